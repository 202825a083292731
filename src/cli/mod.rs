//! The command line: what is parsed, and small commands; larger ones have files of their own.

pub(crate) use crate::app::Failure;
use crate::app::{Answer, Invocation, Result};
use crate::commands::batch::Study;
use crate::commands::trajectory::{TrajectoryArgs, TrajectoryCommand};
use crate::commands::with_commands;
use crate::io::{contamination_file, file_kind, fusion_files, model_file, trajectory_file};
use clap::builder::Resettable;
use clap::error::{ContextKind, ErrorKind};
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_signal::lanes::Level;
use serde_json::json;
pub(crate) use session::{Common, Session};
use std::env::consts::{ARCH, OS};
use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

mod batch;
mod demo;
mod interrupt;
mod session;

/// INS/GNSS navigation simulator with a robust stochastic-calibration front end.
#[derive(Parser)]
#[command(name = "nav-sim", version)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: CliCommand,
}

macro_rules! driven {
    ($($variant:ident: $command:path),* $(,)?) => {
        /// Commands that answer a question.
        #[derive(Subcommand)]
        enum AnswerCommand {
            $($variant(Invocation<$command>)),*
        }

        impl AnswerCommand {
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
#[expect(clippy::large_enum_variant, reason = "one per process")]
enum CliCommand {
    #[command(flatten)]
    Answer(AnswerCommand),
    Trajectory(TrajectoryArgs),
    Batch(batch::BatchArgs),
    Demo(demo::DemoArgs),
    Init(InitArgs),
    Schema(SchemaArgs),
    Completions(CompletionsArgs),
    Man(ManArgs),
}

impl CliCommand {
    /// True if the command itself ends in good order at a signal.
    const fn handles_signals(&self) -> bool {
        matches!(self, Self::Batch(_))
    }

    /// Advice after a signal.
    fn advice_at_signals(&self) -> Option<String> {
        matches!(self, Self::Demo(_)).then(|| "the same command continues".to_owned())
    }

    fn run(self, session: Session) -> Result<(), Failure> {
        let text = match self {
            CliCommand::Answer(driven) => return driven.run(&session),
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
            Self::Init(args) => init(&args, &session)?,
            Self::Schema(args) => schema(&args),
            Self::Completions(args) => completions(&args),
            Self::Man(args) => man(&args)?,
        };
        session.result(text);
        Ok(())
    }
}

/// Text of `nav-sim` without arguments.
const OVERVIEW: &str = include_str!("overview.txt");
/// Examples that lead the help of each command, in paragraphs headed by its name.
const EXAMPLES: &str = include_str!("examples.txt");

/// The whole command line as clap knows it.
fn command() -> clap::Command {
    with_examples(Cli::command(), "")
}

/// The command line for help: each command with the common options that mean something for it; `--help` (`is_long`) has the whole
/// description and every option, in the layout of `-h`. Without a command named they are listed by their first sentences.
fn documented(is_long: bool, names_command: bool) -> clap::Command {
    let mut command = match (is_long, names_command) {
        (true, true) => in_full(command()),
        (true, false) => command().mut_subcommands(|inner| inner.long_about(Resettable::Reset)),
        (false, _) => command(),
    };
    command.build(); // hands the common options down
    of_use(command, "")
}

/// Puts the whole description and every option into the short help; clap then writes no other.
fn in_full(command: clap::Command) -> clap::Command {
    let command = match command.get_long_about().cloned() {
        Some(about) => command.about(about).long_about(Resettable::Reset),
        None => command,
    };
    let command = command.mut_args(|arg| arg.hide_short_help(false));
    command.mut_subcommands(in_full)
}

/// Hides the common options without a use.
fn of_use(command: clap::Command, names: &str) -> clap::Command {
    let shown = |arg: clap::Arg| {
        let is_of_use = means_something(arg.get_id().as_str(), names);
        if is_of_use { arg } else { arg.hide(true) }
    };
    command.mut_args(shown).mut_subcommands(|inner| {
        let names = format!("{names} {}", inner.get_name());
        of_use(inner, names.trim_start())
    })
}

/// True if a command, by its names below nav-sim, has a use for one of the common options.
fn means_something(option: &str, names: &str) -> bool {
    let is_shell = matches!(names, "init" | "schema" | "completions" | "man" | "help");
    let is_reader = matches!(names, "check" | "inspect" | "trajectory check");
    match option {
        "seed" => matches!(
            names,
            "" | "calibrate"
                | "choose"
                | "demo"
                | "design"
                | "run"
                | "synthesize"
                | "tune"
                | "trajectory"
                | "trajectory record"
        ),
        "no_progress" => matches!(
            names,
            "" | "batch" | "calibrate" | "choose" | "demo" | "run" | "wv"
        ),
        "threads" => {
            !is_shell
                && !is_reader
                && !names.starts_with("trajectory")
                && !matches!(names, "datasheet" | "export")
        }
        "force" => !is_shell && !is_reader,
        "format" => !is_shell,
        _ => true,
    }
}

/// Adds the examples of a command, by its names below nav-sim, and of those under it.
fn with_examples(command: clap::Command, names: &str) -> clap::Command {
    let examples = EXAMPLES
        .split("\n\n")
        .filter_map(|paragraph| paragraph.split_once('\n'))
        .find(|(head, _)| *head == names);
    let command = match examples {
        Some((_, lines)) => command.before_help(format!("Examples:\n{}", lines.trim_end())),
        None => command,
    };
    command.mut_subcommands(|inner| {
        let names = format!("{names} {}", inner.get_name());
        with_examples(inner, names.trim_start())
    })
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
    let is_lost = matches!(
        e.kind(),
        ErrorKind::MissingRequiredArgument | ErrorKind::UnknownArgument
    );
    let help = is_lost.then(|| "--help shows usage and examples".to_owned());
    let mut failure = Failure::usage(e).or_hint_if(help);
    // a file too many: what it holds, and what takes it
    if let (ErrorKind::UnknownArgument, Some(word)) = (e.kind(), e.get(ContextKind::InvalidArg)) {
        let path = PathBuf::from(word.to_string());
        if path.is_file() {
            failure = file_kind::or_wrong_kind(&[], &path, failure);
        }
    }
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
        let _ = write!(std::io::stderr(), "{OVERVIEW}");
        return 2;
    }
    let words = words(given.iter().cloned());
    let has = |flags: &[&str]| {
        words
            .iter()
            .any(|word| flags.iter().any(|flag| word == flag))
    };
    let is_long = has(&["--help"]) || words.get(1).is_some_and(|word| word == "help");
    let known = if is_long || has(&["-h"]) {
        let all = command();
        let is_command = |word: &OsString| {
            word.to_str()
                .is_some_and(|w| all.find_subcommand(w).is_some())
        };
        documented(is_long, words.iter().skip(1).any(is_command))
    } else {
        command()
    };
    let known = known.long_version(&*version().leak());
    let matches = known
        .try_get_matches_from(&words)
        .unwrap_or_else(|e| end(&e));
    let Cli { common, command } = Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
    if !command.handles_signals() {
        interrupt::watch(session(&common), command.advice_at_signals());
    }
    let threads = common.threads.map_or(0, usize::from); // 0: one per core
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global();
    let outcome = pool
        .map_err(Failure::failed)
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

// `nav-sim completions`: completion scripts for shells.

/// Print a completion script for a shell
#[derive(clap::Args)]
struct CompletionsArgs {
    /// Which shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

fn completions(args: &CompletionsArgs) -> String {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command(), "nav-sim", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

// `nav-sim man`: manual pages.

/// Print the manual page of a command (without a name: of nav-sim itself)
#[derive(clap::Args)]
struct ManArgs {
    /// Which command
    command: Option<String>,
}

fn man(args: &ManArgs) -> Result<String, Failure> {
    let mut page = Vec::new();
    let root = documented(true, true);
    let of_command = match &args.command {
        None => root,
        Some(name) => {
            let names = root.get_subcommands().map(clap::Command::get_name);
            let known = names.collect::<Vec<_>>().join(", ");
            let found = root.find_subcommand(name).cloned();
            let unknown = format!("no command is named \"{name}\"");
            let found = found.ok_or_else(|| Failure::input(unknown).hint(known))?;
            found.display_name(format!("nav-sim-{name}"))
        }
    };
    clap_mangen::Man::new(of_command)
        .render(&mut page)
        .map_err(Failure::failed)?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}

// `nav-sim schema`: JSON schemas of the files people write.

/// Print the JSON schema of a file that people write, for editors and checkers
#[derive(clap::Args)]
struct SchemaArgs {
    /// Which file
    #[arg(value_enum)]
    of: SchemaKind,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum SchemaKind {
    /// All settings of a run (`nav-sim run --scenario`)
    Scenario,
    /// A grid of experiments (`nav-sim batch`)
    Study,
    /// A noise model (what `nav-sim calibrate` writes)
    Model,
    /// Initial state of a drive (`nav-sim fuse --initial`)
    Initial,
    /// A trajectory by what the vehicle does (`nav-sim run`)
    Profile,
    /// Errors put into recordings (`nav-sim synthesize --contaminate`)
    Contamination,
}

fn schema(args: &SchemaArgs) -> String {
    crate::report::json(&schema_of(args.of))
}

fn schema_of(of: SchemaKind) -> serde_json::Value {
    match of {
        SchemaKind::Scenario => schemars::schema_for!(Scenario).to_value(),
        SchemaKind::Study => schemars::schema_for!(Study).to_value(),
        SchemaKind::Model => model_file::schema(),
        SchemaKind::Initial => fusion_files::initial_schema(),
        SchemaKind::Profile => trajectory_file::profile_schema(),
        SchemaKind::Contamination => contamination_file::schema(),
    }
}

#[cfg(test)]
#[path = "schema_tests.rs"]
mod schema_tests;

// `nav-sim init`: a directory to start from.

/// Make a directory with everything to start from: a commented file of every kind, trajectories, virtual IMUs
///
/// scenario.toml, imu.toml, motion.toml, contamination.toml, initial.toml and examples/quick_study.toml say
/// what each key means. Editors take the schemas from schemas/. The others are those of the repository; the examples of
/// every --help work inside the directory. Files
/// that exist already are left alone.
#[derive(clap::Args)]
struct InitArgs {
    /// Directory
    #[arg(value_name = "DIR", default_value = ".")]
    directory: PathBuf,
}

fn init(args: &InitArgs, session: &Session) -> Result<String, Failure> {
    let schema = |of: &SchemaKind| {
        let name = of.to_possible_value()?.get_name().to_owned();
        Some((name, crate::report::json(&schema_of(*of))))
    };
    let schemas: Vec<_> = SchemaKind::value_variants()
        .iter()
        .filter_map(schema)
        .collect();
    let (written, kept) = crate::init::write_start_files(&args.directory, &schemas)?;
    for path in &kept {
        session.say(format!("kept {path}"));
    }
    Ok(match session.is_json() {
        true => json!({ "schema_version": 1, "written": written, "kept": kept }).to_string(),
        false => written.join("\n"),
    })
}

// Runs a command on a terminal: claims outputs, runs, shows, writes.

/// Does a command.
fn drive<C: crate::app::Command>(asked: &Invocation<C>, session: &Session) -> Result<()> {
    let mut manifest = asked.manifest(session.common.seed)?;
    manifest.command.clone_from(&session.given);
    let claims = asked.claim(&manifest, session.common.force)?;
    let context = session.context().reading(manifest.inputs.clone());
    let context = context.writing(asked.out.clone());
    context.warn_each(claims.warning());
    let answer = asked.request.run(&context)?;
    let document = answer.document();
    let file = answer.files().into_iter().next();
    let text = file.filter(|_| C::PRINTS_FILE).map(|f| match &asked.out {
        Some(_) => String::new(),
        None => f.parts.collect(),
    });
    session.show(&answer, &document, answer.text().or(text));
    let written = asked.write(&answer, &document, manifest, &context)?;
    if !written.is_empty() {
        let names: Vec<_> = written.iter().map(|path| path.to_string_lossy()).collect();
        session.say(format!("wrote {}", names.join(", ")));
    }
    answer.unmet().map_or(Ok(()), Err)
}

/// The version, what this program was built for, and what it uses here (`-V` is the version alone).
fn version() -> String {
    let number = env!("CARGO_PKG_VERSION");
    let either = |is: bool, yes, no| if is { yes } else { no };
    let library = either(cfg!(target_env = "musl"), "musl", "gnu");
    let linked = either(cfg!(target_feature = "crt-static"), "static", "dynamic");
    let profile = either(cfg!(debug_assertions), "debug", "release");
    let level = Level::best();
    let features = match (cfg!(feature = "pictures"), cfg!(feature = "parquet")) {
        (true, true) => "pictures, parquet",
        (true, false) => "pictures",
        (false, true) => "parquet",
        (false, false) => "none",
    };
    format!(
        "{number}\nbuild         {profile}, {ARCH}-{OS}-{library}, {linked}\nvector units  {level}\nfeatures      {features}"
    )
}
