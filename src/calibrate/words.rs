//! A calibration in words: the verdict on models and recordings, the remarks.

use crate::report::comparison_table::in_order;
use nav_sim_calibration::{
    Beginning, Beginnings, Candidate, CommonCause, Diagnosis, Estimator, Misfit, Miss, Note,
    Outcome, ParameterInterval, Ranking, Settings, TurnOnFinding, TurnOnSpread, Undetermined,
    Verdict, WIDEST, WarmUp, duration, percent, tau_s,
};
use nav_sim_document::{readable, short_names};
use nav_sim_signal::imu::{Axis, Channel, Sensor};

/// Recordings that are named in a line.
const NAMED: usize = 4;

/// The verdict: a line for each model (of more than two, for each sensor), and one for the recordings.
pub(super) fn verdict(
    outcomes: &[&Outcome],
    diagnoses: &[Diagnosis],
    settings: &Settings,
) -> Vec<String> {
    let mut lines: Vec<String> = match outcomes.len() {
        0..=2 => outcomes
            .iter()
            .map(|o| fit_line(o, &fit_name(o, outcomes), settings.rate_hz))
            .collect(),
        _ => Sensor::ALL
            .into_iter()
            .filter_map(|sensor| of_sensor(sensor, outcomes, settings.rate_hz))
            .collect(),
    };
    lines.extend(recordings_line(outcomes, diagnoses));
    lines
}

/// `accel: N1 does not fit: data/model 0.33 at 0.02 s (not fitted), 1.26 at 1.28 s; 6 of 16 scales off (all together: p = 0.005)`
fn fit_line(outcome: &Outcome, name: &str, rate_hz: f64) -> String {
    let (spec, departure) = (&outcome.spec, outcome.departure());
    let ratio = |miss: Miss| {
        let left_out = if miss.is_fitted { "" } else { " (not fitted)" };
        format!(
            "{} at {}{left_out}",
            readable(miss.ratio),
            duration(tau_s(miss.level, rate_hz))
        )
    };
    let test = outcome.inference.as_ref().and_then(|i| i.goodness);
    let p = |of: &str| test.map_or(String::new(), |g| format!(" ({of}p = {:.3})", g.p_value));
    if let Some(Misfit { worst, .. }) = outcome.misfit() {
        let fitted = departure.worst().filter(|miss| miss.level != worst.level);
        let ratios: Vec<String> = [Some(worst), fitted]
            .into_iter()
            .flatten()
            .map(ratio)
            .collect();
        let (missed, scales) = (departure.missed.len(), departure.scales);
        return format!(
            "{name}: {spec} does not fit: data/model {}; {missed} of {scales} scales off{}",
            ratios.join(", "),
            p("all together: ")
        );
    }
    let off = departure.furthest.map_or(String::new(), |m| {
        format!(
            ", within {} at all scales known to 10 %",
            percent((m.ratio - 1.0).abs())
        )
    });
    let known = departure.known_to.map_or(String::new(), |level| {
        format!(" (up to {})", duration(tau_s(level, rate_hz)))
    });
    let left_out = departure.left_out.map_or(String::new(), |miss| {
        format!("; data/model {}", ratio(miss))
    });
    format!("{name}: {spec} fits{}{off}{known}{left_out}", p(""))
}

/// Whether the models of a sensor fit, in a line; none without one.
fn of_sensor(sensor: Sensor, outcomes: &[&Outcome], rate_hz: f64) -> Option<String> {
    let own: Vec<&&Outcome> = outcomes
        .iter()
        .filter(|o| o.scope.sensor == sensor)
        .collect();
    let misfits: Vec<(Misfit, &&Outcome)> =
        own.iter().filter_map(|o| Some((o.misfit()?, *o))).collect();
    let size = |m: &Misfit| m.worst.ratio.ln().abs();
    let worst = misfits
        .iter()
        .max_by(|a, b| size(&a.0).total_cmp(&size(&b.0)));
    let worst = worst.map_or(String::new(), |(m, o)| {
        let (ratio, at) = (
            readable(m.worst.ratio),
            duration(tau_s(m.worst.level, rate_hz)),
        );
        format!(
            "; worst data/model {ratio} at {at} ({} {})",
            o.scope.name(),
            o.estimator.name()
        )
    });
    let fitting = own.len() - misfits.len();
    (!own.is_empty()).then(|| {
        format!(
            "{}: {fitting} of {} models fit{worst}",
            sensor.name(),
            own.len()
        )
    })
}

/// `2 of 6 recordings are abnormal: run4 (accel outliers), run5 (accel noise, gyro noise)`; none of a single recording.
fn recordings_line(outcomes: &[&Outcome], diagnoses: &[Diagnosis]) -> Option<String> {
    let names = in_order(diagnoses.iter().map(|d| d.name.as_str()));
    let count = names.len();
    if count == 0 {
        return None;
    }
    if diagnoses.iter().all(|d| d.scores.is_empty()) {
        return Some(format!(
            "{count} recordings: too few to name an abnormal one (4 are needed)"
        ));
    }
    let shown = short_names(&names);
    let mut abnormal: Vec<String> = Vec::new();
    for (name, shown) in names.iter().zip(&shown) {
        let own = diagnoses
            .iter()
            .filter(|d| d.name == *name && d.verdict != Verdict::Normal);
        let findings: Vec<String> = own
            .map(|d| format!("{} {}", d.sensor.name(), findings(d).join(" and ")))
            .collect();
        if !findings.is_empty() {
            abnormal.push(format!("{} ({})", stem(shown), findings.join(", ")));
        }
    }
    if abnormal.is_empty() {
        let differ = outcomes.iter().find_map(|o| o.differing());
        let differ = differ.map_or(String::new(), |(p, _)| {
            format!(", but they differ beyond their noise (p = {p:.3})")
        });
        return Some(format!("{count} recordings, none abnormal{differ}"));
    }
    let more = abnormal.len().saturating_sub(NAMED);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    let named = &abnormal[..abnormal.len().min(NAMED)];
    Some(format!(
        "{} of {count} recordings are abnormal: {}{more}",
        abnormal.len(),
        named.join(", ")
    ))
}

/// `run4` of `run4.csv.gz`.
pub(crate) fn stem(name: &str) -> &str {
    let end = name.rfind('/').map_or(0, |slash| slash + 1);
    name[end..]
        .find('.')
        .filter(|dot| *dot > 0)
        .map_or(name, |dot| &name[..end + dot])
}

/// What a recording is abnormal by.
fn findings(diagnosis: &Diagnosis) -> Vec<&'static str> {
    let found = [
        diagnosis.noise.as_ref().map(|_| "noise"),
        diagnosis.outliers.as_ref().map(|_| "outliers"),
        diagnosis.drift.as_ref().map(|_| "drift"),
    ];
    found.into_iter().flatten().collect()
}

/// Relative change of a wavelet variance by a warm-up that is told where no interval says what matters.
const NOTABLE: f64 = 0.05;
/// Beginnings that are named in a line.
const BEGINNINGS: usize = 2;

/// Beginnings that are left out, or that change a wavelet variance by more than the parameters of its sensor are known to.
pub(super) fn beginnings(found: &Beginnings, outcomes: &[&Outcome]) -> Option<String> {
    let known_to = |sensor: Sensor| {
        let fits = outcomes
            .iter()
            .filter(|o| o.scope.sensor == sensor)
            .filter_map(|o| o.inference.as_ref());
        let amplitudes = fits
            .flat_map(|i| &i.intervals)
            .filter(|i| !i.of.parameter.is_shape() && i.low > 0.0);
        let widths = amplitudes.map(|i| 0.5 * (i.high / i.low).ln());
        widths
            .filter(|w| w.is_finite())
            .min_by(f64::total_cmp)
            .unwrap_or(NOTABLE)
    };
    let matters = |b: &&Beginning| {
        let changes = |(channel, w): &(Channel, WarmUp)| {
            w.change
                .is_none_or(|c| c.ratio.ln().abs() > known_to(channel.sensor))
        };
        found.left_out || b.signals.iter().any(changes)
    };
    let told: Vec<&Beginning> = found.all.iter().filter(matters).collect();
    let names: Vec<&str> = told.iter().map(|b| b.recording.as_str()).collect();
    let line = |(b, name): (&&Beginning, &String)| {
        let change = b
            .surest()
            .and_then(|(channel, w)| Some((channel, w.change?)));
        let change = change.map_or(String::new(), |(channel, c)| {
            format!(" ({channel} {:+.0} %)", 100.0 * (c.ratio - 1.0))
        });
        match b.skip_s {
            Some(s) if found.left_out => format!("{} {s} s", stem(name)),
            Some(s) => format!("{} --skip-s {s}{change}", stem(name)),
            None => format!("{} never settles", stem(name)),
        }
    };
    let lines: Vec<String> = told
        .iter()
        .zip(short_names(&names).iter())
        .map(line)
        .take(BEGINNINGS)
        .collect();
    let more = told.len().saturating_sub(BEGINNINGS);
    let more = if more > 0 {
        format!(", {more} more")
    } else {
        String::new()
    };
    let head = if found.left_out {
        "left out at the beginning"
    } else {
        "not stationary at the beginning"
    };
    (!told.is_empty()).then(|| format!("{head}: {}{more}", lines.join(", ")))
}

/// `accel.x`, with the estimator where there are several.
pub(super) fn fit_name(outcome: &Outcome, outcomes: &[&Outcome]) -> String {
    match outcomes.iter().filter(|o| o.scope == outcome.scope).count() {
        1 => outcome.scope.name(),
        _ => format!("{} {}", outcome.scope.name(), outcome.estimator.name()),
    }
}

/// The remarks on a fit, and why parameters have no interval.
pub(crate) fn notes(outcome: &Outcome, settings: &Settings) -> Vec<String> {
    let labels = outcome.fit.composite.labels();
    let own = outcome
        .notes(settings)
        .into_iter()
        .map(|note| note_line(&note, outcome));
    let intervals = outcome.inference.iter().flat_map(|i| &i.intervals);
    own.chain(intervals.filter_map(|i| undetermined(i, &labels)))
        .collect()
}

/// A remark on a fit.
fn note_line(note: &Note, outcome: &Outcome) -> String {
    let labels = outcome.fit.composite.labels();
    let named = |of| outcome.fit.composite.name_of(of);
    match note {
        Note::AxesDiffer => outcome.axes_differ.map_or_else(String::new, |a| {
            let (ratio, largest, smallest) = (readable(a.ratio), a.largest.name(), a.smallest.name());
            format!("axes differ: {largest} has up to {ratio} times the wavelet variance of {smallest}; --pool axes fits each")
        }),
        Note::LeftOut([first, last]) => format!(
            "scales {} to {} are not fitted: too many outliers",
            duration(*first),
            duration(*last)
        ),
        Note::Indistinct => {
            let simpler = outcome.inference.as_ref().and_then(|i| i.indistinct.as_ref());
            simpler.map_or_else(String::new, |i| {
                format!("{} describes the curve as well (p = {:.2})", i.spec, i.p_value)
            })
        }
        Note::Wide(of, Some(factor)) => format!("{} is known to a factor of {} only", named(*of), readable(*factor)),
        Note::Wide(of, None) => format!("{} may be zero", named(*of)),
        Note::Zero(process) => format!("{} is zero: not seen in these data", labels[*process]),
        Note::LikeWhite(process, time_s) => {
            format!("{}: correlation time {} is below a sample, as of white noise", labels[*process], duration(*time_s))
        }
        Note::LikeWalk(process, time_s, longest_s) => format!(
            "{}: correlation time {} is not identifiable from scales up to {}",
            labels[*process],
            duration(*time_s),
            duration(*longest_s)
        ),
    }
}

/// Why a parameter of a model with processes of these labels has no interval, if it has none.
fn undetermined(interval: &ParameterInterval, labels: &[String]) -> Option<String> {
    let process = &labels[interval.of.process];
    let why = match interval.absent.as_ref()? {
        Undetermined::Zero => format!("{process} is zero"),
        Undetermined::Vanishes => format!(
            "{process} is zero in {} of the draws",
            percent(interval.lost)
        ),
        Undetermined::OneSided => "the draws lie to one side of the estimate".to_owned(),
        Undetermined::BeyondSearch => "any correlation time beyond the scales fits".to_owned(),
        Undetermined::Open => format!("the draws differ by more than a factor of {WIDEST}"),
        Undetermined::Indistinct(alike) => {
            let alike: Vec<&str> = alike.iter().map(|i| labels[*i].as_str()).collect();
            format!("the data do not need both {}", alike.join(" and "))
        }
    };
    Some(format!(
        "{process} {}: no interval: {why}",
        interval.of.parameter.name()
    ))
}

/// Remarks on the recordings of a sensor: on those that are abnormal, on what all have in common.
pub(super) fn recording_notes(
    sensor: Sensor,
    outcomes: &[&Outcome],
    diagnoses: &[Diagnosis],
    settings: &Settings,
) -> Vec<String> {
    let own: Vec<&Diagnosis> = diagnoses.iter().filter(|d| d.sensor == sensor).collect();
    let Some(first) = own.first() else {
        return Vec::new();
    };
    let mut notes = Vec::new();
    let abnormal = own.iter().filter(|d| d.verdict == Verdict::Noise).count();
    if 2 * abnormal >= own.len() {
        notes.push(
            "half of the recordings or more are abnormal: there is no majority to trust".to_owned(),
        );
    } else if abnormal > 0 {
        notes.extend(trim_note(sensor, abnormal, outcomes, settings));
    }
    let ends = |tau_s: &[f64]| {
        format!(
            "{} to {}",
            duration(tau_s[0]),
            duration(tau_s[tau_s.len() - 1])
        )
    };
    for found in &first.common {
        let from_to = || ends(&found.tau_s);
        let size = percent(found.size);
        notes.push(match found.cause {
            CommonCause::Outliers => format!(
                "outliers in most recordings: they add up to {size} to the wavelet variance, from {}; awv has them",
                from_to()
            ),
            CommonCause::GaussianQuantization => format!(
                "QN is Gaussian from {}: robust estimators read it up to {size} too low; use awv",
                from_to()
            ),
            CommonCause::CoarseSteps => format!(
                "quantisation steps are as large as the noise from {}: without outliers use awv",
                from_to()
            ),
            CommonCause::Drift => format!(
                "all recordings drift alike ({} {:+.2e} {}/h): add DR, or warm up longer",
                found.axis.map_or("", Axis::name),
                found.size,
                sensor.unit()
            ),
        });
    }
    notes
}

/// Whether the estimators leave so many abnormal recordings out; none where DR-AWV ran and does.
fn trim_note(
    sensor: Sensor,
    abnormal: usize,
    outcomes: &[&Outcome],
    settings: &Settings,
) -> Option<String> {
    let own = outcomes
        .iter()
        .filter(|o| o.scope.sensor == sensor && o.recordings > 0);
    let fit = own.min_by_key(|o| o.replicates)?;
    // Pooled, a recording has a signal for each axis.
    let needed = abnormal * fit.replicates.div_ceil(fit.recordings);
    if !settings.estimators.contains(&Estimator::DrAwv) {
        return Some(
            "the model includes the abnormal recordings: --estimator dr-awv leaves them out"
                .to_owned(),
        );
    }
    let trim = settings.trim.count(fit.replicates);
    (trim < needed).then(|| {
        format!("a trim of {trim} does not leave out the abnormal recordings: --trim {needed}")
    })
}

/// What follows from the means of one sensor, without its name.
pub(crate) fn turn_on_remark(found: &TurnOnSpread) -> String {
    let unit = found.sensor.unit();
    let spread = format!("{} {unit}", readable(found.spread()));
    match found.finding {
        TurnOnFinding::Seen => format!(
            "turn-on bias {spread} ± {:.0} % from the means of {} recordings, stored as [turn_on]",
            100.0 * found.relative_error(),
            found.recordings()
        ),
        TurnOnFinding::WithinNoise => {
            format!("no turn-on bias seen: the recordings' means scatter by {spread}")
        }
        TurnOnFinding::Moved => {
            format!("no turn-on bias stored: means differ by {spread}, not one mounting")
        }
        TurnOnFinding::Removed => {
            "no turn-on bias: the recordings' means were removed before".to_owned()
        }
    }
}

/// The reasons of a choice.
pub(crate) fn reasons(ranking: &Ranking, rate_hz: f64) -> Vec<String> {
    let Ranking {
        candidates,
        chosen,
        too_simple,
        ..
    } = ranking;
    let (best, taken) = (&candidates[0], &candidates[*chosen]);
    let wvic = |c: &Candidate| format!("{} {:.4}", c.spec, c.wvic());
    let mut lines = vec![match taken.p_value {
        None if taken.spec == best.spec => {
            format!(
                "{} has the least WVIC, nothing simpler fits as well",
                best.spec
            )
        }
        None => format!(
            "{} has the least WVIC that the J-test accepts ({}, {})",
            taken.spec,
            wvic(taken),
            wvic(best)
        ),
        Some(p) => format!(
            "{} fits as well as the least WVIC (p = {p:.2}; {}, {})",
            taken.spec,
            wvic(taken),
            wvic(best)
        ),
    }];
    let rejected = candidates
        .iter()
        .filter(|c| c.spec != taken.spec && c.is_rejected());
    lines.extend(rejected.map(|c| {
        format!(
            "the J-test rejects {} (p = {:.3})",
            c.spec,
            c.j_p_value.unwrap_or(f64::NAN)
        )
    }));
    if taken.is_rejected() {
        lines.push("the J-test rejects every candidate".to_owned());
    }
    lines.extend(too_simple.iter().map(|simple| {
        let (share, at) = (100.0 * simple.share, duration(tau_s(simple.level, rate_hz)));
        format!(
            "{} is too simple (p ≤ {:.3}): {share:.0} % of the difference is at {at}",
            simple.spec, simple.p_value
        )
    }));
    lines
}

/// What a fit is of: `6 recordings × 3 axes`.
pub(super) fn signals(outcome: &Outcome) -> String {
    let recordings = match outcome.recordings {
        0 => return "a curve".to_owned(),
        1 => "1 recording".to_owned(),
        count => format!("{count} recordings"),
    };
    match outcome.replicates.checked_div(outcome.recordings) {
        Some(axes) if axes > 1 && axes * outcome.recordings == outcome.replicates => {
            format!("{recordings} × {axes} axes")
        }
        _ => recordings,
    }
}
