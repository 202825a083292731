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
        // a nanosecond of slack: sample times are multiples of 1/rate, outage times are typed
        let t_s = t_s + 1e-9;
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

/// When fixes come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fixes<'a> {
    /// At whole intervals after the start of the data.
    Every {
        /// From one to the next (s).
        interval_s: f64,
    },
    /// At these times (s), in order.
    At(&'a [f64]),
}

/// The data that outages are placed on: the one rule of runs, studies and fusions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedData<'a> {
    /// From when to when they last (s).
    pub span_s: (f64, f64),
    /// Their fixes.
    pub fixes: Fixes<'a>,
}

impl<'a> FixedData<'a> {
    /// Recorded fixes at these times (s): an outage may last until a fix later than the last would come, and
    /// begin as early before the first.
    #[must_use]
    pub fn recorded(times_s: &'a [f64]) -> Self {
        let interval_s = times_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let (first, last) = times_s.first().zip(times_s.last()).map_or((0.0, 0.0), |(f, l)| (*f, *l));
        Self { span_s: (first - interval_s, last + interval_s), fixes: Fixes::At(times_s) }
    }

    fn has_fix_in(&self, outage: &Outage) -> bool {
        match self.fixes {
            Fixes::Every { interval_s } => {
                let since_start = (outage.start_s - self.span_s.0) / interval_s;
                let next = (since_start - 1e-6).ceil().max(1.0);
                self.span_s.0 + next * interval_s < outage.end_s
            }
            Fixes::At(times_s) => times_s.iter().any(|t_s| outage.withholds(*t_s)),
        }
    }

    fn described(&self) -> String {
        match self.fixes {
            Fixes::Every { interval_s } => {
                format!("fixes come every {interval_s} s from {} s", self.span_s.0)
            }
            Fixes::At([]) => "there are no fixes".to_owned(),
            Fixes::At([first, .., last] | [first @ last]) => {
                format!("the fixes run from {first} to {last} s")
            }
        }
    }

    /// An outage asked for by its times, cut where the data end.
    fn place(&self, asked: Outage) -> Result<Outage, OutageError> {
        let (start_s, end_s) = self.span_s;
        // clocks and people round to a microsecond
        if asked.start_s < start_s - 1e-6 || asked.start_s >= end_s {
            let span_s = self.span_s;
            return Err(OutageError::Outside { asked, span_s, fixes: self.described() });
        }
        let placed = Outage { end_s: asked.end_s.min(end_s), ..asked };
        if self.has_fix_in(&placed) {
            return Ok(placed);
        }
        Err(OutageError::NoFix { asked, fixes: self.described() })
    }
}

/// An outage that is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OutageError {
    /// A value that no data could have.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// One asked for by its times that begins before the data or after them.
    #[error("outage {}:{} does not lie on the data, which last from {} to {} s", .asked.start_s, .asked.end_s, .span_s.0, .span_s.1)]
    Outside {
        /// As asked for.
        asked: Outage,
        /// Of the data (s).
        span_s: (f64, f64),
        /// The fixes of the data, in words.
        fixes: String,
    },
    /// One asked for by its times into which no fix falls.
    #[error("outage {}:{} withholds no fix", .asked.start_s, .asked.end_s)]
    NoFix {
        /// As asked for.
        asked: Outage,
        /// The fixes of the data, in words.
        fixes: String,
    },
}

impl OutageError {
    /// What to know to correct it.
    #[must_use]
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Setting(_) => None,
            Self::Outside { fixes, .. } | Self::NoFix { fixes, .. } => Some(fixes),
        }
    }
}

/// What became of outages on data that are not as they were asked for.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum OutageRemark {
    /// One asked for is cut where the trajectory ends.
    #[error("outage {}:{} is cut: the trajectory ends at {end_s} s", .asked.start_s, .asked.end_s)]
    Cut {
        /// As asked for.
        asked: Outage,
        /// End of the data (s).
        end_s: f64,
    },
    /// One asked for is cut where the next fix would come.
    #[error("outage {}:{} is cut at {end_s} s: the fixes end at {last_s} s", .asked.start_s, .asked.end_s)]
    CutAfterFixes {
        /// As asked for.
        asked: Outage,
        /// Where it ends (s).
        end_s: f64,
        /// Last fix (s).
        last_s: f64,
    },
    /// Some overlap or touch.
    #[error("outages that overlap or touch are made one")]
    United,
    /// The periodic ones begin after the data.
    #[error("outage_periodic.first_s = {first_s} s: the trajectory ends at {end_s} s")]
    PeriodicTooLate {
        /// Start of the first (s).
        first_s: f64,
        /// End of the data (s).
        end_s: f64,
    },
    /// A default one is cut.
    #[error("the default outage {}:{} is cut: the trajectory lasts from {} to {} s", .default.start_s, .default.end_s, .span_s.0, .span_s.1)]
    DefaultCut {
        /// As it would be.
        default: Outage,
        /// Of the data (s).
        span_s: (f64, f64),
    },
    /// A default one lies outside.
    #[error("the default outage {}:{} is left out: the trajectory lasts from {} to {} s", .default.start_s, .default.end_s, .span_s.0, .span_s.1)]
    DefaultLeftOut {
        /// As it would be.
        default: Outage,
        /// Of the data (s).
        span_s: (f64, f64),
    },
}

/// Outages as they are on data.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlacedOutages {
    /// In time order, apart from one another.
    pub windows: Vec<Outage>,
    /// Where they are not what was asked for.
    pub remarks: Vec<OutageRemark>,
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

/// What is asked for: the union of all kinds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OutagePlan {
    /// Windows asked for by their times: they must lie on the data.
    pub fixed: Vec<Outage>,
    /// Windows that nobody asked for: cut or left out where the data are shorter.
    pub default: Vec<Outage>,
    /// Regular ones.
    pub periodic: Option<PeriodicOutages>,
    /// Random ones.
    pub random: Option<RandomOutages>,
}

impl OutagePlan {
    /// Checks every value.
    ///
    /// # Errors
    /// The key whose value is refused.
    pub fn validate(&self) -> Result<(), SettingError> {
        for (i, outage) in self.fixed.iter().enumerate() {
            outage.validate().map_err(|e| e.in_section(&format!("outage[{}]", i + 1)))?;
        }
        if let Some(periodic) = &self.periodic {
            periodic.validate().map_err(|e| e.in_section("outage_periodic"))?;
        }
        if let Some(random) = &self.random {
            random.validate().map_err(|e| e.in_section("outage_random"))?;
        }
        Ok(())
    }

    /// The outages on data: windows asked for must begin on them and withhold a fix, and are cut where the data
    /// end; of all other kinds, what lies on the data remains.
    ///
    /// ```
    /// use nav_sim_navigation::sensors::outage::{FixedData, Fixes, Outage, OutagePlan};
    ///
    /// let data = FixedData { span_s: (0.0, 60.0), fixes: Fixes::Every { interval_s: 1.0 } };
    /// let plan = |start_s, end_s| OutagePlan {
    ///     fixed: vec![Outage { start_s, end_s }],
    ///     ..OutagePlan::default()
    /// };
    /// let placed = plan(50.0, 70.0).on(&data, 1)?;
    /// assert_eq!(placed.windows, [Outage { start_s: 50.0, end_s: 60.0 }]);
    /// assert_eq!(placed.remarks[0].to_string(), "outage 50:70 is cut: the trajectory ends at 60 s");
    /// assert!(plan(70.0, 90.0).on(&data, 1).is_err());
    /// # Ok::<(), nav_sim_navigation::sensors::outage::OutageError>(())
    /// ```
    ///
    /// # Errors
    /// A value that is refused, or a window asked for that does not lie on the data.
    pub fn on(&self, data: &FixedData<'_>, seed: u64) -> Result<PlacedOutages, OutageError> {
        self.validate()?;
        let (start_s, end_s) = data.span_s;
        let mut remarks = Vec::new();
        for asked in &self.fixed {
            if data.place(*asked)? != *asked {
                remarks.push(match data.fixes {
                    Fixes::At([.., last_s]) => {
                        OutageRemark::CutAfterFixes { asked: *asked, end_s, last_s: *last_s }
                    }
                    _ => OutageRemark::Cut { asked: *asked, end_s },
                });
            }
        }
        let windows = self.windows(data.span_s, seed)?;
        if self.fixed.len() > windows.len() {
            remarks.push(OutageRemark::United);
        }
        if let Some(first_s) = self.periodic.map(|p| p.first_s).filter(|first_s| *first_s >= end_s) {
            remarks.push(OutageRemark::PeriodicTooLate { first_s, end_s });
        }
        for default in self.default.iter().copied() {
            if default.end_s <= start_s || default.start_s >= end_s {
                remarks.push(OutageRemark::DefaultLeftOut { default, span_s: data.span_s });
            } else if default.start_s < start_s || default.end_s > end_s {
                remarks.push(OutageRemark::DefaultCut { default, span_s: data.span_s });
            }
        }
        Ok(PlacedOutages { windows, remarks })
    }

    /// The windows on data that last from `span_s.0` to `span_s.1`: in time order, those that overlap or touch
    /// made one, cut at the ends, those outside left out.
    fn windows(&self, span_s: (f64, f64), seed: u64) -> Result<Vec<Outage>, SettingError> {
        let mut all: Vec<Outage> = self.fixed.iter().chain(&self.default).copied().collect();
        all.extend(self.periodic.iter().flat_map(|periodic| periodic.windows(span_s)));
        if let Some(random) = &self.random {
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
        assert_eq!(
            [299.0, 300.0 - 1e-10, 300.0, 389.0, 390.0].map(|t| o.withholds(t)),
            [false, true, true, true, false]
        );
    }

    #[test]
    fn kinds_are_united_in_time_order() {
        let plan = OutagePlan {
            fixed: vec![outage(50.0, 70.0), outage(10.0, 20.0), outage(95.0, 300.0)],
            periodic: Some(PeriodicOutages { first_s: 15.0, every_s: 40.0, duration_s: 10.0 }),
            ..OutagePlan::default()
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
        let recorded = FixedData::recorded(&fixes);
        assert_eq!(recorded.span_s, (0.0, 5.0));
        let regular = FixedData { span_s: (0.0, 5.0), fixes: Fixes::Every { interval_s: 1.0 } };
        for data in [recorded, regular] {
            let place = |a, b| data.place(outage(a, b));
            assert_eq!(place(2.0, 3.0), Ok(outage(2.0, 3.0)));
            assert_eq!(place(3.5, 9.0), Ok(outage(3.5, 5.0)));
            assert_eq!(place(0.0, 1.5), Ok(outage(0.0, 1.5)));
            for (a, b) in [(2.1, 2.9), (0.0, 1.0), (2.0 + 1e-5, 3.0)] {
                assert!(matches!(place(a, b), Err(OutageError::NoFix { .. })), "{a}:{b}");
            }
            assert!(matches!(place(-1.0, 3.0), Err(OutageError::Outside { .. })));
            let e = place(5.0, 9.0).unwrap_err();
            assert_eq!(e.to_string(), "outage 5:9 does not lie on the data, which last from 0 to 5 s");
        }
        let hints =
            [recorded, regular].map(|d| d.place(outage(5.0, 9.0)).unwrap_err().hint().map(str::to_owned));
        let expected = ["the fixes run from 1 to 4 s", "fixes come every 1 s from 0 s"];
        assert_eq!(hints, expected.map(|hint| Some(hint.to_owned())));
    }

    /// What was asked for is refused where what is there by default is cut or left out.
    #[test]
    fn default_outages_are_cut_and_that_is_said() {
        let data = FixedData { span_s: (0.0, 720.0), fixes: Fixes::Every { interval_s: 1.0 } };
        let late = outage(800.0, 810.0);
        let default = [Outage::PAPER.to_vec(), vec![late]].concat();
        let placed = OutagePlan { default, ..OutagePlan::default() }.on(&data, 1).unwrap();
        assert_eq!(placed.windows, [outage(300.0, 390.0), outage(700.0, 720.0)]);
        let span_s = data.span_s;
        let expected = [
            OutageRemark::DefaultCut { default: Outage::PAPER[1], span_s },
            OutageRemark::DefaultLeftOut { default: late, span_s },
        ];
        assert_eq!(placed.remarks, expected);
        let asked = OutagePlan { fixed: vec![late], ..OutagePlan::default() };
        assert!(asked.on(&data, 1).is_err());
    }

    #[test]
    fn outages_that_are_not_as_asked_for_are_remarked() {
        let remarks =
            |plan: OutagePlan, fixes| plan.on(&FixedData { span_s: (0.0, 100.0), fixes }, 1).unwrap().remarks;
        let plan = OutagePlan {
            fixed: vec![outage(10.0, 20.0), outage(20.0, 30.0), outage(90.0, 300.0)],
            periodic: Some(PeriodicOutages { first_s: 100.0, every_s: 40.0, duration_s: 10.0 }),
            ..OutagePlan::default()
        };
        let common = [OutageRemark::United, OutageRemark::PeriodicTooLate { first_s: 100.0, end_s: 100.0 }];
        let asked = outage(90.0, 300.0);
        let found = remarks(plan.clone(), Fixes::Every { interval_s: 1.0 });
        assert_eq!(found[0], OutageRemark::Cut { asked, end_s: 100.0 });
        assert_eq!(found[1..], common);
        let found = remarks(plan, Fixes::At(&[10.0, 20.0, 95.0]));
        assert_eq!(found[0], OutageRemark::CutAfterFixes { asked, end_s: 100.0, last_s: 95.0 });
        assert_eq!(found[1..], common);
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
        let refused = |plan: &OutagePlan| plan.validate().unwrap_err().key;
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
