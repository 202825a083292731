//! `nav-sim wv`: wavelet variance of static recordings.

use super::recordings::RecordingArgs;
use super::tuning::TuningArgs;
use super::{Failure, Session, read};
use nav_sim::calibration::{Replicate, replicates};
use nav_sim::formats::atomic;
use nav_sim::imu::{Channel, Recording};
use nav_sim::report::{self, SignalCurves, SignalsFile};
use nav_sim::wavelet::{WaveletError, haar, interval};
use rayon::prelude::*;
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
    #[arg(long, value_enum, default_value_t = Intervals::Eta3, help_heading = "Wavelet variance")]
    intervals: Intervals,
    /// Write the curves as JSON
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Intervals {
    /// The field's usual ones, conservative beyond the first scale
    Eta3,
    /// From the autocovariance of the coefficients: cover at their level
    LargeSample,
}

impl Intervals {
    const fn name(self) -> &'static str {
        match self {
            Self::Eta3 => "eta3",
            Self::LargeSample => "large-sample",
        }
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let tuning = args.tuning.tuning()?;
    if let Some(out) = &args.out {
        atomic::guard_inputs(out, read::listed(&args.files)?.iter().map(PathBuf::as_path))?;
    }
    let look = |recording: Recording| -> Result<Vec<SignalCurves>, Failure> {
        let measured = replicates(&recording, args.tuning.scales, &tuning)?;
        let curves = |(channel, replicate): &(Channel, Replicate)| {
            let edof = degrees_of_freedom(args.intervals, &recording, *channel, replicate)?;
            Ok(SignalCurves::new(*channel, replicate, recording.rate_hz, edof, tuning.efficiency()))
        };
        let curves = measured.par_iter().map(curves).collect::<Result<_, WaveletError>>();
        curves.map_err(Failure::could_not)
    };
    let (looks, report) = args.recordings.visit(&args.files, args.tuning.min_samples(), session, &look)?;
    let signals = looks.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    let rate_hz = report.files[0].rate_hz;
    let method = args.intervals.name();
    let file = SignalsFile::new(rate_hz, tuning.efficiency(), method, signals);
    let json = report::json(&file);
    if let Some(out) = &args.out {
        atomic::write(out, &json)?;
        session.printer.say(&format!("wrote {}", out.display()));
    }
    if session.json() {
        session.printer.result(json.trim_end());
        return Ok(());
    }
    for signal in &file.signals {
        let title =
            format!("{} · {}.{} · {} samples", signal.file, signal.sensor, signal.axis, signal.samples);
        session.printer.result(&format!("{title}\n{}", compact(&report::signal_rows(signal))));
    }
    session.printer.result(&report::intervals_note(method, &tuning));
    Ok(())
}

fn degrees_of_freedom(
    intervals: Intervals,
    recording: &Recording,
    channel: Channel,
    replicate: &Replicate,
) -> Result<Vec<f64>, WaveletError> {
    let levels = 1..=replicate.classical.len() as u32;
    match (intervals, recording.signal(channel)) {
        (Intervals::LargeSample, Some(signal)) => levels
            .map(|level| Ok(interval::edof_large_sample(&haar::coefficients(&signal.samples, level)?, level)))
            .collect(),
        _ => Ok(levels.map(|level| interval::edof_eta3(replicate.samples, level)).collect()),
    }
}

/// A table whose first row is its head, without lines.
fn compact(rows: &[Vec<String>]) -> String {
    let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, w)| format!("{cell:<w$}")).collect();
        format!("  {}", cells.join("  ")).trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}
