//! From recordings to groups of replicates: the wavelet variances of every signal.

use super::average::Replicate;
use crate::imu::{Axis, Channel, Recording, Sensor, Signal};
use crate::wavelet::{Gappy, Tuning, WaveletError, both, default_levels, gappy};
use rayon::prelude::*;

/// Sensor, and axis if not all, that one model is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scope {
    /// The sensor.
    pub sensor: Sensor,
    /// The axis; none if the axes are pooled.
    pub axis: Option<Axis>,
}

impl Scope {
    /// `accel.x`, or `accel` if the axes are pooled.
    #[must_use]
    pub fn name(&self) -> String {
        match self.axis {
            None => self.sensor.name().to_owned(),
            Some(axis) => Channel {
                sensor: self.sensor,
                axis,
            }
            .to_string(),
        }
    }

    /// The channels it covers.
    #[must_use]
    pub fn channels(&self) -> Vec<Channel> {
        let axes = self.axis.map_or(Axis::ALL.to_vec(), |axis| vec![axis]);
        axes.into_iter()
            .map(|axis| Channel {
                sensor: self.sensor,
                axis,
            })
            .collect()
    }
}

/// Signals to which one model is fitted: replicates of one axis, or of all axes of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Scope of the model.
    pub scope: Scope,
    /// The replicates, each with the axis it is of.
    pub replicates: Vec<Replicate>,
}

impl Group {
    /// Recordings that the replicates are of.
    pub(crate) fn recordings(&self) -> usize {
        let mut names: Vec<&str> = self.replicates.iter().map(|r| r.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
    }
}

/// Rule by which signals are replicates of one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pool {
    /// Those of one axis: a model an axis.
    Axes,
    /// Those of all axes of a sensor: one model a sensor.
    Sensor,
}

nav_sim_signal::named!(Pool { Axes = "axes", Sensor = "sensor" }, in files);

/// A signal without a wavelet variance.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{recording}, {channel}: {source}")]
pub struct SignalError {
    /// The recording.
    pub recording: String,
    /// The signal.
    pub channel: Channel,
    /// Why.
    pub source: WaveletError,
}

/// The wavelet variances of all signals of a recording, in their order; missing samples are NaN. Without a number of levels there are as
/// many as usual for its length.
///
/// # Errors
/// When it is too short for the levels.
pub fn replicates(
    recording: &Recording,
    levels: Option<u32>,
    tuning: &Tuning,
) -> Result<Vec<(Channel, Replicate)>, SignalError> {
    let replicate = |signal: &Signal| {
        let (channel, samples) = (signal.channel, signal.samples.len());
        let levels = levels.unwrap_or_else(|| default_levels(samples));
        let error = |source| SignalError {
            recording: recording.name.clone(),
            channel,
            source,
        };
        let (classical, robust, coverage) = if signal.samples.iter().any(|x| x.is_nan()) {
            let Gappy {
                classical,
                robust,
                coverage,
            } = gappy(&signal.samples, levels, tuning).map_err(error)?;
            (classical, robust, coverage)
        } else {
            let (classical, robust) = both(&signal.samples, levels, tuning).map_err(error)?;
            (classical, robust, Vec::new())
        };
        let (name, axis) = (recording.name.clone(), Some(channel.axis));
        let trend = trend(&signal.samples);
        // Of the samples themselves too: a warm-up may have been left out after the mean was taken.
        let mean = signal.mean + mean_about(0.0, &signal.samples);
        Ok((
            channel,
            Replicate {
                name,
                axis,
                samples,
                classical,
                robust,
                coverage,
                trend,
                mean,
            },
        ))
    };
    recording.signals.par_iter().map(replicate).collect()
}

/// Mean of the later half of a signal less that of its earlier half; the middle one of an odd number is left out.
#[must_use]
pub fn trend(samples: &[f64]) -> f64 {
    let half = samples.len() / 2;
    // Half by half about their first value, so that no digits of a small change are lost.
    let first = samples.iter().copied().find(|x| !x.is_nan()).unwrap_or(0.0);
    mean_about(first, &samples[samples.len() - half..]) - mean_about(first, &samples[..half])
}

/// Mean distance from a value of the samples that are there; missing ones are NaN.
pub(super) fn mean_about(value: f64, samples: &[f64]) -> f64 {
    let present = || samples.iter().filter(|x| !x.is_nan());
    present().map(|x| x - value).sum::<f64>() / present().count() as f64
}

/// The groups, in the order of [`Channel::ALL`].
#[must_use]
pub fn grouped(replicates: Vec<(Channel, Replicate)>, pool: Pool) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let mut replicates = replicates;
    // A stable sort: within a channel the recordings keep the order in which they were given.
    replicates.sort_by_key(|(channel, _)| channel.index());
    for (channel, replicate) in replicates {
        let axis = (pool == Pool::Axes).then_some(channel.axis);
        let scope = Scope {
            sensor: channel.sensor,
            axis,
        };
        match groups.last_mut() {
            Some(group) if group.scope == scope => group.replicates.push(replicate),
            _ => groups.push(Group {
                scope,
                replicates: vec![replicate],
            }),
        }
    }
    groups
}
