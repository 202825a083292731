//! `nav-sim batch plan`: inputs checked and hashed, candidates calibrated, units cut.

use super::inputs::{self, CALIBRATED, CANDIDATE_SEED, Inputs};
use super::merge::stale_results;
use super::status::Count;
use super::{Place, Planned, unusable};
use crate::cli::{Failure, Session, read};
use nav_sim::calibration::Outcome;
use nav_sim::formats::model_file::{self, CalibrationNote};
use nav_sim::formats::study_directory;
use nav_sim::formats::study_file::{self, BatchFile};
use nav_sim::formats::{atomic, hash, unit_file};
use nav_sim::lanes::LANES;
use nav_sim::report::Input;
use nav_sim::study::{
    CalibrateStep, Estimate, Grid, Kept, Plan, Prepared, Study, calibrated, fingerprint, run_unit,
};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Check a study and everything it names, calibrate its candidates, and cut it into units of work
///
/// A probe (eight runs of the first cell) says how long it will take; units are made to last about two
/// minutes, unless the study says `unit_runs`. The directory then holds plan.json, which names every input by
/// its hash, and models/ calibrated here (planning again restores those that are lost). Nothing is computed yet: see `nav-sim batch run`.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --dry-run
  nav-sim batch plan examples/quick_study.toml --seed 1 -o out/quick
  nav-sim batch plan examples/quick_study.toml --dry-run --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    place: Place,
    /// Say what it will take, write nothing
    #[arg(long)]
    dry_run: bool,
}

/// What a unit is made to last (s).
const UNIT_S: f64 = 120.0;

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let (directory, file) = (args.place.directory(), args.place.read()?);
    if let Some(plan) = study_directory::plan(&directory)?.filter(|_| !args.dry_run) {
        return again(args, &directory, plan, &file, session);
    }
    let seed = session.seed(file.study.seed);
    let (mut planned, models) = prepared(args, &directory, file, seed, session)?;
    // Models calibrated here are read back from the directory: of a dry run, from one that goes away.
    let scratch = args.dry_run.then(|| Scratch::new(&directory));
    if let Some(scratch) = &scratch {
        planned.directory.clone_from(&scratch.0);
    }
    for (path, text) in &models {
        atomic::write(&planned.directory.join(path), text)?;
    }
    validate(&planned, &args.place.study, session)?;
    probe(&mut planned, &args.place.study, session)?;
    warn_of_leftovers(&planned, session)?;
    if !args.dry_run {
        study_directory::write_plan(&directory, &planned.plan)?;
    }
    report(&planned, session);
    if !args.dry_run {
        session.printer.say(&format!("wrote {}", directory.join("plan.json").display()));
    }
    Ok(())
}

/// A directory that goes away.
struct Scratch(PathBuf);

impl Scratch {
    fn new(beside: &Path) -> Self {
        let name = beside.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Self(std::env::temp_dir().join(format!("nav-sim-{name}-{}", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// There is a plan already: the same one is left alone, another one refused.
fn again(
    args: &Args,
    directory: &Path,
    plan: Plan,
    file: &BatchFile,
    session: &Session,
) -> Result<(), Failure> {
    let wanted = session.seed(Some(plan.seed));
    study_directory::same(directory, &plan, &file.study, Some(wanted))?;
    let study = &args.place.study;
    for input in &plan.inputs {
        let path = study_file::beside(study, Path::new(&input.path));
        let shown = path.display();
        let found = hash::of_file(&path).map_err(|e| Failure::could_not(format!("{shown}: {e}")))?;
        if found != input.blake3 {
            let failure = Failure::input(format!("{shown} has changed since the study was planned"));
            return Err(failure.hint("put it back, or plan into another directory with --out"));
        }
    }
    restore_models(study, directory, &plan, session)?;
    let grid = Grid::of(&plan).map_err(|e| unusable(study, &e))?;
    let planned = Planned { plan, grid, directory: directory.to_owned() };
    warn_of_leftovers(&planned, session)?;
    report(&planned, session);
    session.printer.say(&format!("{} was planned already", directory.display()));
    Ok(())
}

/// Calibrates again what is lost or damaged in models/; it must be what the plan says.
fn restore_models(study: &Path, directory: &Path, plan: &Plan, session: &Session) -> Result<(), Failure> {
    let whole = |m: &Prepared| hash::of_file(&directory.join(&m.path)).is_ok_and(|found| found == m.blake3);
    let lost: Vec<&Prepared> = plan.models.iter().filter(|m| m.role == CALIBRATED && !whole(m)).collect();
    if lost.is_empty() {
        return Ok(());
    }
    // models that are files of their own do not matter here
    let (_, texts) = models(study, &plan.study, plan.seed, &|_| String::new(), session)?;
    for model in lost {
        let Some((path, text)) = texts.iter().find(|(path, _)| *path == model.path) else {
            let failure = Failure::input(format!("{} cannot be made again as it was planned", model.path));
            return Err(failure.hint("use the build that planned, or plan into another directory with --out"));
        };
        atomic::write(&directory.join(path), text)?;
        session.printer.say(&format!("wrote {} again", directory.join(path).display()));
    }
    Ok(())
}

/// The plan without its units, and the texts of the models calibrated for it.
fn prepared(
    args: &Args,
    directory: &Path,
    file: BatchFile,
    seed: u64,
    session: &Session,
) -> Result<(Planned, Vec<(String, String)>), Failure> {
    let study_path = &args.place.study;
    let BatchFile { study, scenarios, gnss } = file;
    let inputs = input_hashes(study_path, &study)?;
    let hash_of = |path: &Path| {
        let wanted = path.display().to_string();
        inputs.iter().find(|i| i.path == wanted).map(|i| i.blake3.clone()).unwrap_or_default()
    };
    let trajectories = study.trajectory.iter().map(|e| hash_of(&e.file)).collect();
    let truths = study.truth.iter().map(|e| inputs::truth_hash(study_path, e, seed));
    let truths = truths.collect::<Result<_, _>>()?;
    let (models, texts) = models(study_path, &study, seed, &hash_of, session)?;
    let grid = Grid::new(&study, &scenarios, &gnss).map_err(|e| unusable(study_path, &e))?;
    let plan = Plan {
        schema_version: Plan::SCHEMA_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        numerics: fingerprint(),
        seed,
        unit_runs: vec![study.unit_runs.unwrap_or(study.runs); study.trajectory.len()],
        study,
        scenarios,
        gnss,
        trajectories,
        truths,
        models,
        inputs,
        estimate: Estimate::default(),
    };
    Ok((Planned { plan, grid, directory: directory.to_owned() }, texts))
}

/// Every file of the study with its hash, directories of recordings file by file.
fn input_hashes(study_path: &Path, study: &Study) -> Result<Vec<Prepared>, Failure> {
    let base = study_path.parent().unwrap_or(Path::new(""));
    let mut found: Vec<Prepared> = Vec::new();
    for (role, path) in study.files() {
        for file in inputs::listed(study_path, &[path.to_owned()])? {
            let relative = file.strip_prefix(base).unwrap_or(&file).display().to_string();
            let blake3 = read::input(role, &file)?.blake3;
            let known = found.iter().any(|i| i.path == relative && i.role == role);
            if !known {
                found.push(Prepared { role: role.to_owned(), path: relative, blake3 });
            }
        }
    }
    Ok(found)
}

type Models = (Vec<Prepared>, Vec<(String, String)>);

/// The model of each candidate; those of calibration steps are made here.
fn models(
    study_path: &Path,
    study: &Study,
    seed: u64,
    hash_of: &dyn Fn(&Path) -> String,
    session: &Session,
) -> Result<Models, Failure> {
    let (mut models, mut texts) = (Vec::new(), Vec::new());
    for entry in &study.candidate {
        if let Some(path) = &entry.model {
            let blake3 = hash_of(path);
            models.push(Prepared { role: "model".into(), path: path.display().to_string(), blake3 });
        }
        let Some(step) = &entry.calibrate else { continue };
        session.printer.say(&format!("calibrating {} ({})", entry.name, step.estimators.join(", ")));
        let made = calibration(study_path, step, seed, session).map_err(|e| e.within(&entry.name))?;
        for (estimator, text) in step.estimators.iter().zip(made) {
            let blake3 = blake3::hash(text.as_bytes()).to_hex().to_string();
            let name: String = format!("{}_{estimator}", entry.name)
                .chars()
                .map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' })
                .collect();
            let path = format!("models/{name}_{}.toml", &blake3[..8]);
            texts.push((path.clone(), text));
            models.push(Prepared { role: CALIBRATED.into(), path, blake3 });
        }
    }
    Ok((models, texts))
}

/// Model files of a calibration step, one an estimator.
fn calibration(
    study_path: &Path,
    step: &CalibrateStep,
    seed: u64,
    session: &Session,
) -> Result<Vec<String>, Failure> {
    let recordings = match &step.synthesize {
        Some(synthesis) => {
            inputs::synthesised(study_path, synthesis, seed.wrapping_add(CANDIDATE_SEED), session)?
        }
        None => {
            let beside = |p: &PathBuf| study_file::beside(study_path, p);
            let paths: Vec<PathBuf> = step.recordings.iter().map(beside).collect();
            read::recordings_at(&paths, None, session)?
        }
    };
    let (outcomes, settings) = calibrated(&recordings, step)?;
    let files = inputs::listed(study_path, &step.recordings)?;
    let inputs = files.iter().map(|f| read::input("recording", f));
    let note = CalibrationNote {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        efficiency_convention: "exact".to_owned(),
        seed: None,
        reading: toml::Table::new(),
        inputs: inputs.collect::<Result<Vec<Input>, _>>()?,
    };
    let text = |estimator: &nav_sim::calibration::Estimator| {
        let own: Vec<&Outcome> = outcomes.iter().filter(|o| o.estimator == *estimator).collect();
        model_file::to_toml(&note.model_file(&own, &settings, None))
    };
    Ok(settings.estimators.iter().map(text).collect())
}

/// Everything that would stop a run later: one cell of each trajectory, truth and scenario is set up, and
/// every outage set must lie on every trajectory.
fn validate(planned: &Planned, study: &Path, session: &Session) -> Result<(), Failure> {
    let grid = &planned.grid;
    let mut inputs = Inputs::new(planned, study, session);
    let mut seen = std::collections::HashSet::new();
    let mut without = Vec::new();
    for index in 0..grid.len() {
        let cell = grid.cell(index);
        if seen.insert((cell.trajectory, cell.truth, cell.scenario, 0)) || grid.len() <= 64 {
            inputs.with_cell(cell, |_| Ok(()))?;
        }
        if seen.insert((cell.trajectory, cell.scenario, cell.outages, 1)) {
            let outages = inputs.outages(cell)?;
            for remark in &outages.remarks {
                session.printer.warn(&format!("{}: {remark}", grid.names(cell).join(", ")));
            }
            if outages.windows.is_empty() {
                without.push(planned.cell_name(cell));
            }
        }
    }
    warn_of_no_outages(&without, session);
    grid.doubts().iter().for_each(|doubt| session.printer.warn(doubt));
    Ok(())
}

fn warn_of_no_outages(cells: &[String], session: &Session) {
    const SHOWN: usize = 5;
    for name in cells.iter().take(SHOWN) {
        session.printer.warn(&format!("cell \"{name}\" has no outages: its table is empty"));
    }
    if cells.len() > SHOWN {
        session.printer.warn(&format!("{} more cells have no outages", cells.len() - SHOWN));
    }
}

/// Says what other plans left in the directory.
fn warn_of_leftovers(planned: &Planned, session: &Session) -> Result<(), Failure> {
    Count::of(planned)?.warn_of_foreign(planned, session);
    if let Some(path) = stale_results(planned) {
        let path = path.display();
        session.printer.warn(&format!("{path} holds the tables of another plan; `merge` replaces them"));
    }
    Ok(())
}

/// Times eight runs of the first cell, and sizes the units by it.
fn probe(planned: &mut Planned, study: &Path, session: &Session) -> Result<(), Failure> {
    let mut inputs = Inputs::new(planned, study, session);
    let (grid, plan) = (&planned.grid, &planned.plan);
    let first = grid.cell(0);
    let probed = inputs.with_cell(first, |simulation| {
        let start = Instant::now();
        let runs = plan.study.runs.min(LANES as u64);
        let results = run_unit(simulation, (0, runs), plan.kept(), &|| true, &|_| {}).unwrap_or_default();
        let epochs = results.first().map_or(0, |r| r.epochs.len());
        // Eight runs take as long as one: the lanes of the processor.
        Ok((start.elapsed().as_secs_f64() / LANES as f64, epochs, simulation.experiment().outages.len()))
    })?;
    let (run_s, epochs, outages) = probed;
    let durations = (0..grid.trajectories.len()).map(|t| inputs.duration_s(t));
    let durations = durations.collect::<Result<Vec<f64>, _>>()?;
    let scale: Vec<f64> = durations.iter().map(|d| d / durations[0]).collect();
    let run_s: Vec<f64> = scale.iter().map(|s| s * run_s).collect();
    let unit_runs: Vec<u64> = match plan.study.unit_runs {
        Some(runs) => vec![runs; run_s.len()],
        None => run_s.iter().map(|s| unit_runs(*s, plan.study.runs, session.threads())).collect(),
    };
    let long = |t: f64| if plan.kept() == Kept::AllEpochs { epochs as f64 * t } else { epochs as f64 };
    let per_cell = |t: usize| {
        let units = plan.study.runs.div_ceil(unit_runs[t]) as f64;
        let size = unit_file::size(
            grid.columns.len(),
            unit_runs[t].min(plan.study.runs),
            outages,
            long(scale[t]) as usize,
        );
        units * size
    };
    let bytes = (0..run_s.len()).map(per_cell).sum::<f64>() * grid.per_trajectory() as f64;
    let estimate = Estimate { run_s, threads: session.threads(), bytes };
    planned.plan.unit_runs = unit_runs;
    planned.plan.estimate = estimate;
    Ok(())
}

/// Runs of a unit that lasts about two minutes on these threads: a multiple of eight.
fn unit_runs(run_s: f64, runs: u64, threads: usize) -> u64 {
    let lanes = LANES as f64;
    let fit = (UNIT_S * threads as f64 / run_s / lanes).floor().max(1.0) * lanes;
    (fit.min(1e9) as u64).min(runs)
}

fn report(planned: &Planned, session: &Session) {
    let (plan, grid) = (&planned.plan, &planned.grid);
    let units = plan.unit_count(grid);
    let total_s: f64 = plan.units(grid).map(|unit| plan.unit_s(grid, unit)).sum();
    let wall_s = total_s / plan.estimate.threads.max(1) as f64;
    if session.json() {
        let json = json!({
            "schema_version": 1, "plan": plan.id(), "seed": plan.seed, "cells": grid.len(),
            "columns": grid.columns.len(), "runs": plan.study.runs, "units": units, "unit_runs": plan.unit_runs,
            "processor_s": total_s, "wall_s": wall_s, "threads": plan.estimate.threads,
            "disk_bytes": plan.estimate.bytes,
        });
        session.printer.result(&json.to_string());
        return;
    }
    session.printer.result(&format!(
        "{} cells × {} columns × {} runs, seed {}: {units} units of {} runs\nabout {} on {} threads, {} on disk",
        grid.len(),
        grid.columns.len(),
        plan.study.runs,
        plan.seed,
        range(&plan.unit_runs),
        duration(wall_s),
        plan.estimate.threads,
        size(plan.estimate.bytes)
    ));
}

fn range(values: &[u64]) -> String {
    match (values.iter().min(), values.iter().max()) {
        (Some(a), Some(b)) if a != b => format!("{a} to {b}"),
        (Some(a), _) => a.to_string(),
        _ => String::new(),
    }
}

/// A duration for people.
pub(super) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86400.0),
    }
}

fn size(bytes: f64) -> String {
    match bytes {
        b if b < 1e6 => format!("{:.0} kB", (b / 1e3).ceil()),
        b if b < 1e9 => format!("{:.0} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}
