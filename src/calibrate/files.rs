//! The files of a calibration: for each estimator a model, the curves behind it and the draws behind its intervals.

use super::model_file::with_turn_on;
use super::{Calibration, CalibrationNote};
use crate::app::OutputFile;
use crate::formats::atomic::Written;
use crate::formats::draws_file::DrawsFile;
use crate::formats::model_file::ModelFile;
use crate::formats::{hash, model_file};
use crate::report::{self, CurvesFile};
use nav_sim_calibration::{Diagnosis, Estimator, Outcome};
use nav_sim_signal::noise::Model;
use std::borrow::Cow;

/// What comes between the stem of `--out` and the endings of an estimator: of several `_<estimator>`.
fn stem_of(estimator: Estimator, estimators: &[Estimator]) -> String {
    match estimators.len() {
        1 => String::new(),
        _ => format!("_{estimator}"),
    }
}

/// The ending of a model file.
fn model_ending(stem: &str) -> String {
    match stem {
        "" => String::new(),
        stem => format!("{stem}.toml"),
    }
}

/// Endings and kinds of all files of these estimators.
pub(crate) fn endings(estimators: &[Estimator]) -> Vec<(Cow<'static, str>, Written)> {
    let of_estimator = |estimator: &Estimator| {
        let stem = stem_of(*estimator, estimators);
        [
            (model_ending(&stem).into(), Written::Calibrated),
            (format!("{stem}.wv.json").into(), Written::Curves),
            (format!("{stem}.draws.json").into(), Written::Draws),
            (format!("{stem}.html").into(), Written::Page),
            (format!("{stem}.svg").into(), Written::Svg),
        ]
    };
    estimators.iter().flat_map(of_estimator).collect()
}

impl Calibration {
    /// The files of all estimators, as endings of `--out`.
    pub(crate) fn files(
        &self,
        note: &CalibrationNote,
        diagnoses: &[Diagnosis],
    ) -> Vec<OutputFile<'static>> {
        let estimators = &self.settings.estimators;
        let of_estimator = |estimator: &Estimator| {
            let stem = stem_of(*estimator, estimators);
            let names = (model_ending(&stem), stem);
            self.files_of(*estimator, names, (note, diagnoses), None)
        };
        estimators.iter().flat_map(of_estimator).collect()
    }

    /// Draws, curves, model, page and figures of an estimator; names of the model and of what comes before the other
    /// endings. Of a model that is inflated (and how) there are no intervals and draws, which are of its own.
    pub(crate) fn files_of(
        &self,
        estimator: Estimator,
        (model_name, stem): (String, String),
        (note, diagnoses): (&CalibrationNote, &[Diagnosis]),
        inflated: Option<(&Model, &str)>,
    ) -> Vec<OutputFile<'static>> {
        let own = self.outcomes.iter().filter(|o| o.estimator == estimator);
        let own: Vec<&Outcome> = own.collect();
        let curves = report::json(&CurvesFile::new(&self.groups, &own, &self.settings));
        let blake3 = hash::of_bytes(curves.as_bytes());
        let means = self.turn_on.iter().filter(|t| t.estimator == estimator);
        let model = with_turn_on(note.model_file(&own, &self.settings, Some(&blake3)), means);
        let (draws, model) = match inflated {
            None => (DrawsFile::of(&own, self.settings.rate_hz), model),
            Some((inflated, how)) => {
                let mut provenance = model.provenance.unwrap_or_default();
                provenance.insert("inflation".to_owned(), how.into());
                let inflated = ModelFile {
                    missing: model.missing,
                    provenance: Some(provenance),
                    ..ModelFile::new(inflated.clone())
                };
                (None, inflated)
            }
        };
        let page = self
            .shown(diagnoses, |outcome| outcome.estimator == estimator)
            .document();
        let draws = draws.map(|draws| {
            serde_json::to_string(&draws).expect("plain structs are always JSON") + "\n"
        });
        let named = |ending: &str, text| OutputFile::whole(format!("{stem}{ending}"), text);
        let mut files: Vec<_> = draws
            .map(|text| named(".draws.json", text))
            .into_iter()
            .collect();
        files.extend([
            named(".wv.json", curves),
            OutputFile::whole(model_name, model_file::to_toml(&model)),
            named(".html", page.html()),
            named(".svg", page.svg()),
        ]);
        files
    }
}
