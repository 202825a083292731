//! Laws, their draws and their refusals.

use super::*;
use crate::noise::{Process, ProcessKind};
use approx::assert_abs_diff_eq;

const RATE: f64 = 100.0;

fn n1() -> Composite {
    let process = |code, values: &[f64]| {
        Process::of_values(ProcessKind::named(code).unwrap(), values, RATE).unwrap()
    };
    Composite::new(vec![
        process("WN", &[5e-5]),
        process("AR1", &[0.985, 1.5e-8]),
        process("RW", &[3e-11]),
    ])
}

fn spread(process: &str, parameter: &str, law: ParameterDistribution) -> Spread {
    let variation = Variation::new(&n1(), process, parameter, law).unwrap();
    Spread {
        axes: std::array::from_fn(|_| vec![variation.clone()]),
    }
}

fn drawn(spread: &Spread, replicates: u64, axis: usize, at: (usize, usize)) -> Vec<f64> {
    let model = Model::pooled(RATE, &n1(), &n1());
    let value = |r| spread.draw(&model, 1, r).axes[axis].processes[at.0].parameters()[at.1].1;
    (0..replicates).map(value).collect()
}

/// Mean a/(a+b) and variance ab/((a+b)²(a+b+1)) of a beta law; the mean of n draws is within 5 of its
/// standard deviations.
#[test]
fn beta_has_its_range_and_moments() {
    let (a, b, low, width) = (6.0, 2.0, 0.983_548_9, 3.447_648_9e-3);
    let x = drawn(
        &spread(
            "AR1",
            "phi",
            ParameterDistribution::Beta { a, b, low, width },
        ),
        4000,
        0,
        (1, 0),
    );
    assert!(x.iter().all(|v| (low..=low + width).contains(v)));
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let variance = width * width * a * b / ((a + b) * (a + b) * (a + b + 1.0));
    assert_abs_diff_eq!(
        mean,
        low + width * 0.75,
        epsilon = 5.0 * (variance / n).sqrt()
    );
    // The law is lighter-tailed than the normal: the variance's standard deviation is below the normal's.
    let sample = x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    assert_abs_diff_eq!(
        sample,
        variance,
        epsilon = 5.0 * variance * (2.0 / n).sqrt()
    );
}

/// Truncated at 0 from a standard normal about 0: mean √(2/π)·sd, variance (1 − 2/π)·sd².
#[test]
fn normal_is_truncated_to_the_domain() {
    let mut noise = n1();
    noise.processes[0] = Process::white(0.0).unwrap();
    let law = ParameterDistribution::Normal { sd: 2.0 };
    let variation = Variation::new(&noise, "WN", "sigma2", law).unwrap();
    let mut spread = Spread::default();
    spread.axes[0].push(variation);
    let model = Model::pooled(RATE, &noise, &noise);
    let x: Vec<f64> = (0..4000)
        .map(|r| spread.draw(&model, 1, r).axes[0].processes[0].parameters()[0].1)
        .collect();
    let n = x.len() as f64;
    let (mean, pi) = (x.iter().sum::<f64>() / n, std::f64::consts::PI);
    assert!(x.iter().all(|v| *v >= 0.0));
    let bound = 5.0 * 2.0 * ((1.0 - 2.0 / pi) / n).sqrt();
    assert_abs_diff_eq!(mean, 2.0 * (2.0 / pi).sqrt(), epsilon = bound);
}

/// The logarithm of sigma2 and that of the correlation time of phi, −1/ln phi, are normal: the mean of 4000 is within five of
/// its standard deviations, their deviation within five of 1/√8000.
#[test]
fn lognormal_is_of_variances_and_of_correlation_times() {
    let law = |median| ParameterDistribution::Lognormal {
        median,
        sd: 0.3,
        median_ci95: None,
        sd_ci95: None,
    };
    let time = |phi: f64| -1.0 / phi.ln();
    for (process, parameter, at, median, of) in [
        ("WN", "sigma2", (0, 0), 5e-5, (|x| x) as fn(f64) -> f64),
        ("AR1", "phi", (1, 0), 0.98, time),
    ] {
        let x = drawn(&spread(process, parameter, law(median)), 4000, 0, at);
        let logs: Vec<f64> = x.iter().map(|x| (of(*x) / of(median)).ln()).collect();
        let n = logs.len() as f64;
        let mean = logs.iter().sum::<f64>() / n;
        let sd = (logs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
        assert!(mean.abs() < 5.0 * 0.3 / n.sqrt(), "{process}: {mean}");
        assert!(
            (sd / 0.3 - 1.0).abs() < 5.0 / (2.0 * n).sqrt(),
            "{process}: {sd}"
        );
    }
}

#[test]
fn axes_and_replicates_draw_for_themselves_and_repeat() {
    let s = spread(
        "WN",
        "sigma2",
        ParameterDistribution::Beta {
            a: 3.0,
            b: 4.0,
            low: 5e-5,
            width: 5e-6,
        },
    );
    let (x, y) = (drawn(&s, 3, 0, (0, 0)), drawn(&s, 3, 1, (0, 0)));
    assert_ne!(x[..1], x[1..2]);
    assert_ne!(x, y);
    assert_eq!(x, drawn(&s, 3, 0, (0, 0)));
}

#[test]
fn what_is_not_drawn_keeps_its_value() {
    let s = spread("WN", "sigma2", ParameterDistribution::Normal { sd: 1e-6 });
    assert_eq!(drawn(&s, 5, 3, (1, 0)), [0.985; 5]);
}

#[test]
fn impossible_laws_are_refused_in_words() {
    let beta = |a, low, width| ParameterDistribution::Beta {
        a,
        b: 1.0,
        low,
        width,
    };
    let lognormal = |median, sd| ParameterDistribution::Lognormal {
        median,
        sd,
        median_ci95: None,
        sd_ci95: None,
    };
    let normal = |sd| ParameterDistribution::Normal { sd };
    for (process, parameter, law, expected) in [
        (
            "AR1_2",
            "phi",
            normal(0.1),
            "the model has no process \"AR1_2\" there, only WN, AR1, RW",
        ),
        (
            "AR1",
            "ph",
            normal(0.1),
            "AR1 has no parameter \"ph\", only phi, sigma2",
        ),
        (
            "WN",
            "sigma2",
            beta(0.0, 0.0, 1.0),
            "a = 0 is not a finite number > 0",
        ),
        ("AR1", "phi", normal(2.0), "sd = 2 is not between 0 and 1"),
        (
            "WN",
            "sigma2",
            normal(f64::NAN),
            "sd = NaN is not a finite number ≥ 0",
        ),
        (
            "WN",
            "sigma2",
            lognormal(0.0, 0.1),
            "median = 0 is not a finite number > 0",
        ),
        (
            "WN",
            "sigma2",
            lognormal(1.0, 11.0),
            "sd = 11 is not between 0 and 10",
        ),
        (
            "AR1",
            "phi",
            beta(1.0, 0.5, 0.5),
            "the distribution reaches refused values: AR1: phi = 1 is not between −1 and 1 (exclusive)",
        ),
    ] {
        let refusal = Variation::new(&n1(), process, parameter, law).unwrap_err();
        assert_eq!(refusal.to_string(), expected);
    }
    let refusal = Variation::new(&n1(), "AR1", "phi", lognormal(1.5, 0.1)).unwrap_err();
    assert!(
        refusal.to_string().contains("phi = 1.5 is not between"),
        "{refusal}"
    );
}
