//! Outages at regular and at random times.

use super::Outage;
use crate::rng::StreamKey;
use crate::units::{Positive, SettingError, require_finite, require_positive};
use rand_distr::{Distribution, Exp};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Outages of one length at regular times, to the end of the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PeriodicOutages {
    /// Start of the first (s), on the clock of the trajectory: its `t_s`, which need not begin at 0.
    pub first_s: f64,
    /// From one start to the next (s).
    #[schemars(range(min = Self::LEAST_INTERVAL_S))]
    pub every_s: f64,
    /// Length of each (s), less than `every_s`.
    #[schemars(with = "Positive")]
    pub duration_s: f64,
}

impl PeriodicOutages {
    /// Shortest time from one start to the next (s).
    pub const LEAST_INTERVAL_S: f64 = 0.1;

    /// Checks every value.
    ///
    /// # Errors
    /// The key whose value is refused.
    pub(crate) fn validate(&self) -> Result<(), SettingError> {
        require_finite("first_s", &[self.first_s])?;
        require_positive("duration_s", &[self.duration_s])?;
        if !(self.every_s.is_finite() && self.every_s >= Self::LEAST_INTERVAL_S) {
            let requirement = format!("it must be a finite number ≥ {}", Self::LEAST_INTERVAL_S);
            return Err(SettingError::new("every_s", self.every_s, requirement));
        }
        if self.duration_s < self.every_s {
            return Ok(());
        }
        let requirement = format!("it must be shorter than every_s = {}", self.every_s);
        Err(SettingError::new(
            "duration_s",
            self.duration_s,
            requirement,
        ))
    }

    pub(super) fn windows(&self, (from_s, end_s): (f64, f64)) -> Vec<Outage> {
        // those that end before the span begins are not counted through: there may be as many as there is time
        let skipped = ((from_s - self.duration_s - self.first_s) / self.every_s)
            .floor()
            .max(0.0);
        (0_u32..)
            .map(|k| self.first_s + (skipped + f64::from(k)) * self.every_s)
            .take_while(|start| *start < end_s)
            .map(|start_s| Outage {
                start_s,
                end_s: start_s + self.duration_s,
            })
            .collect()
    }
}

/// Outages of one length at random times: from the end of one to the start of the next, an exponential
/// waiting time. One draw for the whole experiment, so that every run has the same outages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RandomOutages {
    /// Outages per hour of time with fixes.
    #[schemars(with = "Positive", range(max = Self::MOST_PER_HOUR))]
    pub rate_per_hour: f64,
    /// Length of each (s).
    #[schemars(with = "Positive")]
    pub duration_s: f64,
}

impl RandomOutages {
    /// One a second.
    pub const MOST_PER_HOUR: f64 = 3600.0;

    /// Checks every value.
    ///
    /// # Errors
    /// The key whose value is refused.
    pub(crate) fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_per_hour", &[self.rate_per_hour])?;
        if self.rate_per_hour > Self::MOST_PER_HOUR {
            let requirement = format!("it must be at most {}", Self::MOST_PER_HOUR);
            return Err(SettingError::new(
                "rate_per_hour",
                self.rate_per_hour,
                requirement,
            ));
        }
        require_positive("duration_s", &[self.duration_s])
    }

    pub(super) fn windows(
        &self,
        (start_s, end_s): (f64, f64),
        seed: u64,
    ) -> Result<Vec<Outage>, SettingError> {
        let refused = |_| {
            SettingError::new(
                "rate_per_hour",
                self.rate_per_hour,
                "it must be a number > 0",
            )
        };
        let waiting = Exp::new(self.rate_per_hour / 3600.0).map_err(refused)?;
        let key = StreamKey {
            seed,
            scenario: "",
            run: 0,
            source: "gnss.outage",
            process: "waiting",
        };
        let mut generator = key.generator();
        let mut windows = Vec::new();
        let mut t = start_s + waiting.sample(&mut generator);
        while t < end_s {
            windows.push(Outage {
                start_s: t,
                end_s: t + self.duration_s,
            });
            // Waiting begins when fixes are back: the rate is that of outages per hour with fixes, and none
            // overlap.
            t += self.duration_s + waiting.sample(&mut generator);
        }
        Ok(windows)
    }
}
