//! The files of a calibration: for each estimator a model, the curves behind it and the draws behind its intervals.

use super::Calibration;
use crate::formats::atomic::{self, AtomicFile, Claim, Existing};
use crate::formats::draws_file::{self, DrawsFile};
use crate::formats::model_file::{self, CalibrationNote, ModelFile};
use crate::formats::{FileError, Place, Setting, hash};
use crate::report::{self, CurvesFile};
use nav_sim_calibration::{Diagnosis, Estimator, Outcome};
use nav_sim_signal::noise::Model;
use std::path::{Path, PathBuf};

/// The files of one estimator.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ModelFiles {
    /// The estimator.
    pub estimator: Estimator,
    /// The model file.
    pub model: PathBuf,
    /// The curves, `<model>.wv.json` beside it.
    pub curves: PathBuf,
    /// The page, `<model>.html` beside it.
    pub page: PathBuf,
    /// The draws behind its intervals, `<model>.draws.json` beside it.
    pub draws: PathBuf,
}

impl ModelFiles {
    /// The files of each estimator: of several `<out>_<estimator>.toml`.
    pub(crate) fn of(out: &Path, estimators: &[Estimator]) -> Vec<Self> {
        let files = |estimator: &Estimator| {
            let suffix = if estimators.len() > 1 { format!("_{estimator}") } else { String::new() };
            let model = with_suffix(out, &suffix);
            let (curves, page) = (model.with_extension("wv.json"), model.with_extension("html"));
            Self { estimator: *estimator, curves, draws: draws_file::beside(&model), page, model }
        };
        estimators.iter().map(files).collect()
    }

    /// The files of each estimator, claimed before the work but for `out` itself, and none of them an input.
    ///
    /// # Errors
    /// When one cannot be made, is an input, or another command writes it.
    pub(crate) fn claim(
        out: &Path,
        estimators: &[Estimator],
        inputs: &[PathBuf],
    ) -> Result<(Vec<Self>, Vec<Claim>), FileError> {
        let all = Self::of(out, estimators);
        let inputs = || inputs.iter().map(PathBuf::as_path);
        atomic::guard_inputs(out, inputs())?;
        // What stands beside a model is claimed even where it is called like `out`: it would replace the model.
        let models = all.iter().map(|f| &f.model).filter(|path| *path != out);
        let others = models.chain(all.iter().flat_map(|f| [&f.curves, &f.draws, &f.page]));
        let claims = others.map(|path| atomic::claim_file(path, inputs())).collect::<Result<_, _>>()?;
        Ok((all, claims))
    }

    /// Where the files go: beside other models that are there and are to stay.
    pub(crate) fn placed(
        &self,
        calibration: &Calibration,
        note: &CalibrationNote,
        existing: Existing,
    ) -> Self {
        let (curves, model) = self.contents(calibration, note);
        let model = model_file::to_toml(&model);
        let files_of_path = |path: &Path| Self::of(path, &[self.estimator]).remove(0);
        let is_usable = |path: &Path| {
            atomic::guard_contents(path, model.as_bytes(), existing)
                .and_then(|()| {
                    atomic::guard_contents(&files_of_path(path).curves, curves.as_bytes(), existing)
                })
                .is_ok()
        };
        if is_usable(&self.model) {
            self.clone()
        } else {
            files_of_path(&atomic::name_beside(&self.model, is_usable))
        }
    }

    /// Refuses what had to be written beside.
    ///
    /// # Errors
    /// When it was.
    pub(crate) fn refuse_beside(&self, placed: &Self) -> Result<(), FileError> {
        if placed == self { Ok(()) } else { Err(atomic::kept_beside(&self.model, &placed.model)) }
    }

    /// Writes the files of all estimators, the pages among them; their names.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write_all<'a>(
        all: &'a [Self],
        calibration: &Calibration,
        note: &CalibrationNote,
        diagnoses: &[Diagnosis],
    ) -> Result<Vec<&'a Path>, FileError> {
        let has_draws = calibration.outcomes.iter().any(|o| o.inference.is_some());
        let mut written = Vec::new();
        for files in all {
            files.write(calibration, note)?;
            files.write_page(calibration, diagnoses)?;
            let draws = has_draws.then_some(&files.draws);
            written.extend([&files.model, &files.curves].into_iter().chain(draws).chain([&files.page]));
        }
        Ok(written.into_iter().map(PathBuf::as_path).collect())
    }

    fn contents(&self, calibration: &Calibration, note: &CalibrationNote) -> (String, ModelFile) {
        let Calibration { groups, outcomes, settings, turn_on } = calibration;
        let chosen: Vec<&Outcome> = outcomes.iter().filter(|o| o.estimator == self.estimator).collect();
        let curves = report::json(&CurvesFile::new(groups, &chosen, settings));
        let blake3 = hash::of_bytes(curves.as_bytes());
        let means = turn_on.iter().filter(|t| t.estimator == self.estimator);
        let model = note.model_file(&chosen, settings, Some(&blake3)).with_turn_on(means);
        (curves, model)
    }

    /// Writes the models of the estimator, with the hash of their curves in them.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write(&self, calibration: &Calibration, note: &CalibrationNote) -> Result<(), FileError> {
        let (curves, model) = self.contents(calibration, note);
        let chosen: Vec<&Outcome> =
            calibration.outcomes.iter().filter(|o| o.estimator == self.estimator).collect();
        let draws = DrawsFile::of(&chosen, calibration.settings.rate_hz);
        let draws =
            draws.map(|draws| serde_json::to_string(&draws).expect("plain structs are always JSON") + "\n");
        // All are on the disk before any has its name. Should the model not get its name, the hash in it tells that the
        // curves are not of it, and its parameters that the draws are not.
        let draws = draws.map(|text| atomic::filled(&self.draws, text.as_bytes())).transpose()?;
        let curves = atomic::filled(&self.curves, curves.as_bytes())?;
        let model = atomic::filled(&self.model, model_file::to_toml(&model).as_bytes())?;
        draws.map_or(Ok(()), AtomicFile::commit)?;
        curves.commit()?;
        model.commit()
    }

    /// Writes the curves of the estimator, and in the place of its own model one with inflated parameters: intervals and
    /// draws, which are of its own, are left out.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write_inflated(
        &self,
        calibration: &Calibration,
        note: &CalibrationNote,
        inflated: &Model,
        inflation: &str,
    ) -> Result<(), FileError> {
        let (curves, own) = self.contents(calibration, note);
        let mut provenance = own.provenance.unwrap_or_default();
        provenance.insert("inflation".to_owned(), inflation.into());
        let provenance = Some(provenance);
        let model = ModelFile { missing: own.missing, provenance, ..ModelFile::new(inflated.clone()) };
        let curves = atomic::filled(&self.curves, curves.as_bytes())?;
        let model = atomic::filled(&self.model, model_file::to_toml(&model).as_bytes())?;
        curves.commit()?;
        model.commit()
    }
}

impl ModelFiles {
    /// Writes the page of the models of the estimator.
    ///
    /// # Errors
    /// When the system refuses.
    pub(super) fn write_page(
        &self,
        calibration: &Calibration,
        diagnoses: &[Diagnosis],
    ) -> Result<(), FileError> {
        let Calibration { groups, outcomes, settings, turn_on } = calibration;
        let chosen = outcomes.iter().enumerate().filter(|(_, o)| o.estimator == self.estimator);
        let chosen: Vec<(usize, &Outcome)> = chosen.collect();
        let curves = CurvesFile::new(groups, &chosen.iter().map(|(_, o)| *o).collect::<Vec<_>>(), settings);
        atomic::write(&self.page, report::calibration_page(&curves, &chosen, diagnoses, turn_on, settings))
    }
}

/// Claims a model file before the work: several files are made of it, by its name.
///
/// # Errors
/// When it cannot be replaced by a file, or another command writes it.
pub(crate) fn claim_model(out: &Path) -> Result<Claim, FileError> {
    let what = match std::fs::metadata(out) {
        _ if out.as_os_str() == "-" => "is no file, and a model is a file with its curves beside it",
        Ok(m) if m.is_dir() => "is a directory",
        Ok(m) if !m.is_file() => "is a device, and a model is a file with its curves beside it",
        _ if out.file_name().is_none() || out.as_os_str().to_string_lossy().ends_with('/') => {
            "is a directory"
        }
        _ => return atomic::claim_file(out, []),
    };
    let error = FileError::contents(out.display().to_string(), Place::Itself, what);
    Err(error.advice("name a file, such as model.toml"))
}

/// Refuses at once what would be refused after the work: a file that is no calibration is another result, and where the
/// bootstrap, and so the file, is another each time (`drawn`), so is a calibration.
///
/// # Errors
/// When the file is to stay.
pub(crate) fn not_anew(out: &Path, drawn: bool, existing: Existing) -> Result<(), FileError> {
    if drawn || !is_calibrated(out) {
        atomic::guard_contents(out, &[], existing)?;
    }
    Ok(())
}

/// Refuses to replace a file of the default name that no calibration wrote: nobody asked for it by name.
///
/// # Errors
/// When there is one.
pub(crate) fn not_of_others(out: &Path) -> Result<(), FileError> {
    if !out.exists() || is_calibrated(out) {
        return Ok(());
    }
    let message = "is not a model that nav-sim calibrate wrote: it is not replaced";
    let error = FileError::contents(out.display().to_string(), Place::Itself, message);
    Err(error.setting(Setting::Output).advice("move that file away"))
}

/// Whether a file is a model that a calibration wrote.
fn is_calibrated(path: &Path) -> bool {
    let provenance = model_file::read(path).ok().and_then(|file| file.provenance);
    provenance.is_some_and(|p| {
        let program = p.get("program").and_then(toml::Value::as_str);
        program.is_some_and(|name| name.starts_with("nav-sim")) && p.contains_key("estimator")
    })
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let extension = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    path.with_file_name(format!("{stem}{suffix}{extension}"))
}
