//! The plan: what a study's files were when it was planned, and how its runs are cut into units.

use super::description::{Metric, Study};
use super::grid::{Cell, Column, Grid};
use crate::app::Input;
use nav_sim_navigation::lanes::LANES;
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::gnss::GnssSettings;
use serde::{Deserialize, Serialize};

/// Role of models that the plan calibrated.
pub(super) const CALIBRATED: &str = "calibrated";

/// A plan. It does not hold the units: they follow from it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Layout version.
    pub schema_version: u32,
    /// Version of nav-sim.
    pub version: String,
    /// Fingerprint of the numbers this build makes (`fingerprint()`).
    pub numerics: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The study, names and defaults filled in.
    pub(crate) study: Study,
    /// Scenario files as read (empty: the default).
    pub scenarios: Vec<Scenario>,
    /// Receivers as read (empty: those of the scenarios).
    pub gnss: Vec<GnssSettings>,
    /// Hash of each trajectory's file.
    pub trajectories: Vec<String>,
    /// Hash of what makes each truth.
    pub truths: Vec<String>,
    /// The model file of each candidate; of one that leaves out what makes the errors, one a truth.
    pub models: Vec<Vec<Input>>,
    /// Every file the study reads, with its hash.
    pub inputs: Vec<Input>,
    /// Runs of a unit, for each trajectory.
    pub unit_runs: Vec<u64>,
    /// What it will take.
    pub(crate) estimate: Estimate,
}

/// What a probe found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Estimate {
    /// Processor time of one run of a cell, for each trajectory (s).
    pub run_s: Vec<f64>,
    /// Threads that were asked for.
    pub threads: usize,
    /// Size of all unit files (bytes).
    pub bytes: f64,
}

/// What is kept of the sums at epochs; records of runs are always kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Kept {
    /// None.
    Runs,
    /// Those of epochs inside outages.
    OutageEpochs,
    /// All.
    AllEpochs,
}

/// A unit of work: runs `first..first + runs` of a cell; a covariance analysis counts as one run.
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

/// A unit with its name.
pub type NamedUnit = (Unit, String);

/// Units whose position leaves `index` when divided by `count`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    count: u64,
}

impl Shard {
    /// All units.
    pub(crate) const ALL: Self = Self { index: 0, count: 1 };

    /// One of `count`, from 0.
    #[must_use]
    pub const fn new(index: u64, count: u64) -> Option<Self> {
        if index < count {
            Some(Self { index, count })
        } else {
            None
        }
    }

    /// Index and count.
    pub(crate) const fn parts(self) -> (u64, u64) {
        (self.index, self.count)
    }

    /// Whether a unit belongs to it.
    pub(crate) const fn has(self, unit: usize) -> bool {
        unit as u64 % self.count == self.index
    }
}

/// What decides the bytes of a cell's units, beside the run range.
#[derive(Serialize)]
struct CellKey<'a> {
    version: &'a str,
    numerics: &'a str,
    method: Method,
    kept: Kept,
    trajectory: &'a str,
    truth: &'a str,
    scenario: &'a Scenario,
    columns: Vec<(&'a str, nav_sim_navigation::ekf::FilterStates)>,
}

impl Plan {
    /// Version of the layout.
    pub(crate) const SCHEMA_VERSION: u32 = 2;

    /// The model file of a candidate where this truth makes the errors.
    pub(super) fn model(&self, candidate: usize, truth: usize) -> &Input {
        let files = &self.models[candidate];
        files.get(truth).unwrap_or(&files[0])
    }

    /// What units keep of the runs.
    pub(crate) fn kept(&self) -> Kept {
        if self.study.keeps(Metric::Epochs) {
            Kept::AllEpochs
        } else if self.study.keeps(Metric::Ratios) {
            Kept::OutageEpochs
        } else {
            Kept::Runs
        }
    }

    /// Runs of each cell; a covariance analysis counts as one.
    pub(crate) const fn runs(&self) -> u64 {
        self.study.runs_of_cell()
    }

    /// Units of each cell of a trajectory.
    fn units_per_cell(&self, trajectory: usize) -> usize {
        let runs = self.unit_runs.get(trajectory).copied().unwrap_or(1).max(1);
        usize::try_from(self.runs().div_ceil(runs)).unwrap_or(usize::MAX)
    }

    /// All units, in cell and run order.
    pub(crate) fn units<'a>(&'a self, grid: &'a Grid) -> impl Iterator<Item = Unit> + 'a {
        let of_cell = move |cell: usize| {
            let trajectory = grid.cell(cell).trajectory;
            let size = self.unit_runs[trajectory].max(1);
            (0..self.units_per_cell(trajectory) as u64).map(move |k| {
                let first = k * size;
                (cell, first, size.min(self.runs() - first))
            })
        };
        let all = (0..grid.len()).flat_map(of_cell).enumerate();
        all.map(|(index, (cell, first, runs))| Unit {
            index,
            cell,
            first,
            runs,
        })
    }

    /// Number of units.
    #[must_use]
    pub fn unit_count(&self, grid: &Grid) -> usize {
        let cells = grid.per_trajectory();
        (0..grid.trajectories.len())
            .map(|t| self.units_per_cell(t).saturating_mul(cells))
            .sum()
    }

    /// Processor time of a unit by the estimate (s). Runs are computed as many at a time as there are lanes: a unit of
    /// one run lasts as long as one of eight.
    pub(crate) fn unit_s(&self, grid: &Grid, unit: Unit) -> f64 {
        let run_s = self
            .estimate
            .run_s
            .get(grid.cell(unit.cell).trajectory)
            .copied()
            .unwrap_or(0.0);
        run_s * unit.runs.next_multiple_of(self.lanes()) as f64
    }

    /// Runs that are computed together.
    pub(crate) const fn lanes(&self) -> u64 {
        if self.study.is_sampled() {
            LANES as u64
        } else {
            1
        }
    }

    /// Hash of everything that decides the bytes of a cell's units.
    fn cell_hash(&self, grid: &Grid, cell: Cell) -> blake3::Hash {
        let column = |c: &Column| {
            (
                self.model(c.candidate, cell.truth).blake3.as_str(),
                grid.filter(cell, c),
            )
        };
        let key = CellKey {
            version: &self.version,
            numerics: &self.numerics,
            method: self.study.method,
            kept: self.kept(),
            trajectory: &self.trajectories[cell.trajectory],
            truth: &self.truths[cell.truth],
            scenario: &grid.scenario(cell, self.seed),
            columns: grid.columns.iter().map(column).collect(),
        };
        blake3::hash(&json(&key))
    }

    /// All units with their names, in order: 32 hexadecimal digits of the hash of the cell's hash and the run range.
    pub(crate) fn named_units(&self, grid: &Grid) -> Vec<NamedUnit> {
        let units: Vec<Unit> = self.units(grid).collect();
        let of_cell = |units: &[Unit]| {
            let hash = self.cell_hash(grid, grid.cell(units[0].cell));
            let named = |unit: &Unit| {
                let mut hasher = blake3::Hasher::new();
                hasher.update(hash.as_bytes());
                hasher
                    .update(&unit.first.to_le_bytes())
                    .update(&unit.runs.to_le_bytes());
                (*unit, hasher.finalize().to_hex()[..32].to_owned())
            };
            units.iter().map(named).collect::<Vec<_>>()
        };
        units
            .chunk_by(|a, b| a.cell == b.cell)
            .flat_map(of_cell)
            .collect()
    }

    /// The plan's own name: hash of everything but the estimate.
    pub(crate) fn id(&self) -> String {
        let bare = Self {
            estimate: Estimate::default(),
            ..self.clone()
        };
        blake3::hash(&json(&bare)).to_hex()[..16].to_owned()
    }
}

fn json(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("plain structs are always JSON")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    fn plan(change: impl FnOnce(&mut Study)) -> (Plan, Grid) {
        let text = "runs = 250\n\
            trajectory = [{ file = \"a.toml\" }, { file = \"b.toml\" }]\n\
            truth = [{ model = \"m.toml\" }]\n\
            candidate = [{ model = \"m.toml\" }, { model = \"n.toml\" }]\n\
            filters = [15, \"full\"]\n\
            outages = [{ sweep = { start_s = [10, 20, 30], duration_s = [1, 2] } }]\n";
        let mut study: Study = toml::from_str(text).unwrap();
        change(&mut study);
        study.resolve().unwrap();
        let prepared = |blake3: &str| Input {
            role: String::new(),
            path: String::new(),
            blake3: blake3.into(),
        };
        let plan = Plan {
            schema_version: 2,
            version: "0".into(),
            numerics: "n".into(),
            seed: 1,
            study,
            scenarios: Vec::new(),
            gnss: Vec::new(),
            trajectories: vec!["a".into(), "b".into()],
            truths: vec!["t".into()],
            models: vec![vec![prepared("m")], vec![prepared("n")]],
            inputs: Vec::new(),
            unit_runs: vec![100, 8],
            estimate: Estimate::default(),
        };
        let grid = Grid::new(&plan.study, &plan.scenarios, &plan.gnss).unwrap();
        (plan, grid)
    }

    #[test]
    fn shards_share_out_the_units() {
        assert_eq!((Shard::new(3, 3), Shard::new(0, 0)), (None, None));
        for unit in 0..20 {
            assert_eq!(
                (0..3)
                    .filter(|i| Shard::new(*i, 3).unwrap().has(unit))
                    .count(),
                1
            );
        }
    }

    #[test]
    fn units_cover_every_run_of_every_cell_once() {
        let (plan, grid) = plan(|_| {});
        let units = plan.named_units(&grid);
        assert_eq!((grid.len(), grid.columns.len()), (12, 4));
        assert_eq!(
            (units.len(), plan.unit_count(&grid)),
            (6 * 3 + 6 * 32, 6 * 3 + 6 * 32)
        );
        assert!(
            units
                .iter()
                .enumerate()
                .all(|(i, (unit, _))| unit.index == i)
        );
        for cell in 0..grid.len() {
            let mut next = 0;
            for (unit, _) in units.iter().filter(|(u, _)| u.cell == cell) {
                assert_eq!(unit.first, next);
                next += unit.runs;
            }
            assert_eq!(next, 250);
        }
        let cells: HashSet<[String; 5]> = (0..12)
            .map(|i| grid.names(grid.cell(i)).map(str::to_owned))
            .collect();
        assert_eq!(cells.len(), 12);
    }

    /// 250 runs in units of one take 250 batches of eight lanes, in units of 100 two and a rest of 13 + 13 + 7.
    #[test]
    fn a_unit_lasts_as_long_as_its_batches() {
        let (mut plan, grid) = plan(|_| {});
        plan.estimate.run_s = vec![0.5, 0.25];
        let seconds = |plan: &Plan| {
            plan.units(&grid)
                .map(|unit| plan.unit_s(&grid, unit))
                .sum::<f64>()
        };
        assert_eq!(seconds(&plan), 6.0 * (0.5 * 8.0 * 33.0 + 0.25 * 256.0));
        plan.unit_runs = vec![1, 8];
        assert_eq!(seconds(&plan), 6.0 * (0.5 * 8.0 * 250.0 + 0.25 * 256.0));
    }

    #[test]
    fn names_differ_in_everything_that_decides_the_bytes_and_in_nothing_else() {
        let (base, grid) = plan(|_| {});
        let names: HashSet<String> = base
            .named_units(&grid)
            .into_iter()
            .map(|(_, id)| id)
            .collect();
        assert_eq!(names.len(), base.unit_count(&grid));
        let shared = |other: &(Plan, Grid)| {
            other
                .0
                .named_units(&other.1)
                .iter()
                .filter(|u| names.contains(&u.1))
                .count()
        };
        let with = |change: &dyn Fn(&mut Plan)| {
            let mut other = base.clone();
            change(&mut other);
            shared(&(other, grid.clone()))
        };
        assert_eq!(with(&|p| p.seed = 2), 0);
        assert_eq!(with(&|p| p.numerics = "o".into()), 0);
        assert_eq!(with(&|p| p.version = "1".into()), 0);
        assert_eq!(with(&|p| p.truths[0] = "u".into()), 0);
        assert_eq!(with(&|p| p.models[1][0].blake3 = "o".into()), 0);
        assert_eq!(with(&|p| p.study.metrics = vec![Metric::Outages]), 0);
        assert_eq!(with(&|p| p.trajectories[1] = "c".into()), 6 * 3);
        // another candidate's name changes no number, and more runs keep the units there are
        assert_eq!(
            shared(&plan(|s| s.candidate[1].name = "other".into())),
            names.len()
        );
        assert_eq!(shared(&plan(|s| s.runs = 1000)), 6 * 2 + 6 * 31);
    }
}
