//! The fixed-interval smoother: every instant, estimated from what was recorded before and after it.
//!
//! [Rauch, Tung and Striebel](crate::bibliography::Rauch65)'s backward recursion, in the form of
//! [Särkkä](crate::bibliography::Sarkka13), sec. 8.2: given the error at the next instant, that at this one is normal,
//! its mean `C` times it and its covariance `D` ([`Link`]). The errors of this filter have mean zero after every
//! update, and are those of its own nominal state there. So what is smoothed is the error of the filter: carried back
//! through a fix by what that took out of the state, through an interval by its link, and taken out of the nominal
//! state where a row is wanted. The filter itself is not changed by a tape that runs along.

use super::filter::Filter;
use super::{FusionError, Row};
use crate::ekf::covariance::PSI;
use crate::ekf::{Ekf, Snapshot};
use crate::linalg::Link;
use crate::trajectory::reference::Reference;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Most memory that a tape may take (bytes).
const MOST_BYTES: f64 = 2e9;

/// What is kept of the way of a filter: an instant for every row and every fix that was used.
pub(super) struct Tape {
    marks: Vec<Mark>,
    /// Covariance at the last mark, after its fix.
    covariance: DMatrix<f64>,
    /// The mark of each row.
    rows: Vec<usize>,
}

/// An instant.
struct Mark {
    t_s: f64,
    /// The filter after the fix.
    after: Snapshot,
    /// What fixes took out of the state.
    correction: Option<DVector<f64>>,
    /// To the next mark.
    link: Option<Link>,
}

impl Mark {
    fn of(ekf: &Ekf, t_s: f64) -> Self {
        Self {
            t_s,
            after: ekf.snapshot(),
            correction: None,
            link: None,
        }
    }
}

impl Tape {
    /// A tape that begins where the filter is, for up to so many marks.
    ///
    /// # Errors
    /// When it would be too large.
    pub(super) fn new(filter: &mut Filter, t_s: f64, marks: f64) -> Result<Self, FusionError> {
        let states = filter.ekf.p.lane(0).nrows();
        let bytes = marks * bytes_of_mark(states as f64);
        if bytes > MOST_BYTES {
            return Err(FusionError::Memory {
                bytes,
                marks,
                states,
            });
        }
        filter.ekf.keep_transition();
        let covariance = filter.ekf.p.lane(0);
        Ok(Self {
            marks: vec![Mark::of(&filter.ekf, t_s)],
            covariance,
            rows: Vec::new(),
        })
    }

    /// Marks where a settled filter is, before a fix or for a row; once for each instant.
    fn mark(&mut self, filter: &mut Filter, t_s: f64) {
        let Some(last) = self.marks.last_mut().filter(|last| last.t_s < t_s) else {
            return;
        };
        let transition = filter.ekf.take_transition();
        let predicted = filter.ekf.p.lane(0);
        last.link = Some(Link::new(&self.covariance, &transition, &predicted));
        self.covariance = predicted;
        self.marks.push(Mark::of(&filter.ekf, t_s));
    }

    /// A row is written here.
    pub(super) fn row(&mut self, filter: &mut Filter, t_s: f64) {
        self.mark(filter, t_s);
        self.rows.push(self.marks.len() - 1);
    }

    /// A fix is used here, by `update`.
    pub(super) fn fix(&mut self, filter: &mut Filter, t_s: f64, update: impl FnOnce(&mut Filter)) {
        self.mark(filter, t_s);
        update(filter);
        let Some(last) = self.marks.last_mut() else {
            return;
        };
        let mut correction = filter.ekf.correction();
        if let Some(earlier) = &last.correction {
            put_back(earlier, &mut correction);
        }
        (last.correction, last.after) = (Some(correction), filter.ekf.snapshot());
        self.covariance = filter.ekf.p.lane(0);
    }

    /// Runs backwards. `filtered` are the rows of the filter, which is used to show the smoothed ones.
    pub(super) fn smoothed(
        self,
        filter: &mut Filter,
        filtered: &[Row],
        reference: Option<&Reference>,
    ) -> Vec<Row> {
        let mut smoothed = filtered.to_vec();
        let mut rows = self.rows.iter().zip(&mut smoothed).rev().peekable();
        let mut p = self.covariance;
        let mut error = DVector::zeros(p.nrows());
        for k in (0..self.marks.len()).rev() {
            let mark = &self.marks[k];
            if let Some(link) = &mark.link {
                if let Some(correction) = &self.marks[k + 1].correction {
                    put_back(correction, &mut error);
                }
                link.back(&mut error, &mut p);
            }
            while let Some((_, row)) = rows.next_if(|(of, _)| **of == k) {
                // at the last mark nothing follows: the filter's own row
                if mark.link.is_some() {
                    filter.ekf.show(&mark.after, &error, &p);
                    *row = filter.row(mark.t_s);
                    row.error = reference.and_then(|r| filter.error_from(r, mark.t_s));
                }
            }
        }
        smoothed
    }
}

/// Bytes of a mark with its link.
fn bytes_of_mark(states: f64) -> f64 {
    8.0 * (states * states + 0.5 * states * (states + 1.0) + 2.0 * states + 32.0)
}

/// The error before a fix took `correction` out of the state, from that after it: rotations compose (to second
/// order), all else adds.
fn put_back(correction: &DVector<f64>, error: &mut DVector<f64>) {
    let psi = |x: &DVector<f64>| DVec3::from_slice(&x.as_slice()[3 * PSI..]);
    let turned = 0.5 * psi(correction).cross(psi(error));
    *error += correction;
    (0..3).for_each(|i| error[3 * PSI + i] += turned[i]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// A rotation after another is that of their product; the rest adds. What is left is of third order: 0.03³.
    #[test]
    fn a_correction_is_put_back_before_the_error_after_it() {
        let (first, then) = (
            DVec3::new(0.02, -0.01, 0.03),
            DVec3::new(-0.015, 0.025, 0.01),
        );
        let state = |psi: DVec3, rest: f64| {
            let mut x = DVector::repeat(15, rest);
            (0..3).for_each(|i| x[3 * PSI + i] = psi[i]);
            x
        };
        let mut error = state(then, 2.0);
        put_back(&state(first, 0.5), &mut error);
        let product =
            (DQuat::from_scaled_axis(first) * DQuat::from_scaled_axis(then)).to_scaled_axis();
        for i in 0..15 {
            match (3 * PSI..3 * PSI + 3).contains(&i) {
                true => assert!(
                    (error[i] - product[i - 3 * PSI]).abs() < 2.7e-5,
                    "{error} {product}"
                ),
                false => assert_eq!(error[i], 2.5),
            }
        }
    }

    /// Numbers of 15 states: a transition, half a symmetric matrix, two vectors, and 32 of the navigation state.
    #[test]
    fn a_mark_is_as_large_as_it_is() {
        assert_eq!(bytes_of_mark(15.0), 8.0 * f64::from(225 + 120 + 30 + 32));
    }
}
