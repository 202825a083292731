//! A calibration on one screen: the verdict first, then each parameter with its interval.

use super::fits::{interval_of, meaning};
use crate::calibration::{Diagnosis, Outcome, ParameterInterval, Settings, advice};
use crate::imu::Sensor;
use crate::noise::Process;

/// With more fits than this each has one line.
const MOST: usize = 2;
/// Remarks that are shown of a fit, and lines of advice of a sensor.
const REMARKS: usize = 2;
const ADVICE: usize = 4;

/// What the recordings of each sensor say of one another, and every fit, shortly: two of five processes in twenty lines.
#[must_use]
pub fn brief(outcomes: &[Outcome], diagnoses: &[Diagnosis], settings: &Settings) -> String {
    let mut lines = Vec::new();
    for sensor in Sensor::ALL {
        let advice = advice(diagnoses, sensor, settings.rate_hz);
        let left = advice.len().saturating_sub(ADVICE);
        lines.extend(advice.into_iter().take(ADVICE).map(|line| format!("{}: {line}", sensor.name())));
        if left > 0 {
            lines.push(format!("{}: {}", sensor.name(), more(left)));
        }
    }
    for outcome in outcomes {
        if outcomes.len() > MOST {
            lines.push(format!("{}: {}", head(outcome), one_line(outcome)));
            continue;
        }
        lines.push(head(outcome));
        lines.extend(processes(outcome, settings.rate_hz));
        lines.extend(outcome.notes.iter().take(REMARKS).map(|note| format!("  note: {note}")));
        let left = outcome.notes.len().saturating_sub(REMARKS);
        if left > 0 {
            lines.push(format!("  note: {}", more(left)));
        }
    }
    lines.join("\n")
}

fn more(left: usize) -> String {
    format!("{left} more with --verbose")
}

/// `accel · dr-awv · WN+AR1 · 24 signals, J-test p = 0.711: no evidence against the model`
fn head(outcome: &Outcome) -> String {
    let signals = match outcome.replicates {
        0 => "a curve".to_owned(),
        1 => "1 signal".to_owned(),
        count => format!("{count} signals"),
    };
    let goodness = outcome.inference.as_ref().and_then(|i| i.goodness);
    let test = goodness.map_or(String::new(), |g| {
        let verdict = if g.is_rejected() { "the model is rejected" } else { "no evidence against the model" };
        format!(", J-test p = {:.3}: {verdict}", g.p_value)
    });
    format!("{} · {} · {} · {signals}{test}", outcome.scope.name(), outcome.estimator.name(), outcome.spec)
}

/// `WN sigma2 5.42e-5, AR1 phi 0.9859 sigma2 1.58e-8`
fn one_line(outcome: &Outcome) -> String {
    let model = &outcome.fit.composite;
    let process = |(process, label): (&Process, String)| {
        let values = process.parameters().into_iter().map(|(name, x)| format!(" {name} {}", number(name, x)));
        format!("{label}{}", values.collect::<String>())
    };
    model.processes.iter().zip(model.labels()).map(process).collect::<Vec<_>>().join(", ")
}

/// A line for each process: its parameters with their intervals, and what they mean.
fn processes(outcome: &Outcome, rate_hz: f64) -> Vec<String> {
    let intervals = outcome.inference.as_ref().map_or(&[][..], |i| &i.intervals);
    let model = &outcome.fit.composite;
    let line = |(index, (process, label)): (usize, (&Process, String))| {
        let own = model.parameters().filter(|(of, _)| of.process == index);
        let all: Vec<String> = own
            .map(|(of, value)| {
                let ends = interval_of(intervals, of).map_or(String::new(), ends);
                format!("{} = {}{ends}", of.parameter.name(), number(of.parameter.name(), value))
            })
            .collect();
        let meaning = if outcome.fit.zero.contains(&index) {
            "no part in it".to_owned()
        } else {
            meaning(process, outcome.scope.sensor, rate_hz)
        };
        format!("  {label:<6} {}; {meaning}", all.join(", "))
    };
    model.processes.iter().zip(model.labels()).enumerate().map(line).collect()
}

/// A value as a screen needs it: phi is told by its distance from 1.
fn number(parameter: &str, value: f64) -> String {
    if parameter == "phi" { format!("{value:.6}") } else { format!("{value:.4e}") }
}

/// ` (5.36e-5 … 5.48e-5)`
fn ends(interval: &ParameterInterval) -> String {
    match interval.absent {
        None => {
            let [low, high] =
                [interval.low, interval.high].map(|end| number(interval.of.parameter.name(), end));
            format!(" ({low} … {high})")
        }
        Some(_) => " (not determined)".to_owned(),
    }
}
