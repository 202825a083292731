//! Replicate recordings of a noise model, as the files of one directory.

mod request;

pub use request::SynthesisRequest;

use crate::app::Failure;
use crate::app::Input;
use crate::io::atomic::{AtomicDir, Claim, Existing, Found, claim_directory};
use crate::io::model_file::ModelFile;
use crate::io::recordings::{FileFormat, is_recording};
use crate::io::{Place, help};
use crate::report;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::contamination::Contamination;
use nav_sim_signal::noise::{Model, ReplicateError, VirtualImu};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::fs::File;
use std::path::{Path, PathBuf};

/// What is made.
#[derive(Debug, Clone)]
pub struct Synthesis {
    /// The noise model, with its spread.
    pub file: ModelFile,
    /// The file of the model, with its hash.
    pub input: Input,
    /// What corrupts the recordings.
    pub contamination: Option<Contamination>,
    /// Recordings.
    pub replicates: u64,
    /// The signals of each.
    pub channels: Vec<Channel>,
    /// The samples of each.
    pub samples: usize,
    /// Their format.
    pub format: FileFormat,
    /// Whether each has parameters of its own, drawn from the model's spread.
    pub spread: bool,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Synthesis {
    /// Refuses to overwrite an input or what a synthesis did not make, and to leave recordings of another one beside
    /// those of this one. `inputs`: what is read.
    ///
    /// # Errors
    /// Why the directory cannot be written to.
    pub(crate) fn claim<'a>(
        &self,
        out: &Path,
        inputs: impl Iterator<Item = &'a Path> + Clone,
        existing: Existing,
    ) -> Result<Claim, Failure> {
        let (names, own) = (self.names(), self.identity());
        let files: Vec<&str> = names
            .iter()
            .map(String::as_str)
            .chain(["manifest.json"])
            .collect();
        let recognise = |text: &str| {
            let Some(made) = made(text) else {
                return Ok(Found::Foreign);
            };
            no_others(out, &names, &made)?;
            let present: Value = serde_json::from_str(text).unwrap_or_default();
            let is_same = own
                .as_object()
                .is_some_and(|own| own.iter().all(|(key, value)| present[key] == *value));
            Ok(Found::result(is_same && made == names))
        };
        claim_directory(out, &files, inputs, existing, recognise)
    }

    /// Writes the recordings and `manifest.json`, which says what was drawn and whose text is returned; `made` is called
    /// at each recording.
    ///
    /// # Errors
    /// Of the first recording that cannot be made or written; then none is.
    pub fn write(&self, out: &Path, made: impl Fn() + Sync) -> Result<String, Failure> {
        let mut directory = AtomicDir::create(out)?;
        let names = self.names();
        let paths: Vec<PathBuf> = names.iter().map(|n| directory.path(n)).collect();
        let write = |i: usize| {
            let model = self.write_replicate(i as u64 + 1, &paths[i], &out.join(&names[i]))?;
            made();
            Ok(model)
        };
        // Collected before the first failure is looked for, so that it is the same at any number of threads.
        let outcomes: Vec<Result<Model, Failure>> =
            (0..names.len()).into_par_iter().map(write).collect();
        let models = outcomes
            .into_iter()
            .collect::<Result<Vec<Model>, Failure>>()?;
        let text = report::json(&self.manifest(&names, &models));
        directory.write("manifest.json", &text)?;
        directory.commit()?;
        Ok(text)
    }

    fn names(&self) -> Vec<String> {
        (1..=self.replicates)
            .map(|k| format!("replicate_{k}.{}", self.format))
            .collect()
    }

    /// Writes a replicate and returns the model it was made from; `shown`: where the file will be.
    fn write_replicate(&self, replicate: u64, path: &Path, shown: &Path) -> Result<Model, Failure> {
        let spread = self.file.spread.as_ref().filter(|_| self.spread);
        let contamination = self.contamination.as_ref();
        let imu = VirtualImu {
            model: &self.file.model,
            spread,
            contamination,
            seed: self.seed,
        };
        let model = imu.model_of(replicate)?;
        let signal = |c: &Channel| Ok((*c, imu.signal(&model, replicate, *c, self.samples)?));
        let signals = self
            .channels
            .iter()
            .map(signal)
            .collect::<Result<Vec<_>, ReplicateError>>()?;
        let written =
            File::create(path).and_then(|file| self.format.write(file, model.rate_hz, &signals));
        written.map_err(|e| Failure::io(shown, e))?;
        Ok(model)
    }

    /// What was drawn.
    fn manifest(&self, names: &[String], models: &[Model]) -> Value {
        let entry = |(i, (name, model)): (usize, (&String, &Model))| {
            let contaminated = self
                .contamination
                .as_ref()
                .is_some_and(|c| c.touches(i as u64 + 1));
            let axes: Map<String, Value> = self
                .channels
                .iter()
                .map(|c| (c.to_string(), json!(model.axis(*c).processes)))
                .collect();
            json!({ "file": name, "contaminated": contaminated, "axes": axes })
        };
        let replicates: Vec<Value> = names.iter().zip(models).enumerate().map(entry).collect();
        let mut manifest = self.identity();
        manifest["model"] = self.input.path.as_str().into();
        manifest["replicates"] = replicates.into();
        manifest
    }

    /// What decides the replicates, but for their number.
    fn identity(&self) -> Value {
        json!({
            "schema_version": 1,
            "command": "synthesize",
            "version": env!("CARGO_PKG_VERSION"),
            "seed": self.seed,
            "model_blake3": self.input.blake3,
            "rate_hz": self.file.model.rate_hz,
            "samples": self.samples,
            "spread": self.spread,
            "axes": self.channels.iter().map(Channel::to_string).collect::<Vec<_>>(),
            "contamination": self.contamination.as_ref().map(|c| c.name.as_str()),
        })
    }
}

/// Refuses recordings in a directory that no synthesis made, or that would be left beside those to be written.
fn no_others(directory: &Path, names: &[String], made: &[String]) -> Result<(), Failure> {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    let inside = entries.filter_map(|e| e.file_name().into_string().ok());
    let mut inside: Vec<String> = inside
        .filter(|n| is_recording(n) && !n.starts_with('.'))
        .collect();
    inside.sort();
    let refusal = |message: String, advice: &'static str| {
        let path = directory.display().to_string();
        Failure::contents(path, Place::Itself, message)
            .or_hint(advice)
            .or(help::DIRECTORY)
    };
    if let Some(other) = inside
        .iter()
        .find(|n| !made.contains(n) && names.contains(n))
    {
        return Err(refusal(
            format!("holds {other}, which this command did not make"),
            "move it away",
        ));
    }
    match inside.iter().find(|n| !names.contains(n)) {
        None => Ok(()),
        Some(stale) => {
            let message = format!(
                "already holds {stale}, which this command would leave beside its own outputs"
            );
            Err(refusal(message, "remove it"))
        }
    }
}

/// The recordings that a manifest of a synthesis names; `None` if it is another's.
fn made(manifest: &str) -> Option<Vec<String>> {
    let manifest: Value = serde_json::from_str(manifest).ok()?;
    let name = |replicate: &Value| replicate["file"].as_str().map(str::to_owned);
    let replicates = manifest["replicates"]
        .as_array()
        .filter(|_| manifest["command"] == "synthesize")?;
    replicates.iter().map(name).collect()
}
