//! The main job: from a trajectory, the filter's noise model and the model of the true errors to navigation errors, by
//! Monte-Carlo runs, by covariance analysis, or by both.

use crate::app::{Context, Failure};
use crate::io::draws_file::Draws;
use crate::report::{reduction_doubt, reduction_line, unexpected_line};
use nav_sim_calibration::derived_interval;
use nav_sim_navigation::ekf::{Belief, BeliefError};
use nav_sim_navigation::metrics::{
    Budget, EpochMetrics, Expected, FanEpoch, OutageSummary, PerState, ReductionQuality,
    ReductionSummary, Summary, epochs, expected_fan, fan, horizontal_quantiles,
};
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{
    FilterPass, Instant, NamedSource, Track, TruthSide, assess, strapdown_over_sigma, weak_heading,
};
use nav_sim_navigation::simulation::{Experiment, ExperimentError, Plan, RunResult};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::{Recording, Sensor};
use nav_sim_signal::noise::reduction::window_s;
use nav_sim_signal::noise::{Model, ParameterError};
use nav_sim_signal::units::SettingError;
use rayon::prelude::*;

/// Inputs of [`navigate()`].
#[derive(Debug)]
pub struct NavigateInputs {
    /// The reference trajectory.
    pub trajectory: Trajectory,
    /// The noise model that the filter believes, at the rate of the IMU.
    pub model: Model,
    /// What makes the errors of the true IMU.
    pub truth: TrueImu,
    /// Bootstrap draws of the calibration of the model, at the rate of the IMU.
    pub model_draws: Option<Draws>,
    /// Bootstrap draws of the calibration of the truth, if it is another model.
    pub truth_draws: Option<Draws>,
}

/// The source of the errors of the true IMU, in addition to the defects in the scenario.
#[derive(Debug)]
pub enum TrueImu {
    /// The model that the filter believes.
    AsBelieved,
    /// Another model, at the rate of the IMU.
    Model(Model),
    /// A model for each run, at the rate of the IMU: drawn from the spread of one.
    Drawn(Vec<Model>),
    /// Windows of static recordings.
    Recordings(Vec<Recording>),
}

/// Results of [`navigate()`].
#[derive(Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Navigation {
    /// The runs; `None` for a covariance analysis.
    #[serde(skip)]
    pub runs: Option<RunResult>,
    /// Statistics at every reporting epoch: of the runs, if there are any.
    #[serde(skip)]
    pub epochs: Vec<EpochMetrics>,
    /// Quantiles of the horizontal error over time: of the runs, if there are any.
    #[serde(skip)]
    pub fan: Vec<FanEpoch>,
    /// The summary.
    #[serde(flatten)]
    pub summary: Summary,
}

/// Error of [`navigate()`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NavigateError {
    /// The experiment does not fit together.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// The believed model has no such filter.
    #[error(transparent)]
    Belief(#[from] BeliefError),
    /// The reduction of the model cannot be assessed.
    #[error(transparent)]
    Reduction(#[from] ParameterError),
    /// Recordings have no covariance.
    #[error(
        "covariance analysis needs a model of what makes the errors; static recordings have none"
    )]
    RecordedTruth,
    /// Each run has a truth of its own.
    #[error("covariance analysis is of one truth; --spread draws one for each run")]
    DrawnTruth,
    /// A setting whose effect depends on what is drawn.
    #[error(transparent)]
    Drawn(#[from] SettingError),
    /// Numbers ran away.
    #[error("the covariance analysis did not stay finite and positive definite")]
    NotFinite,
}

impl From<NavigateError> for Failure {
    fn from(e: NavigateError) -> Self {
        Self::input(e)
    }
}

/// Navigates along a trajectory, with these outages and this seed.
///
/// # Errors
/// What does not fit together, what the method cannot do, or a covariance that runs away.
pub fn navigate(
    inputs: &NavigateInputs,
    scenario: &Scenario,
    outages: &[Outage],
    seed: u64,
    context: &Context<'_>,
) -> Result<Navigation, NavigateError> {
    with_runs(inputs, scenario, outages, seed, None, context)
}

/// The same with runs that were made already.
pub(super) fn with_runs(
    inputs: &NavigateInputs,
    scenario: &Scenario,
    outages: &[Outage],
    seed: u64,
    runs: Option<RunResult>,
    context: &Context<'_>,
) -> Result<Navigation, NavigateError> {
    let method = scenario.run.method;
    if method != Method::MonteCarlo {
        possible(inputs, scenario)?;
    }
    let track = scenario.track(&inputs.trajectory, &inputs.model, outages)?;
    let belief = scenario.belief(&inputs.model, outages, &track)?;
    doubt(inputs, &belief, scenario, context);
    // Within 1e-3 the same in a quarter of the time: for what stands beside the figures.
    let merged = track.merged();
    let reduction = reduction(inputs, scenario, outages, &belief, &merged, context)?;
    // Where the motion hardly shows the heading, no filter of this kind is to be believed.
    let yaw = FilterPass::new(&merged, &belief).yaw_while_measured();
    weak_heading(yaw.into_iter())
        .iter()
        .for_each(|doubt| context.warn(doubt));
    let experiment = scenario.experiment(
        &inputs.trajectory,
        inputs.truth(),
        std::slice::from_ref(&belief),
        outages,
        seed,
    );
    let analysis = Analysis {
        experiment: &experiment,
        track: &track,
        belief: &belief,
        model: inputs.truth_model(),
    };
    let expected = match method {
        // beside runs that were asked for alone it may be impossible
        Method::MonteCarlo => possible(inputs, scenario)
            .ok()
            .and_then(|()| analysis.expected()),
        Method::Lincov | Method::Both => Some(analysis.expected().ok_or(NavigateError::NotFinite)?),
    };
    let mut navigation = match (method, expected) {
        (Method::Lincov, Some((epochs, mut summary))) => {
            // Nothing is drawn but outages; a seed that is given stays on record.
            summary.seed = scenario.outage_random.map(|_| seed).or(scenario.run.seed);
            Navigation {
                runs: None,
                epochs,
                fan: analysis.fan(),
                summary,
            }
        }
        (method, expected) => {
            let mut sampled = match runs {
                Some(runs) => Navigation::of_runs(runs, seed),
                None => {
                    let block = block(&inputs.trajectory, scenario);
                    sampled(&experiment, scenario.run.runs, block, seed, context)?
                }
            };
            match expected {
                Some((_, expected)) if method == Method::Both => {
                    sampled = sampled.beside(expected, &analysis.fan());
                }
                Some((_, expected)) => {
                    sampled.summary.compare_with(&expected);
                }
                None => {}
            }
            sampled
        }
    };
    navigation.summary.reduction = reduction;
    let over_sigma = strapdown_over_sigma(&track, &belief);
    navigation.summary.strapdown_over_sigma = over_sigma;
    scenario
        .unexpected_integration(over_sigma)
        .iter()
        .for_each(|found| context.warn(unexpected_line(found)));
    // Which fixes a gate refuses is drawn with the errors: the gains of such a filter are not those of the analysis.
    if scenario.analysable().is_ok() {
        Analysis {
            track: &merged,
            ..analysis
        }
        .add_budgets(&mut navigation.summary);
    }
    if method == Method::Lincov {
        let full = |model: &Model| {
            scenario
                .with_full_noise()
                .belief(model, outages, &track)
                .ok()
        };
        analysis.add_intervals(&mut navigation.summary.outages, inputs, &full);
    }
    Ok(navigation)
}

/// Whether covariance analysis can do what is asked for.
fn possible(inputs: &NavigateInputs, scenario: &Scenario) -> Result<(), NavigateError> {
    match inputs.truth {
        TrueImu::Recordings(_) => return Err(NavigateError::RecordedTruth),
        TrueImu::Drawn(_) => return Err(NavigateError::DrawnTruth),
        TrueImu::AsBelieved | TrueImu::Model(_) => {}
    }
    Ok(scenario.analysable()?)
}

/// What speaks against the filter before anything was computed.
fn doubt(inputs: &NavigateInputs, belief: &Belief, scenario: &Scenario, context: &Context<'_>) {
    if let TrueImu::Recordings(recordings) = &inputs.truth {
        recordings
            .iter()
            .filter_map(motion)
            .for_each(|doubt| context.warn(doubt));
    }
    // A Gauss-Markov process of phi ≈ 1 may have any stationary variance: a filter that starts with it believes
    // nothing of its first sensor readings.
    for (sensor, limit) in [(Sensor::Accel, 1.0), (Sensor::Gyro, 0.1)] {
        let sigma = belief.process_sigma(sensor);
        if sigma > limit {
            context.warn(format!(
                "the filter starts with a bias of {sigma:.3} {} ({sensor}): an AR1 of phi near 1?",
                sensor.unit()
            ));
        }
    }
    scenario
        .unexpected()
        .into_iter()
        .for_each(|found| context.warn(unexpected_line(&found)));
}

/// Means over a second that differ so much are motion, not noise: m/s², rad/s.
const MOTION: (f64, f64) = (0.5, 0.05);

/// Where a recording is not static.
fn motion(recording: &Recording) -> Option<String> {
    let second = (recording.rate_hz.round() as usize).max(1);
    recording.signals.iter().find_map(|signal| {
        let limit = if signal.channel.sensor == Sensor::Accel { MOTION.0 } else { MOTION.1 };
        let means = signal.samples.chunks_exact(second).map(|c| c.iter().sum::<f64>() / second as f64);
        let (low, high) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), m| (l.min(m), h.max(m)));
        let message = format!(
            "{}: not static? The mean over a second of {} goes from {:.3} to {:.3} {}: motion becomes errors of the \
             IMU",
            recording.name,
            signal.channel,
            low + signal.mean,
            high + signal.mean,
            signal.channel.sensor.unit()
        );
        (high - low > limit).then_some(message)
    })
}

/// The reduction of the model for these outages; none where nothing is reduced.
fn reduction(
    inputs: &NavigateInputs,
    scenario: &Scenario,
    outages: &[Outage],
    belief: &Belief,
    track: &Track,
    context: &Context<'_>,
) -> Result<Option<ReductionSummary>, NavigateError> {
    if !scenario.filter.states.is_reduced() {
        return Ok(None);
    }
    let longest = outages
        .iter()
        .map(|o| o.end_s - o.start_s)
        .fold(0.0, f64::max);
    let scales_s = [1.0 / scenario.gnss.rate_hz, window_s(longest)];
    let full = scenario
        .with_full_noise()
        .belief(&inputs.model, outages, track)
        .ok();
    let made = (&inputs.model, belief, full.as_ref());
    Ok(Some(reduction_of(made, track, scales_s, context)?))
}

/// Runs that are summed together: some ten seconds of work.
pub(super) fn block(trajectory: &Trajectory, scenario: &Scenario) -> u64 {
    let samples = (trajectory.end_s() - trajectory.start_s()) * scenario.imu.rate_hz;
    8 * ((1e8 / (8.0 * samples)) as u64).max(1)
}

/// All runs, block by block.
fn sampled(
    experiment: &Experiment<'_>,
    runs: u64,
    block: u64,
    seed: u64,
    context: &Context<'_>,
) -> Result<Navigation, NavigateError> {
    context.begin("runs", runs);
    let plan = Plan::new(experiment)?.with_fan();
    let of_block = |first: u64| {
        let count = block.min(runs - first);
        let found = monte_carlo::run_range(&plan, first, count, &|| true, &|n| context.advance(n));
        found.expect("nothing stops it").swap_remove(0)
    };
    let mut result = of_block(0);
    for first in (block..runs).step_by(block as usize) {
        result.append(of_block(first));
    }
    context.end();
    Ok(Navigation::of_runs(result, seed))
}

/// What a covariance analysis is made of.
#[derive(Clone, Copy)]
struct Analysis<'a> {
    experiment: &'a Experiment<'a>,
    track: &'a Track,
    belief: &'a Belief,
    /// None: what makes the errors has no model.
    model: Option<&'a Model>,
}

impl Analysis<'_> {
    /// The expected figures; none where the covariance runs away.
    fn expected(&self) -> Option<(Vec<EpochMetrics>, Summary)> {
        let expected = Expected::along(self.track, self.experiment, self.belief, self.model?)?;
        Some((expected.epochs, expected.summary))
    }

    /// Quantiles of the horizontal error over time; none where nothing models what makes the errors.
    fn fan(&self) -> Vec<FanEpoch> {
        let Some(model) = self.model else {
            return Vec::new();
        };
        let truth = TruthSide::together(&TruthSide::sources(self.experiment, model));
        expected_fan(
            &FilterPass::new(self.track, self.belief),
            &truth,
            self.experiment.outages,
        )
    }

    /// What the calibrations leave open in the figures at the ends of outages.
    fn add_intervals(
        &self,
        outages: &mut [OutageSummary],
        inputs: &NavigateInputs,
        full: &(dyn Fn(&Model) -> Option<Belief> + Sync),
    ) {
        let truth_draws = match inputs.truth {
            TrueImu::AsBelieved => inputs.model_draws.as_ref(),
            _ => inputs.truth_draws.as_ref(),
        };
        if let (Some(truth), Some(draws)) = (self.model, truth_draws) {
            self.errors(truth, draws, outages);
        }
        if let Some(draws) = &inputs.model_draws {
            self.beliefs(&inputs.model, draws, full, outages);
        }
    }

    /// What the errors at the ends of outages are made of, and what the filter believes they are.
    fn add_budgets(&self, summary: &mut Summary) {
        let filter = FilterPass::new(self.track, self.belief);
        let at_ends =
            |sources: &[NamedSource]| Budget::at_outage_ends(&filter, sources).into_iter();
        let mut truth = self
            .model
            .map(|model| at_ends(&TruthSide::sources(self.experiment, model)));
        let believed = at_ends(&TruthSide::believed(self.experiment, self.belief));
        for (outage, believed) in summary.outages.iter_mut().zip(believed) {
            outage.budget = truth.as_mut().and_then(Iterator::next);
            outage.believed_budget = Some(believed);
        }
    }
}

impl Navigation {
    /// The statistics of runs of a seed.
    #[must_use]
    pub fn of_runs(result: RunResult, seed: u64) -> Self {
        let epochs = epochs(&result);
        let summary = Summary::of(&result, &epochs, seed);
        Self {
            fan: fan(&result),
            runs: Some(result),
            epochs,
            summary,
        }
    }

    /// Runs beside what was expected of them.
    fn beside(mut self, expected: Summary, fan: &[FanEpoch]) -> Self {
        self.summary.expect(expected);
        for (own, expected) in self.fan.iter_mut().zip(fan) {
            own.lincov_m = Some(expected.quantiles_m);
        }
        self
    }
}

impl NavigateInputs {
    /// Along a trajectory, with models that are known for certain.
    #[must_use]
    pub const fn new(trajectory: Trajectory, model: Model, truth: TrueImu) -> Self {
        Self {
            trajectory,
            model,
            truth,
            model_draws: None,
            truth_draws: None,
        }
    }

    pub(super) fn truth(&self) -> Truth<'_> {
        match &self.truth {
            TrueImu::AsBelieved => Truth::Model(&self.model),
            TrueImu::Model(model) => Truth::Model(model),
            TrueImu::Drawn(models) => Truth::Drawn(models),
            TrueImu::Recordings(recordings) => Truth::Static(recordings),
        }
    }

    /// The model behind the errors, if there is one.
    const fn truth_model(&self) -> Option<&Model> {
        match &self.truth {
            TrueImu::AsBelieved => Some(&self.model),
            TrueImu::Model(model) => Some(model),
            TrueImu::Drawn(_) | TrueImu::Recordings(_) => None,
        }
    }
}

/// The reduction of a model to a filter of 15 states, and its quality, the model taken for the truth: one covariance analysis of
/// the reduced and of the full filter, if the model has one. `scales_s`: time between fixes, longest time scale.
///
/// # Errors
/// When a parameter of the belief is outside its domain.
pub(crate) fn reduction_of(
    (model, belief, full): (&Model, &Belief, Option<&Belief>),
    track: &Track,
    [interval_s, window_s]: [f64; 2],
    context: &Context<'_>,
) -> Result<ReductionSummary, ParameterError> {
    let mut summary = ReductionSummary::of(model, belief, interval_s, window_s)?;
    if summary.is_exact() {
        return Ok(summary);
    }
    let full = full.map(|full| assess(track, full, model));
    let quality = ReductionQuality::of(&assess(track, belief, model), full.as_ref());
    context.remark(reduction_line(&quality));
    reduction_doubt(&quality)
        .iter()
        .for_each(|doubt| context.warn(doubt));
    summary.quality = Some(quality);
    Ok(summary)
}

// What the calibration of a model leaves open in the figures of a covariance analysis.
//
// Every draw of the calibration ([`draws_file`](crate::io::draws_file)) goes through the analysis as the model
// itself did, and a figure has the interval that its draws give, as a parameter has ([`derived_interval`]).
//
// Two questions, two kinds of draws. What the filter's errors will be is open by the calibration of what *makes* them:
// the filter that was made is kept, and the draws are truths. What the filter states is open by the calibration of what
// it *believes*: each draw has the filter that knows it, with a state for each process, since the reduction to 15 states
// would have to be found anew for each; the interval is carried over as a ratio.

/// Figures at the end of an outage.
type Figures = Vec<f64>;

/// Probabilities of the quantiles of the horizontal error.
const QUANTILES: [f64; 2] = [0.5, 0.95];

impl Analysis<'_> {
    /// Puts the intervals of RMSE and of the quantiles of the horizontal error into the outages.
    fn errors(&self, truth: &Model, draws: &Draws, outages: &mut [OutageSummary]) {
        let track = self.track.coarse();
        let filter = FilterPass::new(&track, self.belief);
        let figures = |model: &Model| -> Vec<Figures> {
            let truth = TruthSide::together(&TruthSide::sources(self.experiment, model));
            let ends = filter.errors_at_ends(&truth);
            let figures =
                |end: &Instant| [&end.rmse()[..], &horizontal_quantiles(end, QUANTILES)].concat();
            ends.iter().map(|end| figures(&end.errors)).collect()
        };
        for (outage, interval) in outages.iter_mut().zip(intervals(truth, draws, &figures)) {
            let rmse = outage.rmse_end.0;
            outage.rmse_end_ci95 = Some(PerState(std::array::from_fn(|i| {
                interval.about(i, rmse[i])
            })));
            let h = &mut outage.horizontal_error_end_m;
            let ends = |(low, high): (f64, f64)| (Some(low), Some(high));
            h.p50_ci95 = ends(interval.about(rmse.len(), h.p50));
            h.p95_ci95 = ends(interval.about(rmse.len() + 1, h.p95));
        }
    }

    /// Puts the intervals of the ASEE into the outages; `full` makes the filter that knows a model. None are put where a
    /// model has no such filter.
    fn beliefs(
        &self,
        model: &Model,
        draws: &Draws,
        full: &(dyn Fn(&Model) -> Option<Belief> + Sync),
        outages: &mut [OutageSummary],
    ) {
        let track = self.track.merged();
        let figures = |model: &Model| -> Vec<Figures> {
            let Some(belief) = full(model) else {
                return Vec::new();
            };
            let filter = FilterPass::new(&track, &belief);
            let means = filter.sigma_means(self.experiment.outages);
            filter
                .sigma_at_ends()
                .iter()
                .zip(means)
                .map(|(end, mean)| [&end[..], &mean].concat())
                .collect()
        };
        for (outage, interval) in outages.iter_mut().zip(intervals(model, draws, &figures)) {
            let (end, mean) = (outage.asee_end.0, outage.asee_mean.0);
            outage.asee_end_ci95 =
                Some(PerState(std::array::from_fn(|i| interval.about(i, end[i]))));
            let of_mean = PerState(std::array::from_fn(|i| {
                interval.about(end.len() + i, mean[i])
            }));
            // An outage between two reports has no mean.
            outage.asee_mean_ci95 = Some(of_mean).filter(|_| mean.iter().all(|x| x.is_finite()));
        }
    }
}

/// The figures of one outage: of the estimate, and of each draw.
struct Drawn {
    estimate: Figures,
    draws: Vec<Figures>,
    stretch: f64,
}

impl Drawn {
    /// The interval of a figure, whose ends over the estimate are carried over to its value.
    fn about(&self, figure: usize, value: f64) -> (f64, f64) {
        let estimate = self.estimate[figure];
        let drawn = self.draws.iter().map(|draw| draw[figure]).collect();
        let [low, high] = derived_interval(estimate, drawn, self.stretch);
        (value * (low / estimate), value * (high / estimate))
    }
}

/// What the draws give beside the estimate, outage by outage.
fn intervals(
    estimate: &Model,
    draws: &Draws,
    figures: &(dyn Fn(&Model) -> Vec<Figures> + Sync),
) -> Vec<Drawn> {
    let of_draws: Vec<Vec<Figures>> = draws.models.par_iter().map(figures).collect();
    let of_outage = |(k, estimate): (usize, Figures)| Drawn {
        estimate,
        draws: of_draws
            .iter()
            .filter_map(|ends| ends.get(k).cloned())
            .collect(),
        stretch: draws.stretch,
    };
    figures(estimate)
        .into_iter()
        .enumerate()
        .map(of_outage)
        .collect()
}
