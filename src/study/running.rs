//! Running the units of a shard that are not done yet, and verifying: units computed again and compared.

use super::failure::StudyError;
use super::inputs::{Inputs, Work};
use super::plan::{NamedUnit, Shard};
use super::planned::{Planned, UnitState};
use super::unit_file;
use crate::app::Context;
use nav_sim_navigation::lanes::LANES;
use nav_sim_signal::rng::StreamKey;
use rand::seq::IndexedRandom;
use rayon::prelude::*;

/// Which units to run, and on how much.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunOptions {
    /// Which part of the plan.
    pub shard: Shard,
    /// Threads that work: units too small for all of them are computed together.
    pub threads: usize,
}

/// What a run did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct RunReport {
    /// Units computed and written.
    pub finished: usize,
    /// Units of the shard that are left: the context stopped.
    pub left: usize,
}

/// Computes the units of a shard that are not there, or damaged. Each appears whole, by rename; when the context
/// says stop, those at work are dropped (a covariance analysis, which is short, is finished), and the same call goes on
/// later. Any number of processes may work at once.
///
/// # Errors
/// When the plan is of another build, an input has changed, or a unit cannot be written.
pub fn run(
    planned: &Planned,
    options: &RunOptions,
    context: &Context<'_>,
) -> Result<RunReport, StudyError> {
    planned.same_numbers()?;
    planned.inputs_unchanged()?;
    planned.remark_foreign(context)?;
    let (mut pending, mut done) = (Vec::new(), 0_usize);
    for (unit, id, state) in planned.survey(options.shard)? {
        match state {
            UnitState::Whole => done += 1,
            UnitState::Missing => pending.push((unit, id)),
            UnitState::Damaged(what) => {
                context.warn(format!("{what}; it is computed again"));
                pending.push((unit, id));
            }
        }
    }
    if done > 0 {
        let text = format!("{done} units are done already, {} to do", pending.len());
        context.remark(text);
    }
    let mut inputs = Inputs::new(planned, &[], context);
    context.begin("runs", pending.iter().map(|(unit, _)| unit.runs).sum());
    let mut finished = 0;
    for of_cell in pending.chunk_by(|a, b| a.0.cell == b.0.cell) {
        if !context.go_on() {
            break;
        }
        let cell = planned.grid.cell(of_cell[0].0.cell);
        inputs.with_cell(cell, |work| {
            for together in of_cell.chunks(at_once(of_cell, options.threads)) {
                finished += run_units(planned, work, together, context)?;
            }
            Ok(())
        })?;
    }
    Ok(RunReport {
        finished,
        left: pending.len() - finished,
    })
}

/// How many units are computed at once: more than one where each has too few batches for the threads.
fn at_once(units: &[NamedUnit], threads: usize) -> usize {
    let batches = units[0].0.runs.div_ceil(LANES as u64) as usize;
    (16 * threads / batches).max(1)
}

/// Computes and writes units of one cell; how many were finished.
fn run_units(
    planned: &Planned,
    work: &Work<'_>,
    units: &[NamedUnit],
    context: &Context<'_>,
) -> Result<usize, StudyError> {
    let run_one = |(unit, id): &NamedUnit| -> Result<usize, StudyError> {
        match work.unit(planned, (*unit, id), context)? {
            Some(result) => Ok(unit_file::write(&planned.directory, &result).map(|()| 1)?),
            None => Ok(0),
        }
    };
    let outcomes: Vec<Result<usize, StudyError>> = units.par_iter().map(run_one).collect();
    outcomes.into_iter().sum()
}

/// Which units to compute again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VerifyOptions {
    /// How many.
    pub units: usize,
    /// Seed that draws them.
    pub seed: u64,
}

/// What verifying found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct VerifyReport {
    /// Units that are there and whole.
    pub whole: usize,
    /// Those of them that were computed again.
    pub compared: usize,
    /// What is wrong with units that are damaged.
    pub damaged: Vec<String>,
    /// Units that differ, with their cells.
    pub different: Vec<String>,
}

/// Reads all finished units, computes some of them again and compares them bit by bit.
///
/// # Errors
/// When no unit is done, the plan is of another build, or an input has changed.
pub fn verify(
    planned: &Planned,
    options: &VerifyOptions,
    context: &Context<'_>,
) -> Result<VerifyReport, StudyError> {
    planned.same_numbers()?;
    planned.inputs_unchanged()?;
    let (mut whole, mut damaged) = (Vec::new(), Vec::new());
    for (unit, id, state) in planned.survey(Shard::ALL)? {
        match state {
            UnitState::Whole => whole.push((unit, id)),
            UnitState::Missing => {}
            UnitState::Damaged(what) => damaged.push(what),
        }
    }
    if whole.is_empty() && damaged.is_empty() {
        return Err(StudyError::NothingDone);
    }
    let key = StreamKey {
        seed: options.seed,
        scenario: "",
        run: 0,
        source: "batch.verify",
        process: "units",
    };
    let mut chosen: Vec<&NamedUnit> = whole.sample(&mut key.generator(), options.units).collect();
    chosen.sort_by_key(|(unit, _)| unit.index);
    context.begin("runs", chosen.iter().map(|(unit, _)| unit.runs).sum());
    let mut inputs = Inputs::new(planned, &[], context);
    let mut different = Vec::new();
    for (unit, id) in &chosen {
        let found = unit_file::read(&planned.directory, id)?;
        let cell = planned.grid.cell(unit.cell);
        let again = inputs.with_cell(cell, |work| work.unit(planned, (*unit, id), context))?;
        let Some(again) = again else { break };
        if unit_file::encode(&again) != unit_file::encode(&found) {
            different.push(format!("{id} ({})", planned.grid.names(cell).join(", ")));
        }
    }
    Ok(VerifyReport {
        whole: whole.len(),
        compared: chosen.len(),
        damaged,
        different,
    })
}
