//! The flags that say which states the filter has: the same for `run` and `fuse`.

use super::{Failure, parse};
use nav_sim_navigation::ekf::{BeliefError, FilterStates, InitialSettings};
use std::path::Path;

/// States of the filter.
#[derive(clap::Args, Debug)]
pub(super) struct FilterArgs {
    /// States of the filter: 15 (one bias per axis, to which the model is reduced), 21 (and a scale factor per axis)
    /// or full (a bias state for each process) [default: 15]
    #[arg(long, value_name = "STATES")]
    filter: Option<FilterStates>,
    /// Constant biases that the filter expects in addition to the model (a calibration would remove them): standard
    /// deviations, accelerometer in m/s², gyroscope in rad/s; 3 states each
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = parse::pair)]
    turn_on_bias: Option<parse::Pair>,
    /// Scale-factor errors that the filter expects: standard deviations in parts per million; 3 states each
    /// [default: 300,300 with --filter 21, else none]
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = parse::pair)]
    scale_ppm: Option<parse::Pair>,
}

/// Why a model has no filter: by the file that is at fault, of the model and the one with the settings; `advice` is on settings.
pub(super) fn no_filter(e: &BeliefError, model: &Path, settings: Option<&Path>, advice: &str) -> Failure {
    let within = |failure: Failure, file: &Path| failure.within(&file.display().to_string());
    match e {
        BeliefError::Setting(_) => {
            let failure = Failure::input(e).hint(advice);
            settings.into_iter().fold(failure, within)
        }
        _ => within(Failure::input(e), model),
    }
}

impl FilterArgs {
    /// The flags that are given win over a file.
    pub(super) fn over(&self, states: &mut FilterStates, initial: &mut InitialSettings) {
        *states = self.filter.unwrap_or(*states);
        if let Some(parse::Pair([accel, gyro])) = self.turn_on_bias {
            (initial.accel_bias_sigma_m_s2, initial.gyro_bias_sigma_rad_s) = (Some(accel), Some(gyro));
        }
        if let Some(parse::Pair([accel, gyro])) = self.scale_ppm {
            (initial.accel_scale_sigma_ppm, initial.gyro_scale_sigma_ppm) = (Some(accel), Some(gyro));
        }
    }
}
