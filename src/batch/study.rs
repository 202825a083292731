//! The study file: what a grid of experiments is made of.

use super::StudyError;
use super::sweep::{OutageSet, Periodic, Random, Sweep, expand};
use crate::ekf::FilterStates;
use crate::scenario::{MAX_RUNS, Method, Scenario};
use crate::sensors::gnss::GnssSettings;
use crate::sensors::outage::Outage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A study. Every list is an axis of the grid; the study is their product.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Layout version: 1.
    #[serde(default = "one")]
    pub schema: u64,
    /// Monte-Carlo runs of each cell.
    #[serde(default = "hundred")]
    pub runs: u64,
    /// Seed of all random numbers; without it --seed, or one is drawn and kept in the plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// How the statistics are found.
    #[serde(default)]
    pub method: Method,
    /// What is kept and tabled; outages and their ratios by default.
    #[serde(default = "default_metrics")]
    pub metrics: Vec<Metric>,
    /// The candidate that ratios refer to (default: the first).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<String>,
    /// Runs of one unit of work; without it `batch plan` measures and aims at two minutes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit_runs: Option<u64>,
    /// Filter variants; by default the scenario's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub filters: Vec<FilterStates>,
    /// References to follow.
    #[serde(default)]
    pub trajectory: Vec<TrajectoryEntry>,
    /// What makes the inertial errors.
    #[serde(default)]
    pub truth: Vec<TruthEntry>,
    /// What filters believe.
    #[serde(default)]
    pub candidate: Vec<CandidateEntry>,
    /// Settings of the true IMU, the start, the receiver; by default the paper's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scenario: Vec<ScenarioEntry>,
    /// Receivers; by default the scenario's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gnss: Vec<GnssEntry>,
    /// Outage sets; by default the scenario's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outages: Vec<OutagesEntry>,
}

const fn one() -> u64 {
    1
}

const fn hundred() -> u64 {
    100
}

fn default_metrics() -> Vec<Metric> {
    vec![Metric::Outages, Metric::Ratios]
}

/// What is kept of the runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// Errors and standard deviations in and after each outage (always there).
    Outages,
    /// Ratios to the reference, NEES and coverage during outages: sums at the epochs of outages.
    Ratios,
    /// Everything at every epoch (1 Hz): the largest part of a study by far.
    Epochs,
}

/// `[[trajectory]]`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryEntry {
    /// Name in the results (default: the file's).
    #[serde(default)]
    pub name: String,
    /// Motion profile or table, relative to the study file.
    pub file: PathBuf,
}

/// `[[truth]]`: one of `model`, `recordings`, `synthesize`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruthEntry {
    /// Name in the results (default: that of the file).
    #[serde(default)]
    pub name: String,
    /// Noise model: errors are synthesised for each run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// Static recordings: each run takes a window of one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<PathBuf>,
    /// Recordings of a virtual IMU: each run takes a window of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub synthesize: Option<Synthesis>,
}

/// `[[candidate]]`: one of `model`, `calibrate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CandidateEntry {
    /// Name in the results (default: that of the file). A calibration with several estimators makes
    /// several candidates, `name/estimator`.
    #[serde(default)]
    pub name: String,
    /// Model file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// Calibrate here, when the study is planned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrate: Option<CalibrateStep>,
}

/// Recordings of a virtual IMU.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Synthesis {
    /// Model file, with `[spread]` if `spread` is wanted.
    pub model: PathBuf,
    /// How many recordings.
    #[serde(default = "one")]
    pub replicates: u64,
    /// Samples of each.
    #[serde(default = "paper_samples")]
    pub samples: usize,
    /// Whether each recording has parameters of its own.
    #[serde(default)]
    pub spread: bool,
    /// Signals: all, accel, gyro, x, accel.x, …
    #[serde(default = "all_axes")]
    pub axes: String,
    /// What goes wrong: a name (section5-II, …) or a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contaminate: Option<String>,
    /// Seed of the recordings (default: the study's + 1 for candidates, + 2 for truths, so that no run
    /// meets the numbers its filter was calibrated with).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

const fn paper_samples() -> usize {
    524_284
}

fn all_axes() -> String {
    "all".to_owned()
}

/// `calibrate = { … }`: recordings or `synthesize`, and how to estimate from them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrateStep {
    /// Static recordings, or directories of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<PathBuf>,
    /// Recordings of a virtual IMU instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub synthesize: Option<Synthesis>,
    /// awv, sr-awv, dr-awv; gmwm, rgmwm with a single recording.
    #[serde(default = "dr_awv")]
    pub estimators: Vec<String>,
    /// What is fitted: N1, N2 or any sum.
    #[serde(default = "n2")]
    pub fit: String,
    /// Replicates that dr-awv drops at each end of each scale (default: 30 %).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trim: Option<usize>,
    /// Efficiency of the robust wavelet variance.
    #[serde(default = "efficiency")]
    pub efficiency: f64,
}

fn dr_awv() -> Vec<String> {
    vec!["dr-awv".to_owned()]
}

fn n2() -> String {
    "N2".to_owned()
}

const fn efficiency() -> f64 {
    0.6
}

/// `[[scenario]]`: a scenario file or its keys. Of its `[run]` only `coverage_level` is used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScenarioEntry {
    /// Name in the results (default: that of the file).
    #[serde(default)]
    pub name: String,
    /// Scenario file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The same keys here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settings: Option<Scenario>,
}

/// `[[gnss]]`: a scenario file whose `[gnss]` is used, or its keys.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GnssEntry {
    /// Name in the results (default: that of the file).
    #[serde(default)]
    pub name: String,
    /// Scenario file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The same keys here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settings: Option<GnssSettings>,
}

/// `[[outages]]`: one of `windows`, `sweep`, `periodic`, `random`. The latter three take numbers or lists
/// of numbers and make one set for each combination.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutagesEntry {
    /// Name in the results; a sweep adds its values: `name(300,60)`.
    #[serde(default)]
    pub name: String,
    /// Windows one by one, together one set; an empty list is the set without outages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub windows: Option<Vec<Outage>>,
    /// A window of each start and duration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    /// Regular outages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub periodic: Option<Periodic>,
    /// Random outages, drawn once a set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub random: Option<Random>,
}

impl Study {
    /// Fills in names and defaults, and checks all that can be checked without opening another file.
    ///
    /// # Errors
    /// The key that is refused.
    pub fn resolve(&mut self) -> Result<(), StudyError> {
        self.name_all();
        self.check_numbers()?;
        self.check_axes()?;
        for (axis, names) in self.names() {
            unique(axis, &names)?;
        }
        self.outage_sets().map(|_| ())
    }

    fn name_all(&mut self) {
        self.trajectory.iter_mut().for_each(|e| name_after(&mut e.name, Some(&e.file)));
        for e in &mut self.truth {
            let synthesised = e.synthesize.as_ref().map(|s| &s.model);
            name_after(&mut e.name, e.model.as_ref().or(e.recordings.first()).or(synthesised));
        }
        for e in &mut self.candidate {
            let synthesised = e.calibrate.as_ref().and_then(|c| c.synthesize.as_ref()).map(|s| &s.model);
            let recorded = e.calibrate.as_ref().and_then(|c| c.recordings.first());
            name_after(&mut e.name, e.model.as_ref().or(recorded).or(synthesised));
        }
        self.scenario.iter_mut().for_each(|e| name_after(&mut e.name, e.file.as_ref()));
        self.gnss.iter_mut().for_each(|e| name_after(&mut e.name, e.file.as_ref()));
        for e in self.outages.iter_mut().filter(|e| e.name.is_empty()) {
            let kinds = [
                ("windows", e.windows.is_some()),
                ("sweep", e.sweep.is_some()),
                ("periodic", e.periodic.is_some()),
                ("random", e.random.is_some()),
            ];
            e.name = kinds.iter().find(|(_, there)| *there).map_or(String::new(), |(n, _)| (*n).to_owned());
        }
    }

    fn check_numbers(&self) -> Result<(), StudyError> {
        let refuse = |key: &str, value: String, reason: &str| Err(StudyError::refused(key, value, reason));
        if self.schema != 1 {
            return refuse(
                "schema",
                self.schema.to_string(),
                "is not a layout this version reads: it reads 1",
            );
        }
        if self.runs == 0 || self.runs > MAX_RUNS {
            let reason = format!("must lie between 1 and {MAX_RUNS}");
            return refuse("runs", self.runs.to_string(), &reason);
        }
        if self.unit_runs == Some(0) {
            return refuse("unit_runs", "0".into(), "must be at least 1");
        }
        if self.method != Method::MonteCarlo {
            return refuse(
                "method",
                "\"lincov\"".into(),
                "is not available in studies yet; use \"monte-carlo\"",
            );
        }
        if self.metrics.is_empty() {
            return refuse("metrics", "[]".into(), "is empty; choose of outages, ratios, epochs");
        }
        Ok(())
    }

    /// Every axis has something, and every entry says one thing.
    fn check_axes(&self) -> Result<(), StudyError> {
        let empty = |key: &str, there: bool| match there {
            true => Ok(()),
            false => Err(StudyError::Empty { axis: key.to_owned() }),
        };
        empty("trajectory", !self.trajectory.is_empty())?;
        empty("truth", !self.truth.is_empty())?;
        empty("candidate", !self.candidate.is_empty())?;
        for (i, e) in self.truth.iter().enumerate() {
            let said = [e.model.is_some(), !e.recordings.is_empty(), e.synthesize.is_some()];
            exactly_one("truth", i, &said, "model, recordings, synthesize")?;
        }
        for (i, e) in self.candidate.iter().enumerate() {
            exactly_one("candidate", i, &[e.model.is_some(), e.calibrate.is_some()], "model, calibrate")?;
            let Some(step) = &e.calibrate else { continue };
            let said = [!step.recordings.is_empty(), step.synthesize.is_some()];
            exactly_one("candidate.calibrate", i, &said, "recordings, synthesize")?;
            empty(&format!("candidate[{}].calibrate.estimators", i + 1), !step.estimators.is_empty())?;
        }
        for (i, e) in self.scenario.iter().enumerate() {
            exactly_one("scenario", i, &[e.file.is_some(), e.settings.is_some()], "file, settings")?;
        }
        for (i, e) in self.gnss.iter().enumerate() {
            exactly_one("gnss", i, &[e.file.is_some(), e.settings.is_some()], "file, settings")?;
        }
        let syntheses = self.syntheses();
        match syntheses.iter().find(|s| s.replicates == 0 || s.samples < 2) {
            Some(s) => {
                let value = format!("{} of {} samples", s.replicates, s.samples);
                Err(StudyError::refused("synthesize", value, "are no recordings"))
            }
            None => Ok(()),
        }
    }

    /// All virtual recordings.
    fn syntheses(&self) -> Vec<&Synthesis> {
        let of_candidates = self.candidate.iter().filter_map(|e| e.calibrate.as_ref()?.synthesize.as_ref());
        of_candidates.chain(self.truth.iter().filter_map(|e| e.synthesize.as_ref())).collect()
    }

    /// Names of every axis.
    fn names(&self) -> [(&'static str, Vec<&str>); 6] {
        [
            ("trajectory", self.trajectory.iter().map(|e| e.name.as_str()).collect()),
            ("truth", self.truth.iter().map(|e| e.name.as_str()).collect()),
            ("candidate", self.candidate.iter().map(|e| e.name.as_str()).collect()),
            ("scenario", self.scenario.iter().map(|e| e.name.as_str()).collect()),
            ("gnss", self.gnss.iter().map(|e| e.name.as_str()).collect()),
            ("outages", self.outages.iter().map(|e| e.name.as_str()).collect()),
        ]
    }

    /// The outage sets, sweeps written out; empty: those of the scenarios.
    ///
    /// # Errors
    /// The set that is refused.
    pub fn outage_sets(&self) -> Result<Vec<OutageSet>, StudyError> {
        let mut sets = Vec::new();
        for (i, entry) in self.outages.iter().enumerate() {
            sets.extend(expand(entry, i)?);
        }
        let names: Vec<&str> = sets.iter().map(|s| s.name.as_str()).collect();
        unique("outages", &names)?;
        Ok(sets)
    }

    /// The candidates, one a column: its entry and, for calibrations, its estimator.
    #[must_use]
    pub fn candidates(&self) -> Vec<(String, usize, Option<String>)> {
        let of = |(i, e): (usize, &CandidateEntry)| match &e.calibrate {
            None => vec![(e.name.clone(), i, None)],
            Some(step) if step.estimators.len() == 1 => {
                vec![(e.name.clone(), i, Some(step.estimators[0].clone()))]
            }
            Some(step) => {
                let one =
                    |estimator: &String| (format!("{}/{estimator}", e.name), i, Some(estimator.clone()));
                step.estimators.iter().map(one).collect()
            }
        };
        self.candidate.iter().enumerate().flat_map(of).collect()
    }

    /// Position of the reference among the candidates.
    ///
    /// # Errors
    /// When no candidate has that name.
    pub fn reference(&self) -> Result<usize, StudyError> {
        let candidates = self.candidates();
        let names: Vec<&str> = candidates.iter().map(|(name, ..)| name.as_str()).collect();
        unique("candidate", &names)?;
        let Some(wanted) = &self.reference else { return Ok(0) };
        let found = names.iter().position(|name| name == wanted);
        found.ok_or_else(|| StudyError::NoReference {
            reference: wanted.clone(),
            candidates: names.into_iter().map(str::to_owned).collect(),
        })
    }

    /// Files that the study names: what for, and where.
    #[must_use]
    pub fn files(&self) -> Vec<(&'static str, &Path)> {
        let mut files: Vec<(&'static str, &Path)> = Vec::new();
        files.extend(self.trajectory.iter().map(|e| ("trajectory", e.file.as_path())));
        for e in &self.truth {
            files.extend(e.model.iter().map(|p| ("truth", p.as_path())));
            files.extend(e.recordings.iter().map(|p| ("static", p.as_path())));
        }
        for e in &self.candidate {
            files.extend(e.model.iter().map(|p| ("model", p.as_path())));
            let recordings = e.calibrate.iter().flat_map(|c| &c.recordings);
            files.extend(recordings.map(|p| ("recording", p.as_path())));
        }
        files.extend(self.syntheses().into_iter().map(|s| ("virtual IMU", s.model.as_path())));
        files.extend(self.scenario.iter().filter_map(|e| Some(("scenario", e.file.as_deref()?))));
        files.extend(self.gnss.iter().filter_map(|e| Some(("gnss", e.file.as_deref()?))));
        files
    }

    /// Whether sums are kept at epochs outside outages too.
    #[must_use]
    pub fn keeps(&self, metric: Metric) -> bool {
        self.metrics.contains(&metric)
    }
}

/// The file's name without its ending, where no name was given.
fn name_after(name: &mut String, file: Option<&PathBuf>) {
    if name.is_empty()
        && let Some(stem) = file.and_then(|f| f.file_stem())
    {
        *name = stem.to_string_lossy().into_owned();
    }
}

fn unique(axis: &str, names: &[&str]) -> Result<(), StudyError> {
    if let Some(i) = names.iter().position(|n| n.trim().is_empty()) {
        return Err(StudyError::Unnamed { axis: axis.to_owned(), entry: i + 1 });
    }
    let mut seen = std::collections::HashSet::new();
    match names.iter().find(|name| !seen.insert(**name)) {
        Some(name) => Err(StudyError::Duplicate { axis: axis.to_owned(), name: (*name).to_owned() }),
        None => Ok(()),
    }
}

pub(super) fn exactly_one(
    axis: &str,
    entry: usize,
    said: &[bool],
    keys: &'static str,
) -> Result<(), StudyError> {
    if said.iter().filter(|s| **s).count() == 1 {
        return Ok(());
    }
    Err(StudyError::NotOne { axis: axis.to_owned(), entry: entry + 1, keys })
}
