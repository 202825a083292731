//! Columns that are not used and yet run like a clock: what is lost would be seen in them.

use super::table::Notes;
use super::text::number;
use super::timing::median_step;

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
    values: Vec<f64>,
}

impl Rising {
    /// Whether nine of ten steps are alike: the others may be the gaps that the column shows.
    fn is_even(&self) -> bool {
        let step = median_step(&self.values);
        let alike = self.values.windows(2).filter(|w| (0.5..=1.5).contains(&((w[1] - w[0]) / step))).count();
        self.values.len() >= FEWEST && 10 * alike >= 9 * (self.values.len() - 1)
    }
}

impl Unused {
    pub(super) fn new(indices: impl Iterator<Item = usize>) -> Self {
        Self { rising: indices.map(|index| Rising { index, values: Vec::new() }).collect(), rows: 0 }
    }

    pub(super) fn look(&mut self, row: &csv::ByteRecord) {
        if self.rows == ROWS || self.rising.is_empty() {
            return;
        }
        self.rows += 1;
        self.rising.retain_mut(|column| {
            let Some(value) = row.get(column.index).and_then(number).filter(|v| v.is_finite()) else {
                return false;
            };
            let rises = column.values.last().is_none_or(|last| value > *last);
            column.values.push(value);
            rises
        });
    }

    /// Warns of those whose steps are alike as those of a clock are.
    pub(super) fn tell(&self, names: &[String], notes: &mut Notes) {
        if let Some(column) = self.rising.iter().find(|column| column.is_even()) {
            let name = names[column.index].trim();
            notes.warnings.push(format!(
                "column \"{name}\" rises evenly like a clock, but is not used: gaps in it are not seen; if it is the \
                 time, name it t_s, t_ms, t_us or t_ns (--columns)"
            ));
        }
    }
}
