//! Smallest factors on a noise model that make the filter made of it consistent.
//!
//! What a filter believes is enlarged until it covers its true errors: where the truth is another model, one of
//! several, or the same model with other parameters. The factors come from the least divergence between the
//! covariance that the filter states and that of its errors ([`super::Consistency::divergence`]), then one factor
//! on all of them makes the filter exactly consistent.

use super::consistency::{DrawFactors, FilterConsistency, UpperEnd};
use super::damped::{Damped, Part, Value};
use super::factor::{Factor, MAX_LN, multiplied, scaled, set};
use super::pass::{Assessment, FilterPass};
use super::reduce::{ENDS, divergence};
use super::root::Crossing;
use super::track::Track;
use super::truth::TrueErrors;
use crate::ekf::{Belief, BeliefError};
use crate::imu::Sensor;
use crate::noise::Model;
use crate::simulation::{NEES_DOF, REPORTED};
use rayon::prelude::*;

/// How a model becomes a filter.
pub type Filter<'a> = dyn Fn(&Model) -> Result<Belief, BeliefError> + Sync + 'a;

/// Condition under which a filter counts as consistent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Aim {
    /// The expected NEES, averaged over time and truths, is what it should be.
    Mean,
    /// In no truth is an error larger than stated, in any state at the end of any outage or over the whole run.
    #[default]
    Worst,
}

nav_sim_signal::named!(Aim { Worst = "worst", Mean = "mean" });

/// A model, and the truths that its filter is to be consistent with.
pub struct Task<'a> {
    /// The noise model that the filter is made of.
    pub model: &'a Model,
    /// What may make the errors; at least one.
    pub truths: &'a [TrueErrors],
    /// Where the truths but the first are draws of what is not known of it: the upper end of an interval, which counts in the
    /// place of the worst truth.
    pub drawn: Option<&'a UpperEnd<'a>>,
    /// The trajectory with its fixes and outages.
    pub track: &'a Track,
    /// The filter with a state for each process, for which the factors are found.
    pub full: &'a Filter<'a>,
    /// The filter that is made consistent in the end.
    pub filter: &'a Filter<'a>,
    /// Condition under which it is consistent.
    pub aim: Aim,
    /// Whether a factor may be below 1.
    pub allow_smaller: bool,
}

const ITERATIONS: usize = 60;
/// A step that gains less divergence is the last.
const ENOUGH: f64 = 1e-6;
/// Divergence that a standard deviation wrong by 7 % makes.
const VISIBLE: f64 = 0.01;
/// Cost of a factor e: what no fix tells stays as it is.
const RIDGE: f64 = 2e-5;
/// Cost of a state at an outage's end whose error is e times what is stated, where none may be larger.
const OVERCONFIDENT: f64 = 200.0;
/// A filter whose ratio is this close to 1 is consistent.
const TOLERANCE: f64 = 0.005;
/// How often at most what draws add is found anew.
const ROUNDS: usize = 5;
/// An error that exceeds its sigma by less than this share is as large as stated.
const EXACT: f64 = 1e-3;
/// How close the factors come to the smallest, as a logarithm.
const RESOLUTION: f64 = 0.005;

impl Task<'_> {
    /// The factors, 1 for all where the filter is consistent already.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn factors(&self) -> Result<Vec<Factor>, BeliefError> {
        let mut factors = multiplied(self.model);
        // Asked for its error alone: inside the search a model without a filter is only an infinite cost.
        (self.full)(self.model)?;
        let (consistency, mut draw_factors) = self.consistency_and_draws(self.filter, &factors)?;
        if self.excess(&consistency).abs() <= TOLERANCE {
            return Ok(factors);
        }
        // Draws are many, and what they add to an error hardly depends on the filter: the search has the first truth alone
        // with that added, and again with what they add under the filter that was found.
        for _ in 0..ROUNDS {
            factors = self.search(&factors, draw_factors.as_ref())?;
            if draw_factors.is_none() {
                break;
            }
            let found = self.consistency_and_draws(self.filter, &factors)?;
            if self.excess(&found.0).abs() <= TOLERANCE {
                break;
            }
            draw_factors = found.1;
        }
        Ok(factors)
    }

    /// Sensors whose model has no noise that a factor could multiply, where that of a truth has some.
    #[must_use]
    pub fn without_factor(&self) -> Vec<Sensor> {
        let has_factor = |model: &Model, sensor: &Sensor| {
            multiplied(model)
                .iter()
                .any(|factor| factor.sensor == *sensor)
        };
        let is_without = |sensor: &Sensor| {
            !has_factor(self.model, sensor)
                && self.truths.iter().any(|t| has_factor(&t.model, sensor))
        };
        Sensor::ALL.into_iter().filter(is_without).collect()
    }

    /// The factors for all truths, or for the first with what draws add to it.
    fn search(
        &self,
        factors: &[Factor],
        draw_factors: Option<&DrawFactors>,
    ) -> Result<Vec<Factor>, BeliefError> {
        let track = self.track.coarse();
        let value = |ln: &[f64]| {
            let bent = |x: &f64| Part {
                value: *x,
                curvature: 2.0 * RIDGE,
            };
            let mut value = self.value(&set(factors, ln), &track, draw_factors);
            value.cost += RIDGE * ln.iter().map(|x| x * x).sum::<f64>();
            value.parts.extend(ln.iter().map(bent));
            value
        };
        let low = if self.allow_smaller { -MAX_LN } else { 0.0 };
        let descent = Damped {
            value: &value,
            bounds: (low, MAX_LN),
            iterations: ITERATIONS,
            enough: ENOUGH,
        };
        // From the model as it is, which keeps factors small; and from one factor on all that makes it consistent, since between
        // the two the valley may be flat. The second counts where it is better by what can be seen.
        let unchanged = vec![0.0; factors.len()];
        let at = |ln: &[f64]| self.consistency_with(self.filter, &set(factors, ln), draw_factors);
        let exact = |ln: &[f64]| self.exact(ln, low, &at);
        let alike = exact(&unchanged)?;
        let near = descent.minimum(unchanged.clone()).unwrap_or(unchanged);
        let best = match descent.minimum(alike) {
            Some(far) if value(&far).cost < value(&near).cost - VISIBLE => far,
            _ => near,
        };
        let mut best = exact(&best)?;
        if self.aim == Aim::Worst {
            self.lower_alone(&mut best, low, &at)?;
        }
        Ok(set(factors, &best))
    }

    /// Lowers each factor whose noise binds no error, until it does.
    fn lower_alone(&self, ln: &mut [f64], low: f64, at: &At<'_>) -> Result<(), BeliefError> {
        for i in 0..ln.len() {
            let moved = |by: f64| {
                let mut moved = ln.to_vec();
                moved[i] += by;
                moved
            };
            let covers = |by: f64| Ok(self.excess(&at(&moved(by))?) <= EXACT);
            let bounds = (low - ln[i], 0.0);
            if bounds.0 < -RESOLUTION && covers(0.0)? {
                ln[i] += smallest(bounds, covers)?;
            }
        }
        Ok(())
    }

    /// Every truth under a filter made of the scaled model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn consistency(
        &self,
        filter: &Filter<'_>,
        factors: &[Factor],
    ) -> Result<FilterConsistency, BeliefError> {
        Ok(self.consistency_and_draws(filter, factors)?.0)
    }

    /// The same, and what draws add to the first truth there.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub(super) fn consistency_and_draws(
        &self,
        filter: &Filter<'_>,
        factors: &[Factor],
    ) -> Result<(FilterConsistency, Option<DrawFactors>), BeliefError> {
        let belief = filter(&scaled(self.model, factors))?;
        let assessments = self.assessments(&belief, self.track, None);
        let consistency = FilterConsistency::of(&assessments, self.drawn);
        let draw_factors = self
            .drawn
            .map(|drawn| DrawFactors::of(&assessments, drawn, &consistency));
        Ok((consistency, draw_factors))
    }

    /// The consistency by the first truth with what draws add to it; without draws that by all truths.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub(super) fn consistency_with(
        &self,
        filter: &Filter<'_>,
        factors: &[Factor],
        draw_factors: Option<&DrawFactors>,
    ) -> Result<FilterConsistency, BeliefError> {
        let Some(draw_factors) = draw_factors else {
            return self.consistency(filter, factors);
        };
        let belief = filter(&scaled(self.model, factors))?;
        Ok(draw_factors.consistency(&self.assessments(&belief, self.track, Some(draw_factors))))
    }

    /// Every truth under the filter that `knows` makes of it.
    ///
    /// # Errors
    /// When a truth has no such filter.
    pub fn informed(
        &self,
        knows: impl Fn(&TrueErrors) -> Result<Belief, BeliefError> + Sync,
    ) -> Result<FilterConsistency, BeliefError> {
        let assessed = |truth: &TrueErrors| {
            let belief = knows(truth)?;
            Ok(FilterPass::new(self.track, &belief).assess_stated(&belief, truth))
        };
        let assessments: Result<Vec<Assessment>, BeliefError> =
            self.truths.par_iter().map(assessed).collect();
        Ok(FilterConsistency::of(&assessments?, self.drawn))
    }

    /// Of all truths; of the first alone where what draws add to it is known.
    fn assessments(
        &self,
        belief: &Belief,
        track: &Track,
        draw_factors: Option<&DrawFactors>,
    ) -> Vec<Assessment> {
        // No truth changes the filter: its gains are found once.
        let pass = FilterPass::new(track, belief);
        let count = if draw_factors.is_some() {
            1
        } else {
            self.truths.len()
        };
        self.truths[..count]
            .par_iter()
            .map(|truth| pass.assess_stated(belief, truth))
            .collect()
    }

    /// Mean divergence over the truths and the cost of errors that are larger than stated; infinite where the model has no
    /// filter.
    fn value(
        &self,
        factors: &[Factor],
        track: &Track,
        draw_factors: Option<&DrawFactors>,
    ) -> Value {
        let Ok(belief) = (self.full)(&scaled(self.model, factors)) else {
            return Value {
                cost: f64::INFINITY,
                parts: Vec::new(),
            };
        };
        let overconfident = match self.aim {
            Aim::Mean => 0.0,
            Aim::Worst => OVERCONFIDENT,
        };
        // One-sided: an error smaller than stated costs nothing here, the divergence alone speaks of caution.
        let overconfidence = |ratios: [f64; REPORTED]| -> f64 {
            ratios
                .iter()
                .map(|r| overconfident * r.ln().max(0.0).powi(2))
                .sum()
        };
        let mut assessments = self.assessments(&belief, track, draw_factors);
        draw_factors
            .into_iter()
            .for_each(|draw_factors| assessments.iter_mut().for_each(|a| draw_factors.enlarge(a)));
        let share = 1.0 / assessments.len() as f64;
        let (mut cost, mut parts) = (0.0, Vec::new());
        for assessment in &assessments {
            let of_run = assessment.ratio_over_run();
            cost += share
                * (divergence(assessment, |end| overconfidence(end.ratio()))
                    + overconfidence(of_run));
            // The divergence of one state, (r² − 1)/2 − ln r, has the second derivative 2r² with respect to ln r.
            let part = |weight: f64, of_divergence: f64, r: f64| Part {
                value: r.ln(),
                curvature: share
                    * (2.0 * of_divergence * r * r
                        + 2.0 * weight * if r > 1.0 { overconfident } else { 0.0 }),
            };
            let of_end = ENDS / assessment.outage_ends.len().max(1) as f64;
            let at_ends = assessment.outage_ends.iter().flat_map(|end| end.ratio());
            parts.extend(at_ends.map(|r| part(of_end, of_end, r)));
            parts.extend(of_run.map(|r| part(1.0, 1.0 - ENDS, r)));
        }
        Value { cost, parts }
    }

    /// Logarithm of what should be 1: above 0 the filter is overconfident.
    fn excess(&self, consistency: &FilterConsistency) -> f64 {
        match self.aim {
            Aim::Mean => (consistency.nees / NEES_DOF as f64).ln(),
            Aim::Worst => consistency.largest.ratio.ln(),
        }
    }

    /// The logarithms with one number added to all, none below the lowest: the filter is consistent in the mean, or the least
    /// cautious that covers the worst.
    fn exact(&self, ln: &[f64], low: f64, at: &At<'_>) -> Result<Vec<f64>, BeliefError> {
        let moved =
            |by: f64| -> Vec<f64> { ln.iter().map(|x| (x + by).clamp(low, MAX_LN)).collect() };
        // Down to where the largest factor meets the lowest bound: below that nothing changes any more.
        let highest = ln.iter().copied().fold(low, f64::max);
        let bounds = (low - highest, MAX_LN);
        if self.aim == Aim::Mean {
            let crossing = Crossing {
                bounds,
                step: 0.1,
                exact: EXACT,
            };
            let (by, _) = crossing.from(0.0, |by| {
                Ok::<_, BeliefError>(self.excess(&at(&moved(by))?))
            })?;
            return Ok(moved(by));
        }
        let covering = smallest(bounds, |by| Ok(self.excess(&at(&moved(by))?) <= EXACT))?;
        Ok(moved(covering))
    }
}

/// The smallest factor on the standard deviations that a filter believes of a vehicle's own measurements with which it states
/// its errors, at the ends of outages and over the run; 1 where it does already, none where a factor of a thousand does not help.
#[must_use]
pub fn aiding_factor(track: &Track, belief: &Belief, truth: &TrueErrors) -> Option<f64> {
    let largest = |ln: f64| {
        let track = track.with_aiding_sigmas(ln.exp());
        let assessment = FilterPass::new(&track, belief).assess_stated(belief, truth);
        FilterConsistency::of(&[assessment], None).largest.ratio
    };
    let covers = |ln: f64| Ok(largest(ln) <= 1.0 + TOLERANCE);
    let ln = smallest((0.0, 1000.0_f64.ln()), covers).ok()?;
    (largest(ln) <= 1.0 + TOLERANCE).then(|| ln.exp())
}

/// The consistency of the tuned filter for logarithms of the factors.
type At<'a> = dyn Fn(&[f64]) -> Result<FilterConsistency, BeliefError> + 'a;

/// The smallest number within bounds for which a condition holds that goes on holding above; the upper bound where it holds for
/// none. A bracket from 0 first, then halves of it.
fn smallest(
    (low, high): (f64, f64),
    holds: impl Fn(f64) -> Result<bool, BeliefError>,
) -> Result<f64, BeliefError> {
    let start = 0.0_f64.clamp(low, high);
    let (mut fails, mut fits, mut step) = (start, start, 2.0 * RESOLUTION);
    if holds(start)? {
        while fails == fits || holds(fails)? {
            fits = fails;
            fails = (fits - step).max(low);
            step *= 2.0;
            if fails == fits {
                return Ok(low);
            }
        }
    } else {
        while fails == fits || !holds(fits)? {
            fails = fits;
            fits = (fails + step).min(high);
            step *= 2.0;
            if fails == fits {
                return Ok(high);
            }
        }
    }
    while fits - fails > RESOLUTION {
        let middle = 0.5 * (fails + fits);
        if holds(middle)? {
            fits = middle
        } else {
            fails = middle
        }
    }
    Ok(fits)
}
