//! Uncertainty of a fit, in words.

use super::format::{percent, three_digits};
use crate::outcome::{Indistinct, Outcome, ParameterInterval, Undetermined};
use crate::uncertainty::WIDEST;

/// An amplitude known to no better than this factor, either way, is told.
const FACTOR: f64 = 3.0;

/// Remarks on what the bootstrap says: which processes the data do not need all of, and which amplitude is hardly known, by the width of its
/// interval.
pub(crate) fn notes_of_inference(outcome: &Outcome) -> Vec<String> {
    let Some(inference) = &outcome.inference else { return Vec::new() };
    let labels = outcome.fit.composite.labels();
    let wide = |i: &&ParameterInterval| {
        !i.of.parameter.is_shape() && i.absent.is_none() && i.high > FACTOR * FACTOR * i.low
    };
    let remark = |i: &ParameterInterval| {
        let known = if i.low > 0.0 {
            format!("known to a factor of {} only", three_digits((i.high / i.low).sqrt()))
        } else {
            "may be zero".to_owned()
        };
        format!("{} is {known} (95 %): weakly identifiable", outcome.fit.composite.name_of(i.of))
    };
    let apart = inference.indistinct.iter().map(|i| note_of_indistinct(i, &labels));
    apart.chain(inference.intervals.iter().filter(wide).map(remark)).collect()
}

/// Why a parameter of a model with processes of these labels has no interval, if it has none.
#[must_use]
pub fn undetermined(interval: &ParameterInterval, labels: &[String]) -> Option<String> {
    let ParameterInterval { of, lost, absent, .. } = interval;
    let (process, parameter) = (&labels[of.process], of.parameter.name());
    let why = match absent.as_ref()? {
        Undetermined::Zero => format!("not determined: {process} is zero"),
        Undetermined::Vanishes => {
            format!("not determined: {process} vanishes in {} of the draws", percent(*lost))
        }
        Undetermined::OneSided => {
            return Some(format!(
                "{process} {parameter}: no interval: its draws lie to one side of the estimate"
            ));
        }
        Undetermined::BeyondSearch => {
            "not determined: its correlation time may be any beyond what these scales tell".to_owned()
        }
        Undetermined::Open => {
            format!("not determined: the data leave {process} open by more than a factor of {WIDEST}")
        }
        Undetermined::Indistinct(alike) => {
            format!("not determined: the data do not need {}", joined(alike, labels))
        }
    };
    Some(format!("{process} {parameter}: no interval, {why}"))
}

/// `both AR1_1 and AR1_2`
fn joined(processes: &[usize], labels: &[String]) -> String {
    let together = if processes.len() == 2 { "both " } else { "all of " };
    let named = processes.iter().map(|i| labels[*i].as_str()).collect::<Vec<_>>().join(" and ");
    format!("{together}{named}")
}

/// Sentence on the processes (with these labels) of which the data do not need all, and on what is known instead.
fn note_of_indistinct(indistinct: &Indistinct, labels: &[String]) -> String {
    let Indistinct { processes, spec, composite, p_value, intervals } = indistinct;
    let kind = spec.kinds()[processes[0]];
    let own = composite.parameters().filter(|(of, _)| composite.processes[of.process].kind() == kind);
    let known = own.map(|(of, value)| {
        let interval = intervals.iter().find(|i| i.of == of && i.absent.is_none());
        let ends = interval.map_or(String::new(), |i| format!(" ({:.5e} … {:.5e})", i.low, i.high));
        format!("{} = {value:.5e}{ends}", of.parameter.name())
    });
    format!(
        "the data do not need {}: {spec} describes the curve as well (p = {p_value:.2}), with {}; the intervals of the \
         other parameters are those of that model",
        joined(processes, labels),
        known.collect::<Vec<_>>().join(", ")
    )
}
