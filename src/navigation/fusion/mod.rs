//! Fusion of recorded IMU and GNSS: the filter of the simulation on a user's own data.
//!
//! The IMU's axes are those of its housing; `q_s_b` takes them (s) to the vehicle's front, right, down
//! (b). The filter works in s, so that its noise model stays with the axes it was calibrated on; attitudes
//! go in and come out as those of the vehicle.
//!
//! ```
//! # use nav_sim_navigation::trajectory::profile::{Bank, SegmentKind, Length, Profile, Segment, ProfileStart};
//! use glam::{DQuat, DVec3};
//! use nav_sim_navigation::earth::GravityModel;
//! use nav_sim_navigation::ekf::{FilterModel, FilterStates};
//! use nav_sim_navigation::fusion::{DriveData, FusionSettings, Start, fuse};
//! use nav_sim_navigation::scenario::Scenario;
//! use nav_sim_navigation::sensors::imu::Truth;
//! use nav_sim_navigation::simulation::{Plan, record};
//! use nav_sim_signal::noise::{Composite, Model, Process};
//!
//! # let start = ProfileStart { t_s: 0.0, lat: 0.9, lon: 0.2, h: 0.0, heading: 0.0, speed: 20.0 };
//! # let north = Segment { kind: SegmentKind::Straight(Length::Duration(60.0)), climb_m: 0.0, ramp_s: None };
//! # let drive = Profile { start, bank: Bank::None, ramp_s: 2.0, segments: vec![north] }.build()?;
//! let axis = Composite::new(vec![Process::white(1e-6)?, Process::random_walk(1e-14)?]);
//! let model = Model::pooled(100.0, &axis, &axis);
//! let scenario = Scenario::default();
//! let beliefs = [FilterModel::new(&model, FilterStates::Full, 1.0, 800.0)?.with_initial(&scenario.initial)];
//! let experiment = scenario.experiment(&drive, Truth::Model(&model), &beliefs, &[], 1);
//! let recording = record(&Plan::new(&experiment)?, 0);
//! let recorded = DriveData { imu: &recording.imu, gnss: &recording.gnss, aids: &[] };
//! let sigma = scenario.initial.clone();
//! let start = Start { t_s: 0.0, state: recording.start, sigma, found: None };
//! let settings = FusionSettings {
//!     q_s_b: DQuat::IDENTITY,
//!     mounting_sigma_b: DVec3::ZERO,
//!     lever_arm_b: DVec3::ZERO,
//!     gravity: GravityModel::Wgs84,
//!     outages: vec![],
//!     gate: None,
//!     rows_hz: 1.0,
//!     smooth: false,
//! };
//! let solution = fuse(&recorded, &beliefs[0], &start, &settings, None)?;
//! let end = solution.rows.last().expect("rows");
//! let north_m = (end.state.lat - drive.state(end.t_s).lat) * 6.37e6;
//! // Within four of the standard deviations that the filter states.
//! assert!(north_m.abs() < 4.0 * end.sigma[0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod alignment;
mod antenna_offset;
mod clocks;
mod gate;
pub mod judge;
pub mod mounting;
mod outcome;
mod run;
mod vehicle;
#[cfg(test)]
mod vehicle_tests;
mod white_noise;
mod withheld;

pub use antenna_offset::{
    AntennaOffset, Correlation, WeightedSolution, Whiteness, antenna_offset, fuse_correlated,
    interval_s,
};
pub use clocks::{ClocksApart, clocks_apart, earlier, refine_clock_offset, rough_origin};
pub use gate::GATE_LEVEL;
pub use outcome::{
    EndError, Finding, FixCounts, FromReference, FusionAssessment, FusionError, FusionFigures,
    OutageDrift, OutageEnds, Outliers, SmoothedOutage, SmoothedOutcome, assess, outcome,
};
pub use run::{LONGEST_GAP_S, bridged, fuse};
pub use vehicle::{
    AidInnovations, AidRecord, VehicleVelocity, WheelSpeed, aid_innovations, vehicle_velocities,
    wheel_ratio,
};
pub use white_noise::{ExcessWhiteNoise, own_noise, predicts_as_well};
pub use withheld::{WithheldWindows, withheld};

use crate::earth::GravityModel;
use crate::ekf::InitialSettings;
use crate::frames::NavState;
use crate::gnss::GnssFix;
use crate::imu::ImuIncrement;
use crate::sensors::outage::Outage;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Position (m, north, east, down), velocity (m/s), roll, pitch, yaw (degrees).
type Nine = [f64; 9];

/// Horizontal distance.
fn horizontal(values: &Nine) -> f64 {
    values[0].hypot(values[1])
}

/// Recorded measurements, each in order of time.
#[derive(Debug, Clone, Copy)]
pub struct DriveData<'a> {
    /// Samples whose intervals follow one another.
    pub imu: &'a [ImuIncrement],
    /// Fixes.
    pub gnss: &'a [GnssFix],
    /// Velocity constraints and odometer speeds of the vehicle.
    pub aids: &'a [VehicleVelocity],
}

impl<'a> DriveData<'a> {
    /// The data with other fixes.
    const fn with_gnss(self, gnss: &'a [GnssFix]) -> Self {
        Self { gnss, ..self }
    }

    /// Samples and fixes up to a time (s).
    fn until(self, to_s: f64) -> Self {
        Self {
            imu: &self.imu[..self.imu.partition_point(|s| s.t_s <= to_s)],
            gnss: &self.gnss[..self.gnss.partition_point(|f| f.t_s <= to_s)],
            ..self
        }
    }
}

impl FusionSettings {
    /// For a trial, of which innovations are examined and hardly a row.
    fn trial(&self) -> Self {
        Self {
            rows_hz: 1e-3,
            smooth: false,
            gate: None,
            ..self.clone()
        }
    }

    /// The fixes that are not withheld.
    fn kept(&self, gnss: &[GnssFix]) -> Vec<GnssFix> {
        kept(gnss, &self.outages)
    }
}

/// The fixes that no outage withholds.
fn kept(gnss: &[GnssFix], outages: &[Outage]) -> Vec<GnssFix> {
    let is_kept = |fix: &&GnssFix| !Outage::any_withholds(outages, fix.t_s);
    gnss.iter().filter(is_kept).copied().collect()
}

/// Settings of a fusion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FusionSettings {
    /// The IMU in the vehicle: takes the IMU's axes, returns front, right, down.
    #[serde(rename = "imu_to_vehicle_xyzw")]
    pub q_s_b: DQuat,
    /// Standard deviation of the mounting about the vehicle's front, right and down axes (rad): 0
    /// for an exact one.
    #[serde(rename = "mounting_sigma_rad")]
    pub mounting_sigma_b: DVec3,
    /// Antenna from IMU: front, right, down (m).
    #[serde(rename = "lever_arm_m")]
    pub lever_arm_b: DVec3,
    /// Gravity.
    pub gravity: GravityModel,
    /// When fixes are withheld.
    pub outages: Vec<Outage>,
    /// Probability that the NIS of a right fix is below the gate; none uses every fix.
    pub gate: Option<f64>,
    /// Rows of the solution a second.
    pub rows_hz: f64,
    /// True if a smoother estimates every row from the measurements before and after it.
    pub smooth: bool,
}

/// Initial state of the filter.
#[derive(Debug, Clone)]
pub struct Start {
    /// When (s).
    pub t_s: f64,
    /// Position of the IMU, velocity, attitude of the vehicle.
    pub state: NavState,
    /// Standard deviations of the state.
    pub sigma: InitialSettings,
    /// Method of the alignment; none where the state was given.
    pub found: Option<AlignmentSummary>,
}

/// Heading at the start that is given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Heading {
    /// From north (rad).
    #[serde(rename = "yaw_rad")]
    pub yaw: f64,
    /// Standard deviation (rad).
    #[serde(rename = "sigma_rad")]
    pub sigma: f64,
}

/// Result of [`alignment::coarse`] beside the state.
#[derive(Debug, Clone, Copy)]
pub struct AlignmentSummary {
    /// Source of roll and pitch.
    pub level: Levelling,
    /// Standard deviation of the course as a heading, or of the heading that was given (degrees).
    pub course_sigma_deg: f64,
    /// True if the heading was given.
    pub is_given: bool,
    /// True if the vehicle goes backwards along its course.
    pub is_reversing: bool,
    /// Change of the heading from the course by the fixes of the next minute (degrees), where it
    /// exceeds three standard deviations: wind, slip.
    pub moved_deg: Option<f64>,
}

/// Source of roll and pitch.
#[derive(Debug, Clone, Copy)]
pub enum Levelling {
    /// Gravity at rest until a time (s), carried on by the gyroscopes.
    AtRest(f64),
    /// Specific force and change of the GNSS velocity over so long (s).
    InMotion(f64),
}

/// The state at an instant, and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct SolutionRow {
    /// Time (s).
    pub t_s: f64,
    /// Position of the IMU, velocity, attitude of the vehicle.
    pub state: NavState,
    /// Standard deviations.
    pub sigma: Nine,
    /// Bias estimates in the axes of the IMU: accelerometer (m/s²), gyroscope (rad/s).
    pub bias: [DVec3; 2],
    /// Standard deviations of these.
    pub bias_sigma: [DVec3; 2],
    /// Difference from the reference, where there is one.
    pub error: Option<RowError>,
}

/// Estimate less reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowError {
    /// In each state.
    pub values: Nine,
    /// Standard deviations of these, by the filter and the reference's velocity together.
    pub sigma: Nine,
    /// Standard deviation of the reference's velocity (m/s).
    pub velocity_sigma: f64,
    /// Normalised by the covariance of the nine, of which these are the roots of the diagonal: its mean is 9 if both
    /// are right.
    pub nees: f64,
}

/// A fix as the filter saw it, before using it.
#[derive(Debug, Clone, PartialEq)]
pub struct FixRecord {
    /// Time (s).
    pub t_s: f64,
    /// True if it was used: not in an outage, and not if it is an outlier.
    pub used: bool,
    /// The bound of the NIS, of an outlier that was rejected.
    pub rejected_above: Option<f64>,
    /// Estimated less measured: position (m), velocity (m/s), north, east, down.
    pub innovation: Vec<f64>,
    /// Standard deviations of these, by the filter and the receiver together.
    pub sigma: Vec<f64>,
    /// Normalised innovation squared.
    pub nis: f64,
    /// NIS of the horizontal position alone: chi-square of two degrees if right.
    pub horizontal_nis: f64,
    /// Horizontal standard deviation of the IMU's position just before, by the filter alone (m).
    pub horizontal_sigma_m: f64,
    /// Difference from the reference just before.
    pub error: Option<Nine>,
}

/// Solution of a fusion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Solution {
    /// States at `rows_hz`.
    pub rows: Vec<SolutionRow>,
    /// The smoothed rows, if requested.
    pub smoothed: Option<Vec<SolutionRow>>,
    /// Every fix from start to end of the IMU.
    pub fixes: Vec<FixRecord>,
    /// When the gate was opened after a run of rejections (s).
    pub gate_reopened_s: Vec<f64>,
    /// Every measurement of the vehicle by itself.
    pub aids: Vec<AidRecord>,
    /// Wheel scale (1), mounting pitch and yaw (rad) at the end, and their standard deviations, where they are states.
    pub vehicle: Option<[DVec3; 2]>,
    /// IMU samples used.
    pub samples: usize,
}

/// Checks that IMU and GNSS have time in common.
///
/// # Errors
/// [`FusionError::Clocks`].
pub fn check_clocks(recorded: &DriveData<'_>) -> Result<(), FusionError> {
    let (imu, gnss) = spans(recorded);
    if imu.0 <= gnss.1 && gnss.0 <= imu.1 {
        Ok(())
    } else {
        Err(FusionError::Clocks { imu, gnss })
    }
}

fn spans(recorded: &DriveData<'_>) -> ((f64, f64), (f64, f64)) {
    // microseconds: what clocks and people tell apart
    let rounded = |t: Option<f64>| t.map_or(f64::NAN, |t| (t * 1e6).round() / 1e6);
    let ends = |first: Option<f64>, last: Option<f64>| (rounded(first), rounded(last));
    let (imu, gnss) = (recorded.imu, recorded.gnss);
    (
        ends(
            imu.first().map(|s| s.t_s - s.dt_s),
            imu.last().map(|s| s.t_s),
        ),
        ends(gnss.first().map(|f| f.t_s), gnss.last().map(|f| f.t_s)),
    )
}
