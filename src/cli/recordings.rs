//! Flags for static recordings, and reading them.

use super::axes::ChannelSet;
use super::{Failure, Session};
use nav_sim::data::recordings::{self, Gaps, ReadOptions, Report};
use nav_sim::imu::{Recording, Sensor};
use std::cell::OnceCell;
use std::path::PathBuf;

/// How recordings are read.
#[derive(clap::Args, Debug)]
#[command(next_help_heading = "Recordings")]
pub(crate) struct RecordingArgs {
    /// Sample rate (Hz) of files without a time column
    #[arg(long, value_name = "HZ", value_parser = super::parse::rate_hz)]
    rate_hz: Option<f64>,
    /// Seconds to leave out at the beginning of each file (warm-up)
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = super::parse::non_negative)]
    skip_s: f64,
    /// What to do where the time jumps or stands still
    #[arg(long, value_enum, default_value_t = GapsArg::Refuse)]
    gaps: GapsArg,
    /// Signals to use: all, accel, gyro, x, accel.x, … (repeatable or comma-separated; default: all)
    #[arg(long, value_name = "AXES", value_delimiter = ',', value_parser = ChannelSet::named)]
    axes: Vec<ChannelSet>,
    /// Names of the columns, comma-separated, instead of the header (and for files without one)
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    columns: Option<Vec<String>>,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum GapsArg {
    /// Refuse the file
    Refuse,
    /// Make each stretch between gaps a recording of its own (but not one 16 times shorter than the longest)
    Split,
    /// Take the samples as evenly spaced
    Ignore,
}

impl RecordingArgs {
    /// Rate given on the command line (Hz).
    pub(crate) const fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// Seconds left out at the beginning of each file.
    pub(crate) const fn skip_s(&self) -> f64 {
        self.skip_s
    }

    /// Looks at recordings one by one, says what was found (in detail with `--verbose`) and what is doubtful.
    pub(crate) fn visit<T: Send>(
        &self,
        paths: &[PathBuf],
        min_samples: usize,
        session: &Session,
        look: &(dyn Fn(Recording) -> T + Sync),
    ) -> Result<(Vec<T>, Report), Failure> {
        let options = ReadOptions {
            rate_hz: self.rate_hz,
            skip_s: self.skip_s,
            gaps: match self.gaps {
                GapsArg::Refuse => Gaps::Refuse,
                GapsArg::Split => Gaps::Split,
                GapsArg::Ignore => Gaps::Ignore,
            },
            channels: (!self.axes.is_empty()).then(|| self.axes.iter().flat_map(|s| s.0.clone()).collect()),
            columns: self.columns.clone(),
            min_samples,
            ..ReadOptions::default()
        };
        let progress = OnceCell::new();
        let tell = |done: usize, all: usize| {
            let progress = progress.get_or_init(|| session.progress("recordings", all as u64));
            if done > 0 {
                progress.add(1);
            }
        };
        let visited = recordings::visit(paths, &options, look, &tell);
        drop(progress);
        let (looks, report) = visited?;
        for file in &report.files {
            session.printer.say(&file.to_string());
            if !file.ignored.is_empty() {
                session.printer.detail(&format!("{}: passed over: {}", file.file, file.ignored.join(", ")));
            }
        }
        for warning in report.all_warnings() {
            session.printer.warn(&warning);
        }
        Ok((looks, report))
    }
}

/// The sensor of that name.
pub(crate) fn sensor(word: &str) -> Result<Sensor, String> {
    Sensor::ALL.into_iter().find(|s| s.name() == word).ok_or_else(|| "not accel or gyro".into())
}
