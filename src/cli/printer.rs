//! The only place that writes to the terminal: results to stdout, everything said to stderr.

use super::Common;
use std::io::Write;

/// Where results and remarks go.
#[derive(Debug)]
pub(crate) struct Printer {
    quiet: bool,
    verbose: bool,
}

impl Printer {
    pub(crate) const fn new(common: &Common) -> Self {
        Self { quiet: common.quiet, verbose: common.verbose }
    }

    /// A result, to stdout. A closed pipe ends the program quietly, as success.
    pub(crate) fn result(&self, text: &str) {
        if let Err(e) = writeln!(std::io::stdout(), "{text}")
            && e.kind() == std::io::ErrorKind::BrokenPipe
        {
            std::process::exit(0);
        }
    }

    /// A remark, to stderr.
    pub(crate) fn say(&self, text: &str) {
        if !self.quiet {
            let _ = writeln!(std::io::stderr(), "{text}");
        }
    }

    /// A detail, to stderr, with `--verbose`.
    pub(crate) fn detail(&self, text: &str) {
        if self.verbose {
            self.say(text);
        }
    }
}
