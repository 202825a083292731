//! The places of an outage along a trajectory, and the errors at its end.

use super::{Limit, Quantity, Worst};
use crate::ekf::BeliefError;
use crate::metrics::QuadraticForm;
use crate::noise::Model;
use crate::scenario::Scenario;
use crate::sensors::imu::Truth;
use crate::sensors::outage::Outage;
use crate::simulation::ExperimentError;
use crate::simulation::lincov::{FilterPass, Instant, NamedSource, Track, TruthSide};
use crate::trajectory::Trajectory;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// True errors at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// How long there has been no fix (s).
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
    #[must_use]
    pub fn value(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::P50 => self.quantile(0.5),
            Quantity::P95 => self.quantile(0.95),
            Quantity::Rmse => self.square(quantity).sqrt(),
            Quantity::Angle(i) => self.angles_deg[i],
        }
    }

    /// The mean square behind a quantity (m² or degrees²), in which the parts of independent sources add.
    pub(super) fn square(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Angle(i) => self.angles_deg[i].powi(2),
            // The quantiles have no sum over sources: shares are of the mean square whatever quantile is
            // limited.
            _ => (0..2).map(|i| self.covariance_m2[i][i] + self.mean_m[i].powi(2)).sum(),
        }
    }

    fn quantile(&self, probability: f64) -> f64 {
        let covariance = DMatrix::from_fn(2, 2, |i, j| self.covariance_m2[j][i]);
        // North and east have unequal variances and are correlated: the horizontal error is neither Rayleigh
        // nor normal.
        QuadraticForm::of_square(&covariance, &self.mean_m).quantile(probability).sqrt()
    }
}

/// One place of the outage.
struct Place {
    outage: [Outage; 1],
    /// To the end of the outage.
    track: Track,
}

/// A trajectory with an outage of one length at several places, each alone.
pub struct Course<'a> {
    trajectory: &'a Trajectory,
    places: Vec<Place>,
}

/// What is seen of a course, which is followed in steps of a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// The outage's end alone.
    End,
    /// Every second of the outage.
    Seconds,
}

impl<'a> Course<'a> {
    /// Linearises along the trajectory for each place; of the scenario, receiver, barometer and start count.
    ///
    /// # Errors
    /// When trajectory, rates and fixes do not fit together.
    pub fn new(
        scenario: &Scenario,
        trajectory: &'a Trajectory,
        outages: &[Outage],
        detail: Detail,
    ) -> Result<Self, ExperimentError> {
        // The track is of the reference alone; the noise that is sought comes later, a hundred times over the
        // same track.
        let silent = Model { rate_hz: scenario.imu.rate_hz, axes: Default::default() };
        let place = |outage: &Outage| {
            let track = scenario.track(trajectory, &silent, &[*outage])?.until_outage_end();
            // The same steps for both: the error after 60 s of a long outage is that of an outage of 60 s.
            let track = if detail == Detail::End { track.coarse() } else { track.merged() };
            Ok(Place { outage: [*outage], track })
        };
        let places = outages.par_iter().map(place).collect::<Result<_, ExperimentError>>()?;
        Ok(Self { trajectory, places })
    }

    /// Errors at the outage's end, at each place, of the filter that knows the model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn drifts(&self, scenario: &Scenario, model: &Model) -> Result<Vec<Drift>, BeliefError> {
        let end = |place: &Place| {
            let all = TruthSide::together(&self.sources(place, scenario, model));
            let end = place.filter(scenario, model)?.errors_at_ends(&all);
            Ok(place.drift(end.first().copied()))
        };
        self.places.par_iter().map(end).collect()
    }

    /// Errors at every whole second of the outage, at each place.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn curves(&self, scenario: &Scenario, model: &Model) -> Result<Vec<Vec<Drift>>, BeliefError> {
        let curve = |place: &Place| {
            let all = TruthSide::together(&self.sources(place, scenario, model));
            let law = place.filter(scenario, model)?.errors(&all);
            let outage = place.outage[0];
            // a report within the outage is what an outage would leave that ended there
            let within = law.reports.iter().filter(|r| r.t_s > outage.start_s && r.t_s < outage.end_s);
            let drift = |instant: &Instant| Drift::of(instant, instant.t_s - outage.start_s);
            Ok(within.map(drift).chain([place.drift(law.outage_ends.first().copied())]).collect())
        };
        self.places.par_iter().map(curve).collect()
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
        let place = &self.places[place];
        let filter = place.filter(scenario, model)?;
        let sources = self.sources(place, scenario, model);
        let part = |g: usize| {
            let own: Vec<NamedSource> = sources.iter().filter(|source| group(source) == g).cloned().collect();
            place.drift(filter.errors_at_ends(&TruthSide::together(&own)).first().copied())
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

    fn sources(&self, place: &Place, scenario: &Scenario, model: &Model) -> Vec<NamedSource> {
        let truth = Truth::Model(model);
        TruthSide::sources(&scenario.experiment(self.trajectory, truth, &[], &place.outage, 0), model)
    }
}

impl Place {
    fn filter(&self, scenario: &Scenario, model: &Model) -> Result<FilterPass<'_>, BeliefError> {
        // The filter that knows every process: the best that this IMU allows, whatever reduction is chosen
        // later.
        let belief = scenario.with_full_noise().belief(model, &self.outage, &self.track)?;
        Ok(FilterPass::new(&self.track, &belief))
    }

    fn drift(&self, end: Option<Instant>) -> Drift {
        let length_s = self.outage[0].end_s - self.outage[0].start_s;
        Drift::of(&end.expect("every place has its outage"), length_s)
    }
}

/// Outages of one length at `places` times, the first at `first_s`, evenly to the end of the trajectory.
#[must_use]
pub fn evenly(first_s: f64, end_s: f64, length_s: f64, places: u32) -> Vec<Outage> {
    let last_s = end_s - length_s;
    let step = if places > 1 { (last_s - first_s).max(0.0) / f64::from(places - 1) } else { 0.0 };
    let mut outages: Vec<Outage> = (0..places)
        // Reports come at whole seconds: only from such a start are the errors within the outage those after
        // 1, 2, 3 … s.
        .map(|k| (first_s + f64::from(k) * step).floor())
        .map(|start_s| Outage { start_s, end_s: start_s + length_s })
        .collect();
    outages.dedup();
    outages
}
