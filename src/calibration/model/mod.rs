//! What is fitted: a sum of processes, and where their parameters may be.

mod limits;
mod spec;

pub use limits::{LimitError, Limits};
pub use spec::{ModelSpec, SpecError};
