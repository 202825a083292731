//! Unbiased, exactly; as known as the degrees of freedom say; robust.

use super::*;
use crate::noise::{Composite, Process, Synthesizer};
use crate::rng::{Generator, StreamKey};
use crate::wavelet::classical_and_robust;
use approx::assert_relative_eq;
use rand::{RngExt, SeedableRng};

fn tuning() -> Tuning {
    Tuning::default()
}

/// Loses bursts of so many samples until a share is missing.
fn lose(signal: &mut [f64], share: f64, burst: usize, generator: &mut Generator) {
    let mut lost = 0.0;
    while lost < share * signal.len() as f64 {
        let start = generator.random_range(0..signal.len() - burst);
        for x in &mut signal[start..start + burst] {
            lost += f64::from(u8::from(!x.is_nan()));
            *x = f64::NAN;
        }
    }
}

/// The classical variance as a quadratic form, which it is but for being no less than 0.
fn form(samples: &[f64], there: &[f64], level: u32) -> f64 {
    let observed: f64 = there.iter().sum();
    let mean = samples.iter().zip(there).map(|(x, d)| x * d).sum::<f64>() / observed;
    let samples: Vec<f64> = samples
        .iter()
        .zip(there)
        .map(|(x, d)| (x - mean) * d)
        .collect();
    let mut windows = Windows {
        sums: samples.clone(),
        counts: there.to_vec(),
        half: 1,
    };
    (1..level).for_each(|_| windows.double());
    let blocks = Blocks::new(&samples, there, windows.half);
    windows.coefficients().unwrap().mean_square() - blocks.excess(&windows)
}

/// E xᵀQx is Σ_i a_iᵀQa_i for x = Σ a_i z_i of independent z_i: white noise is the sum of pulses, random walk that of steps.
/// Whatever the holes, it is the theoretical variance to rounding.
#[test]
fn the_expectation_is_exact_whatever_the_holes() {
    const N: usize = 96;
    let of = |is: &dyn Fn(usize) -> bool| -> Vec<f64> {
        (0..N).map(|t| f64::from(u8::from(is(t)))).collect()
    };
    for (seed, burst) in [(1, 1), (2, 5), (3, 9)] {
        let mut holes = vec![1.0; N];
        lose(&mut holes, 0.15, burst, &mut Generator::seed_from_u64(seed));
        let there = of(&|t| !holes[t].is_nan());
        for level in 1..=5 {
            let tau = f64::from(level).exp2();
            let white: f64 = (0..N).map(|i| form(&of(&|t| t == i), &there, level)).sum();
            let walk: f64 = (1..N).map(|i| form(&of(&|t| t >= i), &there, level)).sum();
            assert_relative_eq!(white, 1.0 / tau, max_relative = 1e-11);
            let expected = (tau * tau + 2.0) / (12.0 * tau);
            assert_relative_eq!(walk, expected, max_relative = 1e-11);
        }
    }
}

/// WN, AR1 and RW that lead at the first, middle and last scales.
fn noise() -> Composite {
    Composite::new(vec![
        Process::white(1.0).unwrap(),
        Process::ar1(0.95, 0.02).unwrap(),
        Process::random_walk(4e-4).unwrap(),
    ])
}

fn signal(seed: u64, samples: usize) -> Vec<f64> {
    let key = StreamKey {
        seed,
        scenario: "",
        run: 0,
        source: "",
        process: "",
    };
    let mut signal = vec![0.0; samples];
    Synthesizer::new(&noise(), key).fill(&mut signal);
    signal
}

#[test]
fn without_holes_it_is_the_plain_one() {
    let signal = signal(1, 3000);
    let (classical, robust) = classical_and_robust(&signal, 10, &tuning()).unwrap();
    let found = gappy(&signal, 10, &tuning()).unwrap();
    assert_eq!(found.coverage, [1.0; 10]);
    assert_relative_eq!(found.classical[..], classical[..], max_relative = 1e-9);
    for (found, plain) in found.robust.iter().zip(&robust) {
        assert_relative_eq!(found.value, plain.value, max_relative = 1e-6);
    }
}

/// 200 records of 4096 samples without a tenth of them, singly and in bursts of 20. The mean is within four of its standard errors
/// of the theoretical variance (robust: of the same with a whole record, which reads high at the last scales), and the variance
/// over the records is what coverage makes of that of whole ones: both are known to √(2/200) = 10 %, and paired, so that
/// 30 % is four standard deviations of their ratio at scales that the holes change little, and three of it elsewhere.
#[test]
fn holes_leave_no_bias_and_cost_what_coverage_says() {
    const RECORDS: u64 = 200;
    for burst in [1, 20] {
        let measured = |seed: u64| {
            let mut x = signal(seed, 4096);
            let whole = classical_and_robust(&x, 10, &tuning()).unwrap();
            lose(&mut x, 0.1, burst, &mut Generator::seed_from_u64(seed));
            (whole, gappy(&x, 10, &tuning()).unwrap())
        };
        let all: Vec<_> = (0..RECORDS).map(measured).collect();
        let moments = |values: Vec<f64>| {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            (
                mean,
                values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0),
            )
        };
        for j in 0..10 {
            let nu = noise().haar_wv(j as u32 + 1);
            let (_, whole) = moments(all.iter().map(|(w, _)| w.0[j]).collect());
            let (mean, variance) = moments(all.iter().map(|(_, g)| g.classical[j]).collect());
            let bound = 4.0 * (variance / RECORDS as f64).sqrt();
            assert!(
                (mean - nu).abs() < bound,
                "{burst}, {j}: {mean} {nu} {bound}"
            );
            let (difference, scatter) = moments(
                all.iter()
                    .map(|(w, g)| g.robust[j].value / w.1[j].value - 1.0)
                    .collect(),
            );
            let (coverage, _) = moments(all.iter().map(|(_, g)| g.coverage[j]).collect());
            assert!(
                difference.abs() < 0.01 + 4.0 * (scatter / RECORDS as f64).sqrt(),
                "{burst}, {j}: {difference}"
            );
            assert!(
                (whole / variance / coverage - 1.0).abs() < 0.3,
                "{burst}, {j}: {} {coverage}",
                whole / variance
            );
        }
    }
}

#[test]
fn what_has_too_few_samples_is_refused_or_ends() {
    assert!(matches!(
        gappy(&[f64::NAN, 1.0], 1, &tuning()),
        Err(WaveletError::TooShort { .. })
    ));
    assert!(matches!(
        gappy(&[1.0, f64::INFINITY, 2.0], 1, &tuning()),
        Err(WaveletError::NotFinite { .. })
    ));
    assert!(matches!(
        gappy(&[1.0; 8], 4, &tuning()),
        Err(WaveletError::TooShort { .. })
    ));
    // No two neighbours: no first scale, and none after it.
    let alternate: Vec<f64> = (0..64)
        .map(|t| if t % 2 == 0 { f64::from(t) } else { f64::NAN })
        .collect();
    assert_eq!(
        gappy(&alternate, 3, &tuning()).unwrap(),
        GappyVariances::default()
    );
}
