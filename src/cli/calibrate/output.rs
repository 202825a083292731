//! The files of a calibration: one model and its curves for each estimator.

use super::Args;
use crate::calibration::{Estimator, Outcome, Settings, diagnose};
use crate::cli::pictures::{PlotArgs, replaceable};
use crate::cli::{Failure, Session, read};
use crate::formats::atomic;
use crate::formats::model_file::{self, CalibrationNote};
use crate::jobs::{Calibration, ModelFiles};
use crate::report::{self, CurvesFile, FitsFile, Input};
use std::path::{Path, PathBuf};

/// Refuses at once what would be refused after the work: a file that is no calibration is another result, and with a seed
/// that is drawn the bootstrap, and so the file, is another too.
pub(super) fn not_anew(out: &Path, draws: bool, session: &Session) -> Result<(), Failure> {
    if (draws && session.asked_seed().is_none()) || !is_calibrated(out) {
        atomic::guard_contents(out, &[], session.existing())?;
    }
    Ok(())
}

/// Fails before the work is done, not after, if nothing can be written there.
pub(super) fn writable(out: &Path) -> Result<(), Failure> {
    regular(out)?;
    drop(atomic::AtomicFile::create(out)?);
    Ok(())
}

/// The files of each estimator, none of them an input.
pub(super) fn outputs(
    out: &Path,
    estimators: &[Estimator],
    inputs: &[PathBuf],
) -> Result<Vec<ModelFiles>, Failure> {
    let outputs = ModelFiles::of(out, estimators);
    for path in outputs.iter().flat_map(|f| [&f.model, &f.curves, &f.draws, &f.page]) {
        writable(path)?;
        atomic::guard_inputs(path, inputs.iter().map(PathBuf::as_path))?;
    }
    outputs.iter().try_for_each(|files| replaceable(&files.page))?;
    Ok(outputs)
}

/// Refuses an output that cannot be replaced by a file: several are made of it, by its name.
fn regular(out: &Path) -> Result<(), Failure> {
    let refuse = |what: &str| {
        Err(Failure::input(format!("--out {}: it is a {what}", out.display()))
            .hint("name a file, such as model.toml"))
    };
    match std::fs::metadata(out) {
        Ok(m) if m.is_dir() => refuse("directory"),
        Ok(m) if !m.is_file() => refuse("device, and a model is a file with its curves beside it"),
        _ if out.file_name().is_none() || out.as_os_str().to_string_lossy().ends_with('/') => {
            refuse("directory")
        }
        _ => Ok(()),
    }
}

/// How the recordings were read and grouped; of a curve nothing is known.
fn reading(args: &Args, settings: &Settings) -> toml::Table {
    if args.curve.is_some() {
        return toml::Table::new();
    }
    let mut table = args.recordings.provenance();
    table.insert("pool".to_owned(), args.pool.unwrap_or(settings.pool()).name().into());
    if let Some(scales) = args.tuning.scales {
        table.insert("scales".to_owned(), i64::from(scales).into());
    }
    table
}

/// What is recorded of a calibration. `inputs`: what was fitted; the parameters file is added.
pub(super) fn note(
    args: &Args,
    settings: &Settings,
    mut inputs: Vec<Input>,
    session: &Session,
) -> Result<CalibrationNote, Failure> {
    if let Some(path) = &args.parameters {
        inputs.push(read::input("parameters", path)?);
    }
    Ok(CalibrationNote {
        efficiency_convention: args.tuning.convention().to_owned(),
        reading: reading(args, settings),
        seed: (args.bootstrap > 0).then(|| session.seed(None)),
        inputs,
    })
}

/// Writes one model and its curves for each estimator, and prints the fits.
pub(super) fn finish(
    outputs: &[ModelFiles],
    calibration: &Calibration,
    note: &CalibrationNote,
    plot: &PlotArgs,
    session: &Session,
) -> Result<(), Failure> {
    for output in outputs {
        output.guard(calibration, note, session.existing())?;
    }
    let Calibration { groups, outcomes, settings, turn_on } = calibration;
    let diagnoses = diagnose(groups, outcomes, settings);
    let mut files = Vec::new();
    for output in outputs {
        output.write(calibration, note)?;
        output.write_page(calibration, &diagnoses)?;
        let draws = calibration.outcomes.iter().any(|o| o.inference.is_some()).then_some(&output.draws);
        let written = [&output.model, &output.curves].into_iter().chain(draws).chain([&output.page]);
        files.extend(written.map(|p| p.display().to_string()));
    }
    let all: Vec<&Outcome> = outcomes.iter().collect();
    plot.write(|| report::calibration_svg(&CurvesFile::new(groups, &all, settings), &diagnoses), session)?;
    if session.json() {
        let json = report::json(&FitsFile::new(outcomes, &diagnoses, turn_on, settings, files.clone()));
        session.printer.result(json.trim_end());
    } else {
        let text = if session.verbose() {
            let replicates = report::describe_replicates(&diagnoses);
            let fits = outcomes.iter().map(|o| report::describe(o, settings));
            let means = report::turn_on_lines(turn_on);
            replicates.into_iter().chain(fits).chain(means).collect::<Vec<_>>().join("\n\n")
        } else {
            report::brief(outcomes, &diagnoses, turn_on, settings)
        };
        session.printer.result(&text);
    }
    if !files.is_empty() {
        session.printer.say(&format!("wrote {}", files.join(", ")));
    }
    if outcomes.iter().any(|o| o.recordings > 1) {
        session.printer.detail(WHICH);
    }
    Ok(())
}

/// Where the choice between estimators is made.
const WHICH: &str = "\
which model suits a filter is a question about navigation: nav-sim choose RECORDINGS --trajectory FILE leaves out one recording \
after the other";

/// Refuses to replace a file of the default name that no calibration wrote: nobody asked for it by name.
pub(super) fn not_of_others(out: &Path) -> Result<(), Failure> {
    if !out.exists() {
        return Ok(());
    }
    if is_calibrated(out) {
        return Ok(());
    }
    let message =
        format!("{} is not a model that nav-sim calibrate wrote: it is not replaced", out.display());
    Err(Failure::input(message).hint("name the output with -o, or move that file away"))
}

/// Whether a file is a model that a calibration wrote.
fn is_calibrated(path: &Path) -> bool {
    let provenance = model_file::read(path).ok().and_then(|file| file.provenance);
    provenance.is_some_and(|p| {
        let program = p.get("program").and_then(toml::Value::as_str);
        program.is_some_and(|name| name.starts_with("nav-sim")) && p.contains_key("estimator")
    })
}
