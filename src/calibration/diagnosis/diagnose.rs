//! Each recording against the others, sensor by sensor.

use super::common::common;
use super::comparison::Comparison;
use super::contrasts::FEWEST;
use super::leave_out::left_out;
use super::piece::{Piece, Test, axes};
use super::result::{AxisScores, Diagnosis, Verdict};
use crate::curve::Group;
use crate::imu::Sensor;
use crate::outcome::{Outcome, Settings};
use rayon::prelude::*;

/// Diagnoses every recording, sensor by sensor. Without two recordings there is nothing to compare.
#[must_use]
pub fn diagnose(groups: &[Group], outcomes: &[Outcome], settings: &Settings) -> Vec<Diagnosis> {
    Sensor::ALL
        .into_iter()
        .flat_map(|sensor| of_sensor(sensor, groups, outcomes, settings))
        .collect()
}

fn of_sensor(
    sensor: Sensor,
    groups: &[Group],
    outcomes: &[Outcome],
    settings: &Settings,
) -> Vec<Diagnosis> {
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
    let pieces = if names.len() < FEWEST {
        Vec::new()
    } else {
        pieces
    };
    let [noise, outliers] = [Test::Noise, Test::Outliers]
        .map(|test| Comparison::new(&pieces, sensor, test, settings.tuning.efficiency()));
    let drift = Comparison::drift(&pieces, sensor, &noise);
    let without = |name: &str| {
        let fits: Vec<_> = own
            .iter()
            .flat_map(|g| {
                outcomes
                    .iter()
                    .filter(|o| o.scope == g.scope)
                    .map(move |o| (*g, o))
            })
            .collect();
        fits.into_par_iter()
            .filter_map(|(g, o)| left_out(g, name, o, settings))
            .collect()
    };
    let diagnosis = |(index, name): (usize, &&str)| {
        let [of_noise, of_outliers] =
            [&noise, &outliers].map(|test| test.alarm(index, settings.rate_hz));
        let of_drift = drift.drift_alarm(index, &pieces);
        let verdict = match (&of_noise, &of_outliers, &of_drift) {
            (Some(_), _, _) => Verdict::Noise,
            (None, Some(_), _) => Verdict::Outliers,
            (None, None, Some(_)) => Verdict::Drift,
            (None, None, None) => Verdict::Normal,
        };
        Diagnosis {
            name: (*name).to_owned(),
            sensor,
            verdict,
            noise: of_noise,
            outliers: of_outliers,
            drift: of_drift,
            scores: joined(&pieces, noise.scores(index), outliers.scores(index)),
            common: common.clone(),
            left_out: without(name),
        }
    };
    names.iter().enumerate().map(diagnosis).collect()
}

fn joined(pieces: &[Piece<'_>], noise: Vec<Vec<f64>>, outliers: Vec<Vec<f64>>) -> Vec<AxisScores> {
    let all = pieces.iter().zip(noise).zip(outliers);
    all.map(|((piece, noise), outliers)| AxisScores {
        axis: piece.axis,
        noise,
        outliers,
    })
    .collect()
}
