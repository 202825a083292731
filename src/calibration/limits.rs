//! Where the parameters of a model may be: fixed, or within bounds.

use super::spec::{Kind, ModelSpec};
use crate::wavelet::Curve;

/// Where the parameters of one process may be, in the units of the parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// sigma2, q2, gamma2, s2 or slope.
    pub(super) amplitude: (f64, f64),
    /// phi, beta or theta.
    pub(super) shape: Option<(f64, f64)>,
}

impl Limits {
    /// Wherever the process exists.
    pub(super) const NONE: Self = Self { amplitude: (0.0, f64::INFINITY), shape: None };
}

/// A limit that means nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LimitError {
    /// No such process.
    #[error("{spec} has no process {process}")]
    Process {
        /// The model.
        spec: String,
        /// The name given.
        process: String,
        /// Those it has.
        legal: Vec<String>,
    },
    /// No such parameter.
    #[error("{process} has no parameter {parameter}")]
    Parameter {
        /// The process.
        process: String,
        /// The name given.
        parameter: String,
        /// Those it has.
        legal: Vec<&'static str>,
    },
    /// Nothing lies between the bounds.
    #[error("{process} {parameter}: nothing lies between {low} and {high}")]
    Empty {
        /// The process.
        process: String,
        /// The parameter.
        parameter: String,
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// Bounds where the parameter cannot be.
    #[error("{process} {parameter}: {value} is not {domain}")]
    Domain {
        /// The process.
        process: String,
        /// The parameter.
        parameter: String,
        /// The bound.
        value: f64,
        /// Where it can be.
        domain: &'static str,
    },
}

impl LimitError {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> String {
        match self {
            Self::Process { legal, .. } => format!("its processes: {}", legal.join(", ")),
            Self::Parameter { legal, .. } => format!("its parameters: {}", legal.join(", ")),
            Self::Empty { .. } => "lower ≤ upper; fix = … for a value that is known".to_owned(),
            Self::Domain { .. } => "bounds are in the units of the parameter, as in model files".to_owned(),
        }
    }
}

impl Kind {
    /// Name of the parameter its wavelet variance grows with.
    #[must_use]
    pub const fn amplitude_name(self) -> &'static str {
        match self {
            Self::White | Self::Ar1 | Self::Ma1 => "sigma2",
            Self::Quantization => "q2",
            Self::GaussMarkov => "s2",
            Self::RandomWalk => "gamma2",
            Self::Drift => "slope",
        }
    }

    /// Name of the parameter that gives its shape, and where that can be.
    #[must_use]
    pub const fn shape_name(self) -> Option<&'static str> {
        match self {
            Self::Ar1 => Some("phi"),
            Self::GaussMarkov => Some("beta"),
            Self::Ma1 => Some("theta"),
            _ => None,
        }
    }

    /// Whether a shape can be there, and where it can be in words.
    fn shape_domain(self, value: f64) -> (bool, &'static str) {
        match self {
            // The search is over positive correlations.
            Self::Ar1 => (value > 0.0 && value < 1.0, "between 0 and 1"),
            Self::GaussMarkov => ((1e-100..=1e100).contains(&value), "a number from 1e-100 to 1e100 (1/s)"),
            _ => ((-1.0..=1.0).contains(&value), "between -1 and 1"),
        }
    }
}

impl ModelSpec {
    /// Restricts a parameter of the process of that label (`WN`, `AR1`, or `AR1_2` of several) to `low` … `high`;
    /// without one of them it is not restricted on that side.
    ///
    /// Processes of a kind of which one has limits keep the order of their labels; others are
    /// ordered by correlation time.
    ///
    /// # Errors
    /// When there is no such process or parameter, or no value is allowed.
    pub fn limit(
        &mut self,
        process: &str,
        parameter: &str,
        low: Option<f64>,
        high: Option<f64>,
    ) -> Result<(), LimitError> {
        let labels = self.labels();
        let Some(index) = labels.iter().position(|l| l == process) else {
            let (spec, process) = (self.to_string(), process.to_owned());
            return Err(LimitError::Process { spec, process, legal: labels });
        };
        let kind = self.kinds()[index];
        let is_amplitude = parameter == kind.amplitude_name();
        if !is_amplitude && kind.shape_name() != Some(parameter) {
            let (process, parameter) = (process.to_owned(), parameter.to_owned());
            let legal = kind.shape_name().into_iter().chain([kind.amplitude_name()]).collect();
            return Err(LimitError::Parameter { process, parameter, legal });
        }
        for value in [low, high].into_iter().flatten() {
            let amplitude = ((0.0..=Curve::WV_RANGE.1).contains(&value), "a number from 0 to 1e100");
            let (inside, domain) = if is_amplitude { amplitude } else { kind.shape_domain(value) };
            if !inside {
                let (process, parameter) = (process.to_owned(), parameter.to_owned());
                return Err(LimitError::Domain { process, parameter, value, domain });
            }
        }
        let (from, to) = (low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY));
        if from > to {
            let (process, parameter) = (process.to_owned(), parameter.to_owned());
            return Err(LimitError::Empty { process, parameter, low: from, high: to });
        }
        let limits = &mut self.limits_mut()[index];
        if is_amplitude {
            limits.amplitude = (from.max(0.0), to);
        } else {
            limits.shape = Some((from, to));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_is_refused() {
        let mut spec = ModelSpec::n2();
        let mut message = |p: &str, q: &str, l, h| spec.limit(p, q, l, h).unwrap_err().to_string();
        assert_eq!(message("AR1", "phi", None, Some(0.9)), "WN+QN+2*AR1+RW has no process AR1");
        assert_eq!(message("WN", "phi", None, None), "WN has no parameter phi");
        assert_eq!(
            message("AR1_1", "phi", Some(0.9), Some(0.8)),
            "AR1_1 phi: nothing lies between 0.9 and 0.8"
        );
        assert_eq!(message("AR1_2", "phi", None, Some(1.0)), "AR1_2 phi: 1 is not between 0 and 1");
        assert_eq!(
            message("RW", "gamma2", Some(-1.0), None),
            "RW gamma2: -1 is not a number from 0 to 1e100"
        );
        assert!(
            message("WN", "sigma2", Some(1e308), Some(1e308)).ends_with("is not a number from 0 to 1e100")
        );
        assert_eq!(spec.parameters(), 7);
        spec.limit("AR1_2", "phi", Some(0.99), Some(0.99)).unwrap();
        assert_eq!(spec.parameters(), 6, "a fixed parameter is not free");
    }
}
