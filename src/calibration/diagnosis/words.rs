//! The diagnosis in words.

use super::{Alarm, CommonOutliers, Diagnosis, Movement, Verdict};
use crate::calibration::replicates::Pool;
use crate::imu::Sensor;
use std::fmt::Write;

/// The answer for one sensor: a line for each abnormal recording, what leaving it out does, and which to use.
/// `rate_hz` turns levels into seconds.
#[must_use]
pub fn advice(diagnoses: &[Diagnosis], sensor: Sensor, rate_hz: f64) -> Vec<String> {
    let own: Vec<&Diagnosis> = diagnoses.iter().filter(|d| d.sensor == sensor).collect();
    if own.is_empty() {
        return Vec::new();
    }
    if own.iter().all(|d| d.scores.is_empty()) {
        let few = "too few recordings to tell which of them is abnormal: four are needed".to_owned();
        return std::iter::once(few)
            .chain(own[0].common.iter().map(|c| outliers(c, own.len(), rate_hz)))
            .collect();
    }
    let abnormal: Vec<&Diagnosis> = own.iter().copied().filter(|d| d.verdict != Verdict::Normal).collect();
    let mut lines: Vec<String> = abnormal.iter().flat_map(|d| describe(d, rate_hz)).collect();
    lines.extend(own[0].common.iter().map(|c| outliers(c, own.len(), rate_hz)));
    lines.push(answer(&own, &abnormal));
    lines
}

/// What is said of outliers that all recordings hold.
fn outliers(common: &CommonOutliers, count: usize, rate_hz: f64) -> String {
    let (first, last) = (common.levels[0], common.levels[common.levels.len() - 1]);
    format!(
        "outliers within all {count} recordings, or most: the classical wavelet variance is above the robust one \
         from {} s to {} s, most at {} s: by {} in the median ({:.0} standard deviations): not awv, gmwm or avlr",
        tau_s(first, rate_hz),
        tau_s(last, rate_hz),
        tau_s(common.most, rate_hz),
        percent(common.excess).trim_start_matches('+'),
        common.deviations
    )
}

/// Whether DR-AWV, as it ran, already drops so many abnormal recordings of so many signals.
fn suffices(own: &[&Diagnosis], recordings: usize, signals: usize) -> Option<usize> {
    let (pool, trim) = own[0].dropped?;
    let needed = if pool == Pool::Axes { recordings } else { signals };
    (trim >= needed).then_some(trim)
}

fn describe(diagnosis: &Diagnosis, rate_hz: f64) -> Vec<String> {
    let of = |alarm: &Option<Alarm>, what: &str| {
        let line = |a: &Alarm| format!("{} is abnormal: {what}, {}", diagnosis.name, extent(a, rate_hz));
        alarm.as_ref().map(line)
    };
    let noise = of(&diagnosis.noise, "its noise is not that of the others (robust wavelet variance)");
    let outliers =
        of(&diagnosis.outliers, "outliers within it (classical wavelet variance above the robust one)");
    let mut lines: Vec<String> = noise.into_iter().chain(outliers).collect();
    lines.extend(diagnosis.left_out.iter().map(|l| {
        let mut line = format!(
            "  without it {} {} moves by {} at {} s",
            l.group,
            l.estimator.name(),
            percent(l.change),
            tau_s(l.level, rate_hz)
        );
        let moved = |m: &Movement| match m.without / m.with - 1.0 {
            change if change.is_finite() => percent(change),
            _ => format!("from {} to {:.3e}", m.with, m.without),
        };
        // A process that is zero with and without has nothing to say.
        for (i, m) in l.parameters.iter().filter(|m| m.with.max(m.without) > 0.0).enumerate() {
            let separator = if i == 0 { ": " } else { ", " };
            let _ = write!(line, "{separator}{} {} {}", m.process, m.parameter, moved(m));
        }
        line
    }));
    lines
}

/// `most from 20.48 s to 327.68 s (x +4.9, y +6.3, z +2.1 deviations), p = 0.004`
fn extent(alarm: &Alarm, rate_hz: f64) -> String {
    let (first, last) = alarm.levels;
    let range = if first == last {
        format!("at {} s", tau_s(first, rate_hz))
    } else {
        format!("from {} s to {} s", tau_s(first, rate_hz), tau_s(last, rate_hz))
    };
    let axes: Vec<String> = alarm.deviations.iter().map(|(a, z)| format!("{} {z:+.1}", a.name())).collect();
    format!("most {range} ({} deviations), p = {:.4}", axes.join(", "), alarm.p_value)
}

fn tau_s(level: u32, rate_hz: f64) -> f64 {
    f64::from(level).exp2() / rate_hz
}

/// `+12 %`, `−0.03 %`
fn percent(change: f64) -> String {
    let value = 100.0 * change;
    match value.abs() {
        v if v >= 9.5 => format!("{value:+.0} %"),
        v if v >= 0.95 => format!("{value:+.1} %"),
        _ => format!("{value:+.2} %"),
    }
}

fn answer(own: &[&Diagnosis], abnormal: &[&Diagnosis]) -> String {
    let of_noise = || abnormal.iter().filter(|d| d.verdict == Verdict::Noise);
    let signals: usize = of_noise().map(|d| d.axes).sum();
    match (abnormal.len(), of_noise().count()) {
        (0, _) if own[0].common.is_some() => {
            format!("the {} recordings agree: use them all, with sr-awv, dr-awv or rgmwm", own.len())
        }
        (0, _) => format!("the {} recordings agree: use them all, with any estimator", own.len()),
        (_, 0) => "use all of them with sr-awv or dr-awv: the outliers hardly touch those".to_owned(),
        (_, n) if 2 * n < own.len() && suffices(own, n, signals).is_some() => format!(
            "use dr-awv: the --trim it ran with, {}, already does without them; or leave the abnormal recordings \
             out once you know what happened to them",
            suffices(own, n, signals).unwrap_or_default()
        ),
        (_, n) if 2 * n < own.len() => {
            let trim = if n == signals {
                n.to_string()
            } else {
                format!("{n} (--pool axes) or {signals} (pooled axes)")
            };
            format!(
                "use dr-awv with a --trim of at least {trim}, or leave the abnormal recordings out once you know \
                 what happened to them"
            )
        }
        _ => "half of them or more are abnormal: there is no majority to trust; look at the recordings"
            .to_owned(),
    }
}
