//! The charts of a calibration: wavelet variance and model, and what is exported on the Allan deviation.

use super::words::stem;
use crate::report::curve_chart::{band, curve, scale_axis, sensor_name, unit, variance_axis};
use crate::report::curves::{FittedCurve, ReplicateCurve};
use nav_sim_calibration::{Diagnosis, Outcome, Verdict};
use nav_sim_document::{Axis, Chart, Colour, Mark, Panel, Series, short_names};

/// What is to be seen in [`variance`].
pub(crate) const CAPTION: &str = "Wavelet variance with its 95 % band, the recordings, the model and its processes; below: data over model.";

/// What is to be seen in [`allan`].
pub(super) fn allan_caption() -> String {
    format!(
        "Allan deviation: recordings, model, and what is exported: {}. N is read at 1 s, K at 3 s, 0.664 B at the floor.",
        super::figures::policy()
    )
}

/// `Accelerometer x`, or `Gyroscope, all axes`.
pub(super) fn group_name(fitted: &FittedCurve) -> String {
    let sensor = sensor_name(&fitted.sensor);
    if fitted.axis == "all" {
        format!("{sensor}, all axes")
    } else {
        format!("{sensor} {}", fitted.axis)
    }
}

/// The wavelet variance, and what the model leaves of it.
pub(crate) fn variance(fitted: &FittedCurve, diagnoses: &[Diagnosis]) -> Chart {
    let FittedCurve {
        tau_s,
        wv,
        ci_low,
        ci_high,
        implied,
        ..
    } = fitted;
    let ratio = |values: &[f64]| -> Vec<f64> {
        values
            .iter()
            .zip(implied)
            .map(|(nu, model)| nu / model)
            .collect()
    };
    let data = |wv: &[f64], low: &[f64], high: &[f64]| {
        [
            Series::new("data, 95 %", Colour::Ink, band(tau_s, low, high)),
            Series::line("data, 95 %", Colour::Ink, curve(tau_s, wv)),
        ]
    };
    let mut upper = recordings(fitted, diagnoses, |_| true, |tau, nu| (tau, nu));
    upper.extend(processes(fitted));
    upper.extend(data(wv, ci_low, ci_high));
    upper.push(Series::line("model", Colour::REAL, curve(tau_s, implied)));
    let mut lower = data(&ratio(wv), &ratio(ci_low), &ratio(ci_high)).to_vec();
    lower.push(Series::new("model", Colour::REAL, Mark::Level(1.0)));
    let panels = vec![
        Panel {
            height: 1.4,
            ..Panel::new(variance_axis(&fitted.sensor), upper)
        },
        Panel {
            height: 0.5,
            ..Panel::new(Axis::log("data / model").including(0.8, 1.25), lower)
        },
    ];
    let title = format!(
        "Wavelet variance: {}, {}",
        group_name(fitted),
        fitted.estimator.to_uppercase()
    );
    Chart::new(&title, scale_axis(), panels).in_group("scales")
}

/// Allan deviation at a scale: of averages half as long, √(2 nu).
fn deviation(tau_s: f64, nu: f64) -> (f64, f64) {
    (0.5 * tau_s, (2.0 * nu).sqrt())
}

/// The Allan deviation of each axis with N, B and K, where they are read off it.
pub(super) fn allan(
    fitted: &FittedCurve,
    outcome: &Outcome,
    diagnoses: &[Diagnosis],
    rate_hz: f64,
) -> Vec<Chart> {
    let mut axes: Vec<&str> = fitted
        .replicates
        .iter()
        .filter_map(|r| r.axis.as_deref())
        .collect();
    axes.sort_unstable();
    axes.dedup();
    let axes = if fitted.axis == "all" {
        axes
    } else {
        vec![fitted.axis.as_str()]
    };
    let model: Vec<(f64, f64)> = fitted
        .tau_s
        .iter()
        .zip(&fitted.implied)
        .map(|(t, nu)| deviation(*t, *nu))
        .collect();
    let chart = |axis: &&str| {
        let mut series = recordings(
            fitted,
            diagnoses,
            |r| r.axis.as_deref().is_none_or(|own| own == *axis),
            deviation,
        );
        if series.is_empty() {
            let data = fitted
                .tau_s
                .iter()
                .zip(&fitted.wv)
                .map(|(t, nu)| deviation(*t, *nu));
            series.push(Series::line("data", Colour::Ink, data.collect()));
        }
        series.push(Series::line("model", Colour::REAL, model.clone()));
        series.extend(exported(outcome, &model, rate_hz));
        let y = Axis::log(&format!("Allan deviation ({})", unit(&fitted.sensor)));
        let title = format!("{} {axis}", sensor_name(&fitted.sensor));
        Chart::new(
            &title,
            Axis::log("averaging time (s)"),
            vec![Panel {
                height: 1.2,
                ..Panel::new(y, series)
            }],
        )
    };
    let charts: Vec<Chart> = axes.iter().map(chart).collect();
    if charts.len() > 1 {
        charts.into_iter().map(Chart::small).collect()
    } else {
        charts
    }
}

/// Lines of N and K over the times of a model, with the points where they are read, and the floor.
fn exported(outcome: &Outcome, model: &[(f64, f64)], rate_hz: f64) -> Vec<Series> {
    let Some(practical) = outcome.practical(rate_hz) else {
        return Vec::new();
    };
    let pair = practical.parameters.walk;
    let lowest = model.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let highest = model.iter().map(|p| p.1).fold(0.0, f64::max);
    // Beyond the model's own values the lines would only stretch the axis.
    let over = |line: &dyn Fn(f64) -> f64| {
        let points = model.iter().map(|(t, _)| (*t, line(*t)));
        points
            .filter(|(_, y)| *y > 0.3 * lowest && *y < 1.5 * highest)
            .collect::<Vec<_>>()
    };
    let mut series = Vec::new();
    if pair.density > 0.0 {
        series.push(Series::dashed(
            "N/√τ",
            N,
            over(&|t| pair.density / t.sqrt()),
        ));
        series.push(Series::new("N", N, Mark::Reading(1.0, pair.density)));
    }
    if practical.walk_is_observed() {
        series.push(Series::dashed(
            "K√(τ/3)",
            K,
            over(&|t| pair.walk * (t / 3.0).sqrt()),
        ));
        series.push(Series::new("K", K, Mark::Reading(3.0, pair.walk)));
    }
    if let Some(minimum) = practical.parameters.minimum {
        series.push(Series::new(
            "0.664 B",
            B,
            Mark::Reading(minimum.tau_s, minimum.deviation),
        ));
    }
    series
}

const N: Colour = Colour::Hue(0);
const K: Colour = Colour::Hue(2);
const B: Colour = Colour::Hue(3);

/// Hues of processes: those that neither model nor recordings have.
const PROCESSES: [usize; 5] = [0, 2, 3, 4, 5];
/// Hues of abnormal recordings.
const ABNORMAL: [usize; 2] = [6, 7];

/// Thin lines, grey but for the abnormal ones.
fn recordings(
    fitted: &FittedCurve,
    diagnoses: &[Diagnosis],
    is_shown: impl Fn(&ReplicateCurve) -> bool,
    point: impl Fn(f64, f64) -> (f64, f64),
) -> Vec<Series> {
    let is_abnormal = |file: &str| {
        let of_file = |d: &&Diagnosis| d.name == file && d.sensor.name() == fitted.sensor;
        diagnoses
            .iter()
            .find(of_file)
            .is_some_and(|d| d.verdict != Verdict::Normal)
    };
    if fitted.replicates.len() < 2 {
        return Vec::new();
    }
    let names = short_names(
        &fitted
            .replicates
            .iter()
            .map(|r| r.file.as_str())
            .collect::<Vec<_>>(),
    );
    let mut abnormal: Vec<&str> = Vec::new();
    let mut all = Vec::new();
    for (replicate, name) in fitted.replicates.iter().zip(&names) {
        let file = replicate.file.as_str();
        if is_abnormal(file) && !abnormal.contains(&file) {
            abnormal.push(file);
        }
        if !is_shown(replicate) {
            continue;
        }
        let points = fitted
            .tau_s
            .iter()
            .zip(&replicate.wv)
            .map(|(t, nu)| point(*t, *nu))
            .collect();
        all.push(match abnormal.iter().position(|other| *other == file) {
            None => Series::thin("recordings", Colour::Soft, points),
            Some(k) => {
                let hue = Colour::Hue(ABNORMAL[k % ABNORMAL.len()]);
                Series::line(&format!("{} (abnormal)", stem(name)), hue, points)
            }
        });
    }
    all
}

fn processes(fitted: &FittedCurve) -> Vec<Series> {
    let known = fitted
        .processes
        .iter()
        .filter(|(_, wv)| wv.iter().any(|nu| *nu > 0.0));
    let line = |(k, (name, wv)): (usize, (&String, &Vec<f64>))| {
        Series::dashed(
            name,
            Colour::Hue(PROCESSES[k % PROCESSES.len()]),
            curve(&fitted.tau_s, wv),
        )
    };
    known.enumerate().map(line).collect()
}
