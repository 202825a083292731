//! The request of a calibration: the arguments of `nav-sim calibrate`.

use super::curve::{Curves, read_curves};
use super::{CalibrationNote, CalibrationOptions, EstimatorChoice, Measured, ModelFiles, measure};
use crate::app::Answered;
use crate::app::Context;
use crate::app::Failure;
use crate::formats::input;
use crate::jobs::{JobError, RecordingRequest, VarianceRequest, unknown_model};
use crate::parse;
use nav_sim_calibration::{
    Advance, Bootstrap, Estimator, ModelChoice, ModelSpec, Pool, Settings, Trim, Weighting,
    diagnose,
};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::wavelet::Convention;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Recordings or a curve, and how a model is fitted to them.
#[derive(clap::Args, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CalibrationRequest {
    /// Recordings, or directories of recordings
    #[arg(
        value_name = "INPUT",
        required_unless_present = "curve",
        conflicts_with = "curve"
    )]
    pub inputs: Vec<PathBuf>,
    /// Fit a curve instead of recordings: CSV tau_samples,wv,edof, or a .wv.json of calibrate or wv
    #[arg(long, value_name = "FILE", conflicts_with_all = OF_RECORDINGS)]
    pub curve: Option<PathBuf>,
    /// Which curve is fitted: an average over the replicates (awv; sr-awv, robust to outliers; dr-awv, robust to
    /// abnormal replicates too), or the curve of a single recording (gmwm, rgmwm; avlr: slopes of its Allan deviation)
    #[arg(long, value_parser = parse::words::<EstimatorChoice>(&ESTIMATORS), default_value_t)]
    #[serde(with = "parse::text")]
    pub estimator: EstimatorChoice,
    /// Sum of WN QN AR1 GM MA1 FN RW DR such as 2*AR1+RW+WN+QN, N1 = AR1+RW+WN, N2 = 2*AR1+RW+WN+QN, or auto: the
    /// simplest sum of WN QN RW DR and up to two AR1 that fits as well as the best one, with the reasons
    #[arg(long, value_name = "SUM", default_value = ModelSpec::USUAL)]
    pub model: String,
    /// Replicates that dr-awv drops at each end of each scale: a number, or a percentage of all
    #[arg(long, value_name = "A", default_value_t)]
    #[serde(with = "parse::text")]
    pub trim: Trim,
    /// Weight of a scale in the fit
    #[arg(long, value_parser = parse::words::<Weighting>(&WEIGHTINGS), default_value_t)]
    pub weighting: Weighting,
    /// Which signals are replicates of one another (default: sensor; axes for gmwm, rgmwm and avlr)
    #[arg(long, value_parser = parse::words::<Pool>(&POOLS))]
    pub pool: Option<Pool>,
    /// Draws behind intervals and goodness of fit (0: neither), fewer for tests
    #[arg(long, value_name = "B", hide = true, default_value_t = Bootstrap::DRAWS as u32, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    pub bootstrap: u32,
    /// How they are read.
    #[command(flatten)]
    pub recordings: RecordingRequest,
    /// Scales and robustness.
    #[command(flatten)]
    pub tuning: VarianceRequest,
    /// Seed of the draws.
    #[arg(skip)]
    pub seed: u64,
}

impl Default for CalibrationRequest {
    fn default() -> Self {
        Self {
            inputs: Vec::new(),
            curve: None,
            estimator: EstimatorChoice::default(),
            model: ModelSpec::USUAL.to_owned(),
            trim: Trim::default(),
            weighting: Weighting::default(),
            pool: None,
            bootstrap: Bootstrap::DRAWS as u32,
            recordings: RecordingRequest::default(),
            tuning: VarianceRequest::default(),
            seed: 0,
        }
    }
}

/// Flags about recordings and their averages, which a curve has behind it.
const OF_RECORDINGS: [&str; 6] = ["estimator", "trim", "pool", "skip_s", "gaps", "efficiency"];

/// Those of several recordings first, then those of one.
pub(crate) const ESTIMATORS: [(&str, &str); 7] = [
    (
        Estimator::Awv.name(),
        "Average of the classical wavelet variances",
    ),
    (
        Estimator::SrAwv.name(),
        "Average of the robust wavelet variances",
    ),
    (
        Estimator::DrAwv.name(),
        "Trimmed average of the robust wavelet variances",
    ),
    (
        Estimator::Gmwm.name(),
        "Classical wavelet variance of one recording",
    ),
    (
        Estimator::Rgmwm.name(),
        "Robust wavelet variance of one recording",
    ),
    (
        Estimator::Avlr.name(),
        "Slopes of the Allan deviation of one recording, read off one by one: WN, QN, RW, DR",
    ),
    (
        "all",
        "The three averages (of one recording: gmwm and rgmwm)",
    ),
];

const WEIGHTINGS: [(&str, &str); 2] = [
    (
        Weighting::Model.name(),
        "Inverse variance by the fitted model; a scale far above it weighs less",
    ),
    (
        Weighting::Edof.name(),
        "The same with the observed wv: the convention of the literature, low where wv is low by chance",
    ),
];

const POOLS: [(&str, &str); 2] = [
    (Pool::Axes.name(), "Those of one axis: one model per axis"),
    (
        Pool::Sensor.name(),
        "Those of all axes of a sensor: one model per sensor",
    ),
];

impl CalibrationRequest {
    /// How models are fitted, checked before any file is read.
    pub(crate) fn settings(&self) -> Result<Settings, Failure> {
        Ok(Settings {
            model: self.structure()?,
            trim: self.trim,
            tuning: self.tuning.tuning()?,
            weighting: self.weighting,
            fit_range: self.tuning.fitted(),
            ..Settings::default()
        })
    }

    /// The recordings, read and measured.
    pub(crate) fn measure(
        &self,
        settings: Settings,
        context: &Context<'_>,
    ) -> Result<Measured, Failure> {
        let options = CalibrationOptions {
            reading: self.recordings.options(),
            skip_warm_up: self.recordings.reading.skips_warm_up(),
            scales: self.tuning.levels(),
            estimators: self.estimator,
            pool: self.pool,
            settings,
            bootstrap: self.draws(),
            turn_on: true,
        };
        Ok(measure(&self.inputs, &options, context)?)
    }

    /// The curves in the place of recordings, and whether they do not say of which sensor: then as of an accelerometer.
    pub(crate) fn curves(
        &self,
        path: &Path,
        settings: &Settings,
    ) -> Result<(Curves, bool), Failure> {
        let curves_of =
            |sensor| read_curves(path, self.recordings.reading.rate_hz, sensor, settings);
        match curves_of(self.recordings.sensor()) {
            Err(JobError::NoSensor { .. }) => Ok((curves_of(Some(Sensor::Accel))?, true)),
            read => Ok((read?, false)),
        }
    }

    /// The draws behind intervals.
    pub(crate) fn draws(&self) -> Option<Bootstrap> {
        (self.bootstrap > 0).then_some(Bootstrap {
            draws: self.bootstrap as usize,
            seed: self.seed,
        })
    }

    /// What is recorded of a calibration of these files.
    pub(crate) fn note(
        &self,
        files: &[PathBuf],
        settings: &Settings,
    ) -> Result<CalibrationNote, Failure> {
        let role = if self.curve.is_some() {
            "curve"
        } else {
            "recording"
        };
        Ok(CalibrationNote {
            efficiency_convention: Convention::Exact,
            reading: self.reading(settings),
            seed: self.draws().map(|draws| draws.seed),
            inputs: files
                .iter()
                .map(|path| input::input(role, path))
                .collect::<Result<_, _>>()?,
        })
    }

    /// As `nav-sim calibrate` prints it; its files are those of `model.toml`.
    ///
    /// # Errors
    /// What is wrong with a file or a setting, or that there is no fit.
    pub fn answer(&self, context: &Context<'_>, advance: Advance<'_>) -> Result<Answered, Failure> {
        let settings = self.settings()?;
        let (calibration, files) = match &self.curve {
            Some(path) => (
                self.curves(path, &settings)?.0.calibrate(self.draws())?,
                vec![path.clone()],
            ),
            None => {
                let measured = self.measure(settings, context)?;
                let files = measured
                    .report
                    .files
                    .iter()
                    .map(|f| f.path.clone())
                    .collect();
                (measured.calibrate(advance)?, files)
            }
        };
        let note = self.note(&files, &calibration.settings)?;
        let diagnoses = diagnose(
            &calibration.groups,
            &calibration.outcomes,
            &calibration.settings,
        );
        let made = ModelFiles::of(Path::new("model.toml"), &calibration.settings.estimators);
        let files = made
            .iter()
            .flat_map(|files| files.texts(&calibration, &note, None));
        let files = files
            .map(|(path, text)| (path.display().to_string(), text))
            .collect();
        Ok(Answered {
            files,
            ..Answered::of(&calibration.answer(&diagnoses, Vec::new()))
        })
    }

    /// How the recordings were read and grouped; of a curve nothing is known.
    fn reading(&self, settings: &Settings) -> toml::Table {
        if self.curve.is_some() {
            return toml::Table::new();
        }
        let mut table = self.recordings.provenance();
        table.insert(
            "pool".to_owned(),
            self.pool.unwrap_or(settings.pool()).name().into(),
        );
        if let Some(scales) = self.tuning.levels() {
            table.insert("scales".to_owned(), i64::from(scales).into());
        }
        table
    }

    fn structure(&self) -> Result<ModelChoice, Failure> {
        let chosen: ModelChoice = self.model.parse().map_err(unknown_model)?;
        if self.estimator == EstimatorChoice::One(Estimator::Avlr) && self.tuning.fitted().is_some()
        {
            let message =
                "--scales FROM:TO with --estimator avlr: slopes are read where they are found";
            return Err(
                Failure::input(message).hint("--estimator gmwm fits the same curve over a range")
            );
        }
        if self.estimator != EstimatorChoice::One(Estimator::Avlr) {
            return Ok(chosen);
        }
        let without = match &chosen {
            ModelChoice::Given(spec) => spec
                .kinds()
                .iter()
                .find(|k| k.shape().is_some())
                .map(|k| k.code()),
            ModelChoice::Auto => Some("the AR1 of auto"),
        };
        match without {
            None => Ok(chosen),
            Some(name) => {
                let message = format!(
                    "--estimator avlr: {name} has no slope of its own in the Allan deviation"
                );
                Err(Failure::input(message)
                .hint("--model WN+RW, a sum of WN, RW and DR (and QN where the curve begins with its slope); or --estimator gmwm"))
            }
        }
    }
}
