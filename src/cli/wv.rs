//! `nav-sim wv`: wavelet variance of static recordings.

use super::pictures::{PlotArgs, claim_output};
use super::{Failure, Session, read};
use crate::formats::atomic::Written;
use crate::report::{self, Answer};
use crate::wv::{self, WaveletRequest};
use std::path::PathBuf;

/// Compute wavelet variances (classical, robust) and Allan deviations of static recordings
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim wv calib_data/formats/own.csv
  nav-sim wv calib_data/formats/euroc.csv --axes gyro --intervals large-sample
  nav-sim wv calib_data/formats/compressed.csv.gz --format json -o static.wv.json")]
pub(crate) struct Args {
    #[command(flatten)]
    request: WaveletRequest,
    /// Write the curves as JSON
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    args.request.tuning.tuning()?;
    let inputs = read::listed(&args.request.files)?;
    let _own = claim_output(args.out.as_deref(), &inputs, Written::Signals, session)?;
    let _pictures = args.plot.claim(&inputs, session)?;
    let file = args.request.curves(&session.context())?;
    let written = args
        .out
        .iter()
        .try_for_each(|out| session.write(out, report::json(&file)));
    let drawn = args.plot.draw(&file.document(), session);
    match () {
        () if session.csv() => session.result(wv::signals_csv(&file).trim_end()),
        () => {
            session.answer(&file);
        }
    }
    written.and(drawn)
}
