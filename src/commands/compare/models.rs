//! Two calibrations of an IMU, figure by figure.

use super::TableForm;
use crate::app::{Context, Failure, Result};
use crate::commands::export::Quantity;
use crate::io::draws_file::{self, Draws};
use crate::io::model_file::{self, ModelFile};
use crate::report::some;
use nav_sim_calibration::figures_with_intervals;
use nav_sim_document::{Document, Importance, Table, Tone, readable, short_names};
use nav_sim_signal::imu::{Axis, Channel, Sensor};
use nav_sim_signal::noise::{Kind, Parameter};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};
use std::path::Path;

/// What two models differ by: as JSON, `comparison.json`.
#[derive(Debug, Serialize)]
pub struct ModelComparison {
    /// Layout version.
    schema_version: u32,
    /// The model file that the other is compared with.
    reference: String,
    /// The other.
    model: String,
    /// Whether reference and model have intervals; one that has none counts as known.
    has_intervals: [bool; 2],
    /// Figures whose intervals are known on both sides.
    judged: usize,
    /// One row a figure that both have, the most distant first.
    rows: Vec<Row>,
    /// Form in which the table alone is printed.
    #[serde(skip)]
    pub(super) form: Option<TableForm>,
}

/// One figure of both models.
#[derive(Debug, Serialize)]
struct Row {
    /// `accel` where the three axes are alike, else `accel.x`.
    signal: String,
    figure: String,
    unit: &'static str,
    reference: f64,
    ci95_reference: Option<[f64; 2]>,
    model: f64,
    ci95_model: Option<[f64; 2]>,
    /// The model's over the reference's.
    ratio: f64,
    /// Their distance over that at which the 95 % interval of their difference ends, all figures together; none where an
    /// interval is not known.
    distance: Option<f64>,
    changed: bool,
}

/// A figure: name, unit, value, 95 % interval.
type Estimate = (String, &'static str, f64, Option<[f64; 2]>);

struct Side {
    file: ModelFile,
    draws: Option<Draws>,
}

impl Side {
    fn read(path: &Path, context: &Context<'_>) -> Result<Self> {
        let file = model_file::read(path)?.for_navigation();
        let draws = draws_file::usable(path, &file, file.model.rate_hz);
        let draws = draws.unwrap_or_else(|doubt| {
            context.warn(format!("{doubt}: no intervals of N, K and B"));
            None
        });
        Ok(Self { file, draws })
    }

    fn has_intervals(&self) -> bool {
        self.draws.is_some() || !self.file.intervals.is_empty()
    }

    /// N, B and K with averages up to `range_s`, and the parameters of the processes: of AR1 the correlation time.
    fn estimates(&self, channel: Channel, range_s: f64) -> Vec<Estimate> {
        let (model, rate_hz) = (self.file.model.axis(channel), self.file.model.rate_hz);
        let drawn = self.draws.iter().flat_map(|draws| &draws.models);
        let drawn: Vec<_> = drawn.map(|model| model.axis(channel)).collect();
        let stretch = self.draws.as_ref().map_or(1.0, |draws| draws.stretch);
        let practical = figures_with_intervals(model, &drawn, stretch, rate_hz, range_s);
        let quantities = [Quantity::Density, Quantity::Walk, Quantity::Bias];
        let mut all: Vec<Estimate> = ["N", "K", "B"]
            .into_iter()
            .zip(quantities)
            .zip(practical)
            .filter_map(|((name, quantity), (value, ends))| {
                let (unit, factor) = quantity.sheet(channel.sensor);
                let ends = ends.map(|ends| ends.map(|end| end * factor));
                Some((name.to_owned(), unit, value? * factor, ends))
            })
            .collect();
        let labels = model.labels();
        for (of, value) in model.parameters() {
            let (label, name) = (&labels[of.process], of.parameter.name());
            let is_own = |i: &&model_file::Interval| {
                i.channel == channel && i.process == *label && i.parameter == name
            };
            let own = self.file.intervals.iter().find(is_own);
            let (name, unit, convert): (_, _, fn(f64, f64) -> f64) =
                match (model.processes[of.process].kind(), of.parameter) {
                    (Kind::Quantization, _) => {
                        let unit = ["m/s", "rad"][channel.sensor as usize];
                        ("Q".to_owned(), unit, |q2, rate_hz| q2.sqrt() / rate_hz)
                    }
                    (_, Parameter::Phi) if value > 0.0 => {
                        (format!("{label} T"), "s", |phi, rate_hz| {
                            -1.0 / (phi.ln() * rate_hz)
                        })
                    }
                    _ => (format!("{label} {name}"), "SI", |value, _| value),
                };
            let ends = own.map(|i| [i.low, i.high].map(|end| convert(end, rate_hz)));
            let ends = ends.filter(|ends| ends.iter().all(|end| end.is_finite()));
            all.push((name, unit, convert(value, rate_hz), ends));
        }
        all
    }
}

/// Compares two model files.
///
/// # Errors
/// When one cannot be read.
pub(super) fn compare(
    paths: [&Path; 2],
    form: Option<TableForm>,
    context: &Context<'_>,
) -> Result<ModelComparison> {
    let [a, b] = paths.map(|path| Side::read(path, context));
    let sides = [a?, b?];
    // minima of both are sought where both have data
    let ranges = sides.iter().filter_map(|side| side.file.observed_s());
    let range_s = ranges.reduce(f64::min).unwrap_or(1e3);
    let is_known = sides.each_ref().map(|side| !side.has_intervals());
    let mut rows = Vec::new();
    for sensor in Sensor::ALL {
        let channels = Axis::ALL.map(|axis| Channel { sensor, axis });
        let files = sides.each_ref().map(|side| &side.file);
        let of = |c: &Channel| files.map(|file| file.model.axis(*c));
        let is_alike = channels.iter().all(|c| of(c) == of(&channels[0]));
        for channel in &channels[..if is_alike { 1 } else { 3 }] {
            if files.iter().any(|file| file.missing.contains(channel)) {
                continue;
            }
            let signal = if is_alike {
                sensor.name().to_owned()
            } else {
                channel.to_string()
            };
            let [first, second] = sides
                .each_ref()
                .map(|side| side.estimates(*channel, range_s));
            let is_same = files[0].model.rate_hz == files[1].model.rate_hz
                && of(channel)[0].labels() == of(channel)[1].labels();
            for (figure, unit, value, ends) in first {
                let Some((.., other, other_ends)) = second.iter().find(|e| e.0 == figure) else {
                    continue;
                };
                // parameters of a sample mean the same in the same processes at the same rate
                if is_same || !figure.contains(' ') {
                    let (values, ci95) = ([value, *other], [ends, *other_ends]);
                    let distance = distance(values, ci95, is_known);
                    let (signal, ratio) = (signal.clone(), other / value);
                    rows.push(Row {
                        signal,
                        figure,
                        unit,
                        reference: value,
                        ci95_reference: ends,
                        model: *other,
                        ci95_model: *other_ends,
                        ratio,
                        distance,
                        changed: false,
                    });
                }
            }
        }
    }
    if rows.is_empty() {
        return Err(Failure::input("the models have no sensor in common"));
    }
    let judged = rows.iter().filter(|row| row.distance.is_some()).count();
    // all figures together have the level of one (Bonferroni)
    let limit = Normal::standard().inverse_cdf(1.0 - 0.025 / judged.max(1) as f64) / 1.96;
    for row in &mut rows {
        row.distance = row.distance.map(|distance| distance / limit);
        row.changed = row.distance.is_some_and(|distance| distance > 1.0);
    }
    rows.sort_by(|a, b| {
        b.distance
            .unwrap_or(-1.0)
            .total_cmp(&a.distance.unwrap_or(-1.0))
    });
    Ok(ModelComparison {
        schema_version: 1,
        reference: paths[0].display().to_string(),
        model: paths[1].display().to_string(),
        has_intervals: is_known.map(|known| !known),
        judged,
        rows,
        form,
    })
}

/// The distance of two values over the ends of their intervals that face each other, the squares of which add; of positive
/// values in logarithms.
fn distance(values: [f64; 2], ci95: [Option<[f64; 2]>; 2], is_known: [bool; 2]) -> Option<f64> {
    let is_positive = values
        .iter()
        .chain(ci95.iter().flatten().flatten())
        .all(|x| *x > 0.0);
    let scale = |x: f64| if is_positive { x.ln() } else { x };
    let up = values[1] > values[0];
    let half = |k: usize, is_upper: bool| match ci95[k] {
        Some(ends) => {
            let facing = |better: fn(f64, f64) -> f64| better(ends[0], ends[1]);
            let end = if is_upper {
                facing(f64::max)
            } else {
                facing(f64::min)
            };
            Some((scale(end) - scale(values[k])).abs())
        }
        None => is_known[k].then_some(0.0),
    };
    let width = half(0, up)?.hypot(half(1, !up)?);
    let apart = (scale(values[1]) - scale(values[0])).abs();
    (width > 0.0).then(|| apart / width)
}

impl ModelComparison {
    pub(super) fn table(&self) -> Table {
        let [a, b] = &short_names(&[&self.reference, &self.model])[..] else {
            return Table::new([]);
        };
        let columns = [
            ("figure", "{signal} {figure} ({unit})"),
            (a, "reference"),
            ("95 %", "ci95_reference"),
            (b, "model"),
            ("95 %", "ci95_model"),
            ("ratio", "ratio"),
            ("distance", "distance"),
            ("changed", "changed"),
        ];
        Table::of(self, "/rows/*", &columns)
    }

    pub(super) fn rows(&self) -> Vec<serde_json::Value> {
        self.rows.iter().map(|row| serde_json::json!(row)).collect()
    }

    pub(super) fn document(&self) -> Document {
        let named = |row: &Row| format!("{} {} × {}", row.signal, row.figure, readable(row.ratio));
        let changed: Vec<String> = self.rows.iter().filter(|r| r.changed).map(named).collect();
        let rest = self.judged - changed.len();
        let (tone, verdict) = match (self.judged, changed.len()) {
            (0, _) => (
                Tone::Undecided,
                "not judged: no intervals of the parameters (calibrate writes them)".to_owned(),
            ),
            (all, 0) => (
                Tone::Good,
                format!(
                    "no change seen: all {all} figures within their 95 % intervals, taken together"
                ),
            ),
            _ => (
                Tone::Doubtful,
                format!(
                    "changed: {}; {rest} others within their intervals",
                    some(&changed)
                ),
            ),
        };
        let mut document = Document::new("Two calibrations compared", tone, [verdict]);
        for (name, has) in [&self.reference, &self.model]
            .into_iter()
            .zip(self.has_intervals)
        {
            if !has && self.judged > 0 {
                let text = format!("{name} has no intervals: its figures count as known");
                document.note(Importance::Remark, text);
            }
        }
        document.text(
            "Distance: 1 is where the 95 % interval of a difference ends, of all figures together.",
        );
        document.table(self.table());
        document
    }
}
