//! Planning: inputs checked and hashed, candidates calibrated, units cut.

use super::calibrating::{ModelTexts, models};
use super::description::Study;
use super::failure::StudyError;
use super::file::{StudyFile, beside};
use super::fingerprint::fingerprint;
use super::inputs::{Inputs, Work};
use super::named_files;
use super::plan::{CALIBRATED, Estimate, Kept, Plan, Unit};
use super::planned::{Planned, plan_in};
use super::reader::{Reader, unchanged};
use super::unit_file;
use crate::app::Context;
use crate::app::Input;
use crate::formats::{FileError, atomic, hash, input};
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
    context: &Context<'_>,
) -> Result<PlanReport, StudyError> {
    let file = named_files::read(study)?;
    let reader = Reader { study, context };
    if options.writing == Writing::Write
        && let Some(plan) = plan_in(directory)?
    {
        let seed = (options.seed)(Some(plan.seed));
        let planned = Planned::new(study, directory, plan)?;
        planned.must_be_of(&file.study, Some(seed))?;
        restore(&planned, reader)?;
        planned.remark_foreign(context)?;
        return Ok(PlanReport {
            planned,
            was_there: true,
        });
    }
    let seed = (options.seed)(file.study.seed);
    let (plan, texts) = prepared(file, seed, reader)?;
    let mut planned = Planned::new(study, directory, plan)?;
    validate(&planned, &texts, context)?;
    probe(&mut planned, &texts, options, context)?;
    planned.check_units()?;
    planned.remark_foreign(context)?;
    if options.writing == Writing::Write {
        for (path, text) in &texts {
            atomic::write(&directory.join(path), text)?;
        }
        planned.write_plan()?;
    }
    Ok(PlanReport {
        planned,
        was_there: false,
    })
}

/// The plan is there: its inputs must be what they were; calibrated models that are lost or damaged are made again.
fn restore(planned: &Planned, reader: Reader<'_>) -> Result<(), StudyError> {
    let Planned {
        plan,
        directory,
        study,
        ..
    } = planned;
    for input in &plan.inputs {
        unchanged(&beside(study, Path::new(&input.path)), &input.blake3)?;
    }
    let is_whole =
        |m: &Input| hash::of_file(&directory.join(&m.path)).is_ok_and(|found| found == m.blake3);
    let mut lost = plan
        .models
        .iter()
        .flatten()
        .filter(|m| m.role == CALIBRATED && !is_whole(m))
        .peekable();
    if lost.peek().is_none() {
        return Ok(());
    }
    let (_, texts) = models(
        &plan.study,
        plan.seed,
        &|path| input_of(&plan.inputs, path),
        reader,
    )?;
    for model in lost {
        let path = directory.join(&model.path);
        // made otherwise by another build: it has another name
        let Some((_, text)) = texts.iter().find(|(made, _)| *made == model.path) else {
            return Err(StudyError::Changed {
                what: path.display().to_string(),
            });
        };
        atomic::write(&path, text)?;
        reader
            .context
            .remark(format!("wrote {} again", path.display()));
    }
    Ok(())
}

/// The plan without its units, and the texts of the models calibrated for it.
fn prepared(
    file: StudyFile,
    seed: u64,
    reader: Reader<'_>,
) -> Result<(Plan, ModelTexts), StudyError> {
    let StudyFile {
        study,
        scenarios,
        gnss,
        unused,
    } = file;
    reader.doubt(unused);
    let inputs = input_hashes(&study, reader)?;
    let trajectories = study
        .trajectory
        .iter()
        .map(|e| input_of(&inputs, &e.file).blake3)
        .collect();
    let truths = study
        .truth
        .iter()
        .map(|e| reader.truth_hash(e, seed))
        .collect::<Result<_, _>>()?;
    let (models, texts) = models(&study, seed, &|path| input_of(&inputs, path), reader)?;
    let plan = Plan {
        schema_version: Plan::SCHEMA_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        numerics: fingerprint(),
        seed,
        unit_runs: vec![
            unit_runs_asked(&study).unwrap_or(study.runs_of_cell());
            study.trajectory.len()
        ],
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
fn input_hashes(study: &Study, reader: Reader<'_>) -> Result<Vec<Input>, FileError> {
    let base = reader.study.parent().unwrap_or(Path::new(""));
    let mut found: Vec<Input> = Vec::new();
    for (role, path) in study.files() {
        for file in input::listed(&[beside(reader.study, path)])? {
            let relative = file
                .strip_prefix(base)
                .unwrap_or(&file)
                .display()
                .to_string();
            let input = Input {
                path: relative,
                ..input::input(role, &file)?
            };
            if !found.contains(&input) {
                found.push(input);
            }
        }
    }
    Ok(found)
}

/// The model file, or whatever else, at a path of the study.
fn input_of(inputs: &[Input], path: &Path) -> Input {
    let path = path.display().to_string();
    let blake3 = inputs
        .iter()
        .find(|i| i.path == path)
        .map(|i| i.blake3.clone())
        .unwrap_or_default();
    Input {
        role: "model".to_owned(),
        path,
        blake3,
    }
}

/// Everything that would stop a run later: one cell of each trajectory, truth and scenario is set up, and
/// every outage set must lie on every trajectory.
fn validate(
    planned: &Planned,
    texts: &ModelTexts,
    context: &Context<'_>,
) -> Result<(), StudyError> {
    let grid = &planned.grid;
    let mut inputs = Inputs::new(planned, texts, context);
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
                let text = format!("{}: {remark}", grid.names(cell).join(", "));
                context.warn(text);
            }
            if outages.windows.is_empty() {
                without.push(grid.short_name(cell));
            }
        }
    }
    match without.as_slice() {
        [] => {}
        [cell] => {
            context.warn(format!(
                "cell \"{cell}\" has no outages: its table is empty"
            ));
        }
        [cell, ..] => {
            let text = format!(
                "{} cells have no outages, such as \"{cell}\": their tables are empty",
                without.len()
            );
            context.warn(text);
        }
    }
    grid.doubts()
        .into_iter()
        .for_each(|doubt| context.warn(doubt));
    Ok(())
}

/// Times the covariance analysis of the first cell, or eight runs of it, and sizes the units by it.
fn probe(
    planned: &mut Planned,
    texts: &ModelTexts,
    options: &PlanOptions<'_>,
    context: &Context<'_>,
) -> Result<(), StudyError> {
    let Some(clock) = options.clock else {
        return Ok(());
    };
    let mut inputs = Inputs::new(planned, texts, context);
    let (grid, plan) = (&planned.grid, &planned.plan);
    let first = Unit {
        index: 0,
        cell: 0,
        first: 0,
        runs: plan.runs().min(LANES as u64),
    };
    let before_s = clock();
    let (run_s, unit) = inputs.with_cell(grid.cell(0), |work| {
        let start_s = clock();
        let unit = work
            .unit(planned, (first, ""), &Context::default())?
            .expect("nothing stops it");
        let run_s = match work {
            // Eight runs take as long as one: the lanes of the processor.
            Work::Sampling(_) => (clock() - start_s) / LANES as f64,
            // Setting up takes most of it; columns share the threads.
            Work::Analysis { .. } => {
                (clock() - before_s) * options.threads.min(grid.columns.len()).max(1) as f64
            }
        };
        Ok((run_s, unit))
    })?;
    let epochs = unit.columns.first().map_or(0, |c| c.epochs().len());
    let durations = (0..grid.trajectories.len()).map(|t| inputs.duration_s(t));
    let durations = durations.collect::<Result<Vec<f64>, _>>()?;
    let scale: Vec<f64> = durations.iter().map(|d| d / durations[0]).collect();
    let run_s: Vec<f64> = scale.iter().map(|s| s * run_s).collect();
    let unit_runs: Vec<u64> = match unit_runs_asked(&plan.study) {
        Some(runs) => vec![runs; run_s.len()],
        None => run_s
            .iter()
            .map(|s| unit_runs(*s, plan.runs(), options.threads))
            .collect(),
    };
    // epochs inside outages are as many on any trajectory
    let is_all = plan.kept() == Kept::AllEpochs;
    let bytes_per_cell = |t: usize| {
        let units = plan.runs().div_ceil(unit_runs[t]) as f64;
        let epochs = if is_all {
            (epochs as f64 * scale[t]) as usize
        } else {
            epochs
        };
        units * unit_file::size(&unit, unit_runs[t].min(plan.runs()), epochs)
    };
    let bytes = (0..run_s.len()).map(bytes_per_cell).sum::<f64>() * grid.per_trajectory() as f64;
    planned.plan.estimate = Estimate {
        run_s,
        threads: options.threads,
        bytes,
    };
    planned.plan.unit_runs = unit_runs;
    Ok(())
}

/// What the study says of the size of units; covariance analysis has one unit a cell.
const fn unit_runs_asked(study: &Study) -> Option<u64> {
    if study.is_sampled() {
        study.unit_runs
    } else {
        Some(1)
    }
}

/// Runs of a unit that lasts about two minutes on these threads: a multiple of eight.
fn unit_runs(run_s: f64, runs: u64, threads: usize) -> u64 {
    let lanes = LANES as f64;
    let fit = (UNIT_S * threads as f64 / run_s / lanes).floor().max(1.0) * lanes;
    (fit.min(1e9) as u64).min(runs)
}
