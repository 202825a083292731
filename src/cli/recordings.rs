//! Flags for static recordings, and reading them.

use super::axes::ChannelSet;
use super::parse::words;
use super::{Progress, Session};
use crate::formats::logs::LogOptions;
use crate::formats::recordings::{Gaps, ReadOptions, Report};
use crate::jobs::{Remark, Remarks};
use crate::report::six_digits;
use nav_sim_logs::{OnDamage, Stamp};
use nav_sim_signal::imu::{Channel, Sensor};

/// How recordings are read.
#[derive(clap::Args, Debug)]
#[command(next_help_heading = "Recordings")]
pub(crate) struct ReadingArgs {
    /// Sample rate (Hz) of files without a time column
    #[arg(long, value_name = "HZ", value_parser = super::parse::rate_hz)]
    rate_hz: Option<f64>,
    /// Seconds to leave out at the beginning of each file (warm-up); auto: what differs from the rest of each file
    #[arg(long, value_name = "S|auto", default_value = "0", value_parser = skip)]
    skip_s: Skip,
    /// Topic of the IMU in a log that has several
    #[arg(long, value_name = "NAME")]
    topic: Option<String>,
    #[command(flatten)]
    log: LogArgs,
}

/// What is read of a log.
#[derive(clap::Args, Debug)]
pub(crate) struct LogArgs {
    /// Stamps of a log: header, of the measurement; log, of its arrival
    #[arg(long, value_name = "WHICH", value_parser = words::<Stamps>(STAMPS), default_value_t)]
    stamp: Stamps,
    /// Read a damaged log up to the damage
    #[arg(long)]
    recover: bool,
}

impl LogArgs {
    /// The same, of a topic.
    pub(crate) fn options(&self, topic: Option<String>) -> LogOptions {
        LogOptions {
            topic,
            stamp: if self.stamp == Stamps::Log { Stamp::Log } else { Stamp::Header },
            on_damage: if self.recover { OnDamage::Recover } else { OnDamage::Refuse },
        }
    }
}

/// Stamps of a log by their names.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Stamps {
    #[default]
    Header,
    Log,
}

nav_sim_signal::named!(Stamps { Header = "header", Log = "log" });

const STAMPS: &[(&str, &str)] = &[
    ("header", "Of the measurement, as the message states it"),
    ("log", "Of arrival, as the logger states it"),
];

/// How recordings are read, and which of their signals are used.
#[derive(clap::Args, Debug)]
#[command(next_help_heading = "Recordings")]
pub(crate) struct RecordingArgs {
    #[command(flatten)]
    pub(crate) reading: ReadingArgs,
    /// What to do where the time jumps or stands still
    #[arg(long, value_parser = words::<Gaps>(GAPS), default_value_t = Gaps::Keep)]
    gaps: Gaps,
    /// Signals to use: all, accel, gyro, x, accel.x, … (repeatable or comma-separated; default: all)
    #[arg(long, value_name = "AXES", value_delimiter = ',', value_parser = ChannelSet::named)]
    axes: Vec<ChannelSet>,
}

const GAPS: &[(&str, &str)] = &[
    ("keep", "Leave out what is missing, if it is less than a tenth; refuse the file otherwise"),
    WHOLE[0],
    WHOLE[1],
    WHOLE[2],
];

/// The same of windows that are navigated, in which nothing may be missing.
pub(crate) const WHOLE: &[(&str, &str)] = &[
    ("refuse", "Refuse the file"),
    (
        "split",
        "Make each stretch between gaps a recording of its own (but not one 16 times shorter than the longest)",
    ),
    ("ignore", "Take the samples as evenly spaced over the whole time: stamped late, none lost"),
];

/// What is left out at the beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Skip {
    /// So many seconds.
    Seconds(f64),
    /// What is found not to be as the rest.
    Auto,
}

fn skip(text: &str) -> Result<Skip, String> {
    match text {
        "auto" => Ok(Skip::Auto),
        _ => super::parse::non_negative(text).map(Skip::Seconds).map_err(|e| format!("{e}, nor auto")),
    }
}

impl ReadingArgs {
    /// Whether each recording's own warm-up is left out.
    pub(crate) fn skips_warm_up(&self) -> bool {
        self.skip_s == Skip::Auto
    }

    /// Rate given on the command line (Hz).
    pub(crate) const fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// What decides what is read of the files, for the provenance of a result.
    pub(crate) fn provenance(&self, gaps: Gaps) -> toml::Table {
        let skip_s = match self.skip_s {
            Skip::Seconds(s) => s.into(),
            Skip::Auto => "auto".into(),
        };
        let mut table = toml::Table::new();
        table.insert("skip_s".to_owned(), skip_s);
        table.insert("gaps".to_owned(), gaps.name().into());
        if let Some(rate_hz) = self.rate_hz {
            table.insert("rate_hz_given".to_owned(), rate_hz.into());
        }
        if let Some(topic) = &self.topic {
            table.insert("topic".to_owned(), topic.as_str().into());
        }
        if self.log.stamp != Stamps::default() {
            table.insert("stamp".to_owned(), self.log.stamp.name().into());
        }
        table
    }

    /// How the files are to be read.
    pub(crate) fn options(&self, gaps: Gaps) -> ReadOptions {
        let skip_s = if let Skip::Seconds(s) = self.skip_s { s } else { 0.0 };
        let log = self.log.options(self.topic.clone());
        ReadOptions { rate_hz: self.rate_hz, skip_s, gaps, log, ..ReadOptions::default() }
    }
}

impl RecordingArgs {
    fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.axes.iter().flat_map(|set| &set.0)
    }

    /// The sensor whose signals alone are asked for.
    pub(crate) fn sensor(&self) -> Option<Sensor> {
        let of_sensor = |sensor: &Sensor| {
            let mut channels = self.channels().peekable();
            channels.peek().is_some() && channels.all(|channel| channel.sensor == *sensor)
        };
        Sensor::ALL.into_iter().find(of_sensor)
    }

    /// What decides what is read of the files, for the provenance of a result.
    pub(crate) fn provenance(&self) -> toml::Table {
        let mut table = self.reading.provenance(self.gaps);
        if !self.axes.is_empty() {
            let channels = self.channels().map(ToString::to_string);
            table.insert("axes".to_owned(), channels.collect::<Vec<_>>().into());
        }
        table
    }

    /// How the files are to be read.
    pub(crate) fn options(&self) -> ReadOptions {
        let channels = (!self.axes.is_empty()).then(|| self.channels().copied().collect());
        ReadOptions { channels, ..self.reading.options(self.gaps) }
    }
}

/// Says what is found in recordings (in detail with `--verbose`) and what is doubtful.
pub(crate) struct Said<'a> {
    session: &'a Session,
    progress: Option<Progress>,
}

impl<'a> Said<'a> {
    pub(crate) const fn new(session: &'a Session) -> Self {
        Self { session, progress: None }
    }

    fn report(&mut self, report: &Report) {
        let printer = &self.session.printer;
        if report.files.len() > FEW {
            printer.say(&format!("{} (--verbose: each of them)", report.summary()));
        }
        for file in &report.files {
            if report.files.len() > FEW {
                printer.detail(&file.to_string());
            } else {
                printer.say(&file.to_string());
            }
            if !file.ignored.is_empty() {
                printer.detail(&format!("{}: passed over: {}", file.file, file.ignored.join(", ")));
            }
        }
        for warning in report.all_warnings() {
            printer.warn(&warning);
        }
    }
}

impl Remarks for Said<'_> {
    fn progress(&mut self, done: usize, all: usize) {
        let progress = self.progress.get_or_insert_with(|| self.session.progress("recordings", all as u64));
        if done > 0 {
            progress.add(1);
        }
    }

    fn remark(&mut self, remark: Remark<'_>) {
        self.progress = None;
        match remark {
            Remark::Read(report) => self.report(report),
            Remark::Rate { found_hz, taken_hz } => self.session.say(format!(
                "the recordings run at {} Hz: taken as {taken_hz} Hz, so that fixes meet samples",
                six_digits(found_hz)
            )),
            Remark::Shortest { recording, samples, scales, short: 0, usual, .. } => self.session.warn(format!(
                "{recording}: its {samples} samples limit all recordings to {scales} scales; without it there would be \
                 more (half of them have {usual}): leave it out for those"
            )),
            Remark::Shortest { recording, samples, scales, short, used, .. } => {
                let others = match short {
                    1 => String::new(),
                    _ => format!(" ({} more are short)", short - 1),
                };
                self.session.warn(format!(
                    "{recording}: its {samples} samples have {scales} scales{others}; the longer ones, up to {used} scales, are \
                     averaged over the longer recordings alone"
                ));
            }
        }
    }
}

/// Files of more than this number are told in one line, unless all is to be said.
const FEW: usize = 2;
