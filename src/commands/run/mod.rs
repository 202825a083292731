//! `nav-sim run`: the main job.

use crate::app::inputs::{self, FilterArgs, SettingsArgs};
use crate::app::{
    Answer, Command, Context, Failure, Input, IntoFailure, OutputFile, OutputKind, Result, refused,
};
use crate::io::draws_file::{self, Draws};
use crate::io::model_file::ModelFile;
use crate::io::recordings::Gaps;
use crate::parse;
use crate::report::tables::{epochs_csv, runs_csv};
use crate::report::verdict::requirement_line;
use crate::report::{integration_line, json, reduction_doubt, reduction_line, trajectory};
use nav_sim_calibration::derived_interval;
use nav_sim_document::Document;
use nav_sim_navigation::ekf::{FilterModel, FilterStates};
use nav_sim_navigation::metrics::{
    Budget, EpochMetrics, ExpectedRun, OutageSummary, PerState, ReductionQuality, Requirement,
    Summary, epochs, horizontal_quantiles,
};
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::scenario::{FilterSettings, Method, RunSettings, Scenario};
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{
    FilterPass, Instant, Track, TruthModel, assess, strapdown_over_sigma, weak_heading,
};
use nav_sim_navigation::simulation::{Experiment, Gains, Plan, REPORTED, RunResult};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::{Recording, Sensor};
use nav_sim_signal::noise::reduction::is_exact;
use nav_sim_signal::noise::{Model, continuous};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

pub(crate) mod directory;
mod document;

/// Navigate by INS/GNSS along TRAJECTORY with MODEL in the filter: Monte Carlo or covariance analysis
///
/// Writes a run directory: epochs.csv (ASEE, RMSE, bias, NEES, coverage at 1 Hz), runs.csv, summary.json, report.html, manifest.json. The same seed gives every model the same
/// noise, so that runs can be compared pair by pair (see `nav-sim compare`).
#[derive(clap::Args, Debug, Clone)]
pub struct Run {
    /// Trajectory: motion profile (.toml) or table (.csv)
    pub trajectory: PathBuf,
    /// Noise model that the filter assumes
    model: PathBuf,
    /// Noise model that makes the INS errors (default: MODEL itself)
    #[arg(long, value_name = "MODEL2", conflicts_with = "static")]
    pub truth: Option<PathBuf>,
    /// Draw the true parameters of each run from the [spread] of their model
    #[arg(long, conflicts_with = "static")]
    spread: bool,
    /// Static recording whose windows make the INS errors (repeatable)
    #[arg(id = "static", long = "static", value_name = "FILE")]
    pub recordings: Vec<PathBuf>,
    /// Sample rate of static recordings without a time column
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz, requires = "static", hide_short_help = true)]
    rate_hz: Option<f64>,
    /// Outages and other settings of the run.
    #[command(flatten)]
    settings: SettingsArgs,
    /// Monte-Carlo runs (default: 100)
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    /// States of the filter, and what it expects beside the model.
    #[command(flatten)]
    filter: FilterArgs,
    /// monte-carlo (sampled runs), lincov (linear covariance analysis) or both
    #[arg(long, value_name = "METHOD", hide_possible_values = true, value_parser = parse::one_of::<Method>(&Method::NAMES))]
    method: Option<Method>,
    /// Filter gains: own (of each run), shared (along the reference) or auto (shared where eight runs agree
    /// within 3 %) [default: auto]
    #[arg(long, value_name = "GAINS", hide_possible_values = true, hide_short_help = true, value_parser = parse::one_of::<Gains>(&Gains::NAMES))]
    gains: Option<Gains>,
    /// Limit at the end of every outage (repeatable): p50_m, p95_m, rmse_pos_e_m, yaw_deg, …; or "consistent"; exit
    /// code 3 if not met
    #[arg(long, value_name = "NAME<=LIMIT")]
    require: Vec<Requirement>,
}

/// Results of a run. As JSON it is `summary.json`.
#[derive(Debug, Serialize)]
pub struct RunAnswer {
    /// Runs, statistics and summary.
    #[serde(flatten)]
    pub navigation: Navigation,
    /// IMU epochs a second, all runs together: the only number that the seed does not determine.
    pub throughput_epochs_per_s: f64,
    /// Settings and sources, for the manifest.
    #[serde(skip)]
    pub origin: RunOrigin,
    /// The files that were read.
    #[serde(skip)]
    pub inputs: Vec<Input>,
    /// The reference trajectory, drawn.
    #[serde(skip)]
    pub track: Vec<(f64, [f64; 2])>,
}

/// The record of a run in its manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunOrigin {
    /// The resolved configuration: every key, outages one by one.
    pub configuration: Scenario,
    /// True if the truth of each run was drawn from the spread of its model.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub spread: bool,
    /// Estimator of the model in the filter, if it was calibrated ("awv", "sr-awv", "dr-awv", …).
    #[serde(default)]
    pub estimator: Option<String>,
    /// Independent windows that the static recordings hold, where they made the errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub independent_windows: Option<f64>,
}

/// Names of the tables and the summary of a run directory.
pub(crate) const RUN_FILES: [&str; 3] = ["epochs.csv", "runs.csv", "summary.json"];

impl Command for Run {
    type Answer = RunAnswer;
    const NAME: &'static str = "run";
    const OUT: OutputKind = OutputKind::Directory {
        path: "out/run",
        files: &RUN_FILES,
    };
    const JUDGES: &'static [&'static str] = &["require"];

    fn run(&self, context: &Context<'_>) -> Result<RunAnswer> {
        self.prepare(&TrackCache::default(), context)?
            .navigate(None, context)
    }
}

/// A run before its first epoch: whatever can be refused has been.
pub(crate) struct PreparedRun<'a> {
    request: &'a Run,
    inputs: NavigateInputs,
    origin: RunOrigin,
    seed: u64,
    /// Without its outages.
    track: SharedTrack,
    filter: OnceLock<FilterTracks>,
}

/// A filter along its track, and the same with one step from mark to mark.
struct FilterTracks {
    track: Track,
    merged: Track,
    filter_model: FilterModel,
}

/// A track without outages, and the same with one step from mark to mark; made where it is needed first.
type SharedTrack = Arc<OnceLock<[Track; 2]>>;

/// Trajectories and tracks without outages, made once for many runs.
#[derive(Default)]
pub(crate) struct TrackCache {
    trajectories: Mutex<HashMap<PathBuf, Trajectory>>,
    tracks: Mutex<Vec<(PathBuf, Scenario, SharedTrack)>>,
}

/// Tracks that are kept at most: a study may vary what they depend on.
const TRACKS: usize = 4;

impl TrackCache {
    fn trajectory(&self, path: &Path, context: &Context<'_>) -> Result<Trajectory> {
        let mut known = lock(&self.trajectories);
        if let Some(trajectory) = known.get(path) {
            return Ok(trajectory.clone());
        }
        let trajectory = inputs::trajectory(path, context)?;
        known.insert(path.to_owned(), trajectory.clone());
        Ok(trajectory)
    }

    fn track(&self, path: &Path, scenario: &Scenario) -> SharedTrack {
        // Outages only take measurements from it, and a filter or a number of runs changes nothing.
        let key = Scenario {
            run: RunSettings::default(),
            filter: FilterSettings {
                gravity: scenario.filter.gravity,
                ..FilterSettings::default()
            },
            outage: None,
            ..scenario.clone()
        };
        let mut known = lock(&self.tracks);
        let found = known
            .iter()
            .find(|(of, with, _)| of == path && *with == key);
        if let Some((_, _, track)) = found {
            return track.clone();
        }
        if known.len() == TRACKS {
            known.remove(0);
        }
        let track = SharedTrack::default();
        known.push((path.to_owned(), key, track.clone()));
        track
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Run {
    /// Reads the files and places the outages.
    pub(crate) fn prepare(
        &self,
        shared: &TrackCache,
        context: &Context<'_>,
    ) -> Result<PreparedRun<'_>> {
        let mut scenario = self.scenario()?;
        let (mut inputs, file, made_by) = self.read(&mut scenario, shared, context)?;
        let is_drawn = scenario.run.method != Method::Lincov || scenario.outage_random.is_some();
        let given = context.given_seed().or(scenario.run.seed);
        scenario.run.seed = if is_drawn {
            Some(context.seed_or(given))
        } else {
            given
        };
        let seed = scenario.run.seed.unwrap_or_default();
        if self.spread {
            inputs.truth = TrueImu::Drawn(self.drawn(&made_by, &scenario, seed)?);
        }
        let outages = inputs::placed(&scenario, inputs.trajectory.span_s(), seed, context)
            .map_err(|e| match &self.settings.file.scenario {
                Some(file) if self.settings.outages.is_empty() => {
                    e.within(&file.display().to_string())
                }
                _ => e,
            })?;
        let wanting = self
            .require
            .iter()
            .find(|r| outages.is_empty() && r.needs_outage());
        if let Some(wanting) = wanting {
            let name = wanting.name();
            return refused(
                format!("--require {wanting}: {name} needs an outage"),
                "give one with --outage START:END",
            );
        }
        scenario.outage = Some(outages);
        (scenario.outage_periodic, scenario.outage_random) = (None, None);
        let origin = RunOrigin {
            configuration: scenario,
            spread: self.spread,
            estimator: file.estimator(),
            independent_windows: None,
        };
        Ok(PreparedRun {
            request: self,
            inputs,
            track: shared.track(&self.trajectory, &origin.configuration),
            origin,
            seed,
            filter: OnceLock::new(),
        })
    }

    /// The scenario file with the options over it, checked.
    pub(crate) fn scenario(&self) -> Result<Scenario> {
        let mut scenario = self.settings.scenario()?;
        scenario.run.runs = self.runs.unwrap_or(scenario.run.runs);
        scenario.run.method = self.method.unwrap_or(scenario.run.method);
        scenario.filter.gains = self.gains.unwrap_or(scenario.filter.gains);
        self.filter
            .over(&mut scenario.filter.states, &mut scenario.initial);
        scenario.validate().refuse()?;
        Ok(scenario)
    }

    /// The model that makes the errors of each run: its parameters drawn at its own rate, then brought to that of the IMU.
    fn drawn(&self, file: &ModelFile, scenario: &Scenario, seed: u64) -> Result<Vec<Model>> {
        let path = self.truth.as_ref().unwrap_or(&self.model).display();
        let Some(spread) = &file.spread else {
            return refused(
                format!("{path}: no [spread] to draw from"),
                "nav-sim calibrate writes one where three recordings differ; else leave --spread out",
            );
        };
        let of_run = |run| {
            continuous::at_rate(&spread.draw(&file.model, seed, run), scenario.imu.rate_hz)
                .refuse_within(format!("a model drawn from the [spread] of {path}"))
        };
        (0..scenario.run.runs).map(of_run).collect()
    }

    /// Trajectory, models and recordings; the file of the filter's model and that of what makes the errors. Turn-on
    /// biases that the models state go into the scenario where it is silent.
    fn read(
        &self,
        scenario: &mut Scenario,
        shared: &TrackCache,
        context: &Context<'_>,
    ) -> Result<(NavigateInputs, ModelFile, ModelFile)> {
        let imu_hz = scenario.imu.rate_hz;
        let read_model = |path: &Path| {
            let file = inputs::model(path, context)?;
            Ok::<_, Failure>((inputs::at_rate(path, &file.model, imu_hz, context)?, file))
        };
        let trajectory = shared.trajectory(&self.trajectory, context)?;
        let (model, file) = read_model(&self.model)?;
        let truth = self.truth.as_deref().map(read_model).transpose()?;
        let own = (self.model.as_path(), &file);
        let of_truth = self.truth.as_deref().zip(truth.as_ref());
        let of_truth = of_truth.map_or(own, |(path, (_, file))| (path, file));
        // recordings are their own truth: what they had of a constant bias is taken from them
        let of_truth = self.recordings.is_empty().then_some(of_truth);
        inputs::turn_on(scenario, own, of_truth, context);
        let draws = |path: &Path, file: &ModelFile| -> Option<Draws> {
            draws_file::usable(path, file, imu_hz).unwrap_or_else(|doubt| {
                context.warn(format!("{doubt}: no intervals from the calibration"));
                None
            })
        };
        let model_draws = draws(&self.model, &file);
        let made_by = truth.as_ref().map_or(&file, |(_, file)| file).clone();
        let (truth, truth_draws) = match (truth, self.recordings.as_slice()) {
            (Some((model, file)), []) => (
                TrueImu::Model(model),
                self.truth.as_deref().and_then(|path| draws(path, &file)),
            ),
            (None, []) => (TrueImu::AsBelieved, None),
            (_, paths) => (
                TrueImu::Recordings(inputs::recordings(
                    paths,
                    self.rate_hz,
                    Gaps::Refuse,
                    context,
                )?),
                None,
            ),
        };
        Ok((
            NavigateInputs {
                trajectory,
                model,
                truth,
                model_draws,
                truth_draws,
            },
            file,
            made_by,
        ))
    }
}

/// Runs of this request that are summed together: the bytes of results depend on it alone, not on who computed them.
pub(crate) fn block_of(request: &Run, shared: &TrackCache, context: &Context<'_>) -> Result<u64> {
    Ok(block(
        &shared.trajectory(&request.trajectory, context)?,
        &request.scenario()?,
    ))
}

/// Runs `first..first + count` of filters on the same noise, one result a filter (none for covariance analysis); nothing if the
/// context stopped.
pub(crate) fn columns(
    runs: &[&PreparedRun<'_>],
    first: u64,
    count: u64,
    context: &Context<'_>,
) -> Result<Option<Vec<Option<RunResult>>>> {
    let Some(one) = runs
        .first()
        .filter(|run| run.origin.configuration.run.method != Method::Lincov)
    else {
        context.advance(count * runs.len() as u64);
        return Ok(Some(runs.iter().map(|_| None).collect()));
    };
    let filter_models = runs
        .iter()
        .map(|run| Ok(run.filter()?.filter_model.clone()));
    let (filter_models, outages) = (filter_models.collect::<Result<Vec<_>>>()?, one.outages());
    let inputs = &one.inputs;
    let experiment = one.origin.configuration.experiment(
        &inputs.trajectory,
        inputs.truth(),
        &filter_models,
        &outages,
        one.seed,
    );
    let plan = Plan::new(&experiment)?.with_track(&one.filter()?.track);
    let progress = |done| context.advance(done * runs.len() as u64);
    let results = monte_carlo::run_range(
        &plan,
        first,
        count,
        &|| context.should_continue(),
        &progress,
    );
    Ok(results.map(|results| results.into_iter().map(Some).collect()))
}

impl PreparedRun<'_> {
    fn outages(&self) -> Vec<Outage> {
        self.origin.configuration.outage.clone().unwrap_or_default()
    }

    /// Returns true if two runs differ in the filter alone.
    pub(crate) fn shares_noise_with(&self, other: &Self) -> bool {
        let noise = |run: &Self| {
            let mut scenario = run.origin.configuration.clone();
            scenario.filter.states = FilterStates::Full;
            scenario
        };
        noise(self) == noise(other) && self.seed == other.seed
    }

    /// The filter along its track, made once.
    fn filter(&self) -> Result<&FilterTracks> {
        if self.filter.get().is_none() {
            // Another thread makes the same.
            drop(self.filter.set(self.make_filter()?));
        }
        Ok(self.filter.get().expect("exists"))
    }

    fn make_filter(&self) -> Result<FilterTracks> {
        let (scenario, outages) = (&self.origin.configuration, self.outages());
        let (model, request) = (&self.inputs.model, self.request);
        let file = &request.settings.file;
        if self.track.get().is_none() {
            let track = scenario.track(&self.inputs.trajectory, model, &[])?;
            let merged = track.merged();
            drop(self.track.set([track, merged]));
        }
        let [track, merged] = self.track.get().expect("exists");
        let track = track.with_outages(&outages);
        let filter_model = scenario
            .filter_model(model, &outages, &track)
            .map_err(|e| {
                inputs::no_filter(
                    &e,
                    &request.model,
                    file.gnss.as_deref().or(file.scenario.as_deref()),
                    "raise it, or use --filter full, which reduces nothing",
                )
            })?;
        Ok(FilterTracks {
            track,
            merged: merged.with_outages(&outages),
            filter_model,
        })
    }

    /// Navigates; `sampled`: runs that were made already.
    pub(crate) fn navigate(
        self,
        sampled: Option<RunResult>,
        context: &Context<'_>,
    ) -> Result<RunAnswer> {
        let (outages, _) = (self.outages(), self.filter()?);
        let Self {
            request,
            inputs,
            mut origin,
            seed,
            filter,
            ..
        } = self;
        let filter = filter.get().expect("exists");
        let mut navigation = with_runs(
            &inputs,
            &origin.configuration,
            &outages,
            filter,
            seed,
            sampled,
            context,
        )?;
        let summary = &mut navigation.summary;
        summary.require = request.require.iter().map(|r| r.check(summary)).collect();
        let (runs, runs_s) = (navigation.runs.as_ref(), context.runs_s());
        origin.independent_windows = runs.and_then(|runs| runs.independent_windows);
        let epochs = runs.map_or(0.0, |runs| runs.run_epochs as f64);
        Ok(RunAnswer {
            throughput_epochs_per_s: if runs_s > 0.0 { epochs / runs_s } else { 0.0 },
            track: trajectory::track(&inputs.trajectory),
            inputs: context.inputs().to_vec(),
            navigation,
            origin,
        })
    }
}

impl Answer for RunAnswer {
    fn document(&self) -> Document {
        document::document(self)
    }

    /// Without runs (covariance analysis) there is no table of them.
    fn files(&self) -> Vec<OutputFile<'_>> {
        let [epochs_name, runs_name, summary_name] = RUN_FILES;
        let Navigation { runs, epochs, .. } = &self.navigation;
        let mut files = vec![OutputFile::whole(epochs_name, epochs_csv(epochs))];
        files.extend(runs.as_ref().map(|result| OutputFile {
            name: runs_name.into(),
            parts: Box::new(runs_csv(result)),
        }));
        files.push(OutputFile::whole(summary_name, json(self)));
        files
    }

    fn record(&self) -> serde_json::Value {
        serde_json::to_value(&self.origin).unwrap_or_default()
    }

    /// All runs stay finite, the filter is not off by far, and everything required holds.
    fn unmet(&self) -> Option<Failure> {
        let summary = &self.navigation.summary;
        let Summary {
            diverged,
            runs,
            verdict,
            ..
        } = summary;
        if *diverged > 0 && diverged == runs {
            return Some(
                Failure::failed(format!("all {runs} runs diverged"))
                    .hint("do the models fit the IMU, are [imu] and [initial] plausible?"),
            );
        }
        if *diverged > 0 {
            return Some(
                Failure::bound(format!("{diverged} of {runs} runs diverged"))
                    .hint("summary.json lists them (diverged_runs); no figure includes them"),
            );
        }
        let missed = summary.require.iter().filter(|met| !met.met);
        let missed: Vec<String> = missed.map(|met| requirement_line(met, summary)).collect();
        if !missed.is_empty() {
            return Some(Failure::bound(missed.join("; ")));
        }
        verdict.is_far_off().then(|| {
            let nees = summary.nees.mean;
            Failure::bound(format!(
                "the filter is overconfident by far: NEES {nees:.0}, 9 if right"
            ))
            .hint("the results are written")
        })
    }
}

// The main job: from a trajectory, the filter's noise model and the model of the true errors to navigation errors, by
// Monte-Carlo runs, by covariance analysis, or by both.

/// Inputs of [`navigate()`].
#[derive(Debug)]
pub struct NavigateInputs {
    /// The reference trajectory.
    pub trajectory: Trajectory,
    /// The noise model that the filter assumes, at the rate of the IMU.
    pub model: Model,
    /// Source of the true IMU's errors.
    pub truth: TrueImu,
    /// Bootstrap draws of the calibration of the model, at the rate of the IMU.
    pub model_draws: Option<Draws>,
    /// Bootstrap draws of the calibration of the truth, if it is another model.
    pub truth_draws: Option<Draws>,
}

/// The source of the errors of the true IMU, in addition to the defects in the scenario.
#[derive(Debug)]
pub enum TrueImu {
    /// The model that the filter assumes.
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
    /// The summary.
    #[serde(flatten)]
    pub summary: Summary,
}

/// Navigates along a trajectory, with these outages and this seed.
///
/// # Errors
/// When settings contradict, the method cannot do it, or the covariance runs away.
pub fn navigate(
    inputs: &NavigateInputs,
    scenario: &Scenario,
    outages: &[Outage],
    seed: u64,
    context: &Context<'_>,
) -> Result<Navigation> {
    let track = scenario.track(&inputs.trajectory, &inputs.model, outages)?;
    let filter = FilterTracks {
        filter_model: scenario
            .filter_model(&inputs.model, outages, &track)
            .refuse()?,
        merged: track.merged(),
        track,
    };
    with_runs(inputs, scenario, outages, &filter, seed, None, context)
}

/// Result of a filter along its track, with runs that were made already.
fn with_runs(
    inputs: &NavigateInputs,
    scenario: &Scenario,
    outages: &[Outage],
    FilterTracks {
        track,
        merged,
        filter_model,
    }: &FilterTracks,
    seed: u64,
    runs: Option<RunResult>,
    context: &Context<'_>,
) -> Result<Navigation> {
    let method = scenario.run.method;
    let possible = possible(inputs);
    if method != Method::MonteCarlo {
        possible.clone()?;
    }
    doubt(inputs, scenario, context);
    // Within 1e-3 the same in a quarter of the time: for what stands beside the figures.
    let beside = FilterPass::new(merged, filter_model);
    let full = |model: &Model| {
        scenario
            .with_full_noise()
            .filter_model(model, outages, track)
            .ok()
    };
    let reduction = scenario.filter.states.is_reduced().then(|| {
        reduction_of(
            (&inputs.model, filter_model, full(&inputs.model).as_ref()),
            &beside,
            context,
        )
    });
    // Where the motion hardly shows the heading, no filter of this kind is to be believed.
    context.warn_each(weak_heading(beside.yaw_sigma_at_updates().into_iter()));
    let experiment = scenario.experiment(
        &inputs.trajectory,
        inputs.truth(),
        std::slice::from_ref(filter_model),
        outages,
        seed,
    );
    let analysis = Analysis {
        experiment: &experiment,
        track,
        filter_model,
        model: inputs.truth_model(),
    };
    // beside runs that were requested alone it may be impossible
    let expected = possible.ok().and_then(|()| analysis.expected());
    if method != Method::MonteCarlo && expected.is_none() {
        return Err(
            Failure::failed("the covariance did not stay finite and positive definite")
                .hint("do the models fit the IMU, are [imu] and [initial] plausible?"),
        );
    }
    let mut navigation = match (method, expected) {
        (
            Method::Lincov,
            Some(ExpectedRun {
                epochs, summary, ..
            }),
        ) => Navigation {
            runs: None,
            epochs,
            // Nothing is drawn but outages; a seed that is given stays on record.
            summary: Summary {
                seed: scenario.run.seed,
                ..summary
            },
        },
        (method, expected) => {
            let runs = match runs {
                Some(runs) => runs,
                None => sampled(&analysis, scenario, &inputs.trajectory, context)?,
            };
            let mut sampled = Navigation::of_runs(runs, seed);
            match expected {
                Some(expected) if method == Method::Both => {
                    sampled.summary.expect(expected.summary);
                }
                Some(expected) => sampled.summary.compare_with(&expected.summary),
                None => {}
            }
            sampled
        }
    };
    navigation.summary.reduction = reduction.flatten();
    let over_sigma = strapdown_over_sigma(track, filter_model);
    navigation.summary.strapdown_over_sigma = over_sigma;
    context.warn_each(integration_line(scenario.imu.rate_hz, over_sigma));
    analysis.add_budgets(&beside, &mut navigation.summary.outages);
    analysis.add_intervals(&mut navigation.summary.outages, inputs, &full);
    Ok(navigation)
}

/// Refuses what covariance analysis cannot do.
fn possible(inputs: &NavigateInputs) -> Result<()> {
    match inputs.truth {
        TrueImu::Recordings(_) => refused(
            "covariance analysis needs a model of the errors, not static recordings",
            "calibrate the recordings and give the model with --truth, or use --method monte-carlo",
        ),
        TrueImu::Drawn(_) => refused(
            "covariance analysis has one truth; --spread draws one per run",
            "leave --spread out, or use --method monte-carlo",
        ),
        TrueImu::AsBelieved | TrueImu::Model(_) => Ok(()),
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
    context.warn_each(scenario.unexpected());
}

/// Means over a second that differ so much are motion, not noise: m/s², rad/s.
const MOTION: (f64, f64) = (0.5, 0.05);

/// Describes motion in a recording that should be static.
fn motion(recording: &Recording) -> Option<String> {
    let second = (recording.rate_hz.round() as usize).max(1);
    recording.signals.iter().find_map(|signal| {
        let limit = if signal.channel.sensor == Sensor::Accel { MOTION.0 } else { MOTION.1 };
        let (low, high) = signal.samples.chunks_exact(second).map(|c| c.iter().sum::<f64>() / second as f64).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), m| (l.min(m), h.max(m)));
        let message = format!(
            "{}: not static? One-second means of {} go from {:.3} to {:.3} {}: motion becomes IMU errors",
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
fn block(trajectory: &Trajectory, scenario: &Scenario) -> u64 {
    let samples = (trajectory.end_s() - trajectory.start_s()) * scenario.imu.rate_hz;
    8 * ((1e8 / (8.0 * samples)) as u64).max(1)
}

/// All runs, block by block.
fn sampled(
    analysis: &Analysis<'_>,
    scenario: &Scenario,
    trajectory: &Trajectory,
    context: &Context<'_>,
) -> Result<RunResult> {
    let (runs, block) = (scenario.run.runs, block(trajectory, scenario));
    context.begin("runs", runs);
    let plan = Plan::new(analysis.experiment)?.with_track(analysis.track);
    let of_block = |first: u64| {
        monte_carlo::run_range(&plan, first, block.min(runs - first), &|| true, &|n| {
            context.advance(n)
        })
        .expect("unstoppable")
        .swap_remove(0)
    };
    let mut result = of_block(0);
    for first in (block..runs).step_by(block as usize) {
        result.append(of_block(first));
    }
    context.end();
    Ok(result)
}

/// Input of a covariance analysis.
struct Analysis<'a> {
    experiment: &'a Experiment<'a>,
    track: &'a Track,
    filter_model: &'a FilterModel,
    /// None: what makes the errors has no model.
    model: Option<&'a Model>,
}

impl Analysis<'_> {
    /// The expected figures; none where the covariance runs away or nothing models the errors.
    fn expected(&self) -> Option<ExpectedRun> {
        ExpectedRun::along(self.track, self.experiment, self.filter_model, self.model?)
    }

    /// Adds the uncertainty due to the calibrations to the figures at the ends of outages.
    fn add_intervals(
        &self,
        outages: &mut [OutageSummary],
        inputs: &NavigateInputs,
        full: &(dyn Fn(&Model) -> Option<FilterModel> + Sync),
    ) {
        let truth_draws = match inputs.truth {
            TrueImu::AsBelieved => inputs.model_draws.as_ref(),
            _ => inputs.truth_draws.as_ref(),
        };
        if let (Some(truth), Some(draws)) = (self.model, truth_draws) {
            self.errors(truth, draws, outages);
        }
        if let Some(draws) = &inputs.model_draws {
            self.filter_models(&inputs.model, draws, full, outages);
        }
    }

    /// Adds the error budget at the ends of outages.
    fn add_budgets(&self, filter: &FilterPass<'_>, outages: &mut [OutageSummary]) {
        let Some(model) = self.model else { return };
        let sources = TruthModel::sources(self.experiment, model);
        let budgets = Budget::at_outage_ends(filter, &sources);
        for (outage, budget) in outages.iter_mut().zip(budgets) {
            outage.budget = Some(budget);
        }
    }
}

impl Navigation {
    /// The statistics of runs of a seed.
    pub fn of_runs(result: RunResult, seed: u64) -> Self {
        let epochs = epochs(&result);
        let summary = Summary::of(&result, &epochs, seed);
        Self {
            runs: Some(result),
            epochs,
            summary,
        }
    }
}

impl NavigateInputs {
    /// Along a trajectory, with models that are known for certain.
    pub const fn new(trajectory: Trajectory, model: Model, truth: TrueImu) -> Self {
        Self {
            trajectory,
            model,
            truth,
            model_draws: None,
            truth_draws: None,
        }
    }

    fn truth(&self) -> Truth<'_> {
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
    (model, filter_model, full): (&Model, &FilterModel, Option<&FilterModel>),
    filter: &FilterPass<'_>,
    context: &Context<'_>,
) -> Option<ReductionQuality> {
    if model.axes.iter().all(is_exact) {
        return None;
    }
    let quality = ReductionQuality::of(
        &filter.assess(filter_model, model),
        full.map(|full| assess(filter.track(), full, model))
            .as_ref(),
    );
    context.remark(reduction_line(&quality));
    context.warn_each(reduction_doubt(&quality));
    Some(quality)
}

// What the calibration of a model leaves open in the figures of a run: by covariance analysis, whatever made the figures.
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
        let filter = FilterPass::new(&track, self.filter_model);
        let figures = |model: &Model| -> Figures {
            let truth = TruthModel::together(&TruthModel::sources(self.experiment, model));
            let ends = filter.errors_at_ends(&truth);
            let figures =
                |end: &Instant| [&end.rmse()[..], &horizontal_quantiles(end, QUANTILES)].concat();
            ends.iter().map(|end| figures(&end.errors)).collect()
        };
        for (outage, interval) in outages.iter_mut().zip(intervals(truth, draws, &figures)) {
            let h = &mut outage.horizontal_error_end_m;
            outage.rmse_end_ci95 = about(&outage.rmse_end.0, &interval)
                .try_into()
                .ok()
                .map(PerState);
            if let [.., p50, p95] = interval[..] {
                let has_runs = h.p999.is_none();
                h.p50_ci95 = together(h.p50, h.p50_ci95, p50, has_runs);
                h.p95_ci95 = together(h.p95, h.p95_ci95, p95, has_runs);
            }
        }
    }

    /// Puts the intervals of the ASEE into the outages; `full` makes the filter that knows a model. None are put where a
    /// model has no such filter.
    fn filter_models(
        &self,
        model: &Model,
        draws: &Draws,
        full: &(dyn Fn(&Model) -> Option<FilterModel> + Sync),
        outages: &mut [OutageSummary],
    ) {
        let track = self.track.merged();
        let figures = |model: &Model| -> Figures {
            let Some(filter_model) = full(model) else {
                return Vec::new();
            };
            let filter = FilterPass::new(&track, &filter_model);
            filter
                .sigma_at_ends()
                .iter()
                .zip(filter.sigma_means(self.experiment.outages))
                .map(|(end, mean)| [&end[..], &mean].concat())
                .collect()
        };
        for (outage, interval) in outages.iter_mut().zip(intervals(model, draws, &figures)) {
            let (end, mean) = interval.split_at(REPORTED);
            let [end, mean] = [(&outage.asee_end, end), (&outage.asee_mean, mean)]
                .map(|(asee, ratios)| about(&asee.0, ratios).try_into().ok().map(PerState));
            outage.asee_end_ci95 = end;
            // An outage between two reports has no mean.
            let has_mean = outage.asee_mean.0.iter().all(|x| x.is_finite());
            outage.asee_mean_ci95 = mean.filter(|_| has_mean);
        }
    }
}

/// The interval of a quantile by its runs, if it has some, and by the calibration of what makes the errors: the two are
/// independent, and the squares of their distances add in logarithms. Too few runs for an end leave it open.
fn together(
    value: f64,
    of_runs: (Option<f64>, Option<f64>),
    calibration: (f64, f64),
    has_runs: bool,
) -> (Option<f64>, Option<f64>) {
    let end = |of_runs: Option<f64>, calibration: f64, sign: f64| {
        let of_runs = if has_runs {
            (of_runs? / value).ln()
        } else {
            0.0
        };
        Some(value * (sign * of_runs.hypot(calibration.ln())).exp())
    };
    (
        end(of_runs.0, calibration.0, -1.0),
        end(of_runs.1, calibration.1, 1.0),
    )
}

/// Intervals of values, by their ends over the values.
fn about(values: &[f64], ratios: &[(f64, f64)]) -> Vec<(f64, f64)> {
    values
        .iter()
        .zip(ratios)
        .map(|(value, (low, high))| (value * low, value * high))
        .collect()
}

/// The ends of the interval that the draws give to each figure, over the estimate.
fn intervals(
    estimate: &Model,
    draws: &Draws,
    figures: &(dyn Fn(&Model) -> Figures + Sync),
) -> Vec<Vec<(f64, f64)>> {
    let drawn: Vec<Figures> = draws.models.par_iter().map(figures).collect();
    let of_figure = |k: usize, (i, x): (usize, &f64)| {
        let [low, high] = derived_interval(
            *x,
            drawn
                .iter()
                .filter_map(|ends| Some(ends.get(k)?[i]))
                .collect(),
        );
        (low / x, high / x)
    };
    let of_outage = |(k, own): (usize, &Vec<f64>)| {
        own.iter()
            .enumerate()
            .map(|figure| of_figure(k, figure))
            .collect()
    };
    figures(estimate)
        .iter()
        .enumerate()
        .map(of_outage)
        .collect()
}
