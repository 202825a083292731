//! Whether runs scatter about what covariance analysis expects of them.

use super::summary::Summary;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Probability at which runs that scatter as they should are said not to, all figures together.
const LEVEL: f64 = 1e-3;

impl Summary {
    /// The runs beside what covariance analysis expects of them.
    pub fn expect(&mut self, expected: Self) {
        self.method = "both";
        self.compare_with(&expected);
        self.lincov = Some(Box::new(expected));
    }

    /// Puts the word of covariance analysis beside the verdict, which stays that of the runs.
    pub fn compare_with(&mut self, expected: &Self) {
        for (own, expected) in self.outages.iter_mut().zip(&expected.outages) {
            own.beyond_linear = expected.beyond_linear;
        }
        self.verdict.by_covariance_analysis = Some(expected.verdict.kind);
        self.verdict.beyond_linear = expected.verdict.beyond_linear;
        self.is_contradicted =
            self.contradicts(expected) && self.verdict.kind != expected.verdict.kind;
    }

    /// Whether a figure of the runs (RMSE of every state and NEES at the end of each outage, means over the run of RMSE, NEES
    /// and coverage) is further from the expected one, in its own Monte-Carlo standard errors, than chance explains.
    fn contradicts(&self, expected: &Self) -> bool {
        let distance = |value: f64, error: f64, expected: f64| (value - expected) / error;
        let v = &self.verdict;
        let mut all = vec![
            distance(v.nees, v.nees_std_error, expected.nees.mean),
            distance(v.coverage, v.coverage_std_error, expected.coverage.mean),
        ];
        let (a, e) = (&self.accuracy, &expected.accuracy);
        let means = a.rmse_mean.0.iter().zip(&a.rmse_mean_std_error.0);
        all.extend(
            means
                .zip(&e.rmse_mean.0)
                .map(|((value, error), e)| distance(*value, *error, *e)),
        );
        for (o, e) in self.outages.iter().zip(&expected.outages) {
            all.push(distance(o.nees_end, o.nees_end_std_error, e.nees_end));
            let ends = o.rmse_end.0.iter().zip(&o.rmse_end_std_error.0);
            all.extend(
                ends.zip(&e.rmse_end.0)
                    .map(|((value, error), e)| distance(*value, *error, *e)),
            );
        }
        // coverage that is 1 in every run has no error of its own, and tells nothing
        all.retain(|z| z.is_finite());
        // Two sides, and Bonferroni over all figures: they are correlated, so that the true level is below
        // LEVEL.
        let tail = LEVEL / (2.0 * all.len().max(1) as f64);
        // The standard errors are estimated from the same runs: Student's t, not the normal law.
        StudentsT::new(0.0, 1.0, self.independent_runs - 1.0)
            .is_ok_and(|t| all.iter().any(|z| z.abs() > t.inverse_cdf(1.0 - tail)))
    }
}
