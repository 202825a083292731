//! Where candidates navigate, and what they do on a recording that they have not seen.

use super::candidate::{Candidate, Inflation};
use super::laboratory::Laboratory;
use super::score::Score;
use crate::app::Failure;
use nav_sim_calibration::{CalibrationError, model_of};
use nav_sim_navigation::ekf::{Belief, BeliefError};
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::imu::{Truth, TruthError};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::ExperimentError;
use nav_sim_navigation::simulation::lincov::{
    Aim, Factor, FilterPass, Task, Track, TrueErrors, TruthSide, scaled,
};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::{Recording, Sensor};
use nav_sim_signal::noise::Model;
use nav_sim_signal::noise::continuous::same_rate;
use rayon::prelude::*;
use std::borrow::Cow;

/// A trajectory with its fixes, outages and random numbers.
#[derive(Debug)]
pub struct Drive {
    trajectory: Trajectory,
    scenario: Scenario,
    outages: Vec<Outage>,
    seed: u64,
    track: Track,
}

/// One recording left out.
#[derive(Debug, Clone)]
pub struct Fold {
    /// Scores of the candidates, in their order: on windows of the recording, or what is expected where it is shorter
    /// than the trajectory.
    pub scores: Vec<Score>,
    /// What covariance analysis expects of each where the recording's own N2 makes the errors, if it was asked.
    pub expected: Option<Vec<Score>>,
    /// Windows that were navigated; 0 where the recording is shorter than the trajectory.
    pub windows: u64,
}

impl Drive {
    /// Along a trajectory as far as the end of the last outage, with the rate of the recordings (Hz), which becomes that
    /// of the IMU.
    ///
    /// # Errors
    /// When trajectory, rates and fixes do not fit together.
    pub fn new(
        trajectory: &Trajectory,
        mut scenario: Scenario,
        outages: Vec<Outage>,
        rate_hz: f64,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if !same_rate(scenario.imu.rate_hz, rate_hz) {
            scenario.imu.rate_hz = rate_hz;
        }
        // what comes after the last outage is not judged
        let judged_s = outages
            .iter()
            .map(|o| o.end_s)
            .fold(f64::NEG_INFINITY, f64::max);
        let trajectory = trajectory.until(judged_s + 1.0 / scenario.gnss.rate_hz);
        let none = Model {
            rate_hz,
            axes: Default::default(),
        };
        let track = scenario.track(&trajectory, &none, &outages)?;
        Ok(Self {
            trajectory,
            scenario,
            outages,
            seed,
            track,
        })
    }

    /// How many windows as long as the trajectory lie side by side in so many samples.
    pub(crate) fn independent_windows(&self, samples: usize) -> f64 {
        let lasts_s = self.trajectory.end_s() - self.trajectory.start_s();
        samples as f64 / (lasts_s * self.scenario.imu.rate_hz)
    }

    /// Leaves out recording `k`, whose samples are `recordings` (several stretches of a file that has gaps), and
    /// takes every candidate along the trajectory `runs` times. `progress` is told how many runs are done.
    ///
    /// # Errors
    /// When a model cannot be made, has no such filter, or rates do not fit together.
    pub fn leave_out(
        &self,
        laboratory: &Laboratory,
        k: usize,
        recordings: &[Recording],
        candidates: &[Candidate],
        runs: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Fold, Failure> {
        let models = self.models(laboratory, Some(k), candidates)?;
        let beliefs = self.beliefs(candidates, &models)?;
        let left_out_model = own_model(laboratory, k)?;
        let expected = self.expected(&beliefs, left_out_model);
        let is_long = |r: &Recording| self.independent_windows(r.len()) >= 1.0;
        let usable: Cow<'_, [Recording]> = if recordings.iter().all(is_long) {
            recordings.into()
        } else {
            recordings.iter().filter(|r| is_long(r)).cloned().collect()
        };
        let sampled = if usable.is_empty() {
            None
        } else {
            self.sampled(&beliefs, &usable, runs, progress)?
        };
        if sampled.is_none() {
            progress(runs);
        }
        let windows = if sampled.is_some() { runs } else { 0 };
        Ok(Fold {
            scores: sampled.unwrap_or_else(|| expected.clone()),
            expected: Some(expected),
            windows,
        })
    }

    /// The model of every candidate, of all recordings but one, inflated as it says.
    ///
    /// # Errors
    /// When a model cannot be made or tuned.
    pub fn models(
        &self,
        laboratory: &Laboratory,
        without: Option<usize>,
        candidates: &[Candidate],
    ) -> Result<Vec<Model>, Failure> {
        let mut made: Vec<(&Candidate, Model)> = Vec::new();
        for candidate in candidates {
            if !made
                .iter()
                .any(|(other, _)| other.is_calibrated_as(candidate))
            {
                let calibrated = laboratory.calibrate(candidate, without);
                let (_, outcomes, settings) =
                    calibrated.map_err(|source| uncalibrated(candidate, source))?;
                made.push((candidate, model_of(&outcomes, settings.rate_hz)));
            }
        }
        let inflated = |candidate: &Candidate| {
            let (_, model) = made
                .iter()
                .find(|(c, _)| c.is_calibrated_as(candidate))
                .expect("made above");
            self.inflated(laboratory, without, candidate, model)
        };
        candidates.iter().map(inflated).collect()
    }

    /// A candidate's calibrated model, inflated as it says; tuned for the recordings but one.
    ///
    /// # Errors
    /// When the noise of a recording cannot be described, or a model has no filter.
    pub(crate) fn inflated(
        &self,
        laboratory: &Laboratory,
        without: Option<usize>,
        candidate: &Candidate,
        model: &Model,
    ) -> Result<Model, Failure> {
        match candidate.inflation {
            Inflation::None => Ok(model.clone()),
            Inflation::Tenfold => Ok(tenfold(model)),
            Inflation::Tuned => {
                let others: Vec<usize> = laboratory.others(without).collect();
                let model_of = |k: &usize| own_model(laboratory, *k).cloned();
                let truths: Vec<Model> =
                    others.par_iter().map(model_of).collect::<Result<_, _>>()?;
                self.tuned(candidate, model, &truths)
            }
        }
    }

    fn tuned(
        &self,
        candidate: &Candidate,
        model: &Model,
        truths: &[Model],
    ) -> Result<Model, Failure> {
        let full = self.scenario.with_full_noise();
        let full = |model: &Model| full.belief(model, &self.outages, &self.track);
        let truths: Vec<TrueErrors> = truths.iter().cloned().map(TrueErrors::from).collect();
        let task = Task {
            model,
            truths: &truths,
            drawn: None,
            track: &self.track,
            full: &full,
            // a reduced filter is made so that it is as honest as the full one
            filter: &full,
            aim: Aim::Mean,
            allow_smaller: true,
        };
        let factors = task.factors().map_err(|source| unfit(candidate, source))?;
        Ok(scaled(model, &factors))
    }

    /// What each candidate's filter believes.
    fn beliefs(&self, candidates: &[Candidate], models: &[Model]) -> Result<Vec<Belief>, Failure> {
        let pairs: Vec<(&Candidate, &Model)> = candidates.iter().zip(models).collect();
        let belief = |(candidate, model): &(&Candidate, &Model)| {
            let mut scenario = self.scenario.clone();
            scenario.filter.states = candidate.filter;
            scenario
                .belief(model, &self.outages, &self.track)
                .map_err(|source| unfit(candidate, source))
        };
        pairs.par_iter().map(belief).collect()
    }

    /// Every filter on the same windows; none where the recordings are shorter than the trajectory.
    fn sampled(
        &self,
        beliefs: &[Belief],
        recordings: &[Recording],
        runs: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Option<Vec<Score>>, ExperimentError> {
        let truth = Truth::Static(recordings);
        let experiment =
            self.scenario
                .experiment(&self.trajectory, truth, beliefs, &self.outages, self.seed);
        match monte_carlo::run(&experiment, runs, progress) {
            Ok(results) => Ok(Some(
                results
                    .iter()
                    .map(|r| Score::of_runs(&r.runs, r.outages.len()))
                    .collect(),
            )),
            // a window counts the last sample too
            Err(ExperimentError::Truth(TruthError::TooShort { .. })) => Ok(None),
            Err(e) => Err(e),
        }
    }

    /// Every filter where a model makes the errors.
    fn expected(&self, beliefs: &[Belief], truth: &Model) -> Vec<Score> {
        let experiment = self.scenario.experiment(
            &self.trajectory,
            Truth::Model(truth),
            beliefs,
            &self.outages,
            self.seed,
        );
        let sources = TruthSide::together(&TruthSide::sources(&experiment, truth));
        let score = |belief: &Belief| {
            Score::expected(&FilterPass::new(&self.track, belief).errors_at_ends(&sources))
        };
        beliefs.par_iter().map(score).collect()
    }
}

fn own_model(laboratory: &Laboratory, k: usize) -> Result<&Model, Failure> {
    let recording = &laboratory.units()[k].name;
    let told = |e| Failure::from(e).within(&format!("the noise of {recording} alone"));
    laboratory.own_model(k).map_err(told)
}

fn uncalibrated(candidate: &Candidate, e: CalibrationError) -> Failure {
    Failure::from(e).within(&candidate.to_string())
}

/// Ten times every standard deviation.
fn tenfold(model: &Model) -> Model {
    let factors = Sensor::ALL.map(|sensor| Factor {
        sensor,
        on_variance: 100.0,
    });
    scaled(model, &factors)
}

fn unfit(candidate: &Candidate, e: BeliefError) -> Failure {
    Failure::input(e).within(&candidate.to_string())
}
