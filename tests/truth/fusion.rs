//! Fusion of simulated recordings: consistent with its own covariance, at any split of the samples, mounted in
//! any way.

use crate::common::drive::{DRIVE, MODEL, place_with};
use crate::shared::{data, inside, outage, shipped};
use approx::{assert_abs_diff_eq, assert_relative_eq};
use glam::{DQuat, DVec3};
use nav_sim::io::model_file;
use nav_sim::navigation::earth::GravityModel;
use nav_sim::navigation::ekf::{FilterModel, FilterStates, InitialSettings};

use nav_sim::navigation::fusion::{
    DriveData, FusionSettings, Solution, SolutionRow, Start, fuse, outcome,
};
use nav_sim::navigation::gnss::{GnssFix, GnssVelocity};
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::gnss::GnssSettings;
use nav_sim::navigation::sensors::imu::Truth;

use nav_sim::navigation::simulation::{Plan, SimulatedRecording, record};
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::imu::{ImuIncrement, Sensor};
use nav_sim::signal::noise::Model;
use nav_sim_navigation::fusion::bridged;
use statrs::distribution::{ChiSquared, ContinuousCDF};

pub(crate) fn model() -> Model {
    let place = place_with(DRIVE, MODEL);
    model_file::read(&place.path().join("imu.toml"))
        .unwrap()
        .model
}

pub(crate) fn settings() -> FusionSettings {
    FusionSettings {
        q_s_b: DQuat::IDENTITY,
        mounting_sigma_b: DVec3::ZERO,
        lever_arm_b: DVec3::ZERO,
        gravity: GravityModel::default(),
        outages: Vec::new(),
        gate: None,
        rows_hz: 1.0,
        smooth: false,
    }
}

pub(crate) fn filter_model(model: &Model) -> FilterModel {
    FilterModel::new(model, FilterStates::Reduced15, 1.0, 800.0).unwrap()
}

/// Records runs of an experiment on a trajectory and hands each to `then`.
pub(crate) fn recorded(
    trajectory: &Trajectory,
    model: &Model,
    gnss: &GnssSettings,
    runs: u64,
    mut then: impl FnMut(&SimulatedRecording, &Start),
) {
    let initial = InitialSettings::default();
    let scenario = Scenario {
        gnss: gnss.clone(),
        ..Scenario::default()
    };
    let experiment = scenario.experiment(trajectory, Truth::Model(model), &[], &[], 17);
    let plan = Plan::new(&experiment).unwrap();
    for run in 0..runs {
        let recording = record(&plan, run);
        let start = Start {
            t_s: trajectory.start_s(),
            state: recording.start,
            sigma: initial.clone(),
            found: None,
        };
        then(&recording, &start);
    }
}

pub(crate) fn run(
    data: DriveData<'_>,
    start: &Start,
    settings: &FusionSettings,
    reference: &Trajectory,
) -> Solution {
    let reference = reference.clone().into();
    fuse(
        &data,
        &filter_model(&model()),
        start,
        settings,
        Some(&reference),
    )
    .unwrap()
}

/// Runs with the default receiver.
pub(crate) fn plainly_recorded(
    trajectory: &Trajectory,
    model: &Model,
    runs: u64,
    then: impl FnMut(&SimulatedRecording, &Start),
) {
    recorded(trajectory, model, &GnssSettings::default(), runs, then);
}

/// On recordings made from the model that the filter believes, on three shipped trajectories, the errors
/// are as large as the filter says: the sum of the NEES over 24 independent runs is chi-square of 24·9
/// degrees at every instant, the sum of the NIS chi-square of 6 a fix (two-sided 1e-4 each, 7 looks).
#[test]
fn errors_are_as_large_as_the_filter_says() {
    let looks = [30, 120, 300, 500, 700, 880];
    let (mut nees, mut nis, mut components, mut runs) = ([0.0; 6], 0.0, 0.0, 0.0);
    let gnss = GnssSettings {
        lever_arm_m: [0.8, -0.3, -1.2],
        ..GnssSettings::default()
    };
    let settings = FusionSettings {
        lever_arm_b: gnss.lever_arm_m.into(),
        ..settings()
    };
    for name in ["land_vehicle", "figure_eight", "fixed_wing"] {
        let trajectory = shipped(name);
        recorded(&trajectory, &model(), &gnss, 8, |recording, start| {
            let solution = run(data(recording), start, &settings, &trajectory);
            for (sum, look) in nees.iter_mut().zip(looks) {
                *sum += solution.rows[look].error.unwrap().nees;
            }
            nis += solution.fixes.iter().map(|f| f.nis).sum::<f64>();
            components += 6.0 * solution.fixes.len() as f64;
            runs += 1.0;
        });
    }
    nees.iter().for_each(|sum| inside(*sum, 9.0 * runs));
    inside(nis, components);
}

#[test]
fn what_is_not_measured_is_no_component_of_the_nis() {
    let trajectory = shipped("figure_eight");
    let (mut nis, mut fixes) = (0.0, 0);
    plainly_recorded(&trajectory, &model(), 4, |recording, start| {
        let mut gnss = recording.gnss.clone();
        for velocity in gnss.iter_mut().filter_map(|fix| fix.velocity.as_mut()) {
            velocity.down = None;
        }
        let data = DriveData {
            gnss: &gnss,
            ..data(recording)
        };
        let solution = run(data, start, &settings(), &trajectory);
        assert!(
            solution
                .fixes
                .iter()
                .all(|f| f.innovation.len() == 5 && f.sigma.len() == 5)
        );
        let per_component = outcome(&solution, &[]).nis_per_component;
        nis += per_component * 5.0 * solution.fixes.len() as f64;
        fixes += solution.fixes.len();
    });
    inside(nis, 5.0 * fixes as f64);
}

#[test]
fn fixes_between_samples_are_used_at_their_own_time() {
    let trajectory = shipped("land_vehicle");
    let free = Model {
        rate_hz: 100.0,
        axes: Default::default(),
    };
    plainly_recorded(&trajectory, &free, 1, |recording, start| {
        let fix = |k: u32, late: f64| {
            let t_s = f64::from(k) + 0.0037;
            let s = trajectory.state(t_s - late);
            GnssFix {
                t_s,
                lat: s.lat,
                lon: s.lon,
                h: s.h,
                pos_sigma_n: DVec3::splat(0.01),
                velocity: Some(GnssVelocity::new(s.v_n, DVec3::splat(0.01))),
            }
        };
        let start = Start {
            state: trajectory.state(trajectory.start_s()),
            ..start.clone()
        };
        let worst = |late: f64| {
            let gnss: Vec<_> = (1..200).map(|k| fix(k, late)).collect();
            let data = DriveData {
                imu: &recording.imu[..20_050],
                gnss: &gnss,
                aids: &[],
            };
            let solution = run(data, &start, &settings(), &trajectory);
            let errors = solution.fixes[20..].iter().map(|f| f.error.unwrap());
            errors.map(|e| e[0].hypot(e[1])).fold(0.0, f64::max)
        };
        let (right, late) = (worst(0.0), worst(0.0037));
        assert!(right < 2e-3, "{right} m");
        assert!(late > 0.03, "the test would not notice: {late} m");
    });
}

#[test]
fn mounting_angles_take_a_turned_imu_back() {
    let trajectory = shipped("figure_eight");
    plainly_recorded(&trajectory, &model(), 1, |recording, start| {
        let q_s_b = DQuat::from_scaled_axis(DVec3::new(0.9, -1.4, -2.0));
        let imu = &recording.imu[..12_000];
        let turned = turned(imu, q_s_b);
        let outages = vec![outage(60.0, 80.0)];
        let straight = FusionSettings {
            outages: outages.clone(),
            ..settings()
        };
        let solve = |imu: &[ImuIncrement], settings: &FusionSettings| {
            let gnss = &recording.gnss;
            run(
                DriveData {
                    imu,
                    gnss,
                    aids: &[],
                },
                start,
                settings,
                &trajectory,
            )
        };
        let a = solve(imu, &straight);
        let b = solve(&turned, &FusionSettings { q_s_b, ..straight });
        let (end_a, end_b) = (a.rows.last().unwrap(), b.rows.last().unwrap());
        // the sum of a sensor's biases, in its own axes: at the start as the belief has it
        let filter_model = filter_model(&model());
        for sensor in Sensor::ALL {
            let initial = filter_model.initial_bias_sigma(sensor);
            let [at_start, at_end] = [&a.rows[0], end_a].map(|row| row.bias_sigma[sensor as usize]);
            assert!(
                (at_start / initial - DVec3::ONE).length() < 1e-12,
                "{at_start}"
            );
            assert!(at_end.max_element() < initial);
        }
        for i in 0..9 {
            let [x, y] = [end_a, end_b].map(|row| row.error.unwrap().values[i]);
            assert!((x - y).abs() < 1e-6 * (1.0 + x.abs()), "state {i}: {x} {y}");
            assert_relative_eq!(end_a.sigma[i], end_b.sigma[i], max_relative = 1e-6);
        }
        assert_eq!(a.fixes.iter().filter(|f| !f.used).count(), 20);
        let drift = &outcome(&a, &outages).outages[0];
        assert_eq!(drift.fixes_withheld, 20);
        let (fix, reference) = (
            drift.end_from_fix.unwrap(),
            drift.end_from_reference.unwrap(),
        );
        // the two differ by the noise of one fix, 2.8 m in the horizontal: within 4 of them
        assert_abs_diff_eq!(fix.horizontal_m, reference.horizontal_m, epsilon = 11.4);
        assert!(reference.horizontal_m < 4.0 * reference.expected_sigma_m);
    });
}

/// The recording as an IMU mounted like that makes it.
pub(crate) fn turned(imu: &[ImuIncrement], q_s_b: DQuat) -> Vec<ImuIncrement> {
    let into = q_s_b.inverse();
    let turn = |s: &ImuIncrement| ImuIncrement {
        dtheta: into * s.dtheta,
        dv: into * s.dv,
        ..*s
    };
    imu.iter().map(turn).collect()
}

#[test]
fn after_a_gap_errors_are_as_large_as_the_filter_says() {
    let trajectory = shipped("land_vehicle");
    plainly_recorded(&trajectory, &model(), 2, |recording, start| {
        let places = onsets(&recording.imu);
        let n = places.len() as f64;
        let upper = ChiSquared::new(9.0 * n).unwrap().inverse_cdf(1.0 - 1e-4) / n;
        let smooth = FusionSettings {
            smooth: true,
            ..settings()
        };
        // of the filter and smoothed, this long after the gaps
        let mean = |imu: &[ImuIncrement], ends: &[f64], later: &[f64]| -> Vec<[f64; 2]> {
            let gnss = &recording.gnss;
            let solution = run(
                DriveData {
                    imu,
                    gnss,
                    aids: &[],
                },
                start,
                &smooth,
                &trajectory,
            );
            let nees = |rows: &[SolutionRow], at: f64| {
                rows.iter()
                    .find(|r| r.t_s >= at + 0.05)
                    .unwrap()
                    .error
                    .unwrap()
                    .nees
            };
            let both = [&solution.rows, solution.smoothed.as_ref().unwrap()];
            let at = |later: &f64| {
                both.map(|rows| ends.iter().map(|end| nees(rows, end + later)).sum::<f64>() / n)
            };
            later.iter().map(at).collect()
        };
        for seconds in [0.5, 2.0, 5.0] {
            let (imu, ends) = with_gaps(&recording.imu, &places, seconds);
            let found = mean(&imu, &ends, &[-seconds - 2.0, 0.0, 1.0, 10.0]);
            assert!(
                found.as_flattened().iter().all(|f| *f < upper),
                "{seconds} s: {found:?}"
            );
        }
        let (imu, ends) = with_gaps(&recording.imu, &places, 5.0);
        let believed = mean(&split(&imu), &ends, &[0.0])[0];
        let is_noticed = believed.iter().all(|b| *b > 3.0 * upper);
        assert!(is_noticed, "the test would not notice: {believed:?}");
    });
}

const STEP_S: f64 = 0.01;

/// Instants at which the vehicle begins to turn (s), 40 s apart and 60 s from the ends.
fn onsets(imu: &[ImuIncrement]) -> Vec<f64> {
    let end = imu.last().unwrap().t_s;
    let is_turning = |s: &[ImuIncrement]| s.iter().map(|s| s.dtheta.z).sum::<f64>().abs() > 0.012;
    let turning: Vec<(f64, bool)> = imu
        .chunks_exact(20)
        .map(|s| (s[10].t_s, is_turning(s)))
        .collect();
    let mut found: Vec<f64> = Vec::new();
    for pair in turning.windows(2) {
        let t = pair[1].0;
        let apart = found.last().is_none_or(|last| t - last > 40.0);
        if !pair[0].1 && pair[1].1 && (60.0..end - 60.0).contains(&t) && apart {
            found.push(t);
        }
    }
    assert!(found.len() > 5, "{found:?}");
    found
}

/// The recording without so many seconds about each place, in turn mostly before it and mostly behind, bridged; and
/// the ends of the gaps.
fn with_gaps(imu: &[ImuIncrement], places: &[f64], seconds: f64) -> (Vec<ImuIncrement>, Vec<f64>) {
    let begin = |(i, at): (usize, &f64)| at - if i % 2 == 0 { 0.2 } else { 0.8 } * seconds;
    let begins: Vec<f64> = places.iter().enumerate().map(begin).collect();
    let lost = |s: &&ImuIncrement| {
        let middle = s.t_s - 0.5 * STEP_S;
        !begins.iter().any(|b| (*b..b + seconds).contains(&middle))
    };
    let kept: Vec<ImuIncrement> = imu.iter().filter(lost).copied().collect();
    (
        bridged(&kept, STEP_S),
        begins.iter().map(|b| b + seconds).collect(),
    )
}

/// Bridges cut into samples as long as the others: nothing tells them from these.
fn split(imu: &[ImuIncrement]) -> Vec<ImuIncrement> {
    let parts = |s: &ImuIncrement| {
        let n = (s.dt_s / STEP_S).round().max(1.0);
        let (s, dt_s) = (*s, s.dt_s / n);
        (1..=n as usize).map(move |k| ImuIncrement {
            t_s: s.t_s - (n - k as f64) * dt_s,
            dt_s,
            dtheta: s.dtheta / n,
            dv: s.dv / n,
        })
    };
    imu.iter().flat_map(parts).collect()
}
