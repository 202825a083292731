//! The directory of a choice: the winner's model with its curves and draws, the page and the ranking.

use super::{ChoiceReport, Chosen, Inflation};
use crate::calibrate::{Calibration, CalibrationNote, ModelFiles};
use crate::formats::FileError;
use crate::formats::atomic::{AtomicDir, Claim, Existing, Found, claim_directory};
use crate::formats::input::input;
use crate::report::{Answer, json};
use nav_sim_calibration::diagnose;
use std::path::{Path, PathBuf};

/// The files of a choice, in the order of writing.
const FILES: [&str; 6] = [
    "model.toml",
    "model.wv.json",
    "model.html",
    "model.draws.json",
    "report.html",
    "ranking.json",
];

/// Whether the directory can be made, found out before the work. A ranking does not tell what it was made of.
///
/// # Errors
/// Why it cannot.
pub(crate) fn claim_choice<'a>(
    out: &Path,
    inputs: impl Iterator<Item = &'a Path> + Clone,
    existing: Existing,
) -> Result<Claim, FileError> {
    let recognise = |text: &str| {
        let present = serde_json::from_str::<serde_json::Value>(text).unwrap_or_default();
        let is_ours = present["candidates"].is_array() && present["winner"].is_string();
        Ok(if is_ours {
            Found::Other("holds the result of an earlier choose")
        } else {
            Found::Foreign
        })
    };
    claim_directory(out, &FILES, inputs, existing, recognise)
}

impl Chosen {
    /// The winner's files, with the trajectory and the recordings in what is noted of its calibration.
    pub(crate) fn texts(
        &self,
        files: &ModelFiles,
        trajectory: &Path,
        mut note: CalibrationNote,
    ) -> Result<Vec<(PathBuf, String)>, FileError> {
        note.inputs.push(input("trajectory", trajectory)?);
        for file in &self.files {
            note.inputs.push(input("recording", file)?);
        }
        let how = self.winner.inflation;
        let inflated = (how != Inflation::None).then(|| (&self.model, how.name()));
        Ok(files.texts(&self.calibration, &note, inflated))
    }

    /// Writes the directory.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write(
        &self,
        out: &Path,
        trajectory: &Path,
        note: CalibrationNote,
        report: &ChoiceReport<'_>,
    ) -> Result<(), FileError> {
        let mut directory = AtomicDir::create(out)?;
        let files = self.model_files(&directory.path("model.toml"));
        directory.path("model.html");
        let texts = self.texts(&files, trajectory, note)?;
        for (path, _) in &texts {
            directory.path(&path.file_name().unwrap_or_default().to_string_lossy());
        }
        ModelFiles::write(&texts)?;
        let Calibration {
            groups,
            outcomes,
            settings,
            ..
        } = &self.calibration;
        files.write_page(&self.calibration, &diagnose(groups, outcomes, settings))?;
        directory.write("report.html", report.document().html())?;
        directory.write("ranking.json", json(report))?;
        directory.commit()
    }

    /// The files of the winner.
    pub(crate) fn model_files(&self, model: &Path) -> ModelFiles {
        ModelFiles::of(model, &[self.winner.estimator]).remove(0)
    }
}
