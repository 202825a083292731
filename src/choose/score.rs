//! How good a filter was at the ends of outages.

use nav_sim_navigation::simulation::lincov::Judged;
use nav_sim_navigation::simulation::{NEES_DOF, OutageRecord, RunRecord};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A filter on one recording: what is said of the end of an outage, over all outages.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Horizontal RMSE (m).
    pub rmse_m: f64,
    /// What the filter believes of it (m).
    pub believed_m: f64,
    /// Mean NEES of position, velocity and attitude; 9 is right.
    pub nees: f64,
    /// Share of errors within the filter's 95 % ellipsoid of the nine states; none where nothing is sampled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage: Option<f64>,
    /// Mean log density of the nine errors (m, m/s, rad) under the filter's belief (nats); minus infinity (null)
    /// where a run diverged.
    pub log_score: f64,
    /// Runs that diverged; they are in no mean.
    pub diverged: usize,
    /// Outage by outage.
    pub outages: Vec<EndScore>,
}

/// The same at the end of one outage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EndScore {
    /// Horizontal RMSE (m).
    pub rmse_m: f64,
    /// What the filter believes of it (m).
    pub believed_m: f64,
    /// Mean NEES.
    pub nees: f64,
    /// Mean log density (nats).
    pub log_score: f64,
}

impl Score {
    /// Of runs with so many outages.
    pub(crate) fn of_runs(runs: &[RunRecord], outages: usize) -> Self {
        let kept: Vec<&[OutageRecord]> = runs
            .iter()
            .filter(|r| !r.diverged)
            .map(|r| r.outages.as_slice())
            .collect();
        let diverged = runs.len() - kept.len();
        let end = |i: usize| {
            let mean =
                |value: &dyn Fn(&OutageRecord) -> f64| mean(kept.iter().map(|run| value(&run[i])));
            EndScore {
                rmse_m: mean(&|o| o.horizontal_error_end_m.powi(2)).sqrt(),
                believed_m: mean(&|o| o.see_end[0].powi(2) + o.see_end[1].powi(2)).sqrt(),
                nees: mean(&|o| o.nees_end),
                log_score: mean(&|o| o.log_density_end),
            }
        };
        let limit = ChiSquared::new(NEES_DOF as f64).map_or(f64::NAN, |law| law.inverse_cdf(0.95));
        let inside = |o: &OutageRecord| f64::from(u8::from(o.nees_end <= limit));
        let coverage = mean(kept.iter().flat_map(|run| run.iter()).map(inside));
        let outages = (0..outages).map(end).collect();
        let score = Self {
            coverage: Some(coverage),
            diverged,
            ..Self::of_ends(outages)
        };
        Self {
            log_score: if diverged > 0 {
                f64::NEG_INFINITY
            } else {
                score.log_score
            },
            ..score
        }
    }

    /// As covariance analysis expects it.
    pub(crate) fn expected(ends: &[Judged]) -> Self {
        let end = |end: &Judged| {
            let found = end.consistency();
            EndScore {
                rmse_m: found.rmse[0].hypot(found.rmse[1]),
                believed_m: found.sigma[0].hypot(found.sigma[1]),
                nees: found.nees,
                log_score: found.log_density,
            }
        };
        Self::of_ends(ends.iter().map(end).collect())
    }

    fn of_ends(outages: Vec<EndScore>) -> Self {
        let mean = |value: &dyn Fn(&EndScore) -> f64| mean(outages.iter().map(value));
        Self {
            rmse_m: mean(&|o| o.rmse_m.powi(2)).sqrt(),
            believed_m: mean(&|o| o.believed_m.powi(2)).sqrt(),
            nees: mean(&|o| o.nees),
            coverage: None,
            log_score: mean(&|o| o.log_score),
            diverged: 0,
            outages,
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u64);
    for value in values {
        sum += value;
        count += 1;
    }
    sum / count as f64
}
