//! Limits that the errors must keep.

use super::summary::{OutageSummary, Summary};
use super::verdict::{Verdict, VerdictKind};
use crate::simulation::{REPORTED_NAMES, TOLERANCE};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The figure that a limit is set on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Figure {
    /// Median of the horizontal error at the end of an outage.
    P50,
    /// Its 95 % quantile.
    P95,
    /// RMSE of a reported state at the end of an outage; without outages its mean over the run.
    Rmse(usize),
    /// The verdict on the filter: its worst ratio of error to standard deviation, and that runs could have found a larger one.
    Consistent,
}

/// A figure and the most it may be, at the end of every outage: `p95_m<=5`, `rmse_pos_e_m<=2`, `yaw_deg<=1`; or
/// `consistent`, a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Requirement {
    figure: Figure,
    limit: f64,
}

/// Position and velocity down among the reported states.
const DOWN: [usize; 2] = [2, 5];

/// Not a requirement.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected \"consistent\" or NAME<=LIMIT with a positive limit, NAME one of p50_m, p95_m, rmse_pos_e_m, yaw_deg and the other states"
)]
pub struct UnknownRequirement;

/// Whether a requirement is met, and by how much.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Met {
    /// The figure.
    pub name: String,
    /// The most it may be.
    pub limit: f64,
    /// What it is, at its worst.
    pub value: f64,
    /// The outage at whose end that is (from 0); none: the mean over the run.
    pub outage: Option<usize>,
    /// Whether it is within the limit, and a covariance analysis alone can say so.
    pub met: bool,
    /// The outage (from 0) in which errors are beyond linear theory, where covariance analysis would call the limit met and cannot, for
    /// want of what comes after that outage, or where runs decide in its place.
    pub beyond_linear: Option<usize>,
}

impl FromStr for Requirement {
    type Err = UnknownRequirement;

    fn from_str(text: &str) -> Result<Self, UnknownRequirement> {
        if text.trim() == "consistent" {
            return Ok(Self {
                figure: Figure::Consistent,
                limit: 1.0 + TOLERANCE,
            });
        }
        let (name, limit) = text
            .split_once("<=")
            .or_else(|| text.split_once('<'))
            .ok_or(UnknownRequirement)?;
        let limit: f64 = limit.trim().parse().map_err(|_| UnknownRequirement)?;
        let name = name.trim();
        let state = || {
            REPORTED_NAMES
                .iter()
                .position(|known| *known == name.strip_prefix("rmse_").unwrap_or(name))
        };
        let figure = match name {
            "p50_m" => Figure::P50,
            "p95_m" => Figure::P95,
            _ => Figure::Rmse(state().ok_or(UnknownRequirement)?),
        };
        if limit > 0.0 && limit.is_finite() {
            Ok(Self { figure, limit })
        } else {
            Err(UnknownRequirement)
        }
    }
}

impl Requirement {
    /// Whether it says anything only of outages.
    #[must_use]
    pub const fn needs_outage(&self) -> bool {
        matches!(self.figure, Figure::P50 | Figure::P95)
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        match self.figure {
            Figure::P50 => "p50_m".to_owned(),
            Figure::P95 => "p95_m".to_owned(),
            Figure::Rmse(state) => format!("rmse_{}", REPORTED_NAMES[state]),
            Figure::Consistent => "consistent".to_owned(),
        }
    }

    /// Compares the limit with the expectation of the covariance analysis where there is one, else with the runs. From the first
    /// outage that is beyond linear theory on, position and velocity down are not in the analysis: the runs beside it decide, and
    /// without runs no limit is met. All other figures hold (docs/limits.md).
    #[must_use]
    pub fn check(&self, summary: &Summary) -> Met {
        if self.figure == Figure::Consistent {
            let Verdict {
                kind,
                ratio,
                worst_outage,
                beyond_linear,
                ..
            } = summary.verdict;
            let (name, met) = (self.name(), kind == VerdictKind::Consistent);
            return Met {
                name,
                limit: self.limit,
                value: ratio,
                outage: worst_outage,
                met,
                beyond_linear,
            };
        }
        // Free of chance: a limit is then not kept or missed by the luck of the runs.
        let expected = summary.lincov.as_deref().unwrap_or(summary);
        let of_outage = |o: &OutageSummary| match self.figure {
            Figure::P50 => o.horizontal_error_end_m.p50,
            Figure::P95 => o.horizontal_error_end_m.p95,
            Figure::Rmse(state) => o.rmse_end.0[state],
            Figure::Consistent => o.verdict.ratio,
        };
        let is_down = matches!(self.figure, Figure::Rmse(state) if DOWN.contains(&state));
        let is_shifted = |o: &OutageSummary| o.beyond_linear;
        let shifted = expected
            .outages
            .iter()
            .position(is_shifted)
            .filter(|_| is_down && expected.runs == 0);
        let is_beyond = |outage: usize| shifted.is_some_and(|shifted| outage >= shifted);
        let outages = summary.outages.iter().zip(&expected.outages).enumerate();
        let ends = outages
            .map(|(k, (own, expected))| (k, of_outage(if is_beyond(k) { own } else { expected })));
        // a figure that is not a number is the worst of all
        let worst = ends.max_by(|a, b| (a.1.is_nan().cmp(&b.1.is_nan())).then(a.1.total_cmp(&b.1)));
        let (outage, value) = match (worst, self.figure) {
            (Some((outage, value)), _) => (Some(outage), value),
            (None, Figure::Rmse(state)) => (None, expected.accuracy.rmse_mean.0[state]),
            (None, _) => (None, f64::NAN),
        };
        let (is_kept, is_sampled) = (value <= self.limit, summary.runs > 0);
        let decides = match is_sampled {
            true => outage.is_some_and(is_beyond),
            // any of the outages after it, not the one that is largest in linear theory alone
            false => is_kept && summary.outages.len().checked_sub(1).is_some_and(is_beyond),
        };
        let beyond_linear = shifted.filter(|_| decides);
        let met = is_kept && (is_sampled || beyond_linear.is_none());
        Met {
            name: self.name(),
            limit: self.limit,
            value,
            outage,
            met,
            beyond_linear,
        }
    }
}

impl fmt::Display for Requirement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.figure {
            Figure::Consistent => f.write_str("consistent"),
            _ => write!(f, "{}<={}", self.name(), self.limit),
        }
    }
}

impl TryFrom<String> for Requirement {
    type Error = UnknownRequirement;

    fn try_from(text: String) -> Result<Self, UnknownRequirement> {
        text.parse()
    }
}

impl From<Requirement> for String {
    fn from(requirement: Requirement) -> Self {
        requirement.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requirements_are_read_as_they_are_written() {
        for (text, shown) in [
            ("p95_m<=5", "p95_m<=5"),
            ("p50_m < 2.5", "p50_m<=2.5"),
            ("rmse_pos_e_m<=1", "rmse_pos_e_m<=1"),
            ("yaw_deg<=0.5", "rmse_yaw_deg<=0.5"),
            ("consistent", "consistent"),
        ] {
            assert_eq!(text.parse::<Requirement>().unwrap().to_string(), shown);
        }
        for wrong in [
            "p95_m",
            "p95_m>=5",
            "p95<=5",
            "p95_m<=-1",
            "p95_m<=nan",
            "p95_m<=",
            "rmse_p95_m<=1",
        ] {
            assert_eq!(
                wrong.parse::<Requirement>(),
                Err(UnknownRequirement),
                "{wrong}"
            );
        }
    }
}
