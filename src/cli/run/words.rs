//! What a job tells, in words.

use crate::cli::{Progress, Session};
use crate::observer::Observer;
use crate::report::{reduction_doubt, reduction_line, unexpected_line};
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
        Self { session, runs: Mutex::new(None), runs_s: Mutex::new(0.0) }
    }

    /// How long the runs took (s).
    pub(super) fn runs_s(&self) -> f64 {
        *self.runs_s.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer<Note> for Words<'_> {
    fn remark(&self, note: &Note) {
        let printer = &self.session.printer;
        match note {
            Note::Warning(text) => printer.warn(text),
            Note::Remark(text) => printer.say(text),
            Note::Detail(text) => printer.detail(text),
            Note::LargeBias(sensor, sigma) => printer.warn(&format!(
                "the filter starts with a bias of {sigma:.3} {} ({sensor}): an AR1 of phi near 1?",
                sensor.unit()
            )),
            Note::Unexpected(found) => printer.warn(&unexpected_line(found)),
            Note::Reduction(quality) => {
                printer.say(&reduction_line(quality));
                reduction_doubt(quality).iter().for_each(|doubt| printer.warn(doubt));
            }
            Note::Heading(doubt) => printer.warn(&doubt.to_string()),
            Note::Outage(remark) => printer.warn(&remark.to_string()),
        }
    }

    fn begin(&self, runs: u64) {
        let progress = self.session.progress("runs", runs);
        *self.runs.lock().unwrap_or_else(PoisonError::into_inner) = Some((progress, Instant::now()));
    }

    fn advance(&self, runs: u64) {
        let running = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        running.iter().for_each(|(progress, _)| progress.add(runs));
    }

    fn end(&self) {
        if let Some((_, start)) = self.runs.lock().unwrap_or_else(PoisonError::into_inner).take() {
            *self.runs_s.lock().unwrap_or_else(PoisonError::into_inner) = start.elapsed().as_secs_f64();
        }
    }
}
