use super::*;
use crate::imu::Axis;
use crate::noise::Process;
use approx::{assert_abs_diff_eq, assert_relative_eq};

const X: Channel = Channel {
    sensor: Sensor::Accel,
    axis: Axis::X,
};

fn rule(operation: Operation) -> Rule {
    Rule {
        sensor: Sensor::Accel,
        replicate: Some(2),
        operation,
        place: String::new(),
    }
}

/// Rules for the accelerometers of the second replicate.
pub(crate) fn contamination(operations: impl IntoIterator<Item = Operation>) -> Contamination {
    Contamination {
        name: "test".into(),
        rules: operations.into_iter().map(rule).collect(),
    }
}

fn replace(points: Extent, block: u64, mean: Option<f64>, sigma: f64) -> Operation {
    Operation::Replace {
        points,
        block: Extent::Samples(block),
        mean,
        sigma,
    }
}

fn applied(operation: Operation, n: usize) -> Vec<f64> {
    let mut x = vec![0.0; n];
    contamination([operation])
        .apply(&mut x, X, 2, 100.0, 1)
        .unwrap();
    x
}

#[test]
fn shares_of_the_papers_records() {
    let samples = |share: f64| Extent::Share(share).of(524_284);
    assert_eq!(
        (samples(0.00025), samples(0.01), samples(0.5)),
        (131, 5242, 262_142)
    );
    assert_eq!(
        (samples(90_000.0 / 524_284.0), samples(500.0 / 524_284.0)),
        (90_000, 500)
    );
    assert_eq!(Extent::Samples(7).of(3), 7);
}

#[test]
fn a_step_is_from_the_middle_on() {
    let step = Operation::Step {
        at: Extent::Share(0.5),
        amplitude: 2.0,
    };
    assert_eq!(applied(step, 5), [0.0, 0.0, 2.0, 2.0, 2.0]);
}

/// Mean and variance of the replaced samples within 5 standard deviations; exactly as many as asked,
/// half of them in the first half (binomial-like, hypergeometric: sd below √n/2).
#[test]
fn replacement_is_exact_in_number_and_random_in_place() {
    let mut x = vec![100.0; 200_000];
    let replace_all = contamination([replace(Extent::Samples(1000), 1, None, 0.0)]);
    let mut kept = vec![7.0; 1000];
    replace_all.apply(&mut kept, X, 2, 100.0, 1).unwrap();
    assert_eq!(
        kept, [7.0; 1000],
        "the mean of the signal, if none is given"
    );
    let some = contamination([replace(Extent::Share(0.1), 1, Some(-1.0), 0.5)]);
    some.apply(&mut x, X, 2, 100.0, 1).unwrap();
    let replaced: Vec<f64> = x.iter().copied().filter(|v| *v < 50.0).collect();
    assert_eq!(replaced.len(), 20_000);
    let n = replaced.len() as f64;
    let mean = replaced.iter().sum::<f64>() / n;
    let variance = replaced.iter().map(|v| (v + 1.0).powi(2)).sum::<f64>() / n;
    assert!((mean + 1.0).abs() < 5.0 * 0.5 / n.sqrt());
    assert_abs_diff_eq!(variance, 0.25, epsilon = 5.0 * 0.25 * (2.0 / n).sqrt());
    let first_half = x[..100_000].iter().filter(|v| **v < 50.0).count() as f64;
    assert_abs_diff_eq!(first_half, n / 2.0, epsilon = 5.0 * n.sqrt() / 2.0);
}

#[test]
fn bursts_are_sines_at_multiples_of_the_spacing() {
    let bursts = Operation::Bursts {
        count: 2,
        length: Extent::Samples(40),
        spacing: Extent::Samples(100),
        amplitude: 0.02,
        frequency_hz: 5.0,
    };
    let x = applied(bursts.clone(), 240);
    // 5 Hz at 100 Hz: 20 samples a period.
    for (k, v) in x.iter().enumerate() {
        let inside = (100..140).contains(&k) || (200..240).contains(&k);
        let expected = if inside {
            0.02 * (std::f64::consts::TAU * (k % 20) as f64 / 20.0).sin()
        } else {
            0.0
        };
        assert!((v - expected).abs() < 1e-15, "{k}");
    }
    let mut short = vec![0.0; 239];
    let e = contamination([bursts])
        .apply(&mut short, X, 2, 100.0, 1)
        .unwrap_err();
    let expected = "a train of bursts needs 240 samples, the record has 239";
    assert_eq!(e.to_string(), expected);
    let placed = RefusedRule {
        place: "a.toml, line 3".into(),
        ..e
    };
    assert_eq!(placed.to_string(), format!("a.toml, line 3: {expected}"));
}

#[test]
fn the_added_ar1_has_its_variance() {
    let ar1 = Process::ar1(0.9, 1.9).unwrap();
    let x = applied(Operation::Ar1(ar1), 100_000);
    let variance = x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64;
    // Bartlett: var of the sample variance 2γ₀²/n · (1 + φ²)/(1 − φ²).
    let bound = 5.0 * 10.0 * (2.0 / 1e5 * 1.81 / 0.19_f64).sqrt();
    assert_abs_diff_eq!(variance, 10.0, epsilon = bound);
}

/// What a second rule adds is as large as what the first does and has no correlation with it: of 100 000 samples with phi = 0.9 as
/// many as (1 − phi²)/(1 + phi²) of them are independent, 10 500, whose correlation is 0 ± 0.01.
#[test]
fn two_ar1_rules_are_independent() {
    let ar1 = || Operation::Ar1(Process::ar1(0.9, 1.9).unwrap());
    let first = applied(ar1(), 100_000);
    let mut second = vec![0.0; first.len()];
    let both = contamination([ar1(), ar1()]);
    both.apply(&mut second, X, 2, 100.0, 1).unwrap();
    second
        .iter_mut()
        .zip(&first)
        .for_each(|(both, a)| *both -= a);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let correlation = product(&first, &second) / product(&first, &first);
    assert_abs_diff_eq!(correlation, 0.0, epsilon = 0.04);
    assert_relative_eq!(
        product(&second, &second),
        product(&first, &first),
        max_relative = 0.06
    );
}

#[test]
fn the_order_is_fixed_and_other_signals_are_untouched() {
    let step = Operation::Step {
        at: Extent::Samples(0),
        amplitude: 1.0,
    };
    let both = contamination([replace(Extent::Share(1.0), 1, Some(0.0), 0.0), step]);
    let mut x = vec![5.0; 4];
    both.apply(&mut x, X, 2, 100.0, 1).unwrap();
    assert_eq!(x, [0.0; 4], "the step comes before the replacement");
    let gyro = Channel {
        sensor: Sensor::Gyro,
        axis: Axis::X,
    };
    for (channel, replicate) in [(X, 1), (gyro, 2)] {
        let mut x = vec![5.0; 4];
        both.apply(&mut x, channel, replicate, 100.0, 1).unwrap();
        assert_eq!(x, [5.0; 4]);
    }
    assert!(both.touches(2) && !both.touches(1));
}

#[test]
fn parameters_are_scaled_for_their_replicate_only() {
    let noise = || {
        Composite::new(vec![
            Process::white(1.0).unwrap(),
            Process::random_walk(3.0).unwrap(),
        ])
    };
    let scale = |process: &str| {
        let (process, parameter) = (process.to_owned(), "gamma2".to_owned());
        contamination([Operation::Scale {
            process,
            parameter,
            factor: 4.0,
        }])
    };
    let (mut second, mut third) = (noise(), noise());
    scale("RW").scale(&mut second, X, 2).unwrap();
    scale("RW").scale(&mut third, X, 3).unwrap();
    assert_eq!(second.processes[1].parameters(), [("gamma2", 12.0)]);
    assert_eq!(third, noise());
    let e = scale("RW_2").scale(&mut second, X, 2).unwrap_err();
    assert_eq!(
        e.to_string(),
        "accel.x has no RW_2 gamma2 to scale, only WN sigma2, RW gamma2"
    );
}

#[test]
fn the_same_points_are_replaced_whatever_else_is_done() {
    let replace = replace(Extent::Samples(10), 1, Some(0.0), 1.0);
    let alone = applied(replace.clone(), 1000);
    let (length, spacing) = (Extent::Samples(1), Extent::Samples(999));
    let bursts = Operation::Bursts {
        count: 1,
        length,
        spacing,
        amplitude: 0.0,
        frequency_hz: 1.0,
    };
    let mut x = vec![0.0; 1000];
    contamination([bursts, replace])
        .apply(&mut x, X, 2, 100.0, 1)
        .unwrap();
    assert_eq!(x, alone);
}

/// 1000 points in blocks of 64: fifteen whole ones and one of 40, apart or side by side; every place as likely (the
/// mean position of 16 blocks is known to n/√(12·16)).
#[test]
fn blocks_are_whole_and_anywhere() {
    let n = 100_000;
    let mut centre = 0.0;
    for seed in 0..40 {
        let mut x = vec![1.0; n];
        let blocks = contamination([replace(Extent::Samples(1000), 64, Some(0.0), 0.0)]);
        blocks.apply(&mut x, X, 2, 100.0, seed).unwrap();
        let replaced: Vec<usize> = (0..n).filter(|k| x[*k] == 0.0).collect();
        assert_eq!(replaced.len(), 1000);
        let runs = x.chunk_by(|a, b| a == b).filter(|run| run[0] == 0.0);
        let lengths: Vec<usize> = runs.map(<[f64]>::len).collect();
        assert!(
            lengths.iter().all(|l| [0, 40].contains(&(l % 64))),
            "{lengths:?}"
        );
        centre += replaced.iter().map(|k| *k as f64).sum::<f64>() / 1000.0 / 40.0;
    }
    let deviation = n as f64 / (12.0_f64 * 16.0 * 40.0).sqrt();
    assert_abs_diff_eq!(centre, 0.5 * n as f64, epsilon = 5.0 * deviation);
}

#[test]
fn a_drift_goes_from_nothing_to_its_amplitude() {
    assert_eq!(
        applied(Operation::Drift { amplitude: 2.0 }, 5),
        [0.0, 0.5, 1.0, 1.5, 2.0]
    );
    assert_eq!(applied(Operation::Drift { amplitude: 2.0 }, 1), [0.0]);
}

/// Student's t with 10 degrees of freedom: variance 10/8, kurtosis 4 (6/(10 − 4) above normal's 3), of which the variance of
/// 200 000 samples is known to √(3/n) of itself; two degrees have none.
#[test]
fn heavy_tails_are_students() {
    let n = 200_000;
    let tails = Operation::HeavyTails {
        freedom: 10.0,
        sigma: 3.0,
    };
    let x = applied(tails, n);
    let variance = x.iter().map(|v| v * v).sum::<f64>() / n as f64;
    assert_relative_eq!(
        variance,
        9.0 * 1.25,
        max_relative = 5.0 * (3.0 / n as f64).sqrt()
    );
    let beyond = x.iter().filter(|v| v.abs() > 3.0 * 4.587).count() as f64;
    // P(|t| > 4.587) = 0.001 with ten degrees of freedom
    assert_abs_diff_eq!(beyond, 200.0, epsilon = 5.0 * 200.0_f64.sqrt());
}
