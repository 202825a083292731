//! Units of the border: the factors to SI that headers, keys and flags name. Inside, everything is SI
//! and radians.

/// One degree in radians.
pub const DEG: f64 = std::f64::consts::PI / 180.0;
/// Standard gravity, exact (m/s²).
pub const STANDARD_GRAVITY: f64 = 9.806_65;
/// One degree per hour in rad/s.
pub const DEG_PER_HOUR: f64 = DEG / 3600.0;
