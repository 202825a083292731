//! Run directories → ratios between runs.

use super::{Comparison, RatioCurves};
use crate::app::Manifest;
use crate::formats::run_directory;
use crate::formats::run_directory::RunDirectory;
use crate::jobs::JobError;
use crate::report::{CandidateResult, Label};
use nav_sim_navigation::metrics;
use nav_sim_navigation::scenario::Method;
use std::path::{Path, PathBuf};

/// Compares runs with a reference; `states` are shown.
///
/// # Errors
/// When a directory cannot be read, or is of something else.
pub(crate) fn compare(
    runs: &[PathBuf],
    reference: &Path,
    states: Vec<usize>,
) -> Result<Comparison, JobError> {
    let name = reference.display().to_string();
    let directory = run_directory::read(reference)?;
    let (mut candidates, mut curves, mut doubts) = (Vec::new(), Vec::new(), Vec::new());
    for path in runs {
        let run = path.display().to_string();
        let candidate = run_directory::read(path)?;
        let differences = differences(&candidate, &directory);
        let doubt = |what: &&str| {
            format!("{run}: {what} not that of the reference; the runs are not paired")
        };
        // two covariance analyses have no runs that could be paired, and nothing by chance that pairing would take away
        if !(candidate.experiment.is_expected && directory.experiment.is_expected) {
            doubts.extend(differences.iter().map(doubt));
        }
        let is_reference = is_same_place(path, reference);
        curves.push(RatioCurves::of(
            &candidate.experiment,
            &directory.experiment,
        ));
        candidates.push(compared(
            run,
            &candidate,
            &directory,
            differences.is_empty(),
            is_reference,
        )?);
    }
    let outages = directory.experiment.outages;
    let comparison = Comparison::new((&name, &directory.verdict), candidates, curves, outages);
    Ok(Comparison {
        doubts,
        states,
        ..comparison
    })
}

/// One run.
fn compared(
    run: String,
    candidate: &RunDirectory,
    reference: &RunDirectory,
    is_paired: bool,
    is_reference: bool,
) -> Result<CandidateResult, JobError> {
    if candidate.manifest.hashes("trajectory") != reference.manifest.hashes("trajectory") {
        return Err(JobError::OtherTrajectory { run });
    }
    let outages = metrics::compare(&candidate.experiment, &reference.experiment, is_paired);
    let mut outages = outages.map_err(|source| JobError::Ratio {
        run: run.clone(),
        source,
    })?;
    // the reference is itself, whatever its calibration leaves open
    if !is_reference {
        let open = candidate
            .asee_mean_ci95
            .iter()
            .zip(&reference.asee_mean_ci95);
        for (outage, ends) in outages.iter_mut().zip(open) {
            if let (Some(interval), Some(of_reference)) = ends {
                outage.widen(interval, of_reference);
            }
        }
    }
    let label = Label::of(&run, candidate.origin.model.estimator.as_deref());
    Ok(CandidateResult {
        run,
        label,
        is_reference,
        is_paired,
        verdict: candidate.verdict,
        outages,
    })
}

/// What makes two runs differ beside the model in the filter; then run k did not see the same noise.
fn differences(candidate: &RunDirectory, reference: &RunDirectory) -> Vec<&'static str> {
    let (c, r) = (
        &candidate.origin.configuration,
        &reference.origin.configuration,
    );
    let (candidate, reference) = (&candidate.manifest, &reference.manifest);
    let is_expected = [c, r].map(|manifest| manifest.run.method == Method::Lincov);
    let all = [
        ("the method is", is_expected[0] != is_expected[1]),
        // covariance analysis draws nothing, and so differs in nothing by its seed
        (
            "the seed is",
            is_expected == [false, false] && candidate.seed != reference.seed,
        ),
        (
            "what makes the errors is",
            truth(candidate) != truth(reference),
        ),
        ("[imu] is", c.imu != r.imu),
        ("[gnss] is", c.gnss != r.gnss),
        ("[initial] is", c.initial != r.initial),
    ];
    all.into_iter()
        .filter_map(|(what, differs)| differs.then_some(what))
        .collect()
}

/// What made the INS errors: a recording, a model, or the filter's own.
fn truth(manifest: &Manifest) -> Vec<&str> {
    let given = ["static", "truth", "model"].map(|role| manifest.hashes(role));
    given
        .into_iter()
        .find(|hashes| !hashes.is_empty())
        .unwrap_or_default()
}

fn is_same_place(a: &Path, b: &Path) -> bool {
    a.canonicalize()
        .ok()
        .zip(b.canonicalize().ok())
        .is_some_and(|(a, b)| a == b)
}
