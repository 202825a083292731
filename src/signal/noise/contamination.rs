//! Contamination: what goes wrong in a laboratory, done to signals on purpose, in doses and with a seed.
//!
//! Steps, replaced points and vibrations as in [Minaretzis](crate::bibliography::Minaretzis24), Sections IV
//! and V. Whatever the order in which rules are given, they are applied in this one: scaled parameters
//! (before synthesis), added AR1, heavy tails, step, drift, replacement, bursts.

use super::{Composite, Process, Synthesizer};
use crate::imu::{Channel, Sensor};
use crate::rng::StreamKey;
use crate::units::Refused;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal, StudentT};
use serde::Serialize;

/// A number of samples, given as such or as a share of the record.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Extent {
    /// That many samples.
    Samples(u64),
    /// That share of the record's samples, rounded down.
    Share(f64),
}

impl Extent {
    /// In samples of a record of `length` samples.
    fn of(self, length: usize) -> usize {
        match self {
            Self::Samples(n) => usize::try_from(n).unwrap_or(usize::MAX),
            // A share written as a ratio of whole numbers must not lose one to rounding.
            Self::Share(share) => (share * length as f64 + 1e-6) as usize,
        }
    }
}

/// Operation on a signal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Operation {
    /// Multiplies a parameter of the model, before synthesis.
    Scale {
        /// Label of the process ([`Composite::labels`]).
        process: String,
        /// Name of the parameter.
        parameter: String,
        /// Factor.
        factor: f64,
    },
    /// Adds an AR1.
    Ar1(Process),
    /// Adds white noise of heavy tails: Student's t.
    HeavyTails {
        /// Degrees of freedom, above 2: the variance is sigma²·freedom/(freedom − 2).
        freedom: f64,
        /// Scale (m/s² or rad/s).
        sigma: f64,
    },
    /// Adds a constant from a sample on.
    Step {
        /// First sample with it.
        at: Extent,
        /// The constant (m/s² or rad/s).
        amplitude: f64,
    },
    /// Adds a ramp, from 0 at the first sample to its amplitude at the last.
    Drift {
        /// At the end (m/s² or rad/s).
        amplitude: f64,
    },
    /// Replaces samples, chosen at random, by white noise.
    Replace {
        /// Number of samples replaced.
        points: Extent,
        /// Length of the blocks in which they stand; the last block may be shorter.
        block: Extent,
        /// Mean of the noise; none: the signal's mean.
        mean: Option<f64>,
        /// Standard deviation of the noise (m/s² or rad/s).
        sigma: f64,
    },
    /// Adds vibrations: sines that begin with phase 0 at multiples of the spacing.
    Bursts {
        /// Number of bursts.
        count: u64,
        /// Length of each.
        length: Extent,
        /// Distance between the beginnings of two bursts, and between those of the record and of the first
        /// burst.
        spacing: Extent,
        /// Amplitude (m/s² or rad/s).
        amplitude: f64,
        /// Frequency (Hz).
        frequency_hz: f64,
    },
}

/// An operation and the signals it is done to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rule {
    /// Sensor, all its axes.
    pub sensor: Sensor,
    /// Replicate, counted from 1 as in file names; none: every one.
    pub replicate: Option<u64>,
    /// The operation.
    pub operation: Operation,
    /// Place in a file, such as "shocks.toml, line 3"; empty for a rule that is in none.
    #[serde(skip)]
    pub place: String,
}

/// A rule that cannot be applied, and where it is written.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{place}{}{source}", if place.is_empty() { "" } else { ": " })]
pub struct RefusedRule {
    /// Place of the rule.
    pub place: String,
    /// Reason of the refusal.
    pub source: Refused,
}

/// A named set of rules.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contamination {
    /// Name, or file it is from.
    pub name: String,
    /// The rules.
    pub rules: Vec<Rule>,
}

impl Contamination {
    /// Operations on a signal of a replicate (counted from 1), in the order of application.
    pub fn operations_for(&self, channel: Channel, replicate: u64) -> Vec<&Operation> {
        self.rules_for(channel, replicate)
            .into_iter()
            .map(|r| &r.operation)
            .collect()
    }

    fn rules_for(&self, channel: Channel, replicate: u64) -> Vec<&Rule> {
        let applies = |r: &&Rule| {
            r.sensor == channel.sensor && r.replicate.is_none_or(|only| only == replicate)
        };
        let mut rules: Vec<&Rule> = self.rules.iter().filter(applies).collect();
        rules.sort_by_key(|r| r.operation.stage());
        rules
    }

    /// Returns true if a replicate (counted from 1) is contaminated.
    pub fn touches(&self, replicate: u64) -> bool {
        self.rules
            .iter()
            .any(|r| r.replicate.is_none_or(|only| only == replicate))
    }

    /// Scales the parameters of a replicate's (counted from 1) axis, before synthesis.
    ///
    /// # Errors
    /// When the model has no such parameter or the scaled one is outside its domain.
    pub fn scale(
        &self,
        noise: &mut Composite,
        channel: Channel,
        replicate: u64,
    ) -> Result<(), RefusedRule> {
        for rule in self.rules_for(channel, replicate) {
            if let Operation::Scale {
                process,
                parameter,
                factor,
            } = &rule.operation
            {
                scale(noise, channel, (process, parameter), *factor)
                    .map_err(|e| rule.refused(e))?;
            }
        }
        Ok(())
    }

    /// Contaminates the samples (m/s² or rad/s) of a replicate's (counted from 1) axis. What is random in
    /// it depends on seed, replicate and axis, not on the other rules or the signal.
    ///
    /// # Errors
    /// When the record is too short for a rule.
    pub fn apply(
        &self,
        samples: &mut [f64],
        channel: Channel,
        replicate: u64,
        rate_hz: f64,
        seed: u64,
    ) -> Result<(), RefusedRule> {
        let source = channel.to_string();
        let rules = self.rules_for(channel, replicate);
        for (i, rule) in rules.iter().enumerate() {
            let operation = &rule.operation;
            // A second operation of a kind draws from another stream.
            let same = rules[..i]
                .iter()
                .filter(|r| r.operation.stage() == operation.stage())
                .count();
            let process = format!("{}_{}", operation.name(), same + 1);
            let run = replicate.wrapping_sub(1);
            let key = StreamKey {
                seed,
                scenario: "contamination",
                run,
                source: &source,
                process: &process,
            };
            operation
                .apply(samples, rate_hz, key)
                .map_err(|e| rule.refused(e))?;
        }
        Ok(())
    }
}

impl Rule {
    fn refused(&self, source: Refused) -> RefusedRule {
        RefusedRule {
            place: self.place.clone(),
            source,
        }
    }
}

impl Operation {
    /// Name in files.
    const fn name(&self) -> &'static str {
        match self {
            Self::Scale { .. } => "scale",
            Self::Ar1(_) => "ar1",
            Self::HeavyTails { .. } => "heavy-tails",
            Self::Step { .. } => "step",
            Self::Drift { .. } => "drift",
            Self::Replace { .. } => "replace",
            Self::Bursts { .. } => "bursts",
        }
    }

    const fn stage(&self) -> u8 {
        match self {
            Self::Scale { .. } => 0,
            Self::Ar1(_) => 1,
            Self::HeavyTails { .. } => 2,
            Self::Step { .. } => 3,
            Self::Drift { .. } => 4,
            Self::Replace { .. } => 5,
            Self::Bursts { .. } => 6,
        }
    }

    fn apply(&self, x: &mut [f64], rate_hz: f64, key: StreamKey<'_>) -> Result<(), Refused> {
        let fits = |what, needed| match needed <= x.len() {
            true => Ok(()),
            false => Err(Refused(format!(
                "{what} needs {needed} samples, the record has {}",
                x.len()
            ))),
        };
        match self {
            Self::Scale { .. } => {}
            Self::Ar1(ar1) => add_ar1(x, *ar1, key),
            Self::HeavyTails { freedom, sigma } => {
                let law = StudentT::new(*freedom).map_err(|_| {
                    Refused(format!(
                        "heavy tails of {freedom} degrees of freedom: more than 2 are needed"
                    ))
                })?;
                let mut g = key.generator();
                x.iter_mut().for_each(|v| *v += sigma * law.sample(&mut g));
            }
            // A ramp of given end value, whatever the length: 0 at the first sample, the amplitude at the
            // last.
            Self::Drift { amplitude } => {
                let last = x.len().saturating_sub(1).max(1) as f64;
                x.iter_mut()
                    .enumerate()
                    .for_each(|(k, v)| *v += amplitude * k as f64 / last);
            }
            Self::Step { at, amplitude } => {
                let at = at.of(x.len());
                fits("a step", at + 1)?;
                x[at..].iter_mut().for_each(|v| *v += amplitude);
            }
            Self::Replace {
                points,
                block,
                mean,
                sigma,
            } => {
                let (points, block) = (points.of(x.len()), block.of(x.len()).max(1));
                fits("the replacement of points", points)?;
                // Before anything is replaced, so that the mean is of the signal.
                let mean = mean.unwrap_or_else(|| x.iter().sum::<f64>() / x.len().max(1) as f64);
                replace(x, (points, block), mean, *sigma, key);
            }
            Self::Bursts {
                count,
                length,
                spacing,
                amplitude,
                frequency_hz,
            } => {
                let (length, spacing) = (length.of(x.len()), spacing.of(x.len()));
                let count = usize::try_from(*count).unwrap_or(usize::MAX);
                // The first burst begins after one spacing, so the last one ends at count·spacing + length.
                fits(
                    "a train of bursts",
                    count.saturating_mul(spacing).saturating_add(length),
                )?;
                let step = std::f64::consts::TAU * frequency_hz / rate_hz;
                for start in (1..=count).map(|i| i * spacing) {
                    for (k, v) in x[start..start + length].iter_mut().enumerate() {
                        *v += amplitude * (step * k as f64).sin();
                    }
                }
            }
        }
        Ok(())
    }
}

fn scale(
    noise: &mut Composite,
    channel: Channel,
    (label, parameter): (&str, &str),
    factor: f64,
) -> Result<(), Refused> {
    let named = format!("{label} {parameter}");
    let found = noise
        .parameters()
        .find(|(of, _)| noise.name_of(*of) == named);
    let Some((of, value)) = found else {
        let known = noise.parameters().map(|(of, _)| noise.name_of(of));
        let known = known.collect::<Vec<_>>().join(", ");
        return Err(Refused(format!(
            "{channel} has no {named} to scale, only {known}"
        )));
    };
    let scaled = noise.set(of, factor * value);
    scaled.map_err(|e| Refused(format!("scaled: {e}")))
}

fn add_ar1(x: &mut [f64], ar1: Process, key: StreamKey<'_>) {
    // In blocks, so that a long record needs no second one for the noise; the numbers do not depend on the
    // block.
    let mut source = Synthesizer::new(&Composite::new(vec![ar1]), key);
    let mut block = [0.0; 1024];
    for part in x.chunks_mut(block.len()) {
        let noise = &mut block[..part.len()];
        source.fill(noise);
        part.iter_mut().zip(noise).for_each(|(v, n)| *v += *n);
    }
}

/// Replaces `points` distinct samples in blocks that do not overlap, every choice equally likely: the starts are drawn
/// among as many places as there are with each block taken for one (selection sampling, Knuth's algorithm S: the
/// numbers drawn do not depend on a library's method).
fn replace(
    x: &mut [f64],
    (points, block): (usize, usize),
    mean: f64,
    sigma: f64,
    key: StreamKey<'_>,
) {
    let mut g = key.generator();
    let (mut wanted, mut left) = (points.div_ceil(block), points);
    // Each sample that stays is a place, and each block is one.
    let places = x.len() - points + wanted;
    let mut at = 0;
    for place in 0..places {
        if wanted == 0 {
            break;
        }
        // Taken with probability (still wanted)/(places left): every choice of places is equally likely.
        if g.random::<f64>() * ((places - place) as f64) < wanted as f64 {
            let length = block.min(left);
            for v in &mut x[at..at + length] {
                *v = mean + sigma * g.sample::<f64, _>(StandardNormal);
            }
            (at, left, wanted) = (at + length, left - length, wanted - 1);
        } else {
            at += 1;
        }
    }
}

#[cfg(test)]
#[path = "contamination_tests.rs"]
pub(crate) mod tests;
