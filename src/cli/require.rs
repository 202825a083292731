//! `nav-sim require`: which IMU a limit needs, and what a given one makes of it.

use super::pictures::{PlotArgs, claim_output};
use super::{Failure, Session};
use crate::formats::atomic::Written;
use crate::formats::model_file;
use crate::require::RequireRequest;
use std::path::PathBuf;

/// Find the IMU that keeps the errors at the end of an outage within limits, or judge MODEL by them
///
/// Uses linear covariance analysis along TRAJECTORY of a filter that knows its IMU. Without MODEL it finds the white noise
/// and bias instability that each sensor may have beside the turn-on biases of [imu] in --scenario. With MODEL it says
/// whether the limits are kept (exit code 3: they are not), and the longest outage that it bridges.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim require trajectories/figure_eight.toml --outage 60 \\
      --require 'p95_m<=50' -o needed.toml
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage 60:120 --require 'rmse_m<=100'
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage longest --require 'p95_m<=20'")]
pub(crate) struct Args {
    #[command(flatten)]
    request: RequireRequest,
    #[command(flatten)]
    plot: PlotArgs,
    /// Model file to write, of the required IMU
    #[arg(long, short, value_name = "FILE", conflicts_with_all = ["model", "catalogue"])]
    out: Option<PathBuf>,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let request = &args.request;
    request.possible()?;
    let _pictures = args.plot.claim(
        std::iter::once(&request.trajectory).chain(&request.model),
        session,
    )?;
    let _own = claim_output(
        args.out.as_deref(),
        [&request.trajectory],
        Written::Required,
        session,
    )?;
    let (found, needed) = request.found(&session.context())?;
    let drawn = args.plot.draw(&session.answer(&found), session);
    if let (Some(out), Some(file)) = (&args.out, needed) {
        model_file::write(out, &file)?;
        session.wrote(out);
    }
    drawn?;
    found.unmet().map_or(Ok(()), Err)
}
