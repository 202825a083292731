//! The files of a calibration: one model and its curves for each estimator.

use super::{Args, WeightingArg};
use crate::cli::{Failure, Session};
use nav_sim::calibration::{Estimator, Group, Outcome, Settings, diagnose};
use nav_sim::data::atomic;
use nav_sim::data::model_file::{self, CalibrationNote};
use nav_sim::report::{self, CurvesFile, FitsFile, Input};
use std::path::{Path, PathBuf};

/// One estimator's files.
pub(super) struct Output {
    estimator: Estimator,
    model: PathBuf,
    curves: PathBuf,
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
) -> Result<Vec<Output>, Failure> {
    let output = |estimator: &Estimator| {
        let suffix = if estimators.len() > 1 { format!("_{}", estimator.name()) } else { String::new() };
        let model = with_suffix(out, &suffix);
        let curves = model.with_extension("wv.json");
        for path in [&model, &curves] {
            writable(path)?;
            atomic::guard_inputs(path, inputs.iter().map(PathBuf::as_path))?;
        }
        Ok(Output { estimator: *estimator, model, curves })
    };
    estimators.iter().map(output).collect()
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

pub(super) fn note(args: &Args, inputs: Vec<Input>, session: &Session) -> CalibrationNote {
    CalibrationNote {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        efficiency_convention: args.tuning.convention().to_owned(),
        weighting: match args.weighting {
            WeightingArg::Model => "model",
            WeightingArg::Edof => "edof",
            WeightingArg::Ci => "ci",
            WeightingArg::None => "none",
            WeightingArg::Full => "full",
        }
        .to_owned(),
        seed: (args.bootstrap > 0).then(|| session.seed(None)),
        inputs,
    }
}

/// Writes one model and its curves for each estimator, and prints the fits.
pub(super) fn finish(
    outputs: &[Output],
    groups: &[Group],
    outcomes: &[Outcome],
    settings: &Settings,
    note: &CalibrationNote,
    session: &Session,
) -> Result<(), Failure> {
    let mut files = Vec::new();
    for Output { estimator, model, curves } in outputs {
        let own: Vec<&Outcome> = outcomes.iter().filter(|o| o.estimator == *estimator).collect();
        atomic::write(curves, report::json(&CurvesFile::new(groups, &own, settings)))?;
        model_file::write(model, &note.model_file(groups, &own, settings))?;
        files.extend([model, curves].map(|p| p.display().to_string()));
    }
    let diagnoses = diagnose(groups, outcomes, settings);
    if session.json() {
        let json = report::json(&FitsFile::new(groups, outcomes, &diagnoses, settings, files.clone()));
        session.printer.result(json.trim_end());
    } else {
        let fits = outcomes.iter().map(|o| report::describe(&groups[o.group], o, settings));
        let texts = fits.chain(report::describe_replicates(&diagnoses, settings.rate_hz));
        session.printer.result(&texts.collect::<Vec<_>>().join("\n\n"));
    }
    for file in files {
        session.printer.say(&format!("wrote {file}"));
    }
    Ok(())
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let extension = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    path.with_file_name(format!("{stem}{suffix}{extension}"))
}
