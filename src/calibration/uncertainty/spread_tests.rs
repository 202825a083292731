//! How replicates scatter, and how often intervals that rest on it hold the truth.

use super::*;
use crate::curve::sampling::variance_of_log;
use crate::tests::*;
use crate::wavelet::interval::edof_eta3;

/// Of replicates whose noise is nothing.
fn noiseless(logs: &[f64], estimator: Estimator) -> Scatter {
    Scatter::new(logs, &vec![1e-12; logs.len()], estimator)
}

#[test]
fn one_abnormal_value_moves_the_plain_residuals_and_hardly_the_clipped() {
    let mut logs = vec![-0.1, 0.0, 0.1, 0.05, -0.05, 0.02];
    let clean = noiseless(&logs, Estimator::DrAwv).between;
    logs[2] = 10.0;
    assert!(noiseless(&logs, Estimator::SrAwv).between > 3.0);
    assert!(noiseless(&logs, Estimator::DrAwv).between < 3.0 * clean);
    let units = noiseless(&logs, Estimator::SrAwv).units;
    assert_relative_eq!(
        units.iter().map(|u| u * u).sum::<f64>(),
        5.0,
        max_relative = 1e-9
    );
}

/// Paule and Mandel's equation by hand, two values: (x − y)²/(n₁ + n₂ + 2b²) = 1. Four within their noise: no
/// difference, and the scatter is that of the values.
#[test]
fn unequal_noise_is_allowed_for() {
    let two = Scatter::new(&[0.0, 3.0], &[1.0, 4.0], Estimator::Awv);
    assert_relative_eq!(two.between, 2.0_f64.sqrt(), max_relative = 1e-9);
    assert_relative_eq!(two.factor, 1.0, max_relative = 1e-9);
    let four = Scatter::new(&[0.0, 0.1, -0.1, 0.2], &[1.0; 4], Estimator::SrAwv);
    assert_eq!(four.between, 0.0);
    assert_relative_eq!(four.factor, (0.05_f64 / 3.0).sqrt(), max_relative = 1e-9);
    assert_eq!(weighted_median(&[5.0, 1.0, 2.0], &[1.0, 1.0, 3.0]), 2.0);
    assert_eq!(weighted_median(&[5.0, 1.0, 2.0, 4.0], &[1.0; 4]), 3.0);
}

/// 4000 draws of K Gaussian numbers: the mean of the clipped variance, corrected, is the variance (its standard
/// error is √(2/ν/4000) = 0.5 to 1.2 %, four of which and the 2 % by which the rule is off are allowed), and it scatters
/// as 0.87 (K − 1) degrees of freedom say to 15 % (that of a variance from 4000 is known to √(2/4000) = 2.2 %, the rule
/// is off by 0.09).
#[test]
fn a_clipped_variance_scatters_as_said() {
    let mut generator = Generator::seed_from_u64(2);
    for count in [5, 6, 8, 12, 24] {
        let variance = |generator: &mut Generator| {
            let x: Vec<f64> = (0..count)
                .map(|_| generator.sample(StandardNormal))
                .collect();
            noiseless(&x, Estimator::DrAwv).between.powi(2)
        };
        let drawn: Vec<f64> = (0..4000).map(|_| variance(&mut generator)).collect();
        let mean = drawn.iter().sum::<f64>() / 4000.0;
        let scatter = drawn.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 3999.0;
        assert!((mean - 1.0).abs() < 4.0 * 0.012 + 0.02, "{count}: {mean}");
        let freedom = 2.0 * mean * mean / scatter / (count as f64 - 1.0);
        assert!((freedom / 0.87 - 1.0).abs() < 0.15, "{count}: {freedom}");
    }
}

/// How often the interval of the mean of ln nu of four recordings of three axes holds what it is drawn around, where
/// recordings differ by `between` (of which the axes share all or nothing) and each signal scatters as 2^14 samples of
/// white noise do at level 1, by 1.2 %.
fn coverage(between: f64, is_shared: bool) -> f64 {
    const SETS: u32 = 1000;
    const SAMPLES: usize = 1 << 14;
    let tuning = Tuning::default();
    let model = Composite::new(vec![Process::white(1.0).unwrap()]);
    let (law, curve) = (
        SamplingDistribution::new(&model, 1),
        exact(&model, 1, |_| 1.0),
    );
    let mut generator = Generator::seed_from_u64(7);
    let mut held = 0;
    for _ in 0..SETS {
        let mut replicates = Vec::new();
        for k in 0..4 {
            let mut normal = || generator.sample::<f64, _>(StandardNormal);
            let common = normal();
            for axis in Axis::ALL {
                let differs = between * if is_shared { common } else { normal() };
                let own = variance_of_log(law.edof(SAMPLES)[0]).sqrt() * normal();
                replicates.push(Replicate {
                    name: k.to_string(),
                    axis: Some(axis),
                    samples: SAMPLES,
                    ..replicate(vec![(differs + own).exp()], Vec::new())
                });
            }
        }
        let spread = ReplicateSpread::new(&replicates, Estimator::Awv, &law, &tuning);
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / 12.0;
        let estimate = mean(&mut replicates.iter().map(|r| r.classical[0].ln()));
        let squares: f64 = (0..300)
            .map(|_| mean(&mut spread.draw(&mut generator).iter().map(|r| r[0].ln())).powi(2))
            .sum();
        let half = (squares / 300.0).sqrt() * NORMAL_975 * spread.student(&model, &curve)[0];
        held += u32::from(estimate.abs() < half);
    }
    f64::from(held) / f64::from(SETS)
}

/// 95 % is known to 0.7 % from 1000 sets, of which four are allowed and 1 % for what 300 draws leave open and the
/// rule for the degrees of freedom. Signals that share nothing may be held more often: they are 12, and their
/// interval is one of four recordings.
#[test]
fn intervals_hold_the_truth_whatever_axes_share() {
    let shared = coverage(0.3, true);
    assert_abs_diff_eq!(shared, 0.95, epsilon = 0.038);
    let apart = coverage(0.3, false);
    assert_abs_diff_eq!(apart, 0.95, epsilon = 0.038);
    // recordings that are alike: the scatter of each signal is its own
    let alike = coverage(0.0, true);
    assert!(alike > 0.95 - 0.038, "{alike}");
}

/// Four recordings, of which the last has one level: at the second the others' ln nu are −0.3, 0, 0.3 (variance 0.09, beside
/// which the noise of 2^40 samples is nothing), and so must the draws scatter. 4000 know a variance to √(2/4000) = 2.2 %, of
/// which four are allowed, and 2 % for the chi-square in place of the normal law.
#[test]
fn a_level_that_a_short_recording_lacks_scatters_as_the_others_show() {
    let law = SamplingDistribution::new(&Composite::new(vec![Process::white(1.0).unwrap()]), 2);
    let replicate = |(name, logs): (usize, &[f64])| Replicate {
        name: name.to_string(),
        samples: 1 << 40,
        ..replicate(logs.iter().map(|log| log.exp()).collect(), Vec::new())
    };
    let logs: [&[f64]; 4] = [&[0.1, -0.3], &[-0.1, 0.0], &[0.0, 0.3], &[0.0]];
    let replicates: Vec<Replicate> = logs.into_iter().enumerate().map(replicate).collect();
    let spread = ReplicateSpread::new(&replicates, Estimator::Awv, &law, &Tuning::default());
    assert_relative_eq!(spread.between[1], 0.3, max_relative = 1e-4);
    let mut generator = Generator::seed_from_u64(3);
    let drawn: Vec<f64> = (0..4000)
        .map(|_| spread.draw(&mut generator)[0][1].ln())
        .collect();
    let mean = drawn.iter().sum::<f64>() / 4000.0;
    let variance = drawn.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 3999.0;
    assert_relative_eq!(variance, 0.09, max_relative = 4.0 * 0.022 + 0.02);
}

/// White noise that differs by 0.3 from one to the next of three recordings of three axes, and a random walk that does not: what
/// leads at the levels that differ is known to 2 degrees of freedom, t₀.₉₇₅(2) = 4.3027, and the other to 8, 2.3060. Their own
/// noise at these levels, and the part of either beside the other, move the quantiles by less than 2 %.
#[test]
fn a_process_is_known_as_well_as_the_levels_it_leads_at() {
    let model = white_and_walk(1.0, 1e-4);
    let curve = exact(&model, 10, |level| edof_eta3(4096, level));
    let replicates: Vec<Replicate> = (0..9)
        .map(|k| Replicate {
            name: (k / 3).to_string(),
            axis: Some(Axis::ALL[k % 3]),
            samples: 4096,
            ..replicate(curve.wv.clone(), Vec::new())
        })
        .collect();
    let law = SamplingDistribution::new(&model, 10);
    let spread = ReplicateSpread::new(&replicates, Estimator::Awv, &law, &Tuning::default());
    let between: Vec<f64> = (1..=10)
        .map(|level| if level <= 3 { 0.3 } else { 0.0 })
        .collect();
    let found = spread.stretches(&model, &curve, &between, |_| 1.0);
    let expected = [4.302_653, 2.306_004].map(|quantile| quantile / NORMAL_975);
    assert_relative_eq!(found[..], expected[..], max_relative = 0.02);
}
