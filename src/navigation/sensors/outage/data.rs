//! The data that outages are placed on, and what becomes of them there.

use super::Outage;
use crate::units::SettingError;

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
                // The last fix before the outage and the first after its start, which rounding may exchange; at the
                // earliest one interval after the start of the data: there is no fix at the start itself.
                let last = ((outage.start_s - self.span_s.0) / interval_s)
                    .floor()
                    .max(1.0);
                [last, last + 1.0]
                    .iter()
                    .any(|k| outage.withholds(self.span_s.0 + k * interval_s))
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
    pub(super) fn place(&self, asked: Outage) -> Result<Outage, OutageError> {
        let (start_s, end_s) = self.span_s;
        // clocks and people round to a microsecond
        if asked.start_s < start_s - 1e-6 || asked.start_s >= end_s {
            let span_s = self.span_s;
            return Err(OutageError::Outside {
                asked,
                span_s,
                fixes: self.described(),
            });
        }
        let placed = Outage {
            end_s: asked.end_s.min(end_s),
            ..asked
        };
        if self.has_fix_in(&placed) {
            return Ok(placed);
        }
        Err(OutageError::NoFix {
            asked,
            fixes: self.described(),
        })
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
