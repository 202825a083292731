//! Why recorded data cannot be fused, and what to do about it.

/// Why recorded data cannot be fused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FusionError {
    /// The clocks have nothing in common.
    #[error(
        "the clocks do not overlap: the IMU runs from {} to {} s, GNSS from {} to {} s", .imu.0, .imu.1, .gnss.0, .gnss.1
    )]
    Clocks {
        /// First and last sample (s).
        imu: (f64, f64),
        /// First and last fix (s).
        gnss: (f64, f64),
    },
    /// It begins after the data end, or before they begin.
    #[error("the start at {t_s} s is not within the IMU's {} to {} s", .imu.0, .imu.1)]
    Start {
        /// The start (s).
        t_s: f64,
        /// First and last sample (s).
        imu: (f64, f64),
    },
    /// The initial position is not where the fixes are.
    #[error(
        "the initial position is {metres:.0} m from the fix at {t_s} s (both together are good to {sigma_m:.1} m)"
    )]
    Place {
        /// The first fix after the start (s).
        t_s: f64,
        /// How far (m).
        metres: f64,
        /// Horizontal standard deviation of both (m).
        sigma_m: f64,
    },
    /// Latitude and longitude lose their meaning.
    #[error(
        "latitude {lat_deg:.3}° at {t_s} s: beyond ±89.9° there is no navigation in latitude and longitude"
    )]
    Pole {
        /// When (s).
        t_s: f64,
        /// Where (degrees).
        lat_deg: f64,
    },
    /// What a smoother would have to keep.
    #[error(
        "the smoother would take {:.1} GB of memory for {marks} rows and fixes of {states} states; it takes 2 GB at most",
        bytes / 1e9
    )]
    Memory {
        /// How much (bytes).
        bytes: f64,
        /// Rows and fixes.
        marks: f64,
        /// States of the filter.
        states: usize,
    },
    /// State or covariance stopped being finite.
    #[error("the filter diverged at {t_s} s")]
    Diverged {
        /// When (s).
        t_s: f64,
    },
}

/// What to look at where a solution is not to be believed.
pub const DOUBTFUL: &str = "are the IMU's axes front, right, down, its units right, the initial state true?";

impl FusionError {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        const WEEK_S: f64 = 604_800.0;
        match self {
            Self::Clocks { imu, gnss } => {
                let weeks = ((imu.0 - gnss.0) / WEEK_S).round();
                let rest = (imu.0 - gnss.0 - weeks * WEEK_S).abs();
                Some(if weeks != 0.0 && rest < 86_400.0 {
                    format!("they are {weeks} GPS weeks apart: give both in seconds of the week, without a week column")
                } else {
                    "both files need one clock: is one in milliseconds, or counted from its own start?".into()
                })
            }
            Self::Start { .. } => Some("give t_s of the initial state on the clock of the IMU".into()),
            Self::Diverged { .. } => Some(DOUBTFUL.to_owned()),
            Self::Place { .. } => Some(
                "are t_s, lat_deg and lon_deg of the initial state those of this recording, its pos_sigma_m honest?".into(),
            ),
            Self::Memory { .. } => {
                Some("fewer rows a second, or a filter of fewer states, take less".into())
            }
            Self::Pole { .. } => None,
        }
    }
}
