//! `nav-sim batch`: grids of experiments in units that survive, resume and spread over machines.

mod merge;
mod plan;
mod run;
mod shard;
mod status;
mod verify;
mod watch;

use super::{Failure, Session, read};
use crate::study::{Planned, StudyError};
use std::path::{Path, PathBuf};

/// Run studies: plan a grid of experiments, run it in pieces on any machines, merge the results
///
/// A study (TOML, see `nav-sim schema study`) is the product of trajectories, truths, scenarios, receivers and
/// outage sets, with several candidate models and filters on the same noise in each cell. `plan` cuts it into
/// units of work. `run` does those that are not done yet (any number of processes, on any machines that share
/// the directory; kill and repeat at will). `merge` makes the tables, the same bytes however the units were run.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --seed 1 -o out/quick
  nav-sim batch run examples/quick_study.toml -o out/quick
  nav-sim batch merge examples/quick_study.toml -o out/quick")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand, Debug)]
enum Command {
    Plan(plan::Args),
    Run(run::Args),
    Merge(merge::Args),
    Status(status::Args),
    Verify(verify::Args),
}

impl Args {
    /// Whether the command ends in good order at a signal, to be resumed.
    pub(crate) const fn heeds_signals(&self) -> bool {
        matches!(self.command, Command::Run(_))
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    match &args.command {
        Command::Plan(args) => plan::run(args, session),
        Command::Run(args) => run::run(args, session),
        Command::Merge(args) => merge::run(args, session),
        Command::Status(args) => status::run(args, session),
        Command::Verify(args) => verify::run(args, session),
    }
}

/// The study and its directory.
#[derive(clap::Args, Debug)]
pub(super) struct Place {
    /// The study (TOML)
    #[arg(value_name = "STUDY")]
    study: PathBuf,
    /// Directory of the study (default: out/ and the study's name)
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Place {
    fn directory(&self) -> PathBuf {
        let stem = || Path::new("out").join(self.study.file_stem().unwrap_or_default());
        self.out.clone().unwrap_or_else(stem)
    }

    /// The plan in the directory, which must be that of the study, and have the seed if one is asked for.
    fn planned(&self, seed: Option<u64>) -> Result<Planned, Failure> {
        Ok(Planned::open(&self.study, &self.directory(), seed)?)
    }
}

impl From<StudyError> for Failure {
    fn from(e: StudyError) -> Self {
        let hint = e.hint();
        match e {
            StudyError::File(e) => read::of_study(&e),
            e if e.is_usage() => Self::input(e).maybe_hint(hint),
            e => Self::could_not(e).maybe_hint(hint),
        }
    }
}

/// A duration for people.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86400.0),
    }
}
