//! A standard load, part by part: what the benches time.
//!
//! Eight runs of a consumer-grade IMU (N2 noise on six axes, 100 Hz) at rest, one second at a time: noise,
//! prediction, one fix. What a second costs does not depend on what the vehicle does.

use glam::{DQuat, DVec3};
use nav_sim_navigation::earth::{GravityModel, gravity_down};
use nav_sim_navigation::ekf::{
    Ekf, FilterModel, FilterModelError, FilterStates, Fix, InitialSettings, advance, update,
};
use nav_sim_navigation::frames::NavState;
use nav_sim_navigation::sensors::imu::{LaneErrors, Truth};
use nav_sim_navigation::strapdown::Strapdown;
use nav_sim_signal::imu::ImuSample;
use nav_sim_signal::lanes::{LANES, Lanes, Level, Vec3};
use nav_sim_signal::noise::{Composite, Model, ParameterError, Process};
use nav_sim_signal::rng::StreamKey;

/// IMU samples of one round.
pub(crate) const SAMPLES: usize = 100;
/// Run-epochs of one round: one IMU sample of one run each.
pub(crate) const RUN_EPOCHS: usize = SAMPLES * LANES;

/// The noise model of the load: N2, two AR1 + RW + WN + QN, at 100 Hz.
///
/// # Errors
/// None for these parameters.
pub(crate) fn model() -> Result<Model, ParameterError> {
    let axis = |scale: f64| -> Result<Composite, ParameterError> {
        Ok(Composite::new(vec![
            Process::white(scale * 5e-5)?,
            Process::quantization(scale * 1e-7)?,
            Process::ar1(0.9835, scale * 1.3e-8)?,
            Process::ar1(0.9999, scale * 1e-11)?,
            Process::random_walk(scale * 2.9e-11)?,
        ]))
    };
    Ok(Model::pooled(100.0, &axis(1.0)?, &axis(1e-2)?))
}

/// One batch of eight runs, a second at a time.
#[derive(Debug, Clone)]
pub(crate) struct Load<'a> {
    ekf: Ekf,
    samples: [ImuSample; SAMPLES],
    errors: LaneErrors<'a>,
    fix: Fix,
}

impl<'a> Load<'a> {
    /// With a model for truth and filter, a filter variant and a dispatch level.
    ///
    /// # Errors
    /// When the model cannot be made into filter states.
    pub(crate) fn new(
        model: &'a Model,
        states: FilterStates,
        level: Level,
    ) -> Result<Self, FilterModelError> {
        // Fixes at 1 Hz and the shortest window of the reduction, as in a default run.
        let filter_model = FilterModel::new(model, states, 1.0, 800.0)?;
        let start = NavState {
            lat: 0.8,
            lon: 0.1,
            h: 400.0,
            v_n: DVec3::ZERO,
            q_b_n: DQuat::IDENTITY,
        };
        let gravity = GravityModel::Wgs84;
        // At rest the accelerometers measure the reaction of the ground, −g.
        let f_ib_b = DVec3::NEG_Z * gravity_down(gravity, start.lat.sin(), start.h);
        let key = |run| StreamKey {
            seed: 1,
            scenario: "",
            run,
            source: "",
            process: "",
        };
        let keys: Vec<_> = (0..LANES as u64).map(key).collect();
        let settings = InitialSettings::default();
        Ok(Self {
            ekf: Ekf::new(
                Strapdown::new(&start, gravity),
                &filter_model,
                &start,
                &settings,
            )
            .at_level(level),
            samples: [ImuSample {
                omega_ib_b: DVec3::ZERO,
                f_ib_b,
            }; SAMPLES],
            errors: LaneErrors::new(&Truth::Model(model), &[], &keys, SAMPLES),
            fix: Fix {
                lat: Lanes::splat(start.lat),
                lon: Lanes::splat(start.lon),
                h: Lanes::splat(start.h),
                v_n: Some(Vec3::ZERO),
                pos_sigma_m: DVec3::new(2.0, 2.0, 4.0),
                vel_sigma_m_s: DVec3::new(0.04, 0.04, 0.06),
                lever_arm_b: DVec3::ZERO,
            },
        })
    }

    /// Draws the inertial errors of a second.
    pub(crate) fn noise(&mut self) {
        self.errors.next(SAMPLES);
    }

    /// Predicts through a second: strapdown and covariance at the full rate.
    pub(crate) fn filter(&mut self) {
        advance(&mut self.ekf, &self.samples, self.errors.drawn());
    }

    /// Uses a fix, position and velocity.
    pub(crate) fn fix(&mut self) {
        update(&mut self.ekf, &self.fix);
    }
}
