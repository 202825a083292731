//! The recordings of a laboratory, measured, and the models that are made of all but one of them.

use super::candidate::Candidate;
use super::job::FEWEST;
use nav_sim_calibration::{
    CalibrationError, Estimator, Group, ModelChoice, ModelSpec, Outcome, Pool, Replicate, Settings,
    Verdict, calibrate, diagnose, grouped, model_of,
};
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::Model;
use std::sync::OnceLock;

/// One recording: what is kept of it. The stretches of a file that has gaps are one.
#[derive(Debug, Clone)]
pub struct Unit {
    /// What it is called.
    pub name: String,
    /// The wavelet variances of its signals.
    pub replicates: Vec<(Channel, Replicate)>,
}

/// All recordings and how models are made of them.
#[derive(Debug)]
pub struct Laboratory {
    units: Vec<Unit>,
    settings: Settings,
    pool: Option<Pool>,
    /// The noise of each recording alone, once it was asked for.
    models: Vec<OnceLock<Model>>,
}

/// The groups of recordings that were calibrated, their fits, and how these were made.
pub(crate) type Calibrated = (Vec<Group>, Vec<Outcome>, Settings);

impl Laboratory {
    /// Estimators and model of the settings count nothing: those of the candidates do. `pool`: which signals are
    /// replicates of one another; none: the axes of a sensor, but for single recordings.
    #[must_use]
    pub fn new(units: Vec<Unit>, settings: Settings, pool: Option<Pool>) -> Self {
        let models = units.iter().map(|_| OnceLock::new()).collect();
        Self {
            units,
            settings,
            pool,
            models,
        }
    }

    /// The recordings.
    pub(crate) fn units(&self) -> &[Unit] {
        &self.units
    }

    /// Calibrates a candidate on all recordings but one, before any inflation. An estimator of single recordings takes
    /// that after the one left out (the first, where none is), so that each is taken once.
    ///
    /// # Errors
    /// When a trim leaves no replicate, or a curve is too short for the model.
    pub(crate) fn calibrate(
        &self,
        candidate: &Candidate,
        without: Option<usize>,
    ) -> Result<Calibrated, CalibrationError> {
        let of_units: Vec<&Unit> = if candidate.estimator.is_single() {
            vec![&self.units[without.map_or(0, |k| (k + 1) % self.units.len())]]
        } else {
            self.others(without).map(|k| &self.units[k]).collect()
        };
        self.fit(&of_units, candidate.estimator, &candidate.model, self.pool)
    }

    /// The recordings but one.
    pub(super) fn others(&self, without: Option<usize>) -> impl Iterator<Item = usize> {
        (0..self.units.len()).filter(move |k| Some(*k) != without)
    }

    /// The recordings that judge candidates: an abnormal one has errors that the IMU does not have in use, and a score that
    /// outweighs all others. All, where too few are normal.
    ///
    /// # Errors
    /// When a curve is too short for the model.
    pub(crate) fn judges(&self) -> Result<Vec<usize>, CalibrationError> {
        let all: Vec<usize> = self.others(None).collect();
        let n2 = ModelChoice::Given(ModelSpec::n2());
        let (groups, outcomes, settings) = self.fit(
            &self.units.iter().collect::<Vec<_>>(),
            Estimator::DrAwv,
            &n2,
            self.pool,
        )?;
        let abnormal: Vec<String> = diagnose(&groups, &outcomes, &settings)
            .into_iter()
            .filter(|diagnosis| diagnosis.verdict != Verdict::Normal)
            .map(|diagnosis| diagnosis.name)
            .collect();
        let is_normal = |k: &usize| {
            self.units[*k]
                .replicates
                .iter()
                .all(|(_, r)| !abnormal.contains(&r.name))
        };
        let normal: Vec<usize> = all.iter().copied().filter(is_normal).collect();
        Ok(if normal.len() < FEWEST { all } else { normal })
    }

    /// The noise of one recording as it was met: N2 fitted to the classical wavelet variance of each axis.
    ///
    /// # Errors
    /// When a curve is too short for the model.
    pub(crate) fn own_model(&self, k: usize) -> Result<&Model, CalibrationError> {
        if self.models[k].get().is_none() {
            let n2 = ModelChoice::Given(ModelSpec::n2());
            let (_, outcomes, settings) =
                self.fit(&[&self.units[k]], Estimator::Awv, &n2, Some(Pool::Axes))?;
            // another thread may have been as quick, with the same model
            let _ = self.models[k].set(model_of(&outcomes, settings.rate_hz));
        }
        Ok(self.models[k].get().expect("set above"))
    }

    fn fit(
        &self,
        units: &[&Unit],
        estimator: Estimator,
        model: &ModelChoice,
        pool: Option<Pool>,
    ) -> Result<Calibrated, CalibrationError> {
        let settings = Settings {
            estimators: vec![estimator],
            model: model.clone(),
            ..self.settings.clone()
        };
        // an estimator of single recordings cannot pool axes
        let pool = if estimator.is_single() {
            Pool::Axes
        } else {
            pool.unwrap_or(settings.pool())
        };
        let groups = grouped(
            units
                .iter()
                .flat_map(|unit| unit.replicates.clone())
                .collect(),
            pool,
        );
        let outcomes = calibrate(&groups, &settings)?;
        Ok((groups, outcomes, settings))
    }
}
