//! The filter against mathematics that is not its own: central differences of the strapdown, the matrix
//! exponential, and definiteness under extreme measurements.

mod measurements;

use super::covariance::{EarthStep, EarthTerms, ErrorMap, PSI, R, Sample, V};
use super::update::dense;
use super::{
    Ekf, FilterModel, FilterStates, Fix, InitialSettings, advance, apply_pending_earth_step, update,
};
use crate::earth::{self, GravityModel};
use crate::frames::NavState;
use crate::imu::ImuSample;
use crate::lanes::{Lanes, Level, Vec3};
use crate::noise::Model;
use crate::rng::Generator;
use crate::strapdown::Strapdown;
use crate::tests::{gauss_markov, key, state};
use approx::assert_abs_diff_eq;
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, Matrix3, SMatrix};
use rand::RngExt;

pub(super) type Matrix15 = SMatrix<f64, 15, 15>;

pub(super) fn generator(process: &str) -> Generator {
    key(11).stream("test", process)
}

/// A fast vehicle anywhere, in any attitude, with what its IMU measures.
pub(super) fn random_case(g: &mut Generator) -> (NavState, DVec3, DVec3) {
    let mut vector =
        |scale: f64| DVec3::from_array(std::array::from_fn(|_| scale * g.random_range(-1.0..1.0)));
    let (v_n, axis, omega, f) = (vector(250.0), vector(3.0), vector(1.0), vector(20.0));
    let place = vector(1.0);
    let q_b_n = DQuat::from_scaled_axis(axis);
    let state = NavState {
        lat: place.x * 1.3,
        lon: place.y * 3.0,
        h: 6000.0 * (1.0 + place.z),
        v_n,
        q_b_n,
    };
    (state, omega, f)
}

/// The error of lane `i` about a nominal state: metres, m/s, rad.
pub(super) fn error_of(lane: &NavState, nominal: &NavState) -> [f64; 9] {
    let r = earth::ned_difference(nominal.place(), lane.place());
    let v = lane.v_n - nominal.v_n;
    // the logarithm of a small rotation: 2 asin of the vector part, to fourth order
    let half = (lane.q_b_n * nominal.q_b_n.inverse()).xyz();
    let psi = half * (2.0 + half.length_squared() / 3.0);
    std::array::from_fn(|i| [r, v, psi][i / 3][i % 3])
}

fn perturbed(state: &NavState, block: usize, axis: usize, size: f64) -> NavState {
    let d = DVec3::AXES[axis] * size;
    let r = earth::radii(state.lat.sin());
    match block {
        R => NavState {
            lat: state.lat + d.x / (r.meridian + state.h),
            lon: state.lon + d.y / ((r.transverse + state.h) * state.lat.cos()),
            h: state.h - d.z,
            ..*state
        },
        V => NavState {
            v_n: state.v_n + d,
            ..*state
        },
        PSI => NavState {
            q_b_n: DQuat::from_scaled_axis(d) * state.q_b_n,
            ..*state
        },
        _ => *state,
    }
}

/// Correlation times of the biases of accelerometers and gyroscopes.
pub(super) const T_CORR_S: [f64; 2] = [200.0, 500.0];
/// Random states at which H is compared.
const RANDOM_STATES: usize = 100_000;
const PERTURBATION: [f64; 5] = [1000.0, 1.0, 1e-4, 1e-2, 1e-4];

/// The transition of one sample by central differences of the strapdown, all 15 columns.
fn numeric_transition(state: &NavState, omega: DVec3, f: DVec3, dt: f64) -> SMatrix<f64, 9, 15> {
    let mut result = SMatrix::zeros();
    for column in 0..15 {
        let (block, axis) = (column / 3, column % 3);
        let mut ins = Strapdown::new(state, GravityModel::Wgs84);
        let (mut dtheta, mut dv) = (Vec3::splat(omega * dt), Vec3::splat(f * dt));
        for (lane, sign) in [(1, 1.0), (2, -1.0)] {
            let size = sign * PERTURBATION[block];
            ins.set_lane(lane, &perturbed(state, block, axis, size));
            // a bias estimate that is too large by `size` takes that much off the sample
            match block {
                3 => dv.set_lane(lane, (f - DVec3::AXES[axis] * size) * dt),
                4 => dtheta.set_lane(lane, (omega - DVec3::AXES[axis] * size) * dt),
                _ => {}
            }
        }
        ins.step(dtheta, dv, dt);
        let nominal = ins.lane(0);
        let (plus, minus) = (
            error_of(&ins.lane(1), &nominal),
            error_of(&ins.lane(2), &nominal),
        );
        for row in 0..9 {
            result[(row, column)] = (plus[row] - minus[row]) / (2.0 * PERTURBATION[block]);
        }
    }
    result
}

/// The transition of one sample as the filter's block maps have it, and the Earth's part of F.
fn filter_transition(state: &NavState, omega: DVec3, f: DVec3, dt: f64) -> SMatrix<f64, 9, 15> {
    let mut ins: Strapdown = Strapdown::new(state, GravityModel::Wgs84);
    let terms = EarthTerms::at(&ins);
    let trace = ins.step(Vec3::splat(omega * dt), Vec3::splat(f * dt), dt);
    let sample = Sample::new(&trace, dt);
    let mut result = SMatrix::<f64, 9, 15>::zeros();
    for column in 0..15 {
        let unit = |block: usize| {
            Vec3::splat(if column / 3 == block {
                DVec3::AXES[column % 3]
            } else {
                DVec3::ZERO
            })
        };
        let x = [unit(R), unit(V), unit(PSI)];
        let after =
            EarthStep { terms, dt }.apply(sample.apply(x, unit(3), unit(4)), unit(3), unit(4));
        for row in 0..9 {
            result[(row, column)] = after[row / 3][row % 3][0];
        }
    }
    result
}

/// Every block of F against central differences of the strapdown itself. F = (Phi − I)/dt at dt = 1 ms,
/// where what Phi has beyond first order is below 1e-3 of the block's largest element; the bounds of the
/// blocks that vanish to first order are dt times the neighbouring one.
#[test]
fn every_block_of_f_agrees_with_central_differences() {
    let mut g = generator("f");
    let dt = 1e-3;
    for _ in 0..100_000 {
        let (state, omega, f) = random_case(&mut g);
        let (numeric, filter) = (
            numeric_transition(&state, omega, f, dt),
            filter_transition(&state, omega, f, dt),
        );
        for (row, column) in (0..15).map(|k| (k / 5, k % 5)) {
            let block = |m: &SMatrix<f64, 9, 15>| -> Matrix3<f64> {
                let identity = if row == column {
                    Matrix3::identity()
                } else {
                    Matrix3::zeros()
                };
                (m.fixed_view::<3, 3>(3 * row, 3 * column) - identity) / dt
            };
            let (numeric, filter) = (block(&numeric), block(&filter));
            // rounding of a difference: of a latitude 4e-9 m, of 400 m/s 1e-12 m/s, of quaternion products
            // some 16 units of 2.2e-16 rad
            let rounding = [4e-9, 1e-12, 4e-15][row] / PERTURBATION[column] / dt;
            let worst = (numeric - filter).amax();
            // of (V, R) what changes with latitude is 1/400 of what changes with height
            let relative = if (row, column) == (V, R) { 3e-5 } else { 2e-3 };
            let bound = relative * numeric.amax() + rounding;
            assert!(
                worst <= bound,
                "block ({row}, {column}): {worst:e} > {bound:e}\n{numeric}{filter}"
            );
        }
    }
}

pub(super) fn gauss_markov_model() -> Model {
    gauss_markov(100.0, [4e-5, 1e-6], [0.03, 1e-4], T_CORR_S)
}

/// A vehicle that circles while it climbs and brakes: what its IMU measures at time t.
pub(super) fn manoeuvre(t: f64) -> (DVec3, DVec3) {
    let omega = DVec3::new(
        0.05 * (0.9 * t).sin(),
        0.03 * (0.7 * t).cos(),
        0.2 * (0.05 * t).sin(),
    );
    let f = DVec3::new(
        1.5 * (0.11 * t).sin(),
        2.0 * (0.05 * t).sin(),
        -9.81 + 0.5 * (0.8 * t).cos(),
    );
    (omega, f)
}

pub(super) fn ekf(filter_model: &FilterModel, state: &NavState, initial: &InitialSettings) -> Ekf {
    Ekf::new(
        Strapdown::new(state, GravityModel::Wgs84),
        filter_model,
        state,
        initial,
    )
}

pub(super) fn start() -> NavState {
    state([15.0, -5.0, 0.5])
}

/// A start that is known exactly.
pub(super) fn certain_start() -> InitialSettings {
    InitialSettings {
        pos_sigma_m: [0.0; 3],
        vel_sigma_m_s: [0.0; 3],
        att_sigma_deg: [0.0; 3],
        ..InitialSettings::default()
    }
}

fn filter(model: &Model, states: FilterStates) -> Ekf {
    let filter_model = FilterModel::new(model, states, 1.0, 800.0).unwrap();
    ekf(&filter_model, &start(), &InitialSettings::default())
}

/// The filter after so many samples of the manoeuvre with such a fix a second.
fn driven(mut filter: Ekf, samples: u32, fix: impl Fn(&Ekf) -> Fix) -> Ekf {
    for k in 0..samples {
        let (omega, f) = manoeuvre(f64::from(k) * 0.01);
        predict(&mut filter, omega, f);
        if k % 100 == 99 {
            let fix = fix(&filter);
            update(&mut filter, &fix);
        }
    }
    apply_pending_earth_step(&mut filter);
    filter
}

/// One IMU sample, the same in all lanes.
pub(super) fn predict(ekf: &mut Ekf, omega_ib_b: DVec3, f_ib_b: DVec3) {
    advance(ekf, &[ImuSample { omega_ib_b, f_ib_b }], &[[Vec3::ZERO; 2]]);
}

/// A fix at the nominal position itself: the innovation is zero, the covariance does what it does.
pub(super) fn fix_at_nominal(ekf: &Ekf, pos_sigma_m: f64, vel_sigma_m_s: f64) -> Fix {
    let n = &ekf.nominal;
    Fix {
        lat: n.lat,
        lon: n.lon,
        h: n.h,
        v_n: Some(n.v_n),
        pos_sigma_m: DVec3::splat(pos_sigma_m),
        vel_sigma_m_s: DVec3::splat(vel_sigma_m_s),
        lever_arm_b: DVec3::ZERO,
    }
}

/// The six rows (position, velocity) of an antenna in the first lane, dense.
pub(super) fn measurement_rows(ekf: &Ekf, lever_arm_b: DVec3) -> Vec<Vec<f64>> {
    let fix = Fix {
        lever_arm_b,
        ..fix_at_nominal(ekf, 1.0, 1.0)
    };
    let (h, ..) = dense(&ekf.scalars_of(&fix), 0, ekf.p.dim());
    h.row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

pub(super) fn continuous_f(terms: &EarthTerms<Lanes>, c: &Matrix3<f64>, f_b: DVec3) -> Matrix15 {
    let mut f = Matrix15::zeros();
    let f_n = c * nalgebra::Vector3::new(f_b.x, f_b.y, f_b.z);
    let skew = Matrix3::new(0.0, -f_n.z, f_n.y, f_n.z, 0.0, -f_n.x, -f_n.y, f_n.x, 0.0);
    let blocks = [
        (0, 0, terms.rr.lane(0)),
        (0, 1, Matrix3::identity()),
        (1, 0, terms.vr.lane(0)),
        (1, 1, terms.vv.lane(0)),
        (1, 2, -skew),
        (1, 3, -c),
        (2, 0, terms.psi_r.lane(0)),
        (2, 1, terms.psi_v.lane(0)),
        (2, 2, terms.psi_psi.lane(0)),
        (2, 4, -c),
    ];
    for (i, j, block) in blocks {
        f.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
    }
    f
}

/// Power of white accelerations and rates, sigma² dt.
pub(super) fn continuous_q() -> Matrix15 {
    let psd = [0.0, 4e-5 * 0.01, 1e-6 * 0.01, 0.0, 0.0];
    Matrix15::from_diagonal(&SMatrix::from_fn(|i, _| psd[i / 3]))
}

/// Positive definite and exactly symmetric after many fixes that are nearly perfect, and nearly worthless.
#[test]
fn covariance_stays_positive_definite_under_extreme_measurements() {
    for sigma in [1e-6, 1e6] {
        let filter = filter(&gauss_markov_model(), FilterStates::Reduced15);
        let filter = driven(filter, 100_000, |filter| {
            fix_at_nominal(filter, sigma, sigma)
        });
        let p = filter.p.lane(3);
        let scale = DMatrix::from_diagonal(&p.diagonal().map(|v| 1.0 / v.sqrt()));
        let correlation = &scale * &p * &scale;
        assert!(p == p.transpose(), "exactly symmetric");
        assert!(correlation.cholesky().is_some(), "{sigma:e} m");
    }
}

/// A full filter whose model is one Gauss-Markov bias is the 15-state filter: the same numbers; and the
/// same bias split into two states of one correlation time gives the same navigation covariance.
#[test]
fn splitting_a_bias_into_two_states_changes_nothing_outside() {
    let one = gauss_markov_model();
    let mut two = one.clone();
    for axis in &mut two.axes {
        let bias = axis.processes[1];
        let part = |share: f64| bias.times(share).unwrap();
        axis.processes.splice(1.., [part(0.3), part(0.7)]);
    }
    let [reduced, full, split] = [
        (&one, FilterStates::Reduced15),
        (&one, FilterStates::Full),
        (&two, FilterStates::Full),
    ]
    .map(|(model, states)| {
        driven(filter(model, states), 3000, |f| {
            fix_at_nominal(f, 2.0, 0.05)
        })
    });
    assert_eq!(reduced.p.lane(0), full.p.lane(0));
    assert_eq!(split.p.dim(), 21);
    for i in 0..9 {
        let ratio = split.p.get::<Lanes>(i, i)[0] / full.p.get::<Lanes>(i, i)[0];
        assert!((ratio - 1.0).abs() < 1e-9, "state {i}: {ratio}");
    }
}

/// One text, three compilations: the vector units differ from plain arrays by fused multiply-adds only
/// (1e-9 relative after a minute with fixes), and not at all between each other.
#[test]
fn every_vector_unit_computes_the_same() {
    let run = |level: Level| {
        let filter = filter(&gauss_markov_model(), FilterStates::Full).at_level(level);
        driven(filter, 6000, |filter| {
            let mut fix = fix_at_nominal(filter, 2.0, 0.05);
            fix.lever_arm_b = DVec3::new(0.5, -0.2, -1.0);
            fix.h[3] += 1.0;
            fix
        })
    };
    let [portable, avx2, avx512] = [Level::Portable, Level::Avx2, Level::Avx512].map(run);
    if Level::best() == Level::Avx512 {
        assert_eq!(avx2.p.lane(3), avx512.p.lane(3));
        assert_eq!(avx2.nominal.lane(3), avx512.nominal.lane(3));
    }
    let (p, q) = (portable.p.lane(3), avx2.p.lane(3));
    for (i, j) in (0..15).flat_map(|i| (0..15).map(move |j| (i, j))) {
        let scale = (p[(i, i)] * p[(j, j)]).sqrt();
        assert_abs_diff_eq!(p[(i, j)], q[(i, j)], epsilon = 1e-9 * scale);
    }
    let (a, b) = (portable.nominal.lane(3), avx2.nominal.lane(3));
    let difference = error_of(&a, &b);
    let scale = [1.0, 10.0, 1.0];
    for (i, d) in difference.iter().enumerate() {
        assert!(d.abs() <= 1e-9 * scale[i / 3], "state {i}: {d:e}");
    }
}
