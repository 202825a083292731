//! What a limit needs of an IMU, and what a given one makes of it, on one screen and as JSON.

mod given;

pub(crate) use given::{Bridged, GivenImu, Longest, parts_in_words, what_decides};

use super::beyond_linear::{BeyondLinear, CONFIRM};
use super::markdown_table;
use super::number::{percent, readable, seconds, window};
use nav_sim_navigation::require::{Answer, IMU_PARAMETERS, ImuParameters, IsoDrift, Limit, Quantity, Worst};
use nav_sim_navigation::sensors::outage::Outage;
use serde_json::{Value, json};

/// Lengths of an outage in the table of units (s).
pub(crate) const CURVE_S: [u32; 7] = [1, 3, 10, 30, 60, 120, 300];
/// Longest outage that is looked at (s).
pub(crate) const LONGEST_S: f64 = 600.0;

/// The IMU that a limit needs.
#[derive(Debug, Clone)]
pub(crate) struct NeededImu {
    /// With equal shares.
    pub imu: ImuParameters,
    /// The shares at the limit, and that of GNSS and start.
    pub shares: [f64; IMU_PARAMETERS + 1],
    /// The hardest limit, and where.
    pub worst: Worst,
    /// What each intensity may be if there were no other.
    pub alone: [Answer; IMU_PARAMETERS],
    /// What each may be if the others are ten times better.
    pub others_better: [Answer; IMU_PARAMETERS],
    /// The curve of equal drift.
    pub iso_drift: Option<IsoDrift>,
    /// Turn-on biases that it has: accelerometer (m/s²), gyroscope (rad/s).
    pub turn_on: [f64; 2],
    /// Where the answer is beyond linear theory.
    pub beyond_linear: Option<BeyondLinear>,
}

fn points_json(curve: &[Option<f64>; CURVE_S.len()]) -> Vec<Value> {
    CURVE_S.iter().zip(curve).map(|(s, x)| json!({ "outage_s": s, "value": x })).collect()
}

/// A unit of a catalogue.
#[derive(Debug, Clone)]
pub(crate) struct RankedUnit {
    /// Its name.
    pub name: String,
    /// Figures that its datasheet does not state: they count as zero.
    pub not_stated: Vec<String>,
    /// The hardest limit for the outage asked for.
    pub worst: Worst,
    /// The quantity of the first limit, at its worst place, after [`CURVE_S`]; none where the trajectory is too short.
    pub curve: [Option<f64>; CURVE_S.len()],
    /// The longest outage within the limits.
    pub longest: Longest,
    /// Where its figure for the outage asked for is beyond linear theory.
    pub beyond_linear: Option<BeyondLinear>,
}

impl RankedUnit {
    /// Whether its errors are within the limits, as far as its figures are stated.
    pub(crate) fn is_within(&self) -> bool {
        self.worst.margin() >= 0.0
    }

    /// Whether it keeps the limits, by figures that are all stated.
    pub(crate) fn is_met(&self) -> bool {
        self.is_within() && self.not_stated.is_empty()
    }
}

/// What was asked, and where.
#[derive(Debug, Clone)]
pub(crate) struct Question {
    /// The limits.
    pub limits: Vec<Limit>,
    /// The places of the outage.
    pub outages: Vec<Outage>,
}

impl Question {
    /// `p95_m ≤ 5 after an outage of 60 s (from 300 s on)`, `(the worst of 541 starts tried, 300 to 840 s)`
    pub(crate) fn in_words(&self) -> String {
        let first = self.outages[0];
        let worst = if self.outages.len() > 1 { "the worst of " } else { "" };
        let length = seconds(first.end_s - first.start_s);
        format!("{} after an outage of {length} s ({worst}{})", self.limits_in_words(), self.starts())
    }

    /// Where the outage was tried: `541 starts tried, 300 to 840 s`, or `from 300 s on`.
    fn starts(&self) -> String {
        let [first, last] = [self.outages.first(), self.outages.last()].map(|o| o.map_or(0.0, |o| o.start_s));
        if last > first {
            format!("{} starts tried, {} to {} s", self.outages.len(), seconds(first), seconds(last))
        } else {
            format!("from {} s on", seconds(first))
        }
    }

    /// The quantity that curves of units show: one for all, that of the first limit.
    pub(crate) fn curve_of(&self) -> Quantity {
        self.limits[0].quantity
    }

    fn limits_in_words(&self) -> String {
        let limit = |l: &Limit| format!("{} ≤ {}", l.quantity.name(), readable(l.most));
        self.limits.iter().map(limit).collect::<Vec<_>>().join(", ")
    }

    fn json(&self) -> Value {
        let limit = |l: &Limit| json!({ "quantity": l.quantity.name(), "most": l.most });
        let outage = |o: &Outage| json!({ "start_s": o.start_s, "end_s": o.end_s });
        json!({
            "limits": self.limits.iter().map(limit).collect::<Vec<_>>(),
            "outages": self.outages.iter().map(outage).collect::<Vec<_>>(),
        })
    }

    fn worst(&self, worst: &Worst) -> String {
        let outage = self.outages.get(worst.place).unwrap_or(&self.outages[0]);
        format!(
            "{} {} at the end of the outage {}",
            worst.limit.quantity.name(),
            readable(worst.value),
            window(outage.start_s, outage.end_s)
        )
    }
}

/// A quantity and its unit, for axes and heads.
pub(crate) const fn quantity_in_words(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::P50 => "horizontal error, median (m)",
        Quantity::P95 => "horizontal error, 95 % quantile (m)",
        Quantity::Rmse => "horizontal error, RMSE (m)",
        Quantity::Angle(0) => "roll, RMSE (°)",
        Quantity::Angle(1) => "pitch, RMSE (°)",
        Quantity::Angle(_) => "yaw, RMSE (°)",
    }
}

fn answer(which: usize, found: &Answer) -> String {
    match found {
        Answer::AtMost(value) => readable(ImuParameters::in_datasheets(which, *value)),
        Answer::Any => "any".to_owned(),
        Answer::Never => "–".to_owned(),
    }
}

fn answer_json(which: usize, found: &Answer) -> Value {
    match found {
        Answer::AtMost(value) => json!(ImuParameters::in_datasheets(which, *value)),
        Answer::Any => json!("any"),
        Answer::Never => Value::Null,
    }
}

impl NeededImu {
    /// The turn-on biases that the answer takes for granted.
    pub(crate) fn turn_on_in_words(&self) -> String {
        if self.turn_on == [0.0; 2] {
            return "without turn-on bias ([imu] of --scenario states one)".to_owned();
        }
        let [accel, gyro] = self.turn_on.map(readable);
        format!("with turn-on biases of {accel} m/s² (accel) and {gyro} rad/s (gyro)")
    }

    /// What is needed, in a sentence.
    pub(crate) fn verdict(&self, question: &Question) -> String {
        let (from_s, to_s) = self.imu.floor_s();
        format!(
            "needed for {}: an IMU {}, as allocated below (bias instability: the floor of the Allan deviation, here from {} s \
             to {} s); with it {}; GNSS and the start take {} of the variance there{}",
            question.in_words(),
            self.turn_on_in_words(),
            readable(from_s),
            readable(to_s),
            question.worst(&self.worst),
            percent(self.shares[IMU_PARAMETERS]),
            BeyondLinear::line(self.beyond_linear.as_ref())
        )
    }

    /// The verdict, the figures, and the curve of equal drift if it was asked for.
    pub(crate) fn text(&self, question: &Question) -> String {
        let head = ["figure, at most", "allocated", "share", "if alone", "others 10 × better"];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        for i in 0..IMU_PARAMETERS {
            rows.push(vec![
                ImuParameters::NAMES[i].to_owned(),
                answer(i, &Answer::AtMost(self.imu.values[i])),
                percent(self.shares[i]),
                answer(i, &self.alone[i]),
                answer(i, &self.others_better[i]),
            ]);
        }
        let mut text = format!("{}\n\n{}", self.verdict(question), markdown_table(&rows));
        if let Some(curve) = &self.iso_drift {
            let mut rows = vec![vec![ImuParameters::NAMES[3].to_owned(), ImuParameters::NAMES[0].to_owned()]];
            let row = |(bias, walk): &(f64, Answer)| vec![answer(3, &Answer::AtMost(*bias)), answer(0, walk)];
            rows.extend(curve.points.iter().map(row));
            text += &format!("\n\n{}:\n\n{}", self.iso_drift_in_words(), markdown_table(&rows));
        }
        text
    }

    /// Where the curve of equal drift holds.
    pub(crate) fn iso_drift_in_words(&self) -> String {
        let beside = |i: usize| {
            let value = readable(ImuParameters::in_datasheets(i, self.imu.values[i]));
            format!("{} {value}", ImuParameters::NAMES[i])
        };
        format!("equal drift beside {} and {}, as allocated", beside(1), beside(2))
    }

    /// All of it.
    pub(crate) fn json(&self, question: &Question) -> String {
        let figure = |i: usize| {
            json!({
                "figure": ImuParameters::NAMES[i],
                "allocated": ImuParameters::in_datasheets(i, self.imu.values[i]),
                "share": self.shares[i],
                "alone": answer_json(i, &self.alone[i]),
                "others_10_times_better": answer_json(i, &self.others_better[i]),
            })
        };
        let point = |(bias, walk): &(f64, Answer)| {
            json!([ImuParameters::in_datasheets(3, *bias), answer_json(0, walk)])
        };
        super::json(&json!({
            "schema_version": 1,
            "question": question.json(),
            "t_corr_s": self.imu.t_corr_s,
            "turn_on_bias": { "accel_m_s2": self.turn_on[0], "gyro_rad_s": self.turn_on[1] },
            "figures": (0..IMU_PARAMETERS).map(figure).collect::<Vec<_>>(),
            "share_of_gnss_and_start": self.shares[IMU_PARAMETERS],
            "place": self.worst.place,
            "beyond_linear": self.beyond_linear,
            "iso_drift": self.iso_drift.as_ref().map(|c| c.points.iter().map(point).collect::<Vec<_>>()),
        }))
    }
}

/// What the columns of a ranking hold.
pub(crate) fn legend(question: &Question) -> String {
    let (of, to_s) = (quantity_in_words(question.curve_of()), CURVE_S[CURVE_S.len() - 1]);
    let first = format!("1 s … {to_s} s: {of}, after an outage of so long.");
    format!(
        "{first}\nbridges: the longest outage within the limits, from the same starts.\n{}",
        RULE.join("\n")
    )
}

/// What a ranking takes for granted.
pub(crate) const RULE: [&str; 2] = [
    "not stated: of both sensors where none is named. Turn-on bias is the repeatability from one",
    "switching-on to the next; an initial tolerance of the zero offset counts as removed before use.",
];

/// `bias, accel turn-on`: figures that both sensors lack are named once.
pub(crate) fn stated_in_words(not_stated: &[String]) -> String {
    let mut words = not_stated.join(", ").replace('_', "-");
    for figure in ["noise", "bias", "turn-on"] {
        words = words.replace(&format!("accel {figure}, gyro {figure}"), figure);
    }
    words
}

/// The units of a catalogue, the best first.
pub(crate) fn catalogue_rows(units: &[RankedUnit]) -> Vec<Vec<String>> {
    // a line of a terminal has room for short heads only
    let mut head = vec!["unit".to_owned(), "limit".to_owned(), "bridges".to_owned()];
    head.extend(CURVE_S.iter().map(|s| format!("{s} s")));
    head.push("not stated".to_owned());
    let row = |unit: &RankedUnit| {
        let met = match (unit.is_met(), unit.is_within()) {
            (true, _) => "met",
            (false, true) => "open",
            (false, false) => "not met",
        };
        let mut row = vec![unit.name.clone(), met.to_owned(), unit.longest.in_short()];
        row.extend(unit.curve.iter().map(|x| x.map_or_else(|| "–".to_owned(), readable)));
        row.push(stated_in_words(&unit.not_stated));
        row
    };
    std::iter::once(head).chain(units.iter().map(row)).collect()
}

/// The units whose figures for the outage asked for are beyond linear theory, in a line.
pub(crate) fn catalogue_beyond_linear(units: &[RankedUnit]) -> Option<String> {
    let beyond = units.iter().filter(|unit| unit.beyond_linear.is_some());
    let names: Vec<&str> = beyond.map(|unit| unit.name.as_str()).collect();
    let units = match names.len() {
        0 => return None,
        1..=3 => names.join(", "),
        more => format!("{more} of {} units", units.len()),
    };
    Some(format!("beyond linear theory: {units}: {CONFIRM}"))
}

/// All of it.
pub(crate) fn catalogue_json(units: &[RankedUnit], question: &Question) -> String {
    let unit = |u: &RankedUnit| {
        json!({
            "unit": u.name,
            "met": u.is_met(),
            "not_stated": u.not_stated,
            "quantity": u.worst.limit.quantity.name(),
            "value": u.worst.value,
            "place": u.worst.place,
            "outage": u.longest.json(),
            "curve": points_json(&u.curve),
            "beyond_linear": u.beyond_linear,
        })
    };
    super::json(&json!({
        "schema_version": 1,
        "question": question.json(),
        "curve_quantity": question.curve_of().name(),
        "units": units.iter().map(unit).collect::<Vec<_>>(),
    }))
}
