//! `nav-sim wv`: wavelet variance of static recordings.

use super::parse::words;
use super::pictures::PlotArgs;
use super::recordings::{RecordingArgs, Said};
use super::tuning::TuningArgs;
use super::{Failure, Session, read};
use nav_sim::formats::atomic;
use nav_sim::jobs::{self, Intervals, WaveletOptions};
use nav_sim::report;
use std::path::PathBuf;

/// Wavelet variance of static recordings: classical, robust, Allan, with confidence intervals
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
    /// Where the intervals' degrees of freedom are from
    #[arg(long, value_parser = words::<Intervals>(&INTERVALS), default_value_t, help_heading = "Wavelet variance")]
    intervals: Intervals,
    /// Write the curves as JSON
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write a page with figures
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
}

const INTERVALS: [(&str, &str); 2] = [
    (Intervals::Eta3.name(), "The field's usual ones, conservative beyond the first scale"),
    (Intervals::LargeSample.name(), "From the autocovariance of the coefficients: cover at their level"),
];

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let tuning = args.tuning.tuning()?;
    let inputs = read::listed(&args.files)?;
    for out in args.out.iter().chain(&args.page) {
        atomic::guard_inputs(out, inputs.iter().map(PathBuf::as_path))?;
    }
    args.plot.guard(&inputs)?;
    let intervals = args.intervals;
    let options = WaveletOptions {
        reading: args.recordings.options(),
        skip_warm_up: args.recordings.skips_warm_up(),
        scales: args.tuning.scales,
        tuning,
        intervals,
    };
    let file = jobs::wavelet_variances(&args.files, &options, &mut Said::new(session))?;
    let json = report::json(&file);
    if let Some(out) = &args.out {
        atomic::write(out, &json)?;
        session.printer.say(&format!("wrote {}", out.display()));
    }
    if let Some(page) = &args.page {
        atomic::write(page, report::wavelet_page(&file))?;
        session.printer.say(&format!("wrote {}", page.display()));
    }
    args.plot.write(|| report::wavelet_svg(&file), session)?;
    if session.json() {
        session.printer.result(json.trim_end());
        return Ok(());
    }
    for signal in &file.signals {
        let title =
            format!("{} · {}.{} · {} samples", signal.file, signal.sensor, signal.axis, signal.samples);
        session.printer.result(&format!("{title}\n{}", report::columns(&report::signal_rows(signal))));
    }
    session.printer.result(&report::intervals_note(intervals.name(), &tuning));
    Ok(())
}
