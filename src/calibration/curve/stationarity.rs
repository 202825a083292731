//! Warm-up: whether the beginning of a recording differs from the rest, and how much of it to leave out.
//!
//! The record is cut into sixteen parts. Looked at are the steps of their means, and the logarithms of
//! their mean squared differences (the wavelet variance at the first scale). The first of each is compared with the
//! last eight by Student's law (their mean and deviation): steps of the mean of any noise with stationary
//! increments (random walk and all the others of this crate) are exchangeable or nearly so. Where the
//! first is out of place at 1 in 10⁴, the first part is given up and the next looked at. What remains is cut into sixteen
//! again, until nothing is out of place: whoever leaves out what is said is not told of more.

use super::average::mean_about;
use crate::wavelet::interval::edof_eta3;
use crate::wavelet::{Tuning, classical, default_levels, gappy};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Parts of a record.
const PARTS: usize = 16;
/// Fewest samples of a part.
const SHORTEST: usize = 64;
/// Parts at the end that the others are compared with; no more than the others are given up.
const LAST: usize = 8;
/// Probability of a false alarm of each of the two questions.
const LEVEL: f64 = 1e-4;

/// The beginning of a record that is unlike the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WarmUp {
    /// Samples to leave out: what remains begins as it goes on.
    pub samples: usize,
    /// Wavelet variance (classical) without them over that with them, at the scale where the change is most certain; none
    /// where not even the later half begins as it goes on, and nothing is to be left out.
    pub change: Option<f64>,
}

/// Recording that does not begin as it goes on.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingWarmUp {
    /// The recording.
    pub recording: String,
    /// Its signals with a warm-up.
    pub signals: Vec<WarmUp>,
    /// Seconds to leave out from the beginning of the file; none where that does not help.
    pub skip_s: Option<f64>,
}

/// Looks at a signal, again after what would be left out, until what remains begins as it goes on; none where it does from
/// the start, or is too short to tell.
pub fn warm_up(samples: &[f64]) -> Option<WarmUp> {
    let mut left = look(samples)?;
    while left <= samples.len() / 2 {
        let Some(more) = look(&samples[left..]) else {
            let change = change(samples, left);
            return Some(WarmUp {
                samples: left,
                change,
            });
        };
        left += more;
    }
    Some(WarmUp {
        samples: left,
        change: None,
    })
}

/// The scale at which the wavelet variance without the first samples differs most from that with them, in standard
/// deviations of the difference (the variance of a part less that of the whole).
fn change(samples: &[f64], left: usize) -> Option<f64> {
    let part = &samples[left..];
    let levels = default_levels(part.len());
    let (with, without) = (variances(samples, levels)?, variances(part, levels)?);
    let of_level = |level: u32| {
        let ratio = without[level as usize - 1] / with[level as usize - 1];
        // The whole contains the part, so the variance of their difference is the difference of the
        // variances.
        let noise = 2.0 / edof_eta3(part.len(), level) - 2.0 / edof_eta3(samples.len(), level);
        (
            ratio.ln().abs() / noise.max(f64::MIN_POSITIVE).sqrt(),
            ratio,
        )
    };
    let surest = (1..=levels).map(of_level).filter(|(z, _)| z.is_finite());
    surest
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, ratio)| ratio)
}

fn variances(samples: &[f64], levels: u32) -> Option<Vec<f64>> {
    if samples.iter().any(|x| x.is_nan()) {
        let found = gappy(samples, levels, &Tuning::default()).ok()?.classical;
        return Some(found).filter(|found| found.len() == levels as usize);
    }
    classical(samples, levels).ok()
}

/// One look: the samples of the first parts that are out of place.
fn look(samples: &[f64]) -> Option<usize> {
    let length = samples.len() / PARTS;
    if length < SHORTEST {
        return None;
    }
    let parts: Vec<&[f64]> = samples.chunks_exact(length).take(PARTS).collect();
    let means: Vec<f64> = parts.iter().map(|p| mean_about(0.0, p)).collect();
    let steps: Vec<f64> = means.windows(2).map(|m| m[1] - m[0]).collect();
    // ln: a factor in the noise is then a shift, and the scatter of a variance does not depend on its size.
    let squares = |p: &&[f64]| {
        let present = || {
            p.windows(2)
                .map(|x| (x[1] - x[0]).powi(2))
                .filter(|square| !square.is_nan())
        };
        (present().sum::<f64>() * (length - 1) as f64 / present().count() as f64).ln()
    };
    let noise: Vec<f64> = parts.iter().map(squares).collect();
    let mut found = None;
    // The parts that are compared with the last eight must not be among them; a step needs two parts.
    for first in 0..PARTS - LAST - 1 {
        let is_out = |values: &[f64]| out_of_place(values[first], &values[values.len() - LAST..]);
        if !is_out(&steps) && !is_out(&noise) {
            break;
        }
        found = Some((first + 1) * length);
    }
    found
}

/// Returns true if `first` is an outlier among the other values.
fn out_of_place(first: f64, others: &[f64]) -> bool {
    let count = others.len() as f64;
    let mean = others.iter().sum::<f64>() / count;
    let variance = others.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
    // The value is new: its own variance adds to that of the mean of the others.
    let t = (first - mean) / (variance * (1.0 + 1.0 / count)).sqrt();
    let law = StudentsT::new(0.0, 1.0, count - 1.0);
    t.is_finite() && law.is_ok_and(|law| 2.0 * law.sf(t.abs()) < LEVEL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::*;

    const SAMPLES: usize = 1 << 13;

    /// White noise and random walk of equal standard deviation at a sixteenth of the record.
    fn signal(generator: &mut Generator) -> Vec<f64> {
        let mut walk = 0.0;
        let mut normal = || generator.sample::<f64, _>(StandardNormal);
        (0..SAMPLES)
            .map(|_| {
                walk += 0.05 * normal();
                walk + normal()
            })
            .collect()
    }

    /// 2 in 10⁴ is the chance of a false alarm (steps of a walk's means have a correlation of ¼ with their
    /// neighbours, which changes little): in 400 signals 0.08 ± 0.28, so at most one.
    #[test]
    fn what_begins_as_it_goes_on_raises_no_alarm() {
        let mut generator = Generator::seed_from_u64(3);
        let alarms = (0..400)
            .filter(|_| warm_up(&signal(&mut generator)).is_some())
            .count();
        assert!(alarms <= 1, "{alarms}");
    }

    /// A mean that settles with a time constant of a sixteenth: each part has 1/e of the step before. At 200
    /// the steps are 126, 46, 17, 6; those of the walk √(512·0.05²·2/3) = 0.92.
    #[test]
    fn a_mean_that_settles_is_seen() {
        let mut generator = Generator::seed_from_u64(4);
        let length = SAMPLES as f64 / 16.0;
        let signal: Vec<f64> = signal(&mut generator)
            .iter()
            .enumerate()
            .map(|(t, x)| x + 200.0 * (-(t as f64) / length).exp())
            .collect();
        let found = warm_up(&signal).unwrap();
        assert!(
            (2 * SAMPLES / 16..=6 * SAMPLES / 16).contains(&found.samples),
            "{found:?}"
        );
    }

    #[test]
    fn noise_that_calms_down_is_seen() {
        let mut generator = Generator::seed_from_u64(5);
        let mut signal = signal(&mut generator);
        let mut normal = || generator.sample::<f64, _>(StandardNormal);
        signal[..SAMPLES / 8]
            .iter_mut()
            .for_each(|x| *x += 2.0 * normal());
        let found = warm_up(&signal).unwrap();
        assert_eq!(found.samples, SAMPLES / 8, "{found:?}");
        // An eighth with five times the variance at the first scale: without it 1/(1 + 4/8) = 0.67.
        let change = found.change.unwrap();
        assert_abs_diff_eq!(change, 0.67, epsilon = 0.03);
    }

    /// What is advised is all there is to leave out.
    #[test]
    fn one_round_is_enough() {
        for seed in 0..20 {
            let mut generator = Generator::seed_from_u64(seed);
            let mut signal = signal(&mut generator);
            let mut normal = || generator.sample::<f64, _>(StandardNormal);
            let fades = |t: usize| 3.0 * (-(t as f64) / (0.05 * SAMPLES as f64)).exp();
            signal
                .iter_mut()
                .enumerate()
                .for_each(|(t, x)| *x += fades(t) * normal());
            let found = warm_up(&signal).unwrap();
            assert!(
                found.change.is_none() || warm_up(&signal[found.samples..]).is_none(),
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_short_record_says_nothing() {
        assert_eq!(warm_up(&[1.0; 100]), None);
        assert_eq!(warm_up(&[1.0; 4096]), None, "nor does a constant one");
    }
}
