//! A filter's covariance along the trajectory without a random number: what it believes of itself.

use super::batch::{exact_fix, standard_deviations};
use super::{Plan, REPORTED};
use crate::ekf::{Belief, Ekf, advance, settle, update, update_height};
use crate::frames::RollPitchYaw;
use crate::lanes::{Lanes, Vec3};
use crate::strapdown::Strapdown;

/// Standard deviations of the reported states (m, m/s, degrees).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CovariancePass {
    /// At every report.
    pub reports: Vec<[f64; REPORTED]>,
    /// Just before the first fix after each outage (or at the end).
    pub outage_ends: Vec<[f64; REPORTED]>,
}

/// Takes a filter along the reference with ideal sensors and exact fixes: its covariance does not depend on
/// the noise, but for the small part in which it is linearised about the estimate.
#[must_use]
pub fn covariance_pass(plan: &Plan<'_>, belief: &Belief) -> CovariancePass {
    let experiment = plan.experiment;
    let nominal = Strapdown::new(&plan.start, experiment.gravity);
    let mut ekf = Ekf::new(nominal, belief, &plan.start, experiment.initial);
    let mut pass =
        CovariancePass { reports: Vec::new(), outage_ends: vec![[0.0; REPORTED]; plan.outages.len()] };
    let (mut done, mut none) = (0, Vec::new());
    for (index, event) in plan.events.iter().enumerate() {
        let samples = &plan.ideal[done..event.sample];
        none.resize(samples.len(), [Vec3::ZERO; 2]);
        advance(&mut ekf, samples, &none);
        done = event.sample;
        let jacobian = RollPitchYaw::from_quat(event.reference.q_b_n).jacobian_of_psi_n();
        let sigma = |ekf: &mut Ekf| {
            settle(ekf);
            standard_deviations(ekf, &jacobian).map(|lanes| lanes[0])
        };
        for (end, _) in pass.outage_ends.iter_mut().zip(&plan.outages).filter(|(_, (_, at))| *at == index) {
            *end = sigma(&mut ekf);
        }
        if event.fix {
            let _ = update(&mut ekf, &exact_fix(plan, event));
        }
        if let Some(baro) = experiment.baro.filter(|_| event.baro) {
            let _ = update_height(&mut ekf, &Lanes::splat(event.reference.h), baro.sigma_m);
        }
        if event.report {
            pass.reports.push(sigma(&mut ekf));
        }
    }
    pass
}
