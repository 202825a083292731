//! The filter's standard deviations against an independent implementation (provenance in tests/data).

use glam::DVec3;
use nav_sim::navigation::earth::GravityModel;
use nav_sim::navigation::ekf::{FilterModel, FilterStates, InitialSettings};
use nav_sim::navigation::frames::{NavState, RollPitchYaw};
use nav_sim::signal::imu::ImuSample;
use nav_sim::signal::noise::{Composite, Model, Process};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::ekf::{Ekf, Fix, advance, apply_pending_earth_step, update};
use nav_sim_navigation::strapdown::Strapdown;
use nav_sim_signal::lanes::{Lanes, Vec3};
use nav_sim_signal::noise::continuous::white_sigma2;
use nav_sim_signal::units::{DEG, DEG_PER_HOUR};
use std::io::Read;
use std::path::Path;

const RATE_HZ: f64 = 100.0;

fn rows(path: &Path) -> Vec<Vec<f64>> {
    let bytes = std::fs::read(path).unwrap();
    let mut text = String::new();
    if path.extension().is_some_and(|e| e == "gz") {
        flate2::read::GzDecoder::new(&bytes[..])
            .read_to_string(&mut text)
            .unwrap();
    } else {
        text = String::from_utf8(bytes).unwrap();
    }
    let numbers = text
        .lines()
        .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
    numbers
        .map(|l| l.split(',').map(|c| c.parse().unwrap()).collect())
        .collect()
}

/// Columns t, lat, lon, h, v_n (3), roll, pitch, yaw in degrees and metres.
fn state(row: &[f64]) -> NavState {
    let angles = RollPitchYaw {
        roll: row[7] * DEG,
        pitch: row[8] * DEG,
        yaw: row[9] * DEG,
    };
    let v_n = DVec3::from_slice(&row[4..7]);
    NavState {
        lat: row[1] * DEG,
        lon: row[2] * DEG,
        h: row[3],
        v_n,
        q_b_n: angles.to_quat(),
    }
}

fn axis(density: f64, deviation: f64) -> Composite {
    Composite::new(vec![
        Process::white(white_sigma2(density, RATE_HZ)).unwrap(),
        Process::gauss_markov(1.0 / 600.0, deviation * deviation, RATE_HZ).unwrap(),
    ])
}

/// Position, velocity, roll, pitch, yaw (degrees), gyroscope and accelerometer biases.
fn deviations(ekf: &Ekf, truth: &NavState) -> Vec<f64> {
    let p = ekf.p.lane(0);
    let jacobian = RollPitchYaw::from_quat(truth.q_b_n).jacobian_of_psi_n();
    let angle = |row: &DVec3| {
        let variance: f64 = (0..9)
            .map(|k| row[k / 3] * row[k % 3] * p[(6 + k / 3, 6 + k % 3)])
            .sum();
        variance.sqrt() / DEG
    };
    let sigma = |i: usize| p[(i, i)].sqrt();
    (0..6)
        .map(sigma)
        .chain(jacobian.iter().map(angle))
        .chain((12..15).chain(9..12).map(sigma))
        .collect()
}

/// The largest relative difference of a standard deviation, at any second and state. `truth` has a row a
/// second: state, then standard deviations. Fixes of 1.5 m, none during the outages.
fn worst_difference(increments: &[Vec<f64>], truth: &[Vec<f64>], outages: &[(f64, f64)]) -> f64 {
    let model = Model::pooled(
        RATE_HZ,
        &axis(0.06 / 60.0, 0.02),
        &axis(0.15 * DEG / 60.0, 20.0 * DEG_PER_HOUR),
    );
    let filter_model = FilterModel::new(&model, FilterStates::Reduced15, 1.0, 800.0).unwrap();
    let initial = InitialSettings {
        pos_sigma_m: [2.0; 3],
        vel_sigma_m_s: [0.1; 3],
        att_sigma_deg: [0.2, 0.2, 1.0],
        ..InitialSettings::default()
    };
    let start = state(&truth[0]);
    let mut ekf = Ekf::new(
        Strapdown::new(&start, GravityModel::FirstOrder),
        &filter_model,
        &start,
        &initial,
    );
    let mut worst = 0.0_f64;
    for (k, row) in increments.iter().enumerate().skip(1) {
        advance(&mut ekf, &[sample(row)], &[[Vec3::ZERO; 2]]);
        if k % 100 != 0 {
            continue;
        }
        let here = state(&truth[k / 100]);
        if !outages
            .iter()
            .any(|(after, until)| *after < row[0] && row[0] <= *until)
        {
            let fix = Fix {
                lat: Lanes::splat(here.lat),
                lon: Lanes::splat(here.lon),
                h: Lanes::splat(here.h),
                v_n: None,
                pos_sigma_m: DVec3::splat(1.5),
                vel_sigma_m_s: DVec3::ONE,
                lever_arm_b: DVec3::ZERO,
            };
            update(&mut ekf, &fix);
        }
        apply_pending_earth_step(&mut ekf);
        for (i, sigma) in deviations(&ekf, &here).into_iter().enumerate() {
            worst = worst.max((sigma / truth[k / 100][10 + i] - 1.0).abs());
        }
    }
    worst
}

fn sample(row: &[f64]) -> ImuSample {
    let rates = |at: usize| DVec3::from_slice(&row[at..at + 3]) * RATE_HZ;
    ImuSample {
        omega_ib_b: rates(1),
        f_ib_b: rates(4),
    }
}

/// 60 s: within 2e-4 of pyins in every state. The two linearise about the same truth and differ in the order
/// of the discretisation, dt/T = 1e-4 at the first fixes.
#[test]
fn standard_deviations_are_those_of_an_independent_filter() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let increments = rows(&directory.join("imu_60s_100hz.csv.gz"));
    let worst = worst_difference(
        &increments,
        &rows(&directory.join("cov15_gm_pos_60s.csv")),
        &[],
    );
    assert!(worst < 2e-4, "{worst:e}");
    assert_eq!(increments.len(), 6001);
}

/// 900 s with two outages, and the free inertial integration: on reference files too large to ship, whose
/// directory `NAV_SIM_TRUTH` names (`cargo test --test truth covariance_truth -- --ignored --nocapture`). The bounds are
/// README's figures with what their causes leave open: the order of the discretisation, dt/T = 1e-4 at the first fixes
/// as in the 60 s above, which outages do not add to (1.3e-4 measured); and the truncation of coning and sculling at dt = 10 ms, of
/// which the reference tool's own order test has 0.0107 m at 120 s and 0.139 m at 900 s for two samples; the mechanisation
/// here is of the next order, a tenth of that (0.0135 m measured).
#[test]
#[ignore = "needs reference files that are not shipped"]
fn the_whole_reference_drive() {
    let directory = std::path::PathBuf::from(std::env::var("NAV_SIM_TRUTH").unwrap());
    let increments = rows(&directory.join("imu_incr_900s_100hz.csv.gz"));
    let truth: Vec<_> = rows(&directory.join("truth_900s_100hz.csv.gz"))
        .into_iter()
        .step_by(100)
        .collect();
    let sigmas = rows(&directory.join("cov15_gm_pos_100hz.csv"));
    let joined: Vec<_> = truth
        .iter()
        .zip(&sigmas)
        .map(|(t, s)| [&t[..10], &s[1..]].concat())
        .collect();
    let worst = worst_difference(
        &increments[..=89_900],
        &joined,
        &[(300.0, 360.0), (600.0, 720.0)],
    );

    let mut ins = Strapdown::new(&state(&truth[0]), GravityModel::FirstOrder);
    let mut errors = Vec::new();
    for (k, row) in increments.iter().enumerate().skip(1) {
        let s = sample(row);
        let dt = 1.0 / RATE_HZ;
        ins.step(
            Vec3::splat(s.omega_ib_b * dt),
            Vec3::splat(s.f_ib_b * dt),
            dt,
        );
        if k % 100 == 0 {
            let end = ins.lane(0);
            errors.push(
                ned_difference(state(&truth[k / 100]).place(), end.place())
                    .truncate()
                    .length(),
            );
        }
    }
    let is_near = worst < 2e-4 && errors[119] < 0.0107 && errors[899] < 0.02;
    assert!(is_near, "{worst}, {} m, {} m", errors[119], errors[899]);
}
