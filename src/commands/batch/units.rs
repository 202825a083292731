//! Units of work: a block of runs of the cells that share their noise. Each is written whole, by rename, so that processes
//! may be killed, repeated and run beside one another.

use super::cells::Cell;
use crate::app::{Answer, Context, Failure, Front, Manifest, Result};
use crate::commands::run::{PreparedRun, block_of, columns};
use crate::io::atomic;
use nav_sim_document::{Importance, Note};
use nav_sim_navigation::simulation::RunResult;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// A block of runs of cells that share a pass.
pub(crate) struct Unit<'a> {
    pub cells: Vec<&'a Cell>,
    pub first: u64,
    pub runs: u64,
    /// Runs of a cell: of one block, or of several.
    whole: bool,
}

impl Unit<'_> {
    /// Its size, for shards and the estimate of time.
    pub(crate) fn cost(&self) -> u64 {
        self.runs * self.cells.len() as u64
    }
}

/// The directory of a study.
pub(crate) struct Place<'a>(pub &'a Path);

impl Place<'_> {
    pub(crate) fn cell(&self, name: &str) -> PathBuf {
        self.0.join("cells").join(name)
    }

    /// The manifest of a cell that is there.
    pub(crate) fn manifest(&self, name: &str) -> Option<Manifest> {
        let text = fs::read_to_string(self.cell(name).join("manifest.json")).ok()?;
        serde_json::from_str(&text).ok()
    }

    pub(crate) fn is_done(&self, cell: &Cell) -> bool {
        self.manifest(&cell.name)
            .is_some_and(|there| there.key == cell.manifest.key)
    }

    fn part(&self, cell: &Cell, first: u64) -> PathBuf {
        self.0
            .join("parts")
            .join(&cell.manifest.key[..32])
            .join(format!("{first}.part"))
    }

    fn has(&self, unit: &Unit<'_>, cell: &Cell) -> bool {
        self.is_done(cell) || (!unit.whole && read_part(&self.part(cell, unit.first)).is_some())
    }

    /// Whether nothing of a unit is missing.
    pub(crate) fn has_unit(&self, unit: &Unit<'_>) -> bool {
        unit.cells.iter().all(|cell| self.has(unit, cell))
    }

    /// The lock of a unit, which the kernel frees when its process ends; none where another process works on it. Without
    /// locks (some shared disks) both compute the same bytes.
    fn lock(&self, unit: &Unit<'_>) -> Result<Option<File>> {
        let locks = self.0.join("locks");
        let path = locks.join(format!("{}-{}", &unit.cells[0].noise[..32], unit.first));
        let made = fs::create_dir_all(&locks).and_then(|()| File::create(&path));
        let file = made.map_err(|e| Failure::io(&path, e))?;
        Ok(match file.try_lock() {
            Err(fs::TryLockError::WouldBlock) => None,
            _ => Some(file),
        })
    }
}

/// All units, passes in the order of their first cells.
pub(crate) fn units<'a>(cells: &'a [Cell], context: &Context<'_>) -> Result<Vec<Unit<'a>>> {
    let mut passes: Vec<Vec<&Cell>> = Vec::new();
    let mut places: HashMap<&str, usize> = HashMap::new();
    for cell in cells {
        let place = *places.entry(&cell.noise).or_insert(passes.len());
        if place == passes.len() {
            passes.push(Vec::new());
        }
        passes[place].push(cell);
    }
    let mut blocks: BTreeMap<PathBuf, u64> = BTreeMap::new();
    let mut units = Vec::new();
    for pass in passes {
        let (request, runs) = (&pass[0].asked.request, pass[0].runs);
        let block = match blocks.get(&request.trajectory) {
            Some(block) => *block,
            None => block_of(request, context)?,
        };
        blocks.insert(request.trajectory.clone(), block);
        let unit = |first| Unit {
            cells: pass.clone(),
            first,
            runs: block.min(runs - first),
            whole: runs <= block,
        };
        units.extend((0..runs.max(1)).step_by(block as usize).map(unit));
    }
    Ok(units)
}

/// Units of shard `index` of `count`: contiguous, of equal cost.
pub(crate) fn shard<'a, 'b>(
    units: &'b [Unit<'a>],
    (index, count): (u64, u64),
) -> Vec<&'b Unit<'a>> {
    let total: u64 = units.iter().map(Unit::cost).sum();
    let mut before = 0;
    let mut own = Vec::new();
    for unit in units {
        let middle = 2 * before + unit.cost();
        if u128::from(middle) * u128::from(count) / u128::from(2 * total.max(1))
            == u128::from(index)
        {
            own.push(unit);
        }
        before += unit.cost();
    }
    own
}

/// What a process did.
#[derive(Default)]
pub(crate) struct Worked {
    pub finished: AtomicUsize,
    pub failures: Mutex<Vec<(String, Failure)>>,
}

/// Computes the units that are not there and not in work elsewhere, small ones at once, until the context says stop.
pub(crate) fn work(place: &Place<'_>, own: &[&Unit<'_>], context: &Context<'_>) -> Result<Worked> {
    let (worked, front) = (Worked::default(), OfCells(context, Mutex::default()));
    let todo: Vec<&&Unit<'_>> = own.iter().filter(|unit| !place.has_unit(unit)).collect();
    context.begin("runs", todo.iter().map(|unit| unit.cost()).sum());
    let at_once = |unit: &Unit<'_>| (128 * context.threads() as u64 / unit.runs.max(8)).max(1);
    let mut rest = todo.as_slice();
    while let (Some(first), true) = (rest.first(), context.go_on()) {
        let (now, later) = rest.split_at(rest.len().min(at_once(first) as usize));
        now.par_iter()
            .try_for_each(|unit| compute(place, unit, &worked, context, &front))?;
        rest = later;
    }
    context.end();
    Ok(worked)
}

/// Computes what is missing of a unit. A cell that cannot be computed is named; others go on.
fn compute(
    place: &Place<'_>,
    unit: &Unit<'_>,
    worked: &Worked,
    context: &Context<'_>,
    front: &OfCells<'_>,
) -> Result<()> {
    let Some(_lock) = place.lock(unit)? else {
        return Ok(());
    };
    let missing: Vec<&Cell> = unit
        .cells
        .iter()
        .copied()
        .filter(|cell| !place.has(unit, cell))
        .collect();
    let failed = |cell: &Cell, failure: Failure| {
        worked
            .failures
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push((cell.name.clone(), failure));
    };
    let contexts: Vec<Context<'_>> = missing.iter().map(|cell| context_of(cell, front)).collect();
    let mut prepared = Vec::new();
    for (cell, context) in missing.iter().zip(&contexts) {
        match cell.asked.request.prepare(context) {
            Ok(run) => prepared.push((*cell, run, context)),
            Err(failure) => failed(cell, failure),
        }
    }
    while !prepared.is_empty() {
        // turn-on biases that models state make other noise of cells that asked for the same
        let first = prepared.remove(0);
        let (mut pass, rest): (Vec<_>, Vec<_>) = prepared
            .into_iter()
            .partition(|(_, run, _)| run.shares_noise_with(&first.1));
        prepared = rest;
        pass.insert(0, first);
        let runs: Vec<&PreparedRun<'_>> = pass.iter().map(|(_, run, _)| run).collect();
        let results = match columns(&runs, unit.first, unit.runs, context) {
            Ok(Some(results)) => results,
            Ok(None) => return Ok(()),
            Err(failure) => {
                pass.iter()
                    .for_each(|(cell, _, _)| failed(cell, failure.clone()));
                continue;
            }
        };
        for ((cell, run, context), result) in pass.into_iter().zip(results) {
            if unit.whole {
                if let Err(failure) = write_cell(place, cell, run, result, context) {
                    if failure.code() == 1 && failure.file().is_some() {
                        return Err(failure);
                    }
                    failed(cell, failure);
                }
            } else if let Some(result) = result {
                write_part(&place.part(cell, unit.first), &result)?;
            }
            worked.finished.fetch_add(1, Ordering::Relaxed);
        }
    }
    Ok(())
}

/// Passes each warning of the cells on once; what they remark is for `--verbose`.
struct OfCells<'a>(pub &'a Context<'a>, pub Mutex<HashSet<String>>);

impl Front for OfCells<'_> {
    fn note(&self, note: Note) {
        let Note { importance, text } = note;
        if importance != Importance::Warning {
            self.0.detail(text);
        } else if self
            .1
            .lock()
            .is_ok_and(|mut seen| seen.insert(text.clone()))
        {
            self.0.warn(text);
        }
    }
}

fn context_of<'a>(cell: &Cell, front: &'a OfCells<'_>) -> Context<'a> {
    Context::new(front, Some(cell.seed)).reading(cell.manifest.inputs.clone())
}

/// Finishes a cell whose runs are all there and writes its directory.
fn write_cell(
    place: &Place<'_>,
    cell: &Cell,
    run: PreparedRun<'_>,
    result: Option<RunResult>,
    context: &Context<'_>,
) -> Result<()> {
    let answer = run.navigate(result, context)?;
    let mut asked = cell.asked.clone();
    asked.out = Some(place.cell(&cell.name));
    let written = asked.write(&answer, &answer.document(), cell.manifest.clone(), context);
    match written {
        // another process has written the same meanwhile
        Err(_) if place.is_done(cell) => Ok(()),
        written => written.map(drop),
    }
}

/// Puts the parts of a cell together, where all are there.
pub(crate) fn assemble(
    place: &Place<'_>,
    cell: &Cell,
    firsts: &[u64],
    context: &Context<'_>,
) -> Result<()> {
    if place.is_done(cell) {
        return Ok(());
    }
    let mut whole: Option<RunResult> = None;
    for first in firsts {
        let Some(part) = read_part(&place.part(cell, *first)) else {
            return Ok(());
        };
        match &mut whole {
            Some(whole) => whole.append(part),
            None => whole = Some(part),
        }
    }
    let front = OfCells(context, Mutex::default());
    let context = context_of(cell, &front);
    let run = cell.asked.request.prepare(&context)?;
    write_cell(place, cell, run, whole, &context)?;
    if let Some(parts) = place.part(cell, 0).parent() {
        drop(fs::remove_dir_all(parts));
        // empty after the last
        drop(fs::remove_dir(place.0.join("parts")));
    }
    Ok(())
}

/// The runs of a part: postcard of the result, BLAKE3 of that.
fn write_part(path: &Path, result: &RunResult) -> Result<()> {
    let mut bytes = postcard::to_allocvec(result).map_err(Failure::could_not)?;
    let hash = blake3::hash(&bytes);
    bytes.extend(hash.as_bytes());
    match atomic::write(path, bytes) {
        Err(_) if read_part(path).is_some() => Ok(()),
        written => Ok(written?),
    }
}

/// The runs of a part, if it is there and whole.
fn read_part(path: &Path) -> Option<RunResult> {
    part_of(&fs::read(path).ok()?)
}

/// A part from its bytes, if they are whole.
pub(crate) fn part_of(bytes: &[u8]) -> Option<RunResult> {
    let (content, hash) = bytes.split_at_checked(bytes.len().checked_sub(blake3::OUT_LEN)?)?;
    let is_whole = blake3::hash(content).as_bytes() == hash;
    is_whole
        .then(|| postcard::from_bytes(content).ok())
        .flatten()
}
