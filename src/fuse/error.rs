//! Recordings that cannot be fused, and what helps.

use crate::formats::FileError;
use nav_sim_navigation::ekf::BeliefError;
use nav_sim_navigation::fusion::alignment::AlignmentError;
use nav_sim_navigation::fusion::mounting::MountingError;
use nav_sim_navigation::fusion::{ClocksApart, FusionError};
use nav_sim_navigation::sensors::outage::OutageError;
use nav_sim_signal::noise::{ParameterError, continuous};

/// A fusion that cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FuseError {
    /// A file that cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// A setting out of its range.
    #[error("{0}")]
    Setting(String),
    /// Data and settings that do not fit together, or a filter that diverged.
    #[error(transparent)]
    Fusion(#[from] FusionError),
    /// The model cannot be converted to the rate of the recording.
    #[error("the model: {0}")]
    Rate(#[from] continuous::RateError),
    /// The model has no such filter.
    #[error("the model: {0}")]
    Belief(#[from] BeliefError),
    /// The reduction cannot be assessed.
    #[error(transparent)]
    Reduction(#[from] ParameterError),
    /// Windows that are not on the data.
    #[error(transparent)]
    Outage(#[from] OutageError),
    /// The data do not show where the drive starts.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// The drive does not show how the IMU is mounted.
    #[error(transparent)]
    Mounting(#[from] MountingError),
    /// The clocks are apart, and so the drive does not show how the IMU is mounted.
    #[error("{0}")]
    Apart(MountingError, ClocksApart),
    /// The wheel is of another time.
    #[error("the wheel and the IMU have no time in common")]
    WheelClock,
    /// The wheel is no wheel, or in another unit.
    #[error("the wheel reads {0:.2} times the speed of the fixes")]
    WheelSpeed(f64),
    /// The reference is of another time.
    #[error("the reference and the solution have no time in common")]
    NothingInCommon,
}

impl FuseError {
    /// What helps.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        let fixed = match self {
            Self::Fusion(e @ FusionError::Clocks { .. }) => {
                return e.delay_s().map(|s| format!("--gnss-delay {s}"));
            }
            Self::Apart(_, clocks) => return Some(super::document::apart(clocks)),
            Self::Outage(e) => return e.hint().map(str::to_owned),
            Self::Fusion(FusionError::Start { .. }) => {
                "give t_s of the initial state on the clock of the IMU"
            }
            Self::Fusion(FusionError::Place { .. }) => {
                "check t_s, lat_deg, lon_deg and pos_sigma_m of the initial state"
            }
            Self::Fusion(FusionError::Memory { .. }) => {
                "a filter of fewer states, or the drive in parts"
            }
            Self::Fusion(FusionError::Diverged { .. }) => "check axes, units and the initial state",
            Self::Alignment(_) => {
                "give the heading with --initial DEG:SD, or the whole start with --initial FILE"
            }
            Self::Mounting(_) => {
                "give --mounting ROLL,PITCH,YAW, or minutes of driving with braking and turns, and velocities in the fixes"
            }
            Self::NothingInCommon | Self::WheelClock => "both need one clock",
            Self::WheelSpeed(_) => "check the unit in the header: _m_s, _km_h or _mph",
            _ => return None,
        };
        Some(fixed.to_owned())
    }

    /// Whether the data are at fault rather than the numerics.
    pub(crate) const fn is_input(&self) -> bool {
        !matches!(
            self,
            Self::Reduction(_) | Self::Fusion(FusionError::Diverged { .. })
        )
    }
}
