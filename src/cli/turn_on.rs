//! The constant bias of a switching-on that a model file states, used where flags and scenario are silent.

use super::Session;
use super::run::Words;
use crate::formats::model_file::ModelFile;
use crate::run::read;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::sensors::defects::ImuSettings;
use std::path::Path;

/// Lets the filter expect the turn-on bias of its model; `--turn-on-bias` and `[initial]` win.
pub(super) fn expect(initial: &mut InitialSettings, file: &ModelFile, path: &Path, session: &Session) {
    read::expect_turn_on(initial, file, path, &Words::new(session));
}

/// Gives the true IMU the turn-on bias of the model that makes its errors; `[imu]` wins, a 0 too.
pub(super) fn make(imu: &mut ImuSettings, file: &ModelFile, path: &Path, session: &Session) {
    read::make_turn_on(imu, file, path, &Words::new(session));
}
