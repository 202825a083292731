//! The curve that a model implies: the expected values of the wavelet variances to which it is fitted.
//!
//! For classical variances these are nu_j(theta). Robust ones read quantization noise high
//! ([`QuantizationResponse`]): nu_j(theta)·b(s_j), s_j the part of nu_j that is quantization noise.

use crate::noise::{Composite, Process};
use crate::wavelet::{Curve, QuantizationResponse};

/// The part of a model's wavelet variance that is quantization noise, at a level.
pub(crate) fn quantization_share(model: &Composite, level: u32) -> f64 {
    share(model, level, is_quantization)
}

/// The part of a model's wavelet variance that is drift, at a level.
pub(crate) fn drift_share(model: &Composite, level: u32) -> f64 {
    share(model, level, |p| matches!(p, Process::Drift(_)))
}

fn share(model: &Composite, level: u32, is_counted: impl Fn(&Process) -> bool) -> f64 {
    let counted: f64 = model
        .processes
        .iter()
        .filter(|p| is_counted(p))
        .map(|p| p.haar_wv(level))
        .sum();
    if counted > 0.0 {
        counted / model.haar_wv(level)
    } else {
        0.0
    }
}

const fn is_quantization(process: &Process) -> bool {
    matches!(process, Process::Quantization(_))
}

/// The curve a model implies, at the levels and of the kind (classical or robust) of a given one.
#[must_use]
pub fn implied(model: &Composite, curve: &Curve) -> Vec<f64> {
    let at_level = |level: &u32| {
        let nu = model.haar_wv(*level);
        match curve.response(*level) {
            None => nu,
            Some(response) => nu * response.factor(quantization_share(model, *level)).0,
        }
    };
    curve.levels.iter().map(at_level).collect()
}

/// Its derivatives with respect to all parameters of the model, level by level.
pub(crate) fn implied_gradients(model: &Composite, curve: &Curve) -> Vec<Vec<f64>> {
    let at_level = |level: &u32| {
        let Some(response) = curve.response(*level) else {
            return model.haar_wv_gradient(*level);
        };
        let scale = Response::new(response, quantization_share(model, *level));
        let of_process = |process: &Process| {
            let scale = if is_quantization(process) {
                scale.quantization
            } else {
                scale.others
            };
            process
                .haar_wv_gradient(*level)
                .into_iter()
                .map(move |slope| slope * scale)
        };
        model.processes.iter().flat_map(of_process).collect()
    };
    curve.levels.iter().map(at_level).collect()
}

/// Derivatives of nu·b(q/nu), q the variance of quantization noise and nu that of all: with respect to q and to that of
/// any other process. nu·b is homogeneous, so that it is q times the first plus (nu − q) times the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Response {
    pub(crate) quantization: f64,
    pub(crate) others: f64,
}

impl Response {
    /// Response of a curve that reads quantization noise as it is.
    pub(crate) const PLAIN: Self = Self {
        quantization: 1.0,
        others: 1.0,
    };

    pub(crate) fn new(response: &QuantizationResponse, share: f64) -> Self {
        // With s = q/nu: d(nu·b)/dq = b + (1 − s)·db/ds for quantization noise, which is in q and in nu;
        // b − s·db/ds for a process that is in nu only.
        let (b, slope) = response.factor(share);
        Self {
            quantization: b + (1.0 - share) * slope,
            others: b - share * slope,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Ar1, Quantization, RandomWalk, White};
    use crate::wavelet::{Convention, Tuning};

    fn model(values: [f64; 5]) -> Composite {
        Composite::new(vec![
            Process::White(White::new(values[0]).unwrap()),
            Process::Quantization(Quantization::new(values[1]).unwrap()),
            Process::Ar1(Ar1::new(values[2], values[3]).unwrap()),
            Process::RandomWalk(RandomWalk::new(values[4]).unwrap()),
        ])
    }

    /// All columns against central differences, robust and classical; the parts of a homogeneous curve make the whole.
    #[test]
    fn gradients_are_the_differences() {
        let values = [1.0, 0.6, 0.95, 0.02, 1e-4];
        let levels: Vec<u32> = (1..=10).collect();
        let tuning = Tuning::new(0.6, Convention::Exact).unwrap();
        for quantization in [None, Some(*tuning.quantization())] {
            let curve = Curve {
                levels: levels.clone(),
                quantization,
                ..Curve::default()
            };
            let gradients = implied_gradients(&model(values), &curve);
            for p in 0..5 {
                let step = 1e-5 * values[p];
                let shifted = |sign: f64| {
                    let mut there = values;
                    there[p] += sign * step;
                    implied(&model(there), &curve)
                };
                let (up, down) = (shifted(1.0), shifted(-1.0));
                for j in 0..levels.len() {
                    let difference = 0.5 * (up[j] - down[j]) / step;
                    // Rounding of the values over the step, and the step's square.
                    let scale = implied(&model(values), &curve)[j] / values[p];
                    assert!(
                        (gradients[j][p] - difference).abs()
                            < 1e-8 * scale + 1e-6 * difference.abs(),
                        "{j} {p}"
                    );
                }
            }
        }
    }
}
