//! `nav-sim choose`: which noise model, on the user's own recordings.

use super::pictures::PlotArgs;
use super::{Failure, Session};
use crate::choose::{self, ChoiceRequest};
use std::path::PathBuf;

/// Choose the noise model for a filter by navigating on recordings left out of its calibration
///
/// Leaves out one recording at a time, calibrates every candidate on the others and navigates along TRAJECTORY with
/// windows of the one left out; abnormal recordings are not left out, and judge nothing. Ranks the candidates by the mean log density of the true errors at the ends of outages
/// under the filter's covariance, which rewards accuracy and consistency together. Also prints RMSE, NEES and coverage,
/// with intervals over recordings. Writes report.html, ranking.json and model.toml, the winner calibrated on all
/// recordings.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml --replicates 4 --samples 16384 -o recordings
  nav-sim choose recordings --trajectory trajectories/figure_eight.toml --outage 60:90 \\
      --estimator awv,dr-awv --inflate none,x10
  nav-sim choose recordings --trajectory trajectories/figure_eight.toml --outage 60:90 \\
      --estimator awv --model N1,WN+RW --filter 15,full -o out/models --format json")]
pub(crate) struct Args {
    #[command(flatten)]
    request: ChoiceRequest,
    #[command(flatten)]
    plot: PlotArgs,
    /// Directory to make
    #[arg(long, short, value_name = "DIR", default_value = "out/choice")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let request = ChoiceRequest {
        seed: session.asked_seed(),
        ..args.request.clone()
    };
    request.candidates()?;
    let read = request.inputs.iter().chain([&request.trajectory]);
    let guarded = read.clone().chain(&request.scenario).map(PathBuf::as_path);
    let _own = choose::claim_choice(&args.out, guarded, session.existing())?;
    let _picture = args.plot.claim(read, session)?;
    let made = request.made(|| session.seed(None), &session.context())?;
    let report = made.report();
    made.chosen
        .write(&args.out, &request.trajectory, request.note(&made), &report)?;
    let document = session.answer(&report);
    args.plot.draw(&document, session)?;
    session.say(format!(
        "wrote {0}: report.html, ranking.json, model.toml (nav-sim export {0}/model.toml)",
        args.out.display()
    ));
    Ok(())
}
