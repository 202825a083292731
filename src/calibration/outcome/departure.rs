//! How far a curve is from the model that was fitted to it: where it matters, and where it is most certain.

use super::Outcome;
use crate::curve::implied;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Scales missed by more standard deviations than this are told.
const MISSED: f64 = 4.0;
/// A neighbour belongs to a stretch while it is off by more standard deviations than this, to the same side.
const DOUBTFUL: f64 = 2.0;
/// Standard deviation (relative) to which a wavelet variance must be known for its distance from the model to be told.
const KNOWN: f64 = 0.1;

/// A curve at one level, against the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Miss {
    /// Level.
    pub level: u32,
    /// Wavelet variance of the data over that of the model.
    pub ratio: f64,
    /// The normal score of that ratio, a chi-square over its degrees of freedom where the model holds.
    pub deviations: f64,
}

/// The normal score of a chi-square over its degrees of freedom (Wilson and Hilferty): of few degrees the ratio less one over
/// its deviation would never be far below zero, however improbable it is.
fn score(ratio: f64, edof: f64) -> f64 {
    let variance = 2.0 / (9.0 * edof);
    (ratio.cbrt() - 1.0 + variance) / variance.sqrt()
}

/// A curve against its model.
#[derive(Debug, Clone, PartialEq)]
pub struct Departure {
    /// Scales that count in the fit.
    pub scales: usize,
    /// Those that are missed by more than four standard deviations.
    pub missed: Vec<Miss>,
    /// Of the scales that are known to 10 % (of all, if none is), the one with the ratio furthest from 1.
    pub furthest: Option<Miss>,
    /// The longest of these scales, where there are longer ones.
    pub known_to: Option<u32>,
    /// Of the scales that are off by more than two deviations, the one with the ratio furthest from 1.
    pub doubtful: Option<Miss>,
    /// Probability of scores at least as far off together, where the model holds: their squares as a chi-square of as many
    /// degrees of freedom as scales. That parameters were fitted makes it larger, that neighbours hang together smaller.
    pub chance: f64,
}

impl Departure {
    /// Of the scales that are missed, the one with the ratio furthest from 1: where the model is worst for whoever uses it.
    #[must_use]
    pub fn worst(&self) -> Option<Miss> {
        furthest(&self.missed)
    }

    /// Of the scales that are missed, the one that noise explains least.
    #[must_use]
    pub fn surest(&self) -> Option<Miss> {
        self.missed.iter().copied().max_by(|a, b| a.deviations.abs().total_cmp(&b.deviations.abs()))
    }
}

fn furthest(all: &[Miss]) -> Option<Miss> {
    all.iter().copied().max_by(|a, b| a.ratio.ln().abs().total_cmp(&b.ratio.ln().abs()))
}

impl Outcome {
    /// The curve against the model at the scales that count.
    #[must_use]
    pub fn departure(&self) -> Departure {
        let all = self.misses();
        let missed = all.iter().copied().filter(|m| m.deviations.abs() > MISSED).collect();
        let is_known = |m: &&Miss| {
            let place = self.curve.levels.iter().position(|level| *level == m.level);
            place.is_some_and(|i| (2.0 / self.curve.edof[i]).sqrt() <= KNOWN)
        };
        let known: Vec<Miss> = all.iter().filter(is_known).copied().collect();
        let furthest = furthest(if known.is_empty() { &all } else { &known });
        let longest =
            known.last().map(|m| m.level).filter(|level| all.last().is_some_and(|m| m.level > *level));
        let off: Vec<Miss> = all.iter().copied().filter(|m| m.deviations.abs() > DOUBTFUL).collect();
        let doubtful = self::furthest(&off);
        let squares: f64 = all.iter().map(|m| m.deviations * m.deviations).sum();
        let chance = ChiSquared::new(all.len().max(1) as f64).map_or(1.0, |law| law.sf(squares));
        Departure { scales: all.len(), missed, furthest, known_to: longest, doubtful, chance }
    }

    /// First and last level of the stretch around a miss that is off to the same side.
    #[must_use]
    pub fn stretch(&self, around: Miss) -> (u32, u32) {
        let all = self.misses();
        let Some(place) = all.iter().position(|m| m.level == around.level) else {
            return (around.level, around.level);
        };
        let belongs = |m: &&Miss| m.deviations * around.deviations.signum() > DOUBTFUL;
        let before = all[..place].iter().rev().take_while(belongs).last();
        let after = all[place + 1..].iter().take_while(belongs).last();
        (before.unwrap_or(&around).level, after.unwrap_or(&around).level)
    }

    /// The scales that count.
    #[must_use]
    pub fn counted_levels(&self) -> Vec<u32> {
        self.curve.levels.iter().copied().filter(|level| !self.curve.ignored.contains(level)).collect()
    }

    fn misses(&self) -> Vec<Miss> {
        let curve = &self.curve;
        let implied = implied(&self.fit.composite, curve);
        let scales = curve.levels.iter().zip(&curve.wv).zip(&curve.edof).zip(implied);
        scales
            .filter(|(((level, _), _), _)| !curve.ignored.contains(level))
            .map(|(((level, nu), edof), implied)| {
                let ratio = nu / implied;
                Miss { level: *level, ratio, deviations: score(ratio, *edof) }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::score;
    use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

    /// Against the exact law: the cube is good to a tenth of a deviation out to five of them, from ten degrees on.
    #[test]
    fn scores_are_those_of_the_chi_square() {
        let normal = Normal::new(0.0, 1.0).unwrap();
        for edof in [10.0, 32.0, 300.0] {
            let law = ChiSquared::new(edof).unwrap();
            for ratio in [0.2, 0.39, 0.7, 1.0, 1.5, 2.5] {
                let below = law.cdf(ratio * edof);
                let exact = if below < 0.5 {
                    normal.inverse_cdf(below)
                } else {
                    -normal.inverse_cdf(law.sf(ratio * edof))
                };
                if exact.abs() < 5.0 {
                    assert!((score(ratio, edof) - exact).abs() < 0.1, "{edof} {ratio}: {exact}");
                }
            }
        }
    }
}
