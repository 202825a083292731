//! A calibration on one screen: the verdict first, then the parameters in the terms of practitioners.

use super::columns;
use super::number::readable;
use super::practical::{PracticalRow, interval, policy, practical_rows};
use super::turn_on::turn_on_lines;
use crate::export::Quantity;
use nav_sim_calibration::{
    Diagnosis, Miss, Outcome, Settings, TurnOnSpread, Verdict, advice, axes_remark, duration, percent,
    shares, signals, tau_s,
};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::{Parameter, Process};

/// With more fits than this each has one line.
const MOST: usize = 2;
/// Lines of it all; three more go to stderr.
const LINES: usize = 17;

/// What the recordings of each sensor say of one another, and every fit, shortly: two of five processes in twenty lines.
pub(crate) fn brief(
    outcomes: &[Outcome],
    diagnoses: &[Diagnosis],
    turn_on: &[TurnOnSpread],
    settings: &Settings,
) -> String {
    let rate_hz = settings.rate_hz;
    let of_sensor = |sensor: Sensor| {
        let of_sensor: Vec<&Outcome> = outcomes.iter().filter(|o| o.scope.sensor == sensor).collect();
        let parts = [verdict(&of_sensor, rate_hz), recordings(&of_sensor, diagnoses)];
        let first: Vec<String> = parts.into_iter().flatten().collect();
        let first = (!first.is_empty()).then(|| format!("{}: {}", sensor.name(), first.join(" ")));
        let notes = of_sensor.iter().flat_map(|o| match outcomes.len() <= MOST {
            true => notes(o),
            false => axes_remark(o, rate_hz).into_iter().collect(),
        });
        // that the recordings agree is said already
        let told = usize::from(abnormal(diagnoses, sensor) == Some(0) && !differ(diagnoses, sensor));
        let others = advice(diagnoses, sensor).into_iter().skip(told).chain(notes);
        (first, others.map(|line| format!("{}: {line}", sensor.name())).collect::<Vec<_>>())
    };
    let (mut lines, mut remarks) = (Vec::new(), Vec::new());
    for (first, others) in Sensor::ALL.map(of_sensor) {
        lines.extend(first);
        remarks.extend(others);
    }
    // What goes into the model comes first.
    let place = if turn_on.iter().any(|t| t.sigmas().is_some()) { 0 } else { remarks.len() };
    remarks.splice(place..place, turn_on_lines(turn_on));
    let table = if outcomes.len() > MOST { joint(outcomes, rate_hz) } else { full(outcomes, rate_hz) };
    let room = LINES.saturating_sub(lines.len() + table.len() + 1).max(1);
    let left = remarks.len().saturating_sub(room);
    lines.push(columns(&table));
    let shown = if left > 0 { room - 1 } else { remarks.len() };
    lines.extend(remarks.iter().take(shown).map(|remark| format!("note: {remark}")));
    if left > 0 {
        lines.push(format!("note: {} more with --verbose", remarks.len() - shown));
    }
    lines.join("\n")
}

/// Whether the models of a sensor describe its data; none without a model.
fn verdict(outcomes: &[&Outcome], rate_hz: f64) -> Option<String> {
    match outcomes {
        [] => None,
        [outcome] => Some(format!("{}.", fit_verdict(outcome, rate_hz))),
        several => {
            let fitting = several.iter().filter(|o| in_short(o, rate_hz) == FITS).count();
            Some(format!("{fitting} of {} models fit.", several.len()))
        }
    }
}

/// Abnormal recordings of a sensor; none where they are too few to tell.
fn abnormal(diagnoses: &[Diagnosis], sensor: Sensor) -> Option<usize> {
    let of_sensor = || diagnoses.iter().filter(|d| d.sensor == sensor);
    let can_tell = of_sensor().any(|d| !d.scores.is_empty());
    can_tell.then(|| of_sensor().filter(|d| d.verdict != Verdict::Normal).count())
}

/// Whether the recordings of a sensor differ beyond their noise without one that stands out.
fn differ(diagnoses: &[Diagnosis], sensor: Sensor) -> bool {
    diagnoses.iter().any(|d| d.sensor == sensor && d.differing.is_some())
}

/// What the models are of: `6 recordings × 3 axes: 1 abnormal, axes differ.`; none of a curve.
fn recordings(outcomes: &[&Outcome], diagnoses: &[Diagnosis]) -> Option<String> {
    let first = outcomes.iter().find(|o| o.recordings > 0)?;
    let sensor = first.scope.sensor;
    let abnormal = abnormal(diagnoses, sensor).map(|count| match count {
        0 if differ(diagnoses, sensor) => "none abnormal, but they differ".to_owned(),
        0 => "none abnormal".to_owned(),
        count => format!("{count} abnormal"),
    });
    let axes = outcomes.iter().any(|o| o.axes_differ.is_some()).then(|| "axes differ".to_owned());
    let found: Vec<String> = abnormal.into_iter().chain(axes).collect();
    let colon = if found.is_empty() { "" } else { ": " };
    Some(format!("{}{colon}{}.", signals(first), found.join(", ")))
}

/// The remarks on a fit, and why its two tests may disagree.
fn notes(outcome: &Outcome) -> Vec<String> {
    let goodness = outcome.inference.as_ref().and_then(|i| i.goodness);
    let is_allowed = goodness.is_some_and(|g| !g.is_rejected()) && outcome.departure().worst().is_some();
    let allowed = is_allowed.then(|| {
        "the J-test allows for how much recordings differ among themselves, the count of scales does not"
            .to_owned()
    });
    outcome.notes.iter().cloned().chain(allowed).collect()
}

/// Whether the model fits, and the scale at which it is worst: the same on the terminal and on the page. Where scales are
/// missed, of those the one with the largest factor between data and model; else of the scales that are well known.
pub(super) fn fit_verdict(outcome: &Outcome, rate_hz: f64) -> String {
    let (spec, departure) = (&outcome.spec, outcome.departure());
    let goodness = outcome.inference.as_ref().and_then(|i| i.goodness);
    let test = goodness.map_or(String::new(), |g| format!(" (J-test p = {:.3})", g.p_value));
    let scale_words = |miss: Miss| duration(tau_s(miss.level, rate_hz));
    if let Some(worst) = departure.worst() {
        return format!(
            "{spec} does not fit: data/model is {} at {}, {} of {} scales are off{test}",
            readable(worst.ratio),
            scale_words(worst),
            departure.missed.len(),
            departure.scales
        );
    }
    let impossible = departure.doubtful.filter(|_| goodness.is_none() && departure.chance < IMPOSSIBLE);
    if let Some(worst) = impossible {
        return format!(
            "{spec} does not fit as a whole: data/model is {} at {}",
            readable(worst.ratio),
            scale_words(worst)
        );
    }
    let known = departure.known_to.map_or(String::new(), |level| {
        format!(", of the scales known to 10 % (up to {})", duration(tau_s(level, rate_hz)))
    });
    let off = departure.furthest.map_or(String::new(), |m| {
        format!(": at most {} off, at {}{known}", percent((m.ratio - 1.0).abs()), scale_words(m))
    });
    let word = if goodness.is_some_and(|g| g.is_rejected()) { "does not fit as a whole" } else { "fits" };
    format!("{spec} {word}{test}{off}")
}

/// Probability of the scores of all scales together below which a model is not said to fit, where no J-test was made.
const IMPOSSIBLE: f64 = 1e-4;

/// Rows for a parameter each.
fn full(outcomes: &[Outcome], rate_hz: f64) -> Vec<Vec<String>> {
    let matched = format!("N, K {}", policy());
    let head = ["", &matched, "value", "95 % interval", "unit", "governs averages"];
    // Two estimators of one signal are told by their names.
    let scopes = |outcome: &Outcome| outcomes.iter().filter(|o| o.scope == outcome.scope).count();
    let name = |outcome: &Outcome| match scopes(outcome) {
        1 => outcome.scope.name(),
        _ => format!("{} {}", outcome.scope.name(), outcome.estimator.name()),
    };
    let rows = outcomes.iter().flat_map(|o| rows_of(o, &name(o), rate_hz));
    std::iter::once(head.map(str::to_owned).to_vec()).chain(rows).collect()
}

fn rows_of(outcome: &Outcome, name: &str, rate_hz: f64) -> Vec<Vec<String>> {
    let sensor = outcome.scope.sensor;
    let practical = outcome.practical(rate_hz);
    let cells = |row: PracticalRow| {
        let (value, interval) = match row.value {
            Err(why) => ("–".to_owned(), why.to_owned()),
            // without draws there are no intervals to be determined
            Ok(_) if outcome.inference.is_none() => (row.shown(), String::new()),
            Ok(_) => (row.shown(), row.interval),
        };
        // the sensor stands before it; no line is longer than a terminal
        let name = row.name.replace("acceleration", "accel.");
        vec![name, value, interval, row.unit.to_owned(), row.governs]
    };
    let rows = practical.iter().flat_map(|p| practical_rows(p, sensor)).map(cells);
    let mut rows: Vec<Vec<String>> = rows.collect();
    rows.extend(process_rows(outcome, rate_hz));
    for row in &mut rows {
        row.insert(0, name.to_owned());
    }
    rows
}

/// Correlation times, quantization, ramps: what a pair of N and K does not carry.
fn process_rows(outcome: &Outcome, rate_hz: f64) -> Vec<Vec<String>> {
    let model = &outcome.fit.composite;
    let sensor = outcome.scope.sensor;
    let shares = shares(model, &outcome.counted_levels());
    let intervals = outcome.inference.as_ref().map_or(&[][..], |i| &i.intervals);
    let row = |(index, (process, label)): (usize, (&Process, String))| {
        let figure = figure(process, sensor).filter(|_| !outcome.fit.zero.contains(&index))?;
        let estimated =
            intervals.iter().find(|i| i.of.process == index && i.of.parameter == figure.parameter);
        let ends = match estimated.map(|i| i.absent.is_none().then_some([i.low, i.high])) {
            None => String::new(),
            Some(None) => "not determined".to_owned(),
            Some(Some(ends)) => {
                let mut ends = ends.map(|end| (figure.convert)(end, rate_hz));
                ends.sort_by(f64::total_cmp);
                interval(Some(ends), 1.0)
            }
        };
        let name = format!("{label} {}", figure.name);
        let value = readable((figure.convert)(figure.value, rate_hz));
        Some(vec![name, value, ends, figure.unit.to_owned(), governs(&shares[index], rate_hz)])
    };
    model.processes.iter().zip(model.labels()).enumerate().filter_map(row).collect()
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
    let figure_of =
        |name, parameter, value, convert, unit| Some(Figure { name, parameter, value, convert, unit });
    let [increment_unit, ramp_unit] = match sensor {
        Sensor::Accel => ["m/s", "m/s² per s"],
        Sensor::Gyro => ["rad", "rad/s per s"],
    };
    match process {
        Process::Ar1(p) if p.phi() > 0.0 => {
            let time = |phi: f64, rate_hz: f64| -1.0 / (phi.ln() * rate_hz);
            figure_of("correlation time T", Parameter::Phi, p.phi(), time, "s")
        }
        Process::GaussMarkov(p) => {
            figure_of("correlation time T", Parameter::Beta, p.beta(), |beta, _| 1.0 / beta, "s")
        }
        Process::Quantization(p) => {
            // of the increments over a sample, as IEEE 952 has it
            let increment = |q2: f64, rate_hz: f64| q2.sqrt() / rate_hz;
            figure_of("quantization Q", Parameter::Q2, p.q2(), increment, increment_unit)
        }
        Process::Drift(p) => {
            let ramp = |slope, rate_hz| slope * rate_hz;
            figure_of("ramp", Parameter::Slope, p.slope(), ramp, ramp_unit)
        }
        _ => None,
    }
}

/// Scales at which a process is the largest part of the wavelet variance.
fn governs(share: &nav_sim_calibration::Share, rate_hz: f64) -> String {
    let scale_words = |level: u32| duration(tau_s(level, rate_hz));
    match (share.leads.first(), share.leads.last()) {
        (Some(first), Some(last)) if first == last => scale_words(*first),
        (Some(first), Some(last)) => format!("{} – {}", scale_words(*first), scale_words(*last)),
        _ => format!("none ({} at most)", percent(share.largest.0)),
    }
}

/// A row for a fit each.
fn joint(outcomes: &[Outcome], rate_hz: f64) -> Vec<Vec<String>> {
    let head = ["fit", "N (95 %)", "B", "K", "T (s)", "fits?"];
    let row = |outcome: &Outcome| {
        let sensor = outcome.scope.sensor;
        let practical = outcome.practical(rate_hz);
        let value = |what: Quantity, x: Option<f64>| {
            let (unit, factor) = what.sheet(sensor);
            x.map_or_else(|| "–".to_owned(), |x| format!("{} {unit}", readable(x * factor)))
        };
        let density = practical.as_ref().map_or_else(
            || "–".to_owned(),
            |p| {
                let (unit, factor) = Quantity::Density.sheet(sensor);
                let ends = p.intervals.density.map(|ends| format!(" ({})", interval(Some(ends), factor)));
                let n = readable(p.parameters.walk.density * factor);
                format!("{n}{} {unit}", ends.unwrap_or_default())
            },
        );
        let times = practical.iter().flat_map(|p| &p.parameters.correlated);
        let times: Vec<String> = times.map(|c| readable(c.markov.t_corr_s)).collect();
        let minimum = practical.as_ref().and_then(|p| p.parameters.minimum);
        vec![
            format!("{} {} {}", outcome.scope.name(), outcome.estimator.name(), outcome.spec),
            density,
            minimum.map_or_else(
                || "not reached".to_owned(),
                |m| value(Quantity::Bias, Some(m.bias_instability())),
            ),
            match practical.as_ref() {
                Some(p) if !p.walk_is_observed() => "not observed".to_owned(),
                known => value(Quantity::Walk, known.map(|p| p.parameters.walk.walk)),
            },
            times.join(", "),
            in_short(outcome, rate_hz),
        ]
    };
    std::iter::once(head.map(str::to_owned).to_vec()).chain(outcomes.iter().map(row)).collect()
}

/// Of a fit that describes its data.
const FITS: &str = "yes";

fn in_short(outcome: &Outcome, rate_hz: f64) -> String {
    let rejected = outcome.inference.as_ref().and_then(|i| i.goodness).is_some_and(|g| g.is_rejected());
    match outcome.departure().worst() {
        Some(m) => format!("no: data/model {} at {}", readable(m.ratio), duration(tau_s(m.level, rate_hz))),
        None if rejected => "no (J-test)".to_owned(),
        None => FITS.to_owned(),
    }
}
