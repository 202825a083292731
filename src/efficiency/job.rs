//! A Monte-Carlo study of the estimators themselves, set by set, from which it goes on when it was stopped.

use super::directory::{Layout, StudyDirectory};
use super::{EfficiencyFile, EfficiencyRow};
use crate::formats::FileError;
use crate::jobs::JobError;
use nav_sim_calibration::efficiency::{
    Accuracy, Design, Estimate, Movement, StudyError, Target, abnormal_curve, accuracy,
    outlier_curve, target,
};
use nav_sim_signal::noise::{Process, contamination::Contamination};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// A study, and what its estimators aim at.
#[derive(Debug)]
pub(crate) struct EstimatorStudy {
    /// The design. Its seed may be set before the first estimate.
    pub design: Design,
    aim: Target,
}

impl EstimatorStudy {
    /// A study of that design.
    ///
    /// # Errors
    /// When the design means no study.
    pub(crate) fn new(design: Design) -> Result<Self, StudyError> {
        design.check()?;
        Ok(Self {
            aim: target(&design)?,
            design,
        })
    }

    /// Opens or makes the directory of the study.
    ///
    /// # Errors
    /// When it is of another study, damaged, or cannot be written to.
    pub(crate) fn open(&self, path: &Path) -> Result<StudyDirectory, FileError> {
        StudyDirectory::open(
            path,
            &identity(&self.design),
            layout(&self.design, &self.aim),
        )
    }

    /// Estimates from the sets that are not done yet, block by block of so many: a block is kept as soon as it is done.
    ///
    /// # Errors
    /// When a set has no estimates, or the disk is full.
    pub(crate) fn estimate(
        &self,
        sets: u64,
        block: u64,
        directory: &mut StudyDirectory,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<(), JobError> {
        let mut next = directory.done.len() as u64;
        while next < sets {
            let end = sets.min(next + block);
            let estimates_of = |set: u64| {
                let estimates = self.design.set(set);
                progress(1);
                estimates
            };
            let estimates: Vec<Result<Vec<Estimate>, StudyError>> =
                (next..end).into_par_iter().map(estimates_of).collect();
            directory.append(estimates.into_iter().collect::<Result<Vec<_>, _>>()?)?;
            next = end;
        }
        Ok(())
    }

    /// What so many sets tell.
    #[must_use]
    pub(crate) fn results(&self, sets: u64, directory: &StudyDirectory) -> EfficiencyFile {
        let results = rows(&self.design, &self.aim, &directory.done[..sets as usize]);
        EfficiencyFile {
            schema_version: 1,
            sets,
            study: identity(&self.design),
            results,
        }
    }

    /// How far one outlier or abnormal replicates move each estimate, as CSV: disturbance, size, estimator, parameter,
    /// relative change.
    ///
    /// # Errors
    /// When a disturbed set has no estimates.
    pub(crate) fn sensitivity(&self) -> Result<String, StudyError> {
        sensitivity(&self.design, &self.aim)
    }
}

/// What makes a study this one and no other. The number of sets does not: a study can be extended.
fn identity(design: &Design) -> Value {
    let hash = |what: Value| blake3::hash(what.to_string().as_bytes()).to_hex()[..16].to_owned();
    let scenario = |s: &Contamination| json!({ "name": s.name, "hash": hash(json!(s.rules)) });
    let axis = design.channel.index();
    json!({
        "schema_version": 1,
        "nav_sim": env!("CARGO_PKG_VERSION"),
        "seed": design.seed,
        "axis": design.channel.to_string(),
        "model": hash(json!([design.model.axes[axis], design.spread.axes[axis]])),
        "rate_hz": design.model.rate_hz,
        "replicates": design.replicates,
        "samples": design.samples,
        "levels": design.levels,
        "scenarios": design.scenarios.iter().map(scenario).collect::<Vec<_>>(),
        "estimators": design.estimators.iter().map(|e| e.name()).collect::<Vec<_>>(),
        "fit": design.spec.to_string(),
        "trim": design.trim.count(design.replicates as usize),
        "efficiency": design.tuning.efficiency(),
        "weighting": design.weighting.name(),
    })
}

fn layout(design: &Design, aim: &Target) -> Layout {
    let row = |(s, e): (&Contamination, &str)| (s.name.clone(), e.to_owned());
    let rows_of_scenario = |s| design.estimators.iter().map(move |e| row((s, e.name())));
    let rows = design.scenarios.iter().flat_map(rows_of_scenario).collect();
    Layout {
        rows,
        parameters: Design::parameters(&aim.fit.composite),
    }
}

/// How far the estimates of all sets are from what they aim at.
fn rows(design: &Design, aim: &Target, sets: &[Vec<Estimate>]) -> Vec<EfficiencyRow> {
    let names = Design::parameters(&aim.fit.composite);
    let targets = Design::values(&aim.fit.composite);
    let width = design.estimators.len();
    let mut rows = Vec::new();
    for (s, scenario) in design.scenarios.iter().enumerate() {
        let estimates = |e: usize, p: usize| {
            sets.iter()
                .map(|set| set[s * width + e].theta[p])
                .collect::<Vec<_>>()
        };
        let judge = |e: usize, p: usize| accuracy(&estimates(e, p), targets[p], design.seed);
        let cells: Vec<(usize, usize)> = (0..width)
            .flat_map(|e| (0..names.len()).map(move |p| (e, p)))
            .collect();
        let judged: Vec<Accuracy> = cells.par_iter().map(|(e, p)| judge(*e, *p)).collect();
        for ((e, p), own) in cells.into_iter().zip(&judged) {
            let roots: usize = sets.iter().map(|set| set[s * width + e].without_root).sum();
            let variances = sets.len() as f64 * design.replicates as f64 * f64::from(design.levels);
            let (ratio, ratio_se) = own.ratio_to(&judged[p]);
            rows.push(EfficiencyRow {
                scenario: scenario.name.clone(),
                estimator: design.estimators[e].name().to_owned(),
                parameter: names[p].clone(),
                target: targets[p],
                accuracy: own.clone(),
                ratio,
                ratio_se,
                zeros: estimates(e, p).iter().filter(|v| **v <= 0.0).count(),
                without_root: roots as f64 / variances,
            });
        }
    }
    rows
}

fn sensitivity(design: &Design, aim: &Target) -> Result<String, StudyError> {
    let names = Design::parameters(&aim.fit.composite);
    let noise = design.model.axis(design.channel);
    let white = noise.processes.iter().find_map(|p| match p {
        Process::White(white) => Some(white.sigma2()),
        _ => None,
    });
    // An outlier's unit: the standard deviation of the white noise, or of what the first scale sees.
    let unit = white.unwrap_or_else(|| 2.0 * noise.haar_wv(1)).sqrt();
    let outliers: Vec<f64> = (0..=9).map(|k| 10_f64.powi(k)).collect();
    let factors: Vec<f64> = (0..=10).map(|k| 4_f64.powi(k)).collect();
    let mut curves = vec![(
        "outlier_in_sigmas".to_owned(),
        outlier_curve(design, unit, &outliers)?,
    )];
    let walks = noise
        .processes
        .iter()
        .any(|p| matches!(p, Process::RandomWalk(_)));
    let most = design.trim.count(design.replicates as usize) as u64 + 1;
    for count in (1..=most).filter(|_| walks) {
        let name = format!("random_walk_variance_factor_of_{count}");
        curves.push((name, abnormal_curve(design, count, &factors)?));
    }
    let mut text = "disturbance,size,estimator,parameter,relative_change\n".to_owned();
    for (disturbance, curve) in &curves {
        for Movement { size, changes } in curve {
            for (estimator, changes) in design.estimators.iter().zip(changes) {
                for (name, change) in names.iter().zip(changes) {
                    text += &format!(
                        "{disturbance},{size},{},{name},{change:e}\n",
                        estimator.name()
                    );
                }
            }
        }
    }
    Ok(text)
}
