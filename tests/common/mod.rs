//! Parts that several tests share: a study in a directory, a drive and its recording.

pub mod batch;
pub mod drive;
