//! The recordings of a laboratory, measured, and the models that are made of all but one of them.

use super::candidate::Candidate;
use crate::calibration::{
    CalibrationError, Estimator, Group, ModelChoice, ModelSpec, Pool, Replicate, Settings, calibrate, grouped,
};
use crate::imu::Channel;
use crate::noise::Model;

/// One recording: what is kept of it. The stretches of a file that has gaps are one.
#[derive(Debug, Clone)]
pub struct Unit {
    /// What it is called.
    pub name: String,
    /// The wavelet variances of its signals.
    pub replicates: Vec<(Channel, Replicate)>,
}

/// All recordings and how models are made of them.
#[derive(Debug, Clone)]
pub struct Laboratory {
    /// The recordings.
    pub units: Vec<Unit>,
    /// How models are fitted; estimators and model are those of the candidates.
    pub settings: Settings,
    /// Which signals are replicates of one another; none: the axes of a sensor, but for single recordings.
    pub pool: Option<Pool>,
}

impl Laboratory {
    /// The model of a candidate, of all recordings but one, before any inflation. An estimator of single recordings
    /// takes that after the one left out (the first, where none is), so that each is taken once.
    ///
    /// # Errors
    /// When a trim leaves no replicate, or a curve is too short for the model.
    pub fn model(&self, candidate: &Candidate, without: Option<usize>) -> Result<Model, CalibrationError> {
        let of_units: Vec<&Unit> = if candidate.estimator.is_single() {
            vec![&self.units[without.map_or(0, |k| (k + 1) % self.units.len())]]
        } else {
            self.others(without).map(|(_, unit)| unit).collect()
        };
        let Candidate { estimator, ref model, .. } = *candidate;
        self.fit(&of_units, estimator, model, self.pool)
    }

    /// The recordings but one, with their indices.
    pub(super) fn others(&self, without: Option<usize>) -> impl Iterator<Item = (usize, &Unit)> {
        self.units.iter().enumerate().filter(move |(k, _)| Some(*k) != without)
    }

    /// The noise of one recording as it was met: N2 fitted to the classical wavelet variance of each axis.
    ///
    /// # Errors
    /// When a curve is too short for the model.
    pub fn own_model(&self, k: usize) -> Result<Model, CalibrationError> {
        let n2 = ModelChoice::Given(ModelSpec::n2());
        self.fit(&[&self.units[k]], Estimator::Awv, &n2, Some(Pool::Axes))
    }

    fn fit(
        &self,
        units: &[&Unit],
        estimator: Estimator,
        model: &ModelChoice,
        pool: Option<Pool>,
    ) -> Result<Model, CalibrationError> {
        let settings =
            Settings { estimators: vec![estimator], model: model.clone(), ..self.settings.clone() };
        // an estimator of single recordings cannot pool axes
        let pool = if estimator.is_single() { Pool::Axes } else { pool.unwrap_or(settings.pool()) };
        let replicates = units.iter().flat_map(|unit| unit.replicates.clone()).collect();
        let groups: Vec<Group> = grouped(replicates, pool);
        let mut fitted = Model { rate_hz: settings.rate_hz, axes: Default::default() };
        for outcome in calibrate(&groups, &settings)? {
            for channel in outcome.scope.channels() {
                fitted.axes[channel.index()] = outcome.fit.composite.clone();
            }
        }
        Ok(fitted)
    }
}
