//! Why there is no solution: what helps.

use super::FuseError;
use crate::app::{Failure, option_elsewhere};
use crate::formats::Setting;

impl From<FuseError> for Failure {
    fn from(e: FuseError) -> Self {
        match e {
            // All six channels are needed, as the file names them: without the options for static recordings.
            FuseError::File(e) => Self::of_file(&e, |setting| match setting {
                Setting::ColumnNames => Some("correct the header"),
                Setting::Channels | Setting::FewerChannels | Setting::Gaps => None,
                Setting::RemoveLine => Some("remove the line: gaps of up to 5 s are bridged"),
                other => Some(option_elsewhere(other)),
            }),
            e if e.is_input() => Self::input(&e).maybe_hint(e.hint()),
            e => Self::could_not(&e).maybe_hint(e.hint()),
        }
    }
}
