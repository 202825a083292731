//! Flags that mean the same in every command, and the only place that writes to the terminal: results to stdout,
//! everything said to stderr.

use super::Failure;
use crate::app::{Answer, Context, Reporter};
use crate::failure::system_words;
use crate::io::atomic::remove_unfinished;
use crate::parse;
use crate::report::{WIDTH, json};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressFinish, ProgressStyle};
use nav_sim_document::{Document, Importance, Note, one_line};
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Flags that mean the same in every command.
#[derive(clap::Args, Clone, Default)]
#[command(next_help_heading = "Common options")]
pub(crate) struct Common {
    /// Seed of all random numbers [default: 1]
    #[arg(long, global = true, value_name = "N", value_parser = parse::seed)]
    pub(crate) seed: Option<u64>,
    /// Worker threads, at most 1024 (default: one per core)
    #[arg(long, short = 'j', global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Print verdict, table and warnings only
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Print more
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// Show no progress
    #[arg(long, global = true, hide_short_help = true)]
    pub(crate) no_progress: bool,
    /// Replace results of another configuration, other inputs or another seed
    #[arg(long, global = true, hide_short_help = true)]
    pub(crate) force: bool,
    /// When to use colour
    #[arg(
        long,
        global = true,
        value_name = "WHEN",
        value_enum,
        default_value_t,
        hide_short_help = true
    )]
    pub(crate) color: Color,
    /// Format of what goes to stdout
    #[arg(long, global = true, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(clap::ValueEnum, Clone, Copy, Default, PartialEq)]
pub(crate) enum Color {
    #[default]
    Auto,
    Always,
    Never,
}

#[derive(clap::ValueEnum, Clone, Copy, Default, PartialEq)]
pub(crate) enum Format {
    #[default]
    Text,
    Json,
}

/// Surroundings of every command on a terminal: flags, and the progress of the job that runs.
#[derive(Default)]
pub(crate) struct Session {
    pub(crate) common: Common,
    /// The words of the command line, for manifests.
    pub(crate) given: Vec<String>,
    /// True to keep results back.
    pub(crate) is_muted: bool,
    /// False to stop a job that can be resumed.
    pub(crate) go_on: Option<Box<dyn Fn() -> bool + Send + Sync>>,
    pub(crate) progress: Mutex<Option<ProgressBar>>,
}

impl Session {
    pub(crate) fn is_json(&self) -> bool {
        self.common.format == Format::Json
    }

    /// Notes and progress of a job on this terminal, and the seed.
    pub(crate) fn context(&self) -> Context<'_> {
        Context::new(self, self.common.seed)
    }

    /// A result, to stdout. Where nobody reads any longer nothing is shown, and the command goes on: its files and its
    /// exit code are for others. A full disk ends the program as a failure.
    pub(crate) fn result(&self, text: impl Display) {
        let text = text.to_string();
        let text = text.trim_end();
        if self.is_muted || text.is_empty() {
            return;
        }
        let mut stdout = std::io::stdout().lock();
        match writeln!(stdout, "{}", safe(text)).and_then(|()| stdout.flush()) {
            Err(e) if e.kind() != ErrorKind::BrokenPipe => {
                let failure = Failure::failed(format!("standard output: {}", system_words(&e)));
                self.failure(&failure);
                remove_unfinished();
                std::process::exit(failure.code().into());
            }
            _ => {}
        }
    }

    /// An answer to stdout, in the text given or in its own form, and its notes to stderr.
    pub(crate) fn show(&self, answer: &impl Answer, document: &Document, text: Option<String>) {
        self.result(match (self.common.format, text) {
            (Format::Json, _) => json(answer),
            (_, Some(text)) => text,
            _ if self.common.verbose => document.verbose(WIDTH),
            _ => document.terminal(WIDTH),
        });
        for note in document.shown_notes(self.common.verbose) {
            match note.importance {
                Importance::Warning => self.note(note.clone()),
                _ => self.say(format!("note: {}", note.text)),
            }
        }
    }

    /// Says what is done, on stderr.
    pub(crate) fn say(&self, text: impl Display) {
        if !self.common.quiet {
            let _ = writeln!(std::io::stderr(), "{}", one_line(&text.to_string()));
        }
    }

    /// Prints an error and its hint to stderr, even with `--quiet`.
    pub(crate) fn failure(&self, failure: &Failure) {
        let error = self.painted("error:", "1;31", &failure.to_string());
        let hint = failure.advice();
        let hint = hint.map(|hint| format!("\n{}\n", self.painted("hint:", "1;36", &hint)));
        let _ = write!(std::io::stderr(), "{error}\n{}", hint.unwrap_or_default());
    }

    fn painted(&self, word: &str, style: &str, text: &str) -> String {
        let is_painted = match self.common.color {
            Color::Auto => {
                std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
            }
            always => always == Color::Always,
        };
        match is_painted {
            true => format!("\x1b[{style}m{word}\x1b[0m {}", one_line(text)),
            false => format!("{word} {}", one_line(text)),
        }
    }

    fn running(&self) -> MutexGuard<'_, Option<ProgressBar>> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Reporter for Session {
    fn note(&self, Note { importance, text }: Note) {
        match importance {
            // those of the commands of a demo are for --verbose, as their remarks are
            Importance::Warning if !self.is_muted || self.common.verbose => {
                let warning = self.painted("warning:", "1;33", &text);
                let _ = writeln!(std::io::stderr(), "{warning}");
            }
            Importance::Remark => self.say(text),
            Importance::Detail if self.common.verbose => self.say(text),
            _ => {}
        }
    }

    /// A bar on a terminal, else a line every 10 %.
    fn begin(&self, unit: &str, steps: u64) {
        if self.common.quiet || self.common.no_progress {
            return;
        }
        let target = match std::io::stderr().is_terminal() {
            true => ProgressDrawTarget::stderr(),
            false => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(Some(steps), target);
        let template = "{bar:30} {pos}/{len} {msg}, {per_sec}, {eta} left";
        bar.set_style(ProgressStyle::with_template(template).expect("constant"));
        bar.set_message(unit.to_owned());
        *self.running() = Some(bar.with_finish(ProgressFinish::AndClear));
    }

    fn advance(&self, steps: u64) {
        let running = self.running();
        let Some(bar) = &*running else { return };
        let tenth = || bar.position() * 10 / bar.length().unwrap_or(0).max(1);
        let before = tenth();
        bar.inc(steps);
        if tenth() > before && !std::io::stderr().is_terminal() {
            let _ = writeln!(std::io::stderr(), "{}", line(bar));
        }
    }

    fn end(&self) {
        *self.running() = None;
    }

    fn should_continue(&self) -> bool {
        self.go_on.as_ref().is_none_or(|go_on| go_on())
    }
}

/// A bar as a line.
fn line(bar: &ProgressBar) -> String {
    let (done, total) = (bar.position(), bar.length().unwrap_or(0));
    let rate = done as f64 / bar.elapsed().as_secs_f64().max(1e-9);
    let left = total.saturating_sub(done) as f64 / rate;
    let percent = done * 100 / total.max(1);
    let unit = bar.message();
    format!("{percent:3} %  {done}/{total} {unit}, {rate:.3}/s, {left:.0} s left")
}

/// A text whose control characters (of file names, say) do nothing to a terminal; lines and tabulators stay.
fn safe(text: &str) -> String {
    let parts = text.split_inclusive(['\n', '\t']);
    let shown = |part: &str| {
        let words = part.trim_end_matches(['\n', '\t']);
        one_line(words) + &part[words.len()..]
    };
    parts.map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

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

    #[test]
    fn a_line_says_share_rate_and_time_left() {
        let bar = ProgressBar::hidden().with_elapsed(Duration::from_secs(10));
        bar.set_length(40);
        bar.set_position(20);
        bar.set_message("runs");
        let line = line(&bar);
        assert!(line.starts_with(" 50 %  20/40 runs, "), "{line}");
        assert!(line.ends_with(" 10 s left"), "{line}");
    }
}
