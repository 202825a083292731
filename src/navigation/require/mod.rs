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
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// What is limited at the end of an outage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Median of the horizontal error (m).
    P50,
    /// 95 % quantile of the horizontal error (m).
    P95,
    /// Root mean square of the horizontal error (m).
    Rmse,
    /// RMSE of roll, pitch or yaw (degrees): 0, 1, 2.
    Angle(usize),
}

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 6] = [
        Self::P95,
        Self::P50,
        Self::Rmse,
        Self::Angle(0),
        Self::Angle(1),
        Self::Angle(2),
    ];

    /// Its name, unit included.
    pub const fn name(self) -> &'static str {
        match self {
            Self::P50 => "p50_m",
            Self::P95 => "p95_m",
            Self::Rmse => "rmse_m",
            Self::Angle(0) => "roll_deg",
            Self::Angle(1) => "pitch_deg",
            Self::Angle(_) => "yaw_deg",
        }
    }

    /// Its unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::P50 | Self::P95 | Self::Rmse => "m",
            Self::Angle(_) => "deg",
        }
    }

    /// A value with its unit, to a thousandth; a larger one, or a smaller, in powers of ten.
    pub fn shown(self, value: f64) -> String {
        let rounded = (value * 1e3).round() / 1e3;
        if (1e-3..1e6).contains(&value) {
            format!("{rounded} {}", self.unit())
        } else {
            format!("{value:.2e} {}", self.unit())
        }
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A quantity and the most it may be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limit {
    /// The quantity.
    pub quantity: Quantity,
    /// Its largest value allowed (m or degrees).
    pub most: f64,
}

/// The limit that is the hardest to keep, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Worst {
    /// The limit.
    pub limit: Limit,
    /// The error there.
    pub value: f64,
    /// At which place of the outage, counted from 0.
    pub place: usize,
}

impl Serialize for Worst {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut entry = serializer.serialize_struct("Worst", 4)?;
        entry.serialize_field("quantity", &self.limit.quantity)?;
        entry.serialize_field("value", &self.value)?;
        entry.serialize_field("limit", &self.limit.most)?;
        entry.serialize_field("place", &self.place)?;
        entry.end()
    }
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
        let margins = |worst: &Self| (worst.margin(), worst.margin().is_nan());
        limits.iter().filter_map(worst_of_limit).min_by(|a, b| {
            let ((a, a_is_nan), (b, b_is_nan)) = (margins(a), margins(b));
            // what is not a number is the hardest
            b_is_nan.cmp(&a_is_nan).then(a.total_cmp(&b))
        })
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
    /// Curves have a value each second.
    #[error("{length_s} s is not a whole number of seconds")]
    PartOfASecond {
        /// The length asked for (s).
        length_s: f64,
    },
    /// A unit of several cannot be judged.
    #[error("{name}: {source}")]
    Unit {
        /// Which.
        name: String,
        /// Why.
        source: Box<RequireError>,
    },
    /// The model has no filter.
    #[error(transparent)]
    Belief(#[from] BeliefError),
    /// Trajectory, rates and fixes do not fit together.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
}
