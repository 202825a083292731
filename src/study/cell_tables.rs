//! The units of a cell, added up and as rows of tables.

use super::description::{Metric, Study};
use super::failure::StudyError;
use super::grid::{Cell, Column};
use super::plan::{Kept, NamedUnit};
use super::planned::Planned;
use super::unit::Finding;
use super::unit_file::{self, UnitFileError};
use super::{ShownCell, ShownColumn};
use crate::report::{self, ColumnResult, Label, TableRow};
use nav_sim_navigation::metrics::{self, Measured};
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

impl CellTables {
    /// From the units of one cell, in run order; or those of them that are damaged.
    pub(super) fn make(
        planned: &Planned,
        units: &[NamedUnit],
    ) -> Result<Result<Self, Vec<NamedUnit>>, StudyError> {
        let (mut findings, mut damaged) = (Vec::<Finding>::new(), Vec::new());
        for named in units {
            match unit_file::read(&planned.directory, &named.1) {
                Ok(unit) if findings.is_empty() => findings = unit.columns,
                Ok(unit) => findings
                    .iter_mut()
                    .zip(unit.columns)
                    .for_each(|(sum, later)| sum.append(later)),
                Err(e @ UnitFileError::Io { .. }) => return Err(e.into()),
                Err(_) => damaged.push(named.clone()),
            }
        }
        if !damaged.is_empty() {
            return Ok(Err(damaged));
        }
        let Planned { plan, grid, .. } = planned;
        let cell = grid.cell(units[0].0.cell);
        let reference = planned.reference();
        let measured: Vec<Measured> = findings.iter().map(Finding::measured).collect();
        let mut tables = Self {
            cell,
            windows: measured.first().map_or(Vec::new(), |m| m.outages.clone()),
            runs_of_columns: Vec::new(),
            shown: ShownCell {
                name: grid.short_name(cell),
                columns: Vec::new(),
            },
            outages: Vec::new(),
            epochs: Vec::new(),
            runs: Vec::new(),
            diverged: 0,
        };
        for ((i, column), (finding, measured_here)) in grid
            .columns
            .iter()
            .enumerate()
            .zip(findings.iter().zip(&measured))
        {
            // the reference that has the same filter
            let is_reference = |c: &Column| c.candidate == reference.0 && c.filter == column.filter;
            let of_reference = grid.columns.iter().position(is_reference).unwrap_or(0);
            let comparison = match plan.kept() {
                Kept::Runs => None,
                _ => Some(metrics::compare(
                    measured_here,
                    &measured[of_reference],
                    true,
                )?),
            };
            let filter = grid.filter(cell, column).name();
            let result = ColumnResult {
                cell: grid.names(cell),
                candidate: &column.name,
                filter,
                reference: comparison.as_ref().map_or("", |_| reference.1.as_str()),
                measured: measured_here,
            };
            let outages = finding.outages();
            tables.outages.extend(report::outage_rows(
                &result,
                &outages,
                comparison.as_deref(),
            ));
            tables.runs.extend(report::run_rows(&result));
            if plan.study.keeps(Metric::Epochs) {
                tables
                    .epochs
                    .extend(report::epoch_rows(&result, &finding.epochs()));
            }
            tables.diverged += measured_here
                .sampled()
                .iter()
                .filter(|r| r.diverged)
                .count() as u64;
            let (name, label) = shown_names(&plan.study, column, filter);
            let is_reference = comparison.is_some() && of_reference == i;
            let verdict = measured_here.verdict();
            tables.shown.columns.push(ShownColumn {
                name,
                label,
                outages,
                comparison,
                is_reference,
                verdict,
            });
        }
        if plan.study.leaves_out() {
            tables.runs_of_columns = measured.into_iter().map(|m| m.runs).collect();
        }
        Ok(Ok(tables))
    }
}

impl Planned {
    /// Position and name of the candidate that ratios refer to: the study was checked when it was read.
    pub(super) fn reference(&self) -> (usize, String) {
        let index = self.plan.study.reference().unwrap_or(0);
        (index, self.plan.study.candidates().swap_remove(index).0)
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
