//! `nav-sim batch status`: what is done and what is left.

use super::{Place, duration};
use crate::cli::{Failure, Session};
use serde_json::json;

/// Say what is done of a study and what is left
///
/// Every unit file is read. A damaged one counts as not done, and `run` computes it again.
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
    planned.inputs_unchanged()?;
    let status = planned.status()?;
    let (plan, grid) = (&planned.plan, &planned.grid);
    if session.json() {
        let json = json!({
            "schema_version": 1, "plan": plan.id(), "cells": grid.len(), "cells_done": status.cells_done,
            "units": status.units, "done": status.done, "damaged": status.damaged, "foreign": status.foreign.len(),
            "processor_s_left": status.left_s,
        });
        session.result(json);
        return Ok(());
    }
    if status.damaged > 0 {
        session.warn(format!(
            "damaged unit files: {}; `nav-sim batch run` computes them again",
            status.damaged
        ));
    }
    session.result(format!(
        "{} of {} units done, {} of {} cells complete; about {} left on {} threads",
        status.done,
        status.units,
        status.cells_done,
        grid.len(),
        duration(status.left_s / plan.estimate.threads.max(1) as f64),
        plan.estimate.threads
    ));
    Ok(planned.remark_foreign(&session.context())?)
}
