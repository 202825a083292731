//! A file whose time, units and stretches are decided: what is left is to take its samples.

use super::checks;
use super::error::too_short;
use super::header::Role;
use super::options::ReadOptions;
use super::report::{FileReport, name_of};
use super::table::{Column, Raw};
use super::timing::{self, Timing};
use crate::formats::{FileError, Place, Setting};
use nav_sim_signal::imu::{Channel, Recording, Signal};
use std::ops::Range;

/// What recordings are made of.
pub(super) struct Prepared {
    path: String,
    rate_hz: f64,
    /// The signals, as they stand in the file.
    columns: Vec<Signals>,
    /// The stretches of samples that become recordings.
    pieces: Vec<Range<usize>>,
    /// Samples before which others are missing, and how many.
    holes: Vec<(usize, usize)>,
}

/// The signals of one column.
struct Signals {
    column: Column,
    channel: Channel,
    /// What brings it to SI units.
    factor: f64,
    /// Mean of each stretch (SI units).
    means: Vec<f64>,
}

impl Prepared {
    pub(super) fn new(
        mut raw: Raw,
        options: &ReadOptions,
    ) -> Result<(Self, FileReport), FileError> {
        let mut report = FileReport::new(&raw);
        let timing = timing::timing(&mut raw, options, &mut report)?;
        raw.columns
            .retain(|c| matches!(c.role, Role::Signal { .. }));
        raw.columns.sort_by_key(|c| c.channel().map(Channel::index));
        let factors = checks::factors(&raw, timing.rate_hz)?;
        checks::clipped(&raw, &mut report);
        let samples = raw.columns.first().map_or(0, |c| c.values.len());
        let pieces = pieces(&raw.path, samples, &timing, options, &mut report)?;
        let mut columns = Vec::new();
        for (column, factor) in raw.columns.into_iter().zip(factors) {
            let Some(channel) = column.channel() else {
                continue;
            };
            let mean = |piece: &Range<usize>| checks::mean(&column.values[piece.clone()], factor);
            let means = pieces.iter().map(mean).collect();
            columns.push(Signals {
                column,
                channel,
                factor,
                means,
            });
        }
        let means_of = |i| {
            columns
                .iter()
                .map(|c| (c.channel, c.means[i]))
                .collect::<Vec<_>>()
        };
        for i in 0..pieces.len() {
            checks::plausible(&means_of(i), &mut report)?;
        }
        let holes = timing.holes;
        report.samples = pieces
            .iter()
            .map(|p| p.len() + missing(&holes, p).map(|(_, n)| n).sum::<usize>())
            .collect();
        report.rate_hz = timing.rate_hz;
        report.means = means_of(0);
        Ok((
            Self {
                path: raw.path.clone(),
                rate_hz: timing.rate_hz,
                columns,
                pieces,
                holes,
            },
            report,
        ))
    }

    /// All recordings of the file.
    pub(super) fn recordings(self) -> Vec<Recording> {
        let empty = |i| Recording {
            name: name_of(&self.path, i, self.pieces.len()),
            rate_hz: self.rate_hz,
            signals: Vec::new(),
        };
        let mut recordings: Vec<Recording> = (0..self.pieces.len()).map(empty).collect();
        // column by column, so that each is let go when it is copied
        for of_file in self.columns {
            for ((recording, piece), mean) in
                recordings.iter_mut().zip(&self.pieces).zip(of_file.means)
            {
                let samples = with_holes(&of_file.column.values[piece.clone()], piece, &self.holes);
                recording
                    .signals
                    .push(signal(of_file.channel, samples, of_file.factor, mean));
            }
        }
        recordings
    }
}

/// A signal in SI units without its mean.
fn signal(channel: Channel, mut samples: Vec<f64>, factor: f64, mean: f64) -> Signal {
    samples.iter_mut().for_each(|v| *v = *v * factor - mean);
    Signal {
        channel,
        mean,
        samples,
    }
}

/// The holes within a stretch.
fn missing<'a>(
    holes: &'a [(usize, usize)],
    piece: &'a Range<usize>,
) -> impl Iterator<Item = &'a (usize, usize)> {
    holes
        .iter()
        .filter(|(sample, _)| *sample > piece.start && *sample < piece.end)
}

/// The samples of a stretch with NaN where some are missing.
fn with_holes(samples: &[f64], piece: &Range<usize>, holes: &[(usize, usize)]) -> Vec<f64> {
    let mut whole =
        Vec::with_capacity(samples.len() + missing(holes, piece).map(|(_, n)| n).sum::<usize>());
    let mut done = 0;
    for (sample, lost) in missing(holes, piece) {
        let next = sample - piece.start;
        whole.extend_from_slice(&samples[done..next]);
        whole.extend(std::iter::repeat_n(f64::NAN, *lost));
        done = next;
    }
    whole.extend_from_slice(&samples[done..]);
    whole
}

/// Of the stretches between gaps those shorter than the longest by more than this are left out.
const LONGEST_OVER_SHORTEST: usize = 16;

/// The stretches of samples that become recordings: at least one.
fn pieces(
    path: &str,
    samples: usize,
    timing: &Timing,
    options: &ReadOptions,
    report: &mut FileReport,
) -> Result<Vec<Range<usize>>, FileError> {
    let skip = ((options.skip_s.max(0.0) * timing.rate_hz).round() as usize).min(samples);
    let inner = timing.breaks.iter().copied().filter(|b| *b > skip);
    let ends: Vec<usize> = std::iter::once(skip)
        .chain(inner)
        .chain([samples])
        .collect();
    let all = || ends.windows(2).map(|w| w[0]..w[1]);
    let longest = all().map(|p| p.len()).max().unwrap_or(0);
    let needed = options.min_samples.max(2);
    if longest < needed && options.skip_s > 0.0 {
        let (skip_s, seconds) = (
            options.skip_s,
            crate::report::seconds(samples as f64 / timing.rate_hz),
        );
        let message = format!(
            "leaving out the first {skip_s} s leaves {longest} samples of {seconds} s, but {needed} are needed"
        );
        return Err(FileError::contents(path, Place::Within, message)
            .setting(Setting::Skip)
            .advice("a longer recording"));
    }
    if longest < needed {
        return Err(too_short(path, longest, needed));
    }
    // A short one would cost all others their long scales.
    let needed = needed.max(longest / LONGEST_OVER_SHORTEST);
    let dropped = all().filter(|p| p.len() < needed).count();
    if dropped > 0 {
        report.warn(format!(
            "{dropped} stretches between gaps have fewer than {needed} samples: left out"
        ));
    }
    Ok(all().filter(|p| p.len() >= needed).collect())
}
