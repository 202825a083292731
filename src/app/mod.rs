//! Jobs that all commands share: options and requests by name, notes and progress, inputs, outputs and failures.

mod command;
mod context;
pub(crate) mod inputs;
pub mod reading;

pub use crate::failure::{Failure, Result};
pub(crate) use crate::failure::{IntoFailure, refused};
pub use crate::io::input::Input;
pub use command::{
    Answer, Command, Inputs, Invocation, Manifest, OutputFile, OutputKind, PlainAnswer,
    RenderedAnswer, answered,
};
pub(crate) use command::{argument, is_path, is_repeated};
pub use context::{Context, DEFAULT_SEED, Reporter};
