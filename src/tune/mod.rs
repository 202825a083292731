//! Tuning of a noise model: the smallest factors on its variances that make its filter consistent with other truths.

mod document;
mod job;
mod result;

pub(crate) use job::{Truths, TuneInputs, tune, tuned};
