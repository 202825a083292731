//! Result of a tuning, its verdict and its form as JSON.

use nav_sim_document::readable;
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::metrics::{PerState, VerdictKind};
use nav_sim_navigation::simulation::lincov::{Aim, Factor, FilterConsistency};
use nav_sim_navigation::simulation::{NEES_DOF, REPORTED_NAMES, TOLERANCE};
use nav_sim_signal::imu::Sensor;
use serde::{Serialize, Serializer};

/// Horizontal RMSE over that of a filter that knows the truth, less 1, where the noise of one sensor was made to stand for
/// that of the other.
const ABSURD: f64 = 1.0;
/// Deviation of a factor from 1 that is not worth a word.
const UNCHANGED: f64 = 0.01;

/// What a tuning found.
#[derive(Debug, Clone)]
pub(crate) struct TuneResult {
    /// The filter that was tuned.
    pub filter: FilterStates,
    /// The filter that `run` makes of the model unless told otherwise.
    pub filter_of_run: FilterStates,
    /// The factors.
    pub factors: Vec<Factor>,
    /// The factor on the sigmas of the vehicle's own measurements, where there are any; NaN where none helps.
    pub aiding_sigmas: Option<f64>,
    /// The filter as it was.
    pub before: FilterConsistency,
    /// The tuned one.
    pub after: FilterConsistency,
    /// The tuned model in the filter that `run` makes of it, where that is another.
    pub of_run: Option<FilterConsistency>,
    /// A filter that knows the truth, each truth its own; none where there are errors of which no filter has states.
    pub informed: Option<FilterConsistency>,
    /// Names of the truths; of draws one for all.
    pub truths: Vec<String>,
    /// Condition under which the filter counts as consistent.
    pub aim: Aim,
    /// Sensors without noise that a factor could multiply, where a truth has some.
    pub without_factor: Vec<Sensor>,
    /// Whether the truths are the draws of a calibration, and what counts is the upper end of an interval.
    pub is_drawn: bool,
}

/// Verdict of `run` on a filter, by its covariance analysis.
pub(super) fn kind(found: &FilterConsistency) -> VerdictKind {
    match found.range {
        [_, largest] if largest > 1.0 + TOLERANCE => VerdictKind::Overconfident,
        [smallest, _] if smallest < 1.0 / (1.0 + TOLERANCE) => VerdictKind::Underconfident,
        _ => VerdictKind::Consistent,
    }
}

impl TuneResult {
    /// The factors and their cost, then the filters that they make.
    pub(super) fn verdict(&self) -> Vec<String> {
        let name = filter_name(self.filter);
        let changed: Vec<&Factor> = self.factors.iter().filter(|f| is_changed(f)).collect();
        if let Some(unmet) = self.unmet() {
            return vec![unmet, format!("at best, {}", described(&name, &self.after))];
        }
        let mut lines = match changed.as_slice() {
            [] => vec![format!(
                "no factor is needed: {}",
                described(&name, &self.after)
            )],
            changed => {
                let cost = self.cost(&self.after);
                let cost = match cost.is_finite() {
                    true => format!("; cost {:.1} % of horizontal RMSE", 100.0 * cost),
                    false => String::new(),
                };
                let [before, after] = [&self.before, &self.after].map(|found| readable(found.nees));
                let factors = factors_in_words(changed);
                let nees = format!("NEES {before} → {after} ({NEES_DOF} if right)");
                vec![
                    format!("{factors} (variance){cost}; {nees}"),
                    format!("tuned, {}", described(&name, &self.after)),
                ]
            }
        };
        self.of_aiding()
            .into_iter()
            .for_each(|line| lines.insert(0, line));
        if let Some(of_run) = &self.of_run {
            let name = format!("{}, the default of run,", filter_name(self.filter_of_run));
            lines.push(format!("tuned, {}", described(&name, of_run)));
        }
        lines
    }

    /// What covers the errors of the vehicle's own measurements.
    fn of_aiding(&self) -> Option<String> {
        let factor = self.aiding_sigmas.filter(|factor| *factor != 1.0)?;
        Some(match factor.is_nan() {
            true => "no sigma of the aiding covers its errors: give the filter states of them"
                .to_owned(),
            false => format!(
                "every sigma of [aiding] × {}, and then of the model:",
                readable(factor)
            ),
        })
    }

    /// Whether no factor was needed.
    pub(super) fn is_unchanged(&self) -> bool {
        !self.factors.iter().any(is_changed)
    }

    /// Why the factors are of no use, if they are not.
    pub(crate) fn unmet(&self) -> Option<String> {
        let is_overconfident = match self.aim {
            // of draws the first counts: what `run` judges
            Aim::Worst if self.is_drawn => kind(&self.after) == VerdictKind::Overconfident,
            Aim::Worst => self.after.largest.ratio > 1.0 + TOLERANCE,
            Aim::Mean => self.after.nees / NEES_DOF as f64 > (1.0 + TOLERANCE).powi(2),
        };
        let is_at_limit = self.factors.iter().any(Factor::is_at_limit);
        let names: Vec<&str> = self
            .without_factor
            .iter()
            .map(|sensor| sensor.name())
            .collect();
        if !names.is_empty() && (is_overconfident || is_at_limit || self.cost(&self.after) > ABSURD)
        {
            let names = names.join(" and ");
            return Some(format!(
                "the model has no {names} noise to multiply, where the truth has some"
            ));
        }
        let limit = if is_at_limit {
            ": a factor is the largest that is tried"
        } else {
            ""
        };
        let unmet = || format!("larger noise alone does not make this filter consistent{limit}");
        (is_overconfident || is_at_limit).then(unmet)
    }

    /// What helps there.
    pub(crate) fn remedy(&self) -> &'static str {
        match self.aim {
            _ if !self.without_factor.is_empty() => {
                "give it the noise of its data sheet (nav-sim datasheet) or of the truth, and tune again"
            }
            Aim::Mean => {
                "--for worst, other processes, or the turn-on bias and scale factors that the truth has"
            }
            Aim::Worst => {
                "a model of other processes, or with the turn-on bias and scale factors that the truth has"
            }
        }
    }

    /// Horizontal RMSE at the outages' ends over that of a filter that knows the truth, less 1; NaN without one.
    pub(super) fn cost(&self, found: &FilterConsistency) -> f64 {
        let square = |h: &FilterConsistency| h.horizontal_m().map(|x| x * x).sum::<f64>();
        (square(found) / self.informed.as_ref().map_or(f64::NAN, square)).sqrt() - 1.0
    }

    pub(super) fn filters(&self) -> impl Iterator<Item = (&'static str, &FilterConsistency)> {
        let tuned = [("untuned", &self.before), ("tuned", &self.after)].into_iter();
        let of_run = self.of_run.iter().map(|h| ("tuned, default of run", h));
        tuned
            .chain(of_run)
            .chain(self.informed.iter().map(|h| ("knows the truth", h)))
    }

    /// The truth in which an error is largest.
    pub(super) fn worst_truth(&self, found: &FilterConsistency) -> &str {
        &self.truths[if self.is_drawn {
            0
        } else {
            found.largest.truth
        }]
    }
}

impl Serialize for TuneResult {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let end = |(after_s, rmse): (&f64, &[f64; REPORTED_NAMES.len()])| EndEntry {
            after_s: *after_s,
            rmse: PerState(*rmse),
            horizontal_rmse_m: rmse[0].hypot(rmse[1]),
        };
        let filter = |(filter, found): (&'static str, &FilterConsistency)| FilterEntry {
            filter,
            nees: found.nees,
            largest_ratio: found.largest.ratio,
            state: REPORTED_NAMES[found.largest.state],
            truth: self.worst_truth(found).to_owned(),
            outage_end: found.end_s.iter().zip(&found.rmse_end).map(end).collect(),
        };
        let file = TuneFile {
            schema_version: 1,
            verdict: self.verdict().join("; "),
            factors: self.factors.iter().map(FactorEntry::of).collect(),
            aiding_sigma_factor: self.aiding_sigmas,
            truths: &self.truths,
            horizontal_rmse_cost: self.cost(&self.after),
            filters: self.filters().map(filter).collect(),
        };
        file.serialize(serializer)
    }
}

fn is_changed(factor: &Factor) -> bool {
    (factor.on_variance - 1.0).abs() >= UNCHANGED
}

/// `the full filter is overconfident: errors 0.95 to 1.31 × sigma`
fn described(name: &str, found: &FilterConsistency) -> String {
    let [smallest, largest] = found.range.map(readable);
    format!(
        "the {name} is {}: errors {smallest} to {largest} × sigma",
        kind(found)
    )
}

/// `filter of 15 states`
fn filter_name(states: FilterStates) -> String {
    if states == FilterStates::Full {
        "full filter".to_owned()
    } else {
        format!("filter of {states} states")
    }
}

/// `gyro × 4.02, accel × 1.59`
fn factors_in_words(changed: &[&Factor]) -> String {
    let word = |f: &&Factor| format!("{} × {}", f.sensor.name(), readable(f.on_variance));
    changed.iter().map(word).collect::<Vec<_>>().join(", ")
}

#[derive(Serialize)]
struct TuneFile<'a> {
    schema_version: u32,
    verdict: String,
    factors: Vec<FactorEntry>,
    /// On the sigmas of the vehicle's own measurements.
    #[serde(skip_serializing_if = "Option::is_none")]
    aiding_sigma_factor: Option<f64>,
    truths: &'a [String],
    horizontal_rmse_cost: f64,
    filters: Vec<FilterEntry>,
}

/// A factor in files.
#[derive(Debug, Clone, Serialize)]
pub(super) struct FactorEntry {
    /// `accel` or `gyro`.
    sensor: &'static str,
    on_variance: f64,
}

impl FactorEntry {
    pub(super) fn of(factor: &Factor) -> Self {
        Self {
            sensor: factor.sensor.name(),
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
#[path = "tests.rs"]
mod tests;
