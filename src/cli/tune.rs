//! `nav-sim tune`: factors on a noise model that make its filter consistent.

use super::pictures::{PlotArgs, claim_output};
use super::{Failure, Session};
use crate::formats::atomic::Written;
use crate::formats::model_file;
use crate::tune::{TuneRequest, Tuned};
use std::path::PathBuf;

/// Find the smallest factors on MODEL that make its filter consistent for another truth
///
/// Factors multiply variances of all processes but quantization noise, which is in no filter. They are found by linear
/// covariance analysis along the trajectory. Where no factor makes the filter consistent, the exit code is 3 and no model
/// is written.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim tune calib_data/tactical.toml --truth calib_data/consumer_mems.toml -o tuned.toml
  nav-sim tune calib_data/tactical.toml --for mean \\
      --truth calib_data/tactical.toml calib_data/consumer_mems.toml \\
      --trajectory trajectories/figure_eight.toml --outage 60:90
  nav-sim tune calib_data/tactical.toml --filter 15 --format json \\
      --truth calib_data/consumer_mems.toml")]
pub(crate) struct Args {
    #[command(flatten)]
    request: TuneRequest,
    #[command(flatten)]
    plot: PlotArgs,
    /// Model file to write
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let request = TuneRequest {
        seed: session.asked_seed(),
        ..args.request.clone()
    };
    let files = request.inputs()?;
    let _pictures = args.plot.claim(files.iter().map(|f| &f.path), session)?;
    let _own = claim_output(
        args.out.as_deref(),
        files.iter().map(|f| &f.path),
        Written::Tuned,
        session,
    )?;
    let Tuned { result, model } = request.tuned(&session.context())?;
    args.plot.draw(&session.answer(&result), session)?;
    if let Some(unmet) = request.failure(&result) {
        return Err(unmet);
    }
    if let (Some(out), Some(model)) = (&args.out, model) {
        model_file::write(out, &model)?;
        session.wrote(out);
    }
    Ok(())
}
