//! The directory of a study: `plan.json`, `models/` calibrated by the plan, `units/`, and `results/`.

use super::description::Study;
use super::failure::StudyError;
use super::plan::{Plan, Unit};
use super::unit_file;
use crate::formats::difference::{self, Difference};
use crate::formats::{FileError, atomic, source};
use crate::report::Input;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn file(directory: &Path) -> PathBuf {
    directory.join("plan.json")
}

/// The plan in a directory, if there is one.
///
/// # Errors
/// When it cannot be read or is not a plan.
pub(crate) fn plan(directory: &Path) -> Result<Option<Plan>, FileError> {
    let path = file(directory);
    let shown = path.display().to_string();
    let text = match source::text(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(FileError::io(&path, e)),
    };
    let damaged = |line: usize, message: String| {
        FileError::contents(shown.as_str(), line, message).advice("remove the directory and plan again")
    };
    let plan: Plan = serde_json::from_str(&text).map_err(|e| {
        damaged(e.line(), e.to_string().split(" at line ").next().unwrap_or_default().to_owned())
    })?;
    let sizes = [plan.unit_runs.len(), plan.trajectories.len()];
    let fits = |files: &Vec<Input>| files.len() == 1 || files.len() == plan.study.truth.len();
    if sizes != [plan.study.trajectory.len(); 2]
        || plan.models.len() != plan.study.candidates().len()
        || !plan.models.iter().all(fits)
    {
        return Err(damaged(1, "its numbers of trajectories and models are not those of its study".into()));
    }
    Ok(Some(plan))
}

/// The plan of a study, which must be the one in the directory. A study without a seed takes the plan's.
///
/// # Errors
/// When there is none, or the study is not the one that was planned, or `seed` is given and not the plan's.
pub(crate) fn plan_of(directory: &Path, study: &Study, seed: Option<u64>) -> Result<Plan, StudyError> {
    let plan = plan(directory)?.ok_or_else(|| StudyError::NoPlan { directory: directory.to_owned() })?;
    same(directory, &plan, study, seed)?;
    Ok(plan)
}

/// Refuses a plan that is not of this study, or has another seed than the one asked for.
///
/// # Errors
/// The key that differs.
pub(crate) fn same(
    directory: &Path,
    plan: &Plan,
    study: &Study,
    seed: Option<u64>,
) -> Result<(), StudyError> {
    let refused = |key: &str, found: String, wanted: String| {
        Err(StudyError::OtherStudy { plan: file(directory), key: key.to_owned(), found, wanted })
    };
    if let Some(seed) = seed.filter(|seed| *seed != plan.seed) {
        return refused("seed", plan.seed.to_string(), seed.to_string());
    }
    let study = Study { seed: study.seed.or(plan.study.seed), ..study.clone() };
    let value = |s: &Study| serde_json::to_value(s).unwrap_or_default();
    let (found, wanted) = (value(&plan.study), value(&study));
    let (Some(found), Some(wanted)) = (found.as_object(), wanted.as_object()) else { return Ok(()) };
    match difference::first(found, wanted) {
        None => Ok(()),
        Some(Difference { key, found, wanted }) => refused(&key, found, wanted),
    }
}

/// Writes a plan where none is.
///
/// # Errors
/// When the directory cannot be written to.
pub(crate) fn write_plan(directory: &Path, plan: &Plan) -> Result<(), FileError> {
    let json = serde_json::to_string_pretty(plan).expect("plain structs are always JSON") + "\n";
    atomic::write(&file(directory), json)
}

/// The names of the units in a directory; whether they are whole is not looked at.
///
/// # Errors
/// When the directory cannot be read.
pub(crate) fn units(directory: &Path) -> Result<BTreeSet<String>, FileError> {
    let top = directory.join("units");
    let mut names = BTreeSet::new();
    for inner in entries(&top)? {
        for path in entries(&inner)? {
            let stem = path.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_suffix(".unit"));
            names.extend(stem.filter(|n| !n.starts_with('.')).map(str::to_owned));
        }
    }
    Ok(names)
}

fn entries(path: &Path) -> Result<Vec<PathBuf>, FileError> {
    let io = |e| FileError::io(path, e);
    match fs::read_dir(path) {
        Ok(entries) => entries.map(|e| e.map(|e| e.path()).map_err(io)).collect(),
        Err(e) if matches!(e.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory) => {
            Ok(Vec::new())
        }
        Err(e) => Err(io(e)),
    }
}

/// Whether a unit is there, whole and what the plan says (see [`fits`](super::UnitResult::fits)); why not, if it is damaged.
///
/// # Errors
/// When the system refuses.
pub(crate) fn finished(
    directory: &Path,
    (unit, id): (Unit, &str),
    columns: usize,
    outages: &[(f64, f64)],
) -> Result<Result<bool, String>, unit_file::UnitFileError> {
    match unit_file::read(directory, id) {
        Ok(result) if result.fits(unit, columns, outages) => Ok(Ok(true)),
        Ok(_) => {
            let path = unit_file::path(directory, id).display().to_string();
            let what = "it holds other runs, candidates or outages than the plan";
            Ok(Err(unit_file::UnitFileError::Damaged { path, what }.to_string()))
        }
        Err(unit_file::UnitFileError::Missing { .. }) => Ok(Ok(false)),
        Err(e @ unit_file::UnitFileError::Damaged { .. }) => Ok(Err(e.to_string())),
        Err(e) => Err(e),
    }
}
