//! `nav-sim compare`: run directories → ratios between runs.

use crate::app::{Answer, Command, Context, Failure, Manifest, Out, OutputFile, Result};
use crate::commands::paper::PaperFigure;
use crate::commands::run::RUN_FILES;
use crate::commands::run::directory::{self as run_directory, RunDirectory};
use crate::io::atomic::Written;
use crate::report::comparison_table::{CandidateResult, Label, Layout, ratio_rows, ratio_table};
use crate::report::json;
use crate::report::verdict::{SPOKEN, axis_of, tone};
use crate::report::verdict::{gravest, verdict_in_short};
use nav_sim_document::{
    Axis, Cell, Chart, Colour, Document, Importance, Mark, Panel, Series, Table, short_names,
    window,
};
use nav_sim_navigation::metrics::{
    self, ComparisonError, Measured, OutageComparison, Verdict, VerdictKind,
};
use nav_sim_navigation::scenario::Method;
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};
use serde::Serialize;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Compare runs: verdicts, and ratios of ASEE and RMSE per outage and state
///
/// ASEE, the averaged standard estimation error, is what a filter believes of its error. A cell holds the mean over the
/// outage of (ASEE ratio − 1)·100 ± half its 95 % interval: that of Monte Carlo, and of the calibrations if both runs
/// used --method lincov or both with models of calibrate. Scenario and estimator are those of the directories' names
/// (II_sr-awv, or II/sr-awv); --table prints the layout of the paper's Table I. All states are in the JSON file; a page
/// with NEES, coverage and RMSE is written beside it.
#[derive(clap::Args, Debug, Clone)]
#[command(before_help = "\
Examples:
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --filter full --runs 8 --seed 1 -o out/with_all
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --runs 8 --seed 1 -o out/with_15
  nav-sim compare out/with_15 --reference out/with_all --state all")]
pub struct Compare {
    /// Run directories
    #[arg(required = true, value_name = "DIR")]
    pub runs: Vec<PathBuf>,
    /// Run directory to compare with
    #[arg(long, value_name = "DIR")]
    pub reference: PathBuf,
    /// States in the table (repeatable), or "all"
    #[arg(id = "state", long = "state", value_name = "STATE", default_values = ["pos_e_m", "roll_deg"])]
    pub states: Vec<String>,
    /// Print the table alone in this form
    #[arg(long, value_name = "FORM", value_enum)]
    pub table: Option<TableForm>,
    /// Beginning of the verdict, such as "contamination costs"; empty: the name of the reference.
    #[arg(skip)]
    pub(crate) cause: String,
}

/// How a table is written.
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
    type Answer = Comparison;
    const NAME: &'static str = "compare";
    const OUT: Out = Out::File {
        kind: Written::Comparison,
        name: "comparison.json",
        help: "File to write, with a page (.html) beside it [default: comparison.json]",
    };

    fn writes_by_default(&self) -> bool {
        true
    }

    fn endings(&self) -> Vec<(Cow<'static, str>, Written)> {
        vec![
            ("".into(), Written::Comparison),
            (".html".into(), Written::Page),
        ]
    }

    fn inputs(&self) -> Result<Vec<(&'static str, PathBuf)>> {
        let files = |run: &PathBuf| RUN_FILES.map(|name| run.join(name));
        let all = self.runs.iter().chain([&self.reference]).flat_map(files);
        Ok(all
            .filter(|path| path.exists())
            .map(|path| ("run", path))
            .collect())
    }

    fn run(&self, _: &Context<'_>) -> Result<Comparison> {
        Ok(Comparison {
            cause: self.cause.clone(),
            form: self.table,
            ..compare(&self.runs, &self.reference, states(&self.states)?)?
        })
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
        let of_itself = is_same_place(path, reference);
        Ok((
            path.display().to_string(),
            run_directory::read(path)?,
            of_itself,
        ))
    };
    let read = runs.iter().map(read).collect::<Result<Vec<_>>>()?;
    let runs = read
        .iter()
        .map(|(run, found, of_itself)| (run.as_str(), found, *of_itself));
    between(runs, (&name, &directory), states)
}

/// Compares runs by name, each with whether it is the reference itself.
pub(crate) fn between<'a>(
    runs: impl Iterator<Item = (&'a str, &'a RunDirectory, bool)>,
    (name, directory): (&str, &RunDirectory),
    states: Vec<usize>,
) -> Result<Comparison> {
    let (mut candidates, mut curves, mut doubts) = (Vec::new(), Vec::new(), Vec::new());
    for (run, candidate, is_reference) in runs {
        let run = run.to_owned();
        let differences = differences(candidate, directory);
        let doubt = |what: &&str| {
            format!("{run}: {what} not that of the reference; the runs are not paired")
        };
        // two covariance analyses have no runs that could be paired, and nothing by chance that pairing would take away
        if !(candidate.experiment.is_expected && directory.experiment.is_expected) {
            doubts.extend(differences.iter().map(doubt));
        }
        curves.push(RatioCurves::of(
            &candidate.experiment,
            &directory.experiment,
        ));
        candidates.push(compared(
            run,
            candidate,
            directory,
            differences.is_empty(),
            is_reference,
        )?);
    }
    let outages = directory.experiment.outages.clone();
    let comparison = Comparison::new((name, &directory.verdict), candidates, curves, outages);
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
) -> Result<CandidateResult> {
    if candidate.manifest.hashes("trajectory") != reference.manifest.hashes("trajectory") {
        return Err(
            Failure::input(format!("{run}: not the trajectory of the reference"))
                .hint("compare runs along one and the same trajectory file"),
        );
    }
    let outages = metrics::compare(&candidate.experiment, &reference.experiment, is_paired);
    let mut outages = outages.map_err(|e| {
        let failure = Failure::input(format!("{run}: {e}"));
        match e {
            ComparisonError::Runs { .. } => failure.hint("make both with one number of --runs"),
            _ => failure,
        }
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

/// How the ASEE of a run departs from that of the reference over time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RatioCurves {
    /// Time (s).
    pub t_s: Vec<f64>,
    /// (ratio − 1)·100 of each reported state.
    pub asee_pct: Vec<[f64; REPORTED]>,
}

impl RatioCurves {
    /// Of two experiments with the same epochs.
    pub(crate) fn of(candidate: &Measured, reference: &Measured) -> Self {
        let both = candidate.epochs.iter().zip(&reference.epochs);
        let pct = |i: usize, a: &[f64; REPORTED], b: &[f64; REPORTED]| 100.0 * (a[i] / b[i] - 1.0);
        Self {
            t_s: candidate.epochs.iter().map(|e| e.t_s).collect(),
            asee_pct: both
                .map(|(c, r)| std::array::from_fn(|i| pct(i, &c.asee, &r.asee)))
                .collect(),
        }
    }
}

/// Runs against a reference: as JSON, `comparison.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Layout version.
    pub(crate) schema_version: u32,
    /// Run directory of the reference.
    pub(crate) reference: String,
    /// Whether run k saw the same noise everywhere, so that intervals are those of paired differences.
    pub(crate) paired: bool,
    /// One row a run, the reference first.
    pub(crate) verdicts: Vec<VerdictRow>,
    /// One row a run, outage and state.
    pub(crate) rows: Vec<Row>,
    /// One row a run and outage.
    pub(crate) consistency: Vec<ConsistencyRow>,
    /// The runs.
    #[serde(skip)]
    pub(crate) candidates: Vec<CandidateResult>,
    /// How their ratios go with time, one a run.
    #[serde(skip)]
    pub(crate) curves: Vec<RatioCurves>,
    /// Start and end of each outage (s).
    #[serde(skip)]
    pub(crate) outages: Vec<(f64, f64)>,
    /// Why runs are not paired with the reference.
    #[serde(skip)]
    pub(crate) doubts: Vec<String>,
    /// The states that are shown.
    #[serde(skip)]
    pub(crate) states: Vec<usize>,
    /// Beginning of the verdict, such as "contamination costs"; empty: the name of the reference.
    #[serde(skip)]
    pub(crate) cause: String,
    /// Form in which the table alone is printed.
    #[serde(skip)]
    pub(crate) form: Option<TableForm>,
    /// Pages of the single results, path and name.
    #[serde(skip)]
    pub(crate) links: Vec<(String, String)>,
}

/// Whether the filter of a run is as good as it believes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct VerdictRow {
    /// Run directory.
    pub run: String,
    /// The verdict.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// One state of one run in one outage, against the reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Run directory.
    pub run: String,
    /// Whether run k saw the same noise as that of the reference, so that the intervals are those of paired differences.
    pub paired: bool,
    /// Outage, from 0.
    pub outage: usize,
    /// State.
    pub state: &'static str,
    /// Mean over the outage of (ASEE ratio − 1)·100.
    pub ratio_error_pct: f64,
    /// Mean of its absolute value.
    pub abs_ratio_error_pct: f64,
    /// 95 % interval of the signed mean: Monte Carlo and, where it is known, what the calibrations leave open; null where
    /// nothing was drawn and nothing is known of those.
    pub ci95_pct: Option<[f64; 2]>,
    /// Half the interval that the calibrations alone leave (points); null where it is not known.
    pub calibration_half_pct: Option<f64>,
    /// (ratio − 1)·100 of the RMSE at the outage's end.
    pub rmse_end_ratio_error_pct: f64,
    /// Its 95 % Monte-Carlo interval; null where nothing was drawn.
    pub rmse_end_ci95_pct: Option<[f64; 2]>,
}

/// Consistency of one run in one outage, beside the reference's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ConsistencyRow {
    /// Run directory.
    pub run: String,
    /// Outage, from 0.
    pub outage: usize,
    /// Mean NEES over the outage.
    pub nees_mean: f64,
    /// The reference's.
    pub nees_mean_reference: f64,
    /// Mean coverage over the outage.
    pub coverage_mean: f64,
    /// The reference's.
    pub coverage_mean_reference: f64,
}

impl Comparison {
    /// All candidates against one reference; `curves`: one a candidate.
    pub(crate) fn new(
        reference: (&str, &Verdict),
        candidates: Vec<CandidateResult>,
        curves: Vec<RatioCurves>,
        outages: Vec<(f64, f64)>,
    ) -> Self {
        let others = candidates
            .iter()
            .filter(|c| !c.is_reference)
            .map(|c| (c.run.as_str(), &c.verdict));
        let verdicts = std::iter::once(reference).chain(others);
        let row = |(run, verdict): (&str, &Verdict)| VerdictRow {
            run: run.to_owned(),
            verdict: *verdict,
        };
        let verdicts = verdicts.map(row).collect();
        let (mut all_rows, mut consistency) = (Vec::new(), Vec::new());
        for candidate in &candidates {
            for (outage, comparison) in candidate.outages.iter().enumerate() {
                all_rows.extend(rows(candidate, outage, comparison));
                consistency.push(ConsistencyRow {
                    run: candidate.run.clone(),
                    outage,
                    nees_mean: comparison.nees[0],
                    nees_mean_reference: comparison.nees[1],
                    coverage_mean: comparison.coverage[0],
                    coverage_mean_reference: comparison.coverage[1],
                });
            }
        }
        Self {
            schema_version: 1,
            reference: reference.0.to_owned(),
            paired: candidates.iter().all(|candidate| candidate.is_paired),
            verdicts,
            rows: all_rows,
            consistency,
            candidates,
            curves,
            outages,
            doubts: Vec::new(),
            states: vec![1, 6],
            cause: String::new(),
            form: None,
            links: Vec::new(),
        }
    }

    /// The paper's Table I.
    pub(crate) fn table(&self) -> Table {
        ratio_table(&self.candidates, &self.states, &self.outages)
    }

    /// The same for other programs.
    fn rows_csv(&self) -> String {
        ratio_rows(
            &self.candidates,
            &self.states,
            &self.outages,
            &self.reference,
        )
        .csv()
    }

    /// The paper's Figure 7, beside its other ones.
    pub(crate) fn figure(&self) -> PaperFigure {
        PaperFigure::new(7, FIGURE, self.charts())
    }

    /// How much larger or smaller than the reference's the standard deviations are that the filters state.
    fn cost(&self) -> Option<String> {
        let state = *self.states.first()?;
        let layout = Layout::of(&self.candidates);
        let reference = self.candidates.iter().find(|c| c.is_reference);
        let scenario = reference.map_or("", |c| c.label.scenario.as_str());
        let others: Vec<(&CandidateResult, String)> = match layout.is_grid() {
            true => {
                let others = self
                    .candidates
                    .iter()
                    .filter(|c| c.label.scenario != scenario);
                others.map(|c| (c, c.label.estimator.clone())).collect()
            }
            false => {
                let others: Vec<_> = self.candidates.iter().filter(|c| !c.is_reference).collect();
                let names = short_names(&others.iter().map(|c| c.run.as_str()).collect::<Vec<_>>());
                others.into_iter().zip(names).collect()
            }
        };
        let in_state = SPOKEN[state];
        if let [(only, _)] = others.as_slice() {
            let (own, worst) = (range(&[only], state)?, worst(only)?);
            let [name, reference] =
                [&only.run, &self.reference].map(|run| short_names(&[run.as_str()]).concat());
            return Some(format!(
                "{name} against {reference}: uncertainty of {in_state} {own}, {worst}"
            ));
        }
        let mut names: Vec<&str> = Vec::new();
        others.iter().for_each(|(_, name)| {
            if !names.contains(&name.as_str()) {
                names.push(name)
            }
        });
        let cost = |name: &&str| {
            let of_name: Vec<_> = others
                .iter()
                .filter(|(_, other)| other == name)
                .map(|(c, _)| *c)
                .collect();
            range(&of_name, state).map(|range| format!("{name} {range}"))
        };
        let costs: Vec<String> = names.iter().filter_map(cost).collect();
        let named = costs
            .iter()
            .take(NAMED)
            .map(String::as_str)
            .collect::<Vec<_>>()
            .join(", ");
        let more = if costs.len() > NAMED { ", …" } else { "" };
        let cause = match self.cause.as_str() {
            "" => format!(
                "against {}:",
                short_names(&[self.reference.as_str()]).concat()
            ),
            cause => cause.to_owned(),
        };
        (!costs.is_empty())
            .then(|| format!("{cause} {named}{more} of the uncertainty of {in_state}"))
    }

    /// Departure of the ASEE over time: a chart a scenario, with a curve an estimator; where the names of the runs tell
    /// neither, one with all runs.
    fn charts(&self) -> Vec<Chart> {
        let all: Vec<(&CandidateResult, &RatioCurves)> = self
            .candidates
            .iter()
            .zip(&self.curves)
            .filter(|(c, _)| !c.is_reference)
            .collect();
        let layout = Layout::of(&self.candidates);
        if !layout.is_grid() || layout.scenarios.len() > SCENARIOS {
            let names = short_names(&all.iter().map(|(c, _)| c.run.as_str()).collect::<Vec<_>>());
            let curve = |(hue, (name, (_, curves)))| (name, hue, curves);
            let curves: Vec<_> = names
                .iter()
                .map(String::as_str)
                .zip(all)
                .enumerate()
                .map(curve)
                .collect();
            return vec![self.chart(&self.title(), &curves)];
        }
        let hue = |estimator: &str| {
            layout
                .estimators
                .iter()
                .position(|e| e == estimator)
                .unwrap_or(0)
        };
        let of_scenario = |scenario: &String| {
            let curve = |(c, curves): &(&'_ CandidateResult, &'_ RatioCurves)| {
                (
                    c.label.estimator.clone(),
                    hue(&c.label.estimator),
                    (*curves).clone(),
                )
            };
            let of_scenario = all
                .iter()
                .filter(|(c, _)| c.label.scenario == *scenario)
                .map(curve);
            let curves: Vec<(String, usize, RatioCurves)> = of_scenario.collect();
            let curves: Vec<_> = curves
                .iter()
                .map(|(name, hue, curves)| (name.as_str(), *hue, curves))
                .collect();
            let title = format!("{}, scenario {scenario}", self.title());
            (!curves.is_empty()).then(|| self.chart(&title, &curves))
        };
        layout.scenarios.iter().filter_map(of_scenario).collect()
    }

    fn title(&self) -> String {
        format!(
            "ASEE against {}",
            short_names(&[self.reference.as_str()]).concat()
        )
    }

    fn chart(&self, title: &str, curves: &[(&str, usize, &RatioCurves)]) -> Chart {
        let panel = |state: &usize| {
            let line = |(name, hue, curves): &(&str, usize, &RatioCurves)| {
                let points = curves
                    .t_s
                    .iter()
                    .zip(&curves.asee_pct)
                    .map(|(t, pct)| (*t, pct[*state]));
                Series::line(name, Colour::Hue(*hue), points.collect())
            };
            let zero = Series::new("", Colour::Ink, Mark::Level(0.0));
            let axis = Axis::linear(&format!("{}: (ratio − 1)·100 (%)", SPOKEN[*state]))
                .including(-1.0, 1.0);
            let series = std::iter::once(zero)
                .chain(curves.iter().map(line))
                .collect();
            Panel {
                height: 0.8,
                ..Panel::new(axis, series)
            }
        };
        let panels = self.states.iter().map(panel).collect();
        Chart::new(title, Axis::linear("time (s)"), panels)
            .with_outages(&self.outages)
            .in_group("time")
    }

    /// A row a run and outage, as they stand in comparison.json.
    fn consistency_table(&self) -> Table {
        let errors = self
            .states
            .iter()
            .map(|s| format!("RMSE {} (%)", axis_of(*s)));
        let mut table =
            Table::new(["run", "outage", "NEES", "NEES of the reference", "coverage"]).and(errors);
        let names = short_names(
            &self
                .consistency
                .iter()
                .map(|row| row.run.as_str())
                .collect::<Vec<_>>(),
        );
        for (i, (row, name)) in self.consistency.iter().zip(names).enumerate() {
            let source_of = |key: &str| format!("/consistency/{i}/{key}");
            let mut cells: Vec<Cell> = vec![
                name.into(),
                self.outages
                    .get(row.outage)
                    .map_or_else(String::new, |w| window(w.0, w.1))
                    .into(),
                Cell::number(row.nees_mean, &source_of("nees_mean")),
                Cell::number(row.nees_mean_reference, &source_of("nees_mean_reference")),
                Cell::number(row.coverage_mean, &source_of("coverage_mean")),
            ];
            for state in &self.states {
                let k = REPORTED * i + state;
                let pointer = format!("/rows/{k}/rmse_end_ratio_error_pct");
                cells.push(Cell::number(
                    self.rows[k].rmse_end_ratio_error_pct,
                    &pointer,
                ));
            }
            table.row(cells);
        }
        table
    }
}

impl Answer for Comparison {
    fn text(&self) -> Option<String> {
        Some(match self.form? {
            TableForm::Markdown => self.table().markdown(),
            TableForm::Csv => self.rows_csv(),
            TableForm::Latex => self.table().latex(),
        })
    }

    fn csv(&self) -> Option<String> {
        Some(self.rows_csv())
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        vec![
            OutputFile::whole("", json(self)),
            OutputFile::whole(".html", self.document().html()),
        ]
    }

    fn document(&self) -> Document {
        let kind = gravest(self.verdicts.iter().map(|row| &row.verdict));
        let lines = self.cost().into_iter().chain(verdict_lines(&self.verdicts));
        let mut document = Document::new("What the filters believe, compared", tone(kind), lines);
        self.doubts
            .iter()
            .for_each(|doubt| document.note(Importance::Warning, doubt));
        if !self.outages.is_empty() && !self.candidates.is_empty() {
            document.text(&format!(
                "Mean over the outage of (ASEE ratio − 1)·100 against {}; {}.",
                short_names(&[self.reference.as_str()]).concat(),
                meaning_of_intervals(&self.candidates)
            ));
            document.lead(Layout::of(&self.candidates).by_state(&self.states, &self.outages));
        }
        if !self.links.is_empty() {
            document.folded("Pages of the single results", |page| {
                page.links(&self.links)
            });
        }
        document.text(CAPTION);
        document.charts(&self.charts(), "");
        if !self.outages.is_empty() {
            document.section("Consistency and errors");
            document.text("NEES (9 if right) and coverage over the outage; RMSE at its end against the reference, (ratio − 1)·100.");
            document.table(&self.consistency_table());
        }
        document
    }
}

/// Smallest and largest departure of the ASEE of a state, over runs and outages: "+3 %", "+24 to +35 %".
fn range(candidates: &[&CandidateResult], state: usize) -> Option<String> {
    let all = candidates
        .iter()
        .flat_map(|c| &c.outages)
        .map(|outage| outage.states[state].asee.pct);
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), pct| {
        (a.min(pct), b.max(pct))
    });
    let [low_text, high_text] = [low, high].map(|pct| format!("{pct:+.0}"));
    match low_text == high_text {
        _ if low > high => None,
        true => Some(format!("{low_text} %")),
        false => Some(format!("{low_text} to {high_text} %")),
    }
}

/// The state whose ASEE departs most: "most in roll (+8 %)".
fn worst(candidate: &CandidateResult) -> Option<String> {
    let all = candidate
        .outages
        .iter()
        .flat_map(|outage| outage.states.iter().map(|s| s.asee.pct).enumerate());
    let (state, pct) = all.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(format!("most in {} ({pct:+.0} %)", SPOKEN[state]))
}

fn rows<'a>(
    candidate: &'a CandidateResult,
    outage: usize,
    comparison: &'a OutageComparison,
) -> impl Iterator<Item = Row> + 'a {
    REPORTED_NAMES
        .iter()
        .zip(&comparison.states)
        .map(move |(state, ratio)| Row {
            run: candidate.run.clone(),
            paired: candidate.is_paired,
            outage,
            state,
            ratio_error_pct: ratio.asee.pct,
            abs_ratio_error_pct: ratio.asee_abs_pct,
            ci95_pct: ratio.asee.ci95_pct,
            calibration_half_pct: ratio.calibration_half_pct,
            rmse_end_ratio_error_pct: ratio.rmse_end.pct,
            rmse_end_ci95_pct: ratio.rmse_end.ci95_pct,
        })
}

/// How many filters are consistent and undecided, and which are neither: one line, or one a kind where that is long.
pub(crate) fn verdict_lines(verdicts: &[VerdictRow]) -> Vec<String> {
    let names = short_names(
        &verdicts
            .iter()
            .map(|row| row.run.as_str())
            .collect::<Vec<_>>(),
    );
    let mut kinds: Vec<VerdictKind> = verdicts.iter().map(|row| row.verdict.kind).collect();
    kinds.sort_unstable_by(|a, b| b.cmp(a));
    kinds.dedup();
    let part = |kind: &VerdictKind| {
        let of_kind: Vec<_> = verdicts
            .iter()
            .zip(&names)
            .filter(|(row, _)| row.verdict.kind == *kind)
            .collect();
        let count = format!("{} of {} filters {kind}", of_kind.len(), verdicts.len());
        match kind {
            VerdictKind::Consistent => count,
            VerdictKind::Undecided => {
                let needed = of_kind
                    .iter()
                    .filter_map(|(row, _)| row.verdict.runs_to_decide)
                    .max();
                format!("{count} ({} runs would decide)", needed.unwrap_or_default())
            }
            VerdictKind::Doubtful => format!("{count} (beyond linear theory: run --method both)"),
            _ => {
                let named = |(row, name): &(&VerdictRow, &String)| {
                    format!("{name} ({})", verdict_in_short(&row.verdict))
                };
                let worst = of_kind
                    .iter()
                    .max_by(|a, b| a.0.verdict.nees.total_cmp(&b.0.verdict.nees));
                format!("{count}, most: {}", worst.map(named).unwrap_or_default())
            }
        }
    };
    let parts: Vec<String> = kinds.iter().map(part).collect();
    let line = parts.join("; ");
    if line.chars().count() <= LINE {
        vec![line]
    } else {
        parts
    }
}

/// Characters of a line.
const LINE: usize = 120;
/// Estimators or runs that the verdict names.
const NAMED: usize = 3;
/// Scenarios that have a chart each; of more, one chart has all runs.
const SCENARIOS: usize = 6;

const FIGURE: &str = "Departure of the ASEE of each filter from that of AWV in scenario I, (ratio − 1)·100; outages shaded.";

const CAPTION: &str = "ASEE (averaged standard estimation error) is the filter's own standard deviation: 0 % is as the reference believes.";

/// What the ± of the table are.
pub(crate) fn meaning_of_intervals(candidates: &[CandidateResult]) -> &'static str {
    let states = || {
        candidates
            .iter()
            .flat_map(|c| &c.outages)
            .flat_map(|outage| &outage.states)
    };
    if states().any(|state| state.calibration_half_pct.is_some()) {
        "± half the 95 % interval, Monte Carlo and calibrations"
    } else if states().all(|state| state.asee.ci95_pct.is_none()) {
        "covariance analysis: no Monte-Carlo intervals"
    } else {
        "± half the 95 % interval of Monte Carlo"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::comparison_table::tests::candidate;

    #[test]
    fn the_file_has_the_keys_of_the_interface() {
        let verdict = Verdict::of(&[], 2, None);
        let file = Comparison::new(
            ("I/awv", &verdict),
            vec![candidate("II/awv", 3.0, false)],
            vec![],
            vec![],
        );
        let json = serde_json::to_value(&file).unwrap();
        assert_eq!(json["reference"], "I/awv");
        assert_eq!(json["rows"].as_array().unwrap().len(), 18);
        let row = &json["rows"][10];
        assert_eq!(
            (&row["run"], &row["outage"], &row["state"]),
            (&"II/awv".into(), &1.into(), &"pos_e_m".into())
        );
        assert_eq!(
            (&row["ratio_error_pct"], &row["ci95_pct"][0]),
            (&3.0.into(), &2.5.into())
        );
        assert_eq!(row["abs_ratio_error_pct"], 4.0);
    }
}
