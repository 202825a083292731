//! The files of a calibration: for each estimator a model, the curves behind it and the draws behind its intervals.

use super::model_file::with_turn_on;
use super::{Calibration, CalibrationNote};
use crate::formats::atomic::{AtomicFile, Claim, Existing, Written};
use crate::formats::draws_file::DrawsFile;
use crate::formats::model_file::ModelFile;
use crate::formats::{FileError, Place, atomic, draws_file, hash, model_file};
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
    /// The figures of the page, `<model>.svg` beside it.
    pub figures: PathBuf,
    /// The draws behind its intervals, `<model>.draws.json` beside it.
    pub draws: PathBuf,
}

impl ModelFiles {
    /// The files of each estimator: of several `<out>_<estimator>.toml`.
    pub(crate) fn of(out: &Path, estimators: &[Estimator]) -> Vec<Self> {
        let files = |estimator: &Estimator| {
            let suffix = if estimators.len() > 1 {
                format!("_{estimator}")
            } else {
                String::new()
            };
            let model = with_suffix(out, &suffix);
            let [curves, page, figures] =
                ["wv.json", "html", "svg"].map(|ending| model.with_extension(ending));
            Self {
                estimator: *estimator,
                curves,
                draws: draws_file::beside(&model),
                page,
                figures,
                model,
            }
        };
        estimators.iter().map(files).collect()
    }

    /// The files of each estimator, claimed before the work. None of them is an input.
    ///
    /// # Errors
    /// When one cannot be made, is an input or not of a calibration, or another command writes it.
    pub(crate) fn claim(
        out: &Path,
        estimators: &[Estimator],
        inputs: &[PathBuf],
        existing: Existing,
    ) -> Result<(Vec<Self>, Vec<Claim>), FileError> {
        is_file(out)?;
        let all = Self::of(out, estimators);
        let kinds = [
            Written::Calibrated,
            Written::Curves,
            Written::Draws,
            Written::Page,
            Written::Svg,
        ];
        let paths = all.iter().flat_map(|f| {
            [&f.model, &f.curves, &f.draws, &f.page, &f.figures]
                .into_iter()
                .zip(kinds)
        });
        let claim = |(path, kind): (&PathBuf, Written)| {
            atomic::claim_result(path, inputs.iter().map(PathBuf::as_path), kind, existing)
        };
        let claims = paths.map(claim).collect::<Result<_, _>>()?;
        Ok((all, claims))
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
            // drawn before the first name changes: no model stands beside the page of another for the time of drawing
            let page = files.page(calibration, diagnoses)?;
            Self::write(&files.texts(calibration, note, None))?;
            page.into_iter().try_for_each(AtomicFile::commit)?;
            let draws = has_draws.then_some(&files.draws);
            written.extend(
                [&files.model, &files.curves]
                    .into_iter()
                    .chain(draws)
                    .chain([&files.page, &files.figures]),
            );
        }
        Ok(written.into_iter().map(PathBuf::as_path).collect())
    }

    fn contents(&self, calibration: &Calibration, note: &CalibrationNote) -> (String, ModelFile) {
        let Calibration {
            groups,
            outcomes,
            settings,
            turn_on,
            ..
        } = calibration;
        let chosen: Vec<&Outcome> = outcomes
            .iter()
            .filter(|o| o.estimator == self.estimator)
            .collect();
        let curves = report::json(&CurvesFile::new(groups, &chosen, settings));
        let blake3 = hash::of_bytes(curves.as_bytes());
        let means = turn_on.iter().filter(|t| t.estimator == self.estimator);
        let model = with_turn_on(note.model_file(&chosen, settings, Some(&blake3)), means);
        (curves, model)
    }

    /// The draws behind the intervals of the estimator; none without bootstrap.
    fn drawn(&self, calibration: &Calibration) -> Option<String> {
        let chosen: Vec<&Outcome> = calibration
            .outcomes
            .iter()
            .filter(|o| o.estimator == self.estimator)
            .collect();
        let draws = DrawsFile::of(&chosen, calibration.settings.rate_hz)?;
        Some(serde_json::to_string(&draws).expect("plain structs are always JSON") + "\n")
    }

    /// Draws, curves and model: paths and texts, in the order in which they get their names. Of a model that is inflated
    /// (and how) there are no intervals and draws, which are of its own.
    pub(crate) fn texts(
        &self,
        calibration: &Calibration,
        note: &CalibrationNote,
        inflated: Option<(&Model, &str)>,
    ) -> Vec<(PathBuf, String)> {
        let (curves, own) = self.contents(calibration, note);
        let (draws, model) = match inflated {
            None => (self.drawn(calibration), own),
            Some((inflated, how)) => {
                let mut provenance = own.provenance.unwrap_or_default();
                provenance.insert("inflation".to_owned(), how.into());
                let provenance = Some(provenance);
                (
                    None,
                    ModelFile {
                        missing: own.missing,
                        provenance,
                        ..ModelFile::new(inflated.clone())
                    },
                )
            }
        };
        let model = model_file::to_toml(&model);
        let texts = [
            (&self.draws, draws),
            (&self.curves, Some(curves)),
            (&self.model, Some(model)),
        ];
        texts
            .into_iter()
            .filter_map(|(path, text)| Some((path.clone(), text?)))
            .collect()
    }

    /// Writes them.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write(texts: &[(PathBuf, String)]) -> Result<(), FileError> {
        // All are on the disk before any has its name. Should the model not get its name, the hash in it tells that the
        // curves are not of it, and its parameters that the draws are not.
        let filled = texts
            .iter()
            .map(|(path, text)| atomic::filled(path, text.as_bytes()));
        filled
            .collect::<Result<Vec<_>, _>>()?
            .into_iter()
            .try_for_each(AtomicFile::commit)
    }
}

impl ModelFiles {
    /// The page of the models of the estimator and its figures, on the disk without their names.
    fn page(
        &self,
        calibration: &Calibration,
        diagnoses: &[Diagnosis],
    ) -> Result<[AtomicFile; 2], FileError> {
        let shown = calibration.shown(diagnoses, |outcome| outcome.estimator == self.estimator);
        let document = shown.document();
        let page = atomic::filled(&self.page, document.html().as_bytes())?;
        Ok([
            page,
            atomic::filled(&self.figures, document.svg().as_bytes())?,
        ])
    }

    /// Writes the page of the models of the estimator, and its figures.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write_page(
        &self,
        calibration: &Calibration,
        diagnoses: &[Diagnosis],
    ) -> Result<(), FileError> {
        self.page(calibration, diagnoses)?
            .into_iter()
            .try_for_each(AtomicFile::commit)
    }
}

/// Refuses what is no regular file: several files are made of a model's, by its name.
fn is_file(out: &Path) -> Result<(), FileError> {
    let is_directory = out.is_dir()
        || out.file_name().is_none()
        || out.as_os_str().to_string_lossy().ends_with('/');
    if !is_directory && out.as_os_str() != "-" && (out.is_file() || !out.exists()) {
        return Ok(());
    }
    let error = FileError::contents(out.display().to_string(), Place::Itself, "is not a file");
    Err(error.advice("name a file, such as model.toml"))
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let stem = path
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default();
    let extension = path
        .extension()
        .map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    path.with_file_name(format!("{stem}{suffix}{extension}"))
}
