//! What is chosen among.

use nav_sim_calibration::{Estimator, ModelChoice, ModelSpec};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_signal::noise::Kind;
use std::fmt;

/// A way from recordings to a filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// How replicates become one curve.
    pub estimator: Estimator,
    /// What is fitted to it.
    pub model: ModelChoice,
    /// How the model becomes states of the filter.
    pub filter: FilterStates,
    /// What is done to the model in between.
    pub inflation: Inflation,
}

/// What is done to a model before a filter is made of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Inflation {
    /// Nothing.
    #[default]
    None,
    /// One factor on the variances of each sensor, so that the filter is honest, in the mean, for the models of the
    /// single recordings that it was calibrated on.
    Tuned,
    /// All standard deviations ten times: the rule of thumb.
    Tenfold,
}

nav_sim_signal::named!(Inflation { None = "none", Tuned = "tuned", Tenfold = "x10" });
crate::parse::textual!(Inflation);

impl Candidate {
    /// The estimator's model as it is, in the default filter of 15 states.
    #[must_use]
    pub fn new(estimator: Estimator, model: ModelSpec) -> Self {
        let (filter, inflation) = (FilterStates::default(), Inflation::default());
        Self {
            estimator,
            model: ModelChoice::Given(model),
            filter,
            inflation,
        }
    }

    /// What is compared where nothing else is said: the three averages of N2, and beside AWV what else is done in
    /// practice, from all states to the rule of thumb, and single recordings.
    pub(crate) fn usual() -> Vec<Self> {
        let n2 = |estimator| Self::new(estimator, ModelSpec::n2());
        let two_slopes = |estimator| Self::new(estimator, white_and_walk());
        vec![
            n2(Estimator::Awv),
            n2(Estimator::SrAwv),
            n2(Estimator::DrAwv),
            Self {
                filter: FilterStates::Full,
                ..n2(Estimator::Awv)
            },
            Self {
                inflation: Inflation::Tuned,
                ..n2(Estimator::Awv)
            },
            Self {
                inflation: Inflation::Tenfold,
                ..n2(Estimator::Awv)
            },
            two_slopes(Estimator::Awv),
            n2(Estimator::Gmwm),
            two_slopes(Estimator::Avlr),
        ]
    }

    /// All combinations; AVLR, which reads slopes, with the models that have nothing else, or WN+RW.
    pub(crate) fn product(
        estimators: &[Estimator],
        models: &[ModelChoice],
        filters: &[FilterStates],
        inflations: &[Inflation],
    ) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for &estimator in estimators {
            for model in models {
                let model = if estimator == Estimator::Avlr && !is_of_slopes(model) {
                    ModelChoice::Given(white_and_walk())
                } else {
                    model.clone()
                };
                for &filter in filters {
                    for &inflation in inflations {
                        let candidate = Self {
                            estimator,
                            model: model.clone(),
                            filter,
                            inflation,
                        };
                        if !all.contains(&candidate) {
                            all.push(candidate);
                        }
                    }
                }
            }
        }
        all
    }

    /// Whether another one has the same model, before any inflation.
    pub(crate) fn is_calibrated_as(&self, other: &Self) -> bool {
        self.estimator == other.estimator && self.model == other.model
    }

    /// Whether it may be chosen. What is made of a single recording, while there are several, is shown for comparison.
    #[must_use]
    pub const fn is_eligible(&self) -> bool {
        !self.estimator.is_single()
    }
}

/// What most filters of other programs know.
fn white_and_walk() -> ModelSpec {
    "WN+RW".parse().expect("a sum of known processes")
}

/// Whether every process has a slope of its own in the Allan deviation.
fn is_of_slopes(model: &ModelChoice) -> bool {
    match model {
        ModelChoice::Given(spec) => spec
            .kinds()
            .iter()
            .all(|kind: &Kind| kind.shape().is_none()),
        ModelChoice::Auto => false,
    }
}

impl fmt::Display for Candidate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n2 = ModelChoice::Given(ModelSpec::n2());
        write!(f, "{} ", self.estimator)?;
        if self.model == n2 {
            f.write_str("N2")?
        } else {
            self.model.fmt(f)?
        }
        write!(f, ", {}", self.filter)?;
        match self.inflation {
            Inflation::None => Ok(()),
            inflation => write!(f, ", {}", inflation.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_candidates_apart() {
        let mut names: Vec<String> = Candidate::usual().iter().map(ToString::to_string).collect();
        assert_eq!(
            (names[0].as_str(), names[8].as_str()),
            ("awv N2, 15", "avlr WN+RW, 15")
        );
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn slopes_are_read_off_models_that_have_them() {
        let models = ["N2", "WN+RW"].map(|m| m.parse().unwrap());
        let all = Candidate::product(
            &[Estimator::Awv, Estimator::Avlr],
            &models,
            &[FilterStates::Reduced15],
            &[Inflation::None],
        );
        let names: Vec<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(names, ["awv N2, 15", "awv WN+RW, 15", "avlr WN+RW, 15"]);
    }
}
