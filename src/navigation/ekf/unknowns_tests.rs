//! Scale factors and drifts in the filter, against central differences of the strapdown and of the antenna, and
//! against dense matrices.

use super::covariance::{EarthTerms, PSI, V};
use super::filter_model::BiasGroup;
use super::tests::{
    Matrix15, T_CORR_S, certain_start, continuous_f, continuous_q, ekf, error_of, fix_at_nominal,
    gauss_markov_model, generator, manoeuvre, measurement_rows, predict, random_case, start,
};
use super::{
    CoefficientKind, Ekf, FilterModel, FilterStates, InitialSettings, apply_pending_earth_step,
    update,
};
use crate::earth::{self, GravityModel};
use crate::frames::NavState;
use crate::imu::Sensor;
use crate::lanes::{Lanes, Level, Vec3};
use crate::noise::{Composite, Model, Process};
use crate::strapdown::Strapdown;
use approx::{assert_abs_diff_eq, assert_relative_eq};
use glam::{DQuat, DVec3};
use nalgebra::DMatrix;

/// First states of the unknowns of accelerometer and gyroscope: 9 + 6 biases, then drift and scale factor of each.
const UNKNOWNS: usize = 15;
const DIM: usize = 27;

/// The 15-state filter with drifts and scale factors of both sensors, each axis with its own.
fn filter_model() -> FilterModel {
    let mut filter_model =
        FilterModel::new(&gauss_markov_model(), FilterStates::Reduced15, 1.0, 800.0).unwrap();
    for (sensor, unit) in [(Sensor::Accel, 1.0), (Sensor::Gyro, 1e-2)] {
        let axes = DVec3::new(1.0, 2.0, 3.0);
        filter_model.set_unknown(sensor, CoefficientKind::Drift, axes * unit * 1e-6);
        filter_model.set_unknown(sensor, CoefficientKind::ScaleFactor, axes * 1e-3);
    }
    assert_eq!((filter_model.states, 3 * filter_model.blocks()), (DIM, DIM));
    filter_model
}

/// Squares of the deviations, of attitude those of roll, pitch and yaw of a level vehicle.
#[test]
fn the_covariance_at_the_start_is_what_is_believed() {
    let level = NavState {
        q_b_n: DQuat::IDENTITY,
        ..start()
    };
    let initial = InitialSettings {
        pos_sigma_m: [2.0, 3.0, 4.0],
        vel_sigma_m_s: [0.1, 0.2, 0.3],
        att_sigma_deg: [0.5, 0.6, 2.0],
        ..InitialSettings::default()
    };
    let p = ekf(&filter_model(), &level, &initial).p.lane(0);
    let angles = initial.att_sigma_deg.map(f64::to_radians);
    let sigmas = [initial.pos_sigma_m, initial.vel_sigma_m_s, angles].concat();
    for (i, sigma) in sigmas.iter().enumerate() {
        assert_abs_diff_eq!(
            p[(i, i)],
            sigma * sigma,
            epsilon = 1e-15 * (1.0 + p[(i, i)])
        );
    }
}

/// Flicker noise starts with the variance of all that is slower than its fastest bias, in however few states.
#[test]
fn flicker_noise_starts_with_its_variance() {
    let noise = Process::flicker(1e-8).unwrap();
    let axis = Composite::new(vec![noise]);
    let filter_model = FilterModel::new(
        &Model::pooled(100.0, &axis, &axis),
        FilterStates::Full,
        1.0,
        800.0,
    )
    .unwrap();
    let variance: f64 = filter_model.groups[0]
        .iter()
        .map(|group| group.initial.x)
        .sum();
    assert_relative_eq!(variance, noise.initial_variance(), max_relative = 1e-12);
}

/// A turn-on bias has a state beside the processes of the model, which stay; a second one adds its variance to the first, and
/// where the model has no bias it is the only one.
#[test]
fn a_turn_on_bias_is_beside_what_wanders() {
    let white = Process::white(1e-6).unwrap();
    let walk = Process::random_walk(1e-10).unwrap();
    for (processes, others) in [(vec![white, walk], 1), (vec![white], 0)] {
        let axis = Composite::new(processes);
        let model = Model::pooled(100.0, &axis, &axis);
        let mut filter_model = FilterModel::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
        [0.03, 0.04]
            .iter()
            .for_each(|sigma| filter_model.add_constant(Sensor::Accel, *sigma));
        let groups = &filter_model.groups[0];
        assert_eq!(
            (groups.len(), filter_model.states),
            (others + 1, 9 + 6 * others + 3)
        );
        assert!(
            groups[..others]
                .iter()
                .all(|walk| walk.innovation.x == 1e-10 && walk.initial.x == 0.0)
        );
        let constant = groups[others];
        assert!(
            constant.phi.x == 1.0 && constant.innovation.x == 0.0,
            "{constant:?}"
        );
        assert_abs_diff_eq!(constant.initial.x, 0.05 * 0.05, epsilon = 1e-15);
    }
}

/// What a filter that integrates feels of several white processes: the sum over all time of their covariance with one sample.
#[test]
fn white_noises_add_up_to_their_long_run_variance() {
    let parts = [
        Process::white(3.0).unwrap(),
        Process::ma1(-0.5, 8.0).unwrap(),
    ];
    let axis = Composite::new(parts.to_vec());
    let filter_model = FilterModel::new(
        &Model::pooled(100.0, &axis, &axis),
        FilterStates::Full,
        1.0,
        800.0,
    )
    .unwrap();
    // MA1: (1 + theta²) sigma² of the sample itself, theta sigma² with each neighbour
    assert_eq!(
        filter_model.white,
        [DVec3::splat(3.0 + 8.0 * (1.25 - 2.0 * 0.5)); 2]
    );
}

/// Column of one unknown in the transition of a sample, by central differences of the strapdown: an estimate
/// too large by `size` takes that much too much off the sample.
fn numeric_column(
    state: &NavState,
    sample: [DVec3; 2],
    unknown: usize,
    size: f64,
    age: f64,
    dt: f64,
) -> [f64; 9] {
    let (sensor, is_scale, axis) = (unknown / 6, unknown / 3 % 2 == 1, unknown % 3);
    let mut ins = Strapdown::new(state, GravityModel::Wgs84);
    let mut increments = sample.map(|s| Vec3::splat(s * dt));
    for (lane, sign) in [(1, 1.0), (2, -1.0)] {
        let mut changed = sample[sensor];
        changed[axis] = if is_scale {
            changed[axis] / (1.0 + sign * size)
        } else {
            changed[axis] - sign * size * age
        };
        increments[sensor].set_lane(lane, changed * dt);
    }
    ins.step(increments[1], increments[0], dt);
    let nominal = ins.lane(0);
    let (plus, minus) = (
        error_of(&ins.lane(1), &nominal),
        error_of(&ins.lane(2), &nominal),
    );
    std::array::from_fn(|i| (plus[i] - minus[i]) / (2.0 * size))
}

/// With nothing but one unknown in the covariance, a sample makes cov(navigation, unknown) = column · variance
/// and the navigation's own covariance column · variance · columnᵀ, through both passes of P ← A P Aᵀ.
#[test]
fn columns_of_unknowns_agree_with_central_differences() {
    let mut g = generator("unknowns");
    let exact = certain_start();
    let mut silent = filter_model();
    silent.white = [DVec3::ZERO; 2];
    silent.groups = [vec![BiasGroup::default()], vec![BiasGroup::default()]];
    // second-order terms of the sample are 5e-4 of the first at 1 rad/s, and the first sample's age is 1
    silent.rate_hz = 1000.0;
    let (dt, age) = (1e-3, 1.0);
    for k in 0..3000 {
        let (state, omega, f) = random_case(&mut g);
        let unknown = k % 12;
        let (sensor, kind) = (
            Sensor::ALL[unknown / 6],
            [CoefficientKind::Drift, CoefficientKind::ScaleFactor][unknown / 3 % 2],
        );
        let mut one = silent.clone();
        for other in Sensor::ALL {
            for kind in [CoefficientKind::Drift, CoefficientKind::ScaleFactor] {
                // deviations so small that they leave no trace beside the one that is looked at
                one.set_unknown(other, kind, DVec3::splat(1e-30));
            }
        }
        let mut sigma = DVec3::splat(1e-30);
        sigma[unknown % 3] = 1.0;
        one.set_unknown(sensor, kind, sigma);
        let mut filter = ekf(&one, &state, &exact);
        predict(&mut filter, omega, f);
        let size = 1e-3;
        let numeric = numeric_column(&state, [f, omega], unknown, size, age, dt);
        let column: Vec<f64> = (0..9)
            .map(|i| filter.p.get::<Lanes>(i, UNKNOWNS + unknown)[0])
            .collect();
        let scale = |of: &[f64], block: usize| {
            of[3 * block..3 * block + 3]
                .iter()
                .fold(0.0_f64, |m, x| m.max(x.abs()))
        };
        for i in 0..9 {
            // rounding of a difference of latitudes, velocities, quaternions
            let rounding = [4e-9, 1e-12, 4e-15][i / 3] / size;
            // the transport rate of a velocity error, (1 + tan lat)/R, is among the Earth's terms, which lag
            let transport = if i / 3 == PSI {
                7e-7 * dt * scale(&numeric, V)
            } else {
                0.0
            };
            // where the tilt is nearly along f, what is left of ½ psi × f dt is small beside its second order in ω dt
            let second_order = match i / 3 {
                V => 0.5 * scale(&numeric, PSI) * f.length() * dt * omega.length() * dt,
                _ => 0.0,
            };
            let bound = 2e-3 * scale(&numeric, i / 3) + rounding + transport + second_order;
            assert!(
                (column[i] - numeric[i]).abs() <= bound,
                "unknown {unknown}, state {i}: {column:?} {numeric:?}"
            );
            for j in 0..9 {
                let (p, product) = (filter.p.get::<Lanes>(i, j)[0], column[i] * column[j]);
                // where the column is zero, the other unknowns' deviations of 1e-30 are left
                let bound = 1e-12 * scale(&column, i / 3) * scale(&column, j / 3) + 1e-50;
                assert!(
                    (p - product).abs() <= bound,
                    "({i}, {j}): {p:e} {product:e}"
                );
            }
        }
    }
}

/// A sample spoilt by exactly what the filter estimates is navigated as the clean one.
#[test]
fn samples_are_corrected_by_what_is_estimated() {
    let (scale, slope, bias) = (
        DVec3::new(1e-2, -2e-2, 3e-2),
        DVec3::new(3e-4, -1e-4, 2e-4),
        DVec3::splat(0.01),
    );
    let mut filter = ekf(&filter_model(), &start(), &InitialSettings::default());
    let mut clean = Strapdown::new(&start(), GravityModel::Wgs84);
    let spoilt = |truth: DVec3, k: u32| truth * (DVec3::ONE + scale) + bias + slope * f64::from(k);
    for sensor in Sensor::ALL {
        let first = filter.sources().unknowns(sensor);
        let groups = filter.filter_model.groups.clone();
        filter.estimates[if sensor == Sensor::Accel {
            0
        } else {
            groups[0].len()
        }] = Vec3::splat(bias);
        (filter.estimates[first], filter.estimates[first + 1]) =
            (Vec3::splat(slope), Vec3::splat(scale));
    }
    // biases that do not fade
    filter
        .steps
        .iter_mut()
        .for_each(|step| step.phi = DVec3::ONE);
    for k in 1..=500 {
        let (omega, f) = manoeuvre(f64::from(k) * 0.01);
        predict(&mut filter, spoilt(omega, k), spoilt(f, k));
        clean.step(Vec3::splat(omega * 0.01), Vec3::splat(f * 0.01), 0.01);
    }
    let error = error_of(&filter.nominal.lane(0), &clean.lane(0));
    assert!(error.iter().all(|e| e.abs() < 1e-9), "{error:?}");
    let bias_of = filter.bias_of::<Lanes>(Sensor::Gyro).lane(4);
    assert!(
        (bias_of - bias - slope * 500.0).length() < 1e-15,
        "{bias_of}"
    );
}

/// The dense covariance through one sample: biases first, then exp(F dt) with the noise by Simpson's rule.
fn dense_step(p: &DMatrix<f64>, f: &DMatrix<f64>, dt: f64) -> DMatrix<f64> {
    let mut decay = DMatrix::identity(DIM, DIM);
    let mut q = DMatrix::zeros(DIM, DIM);
    for i in 9..15 {
        let sensor = i / 3 - 3;
        let phi = (-dt / T_CORR_S[sensor]).exp();
        (decay[(i, i)], q[(i, i)]) = (phi, [9e-4, 1e-8][sensor] * (1.0 - phi * phi));
    }
    let p = &decay * p * decay.transpose() + q;
    let mut white = DMatrix::zeros(DIM, DIM);
    white.view_mut((0, 0), (15, 15)).copy_from(&continuous_q());
    let (whole, half) = ((f * dt).exp(), (f * (0.5 * dt)).exp());
    let spread = |phi: &DMatrix<f64>| phi * &white * phi.transpose();
    let noise = (&white + spread(&half) * 4.0 + spread(&whole)) * (dt / 6.0);
    &whole * p * whole.transpose() + noise
}

/// F of 15 states with a column for each unknown: that of the bias of its axis times the regressor.
fn dense_f(f15: &Matrix15, regressors: [DVec3; 4]) -> DMatrix<f64> {
    let mut f = DMatrix::zeros(DIM, DIM);
    f.view_mut((0, 0), (15, 15)).copy_from(f15);
    for u in 0..12 {
        let bias = f15.column(9 + 3 * (u / 6) + u % 3) * regressors[u / 3][u % 3];
        f.view_mut((0, UNKNOWNS + u), (15, 1)).copy_from(&bias);
    }
    f
}

/// 60 s of manoeuvres with fixes of an antenna on an arm, and an outage: 27 states against dense matrices, 1e-4
/// in every standard deviation, with every vector unit.
#[test]
fn covariance_agrees_with_dense_matrices_over_a_run() {
    let arm = DVec3::new(0.8, -0.4, -1.5);
    let initial = InitialSettings::default();
    let levels = [Level::Portable, Level::best()];
    let mut filters = levels.map(|level| ekf(&filter_model(), &start(), &initial).at_level(level));
    let mut p = filters[0].p.lane(0);
    for k in 0..6000_u32 {
        let (omega, f) = manoeuvre((f64::from(k) + 0.5) * 0.01);
        let terms = EarthTerms::at(&filters[0].nominal);
        let before = filters[0].nominal.q_b_n.to_matrix().lane(0);
        filters
            .iter_mut()
            .for_each(|filter| predict(filter, omega, f));
        let c = (before + filters[0].nominal.q_b_n.to_matrix().lane(0)) * 0.5;
        let age = DVec3::splat(f64::from(k + 1));
        p = dense_step(
            &p,
            &dense_f(&continuous_f(&terms, &c, f), [age, f, age, omega]),
            0.01,
        );
        if (k + 1) % 100 != 0 {
            continue;
        }
        if !(3000..5000).contains(&k) {
            let mut fix = fix_at_nominal(&filters[0], 0.5, 0.02);
            fix.lever_arm_b = arm;
            let rows = measurement_rows(&filters[0], arm);
            for (row, r) in rows.iter().zip([0.25, 0.25, 0.25, 4e-4, 4e-4, 4e-4]) {
                let ph = &p * DMatrix::from_column_slice(DIM, 1, row);
                let s = row.iter().zip(ph.iter()).map(|(h, ph)| h * ph).sum::<f64>() + r;
                p -= &ph * ph.transpose() / s;
            }
            // where the antenna would be seen without error: the estimates stay zero
            let (shift, _) = filters[0].innovation(&fix);
            fix = fix_without_innovation(&filters[0], fix, shift.as_slice());
            filters
                .iter_mut()
                .for_each(|filter| _ = update(filter, &fix));
        }
        for filter in &mut filters {
            apply_pending_earth_step(filter);
            for i in 0..DIM {
                let ratio = (filter.p.get::<Lanes>(i, i)[0] / p[(i, i)]).sqrt();
                assert!(
                    (ratio - 1.0).abs() < 1e-4,
                    "state {i} at sample {k}: ratio {ratio}"
                );
            }
        }
    }
    for sensor in Sensor::ALL {
        let first = if sensor == Sensor::Accel { 18 } else { 24 };
        let sigma = filters[0].p.variances(first / 3).lane(0).y.sqrt();
        assert_relative_eq!(sigma, p[(first + 1, first + 1)].sqrt(), max_relative = 1e-4);
        // bias and drift of an axis together: c = (1, age)
        let (bias, drift) = (9 + 3 * sensor as usize, first - 3);
        let sum = p[(bias, bias)] + 2.0 * 6000.0 * p[(bias, drift)] + 3.6e7 * p[(drift, drift)];
        let got = filters[0].bias_sigma(sensor).lane(0).x;
        assert_relative_eq!(got, sum.sqrt(), max_relative = 2e-3);
    }
}

/// The fix whose innovation is zero.
fn fix_without_innovation(filter: &Ekf, mut fix: super::Fix, innovation: &[f64]) -> super::Fix {
    let at = filter.nominal.lane(0);
    let r = earth::radii(at.lat.sin());
    let [z, v] = [0, 3].map(|first| DVec3::from_slice(&innovation[first..]));
    fix.lat = Lanes::splat(fix.lat[0] + z.x / (r.meridian + at.h));
    fix.lon = Lanes::splat(fix.lon[0] + z.y / ((r.transverse + at.h) * at.lat.cos()));
    fix.h = Lanes::splat(fix.h[0] - z.z);
    fix.v_n = fix.v_n.map(|before| Vec3::splat(before.lane(0) + v));
    fix
}

/// The velocity of an antenna on an arm against the gyroscope's unknowns, by central differences.
#[test]
fn lever_arm_rows_of_unknowns_agree_with_central_differences() {
    let (mut g, arm) = (generator("h of unknowns"), DVec3::new(1.3, -0.7, -2.1));
    for _ in 0..2000 {
        let (state, omega, f) = random_case(&mut g);
        let mut filter = ekf(&filter_model(), &state, &InitialSettings::default());
        predict(&mut filter, omega, f);
        let now = filter.nominal.lane(0);
        let velocity = |omega: DVec3| {
            let omega_eb_b = omega - now.q_b_n.inverse() * earth::omega_ie_n(now.lat);
            now.v_n + now.q_b_n * omega_eb_b.cross(arm)
        };
        let rows = measurement_rows(&filter, arm);
        for u in 0..12 {
            let (axis, size) = (DVec3::AXES[u % 3], 1e-4);
            let changed = |sign: f64| match u / 3 {
                2 => omega - axis * (sign * size),
                3 => omega / (DVec3::ONE + axis * (sign * size)),
                _ => omega,
            };
            let numeric = (velocity(changed(1.0)) - velocity(changed(-1.0))) / (2.0 * size);
            for component in 0..3 {
                let (got, expected) = (rows[3 + component][UNKNOWNS + u], numeric[component]);
                assert!(
                    (got - expected).abs() < 2e-6,
                    "unknown {u}, component {component}: {got} {expected}"
                );
                assert_eq!(rows[component][UNKNOWNS + u], 0.0);
            }
        }
    }
}
