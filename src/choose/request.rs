//! The request of a choice: the arguments of `nav-sim choose`.

use super::document::ChoiceReport;
use super::job::{ChoiceDrive, Chosen, choose};
use super::{Candidate, Inflation};
use crate::app::Answered;
use crate::app::Context;
use crate::app::Failure;
use crate::app::inputs::{self as read, OutageFlag};
use crate::calibrate::{CalibrationNote, CalibrationOptions, ESTIMATORS};
use crate::formats::recordings::Gaps;
use crate::jobs::{ReadingRequest, WHOLE, unknown_model};
use crate::parse;
use nav_sim_calibration::{Bootstrap, Estimator, ModelChoice, Settings, Trim};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_signal::wavelet::Convention;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Recordings, candidates, and the drive that judges them.
#[derive(clap::Args, Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChoiceRequest {
    /// Static recordings, three or more files, or directories of them
    #[arg(required = true, value_name = "RECORDINGS")]
    pub inputs: Vec<PathBuf>,
    /// Trajectory: motion profile (.toml) or table (.csv)
    #[arg(long, value_name = "FILE")]
    pub trajectory: PathBuf,
    /// Window without fixes, in seconds (repeatable) (default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END")]
    #[serde(rename = "outage")]
    pub outages: Vec<OutageFlag>,
    /// Estimators to compare [default: awv, sr-awv, dr-awv and, for comparison, gmwm and avlr of single recordings]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = parse::words::<Estimator>(EACH))]
    pub estimator: Vec<Estimator>,
    /// Models to compare, such as N2,N1,WN+RW,auto [default: N2, and WN+RW with awv]
    #[arg(long, value_name = "MODELS", value_delimiter = ',')]
    pub model: Vec<String>,
    /// Filters to compare: 15, 21, full [default: 15, and full with awv]
    #[arg(long, value_name = "STATES", value_delimiter = ',')]
    pub filter: Vec<FilterStates>,
    /// How models are inflated: none, tuned (consistent in the mean for the models of the single recordings), x10 (ten
    /// times the standard deviations) [default: none, and all three with awv]
    #[arg(long, value_name = "HOW", value_delimiter = ',')]
    pub inflate: Vec<Inflation>,
    /// Runs on each recording (default: two for each window that fits side by side, 16 to 64)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub runs: Option<u64>,
    /// What DR-AWV drops at each end of each scale: a number, or a share such as 30%
    #[arg(long, value_name = "A", default_value_t)]
    #[serde(with = "parse::text")]
    pub trim: Trim,
    /// Scenario file: receiver, start, what filters expect (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// What to do where the time jumps or stands still
    #[arg(long, value_parser = parse::words::<Gaps>(WHOLE), default_value_t)]
    #[serde(with = "parse::text")]
    pub gaps: Gaps,
    /// How recordings are read.
    #[command(flatten)]
    pub recordings: ReadingRequest,
    /// Seed of all random numbers; that of the scenario without it, or one that is drawn.
    #[arg(skip)]
    pub seed: Option<u64>,
}

/// The estimators that are one.
const EACH: &[(&str, &str)] = ESTIMATORS.split_at(6).0;

/// What was chosen, and where.
pub(crate) struct ChoiceMade {
    pub chosen: Chosen,
    outages: Vec<Outage>,
    trajectory: String,
    seed: u64,
}

impl ChoiceMade {
    pub(crate) fn report(&self) -> ChoiceReport<'_> {
        ChoiceReport {
            ranking: &self.chosen.ranking,
            abnormal: &self.chosen.abnormal,
            outages: &self.outages,
            trajectory: &self.trajectory,
            seed: self.seed,
        }
    }
}

impl ChoiceRequest {
    /// What the recordings say. `draw` is asked for a seed where neither the request nor the scenario has one.
    pub(crate) fn made(
        &self,
        draw: impl FnOnce() -> u64,
        context: &Context<'_>,
    ) -> Result<ChoiceMade, Failure> {
        let candidates = self.candidates()?;
        let scenario =
            crate::app::inputs::checked_scenario(self.scenario.as_deref(), &self.outages)?;
        let trajectory = read::trajectory(&self.trajectory, context)?;
        let seed = self.seed.or(scenario.run.seed).unwrap_or_else(draw);
        let outages = read::placed(&scenario, &trajectory, seed, context)?;
        if outages.is_empty() {
            return Err(Failure::input(
                "there is no outage, and candidates are judged at the ends of outages",
            )
            .hint("give one with --outage START:END"));
        }
        let options = CalibrationOptions {
            reading: self.recordings.options(self.gaps),
            skip_warm_up: self.recordings.skips_warm_up(),
            settings: Settings {
                trim: self.trim,
                ..Settings::default()
            },
            bootstrap: Some(Bootstrap {
                seed,
                ..Bootstrap::default()
            }),
            turn_on: false,
            ..CalibrationOptions::default()
        };
        let drive = ChoiceDrive {
            trajectory,
            scenario,
            outages: outages.clone(),
            seed,
            runs: self.runs,
        };
        let chosen = choose(&self.inputs, &options, &candidates, drive, context)?;
        Ok(ChoiceMade {
            chosen,
            outages,
            trajectory: self.trajectory.display().to_string(),
            seed,
        })
    }

    /// As `nav-sim choose` prints it; the winner is the file `model.toml`.
    ///
    /// # Errors
    /// What is wrong with a file or a setting, or that there is nothing to choose by.
    pub fn answer(
        &self,
        draw: impl FnOnce() -> u64,
        context: &Context<'_>,
    ) -> Result<Answered, Failure> {
        let made = self.made(draw, context)?;
        let files = made.chosen.model_files("model.toml".as_ref());
        let texts = made
            .chosen
            .texts(&files, &self.trajectory, self.note(&made))?;
        let files = texts
            .into_iter()
            .map(|(path, text)| (path.display().to_string(), text))
            .collect();
        Ok(Answered {
            files,
            ..Answered::of(&made.report())
        })
    }

    /// What is recorded of the winner's calibration.
    pub(crate) fn note(&self, made: &ChoiceMade) -> CalibrationNote {
        CalibrationNote {
            efficiency_convention: Convention::Exact,
            reading: self.recordings.provenance(self.gaps),
            seed: Some(made.seed),
            inputs: Vec::new(),
        }
    }

    /// Those that are usual, or all combinations of what is given.
    pub(crate) fn candidates(&self) -> Result<Vec<Candidate>, Failure> {
        let Self {
            estimator,
            model,
            filter,
            inflate,
            ..
        } = self;
        if estimator.is_empty() && model.is_empty() && filter.is_empty() && inflate.is_empty() {
            return Ok(Candidate::usual());
        }
        let mut models = model
            .iter()
            .map(|m| m.parse().map_err(unknown_model))
            .collect::<Result<Vec<ModelChoice>, Failure>>()?;
        if models.is_empty() {
            models.push(ModelChoice::default());
        }
        let averages = [Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv];
        let candidates = Candidate::product(
            if estimator.is_empty() {
                &averages
            } else {
                estimator
            },
            &models,
            if filter.is_empty() {
                &[FilterStates::Reduced15]
            } else {
                filter
            },
            if inflate.is_empty() {
                &[Inflation::None]
            } else {
                inflate
            },
        );
        if candidates.iter().any(Candidate::is_eligible) {
            return Ok(candidates);
        }
        Err(Failure::input(
            "no candidate uses all recordings: gmwm, rgmwm and avlr take one at a time",
        )
        .hint("add awv, sr-awv or dr-awv to --estimator"))
    }
}
