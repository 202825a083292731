//! The flags that say which states the filter has: the same for `run` and `fuse`.

use super::parse;
use nav_sim_navigation::ekf::{FilterStates, InitialSettings};

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
