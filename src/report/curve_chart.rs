//! Axes, points and bands of charts of wavelet variances.

use nav_sim_document::{Axis, Mark, squared};
use nav_sim_signal::imu::Sensor;

/// The axis of scales.
pub(crate) fn scale_axis() -> Axis {
    Axis::log("scale τ (s)")
}

/// The axis of wavelet variances of a sensor.
pub(crate) fn variance_axis(sensor: &str) -> Axis {
    Axis::log(&format!("wavelet variance ({})", squared(unit(sensor))))
}

/// Unit of a sensor, by its name in files.
pub(crate) fn unit(sensor: &str) -> &'static str {
    Sensor::ALL
        .into_iter()
        .find(|s| s.name() == sensor)
        .map_or("", Sensor::unit)
}

/// A sensor in words.
pub(crate) fn sensor_name(sensor: &str) -> &'static str {
    if sensor == Sensor::Accel.name() {
        "Accelerometer"
    } else {
        "Gyroscope"
    }
}

/// Points of a curve.
pub(crate) fn curve(tau_s: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    tau_s.iter().copied().zip(values.iter().copied()).collect()
}

/// The area between two curves.
pub(crate) fn band(tau_s: &[f64], low: &[f64], high: &[f64]) -> Mark {
    Mark::Band(
        tau_s
            .iter()
            .zip(low)
            .zip(high)
            .map(|((t, a), b)| (*t, *a, *b))
            .collect(),
    )
}
