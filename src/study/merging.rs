//! Merging: units to tables.

use super::MergedStudy;
use super::cell_tables::CellTables;
use super::description::Metric;
use super::failure::StudyError;
use super::file::beside;
use super::leave_one_out::Folds;
use super::plan::NamedUnit;
use super::planned::Planned;
use super::tables::Tables;
use crate::app::Context;
use crate::formats::FileError;
use crate::formats::atomic::{AtomicDir, Claim, Existing, Found, claim_directory};
use crate::report;
use nav_sim_document::Document;
use nav_sim_navigation::simulation::REPORTED_NAMES;
use rayon::prelude::*;
use serde_json::json;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// How to merge.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MergeOptions {
    /// States (positions in [`REPORTED_NAMES`]) in the tables for people; the files have all.
    pub states: Vec<usize>,
    /// Threads that work.
    pub threads: usize,
}

/// What a merge made.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MergeReport {
    /// The directory of the tables.
    pub results: PathBuf,
    /// What is said and drawn of it.
    pub document: Document,
    /// `study.json`: where the results are from.
    pub summary: serde_json::Value,
    /// Runs that diverged; they are in no number.
    pub diverged: u64,
}

/// Makes the tables of a finished study in `results/`, the same bytes however it was run.
///
/// # Errors
/// When an input has changed, or units are missing or damaged ([`StudyError::Incomplete`]): nothing is written then.
pub fn merge(
    planned: &Planned,
    options: &MergeOptions,
    context: &Context<'_>,
) -> Result<MergeReport, StudyError> {
    planned.inputs_unchanged()?;
    planned.remark_foreign(context)?;
    let units = planned.plan.named_units(&planned.grid);
    let missing = planned.missing()?;
    if !missing.is_empty() {
        return Err(StudyError::Incomplete {
            units: units.len(),
            missing,
        });
    }
    let results = planned.directory.join("results");
    let _own = claimed(planned, &results)?;
    let mut out = AtomicDir::create(&results)?;
    let mut tables = Tables::create(&mut out, planned)?;
    let mut merged = subject(planned, &options.states);
    let mut folds = Folds::default();
    let diverged = match gather(
        planned,
        &units,
        options.threads,
        &mut tables,
        &mut merged,
        &mut folds,
    )? {
        Ok(diverged) => diverged,
        Err(missing) => {
            return Err(StudyError::Incomplete {
                units: units.len(),
                missing,
            });
        }
    };
    tables.finish()?;
    merged.rankings = folds.ranked(planned);
    let document = merged.document();
    out.write("report.html", document.html())?;
    if !merged.rankings.is_empty() {
        let rankings: Vec<&serde_json::Value> =
            merged.rankings.iter().map(|place| &place.json).collect();
        out.write(
            "ranking.json",
            report::json(&json!({ "schema_version": 1, "rankings": rankings })),
        )?;
    }
    let summary = summary(planned, units.len(), diverged);
    out.write("study.json", report::json(&summary))?;
    remove_stale(planned)?;
    out.commit()?;
    Ok(MergeReport {
        results,
        document,
        summary,
        diverged,
    })
}

/// The directory of the tables for this merge, new or of an earlier one: somebody else's files stay.
fn claimed(planned: &Planned, results: &Path) -> Result<Claim, StudyError> {
    let files = [
        "outages.csv",
        "outages.json",
        "runs.csv",
        "epochs.csv",
        "report.html",
        "ranking.json",
        "study.json",
    ];
    let inputs = planned
        .plan
        .inputs
        .iter()
        .map(|input| beside(&planned.study, Path::new(&input.path)));
    let inputs: Vec<PathBuf> = inputs.collect();
    let recognise = |text: &str| {
        let made: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
        Ok(if made.get("plan").is_some_and(|plan| plan.is_string()) {
            Found::Same
        } else {
            Found::Foreign
        })
    };
    let inputs = inputs.iter().map(PathBuf::as_path);
    Ok(claim_directory(
        results,
        &files,
        inputs,
        Existing::Replace,
        recognise,
    )?)
}

/// Takes cell by cell into the tables, in their order, as long as no unit is damaged; how many runs diverged, or all units
/// that are damaged.
fn gather(
    planned: &Planned,
    units: &[NamedUnit],
    threads: usize,
    tables: &mut Tables,
    merged: &mut MergedStudy,
    folds: &mut Folds,
) -> Result<Result<u64, Vec<NamedUnit>>, StudyError> {
    let cells: Vec<&[NamedUnit]> = units.chunk_by(|a, b| a.0.cell == b.0.cell).collect();
    let mut damaged = Vec::new();
    let mut diverged = 0;
    for wave in cells.chunks(cells_at_once(planned, threads)) {
        let found: Vec<Result<Result<CellTables, Vec<NamedUnit>>, StudyError>> = wave
            .par_iter()
            .map(|units| CellTables::make(planned, units))
            .collect();
        for cell in found {
            match cell? {
                Ok(cell) if damaged.is_empty() => {
                    diverged += cell.diverged;
                    tables.add(&cell)?;
                    folds.add(planned, &cell);
                    merged.add(cell.shown);
                }
                Ok(_) => {}
                Err(units) => damaged.extend(units),
            }
        }
    }
    Ok(if damaged.is_empty() {
        Ok(diverged)
    } else {
        Err(damaged)
    })
}

/// A merged study without cells.
fn subject(planned: &Planned, states: &[usize]) -> MergedStudy {
    let study = &planned.plan.study;
    let same = if study.filters.len() > 1 {
        " with the same filter"
    } else {
        ""
    };
    let runs = match study.is_sampled() {
        true => format!("{} runs a cell", study.runs),
        false => "covariance analysis".to_owned(),
    };
    let name = planned
        .study
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    MergedStudy {
        subject: format!(
            "study {name} on {}, {runs}",
            planned.grid.trajectories.join(", ")
        ),
        reference: format!("{}{same}", planned.reference().1),
        states: states.to_vec(),
        cells: Vec::new(),
        more: 0,
        rankings: Vec::new(),
    }
}

/// Cells that are held in memory together.
fn cells_at_once(planned: &Planned, threads: usize) -> usize {
    const MEMORY: f64 = 1e8;
    let cells = planned.grid.len().max(1) as f64;
    let bytes_of_cell = 3.0 * planned.plan.estimate.bytes / cells + 1e4;
    ((MEMORY / bytes_of_cell) as usize).clamp(1, 64 * threads.max(1))
}

/// Removes tables of an earlier plan that this one does not write; all others are replaced.
fn remove_stale(planned: &Planned) -> Result<(), StudyError> {
    let epochs: &[&str] = if planned.plan.study.keeps(Metric::Epochs) {
        &[]
    } else {
        &["epochs.csv", "epochs.parquet"]
    };
    let ranking: &[&str] = if planned.plan.study.leaves_out() {
        &[]
    } else {
        &["ranking.json"]
    };
    for name in epochs.iter().chain(ranking) {
        let path = planned.directory.join("results").join(name);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != ErrorKind::NotFound => return Err(FileError::io(&path, e).into()),
            _ => {}
        }
    }
    Ok(())
}

fn summary(planned: &Planned, units: usize, diverged: u64) -> serde_json::Value {
    let plan = &planned.plan;
    json!({
        "schema_version": 1,
        "plan": plan.id(),
        "version": plan.version,
        "numerics": plan.numerics,
        "seed": plan.seed,
        "cells": planned.grid.len(),
        "units": units,
        "runs": if plan.study.is_sampled() { plan.study.runs } else { 0 },
        "diverged": diverged,
        "states": REPORTED_NAMES,
        "study": plan.study,
        "inputs": plan.inputs,
        "models": plan.models,
    })
}
