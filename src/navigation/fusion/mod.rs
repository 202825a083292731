//! Fusion of recorded IMU and GNSS: the filter of the simulation on a user's own data.
//!
//! The IMU's axes are those of its housing; `q_s_b` takes them (s) to the vehicle's front, right, down
//! (b). The filter works in s, so that its noise model stays with the axes it was calibrated on; attitudes
//! go in and come out as those of the vehicle.
//!
//! ```
//! # use nav_sim_navigation::trajectory::profile::{Bank, Kind, Length, Profile, Segment, Start as ProfileStart};
//! use glam::{DQuat, DVec3};
//! use nav_sim_navigation::earth::GravityModel;
//! use nav_sim_navigation::ekf::{Belief, FilterStates};
//! use nav_sim_navigation::fusion::{Recorded, Settings, Start, fuse};
//! use nav_sim_navigation::scenario::Scenario;
//! use nav_sim_navigation::sensors::imu::Truth;
//! use nav_sim_navigation::simulation::{Plan, record};
//! use nav_sim_signal::noise::{Composite, Model, Process, RandomWalk, White};
//!
//! # let start = ProfileStart { t_s: 0.0, lat: 0.9, lon: 0.2, h: 0.0, heading: 0.0, speed: 20.0 };
//! # let north = Segment { kind: Kind::Straight(Length::Duration(60.0)), climb_m: 0.0, ramp_s: None };
//! # let drive = Profile { start, bank: Bank::None, ramp_s: 2.0, segments: vec![north] }.build()?;
//! let axis = Composite::new(vec![Process::White(White::new(1e-6)?), Process::RandomWalk(RandomWalk::new(1e-14)?)]);
//! let model = Model::pooled(100.0, &axis, &axis);
//! let scenario = Scenario::default();
//! let beliefs = [Belief::new(&model, FilterStates::Full, 1.0, 800.0)?.with_initial(&scenario.initial)];
//! let experiment = scenario.experiment(&drive, Truth::Model(&model), &beliefs, &[], 1);
//! let recording = record(&Plan::new(&experiment)?, 0);
//! let recorded = Recorded { imu: &recording.imu, gnss: &recording.gnss };
//! let sigma = scenario.initial.clone();
//! let start = Start { t_s: 0.0, state: recording.start, sigma, found: None };
//! let settings = Settings {
//!     q_s_b: DQuat::IDENTITY,
//!     mounting_sigma_b: DVec3::ZERO,
//!     lever_arm_b: DVec3::ZERO,
//!     gravity: GravityModel::Wgs84,
//!     outages: vec![],
//!     nis_gate: None,
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
mod assessment;
mod clocks;
mod correlation;
mod displaced;
mod error;
mod filter;
pub mod gap;
pub mod mounting;
mod origin;
mod outcome;
mod smoother;

pub use assessment::{Assessment, Confidence, Finding, assess};
pub use clocks::{ClocksApart, clocks_apart};
pub use correlation::{Correlation, Weighed, Whiteness, fuse_correlated};
pub use displaced::{Displaced, displaced};
pub use error::FusionError;
pub use origin::{earlier, rest_of_origin, rough_origin};
pub use outcome::{
    Drift, Ends, FromReference, OutageDrift, Outcome, SmoothedOutage, SmoothedOutcome, outcome,
};

use crate::earth::{GravityModel, MAX_LATITUDE, geodetic_to_ecef};
use crate::ekf::{Belief, InitialSettings, nis_limit};
use crate::frames::NavState;
use crate::gnss::GnssFix;
use crate::imu::ImuIncrement;
use crate::sensors::outage::Outage;
use crate::trajectory::reference::Reference;
use crate::units::DEG;
use filter::Filter;
use gap::{Bridges, Spread};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use smoother::Tape;

/// Position (m, north, east, down), velocity (m/s), roll, pitch, yaw (degrees).
pub(crate) type Nine = [f64; 9];

/// What was recorded, both in order of time.
#[derive(Debug, Clone, Copy)]
pub struct Recorded<'a> {
    /// Samples whose intervals follow one another.
    pub imu: &'a [ImuIncrement],
    /// Fixes.
    pub gnss: &'a [GnssFix],
}

/// How it is fused.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The IMU in the vehicle: takes the IMU's axes, returns front, right, down.
    #[serde(rename = "imu_to_vehicle_xyzw")]
    pub q_s_b: DQuat,
    /// How well that is known about the vehicle's front, right and down axes (rad): 0 as given.
    #[serde(rename = "mounting_sigma_rad")]
    pub mounting_sigma_b: DVec3,
    /// Antenna from IMU: front, right, down (m).
    #[serde(rename = "lever_arm_m")]
    pub lever_arm_b: DVec3,
    /// Gravity.
    pub gravity: GravityModel,
    /// When fixes are withheld.
    pub outages: Vec<Outage>,
    /// A fix is refused whose NIS is above the chi-square quantile of this probability.
    pub nis_gate: Option<f64>,
    /// Rows of the solution a second.
    pub rows_hz: f64,
    /// Whether every row is estimated a second time, from what was recorded before and after it.
    pub smooth: bool,
}

/// Where the filter starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// When (s).
    pub t_s: f64,
    /// Position of the IMU, velocity, attitude of the vehicle.
    pub state: NavState,
    /// How well they are known.
    pub sigma: InitialSettings,
    /// How they were found; none where they were given.
    pub found: Option<Found>,
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

/// How [`alignment::coarse`] found a start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Where roll and pitch come from.
    pub level: Levelling,
    /// Standard deviation of the course as a heading, or of the heading that was given (degrees).
    pub course_sigma_deg: f64,
    /// Whether the heading was given.
    pub is_given: bool,
    /// Whether the vehicle goes backwards along its course.
    pub is_reversing: bool,
    /// How far the fixes of the next minute move the heading from the course (degrees), where that is more than three
    /// standard deviations: wind, slip.
    pub moved_deg: Option<f64>,
}

/// Source of roll and pitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Levelling {
    /// Gravity at rest until a time (s), carried on by the gyroscopes.
    AtRest(f64),
    /// Specific force and change of the GNSS velocity over so long (s).
    InMotion(f64),
}

/// The state at an instant, and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
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
    /// How well the velocity of the reference is known ([`Reference::velocity_sigma`], m/s).
    pub velocity_sigma: f64,
    /// Normalised by the covariance of the nine, of which these are the roots of the diagonal: its mean is 9 if both
    /// are right.
    pub nees: f64,
}

/// What became of a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Used.
    Used,
    /// In an outage.
    Withheld,
    /// Its NIS was above the gate.
    Rejected,
}

/// A fix as the filter saw it, before using it.
#[derive(Debug, Clone, PartialEq)]
pub struct FixRecord {
    /// Time (s).
    pub t_s: f64,
    /// What became of it.
    pub used: Use,
    /// Estimated less measured: position (m), velocity (m/s), north, east, down.
    pub innovation: Vec<f64>,
    /// Standard deviations of these, by the filter and the receiver together.
    pub sigma: Vec<f64>,
    /// Normalised innovation squared.
    pub nis: f64,
    /// The same of the horizontal position alone: chi-square of two degrees if right.
    pub horizontal_nis: f64,
    /// Horizontal standard deviation of the IMU's position just before, by the filter alone (m).
    pub horizontal_sigma_m: f64,
    /// Difference from the reference just before.
    pub error: Option<Nine>,
}

/// What came out.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Solution {
    /// States at `rows_hz`.
    pub rows: Vec<Row>,
    /// The same rows smoothed, where that was asked for.
    pub smoothed: Option<Vec<Row>>,
    /// Every fix from start to end of the IMU.
    pub fixes: Vec<FixRecord>,
    /// IMU samples used.
    pub samples: usize,
}

/// Checks that IMU and GNSS have time in common.
///
/// # Errors
/// [`FusionError::Clocks`].
pub fn check_clocks(recorded: &Recorded<'_>) -> Result<(), FusionError> {
    let (imu, gnss) = spans(recorded);
    if imu.0 <= gnss.1 && gnss.0 <= imu.1 { Ok(()) } else { Err(FusionError::Clocks { imu, gnss }) }
}

fn spans(recorded: &Recorded<'_>) -> ((f64, f64), (f64, f64)) {
    // microseconds: what clocks and people tell apart
    let rounded = |t: Option<f64>| t.map_or(f64::NAN, |t| (t * 1e6).round() / 1e6);
    let ends = |first: Option<f64>, last: Option<f64>| (rounded(first), rounded(last));
    let (imu, gnss) = (recorded.imu, recorded.gnss);
    (
        ends(imu.first().map(|s| s.t_s - s.dt_s), imu.last().map(|s| s.t_s)),
        ends(gnss.first().map(|f| f.t_s), gnss.last().map(|f| f.t_s)),
    )
}

/// Runs the filter through recorded data from `start`. A fix is applied at its own time: the sample it
/// falls into is split there. A sample much longer than the others bridges a gap ([`gap`]). `reference` is only
/// compared with.
///
/// # Errors
/// Clocks that do not overlap, a start outside the data, a pole, divergence.
pub fn fuse(
    recorded: &Recorded<'_>,
    belief: &Belief,
    start: &Start,
    settings: &Settings,
    reference: Option<&Reference>,
) -> Result<Solution, FusionError> {
    check_clocks(recorded)?;
    let imu = spans(recorded).0;
    if !(imu.0 - 1e-6..imu.1).contains(&start.t_s) {
        return Err(FusionError::Start { t_s: start.t_s, imu });
    }
    check_place(recorded, start, settings)?;
    let mut filter = Filter::new(belief, start, settings);
    let tape = match settings.smooth {
        true => Some(Tape::new(&mut filter, start.t_s, most_marks(recorded, start, settings))?),
        false => None,
    };
    let mut run = Run {
        filter,
        tape,
        settings,
        reference,
        now: start.t_s,
        next_row: start.t_s,
        solution: Solution::default(),
    };
    let mut bridges = Bridges::new(recorded.imu);
    let mut fixes = recorded.gnss.iter().skip_while(|f| f.t_s <= start.t_s).peekable();
    run.row()?;
    for sample in recorded.imu.iter().skip_while(|s| s.t_s <= start.t_s) {
        let spread = bridges.spread(sample);
        // a fix that is a millionth of a sample late belongs to its end
        let slack = 1e-6 * sample.dt_s;
        while let Some(fix) = fixes.next_if(|f| f.t_s <= sample.t_s + slack) {
            run.advance(sample, spread, fix.t_s, slack);
            run.fix(fix)?;
        }
        run.advance(sample, spread, sample.t_s, 0.0);
        run.solution.samples += 1;
        if sample.t_s + slack >= run.next_row {
            run.row()?;
        }
    }
    Ok(run.end())
}

/// Rows and fixes that there will be at most.
fn most_marks(recorded: &Recorded<'_>, start: &Start, settings: &Settings) -> f64 {
    let samples = recorded.imu.iter().filter(|s| s.t_s > start.t_s).count() as f64;
    let rows = (spans(recorded).0.1 - start.t_s) * settings.rows_hz;
    1.0 + rows.min(samples).ceil() + recorded.gnss.len() as f64
}

/// Refuses a start that its own and the receiver's deviations cannot explain: 10 km or 50 of both, beside
/// the way to the first fix.
fn check_place(recorded: &Recorded<'_>, start: &Start, settings: &Settings) -> Result<(), FusionError> {
    const FAR: (f64, f64) = (10_000.0, 50.0);
    let Some(fix) = recorded.gnss.iter().find(|f| f.t_s >= start.t_s) else { return Ok(()) };
    let seconds = fix.t_s - start.t_s;
    let place = geodetic_to_ecef(start.state.lat, start.state.lon, fix.h);
    let metres = geodetic_to_ecef(fix.lat, fix.lon, fix.h).distance(place);
    let [n, e, _] = start.sigma.pos_sigma_m;
    let sigma_m = n.hypot(e).hypot(fix.pos_sigma_n.truncate().length());
    // at twice the speed, accelerating with a gravity
    let way = 2.0 * start.state.v_n.length() * seconds + 5.0 * seconds * seconds;
    let allowed = FAR.0.min(FAR.1 * sigma_m) + way + settings.lever_arm_b.length();
    if metres > allowed { Err(FusionError::Place { t_s: fix.t_s, metres, sigma_m }) } else { Ok(()) }
}

/// The state of a run through the data.
struct Run<'a> {
    filter: Filter,
    tape: Option<Tape>,
    settings: &'a Settings,
    reference: Option<&'a Reference>,
    now: f64,
    next_row: f64,
    solution: Solution,
}

impl Run<'_> {
    /// Through the sample as far as `to`, which is taken as the sample's end when it is nearly that.
    /// Where it bridges a gap, with the gap's uncertainty.
    fn advance(&mut self, sample: &ImuIncrement, spread: Option<Spread>, to: f64, slack: f64) {
        let to = if to + slack >= sample.t_s { sample.t_s } else { to };
        if to > self.now + slack {
            match spread {
                None => self.filter.advance(sample, to - self.now),
                Some(spread) => self.filter.cross(sample, to - self.now, spread),
            }
            self.now = to;
        }
    }

    fn fix(&mut self, fix: &GnssFix) -> Result<(), FusionError> {
        let mut record = self.filter.look_at(fix);
        record.error = self.error().map(|e| e.values);
        let withheld = self.settings.outages.iter().any(|o| o.withholds(fix.t_s));
        let limit = self.settings.nis_gate.map(|p| nis_limit(p, record.innovation.len()));
        record.used = match limit {
            _ if withheld => Use::Withheld,
            Some(limit) if record.nis > limit => Use::Rejected,
            _ => Use::Used,
        };
        match &mut self.tape {
            _ if record.used != Use::Used => {}
            Some(tape) => tape.fix(&mut self.filter, self.now, |filter| filter.update(fix)),
            None => self.filter.update(fix),
        }
        let finite = record.nis.is_finite();
        self.solution.fixes.push(record);
        if finite { Ok(()) } else { Err(FusionError::Diverged { t_s: self.now }) }
    }

    fn row(&mut self) -> Result<(), FusionError> {
        self.next_row = (self.next_row + 1.0 / self.settings.rows_hz).max(self.now);
        let mut row = self.filter.row(self.now);
        if !(row.sigma.iter().all(|s| s.is_finite()) && row.state.q_b_n.is_finite()) {
            return Err(FusionError::Diverged { t_s: self.now });
        }
        if row.state.lat.abs() > MAX_LATITUDE {
            return Err(FusionError::Pole { t_s: self.now, lat_deg: row.state.lat / DEG });
        }
        row.error = self.error();
        self.solution.rows.push(row);
        if let Some(tape) = &mut self.tape {
            tape.row(&mut self.filter, self.now);
        }
        Ok(())
    }

    /// What came out; smoothed where a tape ran along.
    fn end(self) -> Solution {
        let Self { mut filter, tape, mut solution, reference, .. } = self;
        solution.smoothed = tape.map(|tape| tape.smoothed(&mut filter, &solution.rows, reference));
        solution
    }

    /// Difference from the reference now, if it reaches here.
    fn error(&mut self) -> Option<RowError> {
        self.filter.error_from(self.reference?, self.now)
    }
}
