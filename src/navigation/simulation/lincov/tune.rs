//! Smallest factors on a noise model that make the filter made of it consistent.
//!
//! What a filter states is enlarged until it covers its true errors: where the truth is another model, one of
//! several, or the same model with other parameters. The factors come from the least divergence between the
//! covariance that the filter states and that of its errors ([`super::Consistency::divergence`]), then one factor
//! on all of them makes the filter exactly consistent.

use super::pass::{Assessment, Consistency, FilterPass};
use super::reduce::{CostTerm, CostValue, ENDS, average, minimum};
use super::track::Track;
use super::truth::TrueErrors;
use crate::ekf::{FilterModel, FilterModelError};
use crate::imu::{Channel, Sensor};
use crate::linalg::mean;
use crate::noise::{Model, Process, ProcessKind};
use crate::simulation::{NEES_DOF, REPORTED};
use rayon::prelude::*;

/// Makes a filter of a model.
pub type Filter<'a> = dyn Fn(&Model) -> Result<FilterModel, FilterModelError> + Sync + 'a;

/// Condition under which a filter counts as consistent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ConsistencyCriterion {
    /// The expected NEES, averaged over time and truths, is what it should be.
    Mean,
    /// In no truth is an error larger than stated, in any state at the end of any outage or over the whole run.
    #[default]
    Worst,
}

nav_sim_signal::named!(ConsistencyCriterion { Worst = "worst", Mean = "mean" });

/// A model, and the truths that its filter is to be consistent with.
pub struct TuningProblem<'a> {
    /// The noise model that the filter is made of.
    pub model: &'a Model,
    /// Candidate truths; at least one.
    pub truths: &'a [TrueErrors],
    /// The trajectory with its fixes and outages.
    pub track: &'a Track,
    /// The filter with a state for each process, for which the factors are found.
    pub full: &'a Filter<'a>,
    /// The filter that is made consistent in the end.
    pub filter: &'a Filter<'a>,
    /// Condition under which it is consistent.
    pub aim: ConsistencyCriterion,
}

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
/// An error that exceeds its sigma by less than this share is as large as stated.
const EXACT: f64 = 1e-3;
/// Tolerance of the logarithm of the factors.
const RESOLUTION: f64 = 0.005;

impl TuningProblem<'_> {
    /// The factors, 1 for all where the filter is consistent already.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn factors(&self) -> Result<Vec<Factor>, FilterModelError> {
        let factors = multiplied(self.model);
        // Asked for its error alone: inside the search a model without a filter is only an infinite cost.
        (self.full)(self.model)?;
        let consistency = self.consistency(self.filter, &factors)?;
        if self.excess(&consistency).abs() <= TOLERANCE {
            return Ok(factors);
        }
        self.search(&factors)
    }

    /// Sensors whose model has no noise that a factor could multiply, where that of a truth has some.
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

    /// The factors for all truths.
    fn search(&self, factors: &[Factor]) -> Result<Vec<Factor>, FilterModelError> {
        let track = self.track.coarse();
        let value = |ln: &[f64]| self.value(&set(factors, ln), &track).with_ridge(RIDGE, ln);
        let minimum = |start: &[f64]| minimum(value, start, (0.0, MAX_LN), |_| ENOUGH);
        // From the model as it is, which keeps factors small; and from one factor on all that makes it consistent, since between
        // the two the valley may be flat. The second counts where it is better by what can be seen.
        let unchanged = vec![0.0; factors.len()];
        let at = |ln: &[f64]| self.consistency(self.filter, &set(factors, ln));
        let exact = |ln: &[f64]| self.exact(ln, &at);
        let alike = exact(&unchanged)?;
        let (near, far) = (minimum(&unchanged), minimum(&alike));
        let is_better = far.value.cost < near.value.cost - VISIBLE;
        let mut best = exact(&if is_better { far } else { near }.at)?;
        if self.aim == ConsistencyCriterion::Worst {
            self.lower_alone(&mut best, &at)?;
        }
        Ok(set(factors, &best))
    }

    /// Lowers each factor whose noise binds no error, until it does.
    fn lower_alone(&self, ln: &mut [f64], at: &At<'_>) -> Result<(), FilterModelError> {
        for i in 0..ln.len() {
            let moved = |by: f64| {
                let mut moved = ln.to_vec();
                moved[i] += by;
                moved
            };
            let covers = |by: f64| Ok(self.excess(&at(&moved(by))?) <= EXACT);
            let bounds = (-ln[i], 0.0);
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
    ) -> Result<FilterConsistency, FilterModelError> {
        let filter_model = filter(&scaled(self.model, factors))?;
        Ok(FilterConsistency::of(
            &self.assessments(&filter_model, self.track),
        ))
    }

    /// Every truth under the filter that `knows` makes of it.
    ///
    /// # Errors
    /// When a truth has no such filter.
    pub fn consistency_of_matched(
        &self,
        knows: impl Fn(&TrueErrors) -> Result<FilterModel, FilterModelError> + Sync,
    ) -> Result<FilterConsistency, FilterModelError> {
        let assessed = |truth: &TrueErrors| {
            let filter_model = knows(truth)?;
            Ok(FilterPass::new(self.track, &filter_model).assess_stated(&filter_model, truth))
        };
        let assessments: Result<Vec<Assessment>, FilterModelError> =
            self.truths.par_iter().map(assessed).collect();
        Ok(FilterConsistency::of(&assessments?))
    }

    fn assessments(&self, filter_model: &FilterModel, track: &Track) -> Vec<Assessment> {
        // No truth changes the filter: its gains are found once.
        let pass = FilterPass::new(track, filter_model);
        self.truths
            .par_iter()
            .map(|truth| pass.assess_stated(filter_model, truth))
            .collect()
    }

    /// Mean divergence over the truths and the cost of errors that are larger than stated; infinite where the model has no
    /// filter.
    fn value(&self, factors: &[Factor], track: &Track) -> CostValue {
        let Ok(filter_model) = (self.full)(&scaled(self.model, factors)) else {
            return CostValue {
                cost: f64::INFINITY,
                parts: Vec::new(),
            };
        };
        let overconfident = match self.aim {
            ConsistencyCriterion::Mean => 0.0,
            ConsistencyCriterion::Worst => OVERCONFIDENT,
        };
        // One-sided: an error smaller than stated costs nothing here, the divergence alone speaks of caution.
        let overconfidence = |ratios: [f64; REPORTED]| -> f64 {
            ratios
                .iter()
                .map(|r| overconfident * r.ln().max(0.0).powi(2))
                .sum()
        };
        let assessments = self.assessments(&filter_model, track);
        let share = 1.0 / assessments.len() as f64;
        let (mut cost, mut parts) = (0.0, Vec::new());
        for assessment in &assessments {
            let of_run = assessment.ratio_over_run();
            cost += share
                * (average(assessment, |end| {
                    end.divergence + overconfidence(end.ratio())
                }) + overconfidence(of_run));
            // The divergence of one state, (r² − 1)/2 − ln r, has the second derivative 2r² with respect to ln r.
            let part = |weight: f64, of_divergence: f64, r: f64| CostTerm {
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
        CostValue { cost, parts }
    }

    /// Logarithm of what should be 1: above 0 the filter is overconfident.
    fn excess(&self, consistency: &FilterConsistency) -> f64 {
        match self.aim {
            ConsistencyCriterion::Mean => (consistency.nees / NEES_DOF as f64).ln(),
            ConsistencyCriterion::Worst => consistency.largest.ratio.ln(),
        }
    }

    /// The logarithms with one number added to all, none below the lowest: the filter is consistent in the mean, or the least
    /// cautious that covers the worst.
    fn exact(&self, ln: &[f64], at: &At<'_>) -> Result<Vec<f64>, FilterModelError> {
        let moved =
            |by: f64| -> Vec<f64> { ln.iter().map(|x| (x + by).clamp(0.0, MAX_LN)).collect() };
        // Down to where the largest factor meets the lowest bound: below that nothing changes any more.
        let highest = ln.iter().copied().fold(0.0, f64::max);
        let bounds = (-highest, MAX_LN);
        if self.aim == ConsistencyCriterion::Mean {
            let crossing = RootSearch {
                bounds,
                step: 0.1,
                exact: EXACT,
            };
            let (by, _) = crossing.from(0.0, |by| {
                Ok::<_, FilterModelError>(self.excess(&at(&moved(by))?))
            })?;
            return Ok(moved(by));
        }
        let covering = smallest(bounds, |by| Ok(self.excess(&at(&moved(by))?) <= EXACT))?;
        Ok(moved(covering))
    }
}

/// The smallest factor on the standard deviations that a filter assumes of a vehicle's own measurements with which it states
/// its errors, at the ends of outages and over the run; 1 where it does already, none where a factor of a thousand does not help.
pub fn aiding_factor(track: &Track, filter_model: &FilterModel, truth: &TrueErrors) -> Option<f64> {
    let largest = |ln: f64| {
        let track = track.with_aiding_sigmas(ln.exp());
        let assessment = FilterPass::new(&track, filter_model).assess_stated(filter_model, truth);
        FilterConsistency::of(&[assessment]).largest.ratio
    };
    let covers = |ln: f64| Ok(largest(ln) <= 1.0 + TOLERANCE);
    let ln = smallest((0.0, 1000.0_f64.ln()), covers).ok()?;
    (largest(ln) <= 1.0 + TOLERANCE).then(|| ln.exp())
}

/// The consistency of the tuned filter for logarithms of the factors.
type At<'a> = dyn Fn(&[f64]) -> Result<FilterConsistency, FilterModelError> + 'a;

/// The smallest number within bounds for which a condition holds that goes on holding above; the upper bound where it holds for
/// none. A bracket from 0 first, then halves of it.
fn smallest(
    (low, high): (f64, f64),
    holds: impl Fn(f64) -> Result<bool, FilterModelError>,
) -> Result<f64, FilterModelError> {
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

// Consistency of a filter with several truths.

/// Consistency of a filter with several truths.
#[derive(Debug, Clone)]
pub struct FilterConsistency {
    /// Expected NEES, mean over time and truths; 9 is right.
    pub nees: f64,
    /// Largest ratio of true to stated errors, at an outage's end or over the whole run (without
    /// outages: at any time).
    pub largest: WorstRatio,
    /// Smallest and largest ratio of any state and of all together: what `run` calls the filter by.
    pub range: [f64; 2],
    /// When the outages end (s from the start).
    pub end_s: Vec<f64>,
    /// True RMSE of the reported states at these ends, root mean square over the truths.
    pub rmse_end: Vec<[f64; REPORTED]>,
}

/// An error over what the filter states of it.
#[derive(Debug, Clone, Copy)]
pub struct WorstRatio {
    /// Largest true RMSE over stated standard deviation in the truths.
    pub ratio: f64,
    /// The reported state.
    pub state: usize,
    /// The outage at whose end it is, counted from 0; none: over the whole run.
    pub outage: Option<usize>,
    /// The truth of that ratio, counted from 0.
    pub truth: usize,
}

impl FilterConsistency {
    /// Consistency of one filter under several truths.
    fn of(assessments: &[Assessment]) -> Self {
        let count = assessments.len() as f64;
        let mean_nees = |a: &Assessment| mean(a.reports.iter().map(|r| r.nees));
        let end_s: Vec<f64> = assessments[0]
            .outage_ends
            .iter()
            .map(|end| end.after_s)
            .collect();
        let mut rmse_end = vec![[0.0; REPORTED]; end_s.len()];
        for assessment in assessments {
            for (sum, end) in rmse_end.iter_mut().zip(&assessment.outage_ends) {
                sum.iter_mut()
                    .zip(&end.rmse)
                    .for_each(|(sum, rmse)| *sum += rmse * rmse / count);
            }
        }
        rmse_end.iter_mut().flatten().for_each(|x| *x = x.sqrt());
        let departures = departures(assessments);
        let nees = mean(assessments.iter().map(mean_nees));
        let at_ends = assessments
            .iter()
            .flat_map(|a| a.outage_ends.iter().map(|end| end.nees));
        let together = std::iter::once(nees)
            .chain(at_ends)
            .map(|nees| (nees / NEES_DOF as f64).sqrt());
        let largest = WorstRatio::largest(&departures);
        let places = if end_s.is_empty() {
            over_run_of(assessments).to_vec()
        } else {
            departures
        };
        let ratios = places.into_iter().map(|d| d.ratio).chain(together);
        let range = ratios.fold([f64::INFINITY, 0.0], |[low, high], r| {
            [r.min(low), r.max(high)]
        });
        Self {
            nees,
            largest,
            range,
            end_s,
            rmse_end,
        }
    }

    /// Horizontal RMSE at the end of each outage (m).
    pub fn horizontal_m(&self) -> impl Iterator<Item = f64> {
        self.rmse_end.iter().map(|rmse| rmse[0].hypot(rmse[1]))
    }
}

impl WorstRatio {
    fn largest(all: &[Self]) -> Self {
        let none = Self {
            ratio: 0.0,
            state: 0,
            outage: None,
            truth: 0,
        };
        all.iter()
            .fold(none, |a, b| if b.ratio > a.ratio { *b } else { a })
    }
}

/// Every state at every place where a filter is judged: at the ends of outages and then over the whole run; without outages
/// wherever it reports.
fn departures(assessments: &[Assessment]) -> Vec<WorstRatio> {
    let at = |outage: Option<usize>, instants: fn(&Assessment) -> &[Consistency], k: usize| {
        states(assessments, outage, &|a| instants(a)[k].ratio())
    };
    match assessments[0].outage_ends.len() {
        0 => (0..assessments[0].reports.len())
            .flat_map(|k| at(None, |a| &a.reports, k))
            .collect(),
        ends => {
            let at_ends = (0..ends).flat_map(|k| at(Some(k), |a| &a.outage_ends, k));
            at_ends.chain(over_run_of(assessments)).collect()
        }
    }
}

fn over_run_of(assessments: &[Assessment]) -> [WorstRatio; REPORTED] {
    states(assessments, None, &Assessment::ratio_over_run)
}

/// Every state at one place.
fn states(
    assessments: &[Assessment],
    outage: Option<usize>,
    ratios: &dyn Fn(&Assessment) -> [f64; REPORTED],
) -> [WorstRatio; REPORTED] {
    let of_truths: Vec<[f64; REPORTED]> = assessments.iter().map(ratios).collect();
    std::array::from_fn(|state| {
        let ratios = of_truths.iter().map(|of_truth| of_truth[state]);
        let largest = ratios
            .enumerate()
            .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        WorstRatio {
            ratio: largest.1,
            state,
            outage,
            truth: largest.0,
        }
    })
}

// Factors on the variances of a noise model.

/// Factor on the noise of a sensor.
#[derive(Debug, Clone, Copy)]
pub struct Factor {
    /// The sensor.
    pub sensor: Sensor,
    /// The factor on the variances of all its processes.
    pub on_variance: f64,
}

impl Factor {
    /// Returns true if the search ended at the largest factor that it tries, e^12, which means
    /// nothing.
    pub fn is_at_limit(&self) -> bool {
        self.on_variance.ln().abs() > MAX_LN - 1e-6
    }
}

/// Largest logarithm of a factor.
const MAX_LN: f64 = 12.0;

/// The factors of a model, all 1: of the sensors with noise that a filter models.
fn multiplied(model: &Model) -> Vec<Factor> {
    let has_noise = |sensor: &Sensor| {
        Channel::ALL
            .into_iter()
            .filter(|channel| channel.sensor == *sensor)
            .any(|channel| model.axis(channel).processes.iter().any(is_felt))
    };
    let one = |sensor| Factor {
        sensor,
        on_variance: 1.0,
    };
    Sensor::ALL.into_iter().filter(has_noise).map(one).collect()
}

/// True if a filter models the process and its amplitude is not zero.
fn is_felt(process: &Process) -> bool {
    process.amplitude() != 0.0 && process.kind() != ProcessKind::Quantization
}

fn set(factors: &[Factor], ln: &[f64]) -> Vec<Factor> {
    factors
        .iter()
        .zip(ln)
        .map(|(f, ln)| Factor {
            on_variance: ln.exp(),
            ..*f
        })
        .collect()
}

/// A model whose processes are multiplied; the factors are the same at any sample rate.
pub fn scaled(model: &Model, factors: &[Factor]) -> Model {
    let mut scaled = model.clone();
    for channel in Channel::ALL {
        let Some(factor) = factors.iter().find(|f| f.sensor == channel.sensor) else {
            continue;
        };
        for process in &mut scaled.axes[channel.index()].processes {
            if is_felt(process) {
                // beyond the largest number nothing is left to enlarge
                *process = process.times(factor.on_variance).unwrap_or(*process);
            }
        }
    }
    scaled
}

// Where a function that falls crosses zero.

/// Settings of the search for a crossing.
pub(crate) struct RootSearch {
    /// Range of the variable.
    pub bounds: (f64, f64),
    /// First step away from the start; it doubles until there is a bracket.
    pub step: f64,
    /// A value this close to zero is zero.
    pub exact: f64,
}

/// Evaluations within a bracket. The Illinois rule gains a digit in two of them.
const TRIALS: usize = 40;

impl RootSearch {
    /// The variable and its value: within `exact` of zero, or at a bound where there is no crossing. From a value
    /// above zero the variable goes up. A bracket first, then regula falsi with the Illinois rule, which
    /// keeps it.
    pub(crate) fn from<E>(
        &self,
        start: f64,
        mut value: impl FnMut(f64) -> Result<f64, E>,
    ) -> Result<(f64, f64), E> {
        let mut near = (start, value(start)?);
        if near.1.abs() <= self.exact {
            return Ok(near);
        }
        // The function falls: a value above zero means that the crossing lies above.
        let mut step = self.step.copysign(near.1);
        let mut far = near;
        while far.1 * near.1 > 0.0 {
            near = far;
            let next = (near.0 + step).clamp(self.bounds.0, self.bounds.1);
            if next == near.0 {
                return Ok(near);
            }
            far = (next, value(next)?);
            // Zero may be where the function ends and not where it crosses.
            if far.1.abs() <= self.exact {
                return Ok(far);
            }
            step *= 2.0;
        }
        for _ in 0..TRIALS {
            if far.1.abs() <= self.exact || !far.1.is_finite() {
                break;
            }
            let middle = (near.0 * far.1 - far.0 * near.1) / (far.1 - near.1);
            let found = (middle, value(middle)?);
            // Illinois: the end that stays is given half of its value, since plain regula falsi keeps one end
            // for ever where the function is convex.
            near = if found.1 * far.1 < 0.0 {
                far
            } else {
                (near.0, 0.5 * near.1)
            };
            far = found;
        }
        Ok(far)
    }
}

#[cfg(test)]
mod root_tests {
    use super::*;
    use std::convert::Infallible;

    fn found(start: f64, f: impl Fn(f64) -> f64) -> f64 {
        let crossing = RootSearch {
            bounds: (-5.0, 5.0),
            step: 0.1,
            exact: 1e-9,
        };
        let Ok((x, _)) = crossing.from::<Infallible>(start, |x| Ok(f(x)));
        x
    }

    #[test]
    fn a_crossing_is_found_from_either_side_and_a_bound_where_there_is_none() {
        let falling = |x: f64| (-x).exp() - 2.0;
        for start in [-4.0, 0.0, 4.0] {
            assert!((found(start, falling) + std::f64::consts::LN_2).abs() < 1e-8);
        }
        assert_eq!(
            (found(0.0, |x| 9.0 - x), found(0.0, |x| -9.0 - x)),
            (5.0, -5.0)
        );
        // it comes close to zero from above and never crosses
        assert!(found(0.0, |x| (-20.0 * x).exp()) < 2.0);
        // a step: the bracket closes on it
        assert!((found(0.0, |x| if x < 1.25 { 1.0 } else { -1.0 }) - 1.25).abs() < 0.1);
    }
}
