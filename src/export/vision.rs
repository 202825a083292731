//! Visual-inertial programs: white noise and random walk, per sensor.

use super::layout::{Layout, PLAIN, number, remark, yaml};
use super::{Entry, Values};

pub(super) const KALIBR: Layout = Layout {
    entries: kalibr,
    open: "rostopic: /imu0  # the topic of your recording",
    source: "Kalibr wiki, \"IMU Noise Model\" and \"YAML formats\"",
    ..PLAIN
};

/// Kalibr's imu.yaml: continuous-time densities, which it makes discrete by `update_rate`
/// (<https://github.com/ethz-asl/kalibr/wiki/IMU-Noise-Model>).
fn kalibr(v: &Values) -> Vec<Entry> {
    let rate = format!("continuous-time, IMU at {} Hz", v.rate_hz);
    let (n, k) = (
        format!("white noise N, {rate}"),
        format!("bias random walk K, {rate}"),
    );
    vec![
        Entry::new(
            "accelerometer_noise_density",
            v.accel.density,
            "m/s^2/sqrt(Hz)",
            n.as_str(),
        ),
        Entry::new(
            "accelerometer_random_walk",
            v.accel.walk,
            "m/s^3/sqrt(Hz)",
            k.as_str(),
        ),
        Entry::new(
            "gyroscope_noise_density",
            v.gyro.density,
            "rad/s/sqrt(Hz)",
            n.as_str(),
        ),
        Entry::new(
            "gyroscope_random_walk",
            v.gyro.walk,
            "rad/s^2/sqrt(Hz)",
            k.as_str(),
        ),
        Entry::new("update_rate", v.rate_hz, "Hz", "rate of the IMU"),
    ]
}

/// `OpenVINS` reads the keys of Kalibr below `imu0` and divides by the time step itself
/// (<https://docs.openvins.com/gs-calibration.html>).
pub(super) const OPENVINS: Layout = Layout {
    entries: kalibr,
    first: Some("%YAML:1.0"),
    open: "imu0:\n  rostopic: /imu0  # the topic of your recording",
    line: |entry| format!("  {}", yaml(entry)),
    source: "OpenVINS, kalibr_imu_chain.yaml; keep T_i_b, time_offset and the model of your own file",
    ..PLAIN
};

pub(super) const VINS: Layout = Layout {
    entries: vins,
    source: "VINS-Mono and VINS-Fusion, config/*.yaml; paste in the place of the same keys",
    ..PLAIN
};

/// VINS-Mono and VINS-Fusion: standard deviations of a sample, N√(2f), and of the bias's slope over one sample interval, K√f:
/// the integration multiplies both by dt (<https://github.com/HKUST-Aerial-Robotics/VINS-Mono>,
/// `vins_estimator/src/factor/integration_base.h`). Its midpoint rule gives each end of an interval half the weight and
/// takes the ends as independent from interval to interval: a velocity grows by f·2·(dt/2)²·acc_n² a second, half of what
/// noise of that deviation in every sample makes. Hence the 2.
fn vins(v: &Values) -> Vec<Entry> {
    let root = v.rate_hz.sqrt();
    let midpoint = (2.0 * v.rate_hz).sqrt();
    let per = |what: &str| format!("{what}, at {} Hz", v.rate_hz);
    let noise = per("N sqrt(2f), noise of a sample in the midpoint rule");
    vec![
        Entry::new("acc_n", v.accel.density * midpoint, "m/s^2", noise.clone()),
        Entry::new("gyr_n", v.gyro.density * midpoint, "rad/s", noise),
        Entry::new(
            "acc_w",
            v.accel.walk * root,
            "m/s^3",
            per("K sqrt(f), bias random walk of a sample"),
        ),
        Entry::new(
            "gyr_w",
            v.gyro.walk * root,
            "rad/s^2",
            per("K sqrt(f), bias random walk of a sample"),
        ),
    ]
}

pub(super) const GTSAM: Layout = Layout {
    entries: gtsam,
    comment: "//",
    open: "auto params = gtsam::PreintegrationCombinedParams::MakeSharedU(9.80665);  // m/s^2; gravity, z up",
    line: |entry| {
        format!(
            "params->{}({} * gtsam::I_3x3);  // {}",
            entry.key,
            number(entry.value),
            remark(entry)
        )
    },
    source: "GTSAM, PreintegrationParams.h and PreintegrationCombinedParams.h; setIntegrationCovariance is not a matter of the IMU",
    ..PLAIN
};

/// GTSAM: covariances of continuous-time noise, the squares of N and K
/// (<https://docs.ros.org/en/api/gtsam/html/structgtsam_1_1PreintegrationCombinedParams.html>).
fn gtsam(v: &Values) -> Vec<Entry> {
    let square = |x: f64| x * x;
    let rate = format!("continuous-time, IMU at {} Hz", v.rate_hz);
    let (n, k) = (format!("N^2, {rate}"), format!("K^2, {rate}"));
    vec![
        Entry::new(
            "setAccelerometerCovariance",
            square(v.accel.density),
            "(m/s^2)^2/Hz",
            n.as_str(),
        ),
        Entry::new(
            "setGyroscopeCovariance",
            square(v.gyro.density),
            "(rad/s)^2/Hz",
            n.as_str(),
        ),
        Entry::new(
            "setBiasAccCovariance",
            square(v.accel.walk),
            "(m/s^3)^2/Hz",
            k.as_str(),
        ),
        Entry::new(
            "setBiasOmegaCovariance",
            square(v.gyro.walk),
            "(rad/s^2)^2/Hz",
            k.as_str(),
        ),
    ]
}
