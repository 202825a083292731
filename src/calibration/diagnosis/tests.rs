//! Alarms in simulated sets: as rare as said where recordings are alike, there where one is not.

use super::*;
use crate::curve::{Estimator, Replicate};
use crate::imu::{Axis, Channel, Sensor};
use crate::outcome::CalibrationSettings;
use crate::tests::{generator, measured, normal, plain_settings};
use crate::{Pool, Trim, calibrate, grouped, trend};
use rand::RngExt;

mod causes;

fn settings(spec: &str) -> CalibrationSettings {
    CalibrationSettings {
        estimators: vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
        trim: Trim::Count(1),
        ..plain_settings(spec)
    }
}

/// What the recordings of a set differ by: the standard deviation of ln sigma2 and ln gamma2, and how much of
/// its variance the axes of a recording share.
#[derive(Clone, Copy)]
struct Differences {
    deviation: f64,
    shared: f64,
}

const NONE: Differences = Differences {
    deviation: 0.0,
    shared: 0.0,
};
const LEVELS: u32 = 10;
const SAMPLES: usize = 2048;

/// Three axes of white noise and random walk for each recording; `change` may spoil a recording's axis.
fn set(
    set: u64,
    count: usize,
    differences: Differences,
    change: impl Fn(usize, Axis, &mut [f64]),
) -> Vec<Diagnosis> {
    let recording = |file: usize| {
        let mut generator = generator(set, file as u64);
        let common = [0, 1].map(|_| normal(&mut generator));
        Axis::ALL.map(|axis| {
            let own = [0, 1].map(|_| normal(&mut generator));
            let factor = |i: usize| {
                let Differences { deviation, shared } = differences;
                (deviation * (shared.sqrt() * common[i] + (1.0 - shared).sqrt() * own[i])).exp()
            };
            let (sigma, gamma) = (factor(0).sqrt(), (1e-4 * factor(1)).sqrt());
            let mut walk = 0.0;
            let mut next = || {
                walk += gamma * normal(&mut generator);
                walk + sigma * normal(&mut generator)
            };
            let mut signal: Vec<f64> = (0..SAMPLES).map(|_| next()).collect();
            change(file, axis, &mut signal);
            signal
        })
    };
    diagnosed((0..count).map(recording), &settings("WN+RW"))
}

/// Recordings of three axes of an accelerometer against one another.
fn diagnosed(
    recordings: impl Iterator<Item = [Vec<f64>; 3]>,
    settings: &CalibrationSettings,
) -> Vec<Diagnosis> {
    let mut replicates = Vec::new();
    for (file, signals) in recordings.enumerate() {
        for (axis, signal) in Axis::ALL.into_iter().zip(signals) {
            let replicate = Replicate {
                axis: Some(axis),
                trend: trend(&signal),
                ..measured(format!("run{file}"), &signal, LEVELS)
            };
            let sensor = Sensor::Accel;
            replicates.push((Channel { sensor, axis }, replicate));
        }
    }
    let groups = grouped(replicates, Pool::Sensor);
    let outcomes = calibrate(&groups, settings).unwrap();
    diagnose(&groups, &outcomes, settings)
}

/// The finding of a cause, if there is one.
fn of_cause(all: &[Diagnosis], cause: CommonCause) -> Option<&CommonFinding> {
    all[0].common.iter().find(|found| found.cause == cause)
}

/// Sets, of so many, with an alarm of noise, of outliers and of drift.
fn alarmed(sets: u64, count: usize, differences: Differences) -> [u32; 3] {
    let mut alarmed = [0; 3];
    for seed in 0..sets {
        let all = set(seed, count, differences, |_, _, _| ());
        alarmed[0] += u32::from(all.iter().any(|d| d.noise.is_some()));
        alarmed[1] += u32::from(all.iter().any(|d| d.outliers.is_some()));
        alarmed[2] += u32::from(all.iter().any(|d| d.drift.is_some()));
    }
    alarmed
}

/// An alarm has a probability of at most 2.5 %: of 24 sets with it 0.6 ± √(24·0.025·0.975) = 0.77, so no more
/// than 3 (four deviations: 3.7). Once for recordings that differ by nothing but noise, twice for some that differ
/// by a fifth, each axis by itself or all alike.
#[test]
fn alike_recordings_raise_no_more_alarms_than_said() {
    let by_a_fifth = |shared| Differences {
        deviation: 0.2,
        shared,
    };
    for differences in [NONE, by_a_fifth(0.0), by_a_fifth(1.0)] {
        let alarms = alarmed(24, 6, differences);
        assert!(alarms.iter().all(|n| *n <= 3), "{alarms:?} of 24");
    }
}

/// The same at length: of 400 sets 2.5 % are 10 ± √(400·0.025·0.975) = 3.1, of which four are allowed. Where axes share all
/// differences 3.5 % were seen before: 14 ± 3.7.
#[test]
#[ignore = "six minutes"]
fn false_alarm_rates() {
    let mut most = 0;
    for (count, deviation, shared) in [
        (4, 0.1, 0.0),
        (6, 0.0, 0.0),
        (6, 0.05, 0.0),
        (6, 0.2, 0.0),
        (6, 1.0, 0.0),
        (10, 0.2, 0.0),
        (6, 0.2, 0.5),
        (6, 0.2, 1.0),
    ] {
        let alarms = alarmed(400, count, Differences { deviation, shared });
        println!("{count} recordings, deviation {deviation}, shared {shared}: {alarms:?} of 400");
        assert!(
            alarms.iter().all(|n| *n <= 22),
            "{count} {deviation} {shared}: {alarms:?} of 400"
        );
        most = alarms.into_iter().fold(most, u32::max);
    }
    println!(
        "figure diagnosis: at most {most} of 400 in {} questions",
        8 * 3
    );
}

fn verdicts(all: &[Diagnosis]) -> Vec<RecordingVerdict> {
    all.iter().map(|d| d.verdict).collect()
}

/// One recording with a few spikes on two axes, one with a third more noise on all, among seven that differ by
/// 3 %.
#[test]
fn outliers_and_another_noise_are_told_apart() {
    let all = set(
        100,
        7,
        Differences {
            deviation: 0.03,
            shared: 0.0,
        },
        |file, axis, signal| match (file, axis) {
            (2, Axis::X | Axis::Y) => (0..3).for_each(|i| signal[100 + 600 * i] += 60.0),
            (5, _) => signal.iter_mut().for_each(|x| *x *= 1.15),
            _ => {}
        },
    );
    use RecordingVerdict::{Noise, Normal, Outliers};
    assert_eq!(
        verdicts(&all),
        [Normal, Normal, Outliers, Normal, Normal, Noise, Normal]
    );
    let alarm = all[2].outliers.as_ref().unwrap();
    assert!(
        alarm.deviations[0].1 > 5.0 && alarm.deviations[2].1 < 5.0,
        "{alarm:?}"
    );
}

/// What spikes do to the parameters: 3 of 60² on two of three axes of 2048 samples make the sigma2 of AWV 1 +
/// 2·5.3/21; without the recording it is 1 again. The others stay within four deviations of an eighth of the
/// noise: √(2/2048/18) = 0.7 % and less.
/// Two of eight with twice the variance at all scales.
#[test]
fn two_abnormal_recordings_do_not_hide_each_other() {
    let all = set(
        7,
        8,
        Differences {
            deviation: 0.03,
            shared: 0.0,
        },
        |file, _, signal| {
            if [1, 6].contains(&file) {
                signal.iter_mut().for_each(|x| *x *= 2.0_f64.sqrt());
            }
        },
    );
    let noisy = (0..8).filter(|i| all[*i].verdict == RecordingVerdict::Noise);
    assert!(noisy.eq([1, 6]));
}

/// Spikes in every recording: of 2048 samples 1 % of 8 deviations adds 0.64 to 1 at the first scales, in all alike.
/// None is abnormal, and yet the estimators describe different noise. Clean sets say nothing of the kind.
#[test]
fn outliers_in_all_recordings_are_told() {
    let all = set(9, 6, NONE, |_, _, signal| {
        (0..20).for_each(|i| signal[50 + 100 * i] += 8.0)
    });
    assert!(all.iter().all(|d| d.verdict == RecordingVerdict::Normal));
    let common = of_cause(&all, CommonCause::Outliers).unwrap();
    assert!(
        (common.size / 0.64 - 1.0).abs() < 0.3 && common.tau_s.contains(&2.0),
        "{common:?}"
    );
    for seed in 0..6 {
        let clean = set(seed, 6, NONE, |_, _, _| ());
        assert_eq!(of_cause(&clean, CommonCause::Outliers), None);
    }
}

/// The differences of numbers, as quantization noise has them, and white noise of a tenth of their variance. Of uniform
/// numbers the robust variance reads them 15 % high, as expected; of Gaussian numbers it does not, and that is no outlier.
#[test]
fn gaussian_quantization_noise_is_not_taken_for_outliers() {
    let found = |is_gaussian: bool, glitches: usize| {
        let signal = |file: usize, axis: Axis| {
            let mut generator = generator(4, 3 * file as u64 + axis as u64);
            let mut number = || match is_gaussian {
                true => normal(&mut generator),
                false => 12.0_f64.sqrt() * (generator.random::<f64>() - 0.5),
            };
            let mut numbers: Vec<f64> = (0..=16 * SAMPLES).map(|_| number()).collect();
            let glitched = numbers.iter_mut().skip(50).step_by(330).take(glitches);
            glitched.for_each(|x| *x += 5.0);
            let mut white = || 0.4 * normal(&mut generator);
            numbers
                .windows(2)
                .map(|pair| pair[1] - pair[0] + white())
                .collect()
        };
        let recording = |file: usize| Axis::ALL.map(|axis| signal(file, axis));
        diagnosed((0..4).map(recording), &settings("WN+QN"))
    };
    let all = found(true, 0);
    let gaussian = of_cause(&all, CommonCause::GaussianQuantization).unwrap();
    assert_eq!(gaussian.tau_s[0], 2.0);
    assert!((0.08..0.154).contains(&gaussian.size), "{gaussian:?}");
    let quantizer = &found(false, 0)[0];
    assert!(quantizer.common.is_empty(), "{quantizer:?}");
    // 0.3 % of 5 deviations in a quantizer's numbers add 7.5 % to the classical variance: outliers, though fewer than the
    // 15 % that would make the two variances equal
    let glitched = found(false, 99);
    let outliers = of_cause(&glitched, CommonCause::Outliers);
    assert!(outliers.is_some(), "{:?}", glitched[0].common);
}

/// A slow drift of one of eight recordings over its whole length, on one axis of three. The level's change between the halves
/// is that of one Haar coefficient, of deviation sqrt(1/T + gamma2 T/12) = 0.13; a drift of 3 changes it by 3/4, 5.7
/// deviations. Its random walk alone would hardly show it: the highest scale has two degrees of freedom.
#[test]
fn a_slow_drift_is_found() {
    let found = |seed: u64| {
        let all = set(seed, 8, NONE, |file, axis, signal| {
            if file == 3 && axis == Axis::Y {
                signal
                    .iter_mut()
                    .enumerate()
                    .for_each(|(t, x)| *x += 3.0 * t as f64 / SAMPLES as f64);
            }
        });
        all.iter().all(|d| d.drift.is_some() == (d.name == "run3"))
    };
    let count = (0..10).filter(|seed| found(*seed)).count();
    assert!(count >= 8, "{count} of 10");
}

#[test]
fn three_recordings_cannot_say_which() {
    let all = set(7, 3, NONE, |_, _, _| ());
    assert!(all.iter().all(|d| d.verdict == RecordingVerdict::Normal));
    assert!(set(7, 1, NONE, |_, _, _| ()).is_empty());
}
