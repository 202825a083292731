//! Recordings that do not begin as they go on, in words.

use nav_sim_calibration::{Change, WarmUp, duration, tau_s};
use nav_sim_signal::imu::Channel;

/// A recording that does not begin as it goes on.
#[derive(Debug, Clone, PartialEq)]
pub struct BeginsOtherwise {
    /// The recording.
    pub recording: String,
    /// Its signals of which that is so.
    pub signals: Vec<(Channel, WarmUp)>,
    /// Seconds to leave out at its beginning, with those that are left out already; none where that does not help.
    pub skip_s: Option<f64>,
}

/// A line for each recording that does not begin as it goes on.
pub(crate) fn warm_up_lines(found: &[BeginsOtherwise], rate_hz: f64) -> Vec<String> {
    let signal = |(channel, w): &(Channel, WarmUp)| {
        let what = if w.mean { "its mean moves" } else { "its noise is another" };
        let change = w.change.map_or(String::new(), |c| format!(", {}", changes(&c, rate_hz)));
        format!("{channel} ({what}, {:+.0} deviations{change})", w.deviations)
    };
    let line = |of_one: &BeginsOtherwise| {
        let signals = of_one.signals.iter().map(signal).collect::<Vec<_>>().join(", ");
        format!("{}: not stationary at its beginning: {signals}", of_one.recording)
    };
    found.iter().map(line).collect()
}

/// `wavelet variance -35 % at 164 s without it`
fn changes(change: &Change, rate_hz: f64) -> String {
    format!(
        "wavelet variance {:+.0} % at {} without it",
        100.0 * (change.ratio - 1.0),
        duration(tau_s(change.level, rate_hz))
    )
}

/// One line: what to leave out of each recording, and what that changes.
pub(crate) fn warm_up_in_short(
    found: &[BeginsOtherwise],
    recordings: usize,
    left_out: bool,
    rate_hz: f64,
) -> String {
    let advice = |of_one: &BeginsOtherwise| {
        let surest =
            of_one.signals.iter().max_by(|a, b| a.1.deviations.abs().total_cmp(&b.1.deviations.abs()));
        let change =
            surest.and_then(|(channel, w)| Some(format!("{channel}: {}", changes(&w.change?, rate_hz))));
        match (of_one.skip_s, change) {
            (Some(s), Some(change)) if left_out => format!("{} {s} s ({change})", of_one.recording),
            (Some(s), Some(change)) => format!("{} --skip-s {s} ({change})", of_one.recording),
            _ => format!("{} (not even its later half settles: left whole)", of_one.recording),
        }
    };
    let all = found.iter().map(advice).collect::<Vec<_>>().join("; ");
    let head = match (found.len(), recordings) {
        (1, 1) => "not stationary at its beginning".to_owned(),
        (some, all) => format!("{some} of {all} recordings not stationary at the beginning"),
    };
    let end = if left_out { ", left out" } else { "; --skip-s auto leaves out each one's own" };
    let late = found
        .iter()
        .filter(|recording| recording.skip_s.is_some() && recording.signals.iter().any(|(_, w)| w.late));
    let late: Vec<&str> = late.map(|recording| recording.recording.as_str()).collect();
    let unsettled = match late.is_empty() {
        true => String::new(),
        false => {
            format!("; {}: an eighth of it or more, what remains may still be settling", late.join(", "))
        }
    };
    format!("{head}: {all}{end}{unsettled}")
}
