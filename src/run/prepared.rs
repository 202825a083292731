//! A run whose files are read and whose settings are checked.

use super::answer::RunAnswer;
use super::error::RunError;
use super::request::RunRequest;
use super::{NavigateInputs, TrueImu, navigate, read};
use crate::answered::{Answered, contents};
use crate::app::Context;
use crate::failure::Failure;
use crate::formats::model_file::ModelFile;
use crate::formats::{FileError, draws_file, input};
use crate::report::{Input, Manifest, ModelNote, TrajectorySeries};
use nav_sim_navigation::metrics::Requirement;
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_signal::noise::{Model, continuous};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A run before its first epoch: whatever can be refused has been.
#[derive(Debug)]
pub struct PreparedRun {
    /// Where its results will come from.
    pub manifest: Manifest,
    inputs: NavigateInputs,
    scenario: Scenario,
    outages: Vec<Outage>,
    seed: u64,
    require: Vec<Requirement>,
    model: PathBuf,
    settings: Option<PathBuf>,
}

impl RunRequest {
    /// Reads the files and places the outages. `draw` is asked for a seed where there are random numbers and neither the
    /// request nor the scenario has one.
    ///
    /// # Errors
    /// What is wrong with a file or a setting.
    pub fn prepare(
        &self,
        draw: impl FnOnce() -> u64,
        context: &Context<'_>,
    ) -> Result<PreparedRun, RunError> {
        let mut scenario = self.settings()?;
        let files = self.files()?;
        let (mut inputs, model, made_by) = self.inputs(&mut scenario, context)?;
        let is_drawn = scenario.run.method != Method::Lincov || scenario.outage_random.is_some();
        scenario.run.seed = self
            .seed
            .or(scenario.run.seed)
            .or_else(|| is_drawn.then(draw));
        let seed = scenario.run.seed.unwrap_or_default();
        if self.spread {
            inputs.truth = TrueImu::Drawn(self.drawn(&made_by, &scenario, seed)?);
        }
        let span = (inputs.trajectory.start_s(), inputs.trajectory.end_s());
        let placed = scenario.outages_on(span, seed).map_err(|source| {
            let file = self.scenario.clone().filter(|_| self.outages.is_empty());
            RunError::Outage { file, source }
        })?;
        placed
            .remarks
            .into_iter()
            .for_each(|remark| context.warn(remark));
        let outages = placed.windows;
        if let Some(wanting) = self
            .require
            .iter()
            .find(|r| outages.is_empty() && r.needs_outage())
        {
            return Err(RunError::NoOutage(*wanting));
        }
        if scenario.run.method == Method::Lincov && self.runs.is_some() {
            let text =
                "--runs is ignored with --method lincov; --method both adds Monte-Carlo runs";
            context.warn(text.to_owned());
        }
        let mut configuration = scenario.clone();
        configuration.outage = Some(outages.clone());
        (configuration.outage_periodic, configuration.outage_random) = (None, None);
        let manifest = Manifest {
            schema_version: Manifest::SCHEMA_VERSION,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: Vec::new(),
            seed: scenario.run.seed,
            configuration,
            spread: self.spread,
            inputs: files,
            outputs: BTreeMap::new(),
            model: ModelNote {
                estimator: model.estimator(),
            },
            threads: 0,
            independent_windows: None,
            wall_s: 0.0,
            throughput_epochs_per_s: 0.0,
        };
        let (require, model, settings) = (
            self.require.clone(),
            self.model.clone(),
            self.settings_file(),
        );
        Ok(PreparedRun {
            manifest,
            inputs,
            scenario,
            outages,
            seed,
            require,
            model,
            settings,
        })
    }

    /// The model that makes the errors of each run: its parameters drawn at its own rate, then brought to that of the IMU.
    fn drawn(
        &self,
        file: &ModelFile,
        scenario: &Scenario,
        seed: u64,
    ) -> Result<Vec<Model>, RunError> {
        let path = self.truth.as_ref().unwrap_or(&self.model);
        let spread = file
            .spread
            .as_ref()
            .ok_or_else(|| RunError::NoSpread(path.clone()))?;
        let of_run = |run| {
            let drawn = spread
                .draw(&file.model, seed, run)
                .expect("the spread was read with its model");
            continuous::at_rate(&drawn, scenario.imu.rate_hz).map_err(|source| RunError::Drawn {
                path: path.clone(),
                source,
            })
        };
        (0..scenario.run.runs).map(of_run).collect()
    }

    /// The models, the trajectory and the recordings, the file of the filter's model and that of what makes the errors; turn-on biases that the models state go into the scenario where it is
    /// silent.
    fn inputs(
        &self,
        scenario: &mut Scenario,
        context: &Context<'_>,
    ) -> Result<(NavigateInputs, ModelFile, ModelFile), RunError> {
        let imu_hz = scenario.imu.rate_hz;
        let read_model = |path: &Path| {
            let file = read::model(path, context)?;
            Ok::<_, RunError>((read::at_rate(path, &file.model, imu_hz, context)?, file))
        };
        let trajectory = read::trajectory(&self.trajectory, context)?;
        let (model, file) = read_model(&self.model)?;
        read::expect_turn_on(&mut scenario.initial, &file, &self.model, context);
        let truth = self.truth.as_deref().map(read_model).transpose()?;
        // recordings are their own truth: what they had of a constant bias is taken from them
        if self.recordings.is_empty() {
            let made_by = truth.as_ref().map_or(&file, |(_, file)| file);
            let path = self.truth.as_ref().unwrap_or(&self.model);
            read::make_turn_on(&mut scenario.imu, made_by, path, context);
        }
        let analysed = scenario.run.method == Method::Lincov;
        let draws = |path: &Path, file: &ModelFile| {
            let found = analysed.then(|| draws_file::usable(path, &file.model, imu_hz))?;
            found.unwrap_or_else(|doubt| {
                let text = format!("{doubt}: no intervals from the calibration");
                context.warn(text);
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
            (_, paths) => (
                TrueImu::Recordings(read::recordings(paths, self.rate_hz, context)?),
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

    /// Every file that is read, with its hash.
    fn files(&self) -> Result<Vec<Input>, FileError> {
        let one =
            |role: &'static str, path: &Option<PathBuf>| path.clone().map(|path| (role, path));
        let mut named = vec![
            ("trajectory", self.trajectory.clone()),
            ("model", self.model.clone()),
        ];
        named.extend(one("truth", &self.truth));
        named.extend(
            input::listed(&self.recordings)?
                .into_iter()
                .map(|path| ("static", path)),
        );
        named.extend(
            [one("scenario", &self.scenario), one("gnss", &self.gnss)]
                .into_iter()
                .flatten(),
        );
        named
            .iter()
            .map(|(role, path)| input::input(role, path))
            .collect()
    }
}

impl RunRequest {
    /// As `nav-sim run` prints and writes it.
    ///
    /// # Errors
    /// What is wrong with a file or a setting, or that the run cannot be made.
    pub fn answer(
        &self,
        draw: impl FnOnce() -> u64,
        context: &Context<'_>,
    ) -> Result<Answered, Failure> {
        let answer = self.prepare(draw, context)?.navigate(context)?;
        Ok(Answered {
            files: contents(answer.files()),
            unmet: answer.unmet(),
            ..Answered::of(&answer)
        })
    }
}

impl PreparedRun {
    /// Navigates.
    ///
    /// # Errors
    /// What does not fit together, what the method cannot do, or a covariance that runs away.
    pub fn navigate(self, context: &Context<'_>) -> Result<RunAnswer, RunError> {
        let Self {
            mut manifest,
            inputs,
            scenario,
            outages,
            seed,
            require,
            model,
            settings,
        } = self;
        let found = navigate(&inputs, &scenario, &outages, seed, context);
        let mut navigation = found.map_err(|e| RunError::Navigate {
            model,
            settings,
            source: Box::new(e),
        })?;
        navigation.summary.require = require
            .iter()
            .map(|r| r.check(&navigation.summary))
            .collect();
        manifest.independent_windows = navigation
            .runs
            .as_ref()
            .and_then(|runs| runs.independent_windows);
        Ok(RunAnswer::new(
            navigation,
            manifest,
            TrajectorySeries::of(&inputs.trajectory),
        ))
    }
}
