//! The diagnosis in words.

use super::format::{duration, signed_percent};
use crate::curve::Pool;
use crate::diagnosis::{
    Alarm, CoarseSteps, CommonDrift, CommonOutliers, Diagnosis, Differing, DriftAlarm, GaussianQuantization,
    LeftOut, Misfit, Movement, Verdict,
};
use crate::imu::{Axis, Sensor};
use crate::outcome::LevelSpread;
use std::fmt::Write;

/// The answer for one sensor: what the recordings are used for, then a line for each that is abnormal, and each fit that the
/// J-test rejects.
///
/// It says what each estimator describes; which of them suits a filter is a question about navigation, not about
/// wavelet variances.
#[must_use]
pub fn advice(diagnoses: &[Diagnosis], sensor: Sensor) -> Vec<String> {
    let own: Vec<&Diagnosis> = diagnoses.iter().filter(|d| d.sensor == sensor).collect();
    let Some(first) = own.first() else { return Vec::new() };
    let mut lines = Vec::new();
    if own.iter().all(|d| d.scores.is_empty()) {
        let line = "too few recordings to tell which of them is abnormal: four are needed";
        // Of two, Student's t has one degree of freedom: see `diagnosis::common_drift`.
        let drift = if own.len() == 2 { "; for a drift that they share, three" } else { "" };
        lines.push(format!("{line}{drift}"));
    } else {
        let abnormal: Vec<&Diagnosis> =
            own.iter().copied().filter(|d| d.verdict != Verdict::Normal).collect();
        lines.push(answer(&own, &abnormal));
        lines.extend(abnormal.iter().flat_map(|d| describe(d)));
    }
    lines.extend(first.common.iter().map(|c| outliers(c, own.len())));
    lines.extend(first.gaussian_quantization.iter().map(gaussian_quantization));
    lines.extend(first.coarse_steps.iter().map(|s| coarse_steps(s, "sr-awv and dr-awv leave", "awv")));
    lines.extend(first.common_drift.iter().map(|d| common_drift(d, sensor)));
    lines.extend(misfits(&first.misfits));
    lines
}

/// Effect on the fits of leaving out each abnormal recording of a sensor, a line each.
#[must_use]
pub fn effects(diagnoses: &[Diagnosis], sensor: Sensor) -> Vec<String> {
    let abnormal = diagnoses.iter().filter(|d| d.sensor == sensor && d.verdict != Verdict::Normal);
    abnormal.flat_map(|d| d.left_out.iter().map(|l| effect(&d.name, l))).collect()
}

/// Sentence for a model that does not describe the curve: all other statements are then about the wrong
/// model.
fn misfits(misfits: &[Misfit]) -> Option<String> {
    if misfits.is_empty() {
        return None;
    }
    let rejection = |m: &Misfit| format!("{} {}, p = {:.3}", m.group, m.estimator.name(), m.p_value);
    let fits: Vec<String> = misfits.iter().map(rejection).collect();
    Some(format!(
        "the J-test rejects the model ({}): its parameters are not those of the noise, whichever recordings are used; \
         first find another model, or recordings without disturbances",
        fits.join("; ")
    ))
}

/// Sentence on outliers that all recordings hold.
fn outliers(common: &CommonOutliers, count: usize) -> String {
    let (first, last) = (common.tau_s[0], common.tau_s[common.tau_s.len() - 1]);
    format!(
        "outliers in all or most of the {count} recordings: the classical wavelet variance is above the robust one \
         from {} to {}, most at {}: by {} in the median ({:.0} standard deviations): awv describes the noise with \
         them, sr-awv and dr-awv without most of them (small outliers pass for noise)",
        duration(first),
        duration(last),
        duration(common.most_tau_s),
        signed_percent(common.excess).trim_start_matches('+'),
        common.deviations
    )
}

/// Sentence on quantization noise that is not that of a quantizer.
fn gaussian_quantization(found: &GaussianQuantization) -> String {
    format!(
        "the noise that the model calls quantization is Gaussian, not a quantizer's (classical and robust wavelet variance agree \
         from {} to {}): sr-awv and dr-awv allow for a quantizer's and read it there by up to {:.0} % too low: use awv",
        duration(found.tau_s[0]),
        duration(found.tau_s[found.tau_s.len() - 1]),
        100.0 * found.read_low
    )
}

/// Sentence on steps of a quantiser that are comparable with the noise. `leave`: the estimators that leave scales out; `instead`: the
/// one that does not.
pub(super) fn coarse_steps(found: &CoarseSteps, leave: &str, instead: &str) -> String {
    format!(
        "the quantisation step is comparable with the noise (more than a tenth of the wavelet coefficients are zero from {} to {}): \
         there the classical wavelet variance differs from the robust one, by up to {}, even without outliers, and {leave} \
         these scales out: use {instead} if the recordings have no outliers",
        duration(found.tau_s[0]),
        duration(found.tau_s[found.tau_s.len() - 1]),
        signed_percent(found.excess)
    )
}

/// Sentence on a drift that the recordings share.
fn common_drift(drift: &CommonDrift, sensor: Sensor) -> String {
    let slope = |((axis, slope), (_, t)): (&(Axis, f64), &(Axis, f64))| {
        format!("{} {slope:+.2e} {} per hour (Student's t {t:+.1})", axis.name(), sensor.unit())
    };
    let axes: Vec<String> = drift.per_hour.iter().zip(&drift.t).map(slope).collect();
    format!(
        "the recordings drift the same way: {}: that is deterministic (temperature after switching on?), no random walk: add DR to the \
         model, or let the unit warm up",
        axes.join(", ")
    )
}

/// Whether DR-AWV, as it ran, already drops so many abnormal recordings of so many signals.
fn suffices(own: &[&Diagnosis], recordings: usize, signals: usize) -> Option<usize> {
    let (pool, trim) = own[0].dropped?;
    let needed = if pool == Pool::Axes { recordings } else { signals };
    (trim >= needed).then_some(trim)
}

fn describe(diagnosis: &Diagnosis) -> Vec<String> {
    let sentence = |alarm: &Option<Alarm>, what: &str| {
        let line = |a: &Alarm| format!("{} is abnormal: {what}, {}", diagnosis.name, extent(a));
        alarm.as_ref().map(line)
    };
    let noise = sentence(&diagnosis.noise, "its noise is not that of the others (robust wavelet variance)");
    let outliers =
        sentence(&diagnosis.outliers, "outliers within it (classical wavelet variance above the robust one)");
    let drift = diagnosis.drift.as_ref().map(|d| drift(&diagnosis.name, diagnosis.sensor, d));
    noise.into_iter().chain(outliers).chain(drift).collect()
}

fn drift(name: &str, sensor: Sensor, alarm: &DriftAlarm) -> String {
    let change_of_axis = |((axis, change), (_, z)): (&(Axis, f64), &(Axis, f64))| {
        format!("{} {change:+.2e} {} ({z:+.1} deviations)", axis.name(), sensor.unit())
    };
    let axes: Vec<String> = alarm.change.iter().zip(&alarm.deviations).map(change_of_axis).collect();
    format!(
        "{name} is abnormal: its level drifts as no other does: mean of the later half minus that of the earlier half {}, p = {:.4}",
        axes.join(", "),
        alarm.p_value
    )
}

fn effect(name: &str, left: &LeftOut) -> String {
    let mut line = format!(
        "without {name} {} {} moves by {} at {}",
        left.group,
        left.estimator.name(),
        signed_percent(left.change),
        duration(left.tau_s)
    );
    let moved = |m: &Movement| match m.without / m.with - 1.0 {
        change if change.is_finite() => signed_percent(change),
        _ => format!("from {} to {:.3e}", m.with, m.without),
    };
    // A process that is zero with and without has nothing to say.
    for (i, m) in left.parameters.iter().filter(|m| m.with.max(m.without) > 0.0).enumerate() {
        let separator = if i == 0 { ": " } else { ", " };
        let _ = write!(line, "{separator}{} {} {}", m.process, m.parameter, moved(m));
    }
    line
}

/// `most from 20.5 s to 5.46 min (x +4.9, y +6.3, z +2.1 deviations), p = 0.004`
fn extent(alarm: &Alarm) -> String {
    let [first, last] = alarm.tau_s.map(duration);
    let range = if first == last { format!("at {first}") } else { format!("from {first} to {last}") };
    let axes: Vec<String> = alarm.deviations.iter().map(|(a, z)| format!("{} {z:+.1}", a.name())).collect();
    format!("most {range} ({} deviations), p = {:.4}", axes.join(", "), alarm.p_value)
}

/// `; farthest from the others is r2 (y +4.6 deviations)`, of recordings that have scores.
fn farthest(own: &[&Diagnosis]) -> String {
    let scores = own.iter().flat_map(|d| d.scores.iter().map(move |s| (d, s)));
    let all = scores.flat_map(|(d, s)| s.noise.iter().map(move |z| (&d.name, s.axis, *z)));
    let largest = all.filter(|(_, _, z)| z.is_finite()).max_by(|a, b| a.2.abs().total_cmp(&b.2.abs()));
    largest.map_or(String::new(), |(name, axis, z)| {
        format!("; farthest from the others is {name} ({} {z:+.1} deviations)", axis.name())
    })
}

fn answer(own: &[&Diagnosis], abnormal: &[&Diagnosis]) -> String {
    let of_noise = || abnormal.iter().filter(|d| d.verdict == Verdict::Noise);
    let signals: usize = of_noise().map(|d| d.axes).sum();
    let all = own.len();
    match (abnormal.len(), of_noise().count()) {
        (0, _) => match own[0].differing {
            None => format!("the {all} recordings agree: use them all"),
            Some(Differing { p_value, most: LevelSpread { tau_s, between, .. } }) => format!(
                "none of the {all} recordings stands out, but they differ among themselves beyond their noise, by {} of the \
                 wavelet variance at {tau_s} s (p = {p_value:.3}): the model is their average and describes none of them exactly{}",
                signed_percent(between).trim_start_matches('+'),
                farthest(own)
            ),
        },
        (some, 0) if abnormal.iter().all(|d| d.verdict == Verdict::Drift) => format!(
            "{some} of {all} recordings drift as no other does, which enters the random walk of every estimator: leave them \
             out once you know why"
        ),
        (some, 0) => format!(
            "{some} of {all} recordings have outliers (or drift): awv describes the noise with them, sr-awv and dr-awv without most \
             of them{}",
            robust_moves(abnormal)
        ),
        (_, n) if 2 * n >= all => {
            "half of the recordings or more are abnormal: there is no majority to trust; look at them"
                .to_owned()
        }
        (_, n) => {
            let drops = match suffices(own, n, signals) {
                Some(trim) => format!("dr-awv, with its trim of {trim}, already leaves it out"),
                None if n == signals => format!("dr-awv with a trim of at least {n} leaves it out"),
                None => format!(
                    "dr-awv with a trim of at least {n} (axes apart) or {signals} (axes pooled) leaves it out"
                ),
            };
            format!(
                "the noise of {n} of {all} recordings is not that of the others: awv and sr-awv include it, {drops}; leave \
                 the abnormal recordings out once you know what happened to them"
            )
        }
    }
}

/// How far the curves of the robust estimators move without the recordings that hold outliers, where they ran.
fn robust_moves(abnormal: &[&Diagnosis]) -> String {
    let robust = abnormal.iter().flat_map(|d| &d.left_out).filter(|l| l.estimator.is_robust());
    match robust.map(|l| l.deviations.abs()).max_by(f64::total_cmp) {
        Some(most) => format!(
            " (without one of those recordings their curves move by at most {most:.1} standard deviations)"
        ),
        None => String::new(),
    }
}
