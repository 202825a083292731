//! Studies: runs whose values may be lists, in cells that survive kills and spread over machines.
//!
//! A cell is one request of `run`, and its directory a run directory. It is done when its manifest has its key: options and
//! contents of inputs. Cells that differ in the filter alone share a pass of noise, and many runs are cut into blocks.

mod cells;
mod results;
mod shard;
mod units;

pub(crate) use cells::Study;
pub use results::StudyAnswer;
pub(crate) use units::part_of;

use crate::app::{Answer, Context, Failure, Manifest, Result};
use crate::commands::run::columns;
use cells::Cell;
use results::{first_of, merge, withdraw};
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use units::{Place, Unit, assemble, units, work};

/// Run a study: a run whose values may be lists
///
/// STUDY (TOML) has the options of `run` as keys of [run], and sections of a scenario. A list is an axis where a single run
/// would not take it; [vary] names axes, and {NAME} stands for a label. Every cell becomes a run directory in DIR/cells; then
/// all are compared (results.csv, summary.json, report.html). Computes what is missing: kill and repeat at will, on any
/// number of processes and machines that share the directory. Stopped by SIGTERM or the time limit the exit code is 75.
#[derive(clap::Args, Debug, Clone, Default)]
#[command(before_help = "\
Examples:
  nav-sim batch examples/quick_study.toml -o out/quick
  nav-sim batch examples/quick_study.toml --shard 0/2 --time-limit 50m
  nav-sim batch examples/quick_study.toml --set runs=8 --dry-run")]
pub struct BatchRequest {
    /// The study (TOML)
    #[arg(value_name = "STUDY")]
    pub study: PathBuf,
    /// Directory of the study (default: out/ and the study's name)
    #[arg(long, short, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Share of the work, from 0/N to N−1/N (default: from HQ_TASK_ID, SLURM_ARRAY_TASK_ID, PBS_ARRAY_INDEX or
    /// JOB_COMPLETION_INDEX, else what no other process has)
    #[arg(long, value_name = "K/N", value_parser = shard::parse)]
    pub shard: Option<(u64, u64)>,
    /// Number of shards, if only the index comes from the scheduler
    #[arg(long, value_name = "N", conflicts_with = "shard", value_parser = clap::value_parser!(u64).range(1..))]
    pub shards: Option<u64>,
    /// Say what there is to do, and compute nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Compute nothing, merge the cells that are there
    #[arg(long, conflicts_with = "dry_run")]
    pub merge: bool,
    /// A key of [run] over that of the study, such as runs=10000 (repeatable)
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// States in the tables of the page (repeatable), or "all"
    #[arg(long = "state", value_name = "STATE", default_values = ["pos_e_m", "roll_deg"])]
    pub states: Vec<String>,
    /// Compute cells again whose request has changed
    #[arg(skip)]
    pub force: bool,
}

/// What became of a study.
#[derive(Debug)]
pub enum Outcome {
    /// Merged: what is there is compared.
    Merged(Box<StudyAnswer>),
    /// Own share done; cells are missing.
    Partial(Vec<String>),
    /// The estimate of a dry run.
    Estimate(String),
    /// Stopped before the own share was done.
    Stopped {
        /// True if the same command goes on: something was finished, or a signal came.
        is_resumable: bool,
        /// Units left.
        left: usize,
    },
}

impl BatchRequest {
    /// Directory of the study.
    #[must_use]
    pub fn directory(&self) -> PathBuf {
        let stem = || Path::new("out").join(self.study.file_stem().unwrap_or_default());
        self.out.clone().unwrap_or_else(stem)
    }

    /// Computes the cells that are missing, and merges when none is.
    ///
    /// # Errors
    /// What is wrong with the study, before anything is computed; cells that cannot be computed (exit code 1); stopped early
    /// (75).
    pub fn run(
        &self,
        variable: &dyn Fn(&str) -> Option<String>,
        context: &Context<'_>,
    ) -> Result<Outcome> {
        let study = Study::read(&self.study, &self.set)?;
        let outcome = self.run_study(&study, variable, context);
        outcome.map_err(|e| match e.code() {
            2 if e.file().is_none() => e.within(&self.study.display().to_string()),
            _ => e,
        })
    }

    fn run_study(
        &self,
        study: &Study,
        variable: &dyn Fn(&str) -> Option<String>,
        context: &Context<'_>,
    ) -> Result<Outcome> {
        let directory = self.directory();
        let place = Place(&directory);
        let cells = study.cells(self.study.parent().unwrap_or(Path::new("")))?;
        if !study.run.contains_key("seed") {
            context.remark("no seed in the study: 1");
        }
        let states = crate::commands::compare::states(&self.states)?;
        let (share, from) = shard::find(self.shard, self.shards, variable)?;
        let merged = || {
            let answer = merge(study, &cells, &place, &states, context)?;
            answer.write(&place)?;
            Ok(Outcome::Merged(Box::new(answer)))
        };
        if self.merge {
            return merged();
        }
        let changed = adopt(&place, &cells, self.dry_run, context);
        if let (Some((name, what)), false) = (changed.first(), self.force || self.dry_run) {
            let message = format!("cell {name} is of another study: {what}");
            return Err(Failure::input(message)
                .hint("choose another directory with --out, or compute it again with --force"));
        }
        let units = units(&cells, context)?;
        if self.dry_run {
            let changed = changed.len();
            return estimate(&cells, &units, &place, changed, context).map(Outcome::Estimate);
        }
        if cells.iter().any(|cell| !place.is_done(cell)) {
            withdraw(&place);
        }
        let own = match share {
            Some(share) => {
                context.remark(format!("shard {}/{} ({from})", share.0, share.1));
                units::shard(&units, share)
            }
            None => units.iter().collect(),
        };
        let worked = work(&place, &own, context)?;
        for cell in &cells {
            let has_cell = |unit: &&Unit<'_>| unit.cells.iter().any(|own| own.name == cell.name);
            let of_cell = units.iter().filter(has_cell);
            let firsts: Vec<u64> = of_cell.map(|unit| unit.first).collect();
            if firsts.len() > 1 {
                assemble(&place, cell, &firsts, context)?;
            }
        }
        let failures = worked.failures.into_inner().unwrap_or_default();
        if let Some((name, failure)) = failures.first() {
            let more = match failures.len() - 1 {
                0 => String::new(),
                n => format!(" (and {n} more cells)"),
            };
            let hint = failure.advice();
            let failed = Failure::could_not(format!("cell {name}: {failure}{more}"));
            return Err(failed.maybe_hint(hint));
        }
        let left = own.iter().filter(|unit| !place.has_unit(unit)).count();
        if left > 0 && !context.go_on() {
            let is_resumable = worked.finished.into_inner() > 0;
            return Ok(Outcome::Stopped { is_resumable, left });
        }
        let missing = cells.iter().filter(|cell| !place.is_done(cell));
        let missing: Vec<String> = missing.map(|cell| cell.name.clone()).collect();
        if missing.is_empty() {
            drop(fs::remove_dir_all(directory.join("locks")));
            return merged();
        }
        context.remark(format!(
            "{} of {} cells are missing: {}",
            missing.len(),
            cells.len(),
            first_of(&missing)
        ));
        Ok(Outcome::Partial(missing))
    }
}

/// Renames cells that have another name than they had; names and reasons of those whose request has changed.
fn adopt(
    place: &Place<'_>,
    cells: &[Cell],
    is_dry: bool,
    context: &Context<'_>,
) -> Vec<(String, String)> {
    let entries = fs::read_dir(place.0.join("cells")).into_iter();
    let names = entries.flatten().flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let keyed = names
        .filter(|name| !name.ends_with(".damaged"))
        .filter_map(|name| Some((place.manifest(&name)?.key, name)));
    let there: HashMap<String, String> = keyed.collect();
    let named = |name: &str| cells.iter().find(|cell| cell.name == name);
    for cell in cells.iter().filter(|_| !is_dry) {
        if let Some(name) = there.get(&cell.manifest.key)
            && !named(name).is_some_and(|own| place.is_done(own))
            && !place.cell(&cell.name).exists()
        {
            drop(fs::rename(place.cell(name), place.cell(&cell.name)));
        }
    }
    let others = there.values();
    let others = others.filter(|name| place.cell(name).exists() && named(name).is_none());
    let mut others: Vec<&String> = others.collect();
    others.sort();
    if !others.is_empty() {
        context.remark(format!(
            "cells of another study are left out: {}, such as {}",
            others.len(),
            others[0]
        ));
    }
    let changed = |cell: &Cell| {
        let manifest = place.manifest(&cell.name)?;
        (manifest.key != cell.manifest.key)
            .then(|| (cell.name.clone(), difference(&manifest, &cell.manifest)))
    };
    cells.iter().filter_map(changed).collect()
}

/// The first setting or input in which two requests differ.
fn difference(there: &Manifest, wanted: &Manifest) -> String {
    let keys = there.options.keys().chain(wanted.options.keys());
    let shown =
        |values: Option<&Vec<String>>| values.map_or("not given".to_owned(), |v| v.join(" "));
    for key in keys {
        let [old, new] = [there, wanted].map(|manifest| manifest.options.get(key));
        if old != new {
            return format!("its \"{key}\" is {}, not {}", shown(old), shown(new));
        }
    }
    let differs = |input: &&crate::app::Input| {
        !there
            .inputs
            .iter()
            .any(|old| old.role == input.role && old.blake3 == input.blake3)
    };
    match wanted.inputs.iter().find(differs) {
        Some(input) => format!("{} has changed", input.path),
        None => "it is of another version of the figures".to_owned(),
    }
}

/// Cells, passes, what is done, the processor time of the rest from eight timed runs, and its size.
fn estimate(
    cells: &[Cell],
    units: &[Unit<'_>],
    place: &Place<'_>,
    changed: usize,
    context: &Context<'_>,
) -> Result<String> {
    const BYTES: f64 = 1.2e6;
    let done = cells.iter().filter(|cell| place.is_done(cell)).count();
    let left: Vec<&Unit<'_>> = units.iter().filter(|unit| !place.has_unit(unit)).collect();
    let passes = units.iter().filter(|unit| unit.first == 0).count();
    let mut text = format!(
        "{} cells in {passes} passes: {done} done, {} to do, {changed} changed",
        cells.len(),
        cells.len() - done
    );
    if let Some(unit) = left.first() {
        let cell = unit.cells[0];
        let quiet = Context::new(&(), Some(cell.seed));
        let prepared = cell.asked.request.prepare(&quiet)?;
        let runs = unit.runs.min(8);
        quiet.begin("runs", runs);
        columns(&[&prepared], 0, runs, &quiet)?;
        quiet.end();
        let per_run = quiet.runs_s() / runs as f64 * quiet.threads() as f64;
        let cost: u64 = left.iter().map(|unit| unit.cost()).sum();
        text += &format!(
            "\n{} of processor time, {:.0} MB",
            nav_sim_calibration::duration(per_run * cost as f64),
            BYTES * (cells.len() - done) as f64 / 1e6
        );
    }
    for cell in cells {
        context.detail(&cell.name);
    }
    Ok(text)
}

impl Outcome {
    /// What is missed: stated bounds, or cells that are to be computed.
    pub fn unmet(&self) -> Option<Failure> {
        match self {
            Self::Merged(answer) => answer.incomplete().or_else(|| answer.unmet()),
            Self::Partial(_) | Self::Estimate(_) => None,
            Self::Stopped {
                is_resumable: true,
                left,
            } => Some(
                Failure::stopped(format!("stopped; {left} units left"))
                    .hint("the same command goes on where this one stopped"),
            ),
            // the same command would end the same way: no code for "to be resumed"
            Self::Stopped { left, .. } => {
                let message = format!("stopped before a single unit was done; {left} units left");
                Some(Failure::could_not(message).hint("a longer --time-limit"))
            }
        }
    }
}
