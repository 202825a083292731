//! Weighting by the full covariance, against its closed form for white noise.

use nalgebra::{DMatrix, DVector};
use nav_sim::calibration::{ModelSpec, Weighting, fit};
use nav_sim::signal::noise::{Composite, Process, Synthesizer, White};
use nav_sim::signal::rng::StreamKey;
use nav_sim::signal::wavelet::{Curve, classical};

const SAMPLES: usize = 2048;
const LEVELS: u32 = 6;
const SIGNALS: u64 = 1200;

/// Coefficients of the Haar filter of a level.
fn filter(level: u32) -> Vec<f64> {
    let m = 1 << (level - 1);
    let sign = |t: usize| if t < m { 1.0 } else { -1.0 };
    (0..2 * m).map(|t| 0.5 * sign(t) / m as f64).collect()
}

/// cov(nu_j, nu_k)/(nu_j nu_k) for white noise: W_j and W_k have the cross-covariances c_l = Σ_t h_j(t) h_k(t + l),
/// so that the covariance of the mean squares is 2 Σ_l (overlap) c_l²/(M_j M_k).
fn relative_covariance() -> DMatrix<f64> {
    let n = LEVELS as usize;
    DMatrix::from_fn(n, n, |j, k| {
        let (a, b) = (filter(j as u32 + 1), filter(k as u32 + 1));
        let counts = [&a, &b].map(|h| (SAMPLES - h.len() + 1) as i64);
        let mut sum = 0.0;
        for lag in -(b.len() as i64)..=(a.len() as i64) {
            let term = |(t, h): (usize, &f64)| {
                usize::try_from(t as i64 - lag)
                    .ok()
                    .and_then(|s| b.get(s))
                    .map_or(0.0, |g| h * g)
            };
            let c: f64 = a.iter().enumerate().map(term).sum();
            let overlap = (counts[0].min(counts[1] - lag) - 0_i64.max(-lag)).max(0);
            sum += overlap as f64 * c * c;
        }
        let nu = |h: &[f64]| h.iter().map(|x| x * x).sum::<f64>();
        2.0 * sum / (counts[0] * counts[1]) as f64 / (nu(&a) * nu(&b))
    })
}

/// The estimate of sigma2 from relative errors e of the curve is 1 + Σ a_j e_j: with Omega = 1/C_jj a_j ∝ 1/C_jj, with
/// the full covariance a ∝ C⁻¹1, of variance 1/(1ᵀC⁻¹1), the least of all and no less than 2/T (Cramér, Rao).
/// (Weights that are taken from the curve itself change this by the order of C.) A variance of 1200 draws is
/// known to √(2/1200) = 4.1 %; four of that.
#[test]
fn variances_are_those_of_the_closed_form() {
    let covariance = relative_covariance();
    let ones = DVector::from_element(LEVELS as usize, 1.0);
    let full = 1.0 / ones.dot(&covariance.clone().try_inverse().unwrap().column_sum());
    let inverse = DVector::from_fn(LEVELS as usize, |j, _| 1.0 / covariance[(j, j)]);
    let weights = &inverse / inverse.sum();
    let diagonal = weights.dot(&(&covariance * &weights));
    assert!(
        2.0 / SAMPLES as f64 <= full && full < diagonal,
        "{full} {diagonal}"
    );

    let noise = Composite::new(vec![Process::White(White::new(1.0).unwrap())]);
    let spec: ModelSpec = "WN".parse().unwrap();
    let mut estimates = [Vec::new(), Vec::new()];
    for run in 0..SIGNALS {
        let key = StreamKey {
            seed: 9,
            scenario: "",
            run,
            source: "",
            process: "",
        };
        let mut signal = vec![0.0; SAMPLES];
        Synthesizer::new(&noise, key).fill(&mut signal);
        let edof = (0..LEVELS as usize)
            .map(|j| 2.0 / covariance[(j, j)])
            .collect();
        let curve = Curve {
            levels: (1..=LEVELS).collect(),
            wv: classical(&signal, LEVELS).unwrap(),
            edof,
            ..Curve::default()
        };
        for (weighting, into) in [Weighting::Edof, Weighting::Full]
            .into_iter()
            .zip(&mut estimates)
        {
            let fit = fit(&curve, &spec, 1.0, weighting).unwrap();
            into.push(fit.composite.processes[0].parameters()[0].1);
        }
    }
    let variance = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
    };
    for (values, expected) in estimates.iter().zip([diagonal, full]) {
        let ratio = variance(values) / expected;
        assert!((ratio - 1.0).abs() < 4.0 * 0.041, "{ratio}");
    }
}
