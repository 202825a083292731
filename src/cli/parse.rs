//! Values of flags.

use nav_sim::imu::MAX_RATE_HZ;

/// A finite number ≥ 0.
pub(super) fn non_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x >= 0.0 => Ok(x),
        _ => Err("not a finite number ≥ 0".into()),
    }
}

/// A sample rate (Hz).
pub(super) fn rate_hz(text: &str) -> Result<f64, String> {
    match positive(text)? {
        x if x <= MAX_RATE_HZ => Ok(x),
        _ => Err(format!("more than {MAX_RATE_HZ} samples a second")),
    }
}

/// A finite number > 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err("not a finite number > 0".into()),
    }
}
