//! `manifest.json`: where a result directory came from, and whether another command makes the same.

use super::Input;
use crate::io::hash;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Where a result directory came from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Layout version.
    pub schema_version: u32,
    /// The command, such as "run".
    pub name: String,
    /// Version of nav-sim.
    pub version: String,
    /// The command line as given.
    pub command: Vec<String>,
    /// Options that decide the result, without files: their contents are among the inputs.
    pub options: BTreeMap<String, Vec<String>>,
    /// Seed of all random numbers; none where there are none.
    pub seed: Option<u64>,
    /// Every file that is read.
    pub inputs: Vec<Input>,
    /// BLAKE3 of every file that is written beside the page and this file.
    pub outputs: BTreeMap<String, String>,
    /// BLAKE3 of what decides the result: command, options, contents of inputs, numerics.
    pub key: String,
    /// Worker threads.
    pub threads: usize,
    /// Time of the runs (s).
    pub wall_s: f64,
    /// Facts that the command records, such as the resolved configuration of a run.
    #[serde(flatten)]
    pub record: Map<String, Value>,
}

/// Version of the figures: it rises when a golden number moves by more than 1e-9.
const NUMERICS: u32 = 1;

impl Manifest {
    /// Version of the layout.
    pub const SCHEMA_VERSION: u32 = 3;

    /// The manifest of a command before it runs.
    pub fn new(name: &str, options: BTreeMap<String, Vec<String>>, inputs: Vec<Input>) -> Self {
        let mut manifest = Self {
            schema_version: Self::SCHEMA_VERSION,
            name: name.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: Vec::new(),
            options,
            seed: None,
            inputs,
            outputs: BTreeMap::new(),
            key: String::new(),
            threads: 0,
            wall_s: 0.0,
            record: Map::new(),
        };
        let decides = (
            name,
            &manifest.options,
            contents(&manifest.inputs),
            NUMERICS,
        );
        let text = serde_json::to_string(&decides).expect("texts and numbers are always JSON");
        manifest.key = hash::of_bytes(text.as_bytes());
        manifest
    }

    /// The hashes of the inputs of a role, in the order given.
    pub(crate) fn hashes(&self, role: &str) -> Vec<&str> {
        let of_role = self.inputs.iter().filter(|input| input.role == role);
        of_role.map(|input| input.blake3.as_str()).collect()
    }
}

/// Roles and contents of files, without their paths.
fn contents(inputs: &[Input]) -> Vec<(&str, &str)> {
    let content = |input| {
        let Input { role, blake3, .. }: &Input = input;
        (role.as_str(), blake3.as_str())
    };
    inputs.iter().map(content).collect()
}
