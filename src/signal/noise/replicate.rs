//! Virtual replicates: what a laboratory would record, switched on again and again.

use super::contamination::{Contamination, RefusedRule};
use super::{Model, Spread, SpreadError, Synthesizer};
use crate::imu::{Channel, Recording, Signal};
use crate::rng::StreamKey;

/// Source of virtual replicates: an IMU with known noise.
#[derive(Debug, Clone, Copy)]
pub struct VirtualImu<'a> {
    /// The noise.
    pub model: &'a Model,
    /// Variation of its parameters between replicates; none: they do not vary.
    pub spread: Option<&'a Spread>,
    /// Contamination of the signals; none: they are clean.
    pub contamination: Option<&'a Contamination>,
    /// Seed of everything.
    pub seed: u64,
}

/// A replicate that cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReplicateError {
    /// The spread does not belong to the model.
    #[error(transparent)]
    Spread(#[from] SpreadError),
    /// The contamination does not fit the model or the record.
    #[error("{source} (replicate {replicate})")]
    Contamination {
        /// Which replicate, counted from 1.
        replicate: u64,
        /// Why.
        source: RefusedRule,
    },
}

impl VirtualImu<'_> {
    /// The model of a replicate, counted from 1: parameters drawn, then scaled by the contamination.
    ///
    /// # Errors
    /// When spread or contamination do not belong to the model.
    pub fn model_of(&self, replicate: u64) -> Result<Model, ReplicateError> {
        let mut model = match self.spread {
            Some(spread) => spread.draw(self.model, self.seed, replicate.wrapping_sub(1))?,
            None => self.model.clone(),
        };
        for channel in Channel::ALL {
            let Some(contamination) = self.contamination else {
                break;
            };
            let (noise, rate_hz) = (&mut model.axes[channel.index()], model.rate_hz);
            contamination
                .scale(noise, channel, replicate, rate_hz)
                .map_err(|source| ReplicateError::Contamination { replicate, source })?;
        }
        Ok(model)
    }

    /// The signal of one channel of a replicate (counted from 1) with the model from
    /// [`VirtualImu::model_of`] (m/s² or rad/s).
    ///
    /// # Errors
    /// When the record is too short for the contamination.
    pub fn signal(
        &self,
        model: &Model,
        replicate: u64,
        channel: Channel,
        samples: usize,
    ) -> Result<Vec<f64>, ReplicateError> {
        let source = channel.to_string();
        let run = replicate.wrapping_sub(1);
        let key = StreamKey {
            seed: self.seed,
            scenario: "",
            run,
            source: &source,
            process: "",
        };
        let mut out = vec![0.0; samples];
        Synthesizer::new(model.axis(channel), key).fill(&mut out);
        if let Some(contamination) = self.contamination {
            contamination
                .apply(&mut out, channel, replicate, model.rate_hz, self.seed)
                .map_err(|source| ReplicateError::Contamination { replicate, source })?;
        }
        Ok(out)
    }

    /// A replicate (counted from 1) as a recording, means removed.
    ///
    /// # Errors
    /// When spread or contamination do not belong to the model or the record.
    pub fn recording(
        &self,
        replicate: u64,
        channels: &[Channel],
        samples: usize,
    ) -> Result<Recording, ReplicateError> {
        let model = self.model_of(replicate)?;
        let signal = |channel: &Channel| {
            let mut x = self.signal(&model, replicate, *channel, samples)?;
            let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
            x.iter_mut().for_each(|v| *v -= mean);
            Ok(Signal {
                channel: *channel,
                mean,
                samples: x,
            })
        };
        let signals = channels
            .iter()
            .map(signal)
            .collect::<Result<_, ReplicateError>>()?;
        Ok(Recording {
            name: format!("replicate_{replicate}"),
            rate_hz: model.rate_hz,
            signals,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::{Axis, Sensor};
    use crate::noise::contamination::{Operation, Rule};
    use crate::noise::{Composite, Law, Process, Variation};

    const X: Channel = Channel {
        sensor: Sensor::Accel,
        axis: Axis::X,
    };

    fn model() -> Model {
        let process =
            |code, values: &[f64]| Process::from_values(code, values, 100.0).unwrap().unwrap();
        let noise = Composite::new(vec![process("WN", &[1.0]), process("RW", &[0.01])]);
        Model::pooled(100.0, &noise, &noise)
    }

    #[test]
    fn replicates_differ_and_repeat_and_contamination_leaves_the_noise_alone() {
        let model = model();
        let clean = VirtualImu {
            model: &model,
            spread: None,
            contamination: None,
            seed: 3,
        };
        let first = clean.signal(&model, 1, X, 100).unwrap();
        assert_ne!(first, clean.signal(&model, 2, X, 100).unwrap());
        assert_eq!(first, clean.signal(&model, 1, X, 100).unwrap());

        let operation = Operation::Step {
            at: crate::noise::contamination::Extent::Share(0.5),
            amplitude: 1000.0,
        };
        let rule = Rule {
            sensor: Sensor::Accel,
            replicate: Some(1),
            operation,
            place: String::new(),
        };
        let contamination = Contamination {
            name: "step".into(),
            rules: vec![rule],
        };
        let dirty = VirtualImu {
            contamination: Some(&contamination),
            ..clean
        };
        let stepped = dirty.signal(&model, 1, X, 100).unwrap();
        assert_eq!(stepped[..50], first[..50]);
        assert!(
            stepped[50..]
                .iter()
                .zip(&first[50..])
                .all(|(a, b)| (a - b - 1000.0).abs() < 1e-9)
        );
    }

    #[test]
    fn parameters_are_drawn_then_scaled() {
        let model = model();
        let law = Law::Beta {
            a: 2.0,
            b: 2.0,
            low: 1.0,
            width: 1.0,
        };
        let variation = Variation::new(&model.axes[0], 100.0, "RW", "gamma2", law).unwrap();
        let mut spread = Spread::default();
        spread.axes[0].push(variation);
        let operation = Operation::Scale {
            process: "RW".into(),
            parameter: "gamma2".into(),
            factor: 4.0,
        };
        let rule = Rule {
            sensor: Sensor::Accel,
            replicate: Some(1),
            operation,
            place: String::new(),
        };
        let contamination = Contamination {
            name: "scale".into(),
            rules: vec![rule],
        };
        let drawn = VirtualImu {
            model: &model,
            spread: Some(&spread),
            contamination: None,
            seed: 3,
        };
        let scaled = VirtualImu {
            contamination: Some(&contamination),
            ..drawn
        };
        let gamma2 = |imu: &VirtualImu<'_>, replicate| {
            imu.model_of(replicate).unwrap().axes[0].processes[1].parameters()[0].1
        };
        let ratio = |replicate| gamma2(&scaled, replicate) / gamma2(&drawn, replicate);
        assert!((ratio(1) - 4.0).abs() < 1e-14 && (ratio(2) - 1.0).abs() < 1e-14);
    }
}
