//! Gazebo: the noise of an IMU in SDF.

use super::layout::{Layout, PLAIN, number, remark};
use super::{Entry, SensorValues, Values};
use nav_sim_signal::noise::practical::Bias;

pub(super) const GAZEBO: Layout = Layout {
    entries: gazebo,
    bias: Bias::Markov,
    comment: "<!--",
    comment_end: " -->",
    open: "<imu>",
    close: "</imu>",
    blocks: Some(blocks),
    source: "SDF specification, sensor/imu; gz-sensors, GaussianNoiseModel.cc",
    ..PLAIN
};

/// Gazebo: white noise of a sample, a constant bias drawn once, and a bias of each sample b ← b·exp(−dt/τ) + σ_d·w with
/// σ_d² = −s²τ/2·expm1(−2dt/τ): stationary with s²τ/2, so that s = σ√(2/τ) makes a Gauss-Markov process of σ exactly, from
/// zero at the start (<https://github.com/gazebosim/gz-sensors>, `GaussianNoiseModel.cc`).
fn gazebo(v: &Values) -> Vec<Entry> {
    let of_sensor = |s: &SensorValues,
                     keys: [&'static str; 5],
                     unit: &'static str,
                     drive_unit: &'static str| {
        let n = format!("N sqrt(f), white noise of a sample at {} Hz", v.rate_hz);
        // without a bias both are zero, which switches it off
        let (drive, time_s) = match s.markov.sigma > 0.0 {
            true => (
                s.markov.sigma * (2.0 / s.markov.t_corr_s).sqrt(),
                s.markov.t_corr_s,
            ),
            false => (0.0, 0.0),
        };
        let turn_on = match s.turn_on {
            Some(_) => "turn-on bias, standard deviation",
            None => "the model states no turn-on bias",
        };
        [
            Entry::new(keys[0], s.density * v.rate_hz.sqrt(), unit, n),
            Entry::new(keys[1], 0.0, unit, "mean of the turn-on bias"),
            Entry::new(keys[2], s.turn_on.unwrap_or(0.0), unit, turn_on),
            Entry::new(
                keys[3],
                drive,
                drive_unit,
                "sigma sqrt(2/T) of the Gauss-Markov bias, which starts at 0",
            ),
            Entry::new(keys[4], time_s, "s", "its correlation time"),
        ]
    };
    const GYRO: [&str; 5] = [
        "angular_velocity.stddev",
        "angular_velocity.bias_mean",
        "angular_velocity.bias_stddev",
        "angular_velocity.dynamic_bias_stddev",
        "angular_velocity.dynamic_bias_correlation_time",
    ];
    const ACCEL: [&str; 5] = [
        "linear_acceleration.stddev",
        "linear_acceleration.bias_mean",
        "linear_acceleration.bias_stddev",
        "linear_acceleration.dynamic_bias_stddev",
        "linear_acceleration.dynamic_bias_correlation_time",
    ];
    let gyro = of_sensor(&v.gyro, GYRO, "rad/s", "rad/s/sqrt(s)");
    let accel = of_sensor(&v.accel, ACCEL, "m/s^2", "m/s^2/sqrt(s)");
    gyro.into_iter().chain(accel).collect()
}

/// The noise of each axis, explained at the first.
fn blocks(entries: &[Entry]) -> Vec<String> {
    let mut lines = Vec::new();
    for sensor in entries.chunk_by(|a, b| element(a).0 == element(b).0) {
        let name = sensor.first().map_or("", |entry| element(entry).0);
        lines.push(format!("  <{name}>"));
        for axis in ["x", "y", "z"] {
            lines.push(format!("    <{axis}><noise type=\"gaussian\">"));
            lines.push("      <mean>0</mean>".to_owned());
            lines.extend(sensor.iter().map(|entry| {
                let key = element(entry).1;
                let line = format!("      <{key}>{}</{key}>", number(entry.value));
                if axis == "x" {
                    format!("{line}  <!-- {}: {} -->", entry.key, remark(entry))
                } else {
                    line
                }
            }));
            lines.push(format!("    </noise></{axis}>"));
        }
        lines.push(format!("  </{name}>"));
    }
    lines
}

/// Element of the sensor, and of the value in its noise.
fn element(entry: &Entry) -> (&'static str, &'static str) {
    entry.key.split_once('.').unwrap_or(("", entry.key))
}
