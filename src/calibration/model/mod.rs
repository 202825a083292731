//! The model that is fitted: a sum of processes, and the limits of their parameters.

mod limits;
mod spec;

pub use limits::{LimitError, Limits};
pub use spec::{BoundDomain, ModelSpec, SpecError};
