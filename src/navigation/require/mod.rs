//! The IMU that keeps the errors at the end of an outage within a limit, and the margin of a given IMU.
//!
//! Everything here is linear covariance analysis of a filter that knows its IMU: a state for every process, with the
//! gains that follow. Errors grow with every noise intensity, so each answer is the zero of a monotone function.
//!
//! ```
//! use nav_sim_navigation::require::{Limit, Quantity, Worst};
//!
//! let limit = Limit { quantity: Quantity::P95, most: 5.0 };
//! let found = Worst { limit, value: 10.0, place: 0 };
//! // Twice the error allowed.
//! assert!((found.margin() + 2_f64.ln()).abs() < 1e-15);
//! ```

mod course;
mod imu;

pub use course::{Course, Drift, evenly};
pub use imu::{Answer, IMU_PARAMETERS, ImuParameters, Margins, Need};

use crate::ekf::BeliefError;
use crate::simulation::ExperimentError;
use serde::Serialize;
use std::str::FromStr;

/// What is limited at the end of an outage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// 95 % quantile of the horizontal error (m).
    P95,
    /// Its median (m).
    P50,
    /// Its root mean square (m).
    Rmse,
    /// RMSE of roll (degrees).
    Roll,
    /// RMSE of pitch (degrees).
    Pitch,
    /// RMSE of yaw (degrees).
    Yaw,
}

nav_sim_signal::named!(Quantity {
    P95 = "p95_m",
    P50 = "p50_m",
    Rmse = "rmse_m",
    Roll = "roll_deg",
    Pitch = "pitch_deg",
    Yaw = "yaw_deg",
}, in files);

impl Quantity {
    /// Roll, pitch or yaw, from 0.
    fn angle(self) -> Option<usize> {
        (self as usize).checked_sub(Self::Roll as usize)
    }

    /// A value with its unit, to a thousandth; a larger one, or a smaller, in powers of ten.
    pub fn shown(self, value: f64) -> String {
        let unit = if self.angle().is_some() { "deg" } else { "m" };
        let rounded = (value * 1e3).round() / 1e3;
        if (1e-3..1e6).contains(&value) {
            format!("{rounded} {unit}")
        } else {
            format!("{value:.2e} {unit}")
        }
    }
}

/// A quantity and the most it may be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limit {
    /// The quantity.
    pub quantity: Quantity,
    /// Its largest value allowed (m or degrees).
    #[serde(rename = "limit")]
    pub most: f64,
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (name, most) = text.split_once("<=").or_else(|| text.split_once('<'))?;
            let most: f64 = most.trim().parse().ok()?;
            let quantity = name.trim().parse().ok()?;
            (most > 0.0 && most.is_finite()).then_some(Self { quantity, most })
        };
        let names = || Quantity::NAMES.join(", ");
        read().ok_or_else(|| {
            format!(
                "expected NAME<=LIMIT with a positive limit, NAME one of {}",
                names()
            )
        })
    }
}

/// The limit that is the hardest to keep, and where.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Worst {
    /// The limit.
    #[serde(flatten)]
    pub limit: Limit,
    /// The error there.
    pub value: f64,
    /// At which place of the outage, counted from 0.
    pub place: usize,
}

impl Worst {
    /// Logarithm of limit over error: above 0 there is a reserve.
    pub fn margin(&self) -> f64 {
        // In logarithms limits of different units compare, and the margin is nearly linear in the logarithm
        // of an intensity.
        (self.limit.most / self.value).ln()
    }

    /// The hardest of some limits for the errors at several places; none without limits or places.
    pub fn of(limits: &[Limit], drifts: &[Drift]) -> Option<Self> {
        let worst_of_limit = |limit: &Limit| {
            let (place, value) = Drift::largest(drifts, limit.quantity)?;
            Some(Self {
                limit: *limit,
                value,
                place,
            })
        };
        // what is not a number is the hardest
        let margin = |worst: &Self| Some(worst.margin()).filter(|margin| !margin.is_nan());
        let key = |worst: &Self| margin(worst).unwrap_or(f64::NEG_INFINITY);
        limits
            .iter()
            .filter_map(worst_of_limit)
            .min_by(|a, b| key(a).total_cmp(&key(b)))
    }
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum RequireError {
    /// Not even an IMU without errors keeps a limit.
    #[error("no IMU keeps {} ≤ {}: without any noise of it, the error is {}, from GNSS, the start and what else the scenario has", limit.quantity.name(), limit.quantity.shown(limit.most), limit.quantity.shown(*value))]
    Floor {
        /// The limit.
        limit: Limit,
        /// The error with a perfect IMU.
        value: f64,
    },
    /// The poorest IMU that is sought keeps every limit.
    #[error("no IMU is too poor for {} ≤ {}: any that is sought keeps it; with the poorest of the search the error is {} ({})", limit.quantity.name(), limit.quantity.shown(limit.most), limit.quantity.shown(*value), poorest.in_words())]
    Loose {
        /// The hardest limit.
        limit: Limit,
        /// The error with the poorest IMU.
        value: f64,
        /// That IMU.
        poorest: ImuParameters,
    },
    /// The model has no filter.
    #[error(transparent)]
    Belief(#[from] BeliefError),
    /// Trajectory, rates and fixes do not fit together.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
}
