//! The only place that writes to the terminal: results to stdout, everything said to stderr.

use super::common::{Color, Common};
use super::exit::Failure;
use std::io::{ErrorKind, IsTerminal, Write};

/// Where results and remarks go.
#[derive(Debug)]
pub(crate) struct Printer {
    quiet: bool,
    verbose: bool,
    color: bool,
    muted: bool,
}

impl Printer {
    pub(crate) fn new(common: &Common) -> Self {
        let terminal = || std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        let color = match common.color {
            Color::Auto => terminal(),
            Color::Always => true,
            Color::Never => false,
        };
        Self { quiet: common.quiet, verbose: common.verbose, color, muted: false }
    }

    /// The same, but results are kept back.
    pub(crate) const fn without_results(self) -> Self {
        Self { muted: true, ..self }
    }

    /// A result, to stdout. A closed pipe ends the program quietly, as success; a full disk as a failure.
    pub(crate) fn result(&self, text: &str) {
        if self.muted {
            return;
        }
        let mut stdout = std::io::stdout().lock();
        match writeln!(stdout, "{text}").and_then(|()| stdout.flush()) {
            Ok(()) => {}
            Err(e) if e.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
            Err(e) => {
                let failure = Failure::could_not(format!("standard output: {e}"));
                self.failure(&failure);
                std::process::exit(failure.code().into());
            }
        }
    }

    /// A remark, to stderr.
    pub(crate) fn say(&self, text: &str) {
        if !self.quiet {
            let _ = writeln!(std::io::stderr(), "{text}");
        }
    }

    /// A doubt about the input or the result, to stderr.
    pub(crate) fn warn(&self, text: &str) {
        self.say(&format!("{} {text}", self.painted("warning:", "\x1b[1;33m")));
    }

    /// A detail, to stderr, with `--verbose`.
    pub(crate) fn detail(&self, text: &str) {
        if self.verbose {
            self.say(text);
        }
    }

    /// What went wrong and what to do about it, to stderr, even with `--quiet`.
    pub(crate) fn failure(&self, failure: &Failure) {
        let mut text = format!("{} {failure}\n", self.painted("error:", "\x1b[1;31m"));
        if let Some(advice) = failure.advice() {
            text += &format!("\n{} {advice}\n", self.painted("hint:", "\x1b[1;36m"));
        }
        let _ = std::io::stderr().write_all(text.as_bytes());
    }

    fn painted(&self, word: &str, style: &str) -> String {
        if self.color { format!("{style}{word}\x1b[0m") } else { word.to_owned() }
    }
}
