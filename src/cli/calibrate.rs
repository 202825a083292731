//! `nav-sim calibrate`: replicate static recordings → noise model.

use super::recordings::{RecordingArgs, sensor};
use super::tuning::TuningArgs;
use super::{Failure, Session, parse, read};
use nav_sim::calibration::{
    AverageError, Bootstrap, CalibrationError, Cause, Estimator, FitError, Group, ModelChoice, ModelSpec,
    Outcome, ParameterLimit, Pool, Replicate, Settings, SpecError, Trim, WarmUp, Weighting, calibrate,
    diagnose, fit_curve, grouped, infer, replicates, warm_up,
};
use nav_sim::data::curve_file::{self, NamedCurve};
use nav_sim::data::model_file::{self, CalibrationNote};
use nav_sim::data::suggest::nearest;
use nav_sim::data::{atomic, parameters_file};
use nav_sim::imu::{Channel, Recording, Sensor, Signal};
use nav_sim::report::{self, CurvesFile, FitsFile, Input};
use nav_sim::wavelet::default_levels;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

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
    /// Fit a curve instead of recordings: CSV tau_samples,wv,edof or a .wv.json
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
    #[arg(long, value_enum, default_value_t = WeightingArg::Edof)]
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
const OF_RECORDINGS: [&str; 9] =
    ["estimator", "trim", "pool", "skip_s", "gaps", "axes", "columns", "efficiency", "scales"];

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
    /// Degrees of freedom / (2 wv²): the inverse variance
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
            WeightingArg::Edof => Weighting::Edof,
            WeightingArg::Ci => Weighting::Interval,
            WeightingArg::None => Weighting::None,
            WeightingArg::Full => Weighting::Full,
        },
        rate_hz: 1.0,
    };
    settings.limits = limits(args, &settings.model)?;
    match &args.curve {
        Some(path) => of_curves(args, path, &mut settings, session),
        None => of_recordings(args, &mut settings, session),
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
        ModelChoice::Given(spec) => spec.kinds().iter().find(|k| k.has_shape()).map(|k| k.code()),
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

fn of_recordings(args: &Args, settings: &mut Settings, session: &Session) -> Result<(), Failure> {
    // As many scales as parameters, and one that the default leaves out.
    let needed = args.tuning.scales.map_or(2 << free_parameters(&settings.model), |j| 1 << j);
    let (recordings, report) = args.recordings.read(&args.inputs, needed, session)?;
    warm_ups(&recordings, args.recordings.skip_s(), session);
    shortest(&recordings, args.tuning.scales, session);
    settings.rate_hz = recordings[0].rate_hz;
    settings.estimators = estimators(args.estimator, recordings.len())?;
    let files: Vec<PathBuf> = report.files.iter().map(|f| PathBuf::from(&f.file)).collect();
    let out = args.out.as_deref().unwrap_or(Path::new("model.toml"));
    let outputs = outputs(out, &settings.estimators, &files)?;
    let inputs = files.iter().map(|f| read::input("recording", f)).collect::<Result<Vec<_>, _>>()?;
    distinct(&inputs)?;
    let pool = pool(args, settings)?;
    enough(&recordings, pool, settings)?;
    let count = recordings.iter().map(|r| r.signals.len() as u64).sum();
    let progress = session.progress("signals", count);
    let measured = replicates(&recordings, args.tuning.scales, &settings.tuning, &|| progress.add(1))?;
    drop(progress);
    drop(recordings);
    let groups = grouped(measured, pool);
    let mut outcomes = calibrate(&groups, settings).map_err(|e| of_calibration(&e))?;
    bootstrap(args, &groups, &mut outcomes, settings, session);
    let note = note(args, inputs, session);
    finish(&outputs, &groups, &outcomes, settings, &note, session)
}

/// Says which recordings do not begin as they go on after what was skipped, and what to leave out.
fn warm_ups(recordings: &[Recording], skipped_s: f64, session: &Session) {
    for recording in recordings {
        let of_signal = |s: &Signal| warm_up(&s.samples).map(|w| (s.channel, w));
        let found: Vec<(Channel, WarmUp)> = recording.signals.par_iter().filter_map(of_signal).collect();
        let Some((_, longest)) = found.iter().max_by_key(|(_, w)| w.samples) else { continue };
        let one = |(channel, w): &(Channel, WarmUp)| {
            let what = if w.mean { "its mean moves" } else { "its noise is another" };
            format!("{channel} ({what}, {:+.0} deviations)", w.deviations)
        };
        session.printer.warn(&format!(
            "{}: not stationary at its beginning: {}; warm-up? --skip-s {} leaves that out",
            recording.name,
            found.iter().map(one).collect::<Vec<_>>().join(", "),
            (skipped_s + longest.samples as f64 / recording.rate_hz).ceil()
        ));
    }
}

/// Says which recording is so much shorter than the others that it costs all of them scales.
fn shortest(recordings: &[Recording], scales: Option<u32>, session: &Session) {
    let levels = |r: &Recording| scales.unwrap_or(u32::MAX).min(default_levels(r.len()));
    let Some(short) = recordings.iter().min_by_key(|r| levels(r)) else { return };
    let mut all: Vec<u32> = recordings.iter().map(levels).collect();
    all.sort_unstable();
    let (fewest, usual) = (levels(short), all[all.len() / 2]);
    if fewest < usual {
        session.printer.warn(&format!(
            "{}: its {} samples limit all recordings to {fewest} scales; without it there would be more (half of \
             them have {usual}): leave it out for those",
            short.name,
            short.len()
        ));
    }
}

/// One estimator's files.
struct Output {
    estimator: Estimator,
    model: PathBuf,
    curves: PathBuf,
}

/// The files of each estimator. Fails before the work is done, not after, if they cannot be written.
fn outputs(out: &Path, estimators: &[Estimator], inputs: &[PathBuf]) -> Result<Vec<Output>, Failure> {
    regular(out)?;
    let output = |estimator: &Estimator| {
        let suffix = if estimators.len() > 1 { format!("_{}", estimator.name()) } else { String::new() };
        let model = with_suffix(out, &suffix);
        let curves = model.with_extension("wv.json");
        for path in [&model, &curves] {
            regular(path)?;
            atomic::guard_inputs(path, inputs.iter().map(PathBuf::as_path))?;
            drop(atomic::AtomicFile::create(path)?);
        }
        Ok(Output { estimator: *estimator, model, curves })
    };
    estimators.iter().map(output).collect()
}

/// Refuses an output that cannot be replaced by a file: several are made of it, by its name.
fn regular(out: &Path) -> Result<(), Failure> {
    let refuse = |what: &str| {
        Err(Failure::input(format!("--out {}: it is a {what}", out.display()))
            .hint("name a file, such as model.toml"))
    };
    match std::fs::metadata(out) {
        Ok(m) if m.is_dir() => refuse("directory"),
        Ok(m) if !m.is_file() => refuse("device, and a model is a file with its curves beside it"),
        _ if out.file_name().is_none() || out.as_os_str().to_string_lossy().ends_with('/') => {
            refuse("directory")
        }
        _ => Ok(()),
    }
}

fn estimators(arg: EstimatorArg, recordings: usize) -> Result<Vec<Estimator>, Failure> {
    let estimators = match arg {
        EstimatorArg::Awv => vec![Estimator::Awv],
        EstimatorArg::SrAwv => vec![Estimator::SrAwv],
        EstimatorArg::DrAwv => vec![Estimator::DrAwv],
        EstimatorArg::Gmwm => vec![Estimator::Gmwm],
        EstimatorArg::Rgmwm => vec![Estimator::Rgmwm],
        EstimatorArg::Avlr => vec![Estimator::Avlr],
        EstimatorArg::All if recordings == 1 => vec![Estimator::Gmwm, Estimator::Rgmwm],
        EstimatorArg::All => vec![Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv],
    };
    match estimators.iter().find(|e| e.is_single() && recordings > 1) {
        None => Ok(estimators),
        Some(e) => {
            let message =
                format!("--estimator {} takes one recording at a time; there are {recordings}", e.name());
            Err(Failure::input(message).hint("awv, sr-awv and dr-awv take several"))
        }
    }
}

fn pool(args: &Args, settings: &Settings) -> Result<Pool, Failure> {
    let single = settings.estimators.iter().any(|e| e.is_single());
    match args.pool {
        Some(PoolArg::Axes) => Ok(Pool::Axes),
        Some(PoolArg::Sensor) if single => {
            Err(Failure::input("--pool sensor: gmwm, rgmwm and avlr take one signal at a time")
                .hint("--pool axes"))
        }
        Some(PoolArg::Sensor) => Ok(Pool::Sensor),
        None if single => Ok(Pool::Axes),
        None => Ok(Pool::Sensor),
    }
}

/// Refuses copies of a recording: one replicate would count as two, and intervals come out too narrow.
fn distinct(inputs: &[Input]) -> Result<(), Failure> {
    for (i, input) in inputs.iter().enumerate() {
        if let Some(first) = inputs[..i].iter().find(|other| other.blake3 == input.blake3) {
            let message =
                format!("{} is a copy of {}: it would count as two replicates", input.path, first.path);
            return Err(Failure::input(message).hint("leave one of them out"));
        }
    }
    Ok(())
}

/// Fails before the wavelet variances are taken if the trim leaves no replicate of a group.
fn enough(recordings: &[Recording], pool: Pool, settings: &Settings) -> Result<(), Failure> {
    if !settings.estimators.contains(&Estimator::DrAwv) {
        return Ok(());
    }
    let channels: Vec<Channel> =
        recordings.iter().flat_map(|r| r.signals.iter().map(|s| s.channel)).collect();
    for channel in &channels {
        let alike = |c: &&Channel| match pool {
            Pool::Axes => *c == channel,
            Pool::Sensor => c.sensor == channel.sensor,
        };
        let replicates = channels.iter().filter(alike).count();
        let trim = settings.trim.count(replicates);
        if replicates < 2 * trim + 1 {
            let of = if pool == Pool::Axes { channel.to_string() } else { channel.sensor.name().to_owned() };
            let failure = Failure::input(format!("{of}: {}", AverageError::Trim { trim, replicates }));
            return Err(failure.hint("a smaller --trim, or --estimator sr-awv"));
        }
    }
    Ok(())
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
        _ => None,
    };
    Failure::input(e).maybe_hint(hint.map(str::to_owned))
}

fn of_curves(args: &Args, path: &Path, settings: &mut Settings, session: &Session) -> Result<(), Failure> {
    let curves = curve_file::read(path).map_err(|e| {
        let failure = if e.is_content() { Failure::input(&e) } else { Failure::could_not(&e) };
        failure.maybe_hint(e.hint())
    })?;
    if let (Some(own), Some(given)) = (curves[0].rate_hz, args.recordings.rate_hz()) {
        let message =
            format!("{}: the curve says its rate, {own} Hz; --rate-hz {given} is another", path.display());
        return Err(Failure::input(message).hint("leave --rate-hz out: it is for a CSV curve"));
    }
    let Some(rate_hz) = curves[0].rate_hz.or(args.recordings.rate_hz()) else {
        let failure = Failure::input(format!("{}: the curve does not say its sample rate", path.display()));
        return Err(
            failure.hint("give the rate with --rate-hz: correlation times and the model file need it")
        );
    };
    settings.rate_hz = rate_hz;
    let estimator = |named: &NamedCurve| {
        let named_so = |e: &Estimator| named.estimator.as_deref() == Some(e.name());
        Estimator::ALL.into_iter().find(named_so).unwrap_or(Estimator::Given)
    };
    let found: Vec<Estimator> = curves.iter().map(estimator).collect();
    settings.estimators = Estimator::ALL.into_iter().filter(|e| found.contains(e)).collect();
    let outputs = match &args.out {
        Some(out) => outputs(out, &settings.estimators, &[path.to_owned()])?,
        None => Vec::new(),
    };
    let mut groups = Vec::new();
    let mut outcomes = Vec::new();
    for (named, estimator) in curves.into_iter().zip(found) {
        let Some(sensor) = named.sensor.or(args.sensor).or(args.out.is_none().then_some(Sensor::Accel))
        else {
            let failure =
                Failure::input(format!("{}: the curve does not say of which sensor it is", path.display()));
            return Err(failure.hint("--sensor accel or --sensor gyro"));
        };
        groups.push(Group { sensor, axis: named.axis, replicates: Vec::<Replicate>::new() });
        let outcome = fit_curve(&groups, groups.len() - 1, estimator, named.curve, settings);
        outcomes.push(outcome.map_err(|e| of_calibration(&e))?);
    }
    bootstrap(args, &groups, &mut outcomes, settings, session);
    let input = read::input("curve", path)?;
    let note = note(args, vec![input], session);
    finish(&outputs, &groups, &outcomes, settings, &note, session)
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

fn note(args: &Args, inputs: Vec<Input>, session: &Session) -> CalibrationNote {
    CalibrationNote {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        efficiency_convention: args.tuning.convention().to_owned(),
        weighting: match args.weighting {
            WeightingArg::Edof => "edof",
            WeightingArg::Ci => "ci",
            WeightingArg::None => "none",
            WeightingArg::Full => "full",
        }
        .to_owned(),
        seed: (args.bootstrap > 0).then(|| session.seed(None)),
        inputs,
    }
}

/// Writes one model and its curves for each estimator, and prints the fits.
fn finish(
    outputs: &[Output],
    groups: &[Group],
    outcomes: &[Outcome],
    settings: &Settings,
    note: &CalibrationNote,
    session: &Session,
) -> Result<(), Failure> {
    let mut files = Vec::new();
    for Output { estimator, model, curves } in outputs {
        let own: Vec<&Outcome> = outcomes.iter().filter(|o| o.estimator == *estimator).collect();
        atomic::write(curves, report::json(&CurvesFile::new(groups, &own, settings)))?;
        model_file::write(model, &note.model_file(groups, &own, settings))?;
        files.extend([model, curves].map(|p| p.display().to_string()));
    }
    let diagnoses = diagnose(groups, outcomes, settings);
    if session.json() {
        let json = report::json(&FitsFile::new(groups, outcomes, &diagnoses, settings, files.clone()));
        session.printer.result(json.trim_end());
    } else {
        let fits = outcomes.iter().map(|o| report::describe(&groups[o.group], o, settings));
        let texts = fits.chain(report::describe_replicates(&diagnoses, settings.rate_hz));
        session.printer.result(&texts.collect::<Vec<_>>().join("\n\n"));
    }
    for file in files {
        session.printer.say(&format!("wrote {file}"));
    }
    Ok(())
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let extension = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    path.with_file_name(format!("{stem}{suffix}{extension}"))
}
