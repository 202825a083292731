//! The IMU that a limit needs.

use super::question::{BeyondLinear, CHECKED, Question};
use nav_sim_document::{Cell, Document, Importance, Table, Tone, readable};
use nav_sim_navigation::require::{Answer as Bound, IMU_PARAMETERS, ImuParameters, Worst};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

/// The IMU that a limit needs.
#[derive(Debug, Clone)]
pub(crate) struct NeededImu {
    /// What was asked.
    pub question: Question,
    /// With equal shares.
    pub imu: ImuParameters,
    /// The hardest limit, and where.
    pub worst: Worst,
    /// What each intensity may be if there were no other.
    pub alone: [Bound; IMU_PARAMETERS],
    /// What each may be if the others are ten times better.
    pub others_better: [Bound; IMU_PARAMETERS],
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
            "if alone",
            "others 10 × better",
        ]);
        for i in 0..IMU_PARAMETERS {
            let pointer = |key: &str| format!("/figures/{i}/{key}");
            table.row([
                ImuParameters::NAMES[i].into(),
                bound(i, &Bound::AtMost(self.imu.values[i]), &pointer("allocated")),
                bound(i, &self.alone[i], &pointer("alone")),
                bound(
                    i,
                    &self.others_better[i],
                    &pointer("others_10_times_better"),
                ),
            ]);
        }
        table
    }
}

impl NeededImu {
    /// Verdict, tables and charts.
    pub(super) fn document(&self) -> Document {
        let lines = [
            format!("needed for {}", self.question.in_words()),
            format!("an IMU {}", self.turn_on_in_words()),
            format!("hardest: {}", self.question.worst(&self.worst)),
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
                "alone": bound_json(i, &self.alone[i]),
                "others_10_times_better": bound_json(i, &self.others_better[i]),
            })
        };
        let file = json!({
            "schema_version": 1,
            "question": self.question.json(),
            "t_corr_s": self.imu.t_corr_s,
            "turn_on_bias": { "accel_m_s2": self.turn_on[0], "gyro_rad_s": self.turn_on[1] },
            "figures": (0..IMU_PARAMETERS).map(figure).collect::<Vec<_>>(),
            "place": self.worst.place,
            "beyond_linear": self.beyond_linear,
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
