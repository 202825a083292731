//! `nav-sim run`: the main job.

pub(crate) mod directory;
mod document;
mod navigate;

pub(crate) use navigate::reduction_of;
pub use navigate::{NavigateInputs, Navigation, TrueImu, navigate};

use crate::app::inputs::{self, FilterArgs, SettingsArgs, files};
use crate::app::{Answer, Command, Context, Failure, Input, Out, OutputFile, Refuse, Result};
use crate::io::draws_file::{self, Draws};
use crate::io::model_file::ModelFile;
use crate::io::scenario_file;
use crate::parse;
use crate::report::tables::{epochs_csv, fan_csv, runs_csv};
use crate::report::verdict::requirement_line;
use crate::report::{TrajectorySeries, json};
use nav_sim_document::{Document, svg};
use nav_sim_navigation::ekf::{Belief, FilterStates};
use nav_sim_navigation::metrics::{Requirement, Summary};
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::Track;
use nav_sim_navigation::simulation::{Plan, RunResult};
use nav_sim_signal::noise::{Model, continuous};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Navigate by INS/GNSS along TRAJECTORY with MODEL in the filter: Monte Carlo or covariance analysis
///
/// Writes a run directory: epochs.csv (ASEE, RMSE, bias, NEES, coverage at 1 Hz), fan.csv (quantiles of the
/// horizontal error), runs.csv, summary.json, report.html, manifest.json. The same seed gives every model the same
/// noise, so that runs can be compared pair by pair (see `nav-sim compare`).
#[derive(clap::Args, Debug, Clone)]
#[command(before_help = "\
Examples:
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml --seed 1 --runs 20
  nav-sim run trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage 60:90 --filter full --runs 8 -o out/full
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --truth calib_data/tactical.toml --runs 8 -o out/mismatch")]
pub struct Run {
    /// Trajectory: motion profile (.toml) or table (.csv)
    pub trajectory: PathBuf,
    /// Noise model that the filter believes
    pub model: PathBuf,
    /// Noise model that makes the INS errors (default: MODEL itself)
    #[arg(long, value_name = "MODEL2", conflicts_with = "static")]
    pub truth: Option<PathBuf>,
    /// Draw the parameters that make the errors of each run from the spread that their model states
    #[arg(long, conflicts_with = "static")]
    pub spread: bool,
    /// Static recording whose windows make the INS errors (repeatable)
    #[arg(id = "static", long = "static", value_name = "FILE")]
    pub recordings: Vec<PathBuf>,
    /// Sample rate of static recordings without a time column
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz, requires = "static")]
    pub rate_hz: Option<f64>,
    /// Outages and other settings of the run.
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Scenario file whose section gnss is used
    #[arg(long, value_name = "FILE")]
    pub gnss: Option<PathBuf>,
    /// Monte-Carlo runs (default: 100)
    #[arg(long, value_name = "N")]
    pub runs: Option<u64>,
    /// States of the filter, and what it expects beside the model.
    #[command(flatten)]
    pub filter: FilterArgs,
    /// How statistics are computed: monte-carlo (sampled runs), lincov (linear covariance analysis, no sampling) or
    /// both (runs, compared with their expected values)
    #[arg(long, value_name = "METHOD", value_parser = parse::one_of::<Method>(&Method::NAMES))]
    pub method: Option<Method>,
    /// Limit on an error at the end of every outage, as NAME<=LIMIT (repeatable): p50_m, p95_m (horizontal),
    /// rmse_pos_e_m, yaw_deg and the other states; or "consistent"; exit code 3 if it is not met
    #[arg(long, value_name = "NAME<=LIMIT")]
    pub require: Vec<Requirement>,
}

/// Results of a run. As JSON it is `summary.json`.
#[derive(Debug, Serialize)]
pub struct RunAnswer {
    /// Runs, statistics and summary.
    #[serde(flatten)]
    pub navigation: Navigation,
    /// Settings and sources, for the manifest; of them the speed, the only number that the seed does not determine.
    #[serde(flatten, serialize_with = "throughput")]
    pub origin: RunOrigin,
    /// The files that were read.
    #[serde(skip)]
    pub inputs: Vec<Input>,
    /// The reference trajectory, drawn.
    #[serde(skip)]
    pub track: TrajectorySeries,
}

fn throughput<S: serde::Serializer>(
    origin: &RunOrigin,
    to: S,
) -> std::result::Result<S::Ok, S::Error> {
    to.collect_map([("throughput_epochs_per_s", origin.throughput_epochs_per_s)])
}

/// The record of a run in its manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunOrigin {
    /// The resolved configuration: every key, outages one by one.
    pub configuration: Scenario,
    /// Whether the truth of each run was drawn from the spread of its model.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub spread: bool,
    /// The model in the filter.
    pub model: ModelNote,
    /// Independent windows that the static recordings hold, where they made the errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub independent_windows: Option<f64>,
    /// IMU epochs a second, all runs together.
    pub throughput_epochs_per_s: f64,
}

/// What the model file says about its making.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelNote {
    /// Estimator, if calibrated ("awv", "sr-awv", "dr-awv", …).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimator: Option<String>,
}

/// Names of the tables and the summary of a run directory.
pub(crate) const RUN_FILES: [&str; 4] = ["epochs.csv", "fan.csv", "runs.csv", "summary.json"];

impl Command for Run {
    type Answer = RunAnswer;
    const NAME: &'static str = "run";
    const OUT: Out = Out::Directory {
        path: "out/run",
        files: &RUN_FILES,
    };
    const JUDGES: &'static [&'static str] = &["require"];

    fn inputs(&self) -> Result<Vec<(&'static str, PathBuf)>> {
        let trajectory = files("trajectory", [&self.trajectory]);
        Ok(trajectory
            .chain(files("model", [&self.model]))
            .chain(files("truth", &self.truth))
            .chain(inputs::listed("static", &self.recordings)?)
            .chain(files("scenario", &self.settings.file.scenario))
            .chain(files("gnss", &self.gnss))
            .collect())
    }

    fn run(&self, context: &Context<'_>) -> Result<RunAnswer> {
        self.prepare(context)?.navigate(None, context)
    }
}

/// A run before its first epoch: whatever can be refused has been.
pub(crate) struct PreparedRun<'a> {
    request: &'a Run,
    inputs: NavigateInputs,
    scenario: Scenario,
    origin: RunOrigin,
    seed: u64,
}

impl Run {
    /// Reads the files and places the outages.
    pub(crate) fn prepare(&self, context: &Context<'_>) -> Result<PreparedRun<'_>> {
        let mut scenario = self.scenario()?;
        let (mut inputs, file, made_by) = self.read(&mut scenario, context)?;
        let is_drawn = scenario.run.method != Method::Lincov || scenario.outage_random.is_some();
        let seed = match is_drawn {
            true => context.seed_or(scenario.run.seed),
            false => context
                .given_seed()
                .or(scenario.run.seed)
                .unwrap_or_default(),
        };
        scenario.run.seed = is_drawn
            .then_some(seed)
            .or(context.given_seed())
            .or(scenario.run.seed);
        if self.spread {
            inputs.truth = TrueImu::Drawn(self.drawn(&made_by, &scenario, seed)?);
        }
        let outages = inputs::placed(&scenario, &inputs.trajectory, seed, context);
        let outages = outages.map_err(|e| match &self.settings.file.scenario {
            Some(file) if self.settings.outages.is_empty() => e.within(&file.display().to_string()),
            _ => e,
        })?;
        let wanting = self
            .require
            .iter()
            .find(|r| outages.is_empty() && r.needs_outage());
        if let Some(wanting) = wanting {
            let name = wanting.name();
            let message =
                format!("--require {wanting}: {name} is of the ends of outages, and there is none");
            return Err(Failure::input(message).hint("give an outage with --outage START:END"));
        }
        if scenario.run.method == Method::Lincov && self.runs.is_some() {
            context.warn(
                "--runs is ignored with --method lincov; --method both adds Monte-Carlo runs",
            );
        }
        let mut configuration = scenario.clone();
        configuration.outage = Some(outages);
        (configuration.outage_periodic, configuration.outage_random) = (None, None);
        let origin = RunOrigin {
            configuration,
            spread: self.spread,
            model: ModelNote {
                estimator: file.estimator(),
            },
            independent_windows: None,
            throughput_epochs_per_s: 0.0,
        };
        Ok(PreparedRun {
            request: self,
            inputs,
            scenario,
            origin,
            seed,
        })
    }

    /// The scenario file with the options over it, checked.
    pub(crate) fn scenario(&self) -> Result<Scenario> {
        let mut scenario = self.settings.scenario()?;
        if let Some(path) = &self.gnss {
            scenario.gnss = scenario_file::read(path)?.gnss;
        }
        scenario.run.runs = self.runs.unwrap_or(scenario.run.runs);
        scenario.run.method = self.method.unwrap_or(scenario.run.method);
        self.filter
            .over(&mut scenario.filter.states, &mut scenario.initial);
        scenario.validate().refuse()?;
        Ok(scenario)
    }

    /// The model that makes the errors of each run: its parameters drawn at its own rate, then brought to that of the IMU.
    fn drawn(&self, file: &ModelFile, scenario: &Scenario, seed: u64) -> Result<Vec<Model>> {
        let path = self.truth.as_ref().unwrap_or(&self.model).display();
        let Some(spread) = &file.spread else {
            let message = format!("{path}: no [spread] to draw parameters from");
            return Err(Failure::input(message).hint(
                "nav-sim calibrate writes one where three recordings or more differ, or leave --spread out",
            ));
        };
        let of_run = |run| {
            let drawn = spread.draw(&file.model, seed, run);
            let drawn = drawn.expect("the spread was read with its model");
            continuous::at_rate(&drawn, scenario.imu.rate_hz)
                .refuse_within(format!("a model drawn from the [spread] of {path}"))
        };
        (0..scenario.run.runs).map(of_run).collect()
    }

    /// Trajectory, models and recordings; the file of the filter's model and that of what makes the errors. Turn-on
    /// biases that the models state go into the scenario where it is silent.
    fn read(
        &self,
        scenario: &mut Scenario,
        context: &Context<'_>,
    ) -> Result<(NavigateInputs, ModelFile, ModelFile)> {
        let imu_hz = scenario.imu.rate_hz;
        let read_model = |path: &Path| {
            let file = inputs::model(path, context)?;
            let model = inputs::at_rate(path, &file.model, imu_hz, context)?;
            Ok::<_, Failure>((model, file))
        };
        let trajectory = inputs::trajectory(&self.trajectory, context)?;
        let (model, file) = read_model(&self.model)?;
        inputs::expect_turn_on(&mut scenario.initial, &file, &self.model, context);
        let truth = self.truth.as_deref().map(read_model).transpose()?;
        // recordings are their own truth: what they had of a constant bias is taken from them
        if self.recordings.is_empty() {
            let made_by = truth.as_ref().map_or(&file, |(_, file)| file);
            let path = self.truth.as_ref().unwrap_or(&self.model);
            inputs::make_turn_on(&mut scenario.imu, made_by, path, context);
        }
        let analysed = scenario.run.method == Method::Lincov;
        let draws = |path: &Path, file: &ModelFile| -> Option<Draws> {
            let found = analysed.then(|| draws_file::usable(path, &file.model, imu_hz))?;
            found.unwrap_or_else(|doubt| {
                context.warn(format!("{doubt}: no intervals from the calibration"));
                None
            })
        };
        let model_draws = draws(&self.model, &file);
        let made_by = truth.as_ref().map_or(&file, |(_, file)| file).clone();
        let (truth, truth_draws) = match (truth, self.recordings.as_slice()) {
            (Some((model, file)), []) => {
                let drawn = self.truth.as_deref().and_then(|path| draws(path, &file));
                (TrueImu::Model(model), drawn)
            }
            (None, []) => (TrueImu::AsBelieved, None),
            (_, paths) => {
                let recordings = inputs::recordings(paths, self.rate_hz, context)?;
                (TrueImu::Recordings(recordings), None)
            }
        };
        let inputs = NavigateInputs {
            trajectory,
            model,
            truth,
            model_draws,
            truth_draws,
        };
        Ok((inputs, file, made_by))
    }
}

/// Runs of this request that are summed together: the bytes of results depend on it alone, not on who computed them.
pub(crate) fn block_of(request: &Run, context: &Context<'_>) -> Result<u64> {
    let trajectory = inputs::trajectory(&request.trajectory, context)?;
    Ok(navigate::block(&trajectory, &request.scenario()?))
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
        .filter(|run| run.scenario.run.method != Method::Lincov)
    else {
        context.advance(count * runs.len() as u64);
        return Ok(Some(runs.iter().map(|_| None).collect()));
    };
    let beliefs = runs.iter().map(|run| Ok(run.filter()?.1));
    let (beliefs, outages) = (beliefs.collect::<Result<Vec<_>>>()?, one.outages());
    let inputs = &one.inputs;
    let experiment = one.scenario.experiment(
        &inputs.trajectory,
        inputs.truth(),
        &beliefs,
        &outages,
        one.seed,
    );
    let plan = Plan::new(&experiment)?.with_fan();
    let progress = |done| context.advance(done * runs.len() as u64);
    let results = monte_carlo::run_range(&plan, first, count, &|| context.go_on(), &progress);
    Ok(results.map(|results| results.into_iter().map(Some).collect()))
}

impl PreparedRun<'_> {
    fn outages(&self) -> Vec<Outage> {
        self.origin.configuration.outage.clone().unwrap_or_default()
    }

    /// Whether two runs differ in the filter alone.
    pub(crate) fn shares_noise_with(&self, other: &Self) -> bool {
        let noise = |run: &Self| {
            let mut scenario = run.origin.configuration.clone();
            scenario.filter.states = FilterStates::Full;
            scenario
        };
        noise(self) == noise(other) && self.seed == other.seed
    }

    /// The track and the filter.
    fn filter(&self) -> Result<(Track, Belief)> {
        let (scenario, outages) = (&self.scenario, self.outages());
        let (model, request) = (&self.inputs.model, self.request);
        let track = scenario.track(&self.inputs.trajectory, model, &outages)?;
        let belief = scenario.belief(model, &outages, &track).map_err(|e| {
            let scenario = request.settings.file.scenario.as_deref();
            let settings = request.gnss.as_deref().or(scenario);
            let advice = "raise it, or take the full filter (--filter full), which reduces nothing";
            inputs::no_filter(&e, &request.model, settings, advice)
        })?;
        Ok((track, belief))
    }

    /// Navigates; `sampled`: runs that were made already.
    pub(crate) fn navigate(
        self,
        sampled: Option<RunResult>,
        context: &Context<'_>,
    ) -> Result<RunAnswer> {
        let (outages, (track, belief)) = (self.outages(), self.filter()?);
        let Self {
            request,
            inputs,
            scenario,
            mut origin,
            seed,
        } = self;
        let filter = (&track, &belief);
        let mut navigation =
            navigate::with_runs(&inputs, &scenario, &outages, filter, seed, sampled, context)?;
        let summary = &mut navigation.summary;
        summary.require = request.require.iter().map(|r| r.check(summary)).collect();
        if let Some(runs) = &navigation.runs {
            origin.independent_windows = runs.independent_windows;
            let runs_s = context.runs_s();
            if runs_s > 0.0 {
                origin.throughput_epochs_per_s = runs.run_epochs as f64 / runs_s;
            }
        }
        Ok(RunAnswer {
            track: TrajectorySeries::of(&inputs.trajectory),
            inputs: context.inputs().to_vec(),
            navigation,
            origin,
        })
    }
}

impl RunAnswer {
    /// The hashes of the inputs of a role.
    pub(crate) fn has_input(&self, role: &str) -> bool {
        self.inputs.iter().any(|input| input.role == role)
    }
}

impl Answer for RunAnswer {
    fn document(&self) -> Document {
        document::document(self)
    }

    fn svg(&self, _: &Document) -> String {
        let Navigation {
            epochs,
            fan,
            summary,
            ..
        } = &self.navigation;
        let shown = [
            document::horizontal(epochs, summary),
            document::fan_chart(fan, summary),
            document::nees(epochs, summary),
        ];
        svg("Navigation errors", &shown)
    }

    /// Without runs (covariance analysis) there is no table of them.
    fn files(&self) -> Vec<OutputFile<'_>> {
        let [epochs_name, fan_name, runs_name, summary_name] = RUN_FILES;
        let Navigation {
            runs, epochs, fan, ..
        } = &self.navigation;
        let mut files = vec![
            OutputFile::whole(epochs_name, epochs_csv(epochs)),
            OutputFile::whole(fan_name, fan_csv(fan)),
        ];
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
            let failure =
                Failure::could_not(format!("all {runs} runs diverged: there is no result"));
            return Some(
                failure.hint("does the model fit the IMU, are [imu] and [initial] plausible?"),
            );
        }
        if *diverged > 0 {
            let failure = Failure::bound(format!("{diverged} of {runs} runs diverged"));
            return Some(failure.hint(
                "their indices are in summary.json, under diverged_runs; they are in no other number",
            ));
        }
        let missed = summary.require.iter().filter(|met| !met.met);
        let missed: Vec<String> = missed.map(|met| requirement_line(met, summary)).collect();
        if !missed.is_empty() {
            return Some(Failure::bound(missed.join("; ")));
        }
        verdict.is_far_off().then(|| {
            let nees = summary.nees.mean;
            let message =
                format!("the filter is overconfident by far: NEES {nees:.0}, 9 if it is right");
            Failure::bound(message).hint("the results are written")
        })
    }
}
