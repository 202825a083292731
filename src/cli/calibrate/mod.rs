//! `nav-sim calibrate`: replicate static recordings → noise model.

mod curves;
mod output;
mod recorded;

use super::recordings::{RecordingArgs, sensor};
use super::tuning::TuningArgs;
use super::{Failure, Session, parse};
use nav_sim::calibration::{
    AverageError, Bootstrap, CalibrationError, Cause, FitError, Group, ModelChoice, ModelSpec, Outcome,
    ParameterLimit, Settings, SpecError, Trim, Weighting, infer,
};
use nav_sim::formats::parameters_file;
use nav_sim::formats::suggest::nearest;
use nav_sim::imu::Sensor;
use std::path::PathBuf;

/// Replicate static recordings -> noise model
///
/// Each recording is one replicate. By default the three axes of a sensor are pooled: one model a sensor,
/// their signals replicates of one another. The model goes to a TOML file, the curves behind it to
/// <model>.wv.json beside it; with `--estimator all` to one pair an estimator, <model>_<estimator>.toml.
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
    /// Fit a curve instead of recordings: CSV tau_samples,wv,edof or a .wv.json (also of wv)
    #[arg(long, value_name = "FILE", conflicts_with_all = OF_RECORDINGS)]
    curve: Option<PathBuf>,
    /// Sensor of a CSV curve, for the model file
    #[arg(long, value_name = "SENSOR", value_parser = sensor, requires = "curve")]
    sensor: Option<Sensor>,
    /// Which curve is fitted: averages over the replicates (awv; sr-awv robust to outliers; dr-awv robust to
    /// abnormal replicates too), or that of a single recording (gmwm, rgmwm; avlr: slopes of its Allan deviation)
    #[arg(long, value_enum, default_value_t = EstimatorArg::DrAwv)]
    estimator: EstimatorArg,
    /// Sum of WN QN AR1 GM MA1 RW DR such as 2*AR1+RW+WN+QN, N1 = AR1+RW+WN, N2 = 2*AR1+RW+WN+QN, or auto: the
    /// simplest sum of WN QN RW DR and up to two AR1 that does as well as the best, with its reasons
    #[arg(long, value_name = "SUM", default_value = "N2")]
    model: String,
    /// What is known of the parameters: a TOML file that fixes or bounds them (nav-sim schema parameters)
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,
    /// Replicates that dr-awv drops at each end of each scale: a number, or a percentage of all
    #[arg(long, value_name = "A", default_value = "30%", value_parser = trim)]
    trim: Trim,
    /// What a scale counts in the fit
    #[arg(long, value_enum, default_value_t = WeightingArg::Model)]
    weighting: WeightingArg,
    /// Which signals are replicates of one another (default: sensor; axes for gmwm, rgmwm and avlr)
    #[arg(long, value_enum)]
    pool: Option<PoolArg>,
    /// Draws of the parametric bootstrap behind intervals and goodness of fit (0: neither)
    #[arg(long, value_name = "B", default_value_t = 200, value_parser = clap::value_parser!(u32).range(0..=100_000))]
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
const OF_RECORDINGS: [&str; 10] = [
    "estimator",
    "trim",
    "pool",
    "skip_s",
    "gaps",
    "axes",
    "columns",
    "efficiency",
    "efficiency_convention",
    "scales",
];

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum EstimatorArg {
    /// Average of the classical wavelet variances
    Awv,
    /// Average of the robust wavelet variances
    SrAwv,
    /// Trimmed average of the robust wavelet variances
    DrAwv,
    /// Classical wavelet variance of one recording
    Gmwm,
    /// Robust wavelet variance of one recording
    Rgmwm,
    /// Slopes of the Allan deviation of one recording, read off one by one: WN, QN, RW, DR
    Avlr,
    /// The three averages (of one recording: gmwm and rgmwm)
    All,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum WeightingArg {
    /// Degrees of freedom / (2 wv²), wv that of the fitted model: the inverse variance
    Model,
    /// The same with the observed wv: the convention of the literature, low where wv is low by chance
    Edof,
    /// 1 / (width of the 95 % interval)²
    Ci,
    /// 1
    None,
    /// The inverse of the covariance between scales, by bootstrap
    Full,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum PoolArg {
    /// Those of one axis: a model an axis
    Axes,
    /// Those of all axes of a sensor: a model a sensor
    Sensor,
}

fn trim(text: &str) -> Result<Trim, String> {
    let expected = || "not a number of replicates such as 2, or a percentage under 50 such as 30%".to_owned();
    match text.strip_suffix('%') {
        None => text.parse().map(Trim::Count).map_err(|_| expected()),
        Some(percent) => match parse::non_negative(percent.trim()) {
            Ok(p) if p < 50.0 => Ok(Trim::Fraction(p / 100.0)),
            _ => Err(expected()),
        },
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut settings = Settings {
        estimators: Vec::new(),
        model: model(args)?,
        limits: Vec::new(),
        trim: args.trim,
        tuning: args.tuning.tuning()?,
        weighting: match args.weighting {
            WeightingArg::Model => Weighting::Model,
            WeightingArg::Edof => Weighting::Edof,
            WeightingArg::Ci => Weighting::Interval,
            WeightingArg::None => Weighting::None,
            WeightingArg::Full => Weighting::Full,
        },
        rate_hz: 1.0,
    };
    settings.limits = limits(args, &settings.model)?;
    match &args.curve {
        Some(path) => curves::run(args, path, &mut settings, session),
        None => recorded::run(args, &mut settings, session),
    }
}

fn model(args: &Args) -> Result<ModelChoice, Failure> {
    let chosen = if args.model.eq_ignore_ascii_case("auto") {
        ModelChoice::Auto
    } else {
        ModelChoice::Given(args.model.parse().map_err(unknown_model)?)
    };
    if args.estimator != EstimatorArg::Avlr {
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
        ModelChoice::Given(_) if args.estimator == EstimatorArg::Avlr => {
            conflict("--parameters: avlr reads slopes, it cannot be bounded", "--estimator gmwm")
        }
        ModelChoice::Given(spec) => {
            let limits = parameters_file::read(path, spec)?;
            let of_axis = limits.iter().find(|l| l.axis.is_some());
            match of_axis {
                Some(l) if args.pool != Some(PoolArg::Axes) && !args.estimator.is_single() => {
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

impl EstimatorArg {
    const fn is_single(self) -> bool {
        matches!(self, Self::Gmwm | Self::Rgmwm | Self::Avlr)
    }
}

/// Parameters to be found, at least.
fn free_parameters(model: &ModelChoice) -> usize {
    match model {
        ModelChoice::Given(spec) => spec.parameters(),
        ModelChoice::Auto => 2,
    }
}

fn unknown_model(e: SpecError) -> Failure {
    let hint = match &e {
        SpecError::Unknown { term, .. } => match nearest(term, ModelSpec::legal()) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => {
                format!("processes and models: {}, auto", ModelSpec::legal().collect::<Vec<_>>().join(", "))
            }
        },
        _ => "a model is a sum such as 2*AR1+RW+WN+QN".into(),
    };
    Failure::input(format!("--model: {e}")).hint(hint)
}

fn of_calibration(e: &CalibrationError) -> Failure {
    let hint = match &e.source {
        Cause::Fit(FitError::TooFewScales { .. }) => {
            Some("record for longer, or a --model with fewer processes")
        }
        Cause::Fit(FitError::NoSlope { .. }) => {
            Some("--model WN+RW, a sum of WN, RW and DR (and QN where the curve begins with its slope)")
        }
        Cause::Fit(FitError::NotPositive { .. }) => Some(
            "the signal is quantised so coarsely that scales are silent: --estimator awv, or another range",
        ),
        Cause::Average(AverageError::Trim { .. }) => Some("a smaller --trim, or --estimator sr-awv"),
        _ => None,
    };
    Failure::input(e).maybe_hint(hint.map(str::to_owned))
}

fn bootstrap(
    args: &Args,
    groups: &[Group],
    outcomes: &mut [Outcome],
    settings: &Settings,
    session: &Session,
) {
    if args.bootstrap > 0 {
        let bootstrap = Bootstrap { draws: args.bootstrap as usize, seed: session.seed(None) };
        infer(groups, outcomes, settings, bootstrap);
    }
}
