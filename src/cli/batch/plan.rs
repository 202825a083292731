//! `nav-sim batch plan`: inputs checked and hashed, candidates calibrated, units cut.

use super::{Place, duration};
use crate::cli::{Failure, Session};
use crate::study::{self, PlanOptions, Planned, Writing};
use serde_json::json;
use std::time::Instant;

/// Check a study and everything it names, calibrate its candidates, and cut it into units of work
///
/// A probe (eight runs of the first cell) predicts how long the study will take. Units are made to last about two
/// minutes, unless the study states `unit_runs`. The directory then holds plan.json, which names every input by
/// its hash, and models/ calibrated here (planning again restores those that are lost). No unit is computed yet:
/// see `nav-sim batch run`.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim batch plan examples/quick_study.toml --dry-run
  nav-sim batch plan examples/quick_study.toml --seed 1 -o out/quick
  nav-sim batch plan examples/quick_study.toml --dry-run --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    place: Place,
    /// Say how long the study will take; write nothing
    #[arg(long)]
    dry_run: bool,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let directory = args.place.directory();
    let start = Instant::now();
    let options = PlanOptions {
        seed: &|of_study| session.seed(of_study),
        threads: session.threads(),
        clock: Some(&|| start.elapsed().as_secs_f64()),
        writing: if args.dry_run {
            Writing::DryRun
        } else {
            Writing::Write
        },
    };
    let made = study::plan(&args.place.study, &directory, &options, &session.context())?;
    report(&made.planned, session);
    if made.was_there {
        session.say(format!("{} was planned already", directory.display()));
    } else if !args.dry_run {
        session.wrote(&directory.join("plan.json"));
    }
    Ok(())
}

fn report(planned: &Planned, session: &Session) {
    let (plan, grid) = (&planned.plan, &planned.grid);
    let units = plan.unit_count(grid);
    let total_s = planned.processor_s();
    let wall_s = total_s / plan.estimate.threads.max(1) as f64;
    let runs = if plan.study.is_sampled() {
        plan.study.runs
    } else {
        0
    };
    if session.json() {
        let json = json!({
            "schema_version": 1, "plan": plan.id(), "seed": plan.seed, "cells": grid.len(),
            "columns": grid.columns.len(), "method": plan.study.method, "runs": runs, "units": units, "unit_runs": plan.unit_runs,
            "processor_s": total_s, "wall_s": wall_s, "threads": plan.estimate.threads,
            "disk_bytes": plan.estimate.bytes,
        });
        session.result(json);
        return;
    }
    let seed = plan.seed;
    let (work, cut) = match plan.study.is_sampled() {
        true => (
            format!("× {runs} runs"),
            format!(" of {} runs", range(&plan.unit_runs)),
        ),
        false => ("by covariance analysis".to_owned(), String::new()),
    };
    session.result(format!(
        "{} cells × {} columns {work}, seed {seed}: {units} units{cut}\nabout {} on {} threads, {} on disk",
        grid.len(),
        grid.columns.len(),
        duration(wall_s),
        plan.estimate.threads,
        size(plan.estimate.bytes)
    ));
}

fn range(values: &[u64]) -> String {
    match (values.iter().min(), values.iter().max()) {
        (Some(a), Some(b)) if a != b => format!("{a} to {b}"),
        (Some(a), _) => a.to_string(),
        _ => String::new(),
    }
}

fn size(bytes: f64) -> String {
    match bytes {
        b if b < 1e6 => format!("{:.0} kB", (b / 1e3).ceil()),
        b if b < 1e9 => format!("{:.0} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}
