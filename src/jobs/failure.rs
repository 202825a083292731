//! Why a job has no result: which flag helps.

use super::JobError;
use crate::app::Failure;
use crate::formats::suggest;
use nav_sim_calibration::{AverageError, CalibrationError, Cause, FitError, ModelSpec, SpecError};
use nav_sim_navigation::metrics::ComparisonError;

impl From<JobError> for Failure {
    fn from(e: JobError) -> Self {
        match e {
            JobError::File(e) => e.into(),
            JobError::Signal(e) => e.into(),
            JobError::Wavelet(e) => Self::could_not(e),
            JobError::Calibration(e) => of_calibration(&e),
            JobError::Copy { .. } => Self::input(e).hint("leave one of them out"),
            JobError::Single { .. } => {
                Self::input(format!("--estimator {e}")).hint("awv, sr-awv and dr-awv take several")
            }
            JobError::OtherTrajectory { .. } => {
                Self::input(e).hint("compare runs along one and the same trajectory file")
            }
            JobError::Ratio {
                source: ComparisonError::Runs { .. },
                ..
            } => Self::input(e).hint("make both with one number of --runs"),
            JobError::Replicate(_)
            | JobError::Anticipation(_)
            | JobError::Navigate(_)
            | JobError::Ratio { .. } => Self::input(e),
            JobError::Pooled => Self::input(format!("--pool sensor: {e}")).hint("--pool axes"),
            JobError::TwoRates {
                path,
                stated,
                given,
            } => {
                let message = format!(
                    "{path}: the curve says its rate, {stated} Hz; --rate-hz {given} is another"
                );
                Self::input(message).hint("leave --rate-hz out: it is for a CSV curve")
            }
            JobError::NoRate { .. } => Self::input(e)
                .hint("give the rate with --rate-hz: correlation times and the model file need it"),
            JobError::NoSensor { .. } => Self::input(e).hint("--axes accel or --axes gyro"),
            JobError::TwoCurves { .. } => {
                Self::input(e).hint("calibrate the recordings themselves: it averages them")
            }
        }
    }
}

pub(crate) fn of_calibration(e: &CalibrationError) -> Failure {
    let hint = match &e.source {
        Cause::Fit(FitError::TooFewScales { .. }) => {
            Some("record for longer, or a --model with fewer processes")
        }
        Cause::Fit(FitError::NoSlope { .. }) => Some(
            "--model WN+RW, a sum of WN, RW and DR (and QN where the curve begins with its slope)",
        ),
        Cause::Fit(FitError::NotPositive { .. }) => Some(
            "the signal is quantised so coarsely that scales are silent: --estimator awv, or another range",
        ),
        Cause::Average(AverageError::Trim { .. }) => {
            Some("a smaller --trim, or --estimator sr-awv")
        }
        _ => None,
    };
    Failure::input(e).maybe_hint(hint.map(str::to_owned))
}

/// Not a `--model`.
pub(crate) fn unknown_model(e: SpecError) -> Failure {
    let hint = suggest::model(&e, ModelSpec::legal().chain(["auto"]));
    Failure::input(format!("--model: {e}")).hint(hint)
}
