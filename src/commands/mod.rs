//! The commands, one file each.

pub mod batch;
pub mod calibrate;
pub mod choose;
pub mod compare;
pub mod datasheet;
pub mod design;
pub mod fuse;
pub mod inspect;
pub mod require;
pub mod run;
pub mod tune;
pub mod wv;

use crate::app::{Answered, Context, Failure, Result, answered};
use serde_json::{Map, Value};

/// Answers a request by the names of a command and its options, without writing files.
///
/// # Errors
/// Unknown names, values that are refused, and why there is no answer.
pub fn answer(name: &str, options: &Map<String, Value>, context: Context<'_>) -> Result<Answered> {
    match name {
        "calibrate" => answered::<crate::commands::calibrate::Calibrate>(options, context),
        "choose" => answered::<crate::commands::choose::Choose>(options, context),
        "compare" => answered::<compare::Compare>(options, context),
        "datasheet" => answered::<datasheet::DatasheetArgs>(options, context),
        "design" => answered::<design::Design>(options, context),
        "fuse" => answered::<crate::commands::fuse::Fuse>(options, context),
        "inspect" => answered::<inspect::Inspect>(options, context),
        "require" => answered::<crate::commands::require::Require>(options, context),
        "run" => answered::<run::Run>(options, context),
        "tune" => answered::<tune::Tune>(options, context),
        "wv" => answered::<wv::Wv>(options, context),
        other => Err(Failure::input(format!("there is no command {other}"))),
    }
}
