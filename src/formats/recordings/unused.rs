//! Columns that are not used and yet run like a clock: what is lost would be seen in them.

use super::table::Notes;
use super::text::number;

/// Rows that are looked at, and how few are not enough to tell.
const ROWS: usize = 1000;
const FEWEST: usize = 16;

/// The columns without a meaning of a file without a clock.
pub(super) struct Unused {
    rising: Vec<Rising>,
    rows: usize,
}

/// A column that has risen with every row so far.
struct Rising {
    index: usize,
    last: f64,
    smallest: f64,
    largest: f64,
}

impl Unused {
    pub(super) fn new(indices: impl Iterator<Item = usize>) -> Self {
        let (last, largest) = (f64::NEG_INFINITY, 0.0);
        let rising = indices.map(|index| Rising { index, last, smallest: f64::INFINITY, largest });
        Self { rising: rising.collect(), rows: 0 }
    }

    pub(super) fn look(&mut self, row: &csv::ByteRecord) {
        if self.rows == ROWS || self.rising.is_empty() {
            return;
        }
        let is_first = self.rows == 0;
        self.rows += 1;
        self.rising.retain_mut(|own| {
            let Some(value) = row.get(own.index).and_then(number).filter(|v| v.is_finite()) else {
                return false;
            };
            let step = value - own.last;
            if !is_first {
                (own.smallest, own.largest) = (own.smallest.min(step), own.largest.max(step));
            }
            own.last = value;
            step > 0.0
        });
    }

    /// Warns of those whose steps are alike as those of a clock without gaps are.
    pub(super) fn tell(&self, names: &[String], notes: &mut Notes) {
        let is_even = |own: &&Rising| self.rows >= FEWEST && own.largest <= 1.5 * own.smallest;
        if let Some(own) = self.rising.iter().find(is_even) {
            let name = names[own.index].trim();
            notes.warnings.push(format!(
                "column \"{name}\" rises evenly like a clock, but is not used: gaps in it are not seen; if it is the \
                 time, name it t_s, t_ms, t_us or t_ns (--columns)"
            ));
        }
    }
}
