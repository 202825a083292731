//! The one place where recorded data meet the filter: one run, the same in all lanes.

use super::gap::Spread;
use super::{AidRecord, FixRecord, Nine, Row, RowError, Settings, Start, Use, VehicleVelocity};
use crate::earth::ned_difference;
use crate::ekf::covariance::{PSI, R, V};
use crate::ekf::{Belief, BodyVelocity, Ekf, Fix, advance, settle, update, update_body_velocity};
use crate::frames::{NavState, RollPitchYaw};
use crate::gnss::GnssFix;
use crate::imu::{ImuIncrement, ImuSample, Sensor};
use crate::lanes::{Lanes, Vec3};
use crate::linalg::to_nalgebra;
use crate::strapdown::Strapdown;
use crate::trajectory::reference::Reference;
use crate::units::DEG;
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector, Matrix3, SVector};

/// Longest step through a gap (s): the filter is linear within one.
const BRIDGE_STEP_S: f64 = 0.1;

/// The filter in the axes of the IMU.
pub(super) struct Filter {
    pub(super) ekf: Ekf,
    q_s_b: DQuat,
    mounting_sigma_b: DVec3,
    lever_arm_s: DVec3,
}

impl Filter {
    pub(super) fn new(belief: &Belief, start: &Start, settings: &Settings) -> Self {
        let q_s_b = settings.q_s_b;
        let of_imu = NavState {
            q_b_n: start.state.q_b_n * q_s_b,
            ..start.state
        };
        let nominal = Strapdown::new(&of_imu, settings.gravity);
        Self {
            // roll, pitch and yaw are those of the vehicle: their deviations go to n at its attitude
            ekf: Ekf::new(nominal, belief, &start.state, &start.sigma),
            q_s_b,
            mounting_sigma_b: settings.mounting_sigma_b,
            lever_arm_s: q_s_b.inverse() * settings.lever_arm_b,
        }
    }

    /// Through `seconds` of a sample.
    pub(super) fn advance(&mut self, sample: &ImuIncrement, seconds: f64) {
        let mean = ImuSample {
            omega_ib_b: sample.dtheta / sample.dt_s,
            f_ib_b: sample.dv / sample.dt_s,
        };
        self.ekf.set_interval(seconds);
        advance(&mut self.ekf, &[mean], &[[Vec3::ZERO; 2]]);
    }

    /// Through `seconds` of a sample that bridges a gap, in steps, as uncertain as [`super::gap`] says.
    pub(super) fn cross(&mut self, bridge: &ImuIncrement, seconds: f64, spread: Spread) {
        let steps = (seconds / BRIDGE_STEP_S).ceil().max(1.0);
        let step_s = seconds / steps;
        let mean = ImuSample {
            omega_ib_b: bridge.dtheta / bridge.dt_s,
            f_ib_b: bridge.dv / bridge.dt_s,
        };
        self.ekf.set_interval(step_s);
        // density σ²T over a step
        self.ekf
            .add_white(spread.map(|sigma| sigma * sigma * (bridge.dt_s / step_s)));
        for _ in 0..steps as usize {
            advance(&mut self.ekf, &[mean], &[[Vec3::ZERO; 2]]);
        }
    }

    fn fix(&self, fix: &GnssFix) -> Fix {
        Fix {
            lat: Lanes::splat(fix.lat),
            lon: Lanes::splat(fix.lon),
            h: Lanes::splat(fix.h),
            v_n: fix.velocity.map(|velocity| Vec3::splat(velocity.v_n())),
            pos_sigma_m: fix.pos_sigma_n,
            vel_sigma_m_s: fix
                .velocity
                .map_or(DVec3::ONE, |velocity| velocity.sigma_n()),
            lever_arm_b: self.lever_arm_s,
        }
    }

    /// Innovation, its standard deviations and NIS, all measured components together.
    pub(super) fn look_at(&mut self, fix: &GnssFix) -> FixRecord {
        settle(&mut self.ekf);
        let measured = self.fix(fix);
        let components = fix.components();
        let [position, velocity] = self.ekf.innovation(&measured);
        let both = [position.lane(0).to_array(), velocity.lane(0).to_array()].concat();
        let z = DVector::from_fn(components, |i, _| both[i]);
        let sigma = [
            measured.pos_sigma_m.to_array(),
            measured.vel_sigma_m_s.to_array(),
        ]
        .concat();
        let rows = self.ekf.measurement_rows(self.lever_arm_s);
        let h = DMatrix::from_fn(components, self.ekf.p.dim(), |i, j| rows[i][j]);
        let noise = DMatrix::from_fn(components, components, |i, j| {
            if i == j { sigma[i].powi(2) } else { 0.0 }
        });
        let s = &h * self.ekf.p.lane(0) * h.transpose() + noise;
        let sigma = s.diagonal().map(f64::sqrt).as_slice().to_vec();
        let (north_east, of_these) = (
            z.rows(0, 2).into_owned(),
            s.view((0, 0), (2, 2)).into_owned(),
        );
        let horizontal_nis = of_these
            .cholesky()
            .map_or(f64::NAN, |c| north_east.dot(&c.solve(&north_east)));
        let nis = s.cholesky().map_or(f64::NAN, |c| z.dot(&c.solve(&z)));
        let before = self.ekf.p.variances(R).lane(0);
        FixRecord {
            horizontal_nis,
            horizontal_sigma_m: (before.x + before.y).sqrt(),
            t_s: fix.t_s,
            used: Use::Used,
            innovation: z.as_slice().to_vec(),
            sigma,
            nis,
            error: None,
        }
    }

    pub(super) fn settle(&mut self) {
        settle(&mut self.ekf);
    }

    /// Uses a velocity along the vehicle's axes.
    pub(super) fn aid(&mut self, aid: &VehicleVelocity) -> AidRecord {
        let to_imu = self.q_s_b.inverse();
        let axes = aid.aid.axes();
        let measured = BodyVelocity {
            value: Vec3::splat(aid.velocity_b),
            axes,
            variance: aid.sigma_m_s * aid.sigma_m_s,
            lever_arm_b: to_imu * aid.lever_arm_b,
            vehicle_b: DVec3::AXES.map(|axis| to_imu * axis),
        };
        let found = update_body_velocity(&mut self.ekf, &measured);
        let normalised = found[..axes.len()]
            .iter()
            .map(|[z, variance]| z[0] / variance[0].sqrt());
        AidRecord {
            t_s: aid.t_s,
            aid: aid.aid,
            normalised: normalised.collect(),
        }
    }

    pub(super) fn update(&mut self, fix: &GnssFix) {
        let fix = self.fix(fix);
        let _ = update(&mut self.ekf, &fix);
    }

    /// The vehicle's state.
    fn state(&self) -> NavState {
        let of_imu = self.ekf.nominal.lane(0);
        NavState {
            q_b_n: (of_imu.q_b_n * self.q_s_b.inverse()).normalize(),
            ..of_imu
        }
    }

    /// What the mounting adds to the covariance of the vehicle's attitude error in n (rad²).
    fn of_mounting(&self, q_b_n: DQuat) -> Matrix3<f64> {
        let axes = DVec3::AXES.map(|axis| to_nalgebra(q_b_n * (axis * self.mounting_sigma_b)));
        axes.iter().map(|axis| axis * axis.transpose()).sum()
    }

    pub(super) fn row(&mut self, t_s: f64) -> Row {
        settle(&mut self.ekf);
        let (state, p) = (self.state(), &self.ekf.p);
        let (r, v) = (p.variances(R).lane(0), p.variances(V).lane(0));
        let full = p.lane(0);
        let psi = full.fixed_view::<3, 3>(3 * PSI, 3 * PSI) + self.of_mounting(state.q_b_n);
        let sigma = nine(&[
            r.map(f64::sqrt),
            v.map(f64::sqrt),
            angle_sigmas(state.q_b_n, &psi),
        ]);
        let bias = Sensor::ALL.map(|sensor| self.ekf.bias_of(sensor).lane(0));
        let bias_sigma = Sensor::ALL.map(|sensor| self.ekf.bias_sigma(sensor).lane(0));
        Row {
            t_s,
            state,
            sigma,
            bias,
            bias_sigma,
            error: None,
        }
    }

    /// Difference from a reference, where it is known at this instant.
    pub(super) fn error_from(&mut self, reference: &Reference, t_s: f64) -> Option<RowError> {
        Some(self.error(&reference.state(t_s)?, reference.velocity_sigma(t_s)?))
    }

    /// Difference from a state whose velocity is known as well as `velocity_sigma` (m/s).
    fn error(&mut self, truth: &NavState, velocity_sigma: f64) -> RowError {
        settle(&mut self.ekf);
        let estimate = self.state();
        let r = ned_difference(truth, estimate.lat, estimate.lon, estimate.h);
        let v = estimate.v_n - truth.v_n;
        let q = estimate.q_b_n * truth.q_b_n.inverse();
        let psi_n = (if q.w < 0.0 { -q } else { q }).to_scaled_axis();
        let angles = RollPitchYaw::from_quat(truth.q_b_n)
            .jacobian_of_psi_n()
            .map(|row| row.dot(psi_n) / DEG);
        let x = SVector::<f64, 9>::from_iterator([r, v, psi_n].iter().flat_map(DVec3::to_array));
        let mut p = self.ekf.p.lane(0).fixed_view::<9, 9>(0, 0).into_owned();
        let mut psi = p.fixed_view_mut::<3, 3>(3 * PSI, 3 * PSI);
        psi += self.of_mounting(truth.q_b_n);
        let angle_sigma = angle_sigmas(truth.q_b_n, &psi.into_owned());
        let mut of_velocity = p.fixed_view_mut::<3, 3>(3 * V, 3 * V);
        of_velocity += Matrix3::from_diagonal_element(velocity_sigma * velocity_sigma);
        let sigma = |block: usize| {
            DVec3::from_array([0, 1, 2].map(|i| p[(3 * block + i, 3 * block + i)].sqrt()))
        };
        let sigma = nine(&[sigma(R), sigma(V), angle_sigma]);
        let nees = p.cholesky().map_or(f64::NAN, |c| x.dot(&c.solve(&x)));
        RowError {
            values: nine(&[r, v, angles.into()]),
            sigma,
            velocity_sigma,
            nees,
        }
    }
}

/// Standard deviations of roll, pitch and yaw (degrees) where the attitude error in n has this covariance.
fn angle_sigmas(q_b_n: DQuat, psi: &Matrix3<f64>) -> DVec3 {
    let jacobian = RollPitchYaw::from_quat(q_b_n)
        .jacobian_of_psi_n()
        .map(to_nalgebra);
    DVec3::from_array(jacobian.map(|row| (row.transpose() * psi * row)[0].sqrt() / DEG))
}

fn nine(of: &[DVec3; 3]) -> Nine {
    std::array::from_fn(|i| of[i / 3][i % 3])
}
