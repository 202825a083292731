//! The files of a calibration: one model and its curves for each estimator.

use super::Args;
use crate::calibrate::{Calibration, CalibrationAnswer, CalibrationNote, FitsFile, ModelFiles};
use crate::cli::{Failure, Session, read};
use crate::report::Input;
use nav_sim_calibration::{Settings, diagnose};
use nav_sim_signal::wavelet::Convention;

/// How the recordings were read and grouped; of a curve nothing is known.
fn reading(args: &Args, settings: &Settings) -> toml::Table {
    if args.curve.is_some() {
        return toml::Table::new();
    }
    let mut table = args.recordings.provenance();
    table.insert("pool".to_owned(), args.pool.unwrap_or(settings.pool()).name().into());
    if let Some(scales) = args.tuning.levels() {
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
        efficiency_convention: Convention::Exact,
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
    session: &Session,
) -> Result<(), Failure> {
    let Calibration { groups, outcomes, settings, turn_on, .. } = calibration;
    let diagnoses = diagnose(groups, outcomes, settings);
    let files = ModelFiles::write_all(outputs, calibration, note, &diagnoses)?;
    let files: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    session.answer(&CalibrationAnswer {
        file: FitsFile::new(outcomes, &diagnoses, turn_on, settings, files.clone()),
        shown: calibration.shown(&diagnoses, |_| true),
    });
    if !files.is_empty() {
        session.say(format!("wrote {}", files.join(", ")));
    }
    Ok(())
}
