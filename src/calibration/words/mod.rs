//! A calibration in words: remarks, reasons, advice. Numbers are decided elsewhere.

mod diagnosis;
mod format;
mod inference;
mod notes;
mod ranking;

pub use diagnosis::{advice, effects};
pub use format::{duration, percent};
pub(crate) use inference::notes_of_inference;
pub use inference::undetermined;
pub(crate) use notes::notes;
pub use notes::{Share, axes_remark, correlation_time_s, shares, signals};
pub use ranking::reasons;
