//! The document of a calibration.

use super::charts;
use super::figures::{averages, figures, policy};
use super::fits::interval_of;
use super::words::{self, reasons, turn_on_remark};
use crate::report::comparison_table::in_order;
use crate::report::curves::{CurvesFile, FittedCurve};
use nav_sim_calibration::{
    Beginnings, Diagnosis, Outcome, Ranking, Settings, TurnOnSpread, Verdict, duration, shares,
    tau_s,
};
use nav_sim_document::{Cell, Document, Importance, Table, Tone, readable, short_names};
use nav_sim_signal::imu::{Axis, Sensor};

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
            words::verdict(&fits, self.diagnoses, self.settings),
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
            let lines = words::recording_notes(sensor, fits, self.diagnoses, settings).into_iter();
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
        notes.extend(
            words::beginnings(self.beginnings, fits).map(|line| (Importance::Remark, line)),
        );
        for outcome in fits {
            let reasons = outcome
                .ranking
                .iter()
                .flat_map(|r| reasons(r, settings.rate_hz));
            let name = words::fit_name(outcome, fits);
            let lines = reasons.chain(words::notes(outcome, settings));
            let noted = |line: String| {
                let is_detail = line.contains("no interval");
                let importance = if is_detail {
                    Importance::Detail
                } else {
                    Importance::Remark
                };
                (importance, format!("{name}: {line}"))
            };
            notes.extend(lines.map(noted));
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
            let name = words::fit_name(outcome, &fits);
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
        document.section(&format!(
            "{} · {}",
            charts::group_name(fitted),
            outcome.spec
        ));
        document.facts(&self.facts(outcome));
        document.charts(
            &charts::allan(fitted, outcome, self.diagnoses, rate_hz),
            &charts::allan_caption(),
        );
        document.chart(&charts::variance(fitted, self.diagnoses), charts::CAPTION);
        document.table(&parameters(outcome, index, rate_hz));
        if let Some(ranking) = &outcome.ranking {
            document.heading("Candidate models");
            document.table(&candidates(ranking));
        }
    }

    fn facts(&self, outcome: &Outcome) -> Vec<(&'static str, String)> {
        let fit = &outcome.fit;
        let mut facts = vec![
            ("fitted to", words::signals(outcome)),
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
            words::stem(&shown[place]).to_owned()
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
