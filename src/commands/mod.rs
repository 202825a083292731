//! The commands, one file each.

pub mod batch;
pub mod compare;
pub mod datasheet;
pub mod design;
pub mod inspect;
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
        "calibrate" => answered::<crate::calibrate::Calibrate>(options, context),
        "choose" => answered::<crate::choose::Choose>(options, context),
        "compare" => answered::<compare::Compare>(options, context),
        "datasheet" => answered::<datasheet::DatasheetArgs>(options, context),
        "design" => answered::<design::Design>(options, context),
        "fuse" => answered::<crate::fuse::Fuse>(options, context),
        "inspect" => answered::<inspect::Inspect>(options, context),
        "require" => answered::<crate::require::Require>(options, context),
        "run" => answered::<run::Run>(options, context),
        "tune" => answered::<tune::Tune>(options, context),
        "wv" => answered::<wv::Wv>(options, context),
        other => Err(Failure::input(format!("there is no command {other}"))),
    }
}
