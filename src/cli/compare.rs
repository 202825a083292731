//! `nav-sim compare`: ratios between runs.

use super::pictures::{PlotArgs, replaceable};
use super::{Failure, Session};
use nav_sim::formats::{atomic, run_directory};
use nav_sim::metrics;
pub(super) use nav_sim::report::markdown_table as table;
use nav_sim::report::{self, CandidateResult, ComparisonFile, Label, Manifest, RatioCurves};
use nav_sim::scenario::Method;
use nav_sim::simulation::REPORTED_NAMES;
use std::path::{Path, PathBuf};

/// Ratios of ASEE (and RMSE, NEES, coverage) between runs, per outage and state
///
/// The table has the layout of the paper's Table I: rows scenario × outage, columns state × estimator, both
/// from the names of the directories (II_sr-awv, or II/sr-awv). Each cell: the mean over the outage of
/// (ASEE ratio − 1)·100, ± half its 95 % Monte-Carlo interval, and in brackets the mean of its absolute
/// value. ASEE is the averaged standard estimation error: what the filter believes, not how wrong it is. So the
/// verdict on every filter comes first, and a second table has NEES, coverage and the ratios of the RMSE at the
/// end of the outage. All states are in the JSON file; a page with figures is written beside it.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --filter full --runs 8 --seed 1 -o out/full
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --runs 8 --seed 1 -o out/reduced
  nav-sim compare out/reduced --reference out/full --state all")]
pub(crate) struct Args {
    /// Run directories
    #[arg(required = true, value_name = "DIR")]
    runs: Vec<PathBuf>,
    /// Run directory to compare with
    #[arg(long, value_name = "DIR")]
    reference: PathBuf,
    /// States in the table (repeatable), or "all"
    #[arg(long = "state", value_name = "STATE", default_values = ["pos_e_m", "roll_deg"])]
    states: Vec<String>,
    /// Where to write the comparison [default: comparison.json, unless that is something else]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the table of ASEE ratios alone, in this form
    #[arg(long, value_enum, value_name = "FORM", conflicts_with = "format")]
    table: Option<TableForm>,
    #[command(flatten)]
    plot: PlotArgs,
}

/// How a table is written.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum TableForm {
    Markdown,
    Csv,
    /// A `tabular` with the rules of booktabs
    Latex,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let out = &args.out.clone().map_or_else(unasked_output, Ok)?;
    let page = out.with_extension("html");
    let read_from = args.runs.iter().chain([&args.reference]);
    let inputs: Vec<PathBuf> =
        read_from.flat_map(|run| report::RUN_FILES.map(|name| run.join(name))).collect();
    atomic::guard_inputs(out, inputs.iter().map(PathBuf::as_path))?;
    atomic::guard_inputs(&page, inputs.iter().map(PathBuf::as_path))?;
    args.plot.guard(&inputs)?;
    replaceable(&page)?;
    let compared = Compared::new(args, session)?;
    let json = report::json(&compared.file);
    atomic::write_result(out, &json, session.existing())?;
    atomic::write(&page, compared.page(&[]))?;
    args.plot.write(|| compared.picture(), session)?;
    if session.json() {
        session.printer.result(json.trim_end());
    } else {
        let shown = args.table.map_or_else(|| compared.text(), |form| compared.table(form));
        session.printer.result(shown.trim_end());
    }
    session.printer.say(&format!("wrote {}, {}", out.display(), page.display()));
    Ok(())
}

/// What was found, and how it is shown.
pub(super) struct Compared {
    file: ComparisonFile,
    candidates: Vec<CandidateResult>,
    /// One a candidate.
    curves: Vec<RatioCurves>,
    /// Start and end (s).
    outages: Vec<(f64, f64)>,
    /// The states that are shown.
    states: Vec<usize>,
}

impl Compared {
    /// Reads the runs and compares them.
    pub(super) fn new(args: &Args, session: &Session) -> Result<Self, Failure> {
        let states = states(&args.states)?;
        let reference = read(&args.reference)?;
        let (mut candidates, mut curves) = (Vec::new(), Vec::new());
        let mut all_paired = true;
        for path in &args.runs {
            let candidate = read(path)?;
            comparable(path, &candidate.manifest, &reference.manifest)?;
            let differences = differences(&candidate.manifest, &reference.manifest);
            for difference in &differences {
                session.printer.warn(&format!("{}: {difference}", path.display()));
            }
            let paired = differences.is_empty();
            all_paired &= paired;
            let outages =
                metrics::compare(&candidate.experiment, &reference.experiment, paired).map_err(|e| {
                    let failure = Failure::input(format!("{}: {e}", path.display()));
                    let runs = matches!(e, metrics::ComparisonError::Runs { .. });
                    failure.maybe_hint(runs.then(|| "make both with one number of --runs".to_owned()))
                })?;
            curves.push(RatioCurves::of(&candidate.experiment, &reference.experiment));
            let run = path.display().to_string();
            let label = Label::of(&run, candidate.manifest.model.estimator.as_deref());
            let is_reference = same_place(path, &args.reference);
            let verdict = candidate.experiment.verdict();
            candidates.push(CandidateResult { run, label, is_reference, verdict, outages });
        }
        let name = args.reference.display().to_string();
        let file = ComparisonFile::new((&name, &reference.experiment.verdict()), all_paired, &candidates);
        Ok(Self { file, candidates, curves, outages: reference.experiment.outages, states })
    }

    /// The page, with links to those beneath it.
    pub(super) fn page(&self, links: &[(String, String)]) -> String {
        let Self { file, candidates, curves, outages, states } = self;
        report::comparison_page(file, candidates, curves, outages, states, links)
    }

    fn picture(&self) -> String {
        report::comparison_svg(&self.candidates, &self.curves, &self.outages, &self.states)
    }

    /// The table of ASEE ratios.
    fn rows(&self) -> Vec<Vec<String>> {
        report::with_times(report::table_rows(&self.candidates, &self.states), &self.outages)
    }

    fn table(&self, form: TableForm) -> String {
        let write = match form {
            TableForm::Markdown => report::markdown_table,
            TableForm::Csv => report::csv_table,
            TableForm::Latex => report::latex_table,
        };
        write(&self.rows())
    }

    /// The verdicts, the table of ASEE ratios, and what stands beside them.
    fn text(&self) -> String {
        let mut lines = report::verdict_lines(&self.file.verdicts);
        if self.candidates.iter().any(|c| !c.outages.is_empty()) {
            lines.push(format!(
                "ASEE against {}, mean over the outage, % (in parentheses: mean size of the deviations):",
                self.file.reference
            ));
            lines.push(table(&self.rows()));
            lines.push(
                "NEES (9 if right) and coverage over the outage, RMSE at its end against the reference, %:"
                    .to_owned(),
            );
            let rows = report::consistency_rows(&self.candidates, &self.states);
            lines.push(table(&report::with_times(rows, &self.outages)));
        }
        lines.join("\n")
    }
}

/// The output that nobody named: a file there that is no comparison is somebody's own.
fn unasked_output() -> Result<PathBuf, Failure> {
    let path = PathBuf::from("comparison.json");
    let is_comparison = |text: String| {
        let file: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        ["schema_version", "reference", "paired", "rows"].iter().all(|key| !file[key].is_null())
    };
    if !path.exists() || std::fs::read_to_string(&path).is_ok_and(is_comparison) {
        return Ok(path);
    }
    let failure = Failure::input(format!("{} is there and is no comparison", path.display()));
    Err(failure.hint("name the output with --out"))
}

fn read(path: &Path) -> Result<run_directory::RunDirectory, Failure> {
    run_directory::read(path).map_err(|e| {
        let failure = if e.is_content() { Failure::input(&e) } else { Failure::could_not(&e) };
        failure.maybe_hint(e.hint())
    })
}

pub(super) fn states(names: &[String]) -> Result<Vec<usize>, Failure> {
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

/// Without the same trajectory a ratio means nothing.
fn comparable(path: &Path, candidate: &Manifest, reference: &Manifest) -> Result<(), Failure> {
    if candidate.hashes("trajectory") == reference.hashes("trajectory") {
        return Ok(());
    }
    let failure = Failure::input(format!("{}: not the trajectory of the reference", path.display()));
    Err(failure.hint("compare runs along one and the same trajectory file"))
}

/// What makes two runs differ beside the model in the filter; then run k did not see the same noise.
fn differences(candidate: &Manifest, reference: &Manifest) -> Vec<String> {
    let (c, r) = (&candidate.configuration, &reference.configuration);
    let mut found = Vec::new();
    let mut differ = |what: &str, different: bool| {
        if different {
            found.push(format!("{what} not that of the reference; the runs are not paired"));
        }
    };
    let is_expected = [c, r].map(|of| of.run.method == Method::Lincov);
    let (seeds, scenarios) = ([candidate.seed, reference.seed], [&candidate.scenario, &reference.scenario]);
    // covariance analysis draws nothing, and so differs in nothing by its seed
    let differently = seeds[0] != seeds[1] || scenarios[0] != scenarios[1];
    differ("the method is", is_expected[0] != is_expected[1]);
    differ("the seed is", is_expected == [false, false] && differently);
    differ("what makes the errors is", truth(candidate) != truth(reference));
    differ("[imu] is", c.imu != r.imu);
    differ("[gnss] is", c.gnss != r.gnss);
    differ("[initial] is", c.initial != r.initial);
    found
}

/// What made the INS errors: a recording, a model, or the filter's own.
fn truth(manifest: &Manifest) -> Vec<&str> {
    let given = ["static", "truth", "model"].map(|role| manifest.hashes(role));
    given.into_iter().find(|hashes| !hashes.is_empty()).unwrap_or_default()
}

fn same_place(a: &Path, b: &Path) -> bool {
    a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b)
}
