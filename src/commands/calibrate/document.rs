//! The document of a calibration.

use super::fits::{averages, figures, interval_of, policy};
use crate::report::comparison_table::in_order;
use crate::report::curves::{CurvesFile, FittedCurve, ReplicateCurve};
use crate::report::curves::{band, curve, scale_axis, sensor_name, unit, variance_axis};
use nav_sim_calibration::{
    Beginning, Beginnings, Candidate, CommonCause, Diagnosis, Estimator, Misfit, Miss, Note,
    Outcome, ParameterInterval, Ranking, Settings, TurnOnFinding, TurnOnSpread, Undetermined,
    Verdict, WIDEST, WarmUp, duration, percent, shares, tau_s,
};
use nav_sim_document::{
    Axis as ChartAxis, Cell, Chart, Colour, Document, Importance, Mark, Panel, Series, Table, Tone,
    readable, short_names,
};
use nav_sim_signal::imu::{Axis, Channel, Sensor};

/// The fits of a calibration, all of them or those of one estimator, and what was found of the recordings.
pub(crate) struct ShownCalibration<'a> {
    /// The fits, each with its place among all of the command.
    pub outcomes: Vec<(usize, &'a Outcome)>,
    /// Their curves, in the same order.
    pub curves: CurvesFile,
    /// The recordings against one another.
    pub diagnoses: &'a [Diagnosis],
    /// Their means.
    pub turn_on: &'a [TurnOnSpread],
    /// Their beginnings.
    pub beginnings: &'a Beginnings,
    /// How all was fitted.
    pub settings: &'a Settings,
}

impl ShownCalibration<'_> {
    /// The document.
    pub(crate) fn document(&self) -> Document {
        let estimators = in_order(self.outcomes.iter().map(|(_, o)| o.estimator.name()));
        let title = format!("Stochastic calibration, {}", estimators.join(", "));
        let fits: Vec<&Outcome> = self.outcomes.iter().map(|(_, o)| *o).collect();
        let mut document = Document::new(
            &title,
            self.tone(),
            verdict(&fits, self.diagnoses, self.settings),
        );
        document.lead(if fits.len() > 2 {
            self.fits_table()
        } else {
            self.figures_table()
        });
        for (importance, note) in self.notes(&fits) {
            document.note(importance, note);
        }
        for ((index, outcome), fitted) in self.outcomes.iter().zip(&self.curves.curves) {
            self.fit(*index, outcome, fitted, &mut document);
        }
        self.recordings(&mut document);
        self.means(&mut document);
        document.checked(
            "wavelet variances of models to 1e-13 of an independent implementation, the optimum to 1e-6 of an exhaustive search",
        );
        document
    }

    fn tone(&self) -> Tone {
        let rejected = |o: &Outcome| {
            o.inference
                .as_ref()
                .and_then(|i| i.goodness)
                .is_some_and(|g| g.is_rejected())
        };
        let is_abnormal = self.diagnoses.iter().any(|d| d.verdict != Verdict::Normal);
        match () {
            () if self.outcomes.iter().any(|(_, o)| rejected(o)) => Tone::Bad,
            () if is_abnormal || self.outcomes.iter().any(|(_, o)| o.misfit().is_some()) => {
                Tone::Doubtful
            }
            () => Tone::Good,
        }
    }

    /// Remarks, the most important first.
    fn notes(&self, fits: &[&Outcome]) -> Vec<(Importance, String)> {
        let settings = self.settings;
        let mut notes: Vec<(Importance, String)> = Vec::new();
        notes.extend(
            fits.iter()
                .find_map(|o| self.too_loud(o))
                .map(|line| (Importance::Warning, line)),
        );
        for sensor in Sensor::ALL {
            let lines = recording_notes(sensor, fits, self.diagnoses, settings).into_iter();
            notes.extend(
                lines.map(|line| (Importance::Warning, format!("{}: {line}", sensor.name()))),
            );
        }
        for found in self.own_means().map(|(_, found)| found) {
            let is_stored = found.sigmas().is_some();
            let importance = if is_stored {
                Importance::Warning
            } else {
                Importance::Detail
            };
            notes.push((
                importance,
                format!("{}: {}", found.sensor.name(), turn_on_remark(found)),
            ));
        }
        notes.extend(beginnings(self.beginnings, fits).map(|line| (Importance::Remark, line)));
        for outcome in fits {
            let reasons = outcome
                .ranking
                .iter()
                .flat_map(|r| reasons(r, settings.rate_hz));
            let name = fit_name(outcome, fits);
            let noted = |importance| {
                let name = &name;
                move |line: String| (importance, format!("{name}: {line}"))
            };
            let remarks = reasons.chain(fit_notes(outcome, settings));
            notes.extend(remarks.map(noted(Importance::Remark)));
            notes.extend(without_interval(outcome).map(noted(Importance::Detail)));
        }
        notes
    }

    /// A gyroscope of more noise than any in the catalogue (0.02 to 2 deg/√h), such as one in degrees under the name of radians.
    fn too_loud(&self, outcome: &Outcome) -> Option<String> {
        const MOST_DEG_SQRT_H: f64 = 5.0;
        let is_gyro = outcome.scope.sensor == Sensor::Gyro;
        let rows = figures(outcome, self.settings.rate_hz);
        let n = rows
            .first()
            .filter(|row| is_gyro && row.name.ends_with(" N"))?
            .value
            .ok()?;
        (n > MOST_DEG_SQRT_H).then(|| {
            let n = readable(n);
            format!("gyro: N of {n} deg/sqrt(h), where catalogued units have 0.02 to 2: columns in degrees are named gyro_x_deg_s")
        })
    }

    /// A row a figure of a model.
    fn figures_table(&self) -> Table {
        let fits: Vec<&Outcome> = self.outcomes.iter().map(|(_, o)| *o).collect();
        let of_one = fits.iter().all(|outcome| outcome.recordings == 1);
        let interval = if of_one {
            "95 %, this power-on"
        } else {
            "95 %, mean of power-ons"
        };
        let mut table = Table::new([policy().as_str(), "value", interval, "averages of"]);
        for (index, outcome) in &self.outcomes {
            let name = fit_name(outcome, &fits);
            for row in figures(outcome, self.settings.rate_hz) {
                let value = match (row.value, row.source) {
                    (Ok(value), Some(source)) => {
                        Cell::number(value, &format!("/fits/{index}/parameters/{source}"))
                    }
                    (Ok(value), None) => Cell::figures(readable(value)),
                    (Err(_), _) => Cell::figures("–"),
                };
                let interval = row.value.err().map_or(row.interval, str::to_owned);
                let figure = format!("{name} {} ({})", row.name, row.unit);
                table.row([
                    figure.into(),
                    value,
                    Cell::figures(interval),
                    row.averages.into(),
                ]);
            }
        }
        table
    }

    /// A row a fit.
    fn fits_table(&self) -> Table {
        let rate_hz = self.settings.rate_hz;
        let mut table = Table::new(["fit", "N (95 %)", "B", "K", "T (s)", "fits"]);
        for (_, outcome) in &self.outcomes {
            let rows = figures(outcome, rate_hz);
            let cell = |letter: &str| {
                let row = rows
                    .iter()
                    .find(|row| row.source.is_some() && row.name.ends_with(letter));
                row.map_or_else(
                    || "–".to_owned(),
                    |row| match row.value {
                        Ok(value) => format!("{} {}", readable(value), row.unit),
                        Err(why) => why.to_owned(),
                    },
                )
            };
            let ends = rows
                .first()
                .map(|n| n.interval.as_str())
                .filter(|ends| !ends.is_empty());
            let times = outcome
                .fit
                .composite
                .processes
                .iter()
                .filter_map(|p| p.correlation_time_s(rate_hz));
            let fits = outcome.misfit().map_or_else(
                || "yes".to_owned(),
                |m| {
                    format!(
                        "no: {} at {}",
                        readable(m.worst.ratio),
                        duration(tau_s(m.worst.level, rate_hz))
                    )
                },
            );
            table.row([
                format!(
                    "{} {} {}",
                    outcome.scope.name(),
                    outcome.estimator.name(),
                    outcome.spec
                )
                .into(),
                Cell::figures(format!(
                    "{}{}",
                    cell(" N"),
                    ends.map_or(String::new(), |ends| format!(" ({ends})"))
                )),
                Cell::figures(cell(" B")),
                Cell::figures(cell(" K")),
                Cell::figures(times.map(readable).collect::<Vec<_>>().join(", ")),
                fits.into(),
            ]);
        }
        table
    }

    /// The section of a fit.
    fn fit(&self, index: usize, outcome: &Outcome, fitted: &FittedCurve, document: &mut Document) {
        let rate_hz = self.settings.rate_hz;
        document.section(&format!("{} · {}", group_name(fitted), outcome.spec));
        document.facts(&self.facts(outcome));
        document.charts(
            &allan(fitted, outcome, self.diagnoses, rate_hz),
            &allan_caption(),
        );
        document.chart(&variance(fitted, self.diagnoses), CAPTION);
        document.table(&parameters(outcome, index, rate_hz));
        if let Some(ranking) = &outcome.ranking {
            document.heading("Candidate models");
            document.table(&candidates(ranking));
        }
    }

    fn facts(&self, outcome: &Outcome) -> Vec<(&'static str, String)> {
        let fit = &outcome.fit;
        let mut facts = vec![
            ("fitted to", signals(outcome)),
            (
                "scales",
                format!(
                    "{} of {}",
                    outcome.counted_levels().len(),
                    outcome.curve.levels.len()
                ),
            ),
            (
                "objective",
                format!(
                    "{} ({})",
                    readable(fit.objective),
                    fit.termination.name().replace('_', " ")
                ),
            ),
            (
                "local minima",
                format!("{}, {} of them the best", fit.starts, fit.agreeing),
            ),
        ];
        let Some(inference) = &outcome.inference else {
            return facts;
        };
        if let Some(g) = inference.goodness {
            let (j, expected) = (readable(g.statistic), readable(g.expected));
            facts.push((
                "J-test",
                format!(
                    "J = {j}, median {expected} where the model holds, p = {:.3}",
                    g.p_value
                ),
            ));
        }
        if let Some((p, most)) = outcome.differing() {
            let by = nav_sim_calibration::percent(most.between);
            facts.push((
                "signals differ",
                format!(
                    "by {by} at {}, beyond their noise (p = {p:.3})",
                    duration(most.tau_s)
                ),
            ));
        }
        facts
    }

    /// The recordings beside one another: which are abnormal, and what they change.
    fn recordings(&self, document: &mut Document) {
        let abnormal: Vec<&Diagnosis> = self
            .diagnoses
            .iter()
            .filter(|d| d.verdict != Verdict::Normal)
            .collect();
        if abnormal.is_empty() {
            return;
        }
        let names: Vec<&str> = self.diagnoses.iter().map(|d| d.name.as_str()).collect();
        let shown = short_names(&names);
        let short = |name: &str| {
            let place = names.iter().position(|n| *n == name).unwrap_or(0);
            stem(&shown[place]).to_owned()
        };
        document.section("Abnormal recordings");
        let mut table = Table::new([
            "recording",
            "sensor",
            "finding",
            "scales",
            "x (σ)",
            "y (σ)",
            "z (σ)",
            "p",
        ]);
        let mut effects = Table::new(["without", "fit", "moves by (%)", "at scale", "σ"]);
        for d in abnormal {
            let mut row = |finding: &str, scales: String, deviations: &[(Axis, f64)], p: f64| {
                let of_axis = |axis: Axis| {
                    let own = deviations.iter().find(|(a, _)| *a == axis);
                    Cell::figures(own.map_or(String::new(), |(_, z)| format!("{z:+.1}")))
                };
                let [x, y, z] = Axis::ALL.map(of_axis);
                let p = Cell::figures(format!("{p:.4}"));
                table.row([
                    short(&d.name).into(),
                    d.sensor.name().into(),
                    finding.into(),
                    scales.into(),
                    x,
                    y,
                    z,
                    p,
                ]);
            };
            for (finding, alarm) in [("noise", &d.noise), ("outliers", &d.outliers)] {
                if let Some(a) = alarm {
                    let [first, last] = a.tau_s.map(duration);
                    let scales = if first == last {
                        first
                    } else {
                        format!("{first} – {last}")
                    };
                    row(finding, scales, &a.deviations, a.p_value);
                }
            }
            if let Some(drift) = &d.drift {
                row("drift", String::new(), &drift.deviations, drift.p_value);
            }
            for left in &d.left_out {
                effects.row([
                    short(&d.name).into(),
                    format!("{} {}", left.group, left.estimator.name()).into(),
                    Cell::figures(format!("{:+.2}", 100.0 * left.change)),
                    duration(left.tau_s).into(),
                    Cell::figures(format!("{:+.1}", left.deviations)),
                ]);
            }
        }
        document.table(&table);
        document.table(&effects);
    }

    /// The means of the fits that are shown, each with its place in the JSON of the command.
    fn own_means(&self) -> impl Iterator<Item = (usize, &TurnOnSpread)> {
        let is_own = |t: &TurnOnSpread| {
            self.outcomes
                .iter()
                .any(|(_, o)| o.estimator == t.estimator)
        };
        self.turn_on
            .iter()
            .enumerate()
            .filter(move |(_, t)| is_own(t))
    }

    /// What the recordings' means say of a turn-on bias.
    fn means(&self, document: &mut Document) {
        let mut table = Table::new([
            "axis",
            "recordings",
            "spread of the means",
            "by noise alone",
            "unit",
        ]);
        for (i, found) in self.own_means() {
            for (k, axis) in found.axes.iter().enumerate() {
                let number = |value: f64, key: &str| {
                    Cell::number(value, &format!("/turn_on/{i}/axes/{k}/{key}"))
                };
                table.row([
                    format!("{} {}", found.sensor.name(), axis.axis.name()).into(),
                    number(axis.recordings as f64, "recordings"),
                    number(axis.spread, "spread"),
                    number(axis.noise, "noise"),
                    found.sensor.unit().into(),
                ]);
            }
        }
        if !table.is_empty() {
            document.section("Turn-on bias");
            document.table(&table);
        }
    }
}

/// A row a parameter. Values and intervals stand in the JSON of `calibrate` under /fits/`index`.
fn parameters(outcome: &Outcome, index: usize, rate_hz: f64) -> Table {
    let (model, unit) = (&outcome.fit.composite, outcome.scope.sensor.unit());
    let intervals = outcome.inference.as_ref().map_or(&[][..], |i| &i.intervals);
    let (shares, labels) = (shares(model, &outcome.counted_levels()), model.labels());
    let mut table = Table::new(["parameter", "value", "95 % interval", "averages of"]);
    let mut last = None;
    for (of, value) in model.parameters() {
        let name = of.parameter.name();
        // φ is told by its distance from 1.
        let digits = |x: f64| {
            if name == "phi" {
                format!("{x:.6}")
            } else {
                readable(x)
            }
        };
        let interval = interval_of(intervals, of).map_or_else(String::new, |i| match i.absent {
            None => format!("{} … {}", digits(i.low), digits(i.high)),
            Some(_) => "not determined".to_owned(),
        });
        let source = format!("/fits/{index}/processes/{}/{name}", of.process);
        let value = if name == "phi" {
            Cell::figures(digits(value))
        } else {
            Cell::number(value, &source)
        };
        let is_first = last.replace(of.process) != Some(of.process);
        let averages = if is_first {
            averages(&shares[of.process], rate_hz)
        } else {
            String::new()
        };
        let unit = match name {
            "phi" | "theta" => String::new(),
            "beta" => " (1/s)".to_owned(),
            "slope" => format!(" ({unit} a sample)"),
            _ => format!(" (({unit})²)"),
        };
        table.row([
            format!("{} {name}{unit}", labels[of.process]).into(),
            value,
            Cell::figures(interval),
            averages.into(),
        ]);
    }
    table
}

/// Candidates of a choice that are shown.
const SHOWN: usize = 8;

/// The candidates of a choice, best first.
fn candidates(ranking: &Ranking) -> Table {
    let mut table = Table::new(["model", "WVIC", "objective", "optimism", "p", "J-test p"]);
    let p = |p: Option<f64>| Cell::figures(p.map_or(String::new(), |p| format!("{p:.3}")));
    for (i, c) in ranking
        .candidates
        .iter()
        .enumerate()
        .take(SHOWN.max(ranking.chosen + 1))
    {
        let chosen = if i == ranking.chosen { " (chosen)" } else { "" };
        let number = |x: f64| Cell::figures(format!("{x:.4}"));
        table.row([
            format!("{}{chosen}", c.spec).into(),
            number(c.wvic()),
            number(c.objective),
            number(c.optimism),
            p(c.p_value),
            p(c.j_p_value),
        ]);
    }
    table
}

// The charts of a calibration: wavelet variance and model, and what is exported on the Allan deviation.

/// What is to be seen in [`variance`].
pub(crate) const CAPTION: &str = "Wavelet variance with its 95 % band, the recordings, the model and its processes; below: data over model.";

/// What is to be seen in [`allan`].
pub(super) fn allan_caption() -> String {
    format!(
        "Allan deviation: recordings, model, and what is exported: {}. N is read at 1 s, K at 3 s, 0.664 B at the floor.",
        super::fits::policy()
    )
}

/// `Accelerometer x`, or `Gyroscope, all axes`.
pub(super) fn group_name(fitted: &FittedCurve) -> String {
    let sensor = sensor_name(&fitted.sensor);
    if fitted.axis == "all" {
        format!("{sensor}, all axes")
    } else {
        format!("{sensor} {}", fitted.axis)
    }
}

/// The wavelet variance, and what the model leaves of it.
pub(crate) fn variance(fitted: &FittedCurve, diagnoses: &[Diagnosis]) -> Chart {
    let FittedCurve {
        tau_s,
        wv,
        ci_low,
        ci_high,
        implied,
        ..
    } = fitted;
    let ratio = |values: &[f64]| -> Vec<f64> {
        values
            .iter()
            .zip(implied)
            .map(|(nu, model)| nu / model)
            .collect()
    };
    let data = |wv: &[f64], low: &[f64], high: &[f64]| {
        [
            Series::new("data, 95 %", Colour::Ink, band(tau_s, low, high)),
            Series::line("data, 95 %", Colour::Ink, curve(tau_s, wv)),
        ]
    };
    let mut upper = recordings(fitted, diagnoses, |_| true, |tau, nu| (tau, nu));
    upper.extend(processes(fitted));
    upper.extend(data(wv, ci_low, ci_high));
    upper.push(Series::line("model", Colour::REAL, curve(tau_s, implied)));
    let mut lower = data(&ratio(wv), &ratio(ci_low), &ratio(ci_high)).to_vec();
    lower.push(Series::new("model", Colour::REAL, Mark::Level(1.0)));
    let panels = vec![
        Panel {
            height: 1.4,
            ..Panel::new(variance_axis(&fitted.sensor), upper)
        },
        Panel {
            height: 0.5,
            ..Panel::new(ChartAxis::log("data / model").including(0.8, 1.25), lower)
        },
    ];
    let title = format!(
        "Wavelet variance: {}, {}",
        group_name(fitted),
        fitted.estimator.to_uppercase()
    );
    Chart::new(&title, scale_axis(), panels).in_group("scales")
}

/// Allan deviation at a scale: of averages half as long, √(2 nu).
fn deviation(tau_s: f64, nu: f64) -> (f64, f64) {
    (0.5 * tau_s, (2.0 * nu).sqrt())
}

/// The Allan deviation of each axis with N, B and K, where they are read off it.
pub(super) fn allan(
    fitted: &FittedCurve,
    outcome: &Outcome,
    diagnoses: &[Diagnosis],
    rate_hz: f64,
) -> Vec<Chart> {
    let mut axes: Vec<&str> = fitted
        .replicates
        .iter()
        .filter_map(|r| r.axis.as_deref())
        .collect();
    axes.sort_unstable();
    axes.dedup();
    let axes = if fitted.axis == "all" {
        axes
    } else {
        vec![fitted.axis.as_str()]
    };
    let model: Vec<(f64, f64)> = fitted
        .tau_s
        .iter()
        .zip(&fitted.implied)
        .map(|(t, nu)| deviation(*t, *nu))
        .collect();
    let chart = |axis: &&str| {
        let mut series = recordings(
            fitted,
            diagnoses,
            |r| r.axis.as_deref().is_none_or(|own| own == *axis),
            deviation,
        );
        if series.is_empty() {
            let data = fitted
                .tau_s
                .iter()
                .zip(&fitted.wv)
                .map(|(t, nu)| deviation(*t, *nu));
            series.push(Series::line("data", Colour::Ink, data.collect()));
        }
        series.push(Series::line("model", Colour::REAL, model.clone()));
        series.extend(exported(outcome, &model, rate_hz));
        let y = ChartAxis::log(&format!("Allan deviation ({})", unit(&fitted.sensor)));
        let title = format!("{} {axis}", sensor_name(&fitted.sensor));
        Chart::new(
            &title,
            ChartAxis::log("averaging time (s)"),
            vec![Panel {
                height: 1.2,
                ..Panel::new(y, series)
            }],
        )
    };
    let charts: Vec<Chart> = axes.iter().map(chart).collect();
    if charts.len() > 1 {
        charts.into_iter().map(Chart::small).collect()
    } else {
        charts
    }
}

/// Lines of N and K over the times of a model, with the points where they are read, and the floor.
fn exported(outcome: &Outcome, model: &[(f64, f64)], rate_hz: f64) -> Vec<Series> {
    let Some(practical) = outcome.practical(rate_hz) else {
        return Vec::new();
    };
    let pair = practical.parameters.walk;
    let lowest = model.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let highest = model.iter().map(|p| p.1).fold(0.0, f64::max);
    // Beyond the model's own values the lines would only stretch the axis.
    let over = |line: &dyn Fn(f64) -> f64| {
        let points = model.iter().map(|(t, _)| (*t, line(*t)));
        points
            .filter(|(_, y)| *y > 0.3 * lowest && *y < 1.5 * highest)
            .collect::<Vec<_>>()
    };
    let mut series = Vec::new();
    if pair.density > 0.0 {
        series.push(Series::dashed(
            "N/√τ",
            N,
            over(&|t| pair.density / t.sqrt()),
        ));
        series.push(Series::new("N", N, Mark::Reading(1.0, pair.density)));
    }
    if practical.walk_is_observed() {
        series.push(Series::dashed(
            "K√(τ/3)",
            K,
            over(&|t| pair.walk * (t / 3.0).sqrt()),
        ));
        series.push(Series::new("K", K, Mark::Reading(3.0, pair.walk)));
    }
    if let Some(minimum) = practical.parameters.minimum {
        series.push(Series::new(
            "0.664 B",
            B,
            Mark::Reading(minimum.tau_s, minimum.deviation),
        ));
    }
    series
}

const N: Colour = Colour::Hue(0);
const K: Colour = Colour::Hue(2);
const B: Colour = Colour::Hue(3);

/// Hues of processes: those that neither model nor recordings have.
const PROCESSES: [usize; 5] = [0, 2, 3, 4, 5];
/// Hues of abnormal recordings.
const ABNORMAL: [usize; 2] = [6, 7];

/// Thin lines, grey but for the abnormal ones.
fn recordings(
    fitted: &FittedCurve,
    diagnoses: &[Diagnosis],
    is_shown: impl Fn(&ReplicateCurve) -> bool,
    point: impl Fn(f64, f64) -> (f64, f64),
) -> Vec<Series> {
    let is_abnormal = |file: &str| {
        let of_file = |d: &&Diagnosis| d.name == file && d.sensor.name() == fitted.sensor;
        diagnoses
            .iter()
            .find(of_file)
            .is_some_and(|d| d.verdict != Verdict::Normal)
    };
    if fitted.replicates.len() < 2 {
        return Vec::new();
    }
    let names = short_names(
        &fitted
            .replicates
            .iter()
            .map(|r| r.file.as_str())
            .collect::<Vec<_>>(),
    );
    let mut abnormal: Vec<&str> = Vec::new();
    let mut all = Vec::new();
    for (replicate, name) in fitted.replicates.iter().zip(&names) {
        let file = replicate.file.as_str();
        if is_abnormal(file) && !abnormal.contains(&file) {
            abnormal.push(file);
        }
        if !is_shown(replicate) {
            continue;
        }
        let points = fitted
            .tau_s
            .iter()
            .zip(&replicate.wv)
            .map(|(t, nu)| point(*t, *nu))
            .collect();
        all.push(match abnormal.iter().position(|other| *other == file) {
            None => Series::thin("recordings", Colour::Soft, points),
            Some(k) => {
                let hue = Colour::Hue(ABNORMAL[k % ABNORMAL.len()]);
                Series::line(&format!("{} (abnormal)", stem(name)), hue, points)
            }
        });
    }
    all
}

fn processes(fitted: &FittedCurve) -> Vec<Series> {
    let known = fitted
        .processes
        .iter()
        .filter(|(_, wv)| wv.iter().any(|nu| *nu > 0.0));
    let line = |(k, (name, wv)): (usize, (&String, &Vec<f64>))| {
        Series::dashed(
            name,
            Colour::Hue(PROCESSES[k % PROCESSES.len()]),
            curve(&fitted.tau_s, wv),
        )
    };
    known.enumerate().map(line).collect()
}

// A calibration in words: the verdict on models and recordings, the remarks.

/// Recordings that are named in a line.
const NAMED: usize = 4;

/// The verdict: a line for each model (of more than two, for each sensor), and one for the recordings.
pub(super) fn verdict(
    outcomes: &[&Outcome],
    diagnoses: &[Diagnosis],
    settings: &Settings,
) -> Vec<String> {
    let mut lines: Vec<String> = match outcomes.len() {
        0..=2 => outcomes
            .iter()
            .map(|o| fit_line(o, &fit_name(o, outcomes), settings.rate_hz))
            .collect(),
        _ => Sensor::ALL
            .into_iter()
            .filter_map(|sensor| of_sensor(sensor, outcomes, settings.rate_hz))
            .collect(),
    };
    lines.extend(recordings_line(outcomes, diagnoses));
    lines
}

/// `accel: N1 does not fit: data/model 0.33 at 0.02 s (not fitted), 1.26 at 1.28 s; 6 of 16 scales off (all together: p = 0.005)`
fn fit_line(outcome: &Outcome, name: &str, rate_hz: f64) -> String {
    let (spec, departure) = (&outcome.spec, outcome.departure());
    let ratio = |miss: Miss| {
        let left_out = if miss.is_fitted { "" } else { " (not fitted)" };
        format!(
            "{} at {}{left_out}",
            readable(miss.ratio),
            duration(tau_s(miss.level, rate_hz))
        )
    };
    let test = outcome.inference.as_ref().and_then(|i| i.goodness);
    let p = |of: &str| test.map_or(String::new(), |g| format!(" ({of}p = {:.3})", g.p_value));
    if let Some(Misfit { worst, .. }) = outcome.misfit() {
        let fitted = departure.worst().filter(|miss| miss.level != worst.level);
        let ratios: Vec<String> = [Some(worst), fitted]
            .into_iter()
            .flatten()
            .map(ratio)
            .collect();
        let (missed, scales) = (departure.missed.len(), departure.scales);
        return format!(
            "{name}: {spec} does not fit: data/model {}; {missed} of {scales} scales off{}",
            ratios.join(", "),
            p("all together: ")
        );
    }
    let off = departure.furthest.map_or(String::new(), |m| {
        format!(
            ", within {} at all scales known to 10 %",
            percent((m.ratio - 1.0).abs())
        )
    });
    let known = departure.known_to.map_or(String::new(), |level| {
        format!(" (up to {})", duration(tau_s(level, rate_hz)))
    });
    let left_out = departure.left_out.map_or(String::new(), |miss| {
        format!("; data/model {}", ratio(miss))
    });
    format!("{name}: {spec} fits{}{off}{known}{left_out}", p(""))
}

/// Whether the models of a sensor fit, in a line; none without one.
fn of_sensor(sensor: Sensor, outcomes: &[&Outcome], rate_hz: f64) -> Option<String> {
    let own: Vec<&&Outcome> = outcomes
        .iter()
        .filter(|o| o.scope.sensor == sensor)
        .collect();
    let misfits: Vec<(Misfit, &&Outcome)> =
        own.iter().filter_map(|o| Some((o.misfit()?, *o))).collect();
    let size = |m: &Misfit| m.worst.ratio.ln().abs();
    let worst = misfits
        .iter()
        .max_by(|a, b| size(&a.0).total_cmp(&size(&b.0)));
    let worst = worst.map_or(String::new(), |(m, o)| {
        let (ratio, at) = (
            readable(m.worst.ratio),
            duration(tau_s(m.worst.level, rate_hz)),
        );
        format!(
            "; worst data/model {ratio} at {at} ({} {})",
            o.scope.name(),
            o.estimator.name()
        )
    });
    let fitting = own.len() - misfits.len();
    (!own.is_empty()).then(|| {
        format!(
            "{}: {fitting} of {} models fit{worst}",
            sensor.name(),
            own.len()
        )
    })
}

/// `2 of 6 recordings are abnormal: run4 (accel outliers), run5 (accel noise, gyro noise)`; none of a single recording.
fn recordings_line(outcomes: &[&Outcome], diagnoses: &[Diagnosis]) -> Option<String> {
    let names = in_order(diagnoses.iter().map(|d| d.name.as_str()));
    let count = names.len();
    if count == 0 {
        return None;
    }
    if diagnoses.iter().all(|d| d.scores.is_empty()) {
        return Some(format!(
            "{count} recordings: too few to name an abnormal one (4 are needed)"
        ));
    }
    let shown = short_names(&names);
    let mut abnormal: Vec<String> = Vec::new();
    for (name, shown) in names.iter().zip(&shown) {
        let own = diagnoses
            .iter()
            .filter(|d| d.name == *name && d.verdict != Verdict::Normal);
        let findings: Vec<String> = own
            .map(|d| format!("{} {}", d.sensor.name(), findings(d).join(" and ")))
            .collect();
        if !findings.is_empty() {
            abnormal.push(format!("{} ({})", stem(shown), findings.join(", ")));
        }
    }
    if abnormal.is_empty() {
        let differ = outcomes.iter().find_map(|o| o.differing());
        let differ = differ.map_or(String::new(), |(p, _)| {
            format!(", but they differ beyond their noise (p = {p:.3})")
        });
        return Some(format!("{count} recordings, none abnormal{differ}"));
    }
    let more = abnormal.len().saturating_sub(NAMED);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    let named = &abnormal[..abnormal.len().min(NAMED)];
    Some(format!(
        "{} of {count} recordings are abnormal: {}{more}",
        abnormal.len(),
        named.join(", ")
    ))
}

/// `run4` of `run4.csv.gz`.
pub(crate) fn stem(name: &str) -> &str {
    let end = name.rfind('/').map_or(0, |slash| slash + 1);
    name[end..]
        .find('.')
        .filter(|dot| *dot > 0)
        .map_or(name, |dot| &name[..end + dot])
}

/// What a recording is abnormal by.
fn findings(diagnosis: &Diagnosis) -> Vec<&'static str> {
    let found = [
        diagnosis.noise.as_ref().map(|_| "noise"),
        diagnosis.outliers.as_ref().map(|_| "outliers"),
        diagnosis.drift.as_ref().map(|_| "drift"),
    ];
    found.into_iter().flatten().collect()
}

/// Relative change of a wavelet variance by a warm-up that is told where no interval says what matters.
const NOTABLE: f64 = 0.05;
/// Beginnings that are named in a line.
const BEGINNINGS: usize = 2;

/// Beginnings that are left out, or that change a wavelet variance by more than the parameters of its sensor are known to.
pub(super) fn beginnings(found: &Beginnings, outcomes: &[&Outcome]) -> Option<String> {
    let known_to = |sensor: Sensor| {
        let fits = outcomes
            .iter()
            .filter(|o| o.scope.sensor == sensor)
            .filter_map(|o| o.inference.as_ref());
        let amplitudes = fits
            .flat_map(|i| &i.intervals)
            .filter(|i| !i.of.parameter.is_shape() && i.low > 0.0);
        let widths = amplitudes.map(|i| 0.5 * (i.high / i.low).ln());
        widths
            .filter(|w| w.is_finite())
            .min_by(f64::total_cmp)
            .unwrap_or(NOTABLE)
    };
    let matters = |b: &&Beginning| {
        let changes = |(channel, w): &(Channel, WarmUp)| {
            w.change
                .is_none_or(|c| c.ratio.ln().abs() > known_to(channel.sensor))
        };
        found.left_out || b.signals.iter().any(changes)
    };
    let told: Vec<&Beginning> = found.all.iter().filter(matters).collect();
    let names: Vec<&str> = told.iter().map(|b| b.recording.as_str()).collect();
    let line = |(b, name): (&&Beginning, &String)| {
        let change = b
            .surest()
            .and_then(|(channel, w)| Some((channel, w.change?)));
        let change = change.map_or(String::new(), |(channel, c)| {
            format!(" ({channel} {:+.0} %)", 100.0 * (c.ratio - 1.0))
        });
        match b.skip_s {
            Some(s) if found.left_out => format!("{} {s} s", stem(name)),
            Some(s) => format!("{} --skip-s {s}{change}", stem(name)),
            None => format!("{} never settles", stem(name)),
        }
    };
    let lines: Vec<String> = told
        .iter()
        .zip(short_names(&names).iter())
        .map(line)
        .take(BEGINNINGS)
        .collect();
    let more = told.len().saturating_sub(BEGINNINGS);
    let more = if more > 0 {
        format!(", {more} more")
    } else {
        String::new()
    };
    let head = if found.left_out {
        "left out at the beginning"
    } else {
        "not stationary at the beginning"
    };
    (!told.is_empty()).then(|| format!("{head}: {}{more}", lines.join(", ")))
}

/// `accel.x`, with the estimator where there are several.
pub(super) fn fit_name(outcome: &Outcome, outcomes: &[&Outcome]) -> String {
    match outcomes.iter().filter(|o| o.scope == outcome.scope).count() {
        1 => outcome.scope.name(),
        _ => format!("{} {}", outcome.scope.name(), outcome.estimator.name()),
    }
}

/// The remarks on a fit.
fn fit_notes(outcome: &Outcome, settings: &Settings) -> impl Iterator<Item = String> {
    let notes = outcome.notes(settings).into_iter();
    notes.map(|note| note_line(&note, outcome))
}

/// The remarks on a fit, and why parameters have no interval.
pub(crate) fn all_notes(outcome: &Outcome, settings: &Settings) -> Vec<String> {
    fit_notes(outcome, settings)
        .chain(without_interval(outcome))
        .collect()
}

/// Why parameters have no interval.
fn without_interval(outcome: &Outcome) -> impl Iterator<Item = String> {
    let labels = outcome.fit.composite.labels();
    let intervals = outcome.inference.iter().flat_map(|i| &i.intervals);
    intervals.filter_map(move |i| undetermined(i, &labels))
}

/// A remark on a fit.
fn note_line(note: &Note, outcome: &Outcome) -> String {
    let labels = outcome.fit.composite.labels();
    let named = |of| outcome.fit.composite.name_of(of);
    match note {
        Note::AxesDiffer => outcome.axes_differ.map_or_else(String::new, |a| {
            let (ratio, largest, smallest) = (readable(a.ratio), a.largest.name(), a.smallest.name());
            format!("axes differ: {largest} has up to {ratio} times the wavelet variance of {smallest}; --pool axes fits each")
        }),
        Note::LeftOut([first, last]) => format!(
            "scales {} to {} are not fitted: too many outliers",
            duration(*first),
            duration(*last)
        ),
        Note::Indistinct => {
            let simpler = outcome.inference.as_ref().and_then(|i| i.indistinct.as_ref());
            simpler.map_or_else(String::new, |i| {
                format!("{} describes the curve as well (p = {:.2})", i.spec, i.p_value)
            })
        }
        Note::Wide(of, Some(factor)) => format!("{} is known to a factor of {} only", named(*of), readable(*factor)),
        Note::Wide(of, None) => format!("{} may be zero", named(*of)),
        Note::Zero(process) => format!("{} is zero: not seen in these data", labels[*process]),
        Note::LikeWhite(process, time_s) => {
            format!("{}: correlation time {} is below a sample, as of white noise", labels[*process], duration(*time_s))
        }
        Note::LikeWalk(process, time_s, longest_s) => format!(
            "{}: correlation time {} is not identifiable from scales up to {}",
            labels[*process],
            duration(*time_s),
            duration(*longest_s)
        ),
    }
}

/// Why a parameter of a model with processes of these labels has no interval, if it has none.
fn undetermined(interval: &ParameterInterval, labels: &[String]) -> Option<String> {
    let process = &labels[interval.of.process];
    let why = match interval.absent.as_ref()? {
        Undetermined::Zero => format!("{process} is zero"),
        Undetermined::Vanishes => format!(
            "{process} is zero in {} of the draws",
            percent(interval.lost)
        ),
        Undetermined::OneSided => "the draws lie to one side of the estimate".to_owned(),
        Undetermined::BeyondSearch => "any correlation time beyond the scales fits".to_owned(),
        Undetermined::Open => format!("the draws differ by more than a factor of {WIDEST}"),
        Undetermined::Indistinct(alike) => {
            let alike: Vec<&str> = alike.iter().map(|i| labels[*i].as_str()).collect();
            format!("the data do not need both {}", alike.join(" and "))
        }
    };
    Some(format!(
        "{process} {}: no interval: {why}",
        interval.of.parameter.name()
    ))
}

/// Remarks on the recordings of a sensor: on those that are abnormal, on what all have in common.
pub(super) fn recording_notes(
    sensor: Sensor,
    outcomes: &[&Outcome],
    diagnoses: &[Diagnosis],
    settings: &Settings,
) -> Vec<String> {
    let own: Vec<&Diagnosis> = diagnoses.iter().filter(|d| d.sensor == sensor).collect();
    let Some(first) = own.first() else {
        return Vec::new();
    };
    let mut notes = Vec::new();
    let abnormal = own.iter().filter(|d| d.verdict == Verdict::Noise).count();
    if 2 * abnormal >= own.len() {
        notes.push(
            "half of the recordings or more are abnormal: there is no majority to trust".to_owned(),
        );
    } else if abnormal > 0 {
        notes.extend(trim_note(sensor, abnormal, outcomes, settings));
    }
    let ends = |tau_s: &[f64]| {
        format!(
            "{} to {}",
            duration(tau_s[0]),
            duration(tau_s[tau_s.len() - 1])
        )
    };
    for found in &first.common {
        let from_to = || ends(&found.tau_s);
        let size = percent(found.size);
        notes.push(match found.cause {
            CommonCause::Outliers => format!(
                "outliers in most recordings: they add up to {size} to the wavelet variance, from {}; awv has them",
                from_to()
            ),
            CommonCause::GaussianQuantization => format!(
                "QN is Gaussian from {}: robust estimators read it up to {size} too low; use awv",
                from_to()
            ),
            CommonCause::CoarseSteps => format!(
                "quantisation steps are as large as the noise from {}: without outliers use awv",
                from_to()
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

/// Whether the estimators leave so many abnormal recordings out; none where DR-AWV ran and does.
fn trim_note(
    sensor: Sensor,
    abnormal: usize,
    outcomes: &[&Outcome],
    settings: &Settings,
) -> Option<String> {
    let own = outcomes
        .iter()
        .filter(|o| o.scope.sensor == sensor && o.recordings > 0);
    let fit = own.min_by_key(|o| o.replicates)?;
    // Pooled, a recording has a signal for each axis.
    let needed = abnormal * fit.replicates.div_ceil(fit.recordings);
    if !settings.estimators.contains(&Estimator::DrAwv) {
        return Some(
            "the model includes the abnormal recordings: --estimator dr-awv leaves them out"
                .to_owned(),
        );
    }
    let trim = settings.trim.count(fit.replicates);
    (trim < needed).then(|| {
        format!("a trim of {trim} does not leave out the abnormal recordings: --trim {needed}")
    })
}

/// What follows from the means of one sensor, without its name.
pub(crate) fn turn_on_remark(found: &TurnOnSpread) -> String {
    let unit = found.sensor.unit();
    let spread = format!("{} {unit}", readable(found.spread()));
    match found.finding {
        TurnOnFinding::Seen => format!(
            "turn-on bias {spread} ± {:.0} % from the means of {} recordings, stored as [turn_on]",
            100.0 * found.relative_error(),
            found.recordings()
        ),
        TurnOnFinding::WithinNoise => {
            format!("no turn-on bias seen: the recordings' means scatter by {spread}")
        }
        TurnOnFinding::Moved => {
            format!("no turn-on bias stored: means differ by {spread}, not one mounting")
        }
        TurnOnFinding::Removed => {
            "no turn-on bias: the recordings' means were removed before".to_owned()
        }
    }
}

/// The reasons of a choice.
pub(crate) fn reasons(ranking: &Ranking, rate_hz: f64) -> Vec<String> {
    let Ranking {
        candidates,
        chosen,
        too_simple,
        ..
    } = ranking;
    let (best, taken) = (&candidates[0], &candidates[*chosen]);
    let wvic = |c: &Candidate| format!("{} {:.4}", c.spec, c.wvic());
    let mut lines = vec![match taken.p_value {
        None if taken.spec == best.spec => {
            format!(
                "{} has the least WVIC, nothing simpler fits as well",
                best.spec
            )
        }
        None => format!(
            "{} has the least WVIC that the J-test accepts ({}, {})",
            taken.spec,
            wvic(taken),
            wvic(best)
        ),
        Some(p) => format!(
            "{} fits as well as the least WVIC (p = {p:.2}; {}, {})",
            taken.spec,
            wvic(taken),
            wvic(best)
        ),
    }];
    let rejected = candidates
        .iter()
        .filter(|c| c.spec != taken.spec && c.is_rejected());
    lines.extend(rejected.map(|c| {
        format!(
            "the J-test rejects {} (p = {:.3})",
            c.spec,
            c.j_p_value.unwrap_or(f64::NAN)
        )
    }));
    if taken.is_rejected() {
        lines.push("the J-test rejects every candidate".to_owned());
    }
    lines.extend(too_simple.iter().map(|simple| {
        let (share, at) = (100.0 * simple.share, duration(tau_s(simple.level, rate_hz)));
        format!(
            "{} is too simple (p ≤ {:.3}): {share:.0} % of the difference is at {at}",
            simple.spec, simple.p_value
        )
    }));
    lines
}

/// What a fit is of: `6 recordings × 3 axes`.
pub(super) fn signals(outcome: &Outcome) -> String {
    let recordings = match outcome.recordings {
        0 => return "a curve".to_owned(),
        1 => "1 recording".to_owned(),
        count => format!("{count} recordings"),
    };
    match outcome.replicates.checked_div(outcome.recordings) {
        Some(axes) if axes > 1 && axes * outcome.recordings == outcome.replicates => {
            format!("{recordings} × {axes} axes")
        }
        _ => recordings,
    }
}
