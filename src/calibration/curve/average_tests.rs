//! Averages of replicates, by hand and on coarse steps.

use super::*;
use crate::tests::*;

fn tuning() -> Tuning {
    Tuning::new(0.6).unwrap()
}

fn replicate(samples: usize, classical: f64, robust: f64) -> Replicate {
    let robust = RobustVariance {
        value: robust,
        status: RootStatus::Ok,
        zeros: 0.0,
    };
    Replicate {
        samples,
        ..crate::tests::replicate(vec![classical; 2], vec![robust; 2])
    }
}

fn eight() -> Vec<Replicate> {
    (1..=8)
        .map(|k| replicate(1000, f64::from(k), 10.0 * f64::from(k)))
        .collect()
}

fn first(replicates: &[Replicate], estimator: Estimator, trim: Trim) -> f64 {
    average(replicates, estimator, trim, &tuning()).unwrap().wv[0]
}

#[test]
fn thirty_per_cent_of_eight_is_two_at_each_end() {
    let trim = Trim::Fraction(0.3);
    assert_relative_eq!(first(&eight(), Estimator::Awv, trim), 4.5);
    assert_relative_eq!(first(&eight(), Estimator::SrAwv, trim), 45.0);
    assert_eq!([8, 10, 3].map(|n| trim.count(n)), [2, 3, 0]);
    assert_eq!(Trim::Count(2).count(8), 2);
    let mut abnormal = eight();
    abnormal[0] = replicate(1000, 0.0, 1e9);
    abnormal[1] = replicate(1000, 0.0, 1e-9);
    // Kept: 40, 50, 60, 70.
    assert_relative_eq!(first(&abnormal, Estimator::DrAwv, trim), 55.0);
    assert_relative_eq!(first(&abnormal[..1], Estimator::Rgmwm, trim), 1e9);
}

#[test]
fn longer_replicates_weigh_more_and_the_kept_weights_sum_to_one() {
    let replicates = [
        replicate(1000, 1.0, 1.0),
        replicate(3000, 5.0, 5.0),
        replicate(1000, 9.0, 100.0),
    ];
    assert_relative_eq!(first(&replicates, Estimator::Awv, Trim::Count(0)), 5.0);
    assert_relative_eq!(first(&replicates, Estimator::DrAwv, Trim::Count(1)), 5.0);
    let curve = average(&replicates[..2], Estimator::Awv, Trim::Count(0), &tuning()).unwrap();
    let eta = |samples: f64| (samples - 1.0) / 2.0;
    assert_relative_eq!(
        curve.edof[0],
        1.0 / (0.0625 / eta(1000.0) + 0.5625 / eta(3000.0))
    );
    assert_relative_eq!(curve.wv[0], 4.0);
}

/// Four of 1000 samples with two levels, and one of 10 with one: the second level is the average of the four, with the
/// trim of four. Of two replicates one alone is no majority.
#[test]
fn a_level_is_averaged_over_the_replicates_that_have_it() {
    let mut replicates = eight()[..4].to_vec();
    replicates.push(replicate(10, 500.0, 500.0));
    replicates[4].classical.pop();
    replicates[4].robust.pop();
    let curve = |estimator, trim| average(&replicates, estimator, trim, &tuning()).unwrap();
    let awv = curve(Estimator::Awv, Trim::Count(0));
    assert_eq!(awv.levels, [1, 2]);
    assert_relative_eq!(
        awv.wv[0],
        (10.0 * 1000.0 + 10.0 * 500.0) / 4010.0,
        max_relative = 1e-14
    );
    assert_relative_eq!(awv.wv[1], 2.5);
    // floor(0.3·5) = floor(0.3·4) = 1: of 10, 20, 30, 40, 500 and of 10, 20, 30, 40.
    let trimmed = curve(Estimator::DrAwv, Trim::Fraction(0.3));
    assert_relative_eq!(trimmed.wv[0], 30.0);
    assert_relative_eq!(trimmed.wv[1], 25.0);
    // Two at each end leave one of five and none of four.
    assert_eq!(curve(Estimator::DrAwv, Trim::Count(2)).levels, [1]);
    let levels = |kept: &[Replicate]| {
        average(kept, Estimator::Awv, Trim::Count(0), &tuning())
            .unwrap()
            .levels
            .len()
    };
    assert_eq!((levels(&replicates[3..]), levels(&replicates[2..])), (1, 2));
}

#[test]
fn equal_replicates_multiply_the_degrees_of_freedom() {
    let curve = average(&eight(), Estimator::DrAwv, Trim::Count(2), &tuning()).unwrap();
    assert_relative_eq!(curve.edof[0], 4.0 * 0.6 * 499.5, max_relative = 1e-12);
}

/// 4000 sets of variances that are chi-squares of 2 eta3 degrees, eta3 = (T − 1)/2 at level 1: the median of ln of the trimmed
/// mean less its bias is 0 to four of its standard errors (1.2533 of those of a mean) and 0.02 for so few of the many of the formula.
#[test]
fn a_trimmed_mean_of_skewed_variances_is_centred() {
    let mut generator = generator(3, 0);
    for (count, trim, eta3) in [(4, 1, 1), (8, 2, 1), (8, 2, 3), (15, 4, 1), (15, 4, 3)] {
        let degrees = 2.0 * f64::from(eta3);
        let law = rand_distr::ChiSquared::new(degrees).unwrap();
        let coarse = RobustVariance {
            value: f64::NAN,
            status: RootStatus::Coarse,
            zeros: 0.0,
        };
        let mut drawn = |_| Replicate {
            samples: 2 * eta3 as usize + 1,
            ..crate::tests::replicate(vec![generator.sample(law) / degrees], vec![coarse])
        };
        let mut centred = |_| {
            let replicates: Vec<Replicate> = (0..count).map(&mut drawn).collect();
            let trim = Trim::Count(trim);
            let curve = average(&replicates, Estimator::DrAwv, trim, &tuning()).unwrap();
            curve.wv[0].ln() - curve.log_bias[0]
        };
        let logs: Vec<f64> = (0..4000).map(&mut centred).collect();
        let middle = median(&logs);
        let square = logs.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / 4000.0;
        let allowed = 4.0 * 1.2533 * (square / 4000.0).sqrt() + 0.02;
        assert!(
            middle.abs() < allowed,
            "{count} {trim} {eta3}: {middle} {allowed}"
        );
    }
}

/// Gaussian numbers of 0.3 steps, rounded: nu of level j is their variance over 2^j, that of the law of three numbers −1, 0,
/// 1 (0.2 % beyond; P(1) = P(Z > 5/3) = 0.0478, variance 0.0956). Every scale counts and is right to four standard deviations,
/// √(2/eta), and the 1.3 % of fine steps; the first is the classical variance, with all its degrees of freedom.
#[test]
fn scales_that_coarse_steps_move_are_classical() {
    let mut generator = generator(5, 0);
    let mut number = || (0.3 * normal(&mut generator)).round();
    let signal: Vec<f64> = (0..1 << 17).map(|_| number()).collect();
    let one = [measured(String::new(), &signal, 9)];
    let curve = |estimator| average(&one, estimator, Trim::Count(0), &tuning()).unwrap();
    assert_eq!(curve(Estimator::Gmwm).ignored, [0; 0]);
    let curve = curve(Estimator::Rgmwm);
    assert!(
        curve.ignored.is_empty() && curve.classical.contains(&1),
        "{curve:?}"
    );
    assert_relative_eq!(curve.edof[0], interval::edof_eta3(1 << 17, 1));
    for ((level, nu), edof) in curve.levels.iter().zip(&curve.wv).zip(&curve.edof) {
        let off = (nu / (0.0956 / f64::from(*level).exp2()) - 1.0).abs();
        let allowed = 0.013 + 4.0 * (2.0 / edof).sqrt();
        assert!(off < allowed, "level {level}: {off}");
    }
}

/// Two of three replicates without a root at the first level: its value is the classical average, which no fit counts.
#[test]
fn a_scale_without_a_root_is_bounded_by_the_classical_average() {
    let mut replicates = eight()[..3].to_vec();
    replicates[..2]
        .iter_mut()
        .for_each(|r| r.robust[0].status = RootStatus::NoRoot);
    let curve = average(&replicates, Estimator::SrAwv, Trim::Count(0), &tuning()).unwrap();
    assert_eq!((curve.ignored, curve.classical), (vec![1], vec![1]));
    assert_relative_eq!(curve.wv[0], 2.0);
    assert_relative_eq!(curve.wv[1], 20.0);
}

#[test]
fn what_cannot_be_averaged_is_refused() {
    for (replicates, estimator, trim, expected) in [
        (0, Estimator::Awv, 0, "no replicates"),
        (
            8,
            Estimator::DrAwv,
            4,
            "a trim of 4 at each end needs 9 replicates; there are 8",
        ),
        (
            8,
            Estimator::Gmwm,
            0,
            "gmwm takes one recording at a time; there are 8",
        ),
    ] {
        let some = &eight()[..replicates];
        let error = average(some, estimator, Trim::Count(trim), &tuning()).unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
}
