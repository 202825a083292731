//! Flags that mean the same in every command, and what follows from them.

use super::{Failure, Printer, Progress};
use crate::app::{Context, Front};
use crate::parse;
use nav_sim_document::Note;
use std::fmt::Display;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Flags that mean the same in every command.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
pub(crate) struct Common {
    /// Seed of all random numbers [default: 1]
    #[arg(long, global = true, value_name = "N", value_parser = parse::seed)]
    pub(crate) seed: Option<u64>,
    /// Worker threads, at most 1024 (default: one per core)
    #[arg(long, short = 'j', global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Print verdict and table only, no notes
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Print more
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// Show no progress, neither bars nor lines
    #[arg(long, global = true)]
    pub(crate) no_progress: bool,
    /// Replace results of another kind, configuration or seed
    #[arg(long, global = true)]
    pub(crate) force: bool,
    /// When to use colour
    #[arg(long, global = true, value_name = "WHEN", value_enum, default_value_t)]
    pub(crate) color: Color,
    /// Format of what goes to stdout
    #[arg(long, global = true, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Color {
    #[default]
    Auto,
    Always,
    Never,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Format {
    #[default]
    Text,
    Json,
    /// For wv (all scales of all signals) and compare
    Csv,
}

/// Surroundings of every command: printer, seed, progress.
#[derive(Debug)]
pub(crate) struct Session {
    common: Common,
    progress: Mutex<Option<Progress>>,
    /// Where results and remarks go.
    pub(crate) printer: Printer,
}

impl Session {
    /// Starts the threads asked for.
    pub(crate) fn new(common: Common) -> Result<Self, Failure> {
        let threads = common.threads.map_or(0, usize::from); // 0: one per core
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global()
            .map_err(Failure::could_not)?;
        Ok(Self {
            printer: Printer::new(&common),
            common,
            progress: Mutex::default(),
        })
    }

    /// A session for a command that another one runs: with that command's seed; `muted`, its results and
    /// remarks are kept back.
    pub(crate) fn within(&self, inner: &Common, muted: bool) -> Self {
        let quiet = self.common.quiet || (muted && !self.common.verbose);
        let common = Common {
            seed: inner.seed,
            quiet,
            ..self.common.clone()
        };
        let printer = if muted {
            Printer::new(&common).without_results()
        } else {
            Printer::new(&common)
        };
        Self {
            printer,
            common,
            progress: Mutex::default(),
        }
    }

    /// Puts a result to stdout.
    pub(crate) fn result(&self, text: impl Display) {
        self.printer.result(&text.to_string());
    }

    /// Says what is done.
    pub(crate) fn say(&self, text: impl Display) {
        self.printer.say(&text.to_string());
    }

    /// True if stdout gets JSON rather than text.
    pub(crate) fn json(&self) -> bool {
        self.common.format == Format::Json
    }

    /// True if another result takes the place of one that is there.
    pub(crate) const fn force(&self) -> bool {
        self.common.force
    }

    /// True if stdout gets CSV rather than text.
    pub(crate) fn csv(&self) -> bool {
        self.common.format == Format::Csv
    }

    /// True with `--verbose`.
    pub(crate) const fn verbose(&self) -> bool {
        self.common.verbose
    }

    /// Notes and progress of a job on this terminal, and the seed.
    pub(crate) fn context(&self) -> Context<'_> {
        Context::new(self, self.common.seed)
    }

    /// The seed of the command line, if there is one.
    pub(crate) const fn asked_seed(&self) -> Option<u64> {
        self.common.seed
    }

    /// Progress of `total` units, said on stderr: a bar on a terminal, else a line every 10 %.
    pub(crate) fn progress(&self, unit: &str, total: u64) -> Progress {
        if self.common.quiet || self.common.no_progress {
            return Progress::silent();
        }
        Progress::new(unit, total)
    }

    fn running(&self) -> MutexGuard<'_, Option<Progress>> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Front for Session {
    fn note(&self, note: Note) {
        self.printer.note(&note);
    }

    fn begin(&self, unit: &str, steps: u64) {
        *self.running() = Some(self.progress(unit, steps));
    }

    fn advance(&self, steps: u64) {
        self.running().iter().for_each(|running| running.add(steps));
    }

    fn end(&self) {
        *self.running() = None;
    }
}
