//! The run directory and what is printed of it.

use crate::cli::{Failure, Session};
use crate::formats::atomic::{AtomicDir, Claim, Found, claim_directory};
use crate::jobs::{Navigation, TrueImu};
use crate::report::{self, Input, Manifest, ModelNote, TrajectorySeries, window};
use nav_sim_navigation::metrics::{Summary, VerdictKind};
use nav_sim_navigation::scenario::{Method, Scenario, Unexpected};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};
use std::cell::Cell;
use std::path::Path;

/// The manifest of a run: every key as it was used, outages one by one, the seed.
pub(crate) fn manifest(
    mut configuration: Scenario,
    outages: &[Outage],
    seed: Option<u64>,
    inputs: Vec<Input>,
    model: ModelNote,
    session: &Session,
) -> Manifest {
    configuration.outage = Some(outages.to_vec());
    (configuration.outage_periodic, configuration.outage_random) = (None, None);
    configuration.run.seed = seed;
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
        first_seed.set(manifest.differs_in_seed(&present).then_some(present.seed).flatten());
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
pub(super) fn doubt_filter(summary: &Summary, scenario: &Scenario, truth: &TrueImu, session: &Session) {
    let (own, analysed) = (summary.verdict.kind, summary.verdict.by_covariance_analysis);
    let undecided = own == VerdictKind::Undecided;
    if own == VerdictKind::Overconfident || undecided && analysed == Some(VerdictKind::Overconfident) {
        let remedy = remedy(summary, &scenario.doubts(), truth);
        session.warn(format!("the filter is overconfident: {remedy}"));
    }
}

const TOO_LARGE: &str =
    "its errors are too large for a linear filter, and neither another MODEL nor nav-sim tune changes that";

/// What helps: by what the belief lacks, where linear analysis finds the filter wrong already; errors that are large are then
/// its consequence.
fn remedy(summary: &Summary, unexpected: &[Unexpected], truth: &TrueImu) -> String {
    let quality = summary.reduction.as_ref().and_then(|reduction| reduction.quality.as_ref());
    let ratios =
        quality.into_iter().flat_map(|q| q.outage_end.iter().chain([&q.mean]).flat_map(|state| state.0));
    if summary.is_contradicted {
        return TOO_LARGE.to_owned();
    }
    if let Some(largest) = largest(summary, unexpected) {
        return largest;
    }
    let is_too_large = summary.verdict.beyond_linear.is_some();
    match truth {
        // what recordings contain is unknown, and so is whether linear analysis would find the filter wrong
        TrueImu::Recordings(_) if is_too_large => TOO_LARGE.to_owned(),
        // where the reduced filter is right about the errors of its own model, the errors are of something else
        _ if ratios.fold(0.0, f64::max) > 1.0 + summary.verdict.tolerance => {
            "--filter full has a state for each process of the model".to_owned()
        }
        TrueImu::Model(_) | TrueImu::Recordings(_) => {
            "the errors are not those that MODEL expects: nav-sim tune (--for worst) finds variances that cover them".to_owned()
        }
        // no draw is in a covariance analysis: what is larger there is noise that a filter has no state for
        TrueImu::AsBelieved if summary.method == Method::Lincov.name() && !is_too_large => {
            "MODEL has noise that no filter contains: nav-sim tune with MODEL as its own --truth finds variances that cover it"
                .to_owned()
        }
        TrueImu::AsBelieved => TOO_LARGE.to_owned(),
    }
}

/// The source with the largest share of the worst error, of those that the filter does not expect, where it makes at least
/// half of what is too much there; without an outage, which has the shares, the first.
fn largest(summary: &Summary, unexpected: &[Unexpected]) -> Option<String> {
    let verdict = &summary.verdict;
    let outage = verdict.worst_outage.or_else(|| summary.outages.len().checked_sub(1));
    let known = outage.and_then(|k| Some((&summary.outages[k], summary.outages[k].budget.as_ref()?)));
    let Some((outage, budget)) = known else { return unexpected.first().map(Unexpected::to_string) };
    let worst = REPORTED_NAMES.iter().position(|name| *name == verdict.worst_state);
    // the state, and the share in its mean square
    let share = |cause: &Unexpected| {
        let of_cause = budget.shares.iter().filter(|(name, _)| cause.sources.contains(name));
        let shares = of_cause.fold([0.0; REPORTED], |sum, (_, of)| std::array::from_fn(|i| sum[i] + of.0[i]));
        let states = worst.map_or(0..REPORTED, |state| state..state + 1);
        states.map(|state| (state, shares[state])).max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let shares = unexpected.iter().filter_map(|cause| Some((cause, share(cause)?)));
    let (largest, (state, share)) = shares.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    // of a mean square that is ratio² times what is believed, this share is too much
    let excess = 1.0 - verdict.ratio.powi(-2);
    let place = format!("{} at the end of {}", REPORTED_NAMES[state], window(outage.start_s, outage.end_s));
    let told = || {
        let Unexpected { what, remedy, .. } = largest;
        format!("{what} ({:.0} % of the mean square of {place}): {remedy}", 100.0 * share)
    };
    (share > 0.5 * excess).then(told)
}
