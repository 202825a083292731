//! The IMU that a limit needs.

use super::question::{BeyondLinear, CHECKED, Question};
use crate::report::Answer;
use nav_sim_document::{
    Axis, Cell, Chart, Colour, Document, Importance, Panel, Series, Table, Tone, percent, readable,
};
use nav_sim_navigation::require::{
    Answer as Bound, IMU_PARAMETERS, ImuParameters, IsoDrift, Worst,
};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

/// The IMU that a limit needs.
#[derive(Debug, Clone)]
pub(crate) struct NeededImu {
    /// What was asked.
    pub question: Question,
    /// With equal shares.
    pub imu: ImuParameters,
    /// The shares at the limit, and that of GNSS and start.
    pub shares: [f64; IMU_PARAMETERS + 1],
    /// The hardest limit, and where.
    pub worst: Worst,
    /// What each intensity may be if there were no other.
    pub alone: [Bound; IMU_PARAMETERS],
    /// What each may be if the others are ten times better.
    pub others_better: [Bound; IMU_PARAMETERS],
    /// The curve of equal drift.
    pub iso_drift: Option<IsoDrift>,
    /// Turn-on biases that it has: accelerometer (m/s²), gyroscope (rad/s).
    pub turn_on: [f64; 2],
    /// Where the answer is beyond linear theory.
    pub beyond_linear: Option<BeyondLinear>,
}

impl NeededImu {
    /// The turn-on biases that the answer takes for granted.
    pub(super) fn turn_on_in_words(&self) -> String {
        if self.turn_on == [0.0; 2] {
            return "without turn-on bias ([imu] of --scenario states one)".to_owned();
        }
        let [accel, gyro] = self.turn_on.map(readable);
        format!("with turn-on biases of {accel} m/s² (accel) and {gyro} rad/s (gyro)")
    }

    fn figures(&self) -> Table {
        let mut table = Table::new([
            "figure",
            "at most, equal shares",
            "share",
            "if alone",
            "others 10 × better",
        ]);
        for i in 0..IMU_PARAMETERS {
            let pointer = |key: &str| format!("/figures/{i}/{key}");
            table.row([
                ImuParameters::NAMES[i].into(),
                bound(i, &Bound::AtMost(self.imu.values[i]), &pointer("allocated")),
                Cell::share(self.shares[i], &pointer("share")),
                bound(i, &self.alone[i], &pointer("alone")),
                bound(
                    i,
                    &self.others_better[i],
                    &pointer("others_10_times_better"),
                ),
            ]);
        }
        let of_gnss = Cell::share(self.shares[IMU_PARAMETERS], "/share_of_gnss_and_start");
        table.row([
            "GNSS and start".into(),
            Cell::figures(""),
            of_gnss,
            Cell::figures(""),
            Cell::figures(""),
        ]);
        table
    }

    fn iso_drift_section(&self, curve: &IsoDrift, document: &mut Document) {
        let beside = |i: usize| {
            let value = readable(ImuParameters::in_datasheets(i, self.imu.values[i]));
            format!("{} {value}", ImuParameters::NAMES[i])
        };
        let held = format!("Beside {} and {}.", beside(1), beside(2));
        let mut table = Table::new([ImuParameters::NAMES[3], ImuParameters::NAMES[0]]);
        let mut line = Vec::new();
        for (k, (bias, walk)) in curve.points.iter().enumerate() {
            let bias = ImuParameters::in_datasheets(3, *bias);
            let pointer = |i: usize| format!("/iso_drift/{k}/{i}");
            table.row([Cell::number(bias, &pointer(0)), bound(0, walk, &pointer(1))]);
            if let Bound::AtMost(walk) = walk {
                line.push((bias, ImuParameters::in_datasheets(0, *walk)));
            }
        }
        let series = Series::dotted_line("limit kept exactly", Colour::REAL, line).into();
        let panel = Panel::new(Axis::log(ImuParameters::NAMES[0]), series);
        let chart = Chart::new(
            "IMUs of equal drift",
            Axis::log(ImuParameters::NAMES[3]),
            vec![panel],
        );
        document.section("Equal drift");
        document.text(&held);
        document.table(&table);
        document.chart(
            &chart,
            "Every point of the curve keeps the limit exactly; below and left of it there is room.",
        );
    }
}

impl Answer for NeededImu {
    fn document(&self) -> Document {
        let gnss = percent(self.shares[IMU_PARAMETERS]);
        let lines = [
            format!("needed for {}", self.question.in_words()),
            format!("an IMU {}", self.turn_on_in_words()),
            format!(
                "hardest: {}, where GNSS and start take {gnss}",
                self.question.worst(&self.worst)
            ),
        ];
        let mut document = Document::new("The IMU that a limit needs", Tone::Good, lines);
        BeyondLinear::note(self.beyond_linear.as_ref(), &mut document);
        let (from_s, to_s) = self.imu.floor_s();
        let floor = format!(
            "bias instability: floor of the Allan deviation, here {} to {} s",
            readable(from_s),
            readable(to_s)
        );
        document.note(Importance::Detail, floor);
        document.section("Figures, at most");
        document.text("If alone: without any other error of the IMU. Others 10 × better: every other figure ten times smaller.");
        document.lead(self.figures());
        if let Some(curve) = &self.iso_drift {
            self.iso_drift_section(curve, &mut document);
        }
        document.checked(CHECKED);
        document
    }
}

impl Serialize for NeededImu {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let figure = |i: usize| {
            json!({
                "figure": ImuParameters::NAMES[i],
                "allocated": ImuParameters::in_datasheets(i, self.imu.values[i]),
                "share": self.shares[i],
                "alone": bound_json(i, &self.alone[i]),
                "others_10_times_better": bound_json(i, &self.others_better[i]),
            })
        };
        let point = |(bias, walk): &(f64, Bound)| {
            json!([ImuParameters::in_datasheets(3, *bias), bound_json(0, walk)])
        };
        let file = json!({
            "schema_version": 1,
            "question": self.question.json(),
            "t_corr_s": self.imu.t_corr_s,
            "turn_on_bias": { "accel_m_s2": self.turn_on[0], "gyro_rad_s": self.turn_on[1] },
            "figures": (0..IMU_PARAMETERS).map(figure).collect::<Vec<_>>(),
            "share_of_gnss_and_start": self.shares[IMU_PARAMETERS],
            "place": self.worst.place,
            "beyond_linear": self.beyond_linear,
            "iso_drift": self.iso_drift.as_ref().map(|c| c.points.iter().map(point).collect::<Vec<_>>()),
        });
        file.serialize(serializer)
    }
}

fn bound(which: usize, found: &Bound, pointer: &str) -> Cell {
    match found {
        Bound::AtMost(value) => Cell::number(ImuParameters::in_datasheets(which, *value), pointer),
        Bound::Any => Cell::figures("any"),
        Bound::Never => Cell::figures("–"),
    }
}

fn bound_json(which: usize, found: &Bound) -> Value {
    match found {
        Bound::AtMost(value) => json!(ImuParameters::in_datasheets(which, *value)),
        Bound::Any => json!("any"),
        Bound::Never => Value::Null,
    }
}
