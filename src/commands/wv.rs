//! `nav-sim wv`: wavelet variances and Allan deviations of static recordings.

use crate::app::reading::{RecordingRequest, VarianceRequest};
use crate::app::{Answer, Command, Context, OutputFile, OutputKind, Result};
use crate::commands::calibrate::{is_abnormal, recordings_line, visit};
use crate::io::recordings::ReadOptions;
use crate::parse;
use crate::report::curves::{
    CONFIDENCE, SignalCurves, SignalsFile, band, curve, recording_names, sensor_name,
};
use crate::report::in_order;
use nav_sim_calibration::{
    CalibrationSettings, Diagnosis, Pool, Replicate, calibrate, diagnose, duration, grouped,
    median, replicates,
};
use nav_sim_document::{Cell, Chart, ChartAxis, Colour, Document, Panel, Series, Table, Tone};
use nav_sim_signal::imu::{Channel, Recording, Sensor};
use nav_sim_signal::wavelet::{WaveletError, haar, interval};
use rayon::prelude::*;
use std::path::PathBuf;

/// Compute wavelet variances (classical, robust) and Allan deviations of static recordings
#[derive(clap::Args, Debug, Clone)]
pub struct Wv {
    /// Recordings, or directories of recordings
    #[arg(id = "recording", required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Options for reading them.
    #[command(flatten)]
    pub recordings: RecordingRequest,
    /// Scales and robustness.
    #[command(flatten)]
    tuning: VarianceRequest,
    /// Degrees of freedom of the intervals: eta3, customary and conservative; large-sample, from the
    /// autocovariance of the coefficients, with the stated coverage
    #[arg(long, value_name = "NAME", hide_possible_values = true, value_parser = parse::one_of::<Intervals>(&Intervals::NAMES), default_value_t, help_heading = "Wavelet variance")]
    intervals: Intervals,
}

impl Command for Wv {
    type Answer = SignalsFile;
    const NAME: &'static str = "wv";
    const OUT: OutputKind = OutputKind::File {
        name: "curves.json",
        help: "Write the curves as JSON",
    };

    fn run(&self, context: &Context<'_>) -> Result<SignalsFile> {
        let (scales, tuning) = (self.tuning.levels(), self.tuning.tuning()?);
        // Four samples have a scale.
        let reading = ReadOptions {
            min_samples: scales.map_or(4, |j| 1 << j),
            ..self.recordings.options()
        };
        let look = |recording: Recording| -> Result<(Vec<SignalCurves>, Vec<_>)> {
            let measured = replicates(&recording, scales, &tuning)?;
            let curves = |(channel, replicate): &(Channel, Replicate)| {
                let edof = self.degrees_of_freedom(&recording, *channel, replicate)?;
                let (rate_hz, efficiency) = (recording.rate_hz, tuning.efficiency());
                Ok(SignalCurves::new(
                    *channel, replicate, rate_hz, edof, efficiency,
                ))
            };
            let curves: Result<_, WaveletError> = measured.par_iter().map(curves).collect();
            Ok((curves?, measured))
        };
        let (looks, report) = visit(&self.files, &reading, &look, context)?;
        let looks: Vec<_> = looks.into_iter().collect::<Result<_>>()?;
        let (signals, measured): (Vec<_>, Vec<_>) = looks.into_iter().unzip();
        let rate_hz = report.files[0].rate_hz;
        let settings = CalibrationSettings {
            tuning,
            rate_hz,
            ..CalibrationSettings::default()
        };
        Ok(SignalsFile {
            schema_version: 1,
            rate_hz,
            diagnoses: compared(measured.concat(), &settings),
            efficiency: tuning.efficiency(),
            edof_method: self.intervals.name().to_owned(),
            confidence: CONFIDENCE,
            signals: signals.concat(),
        })
    }
}

impl Wv {
    fn degrees_of_freedom(
        &self,
        recording: &Recording,
        channel: Channel,
        replicate: &Replicate,
    ) -> Result<Vec<f64>, WaveletError> {
        let levels = 1..=replicate.classical.len() as u32;
        match (self.intervals, recording.signal(channel)) {
            // Of a signal with holes eta3 of what is there.
            (Intervals::LargeSample, Some(signal)) if replicate.coverage.is_empty() => levels
                .map(|level| {
                    Ok(interval::edof_large_sample(
                        &haar::coefficients(&signal.samples, level)?,
                        level,
                    ))
                })
                .collect(),
            _ => Ok(levels.map(|level| replicate.edof_eta3(level)).collect()),
        }
    }
}

/// Source of the degrees of freedom of intervals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Intervals {
    /// The field's usual ones, conservative beyond the first scale.
    #[default]
    Eta3,
    /// From the autocovariance of the coefficients: cover at their level.
    LargeSample,
}

nav_sim_signal::named!(Intervals { Eta3 = "eta3", LargeSample = "large-sample" });

/// Degrees of freedom from which on robust over classical tells of outliers rather than of chance.
const LEAST: f64 = 100.0;
/// Classical over robust beyond which outliers are suspected.
const OUTLIERS: f64 = 1.5;

impl Answer for SignalsFile {
    fn files(&self) -> Vec<OutputFile<'_>> {
        vec![OutputFile::whole("", crate::report::json(self))]
    }

    fn document(&self) -> Document {
        let (mut tone, verdict) = match outliers(&self.signals) {
            Some(verdict) => (Tone::Doubtful, verdict),
            None => (
                Tone::Good,
                "classical and robust wavelet variances agree".to_owned(),
            ),
        };
        let compared = recordings_line(&[], &self.diagnoses);
        if self.diagnoses.iter().any(is_abnormal) {
            tone = Tone::Doubtful;
        }
        let count = recordings(self).len();
        let head = format!(
            "Allan deviation, median of recordings ({count}); ratio: least robust/classical"
        );
        let mut document = Document::new(
            "Wavelet variance of static recordings",
            tone,
            compared.into_iter().chain([verdict, head]),
        );
        document.table(digest(self));
        let charts: Vec<Chart> = channels(self).map(|channel| chart(self, channel)).collect();
        document.charts(&charts, "Robust wavelet variance; dashed: classical, raised by outliers. τ is twice the averaging time.");
        document
    }
}

/// The signal and scale at which the classical wavelet variance is highest above the robust one, if outliers are suspected.
pub(super) fn outliers(signals: &[SignalCurves]) -> Option<String> {
    let all = signals.iter().flat_map(|s| ratios(s).map(move |r| (s, r)));
    let (s, (tau_s, ratio)) = all.min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    (ratio < 1.0 / OUTLIERS).then(|| {
        let (name, ratio) = (recording_names([s.file.as_str()]).concat(), 1.0 / ratio);
        let (channel, at) = (s.channel(), duration(tau_s));
        format!(
            "outliers? {name} {channel}: classical wavelet variance {ratio:.2} times the robust one at {at}"
        )
    })
}

/// Each recording against the others, as `calibrate` compares them with its default model: none where that has no fit.
fn compared(signals: Vec<(Channel, Replicate)>, settings: &CalibrationSettings) -> Vec<Diagnosis> {
    let names = in_order(signals.iter().map(|(_, replicate)| replicate.name.as_str()));
    if names.len() < 2 {
        return Vec::new();
    }
    let groups = grouped(signals, Pool::Sensor);
    calibrate(&groups, settings).map_or(Vec::new(), |outcomes| {
        diagnose(&groups, &outcomes, settings)
    })
}

/// A chart of an axis, the recordings in colour.
fn chart(file: &SignalsFile, channel: Channel) -> Chart {
    let files = recordings(file);
    let names = recording_names(files.iter().copied());
    let mut series = Vec::new();
    for s in signals_of(file, channel) {
        let k = files.iter().position(|name| *name == s.file).unwrap_or(0);
        let colour = Colour::Hue(k);
        if files.len() == 1 {
            series.push(Series::new(
                "95 %",
                colour,
                band(&s.tau_s, &s.robust.ci_low, &s.robust.ci_high),
            ));
        }
        series.push(Series::dashed("", colour, curve(&s.tau_s, &s.classical.wv)));
        series.push(Series::line(
            &names[k],
            colour,
            curve(&s.tau_s, &s.robust.wv),
        ));
    }
    let variance = match channel.sensor {
        Sensor::Accel => "wavelet variance (m²/s⁴)",
        Sensor::Gyro => "wavelet variance (rad²/s²)",
    };
    Chart::new(
        &format!("{} {}", sensor_name(channel.sensor), channel.axis),
        ChartAxis::log("scale τ (s)"),
        vec![Panel::new(ChartAxis::log(variance), series)],
    )
    .small()
    .in_group("scales")
}

/// The recordings, each once.
fn recordings(file: &SignalsFile) -> Vec<&str> {
    in_order(file.signals.iter().map(|s| s.file.as_str()))
}

/// One table for all recordings: a row for each sensor and axis, its Allan deviation at every third averaging time (the
/// median over the recordings), the lowest of all averaging times, and how far the robust wavelet variance is below the
/// classical one.
fn digest(file: &SignalsFile) -> Table {
    let times = times(file);
    let shown = || (0..times.len()).step_by(3);
    let mut table = Table::new(["axis"]).and(
        shown()
            .map(|i| duration(times[i]))
            .chain(["lowest", "ratio"].map(str::to_owned)),
    );
    for channel in channels(file) {
        let signals = signals_of(file, channel);
        let medians: Vec<f64> = (0..times.len())
            .map(|i| {
                let all: Vec<f64> = signals
                    .iter()
                    .filter_map(|s| s.allan_deviation(i))
                    .collect();
                if all.is_empty() {
                    f64::NAN
                } else {
                    median(&all)
                }
            })
            .collect();
        let lowest = medians
            .iter()
            .zip(&times)
            .min_by(|a, b| a.0.total_cmp(b.0))
            .map(|(deviation, time)| format!("{deviation:.2e} at {}", duration(*time)));
        let ratios = signals.iter().flat_map(|s| ratios(s));
        let ratio = ratios.map(|(_, ratio)| ratio).min_by(f64::total_cmp);
        let ratio = ratio.map(|ratio| format!("{ratio:.2}"));
        let figures = shown()
            .map(|i| Some(format!("{:.2e}", medians[i])))
            .chain([lowest, ratio])
            .map(|text| Cell::figures(text.unwrap_or_default()));
        table.row(
            std::iter::once(Cell::from(format!("{channel} ({})", channel.sensor.unit())))
                .chain(figures),
        );
    }
    table
}

fn signals_of(file: &SignalsFile, channel: Channel) -> Vec<&SignalCurves> {
    file.signals
        .iter()
        .filter(|s| s.channel() == channel)
        .collect()
}

fn channels(file: &SignalsFile) -> impl Iterator<Item = Channel> {
    Channel::ALL
        .into_iter()
        .filter(|channel| !signals_of(file, *channel).is_empty())
}

/// The averaging times (s) of the signal with the most scales: a scale is two averages long.
fn times(file: &SignalsFile) -> Vec<f64> {
    file.signals
        .iter()
        .max_by_key(|s| s.tau_s.len())
        .map_or(Vec::new(), |s| {
            s.tau_s.iter().map(|tau_s| 0.5 * tau_s).collect()
        })
}

/// Scale (s) and robust over classical variance, at the scales that are well known.
fn ratios(s: &SignalCurves) -> impl Iterator<Item = (f64, f64)> {
    (0..s.tau_s.len())
        .filter(|i| s.edof[*i] >= LEAST && s.robust.status[*i] == "ok")
        .map(|i| (s.tau_s[i], s.robust.wv[i] / s.classical.wv[i]))
}
