//! How far eight runs are from the reference, and how far their filters believe they are.

use super::batch::standard_deviations;
use super::plan::{Event, Plan};
use super::{BIASES, COVERAGE_DOF, EpochSums, NEES_DOF, REPORTED};
use crate::earth::ned_difference;
use crate::ekf::Ekf;
use crate::ekf::covariance::{PSI, R};
use crate::frames::{NavState, RollPitchYaw};
use crate::imu::Sensor;
use crate::lanes::{LANES, Lanes};
use crate::units::DEG;
use glam::{DQuat, DVec3};

/// Errors and beliefs of eight runs at one instant; the covariance must be settled.
pub(super) struct Assessment {
    /// The filter's own standard deviation of each reported state (m, m/s, degrees).
    pub(super) see: [Lanes; REPORTED],
    /// Error of each reported state, estimate − truth (m, m/s, degrees).
    pub(super) error: [Lanes; REPORTED],
    /// Rotation from the true to the estimated attitude (degrees).
    att_error_deg: Lanes,
    /// Position (m), velocity (m/s) and attitude error (rad), in the order of the filter's states.
    navigation: [Lanes; NEES_DOF],
    /// Normalised estimation error squared of position, velocity and attitude.
    pub(super) nees: Lanes,
}

impl Assessment {
    /// Logarithm of the density of the errors under the filter's belief.
    pub(super) fn log_density(&self, ekf: &Ekf) -> Lanes {
        ekf.p
            .log_density(std::array::from_fn(|i| i), self.navigation)
    }

    /// The assessment of the first `live` lanes against the reference; the other lanes are zero.
    pub(super) fn of(ekf: &Ekf, live: usize, reference: &NavState) -> Self {
        let jacobian = RollPitchYaw::from_quat(reference.q_b_n).jacobian_of_psi_n();
        let mut found = Self {
            see: standard_deviations(ekf, &jacobian),
            error: [Lanes::ZERO; REPORTED],
            att_error_deg: Lanes::ZERO,
            navigation: [Lanes::ZERO; NEES_DOF],
            nees: Lanes::ZERO,
        };
        for lane in 0..live {
            let error = reported_error(&ekf.nominal.lane(lane), reference);
            for i in 0..REPORTED {
                found.error[i][lane] = error.values[i];
            }
            for i in 0..6 {
                found.navigation[i][lane] = error.values[i];
            }
            for i in 0..3 {
                found.navigation[6 + i][lane] = error.psi_n[i];
            }
            found.att_error_deg[lane] = error.psi_n.length() / DEG;
        }
        // With psi_n (rad), not with roll, pitch, yaw: NEES is invariant under the Jacobian, which is
        // singular at pitch ±90°.
        found.nees = ekf
            .p
            .normalised_square(std::array::from_fn(|i| i), found.navigation);
        found
    }
}

/// What eight runs report at one epoch.
pub(super) struct EpochLanes {
    t_s: f64,
    gnss: bool,
    pub(super) see: [Lanes; REPORTED],
    /// The filter's own standard deviation of each sensor's bias (m/s², rad/s).
    bias_see: [Lanes; BIASES],
    pub(super) error: [Lanes; REPORTED],
    att_error_deg: Lanes,
    pub(super) nees: Lanes,
    pub(super) covered: [bool; LANES],
}

impl EpochLanes {
    /// What the first `live` lanes report at an event.
    pub(super) fn of(ekf: &Ekf, live: usize, plan: &Plan<'_>, event: &Event) -> Self {
        let found = Assessment::of(ekf, live, &event.reference);
        let states: [usize; COVERAGE_DOF] =
            std::array::from_fn(|i| if i < 3 { 3 * R + i } else { 3 * PSI + i - 3 });
        let coverage = ekf
            .p
            .normalised_square(states, states.map(|s| found.navigation[s]));
        let [accel, gyro] = Sensor::ALL.map(|sensor| ekf.bias_sigma(sensor).0);
        let bias_see = std::array::from_fn(|i| if i < 3 { accel[i] } else { gyro[i - 3] });
        Self {
            t_s: event.t_s,
            gnss: event.fix,
            see: found.see,
            bias_see,
            error: found.error,
            att_error_deg: found.att_error_deg,
            nees: found.nees,
            // The filter's own ellipsoid at the level: eᵀ P⁻¹ e below the χ² quantile of six degrees of
            // freedom.
            covered: std::array::from_fn(|lane| coverage[lane] <= plan.coverage_quantile),
        }
    }

    pub(super) fn sum(&self, kept: &[usize]) -> EpochSums {
        let mut sums = EpochSums {
            t_s: self.t_s,
            gnss: self.gnss,
            ..EpochSums::default()
        };
        for &lane in kept {
            sums.count += 1;
            for i in 0..REPORTED {
                let (see, error) = (self.see[i][lane], self.error[i][lane]);
                sums.see[i] += see;
                sums.see_sq[i] += see * see;
                sums.error[i] += error;
                sums.error_sq[i] += error * error;
                sums.error_4[i] += error.powi(4);
            }
            for (sum, see) in sums.bias_see.iter_mut().zip(&self.bias_see) {
                *sum += see[lane];
            }
            let position = DVec3::new(
                self.error[0][lane],
                self.error[1][lane],
                self.error[2][lane],
            )
            .length();
            for (sum, value) in [
                (&mut sums.pos_error, position),
                (&mut sums.att_error, self.att_error_deg[lane]),
                (&mut sums.nees, self.nees[lane]),
            ] {
                sum[0] += value;
                sum[1] += value * value;
            }
            sums.covered += u64::from(self.covered[lane]);
        }
        sums
    }
}

/// Errors of a run in the reported states (m, m/s, degrees) and the attitude error vector (rad).
struct ReportedError {
    values: [f64; REPORTED],
    psi_n: DVec3,
}

fn reported_error(estimate: &NavState, truth: &NavState) -> ReportedError {
    let r = ned_difference(truth, estimate.lat, estimate.lon, estimate.h);
    let v = estimate.v_n - truth.v_n;
    // C_est = (I + [psi×]) C_true, hence the estimate on the left: the same error vector as the filter's PSI
    // block.
    let psi_n = rotation_vector(estimate.q_b_n * truth.q_b_n.inverse());
    let jacobian = RollPitchYaw::from_quat(truth.q_b_n).jacobian_of_psi_n();
    // Through the Jacobian, not as a difference of Euler angles: linear as the filter's own deviation is, and
    // no angle wraps at ±180°.
    let angles = jacobian.map(|row| row.dot(psi_n) / DEG);
    ReportedError {
        values: [
            r.x, r.y, r.z, v.x, v.y, v.z, angles[0], angles[1], angles[2],
        ],
        psi_n,
    }
}

/// The rotation vector of a rotation (rad), the logarithm, exact for small ones too.
fn rotation_vector(q: DQuat) -> DVec3 {
    // q and −q are the same rotation: the one with w ≥ 0 is the shorter way.
    let (v, w) = if q.w < 0.0 {
        (-q.xyz(), -q.w)
    } else {
        (q.xyz(), q.w)
    };
    let sine = v.length();
    // Below it atan2(s, w)/s is 1 to rounding, and 0/0 is avoided.
    if sine < 1e-12 {
        v * 2.0
    } else {
        v * (2.0 * sine.atan2(w) / sine)
    }
}
