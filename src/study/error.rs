//! What is wrong with a study.

use crate::formats::suggest::{self, nearest};
use nav_sim_calibration::{Estimator, ModelSpec, SpecError};

/// A study that means no grid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DescriptionError {
    /// A value is refused.
    #[error("\"{key}\" = {value} {reason}")]
    Refused {
        /// Key, dotted.
        key: String,
        /// Value.
        value: String,
        /// Why.
        reason: String,
    },
    /// What is to be fitted is no model.
    #[error("\"{key}\" = \"{fit}\" is not a model: {source}")]
    NotModel {
        /// Key, dotted.
        key: String,
        /// What is to be fitted.
        fit: String,
        /// Why it is none.
        source: Box<SpecError>,
    },
    /// An estimator of a single recording, and several recordings.
    #[error("\"{key}\": {estimator} takes a single recording; there are {recordings}")]
    NotSingle {
        /// Key of the estimators, dotted.
        key: String,
        /// The estimator.
        estimator: Estimator,
        /// How many recordings there are.
        recordings: u64,
    },
    /// An axis without a point: the grid would be empty.
    #[error("the grid is empty: no {axis}")]
    Empty {
        /// Key of the axis.
        axis: String,
    },
    /// Two points of one name.
    #[error("two {axis} entries are named \"{name}\"")]
    Duplicate {
        /// Key of the axis.
        axis: String,
        /// The second of them, from 1.
        entry: usize,
        /// The name.
        name: String,
    },
    /// A point without a name.
    #[error("{axis}[{entry}] has no name")]
    Unnamed {
        /// Key of the axis.
        axis: String,
        /// Which, from 1.
        entry: usize,
    },
    /// Too little or too much said.
    #[error("{key} needs exactly one of {keys}")]
    NotOne {
        /// The point, dotted.
        key: String,
        /// The keys.
        keys: &'static str,
    },
    /// Recordings make the errors, and covariance analysis needs their law.
    #[error("truth[{entry}] has no model, which covariance analysis (method = \"lincov\") needs")]
    NoModel {
        /// Which, from 1.
        entry: usize,
    },
    /// The reference is no candidate.
    #[error("\"reference\" = \"{reference}\" is no candidate")]
    NoReference {
        /// The name given.
        reference: String,
        /// The names there are.
        candidates: Vec<String>,
    },
}

impl DescriptionError {
    /// The refusal of a value.
    pub(crate) fn refused(key: &str, value: impl ToString, reason: impl Into<String>) -> Self {
        Self::Refused {
            key: key.to_owned(),
            value: value.to_string(),
            reason: reason.into(),
        }
    }

    /// The key to look for in the file, dotted.
    pub(crate) fn key(&self) -> String {
        match self {
            Self::Refused { key, .. }
            | Self::NotModel { key, .. }
            | Self::NotSingle { key, .. }
            | Self::NotOne { key, .. } => key.clone(),
            Self::Empty { axis } => axis.clone(),
            Self::Duplicate { axis, entry, .. } | Self::Unnamed { axis, entry } => {
                format!("{axis}[{entry}].name")
            }
            Self::NoModel { entry } => format!("truth[{entry}]"),
            Self::NoReference { .. } => "reference".to_owned(),
        }
    }

    /// What to do about it.
    pub(crate) fn hint(&self) -> Option<String> {
        match self {
            Self::NotModel { source, .. } => Some(suggest::model(source, ModelSpec::legal())),
            Self::NotSingle { .. } => Some(
                "give it one recording, or take awv, sr-awv or dr-awv, which average several"
                    .into(),
            ),
            Self::Empty { axis } if axis.contains('[') => {
                Some("a list without values makes no cell".into())
            }
            Self::Empty { axis } => Some(format!("add a [[{axis}]] to the study")),
            Self::Duplicate { .. } | Self::Unnamed { .. } => {
                Some("give each entry a \"name\"".into())
            }
            Self::NoModel { .. } => Some(
                "calibrate a model of the recordings and name it with \"model\", or sample".into(),
            ),
            Self::NoReference {
                reference,
                candidates,
            } => Some(
                match nearest(reference, candidates.iter().map(String::as_str)) {
                    Some(meant) => format!("did you mean \"{meant}\"?"),
                    None => format!("candidates: {}", candidates.join(", ")),
                },
            ),
            _ => None,
        }
    }
}
