//! The command line: one file per subcommand, each its `Args` and a `run`.

mod exit;
mod printer;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

pub(crate) use exit::Failure;
pub(crate) use printer::Printer;

/// INS/GNSS navigation simulator with a robust stochastic-calibration front end.
#[derive(Parser)]
#[command(name = "nav-sim", version, arg_required_else_help = true)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

/// Flags that mean the same in every command.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Common {
    /// Seed of all random numbers; without it one is drawn, printed and recorded
    #[arg(long, global = true, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Worker threads (default: one per core)
    #[arg(long, short = 'j', global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
    /// Say only errors
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Say more
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// No progress bars
    #[arg(long, global = true)]
    pub(crate) no_progress: bool,
    /// Colour
    #[arg(long, global = true, value_enum, default_value_t)]
    pub(crate) color: Color,
    /// Format of what goes to stdout
    #[arg(long, global = true, value_enum, default_value_t)]
    pub(crate) format: Format,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Color {
    #[default]
    Auto,
    Always,
    Never,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Format {
    #[default]
    Text,
    Json,
}

#[derive(Subcommand, Debug)]
enum Command {}

pub(crate) fn main() -> ExitCode {
    let cli = Cli::parse();
    let _printer = Printer::new(&cli.common);
    let outcome: Result<(), Failure> = match cli.command {};
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
