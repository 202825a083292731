//! Remarks on a fit, and on what it cannot determine, in words.

use super::diagnosis::coarse_steps;
use super::format::{duration, percent, three_digits};
use crate::curve::{Estimator, Replicate, median};
use crate::diagnosis::{CoarseSteps, excess_of_classical};
use crate::noise::{Composite, Process};
use crate::outcome::{AxesDiffer, Miss, Outcome, tau_s};
use crate::wavelet::{Curve, RobustVariance, Status};

/// Contribution of a process to a model's wavelet variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Share {
    /// Levels at which it is the largest part, ascending.
    pub leads: Vec<u32>,
    /// Its largest part of the whole, and the level of that.
    pub largest: (f64, u32),
}

/// The share of each process of a model over some levels.
#[must_use]
pub fn shares(model: &Composite, levels: &[u32]) -> Vec<Share> {
    let part = |process: &Process, level: u32| match process.haar_wv(level) / model.haar_wv(level) {
        part if part.is_finite() => part,
        // Of nothing nothing is a part.
        _ => 0.0,
    };
    let leader = |level: u32| {
        let parts = model.processes.iter().map(|p| part(p, level));
        parts.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
    };
    let share = |(i, process): (usize, &Process)| Share {
        leads: levels.iter().copied().filter(|level| leader(*level) == Some(i)).collect(),
        largest: levels
            .iter()
            .map(|level| (part(process, *level), *level))
            .fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a }),
    };
    model.processes.iter().enumerate().map(share).collect()
}

/// The wavelet variance of an AR1 peaks at this many correlation times.
const PEAK: f64 = 3.78;

/// Remarks on a fit to the average of some replicates at a rate (Hz).
pub(crate) fn notes(outcome: &Outcome, replicates: &[Replicate], rate_hz: f64) -> Vec<String> {
    let Outcome { curve, estimator, .. } = outcome;
    let mut notes = Vec::new();
    let record_s = replicates.iter().map(|r| r.samples as f64 / rate_hz).fold(0.0, f64::max);
    if *estimator == Estimator::Avlr {
        notes.push(
            "slopes are read as if each process were alone: inconsistent where they overlap (Guerrier et al. 2016)"
                .to_owned(),
        );
    }
    at_ends(outcome, rate_hz, &mut notes);
    beyond_the_scales(outcome, record_s, rate_hz, &mut notes);
    notes.extend(misfit(outcome, rate_hz));
    notes.extend(axes_remark(outcome, rate_hz));
    if estimator.is_robust() {
        robust_remarks(curve, replicates, &mut notes);
        // Several recordings have a diagnosis, which says it.
        if outcome.recordings == 1 {
            notes.extend(steps_of_one(outcome, replicates, rate_hz));
        }
    }
    notes
}

/// Remarks on parameters at the ends of their ranges.
fn at_ends(outcome: &Outcome, rate_hz: f64, notes: &mut Vec<String>) {
    let fit = &outcome.fit;
    let labels = fit.composite.labels();
    for label in fit.zero.iter().map(|i| &labels[*i]) {
        notes.push(if outcome.estimator == Estimator::Avlr {
            format!("{label}: no such slope found where it could be the largest part")
        } else {
            format!("{label} is zero at the optimum: not identifiable from these data")
        });
    }
    for of in &fit.bounded {
        let value = fit.composite.parameters().find(|(p, _)| p == of).map_or(f64::NAN, |(_, value)| value);
        let name = fit.composite.name_of(*of);
        notes.push(format!("{name} = {value} is at the bound you gave; the data favour a value beyond it"));
    }
    for i in &fit.at_end {
        let (process, label) = (&fit.composite.processes[*i], &labels[*i]);
        let is_short = correlation_time_s(process, rate_hz).is_some_and(|t| 1.0 / (t * rate_hz) > 1.0);
        notes.push(if is_short {
            format!(
                "{label}: its correlation time is the shortest that is sought, a sixth of a sample (phi = e^-6): it is \
                 indistinguishable from white noise, and not identifiable from these data"
            )
        } else {
            format!(
                "{label}: its correlation time is the longest that is sought, 20 times the longest scale: it is \
                 indistinguishable from a random walk, and not identifiable from these data"
            )
        });
    }
}

/// Remarks on processes of which the observed scales tell little.
fn beyond_the_scales(outcome: &Outcome, record_s: f64, rate_hz: f64, notes: &mut Vec<String>) {
    let (fit, levels) = (&outcome.fit, &outcome.counted_levels());
    let last = levels.last().copied().unwrap_or(0);
    let longest_s = levels.last().map_or(0.0, |level| tau_s(*level, rate_hz));
    let labels = fit.composite.labels();
    let all = fit.composite.processes.iter().zip(&labels).zip(shares(&fit.composite, levels));
    for (i, ((process, label), share)) in all.enumerate() {
        if fit.zero.contains(&i) || fit.at_end.contains(&i) {
            continue;
        }
        if matches!(process, Process::RandomWalk(_) | Process::Drift(_)) && share.leads == [last] {
            notes.push(format!(
                "{label} dominates at the last scale only ({}), of which there are few independent values: a longer \
                 record would determine it better",
                duration(longest_s)
            ));
        }
        let Some(t_corr_s) = correlation_time_s(process, rate_hz) else { continue };
        if t_corr_s * rate_hz < 1.0 {
            notes.push(format!(
                "{label}: its correlation time of {t_corr_s:.4} s is shorter than a sample: indistinguishable from \
                 white noise"
            ));
        }
        // Before its peak the curve of an AR1 rises as that of a random walk does: without the peak only
        // sigma2 is known.
        if PEAK * t_corr_s > longest_s {
            let record = if record_s > 0.0 {
                format!("the record is {}: ", duration(record_s))
            } else {
                String::new()
            };
            notes.push(format!(
                "{record}{label}'s correlation time of {} is not identifiable from scales up to {}; there it looks \
                 like a random walk",
                duration(t_corr_s),
                duration(longest_s)
            ));
        }
    }
}

/// Correlation time of an AR1 or a GM at a rate (Hz), in seconds.
#[must_use]
pub fn correlation_time_s(process: &Process, rate_hz: f64) -> Option<f64> {
    match process {
        Process::Ar1(p) if p.phi() > 0.0 => Some(-1.0 / (p.phi().ln() * rate_hz)),
        Process::GaussMarkov(p) => Some(1.0 / p.beta()),
        _ => None,
    }
}

fn misfit(outcome: &Outcome, rate_hz: f64) -> Option<String> {
    let departure = outcome.departure();
    let (worst, surest) = (departure.worst()?, departure.surest()?);
    let side = if surest.ratio > 1.0 { "above" } else { "below" };
    Some(format!(
        "the data disagree with this model at {} of {} scales: they have {}; most certainly at {}, {} {side} it, {:.0} standard \
         deviations",
        departure.missed.len(),
        departure.scales,
        worst_in_words(outcome, worst, rate_hz),
        duration(tau_s(surest.level, rate_hz)),
        percent((surest.ratio - 1.0).abs()),
        surest.deviations.abs()
    ))
}

/// `2.5 times the model's wavelet variance at 164 s (to the same side from 41 s to 330 s)`
fn worst_in_words(outcome: &Outcome, worst: Miss, rate_hz: f64) -> String {
    let (first, last) = outcome.stretch(worst);
    let range = if first == last {
        String::new()
    } else {
        format!(
            " (to the same side from {} to {})",
            duration(tau_s(first, rate_hz)),
            duration(tau_s(last, rate_hz))
        )
    };
    format!(
        "{} times the model's wavelet variance at {}{range}",
        three_digits(worst.ratio),
        duration(tau_s(worst.level, rate_hz))
    )
}

/// Remark that the axes differ, and where most; none where they agree.
#[must_use]
pub fn axes_remark(outcome: &Outcome, rate_hz: f64) -> Option<String> {
    let AxesDiffer { level, largest, smallest, ratio, .. } = outcome.axes_differ?;
    Some(format!(
        "the axes differ: at {} {} has {} times the wavelet variance of {}; pooled by axes, each has its own model",
        duration(tau_s(level, rate_hz)),
        largest.name(),
        three_digits(ratio),
        smallest.name()
    ))
}

/// Description of the signals averaged: "6 recordings × 3 axes", "1 recording".
#[must_use]
pub fn signals(outcome: &Outcome) -> String {
    let recordings = match outcome.recordings {
        0 => return "a curve".to_owned(),
        1 => "1 recording".to_owned(),
        count => format!("{count} recordings"),
    };
    match outcome.replicates / outcome.recordings {
        1 => recordings,
        axes if axes * outcome.recordings == outcome.replicates => format!("{recordings} × {axes} axes"),
        _ => format!("{recordings}, {} signals", outcome.replicates),
    }
}

fn robust_remarks(curve: &Curve, replicates: &[Replicate], notes: &mut Vec<String>) {
    let replicates_with = |status: Status| {
        let has_such_a_scale =
            |r: &&Replicate| r.robust.iter().take(curve.levels.len()).any(|v| v.status == status);
        replicates.iter().filter(has_such_a_scale).count()
    };
    let (count, no_root, coarse) =
        (replicates.len(), replicates_with(Status::NoRoot), replicates_with(Status::Coarse));
    if no_root > 0 {
        notes.push(format!(
            "{} scales without an admissible robust variance (too many outliers, or \
             too few coefficients): the nearest value is used there",
            have(no_root, count)
        ));
    }
    if coarse > 0 {
        notes.push(format!(
            "{} scales most of whose coefficients are exactly zero (coarse quantisation)",
            have(coarse, count)
        ));
    }
}

/// Remark on the scales that the robust estimators leave out of the fit to one recording, for the steps of its quantiser.
fn steps_of_one(outcome: &Outcome, replicates: &[Replicate], rate_hz: f64) -> Option<String> {
    let excess = |level: u32| {
        let i = level as usize - 1;
        let stepped = replicates.iter().filter(|r| r.robust.get(i).is_some_and(RobustVariance::is_stepped));
        let ratios: Vec<f64> = stepped.map(|r| excess_of_classical(r, i).exp_m1()).collect();
        (!ratios.is_empty()).then(|| (tau_s(level, rate_hz), median(&ratios)))
    };
    let left_out = outcome.curve.ignored.iter().filter_map(|level| excess(*level));
    let (tau_s, all): (Vec<f64>, Vec<f64>) = left_out.unzip();
    let excess = all.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let [leave, instead] = match outcome.estimator {
        Estimator::Rgmwm => ["rgmwm leaves", Estimator::Gmwm.name()],
        _ => ["sr-awv and dr-awv leave", Estimator::Awv.name()],
    };
    Some(coarse_steps(&CoarseSteps { tau_s, excess }, leave, instead))
}

fn have(some: usize, all: usize) -> String {
    match (some, all) {
        (1, 1) => "the signal has".to_owned(),
        (1, _) => format!("1 of {all} signals has"),
        _ => format!("{some} of {all} signals have"),
    }
}
