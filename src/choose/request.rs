//! `nav-sim choose`: the noise model for a filter, by the recordings themselves.

use super::document::ChoiceReport;
use super::job::{ChoiceDrive, Chosen, choose};
use super::{Candidate, Inflation};
use crate::app::inputs::{self, SettingsArgs, files, listed};
use crate::app::reading::{ReadingRequest, WHOLE, unknown_model};
use crate::app::{Answer, Command, Context, Failure, Out, OutputFile, Result};
use crate::calibrate::{Calibration, CalibrationNote, CalibrationOptions, ESTIMATORS};
use crate::formats::recordings::Gaps;
use crate::parse;
use crate::report::json;
use nav_sim_calibration::{Bootstrap, Estimator, ModelChoice, Settings, Trim, diagnose};
use nav_sim_document::Document;
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_signal::wavelet::Convention;
use serde::Serialize;
use std::path::PathBuf;

/// Choose the noise model for a filter by navigating on recordings left out of its calibration
///
/// Leaves out one recording at a time, calibrates every candidate on the others and navigates along TRAJECTORY with
/// windows of the one left out; abnormal recordings are not left out, and judge nothing. Ranks the candidates by the mean log density of the true errors at the ends of outages
/// under the filter's covariance, which rewards accuracy and consistency together. Also prints RMSE, NEES and coverage,
/// with intervals over recordings. Writes report.html, ranking.json and model.toml, the winner calibrated on all
/// recordings.
#[derive(clap::Args, Debug, Clone)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml --replicates 4 --samples 16384 -o recordings
  nav-sim choose recordings --trajectory trajectories/figure_eight.toml --outage 60:90 \\
      --estimator awv,dr-awv --inflate none,x10
  nav-sim choose recordings --trajectory trajectories/figure_eight.toml --outage 60:90 \\
      --estimator awv --model N1,WN+RW --filter 15,full -o out/models --format json")]
pub struct Choose {
    /// Static recordings, three or more files, or directories of them
    #[arg(required = true, value_name = "RECORDINGS")]
    pub inputs: Vec<PathBuf>,
    /// Trajectory: motion profile (.toml) or table (.csv)
    #[arg(long, value_name = "FILE")]
    pub trajectory: PathBuf,
    /// Outages, receiver, start, what filters expect.
    #[command(flatten)]
    pub settings: SettingsArgs,
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
    pub trim: Trim,
    /// What to do where the time jumps or stands still
    #[arg(long, value_parser = parse::words::<Gaps>(WHOLE), default_value_t)]
    pub gaps: Gaps,
    /// How recordings are read.
    #[command(flatten)]
    pub recordings: ReadingRequest,
}

/// The estimators that are one.
const EACH: &[(&str, &str)] = ESTIMATORS.split_at(6).0;

/// What was chosen, and where.
pub struct ChoiceMade {
    chosen: Chosen,
    note: CalibrationNote,
    outages: Vec<Outage>,
    trajectory: String,
    seed: u64,
}

impl ChoiceMade {
    fn report(&self) -> ChoiceReport<'_> {
        ChoiceReport {
            ranking: &self.chosen.ranking,
            abnormal: &self.chosen.abnormal,
            outages: &self.outages,
            trajectory: &self.trajectory,
            seed: self.seed,
        }
    }
}

impl Serialize for ChoiceMade {
    fn serialize<S: serde::Serializer>(
        &self,
        serializer: S,
    ) -> std::result::Result<S::Ok, S::Error> {
        self.report().serialize(serializer)
    }
}

impl Answer for ChoiceMade {
    fn document(&self) -> Document {
        self.report().document()
    }

    /// The winner's model with its curves and draws, and the ranking.
    fn files(&self) -> Vec<OutputFile<'_>> {
        let Chosen {
            winner,
            calibration,
            model,
            ..
        } = &self.chosen;
        let Calibration {
            groups,
            outcomes,
            settings,
            ..
        } = calibration;
        let diagnoses = diagnose(groups, outcomes, settings);
        let names = ("model.toml".to_owned(), "model".to_owned());
        let how = winner.inflation;
        let inflated = (how != Inflation::None).then(|| (model, how.name()));
        let made = (&self.note, diagnoses.as_slice());
        let mut files = calibration.files_of(winner.estimator, names, made, inflated);
        files.push(OutputFile::whole("ranking.json", json(self)));
        files
    }
}

impl Command for Choose {
    type Answer = ChoiceMade;
    const NAME: &'static str = "choose";
    const OUT: Out = Out::Directory {
        path: "out/choice",
        files: &[
            "model.toml",
            "model.wv.json",
            "model.html",
            "model.svg",
            "model.draws.json",
            "ranking.json",
        ],
    };

    fn inputs(&self) -> Result<Vec<(&'static str, PathBuf)>> {
        self.candidates()?;
        let trajectory = files("trajectory", [&self.trajectory]);
        let scenario = files("scenario", &self.settings.file.scenario);
        let recordings = listed("recording", &self.inputs)?;
        Ok(trajectory.chain(recordings).chain(scenario).collect())
    }

    fn run(&self, context: &Context<'_>) -> Result<ChoiceMade> {
        let candidates = self.candidates()?;
        let scenario = self.settings.checked()?;
        let trajectory = inputs::trajectory(&self.trajectory, context)?;
        let seed = context.seed_or(scenario.run.seed);
        let outages = inputs::placed(&scenario, &trajectory, seed, context)?;
        if outages.is_empty() {
            let message = "there is no outage, and candidates are judged at the ends of outages";
            return Err(Failure::input(message).hint("give one with --outage START:END"));
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
        let note = CalibrationNote {
            efficiency_convention: Convention::Exact,
            reading: self.recordings.provenance(self.gaps),
            seed: Some(seed),
            inputs: context.inputs().to_vec(),
        };
        Ok(ChoiceMade {
            chosen,
            note,
            outages,
            trajectory: self.trajectory.display().to_string(),
            seed,
        })
    }
}

impl Choose {
    /// Those that are usual, or all combinations of what is given.
    fn candidates(&self) -> Result<Vec<Candidate>> {
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
            .collect::<Result<Vec<ModelChoice>>>()?;
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
