//! How sure a fit is, in words.

use super::format::{percent, three_digits};
use crate::outcome::{Indistinct, Outcome, ParameterInterval, Undetermined};
use crate::uncertainty::WIDEST;

/// An amplitude known to no better than this factor, either way, is told.
const FACTOR: f64 = 3.0;

/// Remarks on what the bootstrap says: what cannot be told apart, and which amplitude is hardly known, by the width of its
/// interval.
pub(crate) fn notes_of_inference(outcome: &Outcome) -> Vec<String> {
    let Some(inference) = &outcome.inference else { return Vec::new() };
    let wide = |i: &&ParameterInterval| {
        let shape = matches!(i.parameter, "phi" | "beta" | "theta");
        !shape && i.absent.is_none() && i.high > FACTOR * FACTOR * i.low
    };
    let remark = |i: &ParameterInterval| {
        let known = if i.low > 0.0 {
            format!("known to a factor of {} only", three_digits((i.high / i.low).sqrt()))
        } else {
            "may be zero".to_owned()
        };
        format!("{} {} is {known} (95 %): weakly identifiable", i.process, i.parameter)
    };
    let apart = inference.indistinct.iter().map(note_of_indistinct);
    apart.chain(inference.intervals.iter().filter(wide).map(remark)).collect()
}

/// Why a parameter has no interval, if it has none.
#[must_use]
pub fn undetermined(interval: &ParameterInterval) -> Option<String> {
    let ParameterInterval { process, parameter, lost, absent, .. } = interval;
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
        Undetermined::Indistinct(labels) => {
            format!("not determined: {} cannot be told apart", labels.join(" and "))
        }
    };
    Some(format!("{process} {parameter}: no interval, {why}"))
}

/// What cannot be told apart, and what is known instead.
#[must_use]
pub fn note_of_indistinct(indistinct: &Indistinct) -> String {
    let code = indistinct.labels[0].split('_').next().unwrap_or_default();
    let alone = indistinct.composite.processes.iter().zip(indistinct.composite.labels());
    let own = alone.filter(|(process, _)| process.code() == code);
    let of = |label: &str, name: &str, value: f64| {
        let interval = indistinct.intervals.iter().find(|i| i.process == label && i.parameter == name);
        let ends = interval.filter(|i| i.absent.is_none());
        let ends = ends.map_or(String::new(), |i| format!(" ({:.5e} … {:.5e})", i.low, i.high));
        format!("{name} = {value:.5e}{ends}")
    };
    let found: Vec<String> = own
        .flat_map(|(p, l)| p.parameters().into_iter().map(move |(n, v)| (l.clone(), n, v)))
        .map(|(label, name, value)| of(&label, name, value))
        .collect();
    format!(
        "{} cannot be told apart: {} describes the curve as well (p = {:.2}), with {}; the intervals of the other \
             parameters are those of that model",
        indistinct.labels.join(" and "),
        indistinct.spec,
        indistinct.p_value,
        found.join(", ")
    )
}
