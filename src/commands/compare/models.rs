//! Two calibrations of an IMU, figure by figure.

use crate::app::{Context, PlainAnswer, Result};
use crate::commands::calibrate::figure_of;
use crate::commands::export::ExportQuantity;
use crate::io::draws_file::{self, Draws};
use crate::io::model_file::{self, ModelFile};
use crate::report::first_names;
use nav_sim_calibration::figures_with_intervals;
use nav_sim_document::{Document, Table, Tone, readable};
use nav_sim_signal::imu::{Axis, Channel};
use serde_json::{Value, json};
use std::path::Path;

/// A figure: name, unit, value, 95 % interval.
type Estimate = (String, &'static str, f64, Option<[f64; 2]>);

/// N, K and B as far as the recordings tell, and the parameters of the processes, as figures of data sheets where they are such.
fn estimates((file, draws): &(ModelFile, Option<Draws>), channel: Channel) -> Vec<Estimate> {
    let range_s = file.observed_s().unwrap_or(1e3);
    let (model, rate_hz) = (file.model.axis(channel), file.model.rate_hz);
    let drawn = draws.iter().flat_map(|draws| &draws.models);
    let drawn: Vec<_> = drawn.map(|model| model.axis(channel)).collect();
    let figures = figures_with_intervals(model, &drawn, rate_hz, range_s);
    let quantities = [
        ExportQuantity::Density,
        ExportQuantity::Walk,
        ExportQuantity::Bias,
    ];
    let mut all: Vec<Estimate> = Vec::new();
    for (k, (quantity, (value, ends))) in quantities.into_iter().zip(figures).enumerate() {
        let (unit, factor) = quantity.data_sheet_unit(channel.sensor);
        let ends = ends.map(|ends| ends.map(|end| end * factor));
        all.extend(value.map(|x| (["N", "K", "B"][k].to_owned(), unit, x * factor, ends)));
    }
    let labels = model.labels();
    for (of, value) in model.parameters() {
        let (label, parameter) = (&labels[of.process], of.parameter.name());
        let figure = figure_of(&model.processes[of.process], label, channel.sensor);
        let (name, unit, convert) = match figure {
            Some(((key, _, unit), own, convert)) if own == of.parameter => (key, unit, convert),
            _ => (format!("{label} {parameter}"), "SI", (|x, _| x) as _),
        };
        let key = (channel, label.as_str(), parameter);
        let mut intervals = file.intervals.iter();
        let own = intervals.find(|i| (i.channel, i.process.as_str(), i.parameter.as_str()) == key);
        let ends = own.map(|i| [i.low, i.high].map(|end| convert(end, rate_hz)));
        all.push((name, unit, convert(value, rate_hz), ends));
    }
    all
}

/// Compares a model with a reference.
///
/// # Errors
/// When one cannot be read.
pub(super) fn compare(paths: [&Path; 2], context: &Context<'_>) -> Result<PlainAnswer> {
    let mut sides = Vec::new();
    for path in paths {
        let file = model_file::read(path)?.for_navigation();
        let draws = draws_file::usable(path, &file, file.model.rate_hz).unwrap_or_else(|doubt| {
            context.warn(format!("{doubt}: no intervals of N, K and B"));
            None
        });
        sides.push((file, draws));
    }
    let (mut rows, mut changed) = (Vec::new(), Vec::new());
    for channel in sides[0].0.present() {
        let of = |c: Channel| [0, 1].map(|k| sides[k].0.model.axis(c));
        let mut own = Channel::ALL.iter().filter(|c| c.sensor == channel.sensor);
        let is_pooled = own.all(|c| of(*c) == of(channel));
        if sides[1].0.missing.contains(&channel) || is_pooled && channel.axis != Axis::X {
            continue;
        }
        let signal = match is_pooled {
            true => channel.sensor.name().to_owned(),
            false => channel.to_string(),
        };
        // parameters of a sample mean the same in the same processes at the same rate
        let is_same = of(channel)[0].labels() == of(channel)[1].labels()
            && sides[0].0.model.rate_hz == sides[1].0.model.rate_hz;
        let second = estimates(&sides[1], channel);
        for (figure, unit, value, ends) in estimates(&sides[0], channel) {
            let other = second.iter().find(|other| other.0 == figure);
            if let Some((.., x, x_ends)) = other.filter(|_| is_same || unit != "SI") {
                // A model without intervals counts as known; of positive values in logarithms, squares add.
                let half = |k: usize, ends: Option<[f64; 2]>| {
                    let is_known = sides[k].1.is_none() && sides[k].0.intervals.is_empty();
                    let half = ends.map(|[low, high]| 0.5 * (high / low).ln().abs());
                    half.or(is_known.then_some(0.0))
                };
                let width = half(0, ends).zip(half(1, *x_ends)).map(|(a, b)| a.hypot(b));
                let ratio = x / value;
                let distance = width.map(|width| ratio.ln().abs() / (FAR * width));
                let distance = distance.filter(|d| d.is_finite());
                if distance > Some(1.0) {
                    changed.push(format!("{signal} {figure} × {}", readable(ratio)));
                }
                rows.push(json!({
                    "signal": signal,
                    "figure": figure,
                    "unit": unit,
                    "reference": value,
                    "reference_ci95": ends,
                    "model": x,
                    "model_ci95": x_ends,
                    "ratio": ratio,
                    "distance": distance,
                    "changed": distance.map(|distance| distance > 1.0),
                }));
            }
        }
    }
    let distance = |row: &Value| row["distance"].as_f64().unwrap_or(-1.0);
    let judged = rows.iter().filter(|row| distance(row) >= 0.0).count();
    rows.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
    let rest = judged - changed.len();
    let is_central =
        |row: &Value| distance(row) >= 0.0 && (row["figure"] == "N" || row["figure"] == "K");
    let (tone, verdict) = match (judged, &changed[..]) {
        (0, _) => (
            Tone::Undecided,
            "not judged: no shared figure has intervals (calibrate writes them)".to_owned(),
        ),
        (_, []) => {
            let unknown = match rows.len() - judged {
                0 => String::new(),
                n => format!(", {n} without intervals"),
            };
            let is_judged = unknown.is_empty() || rows.iter().any(is_central);
            (
                if is_judged {
                    Tone::Good
                } else {
                    Tone::Undecided
                },
                format!("no change seen: {rest} figures within 1.5 half widths of 95 %{unknown}"),
            )
        }
        _ => (
            Tone::Doubtful,
            format!(
                "changed: {}; {rest} others within their intervals",
                first_names(&changed)
            ),
        ),
    };
    let json = json!({
        "schema_version": 1,
        "reference": paths[0],
        "model": paths[1],
        "judged": judged,
        "rows": rows,
    });
    let mut document = Document::new("Two calibrations compared", tone, [verdict]);
    document.text(DISTANCE);
    let columns = [
        ("figure", "{signal} {figure} ({unit})"),
        ("reference", "reference"),
        ("95 %", "reference_ci95"),
        ("model", "model"),
        ("95 %", "model_ci95"),
        ("ratio", "ratio"),
        ("distance", "distance"),
        ("changed", "changed"),
    ];
    document.table(Table::of(&json, "/rows/*", &columns));
    Ok(PlainAnswer::new(json, document).with_page(None))
}

/// Distance over the half width of a 95 % interval from which on a figure has changed: 2.9 standard deviations, by chance in 4 % of
/// comparisons of ten figures.
const FAR: f64 = 1.5;

const DISTANCE: &str = "Distance: over 1.5 half widths of the 95 % interval of a difference, exceeded by one of ten figures in 4 % of comparisons. Figures without intervals count as known.";
