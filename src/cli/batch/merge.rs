//! `nav-sim batch merge`: units to tables.

use super::status::Count;
use super::{Place, Planned};
use crate::cli::compare::{markdown, table};
use crate::cli::{Failure, Session};
use nav_sim::formats::atomic::AtomicDir;
use nav_sim::formats::table_files::{TableFiles, TableFormat};
use nav_sim::formats::unit_file;
use nav_sim::metrics::{self, Measured, OutageComparison};
use nav_sim::report::{self, ColumnResult, Label, ShownCell, ShownColumn, TableRow};
use nav_sim::simulation::{REPORTED_NAMES, RunResult};
use nav_sim::study::{CellSums, Column, Kept, Metric, Study, Unit, UnitResult};
use rayon::prelude::*;
use serde_json::json;

/// Tables of a finished study: outages, ratios to the reference, epochs, runs
///
/// Writes results/ in the directory of the study: outages.csv, .json and .parquet (a row an outage of each
/// candidate in each cell), runs.parquet, epochs.csv and .parquet if the study asks for them, tables.md. The
/// bytes depend on the plan alone, not on how it was run. Ratios are taken within a filter: column `reference`
/// names the candidate they refer to, in the row's own filter. Nothing is written while units are missing: they
/// are listed (all of them with --verbose or --format json), and the exit code is 75.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --seed 1 \\
      && nav-sim batch run examples/quick_study.toml
  nav-sim batch merge examples/quick_study.toml
  nav-sim batch merge examples/quick_study.toml --state all --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    place: Place,
    /// States in the tables (repeatable), or "all"; the files have all
    #[arg(long = "state", value_name = "STATE", default_values = ["pos_e_m", "roll_deg"])]
    states: Vec<String>,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let states = crate::cli::compare::states(&args.states)?;
    let planned = args.place.planned(session.asked_seed())?;
    complete(&planned, session)?;
    let mut out = AtomicDir::create(&planned.directory.join("results"))?;
    let mut tables = Tables::create(&mut out, &planned)?;
    let mut texts = Texts::new(&planned)?;
    let units: Vec<(Unit, String)> = planned.plan.named_units(&planned.grid).collect();
    let cells: Vec<&[(Unit, String)]> = units.chunk_by(|a, b| a.0.cell == b.0.cell).collect();
    let mut damaged = Vec::new();
    let mut diverged = 0;
    let wave = wave(&planned, session);
    for some in cells.chunks(wave) {
        let found: Vec<Result<CellTables, Bad>> =
            some.par_iter().map(|units| cell_tables(&planned, units)).collect();
        for cell in found {
            match cell {
                Ok(cell) if damaged.is_empty() => {
                    diverged += cell.diverged;
                    tables.add(&cell)?;
                    texts.add(cell);
                }
                Ok(_) => {}
                Err(Bad::Damaged(names)) => damaged.extend(names),
                Err(Bad::Failed(e)) => return Err(e),
            }
        }
    }
    if !damaged.is_empty() {
        return Err(incomplete(&planned, units.len(), &damaged, session));
    }
    tables.finish()?;
    let text = texts.render(&states);
    out.write("tables.md", format!("{text}\n"))?;
    let summary = summary(&planned, units.len(), diverged);
    out.write("study.json", report::json(&summary))?;
    remove_stale(&planned)?;
    out.commit()?;
    session.printer.result(if session.json() { summary.to_string() } else { text }.trim_end());
    session.printer.say(&format!("wrote {}", planned.directory.join("results").display()));
    all_finite(diverged)
}

/// Removes tables of an earlier plan that this one does not write; all others are replaced.
fn remove_stale(planned: &Planned) -> Result<(), Failure> {
    if planned.plan.study.keeps(Metric::Epochs) {
        return Ok(());
    }
    for name in ["epochs.csv", "epochs.parquet"] {
        let path = planned.directory.join("results").join(name);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Failure::could_not(format!("{}: {e}", path.display())));
            }
            _ => {}
        }
    }
    Ok(())
}

fn all_finite(diverged: u64) -> Result<(), Failure> {
    if diverged == 0 {
        return Ok(());
    }
    let failure = Failure::bound(format!("{diverged} runs diverged"));
    Err(failure.hint("they are in runs.parquet, diverged = 1, and in no other number"))
}

/// All units must be there; those of another plan are left out.
fn complete(planned: &Planned, session: &Session) -> Result<(), Failure> {
    let count = Count::of(planned)?;
    count.warn_of_foreign(planned, session);
    if count.missing.is_empty() {
        return Ok(());
    }
    Err(incomplete(planned, count.units, &count.missing, session))
}

/// Names the units that are missing or damaged, all of them on stdout as JSON or with --verbose.
fn incomplete(planned: &Planned, units: usize, missing: &[(Unit, String)], session: &Session) -> Failure {
    let cell = |unit: &Unit| planned.grid.names(planned.grid.cell(unit.cell));
    if session.json() {
        let one = |(unit, id): &(Unit, String)| {
            let runs = [unit.first, unit.first + unit.runs];
            json!({ "unit": id, "index": unit.index, "cell": cell(unit), "runs": runs })
        };
        let missing: Vec<serde_json::Value> = missing.iter().map(one).collect();
        let json = json!({
            "schema_version": 1, "plan": planned.plan.id(), "units": units, "missing": missing,
        });
        session.printer.result(&json.to_string());
    }
    for (unit, id) in missing {
        let (name, last) = (cell(unit).join(", "), unit.first + unit.runs - 1);
        session.printer.detail(&format!("{id}: {name}, runs {} to {last}", unit.first));
    }
    let shown: Vec<&str> = missing.iter().take(10).map(|(_, id)| id.as_str()).collect();
    let more = if missing.len() > shown.len() { ", … (all with --verbose)" } else { "" };
    let n = missing.len();
    let message = format!("{n} of {units} units are missing or damaged: {}{more}", shown.join(", "));
    let stale = match stale_results(planned) {
        Some(path) => format!("; {} is of another plan", path.display()),
        None => String::new(),
    };
    let hint = format!("`nav-sim batch run` computes them; nothing was written{stale}");
    Failure::stopped(message).hint(hint)
}

/// The results that another plan left here, if there are any.
pub(super) fn stale_results(planned: &Planned) -> Option<std::path::PathBuf> {
    let path = planned.directory.join("results");
    let text = std::fs::read_to_string(path.join("study.json")).ok()?;
    let summary: serde_json::Value = serde_json::from_str(&text).ok()?;
    (summary["plan"] != planned.plan.id().as_str()).then_some(path)
}

/// Cells that are held in memory together.
fn wave(planned: &Planned, session: &Session) -> usize {
    const MEMORY: f64 = 1e8;
    let cells = planned.grid.len().max(1) as f64;
    let of_cell = 3.0 * planned.plan.estimate.bytes / cells + 1e4;
    ((MEMORY / of_cell) as usize).clamp(1, 64 * session.threads().max(1))
}

/// Why a cell has no tables.
enum Bad {
    /// These units are damaged.
    Damaged(Vec<(Unit, String)>),
    /// Something else.
    Failed(Failure),
}

/// What a cell contributes.
struct CellTables {
    shown: ShownCell,
    outages: Vec<TableRow>,
    epochs: Vec<TableRow>,
    runs: Vec<TableRow>,
    diverged: u64,
}

fn cell_tables(planned: &Planned, units: &[(Unit, String)]) -> Result<CellTables, Bad> {
    let sums = sums(planned, units)?;
    let grid = &planned.grid;
    let cell = grid.cell(units[0].0.cell);
    let names = grid.names(cell);
    let comparisons = comparisons(planned, &sums.columns)?;
    let mut tables = CellTables {
        shown: ShownCell { name: planned.cell_name(cell), columns: Vec::new() },
        outages: Vec::new(),
        epochs: Vec::new(),
        runs: Vec::new(),
        diverged: 0,
    };
    let reference = reference(planned)?;
    for ((column, result), (comparison, is_reference)) in
        grid.columns.iter().zip(&sums.columns).zip(comparisons)
    {
        let filter = grid.filter(cell, column).name();
        let reference = if comparison.is_some() { reference.1.as_str() } else { "" };
        let of = ColumnResult { cell: names, candidate: &column.name, filter, reference, result };
        let outages = metrics::outages(result);
        tables.outages.extend(report::outage_rows(&of, &outages, comparison.as_deref()));
        tables.runs.extend(report::run_rows(&of));
        if planned.plan.study.keeps(Metric::Epochs) {
            tables.epochs.extend(report::epoch_rows(&of, &metrics::epochs(result)));
        }
        tables.diverged += result.runs.iter().filter(|r| r.diverged).count() as u64;
        let (name, label) = shown_names(&planned.plan.study, column, filter);
        let verdict = report::verdict(result);
        tables.shown.columns.push(ShownColumn { name, label, outages, comparison, is_reference, verdict });
    }
    Ok(tables)
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
        estimator: of_several.unwrap_or_default().to_uppercase(),
    };
    (with_filter(&name), label)
}

/// Position and name of the candidate that ratios refer to.
fn reference(planned: &Planned) -> Result<(usize, String), Bad> {
    let study = &planned.plan.study;
    let index = study.reference().map_err(|e| Bad::Failed(Failure::could_not(e)))?;
    Ok((index, study.candidates().swap_remove(index).0))
}

/// Whether a unit is what the plan says; that its outages are those of the cell's others is seen when it is added.
fn fits(planned: &Planned, unit: Unit, result: &UnitResult) -> bool {
    let outages = result.columns.first().map_or([].as_slice(), |c| &c.outages);
    result.fits(unit, planned.grid.columns.len(), outages)
}

fn sums(planned: &Planned, units: &[(Unit, String)]) -> Result<CellSums, Bad> {
    let mut sums = CellSums::default();
    let mut damaged = Vec::new();
    for (unit, id) in units {
        match unit_file::read(&planned.directory, id) {
            Ok(result) if fits(planned, *unit, &result) => {
                if damaged.is_empty() && !sums.add(result) {
                    damaged.push((*unit, id.clone()));
                }
            }
            Err(unit_file::UnitFileError::Io { path, source }) => {
                return Err(Bad::Failed(Failure::could_not(format!("{path}: {source}"))));
            }
            Ok(_) | Err(_) => damaged.push((*unit, id.clone())),
        }
    }
    if damaged.is_empty() { Ok(sums) } else { Err(Bad::Damaged(damaged)) }
}

type Compared = (Option<Vec<OutageComparison>>, bool);

/// The comparison of each column with the reference that has the same filter, if ratios are kept.
fn comparisons(planned: &Planned, results: &[RunResult]) -> Result<Vec<Compared>, Bad> {
    let failed = |e: String| Bad::Failed(Failure::could_not(e));
    let (reference, _) = reference(planned)?;
    let columns = &planned.grid.columns;
    if planned.plan.kept() == Kept::Runs {
        return Ok(vec![(None, false); columns.len()]);
    }
    let experiments: Vec<Measured> = results.iter().map(report::measured).collect();
    let one = |i: usize| {
        let filter = columns[i].filter;
        let own = columns.iter().position(|c| c.candidate == reference && c.filter == filter).unwrap_or(0);
        let compared = metrics::compare(&experiments[i], &experiments[own], true);
        compared.map(|c| (Some(c), own == i)).map_err(|e| failed(e.to_string()))
    };
    (0..columns.len()).map(one).collect()
}

/// The tables being written.
struct Tables {
    outages: TableFiles,
    runs: TableFiles,
    epochs: Option<TableFiles>,
}

impl Tables {
    fn create(out: &mut AtomicDir, planned: &Planned) -> Result<Self, Failure> {
        let outages = TableFiles::create(out, "outages", &TableFormat::ALL, report::outage_columns())?;
        let runs = TableFiles::create(out, "runs", &[TableFormat::Parquet], report::run_columns())?;
        let formats = [TableFormat::Csv, TableFormat::Parquet];
        let epochs = planned.plan.study.keeps(Metric::Epochs);
        let epochs = epochs.then(|| TableFiles::create(out, "epochs", &formats, report::epoch_columns()));
        Ok(Self { outages, runs, epochs: epochs.transpose()? })
    }

    fn add(&mut self, cell: &CellTables) -> Result<(), Failure> {
        self.outages.add(cell.outages.iter().cloned())?;
        self.runs.add(cell.runs.iter().cloned())?;
        match &mut self.epochs {
            Some(epochs) => Ok(epochs.add(cell.epochs.iter().cloned())?),
            None => Ok(()),
        }
    }

    fn finish(self) -> Result<(), Failure> {
        self.outages.finish()?;
        self.runs.finish()?;
        Ok(self.epochs.map_or(Ok(()), TableFiles::finish)?)
    }
}

/// What people read: of the first cells only, the files have all.
struct Texts {
    /// What ratios refer to, in words.
    reference: String,
    cells: Vec<ShownCell>,
    more: usize,
}

const SHOWN: usize = 24;

impl Texts {
    fn new(planned: &Planned) -> Result<Self, Failure> {
        let study = &planned.plan.study;
        let candidates = study.candidates();
        let index = study.reference().map_err(|e| Failure::could_not(&e))?;
        let same = if study.filters.len() > 1 { " with the same filter" } else { "" };
        Ok(Self { reference: format!("{}{same}", candidates[index].0), cells: Vec::new(), more: 0 })
    }

    fn add(&mut self, cell: CellTables) {
        if self.cells.len() < SHOWN {
            self.cells.push(cell.shown);
        } else {
            self.more += 1;
        }
    }

    fn render(&self, states: &[usize]) -> String {
        let mut text = "Verdict on each filter: NEES over the run (9 if right), error over its standard deviation in the \
                        state that is farthest off\n\n"
            .to_owned();
        text += &table(&report::verdict_table(&self.cells));
        text += "\n\nHorizontal error before the first fix after the outage, median (95 %), m\n\n";
        text += &table(&report::drift_table(&self.cells));
        let has_ratios = |cell: &&ShownCell| cell.columns.len() > 1 && cell.columns[0].comparison.is_some();
        for cell in self.cells.iter().filter(has_ratios) {
            text += &format!(
                "\n\n{}: ASEE relative to {}, mean over the outage of (ratio − 1)·100 ± half the 95 % \
                 interval (mean of the absolute value), %\n\n",
                markdown(&cell.name),
                markdown(&self.reference)
            );
            text += &table(&report::ratio_table(cell, states));
        }
        if self.more > 0 {
            text += &format!("\n\n{} more cells are in outages.csv", self.more);
        }
        text
    }
}

fn summary(planned: &Planned, units: usize, diverged: u64) -> serde_json::Value {
    let plan = &planned.plan;
    json!({
        "schema_version": 1,
        "plan": plan.id(),
        "version": plan.version,
        "numerics": plan.numerics,
        "seed": plan.seed,
        "cells": planned.grid.len(),
        "units": units,
        "runs": plan.study.runs,
        "diverged": diverged,
        "states": REPORTED_NAMES,
        "study": plan.study,
        "inputs": plan.inputs,
        "models": plan.models,
    })
}
