//! How sure a fit is: curves drawn anew, intervals, tests.

pub(crate) mod alike;
mod anticipated;
pub(crate) mod axes;
pub(crate) mod bootstrap;
mod goodness;
mod indistinct;
pub(crate) mod inference;
mod influence;
mod intervals;
mod practical;
mod sandwich;
pub(crate) mod spread;

pub use alike::LEVEL as ALIKE_LEVEL;
pub use anticipated::{Anticipated, AnticipationError, Scattering};
pub use influence::CurveInfluence;
pub(crate) use intervals::WIDEST;
pub use intervals::derived_interval;
