//! Simulated laboratories: the spread that they find.

use super::*;
use crate::Estimator;
use crate::imu::Channel;
use crate::noise::{Model, ParameterDistribution, Spread, Variation};
use crate::tests::{imu, inferred, recorded, settings, white_and_walk};

const SAMPLES: usize = 4096;
const LABORATORIES: u64 = 30;

/// What a laboratory finds by a model; sigma2 of its recordings differs by a lognormal law about 1.
fn laboratory(
    seed: u64,
    recordings: u64,
    channels: &str,
    sd: f64,
    estimator: Estimator,
) -> Outcome {
    let noise = white_and_walk(1.0, 1e-3);
    let law = ParameterDistribution::Lognormal {
        median: 1.0,
        sd,
        median_ci95: None,
        sd_ci95: None,
    };
    let variation = Variation::new(&noise, "WN", "sigma2", law).unwrap();
    let spread = Spread {
        axes: std::array::from_fn(|_| vec![variation.clone()]),
    };
    let model = Model::pooled(1.0, &noise, &noise);
    let imu = imu(&model, Some(&spread), seed);
    let settings = CalibrationSettings {
        estimators: vec![estimator],
        ..settings("WN+RW")
    };
    let groups = recorded(
        &imu,
        recordings,
        &Channel::named(channels),
        SAMPLES,
        &settings,
    );
    inferred(&groups, &settings, 99, 1)
}

fn found(
    recordings: u64,
    channels: &str,
    sd: f64,
    estimator: Estimator,
) -> Vec<Vec<ParameterSpread>> {
    let seeds = (0..LABORATORIES).into_par_iter();
    seeds
        .map(|seed| {
            laboratory(seed, recordings, channels, sd, estimator)
                .inference
                .unwrap()
                .varying
        })
        .collect()
}

/// Thirty laboratories whose white noise has a log-sd of 0.3 between recordings. A variance of f degrees of freedom is known to
/// √(2/f), its root in the mean to 1/(4f) low (c4): the mean of 30 estimates is within three of its standard errors
/// 0.3/√(2f·30) of that. An interval of 95 % misses in 1.5 of 30: more than 5 have a probability of 0.3 % (binomial). The random
/// walk, which does not differ, has no law but by the 2.5 % of its interval: more than 4 of 30 have one of 0.1 %.
#[test]
fn laboratories_find_the_spread_there_is() {
    for (recordings, channels, estimator, freedom) in [
        (6, "accel.x", Estimator::Awv, 5.0),
        (6, "accel.x", Estimator::DrAwv, 4.35),
        (4, "accel", Estimator::Awv, 9.0),
    ] {
        let all = found(recordings, channels, 0.3, estimator);
        let of = |kind: Parameter| all.iter().flatten().filter(move |s| s.of.parameter == kind);
        let own: Vec<&ParameterSpread> = of(Parameter::Sigma2).collect();
        assert_eq!(
            own.len(),
            30,
            "{estimator}: noise of 3 % hides no spread of 30 %"
        );
        let mean = own.iter().map(|s| s.sd).sum::<f64>() / 30.0;
        let error = 0.3 / (2.0 * freedom * 30.0_f64).sqrt();
        assert!(
            (mean - 0.3 * (1.0 - 0.25 / freedom)).abs() < 3.0 * error,
            "{estimator}: {mean}"
        );
        let misses = |of: fn(&ParameterSpread) -> [f64; 2], truth: f64| {
            own.iter()
                .filter(|s| of(s)[0] > truth || of(s)[1] < truth)
                .count()
        };
        let missed = [misses(|s| s.sd_ci95, 0.3), misses(|s| s.median_ci95, 1.0)];
        assert!(missed.iter().all(|n| *n <= 5), "{estimator}: {missed:?}");
        let walks = of(Parameter::Gamma2).count();
        assert!(walks <= 4, "{estimator}: {walks}");
    }
}

/// Without spread a law is written where the test that recordings differ says so, at 2.5 %, at most: more than 4 of 30 have a
/// probability of 0.1 %. Two recordings never have one.
#[test]
fn without_spread_there_is_hardly_a_law() {
    let written = |recordings, sd| {
        let all = found(recordings, "accel.x", sd, Estimator::Awv);
        all.iter().filter(|laws| !laws.is_empty()).count()
    };
    assert!(written(6, 0.0) <= 4);
    assert_eq!(written(2, 0.3), 0);
}
