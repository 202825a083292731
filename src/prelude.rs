//! The types and functions to calibrate recordings and to navigate with the model: `use nav_sim::prelude::*;`.
//!
//! ```
//! use nav_sim::prelude::*;
//!
//! let white = Composite::new(vec![Process::White(White::new(1e-6)?)]);
//! let (trajectory, _) = load_trajectory("trajectories/figure_eight.toml".as_ref(), &TrajectoryOptions::default())?;
//! let inputs = NavigateInputs::new(trajectory, Model::pooled(100.0, &white, &white), TrueImu::AsBelieved);
//! let mut scenario = Scenario::default();
//! scenario.run.method = Method::Lincov;
//! let outage = Outage { start_s: 60.0, end_s: 90.0 };
//! let found = navigate(&inputs, &scenario, &[outage], 1, &())?;
//! // the filter's model is the truth: nine states, NEES 9
//! assert!((found.summary.nees.mean - 9.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use crate::calibration::Estimator;
pub use crate::formats::trajectory_file::{Options as TrajectoryOptions, load as load_trajectory};
pub use crate::jobs::{
    Calibration, CalibrationOptions, NavigateInputs, Navigation, Note, Remarks, Silence, TrueImu, calibrate,
    navigate,
};
pub use crate::noise::{Composite, Model, Process, White};
pub use crate::observer::Observer;
pub use crate::scenario::{Method, Scenario};
pub use crate::sensors::outage::Outage;
pub use crate::trajectory::Trajectory;
