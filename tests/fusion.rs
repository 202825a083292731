//! Fusion of simulated recordings: consistent with its own covariance, at any split of the samples, mounted in
//! any way.

#![allow(clippy::unwrap_used, unreachable_pub, reason = "a test")]

#[path = "common/drive.rs"]
mod drive;

use drive::{DRIVE, MODEL, place_with};
use glam::{DQuat, DVec3};
use nav_sim::data::{model_file, trajectory_file};
use nav_sim::earth::GravityModel;
use nav_sim::ekf::{Belief, FilterStates, InitialSettings};
use nav_sim::frames::RollPitchYaw;
use nav_sim::fusion::{Recorded, Settings, Solution, Start, Use, fuse, outcome};
use nav_sim::gnss::GnssFix;
use nav_sim::imu::ImuIncrement;
use nav_sim::noise::Model;
use nav_sim::scenario::Scenario;
use nav_sim::sensors::gnss::GnssSettings;
use nav_sim::sensors::imu::Truth;
use nav_sim::sensors::outage::Outage;
use nav_sim::simulation::{Plan, Recording, record};
use nav_sim::trajectory::Trajectory;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::path::Path;

fn model() -> Model {
    let place = place_with(DRIVE, MODEL);
    model_file::read(&place.path().join("imu.toml")).unwrap().model
}

fn shipped(name: &str) -> Trajectory {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("trajectories").join(name);
    trajectory_file::load(&path, &trajectory_file::Options::default()).unwrap().0
}

fn settings() -> Settings {
    Settings {
        q_s_b: DQuat::IDENTITY,
        lever_arm_b: DVec3::ZERO,
        gravity: GravityModel::default(),
        outages: Vec::new(),
        nis_gate: None,
        rows_hz: 1.0,
    }
}

fn belief(model: &Model) -> Belief {
    Belief::new(model, FilterStates::Reduced15, 1.0, 800.0).unwrap()
}

/// Records runs of an experiment on a trajectory and hands each to `then`.
fn recorded(
    trajectory: &Trajectory,
    model: &Model,
    gnss: &GnssSettings,
    runs: u64,
    mut then: impl FnMut(&Recording, &Start),
) {
    let initial = InitialSettings::default();
    let scenario = Scenario { gnss: gnss.clone(), ..Scenario::default() };
    let experiment = scenario.experiment(trajectory, Truth::Model(model), &[], &[], 17);
    let plan = Plan::new(&experiment).unwrap();
    for run in 0..runs {
        let recording = record(&plan, run);
        let start = Start {
            t_s: trajectory.start_s(),
            state: recording.start,
            sigma: initial.clone(),
            how: Vec::new(),
        };
        then(&recording, &start);
    }
}

fn run(
    imu: &[ImuIncrement],
    gnss: &[GnssFix],
    start: &Start,
    settings: &Settings,
    reference: &Trajectory,
) -> Solution {
    fuse(&Recorded { imu, gnss }, &belief(&model()), start, settings, Some(&reference.clone().into()))
        .unwrap()
}

/// On recordings made from the model that the filter believes, on three shipped trajectories, the errors
/// are as large as the filter says: the sum of the NEES over 24 independent runs is chi-square of 24·9
/// degrees at every instant, the sum of the NIS chi-square of 6 a fix (two-sided 1e-4 each, 7 looks).
#[test]
fn errors_are_as_large_as_the_filter_says() {
    let looks = [30, 120, 300, 500, 700, 880];
    let (mut nees, mut nis, mut components, mut runs) = ([0.0; 6], 0.0, 0.0, 0.0);
    let gnss = GnssSettings { lever_arm_m: [0.8, -0.3, -1.2], ..GnssSettings::default() };
    let settings = Settings { lever_arm_b: gnss.lever_arm_m.into(), ..settings() };
    for name in ["land_vehicle.toml", "figure_eight.toml", "fixed_wing.toml"] {
        let trajectory = shipped(name);
        recorded(&trajectory, &model(), &gnss, 8, |recording, start| {
            let solution = run(&recording.imu, &recording.gnss, start, &settings, &trajectory);
            for (sum, look) in nees.iter_mut().zip(looks) {
                *sum += solution.rows[look].error.unwrap().nees;
            }
            nis += solution.fixes.iter().map(|f| f.nis).sum::<f64>();
            components += 6.0 * solution.fixes.len() as f64;
            runs += 1.0;
        });
    }
    let inside = |sum: f64, dof: f64| {
        let p = ChiSquared::new(dof).unwrap().cdf(sum);
        assert!((1e-4..=1.0 - 1e-4).contains(&p), "{sum} of {dof} degrees: p = {p}");
    };
    nees.iter().for_each(|sum| inside(*sum, 9.0 * runs));
    inside(nis, components);
}

/// Without noise, fixes between the samples agree to millimetres only when they are used at their own time:
/// 3.7 ms at 25 m/s are 9 cm.
#[test]
fn fixes_between_samples_are_used_at_their_own_time() {
    let trajectory = shipped("land_vehicle.toml");
    let free = Model { rate_hz: 100.0, axes: Default::default() };
    recorded(&trajectory, &free, &GnssSettings::default(), 1, |recording, start| {
        let fix = |k: u32, late: f64| {
            let t_s = f64::from(k) + 0.0037;
            let s = trajectory.state(t_s - late);
            let velocity = Some((s.v_n, DVec3::splat(0.01)));
            GnssFix { t_s, lat: s.lat, lon: s.lon, h: s.h, pos_sigma_n: DVec3::splat(0.01), velocity }
        };
        let start = Start { state: trajectory.state(trajectory.start_s()), ..start.clone() };
        let worst = |late: f64| {
            let gnss: Vec<_> = (1..200).map(|k| fix(k, late)).collect();
            let imu = &recording.imu[..20_050];
            let solution = run(imu, &gnss, &start, &settings(), &trajectory);
            let horizontal = |e: &[f64; 9]| e[0].hypot(e[1]);
            solution.fixes[20..].iter().map(|f| horizontal(&f.error.unwrap())).fold(0.0, f64::max)
        };
        assert!(worst(0.0) < 2e-3, "{} m", worst(0.0));
        assert!(worst(0.0037) > 0.03, "the test would not notice: {} m", worst(0.0037));
    });
}

/// A turned IMU whose turn is told gives the same solution; the outage is longer than its fixes are apart.
#[test]
fn mounting_angles_take_a_turned_imu_back() {
    let trajectory = shipped("figure_eight.toml");
    recorded(&trajectory, &model(), &GnssSettings::default(), 1, |recording, start| {
        let q_s_b = RollPitchYaw { roll: -0.17, pitch: -1.06, yaw: -2.91 }.to_quat();
        let imu = &recording.imu[..12_000];
        let turn = |s: &ImuIncrement| ImuIncrement {
            dtheta: q_s_b.inverse() * s.dtheta,
            dv: q_s_b.inverse() * s.dv,
            ..*s
        };
        let turned: Vec<_> = imu.iter().map(turn).collect();
        let outages = vec![Outage { start_s: 60.0, end_s: 80.0 }];
        let straight = Settings { outages: outages.clone(), ..settings() };
        let a = run(imu, &recording.gnss, start, &straight, &trajectory);
        let b = run(&turned, &recording.gnss, start, &Settings { q_s_b, ..straight }, &trajectory);
        let (end_a, end_b) = (a.rows.last().unwrap(), b.rows.last().unwrap());
        for i in 0..9 {
            let (x, y) = (end_a.error.unwrap().values[i], end_b.error.unwrap().values[i]);
            assert!((x - y).abs() < 1e-6 * (1.0 + x.abs()), "state {i}: {x} {y}");
            assert!((end_a.sigma[i] / end_b.sigma[i] - 1.0).abs() < 1e-6);
        }
        assert_eq!(a.fixes.iter().filter(|f| f.used == Use::Withheld).count(), 20);
        let drift = &outcome(&a, &outages).outages[0];
        assert_eq!(drift.withheld, 20);
        let (fix, reference) = (drift.from_fix.unwrap(), drift.from_reference.unwrap());
        // the two differ by the noise of one fix, 2.8 m in the horizontal: within 4 of them
        assert!((fix.horizontal_m - reference.horizontal_m).abs() < 11.4);
        assert!(reference.horizontal_m < 4.0 * reference.sigma_m);
    });
}
