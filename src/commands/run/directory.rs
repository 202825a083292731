//! Run directories read back, as far as comparisons need them.

use crate::app::Manifest;
use crate::commands::run::RunOrigin;
use crate::failure::{Failure, Place, Result};
use crate::io::run_tables::{REPEAT, parse_epochs, parse_runs};
use crate::io::{input, source};
use nav_sim_navigation::metrics::{ExperimentResult, PerState};
use nav_sim_navigation::scenario::Method;
use nav_sim_navigation::simulation::{OutageRecord, RunRecord};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;

/// A run directory.
pub(crate) struct RunDirectory {
    /// Its provenance.
    pub manifest: Manifest,
    /// Its configuration.
    pub origin: RunOrigin,
    /// Its results.
    pub experiment: ExperimentResult,
    /// Its summary, with the verdict as its own command found it, covariance analysis included.
    pub summary: Value,
    /// 95 % interval of the mean ASEE over each outage by what the calibration leaves open, where it is known.
    pub asee_mean_ci95: Vec<Option<PerState<(f64, f64)>>>,
}

/// Reads a run directory.
///
/// # Errors
/// The file, and what is wrong with it.
pub(crate) fn read(directory: &Path) -> Result<RunDirectory> {
    let (path, json) = text(directory, "manifest.json")?;
    let value: Value = from_json(&path, &json)?;
    let (found, expected) = (&value["schema_version"], Manifest::SCHEMA_VERSION);
    if *found != expected {
        return Err(Failure::contents(
            path,
            Place::Within,
            format!("\"schema_version\" is {found}; this nav-sim reads {expected}"),
        )
        .or_hint("repeat the run with this version"));
    }
    let manifest: Manifest = from_json(&path, &json)?;
    let origin: RunOrigin = from_json(&path, &json)?;
    let epochs = part(directory, &manifest, "epochs.csv", parse_epochs)?;
    let (found, summary): (SummaryFields, Value) =
        part(directory, &manifest, "summary.json", |path, text| {
            Ok((from_json(path, text)?, from_json(path, text)?))
        })?;
    let is_expected = origin.configuration.run.method == Method::Lincov;
    let runs = if is_expected {
        let known = |state: PerState<Option<f64>>| state.0.map(|x| x.unwrap_or(f64::NAN));
        let outage = |o: &FoundOutage| OutageRecord {
            see_mean: known(o.asee_mean),
            error_end: known(o.rmse_end),
            ..OutageRecord::default()
        };
        vec![RunRecord {
            outages: found.outages.iter().map(outage).collect(),
            ..RunRecord::default()
        }]
    } else {
        part(directory, &manifest, "runs.csv", parse_runs)?
    };
    let outages = origin.configuration.outage.iter().flatten();
    Ok(RunDirectory {
        experiment: ExperimentResult {
            epochs,
            runs,
            outages: outages.map(|o| (o.start_s, o.end_s)).collect(),
            independent_windows: origin.independent_windows,
            is_expected,
        },
        asee_mean_ci95: found.outages.iter().map(|o| o.asee_mean_ci95).collect(),
        manifest,
        origin,
        summary,
    })
}

/// `summary.json`, as far as it must be right.
#[derive(Deserialize)]
struct SummaryFields {
    outages: Vec<FoundOutage>,
}

#[derive(Deserialize)]
struct FoundOutage {
    asee_mean: PerState<Option<f64>>,
    rmse_end: PerState<Option<f64>>,
    asee_mean_ci95: Option<PerState<(f64, f64)>>,
}

/// A file that is the one the manifest tells of; what can be read of another was, for a more exact message.
fn part<T>(
    directory: &Path,
    manifest: &Manifest,
    name: &str,
    parse: impl Fn(&str, &str) -> Result<T>,
) -> Result<T> {
    let (path, text) = text(directory, name)?;
    let found = parse(&path, &text)?;
    match manifest.outputs.get(name) {
        Some(blake3) if *blake3 != input::hash_of(text.as_bytes()) => Err(Failure::contents(
            path,
            Place::Within,
            "differs from manifest.json (BLAKE3): damaged or changed",
        )
        .or_hint(REPEAT)),
        _ => Ok(found),
    }
}

fn from_json<T: DeserializeOwned>(path: &str, json: &str) -> Result<T> {
    serde_json::from_str(json).map_err(|e| {
        let message = e.to_string();
        let message = message.split(" at line ").next().unwrap_or_default();
        Failure::contents(path, e.line(), message).or_hint(REPEAT)
    })
}

fn text(directory: &Path, name: &str) -> Result<(String, String)> {
    let path = directory.join(name);
    let text = source::text(&path).map_err(|e| {
        let is_missing = e.kind() == std::io::ErrorKind::NotFound;
        let failure = Failure::io(&path, e);
        if is_missing {
            failure.hint("not a finished run directory: make one with `nav-sim run … -o DIR`")
        } else {
            failure
        }
    })?;
    Ok((path.display().to_string(), text))
}
