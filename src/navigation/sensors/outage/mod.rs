//! When GNSS is missing: fixed windows, periodic ones, random ones.
//!
//! A fix at t is missing when start ≤ t < end of any outage. Times are on the trajectory's own clock.

mod data;
mod kinds;
mod plan;

pub use data::{FixedData, Fixes, OutageError, OutageRemark, PlacedOutages};
pub use kinds::{PeriodicOutages, RandomOutages};
pub use plan::OutagePlan;

use crate::units::{SettingError, require_finite};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// A window without fixes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Outage {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
}

/// What a time that is typed and the same time as a multiple of 1/rate differ by at most (s): times of days, 1e5 s, are
/// rounded to 1.5e-11 s, so that some tens of roundings are less, and no two samples are as near.
const SLACK_S: f64 = 1e-9;

impl Outage {
    /// The two outages of [Minaretzis et al.](crate::bibliography::Minaretzis24), Section V: one on a
    /// straight stretch, one with turns.
    pub const PAPER: [Self; 2] = [
        Self {
            start_s: 300.0,
            end_s: 390.0,
        },
        Self {
            start_s: 700.0,
            end_s: 790.0,
        },
    ];

    /// Whether a fix at `t_s` is missing.
    #[must_use]
    pub fn withholds(&self, t_s: f64) -> bool {
        self.start_s <= t_s + SLACK_S && !self.is_over(t_s)
    }

    /// Whether a fix at `t_s` comes after it.
    #[must_use]
    pub(crate) fn is_over(&self, t_s: f64) -> bool {
        self.end_s <= t_s + SLACK_S
    }

    /// Checks that it is finite and lasts.
    ///
    /// # Errors
    /// The key whose value is refused.
    pub(crate) fn validate(&self) -> Result<(), SettingError> {
        require_finite("start_s", &[self.start_s])?;
        require_finite("end_s", &[self.end_s])?;
        if self.end_s > self.start_s {
            return Ok(());
        }
        Err(SettingError::new(
            "end_s",
            self.end_s,
            format!("it must come after start_s = {}", self.start_s),
        ))
    }
}

/// A text that is no outage.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotAnOutage {
    /// It does not have two times.
    #[error("expected START:END in seconds, such as 300:390")]
    Form,
    /// They are refused.
    #[error(transparent)]
    Times(#[from] SettingError),
}

impl FromStr for Outage {
    type Err = NotAnOutage;

    /// `START:END`, in seconds.
    fn from_str(text: &str) -> Result<Self, NotAnOutage> {
        let time = |text: &str| text.trim().parse().map_err(|_| NotAnOutage::Form);
        let (start, end) = text.split_once(':').ok_or(NotAnOutage::Form)?;
        let outage = Self {
            start_s: time(start)?,
            end_s: time(end)?,
        };
        outage.validate()?;
        Ok(outage)
    }
}

#[cfg(test)]
mod tests;
