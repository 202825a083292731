//! Draws of a calibration (JSON, `<model>.draws.json`): the models that other recordings of the same IMU would have
//! given, by the parametric bootstrap behind the intervals of the parameters.
//!
//! They carry the uncertainty of a calibration on into what is computed from its model.

use super::model_file::ModelFile;
use super::{Failure, source};
use nav_sim_calibration::Outcome;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::{Composite, Model, Process, continuous};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The version of the layout.
const SCHEMA_VERSION: u32 = 1;

/// Bootstrap draws beside a model file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DrawsFile {
    /// Layout version.
    pub schema_version: u32,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// One entry a fit.
    pub signals: Vec<SignalDraws>,
}

/// The draws of one fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SignalDraws {
    /// Signals of the fit: `accel`, or `accel.x` alone.
    pub signals: String,
    /// Names of the columns: process and parameter, as in the model file.
    pub parameters: Vec<String>,
    /// The fit itself: a model file that has other values is not of these draws.
    pub estimate: Vec<f64>,
    /// One row a draw.
    pub draws: Vec<Vec<f64>>,
}

/// Models that other recordings would have given.
#[derive(Debug, Clone, PartialEq)]
pub struct Draws {
    /// One model a draw.
    pub models: Vec<Model>,
}

/// Path of the draws of a model file.
#[must_use]
pub(crate) fn beside(model: &Path) -> PathBuf {
    super::beside(model, ".draws.json")
}

/// The draws beside a model file, at the rate of an IMU, if there are any.
///
/// # Errors
/// Reason that existing draws cannot be used, in words.
pub(crate) fn usable(path: &Path, file: &ModelFile, rate_hz: f64) -> Result<Option<Draws>, String> {
    let Some(read) = read(path).map_err(|e| e.to_string())? else {
        return Ok(None);
    };
    let draws = read.draws(&file.model).and_then(|draws| {
        let models = draws.models.iter();
        let models = models.map(|model| continuous::at_rate(model, rate_hz).ok());
        let models = models.collect::<Option<_>>()?;
        Some(Draws { models })
    });
    let foreign = || format!("{} is not of {}", beside(path).display(), path.display());
    draws.map(Some).ok_or_else(foreign)
}

/// The draws beside a model file; none where there is no such file.
///
/// # Errors
/// When it cannot be read, or is not of this layout.
pub fn read(model: &Path) -> Result<Option<DrawsFile>, Failure> {
    let path = beside(model);
    let text = match source::text(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(Failure::io(&path, e)),
    };
    let read = serde_json::from_str(&text).map_err(|e| (e.line(), e.to_string()));
    let of_version = |file: DrawsFile| match file.schema_version {
        SCHEMA_VERSION => Ok(Some(file)),
        other => Err((
            1,
            format!("\"schema_version\" is {other}; this nav-sim reads {SCHEMA_VERSION}"),
        )),
    };
    read.and_then(of_version).map_err(|(line, message)| {
        Failure::contents(path.display(), line, message)
            .or_hint("calibrate again, or remove the file")
    })
}

fn values(composite: &Composite) -> Vec<f64> {
    composite.parameters().map(|(_, value)| value).collect()
}

impl DrawsFile {
    /// Draws of the models used in navigation; none if one outcome has no draws.
    #[must_use]
    pub fn of(outcomes: &[Outcome], rate_hz: f64) -> Option<Self> {
        let signals = |outcome: &Outcome| {
            let outcome = outcome.for_navigation();
            let (inference, composite) = (outcome.inference.as_ref()?, &outcome.fit.composite);
            Some(SignalDraws {
                signals: outcome.scope.name(),
                parameters: composite
                    .parameters()
                    .map(|(parameter, _)| composite.name_of(parameter))
                    .collect(),
                estimate: values(composite),
                draws: inference.drawn.iter().map(values).collect(),
            })
        };
        let signals = outcomes.iter().map(signals).collect::<Option<_>>()?;
        Some(Self {
            schema_version: SCHEMA_VERSION,
            rate_hz,
            signals,
        })
    }

    /// The models of the draws of `model`, as it is in the file beside; none where the draws are not of it.
    #[must_use]
    pub fn draws(&self, model: &Model) -> Option<Draws> {
        let is_of =
            |s: &SignalDraws, channel: Channel| Channel::named(&s.signals).contains(&channel);
        let count = self
            .signals
            .iter()
            .map(|s| s.draws.len())
            .min()
            .filter(|count| *count > 0)?;
        let mut models = vec![model.clone(); count];
        for channel in Channel::ALL {
            let axis = model.axis(channel);
            let Some(signals) = self.signals.iter().find(|s| is_of(s, channel)) else {
                // what was not calibrated is known for certain: it has no noise
                axis.processes.is_empty().then_some(())?;
                continue;
            };
            if signals.estimate != values(axis) {
                return None;
            }
            for (model, row) in models.iter_mut().zip(&signals.draws) {
                model.axes[channel.index()] = with_values(axis, row, self.rate_hz)?;
            }
        }
        Some(Draws { models })
    }
}

/// The processes of an axis with other parameters.
fn with_values(axis: &Composite, values: &[f64], rate_hz: f64) -> Option<Composite> {
    let mut rest = values;
    let mut processes = Vec::new();
    for process in &axis.processes {
        let (own, others) = rest.split_at_checked(process.values().len())?;
        processes.push(Process::of_values(process.kind(), own, rate_hz).ok()?);
        rest = others;
    }
    rest.is_empty().then(|| Composite::new(processes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_signal::noise::Process;

    fn axis(scale: f64) -> Composite {
        let ar1 = Process::ar1(1.0 - 1e-4 * scale, 1e-9 * scale).unwrap();
        Composite::new(vec![Process::white(1e-6 * scale).unwrap(), ar1])
    }

    fn file() -> (Model, DrawsFile) {
        let signals = |signals: &str, base: f64| SignalDraws {
            signals: signals.to_owned(),
            parameters: vec!["WN sigma2".into(), "AR1 phi".into(), "AR1 sigma2".into()],
            estimate: values(&axis(base)),
            draws: [0.9, 1.2]
                .map(|factor| values(&axis(base * factor)))
                .to_vec(),
        };
        let signals = vec![signals("accel", 1.0), signals("gyro", 2.0)];
        (
            Model::pooled(100.0, &axis(1.0), &axis(2.0)),
            DrawsFile {
                schema_version: 1,
                rate_hz: 100.0,
                signals,
            },
        )
    }

    #[test]
    fn draws_are_models_to_the_last_bit() {
        let (model, file) = file();
        let draws = file.draws(&model).unwrap();
        assert_eq!(
            draws.models[1],
            Model::pooled(100.0, &axis(1.2), &axis(2.4))
        );
        assert_eq!(draws.models.len(), 2);
    }

    #[test]
    fn draws_of_another_model_are_not_taken() {
        let (model, file) = file();
        let mut edited = model.clone();
        edited.axes[3] = axis(2.0001);
        assert_eq!(file.draws(&edited), None);
        let mut cut = file.clone();
        cut.signals[1].draws[0].pop();
        assert_eq!(cut.draws(&model), None);
        let mut accel_alone = file;
        accel_alone.signals.pop();
        assert_eq!(accel_alone.draws(&model), None);
        let without = Model::pooled(100.0, &axis(1.0), &Composite::new(Vec::new()));
        assert!(accel_alone.draws(&without).is_some());
    }
}
