//! The automatic start on drives that are slow, stop and go, or go backwards, with a phone's IMU: as good as it
//! says, and never the wrong way round.

use crate::shared::{data, outage, shipped_model};
use glam::DQuat;
use nav_sim::navigation::ekf::{FilterModel, FilterStates};
use nav_sim::navigation::frames::RollPitchYaw;
use nav_sim::navigation::fusion::alignment::{Alignment, coarse};
use nav_sim::navigation::fusion::{Finding, FusionSettings};
use nav_sim::navigation::metrics::VerdictKind;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;

use nav_sim::navigation::simulation::{Plan, SimulatedRecording, record};
use nav_sim::navigation::trajectory::{Trajectory, TrajectorySample};
use nav_sim::signal::imu::Sensor;
use nav_sim::signal::noise::Model;
use nav_sim_navigation::earth::radii;
use nav_sim_navigation::frames::wrap_angle;

const DEG: f64 = std::f64::consts::PI / 180.0;
/// Turn-on biases of a phone: m/s², rad/s.
pub(crate) const TURN_ON: (f64, f64) = (0.3, 0.01);
/// How far the IMU is in front of the axle that does not steer (m).
const AXLE_M: f64 = 1.3;

/// Seconds, acceleration along the vehicle (m/s², negative brakes or gathers way backwards), curvature (1/m).
pub(crate) type Step = (f64, f64, f64);

const DRIVES: [(&str, &[Step]); 8] = [
    (
        "slow",
        &[
            (15.0, 0.0, 0.0),
            (7.0, 0.6, 0.0),
            (8.0, 0.0, 0.12),
            (15.0, 0.0, 0.0),
            (8.0, 0.0, -0.12),
            (40.0, 0.0, 0.0),
        ],
    ),
    (
        "stop and go",
        &[
            (12.0, 0.0, 0.0),
            (5.0, 1.0, 0.02),
            (4.0, 0.0, 0.05),
            (5.0, -1.0, 0.0),
            (8.0, 0.0, 0.0),
            (6.0, 1.2, 0.0),
            (6.0, -1.2, 0.03),
            (5.0, 0.0, 0.0),
            (8.0, 1.5, 0.0),
            (10.0, 0.0, 0.05),
            (30.0, 0.0, 0.0),
        ],
    ),
    (
        "out of a lot backwards",
        &[
            (10.0, 0.0, 0.0),
            (3.0, -0.7, 0.0),
            (4.0, 0.0, 0.2),
            (3.0, 0.7, 0.1),
            (2.0, 0.0, 0.0),
            (5.0, 1.0, -0.1),
            (8.0, 0.0, 0.1),
            (5.0, 0.5, 0.0),
            (40.0, 0.0, 0.0),
        ],
    ),
    (
        "backwards fast, then forwards",
        &[
            (12.0, 0.0, 0.0),
            (5.0, -0.9, 0.0),
            (8.0, 0.0, 0.03),
            (5.0, 0.9, 0.0),
            (3.0, 0.0, 0.0),
            (8.0, 1.2, 0.05),
            (40.0, 0.0, 0.0),
        ],
    ),
    (
        "backwards for long",
        &[
            (12.0, 0.0, 0.0),
            (6.0, -0.8, 0.0),
            (15.0, 0.0, 0.04),
            (15.0, 0.0, -0.04),
            (15.0, 0.0, 0.0),
        ],
    ),
    (
        "no rest",
        &[
            (4.0, 1.2, 0.0),
            (8.0, 0.0, 0.06),
            (20.0, 0.0, -0.02),
            (6.0, 0.6, 0.0),
            (30.0, 0.0, 0.02),
        ],
    ),
    (
        "away slowly",
        &[
            (10.0, 0.0, 0.0),
            (20.0, 0.2, 0.02),
            (15.0, 0.0, 0.05),
            (10.0, -0.3, 0.0),
            (10.0, 0.5, 0.0),
            (25.0, 0.0, 0.0),
        ],
    ),
    (
        "rest long ago",
        &[
            (6.0, 0.0, 0.0),
            (6.0, 0.35, 0.0),
            (30.0, 0.0, 0.1),
            (20.0, 0.0, -0.1),
            (5.0, 0.8, 0.0),
            (20.0, 0.0, 0.05),
            (20.0, 0.0, 0.0),
        ],
    ),
];

/// A vehicle that follows steps of acceleration and curvature, each reached within half a second.
pub(crate) fn trajectory(steps: &[Step]) -> Trajectory {
    const DT_S: f64 = 0.01;
    let (lat, lon, h) = (46.5 * DEG, 6.5 * DEG, 400.0);
    let r = radii(lat.sin());
    let (mut n, mut e, mut yaw, mut speed) = (0.0, 0.0, 40.0 * DEG, 0.0);
    let (mut accel, mut curvature, mut k) = (0.0, 0.0, 0_u32);
    let mut samples = Vec::new();
    for (seconds, to_accel, to_curvature) in steps {
        for _ in 0..(seconds / DT_S).round() as u32 {
            if k.is_multiple_of(10) {
                let (north, east) = (n + AXLE_M * f64::cos(yaw), e + AXLE_M * f64::sin(yaw));
                let attitude = RollPitchYaw {
                    roll: 1.0 * DEG,
                    pitch: -2.0 * DEG,
                    yaw: wrap_angle(yaw),
                };
                samples.push(TrajectorySample {
                    t_s: f64::from(k) * DT_S,
                    lat: lat + north / (r.meridian + h),
                    lon: lon + east / ((r.transverse + h) * lat.cos()),
                    h,
                    q_b_n: attitude.to_quat(),
                });
            }
            accel += (to_accel - accel) * DT_S / 0.25;
            curvature += (to_curvature - curvature) * DT_S / 0.25;
            n += speed * yaw.cos() * DT_S;
            e += speed * yaw.sin() * DT_S;
            yaw += speed * curvature * DT_S;
            speed += accel * DT_S;
            k += 1;
        }
    }
    Trajectory::from_samples(&samples).unwrap()
}

/// `examples/phone.toml`.
pub(crate) fn phone() -> Model {
    shipped_model("examples/phone.toml")
}

pub(crate) fn filter_model() -> FilterModel {
    let mut filter_model = FilterModel::new(&phone(), FilterStates::Reduced15, 1.0, 800.0).unwrap();
    filter_model.add_constant(Sensor::Accel, TURN_ON.0);
    filter_model.add_constant(Sensor::Gyro, TURN_ON.1);
    filter_model
}

pub(crate) fn settings() -> FusionSettings {
    FusionSettings {
        rows_hz: 10.0,
        ..crate::fusion::settings()
    }
}

/// Records a drive with a receiver of this velocity sigma (m/s), or of positions alone, and hands each run on.
pub(crate) fn recorded(
    trajectory: &Trajectory,
    velocity: Option<f64>,
    runs: u64,
    mut then: impl FnMut(u64, &SimulatedRecording),
) {
    let mut scenario = Scenario::default();
    scenario.gnss.rate_hz = 2.0;
    scenario.gnss.pos_sigma_m = [if velocity.is_some() { 3.0 } else { 1.0 }; 3];
    scenario.gnss.vel_sigma_m_s = velocity.map(|sigma| [sigma; 3]);
    scenario.imu.turn_on_bias_accel_m_s2 = Some(TURN_ON.0);
    scenario.imu.turn_on_bias_gyro_rad_s = Some(TURN_ON.1);
    let model = phone();
    let experiment = scenario.experiment(trajectory, Truth::Model(&model), &[], &[], 11);
    let plan = Plan::new(&experiment).unwrap();
    (0..runs).for_each(|run| then(run, &record(&plan, run)));
}

/// Errors of roll, pitch and yaw at the start in their standard deviations.
fn normalised(alignment: &Alignment, trajectory: &Trajectory) -> [f64; 3] {
    let angles = |q: DQuat| {
        let a = RollPitchYaw::from_quat(q);
        [a.roll, a.pitch, a.yaw]
    };
    let start = &alignment.start;
    let (found, truth) = (
        angles(start.state.q_b_n),
        angles(trajectory.state(start.t_s).q_b_n),
    );
    std::array::from_fn(|i| wrap_angle(found[i] - truth[i]) / DEG / start.sigma.att_sigma_deg[i])
}

/// Slow, stop and go, backwards, without rest, from velocities of 0.1 to 0.6 m/s or from positions alone: no
/// angle is more than four of its standard deviations off (of 3 × 96 normal ones: p < 0.02), and the sum of the
/// squares is below that of chi-square (p = 1e-4, normal approximation).
#[test]
fn every_start_is_as_good_as_it_says() {
    let (mut sums, mut starts) = ([0.0; 3], 0.0);
    for (name, steps) in DRIVES {
        let trajectory = trajectory(steps);
        for velocity in [Some(0.1), Some(0.3), Some(0.6), None] {
            recorded(&trajectory, velocity, 3, |run, recording| {
                // positions alone do not always have a course
                let Ok(alignment) = coarse(&data(recording), &settings(), &filter_model()) else {
                    assert!(velocity.is_none(), "{name} {velocity:?} {run}");
                    return;
                };
                let z = normalised(&alignment, &trajectory);
                let how = &alignment.start.found;
                let is_inside = z.iter().all(|z| z.abs() < 4.0);
                assert!(is_inside, "{name} {velocity:?} {run}: {z:?} {how:?}");
                (0..3).for_each(|i| sums[i] += z[i] * z[i]);
                starts += 1.0;
            });
        }
    }
    let largest = starts + 3.7 * f64::sqrt(2.0 * starts);
    assert!(
        sums.iter().all(|sum| *sum < largest),
        "{sums:?} of {starts}"
    );
}

/// In a wind from the side the course is no heading: 15° off, seven deviations of a road vehicle's. The start says that it
/// is known worse.
#[test]
fn a_heading_beside_the_course_is_not_believed_as_if_it_were_the_course() {
    let straight = trajectory(DRIVES[5].1);
    let sample = |k: u32| {
        let t_s = 0.1 * f64::from(k);
        let s = straight.state(t_s);
        let q_b_n = s.q_b_n * DQuat::from_rotation_z(15.0 * DEG);
        TrajectorySample {
            t_s,
            lat: s.lat,
            lon: s.lon,
            h: s.h,
            q_b_n,
        }
    };
    let samples: Vec<_> = (0..(10.0 * straight.end_s()) as u32).map(sample).collect();
    let crabbing = Trajectory::from_samples(&samples).unwrap();
    recorded(&crabbing, Some(0.1), 6, |run, recording| {
        let alignment = aligned(recording, &settings());
        let z = normalised(&alignment, &crabbing);
        assert!(
            z.iter().all(|z| z.abs() < 4.0),
            "{run}: {z:?} {:?}",
            alignment.start.found
        );
    });
}

/// One recording of a drive, velocities good to 0.1 m/s.
fn one(steps: &[Step]) -> (Trajectory, SimulatedRecording) {
    let trajectory = trajectory(steps);
    let mut found = None;
    recorded(&trajectory, Some(0.1), 1, |_, recording| {
        found = Some(recording.clone())
    });
    (trajectory, found.unwrap())
}

fn aligned(recording: &SimulatedRecording, settings: &FusionSettings) -> Alignment {
    coarse(&data(recording), settings, &filter_model()).unwrap()
}

/// One recording whose velocities are turned by a right angle from 15 s to then: a start there agrees with nothing after it.
fn turned_until(end_s: f64, steps: &[Step]) -> (Trajectory, SimulatedRecording) {
    let (trajectory, mut recording) = one(steps);
    for fix in recording
        .gnss
        .iter_mut()
        .filter(|f| (15.0..end_s).contains(&f.t_s))
    {
        let velocity = fix.velocity.as_mut().unwrap();
        velocity.horizontal = velocity.horizontal.perp();
    }
    (trajectory, recording)
}

/// A later start is taken where most of the fixes are behind it, and not where they are before it, however well the last
/// ones agree: that nothing fits is then said.
#[test]
fn a_late_start_leaves_out_less_than_half_of_the_fixes() {
    let mut steps = vec![(10.0, 0.0, 0.0), (5.0, 1.5, 0.0)];
    for _ in 0..15 {
        steps.extend([(5.0, 0.5, 0.03), (5.0, -0.5, -0.03)]);
    }
    // starts are looked for 15, 30, 60 and 120 s after the first
    for (end_s, is_late) in [(60.0, true), (125.0, false)] {
        let (_, recording) = turned_until(end_s, &steps);
        let found = aligned(&recording, &settings());
        let is_contradicted =
            |(_, finding): &(VerdictKind, Finding)| matches!(finding, Finding::Start { .. });
        let contradicted = found.doubts.iter().any(is_contradicted);
        assert_eq!(
            (found.start.t_s > end_s, contradicted),
            (is_late, !is_late),
            "{found:?}"
        );
    }
}

#[test]
fn a_start_that_the_next_minute_contradicts_is_given_up_for_a_later_one() {
    let (trajectory, recording) = turned_until(30.0, DRIVES[0].1);
    let found = aligned(&recording, &settings());
    let z = normalised(&found, &trajectory);
    assert!(
        found.start.t_s > 30.0 && z.iter().all(|z| z.abs() < 4.0),
        "{z:?} {found:?}"
    );
    assert!(found.doubts.is_empty(), "{found:?}");
}

/// An IMU that looks sideways fits no start; that its axes are no vehicle's is said where gravity shows it.
#[test]
fn a_wrong_mounting_is_told() {
    let (_, recording) = one(DRIVES[1].1);
    let turned = |q_s_b| {
        let settings = FusionSettings {
            q_s_b,
            ..settings()
        };
        aligned(&recording, &settings).doubts
    };
    let sideways = turned(DQuat::from_rotation_z(90.0 * DEG));
    let is_told = matches!(
        sideways[0],
        (VerdictKind::Overconfident, Finding::Start { .. })
    );
    assert!(is_told, "{sideways:?}");
    for turn in [
        DQuat::from_rotation_x(180.0 * DEG),
        DQuat::from_rotation_y(-60.0 * DEG),
    ] {
        let doubts = turned(turn);
        let is_not_level = doubts
            .iter()
            .any(|(_, f)| matches!(f, Finding::NotLevel { .. }));
        assert!(is_not_level, "{doubts:?}");
    }
    assert_eq!(turned(DQuat::IDENTITY), []);
}

/// Straight on at one speed nothing tells forwards from backwards: forwards, and it is said. Fixes that are withheld are not
/// looked at.
#[test]
fn what_the_fixes_do_not_tell_is_said() {
    let (trajectory, mut recording) = one(DRIVES[0].1);
    let withheld = FusionSettings {
        outages: vec![outage(10.0, 40.0)],
        ..settings()
    };
    assert!(aligned(&recording, &settings()).start.t_s < 30.0);
    assert!(aligned(&recording, &withheld).start.t_s >= 40.0);
    recording.imu.retain(|s| s.t_s > 60.0);
    recording.gnss.retain(|f| f.t_s > 60.0);
    let found = aligned(&recording, &settings());
    assert!(normalised(&found, &trajectory)[2].abs() < 4.0, "{found:?}");
    assert!(
        found
            .doubts
            .iter()
            .any(|(_, finding)| *finding == Finding::Direction),
        "{found:?}"
    );
}
