//! The files of a study, read beside it; doubts become remarks.

use super::description::{Synthesis, TruthEntry};
use super::failure::StudyError;
use super::file::beside;
use crate::app::Context;
use crate::formats::model_file::{self, ModelFile};
use crate::formats::recordings::{self, ReadOptions};
use crate::formats::{FileError, contamination_file, hash, input, trajectory_file};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::{Channel, Recording};
use nav_sim_signal::noise::contamination::Contamination;
use nav_sim_signal::noise::{Model, ReplicateError, VirtualImu};
use rayon::prelude::*;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// What is added to the study's seed for virtual recordings of truths, and of candidates.
const TRUTH_SEED: u64 = 2;
pub(super) const CANDIDATE_SEED: u64 = 1;

/// What makes the errors.
pub(super) enum TruthSource {
    Model(Model),
    Recordings(Vec<Recording>),
}

/// Reads what a study names.
#[derive(Clone, Copy)]
pub(super) struct Reader<'a> {
    pub(super) study: &'a Path,
    pub(super) context: &'a Context<'a>,
}

impl Reader<'_> {
    pub(super) fn trajectory(&self, path: &Path) -> Result<Trajectory, FileError> {
        let (trajectory, warnings) =
            trajectory_file::load(path, &trajectory_file::Options::default())?;
        self.doubt(warnings);
        Ok(trajectory)
    }

    pub(super) fn model(&self, path: &Path) -> Result<ModelFile, FileError> {
        let file = model_file::read(path)?;
        self.doubt(file.doubts(path));
        Ok(file)
    }

    /// The recordings in files and directories.
    pub(super) fn recordings(
        &self,
        paths: &[PathBuf],
        rate_hz: Option<f64>,
    ) -> Result<Vec<Recording>, FileError> {
        let (recordings, report) = recordings::read(
            paths,
            &ReadOptions {
                rate_hz,
                ..ReadOptions::default()
            },
        )?;
        self.doubt(report.all_warnings());
        report
            .files
            .iter()
            .for_each(|file| self.context.detail(file));
        Ok(recordings)
    }

    pub(super) fn doubt(&self, doubts: impl IntoIterator<Item = impl Display>) {
        doubts
            .into_iter()
            .for_each(|doubt| self.context.warn(doubt));
    }

    /// What paths of the study mean.
    pub(super) fn beside(&self, paths: &[PathBuf]) -> Vec<PathBuf> {
        paths.iter().map(|path| beside(self.study, path)).collect()
    }

    /// The files behind a list of recordings that do not make the errors of a truth.
    pub(super) fn others(
        &self,
        recordings: &[PathBuf],
        truth: &TruthEntry,
    ) -> Result<Vec<PathBuf>, StudyError> {
        let of_truth = hashes(&recordings::listed(&self.beside(&truth.recordings))?)?;
        let files = recordings::listed(&self.beside(recordings))?;
        // by their contents: the same file may be named in two ways
        let pairs = hashes(&files)?.into_iter().zip(&files);
        let others: Vec<PathBuf> = pairs
            .filter(|(hash, _)| !of_truth.contains(hash))
            .map(|(_, file)| file.clone())
            .collect();
        if others.is_empty() || others.len() == files.len() {
            return Err(StudyError::NothingLeftOut {
                truth: truth.name.clone(),
                left: others.len(),
            });
        }
        Ok(others)
    }

    /// Virtual recordings of the study, means removed: those of `nav-sim synthesize` with the same model and seed.
    pub(super) fn synthesised(
        &self,
        step: &Synthesis,
        seed: u64,
    ) -> Result<Vec<Recording>, StudyError> {
        let path = beside(self.study, &step.model);
        let file = self.model(&path)?;
        let contamination = self.contamination(step, file.model.rate_hz)?;
        if step.spread && file.spread.is_none() {
            let reason = "has no [spread], which \"spread = true\" draws from";
            return Err(StudyError::unfit(path.display(), reason));
        }
        let channels = Channel::named(&step.axes);
        if channels.is_empty() {
            let reason = format!(
                "axes = \"{}\" is not all, accel, gyro, x, y, z, or one channel such as accel.x",
                step.axes
            );
            return Err(StudyError::unfit("synthesize", reason));
        }
        let imu = VirtualImu {
            model: &file.model,
            spread: file.spread.as_ref().filter(|_| step.spread),
            contamination: contamination.as_ref(),
            seed: step.seed.unwrap_or(seed),
        };
        let recording = |replicate: u64| imu.recording(replicate, &channels, step.samples);
        let recordings: Result<_, ReplicateError> = (1..=step.replicates)
            .into_par_iter()
            .map(recording)
            .collect();
        recordings.map_err(|e| StudyError::unfit(path.display(), e))
    }

    fn contamination(
        &self,
        step: &Synthesis,
        rate_hz: f64,
    ) -> Result<Option<Contamination>, FileError> {
        let Some(name) = &step.contaminate else {
            return Ok(None);
        };
        let is_known = contamination_file::names().contains(&name.as_str());
        let place = if is_known {
            PathBuf::from(name)
        } else {
            beside(self.study, Path::new(name))
        };
        contamination_file::find(&place.to_string_lossy(), rate_hz).map(Some)
    }

    /// What makes the errors of a truth.
    pub(super) fn truth(&self, entry: &TruthEntry, seed: u64) -> Result<TruthSource, StudyError> {
        if let Some(model) = &entry.model {
            return Ok(TruthSource::Model(
                self.model(&beside(self.study, model))?.model,
            ));
        }
        let recordings = match &entry.synthesize {
            Some(step) => self.synthesised(step, seed.wrapping_add(TRUTH_SEED))?,
            None => self.recordings(&self.beside(&entry.recordings), entry.rate_hz)?,
        };
        Ok(TruthSource::Recordings(recordings))
    }

    /// Hash of what makes a truth: files, and how virtual recordings are made.
    pub(super) fn truth_hash(&self, entry: &TruthEntry, seed: u64) -> Result<String, FileError> {
        if let Some(model) = &entry.model {
            return input::fingerprint(&beside(self.study, model));
        }
        let mut hasher = blake3::Hasher::new();
        if let Some(rate_hz) = entry.rate_hz {
            hasher.update(&rate_hz.to_bits().to_le_bytes());
        }
        for hash in hashes(&input::listed(&self.beside(&entry.recordings))?)? {
            hasher.update(hash.as_bytes());
        }
        if let Some(step) = &entry.synthesize {
            hasher.update(
                self.synthesis_hash(step, seed.wrapping_add(TRUTH_SEED))?
                    .as_bytes(),
            );
        }
        Ok(hasher.finalize().to_hex().to_string())
    }

    fn synthesis_hash(&self, step: &Synthesis, seed: u64) -> Result<String, FileError> {
        let step = Synthesis {
            seed: Some(step.seed.unwrap_or(seed)),
            ..step.clone()
        };
        let model = beside(self.study, &step.model);
        let rate_hz = model_file::read(&model)?.model.rate_hz;
        let rules = self
            .contamination(&step, rate_hz)?
            .map(|contamination| contamination.rules);
        let identity = serde_json::json!([step, input::fingerprint(&model)?, rules]);
        Ok(hash::of_bytes(identity.to_string().as_bytes()))
    }
}

fn hashes(files: &[PathBuf]) -> Result<Vec<String>, FileError> {
    files.iter().map(|file| input::fingerprint(file)).collect()
}

/// Refuses a file that is not what it was when the study was planned.
pub(super) fn unchanged(path: &Path, blake3: &str) -> Result<(), StudyError> {
    if input::fingerprint(path)? == blake3 {
        return Ok(());
    }
    Err(StudyError::Changed {
        what: path.display().to_string(),
    })
}
