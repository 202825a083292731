//! Variance of the mean of a recording about the level at which it was switched on.

use super::{Ar1, Composite, Ladder, Process};

impl Composite {
    /// Variance of the mean of the first N samples after a switching-on (units²), as [`super::Synthesizer`] makes them: a
    /// random walk begins at zero, an AR1 in its stationary law. A ramp is the same each time and adds nothing.
    #[must_use]
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
        Process::Ar1(p) => of_ar1(p, n),
        Process::GaussMarkov(p) => of_ar1(&p.ar1(), n),
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
fn of_ar1(p: &Ar1, n: f64) -> f64 {
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
    use super::super::{GaussMarkov, Ma1, Quantization, RandomWalk, White};
    use super::*;
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
