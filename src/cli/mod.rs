//! The command line: one file per subcommand, each its `Args` and a `run(args, &Session)`.

mod batch;
mod completions;
mod demo;
mod drive;
mod init;
mod interrupt;
mod man;
mod schema;
mod session;
mod version;

use crate::app::Asked;
use crate::commands::trajectory::{TrajectoryArgs, TrajectoryCommand};
use crate::commands::with_commands;
use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use drive::drive;
use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::process::ExitCode;

pub(crate) use crate::app::Failure;
pub(crate) use session::{Common, Format, Session};

/// INS/GNSS navigation simulator with a robust stochastic-calibration front end.
#[derive(Parser)]
#[command(name = "nav-sim", version)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

macro_rules! driven {
    ($($variant:ident: $command:path),* $(,)?) => {
        /// Commands that answer a question.
        #[derive(Subcommand)]
        enum Driven {
            $($variant(Asked<$command>)),*
        }

        impl Driven {
            fn run(&self, session: &Session) -> Result<(), Failure> {
                match self {
                    $(Self::$variant(asked) => drive(asked, session)),*
                }
            }
        }
    };
}
with_commands!(driven);

#[derive(Subcommand)]
#[expect(clippy::large_enum_variant, reason = "there is one, once a process")]
enum Command {
    #[command(flatten)]
    Driven(Driven),
    Trajectory(TrajectoryArgs),
    Batch(batch::Args),
    Demo(demo::Args),
    Init(init::Args),
    Schema(schema::Args),
    Completions(completions::Args),
    Man(man::Args),
}

impl Command {
    /// True if the command itself ends in good order at a signal.
    const fn heeds_signals(&self) -> bool {
        matches!(self, Self::Batch(_))
    }

    /// Advice after a signal.
    fn advice_at_signals(&self) -> Option<String> {
        matches!(self, Self::Demo(_)).then(|| "the same command goes on where it was".to_owned())
    }

    fn run(self, session: Session) -> Result<(), Failure> {
        let has_csv = matches!(self, Self::Driven(Driven::Wv(_) | Driven::Compare(_)));
        if session.common.format == Format::Csv && !has_csv {
            let failure = Failure::input("--format csv: only wv and compare print CSV");
            return Err(failure.hint("other commands write CSV files to --out"));
        }
        let text = match self {
            Self::Driven(driven) => return driven.run(&session),
            Self::Trajectory(args) => match args.command {
                TrajectoryCommand::Generate(mut asked) => {
                    asked.request.rate_hz.get_or_insert(100.0);
                    return drive(&asked, &session);
                }
                TrajectoryCommand::Check(asked) => return drive(&asked, &session),
                TrajectoryCommand::Convert(asked) => return drive(&asked, &session),
                TrajectoryCommand::Record(asked) => return drive(&asked, &session),
            },
            Self::Batch(args) => return batch::run(&args, session),
            Self::Demo(args) => return demo::run(&args, &session),
            Self::Init(args) => init::run(&args, &session)?,
            Self::Schema(args) => schema::run(&args),
            Self::Completions(args) => completions::run(&args),
            Self::Man(args) => man::run(&args)?,
        };
        session.result(text);
        Ok(())
    }
}

/// Text of `nav-sim` without arguments.
const OVERVIEW: &str = "\
nav-sim COMMAND --help has examples of each command; the book is docs/README.md.

recordings    wv, calibrate       noise and a model of it from static recordings
              choose, design      which model navigates best; how many recordings it takes
              synthesize          recordings from a model
models        datasheet, export   from a data sheet; to Kalibr, PX4, GTSAM and others
              tune, require       factors that make a filter consistent; the IMU that an outage needs
navigation    trajectory          make, check and convert reference trajectories
              run, compare        INS/GNSS by Monte Carlo or covariance analysis; ratios between runs
              fuse                recorded IMU and GNSS data
studies       batch               grids of runs on any machines
to start      demo, init          the case study of the paper; a directory with files of every kind
              check, schema       check files; their JSON schemas
              completions, man    for shells and manuals

first:        nav-sim init study && cd study && nav-sim run trajectories/land_vehicle.toml calib_data/tactical.toml";

/// The whole command line as clap knows it.
fn command() -> clap::Command {
    Cli::command()
}

/// The words of the command line. A negative number after an option is its value, not a flag: no flag begins with a
/// digit, and what is wrong with the number is for the option to say.
fn words(given: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut words: Vec<OsString> = Vec::new();
    for word in given {
        let text = word.to_string_lossy();
        let is_negative = text
            .strip_prefix('-')
            .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.'));
        match words.last_mut() {
            Some(last) if is_negative && is_bare_option(last) => {
                last.push("=");
                last.push(&word);
            }
            _ => words.push(word),
        }
    }
    words
}

/// `--option` without a value.
fn is_bare_option(word: &OsStr) -> bool {
    let word = word.to_string_lossy();
    let name = word.strip_prefix("--");
    name.is_some_and(|name| !name.is_empty() && !name.contains('='))
}

/// Ends the program with help or version, or with the error in the words that requests by name get too.
fn end(e: &clap::Error) -> ! {
    if !e.use_stderr() || e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        e.exit();
    }
    let is_incomplete = e.kind() == ErrorKind::MissingRequiredArgument;
    let help = is_incomplete.then(|| "--help shows usage and examples".to_owned());
    let failure = Failure::usage(e).or_hint_if(help);
    Session::default().failure(&failure);
    std::process::exit(failure.code().into())
}

/// Does what the arguments of the process ask for.
#[must_use]
pub fn main() -> ExitCode {
    run(std::env::args_os()).into()
}

/// Parses a command line, the program first, does what it asks for and returns the exit code. Once a process: what is wrong with
/// the words, and Ctrl-C, end the process itself.
#[must_use]
pub fn run(given: impl IntoIterator<Item = OsString>) -> u8 {
    let given: Vec<OsString> = given.into_iter().collect();
    let lossy = |all: &[OsString]| -> Vec<String> {
        all.iter()
            .map(|w| w.to_string_lossy().into_owned())
            .collect()
    };
    let session = |common: &Common| Session {
        common: common.clone(),
        given: lossy(&given),
        ..Session::default()
    };
    if given.len() < 2 {
        let _ = writeln!(std::io::stderr(), "{OVERVIEW}");
        return 2;
    }
    let words = words(given.iter().cloned());
    let known = command().version(&*version::version(&lossy(&words)).leak());
    let matches = known
        .try_get_matches_from(&words)
        .unwrap_or_else(|e| end(&e));
    let Cli { common, command } = Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    if !command.heeds_signals() {
        interrupt::watch(session(&common), command.advice_at_signals());
    }
    let threads = common.threads.map_or(0, usize::from); // 0: one per core
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global();
    let outcome = pool
        .map_err(Failure::could_not)
        .and_then(|()| command.run(session(&common)));
    interrupt::settle();
    match outcome {
        Ok(()) => 0,
        Err(failure) => {
            let code = failure.code();
            let failure = failure.for_options(|option| has_option(&matches, option));
            session(&common).failure(&failure);
            code
        }
    }
}

/// True if the command of some words has an option.
fn has_option(mut words: &ArgMatches, option: &str) -> bool {
    let mut known = command();
    while let Some((name, inner)) = words.subcommand() {
        known = known.find_subcommand(name).cloned().unwrap_or_default();
        words = inner;
    }
    let mut options = known.get_arguments().filter_map(|a| a.get_long());
    options.any(|long| long == option)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::command().debug_assert();
    }

    #[test]
    fn negative_numbers_belong_to_the_option_before_them() {
        let joined = |text: &str| {
            let words = super::words(text.split(' ').map(Into::into));
            words
                .iter()
                .map(|w| w.to_string_lossy().into_owned())
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(
            joined("run --seed -1 --outage -5:3 -v"),
            "run --seed=-1 --outage=-5:3 -v"
        );
        assert_eq!(
            joined("run a --p95-m=3 -.5 -- -3"),
            "run a --p95-m=3 -.5 -- -3"
        );
    }
}
