//! The request of a tuning: the arguments of `nav-sim tune`.

use super::job::{Truths, TuneInputs, tune, tuned};
use super::result::TuneResult;
use crate::app::Answered;
use crate::app::Context;
use crate::app::Failure;
use crate::app::Input;
use crate::app::inputs as read;
use crate::app::inputs::{OutageFlag, no_filter};
use crate::formats::draws_file::{self, Draws};
use crate::formats::input;
use crate::formats::model_file::{self, ModelFile};
use crate::parse;
use crate::report::unexpected_line;
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{Aim, Track, TrueErrors, drive};
use nav_sim_signal::noise::Model;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A model, what may be true instead of it, and where.
#[derive(clap::Args, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TuneRequest {
    /// Noise model to be tuned
    pub model: PathBuf,
    /// Noise models that may make the errors, such as those of single recordings [default: MODEL, with the errors in SCENARIO]
    #[arg(long = "truth", value_name = "MODEL2", num_args = 1..)]
    #[serde(rename = "truth")]
    pub truths: Vec<PathBuf>,
    /// Truths are MODEL itself and the draws of its calibration (MODEL.draws.json, which `calibrate` writes), each with the
    /// parameters of a recording of its own where MODEL states a spread: errors count up to the upper end of their 95 % interval
    #[arg(long, conflicts_with = "truths")]
    pub intervals: bool,
    /// Trajectory: motion profile (.toml) or table (.csv) [default: a built-in drive with outages of that length]
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Window without fixes, in seconds (repeatable), or "none" (default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END")]
    #[serde(rename = "outage")]
    pub outages: Vec<OutageFlag>,
    /// Meaning of consistent: worst, no error of any truth exceeds what the filter states; mean, the NEES is right on average
    #[arg(long = "for", value_name = "AIM", value_parser = parse::one_of::<Aim>(&Aim::NAMES), default_value_t)]
    #[serde(rename = "for", with = "parse::text")]
    pub aim: Aim,
    /// Filter to tune: full, 15 or 21 (these take longer); the filter that `run` makes by default is assessed too
    #[arg(long, value_name = "STATES", default_value = "full")]
    pub filter: FilterStates,
    /// Scenario file: receiver, start, IMU rate (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Seed of random outages; that of the scenario without it.
    #[arg(skip)]
    pub seed: Option<u64>,
}

impl Default for TuneRequest {
    fn default() -> Self {
        Self {
            model: PathBuf::new(),
            truths: Vec::new(),
            intervals: false,
            trajectory: None,
            outages: Vec::new(),
            aim: Aim::default(),
            filter: FilterStates::Full,
            scenario: None,
            seed: None,
        }
    }
}

/// What helps where fixes are too rare to reduce a model.
const RARE_FIXES: &str =
    "raise it: the verdict is of the filter of 15 states too, whatever --filter tunes";

/// Longest schedule of outages that is looked at where no trajectory says how long (s).
const DAY_S: f64 = 86_400.0;

/// Factors, and the model with them.
pub(crate) struct Tuned {
    /// The factors, and what they do.
    pub result: TuneResult,
    /// The model; none where the filter is not consistent with them.
    pub model: Option<ModelFile>,
}

impl TuneRequest {
    /// The factors.
    pub(crate) fn tuned(&self, context: &Context<'_>) -> Result<Tuned, Failure> {
        let files = self.inputs()?;
        let mut scenario =
            crate::app::inputs::checked_scenario(self.scenario.as_deref(), &self.outages)?;
        if self.truths.is_empty() && !self.intervals && scenario.has_no_errors() {
            return Err(Failure::input("no truth to be consistent with: neither --truth nor --intervals is given")
                .hint("give models (--truth OTHER.toml, one a recording), --intervals for a MODEL of `nav-sim calibrate`, or a scenario with errors"));
        }
        let file = read::model(&self.model, context)?;
        let model = read::at_rate(&self.model, &file.model, scenario.imu.rate_hz, context)?;
        read::expect_turn_on(&mut scenario.initial, &file, &self.model, context);
        let truths = self.truths((&file, &model), &scenario, context)?;
        let (track, outages) = self.track(&scenario, &model, context)?;
        let result = tune(&TuneInputs {
            scenario: &scenario,
            model: &model,
            truths,
            track: &track,
            outages: &outages,
            states: self.filter,
            aim: self.aim,
        });
        let result =
            result.map_err(|e| no_filter(&e, &self.model, self.scenario.as_deref(), RARE_FIXES))?;
        let goal = format!(
            "{} of {}",
            self.aim,
            if self.intervals {
                "intervals"
            } else {
                "truths"
            }
        );
        let model = result
            .unmet()
            .is_none()
            .then(|| tuned(&file, &result.factors, &goal, &files));
        Ok(Tuned { result, model })
    }

    /// As `nav-sim tune` prints it; the tuned model is the file `tuned.toml`.
    ///
    /// # Errors
    /// What is wrong with a file or a setting.
    pub fn answer(&self, context: &Context<'_>) -> Result<Answered, Failure> {
        let tuned = self.tuned(context)?;
        let model = tuned
            .model
            .as_ref()
            .map(|model| ("tuned.toml".to_owned(), model_file::to_toml(model)));
        Ok(Answered {
            files: model.into_iter().collect(),
            unmet: self.failure(&tuned.result),
            ..Answered::of(&tuned.result)
        })
    }

    /// That no factors make the filter consistent, where none do.
    pub(crate) fn failure(&self, result: &TuneResult) -> Option<Failure> {
        let message = format!(
            "{}: {}; no tuned model is written",
            self.model.display(),
            result.unmet()?
        );
        Some(Failure::bound(message).hint(result.remedy()))
    }

    /// A directory or a table holds samples: a truth is a model.
    fn refuse_recordings(&self) -> Result<(), Failure> {
        let is_samples = |p: &&PathBuf| {
            p.is_dir()
                || p.extension()
                    .is_some_and(|e| e == "csv" || e == "npy" || e == "gz")
        };
        match self.truths.iter().find(is_samples) {
            None => Ok(()),
            Some(path) => Err(Failure::input(format!(
                "--truth {}: recordings, not a model",
                path.display()
            ))
            .hint("make a model of each: nav-sim calibrate FILE --estimator gmwm -o FILE.toml")),
        }
    }

    /// The files that are read.
    pub(crate) fn inputs(&self) -> Result<Vec<Input>, Failure> {
        self.refuse_recordings()?;
        let draws = draws_file::beside(&self.model);
        let mut named = vec![("model", &self.model)];
        named.extend((self.intervals && draws.exists()).then_some(("draws", &draws)));
        named.extend(self.truths.iter().map(|p| ("truth", p)));
        named.extend(self.trajectory.iter().map(|p| ("trajectory", p)));
        named.extend(self.scenario.iter().map(|p| ("scenario", p)));
        named
            .iter()
            .map(|(role, path)| Ok(input::input(role, path)?))
            .collect()
    }

    /// What may be true, at the rate of the IMU: noise, turn-on bias, and what the scenario states of the true IMU and
    /// receiver.
    fn truths(
        &self,
        (file, model): (&ModelFile, &Model),
        scenario: &Scenario,
        context: &Context<'_>,
    ) -> Result<Truths, Failure> {
        let true_errors = |path: &Path, model: Model, turned_on: &ModelFile| {
            let (mut imu, gnss) = (scenario.imu.clone(), scenario.gnss.clone());
            read::make_turn_on(&mut imu, turned_on, path, context);
            TrueErrors {
                model,
                imu,
                gnss,
                aiding: scenario.aiding.clone(),
            }
        };
        let truths = if self.intervals {
            let draws = draws(
                &self.model,
                file,
                scenario.imu.rate_hz,
                self.seed.unwrap_or(1),
            )?;
            let estimate = true_errors(&self.model, model.clone(), file);
            let names = vec![format!(
                "{} and the {} draws beside it",
                self.model.display(),
                draws.models.len()
            )];
            let drawn = draws.models.into_iter().map(|model| TrueErrors {
                model,
                ..estimate.clone()
            });
            let errors = std::iter::once(estimate.clone()).chain(drawn).collect();
            Truths {
                names,
                errors,
                stretch: Some(draws.stretch),
            }
        } else {
            let truth = |path: &PathBuf| {
                let file = read::model(path, context)?;
                let model = read::at_rate(path, &file.model, scenario.imu.rate_hz, context)?;
                Ok::<_, Failure>((path.display().to_string(), true_errors(path, model, &file)))
            };
            // Without another, MODEL with what the scenario says is wrong beside it.
            let own = std::slice::from_ref(&self.model);
            let paths = if self.truths.is_empty() {
                own
            } else {
                &self.truths
            };
            let named = paths.iter().map(truth).collect::<Result<Vec<_>, _>>()?;
            let (names, errors) = named.into_iter().unzip();
            Truths {
                names,
                errors,
                stretch: None,
            }
        };
        let mut doubts = Vec::new();
        for truth in &truths.errors {
            for doubt in (Scenario {
                imu: truth.imu.clone(),
                ..scenario.clone()
            })
            .unexpected()
            {
                if !doubts.contains(&doubt) {
                    doubts.push(doubt);
                }
            }
        }
        doubts
            .into_iter()
            .for_each(|doubt| context.warn(unexpected_line(&doubt)));
        Ok(truths)
    }

    /// The way of the analysis with its outages.
    fn track(
        &self,
        scenario: &Scenario,
        model: &Model,
        context: &Context<'_>,
    ) -> Result<(Track, Vec<Outage>), Failure> {
        let seed = self.seed.or(scenario.run.seed).unwrap_or(0);
        let Some(path) = &self.trajectory else {
            if !scenario.aiding.is_none()
                || scenario.baro.is_some()
                || scenario.imu.temperature.is_some()
            {
                return Err(Failure::input(
                    "aiding, a barometer and a temperature profile belong to a trajectory",
                )
                .hint("give it with --trajectory"));
            }
            let outages = scenario.outages_on((0.0, DAY_S), seed)?.windows;
            let lengths: Vec<f64> = outages.iter().map(|o| o.end_s - o.start_s).collect();
            let track = drive(model, &scenario.imu, &scenario.gnss, &lengths).ok_or_else(|| {
                Failure::input("no built-in drive for this receiver")
                    .hint("give a trajectory with --trajectory")
            })?;
            let text = "along a built-in drive with outages as long; --trajectory takes another";
            context.remark(text.to_owned());
            return Ok((track, outages));
        };
        let trajectory = read::trajectory(path, context)?;
        let outages = read::placed(scenario, &trajectory, seed, context)?;
        let track = scenario
            .track(&trajectory, model, &outages)
            .map_err(Failure::input)?;
        Ok((track, outages))
    }
}

/// The draws beside a model file; what the intervals in the file itself leave out is how its parameters hang together.
fn draws(path: &Path, file: &ModelFile, rate_hz: f64, seed: u64) -> Result<Draws, Failure> {
    let missing = || {
        format!(
            "{}: the draws of its calibration are missing",
            draws_file::beside(path).display()
        )
    };
    let found = draws_file::of_recordings(path, file, rate_hz, seed)
        .and_then(|draws| draws.ok_or_else(missing));
    found.map_err(|doubt| {
        Failure::input(doubt)
            .hint("calibrate again: the draws are written beside MODEL, unless with --bootstrap 0")
    })
}
