//! The iterated update against central differences, and against the update that linearises once.

use super::*;
use crate::earth::GravityModel;
use crate::ekf::tests::{error_of, fix_at_nominal, generator, random_case};
use crate::ekf::{FilterModel, FilterStates, FixUpdate, InitialSettings, advance, update};
use crate::frames::NavState;
use crate::imu::ImuSample;
use crate::lanes::Vec3;
use crate::noise::Model;
use approx::assert_abs_diff_eq;
use glam::DQuat;
use rand::RngExt;

/// exp and its logarithm, which the Jacobians are of.
fn exp(psi: &Vector3<f64>) -> DQuat {
    DQuat::from_scaled_axis(DVec3::new(psi.x, psi.y, psi.z))
}

/// State x(ξ) = (exp(−ψ), −J(−ψ) ρ) about zero; the error of x(ξ) against x(ξ + η) by central differences in η, all columns.
#[test]
fn what_is_carried_is_the_derivative_of_the_retraction() {
    let mut g = generator("iterated");
    for size in [1e-3, 0.04, 0.06, 1.0] {
        let mut xi = DVector::from_fn(NAV, |_, _| g.random_range(-1.0..1.0));
        xi.rows_mut(3 * PSI, 3).scale_mut(size);
        let analytic = carried(&xi);
        let errors = |x: &DVector<f64>| {
            Lane {
                xi: x.clone(),
                ..Lane::new(DMatrix::zeros(NAV, NAV))
            }
            .errors()
        };
        for column in 0..NAV {
            let moved = |step: f64| {
                let mut x = xi.clone();
                x[column] += step;
                // The error at x(ξ) of a truth x(ξ + η): positions and velocities subtract, attitudes divide.
                let mut error = errors(&x) - errors(&xi);
                let turned = exp(&-triple(&xi, PSI)) * exp(&-triple(&x, PSI)).inverse();
                let psi = turned.to_scaled_axis();
                (0..3).for_each(|k| error[3 * PSI + k] = psi[k]);
                error
            };
            let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            // Central differences: step² of the third derivative, of order 1, and rounding 1e-16/1e-5.
            assert!(
                (numeric - analytic.column(column)).amax() < 1e-9,
                "{size} {column}"
            );
        }
    }
}

/// The series and the closed forms meet: what the series leave out there is θ⁶/40320, θ⁶/362880, θ⁴/6720 and θ⁴/90720,
/// and differences of closed forms lose θ⁻² of their digits each time.
#[test]
fn coefficients_of_small_angles_go_on_into_those_of_large_ones() {
    let [below, above] = [SMALL * (1.0 - 1e-12), SMALL].map(coefficients);
    for (k, bound) in [1e-12, 1e-12, 2e-9, 3e-10].into_iter().enumerate() {
        assert_abs_diff_eq!(below[k], above[k], epsilon = bound);
    }
}

/// Of a measurement that is as expected: P − P Hᵀ S⁻¹ H P.
#[test]
fn the_posterior_is_that_of_the_kalman_update() {
    let mut g = generator("posterior");
    let root = DMatrix::from_fn(NAV, NAV, |_, _| g.random_range(-1.0..1.0));
    let rows = DMatrix::from_fn(6, NAV, |_, _| g.random_range(-1.0..1.0));
    let (prior, variances) = (&root * root.transpose(), [0.5, 1.0, 2.0, 0.1, 0.2, 0.3]);
    let mut lane = Lane::new(prior.clone());
    let noise = DMatrix::from_diagonal(&DVector::from_row_slice(&variances));
    lane.step((rows.clone(), DVector::zeros(6), noise.clone()));
    let ph = &prior * rows.transpose();
    let s = &rows * &ph + noise;
    let expected = &prior - &ph * s.try_inverse().unwrap() * ph.transpose();
    // rounding of the inverse, whose condition is below 1e4
    assert!((lane.posterior() - expected).amax() < 1e-11 * prior.amax());
}

fn filter(state: &NavState, fix_update: FixUpdate) -> Ekf {
    let model = Model {
        rate_hz: 100.0,
        axes: Default::default(),
    };
    let filter_model = FilterModel::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
    let start = Strapdown::new(state, GravityModel::Wgs84);
    Ekf::new(start, &filter_model, state, &InitialSettings::default()).with_update(fix_update)
}

/// A fix moves both estimates alike to first order in the innovation; their difference is of second: half of the innovation
/// leaves a quarter of it.
#[test]
fn small_innovations_are_used_alike() {
    let mut g = generator("small");
    let (mut state, ..) = random_case(&mut g);
    state.v_n *= 0.1;
    let sample = ImuSample {
        omega_ib_b: DVec3::ZERO,
        f_ib_b: state.q_b_n.inverse() * DVec3::new(0.3, 0.2, -9.8),
    };
    let difference = |scale: f64| {
        let [one, other] = [FixUpdate::Ekf, FixUpdate::Iterated].map(|kind| {
            let mut ekf = filter(&state, kind);
            // Twenty seconds without fixes tie velocity and position to the tilt.
            advance(&mut ekf, &[sample; 2000], &[[Vec3::ZERO; 2]; 2000]);
            let here = ekf.nominal.lane(0);
            let fix = Fix {
                lat: Lanes::splat(here.lat + scale * 1e-5),
                lon: Lanes::splat(here.lon - scale * 2e-5),
                h: Lanes::splat(here.h + scale * 30.0),
                v_n: Some(Vec3::splat(here.v_n + DVec3::new(3.0, -4.0, 1.0) * scale)),
                ..fix_at_nominal(&ekf, 2.0, 0.05)
            };
            update(&mut ekf, &fix);
            ekf.nominal.lane(0)
        });
        let error = error_of(&one, &other);
        error.iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let (whole, half) = (difference(0.02), difference(0.01));
    assert_abs_diff_eq!(whole / half, 4.0, epsilon = 0.2);
}
