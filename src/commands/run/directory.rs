//! Run directories read back, as far as comparisons need them.

use crate::app::Manifest;
use crate::commands::run::RunOrigin;
use crate::failure::{Failure, Place};
use crate::io::run_tables::{REPEAT, parse_epochs, parse_runs};
use crate::io::{atomic, hash, source};
use nav_sim_navigation::metrics::{EpochRow, Measured, PerState, Verdict};
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

/// Reads a run directory; what a killed command had begun to replace in it is finished first.
///
/// # Errors
/// The file, and what is wrong with it.
pub(crate) fn read(directory: &Path) -> Result<RunDirectory, Failure> {
    atomic::recover(directory);
    let (manifest, origin) = manifest(directory)?;
    let (path, epochs_text) = text(directory, "epochs.csv")?;
    let epochs = parse_epochs(&path, &epochs_text)?;
    as_written(directory, &manifest, "epochs.csv", &epochs_text)?;
    let is_expected = origin.configuration.run.method == Method::Lincov;
    let runs = if is_expected {
        let (path, summary) = text(directory, "summary.json")?;
        let run = expected_run(&path, &summary, &epochs)?;
        as_written(directory, &manifest, "summary.json", &summary)?;
        vec![run]
    } else {
        let (path, runs_text) = text(directory, "runs.csv")?;
        let runs = parse_runs(&path, &runs_text)?;
        as_written(directory, &manifest, "runs.csv", &runs_text)?;
        runs
    };
    let (verdict, asee_mean_ci95) = found(directory, &manifest)?;
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
        verdict,
        asee_mean_ci95,
    })
}

/// The verdict, and the intervals that the calibration leaves outage by outage, from the summary.
fn found(directory: &Path, manifest: &Manifest) -> Result<(Verdict, Vec<OpenEnds>), Failure> {
    #[derive(serde::Deserialize)]
    struct Found {
        verdict: Verdict,
        outages: Vec<FoundOutage>,
    }
    #[derive(serde::Deserialize)]
    struct FoundOutage {
        asee_mean_ci95: Option<PerState<(f64, f64)>>,
    }
    let (path, summary) = text(directory, "summary.json")?;
    let found: Found = serde_json::from_str(&summary).map_err(|e| not_json(&path, &e))?;
    as_written(directory, manifest, "summary.json", &summary)?;
    Ok((
        found.verdict,
        found
            .outages
            .into_iter()
            .map(|o| o.asee_mean_ci95)
            .collect(),
    ))
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

/// The run that stands for what covariance analysis expects, from its epochs and its summary.
fn expected_run(path: &str, summary: &str, epochs: &[EpochRow]) -> Result<RunRecord, Failure> {
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
    let expected: Expected = serde_json::from_str(summary).map_err(|e| not_json(path, &e))?;
    let outage = |o: ExpectedOutage| OutageRecord {
        see_mean: o.asee_mean.0,
        see_end: o.asee_end.0,
        error_end: o.rmse_end.0,
        nees_end: o.nees_end,
        ..OutageRecord::default()
    };
    let mean = |value: &dyn Fn(&EpochRow) -> f64| {
        epochs.iter().map(value).sum::<f64>() / epochs.len() as f64
    };
    Ok(RunRecord {
        outages: expected.outages.into_iter().map(outage).collect(),
        nees_mean: mean(&|e| e.nees),
        covered: mean(&|e| e.coverage),
        normalised_sq: std::array::from_fn(|i| mean(&|e| (e.rmse[i] / e.asee[i]).powi(2))),
        ..RunRecord::default()
    })
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
