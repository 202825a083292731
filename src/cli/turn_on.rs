//! The constant bias of a switching-on that a model file states, used where flags and scenario are silent.

use super::Session;
use nav_sim::ekf::InitialSettings;
use nav_sim::formats::model_file::ModelFile;
use nav_sim::imu::Sensor;
use nav_sim::sensors::defects::ImuSettings;
use std::path::Path;

/// Lets the filter expect the turn-on bias of its model; `--turn-on-bias` and `[initial]` win.
pub(super) fn expect(initial: &mut InitialSettings, file: &ModelFile, path: &Path, session: &Session) {
    for (sensor, sigma) in stated(file) {
        let setting = match sensor {
            Sensor::Accel => &mut initial.accel_bias_sigma_m_s2,
            Sensor::Gyro => &mut initial.gyro_bias_sigma_rad_s,
        };
        if setting.is_none() {
            *setting = Some(sigma);
            say("the filter expects", sensor, sigma, path, session);
        }
    }
}

/// Gives the true IMU the turn-on bias of the model that makes its errors; `[imu]` wins unless it is 0.
pub(super) fn make(imu: &mut ImuSettings, file: &ModelFile, path: &Path, session: &Session) {
    for (sensor, sigma) in stated(file) {
        let setting = match sensor {
            Sensor::Accel => &mut imu.turn_on_bias_accel_m_s2,
            Sensor::Gyro => &mut imu.turn_on_bias_gyro_rad_s,
        };
        if *setting == 0.0 {
            *setting = sigma;
            say("the true IMU has", sensor, sigma, path, session);
        }
    }
}

fn stated(file: &ModelFile) -> impl Iterator<Item = (Sensor, f64)> {
    let turn_on = file.turn_on.unwrap_or_default();
    Sensor::ALL.into_iter().filter_map(move |sensor| Some((sensor, turn_on.sigma(sensor)?)))
}

fn say(who: &str, sensor: Sensor, sigma: f64, path: &Path, session: &Session) {
    let (shown, name, unit) = (path.display(), sensor.name(), sensor.unit());
    session
        .printer
        .say(&format!("{shown}: {who} a turn-on bias of {sigma} {unit} ({name}, standard deviation)"));
}
