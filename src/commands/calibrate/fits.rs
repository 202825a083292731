//! Fitted models as JSON.

use super::model_file::TurnOnEntry;
use super::{all_notes, reasons};
use crate::commands::export::{Quantity, parameters_json};
use nav_sim_calibration::{
    Candidate, Diagnosis, Goodness, Indistinct, LevelSpread, Miss, Outcome, ParameterInterval,
    ParameterSpread, Practical, Ranking, Settings, Share, TurnOnSpread, duration, percent, shares,
    tau_s,
};
use nav_sim_document::readable;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::practical::Horizon;
use nav_sim_signal::noise::{Composite, Parameter, ParameterRef, Process};
use serde::Serialize;
use serde_json::{Map, Value};

/// What `calibrate --format json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FitsFile<'a> {
    /// Layout version.
    pub schema_version: u32,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// Structure of the models.
    pub model: String,
    /// One entry a fit.
    pub fits: Vec<FitEntry>,
    /// One entry a recording and sensor: whether it is abnormal.
    pub replicates: &'a [Diagnosis],
    /// One entry a sensor and estimator: what the recordings' means say of a turn-on bias.
    pub turn_on: Vec<TurnOnEntry>,
}

/// One fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FitEntry {
    /// `accel` or `gyro`.
    pub sensor: &'static str,
    /// `x`, `y`, `z`, or `all`.
    pub axis: &'static str,
    /// Estimator.
    pub estimator: &'static str,
    /// What the model is made of.
    pub model: String,
    /// The models it was chosen from, best first; empty where it was given.
    pub ranking: Vec<CandidateEntry>,
    /// Why it was chosen, in words.
    pub reasons: Vec<String>,
    /// Replicates averaged.
    pub replicates: usize,
    /// Scales used.
    pub scales: usize,
    /// The processes, with the keys of model files.
    pub processes: Vec<Map<String, Value>>,
    /// J-test; none without bootstrap.
    pub goodness: Option<Goodness>,
    /// Standard deviation of ln wv of a replicate at each scale: within by theory, between beyond that.
    pub spread: Vec<LevelSpread>,
    /// Probability that replicates of one noise differ as much at some scale; none of a single signal.
    pub spread_p_value: Option<f64>,
    /// Parameters that differ between recordings, as laws of model files.
    pub parameter_spread: Vec<Map<String, Value>>,
    /// Alike processes that cannot be told apart.
    pub indistinct: Option<IndistinctEntry>,
    /// N, K, B and T, each in SI and in the unit of data sheets, with 95 % intervals where the bootstrap determines them.
    pub parameters: Value,
    /// Scales at which curve and model differ by more than four standard deviations.
    pub missed: Vec<MissEntry>,
    /// Draws of the bootstrap.
    pub bootstrap: usize,
    /// Σ Omega_j (nu_j − nu_j(theta))².
    pub objective: f64,
    /// `converged`, `linear` or `iteration_limit`.
    pub termination: &'static str,
    /// Combinations of correlation times tried.
    pub combinations: usize,
    /// Local minima among them, all descended from.
    pub starts: usize,
    /// Starts that end at the best objective.
    pub agreeing: usize,
    /// Objective of the next best minimum.
    pub runner_up: Option<f64>,
    /// Processes whose amplitude is zero.
    pub zero: Vec<String>,
    /// Processes whose correlation time lies at the end of its range.
    pub at_end: Vec<String>,
    /// Remarks, in words.
    pub notes: Vec<String>,
}

/// A model that was tried.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CandidateEntry {
    /// The model.
    pub model: String,
    /// Its parameters.
    pub parameters: usize,
    /// Σ Omega_j (nu_j − nu_j(theta))².
    pub objective: f64,
    /// What is to be added for following the noise of its own curve.
    pub optimism: f64,
    /// The sum of the two.
    pub wvic: f64,
    /// Probability of so large a distance from the best if this one is true, where it was asked for.
    pub p_value: Option<f64>,
    /// Probability of so large an objective if it is true, where it was asked for: the J-test, by the draws of the choice.
    pub j_test_p_value: Option<f64>,
    /// Whether it was chosen.
    pub chosen: bool,
}

impl CandidateEntry {
    pub(super) fn all(ranking: &Ranking) -> Vec<Self> {
        let entry = |(i, c): (usize, &Candidate)| Self {
            model: c.spec.to_string(),
            parameters: c.spec.parameters(),
            objective: c.objective,
            optimism: c.optimism,
            wvic: c.wvic(),
            p_value: c.p_value,
            j_test_p_value: c.j_p_value,
            chosen: i == ranking.chosen,
        };
        ranking.candidates.iter().enumerate().map(entry).collect()
    }
}

/// Processes of one kind that cannot be told apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct IndistinctEntry {
    /// Their labels.
    pub processes: Vec<String>,
    /// The model with one of them less, which describes the curve as well.
    pub simpler: String,
    /// Probability of so large a gain by the further process if the simpler model is true.
    pub p_value: f64,
    /// The processes of the simpler model, with the keys of model files.
    pub simpler_processes: Vec<Map<String, Value>>,
}

impl IndistinctEntry {
    fn new(indistinct: &Indistinct, labels: &[String]) -> Self {
        let Indistinct {
            processes,
            spec,
            composite,
            p_value,
            intervals,
        } = indistinct;
        Self {
            processes: processes.iter().map(|i| labels[*i].clone()).collect(),
            simpler: spec.to_string(),
            p_value: *p_value,
            simpler_processes: processes_json(composite, intervals),
        }
    }
}

/// A scale at which curve and model differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct MissEntry {
    /// Scale (s).
    pub tau_s: f64,
    /// Wavelet variance of the data over that of the model.
    pub ratio: f64,
    /// The normal score of that ratio.
    pub deviations: f64,
}

impl FitEntry {
    /// The entry of an outcome.
    pub(crate) fn new(outcome: &Outcome, settings: &Settings) -> Self {
        let rate_hz = settings.rate_hz;
        let fit = &outcome.fit;
        let inference = outcome.inference.as_ref();
        let labels = fit.composite.labels();
        let labelled = |processes: &[usize]| processes.iter().map(|i| labels[*i].clone()).collect();
        let miss = |m: &Miss| MissEntry {
            tau_s: tau_s(m.level, rate_hz),
            ratio: m.ratio,
            deviations: m.deviations,
        };
        Self {
            sensor: outcome.scope.sensor.name(),
            axis: outcome.scope.axis.map_or("all", |a| a.name()),
            estimator: outcome.estimator.name(),
            model: outcome.spec.to_string(),
            ranking: outcome
                .ranking
                .iter()
                .flat_map(CandidateEntry::all)
                .collect(),
            reasons: outcome
                .ranking
                .as_ref()
                .map_or(Vec::new(), |r| reasons(r, rate_hz)),
            replicates: outcome.replicates,
            scales: outcome.curve.levels.len(),
            processes: processes_json(
                &outcome.fit.composite,
                inference.map_or(&[][..], |i| &i.intervals),
            ),
            goodness: inference.and_then(|i| i.goodness),
            spread: inference.map_or(Vec::new(), |i| i.spread.clone()),
            spread_p_value: inference.and_then(|i| i.alike),
            parameter_spread: inference.map_or(Vec::new(), |i| {
                i.varying
                    .iter()
                    .map(|found| parameter_spread(found, &labels))
                    .collect()
            }),
            indistinct: inference
                .and_then(|i| i.indistinct.as_ref())
                .map(|i| IndistinctEntry::new(i, &labels)),
            parameters: parameters(outcome, rate_hz),
            missed: outcome.departure().missed.iter().map(miss).collect(),
            bootstrap: inference.map_or(0, |i| i.draws),
            objective: fit.objective,
            termination: fit.termination.name(),
            combinations: fit.combinations,
            starts: fit.starts,
            agreeing: fit.agreeing,
            runner_up: fit.runner_up,
            zero: labelled(&fit.zero),
            at_end: labelled(&fit.at_end),
            notes: all_notes(outcome, settings),
        }
    }
}

/// N, K, B and T as exports have them, with their intervals (SI); null where there are none.
fn parameters(outcome: &Outcome, rate_hz: f64) -> Value {
    let Some(practical) = outcome.practical(rate_hz) else {
        return Value::Null;
    };
    let Practical {
        parameters,
        intervals,
        range_s,
        walk_until_s,
    } = &practical;
    let mut value = parameters_json(parameters, outcome.scope.sensor);
    let ends =
        |interval: Option<[f64; 2]>| interval.map_or(Value::Null, |ends| ends.to_vec().into());
    value["white_and_walk"]["n"]["ci95"] = ends(intervals.density);
    value["white_and_walk"]["k"]["ci95"] = ends(intervals.walk);
    value["white_and_walk"]["k"]["observed"] = practical.walk_is_observed().into();
    value["white_and_walk"]["k"]["until_s"] = (*walk_until_s).into();
    if value["minimum"].is_object() {
        value["minimum"]["bias_instability"]["ci95"] = ends(intervals.instability);
    }
    value["observed_to_s"] = (*range_s).into();
    value
}

impl<'a> FitsFile<'a> {
    /// The file of some outcomes.
    pub(crate) fn new(
        outcomes: &[Outcome],
        diagnoses: &'a [Diagnosis],
        turn_on: &[TurnOnSpread],
        settings: &Settings,
    ) -> Self {
        let rate_hz = settings.rate_hz;
        Self {
            schema_version: 1,
            rate_hz,
            model: settings.model.to_string(),
            fits: outcomes
                .iter()
                .map(|o| FitEntry::new(o, settings))
                .collect(),
            replicates: diagnoses,
            turn_on: turn_on.iter().map(TurnOnEntry::new).collect(),
        }
    }
}

/// The law of a parameter between recordings, with the keys of model files.
fn parameter_spread(found: &ParameterSpread, labels: &[String]) -> Map<String, Value> {
    let ParameterSpread {
        of,
        median,
        median_ci95,
        sd,
        sd_ci95,
    } = found;
    let entries: [(&str, Value); 7] = [
        ("process", labels[of.process].as_str().into()),
        ("parameter", of.parameter.name().into()),
        ("distribution", "lognormal".into()),
        ("median", (*median).into()),
        ("median_ci95", median_ci95.to_vec().into()),
        ("sd", (*sd).into()),
        ("sd_ci95", sd_ci95.to_vec().into()),
    ];
    entries
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect()
}

fn processes_json(model: &Composite, intervals: &[ParameterInterval]) -> Vec<Map<String, Value>> {
    model
        .processes
        .iter()
        .enumerate()
        .map(|(i, p)| process_json(p, i, intervals))
        .collect()
}

fn process_json(
    process: &Process,
    index: usize,
    intervals: &[ParameterInterval],
) -> Map<String, Value> {
    let mut map = Map::new();
    map.insert("type".to_owned(), process.code().into());
    for (&parameter, value) in process.kind().parameters().iter().zip(process.values()) {
        let name = parameter.name();
        map.insert(name.to_owned(), value.into());
        if let Some(i) = interval_of(
            intervals,
            ParameterRef {
                process: index,
                parameter,
            },
        ) {
            let ends = if i.absent.is_none() {
                vec![i.low, i.high].into()
            } else {
                Value::Null
            };
            map.insert(format!("{name}_ci95"), ends);
            let error = i.standard_error;
            map.insert(
                format!("{name}_se"),
                if error.is_finite() {
                    error.into()
                } else {
                    Value::Null
                },
            );
        }
    }
    map
}

pub(super) fn interval_of(
    intervals: &[ParameterInterval],
    parameter: ParameterRef,
) -> Option<&ParameterInterval> {
    intervals.iter().find(|i| i.of == parameter)
}

// The figures of a fitted model in the units of data sheets.

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
