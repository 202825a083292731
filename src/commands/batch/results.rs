//! Results of a study: `results.csv`, `summary.json`, `report.html`, made from the run directories of its cells.

use super::cells::{Cell, Labels, Study};
use super::units::Place;
use crate::app::{Answer, Context, Failure, Result};
use crate::commands::compare::{Comparison, between};
use crate::commands::run::directory::{self as run_directory, RunDirectory};
use crate::io::atomic::AtomicDir;
use crate::io::source;
use crate::report::json;
use crate::report::verdict::gravest;
use crate::report::verdict::tone;
use nav_sim_document::{
    Axis, Cell as TableCell, Chart, Colour, Document, Importance, Mark, Panel, Series, Stroke,
    Table, Tone, shortest,
};
use nav_sim_navigation::metrics::{Verdict, compare};
use nav_sim_navigation::simulation::REPORTED_NAMES;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;

const FILES: [&str; 3] = ["results.csv", "summary.json", "report.html"];

/// The cells that are there, against their references.
#[derive(Debug, Serialize)]
pub struct StudyAnswer {
    schema_version: u32,
    complete: bool,
    /// Cells that are not there.
    missing: Vec<String>,
    cells: Vec<CellSummary>,
    /// One row a cell, outage and state.
    rows: Vec<Value>,
    versions: BTreeSet<String>,
    #[serde(skip)]
    axes: Vec<String>,
    #[serde(skip)]
    pub(crate) comparisons: Vec<(String, Comparison)>,
    #[serde(skip)]
    unmet: Option<Failure>,
}

#[derive(Debug, Serialize)]
struct CellSummary {
    name: String,
    labels: BTreeMap<String, String>,
    diverged: u64,
    verdict: Verdict,
    /// Time, p50 and p95 of the horizontal error and NEES at the end of each outage.
    outages: Vec<Value>,
}

/// Reads all cells that are there and compares them; a damaged one is set aside.
pub(crate) fn merge(
    study: &Study,
    cells: &[Cell],
    place: &Place<'_>,
    states: &[usize],
    context: &Context<'_>,
) -> Result<StudyAnswer> {
    let fixed = study.fixed(cells);
    let by_labels: HashMap<&Labels, &Cell> =
        cells.iter().map(|cell| (&cell.labels, cell)).collect();
    let reference_of = |cell: &Cell| {
        let label = |(axis, label): &(String, String)| {
            let fixed = fixed.iter().find(|(fixed, _)| fixed == axis);
            (
                axis.clone(),
                fixed.map_or(label, |(_, label)| label).clone(),
            )
        };
        let labels: Labels = cell.labels.iter().map(label).collect();
        let found = by_labels.get(&labels).copied();
        found.filter(|cell| !fixed.is_empty() && place.is_done(cell))
    };
    let mut answer = StudyAnswer {
        schema_version: 1,
        complete: true,
        missing: Vec::new(),
        cells: Vec::new(),
        rows: Vec::new(),
        versions: BTreeSet::new(),
        axes: cells.first().map_or(Vec::new(), |cell| {
            cell.labels.iter().map(|(axis, _)| axis.clone()).collect()
        }),
        comparisons: Vec::new(),
        unmet: None,
    };
    // of each reference its cells: one setting of the other axes
    let mut settings: Vec<(Option<&Cell>, Vec<&Cell>)> = Vec::new();
    let mut at = HashMap::new();
    for cell in cells {
        let reference = reference_of(cell);
        let name = &reference.unwrap_or(cell).name;
        let index = *at.entry(name).or_insert(settings.len());
        if index == settings.len() {
            settings.push((reference, Vec::new()));
        }
        settings[index].1.push(cell);
    }
    for (reference, members) in settings {
        let mut read = Vec::new();
        for cell in members {
            match place
                .is_done(cell)
                .then(|| run_directory::read(&place.cell(&cell.name)))
            {
                Some(Ok(found)) => read.push((cell, found)),
                Some(Err(e)) if e.code() == 1 => return Err(e),
                damaged => {
                    if let Some(Err(e)) = damaged {
                        context.warn(format!("{e}; {} is set aside", cell.name));
                        let (path, aside) = (
                            place.cell(&cell.name),
                            place.cell(&format!("{}.damaged", cell.name)),
                        );
                        drop(fs::rename(path, aside));
                    }
                    answer.missing.push(cell.name.clone());
                }
            }
        }
        let of = reference.and_then(|r| read.iter().position(|(cell, _)| cell.name == r.name));
        answer.add(place, &read, of, states)?;
    }
    answer.complete = answer.missing.is_empty();
    Ok(answer)
}

impl StudyAnswer {
    /// Cells of one setting, against one of them.
    fn add(
        &mut self,
        place: &Place<'_>,
        read: &[(&Cell, RunDirectory)],
        reference: Option<usize>,
        states: &[usize],
    ) -> Result<()> {
        let comparison = match reference {
            Some(i) if read.len() > 1 => {
                let runs = read.iter().enumerate();
                let runs = runs.map(|(k, (cell, found))| (cell.name.as_str(), found, k == i));
                let (cell, found) = &read[i];
                Some(between(runs, (&cell.name, found), states.to_vec())?)
            }
            _ => None,
        };
        for (k, (cell, found)) in read.iter().enumerate() {
            let text = source::text(&place.cell(&cell.name).join("summary.json"))
                .map_err(Failure::could_not)?;
            let summary: Value = serde_json::from_str(&text).map_err(Failure::could_not)?;
            let alone =
                compare(&found.experiment, &found.experiment, true).map_err(Failure::could_not)?;
            let ratios = comparison
                .as_ref()
                .map(|c| (&c.candidates[k], c.reference.as_str()));
            let mut ends = Vec::new();
            for (i, (outage, own)) in summary["outages"]
                .as_array()
                .into_iter()
                .flatten()
                .zip(&alone)
                .enumerate()
            {
                let horizontal = &outage["horizontal_error_end_m"];
                let time = |key: &str| outage[key].as_f64().unwrap_or(f64::NAN);
                ends.push(json!({
                    "start_s": outage["start_s"],
                    "end_s": outage["end_s"],
                    "p50_m": horizontal["p50"],
                    "p95_m": horizontal["p95"],
                    "nees": outage["nees_end"],
                }));
                for (s, state) in REPORTED_NAMES.iter().enumerate() {
                    let ratio = ratios.filter(|(candidate, _)| !candidate.is_reference);
                    let ratio = ratio.map(|(candidate, _)| &candidate.outages[i].states[s]);
                    let ends = |ends: Option<[f64; 2]>, k: usize| ends.map(|ends| ends[k]);
                    let mut row = json!({
                        "cell": cell.name,
                        "method": summary["method"],
                        "filter": summary["filter_states"],
                        "runs": summary["runs"],
                        "diverged": summary["diverged"],
                        "outage": i,
                        "start_s": outage["start_s"],
                        "end_s": outage["end_s"],
                        "duration_s": time("end_s") - time("start_s"),
                        "state": state,
                        "reference": ratios.map(|(_, name)| name),
                        "paired": ratios.map(|(candidate, _)| candidate.is_paired),
                        "ratio_error_pct": ratio.map(|r| r.asee.pct),
                        "abs_ratio_error_pct": ratio.map(|r| r.asee_abs_pct),
                        "ci95_low_pct": ratio.and_then(|r| ends(r.asee.ci95_pct, 0)),
                        "ci95_high_pct": ratio.and_then(|r| ends(r.asee.ci95_pct, 1)),
                        "calibration_half_pct": ratio.and_then(|r| r.calibration_half_pct),
                        "rmse_end_ratio_error_pct": ratio.map(|r| r.rmse_end.pct),
                        "rmse_end_ci95_low_pct": ratio.and_then(|r| ends(r.rmse_end.ci95_pct, 0)),
                        "rmse_end_ci95_high_pct": ratio.and_then(|r| ends(r.rmse_end.ci95_pct, 1)),
                        "nees_mean": own.nees[0],
                        "nees_end": outage["nees_end"],
                        "coverage": own.coverage[0],
                        "horizontal_p50_m": horizontal["p50"],
                        "horizontal_p95_m": horizontal["p95"],
                        "horizontal_max_m": horizontal["max"],
                        "log_density_end": outage["log_density_end"],
                        "verdict": outage["verdict"]["kind"],
                    });
                    for key in [
                        "asee_mean",
                        "asee_end",
                        "rmse_mean",
                        "rmse_end",
                        "rmse_end_std_error",
                    ] {
                        row[key] = outage[key][*state].clone();
                    }
                    for (axis, label) in &cell.labels {
                        row[axis] = label.as_str().into();
                    }
                    self.rows.push(row);
                }
            }
            self.versions.insert(found.manifest.version.clone());
            let missed = |required: &Value| required["met"] == Value::Bool(false);
            if summary["require"]
                .as_array()
                .is_some_and(|all| all.iter().any(missed))
            {
                let message = format!("{}: a required limit is not kept", cell.name);
                self.unmet.get_or_insert(Failure::bound(message));
            }
            self.cells.push(CellSummary {
                name: cell.name.clone(),
                labels: cell.labels.iter().cloned().collect(),
                diverged: summary["diverged"].as_u64().unwrap_or(0),
                verdict: found.verdict,
                outages: ends,
            });
        }
        let title = reference.map_or_else(String::new, |i| read[i].0.name.clone());
        self.comparisons
            .extend(comparison.map(|comparison| (title, comparison)));
        Ok(())
    }

    /// A row a cell, outage and state.
    fn csv(&self) -> String {
        let axes = self.axes.iter().map(String::as_str);
        let own = |column: &&str| !self.axes.iter().any(|axis| axis == column);
        let rest = COLUMNS[1..].iter().copied().filter(own);
        let columns: Vec<&str> = [COLUMNS[0]].into_iter().chain(axes).chain(rest).collect();
        let heads = columns[1..].iter().map(|column| (*column).to_owned());
        let mut table = Table::new([columns[0]]).and(heads);
        let shown = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) => text.clone(),
            Value::Number(x) if x.is_f64() => shortest(x.as_f64().unwrap_or(f64::NAN)),
            other => other.to_string(),
        };
        for row in &self.rows {
            table.row(
                columns
                    .iter()
                    .map(|column| TableCell::from(shown(&row[*column]))),
            );
        }
        table.csv()
    }

    /// Cells that are missing (exit code 75), if there are any.
    pub(crate) fn incomplete(&self) -> Option<Failure> {
        let missing = &self.missing;
        let message = || format!("{} cells are missing: {}", missing.len(), first_of(missing));
        (!self.complete).then(|| {
            Failure::stopped(message()).hint("the same command without --merge computes them")
        })
    }

    /// Writes the results, all or none.
    pub(crate) fn write(&self, place: &Place<'_>) -> Result<()> {
        let mut files = AtomicDir::create(place.0)?;
        for (name, text) in FILES
            .into_iter()
            .zip([self.csv(), json(self), self.document().html()])
        {
            files.write(name, text)?;
        }
        files.commit()
    }
}

/// Removes results of before, where a cell is missing.
pub(crate) fn withdraw(place: &Place<'_>) {
    FILES
        .iter()
        .for_each(|name| drop(fs::remove_file(place.0.join(name))));
}

const COLUMNS: [&str; 33] = [
    "cell",
    "method",
    "filter",
    "runs",
    "diverged",
    "outage",
    "start_s",
    "end_s",
    "duration_s",
    "state",
    "asee_mean",
    "asee_end",
    "rmse_mean",
    "rmse_end",
    "rmse_end_std_error",
    "reference",
    "paired",
    "ratio_error_pct",
    "abs_ratio_error_pct",
    "ci95_low_pct",
    "ci95_high_pct",
    "calibration_half_pct",
    "rmse_end_ratio_error_pct",
    "rmse_end_ci95_low_pct",
    "rmse_end_ci95_high_pct",
    "nees_mean",
    "nees_end",
    "coverage",
    "horizontal_p50_m",
    "horizontal_p95_m",
    "horizontal_max_m",
    "log_density_end",
    "verdict",
];

impl Answer for StudyAnswer {
    fn document(&self) -> Document {
        let kind = gravest(self.cells.iter().map(|cell| &cell.verdict));
        let count = self.cells.len();
        let mut lines = vec![format!("{count} cells, {}", verdict_lines(&self.cells))];
        if !self.complete {
            lines.push(format!(
                "{} cells are missing: {}",
                self.missing.len(),
                first_of(&self.missing)
            ));
        }
        let tone = if self.complete {
            tone(kind)
        } else {
            Tone::Undecided
        };
        let mut document = Document::new("Study", tone, lines);
        let diverged: Vec<&str> = self
            .cells
            .iter()
            .filter(|c| c.diverged > 0)
            .map(|c| c.name.as_str())
            .collect();
        if !diverged.is_empty() {
            let names: Vec<String> = diverged.iter().map(|name| (*name).to_owned()).collect();
            document.note(
                Importance::Warning,
                format!(
                    "runs diverged in {}; they are in no number",
                    first_of(&names)
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
        document.lead(Table::of(self, "/cells/*/outages/*", &columns).with_keys(2));
        document.charts(
            &self.charts(),
            "Horizontal error at the end of the first outage: p95 and, thin, the median.",
        );
        for (reference, comparison) in &self.comparisons {
            document.section(&format!("ASEE relative to {reference}"));
            document.text("Mean over the outage of (ratio − 1)·100, with its 95 % interval.");
            document.table(&comparison.table());
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
            let mut lines: BTreeMap<String, Vec<(f64, f64, f64)>> = BTreeMap::new();
            for cell in &self.cells {
                let x: f64 = cell.labels[axis].parse().ok()?;
                let others = cell
                    .labels
                    .iter()
                    .filter(|(other, _)| *other != axis)
                    .map(|(_, label)| label.as_str());
                let name = others.collect::<Vec<_>>().join(" ");
                let outage = cell.outages.first()?;
                if let (Some(p50), Some(p95)) = (outage["p50_m"].as_f64(), outage["p95_m"].as_f64())
                {
                    lines.entry(name).or_default().push((x, p50, p95));
                }
            }
            let series =
                lines
                    .iter_mut()
                    .take(LINES)
                    .enumerate()
                    .flat_map(|(hue, (name, points))| {
                        points.sort_by(|a, b| a.0.total_cmp(&b.0));
                        let p50 = points.iter().map(|(x, p50, _)| (*x, *p50)).collect();
                        let p95 = points.iter().map(|(x, _, p95)| (*x, *p95)).collect();
                        [
                            Series::new(name, Colour::Hue(hue), Mark::Line(p95, Stroke::Bold)),
                            Series::new("", Colour::Hue(hue), Mark::Line(p50, Stroke::Thin)),
                        ]
                    });
            let series: Vec<Series> = series.collect();
            let panel = Panel::new(Axis::log("horizontal error (m)"), series);
            Some(Chart::new(
                &format!("Error against {axis}"),
                Axis::linear(axis),
                vec![panel],
            ))
        };
        self.axes.iter().filter_map(chart).collect()
    }
}

/// `3 consistent, 1 overconfident`.
fn verdict_lines(cells: &[CellSummary]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for cell in cells {
        *counts.entry(cell.verdict.kind.name()).or_default() += 1;
    }
    counts
        .iter()
        .map(|(kind, n)| format!("{n} {kind}"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// The first names of a list.
pub(crate) fn first_of(names: &[String]) -> String {
    let more = if names.len() > 3 { ", …" } else { "" };
    names
        .iter()
        .take(3)
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(", ")
        + more
}
