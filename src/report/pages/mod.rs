//! The page of each result.

mod paper;
pub(crate) use paper::{PaperFigure, StudyCurves, paper_figures, paper_page};

use super::page::Tone;
use nav_sim_navigation::metrics::VerdictKind;
use nav_sim_navigation::simulation::REPORTED;

/// The reported states and their units, in words.
pub(crate) const STATES: [&str; REPORTED] = [
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
pub(crate) fn error_of(state: &str) -> String {
    state.replacen(" (", " error (", 1)
}

pub(crate) const fn tone(kind: VerdictKind) -> Tone {
    match kind {
        VerdictKind::Consistent => Tone::Good,
        VerdictKind::Undecided => Tone::Undecided,
        VerdictKind::Doubtful | VerdictKind::Underconfident => Tone::Doubtful,
        VerdictKind::Overconfident | VerdictKind::NotMet | VerdictKind::Diverged => Tone::Bad,
    }
}
