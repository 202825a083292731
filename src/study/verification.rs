//! Verifying: finished units computed again and compared.

use super::directory;
use super::failure::StudyError;
use super::inputs::Inputs;
use super::plan::Unit;
use super::planned::Planned;
use super::remark::Remark;
use super::unit::compute;
use super::unit_file;
use crate::observer::Observer;
use nav_sim_signal::rng::StreamKey;
use rand::seq::IndexedRandom;

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
    observer: &dyn Observer<Remark>,
) -> Result<VerifyReport, StudyError> {
    planned.same_numbers()?;
    planned.inputs_unchanged()?;
    let mut inputs = Inputs::new(planned, observer);
    let (whole, damaged) = whole(planned, &mut inputs)?;
    let key =
        StreamKey { seed: options.seed, scenario: "", run: 0, source: "batch.verify", process: "units" };
    let mut chosen: Vec<&Named> = whole.sample(&mut key.generator(), options.units).collect();
    chosen.sort_by_key(|(unit, _)| unit.index);
    observer.begin(chosen.iter().map(|(unit, _)| unit.runs).sum());
    let mut different = Vec::new();
    for (unit, id) in &chosen {
        let found = unit_file::read(&planned.directory, id)?;
        let cell = planned.grid.cell(unit.cell);
        let again = inputs.with_cell(cell, |work| {
            let progress = |runs| observer.advance(runs);
            compute(&planned.plan, work, (*unit, id), &|| true, &progress)
        })?;
        if again.is_none_or(|again| unit_file::encode(&again) != unit_file::encode(&found)) {
            different.push(format!("{id} ({})", planned.grid.names(cell).join(", ")));
        }
    }
    Ok(VerifyReport { whole: whole.len(), compared: chosen.len(), damaged, different })
}

type Named = (Unit, String);

/// The units that are there and whole, and what is wrong with the others.
fn whole(planned: &Planned, inputs: &mut Inputs<'_>) -> Result<(Vec<Named>, Vec<String>), StudyError> {
    let present = directory::units(&planned.directory)?;
    let units = planned.plan.named_units(&planned.grid).filter(|(_, id)| present.contains(id));
    let (mut whole, mut damaged) = (Vec::new(), Vec::new());
    for (unit, id) in units {
        match inputs.finished((unit, &id))? {
            Ok(true) => whole.push((unit, id)),
            Ok(false) => {}
            Err(what) => damaged.push(what),
        }
    }
    if whole.is_empty() && damaged.is_empty() {
        return Err(StudyError::NothingDone);
    }
    Ok((whole, damaged))
}
