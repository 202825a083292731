//! Calibration: from recordings, or directories of them, to noise models, their files and their document.
//!
//! [`Calibrate`] goes from a directory of recordings to models. From signals in memory:
//! ```
//! use nav_sim::calibration::{ModelChoice, Pool, CalibrationSettings, calibrate, grouped, replicates};
//! use nav_sim::signal::imu::Channel;
//! use nav_sim::signal::noise::{Composite, Model, Process, VirtualImu};
//!
//! let white = Composite::new(vec![Process::white(4e-6)?]);
//! let model = Model::pooled(100.0, &white, &white);
//! let imu = VirtualImu { model: &model, spread: None, contamination: None, seed: 1 };
//! let settings = CalibrationSettings { model: ModelChoice::Given("WN".parse()?), rate_hz: 100.0, ..CalibrationSettings::default() };
//! let mut signals = Vec::new();
//! for replicate in 1..=5 {
//!     signals.extend(replicates(&imu.recording(replicate, &Channel::ALL, 4096)?, None, &settings.tuning)?);
//! }
//! let outcomes = calibrate(&grouped(signals, Pool::Sensor), &settings)?;
//! let sigma2 = outcomes[0].fit.composite.processes[0].values()[0];
//! // The variance of 15 × 4096 samples at an efficiency near 0.6 is known to 0.8 %.
//! assert!((sigma2 / 4e-6 - 1.0).abs() < 0.05);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod document;
mod measure;

pub(crate) use document::{CalibrationNote, figure_of, is_abnormal, recordings_line};
pub use measure::{Calibration, EstimatorChoice};
pub(crate) use measure::{MeasuredRecordings, measure, visit};

use crate::app::reading::{RecordingRequest, VarianceRequest, unknown_model};
use crate::app::{Answer, Command, Context, OutputFile, OutputKind, Result, refused};
use crate::commands::wv;
use crate::io::draws_file::DrawsFile;
use crate::io::input;
use crate::io::model_file::ModelFile;
use crate::parse;
use crate::report;
use crate::report::curves::SignalCurves;
use measure::{Curves, calibrate_curves, read_curves};
use nav_sim_calibration::{
    Bootstrap, CalibrationSettings, Estimator, ModelChoice, ModelSpec, Pool, Replicate, Trim,
    Weighting, calibrate_with_progress, grouped,
};
use nav_sim_document::Document;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::Model;
use serde::Serialize;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

// `nav-sim calibrate`: replicate static recordings → noise model.

/// Fit a noise model to static recordings
///
/// Each recording is one replicate. By default the three axes of a sensor are pooled: there is one model per
/// sensor, and the signals of its axes are replicates of one another. The model goes to a TOML file. Beside it,
/// <model>.wv.json holds the curves, <model>.draws.json the draws behind the intervals, <model>.html a page and
/// <model>.svg its figures. With `--estimator all` there is such a set for each estimator, <model>_<estimator>.toml and so on.
#[derive(clap::Args, Debug, Clone)]
pub struct Calibrate {
    /// Recordings, or directories of recordings
    #[arg(
        id = "recording",
        value_name = "INPUT",
        required_unless_present = "curve",
        conflicts_with = "curve"
    )]
    inputs: Vec<PathBuf>,
    /// Fit a curve instead of recordings: CSV tau_samples,wv,edof, or a .wv.json of calibrate or wv
    #[arg(long, value_name = "FILE", conflicts_with_all = OF_RECORDINGS)]
    curve: Option<PathBuf>,
    /// Average over replicates: awv; sr-awv, robust to outliers; dr-awv, also to abnormal replicates. Single
    /// recordings: gmwm; rgmwm, robust; avlr, slopes of the Allan deviation. all: the averages
    #[arg(long, value_name = "NAME", hide_possible_values = true, value_parser = parse::one_of::<EstimatorChoice>(&ESTIMATORS), default_value = "dr-awv")]
    estimator: EstimatorChoice,
    /// Sum of WN QN AR1 GM MA1 FN RW DR; N1 = AR1+RW+WN, N2 = 2*AR1+RW+WN+QN; or auto: the simplest sum that fits
    /// as well as the best one
    #[arg(long, value_name = "SUM", default_value = ModelSpec::USUAL)]
    model: String,
    /// Replicates that dr-awv drops at each end of each scale: a number, or a percentage of all
    #[arg(long, value_name = "A", default_value_t)]
    trim: Trim,
    /// Weight of a scale: model, the inverse variance by the fitted model; edof, by the observed curve (as in the
    /// literature)
    #[arg(long, value_name = "NAME", hide_possible_values = true, hide_short_help = true, value_parser = parse::one_of::<Weighting>(&Weighting::NAMES), default_value_t)]
    weighting: Weighting,
    /// Replicates of one model: axes, the signals of an axis; sensor, those of all its axes [default: sensor; axes
    /// for gmwm, rgmwm, avlr]
    #[arg(long, value_name = "NAME", hide_possible_values = true, value_parser = parse::one_of::<Pool>(&Pool::NAMES))]
    pool: Option<Pool>,
    /// Draws behind intervals and goodness of fit (0: neither), fewer for tests
    #[arg(long, value_name = "B", hide = true, default_value_t = Bootstrap::DRAWS as u32, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    bootstrap: u32,
    /// Options for reading them.
    #[command(flatten)]
    pub recordings: RecordingRequest,
    /// Scales and robustness.
    #[command(flatten)]
    tuning: VarianceRequest,
}

/// Flags about recordings and their averages, which a curve has behind it.
const OF_RECORDINGS: [&str; 9] = [
    "estimator",
    "trim",
    "pool",
    "skip_s",
    "gaps",
    "efficiency",
    "columns",
    "topic",
    "stamp",
];

/// Names of the estimators, those of several recordings first.
pub(crate) const ESTIMATORS: [&str; 7] =
    ["awv", "sr-awv", "dr-awv", "gmwm", "rgmwm", "avlr", "all"];

impl Command for Calibrate {
    type Answer = Calibration;
    const NAME: &'static str = "calibrate";
    const OUT: OutputKind = OutputKind::File {
        name: "model.toml",
        help: "Model file (default: model.toml; none for --curve)",
    };
    const PLOT: bool = false;

    fn writes_by_default(&self) -> bool {
        self.curve.is_none()
    }

    fn endings(&self) -> Vec<Cow<'static, str>> {
        let estimators = self.estimator.possible();
        let names = estimators
            .iter()
            .flat_map(|e| names(&stem_of(*e, &estimators)));
        names.map(Cow::Owned).collect()
    }

    /// A model has a sensor; what is only printed needs one for its units alone.
    fn check_out(&self) -> Result<()> {
        let Some(path) = &self.curve else {
            return Ok(());
        };
        let (.., is_sensor_assumed) = self.curves(path, &self.settings()?)?;
        if is_sensor_assumed {
            refused(
                format!("{}: the curve names no sensor", path.display()),
                "--axes accel or --axes gyro",
            )
        } else {
            Ok(())
        }
    }

    fn run(&self, context: &Context<'_>) -> Result<Calibration> {
        let settings = self.settings()?;
        let mut calibration = match &self.curve {
            Some(path) => {
                let (curves, settings, is_sensor_assumed) = self.curves(path, &settings)?;
                if is_sensor_assumed {
                    context.remark(format!(
                        "{}: taken as an accelerometer (--axes gyro: gyroscope)",
                        path.display()
                    ));
                }
                calibrate_curves(curves, settings, self.draws(context))?
            }
            None => {
                let (reading, scales) = (self.recordings.options(), self.tuning.levels());
                let estimators = self.estimator;
                let MeasuredRecordings {
                    replicates,
                    warm_ups,
                    settings,
                    ..
                } = measure(
                    &self.inputs,
                    reading,
                    scales,
                    estimators,
                    &settings,
                    context,
                )?;
                if self.pool == Some(Pool::Sensor) && settings.pool() == Pool::Axes {
                    return refused(
                        "--pool sensor: gmwm, rgmwm and avlr take one signal",
                        "--pool axes",
                    );
                }
                // with several, each is judged beside the others
                let first = replicates.first().map(|(_, r)| &r.name);
                if replicates.iter().all(|(_, r)| Some(&r.name) == first) {
                    context.warn_each(wv::outliers(&curves_of(&replicates, &settings)));
                }
                let groups = grouped(replicates, self.pool.unwrap_or(settings.pool()));
                let bootstrap = self.draws(context);
                // draws, what recordings differ by, and whether a simpler model does: each takes about as long
                let steps = settings.model.steps() + 3 * u64::from(self.bootstrap);
                let fits = (groups.len() * settings.estimators.len()) as u64;
                context.begin("steps of the fits", fits * steps);
                let advance = |steps| context.advance(steps);
                let outcomes = calibrate_with_progress(&groups, &settings, &advance)?;
                let made = Calibration::new(groups, outcomes, settings, bootstrap, &advance);
                context.end();
                Calibration { warm_ups, ..made }
            }
        };
        calibration.note = CalibrationNote {
            reading: self.reading(&calibration.settings),
            seed: self.draws(context).map(|draws| draws.seed),
            inputs: context.inputs().to_vec(),
        };
        Ok(calibration)
    }
}

/// The curves of signals as `wv` has them.
fn curves_of(
    signals: &[(Channel, Replicate)],
    settings: &CalibrationSettings,
) -> Vec<SignalCurves> {
    let curves = |(channel, replicate): &(Channel, Replicate)| {
        let levels = 1..=replicate.classical.len() as u32;
        let edof = levels.map(|level| replicate.edof_eta3(level)).collect();
        let efficiency = settings.tuning.efficiency();
        SignalCurves::new(*channel, replicate, settings.rate_hz, edof, efficiency)
    };
    signals.iter().map(curves).collect()
}

impl Serialize for Calibration {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.json().serialize(serializer)
    }
}

impl Answer for Calibration {
    fn document(&self) -> Document {
        self.page()
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        let estimators = &self.settings.estimators;
        let of_estimator = |e: &Estimator| self.files_of(*e, &stem_of(*e, estimators), None);
        let files = estimators.iter().flat_map(of_estimator);
        files
            .map(|(name, text)| OutputFile::whole(name, text))
            .collect()
    }
}

impl Calibrate {
    /// Settings of the fit, validated before any file is read.
    fn settings(&self) -> Result<CalibrationSettings> {
        Ok(CalibrationSettings {
            model: self.structure()?,
            trim: self.trim,
            tuning: self.tuning.tuning()?,
            weighting: self.weighting,
            fit_range: self.tuning.fitted(),
            ..CalibrationSettings::default()
        })
    }

    /// The curves in the place of recordings, and whether they do not say of which sensor: then as of an accelerometer.
    fn curves(
        &self,
        path: &Path,
        settings: &CalibrationSettings,
    ) -> Result<(Curves, CalibrationSettings, bool)> {
        read_curves(
            path,
            self.recordings.reading.rate_hz,
            self.recordings.sensor(),
            settings,
        )
    }

    /// The draws behind intervals.
    fn draws(&self, context: &Context<'_>) -> Option<Bootstrap> {
        (self.bootstrap > 0).then(|| Bootstrap {
            draws: self.bootstrap as usize,
            seed: context.seed_or(None),
        })
    }

    /// Reading and grouping of the recordings; empty for a curve.
    fn reading(&self, settings: &CalibrationSettings) -> toml::Table {
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

    fn structure(&self) -> Result<ModelChoice> {
        let chosen: ModelChoice = self.model.parse().map_err(unknown_model)?;
        if self.curve.is_some() && self.tuning.levels().is_some() {
            return refused(
                "--scales J with --curve, which has its scales",
                "--scales FROM:TO fits a range",
            );
        }
        let is_avlr = self.estimator == EstimatorChoice::One(Estimator::Avlr);
        if is_avlr && self.tuning.fitted().is_some() {
            return refused(
                "--scales FROM:TO with --estimator avlr, which finds its own",
                "--estimator gmwm fits a range",
            );
        }
        Ok(chosen)
    }
}

// The files of a calibration: for each estimator a model, the curves behind it and the draws behind its intervals.

/// Text between the stem of `--out` and an estimator's file extensions: `_<estimator>` if there are
/// several.
fn stem_of(estimator: Estimator, estimators: &[Estimator]) -> String {
    match estimators.len() {
        1 => String::new(),
        _ => format!("_{estimator}"),
    }
}

/// Names of draws, curves, model, page and figures, or their endings: that of a model alone is none.
fn names(stem: &str) -> [String; 5] {
    let model = if stem.is_empty() { "" } else { ".toml" };
    [".draws.json", ".wv.json", model, ".html", ".svg"].map(|ending| format!("{stem}{ending}"))
}

impl Calibration {
    /// Draws, curves, model, page and figures of an estimator. A model that is inflated (and how) has no intervals and draws, which are of its own.
    pub(crate) fn files_of(
        &self,
        estimator: Estimator,
        stem: &str,
        inflated: Option<(&Model, &str)>,
    ) -> Vec<(String, String)> {
        let shown = self.of(estimator);
        let curves = report::json(&shown.curves());
        let mut model = shown.model_file(&input::hash_of(curves.as_bytes()));
        let mut draws = DrawsFile::of(&shown.outcomes, self.settings.rate_hz);
        if let Some((inflated, how)) = inflated {
            draws = None;
            let mut provenance = model.provenance.unwrap_or_default();
            provenance.insert("inflation".to_owned(), how.into());
            model = ModelFile {
                missing: model.missing,
                provenance: Some(provenance),
                ..ModelFile::new(inflated.clone())
            };
        }
        let page = shown.page();
        let draws = draws.map(|draws| serde_json::to_string(&draws).expect("serialises") + "\n");
        let model = crate::io::model_file::to_toml(&model);
        let texts = [
            draws,
            Some(curves),
            Some(model),
            Some(page.html()),
            Some(page.svg()),
        ];
        let files = names(stem).into_iter().zip(texts);
        files
            .filter_map(|(name, text)| Some((name, text?)))
            .collect()
    }
}
