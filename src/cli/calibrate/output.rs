//! The files of a calibration: one model and its curves for each estimator.

use super::Args;
use crate::cli::pictures::PlotArgs;
use crate::cli::{Failure, Session, read};
use crate::formats::model_file::CalibrationNote;
use crate::jobs::{Calibration, ModelFiles};
use crate::report::{self, CurvesFile, FitsFile, Input};
use nav_sim_calibration::{Outcome, Settings, diagnose};

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
    let Calibration { groups, outcomes, settings, turn_on } = calibration;
    let diagnoses = diagnose(groups, outcomes, settings);
    let files = ModelFiles::write_all(outputs, calibration, note, &diagnoses)?;
    let files: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    let all: Vec<&Outcome> = outcomes.iter().collect();
    let drawn =
        plot.write(|| report::calibration_svg(&CurvesFile::new(groups, &all, settings), &diagnoses), session);
    if session.json() {
        let json = report::json(&FitsFile::new(outcomes, &diagnoses, turn_on, settings, files.clone()));
        session.result(json.trim_end());
    } else {
        let text = if session.verbose() {
            let replicates = report::describe_replicates(&diagnoses);
            let fits = outcomes.iter().map(|o| report::describe(o, settings));
            let means = report::turn_on_lines(turn_on);
            replicates.into_iter().chain(fits).chain(means).collect::<Vec<_>>().join("\n\n")
        } else {
            report::brief(outcomes, &diagnoses, turn_on, settings)
        };
        session.result(&text);
    }
    if !files.is_empty() {
        session.say(format!("wrote {}", files.join(", ")));
    }
    if outcomes.iter().any(|o| o.recordings > 1) {
        session.detail(WHICH);
    }
    drawn
}

/// Where the choice between estimators is made.
const WHICH: &str = "\
which model suits a filter is a question about navigation: nav-sim choose RECORDINGS --trajectory FILE leaves out one recording \
after the other";
