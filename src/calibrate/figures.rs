//! The figures of a fitted model in the units of data sheets.

use crate::export::Quantity;
use nav_sim_calibration::{Outcome, Share, duration, percent, shares, tau_s};
use nav_sim_document::readable;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::practical::Horizon;
use nav_sim_signal::noise::{Parameter, Process};

/// A figure of a model, in the unit of data sheets.
pub(crate) struct Row {
    /// Name and letter.
    pub name: String,
    /// Value, or why there is none.
    pub value: Result<f64, &'static str>,
    /// The 95 % interval, in words where there is none.
    pub interval: String,
    /// Unit of the two.
    pub unit: &'static str,
    /// Averaging times at which it is the largest part.
    pub averages: String,
    /// Where the value stands in a fit as JSON, if it does.
    pub source: Option<&'static str>,
}

/// `N, K matched over 1–100 s`
pub(crate) fn policy() -> String {
    let Horizon { from_s, to_s } = Horizon::default();
    format!("N, K matched over {from_s}–{to_s} s")
}

/// N, B and K of a fit, then what a pair of N and K does not carry: correlation times, quantization, ramps.
pub(crate) fn figures(outcome: &Outcome, rate_hz: f64) -> Vec<Row> {
    let mut rows = practical_rows(outcome, rate_hz);
    let model = &outcome.fit.composite;
    let shares = shares(model, &outcome.counted_levels());
    let intervals = outcome.inference.as_ref().map_or(&[][..], |i| &i.intervals);
    for (index, (process, label)) in model.processes.iter().zip(model.labels()).enumerate() {
        let Some(figure) =
            figure(process, outcome.scope.sensor).filter(|_| !outcome.fit.zero.contains(&index))
        else {
            continue;
        };
        let own = intervals
            .iter()
            .find(|i| i.of.process == index && i.of.parameter == figure.parameter);
        let interval = own.map_or_else(String::new, |i| {
            let mut ends = [i.low, i.high].map(|end| (figure.convert)(end, rate_hz));
            ends.sort_by(f64::total_cmp);
            interval(i.absent.is_none().then_some(ends), 1.0)
        });
        rows.push(Row {
            name: format!("{label} {}", figure.name),
            value: Ok((figure.convert)(figure.value, rate_hz)),
            interval,
            unit: figure.unit,
            averages: averages(&shares[index], rate_hz),
            source: None,
        });
    }
    rows
}

fn practical_rows(outcome: &Outcome, rate_hz: f64) -> Vec<Row> {
    let (sensor, Some(practical)) = (outcome.scope.sensor, outcome.practical(rate_hz)) else {
        return Vec::new();
    };
    let (pair, ends) = (&practical.parameters.walk, &practical.intervals);
    let [white, walk] = match sensor {
        Sensor::Accel => ["velocity random walk N", "accel. random walk K"],
        Sensor::Gyro => ["angle random walk N", "rate random walk K"],
    };
    let row = |name: &str,
               source,
               what: Quantity,
               value: Result<f64, &'static str>,
               ends,
               averages: String| {
        let (unit, factor) = what.sheet(sensor);
        // Without draws there are no intervals to be determined.
        let is_known = value.is_ok() && outcome.inference.is_some();
        let interval = if is_known {
            interval(ends, factor)
        } else {
            String::new()
        };
        let value = value.map(|x| x * factor);
        Row {
            name: name.to_owned(),
            value,
            interval,
            unit,
            averages,
            source: Some(source),
        }
    };
    let (seen, crossover) = (
        duration(practical.range_s),
        pair.crossover_s().map(duration),
    );
    let to = crossover
        .as_ref()
        .map_or(String::new(), |t| format!("up to {t}"));
    let until = practical
        .walk_until_s
        .map_or(String::new(), |t| format!(" to {}", duration(t)));
    let from = crossover.map_or_else(
        || format!("none up to {seen}"),
        |t| format!("from {t}{until}"),
    );
    let minimum = practical.parameters.minimum;
    let floor = minimum.map_or_else(
        || format!("none up to {seen}"),
        |m| format!("floor at {}", duration(m.tau_s)),
    );
    let floor_value = minimum.map(|m| m.bias_instability()).ok_or("not reached");
    let walk_value = if practical.walk_is_observed() {
        Ok(pair.walk)
    } else {
        Err("not observed")
    };
    vec![
        row(
            white,
            "white_and_walk/n/data_sheet/value",
            Quantity::Density,
            Ok(pair.density),
            ends.density,
            to,
        ),
        row(
            "bias instability B",
            "minimum/bias_instability/data_sheet/value",
            Quantity::Bias,
            floor_value,
            ends.instability,
            floor,
        ),
        row(
            walk,
            "white_and_walk/k/data_sheet/value",
            Quantity::Walk,
            walk_value,
            ends.walk,
            from,
        ),
    ]
}

/// `5.36e-5 … 5.48e-5`
fn interval(ends: Option<[f64; 2]>, factor: f64) -> String {
    ends.map_or_else(
        || "not determined".to_owned(),
        |[low, high]| format!("{} … {}", readable(low * factor), readable(high * factor)),
    )
}

/// What a process is known by beside N and K.
struct Figure {
    name: &'static str,
    /// The parameter that it follows from, and its value.
    parameter: Parameter,
    value: f64,
    /// How it follows from the parameter and the rate (Hz).
    convert: fn(f64, f64) -> f64,
    unit: &'static str,
}

fn figure(process: &Process, sensor: Sensor) -> Option<Figure> {
    let [increment_unit, ramp_unit] = match sensor {
        Sensor::Accel => ["m/s", "m/s² per s"],
        Sensor::Gyro => ["rad", "rad/s per s"],
    };
    let (name, parameter, value, convert, unit): (_, _, _, fn(f64, f64) -> f64, _) = match process {
        Process::Ar1(p) if p.phi() > 0.0 => (
            "correlation time T",
            Parameter::Phi,
            p.phi(),
            |phi, rate_hz| -1.0 / (phi.ln() * rate_hz),
            "s",
        ),
        Process::GaussMarkov(p) => (
            "correlation time T",
            Parameter::Beta,
            p.beta(),
            |beta, _| 1.0 / beta,
            "s",
        ),
        // Of the increments over a sample, as IEEE 952 has it.
        Process::Quantization(p) => (
            "quantization Q",
            Parameter::Q2,
            p.q2(),
            |q2, rate_hz| q2.sqrt() / rate_hz,
            increment_unit,
        ),
        Process::Drift(p) => (
            "ramp",
            Parameter::Slope,
            p.slope(),
            |slope, rate_hz| slope * rate_hz,
            ramp_unit,
        ),
        _ => return None,
    };
    Some(Figure {
        name,
        parameter,
        value,
        convert,
        unit,
    })
}

/// Averaging times, half a scale each, at which a process is the largest part of the wavelet variance.
pub(crate) fn averages(share: &Share, rate_hz: f64) -> String {
    let time = |level: u32| duration(0.5 * tau_s(level, rate_hz));
    match (share.leads.first(), share.leads.last()) {
        (Some(first), Some(last)) if first == last => time(*first),
        (Some(first), Some(last)) => format!("{} – {}", time(*first), time(*last)),
        _ => format!("none ({} at most)", percent(share.largest.0)),
    }
}
