//! What a job tells, said.

use crate::cli::{Progress, Session};
use crate::observer::Observer;
use crate::run::Note;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Says what a job tells, shows how far it is and takes the time of its runs.
pub(in crate::cli) struct Words<'a> {
    session: &'a Session,
    runs: Mutex<Option<(Progress, Instant)>>,
    runs_s: Mutex<f64>,
}

impl<'a> Words<'a> {
    pub(in crate::cli) const fn new(session: &'a Session) -> Self {
        Self {
            session,
            runs: Mutex::new(None),
            runs_s: Mutex::new(0.0),
        }
    }

    /// How long the runs took (s).
    pub(super) fn runs_s(&self) -> f64 {
        *self.runs_s.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer<Note> for Words<'_> {
    fn remark(&self, note: &Note) {
        note.said()
            .iter()
            .for_each(|said| self.session.printer.note(said));
    }

    fn begin(&self, runs: u64) {
        let progress = self.session.progress("runs", runs);
        *self.runs.lock().unwrap_or_else(PoisonError::into_inner) =
            Some((progress, Instant::now()));
    }

    fn advance(&self, runs: u64) {
        let running = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        running.iter().for_each(|(progress, _)| progress.add(runs));
    }

    fn end(&self) {
        if let Some((_, start)) = self
            .runs
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
        {
            *self.runs_s.lock().unwrap_or_else(PoisonError::into_inner) =
                start.elapsed().as_secs_f64();
        }
    }
}
