//! What a job tells, in words.

use crate::cli::{Progress, Session};
use crate::jobs::Note;
use crate::observer::Observer;
use crate::report::run_words;
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
            Note::LargeBias(sensor, sigma) => printer.warn(&format!(
                "the filter starts with a bias of {sigma:.3} {} ({} of the model, its correlated processes together): \
                 an AR1 of phi near 1? `nav-sim calibrate --parameters` bounds it",
                sensor.unit(),
                sensor.name()
            )),
            Note::Unexpected(doubt) => printer.warn(doubt),
            Note::Reduction(summary) => summary.lines().iter().for_each(|line| printer.say(line)),
            Note::ReductionQuality(quality, has_full) => {
                printer.say(&quality.line());
                let remedy = if *has_full { "; --filter full has a state for every process" } else { "" };
                quality.doubt().iter().for_each(|doubt| printer.warn(&format!("{doubt}{remedy}")));
            }
            Note::Heading(doubt) => printer.warn(&doubt.to_string()),
            Note::Agreement(agreement) if agreement.is_broken() => printer.warn(&format!(
                "the runs contradict the covariance analysis: {}; errors are no longer small",
                run_words::agreement_line(agreement)
            )),
            Note::Agreement(_) => {}
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
