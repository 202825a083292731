//! `nav-sim design`: how many recordings, and how long.

use super::pictures::PlotArgs;
use super::{Failure, Session};
use crate::design::DesignRequest;

/// Predict how well a number of recordings of given length would determine an IMU like MODEL
///
/// Draws the wavelet variances of recordings from their sampling distribution, with the [spread] of MODEL between
/// recordings, and calibrates them as `nav-sim calibrate` would. The expected interval is made of the scatter of these
/// estimates about MODEL. What one calibration states is made of the scatter of its own recordings, half of them more and half
/// less; where a parameter is known to ± 100 %, rather less. 200 draws know such an interval to about 20 %. With --trajectory there is also the
/// interval on the horizontal error (95 % quantile) at the end of each outage, for a filter that knows the IMU.
/// Without --recordings or --hours a table of several is printed.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim design calib_data/tactical.toml --recordings 6 --hours 2
  nav-sim design calib_data/consumer_mems.toml --recordings 6 --hours 1 --draws 50 --estimator awv
  nav-sim design calib_data/tactical.toml --recordings 4 --hours 1 --draws 50 \\
      --trajectory trajectories/figure_eight.toml --outage 300:360")]
pub(crate) struct Args {
    #[command(flatten)]
    request: DesignRequest,
    #[command(flatten)]
    plot: PlotArgs,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let request = DesignRequest {
        seed: session.asked_seed(),
        ..args.request.clone()
    };
    let _pictures = args.plot.claim(
        std::iter::once(&request.model).chain(&request.trajectory),
        session,
    )?;
    let designs = request.made(&session.context())?;
    let document = session.answer(&designs);
    args.plot.draw(&document, session)
}
