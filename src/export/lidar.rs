//! LiDAR-inertial odometry, and the messages that feed it.

use super::layout::{Layout, PLAIN, number, remark, yaml};
use super::{Entry, Values};

pub(super) const LIO_SAM: Layout = Layout {
    entries: lio_sam,
    open: "lio_sam:",
    line: |entry| format!("  {}", yaml(entry)),
    source: "LIO-SAM, config/params.yaml; paste in the place of the same keys",
    ..PLAIN
};

/// LIO-SAM: densities, which it squares for GTSAM, and of the biases takes times the root of the time between two nodes
/// (<https://github.com/TixiaoShan/LIO-SAM>, `imuPreintegration.cpp`).
fn lio_sam(v: &Values) -> Vec<Entry> {
    let rate = format!("continuous-time, IMU at {} Hz", v.rate_hz);
    let (n, k) = (
        format!("white noise N, {rate}"),
        format!("bias random walk K, {rate}"),
    );
    vec![
        Entry::new("imuAccNoise", v.accel.density, "m/s^2/sqrt(Hz)", n.as_str()),
        Entry::new("imuGyrNoise", v.gyro.density, "rad/s/sqrt(Hz)", n.as_str()),
        Entry::new("imuAccBiasN", v.accel.walk, "m/s^3/sqrt(Hz)", k.as_str()),
        Entry::new("imuGyrBiasN", v.gyro.walk, "rad/s^2/sqrt(Hz)", k.as_str()),
    ]
}

pub(super) const FAST_LIO: Layout = Layout {
    entries: fast_lio,
    open: "mapping:",
    line: |entry| format!("    {}", yaml(entry)),
    source: "FAST-LIO2 and FAST-LIVO2, config/*.yaml; paste in the place of the same keys",
    ..PLAIN
};

/// What FAST-LIO ships, tuned to vehicles that vibrate: noise, biases.
const SHIPPED: [f64; 2] = [0.1, 1e-4];

/// FAST-LIO: variances per sample, N²f and K²f: its covariance grows by (dt·f_w) Q (dt·f_w)ᵀ a sample, f times a second
/// (<https://github.com/hku-mars/FAST_LIO>, `esekfom.hpp` and `IMU_Processing.hpp`).
fn fast_lio(v: &Values) -> Vec<Entry> {
    let per_sample = |density: f64| density * density * v.rate_hz;
    let entry = |key, density: f64, unit, symbol: &str, shipped: f64| {
        let value = per_sample(density);
        let times = if value > 0.0 {
            let ratio = nav_sim_document::readable((shipped / value).sqrt());
            format!("; the shipped {shipped:?} is {ratio} times its standard deviation")
        } else {
            String::new()
        };
        Entry::new(
            key,
            value,
            unit,
            format!("{symbol} f, of a sample at {} Hz{times}", v.rate_hz),
        )
    };
    let [noise, bias] = SHIPPED;
    vec![
        entry("acc_cov", v.accel.density, "(m/s^2)^2", "N^2", noise),
        entry("gyr_cov", v.gyro.density, "(rad/s)^2", "N^2", noise),
        entry("b_acc_cov", v.accel.walk, "(m/s^3)^2", "K^2", bias),
        entry("b_gyr_cov", v.gyro.walk, "(rad/s^2)^2", "K^2", bias),
    ]
}

pub(super) const ROS_IMU_COVARIANCE: Layout = Layout {
    entries: ros_imu_covariance,
    line: |entry| {
        let x = number(entry.value);
        format!(
            "{}: [{x}, 0.0, 0.0, 0.0, {x}, 0.0, 0.0, 0.0, {x}]  # {}",
            entry.key,
            remark(entry)
        )
    },
    open: "orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]  # no orientation is measured",
    source: "sensor_msgs/Imu.msg: covariances about x, y, z, row by row",
    ..PLAIN
};

/// The nine numbers of the message: the variance of a sample's white noise, N²f. What moves slowly is no noise of a sample,
/// and the filter that reads the message estimates it as a bias
/// (<https://docs.ros.org/en/api/sensor_msgs/html/msg/Imu.html>).
fn ros_imu_covariance(v: &Values) -> Vec<Entry> {
    let meaning = format!("N^2 f, white noise of a sample at {} Hz", v.rate_hz);
    let variance = |density: f64| density * density * v.rate_hz;
    vec![
        Entry::new(
            "angular_velocity_covariance",
            variance(v.gyro.density),
            "(rad/s)^2",
            meaning.as_str(),
        ),
        Entry::new(
            "linear_acceleration_covariance",
            variance(v.accel.density),
            "(m/s^2)^2",
            meaning,
        ),
    ]
}
