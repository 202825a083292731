//! Run directories read back, as far as comparisons need them.

use crate::app::Manifest;
use crate::commands::run::RunOrigin;
use crate::failure::{Failure, Place};
use crate::io::run_tables::{REPEAT, parse_epochs, parse_runs};
use crate::io::{hash, source};
use nav_sim_navigation::metrics::{Measured, PerState, Verdict};
use nav_sim_navigation::scenario::Method;
use nav_sim_navigation::simulation::{OutageRecord, RunRecord};
use std::path::Path;

/// Lower and upper end of each state's interval, where it is known.
pub(crate) type OpenEnds = Option<PerState<(f64, f64)>>;

/// A run directory.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RunDirectory {
    /// Where it came from.
    pub manifest: Manifest,
    /// Its configuration.
    pub origin: RunOrigin,
    /// What was found.
    pub experiment: Measured,
    /// Whether the filter is as good as it believes: as its own command found it, covariance analysis included.
    pub verdict: Verdict,
    /// 95 % interval of the mean ASEE over each outage by what the calibration leaves open, where it is known.
    pub asee_mean_ci95: Vec<OpenEnds>,
}

/// Reads a run directory.
///
/// # Errors
/// The file, and what is wrong with it.
pub(crate) fn read(directory: &Path) -> Result<RunDirectory, Failure> {
    let (manifest, origin) = manifest(directory)?;
    let (path, epochs_text) = text(directory, "epochs.csv")?;
    let epochs = parse_epochs(&path, &epochs_text)?;
    as_written(directory, &manifest, "epochs.csv", &epochs_text)?;
    let (path, summary) = text(directory, "summary.json")?;
    let found: Found = serde_json::from_str(&summary).map_err(|e| not_json(&path, &e))?;
    as_written(directory, &manifest, "summary.json", &summary)?;
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
        let (path, runs_text) = text(directory, "runs.csv")?;
        let runs = parse_runs(&path, &runs_text)?;
        as_written(directory, &manifest, "runs.csv", &runs_text)?;
        runs
    };
    let outages = origin
        .configuration
        .outage
        .iter()
        .flatten()
        .map(|o| (o.start_s, o.end_s))
        .collect();
    let independent_windows = origin.independent_windows;
    let experiment = Measured {
        epochs,
        runs,
        outages,
        independent_windows,
        is_expected,
    };
    Ok(RunDirectory {
        manifest,
        origin,
        experiment,
        verdict: found.verdict,
        asee_mean_ci95: found.outages.iter().map(|o| o.asee_mean_ci95).collect(),
    })
}

/// `summary.json`, as far as comparisons need it.
#[derive(serde::Deserialize)]
struct Found {
    verdict: Verdict,
    outages: Vec<FoundOutage>,
}

#[derive(serde::Deserialize)]
struct FoundOutage {
    asee_mean: PerState<Option<f64>>,
    rmse_end: PerState<Option<f64>>,
    asee_mean_ci95: OpenEnds,
}

/// Refuses a file that is not the one the manifest tells of; what can be read of it was, for a more exact message.
fn as_written(
    directory: &Path,
    manifest: &Manifest,
    name: &str,
    text: &str,
) -> Result<(), Failure> {
    match manifest.outputs.get(name) {
        Some(blake3) if *blake3 != hash::of_bytes(text.as_bytes()) => {
            let path = directory.join(name).display().to_string();
            let message =
                "is not what its manifest.json says (BLAKE3): it is damaged, or was changed";
            Err(Failure::contents(path, Place::Within, message).or_hint(REPEAT))
        }
        _ => Ok(()),
    }
}

fn manifest(directory: &Path) -> Result<(Manifest, RunOrigin), Failure> {
    let (path, json) = text(directory, "manifest.json")?;
    let value: serde_json::Value = serde_json::from_str(&json).map_err(|e| not_json(&path, &e))?;
    let (found, expected) = (&value["schema_version"], Manifest::SCHEMA_VERSION);
    if *found == expected {
        let manifest: Manifest = serde_json::from_str(&json).map_err(|e| not_json(&path, &e))?;
        let origin = serde_json::from_value(manifest.record.clone().into());
        return match origin {
            Ok(origin) => Ok((manifest, origin)),
            Err(e) => Err(not_json(&path, &e)),
        };
    }
    let message = format!("\"schema_version\" is {found}; this nav-sim reads {expected}");
    Err(Failure::contents(path, Place::Within, message).or_hint("repeat the run with this version"))
}

fn not_json(path: &str, e: &serde_json::Error) -> Failure {
    let message = e
        .to_string()
        .split(" at line ")
        .next()
        .unwrap_or_default()
        .to_owned();
    Failure::contents(path, e.line(), message).or_hint(REPEAT)
}

fn text(directory: &Path, name: &str) -> Result<(String, String), Failure> {
    let path = directory.join(name);
    match source::text(&path) {
        Ok(text) => Ok((path.display().to_string(), text)),
        Err(source) => {
            let unfinished = "not a finished run directory: make one with `nav-sim run … -o DIR`";
            let is_missing = source.kind() == std::io::ErrorKind::NotFound;
            let failure = Failure::io(&path, source);
            Err(match is_missing {
                true => failure.hint(unfinished),
                false => failure,
            })
        }
    }
}
