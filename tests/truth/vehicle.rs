//! The mounting that the constraint of a road vehicle finds, with the sign that is written.

use crate::fusion::{filter_model, model, plainly_recorded, settings, turned};
use crate::shared::{data, shipped};
use glam::{DQuat, DVec3};
use nav_sim::navigation::fusion::{DriveData, FusionSettings, Start, fuse, vehicle_velocities};
use nav_sim::navigation::sensors::aiding::AidingSettings;
use nav_sim::signal::units::DEG;

#[test]
fn the_constraint_finds_how_the_stated_mounting_is_turned() {
    let trajectory = shipped("land_vehicle");
    let stated = DQuat::from_scaled_axis(DVec3::new(-0.3, 0.8, 2.0));
    let m = DVec3::new(0.0, -0.6, 0.9) * DEG;
    let aiding: AidingSettings = toml::from_str("nhc.mounting_sigma_deg = 1").unwrap();
    let filter_model = filter_model(&model()).with_vehicle(aiding.state_sigmas());
    plainly_recorded(&trajectory, &model(), 2, |recording, start| {
        let imu = turned(&recording.imu, DQuat::from_scaled_axis(-m) * stated);
        let bare = DriveData {
            imu: &imu,
            ..data(recording)
        };
        let aids = vehicle_velocities(&bare, &[], &aiding, &[]);
        let settings = FusionSettings {
            q_s_b: stated,
            ..settings()
        };
        let mut start: Start = start.clone();
        start.sigma.att_sigma_deg = start.sigma.att_sigma_deg.map(|s| s.hypot(1.0));
        let recorded = DriveData {
            aids: &aids,
            ..bare
        };
        let solution = fuse(&recorded, &filter_model, &start, &settings, None).unwrap();
        let [found, sigma] = solution.vehicle.unwrap();
        for i in [1, 2] {
            assert!(sigma[i] < 0.2 * DEG, "{}", sigma / DEG);
            let off = (found[i] - m[i]).abs();
            assert!(off < 4.0 * sigma[i], "{} ± {}", found / DEG, sigma / DEG);
        }
    });
}
