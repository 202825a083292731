//! The numbers of a column, held in memory or waiting in a temporary file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;

/// Numbers that are looked at together.
const BLOCK: usize = 4096;
const WIDTH: usize = size_of::<f64>();

/// Numbers in order: all of them held, or all of them stored once [`Self::store`] was called last.
#[derive(Debug, Default)]
pub(crate) struct Values {
    held: Vec<f64>,
    /// A file without a name, and how many numbers are in it.
    stored: Option<(File, usize)>,
}

impl Values {
    #[inline]
    pub(super) fn push(&mut self, value: f64) {
        self.held.push(value);
    }

    pub(crate) fn len(&self) -> usize {
        self.stored.as_ref().map_or(0, |(_, count)| *count) + self.held.len()
    }

    pub(super) const fn is_stored(&self) -> bool {
        self.stored.is_some()
    }

    /// Moves what is held to a temporary file, which goes with the value.
    pub(super) fn store(&mut self) -> io::Result<()> {
        let (file, count) = match &mut self.stored {
            Some(stored) => stored,
            none => none.insert((tempfile::tempfile()?, 0)),
        };
        let mut bytes = Vec::with_capacity(BLOCK * WIDTH);
        for block in self.held.chunks(BLOCK) {
            bytes.clear();
            block
                .iter()
                .for_each(|value| bytes.extend(value.to_le_bytes()));
            file.write_all(&bytes)?;
        }
        *count += self.held.len();
        self.held.clear();
        Ok(())
    }

    /// Gives back memory that is not needed.
    pub(super) fn fit(&mut self) {
        self.held.shrink_to_fit();
    }

    /// Shows a stretch, block by block.
    pub(super) fn each_block(
        &self,
        range: Range<usize>,
        mut show: impl FnMut(&[f64]),
    ) -> io::Result<()> {
        let Some((mut file, _)) = self.stored.as_ref().map(|(file, count)| (file, count)) else {
            self.held[range].chunks(BLOCK).for_each(show);
            return Ok(());
        };
        file.seek(SeekFrom::Start((range.start * WIDTH) as u64))?;
        let (mut bytes, mut block) = (vec![0; BLOCK * WIDTH], Vec::with_capacity(BLOCK));
        for start in range.clone().step_by(BLOCK) {
            let bytes = &mut bytes[..BLOCK.min(range.end - start) * WIDTH];
            file.read_exact(bytes)?;
            block.clear();
            block.extend(bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)));
            show(&block);
        }
        Ok(())
    }

    /// A stretch.
    pub(super) fn stretch(&self, range: Range<usize>) -> io::Result<Vec<f64>> {
        let mut values = Vec::with_capacity(range.len());
        self.each_block(range, |block| values.extend_from_slice(block))?;
        Ok(values)
    }

    /// Some stretches.
    pub(super) fn into_stretches(self, ranges: &[Range<usize>]) -> io::Result<Vec<Vec<f64>>> {
        let [range] = ranges else {
            return ranges
                .iter()
                .map(|range| self.stretch(range.clone()))
                .collect();
        };
        let mut values = self.into_vec()?;
        values.truncate(range.end);
        values.drain(..range.start);
        Ok(vec![values])
    }

    /// All of them.
    pub(crate) fn into_vec(self) -> io::Result<Vec<f64>> {
        if self.is_stored() {
            self.stretch(0..self.len())
        } else {
            Ok(self.held)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_values_are_the_held_ones() {
        let (mut held, mut stored) = (Values::default(), Values::default());
        for i in 0..3 * BLOCK + 17 {
            held.push(i as f64 / 7.0);
            stored.push(i as f64 / 7.0);
            if i % 5000 == 4999 {
                stored.store().unwrap();
            }
        }
        stored.store().unwrap();
        assert!(stored.is_stored() && stored.held.is_empty() && stored.len() == held.len());
        for range in [
            0..0,
            0..1,
            5..BLOCK + 5,
            BLOCK..3 * BLOCK,
            0..held.len(),
            held.len()..held.len(),
        ] {
            let collect = |values: &Values| {
                let mut blocks = Vec::new();
                values
                    .each_block(range.clone(), |b| blocks.push(b.to_vec()))
                    .unwrap();
                blocks
            };
            assert_eq!(collect(&stored), collect(&held), "{range:?}");
        }
        assert_eq!(stored.into_vec().unwrap(), held.into_vec().unwrap());
    }
}
