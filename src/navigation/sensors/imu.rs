//! The errors of the inertial sensors, run by run: synthesised from a model, or windows of recordings.

use crate::imu::{Channel, Recording};
use crate::lanes::{Lanes, Vec3};
use crate::noise::continuous::same_rate;
use crate::noise::{Composite, Model, Synthesizer};
use crate::rng::{LaneGenerator, StreamKey};
use crate::units::Refused;
use crate::wavelet::haar;
use rand::RngExt;

/// Source of the true IMU's errors.
#[derive(Debug, Clone, Copy)]
pub enum Truth<'a> {
    /// Synthesised from a model, per run and axis.
    Model(&'a Model),
    /// Synthesised from a model of each run's own: parameters that differ from one switching-on to the next.
    Drawn(&'a [Model]),
    /// A window of a static recording for each run, all axes together, so that correlation between axes
    /// survives; windows are spread evenly, and each starts from the level best known there ([`best_spans`]).
    Static(&'a [Recording]),
}

/// The truth cannot make the errors of a run.
#[derive(Debug, Clone, thiserror::Error)]
pub enum TruthError {
    /// No model or recording, a channel too few, a model of another rate.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// A recording of another rate than the IMU's.
    #[error("{recording} was sampled at {rate_hz} Hz, the simulated IMU at {imu_hz} Hz")]
    Rate {
        /// Name of the recording.
        recording: String,
        /// Its rate (Hz).
        rate_hz: f64,
        /// Rate of the IMU (Hz).
        imu_hz: f64,
    },
    /// A recording shorter than the trajectory.
    #[error("{recording} lasts {has_s} s, the trajectory {needs_s} s: {} s too short", .needs_s - .has_s)]
    TooShort {
        /// Name of the recording.
        recording: String,
        /// Its length (s).
        has_s: f64,
        /// Length of the trajectory (s).
        needs_s: f64,
    },
}

fn refused<T>(message: impl Into<String>) -> Result<T, TruthError> {
    Err(Refused(message.into()).into())
}

impl Truth<'_> {
    /// Checks that `samples` samples at `imu_hz` can be had.
    ///
    /// # Errors
    /// The data missing, and by how much.
    pub(crate) fn check(&self, imu_hz: f64, samples: usize) -> Result<(), TruthError> {
        let check_model = |model: &Model| match same_rate(model.rate_hz, imu_hz) {
            true => Ok(()),
            false => refused(format!(
                "the model of the truth is at {} Hz, the simulated IMU at {imu_hz} Hz",
                model.rate_hz
            )),
        };
        match self {
            Self::Model(model) => check_model(model),
            Self::Drawn([]) => refused("no model drawn"),
            Self::Drawn(models) => {
                let labels = |model: &Model| model.axes.each_ref().map(Composite::labels);
                let first = labels(&models[0]);
                if models.iter().any(|model| labels(model) != first) {
                    return refused("the drawn models differ in their processes");
                }
                models.iter().try_for_each(check_model)
            }
            Self::Static([]) => refused("no static recording given"),
            Self::Static(recordings) => recordings
                .iter()
                .try_for_each(|r| check_recording(r, imu_hz, samples)),
        }
    }

    /// Number of disjoint windows of `samples` samples in the recordings: more runs than these
    /// share noise. None for a model, which gives every run its own noise.
    pub(crate) fn independent_windows(&self, samples: usize) -> Option<f64> {
        match self {
            Self::Model(_) | Self::Drawn(_) => None,
            Self::Static(recordings) => {
                // By length, not by count: windows that overlap share samples, and a fraction of a window is
                // worth its fraction.
                Some(recordings.iter().map(|r| r.len() as f64).sum::<f64>() / samples.max(1) as f64)
            }
        }
    }
}

fn check_recording(recording: &Recording, imu_hz: f64, needs: usize) -> Result<(), TruthError> {
    let name = || recording.name.clone();
    if let Some(channel) = Channel::ALL
        .into_iter()
        .find(|c| recording.signal(*c).is_none())
    {
        return refused(format!(
            "{}: no channel {channel}; all six are needed, in one file",
            recording.name
        ));
    }
    if !same_rate(recording.rate_hz, imu_hz) {
        return Err(TruthError::Rate {
            recording: name(),
            rate_hz: recording.rate_hz,
            imu_hz,
        });
    }
    let has = recording.len();
    if has < needs {
        let seconds = |samples: usize| samples as f64 / imu_hz;
        return Err(TruthError::TooShort {
            recording: name(),
            has_s: seconds(has),
            needs_s: seconds(needs),
        });
    }
    Ok(())
}

/// The errors of up to eight runs, side by side.
#[derive(Debug, Clone)]
pub struct LaneErrors<'a> {
    source: ErrorSource<'a>,
    /// For each sample, accelerometer (m/s²) and gyroscope (rad/s); the first `used` have been handed out.
    block: Vec<[Vec3; 2]>,
    used: usize,
    channel: Vec<Lanes>,
}

#[derive(Debug, Clone)]
enum ErrorSource<'a> {
    /// One synthesizer for each channel.
    Synthesised(Box<[Synthesizer<LaneGenerator>; 6]>),
    /// For each run the rest of its window on the six channels, and the level from which that started (m/s² or rad/s).
    Recorded(Vec<[(&'a [f64], f64); 6]>),
}

/// Samples made at a time.
const BLOCK: usize = 64;

impl<'a> LaneErrors<'a> {
    /// The errors of at most eight runs over `samples` samples, which the truth must have; of recordings with their
    /// [`best_spans`]. Lanes beyond the runs are without error.
    pub fn new(
        truth: &Truth<'a>,
        spans: &[[usize; 6]],
        keys: &[StreamKey<'_>],
        samples: usize,
    ) -> Self {
        let synthesised = |model_of: &dyn Fn(u64) -> &'a Model| {
            ErrorSource::Synthesised(Box::new(Channel::ALL.map(|channel| {
                let source = &*channel.to_string();
                let keys = keys.iter().map(|key| StreamKey { source, ..*key });
                let runs = keys.map(|key| (model_of(key.run).axis(channel), key));
                Synthesizer::lanes(&runs.collect::<Vec<_>>())
            })))
        };
        let source = match *truth {
            Truth::Model(model) => synthesised(&|_| model),
            // Of fewer models than runs each is taken again.
            Truth::Drawn(models) => {
                synthesised(&|run| &models[(run % models.len() as u64) as usize])
            }
            Truth::Static(recordings) => {
                let window = |key: &StreamKey<'_>| {
                    let (index, start) = place(recordings, *key, samples);
                    Channel::ALL.map(|channel| {
                        let signal = recordings[index].signal(channel);
                        let all = signal.map_or(&[][..], |s| &s.samples);
                        // The level of the window's start, not its mean: a mean over the window would know the
                        // future, and hold the random walk down at both ends.
                        let level = level_at(all, start, spans[index][channel.index()]);
                        (&all[start..start + samples], level)
                    })
                };
                ErrorSource::Recorded(keys.iter().map(window).collect())
            }
        };
        Self {
            source,
            block: Vec::new(),
            used: 0,
            channel: vec![Lanes::ZERO; BLOCK],
        }
    }

    /// Draws the errors of the next `n` samples: accelerometer (m/s²) and gyroscope (rad/s).
    pub fn next(&mut self, n: usize) -> &mut [[Vec3; 2]] {
        self.block.drain(..self.used);
        self.used = n;
        while self.block.len() < n {
            self.extend();
        }
        &mut self.block[..n]
    }

    /// Appends a block; behind the end of recordings it is without error.
    fn extend(&mut self) {
        let first = self.block.len();
        self.block.resize(first + BLOCK, [Vec3::ZERO; 2]);
        for channel in Channel::ALL {
            match &mut self.source {
                ErrorSource::Synthesised(channels) => {
                    channels[channel.index()].fill(&mut self.channel)
                }
                ErrorSource::Recorded(windows) => {
                    self.channel.fill(Lanes::ZERO);
                    for (lane, window) in windows.iter_mut().enumerate() {
                        let (left, level) = &mut window[channel.index()];
                        let (now, later) = left.split_at(left.len().min(BLOCK));
                        for (error, sample) in self.channel.iter_mut().zip(now) {
                            error[lane] = sample - *level;
                        }
                        *left = later;
                    }
                }
            }
            let (sensor, axis) = (channel.sensor as usize, channel.axis as usize);
            for (sample, value) in self.block[first..].iter_mut().zip(&self.channel) {
                sample[sensor][axis] = *value;
            }
        }
    }

    /// The samples drawn last.
    pub fn drawn(&self) -> &[[Vec3; 2]] {
        &self.block[..self.used]
    }
}

// Windows of static recordings as the errors of runs.
//
// A recording holds few windows that do not overlap, and runs that share samples say the same thing twice: the
// windows of successive runs are spread as evenly as any number of them can be. A random walk has been walking
// before a window begins, while a filter starts it at zero: each window starts from the level that is best
// known there, as a vehicle does whose biases were taken off before it left.

/// For each recording of a truth and each channel: samples over which a mean knows the level best; 0 where the record is too
/// short to tell.
pub fn best_spans(truth: &Truth<'_>) -> Vec<[usize; 6]> {
    let Truth::Static(recordings) = truth else {
        return Vec::new();
    };
    let span = |r: &Recording, channel| r.signal(channel).map_or(0, |s| best_span(&s.samples));
    let spans_of = |recording| Channel::ALL.map(|channel| span(recording, channel));
    recordings.iter().map(spans_of).collect()
}

/// Recording and first sample of a run's window: run k stands at the fraction u + k·(√5 − 1)/2 (modulo 1) of
/// all samples, u drawn by the seed. No sequence spreads its first n points more evenly for all n, and none
/// of them depends on how many there are.
fn place(recordings: &[Recording], key: StreamKey<'_>, samples: usize) -> (usize, usize) {
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
    let total: f64 = recordings.iter().map(|r| r.len() as f64).sum();
    // The upper 53 bits: as many as a double holds, so that the fraction stays below 1.
    let mut at = (point >> 11) as f64 / (1_u64 << 53) as f64 * total;
    let length = |index: usize| recordings[index].len();
    let mut index = 0;
    // The last recording has what rounding leaves over.
    while index + 1 < recordings.len() && at >= length(index) as f64 {
        at -= length(index) as f64;
        index += 1;
    }
    // Scaled to the possible starts rather than refused: a window never runs over the end of its recording.
    let starts = length(index) - samples + 1;
    let start = (at / length(index) as f64 * starts as f64) as usize;
    (index, start.min(starts - 1))
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
    use crate::tests::*;

    fn recording(samples: &[f64], rate_hz: f64) -> Recording {
        let signal = |channel: Channel| Signal {
            channel,
            mean: 0.0,
            samples: samples
                .iter()
                .map(|x| x + 1000.0 * channel.index() as f64)
                .collect(),
        };
        Recording {
            name: "r.csv".into(),
            rate_hz,
            signals: Channel::ALL.map(signal).into(),
        }
    }

    fn run(run: u64) -> StreamKey<'static> {
        StreamKey { run, ..key(5) }
    }

    #[test]
    fn windows_keep_the_axes_together_and_reach_both_ends() {
        let recordings = [recording(
            &std::array::from_fn::<_, 12, _>(|k| k as f64),
            100.0,
        )];
        let mut starts = std::collections::BTreeSet::new();
        let truth = Truth::Static(&recordings);
        truth.check(100.0, 10).unwrap();
        let spans = best_spans(&truth);
        for k in 0..200 {
            let mut errors = LaneErrors::new(&truth, &spans, &[run(k)], 10);
            let drawn = errors.next(4);
            let start = drawn[0][0][0][0];
            for channel in Channel::ALL {
                let of_channel =
                    |s: &[Vec3; 2]| s[channel.sensor as usize][channel.axis as usize][0];
                let expected =
                    [0, 1, 2, 3].map(|k| start + f64::from(k) + 1000.0 * channel.index() as f64);
                assert!(drawn.iter().map(of_channel).eq(expected), "{channel}");
            }
            starts.insert(start as u64);
        }
        assert_eq!(starts.into_iter().collect::<Vec<_>>(), [0, 1, 2]);
    }

    #[test]
    fn unusable_recordings_are_refused_with_their_name_and_by_how_much() {
        let mut partial = recording(&[0.0; 600], 100.0);
        partial.signals.remove(4);
        for (recording, expected) in [
            (
                recording(&[0.0; 300], 100.0),
                "r.csv lasts 3 s, the trajectory 5 s: 2 s too short",
            ),
            (
                recording(&[0.0; 600], 50.0),
                "r.csv was sampled at 50 Hz, the simulated IMU at 100 Hz",
            ),
            (
                partial,
                "r.csv: no channel gyro.y; all six are needed, in one file",
            ),
        ] {
            let error = Truth::Static(&[recording]).check(100.0, 500).unwrap_err();
            assert_eq!(error.to_string(), expected);
        }
        assert!(Truth::Static(&[]).check(100.0, 1).is_err());
    }

    /// White noise of standard deviation `sigma` and a random walk of steps 1.
    fn walk(sigma: f64, samples: usize) -> Vec<f64> {
        let (mut normal, mut level) = (normals(5), 0.0);
        let mut sample = || {
            level += normal();
            level + sigma * normal()
        };
        (0..samples).map(|_| sample()).collect()
    }

    /// 100 windows in 20 equal stretches: drawn independently one stretch in ten would hold none or one, ten or
    /// more (binomial, 4.8 %); here each holds 4 to 6, for any seed.
    #[test]
    fn windows_are_spread_evenly() {
        let recordings = [
            recording(&[0.0; 6000], 100.0),
            recording(&[0.0; 4000], 100.0),
        ];
        for seed in 0..20 {
            let mut held = [0_u32; 20];
            for run in 0..100 {
                let (index, start) = place(&recordings, StreamKey { run, ..key(seed) }, 1000);
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
        let recordings = [recording(&walk(0.0, 5000), 100.0)];
        let truth = Truth::Static(&recordings);
        for k in 0..20 {
            let mut errors = LaneErrors::new(&truth, &best_spans(&truth), &[run(k)], 1000);
            let first = errors.next(1)[0];
            assert!(
                first
                    .iter()
                    .flat_map(|sensor| sensor.0)
                    .all(|x| x[0] == 0.0)
            );
        }
    }
}
