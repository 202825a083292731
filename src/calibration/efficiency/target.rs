//! The target of the estimators when parameters vary between replicates
//! ([Minaretzis](crate::bibliography::Minaretzis24), eqs. 2 and 3): the model nearest to the *expected*
//! wavelet variance, which is not the model of the expected parameters.

use super::design::{Design, StudyError};
use super::quadrature::nodes;
use crate::noise::{Composite, Process, SpreadError, Variation};
use crate::wavelet::{Curve, interval};
use crate::{Fit, fit};

/// The target of a study.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// nu_0 = E\[nu(theta_i)\], with the degrees of freedom of K replicates.
    pub curve: Curve,
    /// theta_0: the fit to it.
    pub fit: Fit,
}

/// theta_0 of a design: nu_0 by quadrature over the laws of the parameters, fitted as the estimators fit.
///
/// theta_0 depends on the weights Omega_j = eta_j/(2 nu_0j²) as far as nu_0 is no curve of the model. They
/// are those of the classical estimator; those of the robust ones are proportional to them, but for the
/// last scales, where degrees of freedom stop at 1. Nothing here is contaminated, and nothing is sampled.
///
/// # Errors
/// When the laws do not belong to the model, or the levels are too few for it.
pub fn target(design: &Design) -> Result<Target, StudyError> {
    let axis = design.channel.index();
    let (noise, laws) = (&design.model.axes[axis], &design.spread.axes[axis]);
    let rate_hz = design.model.rate_hz;
    // The degrees of freedom of the average of K independent curves of one length.
    let edof = |j| design.replicates as f64 * interval::edof_eta3(design.samples, j);
    let levels: Vec<u32> = (1..=design.levels).collect();
    let curve = Curve {
        wv: expected_wv(noise, laws, rate_hz, design.levels)?,
        edof: levels.iter().map(|j| edof(*j)).collect(),
        levels,
        ..Curve::default()
    };
    let fit = fit(&curve, &design.spec, rate_hz, design.weighting)?;
    Ok(Target { curve, fit })
}

/// E\[nu_j\] at levels 1, 2, … when the parameters of `noise` follow `laws`, independently.
///
/// # Errors
/// When a law does not belong to this noise.
pub(crate) fn expected_wv(
    noise: &Composite,
    laws: &[Variation],
    rate_hz: f64,
    levels: u32,
) -> Result<Vec<f64>, SpreadError> {
    let mut expected = vec![0.0; levels as usize];
    for (process, label) in noise.processes.iter().zip(noise.labels()) {
        let own = laws.iter().filter(|l| l.process() == label);
        for (process, weight) in weighted(process, own, rate_hz)? {
            for (nu, level) in expected.iter_mut().zip(1..) {
                // nu is a sum over the processes, and so is its expectation: laws of different processes need
                // no common quadrature.
                *nu += weight * process.haar_wv(level);
            }
        }
    }
    Ok(expected)
}

/// The processes, with weights of sum 1, that stand for one whose parameters follow laws.
fn weighted<'a>(
    process: &Process,
    laws: impl Iterator<Item = &'a Variation>,
    rate_hz: f64,
) -> Result<Vec<(Process, f64)>, SpreadError> {
    let mut all = vec![(*process, 1.0)];
    for law in laws {
        let name = law.parameter();
        let own = process
            .kind()
            .parameters()
            .iter()
            .zip(process.values())
            .find(|(p, _)| p.name() == name);
        let (parameter, centre) = own.ok_or_else(|| law.no_parameter(process))?;
        let nodes = nodes(law.law(), centre, *parameter);
        let mut next = Vec::with_capacity(all.len() * nodes.len());
        for (process, weight) in &all {
            for (value, node) in &nodes {
                let changed = process.with_parameter(name, *value, rate_hz);
                let changed = changed.ok_or_else(|| law.no_parameter(process))?;
                next.push((changed.map_err(SpreadError::Reaches)?, weight * node));
            }
        }
        all = next;
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Law, Ma1, Model, Spread, Synthesizer};
    use crate::rng::StreamKey;

    const RATE: f64 = 100.0;

    fn law(noise: &Composite, process: &str, parameter: &str, law: Law) -> Variation {
        Variation::new(noise, RATE, process, parameter, law).unwrap()
    }

    /// The mean over 20000 drawn models is within 5 of its standard errors of the quadrature.
    #[test]
    fn expectation_is_the_mean_over_drawn_models() {
        let process =
            |code, values: &[f64]| Process::from_values(code, values, RATE).unwrap().unwrap();
        let noise = Composite::new(vec![
            process("AR1", &[0.9, 1.0]),
            process("GM", &[2.0, 3.0]),
            process("DR", &[0.01]),
            process("WN", &[1.0]),
        ]);
        let laws = vec![
            law(
                &noise,
                "AR1",
                "phi",
                Law::Beta {
                    a: 0.8,
                    b: 2.0,
                    low: 0.5,
                    width: 0.49,
                },
            ),
            law(&noise, "AR1", "sigma2", Law::Normal { sd: 0.8 }),
            law(
                &noise,
                "GM",
                "beta",
                Law::Beta {
                    a: 2.0,
                    b: 3.0,
                    low: 1.0,
                    width: 5.0,
                },
            ),
            law(&noise, "DR", "slope", Law::Normal { sd: 0.02 }),
        ];
        let exact = expected_wv(&noise, &laws, RATE, 12).unwrap();
        let model = Model::pooled(RATE, &noise, &noise);
        let spread = Spread {
            axes: [laws, vec![], vec![], vec![], vec![], vec![]],
        };
        let n = 20_000_u32;
        let drawn: Vec<Composite> = (0..n)
            .map(|i| spread.draw(&model, 3, i.into()).unwrap().axes[0].clone())
            .collect();
        for (j, exact) in (1..).zip(exact) {
            let nu: Vec<f64> = drawn.iter().map(|m| m.haar_wv(j)).collect();
            let mean = nu.iter().sum::<f64>() / f64::from(n);
            let variance = nu.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
            let bound = 5.0 * (variance / f64::from(n)).sqrt();
            assert!(
                (mean - exact).abs() < bound,
                "level {j}: {mean} {exact}, bound {bound}"
            );
        }
    }

    /// Example 1 of the paper: MA1 with theta_i ~ U(0, b), first scale only.
    struct Example1 {
        b: f64,
    }

    impl Example1 {
        fn noise() -> Composite {
            Composite::new(vec![Process::Ma1(Ma1::new(0.1, 1.0).unwrap())])
        }

        fn laws(&self) -> Vec<Variation> {
            let uniform = Law::Beta {
                a: 1.0,
                b: 1.0,
                low: 0.0,
                width: self.b,
            };
            vec![law(&Self::noise(), "MA1", "theta", uniform)]
        }

        /// The paper's closed form.
        fn theta_0(&self) -> f64 {
            0.5 - (self.b * self.b / 3.0 - 0.5 * self.b + 0.25).sqrt()
        }

        /// argmin over \[0, ½\] of (nu − nu_1(theta))², by bisection: nu_1 falls there.
        fn nearest(nu: f64) -> f64 {
            let (mut low, mut high) = (0.0, 0.5);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if Ma1::new(middle, 1.0).unwrap().haar_wv(1) > nu {
                    low = middle
                } else {
                    high = middle
                }
            }
            low
        }
    }

    #[test]
    fn example_1_of_the_paper_in_closed_form() {
        for b in [0.1, 0.3, 0.49] {
            let example = Example1 { b };
            let nu_0 = expected_wv(&Example1::noise(), &example.laws(), RATE, 1).unwrap()[0];
            assert!((nu_0 - 0.5 * (b * b / 3.0 - 0.5 * b + 1.0)).abs() < 1e-14);
            let theta_0 = Example1::nearest(nu_0);
            // nu_1 has slope ½ − theta there, at least 0.01: 1e-14 in nu are 1e-12 in theta.
            assert!((theta_0 - example.theta_0()).abs() < 1e-12, "{theta_0}");
            assert!(
                (theta_0 - 0.5 * b).abs() > 1e-4,
                "not the mean of the parameters"
            );
        }
    }

    /// The average wavelet variance of drawn and synthesised signals leads to theta_0, and not to b/2: the
    /// error of the mean over n signals, as it scatters, is carried to theta by the slope theta_0 − ½.
    #[test]
    fn the_average_wavelet_variance_leads_to_theta_0_not_to_the_mean_parameter() {
        let example = Example1 { b: 0.49 };
        let model = Model::pooled(RATE, &Example1::noise(), &Composite::default());
        let spread = Spread {
            axes: [example.laws(), vec![], vec![], vec![], vec![], vec![]],
        };
        let n = 8000_u32;
        let first_scale = |run: u32| {
            let drawn = spread.draw(&model, 1, run.into()).unwrap();
            let key = StreamKey {
                seed: 1,
                scenario: "",
                run: run.into(),
                source: "accel.x",
                process: "",
            };
            let mut x = [0.0; 128];
            Synthesizer::new(&drawn.axes[0], key).fill(&mut x);
            crate::wavelet::classical(&x, 1).unwrap()[0]
        };
        let nu: Vec<f64> = (0..n).map(first_scale).collect();
        let mean = nu.iter().sum::<f64>() / f64::from(n);
        let variance = nu.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(n);
        let sd = (variance / f64::from(n)).sqrt() / (0.5 - example.theta_0());
        let found = Example1::nearest(mean);
        assert!(
            (found - example.theta_0()).abs() < 5.0 * sd,
            "{found}, {} ± {sd}",
            example.theta_0()
        );
        assert!(
            (found - 0.5 * example.b).abs() > 5.0 * sd,
            "{found} is not told from b/2: sd {sd}"
        );
    }
}
