//! What is found in recordings, said.

use super::{Progress, Session};
use crate::formats::recordings::Report;
use crate::jobs::{Remark, Remarks};
use crate::report::six_digits;

/// Says what is found in recordings (in detail with `--verbose`) and what is doubtful.
pub(crate) struct Said<'a> {
    session: &'a Session,
    progress: Option<Progress>,
}

impl<'a> Said<'a> {
    pub(crate) const fn new(session: &'a Session) -> Self {
        Self { session, progress: None }
    }

    fn report(&mut self, report: &Report) {
        let printer = &self.session.printer;
        if report.files.len() > FEW {
            printer.say(&format!("{} (--verbose: each of them)", report.summary()));
        }
        for file in &report.files {
            if report.files.len() > FEW {
                printer.detail(&file.to_string());
            } else {
                printer.say(&file.to_string());
            }
            if !file.ignored.is_empty() {
                printer.detail(&format!("{}: passed over: {}", file.file, file.ignored.join(", ")));
            }
        }
        for warning in report.all_warnings() {
            printer.warn(&warning);
        }
    }
}

impl Remarks for Said<'_> {
    fn progress(&mut self, done: usize, all: usize) {
        let progress = self.progress.get_or_insert_with(|| self.session.progress("recordings", all as u64));
        if done > 0 {
            progress.add(1);
        }
    }

    fn remark(&mut self, remark: Remark<'_>) {
        self.progress = None;
        match remark {
            Remark::Read(report) => self.report(report),
            Remark::Rate { found_hz, taken_hz } => self.session.say(format!(
                "the recordings run at {} Hz: taken as {taken_hz} Hz, so that fixes meet samples",
                six_digits(found_hz)
            )),
            Remark::Shortest { recording, samples, scales, short: 0, usual, .. } => self.session.warn(format!(
                "{recording}: its {samples} samples limit all recordings to {scales} scales; without it there would be \
                 more (half of them have {usual}): leave it out for those"
            )),
            Remark::Shortest { recording, samples, scales, short, used, .. } => {
                let others = match short {
                    1 => String::new(),
                    _ => format!(" ({} more are short)", short - 1),
                };
                self.session.warn(format!(
                    "{recording}: its {samples} samples have {scales} scales{others}; the longer ones, up to {used} scales, are \
                     averaged over the longer recordings alone"
                ));
            }
        }
    }
}

/// Files of more than this number are told in one line, unless all is to be said.
const FEW: usize = 2;
