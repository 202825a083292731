//! The names that most programs need: `use nav_sim::prelude::*;`.
//!
//! The figures that filters ask for, from a model:
//! ```
//! use nav_sim::prelude::*;
//!
//! let model = read_model("calib_data/tactical.toml".as_ref())?.model;
//! let gyro_x = model.axis(Channel { sensor: Sensor::Gyro, axis: Axis::X });
//! let figures = AxisParameters::of(&[gyro_x], model.rate_hz, Horizon::default(), Policy::Matched, 1e4)?;
//! println!("N {:.2e} rad/s/sqrt(Hz), K {:.2e} rad/s^2/sqrt(Hz)", figures.walk.density, figures.walk.walk);
//! // The pair has the Allan deviation of the model at 1 s (100 samples), but for quantization noise, which it leaves out.
//! let ratio = figures.walk.allan_variance(100, 100.0) / gyro_x.allan_variance(100);
//! assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use crate::app::{Command, Context, Invocation};
pub use crate::commands::calibrate::{Calibrate, Calibration};
pub use crate::commands::export::Target;
pub use crate::commands::run::{NavigateInputs, Navigation, TrueImu, navigate};
pub use crate::io::model_file::{ModelFile, read as read_model};
pub use crate::io::trajectory_file::load as load_trajectory;
pub use nav_sim_calibration::Estimator;
pub use nav_sim_navigation::scenario::{Method, Scenario};
pub use nav_sim_navigation::sensors::outage::Outage;
pub use nav_sim_navigation::trajectory::Trajectory;
pub use nav_sim_signal::imu::{Axis, Channel, Sensor};
pub use nav_sim_signal::noise::practical::{AxisParameters, Horizon, NoiseDensities, Policy};
pub use nav_sim_signal::noise::{Composite, Model, Process};
