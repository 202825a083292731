//! The Allan variance of a model at any averaging time.
//!
//! The Haar wavelet variance lives on octaves; a data sheet asks for one second, whatever the rate. With averages over
//! m samples the Allan variance is twice the Haar wavelet variance of scale 2m, in closed form for every whole m.

use super::ar1::fast_shape;
use super::slow_ar1::Slow;
use super::{Ar1, Composite, FlickerNoise, Process};
use std::f64::consts::LN_2;

impl Process {
    /// Theoretical Allan variance (units²) of averages over m ≥ 1 samples; for a drift the square of its deterministic
    /// contribution ([IEEE 952](crate::bibliography::Ieee952), annex C).
    pub(crate) fn allan_variance(&self, samples: u32) -> f64 {
        let m = f64::from(samples.max(1));
        match self {
            Self::White(p) => p.sigma2() / m,
            Self::Quantization(p) => 3.0 * p.q2() / (m * m),
            Self::RandomWalk(p) => p.gamma2() * (2.0 * m * m + 1.0) / (6.0 * m),
            Self::Drift(p) => 0.5 * p.slope() * p.slope() * m * m,
            Self::Ma1(p) => {
                let sum = 1.0 + p.theta();
                p.sigma2() * (m * sum * sum - 3.0 * p.theta()) / (m * m)
            }
            Self::Flicker(p) => FlickerNoise::allan_shape(p.b2(), samples),
            Self::Ar1(p) => of_ar1(p, samples.max(1)),
            Self::GaussMarkov(p) => p.s2() * unit_markov(p.beta() / p.rate_hz(), samples.max(1)),
        }
    }
}

impl Composite {
    /// Theoretical Allan variance (units²) of averages over m ≥ 1 samples: the sum over the processes.
    #[must_use]
    pub fn allan_variance(&self, samples: u32) -> f64 {
        self.processes
            .iter()
            .map(|p| p.allan_variance(samples))
            .sum()
    }
}

/// Allan variance of a Gauss-Markov process of variance 1 and correlation time 1/kappa samples.
pub(super) fn unit_markov(kappa: f64, samples: u32) -> f64 {
    // The textbook form loses every digit as kappa → 0; this one is a sum of positive terms.
    if kappa < LN_2 && samples > 1 {
        return 4.0 * kappa * Slow::new(kappa).bracket(f64::from(samples)).value;
    }
    let phi = (-kappa).exp();
    match samples {
        // Half the variance of the difference of neighbours, 1 − phi.
        1 => -(-kappa).exp_m1(),
        m => 2.0 * (1.0 - phi) * (1.0 + phi) * fast_shape(phi, f64::from(m)).0,
    }
}

fn of_ar1(p: &Ar1, samples: u32) -> f64 {
    let (m, phi) = (f64::from(samples), p.phi());
    if samples == 1 {
        return p.sigma2() / (1.0 + phi);
    }
    if phi > 0.0 {
        return p.variance() * unit_markov(-(phi - 1.0).ln_1p(), samples);
    }
    // Between the octaves m may be odd: phi^m keeps its sign, and the product form of the wavelet variance
    // does not apply.
    // 1 − u by the logarithm of −phi = 1 − (1 + phi): as phi → −1 it vanishes for an even m as m (1 + phi) does.
    let log_power = m * (-(1.0 + phi)).ln_1p();
    let rest = if samples.is_multiple_of(2) {
        -log_power.exp_m1()
    } else {
        1.0 + log_power.exp()
    };
    let bump = rest * (2.0 + rest);
    p.sigma2() * (m * (1.0 - phi) * (1.0 + phi) - phi * bump)
        / (m * m * (1.0 - phi).powi(3) * (1.0 + phi))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Drift, GaussMarkov, Ma1, Quantization, RandomWalk, White};

    fn processes() -> Vec<Process> {
        let ar1 = |phi| Process::Ar1(Ar1::new(phi, 1e-8).unwrap());
        vec![
            Process::White(White::new(5e-5).unwrap()),
            Process::Quantization(Quantization::new(1e-7).unwrap()),
            Process::RandomWalk(RandomWalk::new(3e-11).unwrap()),
            Process::Drift(Drift::new(-2e-9).unwrap()),
            Process::GaussMarkov(GaussMarkov::new(0.02, 1e-6, 100.0).unwrap()),
            Process::GaussMarkov(GaussMarkov::new(120.0, 1e-6, 100.0).unwrap()),
            Process::Ma1(Ma1::new(-0.4, 2e-6).unwrap()),
            ar1(0.9999),
            ar1(0.7),
            ar1(0.3),
            ar1(0.0),
            ar1(-0.6),
            ar1(-1.0 + 1e-12),
        ]
    }

    #[test]
    fn on_octaves_it_is_twice_the_wavelet_variance() {
        for process in processes() {
            for level in 1..20 {
                let (a, b) = (
                    process.allan_variance(1 << (level - 1)),
                    2.0 * process.haar_wv(level),
                );
                assert!(
                    (a / b - 1.0).abs() < 1e-12,
                    "{process:?} level {level}: {a:e} {b:e}"
                );
            }
        }
    }

    /// Between octaves against the definition: half the variance of the difference of two adjacent means of m samples,
    /// summed from the autocovariance, Σ over the 2m × 2m pairs of samples with signs.
    #[test]
    fn between_octaves_it_is_the_variance_of_the_definition() {
        for phi in [0.95, 0.3, -0.6] {
            let ar1 = Ar1::new(phi, 2.0).unwrap();
            for m in [3_i32, 7, 13] {
                let mut sum = 0.0;
                for i in 0..2 * m {
                    for j in 0..2 * m {
                        let sign = if (i < m) == (j < m) { 1.0 } else { -1.0 };
                        sum += sign * ar1.variance() * phi.powi((i - j).abs());
                    }
                }
                let definition = 0.5 * sum / f64::from(m * m);
                let value = Process::Ar1(ar1).allan_variance(m as u32);
                assert!(
                    (value / definition - 1.0).abs() < 1e-11,
                    "{phi} {m}: {value:e} {definition:e}"
                );
            }
        }
    }

    #[test]
    fn white_noise_and_random_walk_are_those_of_the_standard() {
        // N²/τ and K²τ/3, at 1 s of 100 Hz, the second to (dt/τ)²/2
        let white = Process::White(White::new(1e-4).unwrap());
        assert!((white.allan_variance(100) / 1e-6 - 1.0).abs() < 1e-14);
        let walk = Process::RandomWalk(RandomWalk::new(1e-8).unwrap());
        assert!((walk.allan_variance(1000) / (1e-8 * 100.0 * 10.0 / 3.0) - 1.0).abs() < 1e-6);
    }
}
