//! Simulated laboratories: the spread that they find.

use super::*;
use crate::noise::{Composite, Law, Model, Process, Spread, Variation, VirtualImu};
use crate::{Estimator, ModelChoice, Pool, calibrate, grouped, infer, replicates};
use nav_sim_signal::imu::Channel;

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
    let white = Process::white(1.0).unwrap();
    let walk = Process::random_walk(1e-3).unwrap();
    let noise = Composite::new(vec![white, walk]);
    let law = Law::Lognormal {
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
    let imu = VirtualImu {
        model: &model,
        spread: Some(&spread),
        contamination: None,
        seed,
    };
    let settings = Settings {
        estimators: vec![estimator],
        model: ModelChoice::Given("WN+RW".parse().unwrap()),
        ..Settings::default()
    };
    let signals = (1..=recordings).flat_map(|run| {
        let recording = imu
            .recording(run, &Channel::named(channels), SAMPLES)
            .unwrap();
        replicates(&recording, None, &settings.tuning).unwrap()
    });
    let groups = grouped(signals.collect(), Pool::Sensor);
    let mut outcomes = calibrate(&groups, &settings).unwrap();
    infer(
        &groups,
        &mut outcomes,
        &settings,
        Bootstrap { draws: 99, seed: 1 },
    );
    outcomes.remove(0)
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
        let missed = own
            .iter()
            .filter(|s| s.sd_ci95[0] > 0.3 || s.sd_ci95[1] < 0.3)
            .count();
        assert!(missed <= 5, "{estimator}: {missed}");
        let missed = own
            .iter()
            .filter(|s| s.median_ci95[0] > 1.0 || s.median_ci95[1] < 1.0)
            .count();
        assert!(missed <= 5, "{estimator}: {missed}");
        assert!(
            of(Parameter::Gamma2).count() <= 4,
            "{estimator}: {}",
            of(Parameter::Gamma2).count()
        );
    }
}

/// Without spread a law is written where the test that recordings differ says so, at 2.5 %, at most: more than 4 of 30 have a
/// probability of 0.1 %. Two recordings never have one.
#[test]
fn without_spread_there_is_hardly_a_law() {
    let written = found(6, "accel.x", 0.0, Estimator::Awv)
        .iter()
        .filter(|laws| !laws.is_empty())
        .count();
    assert!(written <= 4, "{written}");
    assert!(
        found(2, "accel.x", 0.3, Estimator::Awv)
            .iter()
            .all(Vec::is_empty)
    );
}
