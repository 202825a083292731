//! `nav-sim batch verify`: finished units computed again and compared.

use super::Place;
use crate::cli::{Failure, Session};
use crate::study::{self, VerifyOptions};
use serde_json::json;

/// Compute some finished units again and compare them bit by bit
///
/// The units are drawn with --seed. All finished units are read first, and damaged ones are listed. Exit code 3
/// means that a unit is damaged or differs.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --seed 1 \\
      && nav-sim batch run examples/quick_study.toml
  nav-sim batch verify examples/quick_study.toml
  nav-sim batch verify examples/quick_study.toml --units 1 --seed 7")]
pub(crate) struct Args {
    #[command(flatten)]
    place: Place,
    /// Number of units
    #[arg(long, value_name = "K", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    units: u64,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    // --seed draws the units here
    let planned = args.place.planned(None)?;
    let units = usize::try_from(args.units).unwrap_or(usize::MAX);
    let options = VerifyOptions {
        units,
        seed: session.seed(None),
    };
    let found = study::verify(&planned, &options, &session.context())?;
    if session.json() {
        let json = json!({
            "schema_version": 1, "plan": planned.plan.id(), "whole": found.whole, "compared": found.compared,
            "damaged": found.damaged, "different": found.different,
        });
        session.result(json);
    }
    if found.different.is_empty() && found.damaged.is_empty() {
        if !session.json() {
            session.result(format!(
                "{} of {} finished units computed again: the same bits",
                found.compared, found.whole
            ));
        }
        return Ok(());
    }
    let listed = |what: &str, units: &[String]| match units.len() {
        0 => None,
        n => Some(format!("{n} units {what}: {}", units.join("; "))),
    };
    let lines = [
        listed("are damaged", &found.damaged),
        listed("differ", &found.different),
    ];
    let failure = Failure::bound(lines.into_iter().flatten().collect::<Vec<_>>().join("\n"));
    Err(failure.hint(if found.different.is_empty() {
        "`nav-sim batch run` computes them again"
    } else {
        "remove these files and run again; if they still differ, machines or builds do"
    }))
}
