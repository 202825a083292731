//! Jobs that all commands share.

mod context;

pub use context::{Context, DEFAULT_SEED, Front};
