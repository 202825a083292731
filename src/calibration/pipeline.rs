//! The whole of a calibration: groups of replicates × estimators → fits, and how sure they are.

use crate::curve::{CalibrationError, Estimator, Group, average, implied};
use crate::fit::{Fit, estimate};
use crate::outcome::{Advance, Bootstrap, CalibrationSettings, ModelChoice, Outcome};
use crate::reading::reading;
use crate::selection::choose;
use crate::uncertainty::bootstrap::{by_bootstrap, inference};
use crate::uncertainty::spread::axes_differ;
use crate::wavelet::Curve;
use rayon::prelude::*;

/// Fits every group with every estimator, in that order.
///
/// # Errors
/// When a trim leaves no replicate, or a curve is too short for the model.
pub fn calibrate(
    groups: &[Group],
    settings: &CalibrationSettings,
) -> Result<Vec<Outcome>, CalibrationError> {
    calibrate_with_progress(groups, settings, &|_| {})
}

/// Calibrates like [`calibrate`] and reports progress: `advance` receives the number of steps done
/// since its last call, of [`ModelChoice::steps`] per fit.
///
/// # Errors
/// Runs [`calibrate`] and reports progress.
pub fn calibrate_with_progress(
    groups: &[Group],
    settings: &CalibrationSettings,
    advance: Advance<'_>,
) -> Result<Vec<Outcome>, CalibrationError> {
    let jobs: Vec<_> = groups
        .iter()
        .flat_map(|g| settings.estimators.iter().map(move |e| (g, *e)))
        .collect();
    let run = |&(group, estimator): &(&Group, Estimator)| {
        let curve = average(
            &group.replicates,
            estimator,
            settings.trim,
            &settings.tuning,
        )
        .map_err(group.named(estimator))?;
        fit_curve(group, estimator, curve, settings, advance)
    };
    jobs.par_iter().map(run).collect()
}

/// Fits the curve of a group, and tells `advance` of the steps.
///
/// # Errors
/// When the curve is too short for the model.
pub fn fit_curve(
    group: &Group,
    estimator: Estimator,
    mut curve: Curve,
    settings: &CalibrationSettings,
    advance: Advance<'_>,
) -> Result<Outcome, CalibrationError> {
    let without_root = curve.ignored.clone();
    restrict_to_range(&mut curve, settings);
    let (spec, ranking) = match &settings.model {
        ModelChoice::Given(spec) => {
            advance(settings.model.steps());
            (spec.clone(), None)
        }
        ModelChoice::Auto => {
            let (spec, ranking) = choose(group, estimator, &curve, settings, advance)
                .map_err(group.named(estimator))?;
            (spec, Some(ranking))
        }
    };
    let fitted = |curve: &Curve| {
        estimate(
            estimator,
            curve,
            &spec,
            settings.rate_hz,
            settings.weighting,
        )
        .map_err(group.named(estimator))
    };
    let mut fit = fitted(&curve)?;
    while include_exceeded(&mut curve, &without_root, &fit, settings) {
        fit = fitted(&curve)?;
    }
    let mut outcome = Outcome {
        scope: group.scope,
        replicates: group.replicates.len(),
        recordings: group.recordings(),
        estimator,
        spec,
        ranking,
        curve,
        fit,
        axes_differ: axes_differ(&group.replicates, estimator, &settings.tuning),
        inference: None,
        reading: None,
    };
    outcome.reading = reading(&outcome, settings.rate_hz).map(Box::new);
    Ok(outcome)
}

/// Ignores the scales outside the range of a fit.
fn restrict_to_range(curve: &mut Curve, settings: &CalibrationSettings) {
    let outside = |level: &&u32| !settings.counts(**level) && !curve.ignored.contains(*level);
    let outside: Vec<u32> = curve.levels.iter().filter(outside).copied().collect();
    curve.ignored.extend(outside);
}

/// Includes scales without a robust root where the fit exceeds the classical variance, an upper bound. Returns true if
/// any was added.
fn include_exceeded(
    curve: &mut Curve,
    without_root: &[u32],
    fit: &Fit,
    settings: &CalibrationSettings,
) -> bool {
    let implied = implied(&fit.composite, curve);
    let scales = curve.levels.iter().zip(&curve.wv).zip(implied);
    let is_exceeded = |level: &u32| without_root.contains(level) && settings.counts(*level);
    let exceeded = scales
        .filter(|((level, wv), nu)| is_exceeded(level) && nu > *wv)
        .map(|((level, _), _)| *level);
    let exceeded: Vec<u32> = exceeded.collect();
    let before = curve.ignored.len();
    curve.ignored.retain(|level| !exceeded.contains(level));
    curve.ignored.len() < before
}

/// Bootstraps every outcome from its group: intervals and tests. The same seed gives the same numbers on any number of
/// threads.
pub fn add_intervals(
    groups: &[Group],
    outcomes: &mut [Outcome],
    settings: &CalibrationSettings,
    bootstrap: Bootstrap,
) {
    add_intervals_with_progress(groups, outcomes, settings, bootstrap, &|_| {});
}

/// Runs [`add_intervals`] and reports progress: `advance` receives the number of draws done since its last
/// call.
pub fn add_intervals_with_progress(
    groups: &[Group],
    outcomes: &mut [Outcome],
    settings: &CalibrationSettings,
    bootstrap: Bootstrap,
    advance: Advance<'_>,
) {
    outcomes.par_iter_mut().for_each(|outcome| {
        let Some(group) = groups.iter().find(|g| g.scope == outcome.scope) else {
            return;
        };
        outcome.inference = Some(inference(group, outcome, settings, bootstrap, advance));
        if let Some(reading) = &mut outcome.reading {
            let own = by_bootstrap(group, reading, settings, bootstrap, &|_| {});
            reading.inference = Some(own);
        }
    });
}

/// The fit of a curve of accelerometers from elsewhere.
#[cfg(test)]
pub(crate) fn fit_given(curve: Curve, model: &str, rate_hz: f64) -> Outcome {
    let group = Group {
        scope: crate::curve::Scope {
            sensor: crate::imu::Sensor::Accel,
            axis: None,
        },
        replicates: Vec::new(),
    };
    let settings = CalibrationSettings {
        model: ModelChoice::Given(model.parse().unwrap()),
        rate_hz,
        ..CalibrationSettings::default()
    };
    fit_curve(&group, Estimator::Given, curve, &settings, &|_| {}).unwrap()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Scope;
    use crate::outcome::FitRange;
    use crate::tests::*;

    /// White noise and random walk of which the middle scales are without a root, their classical variances a tenth of the model's
    /// at one of them: the fit counts that scale, and no other that bounds it from far above.
    #[test]
    fn a_scale_without_a_root_bounds_the_fit() {
        let mut curve = exact(&white_and_walk(1.0, 1e-4), 12, |_| 1e3);
        curve.ignored = vec![6, 7];
        curve.wv[5] *= 0.1;
        curve.wv[6] *= 10.0;
        let outcome = fit_given(curve, "WN+RW", CalibrationSettings::default().rate_hz);
        assert_eq!(outcome.curve.ignored, [7]);
    }

    /// A curve that no sum of WN, AR1 and RW describes; of the scales 2 to 13 alone, given as a range or as all that there
    /// are, the fit is the same.
    #[test]
    fn a_range_of_scales_is_the_curve_without_the_others() {
        let model = Composite::new(vec![
            Process::white(1.0).unwrap(),
            Process::ar1(0.99, 1e-3).unwrap(),
            Process::random_walk(1e-7).unwrap(),
        ]);
        let mut whole = exact(&model, 16, |level| 1e6 / f64::from(level).exp2());
        // Off by a few per cent from scale to scale, and by a factor of two at the first one.
        whole.wv[0] *= 2.0;
        for (k, nu) in whole.wv.iter_mut().enumerate() {
            *nu *= 1.0 + 0.03 * (k as f64 + 1.0).sin();
        }
        let part = |values: &[f64]| values[1..13].to_vec();
        let short = Curve {
            levels: (2..=13).collect(),
            wv: part(&whole.wv),
            edof: part(&whole.edof),
            ..Curve::default()
        };
        let group = Group {
            scope: Scope {
                sensor: Sensor::Accel,
                axis: None,
            },
            replicates: Vec::new(),
        };
        let range = FitRange {
            from_s: 0.04,
            to_s: 81.92,
        };
        let settings = |fit_range| CalibrationSettings {
            model: ModelChoice::Given("WN+AR1+RW".parse().unwrap()),
            rate_hz: 100.0,
            fit_range,
            ..CalibrationSettings::default()
        };
        let fit = |curve: &Curve, range| {
            let (curve, settings) = (curve.clone(), settings(range));
            fit_curve(&group, Estimator::Given, curve, &settings, &|_| {}).unwrap()
        };
        let ranged = fit(&whole, Some(range));
        let (shortened, all) = (fit(&short, None), fit(&whole, None));
        assert_eq!(
            (
                ranged.curve.counted_levels().len(),
                ranged.departure().scales
            ),
            (12, 12)
        );
        // The weights of either fit settle to 1e-6, and the objective without lack of fit is not stationary where they do.
        assert_relative_eq!(
            ranged.fit.objective,
            shortened.fit.objective,
            max_relative = 1e-6
        );
        let values = |o: &Outcome| {
            o.fit
                .composite
                .parameters()
                .map(|(_, x)| x)
                .collect::<Vec<_>>()
        };
        assert_relative_eq!(
            values(&ranged)[..],
            values(&shortened)[..],
            max_relative = 1e-6
        );
        assert!(all.fit.objective > 10.0 * ranged.fit.objective);
    }
}
