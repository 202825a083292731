//! The study file: what a grid of experiments is made of.

use super::error::DescriptionError;
use super::rules::unique;
use super::sweep::{OutageSet, OutagesEntry, expand};
use nav_sim_calibration::{Estimator, ModelSpec, Pool, Weighting};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::scenario::{MAX_RUNS, Method, Scenario};
use nav_sim_navigation::sensors::gnss::GnssSettings;
use nav_sim_signal::imu::MAX_RATE_HZ;
use nav_sim_signal::units::Positive;
use nav_sim_signal::wavelet::{Convention, Tuning};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A study. Every list is an axis of the grid; the study is their product.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Study {
    /// Layout version: 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 1))]
    pub schema: u64,
    /// Monte-Carlo runs of each cell; a covariance analysis needs none.
    #[serde(default = "hundred")]
    #[schemars(range(min = 1, max = MAX_RUNS))]
    pub runs: u64,
    /// Seed of all random numbers; without it --seed, or one is drawn and kept in the plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// How the statistics are found: by runs, or by covariance analysis, which needs models of what makes the errors.
    #[serde(default)]
    pub method: Method,
    /// What is kept and tabled; outages and their ratios by default.
    #[serde(default = "default_metrics")]
    pub metrics: Vec<Metric>,
    /// The candidate that ratios refer to (default: the first). Ratios are taken within a filter variant: to
    /// the reference with the same filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<String>,
    /// Runs of one unit of work; without it `batch plan` measures and aims at two minutes.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1))]
    pub unit_runs: Option<u64>,
    /// Filter variants, each once; by default the scenario's.
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

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks by reference")]
const fn is_false(value: &bool) -> bool {
    !*value
}

fn default_metrics() -> Vec<Metric> {
    vec![Metric::Outages, Metric::Ratios]
}

/// What is kept of the runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Metric {
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
pub(crate) struct TrajectoryEntry {
    /// Name in the results (default: the file's).
    #[serde(default)]
    pub name: String,
    /// Motion profile or table, relative to the study file.
    pub file: PathBuf,
}

/// `[[truth]]`: one of `model`, `recordings`, `synthesize`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TruthEntry {
    /// Name in the results (default: that of the file).
    #[serde(default)]
    pub name: String,
    /// Noise model: errors are synthesised for each run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// Static recordings: each run takes a window of one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<PathBuf>,
    /// Whether each of the recordings is a truth of its own, named after its file.
    #[serde(default, skip_serializing_if = "is_false")]
    pub each: bool,
    /// Sample rate of recordings without a time column (Hz).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Positive>", range(max = MAX_RATE_HZ))]
    pub rate_hz: Option<f64>,
    /// Recordings of a virtual IMU: each run takes a window of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub synthesize: Option<Synthesis>,
}

/// `[[candidate]]`: one of `model`, `calibrate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CandidateEntry {
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
pub(crate) struct Synthesis {
    /// Model file, with `[spread]` if `spread` is wanted.
    pub model: PathBuf,
    /// How many recordings.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub replicates: u64,
    /// Samples of each.
    #[serde(default = "paper_samples")]
    #[schemars(range(min = Synthesis::LEAST_SAMPLES))]
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

impl Synthesis {
    /// Fewer samples have no variance.
    pub(super) const LEAST_SAMPLES: usize = 2;
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
pub(crate) struct CalibrateStep {
    /// Static recordings, or directories of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<PathBuf>,
    /// Whether the recordings that make the errors of a cell are left out: one calibration a truth.
    #[serde(default, skip_serializing_if = "is_false")]
    pub leave_out: bool,
    /// Sample rate of recordings without a time column (Hz).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Positive>", range(max = MAX_RATE_HZ))]
    pub rate_hz: Option<f64>,
    /// Recordings of a virtual IMU instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub synthesize: Option<Synthesis>,
    /// awv, sr-awv, dr-awv; gmwm, rgmwm, avlr with a single recording.
    #[serde(default = "estimators")]
    pub estimators: Vec<Estimator>,
    /// What is fitted: N1, N2 or any sum.
    #[serde(default = "usual_model")]
    pub fit: String,
    /// Replicates that dr-awv drops at each end of each scale (default: 30 %).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trim: Option<usize>,
    /// Efficiency of the robust wavelet variance.
    #[serde(default = "efficiency")]
    #[schemars(range(min = Tuning::EFFICIENCIES.0, max = Tuning::EFFICIENCIES.1))]
    pub efficiency: f64,
    /// How the tuning constant follows from it: exact, or wv as the R packages have it (default: exact).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub efficiency_convention: Option<Convention>,
    /// What a scale counts: model, edof, ci, none or full (default: model).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighting: Option<Weighting>,
    /// Which signals are replicates of one another: sensor or axes (default: sensor; of a single recording axes).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pool: Option<Pool>,
    /// Number of scales (default: of each signal one less than its length allows).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scales: Option<u32>,
}

fn estimators() -> Vec<Estimator> {
    vec![Estimator::default()]
}

fn usual_model() -> String {
    ModelSpec::USUAL.to_owned()
}

const fn efficiency() -> f64 {
    Tuning::DEFAULT_EFFICIENCY
}

/// `[[scenario]]`: a scenario file or its keys. Of its `[run]` only `coverage_level` is used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ScenarioEntry {
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
pub(crate) struct GnssEntry {
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

impl CandidateEntry {
    /// Whether it is calibrated without the recordings that make the errors.
    pub(super) fn leaves_out(&self) -> bool {
        self.calibrate.as_ref().is_some_and(|step| step.leave_out)
    }
}

impl Study {
    /// All virtual recordings, with their keys.
    pub(super) fn syntheses(&self) -> Vec<(String, &Synthesis)> {
        let of_candidates = self.candidate.iter().enumerate().filter_map(|(i, e)| {
            Some((
                format!("candidate[{}].calibrate.synthesize", i + 1),
                e.calibrate.as_ref()?.synthesize.as_ref()?,
            ))
        });
        let of_truths = self.truth.iter().enumerate();
        let of_truths = of_truths.filter_map(|(i, e)| {
            Some((
                format!("truth[{}].synthesize", i + 1),
                e.synthesize.as_ref()?,
            ))
        });
        of_candidates.chain(of_truths).collect()
    }

    /// The outage sets, sweeps written out; empty: those of the scenarios.
    ///
    /// # Errors
    /// The set that is refused.
    pub(crate) fn outage_sets(&self) -> Result<Vec<OutageSet>, DescriptionError> {
        let mut sets = Vec::new();
        for (i, entry) in self.outages.iter().enumerate() {
            sets.extend(expand(entry, i)?.into_iter().map(|set| (i, set)));
        }
        let names: Vec<(usize, &str)> = sets
            .iter()
            .map(|(i, set)| (*i, set.name.as_str()))
            .collect();
        unique("outages", &names)?;
        Ok(sets.into_iter().map(|(_, set)| set).collect())
    }

    /// The candidates, one a column: its entry and, for calibrations, its estimator.
    pub(crate) fn candidates(&self) -> Vec<(String, usize, Option<Estimator>)> {
        let labels_of_entry = |(i, e): (usize, &CandidateEntry)| match &e.calibrate {
            None => vec![(e.name.clone(), i, None)],
            Some(step) if step.estimators.len() == 1 => {
                vec![(e.name.clone(), i, Some(step.estimators[0]))]
            }
            Some(step) => {
                let label = |estimator: &Estimator| {
                    (format!("{}/{estimator}", e.name), i, Some(*estimator))
                };
                step.estimators.iter().map(label).collect()
            }
        };
        self.candidate
            .iter()
            .enumerate()
            .flat_map(labels_of_entry)
            .collect()
    }

    /// Whether a candidate is calibrated without the recordings that make the errors.
    pub(crate) fn leaves_out(&self) -> bool {
        self.candidate.iter().any(CandidateEntry::leaves_out)
    }

    /// Position of the reference among the candidates.
    ///
    /// # Errors
    /// When no candidate has that name.
    pub(crate) fn reference(&self) -> Result<usize, DescriptionError> {
        let candidates = self.candidates();
        let names: Vec<(usize, &str)> = candidates
            .iter()
            .map(|(name, i, _)| (*i, name.as_str()))
            .collect();
        unique("candidate", &names)?;
        let Some(wanted) = &self.reference else {
            return Ok(0);
        };
        let found = candidates.iter().position(|(name, ..)| name == wanted);
        found.ok_or_else(|| DescriptionError::NoReference {
            reference: wanted.clone(),
            candidates: candidates.into_iter().map(|(name, ..)| name).collect(),
        })
    }

    /// Files that the study names: what for, and where.
    pub(crate) fn files(&self) -> Vec<(&'static str, &Path)> {
        let mut files: Vec<(&'static str, &Path)> = Vec::new();
        files.extend(
            self.trajectory
                .iter()
                .map(|e| ("trajectory", e.file.as_path())),
        );
        for e in &self.truth {
            files.extend(e.model.iter().map(|p| ("truth", p.as_path())));
            files.extend(e.recordings.iter().map(|p| ("static", p.as_path())));
        }
        for e in &self.candidate {
            files.extend(e.model.iter().map(|p| ("model", p.as_path())));
            let recordings = e.calibrate.iter().flat_map(|c| &c.recordings);
            files.extend(recordings.map(|p| ("recording", p.as_path())));
        }
        files.extend(
            self.syntheses()
                .into_iter()
                .map(|(_, s)| ("virtual IMU", s.model.as_path())),
        );
        files.extend(
            self.scenario
                .iter()
                .filter_map(|e| Some(("scenario", e.file.as_deref()?))),
        );
        files.extend(
            self.gnss
                .iter()
                .filter_map(|e| Some(("gnss", e.file.as_deref()?))),
        );
        files
    }

    /// Whether runs are made.
    pub(crate) const fn is_sampled(&self) -> bool {
        !matches!(self.method, Method::Lincov)
    }

    /// Runs of each cell; a covariance analysis counts as one.
    pub(crate) const fn runs_of_cell(&self) -> u64 {
        if self.is_sampled() { self.runs } else { 1 }
    }

    /// Whether sums are kept at epochs outside outages too.
    pub(crate) fn keeps(&self, metric: Metric) -> bool {
        self.metrics.contains(&metric)
    }
}
