//! The models of a study's candidates: files of their own, or calibrated when the study is planned.

use super::description::{CalibrateStep, Study, TruthEntry};
use super::failure::StudyError;
use super::plan::CALIBRATED;
use super::reader::{CANDIDATE_SEED, Reader};
use crate::app::Input;
use crate::calibrate::CalibrationNote;
use crate::formats::{hash, input, model_file};
use nav_sim_calibration::{
    Estimator, Outcome, Pool, Settings, Trim, calibrate, grouped, replicates,
};
use nav_sim_signal::imu::Recording;
use nav_sim_signal::wavelet::Tuning;
use rayon::prelude::*;

/// Model files that are made and not written yet: path in the study's directory, contents.
pub(super) type ModelTexts = Vec<(String, String)>;

/// The model files of each candidate: one, or one a truth that it leaves out. `model` is the input of a given file;
/// the others are calibrated here.
pub(super) fn models(
    study: &Study,
    seed: u64,
    model: &dyn Fn(&std::path::Path) -> Input,
    reader: Reader<'_>,
) -> Result<(Vec<Vec<Input>>, ModelTexts), StudyError> {
    let (mut models, mut texts) = (Vec::new(), Vec::new());
    for entry in &study.candidate {
        models.extend(entry.model.iter().map(|path| vec![model(path)]));
        let Some(step) = &entry.calibrate else {
            continue;
        };
        let estimators: Vec<&str> = step.estimators.iter().map(|e| e.name()).collect();
        reader.context.remark(format!(
            "calibrating {} ({})",
            entry.name,
            estimators.join(", ")
        ));
        let folds: Vec<Option<&TruthEntry>> = if step.leave_out {
            study.truth.iter().map(Some).collect()
        } else {
            vec![None]
        };
        let mut of_estimators = vec![Vec::new(); step.estimators.len()];
        for without in folds {
            let made = calibrated(&entry.name, step, without, seed, reader)?;
            for ((estimator, text), files) in
                step.estimators.iter().zip(made).zip(&mut of_estimators)
            {
                let fold =
                    without.map_or(String::new(), |truth| format!("_without_{}", truth.name));
                let blake3 = hash::of_bytes(text.as_bytes());
                let tame = |c: char| {
                    if c.is_alphanumeric() || "-_.".contains(c) {
                        c
                    } else {
                        '_'
                    }
                };
                let name: String = format!("{}_{estimator}{fold}", entry.name)
                    .chars()
                    .map(tame)
                    .collect();
                let path = format!("models/{name}_{}.toml", &blake3[..8]);
                texts.push((path.clone(), text));
                files.push(Input {
                    role: CALIBRATED.into(),
                    path,
                    blake3,
                });
            }
        }
        models.extend(of_estimators);
    }
    Ok((models, texts))
}

/// Model files of a calibration step, one an estimator, without the recordings of a truth.
fn calibrated(
    candidate: &str,
    step: &CalibrateStep,
    without: Option<&TruthEntry>,
    seed: u64,
    reader: Reader<'_>,
) -> Result<Vec<String>, StudyError> {
    let (recordings, files) = match (&step.synthesize, without) {
        (Some(synthesis), _) => (
            reader.synthesised(synthesis, seed.wrapping_add(CANDIDATE_SEED))?,
            Vec::new(),
        ),
        (None, Some(truth)) => {
            let files = reader.others(&step.recordings, truth)?;
            (reader.recordings(&files, step.rate_hz)?, files)
        }
        (None, None) => {
            let paths = reader.beside(&step.recordings);
            (
                reader.recordings(&paths, step.rate_hz)?,
                input::listed(&paths)?,
            )
        }
    };
    let (outcomes, settings) = fitted(candidate, &recordings, step)?;
    let inputs = files.iter().map(|file| input::input("recording", file));
    let note = CalibrationNote {
        efficiency_convention: step.efficiency_convention.unwrap_or_default(),
        seed: None,
        reading: toml::Table::new(),
        inputs: inputs.collect::<Result<Vec<Input>, _>>()?,
    };
    let text = |estimator: &Estimator| {
        let chosen: Vec<&Outcome> = outcomes
            .iter()
            .filter(|o| o.estimator == *estimator)
            .collect();
        model_file::to_toml(&note.model_file(&chosen, &settings, None))
    };
    Ok(settings.estimators.iter().map(text).collect())
}

/// Fits of all estimators of a step to recordings, as `nav-sim calibrate` makes them.
fn fitted(
    candidate: &str,
    recordings: &[Recording],
    step: &CalibrateStep,
) -> Result<(Vec<Outcome>, Settings), StudyError> {
    let convention = step.efficiency_convention.unwrap_or_default();
    let settings = Settings {
        estimators: step.estimators.clone(),
        model: step
            .fit
            .parse()
            .map_err(|e| StudyError::unfit(candidate, e))?,
        trim: step.trim.map_or(Trim::default(), Trim::Count),
        tuning: Tuning::new(step.efficiency, convention)
            .map_err(|e| StudyError::unfit(candidate, e))?,
        weighting: step.weighting.unwrap_or_default(),
        rate_hz: recordings.first().map_or(1.0, |r| r.rate_hz),
        ..Settings::default()
    };
    let pool = step.pool.unwrap_or_else(|| settings.pool());
    if let Some(estimator) = settings.estimators.iter().find(|e| e.is_single()) {
        if recordings.len() > 1 {
            let reason = format!(
                "{estimator} takes a single recording; there are {}",
                recordings.len()
            );
            return Err(StudyError::unfit(candidate, reason));
        }
        if pool != Pool::Axes {
            return Err(StudyError::unfit(
                candidate,
                format!("{estimator} needs pool = \"axes\""),
            ));
        }
    }
    let curves_of = |recording| replicates(recording, step.scales, &settings.tuning);
    let measured: Result<Vec<_>, _> = recordings.par_iter().map(curves_of).collect();
    let measured = measured.map_err(|e| StudyError::unfit(candidate, e))?;
    let outcomes = calibrate(&grouped(measured.concat(), pool), &settings);
    Ok((
        outcomes.map_err(|e| StudyError::unfit(candidate, e))?,
        settings,
    ))
}
