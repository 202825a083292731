//! Why a job has no result, in the words of the command line: which flag helps.

use super::Failure;
use crate::choose::ChoiceError;
use crate::formats::suggest;
use crate::jobs::JobError;
use nav_sim_calibration::{AverageError, CalibrationError, Cause, FitError, ModelSpec, SpecError};
use nav_sim_navigation::metrics::ComparisonError;
use nav_sim_navigation::simulation::ExperimentError;

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
            JobError::Ratio { source: ComparisonError::Runs { .. }, .. } => {
                Self::input(e).hint("make both with one number of --runs")
            }
            JobError::Replicate(_)
            | JobError::Anticipation(_)
            | JobError::Navigate(_)
            | JobError::EstimatorStudy(_)
            | JobError::Pair(_)
            | JobError::Ratio { .. } => Self::input(e),
            JobError::Pooled => Self::input(format!("--pool sensor: {e}")).hint("--pool axes"),
            JobError::TwoRates { path, stated, given } => {
                let message =
                    format!("{path}: the curve says its rate, {stated} Hz; --rate-hz {given} is another");
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

impl From<ChoiceError> for Failure {
    fn from(e: ChoiceError) -> Self {
        match e {
            ChoiceError::Job(e) => (*e).into(),
            ChoiceError::TooFew { .. } => {
                Self::input(e).hint("each recording is a file; nav-sim calibrate takes fewer")
            }
            ChoiceError::Calibration { candidate, source } => of_calibration(&source).within(&candidate),
            ChoiceError::Own { ref source, .. } => {
                let hint = of_calibration(source).advice().map(str::to_owned);
                Self::input(e).maybe_hint(hint)
            }
            ChoiceError::Experiment(ExperimentError::FixBetweenSamples { .. }) => Self::input(e)
                .hint("the IMU has the rate of the recordings: another [gnss] rate_hz in --scenario"),
            ChoiceError::Experiment(_) | ChoiceError::Belief { .. } => Self::input(e),
        }
    }
}

fn of_calibration(e: &CalibrationError) -> Failure {
    let hint = match &e.source {
        Cause::Fit(FitError::TooFewScales { .. }) => {
            Some("record for longer, or a --model with fewer processes")
        }
        Cause::Fit(FitError::NoSlope { .. }) => {
            Some("--model WN+RW, a sum of WN, RW and DR (and QN where the curve begins with its slope)")
        }
        Cause::Fit(FitError::NotPositive { .. }) => Some(
            "the signal is quantised so coarsely that scales are silent: --estimator awv, or another range",
        ),
        Cause::Average(AverageError::Trim { .. }) => Some("a smaller --trim, or --estimator sr-awv"),
        _ => None,
    };
    Failure::input(e).maybe_hint(hint.map(str::to_owned))
}

/// Not a `--model`.
pub(super) fn unknown_model(e: SpecError) -> Failure {
    let hint = suggest::model(&e, ModelSpec::legal().chain(["auto"]));
    Failure::input(format!("--model: {e}")).hint(hint)
}
