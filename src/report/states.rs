//! The reported states in words; the colour of a verdict.

use nav_sim_document::Tone;
use nav_sim_navigation::metrics::VerdictKind;
use nav_sim_navigation::simulation::REPORTED;

/// As they stand in a sentence.
pub(crate) const SPOKEN: [&str; REPORTED] = [
    "North position",
    "East position",
    "Down position",
    "North velocity",
    "East velocity",
    "Down velocity",
    "roll",
    "pitch",
    "yaw",
];

/// As they stand in the head of a table.
pub(crate) fn axis_of(state: usize) -> &'static str {
    SPOKEN[state].trim_end_matches(" position")
}

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

/// The colour of a verdict.
pub(crate) const fn tone(kind: VerdictKind) -> Tone {
    match kind {
        VerdictKind::Consistent => Tone::Good,
        VerdictKind::Undecided => Tone::Undecided,
        VerdictKind::Doubtful | VerdictKind::Underconfident => Tone::Doubtful,
        VerdictKind::Overconfident | VerdictKind::NotMet | VerdictKind::Diverged => Tone::Bad,
    }
}
