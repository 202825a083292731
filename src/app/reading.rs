//! Arguments for reading recordings and taking wavelet variances, shared by several commands.

use crate::app::{Context, Failure};
use crate::io::logs::LogOptions;
use crate::io::model_file::known;
use crate::io::recordings::{Gaps, ReadOptions, Report};
use crate::io::suggest;
use crate::parse;
use nav_sim_calibration::{FitRange, ModelSpec, SpecError};
use nav_sim_document::Importance;
use nav_sim_logs::Stamp;
use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::wavelet::Tuning;
use serde_json::json;
use std::str::FromStr;

/// Options for reading recordings.
#[derive(clap::Args, Debug, Clone)]
#[command(next_help_heading = "Recordings")]
pub struct ReadingRequest {
    /// Sample rate (Hz) of files without a time column
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz)]
    pub rate_hz: Option<f64>,
    /// Seconds to skip at the start of each file (warm-up)
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = parse::non_negative)]
    pub skip_s: f64,
    /// Names of the columns, for files without a header or instead of it
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        hide_short_help = true
    )]
    pub columns: Vec<String>,
    /// Topic of the IMU in a log that has several
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    pub topic: Option<String>,
    #[command(flatten)]
    /// The part of a log that is read.
    pub log: LogRequest,
}

/// The part of a log that is read.
#[derive(clap::Args, Debug, Clone)]
pub struct LogRequest {
    /// Stamps of a log: header, of the measurement; log, of its arrival
    #[arg(long, value_name = "WHICH", hide_possible_values = true, hide_short_help = true, value_parser = parse::one_of::<Stamp>(&["header", "log"]), default_value = "header")]
    pub stamp: Stamp,
}

/// Options for reading recordings and choosing their signals.
#[derive(clap::Args, Debug, Clone)]
#[command(next_help_heading = "Recordings")]
pub struct RecordingRequest {
    #[command(flatten)]
    /// Options for reading them.
    pub reading: ReadingRequest,
    /// Gaps and repeated times: keep (as missing samples, less than a tenth), refuse, split (into recordings) or
    /// ignore (evenly spaced samples)
    #[arg(long, value_name = "HOW", hide_possible_values = true, value_parser = parse::one_of::<Gaps>(&Gaps::NAMES), default_value_t = Gaps::Keep)]
    pub gaps: Gaps,
    /// Signals to use: all, accel, gyro, x, accel.x, … (comma-separated; default: all)
    #[arg(long, value_name = "AXES", value_delimiter = ',', value_parser = channel_set)]
    pub axes: Vec<ChannelSet>,
}

/// Gap handling for windows that are navigated: no sample may be missing.
pub(crate) const WHOLE: &[&str] = &["refuse", "split", "ignore"];

/// The axes that one word of `--axes` stands for: all, those of a sensor (`accel`), an axis of both (`x`), one (`accel.x`).
pub type ChannelSet = Vec<Channel>;

pub(crate) fn channel_set(word: &str) -> Result<ChannelSet, &'static str> {
    let channels = Channel::named(word);
    match channels.is_empty() {
        true => Err("expected all, accel, gyro, x, y, z, or a channel such as accel.x"),
        false => Ok(channels),
    }
}

impl ReadingRequest {
    /// Options that decide which samples are read, for the provenance of a result.
    pub(crate) fn provenance(&self, gaps: Gaps) -> toml::Table {
        known(json!({
            "skip_s": self.skip_s,
            "gaps": gaps.name(),
            "rate_hz_given": self.rate_hz,
            "columns": (!self.columns.is_empty()).then_some(&self.columns),
            "topic": self.topic,
            "stamp": (self.log.stamp == Stamp::Log).then_some("log"),
        }))
    }

    /// Options for the reader of the files.
    pub(crate) fn options(&self, gaps: Gaps) -> ReadOptions {
        ReadOptions {
            columns: (!self.columns.is_empty()).then(|| self.columns.clone()),
            rate_hz: self.rate_hz,
            skip_s: self.skip_s,
            gaps,
            log: LogOptions {
                topic: self.topic.clone(),
                stamp: self.log.stamp,
            },
            ..ReadOptions::default()
        }
    }
}

impl RecordingRequest {
    fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.axes.iter().flatten()
    }

    /// The sensor whose signals alone are requested.
    pub(crate) fn sensor(&self) -> Option<Sensor> {
        let of_sensor = |sensor: &Sensor| {
            let mut channels = self.channels().peekable();
            channels.peek().is_some() && channels.all(|channel| channel.sensor == *sensor)
        };
        Sensor::ALL.into_iter().find(of_sensor)
    }

    /// Options that decide which samples are read, for the provenance of a result.
    pub(crate) fn provenance(&self) -> toml::Table {
        let mut table = self.reading.provenance(self.gaps);
        if !self.axes.is_empty() {
            let channels = self.channels().map(ToString::to_string);
            table.insert("axes".to_owned(), channels.collect::<Vec<_>>().into());
        }
        table
    }

    /// Options for the reader of the files.
    pub(crate) fn options(&self) -> ReadOptions {
        let channels = (!self.axes.is_empty()).then(|| self.channels().copied().collect());
        ReadOptions {
            channels,
            ..self.reading.options(self.gaps)
        }
    }
}

/// Options for wavelet variances.
#[derive(clap::Args, Debug, Clone)]
#[command(next_help_heading = "Wavelet variance")]
pub struct VarianceRequest {
    /// Efficiency of the robust wavelet variance at the Gaussian model, 0.3 to 0.99
    #[arg(long, value_name = "E", default_value_t = Tuning::DEFAULT_EFFICIENCY)]
    pub efficiency: f64,
    /// Number of scales, 2, 4, 8, … samples (default: of each signal one less than its length allows); or those that are
    /// fitted, such as 1s:1000s
    #[arg(long, value_name = "J|FROM:TO")]
    pub scales: Option<Scales>,
}

/// Scales that are requested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scales {
    /// The first ones.
    Count(u32),
    /// All, of which these are fitted.
    Fitted(FitRange),
}

impl FromStr for Scales {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if !text.contains(':') {
            let count = text.parse().ok().filter(|count| (1..=62).contains(count));
            return count
                .map(Self::Count)
                .ok_or_else(|| "expected 1 to 62, or a range such as 1s:1000s".into());
        }
        let (from_s, to_s) = parse::seconds_range(text)?;
        if from_s >= to_s {
            return Err("the shorter scale comes first".into());
        }
        Ok(Self::Fitted(FitRange { from_s, to_s }))
    }
}

impl VarianceRequest {
    pub(crate) fn tuning(&self) -> Result<Tuning, Failure> {
        Tuning::new(self.efficiency).map_err(|e| Failure::input(format!("--efficiency: {e}")))
    }

    /// Number of scales, if it is given.
    pub(crate) fn levels(&self) -> Option<u32> {
        match self.scales {
            Some(Scales::Count(count)) => Some(count),
            _ => None,
        }
    }

    /// The scales that are fitted, if they are given.
    pub(crate) fn fitted(&self) -> Option<FitRange> {
        match self.scales {
            Some(Scales::Fitted(range)) => Some(range),
            _ => None,
        }
    }
}

/// Not a `--model`.
pub(crate) fn unknown_model(e: SpecError) -> Failure {
    let legal: Vec<&str> = ModelSpec::legal().chain(["auto"]).collect();
    let hint = match &e.term {
        None => "expected a sum such as 2*AR1+RW+WN+QN".to_owned(),
        Some(term) => match suggest::nearest(term, legal.iter().copied()) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => format!("processes and models: {}", legal.join(", ")),
        },
    };
    Failure::input(format!("--model: {e}")).hint(hint)
}

/// Files of more than this number are told in one line, unless all is to be said.
const FEW: usize = 2;

/// Notes what was found in the recordings, and what is doubtful about them.
pub(crate) fn note_report(report: &Report, context: &Context<'_>) {
    let count = report.files.len();
    let each = match count > FEW {
        true => Importance::Detail,
        false => Importance::Remark,
    };
    if count > FEW {
        context.remark(format!("{count} recordings (--verbose lists them)"));
    }
    for file in &report.files {
        context.note(each, file);
        if !file.ignored.is_empty() {
            let ignored = file.ignored.join(", ");
            context.detail(format!("{}: skipped: {ignored}", file.file));
        }
    }
    let doubts = report.all_warnings();
    context.warn_each(&doubts);
}
