//! The plan: what a study's files were when it was planned, and how its runs are cut into units.

use super::grid::{Cell, Grid};
use super::study::Study;
use super::unit::Kept;
use crate::scenario::Scenario;
use crate::sensors::gnss::GnssSettings;
use serde::{Deserialize, Serialize};

/// A plan. It does not hold the units: they follow from it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Layout version.
    pub schema_version: u32,
    /// Version of nav-sim.
    pub version: String,
    /// Fingerprint of the numbers this build makes ([`super::fingerprint()`]).
    pub numerics: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The study, names and defaults filled in.
    pub study: Study,
    /// Scenario files as read (empty: the default).
    pub scenarios: Vec<Scenario>,
    /// Receivers as read (empty: those of the scenarios).
    pub gnss: Vec<GnssSettings>,
    /// Hash of each trajectory's file.
    pub trajectories: Vec<String>,
    /// Hash of what makes each truth.
    pub truths: Vec<String>,
    /// The model file of each candidate.
    pub models: Vec<Prepared>,
    /// Every file the study reads, with its hash.
    pub inputs: Vec<Prepared>,
    /// Runs of a unit, for each trajectory.
    pub unit_runs: Vec<u64>,
    /// What it will take.
    pub estimate: Estimate,
}

/// A file and its hash.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Prepared {
    /// What for.
    pub role: String,
    /// Path, relative to the study file (or, for models calibrated by the plan, to the plan's directory).
    pub path: String,
    /// BLAKE3 of its bytes, in hexadecimal.
    pub blake3: String,
}

/// What a probe found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Processor time of one run of a cell, for each trajectory (s).
    pub run_s: Vec<f64>,
    /// Threads that were asked for.
    pub threads: usize,
    /// Size of all unit files (bytes).
    pub bytes: f64,
}

/// A unit of work: runs `first..first + runs` of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unit {
    /// Position in the plan.
    pub index: usize,
    /// Position of its cell.
    pub cell: usize,
    /// First run.
    pub first: u64,
    /// Number of runs.
    pub runs: u64,
}

/// What decides the bytes of a cell's units, beside the run range.
#[derive(Serialize)]
struct CellKey<'a> {
    version: &'a str,
    numerics: &'a str,
    kept: Kept,
    trajectory: &'a str,
    truth: &'a str,
    scenario: &'a Scenario,
    columns: Vec<(&'a str, crate::ekf::FilterStates)>,
}

impl Plan {
    /// Version of the layout.
    pub const SCHEMA_VERSION: u32 = 1;

    /// What units keep of the runs.
    #[must_use]
    pub fn kept(&self) -> Kept {
        Kept::of(&self.study)
    }

    /// Units of each cell of a trajectory.
    fn units_per_cell(&self, trajectory: usize) -> usize {
        let runs = self.unit_runs.get(trajectory).copied().unwrap_or(1).max(1);
        usize::try_from(self.study.runs.div_ceil(runs)).unwrap_or(usize::MAX)
    }

    /// All units, in cell and run order.
    pub fn units<'a>(&'a self, grid: &'a Grid) -> impl Iterator<Item = Unit> + 'a {
        let of_cell = move |cell: usize| {
            let trajectory = grid.cell(cell).trajectory;
            let size = self.unit_runs[trajectory].max(1);
            (0..self.units_per_cell(trajectory) as u64).map(move |k| {
                let first = k * size;
                (cell, first, size.min(self.study.runs - first))
            })
        };
        let all = (0..grid.len()).flat_map(of_cell).enumerate();
        all.map(|(index, (cell, first, runs))| Unit { index, cell, first, runs })
    }

    /// Number of units.
    #[must_use]
    pub fn unit_count(&self, grid: &Grid) -> usize {
        let cells = grid.per_trajectory();
        (0..grid.trajectories.len()).map(|t| self.units_per_cell(t).saturating_mul(cells)).sum()
    }

    /// Hash of everything that decides the bytes of a cell's units.
    #[must_use]
    pub fn cell_hash(&self, grid: &Grid, cell: Cell) -> blake3::Hash {
        let scenario = grid.scenario(cell, self.seed);
        let key = CellKey {
            version: &self.version,
            numerics: &self.numerics,
            kept: self.kept(),
            trajectory: &self.trajectories[cell.trajectory],
            truth: &self.truths[cell.truth],
            scenario: &scenario,
            columns: grid
                .columns
                .iter()
                .map(|c| (self.models[c.candidate].blake3.as_str(), grid.filter(cell, c)))
                .collect(),
        };
        let json = serde_json::to_vec(&key).expect("plain structs are always JSON");
        blake3::hash(&json)
    }

    /// The name of a unit: hash of its cell's hash and its run range, 32 hexadecimal digits.
    #[must_use]
    pub fn unit_id(cell_hash: &blake3::Hash, unit: Unit) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(cell_hash.as_bytes());
        hasher.update(&unit.first.to_le_bytes()).update(&unit.runs.to_le_bytes());
        hasher.finalize().to_hex()[..32].to_owned()
    }

    /// All units with their names, in order; each cell is hashed once.
    pub fn named_units<'a>(&'a self, grid: &'a Grid) -> impl Iterator<Item = (Unit, String)> + 'a {
        let mut last: Option<(usize, blake3::Hash)> = None;
        self.units(grid).map(move |unit| {
            let hash = match last {
                Some((cell, hash)) if cell == unit.cell => hash,
                _ => self.cell_hash(grid, grid.cell(unit.cell)),
            };
            last = Some((unit.cell, hash));
            (unit, Self::unit_id(&hash, unit))
        })
    }

    /// The plan's own name: hash of everything but the estimate.
    #[must_use]
    pub fn id(&self) -> String {
        let bare = Self { estimate: Estimate::default(), ..self.clone() };
        let json = serde_json::to_vec(&bare).expect("plain structs are always JSON");
        blake3::hash(&json).to_hex()[..16].to_owned()
    }
}
