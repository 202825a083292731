//! `nav-sim inspect`: the contents of a log.

use super::{Failure, Session};
use crate::inspect;
use crate::jobs::LogRequest;
use std::path::PathBuf;

/// List the channels of a log: MCAP, ROS 1 bag, PX4 ULog, u-blox UBX
///
/// Samples of an IMU and fixes of a receiver are read through: rate by the median step, gaps (steps beyond 1.5 times it),
/// jitter (95 % of the steps are as near to the median one).
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim inspect calib_data/formats/log.mcap
  nav-sim inspect calib_data/formats/receiver.ubx --format json
  nav-sim inspect calib_data/formats/log.mcap --stamp log")]
pub(crate) struct Args {
    /// Log
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    log: LogRequest,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let found = inspect::inspect(&args.file, &args.log.options(None))?;
    session.answer(&found);
    Ok(())
}
