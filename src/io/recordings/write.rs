//! Writing recordings.

use super::column_name;
use nav_sim_signal::imu::Channel;
use std::fmt::Write;

/// Signals of the same length (m/s² or rad/s), sampled at `rate_hz` from time 0 on, with ten significant digits.
pub(crate) fn csv(rate_hz: f64, signals: &[(Channel, Vec<f64>)]) -> String {
    let names: Vec<&str> = signals.iter().map(|(c, _)| column_name(*c)).collect();
    let mut text = format!("t_s,{}\n", names.join(","));
    for k in 0..signals.first().map_or(0, |(_, x)| x.len()) {
        let _ = write!(text, "{}", k as f64 / rate_hz);
        for (_, x) in signals {
            let _ = write!(text, ",{:.9e}", x[k]);
        }
        text.push('\n');
    }
    text
}
