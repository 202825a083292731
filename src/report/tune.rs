//! The tuning of a model, on one screen and as JSON.

use super::number::{readable, seconds};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::metrics::PerState;
use nav_sim_navigation::simulation::REPORTED_NAMES;
use nav_sim_navigation::simulation::lincov::{Aim, Factor, Honesty};
use nav_sim_signal::imu::Sensor;
use serde::Serialize;

/// How far errors are off what is stated where `run` calls a filter overconfident or underconfident.
const OFF: f64 = 0.1;
/// Horizontal RMSE over that of a filter that knows the truth, less 1, where the noise of one sensor was made to stand for
/// that of the other.
const ABSURD: f64 = 1.0;
/// A deviation of the NEES or of a ratio from what is right that is not worth a word.
const RIGHT: f64 = 0.01;

/// What a tuning found.
#[derive(Debug, Clone)]
pub(crate) struct TuneResult {
    /// The filter that was made honest.
    pub filter: FilterStates,
    /// The filter that `run` makes of the model unless told otherwise.
    pub filter_of_run: FilterStates,
    /// The factors.
    pub factors: Vec<Factor>,
    /// The filter as it was.
    pub before: Honesty,
    /// The tuned one.
    pub after: Honesty,
    /// The tuned model in the filter that `run` makes of it, where that is another.
    pub of_run: Option<Honesty>,
    /// A filter that knows the truth, each truth its own.
    pub informed: Honesty,
    /// The tuned filter with all its variances times a factor: how sharp the answer is.
    pub sweep: Vec<(f64, Honesty)>,
    /// Names of the truths; of draws one for all.
    pub truths: Vec<String>,
    /// When the filter counts as honest.
    pub aim: Aim,
    /// Sensors without noise that a factor could multiply, where a truth has some.
    pub without_factor: Vec<Sensor>,
    /// Whether the truths are the draws of a calibration, and what counts is the upper end of an interval.
    pub is_drawn: bool,
}

impl TuneResult {
    /// The verdict: how honest the filter was, with which factors it is, and what that costs.
    pub(crate) fn verdict(&self) -> String {
        let scope = if self.is_drawn { "within what the calibration leaves open (95 %), " } else { "" };
        let before = format!("{scope}the {} is {}", filter_name(self.filter), judged(&self.before));
        let unmet = self.unmet().map_or(String::new(), |unmet| format!("; {unmet}"));
        if self.factors.iter().all(|f| (f.on_variance - 1.0).abs() < RIGHT) {
            if !unmet.is_empty() {
                return before + &unmet;
            }
            return match excess(&self.before) {
                Excess::Underconfident => {
                    format!("{before}; no factor is needed (--allow-smaller seeks one below 1)")
                }
                _ => format!("{before}; no factor is needed{}", self.default_of_run()),
            };
        }
        let mut verdict =
            format!("{before}; with {} {}", factors_in_words(&self.factors), judged_after(&self.after));
        if self.cost().is_finite() {
            verdict += &format!(
                "; cost: {} of horizontal RMSE at the outage's end against a filter that knows the truth",
                percent(self.cost())
            );
        }
        verdict += &self.default_of_run();
        verdict + &unmet
    }

    /// Why the factors are of no use, if they are not.
    pub(crate) fn unmet(&self) -> Option<String> {
        let (ratio, nees) = (self.after.largest.ratio, self.after.nees / 9.0);
        let is_dishonest = match self.aim {
            Aim::Worst => ratio > 1.0 + OFF,
            Aim::Mean => nees > (1.0 + OFF).powi(2),
        };
        let is_at_limit = self.factors.iter().any(Factor::is_at_limit);
        let names: Vec<&str> = self.without_factor.iter().map(|sensor| sensor.name()).collect();
        if !names.is_empty() && (is_dishonest || is_at_limit || self.cost() > ABSURD) {
            let names = names.join(" and ");
            return Some(format!("the model has no {names} noise to multiply, where the truth has some"));
        }
        let limit = if is_at_limit { ": a factor is the largest that is tried" } else { "" };
        let unmet = || format!("larger noise alone does not make this model honest{limit}");
        (is_dishonest || is_at_limit).then(unmet)
    }

    /// What helps there.
    pub(crate) fn remedy(&self) -> String {
        if !self.without_factor.is_empty() {
            return "give it the white noise and bias instability of its data sheet (nav-sim datasheet) or of the truth, and \
                    tune again"
                .to_owned();
        }
        let aim = if self.aim == Aim::Mean { "--for worst, or " } else { "" };
        format!(
            "{aim}a model of other processes, or with the turn-on bias and scale factors that the truth has"
        )
    }

    /// What `run` makes of the tuned model unless told otherwise, where that is not the filter that was tuned.
    fn default_of_run(&self) -> String {
        let states = self.filter_of_run;
        let Some(of_run) = &self.of_run else { return String::new() };
        let judged = judged_after(of_run);
        let tunes = match is_honest(of_run) {
            true => String::new(),
            false => format!(" (--filter {states} tunes that one)"),
        };
        format!("; in the {}, which run makes of it by default: {judged}{tunes}", filter_name(states))
    }

    /// Horizontal RMSE at the outages' ends over that of a filter that knows the truth, less 1.
    fn cost(&self) -> f64 {
        self.cost_of(&self.after)
    }

    /// The same of another filter.
    pub(super) fn cost_of(&self, honesty: &Honesty) -> f64 {
        let square = |h: &Honesty| h.horizontal_m().map(|x| x * x).sum::<f64>();
        (square(honesty) / square(&self.informed)).sqrt() - 1.0
    }

    /// Whether the tuned filter is honest.
    pub(super) fn is_honest(&self) -> bool {
        is_honest(&self.after)
    }

    /// A row for each filter under a head.
    pub(crate) fn rows(&self) -> Vec<Vec<String>> {
        let largest = if self.is_drawn { "largest RMSE/sigma, 95 %" } else { "largest RMSE/sigma" };
        let mut head = vec!["filter".to_owned(), "NEES (9)".to_owned(), largest.to_owned()];
        head.extend(self.before.end_s.iter().map(|t| format!("horizontal RMSE at {} s (m)", seconds(*t))));
        let several = self.truths.len() > 1;
        let row = |(name, h): (&str, &Honesty)| {
            let mut largest = format!("{} in {}", readable(h.largest.ratio), REPORTED_NAMES[h.largest.state]);
            match h.largest.outage {
                Some(outage) if h.end_s.len() > 1 => {
                    largest += &format!(" at {} s", seconds(h.end_s[outage]))
                }
                _ => largest += over_run(h),
            }
            if several {
                largest += &format!(", {}", self.truths[h.largest.truth]);
            }
            let mut row = vec![name.to_owned(), readable(h.nees), largest];
            row.extend(h.horizontal_m().map(readable));
            row
        };
        std::iter::once(head).chain(self.filters().map(row)).collect()
    }

    pub(super) fn filters(&self) -> impl Iterator<Item = (&'static str, &Honesty)> {
        let tuned = [("untuned", &self.before), ("tuned", &self.after)].into_iter();
        let of_run = self.of_run.iter().map(|h| ("tuned, default of run", h));
        tuned.chain(of_run).chain([("knows the truth", &self.informed)])
    }

    /// All of it as JSON.
    pub(crate) fn json(&self) -> String {
        let filter = |(name, h): (&'static str, &Honesty)| FilterEntry {
            filter: name,
            nees: h.nees,
            largest_ratio: h.largest.ratio,
            state: REPORTED_NAMES[h.largest.state],
            truth: self.truths[if self.is_drawn { 0 } else { h.largest.truth }].clone(),
            outage_end: h
                .end_s
                .iter()
                .zip(&h.rmse_end)
                .map(|(after_s, rmse)| EndEntry {
                    after_s: *after_s,
                    rmse: PerState(*rmse),
                    horizontal_rmse_m: rmse[0].hypot(rmse[1]),
                })
                .collect(),
        };
        let swept = |(on_variances, h): &(f64, Honesty)| SweepEntry {
            on_variances: *on_variances,
            nees: h.nees,
            largest_ratio: h.largest.ratio,
            horizontal_rmse_cost: self.cost_of(h),
        };
        super::json(&TuneFile {
            schema_version: 1,
            verdict: self.verdict(),
            factors: self.factors.iter().map(FactorEntry::of).collect(),
            truths: &self.truths,
            horizontal_rmse_cost: self.cost(),
            filters: self.filters().map(filter).collect(),
            sweep: self.sweep.iter().map(swept).collect(),
        })
    }
}

enum Excess {
    None,
    Overconfident,
    Underconfident,
}

fn excess(h: &Honesty) -> Excess {
    let nees = h.nees / 9.0 - 1.0;
    if h.largest.ratio > 1.0 + RIGHT || nees > RIGHT {
        Excess::Overconfident
    } else if nees < -RIGHT || h.largest.ratio < 1.0 - RIGHT {
        Excess::Underconfident
    } else {
        Excess::None
    }
}

/// `overconfident by 1.31 in yaw_deg (NEES 13.2)`
fn judged(h: &Honesty) -> String {
    let nees = readable(h.nees);
    match excess(h) {
        Excess::None => format!("honest{} (NEES {nees}, 9 is right)", timid(h)),
        Excess::Overconfident if h.largest.ratio > 1.0 + RIGHT => {
            format!(
                "overconfident by {} in {}{} (NEES {nees}, 9 is right)",
                readable(h.largest.ratio),
                REPORTED_NAMES[h.largest.state],
                over_run(h)
            )
        }
        Excess::Overconfident => format!("overconfident (NEES {nees}, 9 is right)"),
        Excess::Underconfident => format!("on the safe side{} (NEES {nees}, 9 is right)", timid(h)),
    }
}

/// Where the largest ratio is, if not at the end of an outage.
const fn over_run(h: &Honesty) -> &'static str {
    if h.largest.outage.is_none() && !h.end_s.is_empty() { " over the run" } else { "" }
}

/// By how much the filter is underconfident in the state where it is most, as `run` would call it: `, but underconfident in
/// yaw_deg (0.756 of what is stated)`.
fn timid(h: &Honesty) -> String {
    let smallest = &h.smallest;
    if smallest.ratio >= 1.0 - OFF {
        return String::new();
    }
    let over_run = if smallest.outage.is_none() && !h.end_s.is_empty() { " over the run" } else { "" };
    let (state, ratio) = (REPORTED_NAMES[smallest.state], readable(smallest.ratio));
    format!(", but underconfident in {state}{over_run} ({ratio} of what is stated)")
}

/// `filter of 15 states`
fn filter_name(states: FilterStates) -> String {
    if states == FilterStates::Full { "full filter".to_owned() } else { format!("filter of {states} states") }
}

/// No error larger than stated, in any state or all together.
fn is_honest(h: &Honesty) -> bool {
    h.largest.ratio <= 1.0 + RIGHT && h.nees <= 9.0 * (1.0 + RIGHT)
}

/// The tuned filter: `it is honest (NEES 7.9)`
fn judged_after(h: &Honesty) -> String {
    let nees = readable(h.nees);
    let place = if h.end_s.is_empty() { "" } else { " at an outage's end or over the run" };
    if is_honest(h) {
        return format!("it is honest: no error{place} larger than stated{} (NEES {nees})", timid(h));
    }
    if h.largest.ratio <= 1.0 + RIGHT {
        return format!("no error{place} is larger than stated, but the NEES is {nees} where 9 is right");
    }
    let (ratio, state) = (readable(h.largest.ratio), REPORTED_NAMES[h.largest.state]);
    format!("the NEES is {nees}, {state} still overconfident by {ratio}{}", over_run(h))
}

/// `gyro RW × 4.02 (variance; the rest × 1)`
fn factors_in_words(factors: &[Factor]) -> String {
    let is_changed = |f: &&Factor| (f.on_variance - 1.0).abs() >= RIGHT;
    let word = |f: &Factor| {
        let process = f.process.as_ref().map_or(String::new(), |p| format!(" {p}"));
        format!("{}{process} × {}", f.sensor.name(), readable(f.on_variance))
    };
    let changed: Vec<String> = factors.iter().filter(is_changed).map(word).collect();
    let rest = if changed.len() < factors.len() { "; the rest × 1" } else { "" };
    format!("{} (variances{rest})", changed.join(", "))
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

#[derive(Serialize)]
struct TuneFile<'a> {
    schema_version: u32,
    verdict: String,
    factors: Vec<FactorEntry>,
    truths: &'a [String],
    horizontal_rmse_cost: f64,
    filters: Vec<FilterEntry>,
    sweep: Vec<SweepEntry>,
}

/// The tuned filter with all its variances times a factor.
#[derive(Serialize)]
struct SweepEntry {
    on_variances: f64,
    nees: f64,
    largest_ratio: f64,
    horizontal_rmse_cost: f64,
}

/// A factor in files.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct FactorEntry {
    /// `accel` or `gyro`.
    pub sensor: &'static str,
    /// Label of the process; none: all of the sensor's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub process: Option<String>,
    /// On its variance.
    pub on_variance: f64,
}

impl FactorEntry {
    /// Of a factor.
    pub(crate) fn of(factor: &Factor) -> Self {
        Self {
            sensor: factor.sensor.name(),
            process: factor.process.clone(),
            on_variance: factor.on_variance,
        }
    }
}

#[derive(Serialize)]
struct FilterEntry {
    filter: &'static str,
    nees: f64,
    largest_ratio: f64,
    state: &'static str,
    truth: String,
    outage_end: Vec<EndEntry>,
}

#[derive(Serialize)]
struct EndEntry {
    after_s: f64,
    horizontal_rmse_m: f64,
    rmse: PerState<f64>,
}

#[cfg(test)]
#[path = "tune_tests.rs"]
mod tests;
