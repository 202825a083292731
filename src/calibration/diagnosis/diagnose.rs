//! Each recording against the others, sensor by sensor.

use super::common::common;
use super::common_drift::common_drift;
use super::comparison::Comparison;
use super::contrasts::FEWEST;
use super::leave_out::left_out;
use super::piece::{Piece, Test, axes};
use super::result::{AxisScores, Diagnosis, Differing, Misfit, Verdict};
use crate::curve::{Estimator, Group, Pool, Replicate};
use crate::imu::Sensor;
use crate::outcome::{Goodness, LevelSpread, Outcome, Settings};
use crate::uncertainty::ALIKE_LEVEL;
use rayon::prelude::*;

/// Diagnoses every recording, sensor by sensor. Without two recordings there is nothing to compare.
#[must_use]
pub fn diagnose(groups: &[Group], outcomes: &[Outcome], settings: &Settings) -> Vec<Diagnosis> {
    Sensor::ALL.into_iter().flat_map(|sensor| of_sensor(sensor, groups, outcomes, settings)).collect()
}

fn of_sensor(sensor: Sensor, groups: &[Group], outcomes: &[Outcome], settings: &Settings) -> Vec<Diagnosis> {
    let own: Vec<&Group> = groups.iter().filter(|g| g.scope.sensor == sensor).collect();
    let mut names: Vec<&str> = Vec::new();
    for replicate in own.iter().flat_map(|g| &g.replicates) {
        if !names.contains(&replicate.name.as_str()) {
            names.push(&replicate.name);
        }
    }
    if names.len() < 2 {
        return Vec::new();
    }
    let pieces = axes(&own, &names, outcomes);
    let common = common(&pieces, settings);
    let common_drift = common_drift(&pieces, settings.rate_hz);
    let pieces = if names.len() < FEWEST { Vec::new() } else { pieces };
    let dropped = dropped(&own, settings);
    let [noise, outliers] = [Test::Noise, Test::Outliers]
        .map(|test| Comparison::new(&pieces, sensor, test, settings.tuning.efficiency()));
    let drift = Comparison::drift(&pieces, sensor, &noise);
    let without = |name: &str| {
        let fits: Vec<_> = own
            .iter()
            .flat_map(|g| outcomes.iter().filter(|o| o.scope == g.scope).map(move |o| (*g, o)))
            .collect();
        fits.into_par_iter().filter_map(|(g, o)| left_out(g, name, o, settings)).collect()
    };
    let (misfits, differing) = (misfits(sensor, outcomes), differing(sensor, outcomes));
    let diagnosis = |(index, name): (usize, &&str)| {
        let [of_noise, of_outliers] = [&noise, &outliers].map(|test| test.alarm(index, settings.rate_hz));
        let of_drift = drift.drift_alarm(index, &pieces);
        let verdict = match (&of_noise, &of_outliers, &of_drift) {
            (Some(_), _, _) => Verdict::Noise,
            (None, Some(_), _) => Verdict::Outliers,
            (None, None, Some(_)) => Verdict::Drift,
            (None, None, None) => Verdict::Normal,
        };
        let is_of_recording = |r: &&Replicate| r.name == **name;
        Diagnosis {
            name: (*name).to_owned(),
            sensor,
            axes: own.iter().flat_map(|g| &g.replicates).filter(is_of_recording).count(),
            verdict,
            noise: of_noise,
            outliers: of_outliers,
            drift: of_drift,
            scores: joined(&pieces, noise.scores(index), outliers.scores(index)),
            common: common.outliers.clone(),
            gaussian_quantization: common.gaussian.clone(),
            coarse_steps: common.steps.clone(),
            common_drift: common_drift.clone(),
            dropped,
            left_out: without(name),
            misfits: misfits.clone(),
            differing,
        }
    };
    names.iter().enumerate().map(diagnosis).collect()
}

/// The fits of a sensor that the J-test rejects.
fn misfits(sensor: Sensor, outcomes: &[Outcome]) -> Vec<Misfit> {
    let rejected = |o: &Outcome| {
        let goodness = o.inference.as_ref()?.goodness.filter(Goodness::is_rejected)?;
        Some(Misfit { group: o.scope.name(), estimator: o.estimator, p_value: goodness.p_value })
    };
    outcomes.iter().filter(|o| o.scope.sensor == sensor).filter_map(rejected).collect()
}

/// Difference of the recordings of a sensor, by the fit with the smallest p-value; none where no test sees
/// one.
fn differing(sensor: Sensor, outcomes: &[Outcome]) -> Option<Differing> {
    let of_fit = |o: &Outcome| {
        let inference = o.inference.as_ref()?;
        let p_value = inference.alike.filter(|p| *p <= ALIKE_LEVEL)?;
        // Relative to the noise: at the last scales recordings scatter most for lack of coefficients, which
        // is no difference.
        let ratio = |s: &LevelSpread| s.between / s.within;
        let most = *inference.spread.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
        Some(Differing { p_value, most })
    };
    let own = outcomes.iter().filter(|o| o.scope.sensor == sensor);
    own.filter_map(of_fit).min_by(|a, b| a.p_value.total_cmp(&b.p_value))
}

/// Number of replicates that DR-AWV drops at each end in the smallest group of a sensor, with the pooling.
fn dropped(own: &[&Group], settings: &Settings) -> Option<(Pool, usize)> {
    let trim = own.iter().map(|g| settings.trim.count(g.replicates.len())).min()?;
    let pool = if own.iter().any(|g| g.scope.axis.is_none()) { Pool::Sensor } else { Pool::Axes };
    settings.estimators.contains(&Estimator::DrAwv).then_some((pool, trim))
}

fn joined(pieces: &[Piece<'_>], noise: Vec<Vec<f64>>, outliers: Vec<Vec<f64>>) -> Vec<AxisScores> {
    let all = pieces.iter().zip(noise).zip(outliers);
    all.map(|((piece, noise), outliers)| AxisScores { axis: piece.axis, noise, outliers }).collect()
}
