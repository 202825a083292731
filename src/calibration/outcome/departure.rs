//! Departure of a curve from the model that was fitted to it: where it matters, and where it is most certain.

use super::Outcome;
use crate::curve::implied;
use crate::fit::score;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Scales missed by more standard deviations than this are told.
const MISSED: f64 = 4.0;
/// Scales off by more standard deviations than this are what speaks against a model whose scales are off together.
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
    /// Whether the scale counts in the fit.
    pub is_fitted: bool,
}

/// Disagreement of a curve with its model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// Probability of the J-test, if it was made.
    pub p_value: Option<f64>,
    /// The scale with the ratio furthest from 1 of all that are missed, those that count in no fit included.
    pub worst: Miss,
}

/// Probability of the scores of all scales together below which a model is not said to fit, where no J-test was made.
const IMPOSSIBLE: f64 = 1e-4;

/// A curve against its model.
#[derive(Debug, Clone, PartialEq)]
pub struct Departure {
    /// Scales that count in the fit.
    pub scales: usize,
    /// Those that are missed by more than four standard deviations.
    pub missed: Vec<Miss>,
    /// Of the scales that count in no fit and are missed as far, the one with the ratio furthest from 1.
    pub left_out: Option<Miss>,
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
    fn of(all: &[Miss], is_known: impl Fn(&&Miss) -> bool) -> Self {
        let (all, ignored): (Vec<Miss>, Vec<Miss>) = all.iter().copied().partition(|m| m.is_fitted);
        let ignored: Vec<Miss> = ignored
            .into_iter()
            .filter(|m| m.deviations.abs() > MISSED)
            .collect();
        let beyond = |deviations: f64| -> Vec<Miss> {
            all.iter()
                .copied()
                .filter(|m| m.deviations.abs() > deviations)
                .collect()
        };
        let known: Vec<Miss> = all.iter().filter(is_known).copied().collect();
        let longest = all.last().map(|m| m.level);
        let squares: f64 = all.iter().map(|m| m.deviations * m.deviations).sum();
        Self {
            scales: all.len(),
            missed: beyond(MISSED),
            left_out: furthest(&ignored),
            furthest: furthest(if known.is_empty() { &all } else { &known }),
            known_to: known
                .last()
                .map(|m| m.level)
                .filter(|level| Some(*level) != longest),
            doubtful: furthest(&beyond(DOUBTFUL)),
            chance: ChiSquared::new(all.len().max(1) as f64).map_or(1.0, |law| law.sf(squares)),
        }
    }

    /// Of the scales that are missed, the one with the ratio furthest from 1: where the model is worst for whoever uses it.
    #[must_use]
    pub fn worst(&self) -> Option<Miss> {
        furthest(&self.missed)
    }
}

fn furthest(all: &[Miss]) -> Option<Miss> {
    // In the logarithm half is as far from 1 as twice.
    all.iter()
        .copied()
        .max_by(|a, b| a.ratio.ln().abs().total_cmp(&b.ratio.ln().abs()))
}

impl Outcome {
    /// The disagreement of the curve with its model, by single scales, by all together or by the J-test; none where it fits.
    #[must_use]
    pub fn misfit(&self) -> Option<Misfit> {
        let departure = self.departure();
        let goodness = self.inference.as_ref().and_then(|i| i.goodness);
        let together = match goodness {
            Some(goodness) => goodness.is_rejected(),
            None => departure.chance < IMPOSSIBLE && departure.doubtful.is_some(),
        };
        let missed: Vec<Miss> = departure
            .missed
            .iter()
            .chain(&departure.left_out)
            .copied()
            .collect();
        let worst = furthest(&missed)
            .or(departure.doubtful)
            .or(departure.furthest);
        let is_missed = together || !departure.missed.is_empty();
        worst.filter(|_| is_missed).map(|worst| Misfit {
            p_value: goodness.map(|g| g.p_value),
            worst,
        })
    }

    /// The curve against the model.
    #[must_use]
    pub fn departure(&self) -> Departure {
        let is_known = |m: &&Miss| {
            let place = self.curve.levels.iter().position(|level| *level == m.level);
            place.is_some_and(|i| (2.0 / self.curve.edof[i]).sqrt() <= KNOWN)
        };
        Departure::of(&self.misses(), is_known)
    }

    /// The scales that count.
    #[must_use]
    pub fn counted_levels(&self) -> Vec<u32> {
        self.curve
            .levels
            .iter()
            .copied()
            .filter(|level| !self.curve.ignored.contains(level))
            .collect()
    }

    fn misses(&self) -> Vec<Miss> {
        let curve = &self.curve;
        let implied = implied(&self.fit.composite, curve);
        let scales = curve
            .levels
            .iter()
            .zip(&curve.wv)
            .zip(&curve.edof)
            .zip(implied);
        scales
            .map(|(((level, nu), edof), implied)| {
                let ratio = nu / implied;
                let is_fitted = !curve.ignored.contains(level);
                Miss {
                    level: *level,
                    ratio,
                    deviations: score(ratio, *edof),
                    is_fitted,
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{Departure, Miss};
    use crate::fit::score;
    use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

    /// Twelve scales that are off by one deviation each are what chance brings: P(chi-square of 12 > 12) = 0.4457 (tables). Off by
    /// three each, none is missed by itself, and together they are impossible. What is told is of the scales that are known;
    /// what speaks against the model is the scale where it is worst.
    #[test]
    fn scales_are_judged_together_and_told_as_far_as_they_are_known() {
        let off = |deviations: f64| -> Vec<Miss> {
            (1..=12)
                .map(|level| Miss {
                    level,
                    ratio: 1.0 - 0.05 * f64::from(level),
                    deviations,
                    is_fitted: true,
                })
                .collect()
        };
        let departure = |deviations| Departure::of(&off(deviations), |m| m.level <= 8);
        let allowed = departure(-1.0);
        assert!(
            (allowed.chance - 0.4457).abs() < 5e-5 && allowed.doubtful.is_none(),
            "{allowed:?}"
        );
        assert_eq!(
            (allowed.furthest.unwrap().level, allowed.known_to),
            (8, Some(8))
        );
        let impossible = departure(-3.0);
        assert!(
            impossible.missed.is_empty() && impossible.chance < 1e-15,
            "{impossible:?}"
        );
        assert_eq!(impossible.doubtful.unwrap().level, 12);
        assert_eq!(Departure::of(&off(1.0), |_| true).known_to, None);
    }

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
                    assert!(
                        (score(ratio, edof) - exact).abs() < 0.1,
                        "{edof} {ratio}: {exact}"
                    );
                }
            }
        }
    }
}
