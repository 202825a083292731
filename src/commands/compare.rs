//! `nav-sim compare`: run directories → ratios between runs; two models → what changed.

use crate::app::{
    Answer, Command, Context, Failure, Inputs, IntoFailure, Manifest, OutputKind, PlainAnswer,
    Result, refused,
};
use crate::commands::run::RUN_FILES;
use crate::commands::run::directory::{self as run_directory, RunDirectory};
use crate::report::csv::{csv, flat, merged};
use crate::report::verdict::{SPOKEN, axis_of, tone, verdict_counts};
use crate::report::{first_names, in_order};
use nav_sim_document::{
    Cell, Chart, ChartAxis, Colour, Document, Importance, Mark, Panel, Series, Table, short_names,
    window,
};
use nav_sim_navigation::metrics::{self, OutageComparison, PerState, StateRatio};
use nav_sim_navigation::scenario::Method;
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};
use serde::Serialize;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

mod models;

/// Compare runs: verdicts, and ratios of ASEE and RMSE per outage and state; or two calibrations
///
/// ASEE, the averaged standard estimation error, is what a filter states of its error. A cell holds the mean over the
/// outage of (ASEE ratio − 1)·100 ± half its 95 % interval (or its ends, where it is wide): of the runs, and of the
/// calibrations of models with draws beside them, as calibrate writes them. Scenario and estimator are those of the directories' names
/// (II_sr-awv, or II/sr-awv); --table prints the layout of the paper's Table I. All states are in the JSON file; a page
/// with NEES, coverage and RMSE is written beside it.
///
/// Two model files: N, B, K, Q and the parameters of the processes, and which of them changed beyond their 95 % intervals.
#[derive(clap::Args, Debug, Clone)]
pub struct Compare {
    /// Run directories, or two model files
    #[arg(required = true, value_name = "DIR")]
    runs: Vec<PathBuf>,
    /// Run directory to compare with
    #[arg(long, value_name = "DIR")]
    reference: Option<PathBuf>,
    /// States in the table (repeatable), or "all"
    #[arg(id = "state", long = "state", value_name = "STATE", default_values = ["pos_e_m", "roll_deg"])]
    pub states: Vec<String>,
    /// Print the table alone in this form
    #[arg(long, value_name = "FORM", value_enum)]
    table: Option<TableForm>,
}

/// Layout of the printed table.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableForm {
    /// A table of Markdown
    Markdown,
    /// Numbers for other programs: one row a run, outage and state, percentages in columns of their own
    Csv,
    /// A `tabular` with the rules of booktabs
    Latex,
}

impl Command for Compare {
    type Answer = PlainAnswer;
    const NAME: &'static str = "compare";
    const OUT: OutputKind = OutputKind::File {
        name: "comparison.json",
        help: "File to write, with a page (.html) beside it [default: comparison.json]",
    };

    fn writes_by_default(&self) -> bool {
        true
    }

    fn endings(&self) -> Vec<Cow<'static, str>> {
        vec!["".into(), ".html".into()]
    }

    fn inputs(&self, _: Inputs) -> Result<Inputs> {
        let files = |path: &PathBuf| match path.is_file() {
            true => vec![("model".to_owned(), path.clone())],
            false => RUN_FILES
                .map(|name| ("run".to_owned(), path.join(name)))
                .into(),
        };
        Ok(self
            .runs
            .iter()
            .chain(&self.reference)
            .flat_map(files)
            .filter(|(_, path)| path.exists())
            .collect())
    }

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let all: Vec<&PathBuf> = self.reference.iter().chain(&self.runs).collect();
        let models: Vec<_> = all.iter().filter(|path| path.is_file()).collect();
        match (all.len(), models.len(), &self.reference) {
            (2, 2, _) if self.table.is_some() => {
                refused("--table is for runs, not for models", "leave it out")
            }
            (2, 2, _) => models::compare([all[0], all[1]], context),
            (_, 0, Some(reference)) => {
                let found = Comparison {
                    form: self.table,
                    ..compare(&self.runs, reference, states(&self.states)?)?
                };
                Ok(PlainAnswer::new(json!(found), found.document()).with_page(found.text()))
            }
            (_, 0, None) => refused(
                "no run to compare",
                "name one with --reference DIR; model files need none",
            ),
            _ => {
                for path in &all {
                    std::fs::metadata(path).map_err(|e| Failure::io(path, e))?;
                }
                refused(
                    format!("{} is a file: runs are directories", models[0].display()),
                    "give two model files, or run directories with --reference DIR",
                )
            }
        }
    }
}

/// Compares runs with a reference; `states` are shown.
///
/// # Errors
/// When a directory cannot be read, or is of something else.
fn compare(runs: &[PathBuf], reference: &Path, states: Vec<usize>) -> Result<Comparison> {
    let name = reference.display().to_string();
    let directory = run_directory::read(reference)?;
    let read = |path: &PathBuf| {
        Ok((
            path.display().to_string(),
            run_directory::read(path)?,
            is_same_place(path, reference),
        ))
    };
    let read = runs.iter().map(read).collect::<Result<Vec<_>>>()?;
    between(
        read.iter()
            .map(|(run, found, of_itself)| (run.as_str(), found, *of_itself)),
        (&name, &directory),
        states,
    )
}

/// Compares runs by name, each with whether it is the reference itself.
pub(crate) fn between<'a>(
    runs: impl Iterator<Item = (&'a str, &'a RunDirectory, bool)>,
    (name, directory): (&str, &RunDirectory),
    states: Vec<usize>,
) -> Result<Comparison> {
    let mut found = Comparison {
        schema_version: 1,
        reference: name.to_owned(),
        paired: true,
        verdicts: vec![merged([
            json!({ "run": name }),
            directory.summary["verdict"].clone(),
        ])],
        rows: Vec::new(),
        consistency: Vec::new(),
        candidates: Vec::new(),
        outages: directory.experiment.outages.clone(),
        doubts: Vec::new(),
        uncertain: Vec::new(),
        states,
        form: None,
    };
    for (run, candidate, is_reference) in runs {
        let differences = differences(candidate, directory);
        let doubt = |what: &&str| {
            format!("{run}: {what} not that of the reference; the runs are not paired")
        };
        // two covariance analyses have no runs that could be paired, and nothing by chance that pairing would take away
        if !(candidate.experiment.is_expected && directory.experiment.is_expected) {
            found.doubts.extend(differences.iter().map(doubt));
        }
        let is_paired = differences.is_empty();
        found.paired &= is_paired;
        if candidate.manifest.hashes("trajectory") != directory.manifest.hashes("trajectory") {
            return refused(
                format!("{run}: not the trajectory of the reference"),
                "compare runs along the same trajectory file",
            );
        }
        let [own, other] = [candidate, directory].map(|side| &side.experiment);
        let [runs, of_reference] = [own, other].map(|side| side.runs.len());
        if is_paired && runs != of_reference {
            return refused(
                format!("{run}: {runs} runs, {of_reference} in the reference, of one seed"),
                "give both the same --runs",
            );
        }
        let mut outages = metrics::compare(own, other, is_paired).refuse_within(run)?;
        let models = [candidate, directory].map(|side| side.manifest.hashes("model"));
        // what the calibration of one model leaves open is alike on both sides
        if !is_reference && models[0] != models[1] {
            let both = [candidate, directory].map(|side| &side.asee_mean_ci95);
            for (k, outage) in outages.iter_mut().enumerate() {
                let known: Vec<_> = both.iter().filter_map(|side| side[k]).collect();
                if known.is_empty() {
                    found.uncertain.push(run.to_owned());
                } else {
                    outage.widen(&known);
                }
            }
        }
        let pct = |a: f64, b: f64| 100.0 * (a / b - 1.0);
        let both = own.epochs.iter().zip(&other.epochs);
        let curve = both.map(|(c, r)| (c.t_s, std::array::from_fn(|i| pct(c.asee[i], r.asee[i]))));
        found.candidates.push(CandidateResult {
            curve: curve.collect(),
            label: Label::of(run, candidate.origin.estimator.as_deref()),
            run: run.to_owned(),
            is_reference,
            is_paired,
            verdict: candidate.summary["verdict"].clone(),
            outages,
        });
    }
    separate(&mut found.candidates);
    for candidate in &found.candidates {
        if !candidate.is_reference {
            found.verdicts.push(merged([
                json!({ "run": candidate.run }),
                candidate.verdict.clone(),
            ]));
        }
        for (outage, comparison) in candidate.outages.iter().enumerate() {
            let (outage_start_s, outage_end_s) = found.outages[outage];
            for (state, ratio) in REPORTED_NAMES.iter().zip(comparison.states) {
                let place = json!({
                    "run": candidate.run,
                    "reference": name,
                    "outage_start_s": outage_start_s,
                    "outage_end_s": outage_end_s,
                    "state": state,
                });
                let row = [
                    json!(candidate.label),
                    place,
                    json!(ratio),
                    json!({ "paired": candidate.is_paired, "outage": outage }),
                ];
                found.rows.push(merged(row));
            }
            let place = json!({
                "run": candidate.run,
                "outage": outage,
                "outage_start_s": outage_start_s,
                "outage_end_s": outage_end_s,
            });
            let rmse = PerState(
                comparison
                    .states
                    .map(|state| state.rmse_end_ratio_error_pct),
            );
            found.consistency.push(merged([
                place,
                json!(comparison),
                json!({ "rmse_end_ratio_error_pct": rmse }),
            ]));
        }
    }
    Ok(found)
}

/// Differences between two runs other than the filter's model: with any, run k did not have the
/// same noise.
fn differences(candidate: &RunDirectory, reference: &RunDirectory) -> Vec<&'static str> {
    let (c, r) = (
        &candidate.origin.configuration,
        &reference.origin.configuration,
    );
    let is_drawn = [candidate, reference].map(|run| run.origin.spread);
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
            "the source of errors is",
            is_drawn[0] != is_drawn[1] || truth(candidate) != truth(reference),
        ),
        ("[imu] is", c.imu != r.imu),
        ("[gnss] is", c.gnss != r.gnss),
        ("[initial] is", c.initial != r.initial),
    ];
    all.into_iter()
        .filter_map(|(what, differs)| differs.then_some(what))
        .collect()
}

/// Hashes of the source of the INS errors: a recording, a model, or the filter's own model.
fn truth(manifest: &Manifest) -> Vec<&str> {
    ["static", "truth", "model"]
        .map(|role| manifest.hashes(role))
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

/// States by their names; `all` of them.
pub(crate) fn states(names: &[String]) -> Result<Vec<usize>> {
    if names.iter().any(|n| n == "all") {
        return Ok((0..REPORTED_NAMES.len()).collect());
    }
    let index = |name: &String| {
        let found = REPORTED_NAMES.iter().position(|n| n == name);
        let known = || format!("one of {}, or all", REPORTED_NAMES.join(", "));
        found.ok_or_else(|| Failure::input(format!("--state {name} is no state")).hint(known()))
    };
    names.iter().map(index).collect()
}

/// Runs against a reference: as JSON, `comparison.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Layout version.
    schema_version: u32,
    /// Run directory of the reference.
    pub(crate) reference: String,
    /// True if run k had the same noise in all directories: intervals are then those of paired
    /// differences.
    paired: bool,
    /// One row a run, the reference first.
    verdicts: Vec<Value>,
    /// One row a run, outage and state.
    rows: Vec<Value>,
    /// One row a run and outage.
    consistency: Vec<Value>,
    /// The runs.
    #[serde(skip)]
    pub(crate) candidates: Vec<CandidateResult>,
    /// Start and end of each outage (s).
    #[serde(skip)]
    outages: Vec<(f64, f64)>,
    /// Reason that runs are not paired with the reference.
    #[serde(skip)]
    doubts: Vec<String>,
    /// Runs of which, as of the reference, no calibration has draws.
    #[serde(skip)]
    uncertain: Vec<String>,
    /// The states that are shown.
    #[serde(skip)]
    states: Vec<usize>,
    /// Form in which the table alone is printed.
    #[serde(skip)]
    form: Option<TableForm>,
}

impl Comparison {
    /// The paper's Table I.
    pub(crate) fn table(&self) -> Table {
        ratio_table(&self.candidates, &self.states, &self.outages)
    }

    /// The candidates but for the reference itself, with short names.
    fn others(&self) -> Vec<(String, &CandidateResult)> {
        let others: Vec<_> = self.candidates.iter().filter(|c| !c.is_reference).collect();
        let runs: Vec<&str> = others.iter().map(|c| c.run.as_str()).collect();
        short_names(&runs).into_iter().zip(others).collect()
    }

    fn name_of_reference(&self) -> String {
        short_names(&[self.reference.as_str()]).concat()
    }

    /// Departures of the standard deviations that the filters state from the reference's.
    fn cost(&self) -> Option<String> {
        let state = *self.states.first()?;
        let others = self.others();
        let cost = |(name, c): &(String, &CandidateResult)| {
            let all = c
                .outages
                .iter()
                .map(|outage| outage.states[state].ratio_error_pct)
                .filter(|pct| !pct.is_nan());
            let low = all.clone().reduce(f64::min)?;
            let [low, high] = [low, all.fold(low, f64::max)].map(|pct| rounded(pct, 0));
            Some(if low == high {
                format!("{name} {low} %")
            } else {
                format!("{name} {low} to {high} %")
            })
        };
        let costs: Vec<String> = others.iter().filter_map(cost).collect();
        (!costs.is_empty()).then(|| {
            let (reference, costs, state) =
                (self.name_of_reference(), first_names(&costs), SPOKEN[state]);
            format!("ASEE of {state}, mean over the outage, relative to {reference}: {costs}")
        })
    }

    /// The sources of uncertainty that the intervals of the table cover.
    pub(crate) fn coverage_of_intervals(&self) -> String {
        let runs = in_order(self.uncertain.iter().map(String::as_str));
        let covered = match &short_names(&runs)[..] {
            [] => "the runs and the calibrations".to_owned(),
            all if all.len() == self.others().len() => {
                "the runs alone: no model has draws beside it".to_owned()
            }
            names => format!(
                "the runs and the calibrations, of {} of the runs alone",
                first_names(names)
            ),
        };
        format!("95 % intervals (±) of {covered}")
    }

    /// Departure of the ASEE over time: a curve a run.
    fn chart(&self) -> Chart {
        let others = self.others();
        let panel = |state: &usize| {
            let line = |(hue, (name, c)): (usize, &(String, &CandidateResult))| {
                Series::line(
                    name,
                    Colour::Hue(hue),
                    c.curve.iter().map(|(t, pct)| (*t, pct[*state])).collect(),
                )
            };
            let zero = Series::new("", Colour::Ink, Mark::Level(0.0));
            let axis = ChartAxis::linear(&format!("{}: (ratio − 1)·100 (%)", SPOKEN[*state]))
                .including(-1.0, 1.0);
            let series = std::iter::once(zero)
                .chain(others.iter().enumerate().map(line))
                .collect();
            Panel::new(axis, series).of_height(0.8)
        };
        Chart::over_time(
            &format!("ASEE against {}", self.name_of_reference()),
            self.states.iter().map(panel).collect(),
            &self.outages,
        )
    }

    /// A row a run and outage, as they stand in comparison.json.
    fn consistency_table(&self) -> Table {
        let states = self.states.iter().map(|s| {
            (
                format!("RMSE {} (%)", axis_of(*s)),
                format!("rmse_end_ratio_error_pct/{}", REPORTED_NAMES[*s]),
            )
        });
        let states: Vec<(String, String)> = states.collect();
        let mut columns = vec![
            ("run", "run"),
            ("outage", "{outage_start_s}–{outage_end_s} s"),
            ("NEES", "nees_mean"),
            ("NEES of the reference", "nees_mean_reference"),
            ("coverage", "coverage_mean"),
        ];
        columns.extend(
            states
                .iter()
                .map(|(title, key)| (title.as_str(), key.as_str())),
        );
        Table::of(self, "/consistency/*", &columns)
    }
}

impl Answer for Comparison {
    fn text(&self) -> Option<String> {
        Some(match self.form? {
            TableForm::Markdown => self.table().markdown(),
            TableForm::Csv => {
                let is_shown = |row: &&Value| {
                    self.states
                        .iter()
                        .any(|k| row["state"] == REPORTED_NAMES[*k])
                };
                csv(&self
                    .rows
                    .iter()
                    .filter(is_shown)
                    .map(flat)
                    .collect::<Vec<_>>())
            }
            TableForm::Latex => self.table().latex(),
        })
    }

    fn document(&self) -> Document {
        let verdicts = self.verdicts.iter();
        let verdicts: Vec<_> = verdicts
            .map(|row| (row["run"].as_str().unwrap_or_default(), row))
            .collect();
        let (gravest, counts) = verdict_counts(&verdicts);
        let has_table = !self.outages.is_empty() && !self.others().is_empty();
        let lines = self.cost().into_iter().chain(counts);
        let mut outages = self.candidates.iter().flat_map(|c| &c.outages);
        // Standard deviations of runs with shared gains do not scatter.
        let scatter = |[low, high]: [f64; 2]| high > low;
        let has_scatter = outages.any(|outage| outage.states[0].ci95_pct.is_some_and(scatter));
        let lines = lines.chain(has_scatter.then(|| self.coverage_of_intervals()));
        let title = "Stated standard deviations compared";
        let mut document = Document::new(title, tone(gravest), lines);
        self.doubts
            .iter()
            .for_each(|doubt| document.note(Importance::Warning, doubt));
        if has_table {
            document.text(&format!(
                "Mean over the outage of (ASEE ratio − 1)·100 against {}.",
                self.name_of_reference()
            ));
            document.table(self.table());
        }
        document.chart(&self.chart(), CAPTION);
        if !self.outages.is_empty() {
            document.section("Consistency and errors");
            document.text("NEES (9 if right) and coverage over the outage; RMSE at its end, (ratio − 1)·100 to the reference.");
            document.table(self.consistency_table());
        }
        document
    }
}

const CAPTION: &str = "ASEE (averaged standard estimation error): the filter's own standard deviation; 0 % is the reference's.";

// The layout of the paper's Table I: scenario by outage, state by estimator.

/// Estimators by the names their run directories end in.
const ESTIMATORS: [&str; 6] = ["sr-awv", "dr-awv", "awv", "rgmwm", "gmwm", "avlr"];

/// Position of a run in Table I: its row (scenario) and column (estimator, may be empty).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
struct Label {
    /// Row.
    scenario: String,
    /// Column.
    estimator: String,
}

impl Label {
    /// From a run directory's name: `II_sr-awv` or `II/sr-awv` is scenario II, estimator SR-AWV. A name
    /// that ends in no estimator is a scenario of its own; the estimator is then the one the model was
    /// made with, if known.
    fn of(directory: &str, model_estimator: Option<&str>) -> Self {
        let parts: Vec<&str> = directory
            .split('/')
            .filter(|p| !p.is_empty() && *p != ".")
            .collect();
        let name = parts.last().copied().unwrap_or(directory);
        let lower = name.to_lowercase();
        for estimator in ESTIMATORS {
            let Some(head) = lower.strip_suffix(estimator) else {
                continue;
            };
            let parent = parts.len().checked_sub(2).map_or("", |i| parts[i]);
            let separated = head.ends_with(['_', '-', '.', ' ']);
            let scenario = match head.len() {
                0 => parent,
                n if separated => name[..n].trim_end_matches(['_', '-', '.', ' ']),
                _ => continue,
            };
            return Self {
                scenario: scenario.to_owned(),
                estimator: estimator.to_uppercase(),
            };
        }
        let estimator = model_estimator.unwrap_or_default().to_uppercase();
        Self {
            scenario: name.to_owned(),
            estimator,
        }
    }
}

/// A candidate and what the comparison with the reference found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CandidateResult {
    /// Run directory.
    pub run: String,
    /// Its place in the table.
    label: Label,
    /// True of the reference itself.
    pub is_reference: bool,
    /// True if run k saw the same noise as that of the reference.
    pub is_paired: bool,
    /// The verdict on its filter.
    pub verdict: Value,
    /// Outage by outage.
    pub outages: Vec<OutageComparison>,
    /// Time (s) and (ASEE ratio − 1)·100 of each reported state.
    pub curve: Vec<(f64, [f64; REPORTED])>,
}

/// Scenarios and estimators of candidates, in the order in which they were given.
fn layout(candidates: &[CandidateResult]) -> [Vec<&str>; 2] {
    let labels = || candidates.iter().map(|c| &c.label);
    [
        in_order(labels().map(|label| label.scenario.as_str())),
        in_order(labels().map(|label| label.estimator.as_str())),
    ]
}

/// The paper's Table I: a row a scenario and outage, a column a state and estimator; (ASEE ratio − 1)·100 with half its
/// 95 % interval.
fn ratio_table(candidates: &[CandidateResult], states: &[usize], outages: &[(f64, f64)]) -> Table {
    let [scenarios, estimators] = layout(candidates);
    let columns = || {
        states
            .iter()
            .flat_map(|s| estimators.iter().map(move |e| (*s, *e)))
    };
    let mut table = Table::new(["scenario", "outage"])
        .and(columns().map(|(s, e)| format!("{} {e}", axis_of(s)).trim_end().to_owned() + " (%)"))
        .with_keys(2);
    for scenario in scenarios {
        for (outage, (start_s, end_s)) in outages.iter().enumerate() {
            let keys = [scenario.to_owned(), window(*start_s, *end_s)].map(Cell::from);
            let cell = |(state, estimator): (usize, &str)| {
                let is_here = |c: &&CandidateResult| {
                    c.label.scenario == scenario && c.label.estimator == estimator
                };
                let text = match candidates.iter().find(is_here) {
                    Some(c) if c.is_reference => "reference".to_owned(),
                    Some(c) => signed(&c.outages[outage].states[state]),
                    None => String::new(),
                };
                Cell::figures(text)
            };
            table.row(keys.into_iter().chain(columns().map(cell)));
        }
    }
    table
}

/// Gives each candidate a place of its own: those that would share one have rows of their names, and a number if even these are
/// the same.
fn separate(candidates: &mut [CandidateResult]) {
    let labels: Vec<Label> = candidates.iter().map(|c| c.label.clone()).collect();
    let runs: Vec<&str> = candidates.iter().map(|c| c.run.as_str()).collect();
    let names = short_names(&runs);
    for (k, candidate) in candidates.iter_mut().enumerate() {
        if labels.iter().filter(|label| **label == labels[k]).count() > 1 {
            let name = &names[k];
            candidate.label.scenario = match names[..k].iter().filter(|n| *n == name).count() {
                0 => name.clone(),
                before => format!("{name} ({})", before + 1),
            };
        }
    }
}

/// A ratio's distance from unity (%) to three digits, with half its 95 % interval where that would change them; with the ends of
/// the interval where it is so wide that it is no longer symmetric.
fn signed(ratio: &StateRatio) -> String {
    /// Half an interval of a logarithm above which e^x and 1 + x differ in what is shown.
    const WIDE: f64 = 0.25;
    let pct = ratio.ratio_error_pct;
    if pct.is_nan() {
        // no report within the outage
        return "–".to_owned();
    }
    let decimals =
        |x: f64, digits: f64| (digits - x.abs().log10().floor()).clamp(0.0, 2.0) as usize;
    let shown = decimals(pct, 2.0);
    let Some([low, high]) = ratio
        .ci95_pct
        .filter(|ends| ends.iter().all(|x| x.is_finite()))
    else {
        return rounded(pct, shown);
    };
    let half = (high - low) / 2.0;
    let with_half = shown.min(decimals(half, 1.0));
    if half > WIDE * (100.0 + pct) {
        format!("{pct:+.0} ({low:+.0} to {high:+.0})")
    } else if half < 0.5 * 0.1_f64.powi(with_half as i32) {
        rounded(pct, shown)
    } else {
        format!("{} ± {half:.with_half$}", rounded(pct, with_half))
    }
}

/// A percentage with its sign, which a zero has not.
fn rounded(pct: f64, decimals: usize) -> String {
    let unit = 0.1_f64.powi(decimals as i32);
    format!("{:+.decimals$}", (pct / unit).round() * unit + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(run: &str, pct: f64, is_reference: bool) -> CandidateResult {
        let ci95_pct = Some([pct - 0.5, pct + 0.5]);
        let state = StateRatio {
            ratio_error_pct: pct,
            ci95_pct,
            calibration_half_pct: None,
            abs_ratio_error_pct: pct.abs() + 1.0,
            rmse_end_ratio_error_pct: pct,
            rmse_end_ci95_pct: ci95_pct,
        };
        let outage = OutageComparison {
            states: [state; 9],
            nees_mean: 9.5,
            nees_mean_reference: 9.0,
            coverage_mean: 0.9,
            coverage_mean_reference: 0.95,
        };
        let outages = vec![outage.clone(), outage];
        let verdict = Value::Null;
        let label = Label::of(run, None);
        CandidateResult {
            run: run.into(),
            label,
            is_reference,
            is_paired: true,
            verdict,
            outages,
            curve: Vec::new(),
        }
    }

    #[test]
    fn names_of_directories_are_places_in_the_table() {
        let cases = [
            ("runs/II_sr-awv", "II", "SR-AWV"),
            ("II/dr-awv", "II", "DR-AWV"),
            ("./III-AWV/", "III", "AWV"),
            ("awv", "", "AWV"),
            ("rgmwm", "", "RGMWM"),
            ("city", "city", "GMWM"),
            ("lawv", "lawv", "GMWM"),
        ];
        for (directory, scenario, estimator) in cases {
            let label = Label::of(directory, Some("gmwm"));
            assert_eq!(
                (label.scenario.as_str(), label.estimator.as_str()),
                (scenario, estimator),
                "{directory}"
            );
        }
    }

    #[test]
    fn the_table_is_laid_out_as_the_papers() {
        let all = [
            candidate("I/awv", 0.0, true),
            candidate("I/sr-awv", 0.96, false),
            candidate("II/awv", -75.0, false),
        ];
        let outages = [(300.0, 390.0), (700.0, 790.0)];
        let table = ratio_table(&all, &[1, 6], &outages).markdown();
        let cells = |line: &str| line.split('|').map(str::trim).collect::<Vec<_>>().join(",");
        let rows: Vec<String> = table.lines().map(cells).collect();
        assert_eq!(
            rows[0],
            ",scenario,outage,East AWV (%),East SR-AWV (%),roll AWV (%),roll SR-AWV (%),"
        );
        assert_eq!(
            rows[2],
            ",I,300–390 s,reference,+0.96 ± 0.50,reference,+0.96 ± 0.50,"
        );
        assert_eq!(rows[5], ",II,700–790 s,-75.0 ± 0.5,,-75.0 ± 0.5,,");
    }

    #[test]
    fn an_interval_has_no_more_digits_than_it_leaves_known() {
        let cases = [
            (159.347, Some([159.33, 159.36]), "+159"),
            (22.16, Some([10.16, 34.16]), "+22 ± 12"),
            (-0.3, Some([-10.3, 9.7]), "+0 ± 10"),
            (1.346, Some([1.326, 1.366]), "+1.35 ± 0.02"),
            (167.5, Some([-3.3, 634.2]), "+168 (-3 to +634)"),
            (-10.0, None, "-10.0"),
            (5.0, Some([f64::NAN; 2]), "+5.00"),
        ];
        for (ratio_error_pct, ci95_pct, shown) in cases {
            let state = candidate("a", 0.0, false).outages[0].states[0];
            let found = signed(&StateRatio {
                ratio_error_pct,
                ci95_pct,
                ..state
            });
            assert_eq!(found, shown);
        }
    }

    #[test]
    fn candidates_that_would_share_a_place_all_have_one() {
        let runs = ["a/drive", "b/drive", "x/I_awv", "y/I_awv", "c", "c"];
        let candidate = |(k, run)| candidate(run, f64::from(k), false);
        let mut all: Vec<_> = (1..).zip(runs).map(candidate).collect();
        separate(&mut all);
        let table = ratio_table(&all, &[0], &[(1.0, 2.0), (3.0, 4.0)]).markdown();
        let rows: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(rows.len(), 2 * all.len());
        let names = ["a/drive", "b/drive", "x/I_awv", "y/I_awv", "c", "c (2)"];
        for (k, row) in rows.into_iter().enumerate() {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            assert!(k % 2 == 1 || cells[1] == names[k / 2], "{row}");
            let shown = format!("+{}.00 ± 0.50", k / 2 + 1);
            assert_eq!(
                cells.iter().filter(|cell| **cell == shown).count(),
                1,
                "{row}"
            );
        }
    }
}
