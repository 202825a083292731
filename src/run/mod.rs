//! The main job as one call: a request, what is read for it, the job, the answer and its document.
//!
//! ```
//! use nav_sim::app::Context;
//! use nav_sim::run::{RunRequest, run};
//!
//! let request = RunRequest {
//!     trajectory: "trajectories/figure_eight.toml".into(),
//!     model: "calib_data/tactical.toml".into(),
//!     outages: vec!["60:90".parse()?],
//!     runs: Some(2),
//!     seed: Some(1),
//!     ..RunRequest::default()
//! };
//! let answer = run(&request, &Context::default())?;
//! // Two runs are too few to say that the filter is right.
//! assert_eq!(answer.navigation.summary.verdict.kind.name(), "undecided");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod answer;
mod assumptions;
mod budgets;
mod charts;
mod document;
mod error;
mod failure;
mod navigate;
mod prepared;
pub(crate) mod read;
mod reduction;
mod remedy;
mod request;
pub(crate) mod turn_on;
mod uncertainty;

pub(crate) use answer::RUN_FILES;
pub use answer::RunAnswer;
pub use error::RunError;
pub(crate) use failure::no_filter;
pub use navigate::{NavigateError, NavigateInputs, Navigation, TrueImu, navigate};
pub use prepared::PreparedRun;
pub(crate) use reduction::Reduced;
pub use request::{FilterRequest, OutageFlag, RunRequest};
pub(crate) use request::{checked_scenario, windows_of};

use crate::app::Context;

/// Seed of a run for which neither the request nor the scenario has one, where nobody draws it.
const SEED: u64 = 1;

/// Does what `nav-sim run` does: reads the files, places the outages, navigates, checks the requirements.
///
/// # Errors
/// What is wrong with a file or a setting, or does not fit together; what the method cannot do.
pub fn run(request: &RunRequest, context: &Context<'_>) -> Result<RunAnswer, RunError> {
    request.prepare(|| SEED, context)?.navigate(context)
}
