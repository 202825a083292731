//! The document of a calibration.

use super::Calibration;
use crate::app::Input;
use crate::commands::export::ExportQuantity;
use crate::io::model_file::{Interval, ModelFile, PROGRAM, SCHEMA, TurnOn, known};
use crate::report::csv::merged;
use crate::report::curves::{FittedCurve, band, curve, recording_names, sensor_name};
use crate::report::{first_names, in_order};
use nav_sim_calibration::{
    CalibrationSettings, CommonCause, Diagnosis, Estimator, FEWEST_TO_COMPARE, ModelCandidate,
    ModelRanking, Outcome, ParameterInterval, ParameterSpread, RecordingVerdict, RecordingWarmUp,
    ScaleMisfit, TurnOnFinding, TurnOnSpread, UNDETERMINED_RATIO, Undetermined, duration, percent,
    tau_s,
};
use nav_sim_document::{
    Cell, Chart, ChartAxis, Colour, Document, Importance, Mark, Panel, Series, Stroke, Table, Tone,
    readable,
};
use nav_sim_signal::imu::{Axis, Channel, Sensor};
use nav_sim_signal::noise::practical::Horizon;
use nav_sim_signal::noise::{
    Parameter, ParameterDistribution, ParameterRef, Process, ProcessKind, Spread, Variation,
};
use serde_json::{Value, json};
use std::collections::BTreeMap;

impl Calibration {
    pub(super) fn page(&self) -> Document {
        let (json, curves) = (&self.json(), self.curves());
        let title = format!(
            "Stochastic calibration, {}",
            in_order(self.outcomes.iter().map(|o| o.estimator.name())).join(", ")
        );
        let mut document = Document::new(&title, self.tone(), self.verdict());
        let interval = match self.outcomes.iter().map(|o| o.recordings).max() {
            Some(0) => "95 %, this curve",
            Some(1) => "95 %, this power-on",
            _ => "95 %, mean of power-ons",
        };
        let policy = policy();
        let columns = [
            (policy.as_str(), "{../../name} {name} ({unit})"),
            ("value", "value|not observed"),
            (interval, "ci95|not determined"),
            ("averaging time", "averages"),
        ];
        if self.outcomes.len() > 2 {
            let columns = [
                ("fit", "name"),
                ("N", "figures/N/value"),
                ("95 %", "figures/N/ci95"),
                ("B", "figures/B/value"),
                ("K", "figures/K/value"),
            ];
            document.table(Table::of(json, "/fits/*", &columns));
        }
        for figures in ["N|B|K", "!N|B|K"] {
            let table = Table::of(json, &format!("/fits/*/figures/{figures}"), &columns);
            if !table.is_empty() {
                document.table(table);
            }
        }
        for (importance, note) in self.notes() {
            document.note(importance, note);
        }
        for (index, (outcome, fitted)) in self.outcomes.iter().zip(&curves.curves).enumerate() {
            document.section(&format!("{} · {}", group_name(fitted), outcome.spec));
            document.chart(
                &chart(fitted, outcome, &self.diagnoses, self.settings.rate_hz),
                CAPTION,
            );
            document.table(parameters(outcome));
            if outcome.ranking.is_some() {
                document.section("Candidate models");
                let columns = [
                    ("model", "model"),
                    ("WVIC", "wvic"),
                    ("objective", "objective"),
                    ("optimism", "optimism"),
                    ("p", "p_value"),
                    ("J-test p", "j_test_p_value"),
                    ("chosen", "chosen"),
                ];
                document.table(Table::of(
                    json,
                    &format!("/fits/{index}/ranking/*"),
                    &columns,
                ));
            }
        }
        document.section("Fits");
        let columns = [
            ("fit", "name"),
            ("recordings", "recordings"),
            ("signals", "replicates"),
            ("scales", "scales"),
            ("objective", "objective"),
            ("end", "termination"),
            ("local minima", "starts"),
            ("of them the best", "agreeing"),
            ("J-test p", "j_p_value"),
            ("homogeneity p", "spread_p_value"),
        ];
        document.table(Table::of(json, "/fits/*", &columns));
        if self.diagnoses.iter().any(is_abnormal) {
            document.section("Abnormal recordings");
            let columns = [
                ("recording", "file"),
                ("sensor", "sensor"),
                ("verdict", "verdict"),
                ("noise: p", "noise/p_value"),
                ("scales (s)", "noise/tau_s"),
                ("outliers: p", "outliers/p_value"),
                ("scales (s)", "outliers/tau_s"),
                ("drift: p", "drift/p_value"),
            ];
            document.table(Table::of(json, "/replicates/*", &columns).without_unknown());
        }
        document
    }

    fn tone(&self) -> Tone {
        if self
            .outcomes
            .iter()
            .any(|o| o.goodness().is_some_and(|g| g.is_rejected()))
        {
            return Tone::Bad;
        }
        if self.outcomes.iter().any(|o| o.departure().misfit.is_some())
            || self.diagnoses.iter().any(is_abnormal)
        {
            Tone::Doubtful
        } else {
            Tone::Good
        }
    }

    /// A line for each model, and one for the recordings.
    fn verdict(&self) -> Vec<String> {
        self.outcomes
            .iter()
            .map(|o| fit_line(o, &fit_name(o, &self.outcomes), self.settings.rate_hz))
            .chain(recordings_line(&self.outcomes, &self.diagnoses))
            .collect()
    }

    /// Notes, the most important first.
    fn notes(&self) -> Vec<(Importance, String)> {
        let (settings, fits) = (&self.settings, &self.outcomes);
        let mut notes = Vec::new();
        let mut note = |importance, place: &str, text: String| {
            notes.push((importance, format!("{place}: {text}")));
        };
        for sensor in Sensor::ALL {
            for text in recording_notes(sensor, fits, &self.diagnoses, settings) {
                note(Importance::Warning, sensor.name(), text);
            }
        }
        for found in &self.turn_on {
            let importance = match found.finding {
                TurnOnFinding::Seen => Importance::Warning,
                _ => Importance::Detail,
            };
            note(importance, found.sensor.name(), turn_on_remark(found));
        }
        if let Some(text) = warm_ups_line(&self.warm_ups) {
            note(Importance::Remark, "warm-up", text);
        }
        for outcome in fits {
            let reasons = outcome.ranking.iter().flat_map(reasons);
            let name = fit_name(outcome, fits);
            if let Some(a) = outcome.axes_differ.filter(|a| a.ratio > OTHER_UNIT) {
                let text = format!(
                    "{} has up to {} times the wavelet variance of {}: in another unit?",
                    a.largest,
                    readable(a.ratio),
                    a.smallest
                );
                note(Importance::Warning, &name, text);
            }
            for text in reasons.chain(fit_notes(outcome, settings)) {
                note(Importance::Remark, &name, text);
            }
            for text in without_interval(outcome) {
                note(Importance::Detail, &name, text);
            }
        }
        notes
    }
}

/// `N, K matched over 1–100 s`
fn policy() -> String {
    let Horizon { from_s, to_s } = Horizon::default();
    format!("N, K matched over {from_s}–{to_s} s")
}

pub(crate) fn is_abnormal(diagnosis: &Diagnosis) -> bool {
    diagnosis.verdict != RecordingVerdict::Normal
}

/// One row per parameter.
fn parameters(outcome: &Outcome) -> Table {
    let model = &outcome.fit.composite;
    let mut table = Table::new(["parameter (SI, of a sample)", "value", "95 % interval"]);
    for (of, value) in model.parameters() {
        let mut known = intervals(outcome).iter().filter(|i| i.absent.is_none());
        let ends = known.find(|i| i.of == of);
        let ends = ends.map(|i| format!("{:.5e} … {:.5e}", i.low, i.high));
        let value = format!("{value:.5e}");
        table.row([model.name_of(of), value, ends.unwrap_or_default()].map(Cell::from));
    }
    table
}

// The charts of a calibration: wavelet variance and model, and what is exported on the Allan deviation.

/// Caption of [`chart`].
const CAPTION: &str = "Above: Allan deviation with 95 % band, recordings, model, processes and export (N at 1 s, K at 3 s, B at the floor). Below: wavelet variance, data over model.";

/// `Accelerometer x`, or `Gyroscope, all axes`.
fn group_name(fitted: &FittedCurve) -> String {
    let sensor = sensor_name(fitted.sensor);
    match fitted.axis.as_str() {
        "all" => format!("{sensor}, all axes"),
        axis => format!("{sensor} {axis}"),
    }
}

/// The Allan deviation, with N, B and K where they are read off it, and the ratio of the wavelet variance to that of the model.
fn chart(fitted: &FittedCurve, outcome: &Outcome, diagnoses: &[Diagnosis], rate_hz: f64) -> Chart {
    // a scale is two averages long, the wavelet variance half the Allan variance
    let averages_s: Vec<f64> = fitted.tau_s.iter().map(|tau_s| 0.5 * tau_s).collect();
    let allan = |wv: &[f64]| -> Vec<f64> { wv.iter().map(|nu| (2.0 * nu).sqrt()).collect() };
    let over_model = |wv: &[f64]| -> Vec<f64> {
        let both = wv.iter().zip(&fitted.implied);
        both.map(|(nu, of_model)| nu / of_model).collect()
    };
    let data = |of: &dyn Fn(&[f64]) -> Vec<f64>| {
        let [low, high, mid] = [&fitted.ci_low, &fitted.ci_high, &fitted.wv].map(|wv| of(wv));
        [
            Series::new("data, 95 %", Colour::Ink, band(&averages_s, &low, &high)),
            Series::line("data, 95 %", Colour::Ink, curve(&averages_s, &mid)),
        ]
    };
    let line = |wv: &[f64]| curve(&averages_s, &allan(wv));
    let mut upper = recordings(fitted, diagnoses, line);
    upper.extend(
        fitted
            .processes
            .iter()
            .filter(|(_, wv)| wv.iter().any(|nu| *nu > 0.0))
            .zip(PROCESSES.into_iter().cycle())
            .map(|((name, wv), hue)| Series::dashed(name, Colour::Hue(hue), line(wv))),
    );
    upper.extend(data(&allan));
    upper.push(Series::line("model", Colour::REAL, line(&fitted.implied)));
    if let Some(practical) = outcome.practical(rate_hz) {
        let (pair, minimum) = (practical.walk, practical.minimum);
        let read = [
            (pair.density > 0.0).then_some(("N", 1.0, pair.density)),
            practical
                .walk_is_observed()
                .then_some(("K", 3.0, pair.walk)),
            minimum.map(|m| ("B", m.tau_s, m.deviation)),
        ];
        upper.extend(
            read.into_iter()
                .flatten()
                .map(|(name, x, y)| Series::new(name, Colour::RIGHT, Mark::Place(x, y))),
        );
    }
    let mut lower = data(&over_model).to_vec();
    lower.push(Series::new("model", Colour::REAL, Mark::Level(1.0)));
    let deviation = ChartAxis::log(&format!("Allan deviation ({})", fitted.sensor.unit()));
    let ratio = ChartAxis::log("data / model").including(0.8, 1.25);
    let panels = [(1.4, deviation, upper), (0.5, ratio, lower)];
    let panels = panels.map(|(height, axis, series)| Panel::new(axis, series).of_height(height));
    let (group, estimator) = (group_name(fitted), fitted.estimator.to_uppercase());
    Chart::new(
        &format!("Allan deviation: {group}, {estimator}"),
        ChartAxis::log("averaging time (s)"),
        panels.into(),
    )
    .in_group("scales")
}

/// Hues of processes: those that neither model nor recordings have.
const PROCESSES: [usize; 5] = [0, 2, 3, 4, 5];
/// First of the two hues of abnormal recordings.
const ABNORMAL: usize = 6;

/// Thin lines, grey but for the abnormal ones.
fn recordings(
    fitted: &FittedCurve,
    diagnoses: &[Diagnosis],
    line: impl Fn(&[f64]) -> Vec<(f64, f64)>,
) -> Vec<Series> {
    if fitted.replicates.len() < 2 {
        return Vec::new();
    }
    let abnormal: Vec<&str> = diagnoses
        .iter()
        .filter(|d| d.sensor == fitted.sensor)
        .filter(|d| is_abnormal(d))
        .map(|d| d.name.as_str())
        .collect();
    let series = fitted
        .replicates
        .iter()
        .zip(recording_names(
            fitted.replicates.iter().map(|r| r.file.as_str()),
        ))
        .map(|(replicate, name)| {
            let points = line(&replicate.wv);
            match abnormal.iter().position(|file| *file == replicate.file) {
                None => Series::new("recordings", Colour::Soft, Mark::Line(points, Stroke::Thin)),
                Some(k) => Series::line(
                    &format!("{name} (abnormal)"),
                    Colour::Hue(ABNORMAL + k % 2),
                    points,
                ),
            }
        });
    series.collect()
}

// A calibration in words: the verdict on models and recordings, the notes.

/// `accel: N1 does not fit: data/model 0.33 at 0.02 s; 6 of 16 scales off (p = 0.005)`
fn fit_line(outcome: &Outcome, name: &str, rate_hz: f64) -> String {
    let (spec, departure) = (&outcome.spec, outcome.departure());
    let at = |level| duration(tau_s(level, rate_hz));
    let p = outcome
        .goodness()
        .map_or(String::new(), |g| format!(" (p = {:.3})", g.p_value));
    if let Some(worst) = departure.misfit {
        let (ratio, at) = (readable(worst.ratio), at(worst.level));
        let off = match departure.missed.len() {
            0 => "all scales together off".to_owned(),
            missed => format!("{missed} of {} scales off", departure.scales),
        };
        return format!("{name}: {spec} does not fit: data/model {ratio} at {at}; {off}{p}");
    }
    let off = departure.furthest.map_or(String::new(), |m| {
        let off = percent((m.ratio - 1.0).abs());
        let known = departure
            .known_to
            .map(|level| format!(" (up to {})", at(level)))
            .unwrap_or_default();
        format!(", within {off} at all scales known to 10 %{known}")
    });
    format!("{name}: {spec} fits{p}{off}")
}

/// `2 of 6 recordings abnormal: run4 (accel outliers), run5 (accel noise, gyro noise)`; none of a single recording.
pub(crate) fn recordings_line(outcomes: &[Outcome], diagnoses: &[Diagnosis]) -> Option<String> {
    let names = in_order(diagnoses.iter().map(|d| d.name.as_str()));
    let count = names.len();
    if count == 0 {
        return None;
    }
    if count < FEWEST_TO_COMPARE {
        return Some(format!(
            "{count} recordings: {FEWEST_TO_COMPARE} are needed to find abnormal ones"
        ));
    }
    let finding = |d: &Diagnosis| {
        let found = [
            ("noise", d.noise.is_some()),
            ("outliers", d.outliers.is_some()),
            ("drift", d.drift.is_some()),
        ];
        let found: Vec<&str> = found.into_iter().filter(|f| f.1).map(|f| f.0).collect();
        format!("{} {}", d.sensor, found.join(" and "))
    };
    let mut abnormal = Vec::new();
    for (name, shown) in names.iter().zip(recording_names(names.iter().copied())) {
        let findings: Vec<String> = diagnoses
            .iter()
            .filter(|d| d.name == *name && is_abnormal(d))
            .map(finding)
            .collect();
        if !findings.is_empty() {
            abnormal.push(format!("{shown} ({})", findings.join(", ")));
        }
    }
    if abnormal.is_empty() {
        let differ = outcomes
            .iter()
            .find_map(|o| o.differing())
            .map_or(String::new(), |(p, _)| {
                format!(", but differ beyond their noise (p = {p:.3})")
            });
        return Some(format!("{count} recordings, none abnormal{differ}"));
    }
    let named = first_names(&abnormal);
    Some(format!(
        "{} of {count} recordings abnormal: {named}",
        abnormal.len()
    ))
}

/// The recordings whose beginnings change a wavelet variance notably, and what to leave out.
fn warm_ups_line(found: &[RecordingWarmUp]) -> Option<String> {
    const NOTABLE: f64 = 0.05;
    let matters = |b: &&RecordingWarmUp| {
        let mut changes = b.signals.iter().map(|w| w.change);
        changes.any(|c| c.is_none_or(|ratio| ratio.ln().abs() > NOTABLE))
    };
    let told: Vec<&RecordingWarmUp> = found.iter().filter(matters).collect();
    let names = recording_names(told.iter().map(|b| b.recording.as_str()));
    let line = |(b, name): (&&RecordingWarmUp, String)| match b.skip_s {
        Some(s) => format!("{name} --skip-s {s}"),
        None => format!("{name} never settles"),
    };
    let lines: Vec<String> = told.iter().zip(names).map(line).collect();
    (!lines.is_empty()).then(|| first_names(&lines))
}

/// `accel.x`, with the estimator where there are several.
fn fit_name(outcome: &Outcome, outcomes: &[Outcome]) -> String {
    match outcomes.iter().filter(|o| o.scope == outcome.scope).count() {
        1 => outcome.scope.name(),
        _ => format!("{} {}", outcome.scope.name(), outcome.estimator),
    }
}

/// Ratio of wavelet variances of two axes above which one may be in another unit: half of (m/s²)² in g², 96, the smallest
/// square of a usual conversion.
const OTHER_UNIT: f64 = 48.0;
/// An amplitude known to no better than this factor, either way, is reported.
const FACTOR: f64 = 3.0;
/// The wavelet variance of an AR1 peaks at this many correlation times.
const PEAK: f64 = 3.78;

/// Remarks on a fit, the most important first.
fn fit_notes(outcome: &Outcome, settings: &CalibrationSettings) -> Vec<String> {
    let (fit, curve, rate_hz) = (&outcome.fit, &outcome.curve, settings.rate_hz);
    let (model, labels) = (&fit.composite, fit.composite.labels());
    let seconds = |level: &u32| tau_s(*level, rate_hz);
    let mut notes = Vec::new();
    notes.extend(outcome.axes_differ.map(|a| {
        let (largest, ratio, smallest) = (a.largest, readable(a.ratio), a.smallest);
        format!(
            "axes differ: {largest} has up to {ratio} times the wavelet variance of {smallest}; --pool axes fits each"
        )
    }));
    if outcome.recordings == 2 && outcome.inference.is_some() {
        notes.push("two recordings hardly show their differences: intervals are wide".into());
    }
    // A range that was asked for is no news.
    if let ([first, ..], None) = (&curve.ignored[..], settings.fit_range) {
        let scales = [first, curve.ignored.last().unwrap_or(first)]
            .map(|level| duration(seconds(level)))
            .join(" to ");
        notes.push(format!("scales {scales} are not fitted: too many outliers"));
    }
    notes.extend(
        outcome
            .inference
            .iter()
            .filter_map(|i| i.indistinct.as_ref())
            .map(|i| format!("{} fits as well (p = {:.2})", i.spec, i.p_value)),
    );
    if let Some(reading) = &outcome.reading {
        let counted = reading.curve.counted_levels();
        let bands = bands(&counted).map(|[from, to]| {
            let [from, to] = [from, to].map(|level| seconds(&level));
            (
                format!("{} to {}", duration(from), duration(to)),
                format!("{from}s:{to}s"),
            )
        });
        let (spec, all) = (&reading.spec, bands.collect::<Vec<_>>());
        let words: Vec<&str> = all.iter().map(|(words, _)| &**words).collect();
        notes.push(format!(
            "N, K and B are read off the curve, as {spec} at {}",
            words.join(" and ")
        ));
        if let [(_, range)] = &all[..]
            && reading.departure().scales < outcome.departure().scales
        {
            notes.push(format!(
                "other scales spoil the fit: --scales {range} leaves them out"
            ));
        }
    }
    for i in intervals(outcome)
        .iter()
        .filter(|i| !i.of.parameter.is_shape() && i.absent.is_none())
        .filter(|i| i.high > FACTOR * FACTOR * i.low)
    {
        let name = model.name_of(i.of);
        let factor = readable((i.high / i.low).sqrt());
        notes.push(if i.low > 0.0 {
            format!("{name} is known only to a factor of {factor}")
        } else {
            format!("{name} may be zero")
        });
    }
    notes.extend(
        fit.zero
            .iter()
            .map(|i| &labels[*i])
            .map(|label| format!("{label} is zero: not observed")),
    );
    let longest_s = outcome.curve.counted_levels().last().map_or(0.0, seconds);
    for (i, label) in labels
        .iter()
        .enumerate()
        .filter(|(i, _)| !fit.zero.contains(i))
    {
        let Some(time_s) = model.processes[i].correlation_time_s(rate_hz) else {
            continue;
        };
        let [time, longest] = [time_s, longest_s].map(duration);
        // Before its peak the curve of an AR1 rises as that of a random walk does: without the peak only sigma2 is known.
        if PEAK * time_s > longest_s {
            notes.push(format!(
                "{label}: correlation time {time} is not identifiable from scales up to {longest}"
            ));
        }
    }
    notes
}

/// Reasons that parameters have no interval.
fn without_interval(outcome: &Outcome) -> impl Iterator<Item = String> {
    let labels = outcome.fit.composite.labels();
    intervals(outcome)
        .iter()
        .filter_map(|i| Some((i, i.absent.as_ref()?)))
        .map(move |(interval, why)| undetermined(interval, why, &labels))
}

fn undetermined(interval: &ParameterInterval, why: &Undetermined, labels: &[String]) -> String {
    let process = &labels[interval.of.process];
    let why = match why {
        Undetermined::Zero => format!("{process} is zero"),
        Undetermined::Vanishes => format!(
            "{process} is zero in {} of the draws",
            percent(interval.lost)
        ),
        Undetermined::OneSided => "the draws lie on one side of the estimate".to_owned(),
        Undetermined::BeyondSearch => "any longer correlation time fits".to_owned(),
        Undetermined::Open => format!("the draws differ by over a factor of {UNDETERMINED_RATIO}"),
        Undetermined::Indistinct(alike) => {
            let alike: Vec<&str> = alike.iter().map(|i| labels[*i].as_str()).collect();
            format!("the data do not need both {}", alike.join(" and "))
        }
    };
    let name = interval.of.parameter.name();
    format!("{process} {name}: no interval: {why}")
}

/// Notes on the recordings of a sensor: on those that are abnormal, on what all have in common.
fn recording_notes(
    sensor: Sensor,
    outcomes: &[Outcome],
    diagnoses: &[Diagnosis],
    settings: &CalibrationSettings,
) -> Vec<String> {
    let own: Vec<&Diagnosis> = diagnoses.iter().filter(|d| d.sensor == sensor).collect();
    let abnormal = own
        .iter()
        .filter(|d| d.verdict == RecordingVerdict::Noise)
        .count();
    let mut notes = Vec::new();
    if abnormal > 0 && 2 * abnormal >= own.len() {
        notes.push("at least half of the recordings are abnormal: no majority".to_owned());
    } else if abnormal > 0 {
        notes.extend(trim_note(sensor, abnormal, outcomes, settings));
    }
    for found in own.first().iter().flat_map(|d| &d.common) {
        let from_to = [found.tau_s.first(), found.tau_s.last()]
            .map(|end| end.map_or_else(String::new, |s| duration(*s)))
            .join(" to ");
        let size = percent(found.size);
        notes.push(match found.cause {
            CommonCause::Outliers => format!(
                "outliers in most recordings add up to {size} to the wavelet variance, from {from_to}; awv includes them"
            ),
            CommonCause::GaussianQuantization => format!(
                "QN is Gaussian from {from_to}: robust estimators read up to {size} too low; use awv"
            ),
            CommonCause::CoarseSteps => format!(
                "quantization steps are as large as the noise from {from_to}: without outliers use awv"
            ),
            CommonCause::Drift => format!(
                "all recordings drift alike ({} {:+.2e} {}/h): add DR, or warm up longer",
                found.axis.map_or("", Axis::name),
                found.size,
                sensor.unit()
            ),
        });
    }
    notes
}

/// The advice where estimators do not leave out so many abnormal recordings.
fn trim_note(
    sensor: Sensor,
    abnormal: usize,
    outcomes: &[Outcome],
    settings: &CalibrationSettings,
) -> Option<String> {
    if !settings.estimators.contains(&Estimator::DrAwv) {
        return Some(
            "the model includes abnormal recordings: --estimator dr-awv leaves them out".to_owned(),
        );
    }
    let fit = outcomes
        .iter()
        .filter(|o| o.scope.sensor == sensor && o.recordings > 0)
        .min_by_key(|o| o.replicates)?;
    // Pooled, a recording has a signal for each axis.
    let needed = abnormal * fit.replicates.div_ceil(fit.recordings);
    let trim = settings.trim.count(fit.replicates);
    (trim < needed).then_some(format!(
        "a trim of {trim} keeps abnormal recordings: --trim {needed}"
    ))
}

/// The finding about the means of one sensor, without its name.
fn turn_on_remark(found: &TurnOnSpread) -> String {
    let spread = format!("{} {}", readable(found.spread()), found.sensor.unit());
    match found.finding {
        TurnOnFinding::Seen => {
            let (error, recordings) = (percent(found.relative_error()), found.recordings());
            format!(
                "turn-on bias {spread} ± {error} from {recordings} recordings, stored as [turn_on]"
            )
        }
        TurnOnFinding::WithinNoise => {
            format!("no turn-on bias: the means of recordings scatter by {spread}")
        }
        TurnOnFinding::Moved => {
            format!("no turn-on bias stored: means differ by {spread}, not one mounting")
        }
        TurnOnFinding::Removed => "no turn-on bias: means were removed before".to_owned(),
    }
}

/// The reasons of a choice.
fn reasons(ranking: &ModelRanking) -> Vec<String> {
    let (best, taken) = (&ranking.candidates[0], &ranking.candidates[ranking.chosen]);
    let wvic = |c: &ModelCandidate| format!("{} {:.4}", c.spec, c.wvic());
    let (name, pair) = (&taken.spec, format!("{}, {}", wvic(taken), wvic(best)));
    let mut lines = vec![match taken.p_value {
        None if taken.spec == best.spec => {
            format!("{name} has the least WVIC; no simpler model fits as well")
        }
        None => format!("{name} has the least WVIC that the J-test accepts ({pair})"),
        Some(p) => format!("{name} fits as well as the least WVIC (p = {p:.2}; {pair})"),
    }];
    if taken.is_rejected() {
        lines.push("the J-test rejects every candidate".to_owned());
    }
    lines.extend(
        ranking
            .too_simple
            .iter()
            .map(|(spec, p)| format!("{spec} is too simple (p ≤ {p:.3})")),
    );
    lines
}

// A calibration as JSON: fits with their figures, recordings, turn-on biases.

/// The facts of a fit that stand in the provenance of its model too; null where there are none.
fn fit_record(outcome: &Outcome, settings: &CalibrationSettings) -> Value {
    let (fit, goodness) = (&outcome.fit, outcome.goodness());
    let worst = outcome.departure().misfit;
    let notes = fit_notes(outcome, settings).into_iter();
    let notes: Vec<String> = notes.chain(without_interval(outcome)).collect();
    let is_trimmed = outcome.estimator == Estimator::DrAwv;
    json!({
        "signals": outcome.scope.name(),
        "model": outcome.spec.to_string(),
        "replicates": outcome.replicates,
        "recordings": outcome.recordings,
        "trim": is_trimmed.then(|| settings.trim.count(outcome.replicates)),
        "scales": outcome.curve.levels.len(),
        "objective": fit.objective,
        "termination": fit.termination,
        "combinations": fit.combinations,
        "starts": fit.starts,
        "agreeing": fit.agreeing,
        "runner_up": fit.runner_up,
        "bootstrap": outcome.inference.as_ref().map_or(0, |i| i.draws),
        "j_dof": goodness.map(|g| g.dof),
        "j_p_value": goodness.map(|g| g.p_value),
        "worst_ratio": worst.map(|miss| miss.ratio),
        "worst_tau_s": worst.map(|miss| tau_s(miss.level, settings.rate_hz)),
        "notes": notes,
    })
}

/// A fit: its record, models and figures. `axis` is `all` of pooled axes; `spread_p_value` is the probability that
/// replicates of one noise differ as much at some scale; `parameter_spread` are laws of model files; `missed` are the
/// scales at which curve and model differ by more than four standard deviations; `zero` are the processes whose amplitude
/// is zero.
fn fit_json(outcome: &Outcome, all: &[Outcome], settings: &CalibrationSettings) -> Value {
    let (fit, rate_hz) = (&outcome.fit, settings.rate_hz);
    let (inference, ranking) = (outcome.inference.as_ref(), outcome.ranking.as_ref());
    let labels = fit.composite.labels();
    let labelled = |processes: &[usize]| -> Vec<&str> {
        processes.iter().map(|i| labels[*i].as_str()).collect()
    };
    let miss = |m: &ScaleMisfit| json!({ "tau_s": tau_s(m.level, rate_hz), "ratio": m.ratio, "deviations": m.deviations });
    let missed: Vec<Value> = outcome.departure().missed.iter().map(miss).collect();
    let law = |found: &ParameterSpread| {
        let of = json!({
            "process": labels[found.of.process],
            "parameter": found.of.parameter.name(),
            "distribution": "lognormal",
        });
        merged([of, json!(found)])
    };
    let laws: Vec<Value> = inference.iter().flat_map(|i| &i.varying).map(law).collect();
    let indistinct = inference.and_then(|i| i.indistinct.as_ref()).map(|i| {
        json!({
            "processes": labelled(&i.processes),
            "simpler": i.spec.to_string(),
            "p_value": i.p_value,
        })
    });
    let fit_facts = json!({
        "name": fit_name(outcome, all),
        "sensor": outcome.scope.sensor,
        "axis": outcome.scope.axis.map_or("all", |axis| axis.name()),
        "estimator": outcome.estimator,
        "ranking": ranking.map_or(Vec::new(), candidates),
        "reasons": ranking.map_or(Vec::new(), reasons),
        "processes": processes(outcome),
        "goodness": outcome.goodness(),
        "spread": inference.map_or(&[][..], |i| &i.spread),
        "spread_p_value": inference.and_then(|i| i.alike),
        "parameter_spread": laws,
        "indistinct": indistinct,
        "figures": figures(outcome, rate_hz),
        "missed": missed,
        "zero": labelled(&fit.zero),
    });
    merged([fit_record(outcome, settings), fit_facts])
}

fn candidates(ranking: &ModelRanking) -> Vec<Value> {
    let entry = |(i, c): (usize, &ModelCandidate)| {
        json!({
            "model": c.spec.to_string(),
            "objective": c.objective,
            "optimism": c.optimism,
            "wvic": c.wvic(),
            "p_value": c.p_value,
            "j_test_p_value": c.j_p_value,
            "chosen": i == ranking.chosen,
        })
    };
    ranking.candidates.iter().enumerate().map(entry).collect()
}

/// Processes with the keys of model files; beside each parameter `_ci95` and `_se`, null where they are not determined.
fn processes(outcome: &Outcome) -> Vec<Value> {
    let model = &outcome.fit.composite;
    let mut all: Vec<Value> = model.processes.iter().map(|p| json!(p)).collect();
    for i in intervals(outcome) {
        let (entry, name) = (&mut all[i.of.process], i.of.parameter.name());
        entry[format!("{name}_ci95")] = json!(i.absent.is_none().then_some([i.low, i.high]));
    }
    all
}

/// First and last of each run of levels without a gap.
fn bands(levels: &[u32]) -> impl Iterator<Item = [u32; 2]> {
    let runs = levels.chunk_by(|a, b| a + 1 == *b);
    runs.map(|run| [run[0], run[run.len() - 1]])
}

fn intervals(outcome: &Outcome) -> &[ParameterInterval] {
    outcome.inference.as_ref().map_or(&[], |i| &i.intervals)
}

/// The noise of a fit, with its intervals.
fn apply_to(file: &mut ModelFile, outcome: &Outcome) {
    outcome.apply_to(&mut file.model);
    let labels = outcome.fit.composite.labels();
    for channel in outcome.scope.channels() {
        file.missing.retain(|c| *c != channel);
        let known = intervals(outcome).iter().filter(|i| i.low.is_finite());
        file.intervals.extend(known.map(|i| Interval {
            channel,
            process: labels[i.of.process].clone(),
            parameter: i.of.parameter.name().to_owned(),
            low: i.low,
            high: i.high,
        }));
    }
}

/// The means of one sensor, by the model of one estimator.
fn turn_on_json(found: &TurnOnSpread) -> Value {
    let derived = json!({
        "sigmas": found.sigmas(),
        "spread": found.spread(),
        "noise": found.noise(),
        "remark": turn_on_remark(found),
    });
    merged([json!(found), derived])
}

/// Figures of a fit in the units of data sheets: N, B and K, and what a pair of N and K does not carry. `value` is null where
/// the data do not show it, `averages` are the averaging times at which it counts.
fn figures(outcome: &Outcome, rate_hz: f64) -> BTreeMap<String, Value> {
    let sensor = outcome.scope.sensor;
    let mut figures = BTreeMap::new();
    let mut put =
        |key: String, name: &str, (unit, factor), value: Option<f64>, ends, averages: &str| {
            let ends: Option<[f64; 2]> = ends;
            let figure = json!({
                "name": name,
                "value": value.map(|x| x * factor),
                "ci95": value.and(ends).map(|ends| ends.map(|end| end * factor)),
                "unit": unit,
                "averages": averages,
            });
            figures.insert(key, figure);
        };
    if let Some(practical) = outcome.practical(rate_hz) {
        let (pair, ends) = (&practical.walk, &practical.intervals);
        let [white, walk] = match sensor {
            Sensor::Accel => ["velocity random walk N", "acceleration random walk K"],
            Sensor::Gyro => ["angle random walk N", "rate random walk K"],
        };
        let none = format!("none up to {}", duration(practical.range_s));
        let crossover = pair.crossover_s().map(duration);
        let to = crossover.as_ref().map(|t| format!("up to {t}"));
        let until = practical.walk_until_s;
        let until = until.map_or(String::new(), |t| format!(" to {}", duration(t)));
        let from = crossover.map_or(none.clone(), |t| format!("from {t}{until}"));
        let minimum = practical.minimum;
        let floor = minimum.map_or(none, |m| format!("floor at {}", duration(m.tau_s)));
        let b = minimum.map(|m| m.deviation);
        let k = practical.walk_is_observed().then_some(pair.walk);
        let unit = |quantity: ExportQuantity| quantity.data_sheet_unit(sensor);
        let (n, to) = (Some(pair.density), to.unwrap_or_default());
        put(
            "N".to_owned(),
            white,
            unit(ExportQuantity::Density),
            n,
            ends.density,
            &to,
        );
        put(
            "B".to_owned(),
            "bias instability B",
            unit(ExportQuantity::Bias),
            b,
            ends.instability,
            &floor,
        );
        put(
            "K".to_owned(),
            walk,
            unit(ExportQuantity::Walk),
            k,
            ends.walk,
            &from,
        );
    }
    let model = &outcome.fit.composite;
    for (index, (process, label)) in model.processes.iter().zip(model.labels()).enumerate() {
        let figure = figure_of(process, &label, sensor);
        let Some(((key, name, unit), parameter, convert)) =
            figure.filter(|_| !outcome.fit.zero.contains(&index))
        else {
            continue;
        };
        let of = ParameterRef {
            process: index,
            parameter,
        };
        let mut known = intervals(outcome).iter().filter(|i| i.absent.is_none());
        let ends = known.find(|i| i.of == of).map(|i| {
            let mut ends = [i.low, i.high].map(|end| convert(end, rate_hz));
            ends.sort_by(f64::total_cmp);
            ends
        });
        let value = Some(convert(model.value(of), rate_hz));
        put(
            key,
            &format!("{label} {name}"),
            (unit, 1.0),
            value,
            ends,
            "–",
        );
    }
    figures
}

/// Key, name, unit, and what it is computed from, with the rate.
type FigureOf = (
    (String, &'static str, &'static str),
    Parameter,
    fn(f64, f64) -> f64,
);

/// The figure of data sheets that a parameter of a process is, if there is one.
pub(crate) fn figure_of(process: &Process, label: &str, sensor: Sensor) -> Option<FigureOf> {
    let [increment, ramp] = match sensor {
        Sensor::Accel => ["m/s", "m/s² per s"],
        Sensor::Gyro => ["rad", "rad/s per s"],
    };
    let time = || (format!("T_{label}"), "correlation time T", "s");
    Some(match process.kind() {
        ProcessKind::Ar1 if process.shape() > 0.0 => (time(), Parameter::Phi, |phi, rate_hz| {
            -1.0 / (phi.ln() * rate_hz)
        }),
        ProcessKind::GaussMarkov => (time(), Parameter::Beta, |beta, _| 1.0 / beta),
        // Of the increments over a sample, as IEEE 952 has it.
        ProcessKind::Quantization => (
            ("Q".to_owned(), "quantization Q", increment),
            Parameter::Q2,
            |q2, rate_hz| q2.sqrt() / rate_hz,
        ),
        ProcessKind::Drift => (
            ("R".to_owned(), "ramp", ramp),
            Parameter::Slope,
            |slope, rate_hz| slope * rate_hz,
        ),
        _ => return None,
    })
}

// The model file of a calibration.

/// The facts of a calibration for its model files.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct CalibrationNote {
    /// Seed of the bootstrap, if there was one.
    pub seed: Option<u64>,
    /// Reading and grouping of the recordings, by key: skipped start, gaps, axes, scales, pool.
    pub reading: toml::Table,
    /// The recordings or the curve, and the parameters file.
    pub inputs: Vec<Input>,
}

impl Calibration {
    /// The answer as JSON.
    pub(super) fn json(&self) -> Value {
        let fit = |o| fit_json(o, &self.outcomes, &self.settings);
        json!({
            "schema_version": 1,
            "rate_hz": self.settings.rate_hz,
            "model": self.settings.model.to_string(),
            "fits": self.outcomes.iter().map(fit).collect::<Value>(),
            "replicates": self.diagnoses,
            "turn_on": self.turn_on.iter().map(turn_on_json).collect::<Value>(),
        })
    }

    /// The model file of the fits, which are of one estimator. Channels of no group are missing in it. `curves`: BLAKE3, in
    /// hexadecimal, of the file of curves that goes beside it.
    pub(super) fn model_file(&self, curves: &str) -> ModelFile {
        let (outcomes, rate_hz) = (&self.outcomes, self.settings.rate_hz);
        let mut file = ModelFile::empty(rate_hz);
        let mut spread = Spread::default();
        for outcome in outcomes {
            let (composite, labels) = (&outcome.fit.composite, outcome.fit.composite.labels());
            let varying = outcome.inference.iter().flat_map(|i| &i.varying);
            let laws: Vec<Variation> = varying
                .filter_map(|found| {
                    let law = ParameterDistribution::Lognormal {
                        median: found.median,
                        median_ci95: Some(found.median_ci95),
                        sd: found.sd,
                        sd_ci95: Some(found.sd_ci95),
                    };
                    let of = found.of;
                    Variation::new(composite, &labels[of.process], of.parameter.name(), law).ok()
                })
                .collect();
            apply_to(&mut file, outcome);
            if let Some(reading) = &outcome.reading {
                let empty = || Box::new(ModelFile::empty(rate_hz));
                apply_to(file.reading.get_or_insert_with(empty), reading);
            }
            for channel in outcome.scope.channels() {
                spread.axes[channel.index()].clone_from(&laws);
            }
        }
        file.spread = (spread != Spread::default()).then_some(spread);
        let mut provenance = self.provenance(curves);
        let mut remarks = toml::Table::new();
        let mut turn_on = TurnOn::default();
        for found in &self.turn_on {
            let sensor = found.sensor;
            remarks.insert(sensor.name().to_owned(), turn_on_remark(found).into());
            let is_missing = |axis| file.missing.contains(&Channel { sensor, axis });
            let sigma = |sigmas: [f64; 3], axis| match is_missing(axis) {
                true => 0.0,
                false => sigmas[axis as usize],
            };
            let sigmas = found.sigmas();
            let sigmas = sigmas.map(|sigmas| Axis::ALL.map(|axis| sigma(sigmas, axis)));
            match sensor {
                Sensor::Accel => turn_on.accel_m_s2 = sigmas,
                Sensor::Gyro => turn_on.gyro_rad_s = sigmas,
            }
        }
        file.turn_on = (turn_on != TurnOn::default()).then_some(turn_on);
        if !remarks.is_empty() {
            provenance.insert("turn_on".to_owned(), remarks.into());
        }
        file.provenance = Some(provenance);
        file
    }

    fn provenance(&self, curves: &str) -> toml::Table {
        let (outcomes, settings, note) = (&self.outcomes, &self.settings, &self.note);
        let estimator = outcomes.first().map_or(Estimator::Given, |o| o.estimator);
        let is_robust = estimator.is_robust();
        let fit = |outcome: &Outcome| known(fit_record(outcome, settings));
        // TOML integers are signed; larger seeds go as text.
        let seed =
            |seed: u64| i64::try_from(seed).map_or_else(|_| json!(seed.to_string()), Into::into);
        let mut table = known(json!({
            "program": PROGRAM,
            "schema": SCHEMA,
            "estimator": estimator,
            "model": settings.model.to_string(),
            "weighting": settings.weighting.name(),
            "fit_range_s": settings.fit_range.map(|range| [range.from_s, range.to_s]),
            "seed": note.seed.map(seed),
            "efficiency": is_robust.then(|| settings.tuning.efficiency()),
            "fits": outcomes.iter().map(fit).collect::<Vec<_>>(),
            "inputs": note.inputs,
            "curves_blake3": curves,
        }));
        table.extend(note.reading.clone());
        table
    }
}
