//! The run directory that is claimed, and why there is none.

use crate::cli::exit::option_for;
use crate::cli::{Failure, Session};
use crate::formats::Setting;
use crate::formats::atomic::{Claim, Found, claim_directory};
use crate::report::Manifest;
use crate::run::{NavigateError, RUN_FILES, RunError};
use nav_sim_navigation::ekf::BeliefError;
use nav_sim_navigation::sensors::imu::TruthError;
use nav_sim_navigation::simulation::ExperimentError;
use std::cell::Cell;
use std::path::Path;

/// Whether a run directory can be made, found out before the long computation.
pub(super) fn claim(path: &Path, manifest: &Manifest, session: &Session) -> Result<Claim, Failure> {
    let inputs = manifest.inputs.iter().map(|i| Path::new(&i.path));
    let first_seed = Cell::new(None);
    let recognise = |text: &str| {
        let Ok(present) = serde_json::from_str::<Manifest>(text) else { return Ok(Found::Foreign) };
        first_seed.set(manifest.differs_in_seed(&present).then_some(present.seed).flatten());
        Ok(Found::result(manifest.is_same_run(&present)))
    };
    let claimed = claim_directory(path, &RUN_FILES, inputs, session.existing(), recognise);
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

/// Why a run has no answer, with the options that help.
pub(in crate::cli) fn failure(e: RunError) -> Failure {
    match e {
        RunError::File(e) => Failure::of_file(&e, |setting| {
            Some(match setting {
                Setting::Gaps => {
                    "wv and calibrate read it with --gaps split or --gaps ignore; fuse bridges gaps of up to 5 s"
                }
                Setting::Origin => {
                    "write it with latitude and longitude: nav-sim trajectory convert FILE --origin LAT_DEG,LON_DEG,H_M"
                }
                other => option_for(other),
            })
        }),
        RunError::Rate { from_hz, .. } => Failure::input(&e)
            .hint(format!("set rate_hz = {from_hz} in the [imu] section of a --scenario file")),
        RunError::NoSpread(_) => Failure::input(&e).hint(
            "nav-sim calibrate writes one where three recordings or more differ, or leave --spread out",
        ),
        RunError::Drawn { .. } => Failure::input(&e),
        RunError::Outages => Failure::input(&e).hint("give the windows, or none alone"),
        RunError::Outage { ref source, .. } => {
            Failure::input(&e).maybe_hint(source.hint().map(str::to_owned))
        }
        RunError::NoOutage(_) => Failure::input(&e).hint("give an outage with --outage START:END"),
        RunError::Setting(_) => Failure::input(&e),
        RunError::Navigate { model, settings, source } => impossible(*source, &model, settings.as_deref()),
    }
}

/// A navigation that cannot be done.
fn impossible(e: NavigateError, model: &Path, settings: Option<&Path>) -> Failure {
    let failure = Failure::input(&e);
    match e {
        NavigateError::Experiment(ExperimentError::Truth(TruthError::TooShort { .. })) => {
            failure.hint("each run takes a window as long as the trajectory: record for longer")
        }
        NavigateError::Experiment(ExperimentError::Truth(TruthError::Rate { rate_hz, .. })) => {
            failure.hint(format!("set rate_hz = {rate_hz} in the [imu] section of a --scenario file"))
        }
        NavigateError::Experiment(_) => failure,
        NavigateError::Belief(e) => no_filter(
            &e,
            model,
            settings,
            "raise it, or take the full filter (--filter full), which reduces nothing",
        ),
        NavigateError::Reduction(e) => Failure::could_not(e),
        NavigateError::RecordedTruth => failure
            .hint("calibrate the recordings and give the model with --truth, or use --method monte-carlo"),
        NavigateError::DrawnTruth => failure.hint("leave --spread out, or use --method monte-carlo"),
        NavigateError::Gate(_) => failure.hint("remove the key, or use --method monte-carlo"),
        NavigateError::NotFinite => {
            Failure::could_not(e).hint("do the models fit the IMU, are [imu] and [initial] plausible?")
        }
    }
}

/// Why a model has no filter: by the file that is at fault, of the model and the one with the settings; `advice` is on settings.
pub(in crate::cli) fn no_filter(
    e: &BeliefError,
    model: &Path,
    settings: Option<&Path>,
    advice: &str,
) -> Failure {
    let within = |failure: Failure, file: &Path| failure.within(&file.display().to_string());
    match e {
        BeliefError::Setting(_) => {
            let failure = Failure::input(e).hint(advice);
            settings.into_iter().fold(failure, within)
        }
        _ => within(Failure::input(e), model),
    }
}
