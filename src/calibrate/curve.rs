//! Wavelet-variance curves that come from elsewhere → models.

use super::Calibration;
use crate::app::Failure;
use crate::formats::curve_file;
use nav_sim_calibration::{Bootstrap, Estimator, Group, Outcome, Scope, Settings, fit_curve};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::wavelet::Curve;
use std::path::Path;

/// Curves of a file, each with what it is for.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub(crate) struct Curves {
    curves: Vec<(Scope, Estimator, Curve)>,
    /// How models are fitted: with the estimators and the rate of the curves.
    pub settings: Settings,
}

/// Reads curves. A rate (Hz) and a sensor are for those that do not say theirs.
///
/// # Errors
/// When the file cannot be read, says nothing of rate or sensor where nothing is given, or has two curves for one model.
pub(crate) fn read_curves(
    path: &Path,
    rate_hz: Option<f64>,
    sensor: Option<Sensor>,
    settings: &Settings,
) -> Result<(Curves, bool), Failure> {
    let named = curve_file::read(path)?;
    let path = || path.display().to_string();
    let rate_hz = match (named[0].rate_hz, rate_hz) {
        (Some(stated), Some(given)) => {
            let message = format!(
                "{}: the curve says its rate, {stated} Hz; --rate-hz {given} is another",
                path()
            );
            return Err(Failure::input(message).hint("leave --rate-hz out: it is for a CSV curve"));
        }
        (stated, given) => stated.or(given).ok_or_else(|| {
            Failure::input(format!(
                "{}: the curve does not say its sample rate",
                path()
            ))
            .hint("give the rate with --rate-hz: correlation times and the model file need it")
        })?,
    };
    let mut is_unsaid = false;
    let mut curves: Vec<(Scope, Estimator, Curve)> = Vec::new();
    for named in named {
        let estimator = named.estimator.and_then(|name| name.parse().ok());
        let estimator = estimator.unwrap_or(Estimator::Given);
        is_unsaid |= named.sensor.or(sensor).is_none();
        let sensor = named.sensor.or(sensor).unwrap_or(Sensor::Accel);
        let scope = Scope {
            sensor,
            axis: named.axis,
        };
        if curves
            .iter()
            .any(|(s, e, _)| (*s, *e) == (scope, estimator))
        {
            let message = format!(
                "{}: there are two curves of {} for {estimator}",
                path(),
                scope.name()
            );
            return Err(Failure::input(message)
                .hint("calibrate the recordings themselves: it averages them"));
        }
        curves.push((scope, estimator, named.curve));
    }
    let has = |e: &Estimator| curves.iter().any(|(_, estimator, _)| estimator == e);
    let estimators = Estimator::ALL.into_iter().filter(has).collect();
    let curves = Curves {
        curves,
        settings: Settings {
            estimators,
            rate_hz,
            ..settings.clone()
        },
    };
    Ok((curves, is_unsaid))
}

impl Curves {
    /// The models.
    ///
    /// # Errors
    /// When a curve is too short for the model.
    pub(crate) fn calibrate(self, bootstrap: Option<Bootstrap>) -> Result<Calibration, Failure> {
        let Self { curves, settings } = self;
        let mut groups: Vec<Group> = Vec::new();
        let mut outcomes: Vec<Outcome> = Vec::new();
        for (scope, estimator, curve) in curves {
            let group = Group {
                scope,
                replicates: Vec::new(),
            };
            outcomes.push(fit_curve(&group, estimator, curve, &settings)?);
            groups.push(group);
        }
        let calibration = Calibration {
            groups,
            outcomes,
            settings,
            beginnings: Default::default(),
            turn_on: Vec::new(),
        };
        Ok(calibration.with_inference(bootstrap, &|_| {}))
    }
}
