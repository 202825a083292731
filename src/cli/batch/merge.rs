//! `nav-sim batch merge`: units to tables.

use super::Place;
use crate::cli::{Failure, Session};
use crate::report::WIDTH;
use crate::study::{self, MergeOptions, NamedUnit, Planned, StudyError, Unit};
use serde_json::json;

/// Write the tables of a finished study: outages, ratios to the reference, epochs, runs
///
/// Writes results/ in the directory of the study: outages.csv and .json (one row for each outage of each candidate in
/// each cell), runs.csv, epochs.csv if the study asks for it, report.html. The
/// bytes depend on the plan alone, not on how it was run. Ratios are taken within a filter: column `reference`
/// names the candidate they refer to, in the row's own filter. Nothing is written while units are missing: they
/// are listed with --verbose or --format json, and the exit code is 1.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --seed 1 \\
      && nav-sim batch run examples/quick_study.toml
  nav-sim batch merge examples/quick_study.toml
  nav-sim batch merge examples/quick_study.toml --state all --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    place: Place,
    /// States in the tables (repeatable), or "all"; the files have all
    #[arg(long = "state", value_name = "STATE", default_values = ["pos_e_m", "roll_deg"])]
    states: Vec<String>,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let states = crate::commands::compare::states(&args.states)?;
    let planned = args.place.planned(session.asked_seed())?;
    let options = MergeOptions {
        states,
        threads: session.threads(),
    };
    let merged = study::merge(&planned, &options, &session.context()).map_err(|e| match e {
        StudyError::Incomplete { units, missing } => {
            list_missing(&planned, units, &missing, session);
            incomplete(&planned, units, &missing)
        }
        e => e.into(),
    })?;
    let document = &merged.document;
    let text = || {
        if session.verbose() {
            document.verbose(WIDTH)
        } else {
            document.terminal(WIDTH)
        }
    };
    session.show(|| merged.summary.to_string(), text);
    document
        .spoken(session.verbose())
        .for_each(|note| session.say(&note.text));
    session.wrote(&merged.results);
    if merged.diverged == 0 {
        return Ok(());
    }
    let failure = Failure::bound(format!("{} runs diverged", merged.diverged));
    Err(failure.hint("they are in runs.csv, diverged = 1, and in no other number"))
}

/// Units that are missing or damaged, all of them on stdout as JSON or with --verbose.
fn list_missing(planned: &Planned, units: usize, missing: &[NamedUnit], session: &Session) {
    let cell = |unit: &Unit| planned.grid.names(planned.grid.cell(unit.cell));
    if session.json() {
        let json_of_unit = |(unit, id): &NamedUnit| {
            let runs = [unit.first, unit.first + unit.runs];
            json!({ "unit": id, "index": unit.index, "cell": cell(unit), "runs": runs })
        };
        let missing: Vec<serde_json::Value> = missing.iter().map(json_of_unit).collect();
        let json = json!({
            "schema_version": 1, "plan": planned.plan.id(), "units": units, "missing": missing,
        });
        session.result(json);
    }
    for (unit, id) in missing {
        let (name, last) = (cell(unit).join(", "), unit.first + unit.runs - 1);
        session.detail(format!("{id}: {name}, runs {} to {last}", unit.first));
    }
}

fn incomplete(planned: &Planned, units: usize, missing: &[NamedUnit]) -> Failure {
    const NAMED: usize = 6;
    let mut cells: Vec<String> = missing
        .iter()
        .map(|(unit, _)| planned.grid.short_name(planned.grid.cell(unit.cell)))
        .collect();
    cells.dedup();
    let more = if cells.len() > NAMED {
        format!(" and {} more", cells.len() - NAMED)
    } else {
        String::new()
    };
    cells.truncate(NAMED);
    let message = format!(
        "{} of {units} units are missing or damaged, of the cells {}{more}",
        missing.len(),
        cells.join("; ")
    );
    Failure::could_not(message)
        .hint("`nav-sim batch run` computes them; --verbose lists them; nothing was written")
}
