//! `nav-sim batch status`: what is done and what is left.

use super::plan::duration;
use super::{Place, Planned};
use crate::cli::{Failure, Session};
use nav_sim::formats::{study_directory, unit_file};
use nav_sim::study::Unit;
use serde_json::json;

/// What is done of a study and what is left
///
/// Counts unit files by name; whether they are whole is seen by `run` and `merge`.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --seed 1 \\
      && nav-sim batch status examples/quick_study.toml
  nav-sim batch run examples/quick_study.toml --shard 0/2 \\
      && nav-sim batch status examples/quick_study.toml
  nav-sim batch status examples/quick_study.toml --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    place: Place,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let planned = args.place.planned(session.asked_seed())?;
    let count = Count::of(&planned)?;
    let (plan, grid) = (&planned.plan, &planned.grid);
    let wall_s = count.left_s / plan.estimate.threads.max(1) as f64;
    if session.json() {
        let json = json!({
            "schema_version": 1, "plan": plan.id(), "cells": grid.len(), "cells_done": count.cells_done,
            "units": count.units, "done": count.done, "foreign": count.foreign.len(),
            "processor_s_left": count.left_s,
        });
        session.printer.result(&json.to_string());
        return Ok(());
    }
    session.printer.result(&format!(
        "{} of {} units done, {} of {} cells complete; about {} left on {} threads",
        count.done,
        count.units,
        count.cells_done,
        grid.len(),
        duration(wall_s),
        plan.estimate.threads
    ));
    count.warn_of_foreign(&planned, session);
    Ok(())
}

/// What is there of a plan.
pub(super) struct Count {
    pub(super) units: usize,
    done: usize,
    cells_done: usize,
    left_s: f64,
    /// The units that are not there.
    pub(super) missing: Vec<(Unit, String)>,
    /// Units of another plan.
    foreign: Vec<String>,
}

impl Count {
    pub(super) fn of(planned: &Planned) -> Result<Self, Failure> {
        let mut there = study_directory::units(&planned.directory)?;
        let (plan, grid) = (&planned.plan, &planned.grid);
        let mut count =
            Self { units: 0, done: 0, cells_done: 0, left_s: 0.0, missing: Vec::new(), foreign: Vec::new() };
        let mut cell_whole = true;
        for (unit, id) in plan.named_units(grid) {
            let done = there.remove(&id);
            count.units += 1;
            count.done += usize::from(done);
            cell_whole &= done;
            if !done {
                count.left_s += plan.unit_s(grid, unit);
                count.missing.push((unit, id));
            }
            if unit.first + unit.runs == plan.study.runs {
                count.cells_done += usize::from(cell_whole);
                cell_whole = true;
            }
        }
        count.foreign = there.into_iter().collect();
        Ok(count)
    }

    /// Says how many unit files are not of this plan, and where.
    pub(super) fn warn_of_foreign(&self, planned: &Planned, session: &Session) {
        if let Some(id) = self.foreign.first() {
            let (n, path) = (self.foreign.len(), unit_file::path(&planned.directory, id));
            let path = path.display();
            session.printer.warn(&format!("{n} unit files are of another plan and left out, such as {path}"));
        }
    }
}
