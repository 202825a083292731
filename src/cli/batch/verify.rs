//! `nav-sim batch verify`: finished units computed again and compared.

use super::Place;
use super::inputs::Inputs;
use super::run::compute;
use crate::cli::{Failure, Session};
use nav_sim::batch::Unit;
use nav_sim::data::{batch_directory, unit_file};
use nav_sim::rng::StreamKey;
use rand::seq::IndexedRandom;

/// Compute some finished units again and compare them bit by bit
///
/// Which ones is drawn with --seed. Exit code 3 if any differs.
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
    /// How many
    #[arg(long, value_name = "K", default_value_t = 3)]
    units: usize,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    // --seed draws the units here
    let planned = args.place.planned(None)?;
    planned.same_numbers()?;
    let there = batch_directory::units(&planned.directory)?;
    let done: Vec<(Unit, String)> =
        planned.plan.named_units(&planned.grid).filter(|(_, id)| there.contains(id)).collect();
    if done.is_empty() {
        return Err(Failure::input("no unit is done yet").hint("see `nav-sim batch run`"));
    }
    let seed = session.seed(None);
    let key = StreamKey { seed, scenario: "", run: 0, source: "batch.verify", process: "units" };
    let mut chosen: Vec<&(Unit, String)> = done.sample(&mut key.generator(), args.units).collect();
    chosen.sort_by_key(|(unit, _)| unit.index);
    let mut inputs = Inputs::new(&planned, &args.place.study, session);
    let progress = session.progress("runs", chosen.iter().map(|(unit, _)| unit.runs).sum());
    let mut different = Vec::new();
    for (unit, id) in &chosen {
        let found = unit_file::read(&planned.directory, id).map_err(Failure::could_not)?;
        let cell = planned.grid.cell(unit.cell);
        let again = inputs.with_cell(cell, |simulation| {
            Ok(compute(&planned.plan, simulation, *unit, id, &|| true, &|n| progress.add(n)))
        })?;
        if again.is_none_or(|again| unit_file::encode(&again) != unit_file::encode(&found)) {
            different.push(format!("{id} ({})", planned.grid.names(cell).join(", ")));
        }
    }
    drop(progress);
    if different.is_empty() {
        session.printer.result(&format!(
            "{} of {} finished units computed again: the same bits",
            chosen.len(),
            done.len()
        ));
        return Ok(());
    }
    let failure = Failure::bound(format!("{} units differ: {}", different.len(), different.join("; ")));
    Err(failure.hint("remove these files and run again; if they still differ, machines or builds do"))
}
