//! The page of a calibrated model: curves, model, what is left over, parameters, recordings.

use super::wavelet::{band, curve, scale_axis, sensor_name, unit, variance_axis};
use crate::report::brief::fit_verdict;
use crate::report::comparison::in_order;
use crate::report::curves::{CurvesFile, FittedCurve};
use crate::report::describe::meaning;
use crate::report::fits::interval_of;
use crate::report::number::readable;
use crate::report::page::{Axis, Cell, Chart, Colour, Mark, Page, Panel, Series, Table, Tone, svg};
use crate::report::practical::{policy, practical_rows};
use crate::report::short_names;
use crate::report::turn_on::turn_on_remark;
use nav_sim_calibration::{
    Diagnosis, Outcome, Practical, Settings, TurnOnSpread, Verdict, advice, shares, tau_s,
};
use nav_sim_signal::imu::Sensor;

/// The page of the models of one estimator. `outcomes`: each with its place among all fits of the command; `curves`: of the
/// same outcomes.
pub(crate) fn calibration_page(
    curves: &CurvesFile,
    outcomes: &[(usize, &Outcome)],
    diagnoses: &[Diagnosis],
    turn_on: &[TurnOnSpread],
    settings: &Settings,
) -> String {
    let (tone, verdict) = verdict(curves, outcomes, diagnoses);
    let estimator = outcomes.first().map_or("", |(_, o)| o.estimator.name());
    let mut page = Page::new(&format!("Stochastic calibration, {estimator}"), tone, [verdict]);
    for (fitted, (index, outcome)) in curves.curves.iter().zip(outcomes) {
        page.section(&format!("{} · {}", group_name(fitted), outcome.spec));
        if let Some(practical) = outcome.practical(settings.rate_hz) {
            page.heading(&format!("N, B and K: all processes together, N and K {}", policy()));
            page.table(&practical_table(&practical, outcome.scope.sensor, *index));
        }
        page.chart(&chart(fitted, diagnoses), CAPTION);
        page.heading("Parameters of each process");
        page.table(&parameters(outcome, *index, settings.rate_hz));
        outcome.notes.iter().for_each(|note| page.text(&format!("Note: {note}")));
        page.folded("Allan deviation", |page| page.chart(&allan(fitted), ALLAN));
    }
    if !diagnoses.is_empty() {
        page.section("The recordings beside one another");
    }
    for sensor in Sensor::ALL {
        let lines = advice(diagnoses, sensor);
        lines.iter().for_each(|line| page.text(&format!("{}: {line}", sensor_name(sensor.name()))));
    }
    means(&mut page, turn_on, outcomes);
    page.checked(
        "wavelet variances of models to 1e-13 of an independent implementation (tests/truth/calibration_truth.rs); the optimum to 1e-6 \
         of an exhaustive search that shares no code with it (tests/truth/global_minimum.rs), all relative.",
    );
    page.html()
}

/// What the recordings' means say of a turn-on bias. Sources of the numbers are places in the JSON of the command.
fn means(page: &mut Page, turn_on: &[TurnOnSpread], outcomes: &[(usize, &Outcome)]) {
    let is_of_these_fits = |t: &&TurnOnSpread| outcomes.iter().any(|(_, o)| o.estimator == t.estimator);
    if !turn_on.iter().any(|t| is_of_these_fits(&t)) {
        return;
    }
    page.section("Turn-on bias");
    let mut table = Table::new(["axis", "recordings", "spread of the means", "by noise alone", "unit"]);
    for (i, found) in turn_on.iter().enumerate().filter(|(_, t)| is_of_these_fits(t)) {
        page.text(&format!("{}: {}.", sensor_name(found.sensor.name()), turn_on_remark(found)));
        for (k, axis) in found.axes.iter().enumerate() {
            let number = |value: f64, key: &str| Cell::number(value, &format!("/turn_on/{i}/axes/{k}/{key}"));
            table.row([
                format!("{} {}", found.sensor.name(), axis.axis.name()).into(),
                number(axis.recordings as f64, "recordings"),
                number(axis.spread, "spread"),
                number(axis.noise, "noise"),
                found.sensor.unit().into(),
            ]);
        }
    }
    page.table(&table);
}

/// The same as a picture.
pub(crate) fn calibration_svg(curves: &CurvesFile, diagnoses: &[Diagnosis]) -> String {
    let charts: Vec<Chart> = curves.curves.iter().map(|fitted| chart(fitted, diagnoses)).collect();
    svg("Stochastic calibration", &charts)
}

pub(super) const CAPTION: &str = "Above: the wavelet variance that the model was fitted to with its 95 % band, that of each recording, what the \
                       model implies and each of its processes. Below: data over model; the band should hold 1.";
const ALLAN: &str = "√(2 ν) at half the scale: the Allan deviation of the data (the robust one, where the estimator is), of the \
                     model and of its processes.";

/// `Accelerometer x`, or `Gyroscope, all axes`.
fn group_name(fitted: &FittedCurve) -> String {
    let sensor = sensor_name(&fitted.sensor);
    if fitted.axis == "all" { format!("{sensor}, all axes") } else { format!("{sensor} {}", fitted.axis) }
}

/// Whether each model describes its curve, and where it is farthest from it.
fn verdict(curves: &CurvesFile, outcomes: &[(usize, &Outcome)], diagnoses: &[Diagnosis]) -> (Tone, String) {
    let mut tone = Tone::Good;
    let mut found: Vec<(String, Vec<String>)> = Vec::new();
    for (fitted, (_, outcome)) in curves.curves.iter().zip(outcomes) {
        let goodness = outcome.inference.as_ref().and_then(|i| i.goodness);
        if goodness.is_some_and(|g| g.is_rejected()) {
            tone = Tone::Bad;
        }
        let told = fit_verdict(outcome, curves.rate_hz);
        match found.iter_mut().find(|(verdict, _)| *verdict == told) {
            Some((_, groups)) => groups.push(group_name(fitted)),
            None => found.push((told, vec![group_name(fitted)])),
        }
    }
    let mut parts: Vec<String> =
        found.into_iter().map(|(told, groups)| format!("{}: {told}.", groups.join("; "))).collect();
    let named = diagnoses.iter().filter(|d| d.verdict != Verdict::Normal).map(|d| d.name.as_str());
    // both sensors may name a recording
    let abnormal = in_order(named);
    if !abnormal.is_empty() {
        tone = if tone == Tone::Good { Tone::Doubtful } else { tone };
        parts.push(format!("Not like the other recordings: {}.", abnormal.join(", ")));
    }
    (tone, parts.join(" "))
}

pub(super) fn chart(fitted: &FittedCurve, diagnoses: &[Diagnosis]) -> Chart {
    let FittedCurve { tau_s, wv, ci_low, ci_high, implied, .. } = fitted;
    let ratio =
        |values: &[f64]| -> Vec<f64> { values.iter().zip(implied).map(|(nu, model)| nu / model).collect() };
    let mut variance = recordings(fitted, diagnoses);
    variance.extend(processes(fitted));
    variance.extend([
        Series::new("data, 95 %", Colour::Ink, band(tau_s, ci_low, ci_high)),
        Series::line("data, 95 %", Colour::Ink, curve(tau_s, wv)),
        Series::line("model", Colour::REAL, curve(tau_s, implied)),
    ]);
    let (low, high) = (ratio(ci_low), ratio(ci_high));
    let left = vec![
        Series::new("data, 95 %", Colour::Ink, band(tau_s, &low, &high)),
        Series::line("data, 95 %", Colour::Ink, curve(tau_s, &ratio(wv))),
        Series::new("model", Colour::REAL, Mark::Level(1.0)),
    ];
    let panels = vec![
        Panel { height: 1.4, ..Panel::new(variance_axis(&fitted.sensor), variance) },
        Panel { height: 0.5, ..Panel::new(Axis::log("data / model").including(0.8, 1.25), left) },
    ];
    let title = format!("Wavelet variance: {}, {}", group_name(fitted), fitted.estimator.to_uppercase());
    Chart::new(&title, scale_axis(), panels).in_group("scales")
}

/// Thin lines, grey but for the abnormal ones.
fn recordings(fitted: &FittedCurve, diagnoses: &[Diagnosis]) -> Vec<Series> {
    let is_abnormal = |file: &str| {
        let is_of_file = |d: &&Diagnosis| d.name == file && d.sensor.name() == fitted.sensor;
        diagnoses.iter().find(is_of_file).is_some_and(|d| d.verdict != Verdict::Normal)
    };
    let mut abnormal: Vec<&str> = Vec::new();
    let mut all = Vec::new();
    if fitted.replicates.len() < 2 {
        return all;
    }
    let names = short_names(&fitted.replicates.iter().map(|r| r.file.as_str()).collect::<Vec<_>>());
    for (replicate, name) in fitted.replicates.iter().zip(names) {
        let points = curve(&fitted.tau_s, &replicate.wv);
        if !is_abnormal(&replicate.file) {
            all.push(Series::thin("recordings", Colour::Soft, points));
            continue;
        }
        if !abnormal.contains(&replicate.file.as_str()) {
            abnormal.push(&replicate.file);
        }
        let hue = 3 + abnormal.iter().position(|file| *file == replicate.file).unwrap_or(0);
        all.push(Series::thin(&format!("{name} (abnormal)"), Colour::Hue(hue), points));
    }
    all
}

/// Hues of processes: those that neither model nor data have.
const HUES: [usize; 6] = [0, 2, 3, 4, 5, 6];

fn processes(fitted: &FittedCurve) -> Vec<Series> {
    let known = fitted.processes.iter().filter(|(_, wv)| wv.iter().any(|nu| *nu > 0.0));
    let line = |(k, (name, wv)): (usize, (&String, &Vec<f64>))| {
        Series::dashed(name, Colour::Hue(HUES[k % HUES.len()]), curve(&fitted.tau_s, wv))
    };
    known.enumerate().map(line).collect()
}

fn allan(fitted: &FittedCurve) -> Chart {
    let deviation = |values: &[f64]| -> Vec<f64> { values.iter().map(|nu| (2.0 * nu).sqrt()).collect() };
    let times: Vec<f64> = fitted.tau_s.iter().map(|tau| 0.5 * tau).collect();
    let half = FittedCurve {
        tau_s: times.clone(),
        processes: fitted.processes.iter().map(|(name, wv)| (name.clone(), deviation(wv))).collect(),
        ..FittedCurve::default()
    };
    let mut series = processes(&half);
    let data = band(&times, &deviation(&fitted.ci_low), &deviation(&fitted.ci_high));
    series.extend([
        Series::new("data, 95 %", Colour::Ink, data),
        Series::line("data, 95 %", Colour::Ink, curve(&times, &deviation(&fitted.wv))),
        Series::line("model", Colour::REAL, curve(&times, &deviation(&fitted.implied))),
    ]);
    let axis = Axis::log(&format!("Allan deviation ({})", unit(&fitted.sensor)));
    let panel = Panel { height: 1.2, ..Panel::new(axis, series) };
    Chart::new(
        &format!("Allan deviation: {}", group_name(fitted)),
        Axis::log("averaging time (s)"),
        vec![panel],
    )
}

/// N, B and K as the terminal prints them.
fn practical_table(practical: &Practical, sensor: Sensor, index: usize) -> Table {
    let mut table = Table::new(["parameter", "value", "95 % interval", "unit", "in SI", "governs averages"]);
    for row in practical_rows(practical, sensor) {
        let value = match row.value {
            Ok(value) => Cell::number(value, &format!("/fits/{index}/parameters/{}", row.source)),
            Err(why) => Cell::figures(why),
        };
        table.row([
            row.name.into(),
            value,
            Cell::figures(row.interval),
            row.unit.into(),
            Cell::figures(row.si),
            row.governs.into(),
        ]);
    }
    table
}

/// A row a parameter. Values and intervals stand in the JSON of `calibrate` under /fits/`index`.
fn parameters(outcome: &Outcome, index: usize, rate_hz: f64) -> Table {
    let model = &outcome.fit.composite;
    let intervals = outcome.inference.as_ref().map_or(&[][..], |i| &i.intervals);
    let shares = shares(model, &outcome.curve.levels);
    let labels = model.labels();
    let mut table = Table::new(["parameter", "value", "95 % interval", "unit", "dominates at", "that is"]);
    for (of, value) in model.parameters() {
        let (process, name) = (&model.processes[of.process], of.parameter.name());
        let interval = interval_of(intervals, of).map_or_else(String::new, |i| match i.absent {
            None => format!("{} … {}", digits(name, i.low), digits(name, i.high)),
            Some(_) => "not determined".to_owned(),
        });
        let is_absent = outcome.fit.zero.contains(&of.process);
        let leads = &shares[of.process].leads;
        let scales = match (leads.first(), leads.last()) {
            (Some(first), Some(last)) => {
                format!("{} … {} s", readable(tau_s(*first, rate_hz)), readable(tau_s(*last, rate_hz)))
            }
            _ => "no scale".to_owned(),
        };
        let told = if is_absent {
            "no part in it".to_owned()
        } else {
            meaning(process, outcome.scope.sensor, rate_hz)
        };
        let source = format!("/fits/{index}/processes/{}/{name}", of.process);
        let value =
            if name == "phi" { Cell::figures(digits(name, value)) } else { Cell::number(value, &source) };
        table.row([
            format!("{} {name}", labels[of.process]).into(),
            value,
            Cell::figures(interval),
            parameter_unit(name, outcome.scope.sensor.unit()).into(),
            Cell::figures(scales),
            told.into(),
        ]);
    }
    table
}

/// φ is told by its distance from 1.
fn digits(parameter: &str, value: f64) -> String {
    if parameter == "phi" { format!("{value:.6}") } else { readable(value) }
}

fn parameter_unit(parameter: &str, unit: &str) -> String {
    match parameter {
        "phi" | "theta" => "1".to_owned(),
        "beta" => "1/s".to_owned(),
        "slope" => format!("{unit} a sample"),
        "sigma2" | "gamma2" => format!("({unit})² a sample"),
        _ => format!("({unit})²"),
    }
}
