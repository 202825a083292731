//! Jobs that all commands share: options and requests by name, notes and progress, inputs, outputs and failures.

mod command;
mod context;
mod failure;
pub(crate) mod inputs;
mod manifest;
mod outputs;
pub mod reading;

pub use command::{Answer, Answered, Asked, Command, Out, OutputFile, answered};
pub use context::{Context, DEFAULT_SEED, Front};
pub use failure::{Failure, Result};
pub(crate) use failure::{OrHelp, Place, Refuse, help, is_damage, system_words};

pub use manifest::{Input, Manifest};
