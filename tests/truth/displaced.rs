//! Causes of a solution that is not to be believed, found in its recording: an antenna elsewhere, fixes that are late.

use crate::fusion::{filter_model, model, plainly_recorded, recorded, run, settings};
use crate::shared::{data, shipped};
use glam::{DQuat, DVec3};
use nav_sim::navigation::fusion::{
    AntennaOffset, DriveData, FusionSettings, antenna_offset, outcome,
};
use nav_sim::navigation::sensors::gnss::GnssSettings;
use nav_sim::navigation::trajectory::reference::Reference;
use nav_sim::navigation::trajectory::{Trajectory, TrajectorySample};

/// Front, right, down (m).
const ARM: DVec3 = DVec3::new(-1.5, 0.4, -0.9);
const LATE_S: f64 = 0.12;

/// What is found in runs along a trajectory with the antenna at `arm_b` and fixes stamped `late_s` late, of which the
/// filter knows nothing.
fn found(arm_b: DVec3, late_s: f64, settings: &FusionSettings) -> Vec<Option<AntennaOffset>> {
    let gnss = GnssSettings {
        lever_arm_m: arm_b.to_array(),
        ..GnssSettings::default()
    };
    let mut all = Vec::new();
    recorded(
        &shipped("figure_eight"),
        &model(),
        &gnss,
        2,
        |recording, start| {
            let mut gnss = recording.gnss.clone();
            gnss.iter_mut().for_each(|fix| fix.t_s += late_s);
            let data = DriveData {
                gnss: &gnss,
                ..data(recording)
            };
            all.push(antenna_offset(
                &data,
                &filter_model(&model()),
                start,
                settings,
            ));
        },
    );
    all
}

/// Both causes together and each alone: what is there is found, each value within four of its standard deviations, what
/// is not there is not told, and the NIS says so.
#[test]
fn an_antenna_elsewhere_and_late_fixes_are_found() {
    for (arm_b, late_s) in [(ARM, LATE_S), (ARM, 0.0), (DVec3::ZERO, LATE_S)] {
        for found in found(arm_b, late_s, &settings()) {
            let found = found.unwrap();
            assert!(
                found.nis[0] > 1.5 && (0.9..1.1).contains(&found.nis[1]),
                "{found:?}"
            );
            assert_eq!(found.lever_arm_b.is_some(), arm_b != DVec3::ZERO);
            assert_eq!(found.delay_s.is_some(), late_s > 0.0);
            if let Some([arm, sigma]) = found.lever_arm_b {
                assert!(
                    ((arm - arm_b) / sigma).abs().max_element() < 4.0,
                    "{found:?}"
                );
                // how high it is shows in tilts alone
                assert!(sigma.truncate().max_element() < 0.3, "{found:?}");
            }
            if let Some([delay_s, sigma_s]) = found.delay_s {
                assert!(
                    (delay_s - late_s).abs() < 4.0 * sigma_s && sigma_s < 0.02,
                    "{found:?}"
                );
            }
        }
    }
}

/// Neither a sound recording nor one of another cause, an IMU that sits askew, is explained by them.
#[test]
fn other_causes_are_not_taken_for_them() {
    let askew = FusionSettings {
        q_s_b: DQuat::from_rotation_y(0.4),
        ..settings()
    };
    for settings in [settings(), askew] {
        let found = found(DVec3::ZERO, 0.0, &settings);
        assert!(found.iter().all(Option::is_none), "{found:?}");
    }
}

/// A reference that a filter corrected by half a metre every second does not move at 25 m/s: its velocity is known to
/// what its positions are even to, and the NEES is that of right errors.
#[test]
fn corrections_of_a_reference_are_no_errors_of_velocity() {
    let trajectory = shipped("figure_eight");
    let sample = |k: u32| {
        let t_s = trajectory.start_s() + 0.02 * f64::from(k);
        let s = trajectory.state(t_s);
        let shift = if t_s.rem_euclid(2.0) < 1.0 {
            0.25
        } else {
            -0.25
        };
        TrajectorySample {
            t_s,
            lat: s.lat + shift / 6.37e6,
            lon: s.lon,
            h: s.h + shift,
            q_b_n: s.q_b_n,
        }
    };
    let samples: Vec<_> = (0..10_000).map(sample).collect();
    let stepped = Trajectory::from_samples(&samples).unwrap();
    plainly_recorded(&trajectory, &model(), 2, |recording, start| {
        let [sound, uneven] = [&trajectory, &stepped].map(|reference| {
            let solution = run(data(recording), start, &settings(), reference);
            outcome(&solution, &[]).reference.unwrap()
        });
        assert!(
            sound.velocity_sigma_m_s < 0.01 && uneven.velocity_sigma_m_s > 1.0,
            "{sound:?} {uneven:?}"
        );
        assert!(
            sound.nees_mean < 15.0 && uneven.nees_mean < 15.0,
            "{sound:?} {uneven:?}"
        );
    });
    assert!(Reference::from(trajectory).velocity_sigma(-1.0).is_none());
}
