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
    /// With its standard deviations of position and velocity times these; what was not measured stays open.
    #[must_use]
    pub fn with_sigmas_times(mut self, position: f64, velocity: f64) -> Self {
        self.pos_sigma_n *= position;
        if let Some((_, sigma)) = &mut self.velocity {
            let scaled = *sigma * velocity;
            *sigma = if sigma.z >= OPEN_M_S { scaled.truncate().extend(sigma.z) } else { scaled };
        }
        self
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    /// A receiver that is twice as good as it says has still not measured the vertical velocity.
    #[test]
    fn what_was_not_measured_stays_open() {
        let sigma = DVec3::new(0.1, 0.2, OPEN_M_S);
        let fix = GnssFix {
            t_s: 0.0,
            lat: 0.0,
            lon: 0.0,
            h: 0.0,
            pos_sigma_n: DVec3::ONE,
            velocity: Some((DVec3::ZERO, sigma)),
        };
        let halved = fix.with_sigmas_times(0.5, 0.5);
        assert_eq!((fix.components(), halved.components()), (5, 5));
        assert_eq!(halved.pos_sigma_n, DVec3::splat(0.5));
        assert_eq!(halved.velocity.unwrap().1, DVec3::new(0.05, 0.1, OPEN_M_S));
    }
}
