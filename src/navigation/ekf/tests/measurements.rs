//! Rows of measurements, sums of biases, and the noise of one sample.

use super::super::update::update_height;
use super::*;
use crate::ekf::update::{body_velocity_rows, yaw_row as row_of_yaw};
use crate::frames::{RollPitchYaw, wrap_angle};

/// H of position and velocity on a lever arm against central differences of the antenna itself.
#[test]
fn lever_arm_rows_agree_with_central_differences() {
    let mut g = generator("h");
    let arm = DVec3::new(1.3, -0.7, -2.1);
    for _ in 0..RANDOM_STATES {
        let (state, omega, _) = random_case(&mut g);
        let mut ekf = ekf(&gauss_markov_model(), FilterStates::Reduced15);
        for lane in 0..8 {
            ekf.nominal.set_lane(lane, &state);
        }
        ekf.omega_ib_b = Vec3::splat(omega);
        // antenna position (relative, m) and velocity for a state and a gyroscope bias error
        let antenna = |s: &NavState, bias: DVec3| {
            let r = earth::ned_difference(state.place(), s.place()) + s.q_b_n * arm;
            let omega_eb_b = omega - bias - s.q_b_n.inverse() * earth::omega_ie_n(state.lat);
            (r, s.v_n + s.q_b_n * omega_eb_b.cross(arm))
        };
        let rows = measurement_rows(&ekf, arm);
        for column in 0..15 {
            let (block, axis) = (column / 3, column % 3);
            let size = [1.0, 1.0, 1e-5, 1.0, 1e-4][block];
            let bias = |sign: f64| {
                if block == 4 {
                    DVec3::AXES[axis] * (sign * size)
                } else {
                    DVec3::ZERO
                }
            };
            let plus = antenna(&perturbed(&state, block, axis, size), bias(1.0));
            let minus = antenna(&perturbed(&state, block, axis, -size), bias(-1.0));
            let numeric = (
                (plus.0 - minus.0) / (2.0 * size),
                (plus.1 - minus.1) / (2.0 * size),
            );
            for (component, row) in rows.iter().enumerate() {
                let expected = if component < 3 {
                    numeric.0[component]
                } else {
                    numeric.1[component - 3]
                };
                let got = row[column];
                // position in metres is exact to 1e-3 of its curvature; velocity differences round at 1e-9
                assert!(
                    (got - expected).abs() < 2e-6,
                    "row {component}, column {column}: {got} {expected}"
                );
            }
        }
    }
}

/// A fix of the antenna where the filter has it moves nothing: on a lever arm, at the date line, a turn of longitude apart.
#[test]
fn a_fix_of_the_antenna_where_it_is_moves_nothing() {
    let mut g = generator("still");
    let arm = DVec3::new(1.3, -0.7, -2.1);
    for turns in [-1.0, 0.0, 1.0].into_iter().cycle().take(300) {
        let (case, omega, _) = random_case(&mut g);
        let state = NavState {
            lon: std::f64::consts::PI - 1e-7,
            ..case
        };
        let mut filter = ekf(&gauss_markov_model(), FilterStates::Reduced15);
        (0..8).for_each(|lane| filter.nominal.set_lane(lane, &state));
        filter.omega_ib_b = Vec3::splat(omega);
        let (r, radii) = (state.q_b_n * arm, earth::radii(state.lat.sin()));
        let omega_eb_b = omega - state.q_b_n.inverse() * earth::omega_ie_n(state.lat);
        let lon = state.lon + r.y / ((radii.transverse + state.h) * state.lat.cos());
        let fix = Fix {
            lat: Lanes::splat(state.lat + r.x / (radii.meridian + state.h)),
            lon: Lanes::splat(lon + turns * std::f64::consts::TAU),
            h: Lanes::splat(state.h - r.z),
            v_n: Some(Vec3::splat(state.v_n + state.q_b_n * omega_eb_b.cross(arm))),
            lever_arm_b: arm,
            ..fix_at_nominal(&filter, 2.0, 0.05)
        };
        let nis = update(&mut filter, &fix);
        // rounding of a longitude plus a turn, 1e-15 · 6.4e6 m, of the metres of a fix
        let moved = error_of(&filter.nominal.lane(0), &state);
        assert!(
            moved.iter().all(|moved| moved.abs() < 1e-7) && nis[0] < 1e-14,
            "{moved:?} {nis:?}"
        );
    }
}

/// A height of 0.5 m adds its information to that of the start.
#[test]
fn a_height_is_worth_its_variance() {
    let mut filter = ekf(&gauss_markov_model(), FilterStates::Reduced15);
    let before = filter.p.get::<Lanes>(2, 2)[0];
    let height = filter.nominal.h;
    update_height(&mut filter, &height, 0.5);
    let after = filter.p.get::<Lanes>(2, 2)[0];
    assert!(
        (after * (1.0 / before + 1.0 / 0.25) - 1.0).abs() < 1e-12,
        "{before} {after}"
    );
}

/// Rows of the velocity along the body's axes and of yaw, against central differences of both.
#[test]
fn rows_of_body_velocity_and_yaw_agree_with_central_differences() {
    let mut g = generator("body");
    let arm = DVec3::new(-1.4, 0.6, 0.9);
    for _ in 0..2000 {
        let (state, omega, _) = random_case(&mut g);
        let ins = Strapdown::<f64>::new(&state, GravityModel::Wgs84);
        let (rows, yaw_row) = (body_velocity_rows(&ins, omega, arm), row_of_yaw(&ins));
        let measured = |s: &NavState, bias: DVec3| {
            let omega_eb_b = omega - bias - s.q_b_n.inverse() * earth::omega_ie_n(state.lat);
            let v_b = s.q_b_n.inverse() * s.v_n + omega_eb_b.cross(arm);
            (v_b, RollPitchYaw::from_quat(s.q_b_n))
        };
        let is_steep = measured(&state, DVec3::ZERO).1.pitch.cos() < 0.1;
        for column in 0..12 {
            let (block, axis) = (column / 3, column % 3);
            let size = [1.0, 1.0, 1e-5, 1e-4][block];
            let bias = |sign: f64| {
                if block == 3 {
                    DVec3::AXES[axis] * (sign * size)
                } else {
                    DVec3::ZERO
                }
            };
            let plus = measured(&perturbed(&state, block, axis, size), bias(1.0));
            let minus = measured(&perturbed(&state, block, axis, -size), bias(-1.0));
            for (component, row) in rows.iter().enumerate() {
                let numeric = (plus.0[component] - minus.0[component]) / (2.0 * size);
                // of 400 m/s the difference rounds at 1e-13/1e-5, and its third derivative adds 1e-8
                assert!(
                    (row[column] - numeric).abs() < 2e-6,
                    "{component}, {column}: {} {numeric}",
                    row[column]
                );
            }
            let numeric = wrap_angle(plus.1.yaw - minus.1.yaw) / (2.0 * size);
            assert!(
                is_steep || (yaw_row[column] - numeric).abs() < 1e-6,
                "yaw, {column}: {}",
                yaw_row[column]
            );
        }
    }
}

/// The estimated bias of each sensor is the sum of its groups.
#[test]
fn biases_add_up() {
    let mut filter = ekf(&gauss_markov_model(), FilterStates::Full);
    filter.estimates = vec![Vec3::splat(DVec3::X), Vec3::splat(DVec3::Y)];
    assert_eq!(filter.bias_of::<Lanes>(Sensor::Accel).lane(0), DVec3::X);
    assert_eq!(filter.bias_of::<Lanes>(Sensor::Gyro).lane(0), DVec3::Y);
}

/// A filter that is certain of everything but for white noise of a sample of these variances at 100 Hz.
fn certain(accel: f64, gyro: f64) -> Ekf {
    let axis = |sigma2: f64| Composite::new(vec![Process::white(sigma2).unwrap()]);
    let model = Model::pooled(100.0, &axis(accel), &axis(gyro));
    let belief = Belief::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
    let start = NavState {
        lat: 0.8,
        lon: 0.1,
        h: 400.0,
        v_n: DVec3::ZERO,
        q_b_n: DQuat::from_rotation_z(0.7),
    };
    let settings = InitialSettings {
        pos_sigma_m: [0.0; 3],
        vel_sigma_m_s: [0.0; 3],
        att_sigma_deg: [0.0; 3],
        ..InitialSettings::default()
    };
    Ekf::new(
        Strapdown::new(&start, GravityModel::Wgs84),
        &belief,
        &start,
        &settings,
    )
}

/// One sample of white rates tilts and, while it lasts, lets the specific force drive the velocity:
/// Q of velocity and attitude is −\[f_n ×\] S dt²/2, S the power of the rates (van Loan to first order).
#[test]
fn noise_of_one_sample_correlates_velocity_and_attitude() {
    let mut filter = certain(4e-5, 1e-6);
    let f_b = DVec3::new(1.0, -2.0, -9.8);
    predict(&mut filter, DVec3::ZERO, f_b);
    let f = DQuat::from_rotation_z(0.7) * f_b;
    let skew = [[0.0, -f.z, f.y], [f.z, 0.0, -f.x], [-f.y, f.x, 0.0]];
    let half = 0.5 * 1e-6 * 0.01 * 0.01 * 0.01;
    for i in 0..3 {
        for j in 0..3 {
            let (found, expected) = (filter.p.get::<Lanes>(3 + i, 6 + j)[0], -skew[i][j] * half);
            assert!(
                (found - expected).abs() < 1e-3 * 9.8 * half,
                "({i}, {j}): {found:e} {expected:e}"
            );
        }
    }
}

/// White noise w of one sample is an acceleration for dt: w dt in the velocity, w dt²/2 in the position.
#[test]
fn one_sample_of_white_noise_moves_the_position_by_half_a_step() {
    let mut filter = certain(1.0, 1e-6);
    predict(&mut filter, DVec3::ZERO, DVec3::ZERO);
    for axis in 0..3 {
        let of = |i: usize, j: usize| filter.p.get::<Lanes>(3 * i + axis, 3 * j + axis)[0];
        for (found, expected) in [(of(V, V), 1e-4), (of(R, V), 0.5e-6), (of(R, R), 0.25e-8)] {
            assert!(
                (found / expected - 1.0).abs() < 1e-12,
                "axis {axis}: {found:e} for {expected:e}"
            );
        }
    }
}

/// White noise keeps its density whatever the interval: velocity and attitude variance after a second are
/// sigma² dt·1 s, at 100 Hz and in steps of 2 to 40 ms.
#[test]
fn white_noise_does_not_depend_on_how_time_is_cut() {
    for steps in [vec![0.01; 100], [0.002, 0.04, 0.008].repeat(20)] {
        let mut filter = certain(4e-5, 1e-6);
        for dt in steps {
            filter.set_interval(dt);
            predict(&mut filter, DVec3::ZERO, DVec3::ZERO);
        }
        settle(&mut filter);
        for i in 0..3 {
            let (velocity, attitude) = (
                filter.p.get::<Lanes>(3 + i, 3 + i)[0],
                filter.p.get::<Lanes>(6 + i, 6 + i)[0],
            );
            assert!(
                (velocity / (4e-5 * 0.01) - 1.0).abs() < 1e-3,
                "{velocity:e}"
            );
            assert!(
                (attitude / (1e-6 * 0.01) - 1.0).abs() < 1e-3,
                "{attitude:e}"
            );
        }
    }
}
