//! Fixes that are left out as outliers: those whose NIS a right filter exceeds once in this many fixes.
//!
//! The gate is open at the start and after a gap, where a large NIS may be the solution's, until a fix is as stated. A run
//! of rejections opens it again: then it is the solution that is wrong.

use super::interval_s;
use super::outcome::APART;
use crate::gnss::GnssFix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Level of the gate: a right filter rejects one fix in 10 000.
pub const GATE_LEVEL: f64 = 0.9999;
/// Rejections in a row, and how long they last (s), that are no chance and no reflections beside a building: the filter's own
/// uncertainty has grown meanwhile.
const RUN: (usize, f64) = (10, 30.0);

/// The gate during a run of the filter.
#[derive(Debug)]
pub(super) struct Gate {
    level: Option<f64>,
    apart_s: f64,
    last_s: f64,
    is_open: bool,
    rejected: usize,
    since_s: f64,
}

/// Fate of a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum GateDecision {
    /// It is used.
    Used,
    /// It is used, since those before it were rejected for too long.
    Reopened,
    /// It is left out, its NIS being above this.
    Rejected(f64),
}

impl Gate {
    /// A gate of this level; none lets everything pass.
    pub(super) fn new(level: Option<f64>, gnss: &[GnssFix]) -> Self {
        Self {
            level,
            apart_s: APART.0.max(APART.1 * interval_s(gnss).unwrap_or(0.0)),
            last_s: f64::NEG_INFINITY,
            is_open: true,
            rejected: 0,
            since_s: 0.0,
        }
    }

    /// The NIS of so many components above which a fix is no more as stated.
    pub(super) fn bound(level: Option<f64>, components: usize) -> f64 {
        let chi_square = level.zip(ChiSquared::new(components as f64).ok());
        chi_square.map_or(f64::INFINITY, |(level, of)| of.inverse_cdf(level))
    }

    /// Decides on the next fix.
    pub(super) fn pass(&mut self, t_s: f64, nis: f64, components: usize) -> GateDecision {
        let bound = Self::bound(self.level, components);
        self.is_open |= t_s - self.last_s > self.apart_s;
        self.last_s = t_s;
        if nis <= bound {
            (self.is_open, self.rejected) = (false, 0);
            return GateDecision::Used;
        }
        if self.is_open {
            return GateDecision::Used;
        }
        if self.rejected == 0 {
            self.since_s = t_s;
        }
        if self.rejected >= RUN.0 && t_s - self.since_s >= RUN.1 {
            (self.is_open, self.rejected) = (true, 0);
            return GateDecision::Reopened;
        }
        self.rejected += 1;
        GateDecision::Rejected(bound)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fates(nis: impl IntoIterator<Item = (f64, f64)>) -> Vec<GateDecision> {
        let mut gate = Gate::new(Some(GATE_LEVEL), &[]);
        nis.into_iter()
            .map(|(t_s, nis)| gate.pass(t_s, nis, 3))
            .collect()
    }

    /// 21.1 is exceeded by a chi-square of three degrees once in 10 000.
    #[test]
    fn a_jump_is_rejected_and_one_after_the_start_or_a_gap_is_not() {
        let of = fates([
            (0.0, 50.0),
            (1.0, 21.0),
            (2.0, 21.2),
            (3.0, 1.0),
            (14.0, 50.0),
            (15.0, 50.0),
            (16.0, 2.0),
            (17.0, 50.0),
        ]);
        let is_rejected: Vec<bool> = of
            .iter()
            .map(
                |fate| matches!(fate, GateDecision::Rejected(bound) if (bound - 21.1).abs() < 0.05),
            )
            .collect();
        let expected = [false, false, true, false, false, false, false, true];
        assert_eq!(is_rejected, expected, "{of:?}");
    }

    #[test]
    fn a_run_of_rejections_opens_the_gate_until_a_fix_is_as_stated() {
        let far = (1..=40).map(|k| (f64::from(k), if k == 1 { 1.0 } else { 50.0 }));
        let of = fates(far.chain([(41.0, 3.0), (42.0, 50.0)]));
        let reopened = of.iter().position(|fate| *fate == GateDecision::Reopened);
        assert_eq!(reopened, Some(31));
        assert!(of[32..41].iter().all(|fate| *fate == GateDecision::Used));
        assert!(matches!(of[41], GateDecision::Rejected(_)));
        // ten fixes a second: three seconds, of which there are more than ten fixes, are too short
        let fast = (1..=90).map(|k| (0.1 * f64::from(k), if k == 1 { 1.0 } else { 50.0 }));
        assert!(
            fates(fast)[1..]
                .iter()
                .all(|fate| matches!(fate, GateDecision::Rejected(_)))
        );
    }
}
