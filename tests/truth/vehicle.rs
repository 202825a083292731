//! The mounting that the constraint of a road vehicle finds, with the sign that is written.

use crate::fusion::{belief, model, recorded, settings, shipped};
use glam::{DQuat, DVec3};
use nav_sim::navigation::fusion::{Recorded, Settings, Start, fuse, vehicle_velocities};
use nav_sim::navigation::sensors::aiding::{AidingSettings, NhcSettings};
use nav_sim::navigation::sensors::gnss::GnssSettings;
use nav_sim::signal::imu::ImuIncrement;
use nav_sim::signal::units::DEG;

/// The vehicle's axes are turned by m = (0, pitch, yaw) out of those that the stated mounting names: q_true = R(−m)
/// q_stated. Both angles are found within four standard deviations, which are a fifth of what was expected or less.
#[test]
fn the_constraint_finds_how_the_stated_mounting_is_turned() {
    let trajectory = shipped("land_vehicle.toml");
    let stated = DQuat::from_scaled_axis(DVec3::new(-0.3, 0.8, 2.0));
    let turned = DVec3::new(0.0, -0.6, 0.9) * DEG;
    let to_imu = (DQuat::from_scaled_axis(-turned) * stated).inverse();
    let nhc = Some(NhcSettings {
        mounting_sigma_deg: 1.0,
        ..NhcSettings::default()
    });
    let aiding = AidingSettings {
        nhc,
        ..AidingSettings::default()
    };
    let belief = belief(&model()).with_vehicle(aiding.state_sigmas());
    recorded(
        &trajectory,
        &model(),
        &GnssSettings::default(),
        2,
        |recording, start| {
            let askew = |s: &ImuIncrement| ImuIncrement {
                dtheta: to_imu * s.dtheta,
                dv: to_imu * s.dv,
                ..*s
            };
            let imu: Vec<_> = recording.imu.iter().map(askew).collect();
            let bare = Recorded {
                imu: &imu,
                gnss: &recording.gnss,
                aids: &[],
            };
            let aids = vehicle_velocities(&bare, &[], &aiding, &[]);
            let settings = Settings {
                q_s_b: stated,
                ..settings()
            };
            let mut sigma = start.sigma.clone();
            sigma.att_sigma_deg = sigma.att_sigma_deg.map(|s| s.hypot(1.0));
            let start = Start {
                sigma,
                ..start.clone()
            };
            let solution = fuse(
                &Recorded {
                    aids: &aids,
                    ..bare
                },
                &belief,
                &start,
                &settings,
                None,
            )
            .unwrap();
            let [found, sigma] = solution.vehicle.unwrap();
            for i in [1, 2] {
                assert!(sigma[i] < 0.2 * DEG, "{}", sigma / DEG);
                assert!(
                    (found[i] - turned[i]).abs() < 4.0 * sigma[i],
                    "{} ± {}",
                    found / DEG,
                    sigma / DEG
                );
            }
        },
    );
}
