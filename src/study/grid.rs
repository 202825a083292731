//! The cells of a study: every combination of its axes.

use super::description::Study;
use super::error::DescriptionError;
use super::rules::MAX_CELLS;
use super::sweep::OutageSet;
use crate::report::unexpected_line;
use nav_sim_calibration::Estimator;
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::gnss::GnssSettings;

/// The axes of a study with what stands on them.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Names of the trajectories.
    pub(crate) trajectories: Vec<String>,
    /// Names of the truths.
    pub(crate) truths: Vec<String>,
    /// Scenarios.
    pub(crate) scenarios: Vec<(String, Scenario)>,
    /// Receivers; none: the scenario's.
    pub(crate) gnss: Vec<(String, Option<GnssSettings>)>,
    /// Outage sets; none: the scenario's.
    pub(crate) outages: Vec<(String, Option<OutageSet>)>,
    /// What runs on the noise of each cell.
    pub(crate) columns: Vec<Column>,
}

/// A candidate with a filter variant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Column {
    /// Position of the candidate.
    pub candidate: usize,
    /// Its name.
    pub name: String,
    /// Filter; none: the scenario's.
    pub filter: Option<FilterStates>,
}

/// One experiment of the grid: positions on the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cell {
    /// Position in the grid.
    pub index: usize,
    /// Trajectory.
    pub trajectory: usize,
    /// Truth.
    pub truth: usize,
    /// Scenario.
    pub scenario: usize,
    /// Receiver.
    pub gnss: usize,
    /// Outage set.
    pub outages: usize,
}

impl Grid {
    /// The grid of a study whose scenario and receiver files have been read.
    ///
    /// # Errors
    /// When its outage sets are refused.
    pub(crate) fn new(
        study: &Study,
        scenarios: &[Scenario],
        gnss: &[GnssSettings],
    ) -> Result<Self, DescriptionError> {
        let named = |names: Vec<String>| {
            if names.is_empty() {
                vec!["default".to_owned()]
            } else {
                names
            }
        };
        let scenario_names = named(study.scenario.iter().map(|e| e.name.clone()).collect());
        let or_default = if scenarios.is_empty() {
            vec![Scenario::default()]
        } else {
            scenarios.to_vec()
        };
        let gnss_names = named(study.gnss.iter().map(|e| e.name.clone()).collect());
        let receivers = if gnss.is_empty() {
            vec![None]
        } else {
            gnss.iter().cloned().map(Some).collect()
        };
        let sets = study.outage_sets()?;
        let outages = if sets.is_empty() {
            vec![("default".to_owned(), None)]
        } else {
            sets.into_iter()
                .map(|s| (s.name.clone(), Some(s)))
                .collect()
        };
        let grid = Self {
            trajectories: study.trajectory.iter().map(|e| e.name.clone()).collect(),
            truths: study.truth.iter().map(|e| e.name.clone()).collect(),
            scenarios: scenario_names.into_iter().zip(or_default).collect(),
            gnss: gnss_names.into_iter().zip(receivers).collect(),
            outages,
            columns: columns(study),
        };
        if grid.len() > MAX_CELLS {
            let reason = format!("cells in the grid: more than {MAX_CELLS}");
            return Err(DescriptionError::refused("outages", grid.len(), reason));
        }
        Ok(grid)
    }

    /// Number of cells.
    pub(crate) fn len(&self) -> usize {
        self.per_trajectory()
            .saturating_mul(self.trajectories.len())
    }

    /// Cells of each trajectory.
    pub(crate) fn per_trajectory(&self) -> usize {
        [
            self.truths.len(),
            self.scenarios.len(),
            self.gnss.len(),
            self.outages.len(),
        ]
        .into_iter()
        .fold(1, usize::saturating_mul)
    }

    /// A cell by its position; the last axis (outages) is the fastest.
    pub(crate) fn cell(&self, index: usize) -> Cell {
        let mut rest = index;
        let mut digit = |base: usize| {
            let digit = rest % base;
            rest /= base;
            digit
        };
        let outages = digit(self.outages.len());
        let gnss = digit(self.gnss.len());
        let scenario = digit(self.scenarios.len());
        let truth = digit(self.truths.len());
        Cell {
            index,
            trajectory: rest,
            truth,
            scenario,
            gnss,
            outages,
        }
    }

    /// The names of a cell, in the order trajectory, truth, scenario, gnss, outages.
    pub(crate) fn names(&self, cell: Cell) -> [&str; 5] {
        [
            &self.trajectories[cell.trajectory],
            &self.truths[cell.truth],
            &self.scenarios[cell.scenario].0,
            &self.gnss[cell.gnss].0,
            &self.outages[cell.outages].0,
        ]
    }

    /// The names of a cell on those axes that have more than one, in words.
    pub(crate) fn short_name(&self, cell: Cell) -> String {
        let sizes = [
            self.trajectories.len(),
            self.truths.len(),
            self.scenarios.len(),
            self.gnss.len(),
            self.outages.len(),
        ];
        let names = self
            .names(cell)
            .into_iter()
            .zip(sizes)
            .filter(|(_, n)| *n > 1)
            .map(|(name, _)| name);
        let name = names.collect::<Vec<_>>().join(", ");
        if name.is_empty() {
            self.names(cell)[0].to_owned()
        } else {
            name
        }
    }

    /// The resolved scenario of a cell, without runs.
    pub(crate) fn scenario(&self, cell: Cell, seed: u64) -> Scenario {
        let mut scenario = self.scenarios[cell.scenario].1.clone();
        if let Some(gnss) = &self.gnss[cell.gnss].1 {
            scenario.gnss = gnss.clone();
        }
        if let Some(set) = &self.outages[cell.outages].1 {
            scenario.outage = Some(set.plan.fixed.clone());
            scenario.outage_periodic = set.plan.periodic;
            scenario.outage_random = set.plan.random;
        }
        scenario.run.seed = Some(seed);
        scenario.run.runs = 1;
        scenario
    }

    /// What the true IMU of a scenario has and a filter does not expect ([`Scenario::unexpected`]), each once.
    pub(crate) fn doubts(&self) -> Vec<String> {
        let mut found: Vec<String> = Vec::new();
        for (name, scenario) in &self.scenarios {
            for column in &self.columns {
                let mut variant = scenario.clone();
                variant.filter.states = column.filter.unwrap_or(variant.filter.states);
                let states = variant.filter.states;
                found.extend(variant.unexpected().iter().map(|found| {
                    format!(
                        "scenario {name}, filter {states}: {}",
                        unexpected_line(found)
                    )
                }));
            }
        }
        let mut seen = std::collections::HashSet::new();
        found.retain(|doubt| seen.insert(doubt.clone()));
        found
    }

    /// The filter of a column in a cell.
    pub(crate) fn filter(&self, cell: Cell, column: &Column) -> FilterStates {
        column
            .filter
            .unwrap_or(self.scenarios[cell.scenario].1.filter.states)
    }
}

fn columns(study: &Study) -> Vec<Column> {
    let filters: Vec<Option<FilterStates>> = match study.filters.as_slice() {
        [] => vec![None],
        all => all.iter().copied().map(Some).collect(),
    };
    let candidates = study.candidates().into_iter().enumerate();
    let columns_of = |(candidate, (name, ..)): (usize, (String, usize, Option<Estimator>))| {
        filters
            .iter()
            .map(move |f| Column {
                candidate,
                name: name.clone(),
                filter: *f,
            })
            .collect::<Vec<_>>()
    };
    candidates.flat_map(columns_of).collect()
}
