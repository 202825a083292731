//! Remarks on a fit and on what it cannot determine, as values: their words are those of the document of a calibration.

use super::{Outcome, Settings};
use crate::noise::{Composite, ParameterRef, Process};
use crate::outcome::tau_s;

/// Remark on a fit. `process`: position in the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Note {
    /// Axes that are pooled differ ([`Outcome::axes_differ`]).
    AxesDiffer,
    /// Scales that count in no fit, for the steps of a quantiser or too many outliers: the first and the last (s).
    LeftOut([f64; 2]),
    /// Alike processes that cannot be told apart ([`Inference::indistinct`](super::Inference::indistinct)).
    Indistinct,
    /// Amplitude known to a factor, either way; none: it may be zero.
    Wide(ParameterRef, Option<f64>),
    /// Process without an amplitude.
    Zero(usize),
    /// Process whose correlation time (s) is shorter than a sample: white noise by another name.
    LikeWhite(usize, f64),
    /// Process whose correlation time (s) has its peak beyond the longest scale (s): a random walk by another name.
    LikeWalk(usize, f64, f64),
}

/// An amplitude known to no better than this factor, either way, is told.
const FACTOR: f64 = 3.0;
/// The wavelet variance of an AR1 peaks at this many correlation times.
const PEAK: f64 = 3.78;

impl Outcome {
    /// Remarks on the fit, the most important first.
    #[must_use]
    pub fn notes(&self, settings: &Settings) -> Vec<Note> {
        let (rate_hz, mut notes) = (settings.rate_hz, Vec::new());
        notes.extend(self.axes_differ.map(|_| Note::AxesDiffer));
        let ignored = &self.curve.ignored;
        // A range that was asked for is no news.
        if let (Some(first), Some(last), None) =
            (ignored.first(), ignored.last(), settings.fit_range)
        {
            notes.push(Note::LeftOut(
                [*first, *last].map(|level| tau_s(level, rate_hz)),
            ));
        }
        if let Some(inference) = &self.inference {
            notes.extend(inference.indistinct.as_ref().map(|_| Note::Indistinct));
            let amplitudes = inference
                .intervals
                .iter()
                .filter(|i| !i.of.parameter.is_shape() && i.absent.is_none());
            let wide = amplitudes.filter(|i| i.high > FACTOR * FACTOR * i.low);
            notes.extend(
                wide.map(|i| Note::Wide(i.of, (i.low > 0.0).then_some((i.high / i.low).sqrt()))),
            );
        }
        let fit = &self.fit;
        notes.extend(fit.zero.iter().map(|i| Note::Zero(*i)));
        let longest_s = self
            .counted_levels()
            .last()
            .map_or(0.0, |level| tau_s(*level, rate_hz));
        for (i, process) in fit
            .composite
            .processes
            .iter()
            .enumerate()
            .filter(|(i, _)| !fit.zero.contains(i))
        {
            let Some(time_s) = process.correlation_time_s(rate_hz) else {
                continue;
            };
            if time_s * rate_hz < 1.0 {
                notes.push(Note::LikeWhite(i, time_s));
            }
            // Before its peak the curve of an AR1 rises as that of a random walk does: without the peak only sigma2 is known.
            if PEAK * time_s > longest_s {
                notes.push(Note::LikeWalk(i, time_s, longest_s));
            }
        }
        notes
    }
}

/// Contribution of a process to a model's wavelet variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Share {
    /// Levels at which it is the largest part, ascending.
    pub leads: Vec<u32>,
    /// Its largest part of the whole, and the level of that.
    pub largest: (f64, u32),
}

/// The share of each process of a model over some levels.
#[must_use]
pub fn shares(model: &Composite, levels: &[u32]) -> Vec<Share> {
    let part = |process: &Process, level: u32| match process.haar_wv(level) / model.haar_wv(level) {
        part if part.is_finite() => part,
        // Of nothing nothing is a part.
        _ => 0.0,
    };
    let leader = |level: u32| {
        let parts = model.processes.iter().map(|p| part(p, level));
        parts
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(i, _)| i)
    };
    let share = |(i, process): (usize, &Process)| Share {
        leads: levels
            .iter()
            .copied()
            .filter(|level| leader(*level) == Some(i))
            .collect(),
        largest: levels
            .iter()
            .map(|level| (part(process, *level), *level))
            .fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a }),
    };
    model.processes.iter().enumerate().map(share).collect()
}
