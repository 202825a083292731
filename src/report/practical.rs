//! N, B and K of a fit, as the terminal and the page show them.

use super::number::readable;
use crate::export::Quantity;
use nav_sim_calibration::{Practical, duration};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::practical::Horizon;

/// A parameter in the unit of data sheets.
pub(super) struct PracticalRow {
    /// Its name and letter.
    pub name: &'static str,
    /// Value, or why there is none.
    pub value: Result<f64, &'static str>,
    /// The 95 % interval, or that there is none.
    pub interval: String,
    /// Unit of the two.
    pub unit: &'static str,
    /// The value in SI, with its unit.
    pub si: String,
    /// The averages that it governs, by their length.
    pub governs: String,
    /// Where the value stands in the parameters of a fit as JSON.
    pub source: &'static str,
}

impl PracticalRow {
    /// The value as it is printed.
    pub(super) fn shown(&self) -> String {
        self.value.map_or_else(str::to_owned, readable)
    }
}

/// `matched over 1–100 s`
pub(super) fn policy() -> String {
    let Horizon { from_s, to_s } = Horizon::default();
    format!("matched over {from_s}–{to_s} s")
}

/// Velocity or angle random walk, bias instability, acceleration or rate random walk.
pub(super) fn practical_rows(practical: &Practical, sensor: Sensor) -> [PracticalRow; 3] {
    let Practical { parameters, intervals, range_s, walk_until_s } = practical;
    let pair = &parameters.walk;
    let [white, walk] = match sensor {
        Sensor::Accel => ["velocity random walk N", "acceleration random walk K"],
        Sensor::Gyro => ["angle random walk N", "rate random walk K"],
    };
    let row = |(name, source), what: Quantity, x: f64, ends: Option<[f64; 2]>, governs| {
        let (unit, factor) = what.sheet(sensor);
        let si = format!("{x:.2e} {}", what.si_unit(sensor));
        PracticalRow {
            name,
            value: Ok(x * factor),
            interval: interval(ends, factor),
            unit,
            si,
            governs,
            source,
        }
    };
    let absent = |(name, source), why, governs| PracticalRow {
        name,
        value: Err(why),
        interval: String::new(),
        unit: "",
        si: String::new(),
        governs,
        source,
    };
    let (seen, crossover) = (duration(*range_s), pair.crossover_s().map(duration));
    let to = crossover.as_ref().map_or(String::new(), |t| format!("up to {t}"));
    let until = walk_until_s.map_or(String::new(), |t| format!(" to {}", duration(t)));
    let from = crossover.map(|t| format!("from {t}{until}"));
    let n = (white, "white_and_walk/n/data_sheet/value");
    let b = ("bias instability B", "minimum/bias_instability/data_sheet/value");
    let k = (walk, "white_and_walk/k/data_sheet/value");
    [
        row(n, Quantity::Density, pair.density, intervals.density, to),
        match parameters.minimum {
            Some(m) => {
                let floor = format!("floor at {}", duration(m.tau_s));
                row(b, Quantity::Bias, m.bias_instability(), intervals.instability, floor)
            }
            None => absent(b, "not reached", format!("no floor up to {seen}")),
        },
        if practical.walk_is_observed() {
            row(k, Quantity::Walk, pair.walk, intervals.walk, from.unwrap_or_default())
        } else {
            absent(k, "not observed", from.unwrap_or_else(|| format!("none up to {seen}")))
        },
    ]
}

/// `5.36e-5 … 5.48e-5`
pub(super) fn interval(ends: Option<[f64; 2]>, factor: f64) -> String {
    ends.map_or_else(
        || "not determined".to_owned(),
        |[low, high]| format!("{} … {}", readable(low * factor), readable(high * factor)),
    )
}
