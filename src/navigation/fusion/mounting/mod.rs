//! How the IMU sits in a road vehicle, found from the drive itself.
//!
//! The vehicle is taken to move along its x axis, forwards for the most part, without slip and without bank on
//! average. First the specific force is compared with what the change of the GNSS velocity says it is along the track
//! (`track`): gravity gives roll and pitch, accelerations and turns the yaw. Then the filter of the fusion
//! carries the attitude of the IMU through the whole drive, its biases estimated, and the mounting is the mean
//! rotation from it to the track (`refined`).

mod blocks;
mod refined;
mod track;

use super::alignment::AlignmentError;
use super::{FusionError, Recorded, Settings};
use crate::ekf::Belief;
use crate::frames::RollPitchYaw;
use crate::gnss::GnssFix;
use crate::units::DEG;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Largest standard deviation of an angle that is still an answer (rad).
const DETERMINED: f64 = 5.0 * DEG;

/// Where it is known from how the IMU sits in the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mounted {
    /// From the settings.
    #[default]
    AsGiven,
    /// From the drive.
    AsFound,
}

/// A mounting that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Mounting {
    /// Takes the IMU's axes, returns front, right, down.
    pub q_s_b: DQuat,
    /// The same angles beside the axes that the search began with: what a user gives for the next drive.
    pub angles: RollPitchYaw,
    /// Standard deviations about the vehicle's front, right and down axes (rad).
    pub sigma_b: DVec3,
    /// Distance driven with a known course (m).
    pub way_m: f64,
    /// How many times the stated standard deviations of the fixes it was found with.
    pub sigma_factor: f64,
}

impl Mounting {
    /// Roll, pitch and yaw in degrees.
    #[must_use]
    pub fn angles_deg(&self) -> [f64; 3] {
        [self.angles.roll, self.angles.pitch, self.angles.yaw].map(|a| a / DEG)
    }

    /// Standard deviations about front, right and down in degrees.
    #[must_use]
    pub fn sigma_deg(&self) -> [f64; 3] {
        (self.sigma_b / DEG).to_array()
    }
}

/// A drive that does not show the mounting.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MountingError {
    /// Hardly any of it is fast enough to have a course.
    #[error(
        "the mounting is not found: {seconds:.0} s of the drive have a course, {needed:.0} s are needed"
    )]
    TooSlow {
        /// Time with a course (s).
        seconds: f64,
        /// How much is needed (s).
        needed: f64,
    },
    /// It goes as much backwards as forwards.
    #[error("the mounting is not found: {:.0} % of the way goes against the direction of the rest", 100.0 * .share)]
    Directions {
        /// Share of the lesser direction.
        share: f64,
    },
    /// It is no road vehicle.
    #[error(
        "the mounting is not found: the vehicle banks by {bank_deg:.0}° (rms) along its track, as aircraft do"
    )]
    Banks {
        /// Root mean square of the angles about the way (degrees).
        bank_deg: f64,
    },
    /// The angles scatter too much.
    #[error(
        "the mounting is not found: {axis} is known to ±{sigma_deg:.1}°, ±{limit_deg:.0}° is needed"
    )]
    NotDetermined {
        /// `roll`, `pitch` or `yaw`.
        axis: &'static str,
        /// Its standard deviation (degrees).
        sigma_deg: f64,
        /// Largest that is taken (degrees).
        limit_deg: f64,
    },
    /// The fixes contradict the filter that carries the attitude.
    #[error(
        "the mounting is not found: the fixes contradict the filter, NIS {nis_per_component:.1} per component"
    )]
    Contradicted {
        /// Mean NIS of the fixes.
        nis_per_component: f64,
    },
    /// The filter's yaw is not that of the accelerations.
    #[error(
        "the mounting is not found: the filter's yaw is {yaw_deg:.1} ± {sigma_deg:.1}° from that of accelerations"
    )]
    Disagree {
        /// Difference (degrees).
        yaw_deg: f64,
        /// Its standard deviation (degrees).
        sigma_deg: f64,
    },
    /// The filter found no start with what was found so far.
    #[error("the mounting is not found: {0}")]
    Alignment(#[from] AlignmentError),
    /// The filter failed with what was found so far.
    #[error("the mounting is not found: {0}")]
    Fusion(#[from] FusionError),
}

/// Finds the mounting. The rotation of the settings is where the axes' names come from; fixes that are withheld are
/// not looked at.
///
/// # Errors
/// When the drive does not show it.
pub fn find(
    recorded: &Recorded<'_>,
    settings: &Settings,
    belief: &Belief,
) -> Result<Mounting, MountingError> {
    let withheld = |f: &GnssFix| settings.outages.iter().any(|o| o.withholds(f.t_s));
    let gnss: Vec<GnssFix> = recorded
        .gnss
        .iter()
        .filter(|f| !withheld(f))
        .copied()
        .collect();
    let recorded = Recorded {
        gnss: &gnss,
        ..*recorded
    };
    let rough = track::along(&recorded, settings)?;
    let (fine, sigma_factor) = refined(&recorded, settings, belief, &rough)?;
    let named = ["roll", "pitch", "yaw"]
        .into_iter()
        .zip(fine.sigma_b.to_array());
    // NaN is not determined either
    let worst = named
        .into_iter()
        .find(|(_, sigma)| sigma.is_nan() || *sigma > DETERMINED);
    if let Some((axis, sigma)) = worst {
        let (sigma_deg, limit_deg) = (sigma / DEG, DETERMINED / DEG);
        return Err(MountingError::NotDetermined {
            axis,
            sigma_deg,
            limit_deg,
        });
    }
    let angles = RollPitchYaw::from_quat(fine.q_s_b * settings.q_s_b.inverse());
    Ok(Mounting {
        q_s_b: fine.q_s_b,
        angles,
        sigma_b: fine.sigma_b,
        way_m: fine.way_m,
        sigma_factor,
    })
}

/// Most that the standard deviations of fixes are widened by: what contradicts more is not the receiver's word.
const MOST_WIDENED: f64 = 5.0;

/// Refined with standard deviations as stated, or where the fixes contradict those, with what makes their NIS 1.
fn refined(
    recorded: &Recorded<'_>,
    settings: &Settings,
    belief: &Belief,
    rough: &track::Rough,
) -> Result<(refined::Refined, f64), MountingError> {
    let (mut gnss, mut factor) = (recorded.gnss.to_vec(), 1.0);
    loop {
        match refined::through(
            &Recorded {
                gnss: &gnss,
                ..*recorded
            },
            settings,
            belief,
            rough,
        ) {
            Err(MountingError::Contradicted {
                nis_per_component: nis,
            }) if nis > 1.0 && factor * nis.sqrt() <= MOST_WIDENED => {
                factor *= nis.sqrt();
                gnss = recorded
                    .gnss
                    .iter()
                    .map(|fix| fix.with_sigmas_times(factor, factor))
                    .collect();
            }
            found => return Ok((found?, factor)),
        }
    }
}
