//! A calibration as JSON: fits with their figures, recordings, turn-on biases.

use super::document::{fit_name, fit_notes, reasons, turn_on_remark, without_interval};
use crate::commands::export::Quantity;
use crate::report::csv::merged;
use nav_sim_calibration::{
    Candidate, Estimator, Miss, Outcome, ParameterInterval, ParameterSpread, Practical, Ranking,
    Settings, TURN_ON_LEVEL, TurnOnSpread, duration, percent, tau_s,
};
use nav_sim_document::readable;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::{Composite, Parameter, ParameterRef, Process};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The facts of a fit that stand in the provenance of its model too; null where there are none.
pub(super) fn fit_record(outcome: &Outcome, settings: &Settings) -> Value {
    let (fit, goodness) = (&outcome.fit, outcome.goodness());
    let worst = outcome.departure().misfit;
    let notes = fit_notes(outcome, settings).into_iter();
    let notes: Vec<String> = notes.chain(without_interval(outcome)).collect();
    let is_trimmed = outcome.estimator == Estimator::DrAwv;
    json!({
        "signals": outcome.scope.name(),
        "model": outcome.spec.to_string(),
        "replicates": outcome.replicates,
        "recordings": outcome.recordings,
        "trim": is_trimmed.then(|| settings.trim.count(outcome.replicates)),
        "scales": outcome.curve.levels.len(),
        "objective": fit.objective,
        "termination": fit.termination,
        "combinations": fit.combinations,
        "starts": fit.starts,
        "agreeing": fit.agreeing,
        "runner_up": fit.runner_up,
        "bootstrap": outcome.inference.as_ref().map_or(0, |i| i.draws),
        "j_dof": goodness.map(|g| g.dof),
        "j_p_value": goodness.map(|g| g.p_value),
        "worst_ratio": worst.map(|miss| miss.ratio),
        "worst_tau_s": worst.map(|miss| tau_s(miss.level, settings.rate_hz)),
        "notes": notes,
    })
}

/// A fit: its record, models and figures. `axis` is `all` of pooled axes; `spread_p_value` is the probability that
/// replicates of one noise differ as much at some scale; `parameter_spread` are laws of model files; `missed` are the
/// scales at which curve and model differ by more than four standard deviations; `zero` are the processes whose amplitude
/// is zero, `at_end` those whose correlation time lies at the end of its range.
pub(super) fn fit_json(outcome: &Outcome, all: &[&Outcome], settings: &Settings) -> Value {
    let (fit, rate_hz) = (&outcome.fit, settings.rate_hz);
    let (inference, ranking) = (outcome.inference.as_ref(), outcome.ranking.as_ref());
    let labels = fit.composite.labels();
    let labelled = |processes: &[usize]| -> Vec<&str> {
        processes.iter().map(|i| labels[*i].as_str()).collect()
    };
    let miss = |m: &Miss| json!({ "tau_s": tau_s(m.level, rate_hz), "ratio": m.ratio, "deviations": m.deviations });
    let missed: Vec<Value> = outcome.departure().missed.iter().map(miss).collect();
    let law = |found: &ParameterSpread| {
        json!({
            "process": labels[found.of.process],
            "parameter": found.of.parameter.name(),
            "distribution": "lognormal",
            "median": found.median,
            "median_ci95": found.median_ci95,
            "sd": found.sd,
            "sd_ci95": found.sd_ci95,
        })
    };
    let laws: Vec<Value> = inference.iter().flat_map(|i| &i.varying).map(law).collect();
    let indistinct = inference.and_then(|i| i.indistinct.as_ref()).map(|i| {
        json!({
            "processes": labelled(&i.processes),
            "simpler": i.spec.to_string(),
            "p_value": i.p_value,
            "simpler_processes": processes(&i.composite, &i.intervals),
        })
    });
    let fit_facts = json!({
        "name": fit_name(outcome, all),
        "sensor": outcome.scope.sensor,
        "axis": outcome.scope.axis.map_or("all", |axis| axis.name()),
        "estimator": outcome.estimator,
        "ranking": ranking.map_or(Vec::new(), candidates),
        "reasons": ranking.map_or(Vec::new(), reasons),
        "processes": processes(&fit.composite, intervals(outcome)),
        "goodness": outcome.goodness(),
        "spread": inference.map_or(&[][..], |i| &i.spread),
        "spread_p_value": inference.and_then(|i| i.alike),
        "parameter_spread": laws,
        "indistinct": indistinct,
        "figures": figures(outcome, rate_hz),
        "missed": missed,
        "zero": labelled(&fit.zero),
        "at_end": labelled(&fit.at_end),
    });
    merged([fit_record(outcome, settings), fit_facts])
}

fn candidates(ranking: &Ranking) -> Vec<Value> {
    let entry = |(i, c): (usize, &Candidate)| {
        json!({
            "model": c.spec.to_string(),
            "parameters": c.spec.parameters(),
            "objective": c.objective,
            "optimism": c.optimism,
            "wvic": c.wvic(),
            "p_value": c.p_value,
            "j_test_p_value": c.j_p_value,
            "chosen": i == ranking.chosen,
        })
    };
    ranking.candidates.iter().enumerate().map(entry).collect()
}

/// Processes with the keys of model files; beside each parameter `_ci95` and `_se`, null where they are not determined.
fn processes(model: &Composite, intervals: &[ParameterInterval]) -> Vec<Value> {
    let mut all: Vec<Value> = model
        .processes
        .iter()
        .map(|process| json!(process))
        .collect();
    for i in intervals {
        let (entry, name) = (&mut all[i.of.process], i.of.parameter.name());
        entry[format!("{name}_ci95")] = json!(i.absent.is_none().then_some([i.low, i.high]));
    }
    all
}

pub(super) fn intervals(outcome: &Outcome) -> &[ParameterInterval] {
    outcome.inference.as_ref().map_or(&[], |i| &i.intervals)
}

pub(super) fn interval_of(
    intervals: &[ParameterInterval],
    of: ParameterRef,
) -> Option<&ParameterInterval> {
    intervals.iter().find(|i| i.of == of)
}

/// The means of one sensor, by the model of one estimator; where a bias is seen both probabilities are below `level`.
pub(super) fn turn_on_json(found: &TurnOnSpread) -> Value {
    json!({
        "sensor": found.sensor,
        "estimator": found.estimator,
        "finding": found.finding,
        "sigmas": found.sigmas(),
        "spread": found.spread(),
        "noise": found.noise(),
        "relative_error": found.relative_error(),
        "p_noise": found.p_noise,
        "p_drift": found.p_drift,
        "level": TURN_ON_LEVEL,
        "axes": found.axes,
        "remark": turn_on_remark(found),
    })
}

/// A figure of a model, in the unit of data sheets, or why the data do not show it. `ends`: the 95 % interval where draws were
/// made, if they determine it; `averages`: averaging times at which it is the largest part.
fn figure(
    (name, unit): (String, &str),
    value: Result<f64, &str>,
    ends: Option<Option<[f64; 2]>>,
    averages: String,
) -> Value {
    json!({
        "name": name,
        "value": value.ok(),
        "ci95": ends.flatten().filter(|_| value.is_ok()),
        "unit": unit,
        "interval": match (value, ends) {
            (Err(why), _) => why.to_owned(),
            (_, None) => String::new(),
            (_, Some(None)) => "not determined".to_owned(),
            (_, Some(Some(ends))) => ends.map(readable).join(" … "),
        },
        "averages": averages,
    })
}

/// N, B and K of a fit, and what a pair of N and K does not carry.
fn figures(outcome: &Outcome, rate_hz: f64) -> BTreeMap<String, Value> {
    let mut figures = outcome
        .practical(rate_hz)
        .map_or_else(BTreeMap::new, |p| practical_figures(outcome, &p));
    let model = &outcome.fit.composite;
    for (index, (process, label)) in model.processes.iter().zip(model.labels()).enumerate() {
        let Some((letter, name, unit, parameter, convert)) =
            further_figure(process, outcome.scope.sensor)
                .filter(|_| !outcome.fit.zero.contains(&index))
        else {
            continue;
        };
        let own = |of: ParameterRef| of.process == index && of.parameter == parameter;
        let interval = intervals(outcome).iter().find(|i| own(i.of)).map(|i| {
            let mut ends = [i.low, i.high].map(|end| convert(end, rate_hz));
            ends.sort_by(f64::total_cmp);
            i.absent.is_none().then_some(ends)
        });
        let value = model.parameters().find(|(of, _)| own(*of));
        let figure = figure(
            (format!("{label} {name}"), unit),
            value.map(|(_, value)| convert(value, rate_hz)).ok_or(""),
            interval,
            averages(outcome, index, rate_hz),
        );
        let key = match letter {
            "T" => format!("T_{label}"),
            letter => letter.to_owned(),
        };
        figures.insert(key, figure);
    }
    figures
}

fn practical_figures(outcome: &Outcome, practical: &Practical) -> BTreeMap<String, Value> {
    let sensor = outcome.scope.sensor;
    let (pair, ends) = (&practical.parameters.walk, &practical.intervals);
    let [white, walk] = match sensor {
        Sensor::Accel => ["velocity random walk N", "accel. random walk K"],
        Sensor::Gyro => ["angle random walk N", "rate random walk K"],
    };
    let figure =
        |name: &str, quantity: Quantity, value: Result<f64, &str>, ends: Option<[f64; 2]>, at| {
            let (unit, factor) = quantity.sheet(sensor);
            let ends = outcome
                .inference
                .is_some()
                .then_some(ends.map(|ends| ends.map(|end| end * factor)));
            figure((name.to_owned(), unit), value.map(|x| x * factor), ends, at)
        };
    let crossover = pair.crossover_s().map(duration);
    let none = format!("none up to {}", duration(practical.range_s));
    let to = crossover
        .as_ref()
        .map_or(String::new(), |t| format!("up to {t}"));
    let from = crossover.map_or(none.clone(), |t| {
        format!(
            "from {t}{}",
            practical
                .walk_until_s
                .map(|t| format!(" to {}", duration(t)))
                .unwrap_or_default()
        )
    });
    let minimum = practical.parameters.minimum;
    let floor = minimum.map_or(none, |m| format!("floor at {}", duration(m.tau_s)));
    let named = [
        (
            "N",
            figure(white, Quantity::Density, Ok(pair.density), ends.density, to),
        ),
        (
            "B",
            figure(
                "bias instability B",
                Quantity::Bias,
                minimum.map(|m| m.bias_instability()).ok_or("not reached"),
                ends.instability,
                floor,
            ),
        ),
        (
            "K",
            figure(
                walk,
                Quantity::Walk,
                practical
                    .walk_is_observed()
                    .then_some(pair.walk)
                    .ok_or("not observed"),
                ends.walk,
                from,
            ),
        ),
    ];
    named.map(|(key, figure)| (key.to_owned(), figure)).into()
}

/// Letter, name and unit of what a process is known by beside N and K, the parameter that it follows from, and how, at a
/// rate (Hz).
type FurtherFigure = (
    &'static str,
    &'static str,
    &'static str,
    Parameter,
    fn(f64, f64) -> f64,
);

fn further_figure(process: &Process, sensor: Sensor) -> Option<FurtherFigure> {
    let [increment, ramp] = match sensor {
        Sensor::Accel => ["m/s", "m/s² per s"],
        Sensor::Gyro => ["rad", "rad/s per s"],
    };
    const TIME: &str = "correlation time T";
    Some(match process {
        Process::Ar1(p) if p.phi() > 0.0 => ("T", TIME, "s", Parameter::Phi, |phi, rate_hz| {
            -1.0 / (phi.ln() * rate_hz)
        }),
        Process::GaussMarkov(_) => ("T", TIME, "s", Parameter::Beta, |beta, _| 1.0 / beta),
        // Of the increments over a sample, as IEEE 952 has it.
        Process::Quantization(_) => (
            "Q",
            "quantization Q",
            increment,
            Parameter::Q2,
            |q2, rate_hz| q2.sqrt() / rate_hz,
        ),
        Process::Drift(_) => ("R", "ramp", ramp, Parameter::Slope, |slope, rate_hz| {
            slope * rate_hz
        }),
        _ => return None,
    })
}

/// Averaging times at which a process is the largest part of the model's wavelet variance.
fn averages(outcome: &Outcome, index: usize, rate_hz: f64) -> String {
    let model = &outcome.fit.composite;
    let part = |process: &Process, level: u32| match process.haar_wv(level) / model.haar_wv(level) {
        part if part.is_finite() => part,
        // Of nothing nothing is a part.
        _ => 0.0,
    };
    let largest_at = |level: u32| {
        model
            .processes
            .iter()
            .map(|p| part(p, level))
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(i, _)| i)
    };
    let levels = outcome.counted_levels();
    let leads = || levels.iter().filter(|l| largest_at(**l) == Some(index));
    let time = |level: &u32| duration(0.5 * tau_s(*level, rate_hz));
    match (leads().next(), leads().next_back()) {
        (Some(first), Some(last)) if first == last => time(first),
        (Some(first), Some(last)) => format!("{} – {}", time(first), time(last)),
        _ => {
            format!(
                "none ({} at most)",
                percent(
                    levels
                        .iter()
                        .map(|l| part(&model.processes[index], *l))
                        .fold(0.0, f64::max)
                )
            )
        }
    }
}
