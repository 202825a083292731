//! `nav-sim wv`: wavelet variances and Allan deviations of static recordings.

use crate::app::inputs::listed;
use crate::app::reading::{RecordingRequest, VarianceRequest};
use crate::app::{Answer, Command, Context, Out, OutputFile, Result};
use crate::commands::calibrate::stem;
use crate::commands::calibrate::{visit, without_warm_up};
use crate::io::atomic::Written;
use crate::io::recordings::ReadOptions;
use crate::parse;
use crate::report::comparison_table::in_order;
use crate::report::curves::{Band, SignalCurves, SignalsFile};
use crate::report::curves::{band, curve, scale_axis, sensor_name, unit, variance_axis};
use crate::report::json;
use nav_sim_calibration::{Replicate, replicates};
use nav_sim_calibration::{duration, median};
use nav_sim_document::{
    Cell, Chart, Colour, Document, Panel, Series, Table, Tone, short_names, shortest,
};
use nav_sim_signal::imu::{Channel, Recording};
use nav_sim_signal::wavelet::{Tuning, WaveletError, haar, interval};
use rayon::prelude::*;
use std::path::PathBuf;

/// Compute wavelet variances (classical, robust) and Allan deviations of static recordings
#[derive(clap::Args, Debug, Clone)]
#[command(before_help = "\
Examples:
  nav-sim wv calib_data/formats/own.csv
  nav-sim wv calib_data/formats/euroc.csv --axes gyro --intervals large-sample
  nav-sim wv calib_data/formats/compressed.csv.gz --format json -o static.wv.json")]
pub struct Wv {
    /// Recordings, or directories of recordings
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// How they are read.
    #[command(flatten)]
    pub recordings: RecordingRequest,
    /// Scales and robustness.
    #[command(flatten)]
    pub tuning: VarianceRequest,
    /// Where the degrees of freedom of the intervals come from
    #[arg(long, value_parser = parse::words::<Intervals>(&INTERVALS), default_value_t, help_heading = "Wavelet variance")]
    pub intervals: Intervals,
}

const INTERVALS: [(&str, &str); 2] = [
    (
        Intervals::Eta3.name(),
        "The field's usual ones, conservative beyond the first scale",
    ),
    (
        Intervals::LargeSample.name(),
        "From the autocovariance of the coefficients: with the stated coverage",
    ),
];

impl Command for Wv {
    type Answer = SignalsFile;
    const NAME: &'static str = "wv";
    const OUT: Out = Out::File {
        kind: Written::Signals,
        name: "curves.json",
        help: "Write the curves as JSON",
    };

    fn inputs(&self) -> Result<Vec<(&'static str, PathBuf)>> {
        listed("recording", &self.files)
    }

    fn run(&self, context: &Context<'_>) -> Result<SignalsFile> {
        let options = WaveletOptions {
            reading: self.recordings.options(),
            skip_warm_up: self.recordings.reading.skips_warm_up(),
            scales: self.tuning.levels(),
            tuning: self.tuning.tuning()?,
            intervals: self.intervals,
        };
        wavelet_variances(&self.files, &options, context)
    }
}

/// Where the degrees of freedom of intervals are from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Intervals {
    /// The field's usual ones, conservative beyond the first scale.
    #[default]
    Eta3,
    /// From the autocovariance of the coefficients: cover at their level.
    LargeSample,
}

nav_sim_signal::named!(Intervals { Eta3 = "eta3", LargeSample = "large-sample" });

/// How wavelet variances are taken.
#[derive(Debug, Clone, Default)]
struct WaveletOptions {
    /// How the recordings are read.
    pub reading: ReadOptions,
    /// Whether each recording's warm-up, as it is found, is left out.
    pub skip_warm_up: bool,
    /// Number of scales; none: one less than each signal allows.
    pub scales: Option<u32>,
    /// Tuning of the robust ones.
    pub tuning: Tuning,
    /// Where the intervals' degrees of freedom are from.
    pub intervals: Intervals,
}

/// The wavelet variances of all signals of recordings, or directories of them.
///
/// # Errors
/// When a recording cannot be read, or is too short for the scales.
fn wavelet_variances(
    paths: &[PathBuf],
    options: &WaveletOptions,
    context: &Context<'_>,
) -> Result<SignalsFile> {
    let WaveletOptions {
        reading,
        skip_warm_up,
        scales,
        tuning,
        intervals,
    } = options;
    // Four samples have a scale.
    let reading = ReadOptions {
        min_samples: scales.map_or(4, |j| 1 << j),
        ..reading.clone()
    };
    let look = |recording: Recording| -> Result<Vec<SignalCurves>> {
        let recording = if *skip_warm_up {
            without_warm_up(recording, true).0
        } else {
            recording
        };
        let measured = replicates(&recording, *scales, tuning)?;
        let curves = |(channel, replicate): &(Channel, Replicate)| {
            let edof = degrees_of_freedom(*intervals, &recording, *channel, replicate)?;
            Ok(SignalCurves::new(
                *channel,
                replicate,
                recording.rate_hz,
                edof,
                tuning.efficiency(),
            ))
        };
        Ok(measured
            .par_iter()
            .map(curves)
            .collect::<std::result::Result<_, WaveletError>>()?)
    };
    let (looks, report) = visit(paths, &reading, &look, context)?;
    let signals = looks
        .into_iter()
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect();
    Ok(SignalsFile::new(
        report.files[0].rate_hz,
        tuning.efficiency(),
        intervals.name(),
        signals,
    ))
}

fn degrees_of_freedom(
    intervals: Intervals,
    recording: &Recording,
    channel: Channel,
    replicate: &Replicate,
) -> std::result::Result<Vec<f64>, WaveletError> {
    let levels = 1..=replicate.classical.len() as u32;
    match (intervals, recording.signal(channel)) {
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

/// Degrees of freedom from which on robust over classical tells of outliers rather than of chance.
const LEAST: f64 = 100.0;
/// Classical over robust beyond which outliers are suspected.
const OUTLIERS: f64 = 1.5;

impl Answer for SignalsFile {
    fn csv(&self) -> Option<String> {
        Some(signals_csv(self))
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        vec![OutputFile::whole("", json(self))]
    }

    fn document(&self) -> Document {
        let worst = self.signals.iter().filter_map(|s| Some((excess(s)?, s)));
        let worst = worst.max_by(|a, b| a.0.1.total_cmp(&b.0.1));
        let count = recordings(self).len();
        let (tone, verdict) = match worst {
            Some(((tau_s, ratio), s)) if ratio > OUTLIERS => {
                let (at, name) = (duration(tau_s), short_names(&[&s.file]).remove(0));
                let of = format!("{} {}.{}", stem(&name), s.sensor, s.axis);
                (
                    Tone::Doubtful,
                    format!(
                        "outliers? {of}: classical wavelet variance {ratio:.2} times the robust one at {at}"
                    ),
                )
            }
            _ => (
                Tone::Good,
                "classical and robust wavelet variances agree".to_owned(),
            ),
        };
        let median = if count > 1 {
            format!(", median of {count} recordings")
        } else {
            String::new()
        };
        let head = format!(
            "Allan deviation over averages{median}; ratio: robust/classical, * less than by chance"
        );
        let mut document = Document::new(
            "Wavelet variance of static recordings",
            tone,
            [verdict, head],
        );
        document.lead(digest(self));
        let charts: Vec<Chart> = channels(self)
            .into_iter()
            .map(|channel| chart(self, channel))
            .collect();
        document.charts(&charts, "Robust wavelet variance; dashed: classical, which outliers raise. τ is twice the averaging time.");
        for (title, table) in side_by_side(self) {
            document.folded(&title, |inside| inside.table(&table));
        }
        document.checked(
            "wavelet variances to 1e-12, ends of intervals to 1e-9 of an independent implementation",
        );
        document
    }
}

/// A chart of an axis, the recordings in colour.
fn chart(file: &SignalsFile, (sensor, axis): (&str, &str)) -> Chart {
    let files = recordings(file);
    let names = short_names(&files);
    let names: Vec<&str> = names.iter().map(|name| stem(name)).collect();
    let mut series = Vec::new();
    for s in signals_of(file, sensor, axis) {
        let k = files.iter().position(|name| *name == s.file).unwrap_or(0);
        let (name, colour) = (names[k], Colour::Hue(k));
        if files.len() == 1 {
            series.push(Series::new(
                "95 %",
                colour,
                band(&s.tau_s, &s.robust.ci_low, &s.robust.ci_high),
            ));
        }
        series.push(Series::dashed("", colour, curve(&s.tau_s, &s.classical.wv)));
        series.push(Series::line(name, colour, curve(&s.tau_s, &s.robust.wv)));
    }
    let title = format!("{} {axis}", sensor_name(sensor));
    Chart::new(
        &title,
        scale_axis(),
        vec![Panel::new(variance_axis(sensor), series)],
    )
    .small()
    .in_group("scales")
}

/// The recordings, each once.
fn recordings(file: &SignalsFile) -> Vec<&str> {
    in_order(file.signals.iter().map(|s| s.file.as_str()))
}

/// The scale at which classical over robust is largest of those that are well known, and that ratio.
fn excess(s: &SignalCurves) -> Option<(f64, f64)> {
    let ratio = |i: usize| (s.tau_s[i], s.classical.wv[i] / s.robust.wv[i]);
    let told = (0..s.tau_s.len())
        .filter(|i| s.edof[*i] >= LEAST)
        .map(ratio)
        .filter(|r| r.1.is_finite());
    told.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// One table for all recordings: a row for each sensor and axis, its Allan deviation at one averaging time a decade (the
/// median over the recordings), the lowest of all averaging times, and how far the robust wavelet variance is below the
/// classical one.
fn digest(file: &SignalsFile) -> Table {
    let decades = decades(file);
    let times = decades
        .iter()
        .map(|i| duration(allan_time_s(&longest(file).tau_s, *i)));
    let head = times.chain(["lowest", "ratio"].map(str::to_owned));
    let mut table = Table::new(["axis"]).and(head);
    let row = |(sensor, axis): (&str, &str)| {
        let signals = signals_of(file, sensor, axis);
        let median_at = |i: usize| {
            let of_files = signals
                .iter()
                .filter_map(|s| Some(allan_deviation(*s.classical.wv.get(i)?)));
            let all: Vec<f64> = of_files.collect();
            (!all.is_empty()).then(|| median(&all))
        };
        let cells = decades
            .iter()
            .map(|i| median_at(*i).map_or(String::new(), |x| format!("{x:.2e}")));
        let name = format!("{sensor}.{axis} ({})", unit(sensor));
        let scales = signals.iter().map(|s| s.tau_s.len()).max().unwrap_or(0);
        let lowest = (0..scales)
            .filter_map(|i| Some((i, median_at(i)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let lowest = lowest.map_or(String::new(), |(i, deviation)| {
            format!(
                "{deviation:.2e} at {}",
                duration(allan_time_s(&longest(file).tau_s, i))
            )
        });
        let ratios: Vec<Ratio> = signals
            .iter()
            .flat_map(|s| ratios(s, file.efficiency))
            .collect();
        let ratio = least_ratio(&ratios).map_or(String::new(), |(r, mark)| format!("{r:.2}{mark}"));
        let figures = cells.chain([lowest, ratio]).map(Cell::figures);
        std::iter::once(Cell::from(name))
            .chain(figures)
            .collect::<Vec<Cell>>()
    };
    channels(file)
        .into_iter()
        .for_each(|channel| table.row(row(channel)));
    table
}

/// For each sensor and axis a title and a table: a row a scale, a column a recording.
fn side_by_side(file: &SignalsFile) -> Vec<(String, Table)> {
    let table = |(sensor, axis): (&str, &str)| {
        let signals = signals_of(file, sensor, axis);
        let names = short_names(&signals.iter().map(|s| s.file.as_str()).collect::<Vec<_>>());
        let mut table = Table::new(["averages of"]).and(names);
        for i in 0..signals.iter().map(|s| s.tau_s.len()).max().unwrap_or(0) {
            let cell = |s: &&SignalCurves| {
                let deviation = s
                    .classical
                    .wv
                    .get(i)
                    .map(|wv| format!("{:.3e}", allan_deviation(*wv)));
                Cell::figures(deviation.unwrap_or_default())
            };
            let time = duration(allan_time_s(&longest(file).tau_s, i));
            table.row(std::iter::once(Cell::from(time)).chain(signals.iter().map(cell)));
        }
        (
            format!("{sensor}.{axis}: Allan deviation ({})", unit(sensor)),
            table,
        )
    };
    channels(file).into_iter().map(table).collect()
}

/// All scales of all signals as CSV.
fn signals_csv(file: &SignalsFile) -> String {
    let mut text = "file,sensor,axis,tau_s,edof,classical_wv,classical_ci_low,classical_ci_high,robust_wv,robust_ci_low,\
                    robust_ci_high,robust_status,allan_tau_s,allan_deviation\n"
        .to_owned();
    for s in &file.signals {
        let name = if s.file.contains([',', '"', '\n']) {
            format!("\"{}\"", s.file.replace('"', "\"\""))
        } else {
            s.file.clone()
        };
        for i in 0..s.tau_s.len() {
            let band = |b: &Band| [b.wv[i], b.ci_low[i], b.ci_high[i]].map(shortest).join(",");
            let allan = [
                allan_time_s(&s.tau_s, i),
                allan_deviation(s.classical.wv[i]),
            ]
            .map(shortest)
            .join(",");
            text += &format!(
                "{name},{},{},{},{},{},{},{},{allan}\n",
                s.sensor,
                s.axis,
                shortest(s.tau_s[i]),
                shortest(s.edof[i]),
                band(&s.classical),
                band(&s.robust),
                s.robust.status[i]
            );
        }
    }
    text
}

/// A scale is two averages long.
fn allan_time_s(tau_s: &[f64], index: usize) -> f64 {
    0.5 * tau_s[index]
}

/// The wavelet variance is half the Allan variance.
fn allan_deviation(wv: f64) -> f64 {
    (2.0 * wv).sqrt()
}

fn signals_of<'a>(file: &'a SignalsFile, sensor: &str, axis: &str) -> Vec<&'a SignalCurves> {
    file.signals
        .iter()
        .filter(|s| s.sensor == sensor && s.axis == axis)
        .collect()
}

/// Sensors and axes, as they first appear.
fn channels(file: &SignalsFile) -> Vec<(&str, &str)> {
    let mut channels: Vec<(&str, &str)> = Vec::new();
    for s in &file.signals {
        if !channels.contains(&(&s.sensor, &s.axis)) {
            channels.push((&s.sensor, &s.axis));
        }
    }
    channels
}

/// The signal with the most scales.
fn longest(file: &SignalsFile) -> &SignalCurves {
    let most = file.signals.iter().max_by_key(|s| s.tau_s.len());
    most.expect("a file of signals has one")
}

/// The scales whose averaging times are nearest to powers of ten (s), each once.
fn decades(file: &SignalsFile) -> Vec<usize> {
    let tau_s = &longest(file).tau_s;
    let log = |i: usize| allan_time_s(tau_s, i).log10();
    let (first, last) = (log(0).floor() as i32, log(tau_s.len() - 1).ceil() as i32);
    let nearest = |decade: i32| {
        let distance = |i: &usize| (log(*i) - f64::from(decade)).abs();
        (0..tau_s.len())
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap_or(0)
    };
    let mut found: Vec<usize> = (first..=last).map(nearest).collect();
    found.dedup();
    found
}

/// Robust over classical at one scale, and the standard deviation of its logarithm that chance has.
struct Ratio {
    ratio: f64,
    deviation: f64,
}

/// At the scales that are well known. Of Gaussian coefficients the classical variance is efficient, so that the variance of
/// the robust one is 1/e times its, their covariance is its, and that of their ratio 1/e − 1 times its, 2/edof.
fn ratios(s: &SignalCurves, efficiency: f64) -> impl Iterator<Item = Ratio> {
    let known = (0..s.tau_s.len()).filter(|i| s.edof[*i] >= LEAST && s.robust.status[*i] == "ok");
    known.map(move |i| Ratio {
        ratio: s.robust.wv[i] / s.classical.wv[i],
        deviation: ((1.0 / efficiency - 1.0) * 2.0 / s.edof[i]).sqrt(),
    })
}

/// How often a row without outliers is marked, at most.
const FALSE_ALARMS: f64 = 0.025;

/// The least of the ratios, which is below 1 by chance too, and a mark where one of them is lower than chance makes the
/// least of so many: a normal variable is below −z with a probability of at most e^(−z²/2).
fn least_ratio(ratios: &[Ratio]) -> Option<(f64, &'static str)> {
    let z = (2.0 * (ratios.len() as f64 / FALSE_ALARMS).ln()).sqrt();
    let is_marked = ratios.iter().any(|r| r.ratio.ln() < -z * r.deviation);
    let least = ratios.iter().map(|r| r.ratio).min_by(f64::total_cmp)?;
    Some((least, if is_marked { " *" } else { "" }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_signal::rng::Generator;
    use nav_sim_signal::wavelet::{Convention, Tuning, interval};
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn file(count: usize) -> SignalsFile {
        // 100 Hz, 14 scales: white noise of density 1, wv = 1/(2·tau/2)/… so that the Allan deviation at t is 1/√t.
        let tau_s: Vec<f64> = (1..=14).map(|j| f64::from(j).exp2() / 100.0).collect();
        let wv: Vec<f64> = tau_s.iter().map(|tau| 1.0 / tau).collect();
        let edof: Vec<f64> = (1..=14).map(|j| 1e5 / f64::from(j).exp2()).collect();
        let band = |factor: f64, status: &str| Band {
            wv: wv.iter().map(|x| x * factor).collect(),
            ci_low: wv.clone(),
            ci_high: wv.clone(),
            status: vec![status.to_owned(); 14],
        };
        let signal = |k: usize| SignalCurves {
            file: format!("rec/run{k}.csv"),
            sensor: "gyro".to_owned(),
            axis: "z".to_owned(),
            samples: 1 << 15,
            tau_s: tau_s.clone(),
            edof: edof.clone(),
            classical: band(1.0, ""),
            robust: band(0.9, "ok"),
        };
        SignalsFile::new(100.0, 0.6, "eta3", (0..count).map(signal).collect())
    }

    /// 1/√t at the octaves nearest to the decades: 0.01, 0.08, 1.28 and 10.24 s (81.92 s is the last).
    #[test]
    fn a_digest_has_a_row_a_channel() {
        let text = digest(&file(3)).csv();
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(rows.len(), 2);
        assert_eq!(
            rows[0][1..6],
            ["0.01 s", "0.08 s", "1.28 s", "10.2 s", "81.9 s"]
        );
        assert_eq!(rows[1][..2], ["gyro.z (rad/s)", "1.00e1"]);
        assert_eq!(rows[1][5..], ["1.10e-1", "1.10e-1 at 81.9 s", "0.90 *"]);
    }

    /// 200 recordings of white noise, 4096 samples each: at most 2.5 % have a mark, four deviations of a binomial share more,
    /// 4 √(0.025·0.975/200) = 0.044, while the least ratio is below 1 in nearly all. With 2 % of the samples ten times as
    /// large all have one.
    #[test]
    fn outliers_are_marked_and_chance_is_not() {
        let tuning = Tuning::new(0.6, Convention::Exact).unwrap();
        let row = |seed: u64, outliers: usize| {
            let mut generator = Generator::seed_from_u64(seed);
            let mut signal: Vec<f64> = (0..4096)
                .map(|_| generator.sample(StandardNormal))
                .collect();
            signal
                .iter_mut()
                .step_by(50)
                .take(outliers)
                .for_each(|x| *x *= 10.0);
            let (classical, robust) = nav_sim_signal::wavelet::both(&signal, 8, &tuning).unwrap();
            let ratios: Vec<Ratio> = (1..=8_u32)
                .map(|level| (level, interval::edof_eta3(4096, level)))
                .filter(|(_, edof)| *edof >= LEAST)
                .map(|(level, edof)| Ratio {
                    ratio: robust[level as usize - 1].value / classical[level as usize - 1],
                    deviation: ((1.0 / 0.6 - 1.0) * 2.0 / edof).sqrt(),
                })
                .collect();
            least_ratio(&ratios).unwrap()
        };
        let clean: Vec<(f64, &str)> = (0..200).map(|seed| row(seed, 0)).collect();
        let marked = clean.iter().filter(|(_, mark)| !mark.is_empty()).count();
        assert!(marked as f64 / 200.0 <= 0.025 + 0.044, "{marked} of 200");
        assert!(clean.iter().filter(|(ratio, _)| *ratio < 1.0).count() > 180);
        assert!((0..20).all(|seed| row(seed, 82).1 == " *"));
    }

    #[test]
    fn recordings_stand_side_by_side() {
        let tables = side_by_side(&file(2));
        assert_eq!(tables.len(), 1);
        let text = tables[0].1.csv();
        assert!(
            text.starts_with("averages of,run0.csv,run1.csv\n") && text.lines().count() == 15,
            "{text}"
        );
        assert_eq!(signals_csv(&file(2)).lines().count(), 1 + 2 * 14);
    }
}
