//! The places of an outage along a trajectory, and the errors at its end.

use super::{Limit, Quantity, Worst};
use crate::ekf::{Belief, BeliefError};
use crate::metrics::QuadraticForm;
use crate::noise::Model;
use crate::scenario::Scenario;
use crate::sensors::imu::Truth;
use crate::sensors::outage::Outage;
use crate::simulation::ExperimentError;
use crate::simulation::lincov::{
    Crossing, Instant, Moments, NamedSource, Track, TruthSide, errors_in_outages,
};
use crate::trajectory::Trajectory;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// True errors at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// How long the outage has lasted (s).
    pub after_s: f64,
    /// Mean of the position error, north and east (m).
    pub mean_m: [f64; 2],
    /// Its covariance (m²).
    pub covariance_m2: [[f64; 2]; 2],
    /// RMSE of roll, pitch, yaw (degrees).
    pub angles_deg: [f64; 3],
}

impl Drift {
    fn of(instant: &Instant, after_s: f64) -> Self {
        let p = &instant.covariance;
        let rmse = instant.rmse();
        Self {
            after_s,
            mean_m: [instant.mean[0], instant.mean[1]],
            covariance_m2: [[p[0][0], p[0][1]], [p[1][0], p[1][1]]],
            angles_deg: [rmse[6], rmse[7], rmse[8]],
        }
    }

    /// The value of a quantity (m or degrees).
    pub fn value(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::P50 => self.quantile(0.5),
            Quantity::P95 => self.quantile(0.95),
            Quantity::Rmse => self.square(quantity).sqrt(),
            Quantity::Roll => self.angles_deg[0],
            Quantity::Pitch => self.angles_deg[1],
            Quantity::Yaw => self.angles_deg[2],
        }
    }

    /// The mean square behind a quantity (m² or degrees²), in which the parts of independent sources add.
    pub(super) fn square(&self, quantity: Quantity) -> f64 {
        match quantity.angle() {
            Some(i) => self.angles_deg[i].powi(2),
            // The quantiles have no sum over sources: shares are of the mean square whatever quantile is
            // limited.
            None => (0..2)
                .map(|i| self.covariance_m2[i][i] + self.mean_m[i].powi(2))
                .sum(),
        }
    }

    /// What a value is at most, at next to no cost.
    fn bound(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::P50 => self.quantile_bound(0.5),
            Quantity::P95 => self.quantile_bound(0.95),
            _ => self.value(quantity),
        }
    }

    /// The mean, and the quantile of a circular error whose variance on every axis is the largest of this one's.
    fn quantile_bound(&self, probability: f64) -> f64 {
        let [[north, both], [_, east]] = self.covariance_m2;
        let largest = 0.5 * (north + east + (north - east).hypot(2.0 * both));
        self.mean_m[0].hypot(self.mean_m[1]) + (-2.0 * (1.0 - probability).ln() * largest).sqrt()
    }

    /// Whether a limit is exceeded, or the value is not a number.
    pub fn exceeds(&self, limit: &Limit) -> bool {
        let is_within = |value: f64| value <= limit.most;
        !is_within(self.bound(limit.quantity)) && !is_within(self.value(limit.quantity))
    }

    /// The largest value of a quantity and where it is; what is not a number is the largest.
    pub fn largest(drifts: &[Self], quantity: Quantity) -> Option<(usize, f64)> {
        let bound = |drift: &Self| {
            Some(drift.bound(quantity))
                .filter(|b| !b.is_nan())
                .unwrap_or(f64::INFINITY)
        };
        let mut bounds: Vec<(usize, f64)> = drifts.iter().map(bound).enumerate().collect();
        bounds.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut largest: Option<(usize, f64)> = None;
        // A quantile is an integral: only those are computed that may be the largest.
        for (place, bound) in bounds {
            if largest.is_some_and(|(_, value)| bound <= value || value.is_nan()) {
                break;
            }
            let value = drifts[place].value(quantity);
            if largest.is_none_or(|(_, largest)| value > largest || value.is_nan()) {
                largest = Some((place, value));
            }
        }
        largest
    }

    fn quantile(&self, probability: f64) -> f64 {
        let covariance = DMatrix::from_fn(2, 2, |i, j| self.covariance_m2[j][i]);
        // North and east have unequal variances and are correlated: the horizontal error is neither Rayleigh
        // nor normal.
        QuadraticForm::of_square(&covariance, &self.mean_m)
            .quantile(probability)
            .sqrt()
    }
}

/// A trajectory with an outage at several places, each alone.
pub struct Course<'a> {
    trajectory: &'a Trajectory,
    track: Track,
    outages: Vec<Outage>,
}

impl<'a> Course<'a> {
    /// Linearises along the trajectory; of the scenario, receiver, barometer and start count. Outages may overlap.
    ///
    /// # Errors
    /// When trajectory, rates and fixes do not fit together.
    pub fn new(
        scenario: &Scenario,
        trajectory: &'a Trajectory,
        outages: &[Outage],
    ) -> Result<Self, ExperimentError> {
        // The track is of the reference alone; the noise that is sought comes later, a hundred times over the
        // same track.
        let silent = Model {
            rate_hz: scenario.imu.rate_hz,
            axes: Default::default(),
        };
        let track = scenario.track(trajectory, &silent, &[])?.merged();
        Ok(Self {
            trajectory,
            track,
            outages: outages.to_vec(),
        })
    }

    /// Errors at the outage's end, at each place, of the filter that knows the model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn drifts(&self, scenario: &Scenario, model: &Model) -> Result<Vec<Drift>, BeliefError> {
        self.drifts_in(&self.outages, scenario, model)
    }

    /// Errors at every whole second of the outage, at each place.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn curves(
        &self,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<Vec<Vec<Drift>>, BeliefError> {
        let belief = self.belief(scenario, model)?;
        let all = TruthSide::together(&self.sources(scenario, model));
        let laws = errors_in_outages(&self.track, &belief, &all, &self.outages, Moments::Reports);
        let curve = |(instants, outage): (Vec<Instant>, &Outage)| {
            // A report within the outage is what an outage would leave that ended there.
            let drift = |instant: &Instant| Drift::of(instant, instant.t_s - outage.start_s);
            let mut curve: Vec<Drift> = instants
                .iter()
                .map(drift)
                .filter(|d| d.after_s > 0.0)
                .collect();
            if let Some(end) = curve.last_mut() {
                end.after_s = outage.end_s - outage.start_s;
            }
            curve
        };
        Ok(laws.into_iter().zip(&self.outages).map(curve).collect())
    }

    /// The errors of each group of sources alone, under the gains of the filter that knows them all.
    pub(super) fn parts(
        &self,
        place: usize,
        scenario: &Scenario,
        model: &Model,
        group: &(dyn Fn(&NamedSource) -> usize + Sync),
        groups: usize,
    ) -> Result<Vec<Drift>, BeliefError> {
        let belief = self.belief(scenario, model)?;
        let sources = self.sources(scenario, model);
        let part = |g: usize| {
            let own: Vec<NamedSource> = sources
                .iter()
                .filter(|source| group(source) == g)
                .cloned()
                .collect();
            self.ends(
                &self.outages[place..=place],
                &belief,
                &TruthSide::together(&own),
            )[0]
        };
        Ok((0..groups).into_par_iter().map(part).collect())
    }

    /// The hardest limit of a filter that knows the model.
    pub(super) fn worst(
        &self,
        scenario: &Scenario,
        model: &Model,
        limits: &[Limit],
    ) -> Result<Worst, BeliefError> {
        let worst = Worst::of(limits, &self.drifts(scenario, model)?);
        Ok(worst.expect("at least one limit and one place"))
    }

    /// Where the margin of the hardest limit falls to `reserve` along IMUs of a rising logarithm, each with the scenario
    /// of a filter that knows it, as [`Crossing::from`] 0; the logarithm and what is left beyond the reserve.
    ///
    /// The search is at the places that were the worst so far; what it finds is held against all, and it goes on where
    /// another is worse. The answer is that of all places, at the cost of a few.
    pub(super) fn crossing(
        &self,
        limits: &[Limit],
        (crossing, reserve): (&Crossing, f64),
        imu_at: impl Fn(f64) -> (Scenario, Model),
    ) -> Result<(f64, f64), BeliefError> {
        let worst_at = |ln: f64| {
            let (scenario, model) = imu_at(ln);
            self.worst(&scenario, &model, limits)
        };
        let mut places = vec![worst_at(0.0)?.place];
        let mut start = 0.0;
        loop {
            let outages: Vec<Outage> = places.iter().map(|place| self.outages[*place]).collect();
            let margin_there = |ln: f64| {
                let (scenario, model) = imu_at(ln);
                let worst = Worst::of(limits, &self.drifts_in(&outages, &scenario, &model)?);
                Ok::<_, BeliefError>(
                    worst.expect("at least one limit and one place").margin() - reserve,
                )
            };
            let (ln, there) = crossing.from(start, margin_there)?;
            let worst = worst_at(ln)?;
            let everywhere = worst.margin() - reserve;
            if everywhere >= there - crossing.exact || places.contains(&worst.place) {
                return Ok((ln, everywhere));
            }
            places.push(worst.place);
            start = ln;
        }
    }

    fn drifts_in(
        &self,
        outages: &[Outage],
        scenario: &Scenario,
        model: &Model,
    ) -> Result<Vec<Drift>, BeliefError> {
        let all = TruthSide::together(&self.sources(scenario, model));
        Ok(self.ends(outages, &self.belief(scenario, model)?, &all))
    }

    fn ends(&self, outages: &[Outage], belief: &Belief, truth: &TruthSide) -> Vec<Drift> {
        let ends = errors_in_outages(&self.track, belief, truth, outages, Moments::End);
        let drift = |(instants, outage): (Vec<Instant>, &Outage)| {
            Drift::of(
                instants.last().expect("every outage has an end"),
                outage.end_s - outage.start_s,
            )
        };
        ends.into_iter().zip(outages).map(drift).collect()
    }

    /// The filter that knows every process: the best that this IMU allows, whatever reduction is chosen later.
    fn belief(&self, scenario: &Scenario, model: &Model) -> Result<Belief, BeliefError> {
        scenario
            .with_full_noise()
            .belief(model, &self.outages, &self.track)
    }

    fn sources(&self, scenario: &Scenario, model: &Model) -> Vec<NamedSource> {
        let truth = Truth::Model(model);
        TruthSide::sources(
            &scenario.experiment(self.trajectory, truth, &[], &self.outages, 0),
            model,
        )
    }
}

/// Outages of one length at `places` times, the first at `first_s`, evenly to the end of the trajectory.
pub fn evenly(first_s: f64, end_s: f64, length_s: f64, places: u32) -> Vec<Outage> {
    let last_s = end_s - length_s;
    let step = if places > 1 {
        (last_s - first_s).max(0.0) / f64::from(places - 1)
    } else {
        0.0
    };
    let mut outages: Vec<Outage> = (0..places)
        // Reports come at whole seconds: only from such a start are the errors within the outage those after
        // 1, 2, 3 … s.
        .map(|k| (first_s + f64::from(k) * step).floor())
        .map(|start_s| Outage {
            start_s,
            end_s: start_s + length_s,
        })
        .collect();
    outages.dedup();
    outages
}
