//! What the engine of studies says, on the terminal.

use crate::cli::{Progress, Session};
use crate::observer::Observer;
use crate::study::{Importance, Remark};
use std::sync::OnceLock;

/// Prints remarks and shows progress.
pub(super) struct Watch<'a, F: Fn() -> bool + Sync> {
    session: &'a Session,
    go_on: F,
    progress: OnceLock<Progress>,
}

impl<'a, F: Fn() -> bool + Sync> Watch<'a, F> {
    /// Of work that goes on as long as `go_on` says so.
    pub(super) const fn new(session: &'a Session, go_on: F) -> Self {
        Self {
            session,
            go_on,
            progress: OnceLock::new(),
        }
    }
}

impl<F: Fn() -> bool + Sync> Observer<Remark> for Watch<'_, F> {
    fn remark(&self, remark: &Remark) {
        match remark.importance {
            Importance::Detail => self.session.detail(&remark.text),
            Importance::Note => self.session.say(&remark.text),
            Importance::Warning => self.session.warn(&remark.text),
        }
    }

    fn begin(&self, runs: u64) {
        let _ = self.progress.set(self.session.progress("runs", runs));
    }

    fn advance(&self, runs: u64) {
        if let Some(progress) = self.progress.get() {
            progress.add(runs);
        }
    }

    fn go_on(&self) -> bool {
        (self.go_on)()
    }
}
