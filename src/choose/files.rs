//! The directory of a choice: the winner's model with its curves and draws, the page and the ranking.

use super::{ChoiceReport, Chosen, Inflation};
use crate::calibrate::{Calibration, CalibrationNote, ModelFiles};
use crate::formats::FileError;
use crate::formats::atomic::{AtomicDir, Claim, Existing, Found, claim_directory};
use crate::formats::input::input;
use crate::report::{Answer, json};
use nav_sim_calibration::diagnose;
use std::path::Path;

/// The files of a choice, in the order of writing.
const FILES: [&str; 6] =
    ["model.toml", "model.wv.json", "model.html", "model.draws.json", "report.html", "ranking.json"];

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
        let is_ours = present["candidates"].is_array() && present["influence"].is_object();
        Ok(if is_ours { Found::Other("holds the result of an earlier choose") } else { Found::Foreign })
    };
    claim_directory(out, &FILES, inputs, existing, recognise)
}

impl Chosen {
    /// Writes the directory. To what is noted of the calibration the trajectory and the recordings are added.
    ///
    /// # Errors
    /// When the system refuses.
    pub(crate) fn write(
        &self,
        out: &Path,
        trajectory: &Path,
        mut note: CalibrationNote,
        report: &ChoiceReport<'_>,
    ) -> Result<(), FileError> {
        let mut directory = AtomicDir::create(out)?;
        let model = directory.path("model.toml");
        directory.path("model.wv.json");
        directory.path("model.html");
        note.inputs.push(input("trajectory", trajectory)?);
        for file in &self.files {
            note.inputs.push(input("recording", file)?);
        }
        let Self { calibration, model: inflated, winner, .. } = self;
        for files in ModelFiles::of(&model, &[winner.estimator]) {
            if winner.inflation == Inflation::None {
                files.write(calibration, &note)?;
                directory.path("model.draws.json");
            } else {
                files.write_inflated(calibration, &note, inflated, winner.inflation.name())?;
            }
            let Calibration { groups, outcomes, settings, .. } = calibration;
            files.write_page(calibration, &diagnose(groups, outcomes, settings))?;
        }
        directory.write("report.html", report.document().html())?;
        directory.write("ranking.json", json(report))?;
        directory.commit()
    }
}
