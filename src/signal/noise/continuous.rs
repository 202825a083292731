//! Between a discrete model at a rate and continuous time: the only home of these conversions.
//!
//! A process sampled at another rate: white noise keeps its density, a random walk its growth per second,
//! a Gauss-Markov process its correlation time and variance. Quantization noise belongs to the
//! quantiser's own rate and cannot be converted.

use super::{Ar1, Composite, Drift, GaussMarkov, Model, Process, RandomWalk, White};
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
        match self {
            Self::Ar1(p) if p.phi() > 0.0 => Some(correlation_time_s(p.phi(), rate_hz)),
            Self::GaussMarkov(p) => Some(1.0 / p.beta()),
            _ => None,
        }
    }
}

/// The same noise sampled at another rate.
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
            .map(|p| process_at_rate(p, model.rate_hz, rate_hz))
            .collect();
        *axis = Composite::new(converted?);
    }
    Ok(Model { rate_hz, axes })
}

/// Whether two rates are the same to the precision of a clock (1 ppm).
pub fn same_rate(a_hz: f64, b_hz: f64) -> bool {
    (a_hz / b_hz - 1.0).abs() < 1e-6
}

fn process_at_rate(process: &Process, from_hz: f64, to_hz: f64) -> Result<Process, Refused> {
    let ratio = to_hz / from_hz;
    let tied = |why| {
        Refused(format!(
            "{} at {from_hz} Hz cannot be converted to {to_hz} Hz: {why}",
            process.code()
        ))
    };
    Ok(match process {
        // What is kept: N² = sigma2/f, K² = gamma2·f, and the slope per second.
        Process::White(p) => Process::White(White::new(p.sigma2() * ratio)?),
        // B² is that of every rate.
        Process::Flicker(p) => Process::Flicker(*p),
        Process::RandomWalk(p) => Process::RandomWalk(RandomWalk::new(p.gamma2() / ratio)?),
        Process::Drift(p) => Process::Drift(Drift::new(p.slope() / ratio)?),
        Process::GaussMarkov(p) => Process::GaussMarkov(GaussMarkov::new(p.beta(), p.s2(), to_hz)?),
        Process::Ar1(p) if p.phi() > 0.0 => {
            // T and the stationary variance are kept: kappa = dt/T goes with dt, and sigma2 = variance·(1 −
            // phi²).
            let kappa = -(p.phi() - 1.0).ln_1p() / ratio;
            Process::Ar1(Ar1::new(
                (-kappa).exp(),
                p.variance() * -(-2.0 * kappa).exp_m1(),
            )?)
        }
        Process::Ar1(_) => return Err(tied("phi ≤ 0 has no continuous counterpart")),
        Process::Ma1(_) => return Err(tied("it has no continuous counterpart")),
        Process::Quantization(_) => {
            return Err(tied("quantization belongs to the quantiser's own rate"));
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn n2_without_qn() -> Model {
        let axis = Composite::new(vec![
            Process::White(White::new(5.2e-5).unwrap()),
            Process::Ar1(Ar1::new(0.9835, 1.3e-8).unwrap()),
            Process::GaussMarkov(GaussMarkov::new(1e-3, 4e-8, 100.0).unwrap()),
            Process::RandomWalk(RandomWalk::new(2.9e-11).unwrap()),
            Process::Drift(Drift::new(-1e-9).unwrap()),
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
        assert!((sigma2.sqrt() / deg - 0.1).abs() < 1e-15);
        assert!((white_density(sigma2, 100.0) / deg * 60.0 - 0.6).abs() < 1e-12);
        assert!((walk_gamma2(walk_density(2e-11, 100.0), 100.0) / 2e-11 - 1.0).abs() < 1e-15);
        assert!((correlation_time_s((-1e-9_f64).exp(), 100.0) / 1e7 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn quantization_noise_is_tied_to_its_rate() {
        let qn = Process::Quantization(crate::noise::Quantization::new(1e-7).unwrap());
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
