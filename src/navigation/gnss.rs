//! GNSS fixes.

use glam::{DVec2, DVec3};
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
    /// Velocity of the antenna, when measured.
    pub velocity: Option<GnssVelocity>,
}

/// A measured velocity with respect to the Earth, in NED.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssVelocity {
    /// North, east (m/s).
    pub horizontal: DVec2,
    /// Standard deviations of these (m/s).
    pub horizontal_sigma: DVec2,
    /// Down and its standard deviation (m/s), where measured: NMEA sentences have none.
    pub down: Option<(f64, f64)>,
}

/// Standard deviation (m/s) with which a filter of three components is told a vertical velocity of 0 that was not measured:
/// nothing.
const OPEN_M_S: f64 = 1000.0;

impl GnssVelocity {
    /// With all three components measured: velocity and standard deviations (m/s).
    pub fn new(v_n: DVec3, sigma_n: DVec3) -> Self {
        Self {
            horizontal: v_n.truncate(),
            horizontal_sigma: sigma_n.truncate(),
            down: Some((v_n.z, sigma_n.z)),
        }
    }

    /// North, east, down (m/s), for who takes three components: where the last is not measured it is 0, and its
    /// standard deviation too large to tell anything.
    pub fn v_n(&self) -> DVec3 {
        self.horizontal.extend(self.down.map_or(0.0, |(v, _)| v))
    }

    /// Standard deviations of [`Self::v_n`] (m/s).
    pub fn sigma_n(&self) -> DVec3 {
        self.horizontal_sigma
            .extend(self.down.map_or(OPEN_M_S, |(_, sigma)| sigma))
    }
}

/// Standard deviations of fixes that state none: north, east, down.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct FixSigma {
    /// Standard deviations of the position (m).
    pub pos_m: [f64; 3],
    /// Standard deviations of the velocity (m/s).
    pub vel_m_s: Option<[f64; 3]>,
}

impl GnssFix {
    /// Latitude, longitude (rad) and height (m).
    pub const fn place(&self) -> [f64; 3] {
        [self.lat, self.lon, self.h]
    }

    /// With its standard deviations of position and velocity times these; what was not measured stays open.
    pub fn with_sigmas_times(mut self, position: f64, velocity: f64) -> Self {
        self.pos_sigma_n *= position;
        if let Some(measured) = &mut self.velocity {
            measured.horizontal_sigma *= velocity;
            measured.down = measured.down.map(|(v, sigma)| (v, sigma * velocity));
        }
        self
    }

    /// Number of measured components, in the order north, east, down of the position and of the
    /// velocity. A component that was not measured does not count in the NIS.
    pub fn components(&self) -> usize {
        self.sigmas().count()
    }

    /// Standard deviations of the components (m, m/s).
    pub fn sigmas(&self) -> impl Iterator<Item = f64> {
        let horizontal = self.velocity.map(|v| v.horizontal_sigma.to_array());
        let down = self.velocity.and_then(|v| v.down).map(|(_, sigma)| sigma);
        let velocity = horizontal.into_iter().flatten().chain(down);
        self.pos_sigma_n.to_array().into_iter().chain(velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A receiver that is twice as good as it says has still not measured the vertical velocity; one that measures it
    /// badly has.
    #[test]
    fn what_was_not_measured_stays_open() {
        let fix = |down| GnssFix {
            t_s: 0.0,
            lat: 0.0,
            lon: 0.0,
            h: 0.0,
            pos_sigma_n: DVec3::ONE,
            velocity: Some(GnssVelocity {
                horizontal: DVec2::ZERO,
                horizontal_sigma: DVec2::new(0.1, 0.2),
                down,
            }),
        };
        let halved = fix(None).with_sigmas_times(0.5, 0.5);
        assert_eq!((fix(None).components(), halved.components()), (5, 5));
        assert_eq!(halved.pos_sigma_n, DVec3::splat(0.5));
        let velocity = halved.velocity.unwrap();
        assert_eq!(
            (velocity.horizontal_sigma, velocity.down),
            (DVec2::new(0.05, 0.1), None)
        );
        let bad = fix(Some((3.0, 1500.0))).with_sigmas_times(0.5, 0.5);
        assert_eq!(
            (bad.components(), bad.velocity.unwrap().sigma_n().z),
            (6, 750.0)
        );
    }
}
