//! The files of a study, read beside it; doubts become remarks.

use super::description::{Synthesis, TruthEntry};
use super::failure::StudyError;
use super::file::beside;
use super::prepare::Material;
use super::remark::Remark;
use crate::formats::model_file::{self, ModelFile};
use crate::formats::recordings::{self, ReadOptions};
use crate::formats::{contamination_file, hash, input, trajectory_file};
use crate::observer::Observer;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::Recording;
use nav_sim_signal::noise::Model;
use nav_sim_signal::noise::contamination::Contamination;
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
    pub(super) observer: &'a dyn Observer<Remark>,
}

impl Reader<'_> {
    pub(super) fn trajectory(&self, path: &Path) -> Result<Trajectory, StudyError> {
        let (trajectory, warnings) = trajectory_file::load(path, &trajectory_file::Options::default())?;
        self.doubt(warnings.iter().map(ToString::to_string));
        Ok(trajectory)
    }

    pub(super) fn model(&self, path: &Path) -> Result<ModelFile, StudyError> {
        let file = model_file::read(path)?;
        self.doubt(file.doubts(path));
        Ok(file)
    }

    /// The recordings that the study names.
    pub(super) fn recordings(
        &self,
        paths: &[PathBuf],
        rate_hz: Option<f64>,
    ) -> Result<Vec<Recording>, StudyError> {
        self.recordings_in(&self.beside_all(paths), rate_hz)
    }

    /// The recordings in files and directories.
    pub(super) fn recordings_in(
        &self,
        paths: &[PathBuf],
        rate_hz: Option<f64>,
    ) -> Result<Vec<Recording>, StudyError> {
        let (recordings, report) =
            recordings::read(paths, &ReadOptions { rate_hz, ..ReadOptions::default() })?;
        self.doubt(report.doubts());
        for file in &report.files {
            self.observer.remark(&Remark::InputRead(file.to_string()));
        }
        Ok(recordings)
    }

    pub(super) fn doubt(&self, doubts: impl IntoIterator<Item = String>) {
        doubts.into_iter().for_each(|doubt| self.observer.remark(&Remark::InputDoubt(doubt)));
    }

    /// The files behind a list of recordings, directories in name order.
    pub(super) fn listed(&self, recordings: &[PathBuf]) -> Result<Vec<PathBuf>, StudyError> {
        Ok(input::listed(&self.beside_all(recordings))?)
    }

    /// The files behind a list of recordings that do not make the errors of a truth.
    pub(super) fn others(
        &self,
        recordings: &[PathBuf],
        truth: &TruthEntry,
    ) -> Result<Vec<PathBuf>, StudyError> {
        let of_truth: Vec<String> = hashes(&recordings::listed(&self.beside_all(&truth.recordings))?)?;
        let mut files = recordings::listed(&self.beside_all(recordings))?;
        let all = files.len();
        // by their contents: the same file may be named in two ways
        let same = hashes(&files)?;
        let mut is_other = same.iter().map(|hash| !of_truth.contains(hash));
        files.retain(|_| is_other.next().unwrap_or(true));
        if files.is_empty() || files.len() == all {
            return Err(StudyError::NothingLeftOut { truth: truth.name.clone(), left: files.len() });
        }
        Ok(files)
    }

    fn beside_all(&self, paths: &[PathBuf]) -> Vec<PathBuf> {
        paths.iter().map(|path| beside(self.study, path)).collect()
    }

    /// Virtual recordings of the study.
    pub(super) fn synthesised(&self, step: &Synthesis, seed: u64) -> Result<Vec<Recording>, StudyError> {
        let file = self.model(&beside(self.study, &step.model))?;
        let contamination = self.contamination(step, file.model.rate_hz)?;
        if step.spread && file.spread.is_none() {
            return Err(StudyError::NoSpread { model: step.model.clone() });
        }
        let (spread, contamination) = (file.spread.as_ref(), contamination.as_ref());
        Ok(Material { step, model: &file.model, spread, contamination, seed }.recordings()?)
    }

    fn contamination(&self, step: &Synthesis, rate_hz: f64) -> Result<Option<Contamination>, StudyError> {
        let Some(name) = &step.contaminate else { return Ok(None) };
        let found = if contamination_file::names().contains(&name.as_str()) {
            contamination_file::find(name, rate_hz)
        } else {
            contamination_file::find(&beside(self.study, Path::new(name)).to_string_lossy(), rate_hz)
        };
        Ok(Some(found?))
    }

    /// What makes the errors of a truth.
    pub(super) fn truth(&self, entry: &TruthEntry, seed: u64) -> Result<TruthSource, StudyError> {
        if let Some(model) = &entry.model {
            return Ok(TruthSource::Model(self.model(&beside(self.study, model))?.model));
        }
        let recordings = match &entry.synthesize {
            Some(step) => self.synthesised(step, seed.wrapping_add(TRUTH_SEED))?,
            None => self.recordings(&entry.recordings, entry.rate_hz)?,
        };
        Ok(TruthSource::Recordings(recordings))
    }

    /// Hash of what makes a truth: files, and how virtual recordings are made.
    pub(super) fn truth_hash(&self, entry: &TruthEntry, seed: u64) -> Result<String, StudyError> {
        if let Some(model) = &entry.model {
            return Ok(input::fingerprint(&beside(self.study, model))?);
        }
        let mut hasher = blake3::Hasher::new();
        if let Some(rate_hz) = entry.rate_hz {
            hasher.update(&rate_hz.to_bits().to_le_bytes());
        }
        for file in self.listed(&entry.recordings)? {
            hasher.update(input::fingerprint(&file)?.as_bytes());
        }
        if let Some(step) = &entry.synthesize {
            hasher.update(self.synthesis_hash(step, seed.wrapping_add(TRUTH_SEED))?.as_bytes());
        }
        Ok(hasher.finalize().to_hex().to_string())
    }

    fn synthesis_hash(&self, step: &Synthesis, seed: u64) -> Result<String, StudyError> {
        let mut step = step.clone();
        step.seed = Some(step.seed.unwrap_or(seed));
        let model = beside(self.study, &step.model);
        let rate_hz = model_file::read(&model)?.model.rate_hz;
        let rules = self.contamination(&step, rate_hz)?.map(|contamination| contamination.rules);
        let identity = serde_json::json!([step, input::fingerprint(&model)?, rules]);
        Ok(hash::of_bytes(identity.to_string().as_bytes()))
    }
}

fn hashes(files: &[PathBuf]) -> Result<Vec<String>, StudyError> {
    files.iter().map(|file| Ok(input::fingerprint(file)?)).collect()
}
