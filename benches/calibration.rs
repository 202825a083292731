//! Calibration kernels at the size of the paper's signals (524284 samples), beside a naive reference.

use criterion::{Criterion, criterion_group, criterion_main};

use nav_sim::rng::StreamKey;
use nav_sim::wavelet::{self, Convention, Tuning};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::hint::black_box;
use std::time::Duration;

const SAMPLES: usize = 524_284;
const LEVELS: u32 = 18;

/// White noise, AR1 and random walk of the paper's Section IV.
fn signal() -> Vec<f64> {
    let key = StreamKey { seed: 1, scenario: "bench", run: 0, source: "accel.x", process: "N1" };
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
    let tuning = Tuning::new(0.6, Convention::Exact).unwrap();
    let mut group = c.benchmark_group("wavelet variance, 524284 samples, 18 scales");
    group.sample_size(20).measurement_time(Duration::from_secs(3));
    group.bench_function("classical", |b| b.iter(|| wavelet::classical(black_box(&signal), LEVELS)));
    group.bench_function("classical, naive", |b| b.iter(|| naive_classical(black_box(&signal), LEVELS)));
    group.bench_function("classical and robust", |b| {
        b.iter(|| wavelet::both(black_box(&signal), LEVELS, &tuning));
    });
    group.finish();
}

criterion_group!(benches, wavelet_variance);
criterion_main!(benches);
