//! A recorded trajectory that is only compared with: what jumps is left out.

use super::samples::{Attitude, Rows, follow_path, no_trajectory};
use crate::io::{Failure as Error, Place};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::reference::{Reference, breaks, usable};
use std::ops::Range;

impl Rows {
    /// The stretches of the rows between what no vehicle does, and what is doubtful about them.
    pub(super) fn reference(mut self) -> Result<(Reference, Vec<String>), Error> {
        let found = breaks(&self.samples);
        let mut refused = None;
        let (mut stretches, mut seconds) = (Vec::new(), 0.0);
        for range in usable(&self.samples, &found) {
            match self.stretch(range.clone()) {
                Ok(stretch) => {
                    seconds += stretch.end_s() - stretch.start_s();
                    stretches.push(stretch);
                }
                Err(source) => refused = refused.or(Some(source)),
            }
        }
        let parts = stretches.len();
        let Some(reference) = Reference::of_stretches(stretches) else {
            let whole = self.stretch(0..self.samples.len()).err();
            let none = "no stretch of five seconds without a jump in position or attitude";
            let none = || Error::contents(&self.path, Place::Within, none);
            return Err(refused.or(whole).unwrap_or_else(none));
        };
        if let Some(first) = found.first() {
            let (line, at) = (self.lines[first.index], self.samples[first.index].t_s);
            let other = found.len() - 1;
            let text = format!(
                "{} at {at:.2} s and {other} more: compared with {seconds:.1} s in {parts} stretches",
                first.fault
            );
            self.doubt(Some(line), text);
        } else if let Some(source) = refused {
            self.doubt(None, format!("left out of the comparison: {source}"));
        }
        Ok((reference, self.doubts))
    }

    fn stretch(&self, range: Range<usize>) -> Result<Trajectory, Error> {
        let first = range.start;
        let mut samples = self.samples[range].to_vec();
        if self.attitude == Attitude::OfPath && samples.len() > 1 {
            follow_path(&mut samples);
        }
        Trajectory::from_samples(&samples).map_err(|source| {
            let index = first + source.index().unwrap_or(0);
            let line = self.lines.get(index).copied().unwrap_or(1);
            no_trajectory(&self.path, line, &source)
        })
    }
}
