//! The page of each result.

mod paper;
mod run;
mod run_budgets;
mod run_charts;
pub(crate) use paper::{PaperFigure, StudyCurves, paper_figures, paper_page};
pub(super) use run::run_page;
pub(crate) use run_charts::run_svg;

use super::number;
use super::page::Tone;
use nav_sim_navigation::metrics::VerdictKind;
use nav_sim_navigation::simulation::REPORTED;

/// The reported states and their units, in words.
const STATES: [&str; REPORTED] = [
    "position north (m)",
    "position east (m)",
    "position down (m)",
    "velocity north (m/s)",
    "velocity east (m/s)",
    "velocity down (m/s)",
    "roll (°)",
    "pitch (°)",
    "yaw (°)",
];

/// A state as the title of a chart of its errors: `roll error (°)`.
fn error_of(state: &str) -> String {
    state.replacen(" (", " error (", 1)
}

pub(super) const fn tone(kind: VerdictKind) -> Tone {
    match kind {
        VerdictKind::Consistent => Tone::Good,
        VerdictKind::Undecided => Tone::Undecided,
        VerdictKind::Doubtful | VerdictKind::Underconfident => Tone::Doubtful,
        VerdictKind::Overconfident | VerdictKind::NotMet | VerdictKind::Diverged => Tone::Bad,
    }
}

/// With a capital letter and a full stop.
fn sentence(line: &str) -> String {
    let mut letters = line.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}.", letters.as_str())
}

/// `300–390 s`
fn window((start_s, end_s): (f64, f64)) -> String {
    number::window(start_s, end_s)
}
