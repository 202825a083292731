//! The constant bias of a switching-on that a model file states, used where flags and scenario are silent.

use super::Session;
use crate::formats::model_file::ModelFile;
use crate::jobs;
use crate::report::readable;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_signal::imu::Sensor;
use std::path::Path;

/// Lets the filter expect the turn-on bias of its model; `--turn-on-bias` and `[initial]` win.
pub(super) fn expect(initial: &mut InitialSettings, file: &ModelFile, path: &Path, session: &Session) {
    say(
        "the filter expects",
        &jobs::turn_on::expect(initial, &file.turn_on.unwrap_or_default()),
        path,
        session,
    );
}

/// Gives the true IMU the turn-on bias of the model that makes its errors; `[imu]` wins, a 0 too.
pub(super) fn make(imu: &mut ImuSettings, file: &ModelFile, path: &Path, session: &Session) {
    say("the true IMU has", &jobs::turn_on::make(imu, &file.turn_on.unwrap_or_default()), path, session);
}

fn say(who: &str, set: &[(Sensor, f64)], path: &Path, session: &Session) {
    for (sensor, sigma) in set {
        let (shown, sigma) = (path.display(), readable(*sigma));
        let (name, unit) = (sensor.name(), sensor.unit());
        let message = format!("{shown}: {who} a turn-on bias of {sigma} {unit} ({name}, standard deviation)");
        session.say(&message);
    }
}
