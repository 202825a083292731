//! Recorded data that cannot be fused.

/// Recorded data that cannot be fused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FusionError {
    /// The clocks have nothing in common.
    #[error("the clocks do not overlap: IMU {} to {} s, GNSS {} to {} s", .imu.0, .imu.1, .gnss.0, .gnss.1)]
    Clocks {
        /// First and last sample (s).
        imu: (f64, f64),
        /// First and last fix (s).
        gnss: (f64, f64),
    },
    /// It begins after the data end, or before they begin.
    #[error("the start at {t_s:.2} s is not within the IMU's {} to {} s", .imu.0, .imu.1)]
    Start {
        /// The start (s).
        t_s: f64,
        /// First and last sample (s).
        imu: (f64, f64),
    },
    /// The initial position is not where the fixes are.
    #[error(
        "the initial position is {metres:.0} m from the fix at {t_s:.2} s, with a standard deviation of {sigma_m:.1} m"
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
    #[error("latitude {lat_deg:.3}° at {t_s:.2} s is beyond ±89.9°")]
    Pole {
        /// When (s).
        t_s: f64,
        /// Where (degrees).
        lat_deg: f64,
    },
    /// What a smoother would have to keep.
    #[error("the smoother would take {:.1} GB for {marks} rows and fixes of {states} states, 2 GB at most", bytes / 1e9)]
    Memory {
        /// How much (bytes).
        bytes: f64,
        /// Rows and fixes.
        marks: f64,
        /// States of the filter.
        states: usize,
    },
    /// State or covariance stopped being finite.
    #[error("the filter diverged at {t_s:.2} s")]
    Diverged {
        /// When (s).
        t_s: f64,
    },
}

/// Seconds of a GNSS week.
const WEEK_S: f64 = 604_800.0;

impl FusionError {
    /// How late the fixes are by their clock, where that is why nothing overlaps (s): whole weeks, or what makes both
    /// recordings begin in the same second.
    #[must_use]
    pub fn delay_s(&self) -> Option<f64> {
        let Self::Clocks { imu, gnss } = self else {
            return None;
        };
        let apart_s = gnss.0 - imu.0;
        let overlap = |delay_s: &f64| gnss.0 - delay_s <= imu.1 && imu.0 <= gnss.1 - delay_s;
        [WEEK_S, 1.0]
            .map(|step| (apart_s / step).round() * step)
            .into_iter()
            .find(overlap)
    }
}
