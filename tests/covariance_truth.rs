//! The filter's standard deviations against an independent implementation (provenance in tests/truth).

#![allow(clippy::unwrap_used, reason = "a test")]

use glam::DVec3;
use nav_sim::earth::GravityModel;
use nav_sim::ekf::{Belief, Ekf, FilterStates, Fix, InitialSettings, advance, settle, update};
use nav_sim::frames::{NavState, RollPitchYaw};
use nav_sim::imu::ImuSample;
use nav_sim::lanes::{Lanes, Vec3};
use nav_sim::noise::continuous::white_sigma2;
use nav_sim::noise::{Composite, GaussMarkov, Model, Process, White};
use nav_sim::strapdown::Strapdown;
use nav_sim::units::{DEG, DEG_PER_HOUR};
use std::io::Read;
use std::path::Path;

const RATE_HZ: f64 = 100.0;

fn rows(name: &str) -> Vec<Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth").join(name);
    let bytes = std::fs::read(path).unwrap();
    let mut text = String::new();
    if name.ends_with(".gz") {
        flate2::read::GzDecoder::new(&bytes[..]).read_to_string(&mut text).unwrap();
    } else {
        text = String::from_utf8(bytes).unwrap();
    }
    let numbers = text.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
    numbers.map(|l| l.split(',').map(|c| c.parse().unwrap()).collect()).collect()
}

/// Columns t, lat, lon, h, v_n (3), roll, pitch, yaw in degrees and metres.
fn state(row: &[f64]) -> NavState {
    let angles = RollPitchYaw { roll: row[7] * DEG, pitch: row[8] * DEG, yaw: row[9] * DEG };
    let v_n = DVec3::from_slice(&row[4..7]);
    NavState { lat: row[1] * DEG, lon: row[2] * DEG, h: row[3], v_n, q_b_n: angles.to_quat() }
}

fn axis(density: f64, deviation: f64) -> Composite {
    Composite::new(vec![
        Process::White(White::new(white_sigma2(density, RATE_HZ)).unwrap()),
        Process::GaussMarkov(GaussMarkov::new(1.0 / 600.0, deviation * deviation, RATE_HZ).unwrap()),
    ])
}

/// Position, velocity, roll, pitch, yaw (degrees), gyroscope and accelerometer biases.
fn deviations(ekf: &Ekf, truth: &NavState) -> Vec<f64> {
    let p = ekf.p.lane(0);
    let jacobian = RollPitchYaw::from_quat(truth.q_b_n).jacobian_of_psi_n();
    let angle = |row: &DVec3| {
        let variance: f64 = (0..9).map(|k| row[k / 3] * row[k % 3] * p[(6 + k / 3, 6 + k % 3)]).sum();
        variance.sqrt() / DEG
    };
    let sigma = |i: usize| p[(i, i)].sqrt();
    (0..6).map(sigma).chain(jacobian.iter().map(angle)).chain((12..15).chain(9..12).map(sigma)).collect()
}

/// 60 s with fixes of 1.5 m: within 2e-4 of pyins in every state. The two linearise about the same truth
/// and differ in the order of the discretisation, dt/T = 1e-4 at the first fixes.
#[test]
fn standard_deviations_are_those_of_an_independent_filter() {
    let (increments, truth) = (rows("imu_60s_100hz.csv.gz"), rows("cov15_gm_pos_60s.csv"));
    let model =
        Model::pooled(RATE_HZ, &axis(0.06 / 60.0, 0.02), &axis(0.15 * DEG / 60.0, 20.0 * DEG_PER_HOUR));
    let belief = Belief::new(&model, FilterStates::Reduced15, 1.0, 800.0).unwrap();
    let initial = InitialSettings {
        pos_sigma_m: [2.0; 3],
        vel_sigma_m_s: [0.1; 3],
        att_sigma_deg: [0.2, 0.2, 1.0],
        ..InitialSettings::default()
    };
    let start = state(&truth[0]);
    let mut ekf = Ekf::new(Strapdown::new(&start, GravityModel::FirstOrder), &belief, &start, &initial);
    for (k, row) in increments.iter().enumerate().skip(1) {
        let rates = |at: usize| DVec3::from_slice(&row[at..at + 3]) * RATE_HZ;
        let sample = ImuSample { omega_ib_b: rates(1), f_ib_b: rates(4) };
        advance(&mut ekf, &[sample], &[[Vec3::ZERO; 2]]);
        if k % 100 != 0 {
            continue;
        }
        let here = state(&truth[k / 100]);
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
        settle(&mut ekf);
        for (i, sigma) in deviations(&ekf, &here).into_iter().enumerate() {
            let ratio = sigma / truth[k / 100][10 + i];
            assert!((ratio - 1.0).abs() < 2e-4, "state {i} at {} s: ratio {ratio}", row[0]);
        }
    }
    assert_eq!(increments.len(), 6001);
}
