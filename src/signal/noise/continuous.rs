//! Between a discrete model at a rate and continuous time: the only home of these conversions.
//!
//! A process sampled at another rate: white noise keeps its density, a random walk its growth per second,
//! a Gauss-Markov process its correlation time and variance. Quantization noise belongs to the
//! quantiser's own rate and cannot be converted.

use super::{Composite, Model, Process};
use crate::units::Refused;

/// White noise density N = sigma √dt (units/√Hz).
pub(crate) fn white_density(sigma2: f64, rate_hz: f64) -> f64 {
    (sigma2 / rate_hz).sqrt()
}

/// Variance of a sample of white noise of density N (units/√Hz).
pub fn white_sigma2(density: f64, rate_hz: f64) -> f64 {
    density * density * rate_hz
}

/// Random-walk density K = gamma √f (units/s/√Hz).
pub(crate) fn walk_density(gamma2: f64, rate_hz: f64) -> f64 {
    (gamma2 * rate_hz).sqrt()
}

/// Variance of a random-walk increment of density K (units/s/√Hz).
pub fn walk_gamma2(density: f64, rate_hz: f64) -> f64 {
    density * density / rate_hz
}

/// Correlation time T = −dt/ln phi (s) of an AR1 with 0 < phi < 1.
pub fn correlation_time_s(phi: f64, rate_hz: f64) -> f64 {
    // phi − 1 is exact for phi ≥ ½: T keeps its digits where phi is next to 1.
    -1.0 / (rate_hz * (phi - 1.0).ln_1p())
}

impl Process {
    /// Correlation time (s) of an AR1 with phi > 0 or a GM; none of the others.
    pub fn correlation_time_s(&self, rate_hz: f64) -> Option<f64> {
        self.kappa().map(|kappa| 1.0 / (rate_hz * kappa))
    }
}

/// The noise model sampled at another rate.
///
/// # Errors
/// When a process is tied to its own rate: QN, MA1, an AR1 with phi ≤ 0.
pub fn at_rate(model: &Model, rate_hz: f64) -> Result<Model, Refused> {
    let mut axes = model.axes.clone();
    if same_rate(model.rate_hz, rate_hz) {
        return Ok(model.clone());
    }
    for axis in &mut axes {
        let converted: Result<Vec<_>, _> = axis
            .processes
            .iter()
            .map(|p| p.at_rate(model.rate_hz, rate_hz))
            .collect();
        *axis = Composite::new(converted?);
    }
    Ok(Model { rate_hz, axes })
}

/// Returns true if two rates agree to the precision of a clock (1 ppm).
pub fn same_rate(a_hz: f64, b_hz: f64) -> bool {
    (a_hz / b_hz - 1.0).abs() < 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{assert_abs_diff_eq, assert_relative_eq};

    fn n2_without_qn() -> Model {
        let axis = Composite::new(vec![
            Process::white(5.2e-5).unwrap(),
            Process::ar1(0.9835, 1.3e-8).unwrap(),
            Process::gauss_markov(1e-3, 4e-8, 100.0).unwrap(),
            Process::random_walk(2.9e-11).unwrap(),
            Process::drift(-1e-9).unwrap(),
        ]);
        Model::pooled(100.0, &axis, &axis)
    }

    #[test]
    fn to_another_rate_and_back_is_the_same_model() {
        let model = n2_without_qn();
        let back = at_rate(&at_rate(&model, 37.0).unwrap(), 100.0).unwrap();
        for (a, b) in model.axes[0].processes.iter().zip(&back.axes[0].processes) {
            for ((name, x), (_, y)) in a.parameters().into_iter().zip(b.parameters()) {
                assert!(
                    (x / y - 1.0).abs() < 1e-10,
                    "{} {name}: {x:e} {y:e}",
                    a.code()
                );
            }
        }
    }

    /// The variance of the mean over one second is a property of the continuous process: 100 samples at
    /// 100 Hz and 400 at 400 Hz agree up to the sampling of the slow processes, (dt/T)² < 1e-3 here.
    #[test]
    fn the_wavelet_variance_at_a_time_scale_does_not_depend_on_the_rate() {
        let model = n2_without_qn();
        let fast = at_rate(&model, 400.0).unwrap();
        for level in 7..16 {
            let (a, b) = (
                model.axes[0].haar_wv(level),
                fast.axes[0].haar_wv(level + 2),
            );
            assert!((a / b - 1.0).abs() < 1e-3, "level {level}: {a:e} {b:e}");
        }
    }

    #[test]
    fn densities_are_those_of_the_data_sheets() {
        // 0.01 °/s/√Hz is 0.6 °/√h; at 100 Hz a sample deviates by 0.1 °/s
        let deg = crate::units::DEG;
        let sigma2 = white_sigma2(0.01 * deg, 100.0);
        assert_abs_diff_eq!(sigma2.sqrt() / deg, 0.1, epsilon = 1e-15);
        assert_abs_diff_eq!(
            white_density(sigma2, 100.0) / deg * 60.0,
            0.6,
            epsilon = 1e-12
        );
        assert_relative_eq!(
            walk_gamma2(walk_density(2e-11, 100.0), 100.0),
            2e-11,
            max_relative = 1e-15
        );
        assert_relative_eq!(
            correlation_time_s((-1e-9_f64).exp(), 100.0),
            1e7,
            max_relative = 1e-6
        );
    }

    #[test]
    fn quantization_noise_is_tied_to_its_rate() {
        let qn = Process::quantization(1e-7).unwrap();
        let model = Model::pooled(100.0, &Composite::new(vec![qn]), &Composite::default());
        let error = at_rate(&model, 50.0).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("QN at 100 Hz cannot be converted to 50 Hz")
        );
        assert!(at_rate(&model, 100.0).is_ok());
    }
}
