//! Static recordings → their wavelet variances.

use crate::app::Context;
use crate::calibrate::{visit, without_warm_up};
use crate::formats::recordings::ReadOptions;
use crate::jobs::JobError;
use crate::report::{SignalCurves, SignalsFile};
use nav_sim_calibration::{Replicate, replicates};
use nav_sim_signal::imu::{Channel, Recording};
use nav_sim_signal::wavelet::{Tuning, WaveletError, haar, interval};
use rayon::prelude::*;
use std::path::PathBuf;

/// Where the degrees of freedom of intervals are from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Intervals {
    /// The field's usual ones, conservative beyond the first scale.
    #[default]
    Eta3,
    /// From the autocovariance of the coefficients: cover at their level.
    LargeSample,
}

nav_sim_signal::named!(Intervals { Eta3 = "eta3", LargeSample = "large-sample" });
crate::parse::textual!(Intervals);

/// How wavelet variances are taken.
#[derive(Debug, Clone, Default)]
pub(crate) struct WaveletOptions {
    /// How the recordings are read.
    pub reading: ReadOptions,
    /// Whether each recording's warm-up, as it is found, is left out.
    pub skip_warm_up: bool,
    /// Number of scales; none: one less than each signal allows.
    pub scales: Option<u32>,
    /// Tuning of the robust ones.
    pub tuning: Tuning,
    /// Where the intervals' degrees of freedom are from.
    pub intervals: Intervals,
}

/// The wavelet variances of all signals of recordings, or directories of them.
///
/// # Errors
/// When a recording cannot be read, or is too short for the scales.
pub(crate) fn wavelet_variances(
    paths: &[PathBuf],
    options: &WaveletOptions,
    context: &Context<'_>,
) -> Result<SignalsFile, JobError> {
    let WaveletOptions {
        reading,
        skip_warm_up,
        scales,
        tuning,
        intervals,
    } = options;
    // Four samples have a scale.
    let reading = ReadOptions {
        min_samples: scales.map_or(4, |j| 1 << j),
        ..reading.clone()
    };
    let look = |recording: Recording| -> Result<Vec<SignalCurves>, JobError> {
        let recording = if *skip_warm_up {
            without_warm_up(recording, true).0
        } else {
            recording
        };
        let measured = replicates(&recording, *scales, tuning)?;
        let curves = |(channel, replicate): &(Channel, Replicate)| {
            let edof = degrees_of_freedom(*intervals, &recording, *channel, replicate)?;
            Ok(SignalCurves::new(
                *channel,
                replicate,
                recording.rate_hz,
                edof,
                tuning.efficiency(),
            ))
        };
        Ok(measured
            .par_iter()
            .map(curves)
            .collect::<Result<_, WaveletError>>()?)
    };
    let (looks, report) = visit(paths, &reading, &look, context)?;
    let signals = looks
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .flatten()
        .collect();
    Ok(SignalsFile::new(
        report.files[0].rate_hz,
        tuning.efficiency(),
        intervals.name(),
        signals,
    ))
}

fn degrees_of_freedom(
    intervals: Intervals,
    recording: &Recording,
    channel: Channel,
    replicate: &Replicate,
) -> Result<Vec<f64>, WaveletError> {
    let levels = 1..=replicate.classical.len() as u32;
    match (intervals, recording.signal(channel)) {
        // Of a signal with holes eta3 of what is there.
        (Intervals::LargeSample, Some(signal)) if replicate.coverage.is_empty() => levels
            .map(|level| {
                Ok(interval::edof_large_sample(
                    &haar::coefficients(&signal.samples, level)?,
                    level,
                ))
            })
            .collect(),
        _ => Ok(levels.map(|level| replicate.edof_eta3(level)).collect()),
    }
}
