//! Running: the units of a shard that are not done yet.

use super::directory;
use super::failure::StudyError;
use super::inputs::{Inputs, Work};
use super::plan::Unit;
use super::planned::Planned;
use super::remark::Remark;
use super::unit::compute;
use super::unit_file;
use crate::observer::Observer;
use nav_sim_navigation::lanes::LANES;
use rayon::prelude::*;

/// Units whose position leaves `index` when divided by `count`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    count: u64,
}

impl Shard {
    /// All units.
    pub(crate) const ALL: Self = Self { index: 0, count: 1 };

    /// One of `count`, from 0.
    #[must_use]
    pub const fn new(index: u64, count: u64) -> Option<Self> {
        if index < count { Some(Self { index, count }) } else { None }
    }

    /// Which of them, and how many there are.
    pub(crate) const fn parts(self) -> (u64, u64) {
        (self.index, self.count)
    }

    /// Whether a unit belongs to it.
    pub(crate) const fn has(self, unit: usize) -> bool {
        unit as u64 % self.count == self.index
    }
}

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
    /// Units of the shard that are left: the observer stopped.
    pub left: usize,
}

/// Computes the units of a shard that are not there, or damaged. Each appears whole, by rename; when the observer
/// says stop, those at work are dropped (a covariance analysis, which is short, is finished), and the same call goes on
/// later. Any number of processes may work at once.
///
/// # Errors
/// When the plan is of another build, an input has changed, or a unit cannot be written.
pub fn run(
    planned: &Planned,
    options: &RunOptions,
    observer: &dyn Observer<Remark>,
) -> Result<RunReport, StudyError> {
    planned.same_numbers()?;
    planned.inputs_unchanged()?;
    if let Some(remark) = planned.foreign_units(&planned.status()?) {
        observer.remark(&remark);
    }
    let mut inputs = Inputs::new(planned, observer);
    let pending = pending(planned, options.shard, &mut inputs, observer)?;
    observer.begin(pending.iter().map(|(unit, _)| unit.runs).sum());
    let mut finished = 0;
    for of_cell in pending.chunk_by(|a, b| a.0.cell == b.0.cell) {
        if !observer.go_on() {
            break;
        }
        let cell = planned.grid.cell(of_cell[0].0.cell);
        inputs.with_cell(cell, |work| {
            for together in of_cell.chunks(at_once(of_cell, options.threads)) {
                finished += run_units(planned, work, together, observer)?;
            }
            Ok(())
        })?;
    }
    Ok(RunReport { finished, left: pending.len() - finished })
}

type Named = (Unit, String);

/// The units of a shard that are not there, or damaged.
fn pending(
    planned: &Planned,
    shard: Shard,
    inputs: &mut Inputs<'_>,
    observer: &dyn Observer<Remark>,
) -> Result<Vec<Named>, StudyError> {
    let names = directory::units(&planned.directory)?;
    let mine = planned.plan.named_units(&planned.grid).filter(|(unit, _)| shard.has(unit.index));
    let (mut pending, mut done) = (Vec::new(), 0_usize);
    for (unit, id) in mine {
        // Without the unit's file its trajectory need not be read yet.
        let found = if names.contains(&id) { inputs.finished((unit, &id))? } else { Ok(false) };
        match found {
            Ok(true) => done += 1,
            Ok(false) => pending.push((unit, id)),
            Err(what) => {
                observer.remark(&Remark::DamagedUnit { what });
                pending.push((unit, id));
            }
        }
    }
    if done > 0 {
        observer.remark(&Remark::DoneAlready { done, pending: pending.len() });
    }
    Ok(pending)
}

/// How many units are computed at once: more than one where each has too few batches for the threads.
fn at_once(units: &[Named], threads: usize) -> usize {
    let batches = units[0].0.runs.div_ceil(LANES as u64) as usize;
    (16 * threads / batches).max(1)
}

/// Computes and writes units of one cell; how many were finished.
fn run_units(
    planned: &Planned,
    work: &Work<'_>,
    units: &[Named],
    observer: &dyn Observer<Remark>,
) -> Result<usize, StudyError> {
    let run_one = |(unit, id): &Named| -> Result<bool, StudyError> {
        let (go_on, progress) = (|| observer.go_on(), |runs| observer.advance(runs));
        match compute(&planned.plan, work, (*unit, id), &go_on, &progress)? {
            Some(result) => Ok(unit_file::write(&planned.directory, &result).map(|()| true)?),
            None => Ok(false),
        }
    };
    let outcomes: Vec<Result<bool, StudyError>> = units.par_iter().map(run_one).collect();
    let mut finished = 0;
    for outcome in outcomes {
        finished += usize::from(outcome?);
    }
    Ok(finished)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_share_out_the_units() {
        assert_eq!((Shard::new(3, 3), Shard::new(0, 0)), (None, None));
        for unit in 0..20 {
            assert_eq!((0..3).filter(|i| Shard::new(*i, 3).unwrap().has(unit)).count(), 1);
        }
    }
}
