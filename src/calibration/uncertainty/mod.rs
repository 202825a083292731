//! Uncertainty of a fit: curves drawn anew, intervals, tests.

pub(crate) mod alike;
pub(crate) mod axes;
pub(crate) mod bootstrap;
mod goodness;
mod indistinct;
pub(crate) mod inference;
pub(crate) mod intervals;
pub(crate) mod practical;
mod sandwich;
pub(crate) mod spread;
mod varying;

pub use alike::LEVEL as ALIKE_LEVEL;
pub use bootstrap::Scattering;
pub use intervals::{WIDEST, derived_interval};
