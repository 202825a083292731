//! The request of a synthesis: the arguments of `nav-sim synthesize`.

use super::Synthesis;
use crate::app::Context;
use crate::app::Failure;
use crate::app::reading::ChannelSet;
use crate::io::model_file::{self, ModelFile};
use crate::io::recordings::FileFormat;
use crate::io::{contamination_file, input};
use crate::parse;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::contamination::{Contamination, Rule};
use std::path::PathBuf;

/// A model, and the recordings that are made of it.
#[derive(clap::Args, Debug, Clone)]
pub struct SynthesisRequest {
    /// Noise model (TOML)
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Recordings to make
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub replicates: u64,
    /// Samples of each [default: 524284, as in the paper]
    #[arg(long, value_name = "T", conflicts_with = "duration", value_parser = clap::value_parser!(u64).range(2..))]
    pub samples: Option<u64>,
    /// Length of each in seconds, instead of --samples
    #[arg(long, value_name = "S", value_parser = parse::positive)]
    pub duration: Option<f64>,
    /// Draw each replicate's parameters from the spread that the model states
    #[arg(long)]
    pub spread: bool,
    /// Corrupt the replicates: a scenario of the paper (section4-II, section4-III, section5-II, section5-III) or a file
    #[arg(long, value_name = "NAME|FILE")]
    pub contaminate: Option<String>,
    /// Signals to make: all, accel, gyro, x, accel.x, … (comma-separated)
    #[arg(
        long,
        value_name = "AXES",
        value_delimiter = ',',
        default_value = "all"
    )]
    pub axes: Vec<ChannelSet>,
}

impl SynthesisRequest {
    /// Everything that is decided before the first number is drawn.
    pub(crate) fn synthesis(&self, context: &Context<'_>) -> Result<Synthesis, Failure> {
        let file = model_file::read(&self.model)?;
        let shown = self.model.display();
        if self.spread && file.spread.is_none() {
            let hint = "see the head of calib_data/consumer_mems.toml, or leave --spread out";
            return Err(
                Failure::input(format!("{shown}: no [spread] to draw parameters from")).hint(hint),
            );
        }
        if file.turn_on.is_some() {
            context.remark(format!(
                "{shown}: its turn-on biases are not drawn: recordings are of noise about their mean"
            ));
        }
        let contamination = self
            .contaminate
            .as_deref()
            .map(|c| contamination(c, file.model.rate_hz));
        let contamination = contamination.transpose()?;
        let channels = self.wanted(&file, context)?;
        reaches(contamination.as_ref(), self.replicates, &channels, context)?;
        let samples = match self.duration {
            Some(s) => (s * file.model.rate_hz).round(),
            None => self.samples.unwrap_or(524_284) as f64,
        };
        let bytes = samples * channels.len() as f64 * 8.0;
        if samples < 2.0 {
            return Err(Failure::input(format!(
                "a recording needs at least 2 samples; these are {samples}"
            )));
        }
        if bytes >= isize::MAX as f64 || Vec::<u8>::new().try_reserve_exact(bytes as usize).is_err()
        {
            let gigabytes = bytes / 1e9;
            return Err(Failure::could_not(format!(
                "{samples} samples need {gigabytes:.0} GB of memory"
            )));
        }
        Ok(Synthesis {
            input: input::input("model", &self.model)?,
            replicates: self.replicates,
            samples: samples as usize,
            format: FileFormat::Csv,
            spread: self.spread,
            seed: context.seed_or(None),
            file,
            contamination,
            channels,
        })
    }

    /// The channels to make: those asked for that the model has.
    fn wanted(&self, file: &ModelFile, context: &Context<'_>) -> Result<Vec<Channel>, Failure> {
        let asked = |c: &Channel| self.axes.iter().any(|set| set.channels.contains(c));
        let (missing, present): (Vec<Channel>, Vec<Channel>) = Channel::ALL
            .into_iter()
            .filter(asked)
            .partition(|c| file.missing.contains(c));
        let shown = self.model.display();
        if present.is_empty() {
            return Err(Failure::input(format!(
                "{shown} has no noise model for the axes asked for"
            )));
        }
        for channel in missing {
            context.warn(format!(
                "{shown} has no noise model for {channel}; no signal is written for that axis"
            ));
        }
        Ok(present)
    }
}

/// Refuses a contamination that touches nothing of what is made: the replicates would be clean by another name. Says
/// which of its rules do not.
fn reaches(
    contamination: Option<&Contamination>,
    replicates: u64,
    channels: &[Channel],
    context: &Context<'_>,
) -> Result<(), Failure> {
    let Some(contamination) = contamination else {
        return Ok(());
    };
    let Contamination { name, rules } = contamination;
    if !(1..=replicates).any(|replicate| contamination.touches(replicate)) {
        let message =
            format!("--contaminate {name}: it touches none of the replicates 1 to {replicates}");
        return Err(Failure::input(message)
            .hint("replicates are counted from 1; more of them with --replicates"));
    }
    let made = |rule: &Rule| channels.iter().any(|c| c.sensor == rule.sensor);
    let Some(Rule { sensor, place, .. }) = rules.iter().find(|rule| !made(rule)) else {
        return Ok(());
    };
    let message = format!("{place}: corrupts the {}, which is not made", sensor.name());
    if rules.iter().any(made) {
        context.detail(message);
        return Ok(());
    }
    Err(Failure::input(message).hint("another contamination, or --axes with that sensor"))
}

fn contamination(name: &str, rate_hz: f64) -> Result<Contamination, Failure> {
    contamination_file::find(name, rate_hz).map_err(|e| {
        let known = contamination_file::names().join(", ");
        let meant = contamination_file::meant(name);
        let hint = match (e.code() == 1, meant) {
            (false, _) => None,
            (true, Some(meant)) => Some(format!("did you mean \"{meant}\"?")),
            (true, None) => Some(format!("give a file or one of {known}")),
        };
        e.maybe_hint(hint)
    })
}
