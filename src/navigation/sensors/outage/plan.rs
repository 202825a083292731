//! What outages are asked for, and the one rule of runs, studies and fusions that places them on data.

use super::{
    FixedData, Fixes, Outage, OutageError, OutageRemark, PeriodicOutages, PlacedOutages,
    RandomOutages,
};
use crate::units::SettingError;

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
            random
                .validate()
                .map_err(|e| e.in_section("outage_random"))?;
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
                    Fixes::At([.., last_s]) => OutageRemark::CutAfterFixes {
                        asked: *asked,
                        end_s,
                        last_s: *last_s,
                    },
                    _ => OutageRemark::Cut {
                        asked: *asked,
                        end_s,
                    },
                });
            }
        }
        let windows = self.windows(data.span_s, seed)?;
        // Every fixed window lies on the data by now: fewer windows than were asked for can only come of a
        // union.
        if self.fixed.len() > windows.len() {
            remarks.push(OutageRemark::United);
        }
        if let Some(first_s) = self
            .periodic
            .map(|p| p.first_s)
            .filter(|first_s| *first_s >= end_s)
        {
            remarks.push(OutageRemark::PeriodicTooLate { first_s, end_s });
        }
        for default in self.default.iter().copied() {
            if default.end_s <= start_s || default.start_s >= end_s {
                remarks.push(OutageRemark::DefaultLeftOut {
                    default,
                    span_s: data.span_s,
                });
            } else if default.start_s < start_s || default.end_s > end_s {
                remarks.push(OutageRemark::DefaultCut {
                    default,
                    span_s: data.span_s,
                });
            }
        }
        Ok(PlacedOutages { windows, remarks })
    }

    /// The windows on data that last from `span_s.0` to `span_s.1`: in time order, those that overlap or touch
    /// made one, cut at the ends, those outside left out.
    pub(super) fn windows(
        &self,
        span_s: (f64, f64),
        seed: u64,
    ) -> Result<Vec<Outage>, SettingError> {
        let mut all: Vec<Outage> = self.fixed.iter().chain(&self.default).copied().collect();
        all.extend(
            self.periodic
                .iter()
                .flat_map(|periodic| periodic.windows(span_s)),
        );
        if let Some(random) = &self.random {
            all.extend(
                random
                    .windows(span_s, seed)
                    .map_err(|e| e.in_section("outage_random"))?,
            );
        }
        Ok(united(all, span_s))
    }
}

fn united(mut windows: Vec<Outage>, (start_s, end_s): (f64, f64)) -> Vec<Outage> {
    windows.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    let mut united: Vec<Outage> = Vec::new();
    for window in windows {
        let cut = Outage {
            start_s: window.start_s.max(start_s),
            end_s: window.end_s.min(end_s),
        };
        match united.last_mut() {
            _ if cut.start_s >= cut.end_s => {}
            // Touching counts as overlapping: the first fix after the one is the first that the other
            // withholds.
            Some(last) if cut.start_s <= last.end_s => last.end_s = last.end_s.max(cut.end_s),
            _ => united.push(cut),
        }
    }
    united
}
