//! How a noise model becomes states of the filter, and how people write that.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Scale-factor error that the filter of 21 states expects (1): 300 ppm, that of KF-GINS's demonstration.
const SCALE_SIGMA: f64 = 300e-6;

/// How the noise model becomes states of the filter. Unknown constants (turn-on bias, scale factors) that are
/// asked for beside it, and drifts (DR) of the model, add three states each to any of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "WrittenStates")]
#[schemars(!try_from)]
pub enum FilterStates {
    /// 15 states: one first-order Gauss-Markov bias an axis, the reduction of the model.
    #[default]
    #[serde(rename = "15")]
    Reduced15,
    /// 21 states: those 15 and a constant scale factor of each axis of both sensors (300 ppm unless said).
    #[serde(rename = "21")]
    Reduced21,
    /// One state for each AR1 and random walk of each axis.
    #[serde(rename = "full")]
    Full,
}

/// A word that is none of the filters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("expected \"15\", \"21\" or \"full\"")]
pub struct UnknownStates;

impl FilterStates {
    /// All, the smallest first.
    pub const ALL: [Self; 3] = [Self::Reduced15, Self::Reduced21, Self::Full];

    /// As it is written: `15`, `21` or `full`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reduced15 => "15",
            Self::Reduced21 => "21",
            Self::Full => "full",
        }
    }

    /// Scale-factor error that the filter expects of both sensors where nothing else is said (1).
    #[must_use]
    pub const fn scale_sigma(self) -> f64 {
        match self {
            Self::Reduced21 => SCALE_SIGMA,
            Self::Reduced15 | Self::Full => 0.0,
        }
    }

    /// Whether the model's processes are reduced to one bias an axis.
    #[must_use]
    pub const fn is_reduced(self) -> bool {
        !matches!(self, Self::Full)
    }
}

impl fmt::Display for FilterStates {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FilterStates {
    type Err = UnknownStates;

    fn from_str(text: &str) -> Result<Self, UnknownStates> {
        Self::ALL
            .into_iter()
            .find(|states| states.name() == text)
            .ok_or(UnknownStates)
    }
}

/// In a file: a word, or a number for those that are one.
#[derive(Deserialize)]
#[serde(untagged, expecting = "\"15\", \"21\" or \"full\"")]
enum WrittenStates {
    Number(u64),
    Word(String),
}

impl TryFrom<WrittenStates> for FilterStates {
    type Error = UnknownStates;

    fn try_from(written: WrittenStates) -> Result<Self, UnknownStates> {
        match written {
            WrittenStates::Number(number) => number.to_string().parse(),
            WrittenStates::Word(word) => word.parse(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_is_read_as_it_is_written() {
        for states in FilterStates::ALL {
            assert_eq!(states.to_string().parse(), Ok(states));
            assert_eq!(serde_json::to_value(states).unwrap(), states.name());
            assert_eq!(
                serde_json::from_value::<FilterStates>(states.name().into()).unwrap(),
                states
            );
        }
        assert_eq!(
            serde_json::from_str::<FilterStates>("21").unwrap(),
            FilterStates::Reduced21
        );
        assert!(
            "16".parse::<FilterStates>().is_err()
                && serde_json::from_str::<FilterStates>("27").is_err()
        );
    }
}
