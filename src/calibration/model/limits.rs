//! Limits of the parameters of a model: fixed values or bounds.

/// Bounds of the parameters of one process, in the units of the parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// sigma2, q2, gamma2, s2 or slope.
    pub(crate) amplitude: (f64, f64),
    /// phi, beta or theta.
    pub(crate) shape: Option<(f64, f64)>,
}

impl Limits {
    /// No limits: wherever the process exists.
    pub(crate) const NONE: Self = Self {
        amplitude: (0.0, f64::INFINITY),
        shape: None,
    };
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
        /// The domain, in words.
        domain: &'static str,
    },
}

impl LimitError {
    /// Advice to the user.
    #[must_use]
    pub fn hint(&self) -> String {
        match self {
            Self::Process { legal, .. } => format!("its processes: {}", legal.join(", ")),
            Self::Parameter { legal, .. } => format!("its parameters: {}", legal.join(", ")),
            Self::Empty { .. } => "lower ≤ upper; fix = … for a value that is known".to_owned(),
            Self::Domain { .. } => {
                "bounds are in the units of the parameter, as in model files".to_owned()
            }
        }
    }
}
