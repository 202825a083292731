//! `nav-sim run`: the main job.

mod output;

use super::pictures::PlotArgs;
use super::{Failure, Session};
use crate::run::RunRequest;
use std::path::PathBuf;

/// Navigate by INS/GNSS along TRAJECTORY with MODEL in the filter: Monte Carlo or covariance analysis
///
/// Writes a run directory: epochs.csv (ASEE, RMSE, bias, NEES, coverage at 1 Hz), fan.csv (quantiles of the
/// horizontal error), runs.csv, summary.json, report.html, manifest.json. The same seed gives every model the same
/// noise, so that runs can be compared pair by pair (see `nav-sim compare`).
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml --seed 1 --runs 20
  nav-sim run trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage 60:90 --filter full --runs 8 -o out/full
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --truth calib_data/tactical.toml --runs 8 -o out/mismatch")]
pub(crate) struct Args {
    #[command(flatten)]
    request: RunRequest,
    #[command(flatten)]
    plot: PlotArgs,
    /// Run directory to make
    #[arg(long, short, value_name = "DIR", default_value = "out/run")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let context = session.context();
    let request = RunRequest {
        seed: session.asked_seed(),
        ..args.request.clone()
    };
    let mut prepared = request.prepare(|| session.seed(None), &context)?;
    prepared.manifest.command = super::given();
    prepared.manifest.threads = session.threads();
    let _own = output::claim(&args.out, &prepared.manifest, session)?;
    let _picture = args
        .plot
        .claim(prepared.manifest.inputs.iter().map(|i| &i.path), session)?;
    let mut answer = prepared.navigate(&context)?;
    answer.took(context.runs_s());
    answer.write(&args.out)?;
    let document = session.answer(&answer);
    args.plot.write(&document, || answer.svg(), session)?;
    session.wrote(&args.out);
    answer.unmet().map_or(Ok(()), Err)
}
