//! Run directories read back, as far as comparisons need them.

use super::run_tables::{parse_epochs, parse_runs};
use super::{FileError, Place, atomic, source};
use crate::metrics::{EpochRow, Measured, PerState};
use crate::report::Manifest;
use crate::scenario::Method;
use crate::simulation::{OutageRecord, RunRecord};
use std::path::Path;

/// A run directory.
#[derive(Debug, Clone, PartialEq)]
pub struct RunDirectory {
    /// Where it came from.
    pub manifest: Manifest,
    /// What was found.
    pub experiment: Measured,
}

/// Reads a run directory; what a killed command had begun to replace in it is finished first.
///
/// # Errors
/// The file, and what is wrong with it.
pub fn read(directory: &Path) -> Result<RunDirectory, FileError> {
    atomic::recover(directory);
    let manifest = manifest(directory)?;
    let (epochs_path, epochs) = text(directory, "epochs.csv")?;
    let epochs = parse_epochs(&epochs_path, &epochs)?;
    let is_expected = manifest.configuration.run.method == Method::Lincov;
    let runs = if is_expected {
        vec![expected_run(directory, &epochs)?]
    } else {
        let (runs_path, runs) = text(directory, "runs.csv")?;
        parse_runs(&runs_path, &runs)?
    };
    let outages = manifest.configuration.outage.iter().flatten().map(|o| (o.start_s, o.end_s)).collect();
    let independent_windows = manifest.independent_windows;
    let experiment = Measured { epochs, runs, outages, independent_windows, is_expected };
    Ok(RunDirectory { manifest, experiment })
}

/// The run that stands for what covariance analysis expects, from its epochs and its summary.
fn expected_run(directory: &Path, epochs: &[EpochRow]) -> Result<RunRecord, FileError> {
    #[derive(serde::Deserialize)]
    struct Expected {
        outages: Vec<ExpectedOutage>,
    }
    #[derive(serde::Deserialize)]
    struct ExpectedOutage {
        asee_mean: PerState<f64>,
        asee_end: PerState<f64>,
        rmse_end: PerState<f64>,
        nees_end: f64,
    }
    let (path, json) = text(directory, "summary.json")?;
    let expected: Expected = serde_json::from_str(&json).map_err(|e| not_json(&path, &e))?;
    let outage = |o: ExpectedOutage| OutageRecord {
        see_mean: o.asee_mean.0,
        see_end: o.asee_end.0,
        error_end: o.rmse_end.0,
        nees_end: o.nees_end,
        ..OutageRecord::default()
    };
    let mean = |value: &dyn Fn(&EpochRow) -> f64| epochs.iter().map(value).sum::<f64>() / epochs.len() as f64;
    Ok(RunRecord {
        outages: expected.outages.into_iter().map(outage).collect(),
        nees_mean: mean(&|e| e.nees),
        covered: mean(&|e| e.coverage),
        normalised_sq: std::array::from_fn(|i| mean(&|e| (e.rmse[i] / e.asee[i]).powi(2))),
        ..RunRecord::default()
    })
}

fn manifest(directory: &Path) -> Result<Manifest, FileError> {
    let (path, json) = text(directory, "manifest.json")?;
    let manifest: Manifest = serde_json::from_str(&json).map_err(|e| not_json(&path, &e))?;
    let (found, expected) = (manifest.schema_version, Manifest::SCHEMA_VERSION);
    if found == expected {
        return Ok(manifest);
    }
    let message = format!("\"schema_version\" is {found}; this nav-sim reads {expected}");
    Err(FileError::contents(path, Place::Within, message).advice("repeat the run with this version"))
}

fn not_json(path: &str, e: &serde_json::Error) -> FileError {
    let message = e.to_string().split(" at line ").next().unwrap_or_default().to_owned();
    FileError::contents(path, e.line(), message)
}

fn text(directory: &Path, name: &str) -> Result<(String, String), FileError> {
    let path = directory.join(name);
    match source::text(&path) {
        Ok(text) => Ok((path.display().to_string(), text)),
        Err(source) => {
            let unfinished = "not a finished run directory: make one with `nav-sim run … -o DIR`";
            let is_missing = source.kind() == std::io::ErrorKind::NotFound;
            Err(FileError::io(&path, source).advice_if(is_missing.then(|| unfinished.to_owned())))
        }
    }
}
