//! The commands, one file each.

pub mod batch;
pub mod calibrate;
pub mod check;
pub mod choose;
pub mod compare;
pub mod datasheet;
pub mod design;
pub mod export;
pub mod fuse;
pub mod inspect;
pub mod judge;
pub mod require;
pub mod run;
pub mod synthesize;
pub mod trajectory;
pub mod tune;
pub mod wv;

use crate::app::{Command, Failure, RenderedAnswer, Reporter, Result, answered};
use serde_json::{Map, Value};

/// Calls a macro with all commands that answer a question, in the order of the help.
macro_rules! with_commands {
    ($then:ident) => {
        $then! {
            Wv: crate::commands::wv::Wv,
            Calibrate: crate::commands::calibrate::Calibrate,
            Choose: crate::commands::choose::Choose,
            Design: crate::commands::design::Design,
            Synthesize: crate::commands::synthesize::Synthesize,
            Datasheet: crate::commands::datasheet::DatasheetArgs,
            Export: crate::commands::export::ExportArgs,
            Tune: crate::commands::tune::Tune,
            Require: crate::commands::require::Require,
            Run: crate::commands::run::Run,
            Compare: crate::commands::compare::Compare,
            Fuse: crate::commands::fuse::Fuse,
            Judge: crate::commands::judge::Judge,
            Inspect: crate::commands::inspect::Inspect,
            Check: crate::commands::check::CheckFiles,
        }
    };
}
pub(crate) use with_commands;

macro_rules! by_name {
    ($($variant:ident: $command:path),* $(,)?) => {
        /// Answers a request by the names of a command and its options, without writing files.
        ///
        /// # Errors
        /// Unknown names, values that are refused, and why there is no answer.
        pub fn answer(
            name: &str,
            options: Map<String, Value>,
            front: &dyn Reporter,
        ) -> Result<RenderedAnswer> {
            $(if name == <$command as Command>::NAME {
                return answered::<$command>(options, front);
            })*
            if name == trajectory::Convert::NAME {
                return answered::<trajectory::Convert>(options, front);
            }
            Err(Failure::input(format!("there is no command {name}")))
        }
    };
}
with_commands!(by_name);
