//! `nav-sim compare`: ratios between runs.

use super::pictures::{PlotArgs, claim_output};
use super::{Failure, Session};
use crate::compare::{CompareRequest, Comparison};
use crate::formats::atomic::{self, Written};
use crate::report::{self, Answer};
use std::path::{Path, PathBuf};

/// Compare runs: verdicts, and ratios of ASEE and RMSE per outage and state
///
/// ASEE, the averaged standard estimation error, is what a filter believes of its error. A cell holds the mean over the
/// outage of (ASEE ratio − 1)·100 ± half its 95 % interval: that of Monte Carlo, and of the calibrations if both runs
/// used --method lincov or both with models of calibrate. Scenario and estimator are those of the directories' names
/// (II_sr-awv, or II/sr-awv); --table prints the layout of the paper's Table I. All states are in the JSON file; a page
/// with NEES, coverage and RMSE is written beside it.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --filter full --runs 8 --seed 1 -o out/with_all
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --runs 8 --seed 1 -o out/with_15
  nav-sim compare out/with_15 --reference out/with_all --state all")]
pub(crate) struct Args {
    #[command(flatten)]
    request: CompareRequest,
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
    compare(args, "", session).map(|_| ())
}

/// Compares, prints and writes; `cause`: beginning of the verdict, or nothing.
pub(super) fn compare(args: &Args, cause: &str, session: &Session) -> Result<Comparison, Failure> {
    let out = args.out.as_deref().unwrap_or(Path::new("comparison.json"));
    let page = out.with_extension("html");
    let read_from = args.request.runs.iter().chain([&args.request.reference]);
    let inputs: Vec<PathBuf> = read_from
        .flat_map(|run| crate::commands::run::RUN_FILES.map(|name| run.join(name)))
        .collect();
    let _own = claim_output(Some(out), &inputs, Written::Comparison, session)?;
    let _page = claim_output(Some(&page), &inputs, Written::Page, session)?;
    let _picture = args.plot.claim(&inputs, session)?;
    let found = args.request.comparison()?;
    let found = Comparison {
        cause: cause.to_owned(),
        ..found
    };
    let document = match args.table {
        None => session.answer(&found),
        Some(form) => {
            let table = match form {
                TableForm::Markdown => found.table().markdown(),
                TableForm::Csv => found.csv(),
                TableForm::Latex => found.table().latex(),
            };
            session.warn_all(&found.doubts);
            session.show(|| report::json(&found), || table);
            found.document()
        }
    };
    atomic::write(out, report::json(&found))?;
    atomic::write(&page, document.html())?;
    args.plot.draw(&document, session)?;
    session.say(format!("wrote {}, {}", out.display(), page.display()));
    Ok(found)
}
