//! What a vehicle knows of its own motion: the non-holonomic constraint, a wheel, standstill, a heading.
//!
//! Each is believed by the filter as white noise, and its lasting errors as states where a deviation of theirs is
//! given. What is truly wrong with it stands apart in a table `truth`, so that a filter that leaves it out is seen.
//!
//! The vehicle's axes are forward, right, down, those of the reference. Models of the errors:
//! [Groves](crate::bibliography::Groves13), sec. 15.3 (constraints) and 16.3 (odometers).

mod errors;
mod settings;

pub(crate) use errors::{AidError, AidNoise, AidPart, Law};
pub use settings::{
    HeadingErrors, HeadingSettings, HeadingSource, NhcErrors, NhcSettings, OdometerErrors,
    OdometerSettings, ZuptErrors, ZuptSettings,
};

use crate::units::{DEG, SettingError};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[aiding]`: measurements of the vehicle by itself, which outages do not concern but for a heading of two antennas.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AidingSettings {
    /// Non-holonomic constraint: a road vehicle moves neither sideways nor up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nhc: Option<NhcSettings>,
    /// Forward speed of a wheel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odometer: Option<OdometerSettings>,
    /// Zero velocity where the reference stands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zupt: Option<ZuptSettings>,
    /// Heading of a compass or of two antennas.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading: Option<HeadingSettings>,
}

impl AidingSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key whose value is refused, with its table within `aiding`.
    pub fn validate(&self) -> Result<(), SettingError> {
        let all = [
            self.nhc.as_ref().map(NhcSettings::validate),
            self.odometer.as_ref().map(OdometerSettings::validate),
            self.zupt.as_ref().map(ZuptSettings::validate),
            self.heading.as_ref().map(HeadingSettings::validate),
        ];
        for (aid, checked) in Aid::ALL.into_iter().zip(all) {
            checked.transpose().map_err(|e| e.in_section(aid.name()))?;
        }
        Ok(())
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.rates().next().is_none()
    }

    /// Those that are there, and their rates (Hz).
    pub fn rates(&self) -> impl Iterator<Item = (Aid, f64)> {
        let rates = [
            self.nhc.as_ref().map(|s| s.rate_hz),
            self.odometer.as_ref().map(|s| s.rate_hz),
            self.zupt.as_ref().map(|s| s.rate_hz),
            self.heading.as_ref().map(|s| s.rate_hz),
        ];
        Aid::ALL
            .into_iter()
            .zip(rates)
            .filter_map(|(aid, rate)| rate.map(|rate| (aid, rate)))
    }

    /// Whether an aid is part of the receiver: it measures nothing in outages.
    pub(crate) fn is_of_gnss(&self, aid: Aid) -> bool {
        let heading = self.heading.as_ref().filter(|_| aid == Aid::Heading);
        heading.is_some_and(|heading| heading.source == HeadingSource::Antennas)
    }

    /// The point of which an aid measures the velocity, with respect to the IMU, in b (m).
    pub(crate) fn lever_arm_b(&self, aid: Aid) -> DVec3 {
        let arm = match aid {
            Aid::Nhc => self.nhc.as_ref().map(|s| s.lever_arm_m),
            Aid::Odometer => self.odometer.as_ref().map(|s| s.lever_arm_m),
            Aid::Zupt | Aid::Heading => None,
        };
        arm.map_or(DVec3::ZERO, DVec3::from)
    }

    /// Standard deviations of one measurement's white noise, as the filter believes and in truth (m/s or rad).
    #[must_use]
    pub fn sigmas(&self, aid: Aid) -> [f64; 2] {
        let (sigma, noise) = match aid {
            Aid::Nhc => self
                .nhc
                .as_ref()
                .map(|s| (s.sigma_m_s, s.truth.noise_sigma_m_s)),
            Aid::Odometer => self
                .odometer
                .as_ref()
                .map(|s| (s.sigma_m_s, s.truth.noise_sigma_m_s)),
            Aid::Zupt => self
                .zupt
                .as_ref()
                .map(|s| (s.sigma_m_s, s.truth.noise_sigma_m_s)),
            Aid::Heading => {
                let radians = |s: &HeadingSettings| {
                    (s.sigma_deg * DEG, s.truth.noise_sigma_deg.map(|n| n * DEG))
                };
                self.heading.as_ref().map(radians)
            }
        }
        .unwrap_or_default();
        [sigma, noise.unwrap_or(sigma)]
    }

    /// Standard deviations of what a filter may have as states: scale of the wheel (1), pitch and yaw of the vehicle's
    /// axes (rad); 0 where it has none.
    #[must_use]
    pub fn state_sigmas(&self) -> DVec3 {
        let scale = self.odometer.as_ref().map_or(0.0, |s| s.scale_sigma);
        let mounting = self
            .nhc
            .as_ref()
            .map_or(0.0, |s| s.mounting_sigma_deg * DEG);
        DVec3::new(scale, mounting, mounting)
    }

    /// A car: the constraint at the rear axle with states of its mounting, and what is truly wrong with it: 0.5° of
    /// mounting, sideslip of 0.003 rad s²/m, 0.05 m/s of the suspension over a second.
    #[must_use]
    pub fn car() -> Self {
        let truth = NhcErrors {
            noise_sigma_m_s: Some(0.02),
            mounting_sigma_deg: 0.5,
            sideslip_s2_m: 0.003,
            walk_sigma_m_s: 0.05,
            correlation_time_s: 1.0,
        };
        let nhc = NhcSettings {
            mounting_sigma_deg: 0.5,
            truth,
            ..NhcSettings::default()
        };
        Self {
            nhc: Some(nhc),
            ..Self::default()
        }
    }

    /// The same with a wheel whose scale is off by one per cent, of which the filter has a state.
    #[must_use]
    pub fn car_with_odometer() -> Self {
        let truth = OdometerErrors {
            scale_sigma: 0.01,
            noise_sigma_m_s: None,
            slip_s2_m: 0.002,
        };
        let odometer = OdometerSettings {
            sigma_m_s: 0.1,
            scale_sigma: 0.01,
            truth,
            ..OdometerSettings::default()
        };
        Self {
            odometer: Some(odometer),
            ..Self::car()
        }
    }
}

/// A kind of aiding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aid {
    /// Non-holonomic constraint.
    Nhc,
    /// Speed of a wheel.
    Odometer,
    /// Zero velocity.
    Zupt,
    /// Yaw.
    Heading,
}

impl Aid {
    /// All, in the order of their use at one instant.
    pub(crate) const ALL: [Self; 4] = [Self::Nhc, Self::Odometer, Self::Zupt, Self::Heading];

    /// As its table is called.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["nhc", "odometer", "zupt", "heading"][self as usize]
    }

    /// The axes of the vehicle along which it measures the velocity; none of a heading.
    pub(crate) const fn axes(self) -> &'static [usize] {
        match self {
            Self::Nhc => &[1, 2],
            Self::Odometer => &[0],
            Self::Zupt => &[0, 1, 2],
            Self::Heading => &[],
        }
    }
}
