//! Rows of measurements, sums of biases, and the noise of one sample.

use super::super::update::update_height;
use super::*;
use crate::ekf::update::{body_velocity_rows, yaw_row as row_of_yaw};
use crate::frames::{RollPitchYaw, wrap_angle};
use crate::noise::{Composite, Process};
use approx::{assert_abs_diff_eq, assert_relative_eq};

#[test]
fn lever_arm_rows_agree_with_central_differences() {
    let mut g = generator("h");
    let arm = DVec3::new(1.3, -0.7, -2.1);
    let mut ekf = super::filter(&gauss_markov_model(), FilterStates::Reduced15);
    for _ in 0..RANDOM_STATES {
        let (state, omega, _) = random_case(&mut g);
        (0..8).for_each(|lane| ekf.nominal.set_lane(lane, &state));
        ekf.omega_ib_b = Vec3::splat(omega);
        // antenna position (relative, m) and velocity for a state and a gyroscope bias error
        let antenna = |s: &NavState, bias: DVec3| {
            let r = earth::ned_difference(state.place(), s.place()) + s.q_b_n * arm;
            let omega_eb_b = omega - bias - s.q_b_n.inverse() * earth::omega_ie_n(state.lat);
            let v = s.v_n + s.q_b_n * omega_eb_b.cross(arm);
            [r.to_array(), v.to_array()].concat()
        };
        let rows = measurement_rows(&ekf, arm);
        for (column, numeric) in central_differences(&state, antenna).enumerate() {
            for (component, row) in rows.iter().enumerate() {
                let (got, expected) = (row[column], numeric[component]);
                // position in metres is exact to 1e-3 of its curvature; velocity differences round at 1e-9
                assert!(
                    (got - expected).abs() < 2e-6,
                    "row {component}, column {column}: {got} {expected}"
                );
            }
        }
    }
}

/// Derivatives of a measurement of state and gyroscope bias error with respect to each of the 15 states.
fn central_differences(
    state: &NavState,
    measured: impl Fn(&NavState, DVec3) -> Vec<f64>,
) -> impl Iterator<Item = Vec<f64>> {
    (0..15).map(move |column| {
        let (block, axis) = (column / 3, column % 3);
        let size = [1.0, 1.0, 1e-5, 1.0, 1e-4][block];
        let [plus, minus] = [size, -size].map(|size| {
            let bias = if block == 4 {
                DVec3::AXES[axis] * size
            } else {
                DVec3::ZERO
            };
            measured(&perturbed(state, block, axis, size), bias)
        });
        plus.iter()
            .zip(minus)
            .map(|(plus, minus)| (plus - minus) / (2.0 * size))
            .collect()
    })
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
        let mut filter = super::filter(&gauss_markov_model(), FilterStates::Reduced15);
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
    let mut filter = super::filter(&gauss_markov_model(), FilterStates::Reduced15);
    let before = filter.p.get::<Lanes>(2, 2)[0];
    let height = filter.nominal.h;
    update_height(&mut filter, &height, 0.5);
    let after = filter.p.get::<Lanes>(2, 2)[0];
    assert_abs_diff_eq!(after * (1.0 / before + 1.0 / 0.25), 1.0, epsilon = 1e-12);
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
        let now = RollPitchYaw::from_quat(state.q_b_n);
        let measured = |s: &NavState, bias: DVec3| {
            let omega_eb_b = omega - bias - s.q_b_n.inverse() * earth::omega_ie_n(state.lat);
            let v_b = s.q_b_n.inverse() * s.v_n + omega_eb_b.cross(arm);
            let turned = wrap_angle(RollPitchYaw::from_quat(s.q_b_n).yaw - now.yaw);
            vec![v_b.x, v_b.y, v_b.z, turned]
        };
        // the rows have no accelerometer bias: position, velocity, attitude, gyroscope bias
        let columns = central_differences(&state, measured).enumerate();
        for (column, numeric) in columns.filter(|(column, _)| column / 3 != 3) {
            let own = if column < 9 { column } else { column - 3 };
            for (component, row) in rows.iter().enumerate() {
                // of 400 m/s the difference rounds at 1e-13/1e-5, and its third derivative adds 1e-8
                assert!(
                    (row[own] - numeric[component]).abs() < 2e-6,
                    "{component}, {column}: {} {numeric:?}",
                    row[own]
                );
            }
            assert!(
                now.pitch.cos() < 0.1 || (yaw_row[own] - numeric[3]).abs() < 1e-6,
                "yaw, {column}: {} {numeric:?}",
                yaw_row[own]
            );
        }
    }
}

fn certain(accel: f64, gyro: f64) -> Ekf {
    let axis = |sigma2: f64| Composite::new(vec![Process::white(sigma2).unwrap()]);
    let model = Model::pooled(100.0, &axis(accel), &axis(gyro));
    let filter_model = FilterModel::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
    let start = NavState {
        q_b_n: DQuat::from_rotation_z(0.7),
        ..state([0.0; 3])
    };
    ekf(&filter_model, &start, &certain_start())
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
    for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
        let (found, expected) = (filter.p.get::<Lanes>(3 + i, 6 + j)[0], -skew[i][j] * half);
        assert!(
            (found - expected).abs() < 1e-3 * 9.8 * half,
            "({i}, {j}): {found:e}"
        );
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
        apply_pending_earth_step(&mut filter);
        for i in 3..9 {
            let variance = filter.p.get::<Lanes>(i, i)[0];
            let expected = if i < 6 { 4e-5 * 0.01 } else { 1e-6 * 0.01 };
            assert_relative_eq!(variance, expected, max_relative = 1e-3);
        }
    }
}
