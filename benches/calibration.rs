//! Calibration kernels at the size of the paper's signals (524284 samples), beside a naive reference.

#![allow(clippy::unwrap_used, reason = "a benchmark")]

use criterion::{Criterion, criterion_group, criterion_main};

use nav_sim::calibration::{
    Bootstrap, CalibrationSettings, Group, ModelSpec, Replicate, Scope, Weighting, add_intervals,
    calibrate, fit,
};
use nav_sim::signal::imu::Sensor;
use nav_sim::signal::noise::Process;
use nav_sim::signal::rng::StreamKey;
use nav_sim::signal::wavelet;
use nav_sim::signal::wavelet::{Curve, RobustVariance, RootStatus, Tuning};
use nav_sim_signal::wavelet::interval;
use rand::RngExt;
use rand_distr::StandardNormal;
use std::hint::black_box;
use std::time::Duration;

const SAMPLES: usize = 524_284;
const LEVELS: u32 = 18;

/// White noise, AR1 and random walk of the paper's Section IV.
fn signal() -> Vec<f64> {
    let key = StreamKey {
        seed: 1,
        scenario: "bench",
        run: 0,
        source: "accel.x",
        process: "N1",
    };
    let mut generator = key.generator();
    let mut normal = || generator.sample::<f64, _>(StandardNormal);
    let (mut ar1, mut walk) = (0.0, 0.0);
    (0..SAMPLES)
        .map(|_| {
            ar1 = 0.986 * ar1 + 1.2e-4 * normal();
            walk += 5.8e-6 * normal();
            7.4e-3 * normal() + ar1 + walk
        })
        .collect()
}

/// The definition, with prefix sums.
fn naive_classical(signal: &[f64], levels: u32) -> Vec<f64> {
    let mut prefix = vec![0.0; signal.len() + 1];
    for (t, x) in signal.iter().enumerate() {
        prefix[t + 1] = prefix[t] + x;
    }
    let level = |j: u32| {
        let m = 1_usize << (j - 1);
        let w = |t: usize| (prefix[t + 2 * m] - 2.0 * prefix[t + m] + prefix[t]) / (2 * m) as f64;
        let count = signal.len() - 2 * m + 1;
        (0..count).map(|t| w(t) * w(t)).sum::<f64>() / count as f64
    };
    (1..=levels).map(level).collect()
}

fn wavelet_variance(c: &mut Criterion) {
    let signal = signal();
    let tuning = Tuning::new(0.6).unwrap();
    let mut group = c.benchmark_group("wavelet variance, 524284 samples, 18 scales");
    group
        .sample_size(20)
        .measurement_time(Duration::from_secs(3));
    group.bench_function("classical", |b| {
        b.iter(|| wavelet::classical(black_box(&signal), LEVELS))
    });
    group.bench_function("classical, naive", |b| {
        b.iter(|| naive_classical(black_box(&signal), LEVELS))
    });
    group.bench_function("classical and robust", |b| {
        b.iter(|| wavelet::classical_and_robust(black_box(&signal), LEVELS, &tuning));
    });
    group.finish();
}

/// A day at 200 Hz: longer than any cache.
fn a_day(c: &mut Criterion) {
    let signal: Vec<f64> = signal().into_iter().cycle().take(17_280_000).collect();
    let tuning = Tuning::new(0.6).unwrap();
    let mut group = c.benchmark_group("wavelet variance, 17280000 samples, 23 scales");
    group.sample_size(10);
    group.bench_function("classical and robust", |b| {
        b.iter(|| wavelet::classical_and_robust(black_box(&signal), 23, &tuning));
    });
    group.finish();
}

/// The N2 curve of a consumer accelerometer, its wavelet variances off by a few of their standard deviations.
fn noisy_curve() -> Curve {
    let levels: Vec<u32> = (1..=LEVELS).collect();
    let n2 = [
        Process::white(5.2e-5).unwrap(),
        Process::quantization(1e-7).unwrap(),
        Process::ar1(0.9835, 1.3e-8).unwrap(),
        Process::ar1(0.9999, 1e-11).unwrap(),
        Process::random_walk(2.9e-11).unwrap(),
    ];
    let edof: Vec<f64> = levels
        .iter()
        .map(|j| interval::edof_eta3(SAMPLES, *j))
        .collect();
    let exact = |j: u32| n2.iter().map(|p| p.haar_wv(j)).sum::<f64>();
    let noisy = |(j, edof): (&u32, &f64)| {
        exact(*j) * (1.0 + f64::from(*j).sin() * (2.0 / edof).sqrt().min(0.5))
    };
    Curve {
        wv: levels.iter().zip(&edof).map(noisy).collect(),
        edof,
        levels,
        ..Curve::default()
    }
}

fn fits(c: &mut Criterion) {
    let curve = noisy_curve();
    let mut group = c.benchmark_group("fit");
    group
        .sample_size(20)
        .measurement_time(Duration::from_secs(3));
    for spec in [ModelSpec::n1(), ModelSpec::n2()] {
        group.bench_function(spec.to_string(), |b| {
            b.iter(|| fit(black_box(&curve), &spec, 100.0, Weighting::Edof));
        });
    }
    group.finish();
}

/// Intervals of N2 from 99 draws of three replicates.
fn bootstrap(c: &mut Criterion) {
    let curve = noisy_curve();
    let replicate = |k: i32| {
        let noisy = curve.wv.iter().zip(&curve.edof).enumerate();
        let noisy = noisy.map(|(j, (nu, edof))| {
            let phase = f64::from(k) + 1.7 * j as f64;
            nu * (1.0 + phase.sin() * (2.0 / edof).sqrt().min(0.5))
        });
        let classical: Vec<f64> = noisy.collect();
        let robust = |nu: &f64| RobustVariance {
            value: *nu,
            status: RootStatus::Ok,
            zeros: 0.0,
        };
        Replicate {
            name: k.to_string(),
            axis: None,
            samples: SAMPLES,
            robust: classical.iter().map(robust).collect(),
            classical,
            coverage: Vec::new(),
            trend: f64::NAN,
            mean: f64::NAN,
        }
    };
    let scope = Scope {
        sensor: Sensor::Accel,
        axis: None,
    };
    let replicates = (0..3).map(replicate).collect();
    let groups = [Group { scope, replicates }];
    let settings = CalibrationSettings::default();
    let outcomes = calibrate(&groups, &settings).unwrap();
    let bootstrap = Bootstrap { draws: 99, seed: 1 };
    let mut group = c.benchmark_group("bootstrap");
    group
        .sample_size(10)
        .measurement_time(Duration::from_secs(5));
    group.bench_function("N2, 99 draws", |b| {
        b.iter(|| add_intervals(&groups, &mut outcomes.clone(), &settings, bootstrap));
    });
    group.finish();
}

criterion_group!(benches, wavelet_variance, a_day, fits, bootstrap);
criterion_main!(benches);
