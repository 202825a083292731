//! Stretches of rows that come twice, in one recording or in two of them.

use super::FileReport;
use super::error::storage;
use super::table::{Column, Raw};
use crate::formats::FileError;
use nav_sim_signal::imu::Channel;
use std::collections::HashMap;
use std::io;

/// Samples that are looked at together.
const WINDOW: usize = 64;
/// Fewest changes of the value in a window that may be told from others, and in a stretch that is called a
/// repetition: a coarsely quantized axis that changes `c` times in independent samples is like another stretch of
/// the same with a chance below `exp(−2c)`.
const CHANGES_OF_WINDOW: usize = 16;
const CHANGES_OF_STRETCH: usize = 64;
/// Longest stretch that is compared to say how long a repetition is, to either side (rows).
const LONGEST: usize = 1 << 16;
/// Windows that stand for a column.
const SKETCH: usize = 64;

/// The windows of a column with the smallest hashes, sorted: two columns of the same samples share them, wherever
/// the samples begin.
pub(super) type Sketch = Vec<u64>;

/// Tells of rows that come twice, and takes a sketch of each column.
pub(super) fn doubts(raw: &Raw, report: &mut FileReport) -> Result<(), FileError> {
    let mut sketches = Vec::new();
    let stored = storage(&raw.path);
    let mut finest: Option<(usize, &Column)> = None;
    for column in &raw.columns {
        let Some(channel) = column.channel() else { continue };
        let mut sketch = Sketch::new();
        let changes = each_window(column, |window| insert(&mut sketch, window.hash)).map_err(&stored)?;
        sketches.push((channel, sketch));
        if finest.is_none_or(|(most, _)| changes > most) {
            finest = Some((changes, column));
        }
    }
    if let Some((_, column)) = finest
        && let Some(Repetition { first, second, rows }) = repetition(raw, column).map_err(&stored)?
    {
        let line = |row| raw.lines.of(row);
        report.warn(format!(
            "lines {} to {} are the same as lines {} to {}: a block written twice? Remove one of them",
            line(second),
            line(second + rows - 1),
            line(first),
            line(first + rows - 1)
        ));
    }
    report.sketches = sketches;
    Ok(())
}

/// A window with enough changes to be told from others.
struct Window {
    start: usize,
    hash: u64,
}

/// Shows each window of a column and counts the changes of its value.
fn each_window(column: &Column, mut show: impl FnMut(Window)) -> io::Result<usize> {
    const BASE: u64 = 0x9E37_79B9_7F4A_7C15;
    let oldest = (1..WINDOW).fold(1_u64, |power, _| power.wrapping_mul(BASE));
    let (mut ring, mut changed) = ([0_u64; WINDOW], [false; WINDOW]);
    let (mut hash, mut changes, mut all, mut row, mut last) = (0_u64, 0_usize, 0_usize, 0_usize, 0_u64);
    column.values.each_block(0..column.values.len(), |block| {
        for value in block {
            let (bits, slot) = (value.to_bits(), row % WINDOW);
            let word = mixed(bits);
            // What leaves the window is taken out of the polynomial, then the new value comes in.
            hash = hash.wrapping_sub(ring[slot].wrapping_mul(oldest)).wrapping_mul(BASE).wrapping_add(word);
            changes = changes + usize::from(bits != last) - usize::from(changed[slot]);
            all += usize::from(bits != last);
            (ring[slot], changed[slot], last) = (word, bits != last, bits);
            row += 1;
            if row >= WINDOW && changes >= CHANGES_OF_WINDOW {
                show(Window { start: row - WINDOW, hash: mixed(hash) });
            }
        }
    })?;
    Ok(all)
}

/// Spreads the bits of a word over all of it (the finaliser of [SplitMix64](https://doi.org/10.1145/2714064.2660195)).
const fn mixed(word: u64) -> u64 {
    let word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    word ^ (word >> 31)
}

fn insert(sketch: &mut Sketch, hash: u64) {
    if sketch.len() == SKETCH && sketch[SKETCH - 1] <= hash {
        return;
    }
    if let Err(at) = sketch.binary_search(&hash) {
        sketch.insert(at, hash);
        sketch.truncate(SKETCH);
    }
}

/// Rows `second..second + rows` that are those of `first..first + rows`.
struct Repetition {
    first: usize,
    second: usize,
    rows: usize,
}

/// The first repetition, found in one column and seen in all.
fn repetition(raw: &Raw, column: &Column) -> io::Result<Option<Repetition>> {
    const ENOUGH: usize = 16;
    let mut starts = HashMap::new();
    let mut candidates: Vec<(usize, usize)> = Vec::new();
    each_window(column, |Window { start, hash }| match starts.get(&hash) {
        Some(&first) if first + WINDOW <= start => {
            let is_new = candidates.last().is_none_or(|(a, b)| b - a != start - first);
            if is_new && candidates.len() < ENOUGH {
                candidates.push((first, start));
            }
        }
        // One window of 64 is enough to meet any stretch of 127 rows again.
        None if start % WINDOW == 0 => drop(starts.insert(hash, start)),
        _ => {}
    })?;
    for (first, second) in candidates {
        if let Some(found) = extended(raw, column, first, second)? {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// The whole stretch around two rows from which on a column repeats itself, if all columns do.
fn extended(raw: &Raw, column: &Column, first: usize, second: usize) -> io::Result<Option<Repetition>> {
    let rows = column.values.len();
    let apart = second - first;
    let (mut before, mut after) = (first.min(LONGEST), apart.min(rows - second).min(LONGEST));
    for column in raw.columns.iter().filter(|c| c.channel().is_some()) {
        let stretch = |start: usize, count: usize| column.values.stretch(start..start + count);
        let alike = |(a, b): &(&f64, &f64)| a.to_bits() == b.to_bits();
        let (a, b) = (stretch(first, after)?, stretch(second, after)?);
        after = a.iter().zip(&b).take_while(alike).count();
        let (a, b) = (stretch(first - before, before)?, stretch(second - before, before)?);
        before = a.iter().rev().zip(b.iter().rev()).take_while(alike).count();
    }
    let before = before.min(apart - after);
    let (start, count) = (first - before, before + after);
    let stretch = column.values.stretch(start..start + count)?;
    let changes = stretch.windows(2).filter(|w| w[0].to_bits() != w[1].to_bits()).count();
    let is_repetition = after >= WINDOW && changes >= CHANGES_OF_STRETCH;
    Ok(is_repetition.then_some(Repetition { first: start, second: second - before, rows: count }))
}

/// What two files have in common, as a part of their union (Jaccard), from their sketches; `None` if it is nothing.
pub(super) fn jaccard(a: &[(Channel, Sketch)], b: &[(Channel, Sketch)]) -> Option<f64> {
    /// By chance not even one is shared.
    const FEWEST: usize = 4;
    let share = |(channel, a): &(Channel, Sketch)| {
        let (_, b) = b.iter().find(|(other, _)| other == channel)?;
        let mut union: Vec<u64> = a.iter().chain(b).copied().collect();
        union.sort_unstable();
        union.dedup();
        union.truncate(SKETCH);
        let is_shared = |hash: &&u64| a.binary_search(hash).is_ok() && b.binary_search(hash).is_ok();
        let shared = union.iter().filter(is_shared).count();
        (shared >= FEWEST).then_some(shared as f64 / union.len() as f64)
    };
    a.iter().filter_map(share).reduce(f64::max)
}
