//! `nav-sim wv`: wavelet variance of static recordings.

use super::parse::words;
use super::pictures::{PlotArgs, claim_output};
use super::recordings::{RecordingArgs, Said};
use super::tuning::TuningArgs;
use super::{Failure, Session, read};
use crate::formats::atomic::Written;
use crate::report::{self, Answer};
use crate::wv::{self, Intervals, WaveletOptions};
use std::path::PathBuf;

/// Compute wavelet variances (classical, robust) and Allan deviations of static recordings
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim wv calib_data/formats/own.csv
  nav-sim wv calib_data/formats/euroc.csv --axes gyro --intervals large-sample
  nav-sim wv calib_data/formats/compressed.csv.gz --format json -o static.wv.json")]
pub(crate) struct Args {
    /// Recordings, or directories of recordings
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    recordings: RecordingArgs,
    #[command(flatten)]
    tuning: TuningArgs,
    /// Where the degrees of freedom of the intervals come from
    #[arg(long, value_parser = words::<Intervals>(&INTERVALS), default_value_t, help_heading = "Wavelet variance")]
    intervals: Intervals,
    /// Print one table for each sensor and axis, with the recordings side by side
    #[arg(long, conflicts_with = "verbose")]
    per_file: bool,
    /// Write the curves as JSON
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
}

const INTERVALS: [(&str, &str); 2] = [
    (Intervals::Eta3.name(), "The field's usual ones, conservative beyond the first scale"),
    (Intervals::LargeSample.name(), "From the autocovariance of the coefficients: with the stated coverage"),
];

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let tuning = args.tuning.tuning()?;
    let inputs = read::listed(&args.files)?;
    let _own = claim_output(args.out.as_deref(), &inputs, Written::Signals, session)?;
    let _pictures = args.plot.claim(&inputs, session)?;
    let intervals = args.intervals;
    let options = WaveletOptions {
        reading: args.recordings.options(),
        skip_warm_up: args.recordings.reading.skips_warm_up(),
        scales: args.tuning.levels(),
        tuning,
        intervals,
    };
    let file = wv::wavelet_variances(&args.files, &options, &mut Said::new(session))?;
    let json = report::json(&file);
    let written = args.out.iter().try_for_each(|out| session.write(out, &json));
    let drawn = args.plot.draw(&file.document(), session);
    match () {
        () if session.csv() => session.result(wv::signals_csv(&file).trim_end()),
        () if args.per_file && !session.json() => session.result(side_by_side(&file)),
        () => {
            session.answer(&file);
        }
    }
    written.and(drawn)
}

/// A table for each sensor and axis.
fn side_by_side(file: &report::SignalsFile) -> String {
    let tables = wv::side_by_side(file).into_iter();
    tables
        .map(|(title, table)| format!("{title}\n{}", table.columns(report::WIDTH)))
        .collect::<Vec<_>>()
        .join("\n")
}
