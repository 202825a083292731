//! What the values of a column look like: held, clipped, of another size than its neighbours.

use super::FileReport;
use super::error::storage;
use super::table::{Column, Raw};
use crate::formats::FileError;
use nav_sim_signal::imu::{Channel, Sensor};
use std::io;

/// Longest pattern of rows in which values are looked for that stand.
const LONGEST_PATTERN: usize = 20;
/// Fewest pairs of rows at one place of a pattern. With a chance of `p` that a value is the last one again, as coarse
/// quantization has it, `p^200` at one place and 40 other values of 200 at another do not come together by chance.
const FEWEST_PAIRS: usize = 200;
const STANDS: f64 = 0.99;
const MOVES: f64 = 0.8;

/// Tells what no sensor gives though every number is one.
pub(super) fn doubts(raw: &Raw, factors: &[f64], report: &mut FileReport) -> Result<(), FileError> {
    let (mut textures, mut clipped) = (Vec::new(), Vec::new());
    for (column, factor) in raw.columns.iter().zip(factors) {
        let Some(channel) = column.channel() else { continue };
        let texture = Texture::of(column).map_err(storage(&raw.path))?;
        let ends = texture.clipped().into_iter().map(|(end, place)| {
            let percent = 100.0 * place.count as f64 / texture.rows as f64;
            let line = raw.lines.of(place.first);
            format!("at its {end}, {}, in {percent:.0} % of the rows, first in line {line}", place.value)
        });
        let ends: Vec<String> = ends.collect();
        if !ends.is_empty() {
            clipped.push(format!("{channel} (column \"{}\") stands {}", column.name, ends.join(" and ")));
        }
        textures.push((channel, texture, factor.abs()));
    }
    if !clipped.is_empty() {
        // One remark a file: a range too small for one axis is so for others, at both ends.
        let clipped = clipped.join("; ");
        report.warn(format!("{clipped}: clipped? A larger range of the sensor, or leave the axis out"));
    }
    held(&textures, report);
    for sensor in Sensor::ALL {
        other_unit(&textures, sensor, report);
    }
    Ok(())
}

/// A value, how often it comes, and where first.
#[derive(Debug, Clone, Copy)]
struct Place {
    value: f64,
    count: usize,
    first: usize,
}

/// The outermost two values on one side.
#[derive(Debug, Clone, Copy)]
struct Edge {
    /// 1: the largest; −1: the smallest.
    side: f64,
    outermost: Place,
    next: Place,
}

impl Edge {
    const fn new(side: f64) -> Self {
        let none = Place { value: -side * f64::INFINITY, count: 0, first: 0 };
        Self { side, outermost: none, next: none }
    }

    #[inline]
    fn see(&mut self, value: f64, row: usize) {
        let seen = Place { value, count: 1, first: row };
        if value == self.outermost.value {
            self.outermost.count += 1;
        } else if value * self.side > self.outermost.value * self.side {
            self.next = self.outermost;
            self.outermost = seen;
        } else if value == self.next.value {
            self.next.count += 1;
        } else if value * self.side > self.next.value * self.side {
            self.next = seen;
        }
    }
}

struct Texture {
    rows: usize,
    high: Edge,
    low: Edge,
    /// Sum of the absolute differences of neighbours.
    moved: f64,
    /// How often a value is the last one again, for each length of a pattern from 2 on and each place in it.
    stands: Vec<Vec<usize>>,
}

impl Texture {
    fn of(column: &Column) -> io::Result<Self> {
        let mut texture = Self {
            rows: 0,
            high: Edge::new(1.0),
            low: Edge::new(-1.0),
            moved: 0.0,
            stands: (2..=LONGEST_PATTERN).map(|length| vec![0; length]).collect(),
        };
        let mut last = f64::NAN;
        column.values.each_block(0..column.values.len(), |block| {
            for &value in block {
                texture.see(last, value);
                last = value;
            }
        })?;
        Ok(texture)
    }

    #[inline]
    fn see(&mut self, last: f64, value: f64) {
        let row = self.rows;
        self.rows += 1;
        self.high.see(value, row);
        self.low.see(value, row);
        if value == last {
            for places in &mut self.stands {
                let length = places.len();
                places[row % length] += 1;
            }
        } else if row > 0 {
            self.moved += (value - last).abs();
        }
    }

    /// Ends of the range at which values pile up. Noise that is quantized, however coarsely, has fewer values at its
    /// ends than next to them.
    fn clipped(&self) -> Vec<(&'static str, Place)> {
        const SHARE: f64 = 0.01;
        const FEWEST: usize = 20;
        let has_four_values = self.low.next.value < self.high.next.value;
        let piled = |edge: &Edge| {
            let Place { count, .. } = edge.outermost;
            has_four_values
                && count >= FEWEST
                && count as f64 > SHARE * self.rows as f64
                && count > 4 * edge.next.count
        };
        let ends = [("largest value", self.high), ("smallest value", self.low)];
        ends.into_iter().filter(|(_, edge)| piled(edge)).map(|(name, edge)| (name, edge.outermost)).collect()
    }

    /// The shortest pattern of rows in which values stand at the same places: its length and how many values it has.
    fn pattern(&self) -> Option<(usize, usize)> {
        self.stands.iter().find_map(|places| {
            let pairs = (self.rows / places.len()) as f64;
            let share = |count: &usize| *count as f64 / pairs;
            let is_pattern = pairs >= FEWEST_PAIRS as f64
                && places.iter().any(|c| share(c) >= STANDS)
                && places.iter().any(|c| share(c) <= MOVES);
            is_pattern.then(|| (places.len(), places.iter().filter(|c| share(c) < STANDS).count()))
        })
    }
}

type Textures = [(Channel, Texture, f64)];

/// Tells of values that are held until the next one comes: the white noise is too small by the share of them.
fn held(textures: &Textures, report: &mut FileReport) {
    let patterns: Vec<_> = textures.iter().filter_map(|(c, t, _)| Some((*c, t.pattern()?))).collect();
    let mut told = Vec::new();
    for (_, pattern) in &patterns {
        if told.contains(pattern) {
            continue;
        }
        told.push(*pattern);
        let alike = patterns.iter().filter(|(_, p)| p == pattern).map(|(c, _)| c.to_string());
        let (channels, (rows, values)) = (alike.collect::<Vec<_>>().join(", "), pattern);
        report.warn(format!(
            "{channels}: of every {rows} rows from the first on, {values} have a new value and the others hold the last \
             one: logged faster than sampled? Record at {values}/{rows} of this rate, or keep the new values only"
        ));
    }
}

/// Tells of an axis whose noise is of another size than that of the other two, which are alike.
fn other_unit(textures: &Textures, sensor: Sensor, report: &mut FileReport) {
    const OTHER: f64 = 6.0;
    const ALIKE: f64 = 2.0;
    let sizes: Vec<(Channel, f64)> = textures
        .iter()
        .filter(|(channel, _, _)| channel.sensor == sensor)
        .map(|(channel, texture, factor)| (*channel, texture.moved / texture.rows as f64 * factor))
        .collect();
    let [a, b, c] = sizes[..] else { return };
    let apart = |x: f64, y: f64| (x / y).max(y / x);
    for ((one, size), first, second) in [(a, b, c), (b, a, c), (c, a, b)] {
        let others = (first.1 * second.1).sqrt();
        if apart(first.1, second.1) < ALIKE && apart(size, others) > OTHER {
            let what = if size < others { "smaller" } else { "larger" };
            report.warn(format!(
                "{one}: its steps from row to row are {:.1} times {what} than those of {} and {}: is it in another unit \
                 than its column says (1 g is 9.8 m/s², 1 rad is 57 deg)?",
                apart(size, others),
                first.0,
                second.0
            ));
        }
    }
}
