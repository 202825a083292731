//! GNSS fixes.

use glam::DVec3;

/// One position (and velocity) fix with the standard deviations that belong to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssFix {
    /// Time (s).
    pub t_s: f64,
    /// Geodetic latitude of the antenna (rad).
    pub lat: f64,
    /// Longitude (rad).
    pub lon: f64,
    /// Height above the ellipsoid (m).
    pub h: f64,
    /// Position standard deviations north, east, down (m).
    pub pos_sigma_n: DVec3,
    /// Velocity with respect to the Earth in NED (m/s) and its standard deviations, when measured.
    pub velocity: Option<(DVec3, DVec3)>,
}
