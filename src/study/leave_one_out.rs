//! The ranking of candidates that are calibrated without the recordings that make the errors.

use super::cell_tables::CellTables;
use super::grid::{Cell, Grid};
use super::planned::Planned;
use crate::choose::{ChoiceReport, Contender, Fold, RankedPlace, Ranking, Score};
use nav_sim_navigation::sensors::outage::Outage;

/// What the recordings say, where all but the recording is the same.
struct Place {
    /// Any of its cells.
    cell: Cell,
    outages: Vec<Outage>,
    folds: Vec<(String, Fold)>,
}

/// Scores of the cells as they come in.
#[derive(Default)]
pub(super) struct Folds {
    places: Vec<Place>,
}

/// Whether two cells differ in what makes the errors alone.
fn same_place(a: Cell, b: Cell) -> bool {
    let but_truth = |c: Cell| (c.trajectory, c.scenario, c.gnss, c.outages);
    but_truth(a) == but_truth(b)
}

impl Folds {
    /// Adds a cell; one without outages says nothing.
    pub(super) fn add(&mut self, planned: &Planned, tables: &CellTables) {
        if !planned.plan.study.leaves_out() || tables.windows.is_empty() {
            return;
        }
        let scores: Vec<Score> = tables
            .runs_of_columns
            .iter()
            .map(|runs| Score::of_runs(runs, tables.windows.len()))
            .collect();
        let fold = Fold {
            scores,
            expected: None,
            windows: planned.plan.runs(),
        };
        let truth = planned.grid.truths[tables.cell.truth].clone();
        let known = self
            .places
            .iter()
            .position(|place| same_place(place.cell, tables.cell));
        let place = known.unwrap_or_else(|| {
            let outages = tables
                .windows
                .iter()
                .map(|&(start_s, end_s)| Outage { start_s, end_s })
                .collect();
            self.places.push(Place {
                cell: tables.cell,
                outages,
                folds: Vec::new(),
            });
            self.places.len() - 1
        });
        self.places[place].folds.push((truth, fold));
    }

    /// The ranking of each place.
    pub(super) fn ranked(&self, planned: &Planned) -> Vec<RankedPlace> {
        let grid = &planned.grid;
        self.places
            .iter()
            .map(|place| ranked(grid, place, planned.plan.seed))
            .collect()
    }
}

fn ranked(grid: &Grid, place: &Place, seed: u64) -> RankedPlace {
    let contender = |column| {
        let filter = grid.filter(place.cell, column).name();
        Contender {
            name: format!("{}, {filter}", column.name),
            eligible: true,
        }
    };
    let contenders: Vec<Contender> = grid.columns.iter().map(contender).collect();
    let ranking = Ranking::new(&contenders, &place.folds);
    let [trajectory, _, scenario, gnss, outages] = grid.names(place.cell);
    let report = ChoiceReport {
        ranking: &ranking,
        abnormal: &[],
        outages: &place.outages,
        trajectory,
        seed,
    };
    report.of_place([trajectory, scenario, gnss, outages].join(", "))
}
