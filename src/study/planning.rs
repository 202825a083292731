//! Planning: inputs checked and hashed, candidates calibrated, units cut.

use super::description::{CalibrateStep, Study, TruthEntry};
use super::directory;
use super::failure::StudyError;
use super::file::{StudyFile, beside};
use super::fingerprint::fingerprint;
use super::grid::Grid;
use super::inputs::{CALIBRATED, Inputs, ModelTexts, Work, unchanged};
use super::named_files;
use super::plan::{Estimate, Kept, Plan, Unit};
use super::planned::Planned;
use super::prepare::calibrated;
use super::reader::{CANDIDATE_SEED, Reader};
use super::remark::Remark;
use super::unit::{UnitResult, compute};
use super::unit_file;
use crate::formats::model_file::{self, CalibrationNote};
use crate::formats::{atomic, hash, input};
use crate::observer::Observer;
use crate::report::Input;
use nav_sim_calibration::{Estimator, Outcome};
use nav_sim_navigation::lanes::LANES;
use std::collections::HashSet;
use std::path::Path;

/// What a unit is made to last (s).
const UNIT_S: f64 = 120.0;

/// How to plan.
#[derive(Clone, Copy)]
pub struct PlanOptions<'a> {
    /// The seed, given the one of the study (or of the plan that is there), if it has one.
    pub seed: &'a dyn Fn(Option<u64>) -> u64,
    /// Threads that will work on a unit.
    pub threads: usize,
    /// Seconds since some instant, to time the probe with. Without it nothing is estimated, and units are as large as
    /// the study says: else all runs of a cell.
    pub clock: Option<&'a dyn Fn() -> f64>,
    /// Whether the plan and the calibrated models are written.
    pub writing: Writing,
}

/// Whether a plan is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writing {
    /// To the directory.
    Write,
    /// Only made.
    DryRun,
}

/// What planning found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PlanReport {
    /// The plan.
    pub planned: Planned,
    /// Whether it was there already: then nothing was written but models that were lost.
    pub was_there: bool,
}

/// Checks a study and everything it names, calibrates its candidates, times a probe (eight runs of the first cell)
/// and cuts the study into units. A plan of the same study that is there already is left as it is.
///
/// # Errors
/// When an input is refused, or another study was planned there.
pub fn plan(
    study: &Path,
    directory: &Path,
    options: &PlanOptions<'_>,
    observer: &dyn Observer<Remark>,
) -> Result<PlanReport, StudyError> {
    let file = named_files::read(study)?;
    let reader = Reader { study, observer };
    if options.writing == Writing::Write
        && let Some(plan) = directory::plan(directory)?
    {
        let seed = (options.seed)(Some(plan.seed));
        directory::same(directory, &plan, &file.study, Some(seed))?;
        let planned = Planned::new(study, directory, plan)?;
        restore(&planned, reader)?;
        return Ok(PlanReport { planned, was_there: true });
    }
    let seed = (options.seed)(file.study.seed);
    let (plan, texts) = prepared(file, seed, reader)?;
    let mut planned = Planned::new(study, directory, plan)?;
    validate(&planned, &texts, observer)?;
    probe(&mut planned, &texts, options, observer)?;
    planned.remark_leftovers(observer)?;
    if options.writing == Writing::Write {
        for (path, text) in &texts {
            atomic::write(&directory.join(path), text)?;
        }
        directory::write_plan(directory, &planned.plan)?;
    }
    Ok(PlanReport { planned, was_there: false })
}

/// The plan is there: its inputs must be what they were; models that are lost are made again.
fn restore(planned: &Planned, reader: Reader<'_>) -> Result<(), StudyError> {
    for input in &planned.plan.inputs {
        unchanged(&beside(&planned.study, Path::new(&input.path)), &input.blake3)?;
    }
    restore_models(planned, reader)?;
    planned.remark_leftovers(reader.observer)
}

/// Calibrates again what is lost or damaged in models/; it must be what the plan says.
fn restore_models(planned: &Planned, reader: Reader<'_>) -> Result<(), StudyError> {
    let Planned { plan, directory, .. } = planned;
    let whole = |m: &Input| hash::of_file(&directory.join(&m.path)).is_ok_and(|found| found == m.blake3);
    let lost: Vec<&Input> =
        plan.models.iter().flatten().filter(|m| m.role == CALIBRATED && !whole(m)).collect();
    if lost.is_empty() {
        return Ok(());
    }
    // models that are files of their own do not matter here
    let (_, texts) = models(&plan.study, plan.seed, &[], reader)?;
    for model in lost {
        let Some((path, text)) = texts.iter().find(|(path, _)| *path == model.path) else {
            return Err(StudyError::NotMadeAgain { model: model.path.clone() });
        };
        let path = directory.join(path);
        atomic::write(&path, text)?;
        reader.observer.remark(&Remark::ModelRestored { path });
    }
    Ok(())
}

/// The plan without its units, and the texts of the models calibrated for it.
fn prepared(file: StudyFile, seed: u64, reader: Reader<'_>) -> Result<(Plan, ModelTexts), StudyError> {
    let StudyFile { study, scenarios, gnss, unused } = file;
    reader.doubt(unused);
    let inputs = input_hashes(&study, reader)?;
    let trajectories = study.trajectory.iter().map(|e| hash_of(&inputs, &e.file)).collect();
    let truths = study.truth.iter().map(|e| reader.truth_hash(e, seed)).collect::<Result<_, _>>()?;
    let (models, texts) = models(&study, seed, &inputs, reader)?;
    let plan = Plan {
        schema_version: Plan::SCHEMA_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        numerics: fingerprint(),
        seed,
        unit_runs: vec![unit_runs_asked(&study).unwrap_or(study.runs_of_cell()); study.trajectory.len()],
        study,
        scenarios,
        gnss,
        trajectories,
        truths,
        models,
        inputs,
        estimate: Estimate::default(),
    };
    Ok((plan, texts))
}

/// Every file of the study with its hash, directories of recordings file by file.
fn input_hashes(study: &Study, reader: Reader<'_>) -> Result<Vec<Input>, StudyError> {
    let base = reader.study.parent().unwrap_or(Path::new(""));
    let mut found: Vec<Input> = Vec::new();
    for (role, path) in study.files() {
        for file in reader.listed(&[path.to_owned()])? {
            let relative = file.strip_prefix(base).unwrap_or(&file).display().to_string();
            let blake3 = input::input(role, &file)?.blake3;
            let known = found.iter().any(|i| i.path == relative && i.role == role);
            if !known {
                found.push(Input { role: role.to_owned(), path: relative, blake3 });
            }
        }
    }
    Ok(found)
}

/// The hash of one of the inputs.
fn hash_of(inputs: &[Input], path: &Path) -> String {
    let wanted = path.display().to_string();
    inputs.iter().find(|i| i.path == wanted).map(|i| i.blake3.clone()).unwrap_or_default()
}

/// The model of each candidate, or its models, one a truth; those of calibration steps are made here.
fn models(
    study: &Study,
    seed: u64,
    inputs: &[Input],
    reader: Reader<'_>,
) -> Result<(Vec<Vec<Input>>, ModelTexts), StudyError> {
    let (mut models, mut texts) = (Vec::new(), Vec::new());
    for entry in &study.candidate {
        if let Some(path) = &entry.model {
            let blake3 = hash_of(inputs, path);
            models.push(vec![Input { role: "model".into(), path: path.display().to_string(), blake3 }]);
        }
        let Some(step) = &entry.calibrate else { continue };
        let (candidate, estimators) =
            (entry.name.clone(), step.estimators.iter().map(Estimator::to_string).collect());
        reader.observer.remark(&Remark::Calibrating { candidate, estimators });
        let folds: Vec<Option<&TruthEntry>> =
            if step.leave_out { study.truth.iter().map(Some).collect() } else { vec![None] };
        let mut of_estimators = vec![Vec::new(); step.estimators.len()];
        for without in folds {
            let made = calibration(step, without, seed, reader).map_err(|source| StudyError::Candidate {
                candidate: entry.name.clone(),
                source: Box::new(source),
            })?;
            for ((estimator, text), files) in step.estimators.iter().zip(made).zip(&mut of_estimators) {
                let fold = without.map_or(String::new(), |truth| format!("_without_{}", truth.name));
                let prepared = calibrated_file(&format!("{}_{estimator}{fold}", entry.name), &text);
                texts.push((prepared.path.clone(), text));
                files.push(prepared);
            }
        }
        models.extend(of_estimators);
    }
    Ok((models, texts))
}

/// Where a calibrated model will lie.
fn calibrated_file(name: &str, text: &str) -> Input {
    let blake3 = hash::of_bytes(text.as_bytes());
    let tame = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(tame).collect();
    Input { role: CALIBRATED.into(), path: format!("models/{name}_{}.toml", &blake3[..8]), blake3 }
}

/// Model files of a calibration step, one an estimator, without the recordings of a truth.
fn calibration(
    step: &CalibrateStep,
    without: Option<&TruthEntry>,
    seed: u64,
    reader: Reader<'_>,
) -> Result<Vec<String>, StudyError> {
    let (recordings, files) = match (&step.synthesize, without) {
        (Some(synthesis), _) => {
            (reader.synthesised(synthesis, seed.wrapping_add(CANDIDATE_SEED))?, Vec::new())
        }
        (None, Some(truth)) => {
            let files = reader.others(&step.recordings, truth)?;
            (reader.recordings_in(&files, step.rate_hz)?, files)
        }
        (None, None) => {
            (reader.recordings(&step.recordings, step.rate_hz)?, reader.listed(&step.recordings)?)
        }
    };
    let (outcomes, settings) = calibrated(&recordings, step)?;
    let inputs = files.iter().map(|file| input::input("recording", file));
    let note = CalibrationNote {
        efficiency_convention: step.efficiency_convention.unwrap_or_default().to_string(),
        seed: None,
        reading: toml::Table::new(),
        inputs: inputs.collect::<Result<Vec<Input>, _>>()?,
    };
    let text = |estimator: &Estimator| {
        let chosen: Vec<&Outcome> = outcomes.iter().filter(|o| o.estimator == *estimator).collect();
        model_file::to_toml(&note.model_file(&chosen, &settings, None))
    };
    Ok(settings.estimators.iter().map(text).collect())
}

/// Everything that would stop a run later: one cell of each trajectory, truth and scenario is set up, and
/// every outage set must lie on every trajectory.
fn validate(
    planned: &Planned,
    texts: &ModelTexts,
    observer: &dyn Observer<Remark>,
) -> Result<(), StudyError> {
    let grid = &planned.grid;
    let mut inputs = Inputs::new(planned, observer).with_models(texts);
    let (mut set_up, mut placed) = (HashSet::new(), HashSet::new());
    let mut without = Vec::new();
    for index in 0..grid.len() {
        let cell = grid.cell(index);
        if set_up.insert((cell.trajectory, cell.truth, cell.scenario)) || grid.len() <= 64 {
            inputs.check_cell(cell)?;
        }
        if placed.insert((cell.trajectory, cell.scenario, cell.outages)) {
            let outages = inputs.outages(cell)?;
            for remark in outages.remarks {
                observer.remark(&Remark::Outage { cell: grid.names(cell).join(", "), remark });
            }
            if outages.windows.is_empty() {
                without.push(grid.short_name(cell));
            }
        }
    }
    remark_no_outages(without, observer);
    grid.doubts().into_iter().for_each(|doubt| observer.remark(&Remark::FilterDoubt(doubt)));
    Ok(())
}

fn remark_no_outages(mut cells: Vec<String>, observer: &dyn Observer<Remark>) {
    const SHOWN: usize = 5;
    let more = cells.len().saturating_sub(SHOWN);
    cells.truncate(SHOWN);
    cells.into_iter().for_each(|cell| observer.remark(&Remark::NoOutages { cell }));
    if more > 0 {
        observer.remark(&Remark::MoreWithoutOutages { cells: more });
    }
}

/// Times the covariance analysis of the first cell, or eight runs of it, and sizes the units by it.
fn probe(
    planned: &mut Planned,
    texts: &ModelTexts,
    options: &PlanOptions<'_>,
    observer: &dyn Observer<Remark>,
) -> Result<(), StudyError> {
    let Some(clock) = options.clock else { return Ok(()) };
    let mut inputs = Inputs::new(planned, observer).with_models(texts);
    let (grid, plan) = (&planned.grid, &planned.plan);
    let Probe { run_s, unit } = probed(plan, grid, &mut inputs, (clock, options.threads))?;
    let epochs = unit.columns.first().map_or(0, |c| c.epochs().len());
    let durations = (0..grid.trajectories.len()).map(|t| inputs.duration_s(t));
    let durations = durations.collect::<Result<Vec<f64>, _>>()?;
    let scale: Vec<f64> = durations.iter().map(|d| d / durations[0]).collect();
    let run_s: Vec<f64> = scale.iter().map(|s| s * run_s).collect();
    let unit_runs: Vec<u64> = match unit_runs_asked(&plan.study) {
        Some(runs) => vec![runs; run_s.len()],
        None => run_s.iter().map(|s| unit_runs(*s, plan.runs(), options.threads)).collect(),
    };
    // epochs inside outages are as many on any trajectory
    let is_all = plan.kept() == Kept::AllEpochs;
    let bytes_per_cell = |t: usize| {
        let units = plan.runs().div_ceil(unit_runs[t]) as f64;
        let epochs = if is_all { (epochs as f64 * scale[t]) as usize } else { epochs };
        units * unit_file::size(&unit, unit_runs[t].min(plan.runs()), epochs)
    };
    let bytes = (0..run_s.len()).map(bytes_per_cell).sum::<f64>() * grid.per_trajectory() as f64;
    planned.plan.estimate = Estimate { run_s, threads: options.threads, bytes };
    planned.plan.unit_runs = unit_runs;
    Ok(())
}

/// A first unit, and the processor time of one of its runs (s).
struct Probe {
    run_s: f64,
    unit: UnitResult,
}

fn probed(
    plan: &Plan,
    grid: &Grid,
    inputs: &mut Inputs<'_>,
    (clock, threads): (&dyn Fn() -> f64, usize),
) -> Result<Probe, StudyError> {
    let runs = plan.runs().min(LANES as u64);
    let unit = Unit { index: 0, cell: 0, first: 0, runs };
    let before_s = clock();
    inputs.with_cell(grid.cell(0), |work| {
        let start_s = clock();
        let unit = compute(plan, work, (unit, ""), &|| true, &|_| {})?.expect("nothing stops it");
        let run_s = match work {
            // Eight runs take as long as one: the lanes of the processor.
            Work::Sampling(_) => (clock() - start_s) / LANES as f64,
            // Setting up takes most of it; columns share the threads.
            Work::Analysis(_) => (clock() - before_s) * threads.min(grid.columns.len()).max(1) as f64,
        };
        Ok(Probe { run_s, unit })
    })
}

/// What the study says of the size of units; covariance analysis has one unit a cell.
const fn unit_runs_asked(study: &Study) -> Option<u64> {
    if study.is_sampled() { study.unit_runs } else { Some(1) }
}

/// Runs of a unit that lasts about two minutes on these threads: a multiple of eight.
fn unit_runs(run_s: f64, runs: u64, threads: usize) -> u64 {
    let lanes = LANES as f64;
    let fit = (UNIT_S * threads as f64 / run_s / lanes).floor().max(1.0) * lanes;
    (fit.min(1e9) as u64).min(runs)
}
