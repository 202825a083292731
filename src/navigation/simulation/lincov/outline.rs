//! Tracks of fewer and longer steps, for the many passes of a search.

use super::input::SIGNALS;
use super::joint::add_scaled;
use super::track::{Mark, Measured, NAV, Nav, Row, Step, Track};
use crate::simulation::BIASES;

/// Longest step of an outline (s): with fixes, and without.
const OUTLINE_STEP_S: [f64; 2] = [2.0, 5.0];
/// Time between two reports of an outline (s).
const REPORT_S: f64 = 10.0;

impl Track {
    /// As [`Self::merged`], with a report every ten, and white noise through its mean over a step as well: a tenth faster
    /// for the hundreds of passes of a search, and within 1e-3 in every ratio.
    #[must_use]
    pub fn coarse(&self) -> Self {
        let mut track = self.with_legs(Step::of_means);
        let mut reports = 0;
        for mark in &mut track.marks {
            reports += usize::from(mark.report);
            // One report in ten: reports enter the cost of a search as an average, and errors change slowly.
            mark.report &= reports % 10 == 0;
        }
        track
    }

    /// The same with one step from mark to mark, at most a second: a few times faster. White noise is exact; a bias is
    /// its mean over the step, which leaves up to 1e-4 of an error after ten seconds without fixes, 1.2e-3 after five.
    #[must_use]
    pub fn merged(&self) -> Self {
        self.with_legs(Step::then)
    }

    /// One step from mark to mark, of which each follows another by `joined`.
    fn with_legs(&self, joined: impl Fn(&Step, &Step) -> Step) -> Self {
        let (mut steps, mut marks, mut done) = (Vec::new(), self.marks.clone(), 0);
        for mark in &mut marks {
            // Between marks alone: no step may reach over a measurement.
            let leg = &self.steps[done..mark.steps];
            if let Some((first, rest)) = leg.split_first() {
                steps.push(
                    rest.iter()
                        .fold(first.clone(), |step, next| joined(&step, next)),
                );
            }
            (done, mark.steps) = (mark.steps, steps.len());
        }
        Self {
            steps,
            marks,
            outages: self.outages,
            start: self.start,
            perfect: self.perfect,
        }
    }

    /// The drive in half of the steps or fewer: what the search for a reduction passes along. Several fixes are one of their
    /// mean at the last of them.
    #[must_use]
    pub(super) fn outline(&self) -> Self {
        let last_fixes = self.last_fixes();
        let (mut steps, mut marks, mut block) = (Vec::new(), Vec::new(), Block::default());
        let mut report_s = f64::NEG_INFINITY;
        for (i, (leg, mark)) in self.legs(0..self.marks.len()).enumerate() {
            block.add(
                leg,
                mark,
                i.checked_sub(1)
                    .map_or(0.0, |before| self.marks[before].after_s),
            );
            let next = self.marks.get(i + 1).filter(|next| next.outages.is_empty());
            // An outage begins with its first missing fix and ends with the first fix after it, no step later.
            let is_bound = !mark.outages.is_empty() || last_fixes.contains(&i);
            if !is_bound && next.is_some_and(|next| block.has_room_until(next.after_s)) {
                continue;
            }
            let Block { step, measured, .. } = std::mem::take(&mut block);
            steps.extend(step);
            let report = mark.after_s - report_s >= REPORT_S - SLACK_S;
            report_s = if report { mark.after_s } else { report_s };
            let rows = measured.into_iter().flat_map(Together::mean).collect();
            marks.push(Mark {
                steps: steps.len(),
                rows,
                report,
                ..mark.clone()
            });
        }
        Self {
            steps,
            marks,
            outages: self.outages,
            start: self.start,
            perfect: self.perfect,
        }
    }

    /// Marks whose fix is followed by a gap.
    fn last_fixes(&self) -> Vec<usize> {
        let fixes: Vec<usize> = (0..self.marks.len())
            .filter(|i| self.marks[*i].fix)
            .collect();
        let gap_s = |pair: &[usize]| self.marks[pair[1]].after_s - self.marks[pair[0]].after_s;
        let interval_s = fixes.windows(2).map(gap_s).fold(f64::INFINITY, f64::min);
        fixes
            .windows(2)
            .filter(|pair| gap_s(pair) > 1.5 * interval_s)
            .map(|pair| pair[0])
            .collect()
    }
}

/// Times of marks are sums of samples: this much apart they are the same (s).
const SLACK_S: f64 = 1e-6;

/// Steps and measurements that become one of each.
#[derive(Default)]
struct Block {
    begin_s: f64,
    step: Option<Step>,
    /// By kind, fixes first.
    measured: [Together; Measured::KINDS],
}

impl Block {
    /// Adds a mark with the steps that lead to it from `before_s`.
    fn add(&mut self, leg: &[Step], mark: &Mark, before_s: f64) {
        if self.step.is_none() {
            self.begin_s = before_s;
        }
        self.step = self
            .step
            .take()
            .into_iter()
            .chain(leg.iter().cloned())
            .reduce(|a, b| a.of_means(&b));
        for (kind, together) in self.measured.iter_mut().enumerate() {
            together.add(
                mark.rows
                    .iter()
                    .filter(|row| row.what.kind() == kind)
                    .copied()
                    .collect(),
            );
        }
    }

    fn has_room_until(&self, after_s: f64) -> bool {
        after_s - self.begin_s <= OUTLINE_STEP_S[usize::from(self.measured[0].count == 0)] + SLACK_S
    }
}

/// Measurements of one kind, taken at the last of them.
#[derive(Default)]
struct Together {
    rows: Vec<Row>,
    count: u32,
}

impl Together {
    fn add(&mut self, rows: Vec<Row>) {
        if !rows.is_empty() {
            (self.rows, self.count) = (rows, self.count + 1);
        }
    }

    /// One measurement of the mean of their noise.
    fn mean(self) -> impl Iterator<Item = Row> {
        let count = f64::from(self.count);
        self.rows.into_iter().map(move |row| Row {
            r: row.r / count,
            noise: row.noise / count,
            ..row
        })
    }
}

impl Step {
    /// This step and then another, as one.
    fn then(&self, next: &Self) -> Self {
        let none = [0.0; SIGNALS];
        // White noise of the two parts is independent: through the mean of a second it would move a position by
        // a quarter of T³ where it is a third.
        let mut white = self.white_noise();
        for (sum, more) in white.iter_mut().zip(next.white_noise()) {
            let carried = sum.map(|column| next.map(&column, &none));
            for (i, more) in more.iter().enumerate() {
                // Symmetric: the rows of a carried covariance are its columns.
                sum[i] = next.map(&carried.map(|column| column[i]), &none);
                add_scaled(&mut sum[i], 1.0, more);
            }
        }
        Self {
            white,
            ..self.of_means(next)
        }
    }

    /// Its `white`, whether it is there or follows from the mean over the step.
    fn white_noise(&self) -> Vec<[Nav; NAV]> {
        let of_mean = |b: &Nav| b.map(|factor| b.map(|b| b * factor / f64::from(self.samples)));
        if self.white.is_empty() {
            self.b[..BIASES].iter().map(of_mean).collect()
        } else {
            self.white.clone()
        }
    }

    /// The same with white noise through its mean over the step, as that of a bias.
    fn of_means(&self, next: &Self) -> Self {
        let none = [0.0; SIGNALS];
        let mut b: Vec<Nav> = self
            .b
            .iter()
            .map(|column| next.map(column, &none))
            .collect();
        for (sum, column) in b.iter_mut().flatten().zip(next.b.iter().flatten()) {
            // The response to a constant input: that of the first part, carried through the second, and that
            // of the second.
            *sum += column;
        }
        let m = self.m.map(|column| next.map(&column, &none));
        Self {
            samples: self.samples + next.samples,
            m,
            b,
            white: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::noise::Model;
    use crate::scenario::Scenario;
    use crate::sensors::outage::Outage;
    use crate::trajectory::profile::{Bank, Kind, Length, Profile, Segment, Start};

    /// A step covers two seconds or five, and every outage begins and ends where it did.
    #[test]
    fn an_outline_is_half_of_the_drive() {
        let outline = |duration_s: f64| {
            let north = Segment {
                kind: Kind::Straight(Length::Duration(duration_s)),
                climb_m: 0.0,
                ramp_s: None,
            };
            let start = Start {
                t_s: 0.0,
                lat: 0.9,
                lon: 0.2,
                h: 0.0,
                heading: 0.0,
                speed: 20.0,
            };
            let drive = Profile {
                start,
                bank: Bank::None,
                ramp_s: 2.0,
                segments: vec![north],
            }
            .build()
            .unwrap();
            let mut scenario = Scenario::default();
            scenario.imu.rate_hz = 10.0;
            let silent = Model {
                rate_hz: 10.0,
                axes: Default::default(),
            };
            let outages = [Outage {
                start_s: 600.0,
                end_s: 663.0,
            }];
            let track = scenario.track(&drive, &silent, &outages).unwrap().outline();
            let end = track
                .marks
                .iter()
                .position(|mark| !mark.outages.is_empty())
                .unwrap();
            let [.., last_fix, _] = track.marks[..end]
                .iter()
                .filter(|m| !m.rows.is_empty() || m.after_s > 600.0)
                .collect::<Vec<_>>()[..]
            else {
                panic!()
            };
            assert_eq!(track.marks[end].after_s, 663.0);
            assert!(last_fix.after_s > 600.0 && last_fix.rows.is_empty());
            assert!(
                track
                    .marks
                    .iter()
                    .any(|mark| mark.after_s == 599.0 && !mark.rows.is_empty())
            );
            track.steps.len()
        };
        assert!(outline(1200.0) < 620 && outline(3600.0) < 1820);
    }
}
