//! When GNSS is missing: fixed windows, periodic ones, random ones.
//!
//! A fix at t is missing when start ≤ t < end of any outage. Times are on the trajectory's own clock.

use crate::rng::StreamKey;
use crate::units::{Positive, Refused, SettingError};
use rand_distr::{Distribution, Exp};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
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

/// Largest difference between a typed time and the same time as a multiple of 1/rate (s): times of
/// days, 1e5 s, are rounded to 1.5e-11 s, so that some tens of roundings are less, and no two
/// samples are as near.
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

    /// Returns true if a fix at `t_s` is missing.
    pub fn withholds(&self, t_s: f64) -> bool {
        self.start_s <= t_s + SLACK_S && !self.is_over(t_s)
    }

    /// True if any of the outages withholds a fix at `t_s`.
    pub fn any_withholds(outages: &[Self], t_s: f64) -> bool {
        outages.iter().any(|outage| outage.withholds(t_s))
    }

    /// The instant of the first fix after it, of all instants in time order with their fixes; the last one where none
    /// follows.
    pub(crate) fn end_among(
        &self,
        mut instants: impl ExactSizeIterator<Item = (f64, bool)>,
    ) -> usize {
        let last = instants.len() - 1;
        let first_fix = instants.position(|(t_s, is_fix)| is_fix && self.is_over(t_s));
        first_fix.unwrap_or(last)
    }

    /// True if a fix at `t_s` comes after it.
    pub(crate) fn is_over(&self, t_s: f64) -> bool {
        self.end_s <= t_s + SLACK_S
    }

    /// Checks that it is finite and lasts.
    ///
    /// # Errors
    /// The key whose value is refused.
    fn validate(&self) -> Result<(), SettingError> {
        super::check_bounds(self)?;
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

impl fmt::Display for Outage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.start_s, self.end_s)
    }
}

impl FromStr for Outage {
    type Err = Refused;

    /// `START:END` or `START:+DURATION`, in seconds.
    fn from_str(text: &str) -> Result<Self, Refused> {
        let form = || Refused("expected START:END in seconds, such as 300:390".to_owned());
        let time = |text: &str| text.trim().parse::<f64>().map_err(|_| form());
        let (start, end) = text.split_once(':').ok_or_else(form)?;
        let start_s = time(start)?;
        let end_s = match end.trim().strip_prefix('+') {
            Some(duration) => start_s + time(duration)?,
            None => time(end)?,
        };
        let outage = Self { start_s, end_s };
        match outage.validate() {
            Ok(()) => Ok(outage),
            Err(e) => Err(Refused(e.to_string())),
        }
    }
}

// The data that outages are placed on, and what becomes of them there.

/// When fixes come.
#[derive(Debug, Clone, Copy)]
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
#[derive(Debug, Clone, Copy)]
pub struct FixedData<'a> {
    /// From when to when they last (s).
    pub span_s: (f64, f64),
    /// Their fixes.
    pub fixes: Fixes<'a>,
}

impl<'a> FixedData<'a> {
    /// Recorded fixes at these times (s): an outage may last until a fix later than the last would come, and
    /// begin as early before the first.
    pub fn recorded(times_s: &'a [f64]) -> Self {
        let interval_s = times_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let (first, last) = times_s
            .first()
            .zip(times_s.last())
            .map_or((0.0, 0.0), |(f, l)| (*f, *l));
        Self {
            span_s: (first - interval_s, last + interval_s),
            fixes: Fixes::At(times_s),
        }
    }

    fn has_fix_in(&self, outage: &Outage) -> bool {
        match self.fixes {
            Fixes::Every { interval_s } => {
                let (start_s, end_s) = self.span_s;
                let before = ((outage.start_s - start_s) / interval_s).floor().max(0.0);
                // there is no fix at the start itself
                let numbers = [before.max(1.0), before + 1.0];
                let mut times = numbers.map(|k| start_s + k * interval_s).into_iter();
                times.any(|t_s| t_s <= end_s + SLACK_S && outage.withholds(t_s))
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

    /// A window cut where the data end: one that lasts longer withholds a fix at their very end.
    fn cut(&self, window: Outage) -> Outage {
        let (start_s, end_s) = self.span_s;
        let next_s = match self.fixes {
            Fixes::Every { interval_s } => end_s + interval_s,
            Fixes::At(_) => end_s,
        };
        Outage {
            start_s: window.start_s.max(start_s),
            end_s: window.end_s.min(next_s),
        }
    }

    /// Checks that an outage requested by its times begins on the data and withholds a fix.
    fn check(&self, asked: Outage) -> Result<(), OutageError> {
        let (start_s, end_s) = self.span_s;
        let refused = |reason: String, fixes: String| {
            Err(OutageError::Placed {
                message: format!("outage {asked} {reason}"),
                fixes,
            })
        };
        // clocks and people round to a microsecond
        if asked.start_s < start_s - 1e-6 || asked.start_s >= end_s {
            let off = "does not lie on the data, which last";
            return refused(
                format!("{off} from {start_s} to {end_s} s"),
                format!(
                    "{}: begin it between {start_s} and {end_s} s",
                    self.described()
                ),
            );
        }
        if self.has_fix_in(&asked) {
            return Ok(());
        }
        refused("withholds no fix".to_owned(), self.described())
    }
}

/// An outage that is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OutageError {
    /// A value that no data could have.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// One requested by its times that begins off the data, or into which no fix falls.
    #[error("{message}")]
    Placed {
        /// The refusal.
        message: String,
        /// The fixes of the data, in words, with what helps.
        fixes: String,
    },
}

impl OutageError {
    /// Hint for correcting it.
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Setting(_) => None,
            Self::Placed { fixes, .. } => Some(fixes),
        }
    }
}

/// Outages as they are on data.
#[derive(Debug, Clone)]
pub struct PlacedOutages {
    /// In time order: each withholds a fix, and there is one between any two.
    pub windows: Vec<Outage>,
    /// Remarks on outages that differ from the request.
    pub remarks: Vec<String>,
}

// Outages at regular and at random times.

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
    fn validate(&self) -> Result<(), SettingError> {
        super::check_bounds(self)?;
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

    fn windows(&self, (from_s, end_s): (f64, f64)) -> Vec<Outage> {
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

    fn windows(&self, (start_s, end_s): (f64, f64), seed: u64) -> Vec<Outage> {
        let waiting = Exp::new(self.rate_per_hour / 3600.0).expect("a rate > 0");
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
        windows
    }
}

// What outages are requested, and the one rule of runs, studies and fusions that places them on data.

/// Requested outages: the union of all kinds.
#[derive(Debug, Clone, Default)]
pub struct OutagePlan {
    /// Windows requested by their times: they must lie on the data.
    pub fixed: Vec<Outage>,
    /// Windows that nobody requested: cut or left out where the data are shorter.
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
            outage
                .validate()
                .map_err(|e| e.in_section(&format!("outage[{}]", i + 1)))?;
        }
        if let Some(periodic) = &self.periodic {
            periodic
                .validate()
                .map_err(|e| e.in_section("outage_periodic"))?;
        }
        if let Some(random) = &self.random {
            super::check_bounds(random).map_err(|e| e.in_section("outage_random"))?;
        }
        Ok(())
    }

    /// The outages on data: windows requested must begin on them and withhold a fix, and are cut where the data
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
    /// assert_eq!(placed.windows, [Outage { start_s: 50.0, end_s: 61.0 }]);
    /// assert_eq!(placed.remarks[0], "outage 50:70 is cut: the trajectory ends at 60 s");
    /// assert!(plan(70.0, 90.0).on(&data, 1).is_err());
    /// # Ok::<(), nav_sim_navigation::sensors::outage::OutageError>(())
    /// ```
    ///
    /// # Errors
    /// A value that is refused, or a window requested that does not lie on the data.
    pub fn on(&self, data: &FixedData<'_>, seed: u64) -> Result<PlacedOutages, OutageError> {
        self.validate()?;
        let (start_s, end_s) = data.span_s;
        let mut remarks = Vec::new();
        for asked in &self.fixed {
            data.check(*asked)?;
            if asked.end_s > end_s {
                remarks.push(match data.fixes {
                    Fixes::At([.., last]) => {
                        format!("outage {asked} is cut at {end_s} s: the fixes end at {last} s")
                    }
                    _ => format!("outage {asked} is cut: the trajectory ends at {end_s} s"),
                });
            }
        }
        let windows = self.windows(data, seed);
        // Every fixed window withholds a fix: fewer windows than were requested can only come of a union.
        if self.fixed.len() > windows.len() {
            remarks.push("outages without a fix between them are merged".to_owned());
        }
        if let Some(first_s) = self
            .periodic
            .map(|p| p.first_s)
            .filter(|first_s| *first_s >= end_s)
        {
            remarks.push(format!(
                "outage_periodic.first_s = {first_s} s: the trajectory ends at {end_s} s"
            ));
        }
        for default in self.default.iter().copied() {
            let what = if default.end_s <= start_s || default.start_s >= end_s {
                "left out"
            } else if default.start_s < start_s || default.end_s > end_s {
                "cut"
            } else {
                continue;
            };
            remarks.push(format!(
                "the default outage {default} is {what}: the trajectory lasts from {start_s} to {end_s} s"
            ));
        }
        Ok(PlacedOutages { windows, remarks })
    }

    /// The windows on data in time order, cut at the ends: those that withhold no fix left out, those without a fix
    /// between them made one.
    fn windows(&self, data: &FixedData<'_>, seed: u64) -> Vec<Outage> {
        let fixed = self.fixed.iter().chain(&self.default).copied();
        let periodic = self.periodic.iter().flat_map(|p| p.windows(data.span_s));
        let random = self
            .random
            .iter()
            .flat_map(|r| r.windows(data.span_s, seed));
        let all = fixed.chain(periodic).chain(random);
        let mut windows: Vec<Outage> = all
            .filter(|window| window.start_s < data.span_s.1)
            .map(|window| data.cut(window))
            .filter(|window| data.has_fix_in(window))
            .collect();
        windows.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        windows.dedup_by(|next, last| {
            let is_one = !data.has_fix_in(&Outage {
                start_s: last.end_s,
                end_s: next.start_s,
            });
            if is_one {
                last.end_s = last.end_s.max(next.end_s);
            }
            is_one
        });
        windows
    }
}

#[cfg(test)]
#[path = "outage_tests.rs"]
mod outage_tests;
