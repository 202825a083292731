//! `nav-sim batch verify`: finished units computed again and compared.

use super::inputs::{Inputs, finished};
use super::run::compute;
use super::{Place, Planned};
use crate::cli::{Failure, Session};
use nav_sim::formats::{study_directory, unit_file};
use nav_sim::rng::StreamKey;
use nav_sim::study::Unit;
use rand::seq::IndexedRandom;

/// Compute some finished units again and compare them bit by bit
///
/// Which ones is drawn with --seed. All finished units are read first, and damaged ones listed. Exit code 3 if
/// any is damaged or differs.
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
    #[arg(long, value_name = "K", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    units: u64,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    // --seed draws the units here
    let planned = args.place.planned(None)?;
    planned.same_numbers()?;
    let there = study_directory::units(&planned.directory)?;
    let done: Vec<Named> =
        planned.plan.named_units(&planned.grid).filter(|(_, id)| there.contains(id)).collect();
    if done.is_empty() {
        return Err(Failure::input("no unit is done yet").hint("see `nav-sim batch run`"));
    }
    let mut inputs = Inputs::new(&planned, &args.place.study, session);
    let (done, damaged) = whole(&planned, done, &mut inputs)?;
    let seed = session.seed(None);
    let key = StreamKey { seed, scenario: "", run: 0, source: "batch.verify", process: "units" };
    let amount = usize::try_from(args.units).unwrap_or(usize::MAX);
    let mut chosen: Vec<&Named> = done.sample(&mut key.generator(), amount).collect();
    chosen.sort_by_key(|(unit, _)| unit.index);
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
    if different.is_empty() && damaged.is_empty() {
        session.printer.result(&format!(
            "{} of {} finished units computed again: the same bits",
            chosen.len(),
            done.len()
        ));
        return Ok(());
    }
    let listed = |what: &str, units: &[String]| match units.len() {
        0 => None,
        n => Some(format!("{n} units {what}: {}", units.join("; "))),
    };
    let found = [listed("are damaged", &damaged), listed("differ", &different)];
    let failure = Failure::bound(found.into_iter().flatten().collect::<Vec<_>>().join("\n"));
    Err(failure.hint(if different.is_empty() {
        "`nav-sim batch run` computes them again"
    } else {
        "remove these files and run again; if they still differ, machines or builds do"
    }))
}

type Named = (Unit, String);

/// The units that are whole, and what is wrong with the others.
fn whole(
    planned: &Planned,
    units: Vec<Named>,
    inputs: &mut Inputs<'_>,
) -> Result<(Vec<Named>, Vec<String>), Failure> {
    let (mut whole, mut damaged) = (Vec::new(), Vec::new());
    for (unit, id) in units {
        match finished(planned, (unit, &id), inputs)? {
            Ok(true) => whole.push((unit, id)),
            Ok(false) => {}
            Err(what) => damaged.push(what),
        }
    }
    Ok((whole, damaged))
}
