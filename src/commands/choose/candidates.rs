//! Candidates of `choose` and their cross-validation.

use super::FEWEST;
use super::ranking::Score;
use crate::app::{Failure, IntoFailure};
use nav_sim_calibration::{
    CalibrationError, CalibrationSettings, Estimator, Group, ModelChoice, ModelSpec, Outcome,
    RecordingVerdict, Replicate, calibrate, diagnose, grouped, model_of,
};
use nav_sim_navigation::ekf::{FilterModel, FilterStates};
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{Factor, Track, scaled};
use nav_sim_navigation::simulation::{ExperimentError, RunResult};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::{Channel, Recording, Sensor};
use nav_sim_signal::noise::Model;
use nav_sim_signal::noise::continuous::same_rate;
use rayon::prelude::*;
use std::fmt;

/// A way from recordings to a filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Estimator that combines the replicates into one curve.
    pub estimator: Estimator,
    /// Model fitted to the curve.
    pub model: ModelChoice,
    /// States by which the filter represents the model.
    pub filter: FilterStates,
    /// Inflation of the model before the filter takes it.
    pub inflation: Inflation,
}

/// Inflation of a model before a filter takes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Inflation {
    /// Nothing.
    #[default]
    None,
    /// All standard deviations ten times: the rule of thumb.
    Tenfold,
}

nav_sim_signal::named!(Inflation { None = "none", Tenfold = "x10" });

impl Candidate {
    /// The estimator's model as it is, in the default filter of 15 states.
    pub fn new(estimator: Estimator, model: ModelSpec) -> Self {
        let (filter, inflation) = (FilterStates::default(), Inflation::default());
        Self {
            estimator,
            model: ModelChoice::Given(model),
            filter,
            inflation,
        }
    }

    /// Default candidates: the three averages with N2; and with AWV the other common practices,
    /// from all states to the rule of thumb and single recordings.
    pub(crate) fn default_set() -> Vec<Self> {
        let n2 = |estimator| Self::new(estimator, ModelSpec::n2());
        let two_slopes = |estimator| Self::new(estimator, white_and_walk());
        vec![
            n2(Estimator::Awv),
            n2(Estimator::SrAwv),
            n2(Estimator::DrAwv),
            Self {
                filter: FilterStates::Full,
                ..n2(Estimator::Awv)
            },
            Self {
                inflation: Inflation::Tenfold,
                ..n2(Estimator::Awv)
            },
            two_slopes(Estimator::Awv),
            n2(Estimator::Gmwm),
            two_slopes(Estimator::Avlr),
        ]
    }

    /// All combinations; AVLR, which reads slopes, with the models that have nothing else, or WN+RW.
    pub(crate) fn product(
        estimators: &[Estimator],
        models: &[ModelChoice],
        filters: &[FilterStates],
        inflations: &[Inflation],
    ) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for &estimator in estimators {
            for model in models {
                let model = if estimator == Estimator::Avlr && !is_of_slopes(model) {
                    ModelChoice::Given(white_and_walk())
                } else {
                    model.clone()
                };
                for &filter in filters {
                    for &inflation in inflations {
                        let candidate = Self {
                            estimator,
                            model: model.clone(),
                            filter,
                            inflation,
                        };
                        if !all.contains(&candidate) {
                            all.push(candidate);
                        }
                    }
                }
            }
        }
        all
    }

    /// The calibrated model, inflated.
    pub(crate) fn inflated(&self, model: &Model) -> Model {
        match self.inflation {
            Inflation::None => model.clone(),
            Inflation::Tenfold => {
                let on_variance = 100.0;
                let factor = |sensor| Factor {
                    sensor,
                    on_variance,
                };
                scaled(model, &Sensor::ALL.map(factor))
            }
        }
    }

    /// Returns true if it may be chosen. Calibrations of a single recording are shown for
    /// comparison only.
    pub const fn is_eligible(&self) -> bool {
        !self.estimator.is_single()
    }
}

/// Noise model of most filters: white noise and a random walk.
fn white_and_walk() -> ModelSpec {
    "WN+RW".parse().expect("processes")
}

/// Returns true if every process has a slope of its own in the Allan deviation.
fn is_of_slopes(model: &ModelChoice) -> bool {
    match model {
        ModelChoice::Given(spec) => spec.kinds().iter().all(|kind| kind.shape().is_none()),
        ModelChoice::Auto => false,
    }
}

impl fmt::Display for Candidate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_usual = self.model == ModelChoice::default();
        let model = if is_usual {
            "N2".to_owned()
        } else {
            self.model.to_string()
        };
        write!(f, "{} {model}, {}", self.estimator, self.filter)?;
        match self.inflation {
            Inflation::None => Ok(()),
            inflation => write!(f, ", {inflation}"),
        }
    }
}

#[cfg(test)]
mod candidate_tests {
    use super::*;

    #[test]
    fn names_tell_candidates_apart() {
        let mut names: Vec<String> = Candidate::default_set()
            .iter()
            .map(ToString::to_string)
            .collect();
        assert_eq!(
            (names[0].as_str(), names[7].as_str()),
            ("awv N2, 15", "avlr WN+RW, 15")
        );
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn slopes_are_read_off_models_that_have_them() {
        let models = ["N2", "WN+RW"].map(|m| m.parse().unwrap());
        let all = Candidate::product(
            &[Estimator::Awv, Estimator::Avlr],
            &models,
            &[FilterStates::Reduced15],
            &[Inflation::None],
        );
        let names: Vec<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(names, ["awv N2, 15", "awv WN+RW, 15", "avlr WN+RW, 15"]);
    }
}

// The recordings of a laboratory, measured, and the models that are made of all but one of them.

/// The wavelet variances of one recording; the stretches of a file that has gaps are one.
pub type Unit = Vec<(Channel, Replicate)>;

/// All recordings and how models are made of them. Estimators and model of the settings count nothing: those of the
/// candidates do.
#[derive(Debug)]
pub struct CalibrationSet {
    /// The recordings.
    pub units: Vec<Unit>,
    /// Settings of the fits.
    pub settings: CalibrationSettings,
}

/// The groups of recordings that were calibrated, their fits, and how these were made.
type Calibrated = (Vec<Group>, Vec<Outcome>, CalibrationSettings);

impl CalibrationSet {
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
        self.fit(&of_units, candidate.estimator, &candidate.model)
    }

    /// The recordings but one.
    fn others(&self, without: Option<usize>) -> impl Iterator<Item = usize> {
        (0..self.units.len()).filter(move |k| Some(*k) != without)
    }

    /// The recordings that judge candidates: an abnormal one has errors that the IMU does not have in use, and a score that
    /// outweighs all others. All, where too few are normal.
    ///
    /// # Errors
    /// When a curve is too short for the model.
    pub(crate) fn judges(&self) -> Result<Vec<usize>, CalibrationError> {
        let n2 = ModelChoice::Given(ModelSpec::n2());
        let all: Vec<&Unit> = self.units.iter().collect();
        let (groups, outcomes, settings) = self.fit(&all, Estimator::DrAwv, &n2)?;
        let mut diagnoses = diagnose(&groups, &outcomes, &settings);
        diagnoses.retain(|diagnosis| diagnosis.verdict != RecordingVerdict::Normal);
        let is_abnormal = |name: &String| diagnoses.iter().any(|d| d.name == *name);
        let is_normal = |k: &usize| !self.units[*k].iter().any(|(_, r)| is_abnormal(&r.name));
        let normal: Vec<usize> = self.others(None).filter(is_normal).collect();
        Ok(if normal.len() < FEWEST {
            self.others(None).collect()
        } else {
            normal
        })
    }

    fn fit(
        &self,
        units: &[&Unit],
        estimator: Estimator,
        model: &ModelChoice,
    ) -> Result<Calibrated, CalibrationError> {
        let settings = CalibrationSettings {
            estimators: vec![estimator],
            model: model.clone(),
            ..self.settings.clone()
        };
        let pool = settings.pool();
        let groups = grouped(
            units.iter().flat_map(|unit| unit.iter().cloned()).collect(),
            pool,
        );
        let outcomes = calibrate(&groups, &settings)?;
        Ok((groups, outcomes, settings))
    }
}

// Where candidates navigate, and what they do on a recording that they have not seen.

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
    /// The recording.
    pub recording: String,
    /// Windows of it that were navigated.
    pub windows: u64,
    /// Scores of the candidates, in their order.
    pub scores: Vec<Score>,
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

    /// Leaves out recording `k`, whose samples are `recordings` (several stretches of a file that has gaps), and
    /// takes every candidate along the trajectory `runs` times. `progress` is told how many runs are done.
    ///
    /// # Errors
    /// When a model cannot be made, has no such filter, rates do not fit together, or the recording is shorter than the
    /// trajectory.
    pub fn leave_out(
        &self,
        laboratory: &CalibrationSet,
        k: usize,
        mut recordings: Vec<Recording>,
        candidates: &[Candidate],
        runs: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Score>, Failure> {
        let filter_models = self.filter_models(laboratory, k, candidates)?;
        let lasts_s = self.trajectory.end_s() - self.trajectory.start_s();
        if recordings.len() > 1 {
            recordings.retain(|r| r.len() as f64 >= lasts_s * self.scenario.imu.rate_hz);
        }
        let truth = Truth::Static(&recordings);
        let (trajectory, outages) = (&self.trajectory, &self.outages);
        let experiment =
            self.scenario
                .experiment(trajectory, truth, &filter_models, outages, self.seed);
        let results = monte_carlo::run(&experiment, runs, progress)?;
        let score = |r: &RunResult| Score::of(&r.runs, outages.len());
        Ok(results.iter().map(score).collect())
    }

    /// Noise model in each candidate's filter, calibrated from all recordings but one.
    fn filter_models(
        &self,
        laboratory: &CalibrationSet,
        without: usize,
        candidates: &[Candidate],
    ) -> Result<Vec<FilterModel>, Failure> {
        let mut made: Vec<(&Candidate, Model)> = Vec::new();
        for candidate in candidates {
            let mut others = made.iter();
            let is_same = |other: &Candidate| {
                other.estimator == candidate.estimator && other.model == candidate.model
            };
            let model = match others.find(|(other, _)| is_same(other)) {
                Some((_, model)) => model.clone(),
                None => {
                    let (_, outcomes, settings) = laboratory
                        .calibrate(candidate, Some(without))
                        .map_err(|e| Failure::from(e).within(&candidate.to_string()))?;
                    model_of(&outcomes, settings.rate_hz)
                }
            };
            made.push((candidate, model));
        }
        let filter_model = |(candidate, model): &(&Candidate, Model)| {
            let mut scenario = self.scenario.clone();
            scenario.filter.states = candidate.filter;
            scenario
                .filter_model(&candidate.inflated(model), &self.outages, &self.track)
                .refuse_within(candidate)
        };
        made.par_iter().map(filter_model).collect()
    }
}
