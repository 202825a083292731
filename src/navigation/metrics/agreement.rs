//! Whether runs scatter about what covariance analysis expects of them.

use super::summary::Summary;
use crate::simulation::REPORTED_NAMES;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Probability at which runs that scatter as they should are said not to, all figures together.
const LEVEL: f64 = 1e-3;

/// Figures of runs, each as its distance from the expected one in its own Monte-Carlo standard errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Agreement {
    /// How many figures are compared: RMSE of every state and NEES at the end of each outage, means over the run of RMSE, NEES
    /// and coverage.
    pub figures: usize,
    /// The largest distance, with its sign.
    pub largest_z: f64,
    /// The figure that has it.
    pub largest: String,
    /// What chance alone reaches with probability 1e-3 (Student's t, Bonferroni).
    pub bound_z: f64,
    /// Distance of the mean NEES over the run.
    pub nees_z: f64,
    /// Distance of the mean coverage over the run.
    pub coverage_z: f64,
}

impl Agreement {
    /// The agreement of the summary of runs with the expected one of the same experiment.
    #[must_use]
    pub fn of(runs: &Summary, expected: &Summary) -> Self {
        let distance = |value: f64, error: f64, expected: f64| (value - expected) / error;
        let v = &runs.verdict;
        let nees_z = distance(v.nees, v.nees_std_error, expected.nees.mean);
        let coverage_z = distance(v.coverage, v.coverage_std_error, expected.coverage.mean);
        let mut all = vec![
            (nees_z, "NEES".to_owned()),
            (coverage_z, "coverage".to_owned()),
        ];
        let (a, e) = (&runs.accuracy, &expected.accuracy);
        for (i, name) in REPORTED_NAMES.iter().enumerate() {
            let z = distance(
                a.rmse_mean.0[i],
                a.rmse_mean_std_error.0[i],
                e.rmse_mean.0[i],
            );
            all.push((z, format!("RMSE of {name} over the run")));
        }
        for (k, (o, e)) in runs.outages.iter().zip(&expected.outages).enumerate() {
            let place = format!("at the end of outage {}", k + 1);
            all.push((
                distance(o.nees_end, o.nees_end_std_error, e.nees_end),
                format!("NEES {place}"),
            ));
            for (i, name) in REPORTED_NAMES.iter().enumerate() {
                let z = distance(o.rmse_end.0[i], o.rmse_end_std_error.0[i], e.rmse_end.0[i]);
                all.push((z, format!("RMSE of {name} {place}")));
            }
        }
        // coverage that is 1 in every run has no error of its own, and tells nothing
        all.retain(|(z, _)| z.is_finite());
        let largest = all
            .iter()
            .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
            .cloned();
        let (largest_z, largest) = largest.unwrap_or((f64::NAN, String::new()));
        // Two sides, and Bonferroni over all figures: they are correlated, so that the true level is below
        // LEVEL.
        let tail = LEVEL / (2.0 * all.len().max(1) as f64);
        // The standard errors are estimated from the same runs: Student's t, not the normal law.
        let t = StudentsT::new(0.0, 1.0, runs.independent_runs - 1.0);
        let bound_z = t.map_or(f64::NAN, |t| t.inverse_cdf(1.0 - tail));
        Self {
            figures: all.len(),
            largest_z,
            largest,
            bound_z,
            nees_z,
            coverage_z,
        }
    }

    /// Whether the runs contradict the analysis: where errors are no longer small it does not hold.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        self.largest_z.abs() > self.bound_z
    }
}

impl Summary {
    /// With what covariance analysis expects beside the runs.
    pub fn expect(&mut self, expected: Self, agreement: Agreement) {
        self.method = "both";
        self.compare_with(&expected, &agreement);
        self.lincov = Some(Box::new(expected));
        self.agreement = Some(agreement);
    }

    /// Puts the word of covariance analysis beside the verdict, which stays that of the runs.
    pub fn compare_with(&mut self, expected: &Self, agreement: &Agreement) {
        for (own, expected) in self.outages.iter_mut().zip(&expected.outages) {
            own.beyond_linear = expected.beyond_linear;
        }
        self.verdict.by_covariance_analysis = Some(expected.verdict.kind);
        self.verdict.beyond_linear = expected.verdict.beyond_linear;
        self.is_contradicted = agreement.is_broken() && self.verdict.kind != expected.verdict.kind;
    }
}
