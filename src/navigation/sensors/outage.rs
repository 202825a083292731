//! When GNSS is missing: fixed windows, periodic ones, random ones.
//!
//! A fix at t is missing when start ≤ t < end of any outage. Times are on the trajectory's own clock.

use crate::rng::StreamKey;
use crate::units::{SettingError, require_finite, require_positive};
use rand_distr::{Distribution, Exp};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A window without fixes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Outage {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
}

impl Outage {
    /// The two outages of [Minaretzis et al.](crate::bibliography::Minaretzis24), Section V: one on a
    /// straight stretch, one with turns.
    pub const PAPER: [Self; 2] =
        [Self { start_s: 300.0, end_s: 390.0 }, Self { start_s: 700.0, end_s: 790.0 }];

    /// Whether a fix at `t_s` is missing.
    #[must_use]
    pub fn withholds(&self, t_s: f64) -> bool {
        self.start_s <= t_s && t_s < self.end_s
    }

    /// Checks that it is finite and lasts.
    ///
    /// # Errors
    /// The key whose value is refused.
    pub fn validate(&self) -> Result<(), SettingError> {
        require_finite("start_s", &[self.start_s])?;
        require_finite("end_s", &[self.end_s])?;
        if self.end_s > self.start_s {
            return Ok(());
        }
        Err(SettingError::new("end_s", self.end_s, format!("it must come after start_s = {}", self.start_s)))
    }
}

/// An outage that was asked for by its times and is none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum MisplacedOutage {
    /// It begins before the data or after them.
    #[error("outage {}:{} does not lie on the data, which last from {} to {} s", .outage.start_s, .outage.end_s, .span_s.0, .span_s.1)]
    Outside {
        /// As asked for.
        outage: Outage,
        /// Of the data (s).
        span_s: (f64, f64),
    },
    /// No fix falls into it.
    #[error("outage {}:{} withholds no fix", .0.start_s, .0.end_s)]
    NoFix(Outage),
}

impl Outage {
    /// The outage on data that last from `span_s.0` to `span_s.1`, cut where they end; `withholds` tells whether a fix
    /// falls into what is left. The one rule of runs, studies and fusions.
    ///
    /// # Errors
    /// One that begins outside the data, or withholds no fix: a mistake.
    pub fn placed(
        self,
        span_s: (f64, f64),
        withholds: impl Fn(&Self) -> bool,
    ) -> Result<Self, MisplacedOutage> {
        // clocks and people round to a microsecond
        if self.start_s < span_s.0 - 1e-6 || self.start_s >= span_s.1 {
            return Err(MisplacedOutage::Outside { outage: self, span_s });
        }
        let placed = Self { end_s: self.end_s.min(span_s.1), ..self };
        if withholds(&placed) { Ok(placed) } else { Err(MisplacedOutage::NoFix(self)) }
    }
}

/// Outages of one length at regular times, to the end of the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PeriodicOutages {
    /// Start of the first (s).
    pub first_s: f64,
    /// From one start to the next (s).
    pub every_s: f64,
    /// Length of each (s).
    pub duration_s: f64,
}

impl PeriodicOutages {
    /// Checks every value.
    ///
    /// # Errors
    /// The key whose value is refused.
    pub fn validate(&self) -> Result<(), SettingError> {
        require_finite("first_s", &[self.first_s])?;
        require_positive("duration_s", &[self.duration_s])?;
        if !(self.every_s.is_finite() && self.every_s >= 0.1) {
            return Err(SettingError::new("every_s", self.every_s, "it must be a finite number ≥ 0.1"));
        }
        if self.duration_s < self.every_s {
            return Ok(());
        }
        let requirement = format!("it must be shorter than every_s = {}", self.every_s);
        Err(SettingError::new("duration_s", self.duration_s, requirement))
    }

    fn windows(&self, (from_s, end_s): (f64, f64)) -> Vec<Outage> {
        // those that end before the span begins are not counted through: there may be as many as there is time
        let skipped = ((from_s - self.duration_s - self.first_s) / self.every_s).floor().max(0.0);
        (0_u32..)
            .map(|k| self.first_s + (skipped + f64::from(k)) * self.every_s)
            .take_while(|start| *start < end_s)
            .map(|start_s| Outage { start_s, end_s: start_s + self.duration_s })
            .collect()
    }
}

/// Outages of one length at random times: from the end of one to the start of the next, an exponential
/// waiting time. One draw for the whole experiment, so that every run has the same outages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RandomOutages {
    /// Outages per hour of time with fixes.
    pub rate_per_hour: f64,
    /// Length of each (s).
    pub duration_s: f64,
}

impl RandomOutages {
    /// Checks every value.
    ///
    /// # Errors
    /// The key whose value is refused.
    pub fn validate(&self) -> Result<(), SettingError> {
        require_positive("rate_per_hour", &[self.rate_per_hour])?;
        if self.rate_per_hour > 3600.0 {
            return Err(SettingError::new("rate_per_hour", self.rate_per_hour, "it must be at most 3600"));
        }
        require_positive("duration_s", &[self.duration_s])
    }

    fn windows(&self, (start_s, end_s): (f64, f64), seed: u64) -> Result<Vec<Outage>, SettingError> {
        let refused = |_| SettingError::new("rate_per_hour", self.rate_per_hour, "it must be a number > 0");
        let waiting = Exp::new(self.rate_per_hour / 3600.0).map_err(refused)?;
        let key = StreamKey { seed, scenario: "", run: 0, source: "gnss.outage", process: "waiting" };
        let mut generator = key.generator();
        let mut windows = Vec::new();
        let mut t = start_s + waiting.sample(&mut generator);
        while t < end_s {
            windows.push(Outage { start_s: t, end_s: t + self.duration_s });
            t += self.duration_s + waiting.sample(&mut generator);
        }
        Ok(windows)
    }
}

/// What is asked for: the union of the three kinds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OutagePlan {
    /// Windows given one by one.
    pub fixed: Vec<Outage>,
    /// Regular ones.
    pub periodic: Option<PeriodicOutages>,
    /// Random ones.
    pub random: Option<RandomOutages>,
}

impl OutagePlan {
    /// The windows on a trajectory that lasts from `span_s.0` to `span_s.1`: in time order, those that
    /// overlap or touch made one, cut at the trajectory's ends, those outside left out.
    ///
    /// # Errors
    /// The key of a value that is refused.
    pub fn windows(&self, span_s: (f64, f64), seed: u64) -> Result<Vec<Outage>, SettingError> {
        let mut all = self.fixed.clone();
        for (i, outage) in all.iter().enumerate() {
            outage.validate().map_err(|e| e.in_section(&format!("outage[{}]", i + 1)))?;
        }
        if let Some(periodic) = &self.periodic {
            periodic.validate().map_err(|e| e.in_section("outage_periodic"))?;
            all.extend(periodic.windows(span_s));
        }
        if let Some(random) = &self.random {
            random.validate().map_err(|e| e.in_section("outage_random"))?;
            all.extend(random.windows(span_s, seed).map_err(|e| e.in_section("outage_random"))?);
        }
        Ok(united(all, span_s))
    }
}

fn united(mut windows: Vec<Outage>, (start_s, end_s): (f64, f64)) -> Vec<Outage> {
    windows.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    let mut united: Vec<Outage> = Vec::new();
    for window in windows {
        let cut = Outage { start_s: window.start_s.max(start_s), end_s: window.end_s.min(end_s) };
        match united.last_mut() {
            _ if cut.start_s >= cut.end_s => {}
            Some(last) if cut.start_s <= last.end_s => last.end_s = last.end_s.max(cut.end_s),
            _ => united.push(cut),
        }
    }
    united
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outage(start_s: f64, end_s: f64) -> Outage {
        Outage { start_s, end_s }
    }

    #[test]
    fn a_fix_at_the_start_is_missing_and_at_the_end_is_not() {
        let o = outage(300.0, 390.0);
        assert_eq!([299.0, 300.0, 389.0, 390.0].map(|t| o.withholds(t)), [false, true, true, false]);
    }

    #[test]
    fn kinds_are_united_in_time_order() {
        let plan = OutagePlan {
            fixed: vec![outage(50.0, 70.0), outage(10.0, 20.0), outage(95.0, 300.0)],
            periodic: Some(PeriodicOutages { first_s: 15.0, every_s: 40.0, duration_s: 10.0 }),
            random: None,
        };
        let expected = vec![outage(10.0, 25.0), outage(50.0, 70.0), outage(95.0, 100.0)];
        assert_eq!(plan.windows((0.0, 100.0), 1).unwrap(), expected);
    }

    /// First one, from time immemorial: as many windows as the span has room for, at the same times.
    #[test]
    fn periodic_outages_begin_where_the_span_does() {
        let plan = |first_s| OutagePlan {
            periodic: Some(PeriodicOutages { first_s, every_s: 100.0, duration_s: 20.0 }),
            ..OutagePlan::default()
        };
        let expected = vec![outage(0.0, 10.0), outage(90.0, 110.0), outage(190.0, 200.0)];
        assert_eq!(plan(-10.0).windows((0.0, 200.0), 1).unwrap(), expected);
        assert_eq!(plan(-1e12 - 10.0).windows((0.0, 200.0), 1).unwrap(), expected);
        let epoch = plan(0.0).windows((1.7e9 - 10.0, 1.7e9 + 30.0), 1).unwrap();
        assert_eq!(epoch, [outage(1.7e9, 1.7e9 + 20.0)]);
    }

    #[test]
    fn an_outage_lies_on_the_data_and_withholds_a_fix() {
        let fixes = [1.0, 2.0, 3.0, 4.0];
        let place = |a, b| outage(a, b).placed((1.0, 4.5), |o| fixes.iter().any(|t| o.withholds(*t)));
        assert_eq!(place(2.0, 3.0), Ok(outage(2.0, 3.0)));
        assert_eq!(place(3.5, 9.0), Ok(outage(3.5, 4.5)));
        assert_eq!(place(2.1, 2.9), Err(MisplacedOutage::NoFix(outage(2.1, 2.9))));
        assert!(matches!(place(0.0, 3.0), Err(MisplacedOutage::Outside { .. })));
        let e = place(5.0, 9.0).unwrap_err().to_string();
        assert_eq!(e, "outage 5:9 does not lie on the data, which last from 1 to 4.5 s");
    }

    /// The number of outages in an hour of exponential waiting is close to Poisson: over 2000 seeds the
    /// mean is within 5 standard errors of the renewal rate 3600/(mean waiting + duration).
    #[test]
    fn random_outages_occur_at_the_stated_rate_and_repeat_with_the_seed() {
        let plan = OutagePlan {
            random: Some(RandomOutages { rate_per_hour: 6.0, duration_s: 30.0 }),
            ..OutagePlan::default()
        };
        let span = (0.0, 36_000.0);
        let count = |seed| plan.windows(span, seed).unwrap().len() as f64;
        let seeds = 2000;
        let counts: Vec<f64> = (0..seeds).map(count).collect();
        let mean = counts.iter().sum::<f64>() / seeds as f64;
        let variance = counts.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (seeds - 1) as f64;
        // Renewal function of a delayed process: (T − E[wait])/cycle up to the residual of the first cycle,
        // E N(T) = T/m + (s² + m²)/(2m²) − E[first]/m, m = 630 s, s = E[first] = 600 s.
        let (m, s, t) = (630.0, 600.0, span.1);
        let expected = t / m + (s * s + m * m) / (2.0 * m * m) - s / m;
        assert!((mean - expected).abs() < 5.0 * (variance / seeds as f64).sqrt(), "{mean} {expected}");
        assert_eq!(plan.windows(span, 7).unwrap(), plan.windows(span, 7).unwrap());
        assert_ne!(plan.windows(span, 7).unwrap(), plan.windows(span, 8).unwrap());
    }

    #[test]
    fn impossible_windows_are_refused_by_key() {
        let refused = |plan: &OutagePlan| plan.windows((0.0, 100.0), 1).unwrap_err().key;
        let fixed = OutagePlan { fixed: vec![outage(9.0, 9.0)], ..OutagePlan::default() };
        assert_eq!(refused(&fixed), "outage[1].end_s");
        let periodic = PeriodicOutages { first_s: 0.0, every_s: 10.0, duration_s: 10.0 };
        let periodic = OutagePlan { periodic: Some(periodic), ..OutagePlan::default() };
        assert_eq!(refused(&periodic), "outage_periodic.duration_s");
        let random = RandomOutages { rate_per_hour: f64::NAN, duration_s: 10.0 };
        let random = OutagePlan { random: Some(random), ..OutagePlan::default() };
        assert_eq!(refused(&random), "outage_random.rate_per_hour");
    }
}
