//! The page of `wv`, and what pages of wavelet variances share.

use crate::report::curves::{SignalCurves, SignalsFile};
use crate::report::number::squared;
use crate::report::page::{Axis, Chart, Colour, Mark, Page, Panel, Series, Table, Tone};
use crate::report::short_names;
use nav_sim_calibration::duration;
use nav_sim_signal::imu::Sensor;

/// The axis of scales.
pub(super) fn scale_axis() -> Axis {
    Axis::log("scale τ (s)")
}

/// The axis of wavelet variances of a sensor.
pub(super) fn variance_axis(sensor: &str) -> Axis {
    Axis::log(&format!("wavelet variance ({})", squared(unit(sensor))))
}

/// Unit of a sensor, by its name in files.
pub(super) fn unit(sensor: &str) -> &'static str {
    Sensor::ALL.into_iter().find(|s| s.name() == sensor).map_or("", Sensor::unit)
}

/// A sensor in words.
pub(super) fn sensor_name(sensor: &str) -> &'static str {
    if sensor == Sensor::Accel.name() { "Accelerometer" } else { "Gyroscope" }
}

pub(super) fn curve(tau_s: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    tau_s.iter().copied().zip(values.iter().copied()).collect()
}

pub(super) fn band(tau_s: &[f64], low: &[f64], high: &[f64]) -> Mark {
    Mark::Band(tau_s.iter().zip(low).zip(high).map(|((t, a), b)| (*t, *a, *b)).collect())
}

/// The page of the wavelet variances of some signals.
pub(crate) fn wavelet_page(file: &SignalsFile) -> Page {
    let worst = file.signals.iter().filter_map(|s| Some((excess(s)?, s)));
    let worst = worst.max_by(|a, b| a.0.1.total_cmp(&b.0.1));
    let (tone, verdict) = match worst {
        Some(((tau_s, ratio), s)) if ratio > OUTLIERS => (
            Tone::Doubtful,
            format!(
                "Outliers? The classical wavelet variance of {} {}.{} is {ratio:.2} times the robust one at {}.",
                s.file,
                s.sensor,
                s.axis,
                duration(tau_s)
            ),
        ),
        _ => (
            Tone::Good,
            format!(
                "{} signals; classical and robust wavelet variances agree within {:.0} % wherever 30 degrees of freedom or \
                 more tell them.",
                file.signals.len(),
                100.0 * (OUTLIERS - 1.0)
            ),
        ),
    };
    let mut page = Page::new("Wavelet variance of static recordings", tone, [verdict]);
    let caption = "Lines: robust wavelet variance with its 95 % band; dashed: classical, which outliers raise. White noise falls by 1 a decade, a random walk rises by 1; a flat stretch is bias \
                   instability. τ is twice the averaging time of the Allan deviation, which is √(2 ν).";
    page.text(caption);
    for chart in charts(file) {
        page.chart(&chart, "");
    }
    for signal in &file.signals {
        page.heading(&name(signal));
        page.table(&Table::of_rows(&crate::report::signal_rows(signal)));
    }
    page.checked(
        "wavelet variances to 1e-12, ends of intervals to 1e-9 of an independent implementation, relative \
         (tests/truth/calibration_truth.rs).",
    );
    page
}

/// Classical over robust beyond which outliers are suspected.
const OUTLIERS: f64 = 1.5;
/// Degrees of freedom that such a ratio takes.
const TELLING: f64 = 30.0;

/// The scale at which classical over robust is largest, and that ratio.
fn excess(s: &SignalCurves) -> Option<(f64, f64)> {
    let ratio = |i: usize| (s.tau_s[i], s.classical.wv[i] / s.robust.wv[i]);
    let told = (0..s.tau_s.len()).filter(|i| s.edof[*i] >= TELLING).map(ratio).filter(|r| r.1.is_finite());
    told.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// `run1.csv · accel.x · 600000 samples`
fn name(s: &SignalCurves) -> String {
    format!("{} · {}.{} · {} samples", s.file, s.sensor, s.axis, s.samples)
}

/// Signals of a chart, beyond which it is full.
const MOST: usize = 8;

/// A chart a sensor, or several where there are many signals.
fn charts(file: &SignalsFile) -> Vec<Chart> {
    let mut charts: Vec<Chart> = Vec::new();
    let is_only_file = file.signals.windows(2).all(|pair| pair[0].file == pair[1].file);
    let files = short_names(&file.signals.iter().map(|s| s.file.as_str()).collect::<Vec<_>>());
    let name = |(s, file): (&SignalCurves, &String)| match is_only_file {
        true => s.axis.clone(),
        false => format!("{file} {}", s.axis),
    };
    for sensor in Sensor::ALL {
        let with_names = file.signals.iter().zip(&files).filter(|(s, _)| s.sensor == sensor.name());
        let with_names: Vec<(&SignalCurves, String)> =
            with_names.map(|(s, file)| (s, name((s, file)))).collect();
        let title = sensor_name(sensor.name());
        for (k, signals) in with_names.chunks(MOST).enumerate() {
            let series = signals
                .iter()
                .enumerate()
                .flat_map(|(hue, (s, name))| of_signal(s, name, Colour::Hue(hue)))
                .collect();
            let title = if k == 0 { title.to_owned() } else { format!("{title}, continued") };
            let panel = Panel { height: 1.4, ..Panel::new(variance_axis(sensor.name()), series) };
            charts.push(Chart::new(&title, scale_axis(), vec![panel]).in_group("scales"));
        }
    }
    charts
}

/// Robust as a line in its band, classical dashed.
fn of_signal(s: &SignalCurves, name: &str, colour: Colour) -> Vec<Series> {
    vec![
        Series::new(name, colour, band(&s.tau_s, &s.robust.ci_low, &s.robust.ci_high)),
        Series::line(name, colour, curve(&s.tau_s, &s.robust.wv)),
        Series::dashed(&format!("{name}, classical"), colour, curve(&s.tau_s, &s.classical.wv)),
    ]
}
