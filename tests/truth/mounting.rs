//! The mounting of an IMU found from the drive: as good as it says, whatever it is, or refused.

use crate::alignment::{Step, filter_model, phone, recorded, settings, trajectory};
use crate::fusion::turned;
use crate::shared::{data, shipped};
use glam::{DQuat, DVec3};
use nav_sim::navigation::ekf::{FilterModel, FilterStates};
use nav_sim::navigation::frames::RollPitchYaw;
use nav_sim::navigation::fusion::alignment::coarse;
use nav_sim::navigation::fusion::mounting::{Mounting, find};
use nav_sim::navigation::fusion::{DriveData, FusionSettings, fuse};
use nav_sim::navigation::simulation::SimulatedRecording;
use nav_sim::navigation::trajectory::reference::Reference;
use nav_sim::signal::units::Refused;
use statrs::distribution::{ChiSquared, ContinuousCDF};

const DEG: f64 = std::f64::consts::PI / 180.0;

/// Roll, pitch and yaw (degrees): upside down, on its side, on its nose, those of a phone in a car.
const MOUNTINGS: [[f64; 3]; 12] = [
    [0.0, 0.0, 0.0],
    [180.0, 0.0, 0.0],
    [90.0, 0.0, 45.0],
    [-90.0, 10.0, -120.0],
    [0.0, 89.5, 30.0],
    [20.0, -88.0, 170.0],
    [5.0, -3.0, 179.0],
    [-9.5, -60.8, -166.8],
    [178.2, 24.6, -96.8],
    [33.0, 47.0, -71.0],
    [-140.0, -35.0, 100.0],
    [2.0, 1.0, -90.0],
];

fn rotation([roll, pitch, yaw]: [f64; 3]) -> DQuat {
    RollPitchYaw {
        roll: roll * DEG,
        pitch: pitch * DEG,
        yaw: yaw * DEG,
    }
    .to_quat()
}

fn found(recording: &SimulatedRecording, q_s_b: DQuat) -> Result<Mounting, Refused> {
    found_with(recording, q_s_b, &filter_model())
}

fn found_with(
    recording: &SimulatedRecording,
    q_s_b: DQuat,
    filter_model: &FilterModel,
) -> Result<Mounting, Refused> {
    let data = DriveData {
        imu: &turned(&recording.imu, q_s_b),
        ..data(recording)
    };
    find(&data, &settings(), filter_model)
}

/// Found less true, about the vehicle's axes (rad).
fn off(mounting: &Mounting, truth: DQuat) -> DVec3 {
    let q = mounting.q_s_b * truth.inverse();
    (if q.w < 0.0 { -q } else { q }).to_scaled_axis()
}

fn is_as_good_as_it_says(mounting: &Mounting, truth: DQuat) {
    let off = off(mounting, truth);
    assert!(
        (off / mounting.sigma_b).abs().max_element() < 3.0,
        "{} {mounting:?}",
        off / DEG
    );
    assert!(mounting.sigma_b.max_element() < 3.0 * DEG, "{mounting:?}");
}

/// A phone with turn-on biases of 0.3 m/s² and 0.01 rad/s, receivers of 0.1 m/s: every angle within three of its standard
/// deviations (of 36 normal ones: p < 0.1; those that are stated allow for cambers that this road has not), none of these above 3°.
/// The solution that follows is as good as it says: the sums of the NEES are below the chi-square quantile (1e-4).
#[test]
fn twelve_mountings_are_found_and_fused_with() {
    let trajectory = shipped("land_vehicle");
    let reference: Reference = trajectory.clone().into();
    let looks = [200, 500, 880];
    let mut nees = [0.0; 3];
    recorded(&trajectory, Some(0.1), 12, |run, recording| {
        let truth = rotation(MOUNTINGS[run as usize]);
        let mounting = found(recording, truth).unwrap();
        is_as_good_as_it_says(&mounting, truth);
        assert!(rotation(mounting.angles_deg()).angle_between(mounting.q_s_b) < 1e-6);

        let data = DriveData {
            imu: &turned(&recording.imu, truth),
            ..data(recording)
        };
        let settings = FusionSettings {
            q_s_b: mounting.q_s_b,
            mounting_sigma_b: mounting.sigma_b,
            rows_hz: 1.0,
            ..settings()
        };
        let start = coarse(&data, &settings, &filter_model()).unwrap().start;
        let solution = fuse(&data, &filter_model(), &start, &settings, Some(&reference)).unwrap();
        for (sum, look) in nees.iter_mut().zip(looks) {
            let mut rows = solution.rows.iter();
            let row = rows.find(|row| row.t_s >= f64::from(look)).unwrap();
            *sum += row.error.unwrap().nees;
        }
    });
    let upper = ChiSquared::new(9.0 * 12.0).unwrap().inverse_cdf(1.0 - 1e-4);
    assert!(nees.iter().all(|sum| *sum < upper), "{nees:?} {upper}");
}

/// From positions alone, good to 1 m: with the accelerations of their differences.
#[test]
fn positions_alone_show_it_less_well() {
    recorded(&shipped("land_vehicle"), None, 2, |run, recording| {
        let truth = rotation(MOUNTINGS[7 + run as usize]);
        is_as_good_as_it_says(&found(recording, truth).unwrap(), truth);
    });
}

/// What the drive does not show is refused, each by its cause.
#[test]
fn a_drive_that_does_not_show_it_is_refused() {
    let refusal = |steps: &[Step], velocity: Option<f64>| {
        let mut refusal = None;
        recorded(&trajectory(steps), velocity, 1, |_, recording| {
            refusal = Some(found(recording, rotation(MOUNTINGS[9])).unwrap_err());
        });
        refusal.unwrap().0
    };
    let stands = refusal(&[(200.0, 0.0, 0.0)], Some(0.1));
    assert!(
        stands.contains(": 0 s of the drive have a course"),
        "{stands}"
    );
    let short = refusal(&[(10.0, 1.0, 0.0), (60.0, 0.0, 0.02)], Some(0.1));
    assert!(short.contains("s of the drive have a course"), "{short}");
    let straight = |accelerate_s: f64| [(accelerate_s, 0.05, 0.0), (400.0, 0.0, 0.0)];
    let even = refusal(&straight(100.0), Some(0.6));
    assert!(even.contains(" is known to ±"), "{even}");
    // as far backwards as forwards, round and round
    let forwards = [
        (4.0, 1.5, 0.0),
        (60.0, 0.0, 0.05),
        (4.0, -1.5, 0.0),
        (5.0, 0.0, 0.0),
    ];
    let backwards = forwards.map(|(seconds, accel, curve)| (seconds, -accel, curve));
    let both = refusal(
        &[forwards, backwards, forwards, backwards].concat(),
        Some(0.1),
    );
    let is_told = ["against the direction of the rest", " is known to ±"];
    assert!(is_told.iter().any(|cause| both.contains(cause)), "{both}");
}

/// An aircraft banks into its turns: its way is not that of its axes, and what is found would be wrong.
#[test]
fn an_aircraft_is_refused() {
    recorded(&shipped("fixed_wing"), Some(0.1), 1, |_, recording| {
        let refusal = found(recording, rotation(MOUNTINGS[0])).unwrap_err().0;
        let bank = refusal.split_once(" banks by ").unwrap().1;
        let bank_deg: f64 = bank.split_once('°').unwrap().0.parse().unwrap();
        assert!(bank_deg < 35.0, "{refusal}");
    });
}

/// Out of lots backwards, then forwards for the most part: still the right way round.
#[test]
fn some_way_backwards_does_not_matter() {
    let mut steps: Vec<Step> = vec![(10.0, 0.0, 0.0)];
    for turn in [0.03, -0.04, 0.05, -0.02, 0.04, -0.05] {
        steps.extend([
            (5.0, -0.9, 0.0),
            (5.0, 0.0, turn),
            (5.0, 0.9, 0.0),
            (3.0, 0.0, 0.0),
        ]);
        steps.extend([
            (8.0, 1.3, 0.0),
            (25.0, 0.0, turn),
            (5.0, -0.8, 0.0),
            (10.0, 0.0, -turn),
            (6.0, -1.07, 0.0),
        ]);
    }
    // level attitudes beside the road's are part of the mounting: a body that leans by 1° and looks down by 2°
    let body = RollPitchYaw {
        roll: 1.0 * DEG,
        pitch: -2.0 * DEG,
        yaw: 0.0,
    }
    .to_quat();
    recorded(&trajectory(&steps), Some(0.1), 2, |run, recording| {
        let truth = rotation(MOUNTINGS[3 + run as usize]);
        is_as_good_as_it_says(&found(recording, truth).unwrap(), body * truth);
    });
}

/// A filter that expects no turn-on bias where there is one of 0.3 m/s² and 0.01 rad/s: refused, or as good as it says.
#[test]
fn a_filter_that_is_wrong_says_nothing_wrong() {
    let careless = FilterModel::new(&phone(), FilterStates::Reduced15, 1.0, 800.0).unwrap();
    recorded(&shipped("land_vehicle"), Some(0.1), 4, |run, recording| {
        let truth = rotation(MOUNTINGS[6 + run as usize]);
        match found_with(recording, truth, &careless) {
            Ok(mounting) => is_as_good_as_it_says(&mounting, truth),
            Err(why) => {
                let causes = ["the fixes contradict the filter", "the filter's yaw is"];
                assert!(causes.iter().any(|cause| why.0.contains(cause)), "{why}");
            }
        }
    });
}
