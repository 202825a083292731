//! GNSS fixes.

use glam::DVec3;
use serde::{Deserialize, Serialize};

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
    /// Velocity with respect to the Earth in NED (m/s) and its standard deviations, when measured; where the vertical one
    /// is not, its deviation is [`OPEN_M_S`].
    pub velocity: Option<(DVec3, DVec3)>,
}

/// Standard deviations of fixes that state none: north, east, down.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FixSigma {
    /// Of the position (m).
    pub pos_m: [f64; 3],
    /// Of the velocity (m/s).
    pub vel_m_s: Option<[f64; 3]>,
}

/// Standard deviation of a vertical velocity that was not measured (m/s): it tells a filter nothing.
pub const OPEN_M_S: f64 = 1000.0;

impl GnssFix {
    /// How many components were measured: what is open adds nothing to the NIS, and counts for nothing in it. They stand
    /// in the order of north, east, down of the position and of the velocity.
    #[must_use]
    pub fn components(&self) -> usize {
        match self.velocity {
            None => 3,
            Some((_, sigma)) if sigma.z >= OPEN_M_S => 5,
            Some(_) => 6,
        }
    }
}
