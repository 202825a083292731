//! Fitted models as JSON and as words.

use super::replicates::ReplicateEntry;
use crate::calibration::{
    ALIKE_LEVEL, Candidate, Diagnosis, Estimator, Goodness, Indistinct, Inference, LevelSpread, Miss,
    Outcome, ParameterInterval, Practical, Ranking, Settings, Share, correlation_time_s, percent, reasons,
    shares, signals, tau_s, undetermined,
};
use crate::export::parameters_json;
use crate::imu::Sensor;
use crate::noise::{Composite, ParameterRef, Process};
use crate::units::DEG;
use serde::Serialize;
use serde_json::{Map, Value};

/// What `calibrate --format json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitsFile {
    /// Layout version.
    pub schema_version: u32,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// Structure of the models.
    pub model: String,
    /// One entry a fit.
    pub fits: Vec<FitEntry>,
    /// One entry a recording and sensor: whether it is abnormal.
    pub replicates: Vec<ReplicateEntry>,
    /// Files written.
    pub files: Vec<String>,
}

/// One fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitEntry {
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
    pub goodness: Option<GoodnessEntry>,
    /// Standard deviation of ln wv of a replicate at each scale: within by theory, between beyond that.
    pub spread: Vec<SpreadEntry>,
    /// Probability that replicates of one noise differ as much at some scale; none of a single signal.
    pub spread_p_value: Option<f64>,
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
pub struct CandidateEntry {
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
    /// Whether it was chosen.
    pub chosen: bool,
}

impl CandidateEntry {
    fn all(ranking: &Ranking) -> Vec<Self> {
        let entry = |(i, c): (usize, &Candidate)| Self {
            model: c.spec.to_string(),
            parameters: c.spec.parameters(),
            objective: c.objective,
            optimism: c.optimism,
            wvic: c.wvic(),
            p_value: c.p_value,
            chosen: i == ranking.chosen,
        };
        ranking.candidates.iter().enumerate().map(entry).collect()
    }
}

/// Candidates that are shown.
const SHOWN: usize = 8;

/// The ranking as lines.
fn ranking_lines(ranking: &Ranking, rate_hz: f64) -> Vec<String> {
    let line = |c: CandidateEntry| {
        let p = c.p_value.map_or(String::new(), |p| format!("  p ≤ {p:.3}"));
        let mark = if c.chosen { "*" } else { " " };
        format!(
            "  {mark} {:<18} WVIC {:>10.4} = {:.4} + {:.4}, {} parameters{p}",
            c.model, c.wvic, c.objective, c.optimism, c.parameters
        )
    };
    let all = CandidateEntry::all(ranking);
    let left = all.len().saturating_sub(SHOWN.max(ranking.chosen + 1));
    let mut lines: Vec<String> = all.into_iter().take(SHOWN.max(ranking.chosen + 1)).map(line).collect();
    lines.push(format!(
        "    {} more with a larger WVIC, {} not identifiable (a process is zero or at the end of its range)",
        left + ranking.far,
        ranking.not_identifiable
    ));
    lines.extend(reasons(ranking, rate_hz).iter().map(|r| format!("  chosen: {r}")));
    lines
}

/// The J-test of a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GoodnessEntry {
    /// J, the objective.
    pub statistic: f64,
    /// Scales less parameters.
    pub dof: usize,
    /// Median of J when the model holds.
    pub expected: f64,
    /// Probability of such a J when the model holds.
    pub p_value: f64,
}

/// Processes of one kind that cannot be told apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IndistinctEntry {
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
        let Indistinct { processes, spec, composite, p_value, intervals } = indistinct;
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
pub struct MissEntry {
    /// Scale (s).
    pub tau_s: f64,
    /// Wavelet variance of the data over that of the model.
    pub ratio: f64,
    /// The normal score of that ratio.
    pub deviations: f64,
}

/// How replicates differ at one scale.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpreadEntry {
    /// Scale (s).
    pub tau_s: f64,
    /// Standard deviation of ln wv that noise alone makes.
    pub within: f64,
    /// Standard deviation beyond that.
    pub between: f64,
}

impl FitEntry {
    /// The entry of an outcome.
    #[must_use]
    pub fn new(outcome: &Outcome, rate_hz: f64) -> Self {
        let fit = &outcome.fit;
        let inference = outcome.inference.as_ref();
        let goodness = inference.and_then(|i| i.goodness);
        let labels = fit.composite.labels();
        let labelled = |processes: &[usize]| processes.iter().map(|i| labels[*i].clone()).collect();
        let intervals = inference.into_iter().flat_map(|i| &i.intervals);
        let open = intervals.filter_map(|i| undetermined(i, &labels));
        let spread = inference.map_or(&[][..], |i| &i.spread).iter();
        let miss =
            |m: &Miss| MissEntry { tau_s: tau_s(m.level, rate_hz), ratio: m.ratio, deviations: m.deviations };
        Self {
            sensor: outcome.scope.sensor.name(),
            axis: outcome.scope.axis.map_or("all", |a| a.name()),
            estimator: outcome.estimator.name(),
            model: outcome.spec.to_string(),
            ranking: outcome.ranking.iter().flat_map(CandidateEntry::all).collect(),
            reasons: outcome.ranking.as_ref().map_or(Vec::new(), |r| reasons(r, rate_hz)),
            replicates: outcome.replicates,
            scales: outcome.curve.levels.len(),
            processes: processes_json(&outcome.fit.composite, inference.map_or(&[][..], |i| &i.intervals)),
            goodness: goodness.map(|Goodness { statistic, dof, expected, p_value }| GoodnessEntry {
                statistic,
                dof,
                expected,
                p_value,
            }),
            spread: spread
                .map(|&LevelSpread { level, within, between }| SpreadEntry {
                    tau_s: tau_s(level, rate_hz),
                    within,
                    between,
                })
                .collect(),
            spread_p_value: inference.and_then(|i| i.alike),
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
            notes: outcome.notes.iter().cloned().chain(open).collect(),
        }
    }
}

/// N, K, B and T as exports have them, with their intervals (SI); null where there are none.
fn parameters(outcome: &Outcome, rate_hz: f64) -> Value {
    let Some(Practical { parameters, intervals, range_s }) = outcome.practical(rate_hz) else {
        return Value::Null;
    };
    let mut value = parameters_json(&parameters, outcome.scope.sensor);
    let ends = |interval: Option<[f64; 2]>| interval.map_or(Value::Null, |ends| ends.to_vec().into());
    value["white_and_walk"]["n"]["ci95"] = ends(intervals.density);
    value["white_and_walk"]["k"]["ci95"] = ends(intervals.walk);
    if value["minimum"].is_object() {
        value["minimum"]["bias_instability"]["ci95"] = ends(intervals.instability);
    }
    value["observed_to_s"] = range_s.into();
    value
}

impl FitsFile {
    /// The file of some outcomes.
    #[must_use]
    pub fn new(
        outcomes: &[Outcome],
        diagnoses: &[Diagnosis],
        settings: &Settings,
        files: Vec<String>,
    ) -> Self {
        let rate_hz = settings.rate_hz;
        Self {
            schema_version: 1,
            rate_hz,
            model: settings.model.to_string(),
            fits: outcomes.iter().map(|o| FitEntry::new(o, rate_hz)).collect(),
            replicates: diagnoses.iter().map(|d| ReplicateEntry::new(d, rate_hz)).collect(),
            files,
        }
    }
}

fn processes_json(model: &Composite, intervals: &[ParameterInterval]) -> Vec<Map<String, Value>> {
    model.processes.iter().enumerate().map(|(i, p)| process_json(p, i, intervals)).collect()
}

fn process_json(process: &Process, index: usize, intervals: &[ParameterInterval]) -> Map<String, Value> {
    let mut map = Map::new();
    map.insert("type".to_owned(), process.code().into());
    for (&parameter, value) in process.kind().parameters().iter().zip(process.values()) {
        let name = parameter.name();
        map.insert(name.to_owned(), value.into());
        if let Some(i) = interval_of(intervals, ParameterRef { process: index, parameter }) {
            let ends = if i.absent.is_none() { vec![i.low, i.high].into() } else { Value::Null };
            map.insert(format!("{name}_ci95"), ends);
            let error = i.standard_error;
            map.insert(format!("{name}_se"), if error.is_finite() { error.into() } else { Value::Null });
        }
    }
    map
}

pub(super) fn interval_of(intervals: &[ParameterInterval], of: ParameterRef) -> Option<&ParameterInterval> {
    intervals.iter().find(|i| i.of == of)
}

/// A fit in words: a head line, a line for each process, how sure the optimum is, the remarks.
#[must_use]
pub fn describe(outcome: &Outcome, settings: &Settings) -> String {
    let mut lines = vec![head(outcome, settings)];
    lines.extend(outcome.ranking.iter().flat_map(|r| ranking_lines(r, settings.rate_hz)));
    lines.extend(process_lines(
        &outcome.fit.composite,
        outcome.scope.sensor,
        &outcome.curve.levels,
        settings.rate_hz,
    ));
    lines.push(optimum(outcome));
    lines.extend(outcome.inference.iter().flat_map(|i| inference_lines(i, outcome, settings.rate_hz)));
    lines.extend(outcome.notes.iter().map(|note| format!("  note: {note}")));
    lines.join("\n")
}

fn inference_lines(inference: &Inference, outcome: &Outcome, rate_hz: f64) -> Vec<String> {
    if inference.fitted < 2 {
        return vec![format!(
            "  {} of {} draws of the bootstrap had a fit: no intervals",
            inference.fitted, inference.draws
        )];
    }
    let mut lines: Vec<String> = inference.goodness.iter().map(|g| j_test(g, outcome)).collect();
    let labels = outcome.fit.composite.labels();
    for i in &inference.intervals {
        if let Some(text) = undetermined(i, &labels) {
            lines.push(format!("  95 % {text}"));
            continue;
        }
        let error = match i.standard_error {
            error if error.is_finite() => format!("  (standard error {error:.2e})"),
            _ => String::new(),
        };
        lines.push(format!(
            "  95 % {:<6} {:<7} {:.6e} … {:.6e}{error}",
            labels[i.of.process],
            i.of.parameter.name(),
            i.low,
            i.high
        ));
    }
    if outcome.replicates > 1 {
        lines.extend(spread_line(inference, outcome, rate_hz));
    }
    lines
}

fn j_test(goodness: &Goodness, outcome: &Outcome) -> String {
    let Goodness { statistic, dof, expected, p_value } = goodness;
    let verdict = if goodness.is_rejected() {
        "the model does not describe the curve"
    } else if outcome.departure().missed.is_empty() {
        "no evidence against"
    } else {
        "not rejected, in view of how much the signals differ among themselves; by their noise alone it misses scales (note)"
    };
    format!(
        "  J-test {statistic:.4e} on {dof} degrees of freedom, median {expected:.4e} if the model holds, p = \
         {p_value:.3}: {verdict}"
    )
}

/// Where the signals that are averaged differ most beyond what noise alone makes.
fn spread_line(inference: &Inference, outcome: &Outcome, rate_hz: f64) -> Option<String> {
    let p = inference.alike?;
    let signals = match (outcome.recordings, outcome.replicates) {
        (1, _) => "the axes",
        (recordings, replicates) if recordings == replicates => "the recordings",
        _ => "the signals (recordings and axes)",
    };
    if p > ALIKE_LEVEL {
        return Some(format!("  no evidence that {signals} differ beyond their noise (p = {p:.3})"));
    }
    let most = |s: &&LevelSpread| s.between / s.within;
    let LevelSpread { level, within, between } =
        *inference.spread.iter().max_by(|a, b| most(a).total_cmp(&most(b)))?;
    Some(format!(
        "  {signals} differ beyond their noise (p = {p:.3}), most at {} s: by {} of the wavelet variance, noise alone \
         makes {}",
        tau_s(level, rate_hz),
        percent(between),
        percent(within)
    ))
}

fn head(outcome: &Outcome, settings: &Settings) -> String {
    let (count, signals) = (outcome.replicates, signals(outcome));
    let trimmed = match settings.trim.count(count) {
        a if outcome.estimator == Estimator::DrAwv && count > 0 => {
            format!(", {a} dropped at each end of each scale")
        }
        _ => String::new(),
    };
    let scales = outcome.curve.levels.len();
    format!(
        "{} · {} · {} · {signals}{trimmed}, {scales} scales",
        outcome.scope.name(),
        outcome.estimator.name(),
        outcome.spec
    )
}

fn process_lines(model: &Composite, sensor: Sensor, levels: &[u32], rate_hz: f64) -> Vec<String> {
    let shares = shares(model, levels);
    let line = |((process, label), share): ((&Process, String), &Share)| {
        let parameters: Vec<String> =
            process.parameters().iter().map(|(name, value)| format!("{name} = {value:.6e}")).collect();
        let parameters = parameters.join(", ");
        if share.largest.0 <= 0.0 {
            return format!("  {label:<6} {parameters:<42} zero at the optimum");
        }
        let meaning = meaning(process, sensor, rate_hz);
        let governs = match (share.leads.first(), share.leads.last()) {
            (Some(first), Some(last)) if first == last => {
                format!("dominates at {} s", tau_s(*first, rate_hz))
            }
            (Some(first), Some(last)) => {
                format!("dominates from {} s to {} s", tau_s(*first, rate_hz), tau_s(*last, rate_hz))
            }
            _ => format!(
                "dominates at no scale ({} of the variance at most, at {} s)",
                percent(share.largest.0),
                tau_s(share.largest.1, rate_hz)
            ),
        };
        format!("  {label:<6} {parameters:<42} {meaning}; {governs}")
    };
    model.processes.iter().zip(model.labels()).zip(&shares).map(line).collect()
}

/// The parameters in the terms of data sheets.
pub(super) fn meaning(process: &Process, sensor: Sensor, rate_hz: f64) -> String {
    let dt = 1.0 / rate_hz;
    let unit = sensor.unit();
    // Per √h, in degrees for angles.
    let (name, per_root_hour, root_hour_unit) = match sensor {
        Sensor::Accel => ("velocity random walk", 60.0, "m/s/√h"),
        Sensor::Gyro => ("angle random walk", 60.0 / DEG, "°/√h"),
    };
    match process {
        Process::White(p) => {
            format!("{name} {:.4e} {root_hour_unit}", (p.sigma2() * dt).sqrt() * per_root_hour)
        }
        Process::Quantization(p) => {
            format!("Q = {:.4e} {unit}, times dt {:.4e} {unit}·s", p.q2().sqrt(), p.q2().sqrt() * dt)
        }
        Process::Ar1(p) => match correlation_time_s(process, rate_hz) {
            Some(t) => {
                format!("correlation time {t:.4} s, standard deviation {:.4e} {unit}", p.variance().sqrt())
            }
            None => format!("alternating, standard deviation {:.4e} {unit}", p.variance().sqrt()),
        },
        Process::GaussMarkov(p) => {
            format!(
                "correlation time {:.4} s, standard deviation {:.4e} {unit}",
                1.0 / p.beta(),
                p.s2().sqrt()
            )
        }
        Process::RandomWalk(p) => {
            let name = match sensor {
                Sensor::Accel => "acceleration random walk",
                Sensor::Gyro => "rate random walk",
            };
            format!("{name} {:.4e} {unit}/√s", (p.gamma2() * rate_hz).sqrt())
        }
        Process::Drift(p) => format!("ramp {:.4e} {unit}/s", p.slope() * rate_hz),
        Process::Ma1(p) => {
            format!("standard deviation {:.4e} {unit}", (p.sigma2() * (1.0 + p.theta() * p.theta())).sqrt())
        }
    }
}

fn optimum(outcome: &Outcome) -> String {
    let fit = &outcome.fit;
    let search = match (fit.combinations, fit.starts) {
        _ if outcome.estimator == Estimator::Avlr => "slopes read off, nothing minimised".to_owned(),
        (1, _) => "the only minimum".to_owned(),
        (n, 1) => format!("{n} combinations of shapes tried, one minimum"),
        (n, starts) => {
            let next = fit.runner_up.map_or(String::new(), |f| format!(", the next best at {f:.6e}"));
            format!(
                "{n} combinations of shapes tried, {starts} minima descended to, {} agree{next}",
                fit.agreeing
            )
        }
    };
    format!("  objective {:.6e}, {}: {search}", fit.objective, fit.termination.name().replace('_', " "))
}
