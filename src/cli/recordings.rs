//! What is found in recordings, said.

use super::{Progress, Session};
use crate::jobs::{Remark, Remarks};

/// Says what is found in recordings (in detail with `--verbose`) and what is doubtful.
pub(crate) struct Said<'a> {
    session: &'a Session,
    progress: Option<Progress>,
}

impl<'a> Said<'a> {
    pub(crate) const fn new(session: &'a Session) -> Self {
        Self {
            session,
            progress: None,
        }
    }
}

impl Remarks for Said<'_> {
    fn progress(&mut self, done: usize, all: usize) {
        let progress = self
            .progress
            .get_or_insert_with(|| self.session.progress("recordings", all as u64));
        if done > 0 {
            progress.add(1);
        }
    }

    fn remark(&mut self, remark: Remark<'_>) {
        self.progress = None;
        remark
            .said()
            .iter()
            .for_each(|said| self.session.printer.note(said));
    }
}
