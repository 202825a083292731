//! The main job: from a trajectory, the filter's noise model and the model of the true errors to navigation errors, by
//! Monte-Carlo runs, by covariance analysis, or by both.

use crate::app::{Context, Failure, OrHelp, Refuse, Result};
use crate::io::draws_file::Draws;
use crate::report::{reduction_doubt, reduction_line, unexpected_line};
use nav_sim_calibration::derived_interval;
use nav_sim_navigation::ekf::Belief;
use nav_sim_navigation::metrics::{
    Budget, EpochMetrics, Expected, FanEpoch, OutageSummary, PerState, ReductionQuality, Summary,
    epochs, expected_fan, fan, horizontal_quantiles,
};
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{
    FilterPass, Instant, NamedSource, Track, TruthSide, assess, strapdown_over_sigma, weak_heading,
};
use nav_sim_navigation::simulation::{Experiment, Plan, RunResult};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::{Recording, Sensor};
use nav_sim_signal::noise::Model;
use nav_sim_signal::noise::reduction::is_exact;
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
) -> Result<Navigation> {
    let track = scenario.track(&inputs.trajectory, &inputs.model, outages)?;
    let belief = scenario.belief(&inputs.model, outages, &track).refuse()?;
    with_runs(
        inputs,
        scenario,
        outages,
        (&track, &belief),
        seed,
        None,
        context,
    )
}

/// The same of a filter along its track, with runs that were made already.
pub(super) fn with_runs(
    inputs: &NavigateInputs,
    scenario: &Scenario,
    outages: &[Outage],
    (track, belief): (&Track, &Belief),
    seed: u64,
    runs: Option<RunResult>,
    context: &Context<'_>,
) -> Result<Navigation> {
    let method = scenario.run.method;
    let possible = possible(inputs, scenario);
    if method != Method::MonteCarlo {
        possible.clone()?;
    }
    doubt(inputs, scenario, context);
    // Within 1e-3 the same in a quarter of the time: for what stands beside the figures.
    let merged = track.merged();
    let full = |model: &Model| {
        let scenario = scenario.with_full_noise();
        scenario.belief(model, outages, track).ok()
    };
    let reduction = scenario.filter.states.is_reduced().then(|| {
        let full = full(&inputs.model);
        reduction_of((&inputs.model, belief, full.as_ref()), &merged, context)
    });
    // Where the motion hardly shows the heading, no filter of this kind is to be believed.
    let yaw = FilterPass::new(&merged, belief).yaw_while_measured();
    weak_heading(yaw.into_iter())
        .iter()
        .for_each(|doubt| context.warn(doubt));
    let experiment = scenario.experiment(
        &inputs.trajectory,
        inputs.truth(),
        std::slice::from_ref(belief),
        outages,
        seed,
    );
    let analysis = Analysis {
        experiment: &experiment,
        track,
        belief,
        model: inputs.truth_model(),
    };
    // beside runs that were asked for alone it may be impossible
    let expected = possible.ok().and_then(|()| analysis.expected());
    if method != Method::MonteCarlo && expected.is_none() {
        let message = "the covariance analysis did not stay finite and positive definite";
        return Err(Failure::could_not(message)
            .hint("do the models fit the IMU, are [imu] and [initial] plausible?"));
    }
    let mut navigation = match (method, expected) {
        (
            Method::Lincov,
            Some(Expected {
                epochs, summary, ..
            }),
        ) => Navigation {
            runs: None,
            epochs,
            fan: analysis.fan(),
            // Nothing is drawn but outages; a seed that is given stays on record.
            summary: Summary {
                seed: scenario.outage_random.map(|_| seed).or(scenario.run.seed),
                ..summary
            },
        },
        (method, expected) => {
            let runs = match runs {
                Some(runs) => runs,
                None => sampled(&experiment, scenario, &inputs.trajectory, context)?,
            };
            let mut sampled = Navigation::of_runs(runs, seed);
            match expected {
                Some(expected) if method == Method::Both => {
                    sampled.summary.expect(expected.summary);
                    for (own, expected) in sampled.fan.iter_mut().zip(analysis.fan()) {
                        own.lincov_m = Some(expected.quantiles_m);
                    }
                }
                Some(expected) => sampled.summary.compare_with(&expected.summary),
                None => {}
            }
            sampled
        }
    };
    navigation.summary.reduction = reduction.flatten();
    let over_sigma = strapdown_over_sigma(track, belief);
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
        analysis.add_intervals(&mut navigation.summary.outages, inputs, &full);
    }
    Ok(navigation)
}

/// Refuses what covariance analysis cannot do.
fn possible(inputs: &NavigateInputs, scenario: &Scenario) -> Result<()> {
    match inputs.truth {
        TrueImu::Recordings(_) => Err(Failure::input(
            "covariance analysis needs a model of what makes the errors; static recordings have none",
        )
        .hint("calibrate the recordings and give the model with --truth, or use --method monte-carlo")),
        TrueImu::Drawn(_) => Err(Failure::input(
            "covariance analysis is of one truth; --spread draws one for each run",
        )
        .hint("leave --spread out, or use --method monte-carlo")),
        TrueImu::AsBelieved | TrueImu::Model(_) => scenario
            .analysable()
            .refuse()
            .or_help("leave it out, or use --method monte-carlo"),
    }
}

/// Warns of what speaks against the filter before anything was computed.
fn doubt(inputs: &NavigateInputs, scenario: &Scenario, context: &Context<'_>) {
    if let TrueImu::Recordings(recordings) = &inputs.truth {
        recordings
            .iter()
            .filter_map(motion)
            .for_each(|doubt| context.warn(doubt));
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

/// Runs that are summed together: some ten seconds of work.
pub(super) fn block(trajectory: &Trajectory, scenario: &Scenario) -> u64 {
    let samples = (trajectory.end_s() - trajectory.start_s()) * scenario.imu.rate_hz;
    8 * ((1e8 / (8.0 * samples)) as u64).max(1)
}

/// All runs, block by block.
fn sampled(
    experiment: &Experiment<'_>,
    scenario: &Scenario,
    trajectory: &Trajectory,
    context: &Context<'_>,
) -> Result<RunResult> {
    let (runs, block) = (scenario.run.runs, block(trajectory, scenario));
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
    Ok(result)
}

/// What a covariance analysis is made of.
struct Analysis<'a> {
    experiment: &'a Experiment<'a>,
    track: &'a Track,
    belief: &'a Belief,
    /// None: what makes the errors has no model.
    model: Option<&'a Model>,
}

impl Analysis<'_> {
    /// The expected figures; none where the covariance runs away or nothing models the errors.
    fn expected(&self) -> Option<Expected> {
        Expected::along(self.track, self.experiment, self.belief, self.model?)
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

/// The quality of a filter of 15 states to which a model was reduced, the model taken for the truth: one covariance analysis of the
/// reduced and of the full filter, if the model has one. None where nothing was lost.
pub(crate) fn reduction_of(
    (model, belief, full): (&Model, &Belief, Option<&Belief>),
    track: &Track,
    context: &Context<'_>,
) -> Option<ReductionQuality> {
    if model.axes.iter().all(is_exact) {
        return None;
    }
    let full = full.map(|full| assess(track, full, model));
    let quality = ReductionQuality::of(&assess(track, belief, model), full.as_ref());
    context.remark(reduction_line(&quality));
    reduction_doubt(&quality)
        .iter()
        .for_each(|doubt| context.warn(doubt));
    Some(quality)
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

/// Figures at the ends of outages.
type Figures = Vec<Vec<f64>>;

/// Probabilities of the quantiles of the horizontal error.
const QUANTILES: [f64; 2] = [0.5, 0.95];

impl Analysis<'_> {
    /// Puts the intervals of RMSE and of the quantiles of the horizontal error into the outages.
    fn errors(&self, truth: &Model, draws: &Draws, outages: &mut [OutageSummary]) {
        let track = self.track.coarse();
        let filter = FilterPass::new(&track, self.belief);
        let figures = |model: &Model| -> Figures {
            let truth = TruthSide::together(&TruthSide::sources(self.experiment, model));
            let ends = filter.errors_at_ends(&truth);
            let figures =
                |end: &Instant| [&end.rmse()[..], &horizontal_quantiles(end, QUANTILES)].concat();
            ends.iter().map(|end| figures(&end.errors)).collect()
        };
        for (outage, interval) in outages.iter_mut().zip(intervals(truth, draws, &figures)) {
            let rmse = outage.rmse_end.0;
            let about = |i: usize, value: f64| (value * interval[i].0, value * interval[i].1);
            outage.rmse_end_ci95 = Some(PerState(std::array::from_fn(|i| about(i, rmse[i]))));
            let h = &mut outage.horizontal_error_end_m;
            let ends = |(low, high): (f64, f64)| (Some(low), Some(high));
            h.p50_ci95 = ends(about(rmse.len(), h.p50));
            h.p95_ci95 = ends(about(rmse.len() + 1, h.p95));
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
        let figures = |model: &Model| -> Figures {
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
            let about = |i: usize, value: f64| (value * interval[i].0, value * interval[i].1);
            outage.asee_end_ci95 = Some(PerState(std::array::from_fn(|i| about(i, end[i]))));
            let of_mean = PerState(std::array::from_fn(|i| about(end.len() + i, mean[i])));
            // An outage between two reports has no mean.
            outage.asee_mean_ci95 = Some(of_mean).filter(|_| mean.iter().all(|x| x.is_finite()));
        }
    }
}

/// The ends of the interval that the draws give to each figure, over the estimate.
fn intervals(
    estimate: &Model,
    draws: &Draws,
    figures: &(dyn Fn(&Model) -> Figures + Sync),
) -> Vec<Vec<(f64, f64)>> {
    let drawn: Vec<Figures> = draws.models.par_iter().map(figures).collect();
    let of_figure = |k: usize, (i, x): (usize, &f64)| {
        let all = drawn.iter().filter_map(|ends| Some(ends.get(k)?[i]));
        let [low, high] = derived_interval(*x, all.collect(), draws.stretch);
        (low / x, high / x)
    };
    let of_outage = |(k, own): (usize, &Vec<f64>)| {
        let own = own.iter().enumerate();
        own.map(|figure| of_figure(k, figure)).collect()
    };
    figures(estimate)
        .iter()
        .enumerate()
        .map(of_outage)
        .collect()
}
