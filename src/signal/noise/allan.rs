//! The Allan variance of a model at any averaging time.
//!
//! The Haar wavelet variance lives on octaves; a data sheet asks for one second, whatever the rate. With averages over
//! m samples the Allan variance is twice the Haar wavelet variance of scale 2m, in closed form for every whole m.

use super::ar1::{Slow, fast_shape};
use super::{Ar1, Composite, FlickerNoise, Ladder, Process};
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

// Variance of the mean of a recording about the level at which it was switched on.

impl Composite {
    /// Variance of the mean of the first N samples after a switching-on (units²), as [`super::Synthesizer`] makes them: a
    /// random walk begins at zero, an AR1 in its stationary law. A ramp is the same each time and adds nothing.
    pub fn mean_variance(&self, samples: usize) -> f64 {
        self.processes
            .iter()
            .map(|p| mean_variance(p, samples as f64))
            .sum()
    }
}

fn mean_variance(process: &Process, n: f64) -> f64 {
    match process {
        Process::White(p) => p.sigma2() / n,
        // The sum telescopes to √(12 Q²) (U_n − U_0).
        Process::Quantization(p) => 2.0 * p.q2() / (n * n),
        Process::Ar1(p) => mean_of_ar1(p, n),
        Process::GaussMarkov(p) => mean_of_ar1(&p.ar1(), n),
        // Step i is in n + 1 − i of the samples: γ² Σ i²/n².
        Process::RandomWalk(p) => p.gamma2() * (n + 1.0) * (2.0 * n + 1.0) / (6.0 * n),
        Process::Flicker(p) => p
            .parts(Ladder::FINE)
            .iter()
            .map(|part| mean_variance(part, n))
            .sum(),
        Process::Drift(_) => 0.0,
        Process::Ma1(p) => {
            // W_1 … W_(n−1) occur in two samples, with 1 and theta; W_n in one with 1, W_0 in one with theta.
            let inner = (1.0 + p.theta()) * (1.0 + p.theta());
            p.sigma2() * ((n - 1.0) * inner + 1.0 + p.theta() * p.theta()) / (n * n)
        }
    }
}

/// Variance of the mean of n samples of an AR1 (units²):
/// γ₀/n² [n (1 + φ)/(1 − φ) − 2 φ (1 − φⁿ)/(1 − φ)²]
fn mean_of_ar1(p: &Ar1, n: f64) -> f64 {
    let (phi, left) = (p.phi(), 1.0 - p.phi());
    if n * left < 1e-2 {
        // The difference would lose its digits: e^(−κd) in powers of the distances d, what is left out is below 2e-8.
        // Over the n² pairs the mean of |i − k| is (n² − 1)/(3n) and that of its square (n² − 1)/6.
        let (kappa, squares) = (-phi.ln(), n * n - 1.0);
        return p.variance() * (1.0 - kappa * squares / (3.0 * n) + kappa * kappa * squares / 12.0);
    }
    p.variance() * (n * (1.0 + phi) / left - 2.0 * phi * (1.0 - phi.powf(n)) / (left * left))
        / (n * n)
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

#[cfg(test)]
mod mean_tests {
    use super::*;
    use crate::noise::{GaussMarkov, Ma1, Quantization, RandomWalk, White};
    use approx::assert_relative_eq;

    /// By definition: the double sum of the autocovariances of X_1 … X_n.
    fn by_definition(n: usize, covariance: impl Fn(usize, usize) -> f64) -> f64 {
        let sum: f64 = (1..=n)
            .map(|i| (1..=n).map(|k| covariance(i, k)).sum::<f64>())
            .sum();
        sum / (n * n) as f64
    }

    fn closed_form(process: Process, n: usize) -> f64 {
        Composite::new(vec![process]).mean_variance(n)
    }

    #[test]
    fn the_mean_of_n_samples_has_the_sum_of_their_covariances() {
        let n = 50;
        let of_distance = |at: &dyn Fn(usize) -> f64| by_definition(n, |i, k| at(i.abs_diff(k)));
        let white = closed_form(Process::White(White::new(2.0).unwrap()), n);
        assert_relative_eq!(
            white,
            of_distance(&|d| if d == 0 { 2.0 } else { 0.0 }),
            max_relative = 1e-12
        );
        let steps = closed_form(Process::Quantization(Quantization::new(2.0).unwrap()), n);
        let exact = of_distance(&|d| [4.0, -2.0].get(d).copied().unwrap_or(0.0));
        assert_relative_eq!(steps, exact, max_relative = 1e-10);
        let average = closed_form(Process::Ma1(Ma1::new(0.5, 2.0).unwrap()), n);
        let exact = of_distance(&|d| [2.5, 1.0].get(d).copied().unwrap_or(0.0));
        assert_relative_eq!(average, exact, max_relative = 1e-12);
        let walk = closed_form(Process::RandomWalk(RandomWalk::new(2.0).unwrap()), n);
        assert_relative_eq!(
            walk,
            by_definition(n, |i, k| 2.0 * i.min(k) as f64),
            max_relative = 1e-12
        );
        // On both sides of the series at 50 (1 − φ) = 0.01.
        for phi in [-0.5, 0.0, 0.3, 0.9, 0.999, 0.9998, 0.99999] {
            let p = Ar1::new(phi, 2.0).unwrap();
            let exact = of_distance(&|d| p.variance() * phi.powi(d as i32));
            assert_relative_eq!(closed_form(Process::Ar1(p), n), exact, max_relative = 1e-7);
        }
        let markov = GaussMarkov::new(0.5, 3.0, 10.0).unwrap();
        let same = closed_form(Process::Ar1(markov.ar1()), n);
        assert_relative_eq!(closed_form(Process::GaussMarkov(markov), n), same);
    }
}
