//! The units of a cell, added up and as rows of tables.

use super::description::{Metric, Study};
use super::error::DescriptionError;
use super::failure::StudyError;
use super::grid::{Cell, Column};
use super::plan::{Kept, Unit};
use super::planned::Planned;
use super::sums::CellSums;
use super::unit::{Finding, UnitResult};
use super::unit_file::{self, UnitFileError};
use crate::report::{self, ColumnResult, Label, ShownCell, ShownColumn, TableRow};
use nav_sim_navigation::metrics::{self, EpochMetrics, Measured, OutageComparison};
use nav_sim_navigation::simulation::RunRecord;

/// What a cell contributes.
pub(super) struct CellTables {
    pub(super) cell: Cell,
    /// Its outages (start, end) (s).
    pub(super) windows: Vec<(f64, f64)>,
    /// Column by column, in studies that leave out recordings.
    pub(super) runs_of_columns: Vec<Vec<RunRecord>>,
    pub(super) shown: ShownCell,
    pub(super) outages: Vec<TableRow>,
    pub(super) epochs: Vec<TableRow>,
    pub(super) runs: Vec<TableRow>,
    pub(super) diverged: u64,
}

/// Units of a cell that are damaged.
pub(super) struct DamagedUnits(pub(super) Vec<(Unit, String)>);

impl Planned {
    pub(super) fn keeps_epochs(&self) -> bool {
        self.plan.study.keeps(Metric::Epochs)
    }

    /// Position and name of the candidate that ratios refer to.
    pub(super) fn reference(&self) -> Result<(usize, String), StudyError> {
        let refused =
            |source: DescriptionError| StudyError::Description { study: self.study.clone(), source };
        let index = self.plan.study.reference().map_err(refused)?;
        Ok((index, self.plan.study.candidates().swap_remove(index).0))
    }
}

impl CellTables {
    /// From the units of one cell, in run order.
    pub(super) fn make(
        planned: &Planned,
        units: &[(Unit, String)],
    ) -> Result<Result<Self, DamagedUnits>, StudyError> {
        let sums = match sums(planned, units)? {
            Ok(sums) => sums,
            Err(damaged) => return Ok(Err(damaged)),
        };
        let grid = &planned.grid;
        let cell = grid.cell(units[0].0.cell);
        let reference = planned.reference()?;
        let measured: Vec<Measured> = sums.columns.iter().map(Finding::measured).collect();
        let comparisons = comparisons(planned, &measured, reference.0)?;
        let mut tables = Self {
            cell,
            windows: measured.first().map_or(Vec::new(), |m| m.outages.clone()),
            runs_of_columns: Vec::new(),
            shown: ShownCell { name: grid.short_name(cell), columns: Vec::new() },
            outages: Vec::new(),
            epochs: Vec::new(),
            runs: Vec::new(),
            diverged: 0,
        };
        let columns = grid.columns.iter().zip(&sums.columns).zip(&measured).zip(comparisons);
        for (((column, finding), measured), (comparison, is_reference)) in columns {
            let reference = if comparison.is_some() { reference.1.as_str() } else { "" };
            let filter = grid.filter(cell, column).name();
            let (cell, candidate) = (grid.names(cell), column.name.as_str());
            let result = ColumnResult { cell, candidate, filter, reference, measured };
            let (name, label) = shown_names(&planned.plan.study, column, filter);
            let (outages, verdict) = (finding.outages(), measured.verdict());
            let shown = ShownColumn { name, label, outages, comparison, is_reference, verdict };
            let epochs = planned.keeps_epochs().then(|| finding.epochs());
            tables.add(&result, shown, epochs.as_deref());
        }
        if planned.plan.study.leaves_out() {
            tables.runs_of_columns = measured.into_iter().map(|m| m.runs).collect();
        }
        Ok(Ok(tables))
    }

    /// The rows of a column.
    fn add(&mut self, result: &ColumnResult<'_>, shown: ShownColumn, epochs: Option<&[EpochMetrics]>) {
        self.outages.extend(report::outage_rows(result, &shown.outages, shown.comparison.as_deref()));
        self.runs.extend(report::run_rows(result));
        self.epochs.extend(epochs.into_iter().flat_map(|epochs| report::epoch_rows(result, epochs)));
        self.diverged += result.measured.sampled().iter().filter(|r| r.diverged).count() as u64;
        self.shown.columns.push(shown);
    }
}

/// The name of a column, and its place in the layout of Table I: the estimators of one calibration stand in a
/// row, every other candidate has its own. Where there are several filters, each has a row.
fn shown_names(study: &Study, column: &Column, filter: &str) -> (String, Label) {
    let with_filter = |name: &str| match study.filters.len() {
        0 | 1 => name.to_owned(),
        _ => format!("{name} {filter}"),
    };
    let (name, entry, estimator) = study.candidates().swap_remove(column.candidate);
    let of_several = estimator.filter(|_| name != study.candidate[entry].name);
    let label = Label {
        scenario: with_filter(&study.candidate[entry].name),
        estimator: of_several.map_or_else(String::new, |e| e.name().to_uppercase()),
    };
    (with_filter(&name), label)
}

/// Whether a unit is what the plan says; that its outages are those of the cell's others is seen when it is added.
fn fits(planned: &Planned, unit: Unit, result: &UnitResult) -> bool {
    let outages = result.columns.first().map_or(Vec::new(), Finding::windows);
    result.fits(unit, planned.grid.columns.len(), &outages)
}

fn sums(planned: &Planned, units: &[(Unit, String)]) -> Result<Result<CellSums, DamagedUnits>, StudyError> {
    let mut sums = CellSums::default();
    let mut damaged = Vec::new();
    for (unit, id) in units {
        match unit_file::read(&planned.directory, id) {
            Ok(result) if fits(planned, *unit, &result) => {
                if damaged.is_empty() && !sums.add(result) {
                    damaged.push((*unit, id.clone()));
                }
            }
            Err(e @ UnitFileError::Io { .. }) => return Err(e.into()),
            Ok(_) | Err(_) => damaged.push((*unit, id.clone())),
        }
    }
    Ok(if damaged.is_empty() { Ok(sums) } else { Err(DamagedUnits(damaged)) })
}

type Compared = (Option<Vec<OutageComparison>>, bool);

/// The comparison of each column with the reference that has the same filter, if ratios are kept.
fn comparisons(
    planned: &Planned,
    experiments: &[Measured],
    reference: usize,
) -> Result<Vec<Compared>, StudyError> {
    let columns = &planned.grid.columns;
    if planned.plan.kept() == Kept::Runs {
        return Ok(vec![(None, false); columns.len()]);
    }
    let compared = |i: usize| {
        let filter = columns[i].filter;
        let reference_column =
            columns.iter().position(|c| c.candidate == reference && c.filter == filter).unwrap_or(0);
        Ok((
            Some(metrics::compare(&experiments[i], &experiments[reference_column], true)?),
            reference_column == i,
        ))
    };
    (0..columns.len()).map(compared).collect()
}
