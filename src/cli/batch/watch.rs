//! A session that can be stopped.

use crate::app::Front;
use crate::cli::Session;
use nav_sim_document::Note;

/// Goes on as long as `go_on` says so.
pub(super) struct Watch<'a, F>(pub(super) &'a Session, pub(super) F);

impl<F: Fn() -> bool + Sync> Front for Watch<'_, F> {
    fn note(&self, note: Note) {
        self.0.note(note);
    }

    fn begin(&self, unit: &str, steps: u64) {
        self.0.begin(unit, steps);
    }

    fn advance(&self, steps: u64) {
        self.0.advance(steps);
    }

    fn end(&self) {
        self.0.end();
    }

    fn go_on(&self) -> bool {
        (self.1)()
    }
}
