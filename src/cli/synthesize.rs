//! `nav-sim synthesize`: replicate recordings from a noise model.

use super::axes::ChannelSet;
use super::{Failure, Session, read};
use crate::formats::contamination_file;
use crate::formats::model_file::{self, ModelFile};
use crate::formats::recordings::FileFormat;
use crate::synthesize::Synthesis;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::contamination::{Contamination, Rule};
use std::path::{Path, PathBuf};

/// Synthesise static recordings from a noise model
///
/// Writes replicate_1, replicate_2, … and a manifest.json with the parameters that were drawn. The same seed gives the
/// same noise with and without contamination, and at any number of threads.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml \\
      --replicates 9 --samples 65536 --spread --seed 1 -o replicates
  nav-sim synthesize calib_data/consumer_mems.toml --replicates 8 --samples 65536 \\
      --axes x --contaminate section5-II -o corrupted
  nav-sim synthesize calib_data/tactical.toml --duration 600 -o tactical")]
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
    /// Directory to write to
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let job = synthesis(args, session)?;
    let contamination = args.contaminate.as_deref().map(Path::new);
    let inputs = contamination.into_iter().chain([args.model.as_path()]);
    let _own = job.claim(&args.out, inputs, session.existing())?;
    let progress = session.progress("replicates", args.replicates);
    let manifest = job.write(&args.out, || progress.add(1))?;
    let text = || {
        let axes: Vec<String> = job.channels.iter().map(Channel::to_string).collect();
        format!(
            "{}: {} replicates of {} samples at {} Hz, {}, seed {}",
            args.out.display(),
            args.replicates,
            job.samples,
            job.file.model.rate_hz,
            axes.join(" "),
            job.seed
        )
    };
    session.show(|| manifest, text);
    Ok(())
}

/// Everything that is decided before the first number is drawn.
fn synthesis(args: &Args, session: &Session) -> Result<Synthesis, Failure> {
    let file = model_file::read(&args.model)?;
    let shown = args.model.display();
    if args.spread && file.spread.is_none() {
        let hint = "see the head of calib_data/consumer_mems.toml, or leave --spread out";
        return Err(Failure::input(format!("{shown}: no [spread] to draw parameters from")).hint(hint));
    }
    if file.turn_on.is_some() {
        session.say(format!(
            "{shown}: its turn-on biases are not drawn: recordings are of noise about their mean"
        ));
    }
    let contamination = args.contaminate.as_deref().map(|c| contamination(c, file.model.rate_hz));
    let contamination = contamination.transpose()?;
    let channels = wanted(args, &file, session)?;
    reaches(contamination.as_ref(), args.replicates, &channels, session)?;
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
    Ok(Synthesis {
        input: read::input("model", &args.model)?,
        replicates: args.replicates,
        samples: samples as usize,
        format: FileFormat::Csv,
        spread: args.spread,
        seed: session.seed(None),
        file,
        contamination,
        channels,
    })
}

/// The channels to make: those asked for that the model has.
fn wanted(args: &Args, file: &ModelFile, session: &Session) -> Result<Vec<Channel>, Failure> {
    let asked = |c: &Channel| args.axes.iter().any(|set| set.0.contains(c));
    let (missing, present): (Vec<Channel>, Vec<Channel>) =
        Channel::ALL.into_iter().filter(asked).partition(|c| file.missing.contains(c));
    let shown = args.model.display();
    if present.is_empty() {
        return Err(Failure::input(format!("{shown} has no noise model for the axes asked for")));
    }
    for channel in missing {
        session.warn(format!("{shown} has no noise model for {channel}; no signal is written for that axis"));
    }
    Ok(present)
}

/// Refuses a contamination that touches nothing of what is made: the replicates would be clean by another name. Says
/// which of its rules do not.
fn reaches(
    contamination: Option<&Contamination>,
    replicates: u64,
    channels: &[Channel],
    session: &Session,
) -> Result<(), Failure> {
    let Some(contamination) = contamination else { return Ok(()) };
    let Contamination { name, rules } = contamination;
    if !(1..=replicates).any(|replicate| contamination.touches(replicate)) {
        let message = format!("--contaminate {name}: it touches none of the replicates 1 to {replicates}");
        return Err(
            Failure::input(message).hint("replicates are counted from 1; more of them with --replicates")
        );
    }
    let made = |rule: &Rule| channels.iter().any(|c| c.sensor == rule.sensor);
    let Some(Rule { sensor, place, .. }) = rules.iter().find(|rule| !made(rule)) else { return Ok(()) };
    let message = format!("{place}: corrupts the {}, which is not made", sensor.name());
    if rules.iter().any(made) {
        session.detail(&message);
        return Ok(());
    }
    Err(Failure::input(message).hint("another contamination, or --axes with that sensor"))
}

fn contamination(name: &str, rate_hz: f64) -> Result<Contamination, Failure> {
    contamination_file::find(name, rate_hz).map_err(|e| {
        let known = contamination_file::names().join(", ");
        let meant = contamination_file::meant(name);
        let hint = match (e.is_system(), meant) {
            (false, _) => None,
            (true, Some(meant)) => Some(format!("did you mean \"{meant}\"?")),
            (true, None) => Some(format!("give a file or one of {known}")),
        };
        Failure::from(e).maybe_hint(hint)
    })
}
