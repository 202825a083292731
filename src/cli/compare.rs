//! `nav-sim compare`: ratios between runs.

use super::pictures::{PlotArgs, claim_output};
use super::{Failure, Session};
use crate::formats::atomic::{self, Written};
use crate::jobs::{self, Comparison};
use crate::report::{self, PaperFigure, ShownComparison};
use nav_sim_navigation::simulation::REPORTED_NAMES;
use std::path::{Path, PathBuf};

/// Compare runs: verdicts, and ratios of ASEE and RMSE per outage and state
///
/// The table has the layout of the paper's Table I: rows scenario × outage, columns state × estimator, both
/// from the names of the directories (II_sr-awv, or II/sr-awv). Each cell holds the mean over the outage of
/// (ASEE ratio − 1)·100, ± half its 95 % interval, and in parentheses the mean of its absolute value. The interval
/// covers the Monte-Carlo error, and the uncertainty of the calibrations if both runs used --method lincov or both
/// with models of calibrate. ASEE, the averaged standard estimation error, is what the filter believes, not how
/// wrong it is. So the verdict on every filter comes first, and a second table has NEES, coverage and the ratios of
/// the RMSE at the end of the outage. All states are in the JSON file; a page with figures is written beside it.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --filter full --runs 8 --seed 1 -o out/with_all
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --runs 8 --seed 1 -o out/with_15
  nav-sim compare out/with_15 --reference out/with_all --state all")]
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
    /// Where to write the comparison [default: comparison.json]
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
    /// Numbers for other programs: one row a run, outage and state, percentages in columns of their own
    Csv,
    /// A `tabular` with the rules of booktabs
    Latex,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let out = args.out.as_deref().unwrap_or(Path::new("comparison.json"));
    let page = out.with_extension("html");
    let read_from = args.runs.iter().chain([&args.reference]);
    let inputs: Vec<PathBuf> =
        read_from.flat_map(|run| report::RUN_FILES.map(|name| run.join(name))).collect();
    let _own = claim_output(Some(out), &inputs, Written::Comparison, session)?;
    let _page = claim_output(Some(&page), &inputs, Written::Page, session)?;
    let _picture = args.plot.claim(&inputs, session)?;
    let compared = Compared::new(args, session)?;
    let json = report::json(&compared.found.file);
    session.show(|| json.clone(), || args.table.map_or_else(|| compared.text(), |form| compared.table(form)));
    atomic::write(out, &json)?;
    atomic::write(&page, compared.page(&[]))?;
    args.plot.write(|| compared.shown().svg(), session)?;
    session.say(format!("wrote {}, {}", out.display(), page.display()));
    Ok(())
}

/// Columns that say what a row is of: scenario and outage.
const LEAD: usize = 2;

/// What was found, and how it is shown.
pub(super) struct Compared {
    found: Comparison,
    /// The states that are shown.
    states: Vec<usize>,
}

impl Compared {
    /// Reads the runs and compares them.
    pub(super) fn new(args: &Args, session: &Session) -> Result<Self, Failure> {
        let states = states(&args.states)?;
        let found = jobs::compare(&args.runs, &args.reference)?;
        session.warn_all(&found.doubts);
        Ok(Self { found, states })
    }

    /// The page, with links to those beneath it.
    pub(super) fn page(&self, links: &[(String, String)]) -> String {
        self.shown().page(&self.found.file, links)
    }

    /// The paper's Figure 7.
    pub(super) fn figure(&self) -> PaperFigure {
        self.shown().figure()
    }

    /// The outages (start, end) (s).
    pub(super) fn outages(&self) -> &[(f64, f64)] {
        &self.found.outages
    }

    fn shown(&self) -> ShownComparison<'_> {
        let Comparison { candidates, curves, outages, .. } = &self.found;
        ShownComparison { candidates, curves, outages, states: &self.states }
    }

    /// The table of ASEE ratios.
    fn rows(&self) -> Vec<Vec<String>> {
        let rows = report::table_rows(&self.found.candidates, &self.states);
        report::with_times(rows, &self.found.outages)
    }

    fn table(&self, form: TableForm) -> String {
        let Comparison { file, candidates, outages, .. } = &self.found;
        match form {
            TableForm::Markdown => report::markdown_table(&self.rows()),
            TableForm::Csv => {
                let rows = report::ratio_rows(candidates, &self.states, outages, &file.reference);
                report::csv_table(&rows).trim_end().to_owned()
            }
            TableForm::Latex => report::latex_table(&self.rows()),
        }
    }

    /// The verdicts, the table of ASEE ratios, and what stands beside them.
    fn text(&self) -> String {
        let Comparison { file, candidates, outages, .. } = &self.found;
        let mut lines = report::verdict_lines(&file.verdicts);
        if candidates.iter().any(|c| !c.outages.is_empty()) {
            lines.push(format!(
                "ASEE against {}, mean over the outage, % (in parentheses: mean size of the deviations; {}):",
                file.reference,
                report::meaning_of_intervals(candidates)
            ));
            lines.push(report::terminal_table(&self.rows(), LEAD));
            let names: Vec<&str> = self.states.iter().map(|s| REPORTED_NAMES[*s]).collect();
            lines.push(format!(
                "NEES (9 if right) and coverage over the outage, RMSE at its end ({}) against the reference, %:",
                names.join(", ")
            ));
            let rows = report::consistency_rows(candidates, &self.states);
            lines.push(report::terminal_table(&report::with_times(rows, outages), LEAD));
        }
        lines.join("\n")
    }
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
