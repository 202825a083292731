//! `nav-sim inspect`: the channels of a log with their rates, gaps and spans.

use crate::app::reading::LogRequest;
use crate::app::{Answer, Command, Context, Result};
use crate::io::file_kind::{self, FileKind};
use crate::io::logs;
use nav_sim_document::{Document, Importance, Table, Tone, six_digits};
use nav_sim_logs::{Content, Log, LogChannel, LogError, Stamp};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A step of this many times the median one is a gap.
const GAP: f64 = 1.5;

/// List the channels of a log: MCAP, ROS 1 bag, PX4 ULog, u-blox UBX
///
/// Samples of an IMU and fixes of a receiver are read through: rate by the median step, gaps (steps beyond 1.5 times it),
/// jitter (95 % of the steps are as near to the median one).
#[derive(clap::Args, Debug, Clone)]
pub struct Inspect {
    /// Log
    #[arg(id = "log", value_name = "FILE")]
    file: PathBuf,
    /// Options for reading it.
    #[command(flatten)]
    log: LogRequest,
}

impl Command for Inspect {
    type Answer = Inspection;
    const NAME: &'static str = "inspect";
    const PLOT: bool = false;

    fn run(&self, _: &Context<'_>) -> Result<Inspection> {
        inspect(&self.file, self.log.stamp)
    }
}

/// Contents of a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inspection {
    /// The file.
    pub file: String,
    /// Its format, in words.
    pub format: &'static str,
    /// Its channels, in order of their topics.
    pub channels: Vec<InspectedChannel>,
    /// Cut at which the reading ended.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damage: Option<String>,
}

/// A channel of a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InspectedChannel {
    /// Topic, or name of the messages.
    pub topic: String,
    /// Type of the messages.
    #[serde(rename = "type")]
    pub type_name: String,
    /// `imu`, `fix` or `other`.
    pub content: &'static str,
    /// Number of messages.
    pub messages: u64,
    /// Time from the first to the last message (s).
    pub span_s: f64,
    /// Messages a second: by the median step of samples and fixes, by the span of others.
    pub rate_hz: Option<f64>,
    /// Steps of more than 1.5 times the median one; of samples and fixes.
    pub gaps: Option<u64>,
    /// The longest step (s).
    pub longest_step_s: Option<f64>,
    /// Largest departure of 95 % of the steps from the median one (s).
    pub jitter_s: Option<f64>,
    /// Units that the channel is read in.
    pub units: Option<&'static str>,
}

/// Reads the channels of a log, and every stamp of its samples and fixes.
///
/// ```
/// use nav_sim::commands::inspect::inspect;
///
/// let log = inspect("src/logs/tests/data/ros2_zstd.mcap".as_ref(), Default::default())?;
/// let imu = log.channels.iter().find(|channel| channel.content == "imu").expect("one is there");
/// assert_eq!((imu.topic.as_str(), imu.messages, imu.units), ("/imu", 40, Some("m/s², rad/s")));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the file is not a log that is read, or is damaged before its end.
pub fn inspect(path: &Path, stamp: Stamp) -> Result<Inspection> {
    let log = logs::open(path).map_err(|e| file_kind::or_wrong_kind(&[FileKind::Log], path, e))?;
    let channels = log
        .channels()
        .iter()
        .map(|channel| inspected(&log, channel, stamp));
    Ok(Inspection {
        file: path.display().to_string(),
        format: log.kind().name(),
        channels: channels
            .collect::<Result<_, _>>()
            .map_err(|e| logs::refused(path, e))?,
        damage: log.damage().map(logs::cut_off),
    })
}

fn inspected(log: &Log, channel: &LogChannel, stamp: Stamp) -> Result<InspectedChannel, LogError> {
    let (content, units, stamps) = match channel.content {
        _ if channel.messages == 0 => ("other", None, Vec::new()),
        Content::Imu => (
            "imu",
            Some("m/s², rad/s"),
            log.imu(channel, stamp)?
                .iter()
                .map(|sample| sample.stamp_ns)
                .collect(),
        ),
        Content::Fix => (
            "fix",
            Some("deg, m"),
            log.fixes(channel, stamp)?
                .iter()
                .map(|fix| fix.stamp_ns)
                .collect(),
        ),
        Content::Other => ("other", None, Vec::new()),
    };
    let span_ns = channel
        .first_ns
        .zip(channel.last_ns)
        .map_or(0, |(first, last)| last.saturating_sub(first));
    let span_s = span_ns as f64 * 1e-9;
    let by_span = (span_s > 0.0).then(|| channel.messages.saturating_sub(1) as f64 / span_s);
    let steps = steps(&stamps);
    Ok(InspectedChannel {
        topic: channel.topic.clone(),
        type_name: channel.type_name.clone(),
        content,
        messages: channel.messages,
        span_s,
        rate_hz: steps.map(|steps| six_digits(1.0 / steps.0)).or(by_span),
        gaps: steps.map(|steps| steps.1),
        longest_step_s: steps.map(|steps| steps.2),
        jitter_s: steps.map(|steps| steps.3),
        units,
    })
}

/// Median of the steps from one stamp to the next (s), gaps, longest step (s) and jitter (s).
fn steps(stamps_ns: &[i64]) -> Option<(f64, u64, f64, f64)> {
    let steps = stamps_ns
        .windows(2)
        .map(|pair| pair[1].saturating_sub(pair[0]) as f64 * 1e-9);
    let mut steps: Vec<f64> = steps.collect();
    steps.sort_by(f64::total_cmp);
    let median_s = *steps.get(steps.len() / 2).filter(|step| **step > 0.0)?;
    let mut off: Vec<f64> = steps.iter().map(|step| (step - median_s).abs()).collect();
    off.sort_by(f64::total_cmp);
    Some((
        median_s,
        steps.iter().filter(|step| **step > GAP * median_s).count() as u64,
        *steps.last()?,
        off[(off.len() * 95).div_ceil(100) - 1],
    ))
}

impl Answer for Inspection {
    fn document(&self) -> Document {
        let named = |content: &str| {
            let topics: Vec<&str> = self
                .channels
                .iter()
                .filter(|c| c.content == content)
                .map(|c| c.topic.as_str())
                .collect();
            if topics.is_empty() {
                "none".to_owned()
            } else {
                topics.join(", ")
            }
        };
        let (imu, fix) = (named("imu"), named("fix"));
        let line = format!("{}: {}; IMU {imu}; GNSS {fix}", self.file, self.format);
        let tone = match self.damage {
            Some(_) => Tone::Doubtful,
            None => Tone::Good,
        };
        let mut document = Document::new("Contents of a log", tone, [line]);
        let columns = [
            ("channel", "topic"),
            ("type", "type"),
            ("content", "content"),
            ("messages", "messages"),
            ("span (s)", "span_s"),
            ("rate (Hz)", "rate_hz"),
            ("gaps", "gaps"),
            ("jitter (s)", "jitter_s"),
            ("units", "units"),
        ];
        document.table(Table::of(self, "/channels/*", &columns));
        if let Some(damage) = &self.damage {
            document.note(Importance::Warning, damage.as_str());
        }
        document
    }
}
