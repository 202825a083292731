//! Noise, recordings and laboratories that the tests of several modules share.

use crate::curve::{Estimator, Group, Pool, Replicate, Trim, grouped, replicates};
use crate::imu::Channel;
use crate::noise::{Composite, Model, Process, Spread, VirtualImu};
use crate::outcome::{Bootstrap, CalibrationSettings, ModelChoice, Outcome};
use crate::rng::{Generator, StreamKey};
use crate::wavelet::{Curve, RobustVariance, Tuning, classical_and_robust};
use crate::{Weighting, add_intervals, calibrate};
use rand_distr::{Distribution, StandardNormal};

pub(crate) fn generator(seed: u64, run: u64) -> Generator {
    let key = StreamKey {
        seed,
        scenario: "",
        run,
        source: "",
        process: "",
    };
    key.generator()
}

/// A draw of the standard normal distribution.
pub(crate) fn normal(generator: &mut Generator) -> f64 {
    StandardNormal.sample(generator)
}

pub(crate) fn white_and_walk(sigma2: f64, gamma2: f64) -> Composite {
    let walk = Process::random_walk(gamma2).unwrap();
    Composite::new(vec![Process::white(sigma2).unwrap(), walk])
}

/// The wavelet variances of a model at the first levels.
pub(crate) fn exact(model: &Composite, levels: u32, edof: impl Fn(u32) -> f64) -> Curve {
    Curve {
        levels: (1..=levels).collect(),
        wv: (1..=levels).map(|level| model.haar_wv(level)).collect(),
        edof: (1..=levels).map(edof).collect(),
        ..Curve::default()
    }
}

pub(crate) fn replicate(classical: Vec<f64>, robust: Vec<RobustVariance>) -> Replicate {
    Replicate {
        name: String::new(),
        axis: None,
        samples: 0,
        classical,
        robust,
        coverage: Vec::new(),
        trend: f64::NAN,
        mean: f64::NAN,
    }
}

/// The wavelet variances of a signal.
pub(crate) fn measured(name: String, signal: &[f64], levels: u32) -> Replicate {
    let (classical, robust) =
        classical_and_robust(signal, levels, &Tuning::new(0.6).unwrap()).unwrap();
    Replicate {
        name,
        samples: signal.len(),
        ..replicate(classical, robust)
    }
}

/// Classical averages, fitted with a sum of processes.
pub(crate) fn settings(spec: &str) -> CalibrationSettings {
    CalibrationSettings {
        estimators: vec![Estimator::Awv],
        model: ModelChoice::Given(spec.parse().unwrap()),
        ..CalibrationSettings::default()
    }
}

/// The same of samples a second apart, with the weights of the literature.
pub(crate) fn plain_settings(spec: &str) -> CalibrationSettings {
    CalibrationSettings {
        trim: Trim::Count(0),
        tuning: Tuning::new(0.6).unwrap(),
        weighting: Weighting::Edof,
        rate_hz: 1.0,
        ..settings(spec)
    }
}

pub(crate) fn imu<'a>(model: &'a Model, spread: Option<&'a Spread>, seed: u64) -> VirtualImu<'a> {
    VirtualImu {
        model,
        spread,
        contamination: None,
        seed,
    }
}

/// Recordings of an IMU, one group of all axes of a sensor.
pub(crate) fn recorded(
    imu: &VirtualImu<'_>,
    recordings: u64,
    channels: &[Channel],
    samples: usize,
    settings: &CalibrationSettings,
) -> Vec<Group> {
    let signals = (1..=recordings).flat_map(|run| {
        let recording = imu.recording(run, channels, samples).unwrap();
        replicates(&recording, None, &settings.tuning).unwrap()
    });
    grouped(signals.collect(), Pool::Sensor)
}

/// The first outcome of a calibration, with what other recordings would have given.
pub(crate) fn inferred(
    groups: &[Group],
    settings: &CalibrationSettings,
    draws: usize,
    seed: u64,
) -> Outcome {
    let mut outcomes = calibrate(groups, settings).unwrap();
    add_intervals(groups, &mut outcomes, settings, Bootstrap { draws, seed });
    outcomes.remove(0)
}
