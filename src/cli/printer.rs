//! The only place that writes to the terminal: results to stdout, everything said to stderr.

use super::Failure;
use super::common::{Color, Common};
use crate::failure::system_words;
use nav_sim_document::{Importance, Note, turns};
use std::borrow::Cow;
use std::io::{ErrorKind, IsTerminal, Write};

/// Where results and remarks go.
#[derive(Debug, Default)]
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
        Self {
            quiet: common.quiet,
            verbose: common.verbose,
            color,
            muted: false,
        }
    }

    /// The same, but results are kept back.
    pub(crate) const fn without_results(self) -> Self {
        Self {
            muted: true,
            ..self
        }
    }

    /// A result, to stdout. Where nobody reads any longer nothing is shown, and the command goes on: its files and its
    /// exit code are for others. A full disk ends the program as a failure.
    pub(crate) fn result(&self, text: &str) {
        if self.muted {
            return;
        }
        let mut stdout = std::io::stdout().lock();
        match writeln!(stdout, "{}", safe(text)).and_then(|()| stdout.flush()) {
            Ok(()) => {}
            Err(e) if e.kind() == ErrorKind::BrokenPipe => {}
            Err(e) => {
                let failure = Failure::could_not(format!("standard output: {}", system_words(&e)));
                self.failure(&failure);
                std::process::exit(failure.code().into());
            }
        }
    }

    /// A remark, to stderr.
    pub(crate) fn say(&self, text: &str) {
        self.line(&safe(text));
    }

    fn line(&self, text: &str) {
        if !self.quiet {
            let _ = writeln!(std::io::stderr(), "{text}");
        }
    }

    /// A doubt about the input or the result, to stderr.
    pub(crate) fn warn(&self, text: &str) {
        self.line(&format!(
            "{} {}",
            self.painted("warning:", "\x1b[1;33m"),
            safe(text)
        ));
    }

    /// A detail, to stderr, with `--verbose`.
    pub(crate) fn detail(&self, text: &str) {
        if self.verbose {
            self.say(text);
        }
    }

    /// A remark, by its importance.
    pub(crate) fn note(&self, note: &Note) {
        match note.importance {
            Importance::Warning => self.warn(&note.text),
            Importance::Remark => self.say(&note.text),
            Importance::Detail => self.detail(&note.text),
        }
    }

    /// Prints an error and its hint to stderr, even with `--quiet`.
    pub(crate) fn failure(&self, failure: &Failure) {
        let message = failure.to_string();
        let mut text = format!(
            "{} {}\n",
            self.painted("error:", "\x1b[1;31m"),
            safe(&message)
        );
        if let Some(advice) = failure.advice() {
            text += &format!(
                "\n{} {}\n",
                self.painted("hint:", "\x1b[1;36m"),
                safe(&advice)
            );
        }
        let _ = std::io::stderr().write_all(text.as_bytes());
    }

    fn painted(&self, word: &str, style: &str) -> String {
        if self.color {
            format!("{style}{word}\x1b[0m")
        } else {
            word.to_owned()
        }
    }
}

/// A text whose control characters (of file names, say) do nothing to a terminal; lines and tabulators stay.
fn safe(text: &str) -> Cow<'_, str> {
    let is_unsafe = |c: char| turns(c) || c.is_control() && c != '\n' && c != '\t';
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let shown = |c: char| {
        if is_unsafe(c) {
            c.escape_default().to_string()
        } else {
            c.to_string()
        }
    };
    Cow::Owned(text.chars().map(shown).collect())
}

#[cfg(test)]
mod tests {
    use super::safe;

    #[test]
    fn control_characters_are_shown() {
        assert_eq!(safe("a\tb\nc \u{b5}m"), "a\tb\nc \u{b5}m");
        assert_eq!(
            safe("ri\u{1b}[31mght\u{9b}\r"),
            "ri\\u{1b}[31mght\\u{9b}\\r"
        );
        // shown as run.exe.csv
        assert_eq!(safe("run\u{202e}vsc.exe"), "run\\u{202e}vsc.exe");
    }
}
