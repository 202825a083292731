//! The reported states in words.

use nav_sim_navigation::simulation::REPORTED;

/// As they stand in a sentence.
pub(super) const STATES: [&str; REPORTED] = [
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
pub(super) fn axis_of(state: usize) -> &'static str {
    STATES[state].trim_end_matches(" position")
}
