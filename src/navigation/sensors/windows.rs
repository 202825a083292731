//! Windows of static recordings as the errors of runs.
//!
//! A recording holds few windows that do not overlap, and runs that share samples say the same thing twice: the
//! windows of successive runs are spread as evenly as any number of them can be. A random walk has been walking
//! before a window begins, while a filter starts it at zero: each window starts from the level that is best
//! known there, as a vehicle does whose biases were taken off before it left.

use crate::imu::{Channel, Recording};
use crate::rng::StreamKey;
use crate::wavelet::haar;
use rand::RngExt;

/// Recordings, and the averaging times that tell their levels best.
#[derive(Debug, Clone)]
pub struct Windows<'a> {
    recordings: &'a [Recording],
    /// For each recording and channel: samples over which a mean knows the level best; 0 where the record is
    /// too short to tell.
    spans: Vec<[usize; 6]>,
}

impl<'a> Windows<'a> {
    /// The windows of recordings that have all six channels.
    pub(super) fn new(recordings: &'a [Recording]) -> Self {
        let spans_of = |recording: &Recording| {
            Channel::ALL.map(|channel| {
                recording
                    .signal(channel)
                    .map_or(0, |s| best_span(&s.samples))
            })
        };
        Self {
            recordings,
            spans: recordings.iter().map(spans_of).collect(),
        }
    }

    /// The window of a run: for each channel its samples and the level they start from.
    pub(super) fn of_run(&self, key: StreamKey<'_>, samples: usize) -> [(&'a [f64], f64); 6] {
        let (index, start) = self.place(key, samples);
        let recording = &self.recordings[index];
        Channel::ALL.map(|channel| {
            let all = recording.signal(channel).map_or(&[][..], |s| &s.samples);
            let level = level_at(all, start, self.spans[index][channel.index()]);
            (&all[start..start + samples], level)
        })
    }

    /// Recording and first sample of a run's window: run k stands at the fraction u + k·(√5 − 1)/2 (modulo 1) of
    /// all samples, u drawn by the seed. No sequence spreads its first n points more evenly for all n, and none
    /// of them depends on how many there are.
    fn place(&self, key: StreamKey<'_>, samples: usize) -> (usize, usize) {
        const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15; // (√5 − 1)/2 in units of 2⁻⁶⁴
        let shift: u64 = StreamKey {
            run: 0,
            source: "imu",
            process: "window",
            ..key
        }
        .generator()
        .random();
        // Integers wrap as fractions do modulo 1, without the rounding that k·(√5 − 1)/2 has for large k.
        let point = shift.wrapping_add(key.run.wrapping_mul(GOLDEN));
        let total: f64 = self.recordings.iter().map(|r| r.len() as f64).sum();
        // The upper 53 bits: as many as a double holds, so that the fraction stays below 1.
        let mut at = (point >> 11) as f64 / (1_u64 << 53) as f64 * total;
        let length = |index: usize| self.recordings[index].len();
        let mut index = 0;
        // The last recording has what rounding leaves over.
        while index + 1 < self.recordings.len() && at >= length(index) as f64 {
            at -= length(index) as f64;
            index += 1;
        }
        // Scaled to the possible starts rather than refused: a window never runs over the end of its recording.
        let starts = length(index) - samples + 1;
        (
            index,
            ((at / length(index) as f64 * starts as f64) as usize).min(starts - 1),
        )
    }
}

/// The averaging time (samples) at which the Allan variance is least: beyond it the level has moved on, below
/// it white noise hides it. Sought among scales of which the signal holds eight or more: the variance of a
/// longer one is chance.
fn best_span(signal: &[f64]) -> usize {
    let levels = (signal.len() / 8).checked_ilog2().unwrap_or(0);
    let Ok(variances) = haar::classical(signal, levels) else {
        return 0;
    };
    let least = (0..variances.len()).min_by(|a, b| variances[*a].total_cmp(&variances[*b]));
    // level j compares neighbouring means over 2^(j − 1) samples
    least.map_or(0, |index| 1 << index)
}

/// Mean over `span` samples around `start`.
fn level_at(signal: &[f64], start: usize, span: usize) -> f64 {
    if span == 0 {
        return 0.0;
    }
    // Centred on the start: a random walk gives this mean a quarter of the error variance of a one-sided one,
    // and a drift no error at all.
    let first = start.saturating_sub(span / 2).min(signal.len() - span);
    signal[first..first + span].iter().sum::<f64>() / span as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::Signal;
    use rand_distr::{Distribution, StandardNormal};

    const KEY: StreamKey<'_> = StreamKey {
        seed: 5,
        scenario: "",
        run: 0,
        source: "",
        process: "",
    };

    fn recording(signal: &[f64]) -> Recording {
        let channel = |channel| Signal {
            channel,
            mean: 0.0,
            samples: signal.to_vec(),
        };
        Recording {
            name: "r.csv".into(),
            rate_hz: 100.0,
            signals: Channel::ALL.map(channel).into(),
        }
    }

    /// White noise of standard deviation `sigma` and a random walk of steps 1.
    fn walk(sigma: f64, samples: usize) -> Vec<f64> {
        let mut rng = StreamKey {
            source: "walk",
            ..KEY
        }
        .generator();
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut level = 0.0;
        (0..samples)
            .map(|_| {
                level += normal();
                level + sigma * normal()
            })
            .collect()
    }

    /// 100 windows in 20 equal stretches: drawn independently one stretch in ten would hold none or one, ten or
    /// more (binomial, 4.8 %); here each holds 4 to 6, for any seed.
    #[test]
    fn windows_are_spread_evenly() {
        let recordings = [recording(&vec![0.0; 6000]), recording(&vec![0.0; 4000])];
        let windows = Windows::new(&recordings);
        for seed in 0..20 {
            let mut held = [0_u32; 20];
            for run in 0..100 {
                let (index, start) = windows.place(StreamKey { seed, run, ..KEY }, 1000);
                let share = start as f64 / (recordings[index].len() - 999) as f64;
                held[12 * index + (share * [12.0, 8.0][index]) as usize] += 1;
            }
            assert!(
                held.iter().all(|n| (4..=6).contains(n)),
                "seed {seed}: {held:?}"
            );
        }
    }

    /// The Allan variance of white noise and a random walk, sigma²/n + n/3, is least at n = √3 sigma.
    #[test]
    fn the_span_is_that_of_the_least_allan_variance() {
        let span = best_span(&walk(40.0, 100_000)) as f64;
        let expected = 3.0_f64.sqrt() * 40.0;
        assert!((0.5..=2.0).contains(&(span / expected)), "{span}");
    }

    /// A pure random walk starts at zero, wherever its window begins.
    #[test]
    fn a_random_walk_starts_at_zero() {
        let recordings = [recording(&walk(0.0, 5000))];
        let windows = Windows::new(&recordings);
        for run in 0..20 {
            for (samples, level) in windows.of_run(StreamKey { run, ..KEY }, 1000) {
                assert_eq!((samples[0], samples.len()), (level, 1000));
            }
        }
    }
}
