//! The constant bias of a switching-on that a model file states, used where settings are silent.

use crate::formats::model_file::TurnOn;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_signal::imu::Sensor;

/// Lets the filter expect the turn-on bias of its model; settings win. What was set.
pub(crate) fn expect(initial: &mut InitialSettings, stated: &TurnOn) -> Vec<(Sensor, f64)> {
    set(
        [
            &mut initial.accel_bias_sigma_m_s2,
            &mut initial.gyro_bias_sigma_rad_s,
        ],
        stated,
    )
}

/// Gives the true IMU the turn-on bias of the model that makes its errors; settings win, a 0 too. What was set.
pub(crate) fn make(imu: &mut ImuSettings, stated: &TurnOn) -> Vec<(Sensor, f64)> {
    set(
        [
            &mut imu.turn_on_bias_accel_m_s2,
            &mut imu.turn_on_bias_gyro_rad_s,
        ],
        stated,
    )
}

/// Fills in the settings of both sensors that are not given.
fn set(settings: [&mut Option<f64>; 2], stated: &TurnOn) -> Vec<(Sensor, f64)> {
    let sigmas = Sensor::ALL
        .into_iter()
        .filter_map(|sensor| Some((sensor, stated.sigma(sensor)?)));
    let mut set: Vec<(Sensor, f64)> = sigmas.collect();
    let [accel, gyro] = settings;
    set.retain(|(sensor, sigma)| {
        let setting = if *sensor == Sensor::Accel {
            &mut *accel
        } else {
            &mut *gyro
        };
        let is_open = setting.is_none();
        setting.get_or_insert(*sigma);
        is_open
    });
    set
}
