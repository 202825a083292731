//! Uncertainty of a fit: curves drawn anew, intervals, tests.

pub(crate) mod bootstrap;
pub(crate) mod intervals;
pub(crate) mod spread;
mod varying;

pub use bootstrap::ScatterSource;
pub use intervals::{UNDETERMINED_RATIO, derived_interval, figures_with_intervals};
pub use spread::LEVEL as ALIKE_LEVEL;
