//! Effect of leaving a recording out on each estimator: its curve, and every parameter.

use crate::curve::shape::variance_of_log;
use crate::curve::{Estimator, Group, Replicate, average};
use crate::outcome::{Outcome, Settings, tau_s};

/// Movement of an estimator when one recording is left out.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LeftOut {
    /// The group, `accel` or `accel.x`.
    #[serde(rename = "signals")]
    pub group: String,
    /// The estimator.
    pub estimator: Estimator,
    /// Scale (s) at which the curve moves most, in standard deviations of its own.
    pub tau_s: f64,
    /// nu without it over nu with it, less one, there.
    pub change: f64,
    /// The same in standard deviations of ln nu of the curve.
    pub deviations: f64,
    /// Movement of every parameter; empty where there is no fit without it.
    pub parameters: Vec<Movement>,
}

/// Movement of one parameter.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Movement {
    /// Label of the process.
    pub process: String,
    /// Name of the parameter.
    pub parameter: &'static str,
    /// With all recordings (units of the parameter).
    pub with: f64,
    /// Without this recording (units of the parameter).
    pub without: f64,
}

/// Movement of an outcome without the recording of that name; none if no curve is left.
pub(super) fn left_out(
    group: &Group,
    name: &str,
    outcome: &Outcome,
    settings: &Settings,
) -> Option<LeftOut> {
    let mut rest: Vec<Replicate> = group
        .replicates
        .iter()
        .filter(|r| r.name != name)
        .cloned()
        .collect();
    // Without the shortest there would be more scales: another fit than this one.
    for replicate in &mut rest {
        replicate.classical.truncate(outcome.curve.levels.len());
        replicate.robust.truncate(outcome.curve.levels.len());
    }
    let mut without = average(&rest, outcome.estimator, settings.trim, &settings.tuning).ok()?;
    let with = &outcome.curve;
    // The same scales in both fits: else the change of a parameter would be one of scales.
    without.ignored.clone_from(&with.ignored);
    without.classical.clone_from(&with.classical);
    without.differing = with.differing;
    let moves = with
        .levels
        .iter()
        .zip(&with.wv)
        .zip(&with.edof)
        .zip(&without.wv);
    let movement = |(((level, with), edof), without): (((&u32, &f64), &f64), &f64)| {
        let ratio = without / with;
        (
            *level,
            ratio - 1.0,
            ratio.ln() / variance_of_log(*edof).sqrt(),
        )
    };
    let (level, change, deviations) = moves
        .map(movement)
        .max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()))?;
    let parameters = outcome
        .estimate_again(&without, settings)
        .map_or(Vec::new(), |fit| movements(outcome, &fit.composite));
    Some(LeftOut {
        group: group.scope.name(),
        estimator: outcome.estimator,
        tau_s: tau_s(level, settings.rate_hz),
        change,
        deviations,
        parameters,
    })
}

fn movements(outcome: &Outcome, without: &crate::noise::Composite) -> Vec<Movement> {
    let with = &outcome.fit.composite;
    let of_process =
        |((a, b), label): ((&crate::noise::Process, &crate::noise::Process), String)| {
            let pairs = a.parameters().into_iter().zip(b.parameters());
            let movement =
                |((parameter, with), (_, without)): ((&'static str, f64), (&'static str, f64))| {
                    Movement {
                        process: label.clone(),
                        parameter,
                        with,
                        without,
                    }
                };
            pairs.map(movement).collect::<Vec<_>>()
        };
    with.processes
        .iter()
        .zip(&without.processes)
        .zip(with.labels())
        .flat_map(of_process)
        .collect()
}
