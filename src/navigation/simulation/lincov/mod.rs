//! Linear covariance analysis: what a filter states of its errors, and what they are, without random numbers.
//!
//! A filter's gains do not depend on the random numbers, except for the small effect of linearising about its own
//! estimate. One pass along the reference therefore gives its own covariance, and beside it the covariance
//! of the *true* error under the same gains: that of \[navigation error; the filter's bias estimates\] jointly
//! with the states of whatever makes the inertial errors ([Maybeck](crate::bibliography::Maybeck79), sec. 6.8).
//!
//! The trajectory is reduced once to a [`Track`]: exact maps of the navigation error over steps of a fraction
//! of a second. Any number of beliefs and truths are then assessed along it, in milliseconds each.
//!
//! ```
//! # use nav_sim_navigation::trajectory::profile::{Bank, SegmentKind, Length, Profile, Segment, ProfileStart};
//! use nav_sim_navigation::ekf::{FilterModel, FilterStates};
//! use nav_sim_navigation::scenario::Scenario;
//! use nav_sim_navigation::simulation::lincov::assess;
//! use nav_sim_signal::noise::{Composite, Model, Process};
//!
//! # let start = ProfileStart { t_s: 0.0, lat: 0.9, lon: 0.2, h: 0.0, heading: 0.0, speed: 20.0 };
//! # let north = Segment { kind: SegmentKind::Straight(Length::Duration(60.0)), climb_m: 0.0, ramp_s: None };
//! # let drive = Profile { start, bank: Bank::None, ramp_s: 2.0, segments: vec![north] }.build()?;
//! let axis = Composite::new(vec![Process::white(1e-6)?, Process::random_walk(1e-14)?]);
//! let model = Model::pooled(100.0, &axis, &axis);
//! let scenario = Scenario::default();
//! let track = scenario.track(&drive, &model, &[])?;
//! let belief = FilterModel::new(&model, FilterStates::Full, 1.0, 800.0)?.with_initial(&scenario.initial);
//! let assessment = assess(&track, &belief, &model);
//! // A filter that has the model of the truth states its errors: a NEES of 9 for nine states.
//! assert!(assessment.reports.iter().all(|report| (report.nees - 9.0).abs() < 1e-6));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod joint;
mod pass;
mod reduce;
mod track;
mod truth;
mod tune;

pub use pass::{
    AssessedInstant, Assessment, Consistency, ErrorDistribution, FilterPass, Instant, assess,
    strapdown_over_sigma,
};
pub(crate) use pass::{Moments, errors_in_outages};
pub use reduce::{AxisGrouping, drive, reduced_belief};
pub use track::Track;
pub use truth::{DRIFT, NamedSource, STRAPDOWN, TrueErrors, TruthModel, weak_heading};
pub(crate) use tune::RootSearch;
pub use tune::{
    ConsistencyCriterion, Factor, Filter, FilterConsistency, TuningProblem, WorstRatio,
    aiding_factor, scaled,
};
