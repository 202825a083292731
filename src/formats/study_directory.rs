//! The directory of a study: `plan.json`, `models/` calibrated by the plan, `units/`, and `results/`.

use super::atomic;
use super::difference::{self, Difference};
use super::{source, unit_file};
use crate::study::{Plan, Study, Unit};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A study directory that cannot be worked in.
#[derive(Debug, thiserror::Error)]
pub enum BatchDirectoryError {
    /// There is no plan.
    #[error("{path} holds no plan")]
    NoPlan {
        /// The directory.
        path: String,
    },
    /// The system refused.
    #[error("{path}: {source}")]
    Io {
        /// File or directory.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// An output cannot be written.
    #[error(transparent)]
    Write(#[from] super::FileError),
    /// The plan is not one.
    #[error("{path}, line {line}: {message}")]
    Damaged {
        /// File.
        path: String,
        /// Line, from 1.
        line: usize,
        /// What the parser said.
        message: String,
    },
    /// It is the plan of another study, or the study has changed since.
    #[error(
        "{path} is the plan of another study, or the study has changed since: \"{key}\" is {found} in the plan, {wanted} in the study"
    )]
    Other {
        /// The plan's file.
        path: String,
        /// What differs.
        key: String,
        /// What is in the plan.
        found: String,
        /// What is in the study.
        wanted: String,
    },
}

impl BatchDirectoryError {
    /// Whether the contents or the request are at fault (rather than the machine).
    #[must_use]
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Io { source, .. } => source::is_damage(source.kind()),
            Self::Write(e) => !e.is_system(),
            _ => true,
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::NoPlan { .. } => Some("make one with `nav-sim batch plan STUDY.toml`".into()),
            Self::Write(e) => e.hint(),
            Self::Io { .. } => None,
            Self::Damaged { .. } => Some("remove the directory and plan again".into()),
            Self::Other { .. } => Some("plan into another directory with --out, or remove this one".into()),
        }
    }
}

fn file(directory: &Path) -> PathBuf {
    directory.join("plan.json")
}

/// The plan in a directory, if there is one.
///
/// # Errors
/// When it cannot be read or is none.
pub fn plan(directory: &Path) -> Result<Option<Plan>, BatchDirectoryError> {
    let path = file(directory);
    let shown = path.display().to_string();
    let text = match source::text(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(BatchDirectoryError::Io { path: shown, source }),
    };
    let damaged = |line, message: String| BatchDirectoryError::Damaged { path: shown.clone(), line, message };
    let plan: Plan = serde_json::from_str(&text).map_err(|e| {
        damaged(e.line(), e.to_string().split(" at line ").next().unwrap_or_default().to_owned())
    })?;
    let sizes = [plan.unit_runs.len(), plan.trajectories.len()];
    if sizes != [plan.study.trajectory.len(); 2] || plan.models.len() != plan.study.candidates().len() {
        return Err(damaged(1, "its lists do not fit together".into()));
    }
    Ok(Some(plan))
}

/// The plan of a study, which must be the one in the directory. A study without a seed takes the plan's.
///
/// # Errors
/// When there is none, or the study is not the one that was planned, or `seed` is given and not the plan's.
pub fn plan_of(directory: &Path, study: &Study, seed: Option<u64>) -> Result<Plan, BatchDirectoryError> {
    let plan = plan(directory)?
        .ok_or_else(|| BatchDirectoryError::NoPlan { path: directory.display().to_string() })?;
    same(directory, &plan, study, seed)?;
    Ok(plan)
}

/// Refuses a plan that is not of this study, or has another seed than the one asked for.
///
/// # Errors
/// The key that differs.
pub fn same(
    directory: &Path,
    plan: &Plan,
    study: &Study,
    seed: Option<u64>,
) -> Result<(), BatchDirectoryError> {
    let path = file(directory).display().to_string();
    if let Some(seed) = seed.filter(|seed| *seed != plan.seed) {
        let (found, wanted) = (plan.seed.to_string(), seed.to_string());
        return Err(BatchDirectoryError::Other { path, key: "seed".into(), found, wanted });
    }
    let study = Study { seed: study.seed.or(plan.study.seed), ..study.clone() };
    let value = |s: &Study| serde_json::to_value(s).unwrap_or_default();
    let (found, wanted) = (value(&plan.study), value(&study));
    let (Some(found), Some(wanted)) = (found.as_object(), wanted.as_object()) else { return Ok(()) };
    match difference::first(found, wanted) {
        None => Ok(()),
        Some(Difference { key, found, wanted }) => {
            Err(BatchDirectoryError::Other { path, key, found, wanted })
        }
    }
}

/// Writes a plan where none is.
///
/// # Errors
/// When the directory cannot be written to.
pub fn write_plan(directory: &Path, plan: &Plan) -> Result<(), BatchDirectoryError> {
    let json = serde_json::to_string_pretty(plan).expect("plain structs are always JSON") + "\n";
    Ok(atomic::write(&file(directory), json)?)
}

/// The names of the units in a directory; whether they are whole is not looked at.
///
/// # Errors
/// When the directory cannot be read.
pub fn units(directory: &Path) -> Result<BTreeSet<String>, BatchDirectoryError> {
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

fn entries(path: &Path) -> Result<Vec<PathBuf>, BatchDirectoryError> {
    let io = |source| BatchDirectoryError::Io { path: path.display().to_string(), source };
    match fs::read_dir(path) {
        Ok(entries) => entries.map(|e| e.map(|e| e.path()).map_err(io)).collect(),
        Err(e) if matches!(e.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory) => {
            Ok(Vec::new())
        }
        Err(e) => Err(io(e)),
    }
}

/// Whether a unit is there, whole and what the plan says (see [`fits`](crate::study::UnitResult::fits)); why not, if it is damaged.
///
/// # Errors
/// When the system refuses.
pub fn finished(
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
