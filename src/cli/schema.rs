//! `nav-sim schema`: JSON schemas of the files people write.

use super::{Failure, Session};
use nav_sim::batch::Study;
use nav_sim::scenario::Scenario;

/// Print the JSON schema of a scenario or study file, for editors and checkers
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim schema scenario
  nav-sim schema scenario > scenario.schema.json
  nav-sim schema study | grep -c description")]
pub(crate) struct Args {
    /// Which file
    #[arg(value_enum)]
    of: Kind,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Kind {
    /// Everything of a run (`nav-sim run --scenario`)
    Scenario,
    /// A grid of experiments (`nav-sim batch`)
    Study,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let schema = match args.of {
        Kind::Scenario => schemars::schema_for!(Scenario),
        Kind::Study => schemars::schema_for!(Study),
    };
    let text = serde_json::to_string_pretty(&schema).map_err(Failure::could_not)?;
    session.printer.result(&text);
    Ok(())
}
