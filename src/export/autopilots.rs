//! Autopilots: noise of a prediction step, within documented ranges.

use super::layout::{Layout, PLAIN, number, remark};
use super::{Entry, Values};

pub(super) const PX4: Layout = Layout {
    entries: px4,
    line: |entry| {
        format!(
            "param set {} {}  # {}",
            entry.key,
            number(entry.value),
            remark(entry)
        )
    },
    source: "PX4 parameter reference, group EKF2",
    ..PLAIN
};

/// Prediction interval of PX4's EKF2, its parameter `EKF2_PREDICT_US` (s).
const PX4_STEP_S: f64 = 0.01;

/// PX4's EKF2 adds (dt·noise)² to the variance of velocity or angle in a step of dt, and (dt·bias noise)² to that of the
/// bias: N/√dt and K/√dt (<https://docs.px4.io/main/en/advanced_config/parameter_reference.html>, covariance.cpp). The
/// units follow: the bias noise is in units per second.
fn px4(v: &Values) -> Vec<Entry> {
    step_noise(
        v,
        [
            "EKF2_ACC_NOISE",
            "EKF2_GYR_NOISE",
            "EKF2_ACC_B_NOISE",
            "EKF2_GYR_B_NOISE",
        ],
        [[0.01, 1.0], [0.0001, 0.1], [0.0, 0.01], [0.0, 0.01]],
        PX4_STEP_S,
        "EKF2_PREDICT_US = 10000",
    )
}

pub(super) const ARDUPILOT: Layout = Layout {
    entries: ardupilot,
    // Ground stations refuse a line with more than a name and a value.
    line: |entry| format!("# {}\n{},{}", remark(entry), entry.key, number(entry.value)),
    source: "ArduPilot, complete parameter list, EK3_",
    ..PLAIN
};

/// Target interval of ArduPilot's EKF3, `EKF_TARGET_DT` (s).
const ARDUPILOT_STEP_S: f64 = 0.012;

/// ArduPilot's EKF3 adds (dt·noise)² to velocity and angle and (dt²·bias noise)² to biases of increments in a step of dt:
/// N/√dt and K/√dt as in PX4, with dt of 12 ms (<https://ardupilot.org/copter/docs/parameters.html>,
/// AP_NavEKF3_core.cpp).
fn ardupilot(v: &Values) -> Vec<Entry> {
    step_noise(
        v,
        [
            "EK3_ACC_P_NSE",
            "EK3_GYRO_P_NSE",
            "EK3_ABIAS_P_NSE",
            "EK3_GBIAS_P_NSE",
        ],
        [
            [0.01, 1.0],
            [0.0001, 0.1],
            [0.00001, 0.02],
            [0.00001, 0.001],
        ],
        ARDUPILOT_STEP_S,
        "EKF_TARGET_DT = 0.012",
    )
}

fn step_noise(
    v: &Values,
    keys: [&'static str; 4],
    ranges: [[f64; 2]; 4],
    step_s: f64,
    setting: &str,
) -> Vec<Entry> {
    let values =
        [v.accel.density, v.gyro.density, v.accel.walk, v.gyro.walk].map(|x| x / step_s.sqrt());
    let units = ["m/s^2", "rad/s", "m/s^3", "rad/s^2"];
    let names = [
        "N/sqrt(dt), white noise",
        "N/sqrt(dt), white noise",
        "K/sqrt(dt), bias",
        "K/sqrt(dt), bias",
    ];
    (0..4)
        .map(|i| {
            let [low, high] = ranges[i];
            let meaning = format!(
                "{}, dt = {step_s} s ({setting}), range {low} to {high}",
                names[i]
            );
            Entry::new(keys[i], values[i], units[i], meaning).within(low, high)
        })
        .collect()
}
