//! What a vehicle measures of itself along its reference, before any error.

use super::plan::{Event, Experiment, ExperimentError};
use crate::sensors::aiding::Aid;
use crate::units::DEG;
use glam::DVec3;

/// Sine of a pitch of 80°.
const STEEP: f64 = 0.985;
/// Share of what a filter believes of the constraint that the reference may have of its own: runs and analysis forgive it.
const FORGIVEN: f64 = 0.3;

/// Below these a vehicle stands (m/s, rad/s): a hundredth of the pace of a walk, and what a gyroscope would not show.
const STANDS_M_S: f64 = 0.01;
const STANDS_RAD_S: f64 = 0.01 * DEG;

/// A measurement of the vehicle by itself, as it would be without error.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aided {
    pub(super) aid: Aid,
    /// Velocity of the point that it belongs to, in b (m/s).
    pub(super) v_b: DVec3,
    /// Acceleration of the vehicle with respect to the Earth, in b (m/s²).
    pub(super) a_b: DVec3,
    /// Whether an outage withholds it.
    pub(super) withheld: bool,
}

/// What the vehicle measures of itself, of these aids.
pub(super) fn aided<'a>(
    experiment: &Experiment<'_>,
    t_s: f64,
    aids: impl Iterator<Item = &'a (Aid, usize)>,
) -> Vec<Aided> {
    let mut aids = aids.peekable();
    if aids.peek().is_none() {
        return Vec::new();
    }
    let in_outage = experiment
        .outages
        .iter()
        .any(|outage| outage.withholds(t_s));
    let k = experiment.trajectory.kinematics(t_s);
    let to_b = k.q_b_e.inverse();
    let (v_b, a_b) = (to_b * k.v_e, to_b * k.a_e);
    let stands = v_b.length() < STANDS_M_S && k.omega_eb_b.length() < STANDS_RAD_S;
    // Near the vertical there is no yaw: within ten degrees none is measured.
    let nose = experiment.trajectory.state(t_s).q_b_n * DVec3::X;
    let has_yaw = nose.z.abs() < STEEP;
    aids.filter(|(aid, _)| (*aid != Aid::Zupt || stands) && (*aid != Aid::Heading || has_yaw))
        .map(|(aid, _)| {
            let swing = k.omega_eb_b.cross(experiment.aiding.lever_arm_b(*aid));
            let withheld = in_outage && experiment.aiding.is_of_gnss(*aid);
            Aided {
                aid: *aid,
                v_b: v_b + swing,
                a_b,
                withheld,
            }
        })
        .collect()
}

/// A constraint that the reference itself does not keep tells of another vehicle, or of another point of it.
pub(super) fn check_sideslip(
    experiment: &Experiment<'_>,
    events: &[Event],
) -> Result<(), ExperimentError> {
    let Some(nhc) = &experiment.aiding.nhc else {
        return Ok(());
    };
    let squares: Vec<f64> = events
        .iter()
        .flat_map(|event| event.aids.iter().filter(|a| a.aid == Aid::Nhc))
        .map(|a| 0.5 * (a.v_b.y * a.v_b.y + a.v_b.z * a.v_b.z))
        .collect();
    let rms_m_s = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    if rms_m_s <= FORGIVEN * nhc.sigma_m_s {
        return Ok(());
    }
    Err(ExperimentError::Sideslip {
        rms_m_s,
        sigma_m_s: nhc.sigma_m_s,
    })
}
