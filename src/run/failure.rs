//! Why a run has no answer: the options that help.

use super::{NavigateError, RunAnswer, RunError};
use crate::failure::{Failure, option_elsewhere};
use crate::formats::Setting;
use crate::report::requirement::requirement_line;
use nav_sim_navigation::ekf::BeliefError;
use nav_sim_navigation::metrics::Summary;
use nav_sim_navigation::sensors::imu::TruthError;
use nav_sim_navigation::simulation::ExperimentError;
use std::path::Path;

impl From<RunError> for Failure {
    fn from(e: RunError) -> Self {
        match e {
            RunError::File(e) => Failure::of_file(&e, |setting| {
                Some(match setting {
                    Setting::Gaps => {
                        "wv and calibrate read it with --gaps split or --gaps ignore; fuse bridges gaps of up to 5 s"
                    }
                    other => option_elsewhere(other),
                })
            }),
            RunError::Rate { from_hz, .. } => Failure::input(&e)
                .hint(format!("set rate_hz = {from_hz} in the [imu] section of a --scenario file")),
            RunError::NoSpread(_) => Self::input(&e).hint(
                "nav-sim calibrate writes one where three recordings or more differ, or leave --spread out",
            ),
            RunError::Drawn { .. } => Self::input(&e),
            RunError::Outages => Failure::input(&e).hint("give the windows, or none alone"),
            RunError::Outage { ref source, .. } => {
                Failure::input(&e).maybe_hint(source.hint().map(str::to_owned))
            }
            RunError::NoOutage(_) => Failure::input(&e).hint("give an outage with --outage START:END"),
            RunError::Setting(_) => Failure::input(&e),
            RunError::Navigate { model, settings, source } => {
                impossible(*source, &model, settings.as_deref())
            }
        }
    }
}

impl RunAnswer {
    /// What is not met, if anything: all runs stay finite, the filter is not off by far, and everything required holds.
    #[must_use]
    pub fn unmet(&self) -> Option<Failure> {
        let summary = &self.navigation.summary;
        let Summary {
            diverged,
            runs,
            verdict,
            ..
        } = summary;
        if *diverged > 0 && diverged == runs {
            let failure =
                Failure::could_not(format!("all {runs} runs diverged: there is no result"));
            return Some(
                failure.hint("does the model fit the IMU, are [imu] and [initial] plausible?"),
            );
        }
        if *diverged > 0 {
            let failure = Failure::bound(format!("{diverged} of {runs} runs diverged"));
            return Some(failure.hint(
                "their indices are in summary.json, under diverged_runs; they are in no other number",
            ));
        }
        let missed: Vec<String> = summary
            .require
            .iter()
            .filter(|met| !met.met)
            .map(|met| requirement_line(met, summary))
            .collect();
        if !missed.is_empty() {
            return Some(Failure::bound(missed.join("; ")));
        }
        if verdict.is_far_off() {
            let message = format!(
                "the filter is overconfident by far: NEES {:.0}, 9 if it is right",
                summary.nees.mean
            );
            return Some(Failure::bound(message).hint("the results are written"));
        }
        None
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
            failure.hint(format!(
                "set rate_hz = {rate_hz} in the [imu] section of a --scenario file"
            ))
        }
        NavigateError::Experiment(_) => failure,
        NavigateError::Belief(e) => no_filter(
            &e,
            model,
            settings,
            "raise it, or take the full filter (--filter full), which reduces nothing",
        ),
        NavigateError::Reduction(e) => Failure::could_not(e),
        NavigateError::RecordedTruth => failure.hint(
            "calibrate the recordings and give the model with --truth, or use --method monte-carlo",
        ),
        NavigateError::DrawnTruth => {
            failure.hint("leave --spread out, or use --method monte-carlo")
        }
        NavigateError::Drawn(_) => failure.hint("leave it out, or use --method monte-carlo"),
        NavigateError::NotFinite => Failure::could_not(e)
            .hint("do the models fit the IMU, are [imu] and [initial] plausible?"),
    }
}

/// Why a model has no filter: by the file that is at fault, of the model and the one with the settings; `advice` is on settings.
pub(crate) fn no_filter(
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
