//! Why there is no choice: which flag helps.

use super::ChoiceError;
use crate::app::Failure;
use crate::jobs::of_calibration;
use nav_sim_navigation::simulation::ExperimentError;

impl From<ChoiceError> for Failure {
    fn from(e: ChoiceError) -> Self {
        match e {
            ChoiceError::Job(e) => (*e).into(),
            ChoiceError::TooFew { .. } => {
                Self::input(e).hint("each recording is a file; nav-sim calibrate takes fewer")
            }
            ChoiceError::Calibration { candidate, source } => {
                of_calibration(&source).within(&candidate)
            }
            ChoiceError::Own { ref source, .. } => {
                let hint = of_calibration(source).advice().map(str::to_owned);
                Self::input(e).maybe_hint(hint)
            }
            ChoiceError::Experiment(ExperimentError::FixBetweenSamples { .. }) => Self::input(e)
                .hint(
                    "the IMU has the rate of the recordings: another [gnss] rate_hz in --scenario",
                ),
            ChoiceError::Experiment(_) | ChoiceError::Belief { .. } => Self::input(e),
        }
    }
}
