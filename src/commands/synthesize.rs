//! `nav-sim synthesize`: replicate recordings of a noise model.

use crate::app::reading::{ChannelSet, channel_set};
use crate::app::{
    Answer, Command, Context, Failure, Inputs, OutputFile, OutputKind, Result, refused,
};
use crate::io::model_file::{self, ModelFile};
use crate::io::{contamination_file, recordings};
use crate::parse;
use nav_sim_document::{Document, Tone, counted};
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::contamination::{Contamination, Rule};
use nav_sim_signal::noise::{Model, ReplicateError, VirtualImu};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Synthesise static recordings from a noise model
///
/// Writes replicate_1, replicate_2, … and a manifest.json with the parameters that were drawn. The same seed gives the
/// same noise with and without contamination, and at any number of threads. Replicate k has the noise of run k - 1 of
/// `run`: give that another seed.
#[derive(clap::Args, Debug, Clone)]
pub struct Synthesize {
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
    #[arg(long, value_name = "S", value_parser = parse::positive)]
    duration: Option<f64>,
    /// Draw each replicate's parameters from the spread that the model states
    #[arg(long)]
    spread: bool,
    /// Corrupt the replicates: a scenario of the paper (section4-II, section4-III, section5-II, section5-III) or a file
    #[arg(long, value_name = "NAME|FILE")]
    contaminate: Option<String>,
    /// Signals to make: all, accel, gyro, x, accel.x, … (comma-separated)
    #[arg(
        long,
        value_name = "AXES",
        value_delimiter = ',',
        default_value = "all"
    , value_parser = channel_set)]
    axes: Vec<ChannelSet>,
}

/// Samples of a recording, at most.
const MOST: f64 = 1e9;

/// Recordings whose models are drawn; their noise is drawn as they are written.
#[derive(Debug, Serialize)]
pub struct Synthesis {
    schema_version: u32,
    seed: u64,
    #[serde(flatten)]
    drawn: SynthesisRecord,
    #[serde(skip)]
    file: ModelFile,
    #[serde(skip)]
    contamination: Option<Contamination>,
    #[serde(skip)]
    channels: Vec<Channel>,
    #[serde(skip)]
    models: Vec<Model>,
}

#[derive(Debug, Serialize)]
struct SynthesisRecord {
    rate_hz: f64,
    samples: usize,
    spread: bool,
    axes: Vec<String>,
    contamination: Option<String>,
    replicates: Vec<Value>,
}

impl Command for Synthesize {
    type Answer = Synthesis;
    const NAME: &'static str = "synthesize";
    const OUT: OutputKind = OutputKind::Directory {
        path: "out/replicates",
        files: &[],
    };
    const PLOT: bool = false;
    const PAGE: bool = false;

    fn inputs(&self, mut given: Inputs) -> Result<Inputs> {
        let file = self
            .contaminate
            .iter()
            .map(PathBuf::from)
            .find(|path| path.exists());
        given.extend(file.map(|path| ("contamination".to_owned(), path)));
        Ok(given)
    }

    fn output_names(&self) -> Vec<Cow<'static, str>> {
        (1..=self.replicates).map(|k| name(k).into()).collect()
    }

    fn run(&self, context: &Context<'_>) -> Result<Synthesis> {
        let file = model_file::read(&self.model)?;
        let (path, rate_hz) = (self.model.display(), file.model.rate_hz);
        if self.spread && file.spread.is_none() {
            return refused(
                format!("{path}: no [spread] to draw from"),
                "see calib_data/consumer_mems.toml, or leave --spread out",
            );
        }
        let contamination = self
            .contaminate
            .as_deref()
            .map(|name| find(name, rate_hz))
            .transpose()?;
        let channels = self.wanted(&file, context)?;
        refuse_ineffective(contamination.as_ref(), self.replicates, &channels, context)?;
        let samples = match self.duration {
            Some(s) => (s * rate_hz).round(),
            None => self.samples.unwrap_or(524_284) as f64,
        };
        if !(2.0..=MOST).contains(&samples) {
            return Err(Failure::input(format!(
                "{samples} samples: a recording has 2 to {MOST:e}"
            )));
        }
        let mut synthesis = Synthesis {
            schema_version: 1,
            seed: context.seed_or(None),
            drawn: SynthesisRecord {
                rate_hz,
                samples: samples as usize,
                spread: self.spread,
                axes: channels.iter().map(Channel::to_string).collect(),
                contamination: contamination.as_ref().map(|c| c.name.clone()),
                replicates: Vec::new(),
            },
            file,
            contamination,
            channels,
            models: Vec::new(),
        };
        for k in 1..=self.replicates {
            let model = synthesis.model(k)?;
            let axes = synthesis
                .channels
                .iter()
                .map(|c| (c.to_string(), model.axis(*c).processes.clone()));
            let replicate = json!({
                "file": name(k),
                "contaminated": synthesis.is_contaminated(k),
                "axes": axes.collect::<BTreeMap<_, _>>(),
            });
            synthesis.drawn.replicates.push(replicate);
            synthesis.models.push(model);
        }
        Ok(synthesis)
    }
}

impl Synthesize {
    /// The channels to make: those requested that the model has.
    fn wanted(&self, file: &ModelFile, context: &Context<'_>) -> Result<Vec<Channel>> {
        let (missing, present): (Vec<Channel>, Vec<Channel>) = Channel::ALL
            .into_iter()
            .filter(|c| self.axes.iter().any(|set| set.contains(c)))
            .partition(|c| file.missing.contains(c));
        let shown = self.model.display();
        if present.is_empty() {
            return Err(Failure::input(format!(
                "{shown} has no noise model for these axes"
            )));
        }
        for channel in missing {
            context.warn(format!(
                "{shown} has no noise model for {channel}: not written"
            ));
        }
        Ok(present)
    }
}

fn name(replicate: u64) -> String {
    format!("replicate_{replicate}.csv")
}

impl Synthesis {
    fn imu(&self) -> VirtualImu<'_> {
        VirtualImu {
            model: &self.file.model,
            spread: self.file.spread.as_ref().filter(|_| self.drawn.spread),
            contamination: self.contamination.as_ref(),
            seed: self.seed,
        }
    }

    fn is_contaminated(&self, replicate: u64) -> bool {
        self.contamination
            .as_ref()
            .is_some_and(|c| c.touches(replicate))
    }

    /// The model of a replicate, whose contamination is tried on silence.
    fn model(&self, replicate: u64) -> Result<Model> {
        let model = self.imu().model_of(replicate)?;
        let contamination = self.contamination.iter();
        for contamination in contamination.filter(|c| c.touches(replicate)) {
            let mut silence = vec![0.0; self.drawn.samples];
            for channel in &self.channels {
                contamination
                    .apply(&mut silence, *channel, replicate, model.rate_hz, self.seed)
                    .map_err(|source| ReplicateError { replicate, source })?;
            }
        }
        Ok(model)
    }

    fn text(&self, replicate: u64, model: &Model) -> String {
        let signal = |channel: &Channel| {
            (
                *channel,
                self.imu()
                    .signal(model, replicate, *channel, self.drawn.samples)
                    .expect("tried"),
            )
        };
        let signals: Vec<_> = self.channels.par_iter().map(signal).collect();
        recordings::csv(model.rate_hz, &signals)
    }
}

impl Answer for Synthesis {
    fn document(&self) -> Document {
        let SynthesisRecord {
            rate_hz,
            samples,
            axes,
            ..
        } = &self.drawn;
        let (replicates, axes, seed) = (self.models.len(), axes.join(" "), self.seed);
        let line = format!(
            "{} of {samples} samples at {rate_hz} Hz, {axes}, seed {seed}",
            counted(replicates, "replicate")
        );
        Document::new("Synthesised recordings", Tone::Good, [line])
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        let file = |(k, model)| OutputFile {
            name: name(k).into(),
            parts: Box::new(std::iter::once_with(move || self.text(k, model))),
        };
        (1..).zip(&self.models).map(file).collect()
    }

    fn record(&self) -> Value {
        json!(self.drawn)
    }
}

/// Refuses a contamination that touches nothing of what is made: the replicates would be clean by another name. Says
/// which of its rules do not.
fn refuse_ineffective(
    contamination: Option<&Contamination>,
    replicates: u64,
    channels: &[Channel],
    context: &Context<'_>,
) -> Result<()> {
    let Some(contamination) = contamination else {
        return Ok(());
    };
    let Contamination { name, rules } = contamination;
    if !(1..=replicates).any(|replicate| contamination.touches(replicate)) {
        return refused(
            format!("--contaminate {name}: affects none of the replicates 1 to {replicates}"),
            "give more --replicates (counted from 1)",
        );
    }
    // the named ones are of as many recordings as in the paper
    let is_named = contamination_file::names().contains(&name.as_str());
    let beyond = |rule: &&Rule| rule.replicate.is_some_and(|k| k > replicates);
    if let Some(Rule {
        place,
        replicate: Some(k),
        ..
    }) = rules.iter().find(beyond)
        && !is_named
    {
        return refused(
            format!("{place}: corrupts replicate {k} of {replicates}"),
            "give more --replicates, or leave it out of the list",
        );
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
    refused(message, "another contamination, or --axes with that sensor")
}

fn find(name: &str, rate_hz: f64) -> Result<Contamination> {
    contamination_file::find(name, rate_hz).map_err(|e| {
        match contamination_file::nearest_preset(name) {
            _ if Path::new(name).exists() => e,
            Some(meant) => e.hint(format!("did you mean \"{meant}\"?")),
            None => {
                let known = contamination_file::names().join(", ");
                e.hint(format!("give a file or one of {known}"))
            }
        }
    })
}
