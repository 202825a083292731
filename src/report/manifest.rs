//! `manifest.json`: all it takes to know where the directory of a run came from, and to make it again.

use nav_sim_navigation::scenario::Scenario;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where a run directory came from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Layout version.
    pub schema_version: u32,
    /// Version of nav-sim.
    pub version: String,
    /// The command as given.
    pub command: Vec<String>,
    /// Seed of all random numbers; none where there are none.
    pub seed: Option<u64>,
    /// The resolved configuration: every key, outages one by one.
    pub configuration: Scenario,
    /// Whether the truth of each run was drawn from the spread of its model.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub spread: bool,
    /// Every file that was read.
    pub inputs: Vec<Input>,
    /// BLAKE3 of the tables and the summary, by their names. (Directories made before have none.)
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub outputs: BTreeMap<String, String>,
    /// The model the filter believes.
    pub model: ModelNote,
    /// Worker threads.
    pub threads: usize,
    /// Independent windows that the static recordings hold, where they made the errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub independent_windows: Option<f64>,
    /// Time from start to results (s).
    pub wall_s: f64,
    /// IMU epochs a second, all runs together.
    pub throughput_epochs_per_s: f64,
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// What for: "trajectory", "model", "truth", "static", "scenario".
    pub role: String,
    /// Path as given.
    pub path: String,
    /// BLAKE3 of its bytes, in hexadecimal.
    pub blake3: String,
}

/// What the model file says about its making.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelNote {
    /// Estimator, if calibrated ("awv", "sr-awv", "dr-awv", …).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimator: Option<String>,
}

impl Manifest {
    /// Version of the layout.
    pub const SCHEMA_VERSION: u32 = 2;

    /// Whether a run of the one is a run of the other: all that decides the results is the same.
    pub(crate) fn is_same_run(&self, other: &Self) -> bool {
        (&self.version, self.seed, self.spread) == (&other.version, other.seed, other.spread)
            && (&self.configuration, &self.model) == (&other.configuration, &other.model)
            && contents(&self.inputs) == contents(&other.inputs)
    }

    /// Whether another run would be a run of this one, had this one its seed.
    pub(crate) fn differs_in_seed(&self, other: &Self) -> bool {
        let mut seeded = Self {
            seed: other.seed,
            ..self.clone()
        };
        seeded.configuration.run.seed = other.configuration.run.seed;
        self.seed != other.seed && seeded.is_same_run(other)
    }

    /// The hashes of the inputs of a role, in the order given.
    pub(crate) fn hashes(&self, role: &str) -> Vec<&str> {
        self.inputs
            .iter()
            .filter(|i| i.role == role)
            .map(|i| i.blake3.as_str())
            .collect()
    }
}

/// What files hold and what for, wherever they are.
pub(crate) fn contents(inputs: &[Input]) -> Vec<(&str, &str)> {
    inputs
        .iter()
        .map(|i| (i.role.as_str(), i.blake3.as_str()))
        .collect()
}
