//! Results of a study: `results.csv`, `summary.json`, `report.html`, made from the run directories of its cells.

use super::{Labels, Study, StudyCell, StudyDirectory};
use crate::app::{Answer, Context, Failure, Result};
use crate::commands::compare::{Comparison, between};
use crate::commands::run::directory::{self as run_directory, RunDirectory};
use crate::io::atomic::{AtomicDir, guard_others};
use crate::report::csv::{csv, flat, merged};
use crate::report::verdict::{tone, verdict_counts};
use crate::report::{first_names, json};
use indexmap::{IndexMap, IndexSet};
use nav_sim_document::{
    Chart, ChartAxis, Colour, Document, Importance, Panel, Series, Table, Tone, counted,
};
use nav_sim_navigation::simulation::REPORTED_NAMES;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;

/// States in the tables of the page: East position and roll.
const SHOWN: [usize; 2] = [1, 6];

const FILES: [&str; 3] = ["results.csv", "summary.json", "report.html"];

/// The cells that are there, against their references.
#[derive(Debug, Default, Serialize)]
pub struct StudyAnswer {
    schema_version: u32,
    complete: bool,
    /// Cells that are not there.
    missing: Vec<String>,
    cells: Vec<CellSummary>,
    /// One row a cell, outage and state.
    rows: Vec<Map<String, Value>>,
    versions: BTreeSet<String>,
    #[serde(skip)]
    axes: Vec<String>,
    #[serde(skip)]
    pub(crate) comparisons: Vec<Comparison>,
    #[serde(skip)]
    unmet: Option<Failure>,
}

#[derive(Debug, Serialize)]
struct CellSummary {
    name: String,
    labels: BTreeMap<String, String>,
    diverged: u64,
    verdict: Value,
    /// Time, p50 and p95 of the horizontal error and NEES at the end of each outage.
    outages: Vec<Value>,
}

/// Reads all cells that are there and compares them; a damaged one is set aside.
pub(super) fn merge(
    study: &Study,
    cells: &[StudyCell],
    place: &StudyDirectory<'_>,
    context: &Context<'_>,
) -> Result<StudyAnswer> {
    let fixed = study.fixed(cells);
    let by_labels: HashMap<&Labels, &StudyCell> =
        cells.iter().map(|cell| (&cell.labels, cell)).collect();
    let reference_of = |cell: &StudyCell| {
        let label = |(axis, label): &(String, String)| {
            (axis.clone(), fixed.get(axis).unwrap_or(label).clone())
        };
        let labels: Labels = cell.labels.iter().map(label).collect();
        by_labels
            .get(&labels)
            .copied()
            .filter(|cell| !fixed.is_empty() && place.is_done(cell))
    };
    let axes: IndexSet<&String> = cells.iter().flat_map(|c| &c.labels).map(|l| &l.0).collect();
    let mut answer = StudyAnswer {
        schema_version: 1,
        axes: axes.into_iter().cloned().collect(),
        ..StudyAnswer::default()
    };
    // of each reference its cells: one setting of the other axes
    let mut settings: IndexMap<&str, Vec<&StudyCell>> = IndexMap::new();
    for cell in cells {
        settings
            .entry(&reference_of(cell).unwrap_or(cell).name)
            .or_default()
            .push(cell);
    }
    for (reference, members) in settings {
        let mut read = Vec::new();
        for cell in members {
            let (path, name) = (place.cell(&cell.name), &cell.name);
            match place.is_done(cell).then(|| run_directory::read(&path)) {
                Some(Ok(found)) => {
                    read.push((cell, found));
                    continue;
                }
                Some(Err(e)) if e.code() == 1 => return Err(e),
                Some(Err(e)) => {
                    context.warn(format!("{e}; {name} is set aside"));
                    let aside = place.cell(&format!("{name}.damaged"));
                    drop(fs::remove_dir_all(&aside));
                    drop(fs::rename(path, aside));
                }
                None => {}
            }
            answer.missing.push(name.clone());
        }
        let at = read.iter().position(|(cell, _)| cell.name == reference);
        match answer.add(&read, at) {
            // Cells that cannot be compared keep their own figures.
            Err(e) if e.code() == 2 && at.is_some() => {
                context.warn(format!("{e}: no ratios to {reference}"));
                answer.add(&read, None)?;
            }
            added => added?,
        }
    }
    answer.complete = answer.missing.is_empty();
    Ok(answer)
}

impl StudyAnswer {
    /// Cells of one setting, against one of them.
    fn add(&mut self, read: &[(&StudyCell, RunDirectory)], reference: Option<usize>) -> Result<()> {
        // without the reference each is alone
        let Some(i) = reference else {
            let mut alone = read.iter().map(std::slice::from_ref);
            return alone.try_for_each(|one| self.add(one, Some(0)));
        };
        let runs = read
            .iter()
            .enumerate()
            .map(|(k, (cell, found))| (cell.name.as_str(), found, k == i));
        let (cell, found) = &read[i];
        let comparison = between(runs, (&cell.name, found), SHOWN.to_vec())?;
        let is_compared = read.len() > 1;
        for ((cell, found), candidate) in read.iter().zip(&comparison.candidates) {
            let summary = &found.summary;
            let outages = summary["outages"].as_array().into_iter().flatten();
            let mut ends = Vec::new();
            let of_cell = json!({
                "method": summary["method"],
                "filter": summary["filter_states"],
                "runs": summary["runs"],
                "diverged": summary["diverged"],
            });
            let row = |own: [Value; 2]| {
                let mut row = flat(&json!({ "cell": cell.name }));
                let labels = cell.labels.iter().cloned();
                row.extend(labels.map(|(axis, label)| (axis, label.into())));
                let [own, ratio] = own;
                for (key, value) in flat(&merged([of_cell.clone(), own, ratio])) {
                    row.entry(key).or_insert(value);
                }
                row
            };
            if candidate.outages.is_empty() {
                // Without an outage: means over the run.
                let of_state = |state: &str| {
                    json!({
                        "state": state,
                        "asee_mean": summary["accuracy"]["asee_mean"][state],
                        "rmse_mean": summary["accuracy"]["rmse_mean"][state],
                        "nees_mean": summary["nees"]["mean"],
                        "coverage": summary["coverage"]["mean"],
                        "verdict": summary["verdict"]["kind"],
                    })
                };
                let rows = REPORTED_NAMES.map(|state| row([of_state(state), Value::Null]));
                self.rows.extend(rows);
            }
            for (i, (outage, own)) in outages.zip(&candidate.outages).enumerate() {
                let horizontal = &outage["horizontal_error_end_m"];
                let [start_s, end_s] = [&outage["start_s"], &outage["end_s"]];
                let duration_s = end_s.as_f64().zip(start_s.as_f64()).map(|(b, a)| b - a);
                ends.push(json!({
                    "start_s": start_s,
                    "end_s": end_s,
                    "p50_m": horizontal["p50"],
                    "p95_m": horizontal["p95"],
                    "nees": outage["nees_end"],
                }));
                for (state, ratio) in REPORTED_NAMES.iter().zip(&own.states) {
                    let own = json!({
                        "outage": i,
                        "start_s": start_s,
                        "end_s": end_s,
                        "duration_s": duration_s,
                        "state": state,
                        "asee_mean": outage["asee_mean"][*state],
                        "asee_end": outage["asee_end"][*state],
                        "rmse_mean": outage["rmse_mean"][*state],
                        "rmse_end": outage["rmse_end"][*state],
                        "rmse_end_std_error": outage["rmse_end_std_error"][*state],
                        "reference": is_compared.then_some(&comparison.reference),
                        "paired": is_compared.then_some(candidate.is_paired),

                        "nees_mean": own.nees_mean,
                        "nees_end": outage["nees_end"],
                        "coverage": own.coverage_mean,
                        "horizontal_p50_m": horizontal["p50"],
                        "horizontal_p95_m": horizontal["p95"],
                        "horizontal_max_m": horizontal["max"],
                        "log_density_end": outage["log_density_end"],
                        "verdict": outage["verdict"]["kind"],
                    });
                    let ratio = json!((!candidate.is_reference).then_some(ratio));
                    self.rows.push(row([own, ratio]));
                }
            }
            self.versions.insert(found.manifest.version.clone());
            let required = summary["require"].as_array().into_iter().flatten();
            if required
                .into_iter()
                .any(|required| required["met"] == false)
            {
                self.unmet.get_or_insert(Failure::bound(format!(
                    "{}: a required limit is not kept",
                    cell.name
                )));
            }
            self.cells.push(CellSummary {
                name: cell.name.clone(),
                labels: cell.labels.iter().cloned().collect(),
                diverged: summary["diverged"].as_u64().unwrap_or(0),
                verdict: summary["verdict"].clone(),
                outages: ends,
            });
        }
        if is_compared {
            self.comparisons.push(comparison);
        }
        Ok(())
    }

    /// Cells that are missing (exit code 75), if there are any.
    pub(crate) fn incomplete(&self) -> Option<Failure> {
        let missing = &self.missing;
        let message = || {
            format!(
                "{} missing: {}",
                counted(missing.len(), "cell"),
                first_names(missing)
            )
        };
        (!self.complete).then(|| {
            Failure::stopped(message()).hint("the same command without --merge computes them")
        })
    }

    /// Writes the results, all or none.
    pub(super) fn write(&self, place: &StudyDirectory<'_>) -> Result<()> {
        let mut files = AtomicDir::create(place.path)?;
        for (name, text) in
            FILES
                .into_iter()
                .zip([csv(&self.rows), json(self), self.document().html()])
        {
            files.write(name, [text])?;
        }
        files.commit()
    }
}

/// Refuses a directory of another command, and one where files of others have the names of results.
///
/// # Errors
/// The file that would be lost.
pub(super) fn guard(place: &StudyDirectory<'_>) -> Result<()> {
    let mut files = FILES.iter().chain(&["manifest.json"]);
    files.try_for_each(|name| guard_others(&place.path.join(name), name))
}

/// Removes results of before, where a cell is missing.
pub(super) fn withdraw(place: &StudyDirectory<'_>) {
    FILES
        .iter()
        .for_each(|name| drop(fs::remove_file(place.path.join(name))));
}

impl Answer for StudyAnswer {
    fn document(&self) -> Document {
        let verdicts = self.cells.iter();
        let verdicts: Vec<_> = verdicts
            .map(|cell| (cell.name.as_str(), &cell.verdict))
            .collect();
        let (gravest, mut lines) = verdict_counts(&verdicts);
        lines.extend(self.incomplete().map(|failure| failure.to_string()));
        let tone = if self.complete {
            tone(gravest)
        } else {
            Tone::Undecided
        };
        let mut document = Document::new("Study", tone, lines);
        let names: Vec<String> = self
            .cells
            .iter()
            .filter(|c| c.diverged > 0)
            .map(|c| c.name.clone())
            .collect();
        if !names.is_empty() {
            document.note(
                Importance::Warning,
                format!(
                    "runs diverged in {}; no figure includes them",
                    first_names(&names)
                ),
            );
        }
        let columns = [
            ("cell", "../../name"),
            ("outage", "{start_s}–{end_s} s"),
            ("p50 (m)", "p50_m"),
            ("p95 (m)", "p95_m"),
            ("NEES", "nees"),
            ("verdict", "../../verdict/kind"),
        ];
        document.table(Table::of(self, "/cells/*/outages/*", &columns).with_keys(2));
        document.charts(
            &self.charts(),
            "95 % quantile of the horizontal error after the first outage.",
        );
        for comparison in &self.comparisons {
            document.section(&format!("ASEE relative to {}", comparison.reference));
            document.text(&format!(
                "Mean over the outage of (ratio − 1)·100; {}.",
                comparison.coverage_of_intervals()
            ));
            document.table(comparison.table());
        }
        document.section("Cells");
        let link = |cell: &CellSummary| {
            (
                format!("cells/{}/report.html", cell.name),
                cell.name.clone(),
            )
        };
        document.links(&self.cells.iter().map(link).collect::<Vec<_>>());
        document
    }

    fn unmet(&self) -> Option<Failure> {
        self.unmet.clone()
    }
}

impl StudyAnswer {
    /// A chart for each axis of numbers: a line for each setting of the others.
    fn charts(&self) -> Vec<Chart> {
        const LINES: usize = 12;
        let chart = |axis: &String| {
            let mut lines: BTreeMap<Vec<&str>, Vec<(f64, f64)>> = BTreeMap::new();
            for cell in &self.cells {
                // A label of another axis may bring this one with it.
                let Some(label) = cell.labels.get(axis) else {
                    continue;
                };
                let x: f64 = label.parse().ok()?;
                let name = cell
                    .labels
                    .iter()
                    .filter(|(other, _)| *other != axis)
                    .map(|(_, label)| label.as_str())
                    .collect();
                lines
                    .entry(name)
                    .or_default()
                    .extend(cell.outages.first()?["p95_m"].as_f64().map(|y| (x, y)));
            }
            let mut series = Vec::new();
            for (hue, (name, mut points)) in lines.into_iter().take(LINES).enumerate() {
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                series.push(Series::line(&name.join(" "), Colour::Hue(hue), points));
            }
            Some(Chart::new(
                &format!("Error against {axis}"),
                ChartAxis::linear(axis),
                vec![Panel::new(
                    ChartAxis::log("horizontal error, p95 (m)"),
                    series,
                )],
            ))
        };
        self.axes.iter().filter_map(chart).collect()
    }
}
