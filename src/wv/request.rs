//! The request of wavelet variances: the arguments of `nav-sim wv`.

use super::job::{Intervals, WaveletOptions, wavelet_variances};
use crate::app::Answered;
use crate::app::Context;
use crate::app::Failure;
use crate::jobs::{RecordingRequest, VarianceRequest};
use crate::parse;
use crate::report::SignalsFile;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Recordings, and how their wavelet variances are taken.
#[derive(clap::Args, Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WaveletRequest {
    /// Recordings, or directories of recordings
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// How they are read.
    #[command(flatten)]
    pub recordings: RecordingRequest,
    /// Scales and robustness.
    #[command(flatten)]
    pub tuning: VarianceRequest,
    /// Where the degrees of freedom of the intervals come from
    #[arg(long, value_parser = parse::words::<Intervals>(&INTERVALS), default_value_t, help_heading = "Wavelet variance")]
    pub intervals: Intervals,
}

const INTERVALS: [(&str, &str); 2] = [
    (
        Intervals::Eta3.name(),
        "The field's usual ones, conservative beyond the first scale",
    ),
    (
        Intervals::LargeSample.name(),
        "From the autocovariance of the coefficients: with the stated coverage",
    ),
];

impl WaveletRequest {
    /// The curves.
    pub(crate) fn curves(&self, context: &Context<'_>) -> Result<SignalsFile, Failure> {
        let options = WaveletOptions {
            reading: self.recordings.options(),
            skip_warm_up: self.recordings.reading.skips_warm_up(),
            scales: self.tuning.levels(),
            tuning: self.tuning.tuning()?,
            intervals: self.intervals,
        };
        Ok(wavelet_variances(&self.files, &options, context)?)
    }

    /// As `nav-sim wv` prints it.
    ///
    /// # Errors
    /// When a recording cannot be read, or is too short for the scales.
    pub fn answer(&self, context: &Context<'_>) -> Result<Answered, Failure> {
        Ok(Answered::of(&self.curves(context)?))
    }
}
