//! `nav-sim calibrate`: replicate static recordings → noise model.

mod output;

use super::jobs::unknown_model;
use super::parse::words;
use super::recordings::{RecordingArgs, Said};
use super::tuning::TuningArgs;
use super::{Failure, Session, read};
use crate::calibrate::{self, CalibrationOptions, EstimatorChoice, ModelFiles};
use crate::formats::parameters_file;
use crate::jobs::JobError;
use nav_sim_calibration::{
    Bootstrap, Estimator, ModelChoice, ModelSpec, ParameterLimit, Pool, Settings, Trim, Weighting,
};
use nav_sim_signal::imu::Sensor;
use std::path::{Path, PathBuf};

/// Fit a noise model to static recordings
///
/// Each recording is one replicate. By default the three axes of a sensor are pooled: there is one model per
/// sensor, and the signals of its axes are replicates of one another. The model goes to a TOML file. Beside it,
/// <model>.wv.json holds the curves, <model>.draws.json the draws behind the intervals, <model>.html a page and
/// <model>.svg its figures. With `--estimator all` there is such a set for each estimator, <model>_<estimator>.toml and so on.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml \\
      --replicates 5 --samples 65536 --spread --seed 1 -o static
  nav-sim calibrate static -o model.toml
  nav-sim calibrate static --estimator all --model \"AR1+RW+WN\" --pool axes -o imu.toml")]
pub(crate) struct Args {
    /// Recordings, or directories of recordings
    #[arg(value_name = "INPUT", required_unless_present = "curve", conflicts_with = "curve")]
    inputs: Vec<PathBuf>,
    /// Fit a curve instead of recordings: CSV tau_samples,wv,edof, or a .wv.json of calibrate or wv
    #[arg(long, value_name = "FILE", conflicts_with_all = OF_RECORDINGS)]
    curve: Option<PathBuf>,
    /// Which curve is fitted: an average over the replicates (awv; sr-awv, robust to outliers; dr-awv, robust to
    /// abnormal replicates too), or the curve of a single recording (gmwm, rgmwm; avlr: slopes of its Allan deviation)
    #[arg(long, value_parser = words::<EstimatorChoice>(&ESTIMATORS), default_value_t)]
    estimator: EstimatorChoice,
    /// Sum of WN QN AR1 GM MA1 FN RW DR such as 2*AR1+RW+WN+QN, N1 = AR1+RW+WN, N2 = 2*AR1+RW+WN+QN, or auto: the
    /// simplest sum of WN QN RW DR and up to two AR1 that fits as well as the best one, with the reasons
    #[arg(long, value_name = "SUM", default_value = ModelSpec::USUAL)]
    model: String,
    /// TOML file that fixes or bounds parameters known beforehand (nav-sim schema parameters)
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    /// Replicates that dr-awv drops at each end of each scale: a number, or a percentage of all
    #[arg(long, value_name = "A", default_value_t)]
    trim: Trim,
    /// Weight of a scale in the fit
    #[arg(long, value_parser = words::<Weighting>(&WEIGHTINGS), default_value_t)]
    weighting: Weighting,
    /// Which signals are replicates of one another (default: sensor; axes for gmwm, rgmwm and avlr)
    #[arg(long, value_parser = words::<Pool>(&POOLS))]
    pool: Option<Pool>,
    /// Draws behind intervals and goodness of fit (0: neither), fewer for tests
    #[arg(long, value_name = "B", hide = true, default_value_t = Bootstrap::DRAWS as u32, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    bootstrap: u32,
    /// The model file (default: model.toml; none for --curve)
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    recordings: RecordingArgs,
    #[command(flatten)]
    tuning: TuningArgs,
}

/// Flags about recordings and their averages, which a curve has behind it.
const OF_RECORDINGS: [&str; 6] = ["estimator", "trim", "pool", "skip_s", "gaps", "efficiency"];

/// Those of several recordings first, then those of one.
pub(super) const ESTIMATORS: [(&str, &str); 7] = [
    (Estimator::Awv.name(), "Average of the classical wavelet variances"),
    (Estimator::SrAwv.name(), "Average of the robust wavelet variances"),
    (Estimator::DrAwv.name(), "Trimmed average of the robust wavelet variances"),
    (Estimator::Gmwm.name(), "Classical wavelet variance of one recording"),
    (Estimator::Rgmwm.name(), "Robust wavelet variance of one recording"),
    (
        Estimator::Avlr.name(),
        "Slopes of the Allan deviation of one recording, read off one by one: WN, QN, RW, DR",
    ),
    ("all", "The three averages (of one recording: gmwm and rgmwm)"),
];

const WEIGHTINGS: [(&str, &str); 5] = [
    (Weighting::Model.name(), "Inverse variance by the fitted model; a scale far above it weighs less"),
    (
        Weighting::Edof.name(),
        "The same with the observed wv: the convention of the literature, low where wv is low by chance",
    ),
    (Weighting::Interval.name(), "1 / (width of the 95 % interval)²"),
    (Weighting::None.name(), "1"),
    (Weighting::Full.name(), "The inverse of the covariance between scales, by bootstrap"),
];

const POOLS: [(&str, &str); 2] = [
    (Pool::Axes.name(), "Those of one axis: one model per axis"),
    (Pool::Sensor.name(), "Those of all axes of a sensor: one model per sensor"),
];

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let model = model(args)?;
    let settings = Settings {
        limits: limits(args, &model)?,
        model,
        trim: args.trim,
        tuning: args.tuning.tuning()?,
        weighting: args.weighting,
        fit_range: args.tuning.fitted(),
        ..Settings::default()
    };
    match &args.curve {
        Some(path) => curves(args, path, &settings, session),
        None => recordings(args, settings, session),
    }
}

fn recordings(args: &Args, settings: Settings, session: &Session) -> Result<(), Failure> {
    let out = args.out.as_deref().unwrap_or(Path::new("model.toml"));
    let listed = read::listed(&args.inputs)?;
    let guarded: Vec<PathBuf> = listed.iter().chain(&args.parameters).cloned().collect();
    let (mut outputs, _claims) =
        ModelFiles::claim(out, &args.estimator.possible(), &guarded, session.existing())?;
    let options = CalibrationOptions {
        reading: args.recordings.options(),
        skip_warm_up: args.recordings.reading.skips_warm_up(),
        scales: args.tuning.levels(),
        estimators: args.estimator,
        pool: args.pool,
        settings,
        bootstrap: bootstrap(args, session),
        turn_on: true,
    };
    let measured = calibrate::measure(&args.inputs, &options, &mut Said::new(session))?;
    let files: Vec<PathBuf> = measured.report.files.iter().map(|f| f.path.clone()).collect();
    outputs.retain(|files| measured.settings.estimators.contains(&files.estimator));
    let inputs = files.iter().map(|f| read::input("recording", f)).collect::<Result<Vec<_>, _>>()?;
    let calibration = {
        let progress = session.progress("steps of the fits", measured.steps());
        measured.calibrate(&|steps| progress.add(steps))?
    };
    let note = output::note(args, &calibration.settings, inputs, session)?;
    output::finish(&outputs, &calibration, &note, session)
}

/// Fitting curves that come from elsewhere.
fn curves(args: &Args, path: &Path, settings: &Settings, session: &Session) -> Result<(), Failure> {
    let curves_of =
        |sensor| calibrate::read_curves(path, args.recordings.reading.rate_hz(), sensor, settings);
    let curves = match curves_of(args.recordings.sensor()) {
        // What is only printed needs a sensor for its units alone.
        Err(JobError::NoSensor { .. }) if args.out.is_none() => {
            session.say(format!(
                "{}: taken as of an accelerometer (--axes gyro: of a gyroscope)",
                path.display()
            ));
            curves_of(Some(Sensor::Accel))?
        }
        read => read?,
    };
    let inputs: Vec<PathBuf> =
        [path].into_iter().map(Path::to_owned).chain(args.parameters.clone()).collect();
    let (outputs, _claims) = match &args.out {
        Some(out) => ModelFiles::claim(out, &curves.settings.estimators, &inputs, session.existing())?,
        None => Default::default(),
    };
    let calibration = curves.calibrate(bootstrap(args, session))?;
    let input = read::input("curve", path)?;
    let note = output::note(args, &calibration.settings, vec![input], session)?;
    output::finish(&outputs, &calibration, &note, session)
}

fn bootstrap(args: &Args, session: &Session) -> Option<Bootstrap> {
    (args.bootstrap > 0).then(|| Bootstrap { draws: args.bootstrap as usize, seed: session.seed(None) })
}

fn model(args: &Args) -> Result<ModelChoice, Failure> {
    let chosen: ModelChoice = args.model.parse().map_err(unknown_model)?;
    if args.estimator == EstimatorChoice::One(Estimator::Avlr) && args.tuning.fitted().is_some() {
        let message = "--scales FROM:TO with --estimator avlr: slopes are read where they are found";
        return Err(Failure::input(message).hint("--estimator gmwm fits the same curve over a range"));
    }
    if args.estimator != EstimatorChoice::One(Estimator::Avlr) {
        return Ok(chosen);
    }
    let without = match &chosen {
        ModelChoice::Given(spec) => spec.kinds().iter().find(|k| k.shape().is_some()).map(|k| k.code()),
        ModelChoice::Auto => Some("the AR1 of auto"),
    };
    match without {
        None => Ok(chosen),
        Some(name) => {
            let message = format!("--estimator avlr: {name} has no slope of its own in the Allan deviation");
            Err(Failure::input(message)
                .hint("--model WN+RW, a sum of WN, RW and DR (and QN where the curve begins with its slope); or --estimator gmwm"))
        }
    }
}

fn limits(args: &Args, model: &ModelChoice) -> Result<Vec<ParameterLimit>, Failure> {
    let Some(path) = &args.parameters else { return Ok(Vec::new()) };
    let conflict = |message: &str, hint: &str| Err(Failure::input(message).hint(hint));
    match model {
        ModelChoice::Auto => {
            conflict("--parameters with --model auto: whose parameters?", "name the --model, such as N2")
        }
        ModelChoice::Given(_) if args.estimator == EstimatorChoice::One(Estimator::Avlr) => {
            conflict("--parameters: avlr reads slopes, it cannot be bounded", "--estimator gmwm")
        }
        ModelChoice::Given(spec) => {
            let limits = parameters_file::read(path, spec)?;
            let of_axis = limits.iter().find(|l| l.axis.is_some());
            match of_axis {
                Some(l) if args.pool != Some(Pool::Axes) && !args.estimator.is_single() => {
                    let axis = l.axis.map_or("x", |a| a.name());
                    let message =
                        format!("{}: the axis {axis} is named, but the axes are pooled", path.display());
                    conflict(&message, "--pool axes")
                }
                _ => Ok(limits),
            }
        }
    }
}
