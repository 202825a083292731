//! `nav-sim synthesize`: replicate recordings from a noise model.

use super::axes::ChannelSet;
use super::parse::one_of;
use super::{Failure, Session, read};
use crate::formats::atomic::{AtomicDir, Found, claim_directory};
use crate::formats::contamination_file;
use crate::formats::model_file::{self, ModelFile};
use crate::formats::recordings::{FileFormat, is_recording};
use crate::formats::{FileError, Place, Setting};
use crate::imu::Channel;
use crate::noise::contamination::{Contamination, Rule};
use crate::noise::{Model, ReplicateError, VirtualImu};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::fs::File;
use std::path::{Path, PathBuf};

/// Synthesise static recordings from a noise model
///
/// Writes replicate_1, replicate_2, … and a manifest.json that says what was drawn. The same seed gives the
/// same noise with and without contamination, and at any number of threads.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml \\
      --replicates 9 --samples 65536 --spread --seed 1 -o replicates
  nav-sim synthesize calib_data/consumer_mems.toml --replicates 8 --samples 65536 \\
      --axes x --contaminate section5-II -o corrupted
  nav-sim synthesize calib_data/tactical.toml --duration 600 --output-format npy -o tactical")]
pub(crate) struct Args {
    /// Noise model (TOML)
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Recordings to make
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    replicates: u64,
    /// Samples of each [default: 524284, as in the paper]
    #[arg(long, value_name = "T", conflicts_with = "duration", value_parser = clap::value_parser!(u64).range(2..))]
    samples: Option<u64>,
    /// Length of each in seconds, instead of --samples
    #[arg(long, value_name = "S", value_parser = super::parse::positive)]
    duration: Option<f64>,
    /// Draw each replicate's parameters from the model's [spread]
    #[arg(long)]
    spread: bool,
    /// Corrupt the replicates: a scenario of the paper (section4-II, section4-III, section5-II, section5-III) or a file
    #[arg(long, value_name = "NAME|FILE")]
    contaminate: Option<String>,
    /// Signals to make: all, accel, gyro, x, accel.x, … (comma-separated)
    #[arg(long, value_name = "AXES", value_delimiter = ',', value_parser = ChannelSet::named, default_value = "all")]
    axes: Vec<ChannelSet>,
    /// Format of the recordings: csv has ten digits and the time, npy all digits (samples × signals)
    #[arg(long, value_name = "FORMAT", value_parser = one_of::<FileFormat>(&FileFormat::NAMES), default_value_t)]
    output_format: FileFormat,
    /// Directory to write to
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
}

/// Everything about the job that is decided before the first number is drawn.
struct Job {
    file: ModelFile,
    contamination: Option<Contamination>,
    channels: Vec<Channel>,
    samples: usize,
    format: FileFormat,
    spread: bool,
    seed: u64,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let job = Job::new(args, session)?;
    let names: Vec<String> = (1..=args.replicates).map(|k| format!("replicate_{k}.{}", job.format)).collect();
    claim(args, &job, &names, session)?;
    let mut out = AtomicDir::create(&args.out)?;
    let paths: Vec<PathBuf> = names.iter().map(|n| out.path(n)).collect();
    let progress = session.progress("replicates", args.replicates);
    let write = |i: usize| {
        let model = job.write(i as u64 + 1, &paths[i]).map_err(|e| e.at(&args.out.join(&names[i])))?;
        progress.add(1);
        Ok(model)
    };
    // Collected before the first failure is looked for, so that it is the same at any number of threads.
    let outcomes: Vec<Result<Model, Failure>> = (0..names.len()).into_par_iter().map(write).collect();
    let models = outcomes.into_iter().collect::<Result<Vec<Model>, Failure>>()?;
    let manifest = job.manifest(args, &names, &models)?;
    let text = serde_json::to_string_pretty(&manifest).map_err(Failure::could_not)? + "\n";
    out.write("manifest.json", &text)?;
    out.commit()?;
    report(args, &job, &text, session);
    Ok(())
}

fn report(args: &Args, job: &Job, manifest: &str, session: &Session) {
    if session.json() {
        session.printer.result(manifest.trim_end());
        return;
    }
    let axes: Vec<String> = job.channels.iter().map(Channel::to_string).collect();
    session.printer.result(&format!(
        "{}: {} replicates of {} samples at {} Hz, {}, seed {}",
        args.out.display(),
        args.replicates,
        job.samples,
        job.file.model.rate_hz,
        axes.join(" "),
        job.seed
    ));
}

/// Refuses to overwrite an input or what this command did not make, and to leave recordings of another job beside
/// this one's.
fn claim(args: &Args, job: &Job, names: &[String], session: &Session) -> Result<(), Failure> {
    let files: Vec<&str> = names.iter().map(String::as_str).chain(["manifest.json"]).collect();
    let contamination = args.contaminate.as_deref().map(Path::new);
    let inputs = contamination.into_iter().chain([args.model.as_path()]);
    let own = job.identity(args)?;
    let recognise = |text: &str| {
        let Some(made) = made(text) else { return Ok(Found::Foreign) };
        no_others(&args.out, names, &made)?;
        let there: Value = serde_json::from_str(text).unwrap_or_default();
        let is_same = own.as_object().is_some_and(|own| own.iter().all(|(key, value)| there[key] == *value));
        Ok(Found::result(is_same && made == names))
    };
    Ok(claim_directory(&args.out, &files, inputs, session.existing(), recognise)?)
}

/// Refuses recordings in a directory that this command did not make, or would leave beside its own.
fn no_others(directory: &Path, names: &[String], made: &[String]) -> Result<(), FileError> {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    let inside = entries.filter_map(|e| e.file_name().into_string().ok());
    let mut inside: Vec<String> = inside.filter(|n| is_recording(n) && !n.starts_with('.')).collect();
    inside.sort();
    let refusal = |message: String, advice: &'static str| {
        let path = directory.display().to_string();
        FileError::contents(path, Place::Itself, message).advice(advice).setting(Setting::OutputDirectory)
    };
    if let Some(other) = inside.iter().find(|n| !made.contains(n) && names.contains(n)) {
        return Err(refusal(format!("holds {other}, which this command did not make"), "move it away"));
    }
    match inside.iter().find(|n| !names.contains(n)) {
        None => Ok(()),
        Some(stale) => {
            let message =
                format!("already holds {stale}, which this command would leave beside its own outputs");
            Err(refusal(message, "remove it"))
        }
    }
}

/// The recordings that a manifest of this command names; `None` if it is another's.
fn made(manifest: &str) -> Option<Vec<String>> {
    let manifest: Value = serde_json::from_str(manifest).ok()?;
    let name = |replicate: &Value| replicate["file"].as_str().map(str::to_owned);
    let replicates = manifest["replicates"].as_array().filter(|_| manifest["command"] == "synthesize")?;
    replicates.iter().map(name).collect()
}

/// A replicate that was not written.
enum NotWritten {
    Refused(ReplicateError),
    Io(std::io::Error),
}

impl NotWritten {
    fn at(self, path: &Path) -> Failure {
        match self {
            Self::Refused(e) => Failure::input(e),
            Self::Io(e) => FileError::io(path, e).into(),
        }
    }
}

impl Job {
    fn new(args: &Args, session: &Session) -> Result<Self, Failure> {
        let file = model_file::read(&args.model)?;
        let shown = args.model.display();
        if args.spread && file.spread.is_none() {
            let hint = "see the head of calib_data/consumer_mems.toml, or leave --spread out";
            return Err(Failure::input(format!("{shown}: no [spread] to draw parameters from")).hint(hint));
        }
        if file.turn_on.is_some() {
            session.printer.say(&format!(
                "{shown}: its turn-on biases are not drawn: recordings are of noise about their mean"
            ));
        }
        let contamination = args.contaminate.as_deref().map(|c| contamination(c, file.model.rate_hz));
        let contamination = contamination.transpose()?;
        let channels = wanted(args, &file, session)?;
        reaches(contamination.as_ref(), &channels, session)?;
        let samples = match args.duration {
            Some(s) => (s * file.model.rate_hz).round(),
            None => args.samples.unwrap_or(524_284) as f64,
        };
        let bytes = samples * channels.len() as f64 * 8.0;
        if samples < 2.0 {
            return Err(Failure::input(format!("a recording needs at least 2 samples; these are {samples}")));
        }
        if bytes >= isize::MAX as f64 || Vec::<u8>::new().try_reserve_exact(bytes as usize).is_err() {
            let gigabytes = bytes / 1e9;
            return Err(Failure::could_not(format!("{samples} samples need {gigabytes:.0} GB of memory")));
        }
        let (samples, format) = (samples as usize, args.output_format);
        let (spread, seed) = (args.spread, session.seed(None));
        Ok(Self { file, contamination, channels, samples, format, spread, seed })
    }

    fn imu(&self) -> VirtualImu<'_> {
        let spread = self.file.spread.as_ref().filter(|_| self.spread);
        let contamination = self.contamination.as_ref();
        VirtualImu { model: &self.file.model, spread, contamination, seed: self.seed }
    }

    /// Writes a replicate and returns the model it was made from.
    fn write(&self, replicate: u64, path: &Path) -> Result<Model, NotWritten> {
        let imu = self.imu();
        let model = imu.model_of(replicate).map_err(NotWritten::Refused)?;
        let signal = |c: &Channel| Ok((*c, imu.signal(&model, replicate, *c, self.samples)?));
        let signals: Result<Vec<_>, ReplicateError> = self.channels.iter().map(signal).collect();
        let signals = signals.map_err(NotWritten::Refused)?;
        let file = File::create(path).map_err(NotWritten::Io)?;
        self.format.write(file, model.rate_hz, &signals).map_err(NotWritten::Io)?;
        Ok(model)
    }

    /// What was drawn.
    fn manifest(&self, args: &Args, names: &[String], models: &[Model]) -> Result<Value, Failure> {
        let entry = |(i, (name, model)): (usize, (&String, &Model))| {
            let contaminated = self.contamination.as_ref().is_some_and(|c| c.touches(i as u64 + 1));
            let axes: Map<String, Value> =
                self.channels.iter().map(|c| (c.to_string(), json!(model.axis(*c).processes))).collect();
            json!({ "file": name, "contaminated": contaminated, "axes": axes })
        };
        let replicates: Vec<Value> = names.iter().zip(models).enumerate().map(entry).collect();
        let mut manifest = self.identity(args)?;
        manifest["model"] = args.model.display().to_string().into();
        manifest["replicates"] = replicates.into();
        Ok(manifest)
    }

    /// What decides the replicates, but for their number.
    fn identity(&self, args: &Args) -> Result<Value, Failure> {
        let model = read::input("model", &args.model)?;
        Ok(json!({
            "schema_version": 1,
            "command": "synthesize",
            "version": env!("CARGO_PKG_VERSION"),
            "seed": self.seed,
            "model_blake3": model.blake3,
            "rate_hz": self.file.model.rate_hz,
            "samples": self.samples,
            "spread": self.spread,
            "axes": self.channels.iter().map(Channel::to_string).collect::<Vec<_>>(),
            "contamination": self.contamination.as_ref().map(|c| c.name.as_str()),
        }))
    }
}

/// The channels to make: those asked for that the model has.
fn wanted(args: &Args, file: &ModelFile, session: &Session) -> Result<Vec<Channel>, Failure> {
    let asked = |c: &Channel| args.axes.iter().any(|set| set.0.contains(c));
    let (missing, there): (Vec<Channel>, Vec<Channel>) =
        Channel::ALL.into_iter().filter(asked).partition(|c| file.missing.contains(c));
    let shown = args.model.display();
    if there.is_empty() {
        return Err(Failure::input(format!("{shown} has no noise model for the axes asked for")));
    }
    for channel in missing {
        session
            .printer
            .warn(&format!("{shown} has no noise model for {channel}; no signal is written for that axis"));
    }
    Ok(there)
}

/// Refuses a contamination that touches nothing of what is made: the replicates would be clean by another name. Says
/// which of its rules do not.
fn reaches(
    contamination: Option<&Contamination>,
    channels: &[Channel],
    session: &Session,
) -> Result<(), Failure> {
    let Some(Contamination { name, rules }) = contamination else { return Ok(()) };
    let made = |rule: &Rule| channels.iter().any(|c| c.sensor == rule.sensor);
    let Some(Rule { sensor, .. }) = rules.iter().find(|rule| !made(rule)) else { return Ok(()) };
    let message = format!("--contaminate {name}: it corrupts the {}, which is not made", sensor.name());
    if rules.iter().any(made) {
        session.printer.detail(&message);
        return Ok(());
    }
    Err(Failure::input(message).hint("another contamination, or --axes with that sensor"))
}

fn contamination(name: &str, rate_hz: f64) -> Result<Contamination, Failure> {
    contamination_file::find(name, rate_hz).map_err(|e| {
        let there = contamination_file::names().join(", ");
        let meant = contamination_file::meant(name);
        let hint = match (e.is_system(), meant) {
            (false, _) => None,
            (true, Some(meant)) => Some(format!("did you mean \"{meant}\"?")),
            (true, None) => Some(format!("give a file or one of {there}")),
        };
        Failure::from(e).maybe_hint(hint)
    })
}
