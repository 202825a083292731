//! The request of a comparison: the arguments of `nav-sim compare`.

use super::{Comparison, compare};
use crate::app::Answered;
use crate::app::Failure;
use nav_sim_navigation::simulation::REPORTED_NAMES;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Runs, and what they are compared with.
#[derive(clap::Args, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CompareRequest {
    /// Run directories
    #[arg(required = true, value_name = "DIR")]
    pub runs: Vec<PathBuf>,
    /// Run directory to compare with
    #[arg(long, value_name = "DIR")]
    pub reference: PathBuf,
    /// States in the table (repeatable), or "all"
    #[arg(long = "state", value_name = "STATE", default_values = ["pos_e_m", "roll_deg"])]
    #[serde(rename = "state")]
    pub states: Vec<String>,
}

impl Default for CompareRequest {
    fn default() -> Self {
        let states = ["pos_e_m", "roll_deg"].map(str::to_owned).to_vec();
        Self {
            runs: Vec::new(),
            reference: PathBuf::new(),
            states,
        }
    }
}

impl CompareRequest {
    /// The ratios.
    pub(crate) fn comparison(&self) -> Result<Comparison, Failure> {
        Ok(compare(&self.runs, &self.reference, states(&self.states)?)?)
    }

    /// As `nav-sim compare` prints it; the ratios are also the table `comparison.csv`.
    ///
    /// # Errors
    /// When a directory cannot be read, or is of something else.
    pub fn answer(&self) -> Result<Answered, Failure> {
        let found = self.comparison()?;
        Ok(Answered {
            files: vec![("comparison.csv".to_owned(), found.csv())],
            ..Answered::of(&found)
        })
    }
}

/// States by their names; `all` of them.
pub(crate) fn states(names: &[String]) -> Result<Vec<usize>, Failure> {
    if names.iter().any(|n| n == "all") {
        return Ok((0..REPORTED_NAMES.len()).collect());
    }
    let index = |name: &String| {
        let found = REPORTED_NAMES.iter().position(|n| n == name);
        let known = || format!("one of {}, or all", REPORTED_NAMES.join(", "));
        found.ok_or_else(|| Failure::input(format!("--state {name} is no state")).hint(known()))
    };
    names.iter().map(index).collect()
}
