//! The run directory and what is printed of it.

use crate::cli::compare::table;
use crate::cli::{Failure, Session};
use nav_sim::data::atomic::{self, AtomicDir};
use nav_sim::metrics::{self, OutageSummary, ReductionSummary, Summary};
use nav_sim::report::{self, Input, Manifest, ModelNote};
use nav_sim::scenario::Scenario;
use nav_sim::sensors::outage::Outage;
use nav_sim::simulation::RunResult;
use std::path::Path;

/// The manifest of a run: every key as it was used, outages one by one, the seed.
pub(crate) fn manifest(
    mut configuration: Scenario,
    outages: &[Outage],
    seed: u64,
    inputs: Vec<Input>,
    model: ModelNote,
    session: &Session,
) -> Manifest {
    configuration.outage = Some(outages.to_vec());
    (configuration.outage_periodic, configuration.outage_random) = (None, None);
    configuration.run.seed = Some(seed);
    Manifest {
        schema_version: Manifest::SCHEMA_VERSION,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
        seed,
        scenario: String::new(),
        configuration,
        inputs,
        model,
        threads: session.threads(),
        wall_s: 0.0,
    }
}

/// Whether a run directory can be made, found out before the long computation; none of its files may be an
/// input. Nothing is left: a run that is interrupted leaves no trace.
pub(crate) fn try_open(path: &Path, inputs: &[Input]) -> Result<(), Failure> {
    for name in report::RUN_FILES {
        atomic::guard_inputs(&path.join(name), inputs.iter().map(|i| Path::new(&i.path)))?;
    }
    not_of_another_command(path, |text| serde_json::from_str::<Manifest>(text).is_ok())?;
    drop(AtomicDir::create(path)?);
    Ok(())
}

/// Refuses a directory whose manifest is that of another command: its own would take its place.
pub(crate) fn not_of_another_command(path: &Path, is_ours: fn(&str) -> bool) -> Result<(), Failure> {
    let manifest = path.join("manifest.json");
    let Ok(text) = std::fs::read_to_string(&manifest) else { return empty_or_new(path) };
    if is_ours(&text) {
        return Ok(());
    }
    let message = format!("{} is of another command, or of another version", manifest.display());
    Err(Failure::input(message).hint("choose another directory with --out, or remove it"))
}

/// Refuses a directory that holds anything: files of the same names would be lost.
pub(crate) fn empty_or_new(path: &Path) -> Result<(), Failure> {
    let Ok(entries) = std::fs::read_dir(path) else { return Ok(()) };
    let visible = |name: &std::ffi::OsString| !name.to_string_lossy().starts_with('.');
    let mut names: Vec<_> = entries.flatten().map(|e| e.file_name()).filter(visible).collect();
    names.sort();
    let Some(first) = names.first() else { return Ok(()) };
    let message = format!(
        "{} is not empty, and not of this command: it holds {}",
        path.display(),
        first.to_string_lossy()
    );
    Err(Failure::input(message).hint("choose a new directory with --out"))
}

/// Writes a run directory.
pub(crate) fn write(
    result: &RunResult,
    manifest: &Manifest,
    reduction: Option<ReductionSummary>,
    path: &Path,
) -> Result<Summary, Failure> {
    let epochs = metrics::epochs(&result.epochs);
    let summary = Summary { reduction, ..Summary::of(result, &epochs, manifest.seed, manifest.wall_s) };
    let mut directory = AtomicDir::create(path)?;
    for file in report::run_directory(result, &epochs, &summary, manifest) {
        directory.write_parts(file.name, file.parts)?;
    }
    directory.commit()?;
    Ok(summary)
}

/// The summary for people.
pub(crate) fn text(summary: &Summary) -> String {
    let (nees, coverage) = (&summary.nees, &summary.coverage);
    let mut text = format!(
        "{} runs ({} diverged), {} states, seed {}, {:.2} million IMU epochs/s\n",
        summary.runs,
        summary.diverged,
        summary.filter_states,
        summary.seed,
        summary.throughput_epochs_per_s / 1e6
    );
    if summary.diverged == summary.runs {
        return text.trim_end().to_owned();
    }
    if !summary.outages.is_empty() {
        text += &outage_table(&summary.outages);
        text.push('\n');
    }
    text += &format!(
        "NEES {:.2} ({} if the filter is right), {:.0} % of epochs within [{:.2}, {:.2}]\n",
        nees.mean,
        nees.dof,
        nees.fraction_inside * 100.0,
        nees.lower95,
        nees.upper95
    );
    text += &format!(
        "coverage {:.3} at level {}, {:.0} % of epochs within [{:.2}, {:.2}]",
        coverage.mean,
        coverage.level,
        coverage.fraction_inside * 100.0,
        coverage.lower95,
        coverage.upper95
    );
    text
}

fn outage_table(outages: &[OutageSummary]) -> String {
    let head = [
        "outage",
        "horizontal p50 (m)",
        "p95",
        "max",
        "ASEE pos_e_m",
        "roll_deg",
        "RMSE pos_e_m",
        "roll_deg",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for o in outages {
        let h = &o.horizontal_error_end_m;
        let mut row = vec![format!("{}–{} s", o.start_s, o.end_s)];
        row.extend([h.p50, h.p95, h.max].map(|v| format!("{v:.1}")));
        let states = [o.asee_mean.0[1], o.asee_mean.0[6], o.rmse_end.0[1], o.rmse_end.0[6]];
        row.extend(states.map(|v| format!("{v:.3}")));
        rows.push(row);
    }
    table(&rows)
}
