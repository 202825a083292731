//! `nav-sim schema`: JSON schemas of the files people write.

use crate::commands::batch::Study;
use crate::io::{contamination_file, fusion_files, model_file, trajectory_file};
use nav_sim_navigation::scenario::Scenario;

/// Print the JSON schema of a file that people write, for editors and checkers
#[derive(clap::Args)]
#[command(before_help = "\
Examples:
  nav-sim schema scenario > scenario.schema.json
  nav-sim schema model | grep -c AR1
  nav-sim schema study | grep -c description")]
pub(crate) struct Args {
    /// Which file
    #[arg(value_enum)]
    of: Kind,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Kind {
    /// All settings of a run (`nav-sim run --scenario`)
    Scenario,
    /// A grid of experiments (`nav-sim batch`)
    Study,
    /// A noise model (what `nav-sim calibrate` writes)
    Model,
    /// Where and how a drive begins (`nav-sim fuse --initial`)
    Initial,
    /// A trajectory by what the vehicle does (`nav-sim run`)
    Profile,
    /// Errors put into recordings (`nav-sim synthesize --contaminate`)
    Contamination,
}

pub(crate) fn run(args: &Args) -> String {
    crate::report::json(&schema(args.of))
}

fn schema(of: Kind) -> serde_json::Value {
    match of {
        Kind::Scenario => schemars::schema_for!(Scenario).to_value(),
        Kind::Study => schemars::schema_for!(Study).to_value(),
        Kind::Model => model_file::schema(),
        Kind::Initial => fusion_files::initial_schema(),
        Kind::Profile => trajectory_file::profile_schema(),
        Kind::Contamination => contamination_file::schema(),
    }
}

#[cfg(test)]
mod tests;
