//! The run directory and what is printed of it.

use crate::cli::{Failure, Session};
use crate::formats::atomic::{AtomicDir, Claim, Found, claim_directory};
use crate::jobs::Navigation;
use crate::report::{self, Input, Manifest, ModelNote, TrajectorySeries, run_words};
use nav_sim_navigation::metrics::{Summary, VerdictKind};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::outage::Outage;
use std::cell::Cell;
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
        configuration,
        inputs,
        outputs: std::collections::BTreeMap::new(),
        model,
        threads: session.threads(),
        independent_windows: None,
        wall_s: 0.0,
        throughput_epochs_per_s: 0.0,
    }
}

/// Whether a run directory can be made, found out before the long computation.
pub(crate) fn claim(path: &Path, manifest: &Manifest, session: &Session) -> Result<Claim, Failure> {
    let inputs = manifest.inputs.iter().map(|i| Path::new(&i.path));
    let first_seed = Cell::new(None);
    let recognise = |text: &str| {
        let Ok(present) = serde_json::from_str::<Manifest>(text) else { return Ok(Found::Foreign) };
        first_seed.set(manifest.differs_in_seed(&present).then_some(present.seed));
        Ok(Found::result(manifest.is_same_run(&present)))
    };
    let claimed = claim_directory(path, &report::RUN_FILES, inputs, session.existing(), recognise);
    claimed.map_err(|e| match first_seed.get() {
        Some(seed) => {
            let hint = format!(
                "make that run again with --seed {seed}, name another directory with -o, or replace it with --force"
            );
            Failure::from(e).hint(hint)
        }
        None => e.into(),
    })
}

/// Writes a run directory.
pub(super) fn write(
    found: &Navigation,
    manifest: &Manifest,
    track: &TrajectorySeries,
    path: &Path,
) -> Result<(), Failure> {
    let mut directory = AtomicDir::create(path)?;
    let Navigation { runs, epochs, fan, summary } = found;
    for file in report::run_directory(runs.as_ref(), epochs, fan, summary, manifest, track) {
        directory.write_parts(file.name, file.parts)?;
    }
    Ok(directory.commit()?)
}

/// Says aloud that a filter believes too much of itself, and what helps.
pub(crate) fn doubt_filter(summary: &Summary, session: &Session) {
    if summary.verdict.kind != VerdictKind::Overconfident {
        return;
    }
    let quality = summary.reduction.as_ref().and_then(|reduction| reduction.quality.as_ref());
    let ratios =
        quality.into_iter().flat_map(|q| q.outage_end.iter().chain([&q.mean]).flat_map(|state| state.0));
    // where the reduced filter is right about the errors of its own model, the errors are of something else
    let remedy = if run_words::beyond_linear(summary).is_some() || summary.is_second_order {
        "its errors are too large for a linear filter, and neither another MODEL nor nav-sim tune changes that"
    } else if ratios.fold(0.0, f64::max) > 1.0 + summary.verdict.tolerance {
        "--filter full has a state for each process of the model"
    } else {
        "the errors are not those that MODEL expects: nav-sim tune finds variances that cover them"
    };
    session.warn(format!("the filter is {}; {remedy}", run_words::verdict(summary)));
}
