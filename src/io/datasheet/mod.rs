//! Datasheets: their figures in their units, and the noise model they are assumed to mean.
//!
//! | figure | becomes |
//! |---|---|
//! | noise density N | white noise, sigma2 = N²·rate |
//! | bias instability B, correlation time T | Gauss-Markov processes whose Allan deviation has the floor B |
//! | rate random walk K | a random walk, gamma2 = K²/rate |
//! | turn-on bias (repeatability) | `[turn_on]` of the model file, taken as a standard deviation |
//! | zero offset (initial tolerance) | said, not part of a noise model: measured and removed before use |
//! | scale factor | said, not part of a noise model |
//!
//! **Bias instability.** Manufacturers read B off the lowest point of the Allan deviation (Sensonor's FAQ: "the
//! minimum point of the Allan Variance curve"); [IEEE 952](nav_sim_signal::bibliography::Ieee952) calls that point 0.664
//! times the coefficient of a flicker noise. B is read as that floor: [`Flicker`] has correlation times T, T/16, T/256, …
//! down to 1 s, and its Allan deviation is at least B and at most 1.08 B from 1.9 times the shortest to 1.9 times T.
//! White noise comes on top, so that the model is nowhere in that range below the datasheet; by how much its lowest point
//! is above B is said where it is more than a fifth. (A single Gauss-Markov process whose largest Allan deviation is B, as in
//! Farrell, Silva, Rahman, Wendel: *IMU error modeling tutorial*, IEEE Control Systems 42(6), 2022, is below B at every
//! other averaging time: errors after an outage come out up to two times too small.)

use super::file_kind;
use super::model_file::{ModelFile, NOT_STATED, PROGRAM, SCHEMA, TurnOn, known};
use super::toml_file::TomlSource;
use super::{Failure, Place, source};
use crate::parse;
use crate::report::readable;
use nav_sim_signal::imu::{Channel, Sensor};
use nav_sim_signal::noise::{Composite, Flicker, Model, ParameterError, Process, continuous};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use toml::Table;

/// The correlation time that is assumed where none is given (s).
const ASSUMED_CORRELATION_TIME_S: f64 = 300.0;

/// One figure of one sensor, and where it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct DatasheetEntry {
    /// Whose.
    pub sensor: Sensor,
    /// Name of the figure.
    pub figure: Figure,
    /// Its value.
    pub quantity: StatedQuantity,
    /// Document and place.
    pub source: Option<String>,
    /// The line that was read.
    pub quote: Option<String>,
}

/// Figures of an IMU from its data sheet.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Datasheet {
    /// Manufacturer and name, if known.
    pub name: Option<String>,
    /// Consumer, industrial, tactical or navigation.
    pub class: Option<String>,
    /// At most one entry for each figure of each sensor.
    pub entries: Vec<DatasheetEntry>,
    /// Assumptions beside the figures.
    pub assumptions: Vec<String>,
}

/// A model made of a datasheet, and what to say of it.
#[derive(Debug, Clone, PartialEq)]
pub struct DatasheetModel {
    /// The model.
    pub file: ModelFile,
    /// Assumptions and contradictions to report.
    pub doubts: Vec<String>,
}

impl Datasheet {
    /// A figure in SI (ppm for scale factors).
    #[must_use]
    pub fn value(&self, sensor: Sensor, figure: Figure) -> Option<f64> {
        let mut entries = self.entries.iter();
        let entry = entries.find(|e| e.sensor == sensor && e.figure == figure)?;
        Some(entry.quantity.value)
    }

    /// The figures of a sensor that decide an outage and are not stated: the model has no such error, or that of the grade.
    pub(crate) fn lacking(
        &self,
        sensor: Sensor,
    ) -> impl Iterator<Item = (Figure, Option<&DatasheetEntry>)> {
        // A tolerance of the zero offset stands for no turn-on bias: once removed, it says nothing of the next switching-on.
        let figures = [Figure::Noise, Figure::Bias, Figure::TurnOn].into_iter();
        let of = move |figure| {
            let mut entries = self.entries.iter();
            (
                figure,
                entries.find(|e| e.sensor == sensor && e.figure == figure),
            )
        };
        // N and K have a lowest point of the Allan deviation, as the floor has
        let has_floor =
            move |figure| figure == Figure::Bias && self.value(sensor, Figure::Walk).is_some();
        let found = figures.map(of);
        found.filter(move |(f, entry)| {
            !has_floor(*f) && entry.is_none_or(DatasheetEntry::is_of_grade)
        })
    }

    /// Figures that neither sensor's data state, in words.
    pub(crate) fn not_stated(&self) -> Vec<String> {
        let both = Sensor::ALL.into_iter();
        let lacking =
            both.flat_map(|sensor| self.lacking(sensor).map(move |lacking| (sensor, lacking)));
        let mut lacking: Vec<_> = lacking.collect();
        lacking.sort_by_key(|(sensor, (figure, _))| (*figure as usize, *sensor as usize));
        let words = lacking.into_iter().map(|(sensor, (figure, entry))| {
            let grade = if entry.is_some() { " by grade" } else { "" };
            format!("{} {}{grade}", sensor.name(), figure.name())
        });
        words.collect()
    }

    /// Puts a figure in the place of what was known of it.
    pub(crate) fn set(&mut self, entry: DatasheetEntry) {
        self.entries
            .retain(|e| (e.sensor, e.figure) != (entry.sensor, entry.figure));
        self.entries.push(entry);
    }

    /// The model at a rate (Hz).
    ///
    /// # Errors
    /// When a figure is beyond what a process can have.
    pub fn model_file(&self, rate_hz: f64) -> Result<DatasheetModel, ParameterError> {
        let mut doubts = Vec::new();
        let mut noise = |sensor| self.noise(sensor, rate_hz, &mut doubts);
        let (accel, gyro) = (noise(Sensor::Accel)?, noise(Sensor::Gyro)?);
        let mut file = ModelFile::new(Model::pooled(rate_hz, &accel, &gyro));
        let silent = |channel: &Channel| file.model.axis(*channel).processes.is_empty();
        file.missing = Channel::ALL.into_iter().filter(silent).collect();
        let turn_on = |sensor| self.value(sensor, Figure::TurnOn).map(|sigma| [sigma; 3]);
        let turn_on = TurnOn {
            accel_m_s2: turn_on(Sensor::Accel),
            gyro_rad_s: turn_on(Sensor::Gyro),
        };
        file.turn_on = (turn_on != TurnOn::default()).then_some(turn_on);
        file.provenance = Some(self.provenance(&doubts));
        Ok(DatasheetModel { file, doubts })
    }

    fn noise(
        &self,
        sensor: Sensor,
        rate_hz: f64,
        doubts: &mut Vec<String>,
    ) -> Result<Composite, ParameterError> {
        let mut processes = Vec::new();
        let density = self.value(sensor, Figure::Noise);
        if let Some(density) = density {
            let sigma2 = continuous::white_sigma2(density, rate_hz);
            processes.push(Process::white(sigma2)?);
        }
        let given_s = self.value(sensor, Figure::CorrelationTime);
        let t_corr_s = given_s.unwrap_or(ASSUMED_CORRELATION_TIME_S);
        if let Some(floor) = self.value(sensor, Figure::Bias) {
            let flicker = Flicker { floor, t_corr_s };
            processes.extend(flicker.processes(rate_hz)?);
            doubts.extend(doubt_floor(
                sensor,
                flicker,
                density.unwrap_or(0.0),
                given_s.is_some(),
            ));
        }
        if let Some(density) = self.value(sensor, Figure::Walk) {
            let gamma2 = continuous::walk_gamma2(density, rate_hz);
            processes.push(Process::random_walk(gamma2)?);
        }
        Ok(Composite::new(processes))
    }

    fn provenance(&self, doubts: &[String]) -> Table {
        let figures: Vec<Table> = self
            .entries
            .iter()
            .map(DatasheetEntry::provenance)
            .collect();
        let not_stated = self.not_stated();
        known(json!({
            "estimator": "datasheet",
            "label": "assumed from data-sheet figures, not calibrated",
            "program": PROGRAM,
            "schema": SCHEMA,
            "unit": self.name,
            "assumptions": ([&self.assumptions, doubts].concat()),
            "figures": figures,
            NOT_STATED: (!not_stated.is_empty()).then_some(not_stated),
        }))
    }
}

impl DatasheetEntry {
    /// True of a figure that no document states.
    pub(crate) fn is_of_grade(&self) -> bool {
        self.source.as_deref() == Some(GRADE)
    }

    fn provenance(&self) -> Table {
        known(json!({
            "figure": format!("{}.{}", self.sensor.name(), self.figure.name()),
            "given": self.quantity.given,
            "source": self.source,
            "quote": self.quote,
        }))
    }
}

/// Largest ratio of the minimum of the whole Allan deviation to the bias instability that needs no
/// remark.
const NOTABLE: f64 = 1.2;

fn doubt_floor(sensor: Sensor, flicker: Flicker, density: f64, is_time_given: bool) -> Vec<String> {
    let name = sensor.name();
    let mut doubts = Vec::new();
    if !is_time_given {
        doubts.push(format!(
            "{name}: no correlation time given; {ASSUMED_CORRELATION_TIME_S} s assumed for the bias instability"
        ));
    }
    // the white noise falls throughout, so that both together are lowest where the floor ends
    let tau_s = flicker.range_s().1;
    let white = density / tau_s.sqrt() / flicker.floor;
    let lowest = white.hypot(1.0);
    if white > 1.0 {
        doubts.push(format!(
            "{name}: at {} s the white noise hides the bias instability in the Allan deviation; a correlation time above {} s would not",
            readable(tau_s),
            readable(flicker.t_corr_s * white * white)
        ));
    } else if lowest > NOTABLE {
        doubts.push(format!(
            "{name}: the lowest Allan deviation of this model is {lowest:.2} times the bias instability, at {} s; a longer correlation time lowers it",
            readable(tau_s)
        ));
    }
    doubts
}

#[cfg(test)]
mod tests;

// The figures of a datasheet and the units they are given in.

/// A figure of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// White noise: velocity or angle random walk, noise density.
    Noise,
    /// Bias instability: the lowest point of the Allan deviation.
    Bias,
    /// Correlation time of the bias.
    CorrelationTime,
    /// Rate random walk.
    Walk,
    /// Constant bias of a switching-on: its repeatability from one to the next.
    TurnOn,
    /// Initial tolerance of the zero offset, which is measured and removed before use.
    Offset,
    /// Scale-factor error.
    Scale,
}

nav_sim_signal::named!(Figure {
    Noise = "noise", Bias = "bias", CorrelationTime = "corr_time", Walk = "walk", TurnOn = "turn_on", Offset = "offset", Scale = "scale"
});

/// Units as people write them, each with what one of it is in SI; ppm for scale factors.
type Units = &'static [(&'static str, f64)];

const ACCEL_NOISE: Units = &[
    ("m/s/sqrt(h)", 1.0 / 60.0),
    ("m/s/sqrt(s)", 1.0),
    ("ft/s/sqrt(h)", 0.3048 / 60.0),
    ("m/s²/sqrt(Hz)", 1.0),
    ("mg/sqrt(Hz)", 1e-3 * STANDARD_GRAVITY),
    ("ug/sqrt(Hz)", 1e-6 * STANDARD_GRAVITY),
];
const GYRO_NOISE: Units = &[
    ("deg/sqrt(h)", DEG / 60.0),
    ("deg/sqrt(s)", DEG),
    ("deg/s/sqrt(Hz)", DEG),
    ("mdeg/s/sqrt(Hz)", 1e-3 * DEG),
    ("deg/h/sqrt(Hz)", DEG_PER_HOUR),
    ("rad/sqrt(s)", 1.0),
    ("rad/s/sqrt(Hz)", 1.0),
];
const ACCELERATION: Units = &[
    ("ug", 1e-6 * STANDARD_GRAVITY),
    ("mg", 1e-3 * STANDARD_GRAVITY),
    ("mGal", 1e-5),
    ("m/s²", 1.0),
];
const RATE: Units = &[
    ("deg/h", DEG_PER_HOUR),
    ("deg/s", DEG),
    ("mdeg/s", 1e-3 * DEG),
    ("rad/s", 1.0),
];
const ACCEL_WALK: Units = &[
    ("m/s²/sqrt(h)", 1.0 / 60.0),
    ("m/s/h/sqrt(h)", 1.0 / 3600.0 / 60.0),
    ("m/s²/sqrt(s)", 1.0),
    ("m/s³/sqrt(Hz)", 1.0),
    ("mg/sqrt(h)", 1e-3 * STANDARD_GRAVITY / 60.0),
    ("ug/sqrt(h)", 1e-6 * STANDARD_GRAVITY / 60.0),
];
const GYRO_WALK: Units = &[
    ("deg/h/sqrt(h)", DEG_PER_HOUR / 60.0),
    ("deg/s/sqrt(s)", DEG),
    ("deg/s/sqrt(h)", DEG / 60.0),
    ("rad/s/sqrt(s)", 1.0),
    ("rad/s²/sqrt(Hz)", 1.0),
];
const TIME: Units = &[("s", 1.0), ("min", 60.0), ("h", 3600.0)];
const RATIO: Units = &[("ppm", 1.0), ("%", 1e4)];

impl Figure {
    /// The units it may be given in.
    pub(crate) const fn units(self, sensor: Sensor) -> Units {
        match (self, sensor) {
            (Self::Noise, Sensor::Accel) => ACCEL_NOISE,
            (Self::Noise, Sensor::Gyro) => GYRO_NOISE,
            (Self::Bias | Self::TurnOn | Self::Offset, Sensor::Accel) => ACCELERATION,
            (Self::Bias | Self::TurnOn | Self::Offset, Sensor::Gyro) => RATE,
            (Self::Walk, Sensor::Accel) => ACCEL_WALK,
            (Self::Walk, Sensor::Gyro) => GYRO_WALK,
            (Self::CorrelationTime, _) => TIME,
            (Self::Scale, _) => RATIO,
        }
    }
}

/// The largest figure (SI, ppm for scale factors).
const MOST: f64 = 1e12;

/// A figure as given, and what it is in SI (ppm for scale factors).
#[derive(Debug, Clone, PartialEq)]
pub struct StatedQuantity {
    /// Text of the figure: "0.34 deg/sqrt(h)".
    pub given: String,
    /// In SI.
    pub value: f64,
}

impl StatedQuantity {
    /// A number and one of the units; °, µ, √, ², dps and hr are read too.
    ///
    /// # Errors
    /// When there is no positive number, no unit, or one that does not fit.
    pub(crate) fn parse(text: &str, units: Units) -> Result<Self, String> {
        let given = text.trim();
        // of "0.5e-3 deg/h" the longest beginning that is a number; 'e' may begin no unit here
        let end = given
            .find(|c: char| !(c.is_ascii_digit() || ".+-eE".contains(c)))
            .unwrap_or(given.len());
        let (number, unit) = (&given[..end], given[end..].trim());
        let fitting = || {
            units
                .iter()
                .map(|(name, _)| *name)
                .collect::<Vec<_>>()
                .join(", ")
        };
        let number = number
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite() && *x > 0.0);
        let Some(number) = number else {
            return Err(format!(
                "does not begin with a number > 0, such as 0.1 {}",
                units[0].0
            ));
        };
        if unit.is_empty() {
            return Err(format!("has no unit; expected {}", fitting()));
        }
        match units.iter().find(|(name, _)| plain(name) == plain(unit)) {
            Some((_, factor)) if number * factor > MOST => {
                Err(format!("is more than {MOST:e} in SI units"))
            }
            Some((_, factor)) => Ok(Self {
                given: given.to_owned(),
                value: number * factor,
            }),
            None => Err(format!("has the unit {unit}; expected {}", fitting())),
        }
    }
}

/// A unit without the freedom of its spelling.
fn plain(unit: &str) -> String {
    let bare = |c: &char| !c.is_whitespace() && !"()".contains(*c);
    let mut text = unit.chars().filter(bare).collect::<String>().to_lowercase();
    for (written, meant) in [
        ("µ", "u"),
        ("μ", "u"),
        ("°", "deg"),
        ("º", "deg"),
        ("²", "2"),
        ("³", "3"),
        ("^", ""),
        ("dps", "deg/s"),
        ("fps", "ft/s"),
        ("hr", "h"),
        ("√", "sqrt"),
        ("/rthz", "/sqrthz"),
        ("/rth", "/sqrth"),
        ("/rts", "/sqrts"),
    ] {
        text = text.replace(written, meant);
    }
    text
}

#[cfg(test)]
mod unit_tests {
    use super::*;
    use crate::io::tests::answers;
    use Figure::{Bias, CorrelationTime, Noise, Scale, TurnOn, Walk};
    use Sensor::{Accel, Gyro};

    fn parse(sensor: Sensor, figure: Figure, text: &str) -> Result<f64, String> {
        StatedQuantity::parse(text, figure.units(sensor))
            .map(|q| q.value)
            .map_err(|e| e.to_string())
    }

    /// Each unit against its definition, written out independently of the table.
    #[test]
    fn units_are_what_they_are_defined_as() {
        let (g, deg) = (9.806_65, std::f64::consts::PI / 180.0);
        for (sensor, figure, text, expected) in [
            (Accel, Noise, "0.06 m/s/√h", 0.001),
            (Accel, Noise, "60 µg/√Hz", 60e-6 * g),
            (Accel, Noise, "60 ug/rtHz", 60e-6 * g),
            (Accel, Noise, "0.14mg/sqrt(Hz)", 0.14e-3 * g),
            (Accel, Noise, "1e-3 (m/s²)/sqrt(Hz)", 1e-3),
            (Accel, Noise, "0.065 fps/sqrt(hr)", 0.065 * 0.3048 / 60.0),
            (Gyro, Noise, "0.6 deg/rt(hr)", 0.01 * deg),
            (Gyro, Noise, "0.6 °/√hr", 0.01 * deg),
            (Gyro, Noise, "0.01 deg/s/sqrt(Hz)", 0.01 * deg),
            (Gyro, Noise, "10 mdps/√Hz", 0.01 * deg),
            (Gyro, Noise, "2 dps/√Hz", 2.0 * deg),
            (Gyro, Noise, "36 °/h/√Hz", 0.01 * deg),
            (Gyro, Noise, "1.5E-5 rad/s/sqrt(Hz)", 1.5e-5),
            (Accel, Bias, "40 ug", 40e-6 * g),
            (Accel, TurnOn, "2 mg", 2e-3 * g),
            (Accel, Bias, "13 mGal", 13e-5),
            (Accel, TurnOn, "0.1 m/s^2", 0.1),
            (Gyro, Bias, "10 °/h", 10.0 * deg / 3600.0),
            (Gyro, TurnOn, "0.2 deg/s", 0.2 * deg),
            (Gyro, Walk, "6 deg/h/sqrt(h)", 6.0 * deg / 3600.0 / 60.0),
            (Accel, Walk, "60 ug/sqrt(h)", 1e-6 * g),
            (Gyro, CorrelationTime, "5 min", 300.0),
            (Accel, CorrelationTime, "2 h", 7200.0),
            (Accel, Scale, "0.05 %", 500.0),
        ] {
            let value = parse(sensor, figure, text).unwrap();
            assert!(
                (value / expected - 1.0).abs() < 1e-14,
                "{text}: {value:e} {expected:e}"
            );
        }
    }

    /// A number in any unit, written and read in any other that fits, is the same number.
    #[test]
    fn units_round_trip() {
        for sensor in Sensor::ALL {
            for (figure, from, to) in Figure::ALL.into_iter().flat_map(|figure| {
                let units = figure.units(sensor);
                units
                    .iter()
                    .flat_map(move |from| units.iter().map(move |to| (figure, from, to)))
            }) {
                let converted = parse(sensor, figure, &format!("0.3 {}", from.0)).unwrap() / to.1;
                let back =
                    parse(sensor, figure, &format!("{converted:e} {}", to.0)).unwrap() / from.1;
                assert!((back / 0.3 - 1.0).abs() < 1e-14, "{} {}", from.0, to.0);
            }
        }
    }

    #[test]
    fn what_is_no_figure_is_refused_with_the_units_that_fit() {
        insta::assert_snapshot!(answers(
            [
                "10",
                "10 ug",
                "1e300 deg/s",
                "",
                "deg/h",
                "-1 deg/h",
                "0 deg/h",
                "1e999 deg/h",
                "nan deg/h",
                "1.2.3 deg/h",
            ]
            .map(|text| (text, parse(Sensor::Gyro, Figure::Bias, text)))
        ));
    }
}

// Catalogue entries (TOML): real IMUs, each figure with its source.
//
// ```toml
// [unit]
// manufacturer = "Sensonor"
// name = "STIM300"
// class = "tactical"                  # consumer, industrial, tactical, navigation
// assumptions = ["…"]
// [gyro]                              # noise, bias, corr_time, walk, turn_on, offset, scale
// noise = { value = "0.15 deg/sqrt(h)", source = "document, revision, page; where it was read", quote = "…" }
// ```

macro_rules! catalogue {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../calib_data/catalogue/", $name, ".toml")))),*]
    };
}

/// The entries that are known by name, and their texts.
pub(crate) const CATALOGUE: &[(&str, &str)] = catalogue![
    "adis16405",
    "adis16448",
    "adis16470",
    "adis16488",
    "bmi088",
    "dmu41",
    "hg1700",
    "hg4930",
    "icm42688p",
    "imx5",
    "lsm6dso",
    "mpu6050",
    "mti1",
    "mti300",
    "openrtk300za",
    "stim300",
    "vn100",
];

/// Source of a turn-on bias that the data sheet does not state.
pub(crate) const GRADE: &str = "grade";

/// Turn-on biases of a grade, accelerometer and gyroscope, where a data sheet states none: from Groves 2013, table 4.1 (tactical
/// 1 to 10 mg and 1 to 100 deg/h, in its middle; automotive above that; aviation 0.03 to 0.1 mg, 0.01 deg/h).
const GRADES: [(&str, &str, &str); 4] = [
    ("consumer", "10 mg", "0.1 deg/s"),
    ("industrial", "5 mg", "100 deg/h"),
    ("tactical", "3 mg", "10 deg/h"),
    ("navigation", "0.05 mg", "0.01 deg/h"),
];

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct DatasheetFile {
    unit: FigureUnit,
    #[serde(default)]
    accel: BTreeMap<String, StatedFigure>,
    #[serde(default)]
    gyro: BTreeMap<String, StatedFigure>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FigureUnit {
    manufacturer: String,
    name: String,
    class: String,
    #[serde(default)]
    assumptions: Vec<String>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct StatedFigure {
    value: String,
    source: String,
    quote: Option<String>,
}

/// Reads an entry.
///
/// # Errors
/// File, line, key and value of what is refused.
pub fn read(path: &Path) -> Result<Datasheet, Failure> {
    parse(&TomlSource::read(path)?)
}

/// The entry of that name, if the catalogue has it; capitals do not matter.
#[must_use]
pub fn catalogued(name: &str) -> Option<Result<Datasheet, Failure>> {
    let (name, text) = CATALOGUE
        .iter()
        .find(|(known, _)| known.eq_ignore_ascii_case(name))?;
    Some(parse(&TomlSource::new(name, text)))
}

pub(super) fn parse(source: &TomlSource) -> Result<Datasheet, Failure> {
    let file: DatasheetFile = source.get()?;
    let mut entries = Vec::new();
    for (sensor, table) in [(Sensor::Accel, file.accel), (Sensor::Gyro, file.gyro)] {
        for (key, given) in table {
            entries.push(entry(source, sensor, &key, given)?);
        }
    }
    let name = Some(format!("{} {}", file.unit.manufacturer, file.unit.name));
    let of_grade = GRADES.iter().find(|(class, ..)| *class == file.unit.class);
    for (sensor, given) in of_grade
        .into_iter()
        .flat_map(|(_, accel, gyro)| [(Sensor::Accel, accel), (Sensor::Gyro, gyro)])
    {
        let figure = Figure::TurnOn;
        if !entries
            .iter()
            .any(|e: &DatasheetEntry| (e.sensor, e.figure) == (sensor, figure))
        {
            entries.push(DatasheetEntry {
                sensor,
                figure,
                quantity: StatedQuantity::parse(given, figure.units(sensor))
                    .expect("a turn-on bias"),
                source: Some(GRADE.to_owned()),
                quote: None,
            });
        }
    }
    Ok(Datasheet {
        name,
        class: Some(file.unit.class),
        entries,
        assumptions: file.unit.assumptions,
    })
}

fn entry(
    source: &TomlSource,
    sensor: Sensor,
    key: &str,
    given: StatedFigure,
) -> Result<DatasheetEntry, Failure> {
    let path = format!("{}.{key}", sensor.name());
    let Ok(figure) = key.parse::<Figure>() else {
        return Err(source.unknown(&path, Figure::NAMES.into_iter()));
    };
    let quantity = StatedQuantity::parse(&given.value, figure.units(sensor))
        .map_err(|e| source.refused(&format!("{path}.value"), e.to_string()))?;
    Ok(DatasheetEntry {
        sensor,
        figure,
        quantity,
        source: Some(given.source),
        quote: given.quote,
    })
}

// Figures that other programs measured: YAML of Kalibr, allan_variance_ros and imu_utils. Their files are `key: value` line by line.

/// Keys, and what they are. Kalibr's random walk is K. Of imu_utils `_n` is the Allan deviation at 1 s times √rate, that of a
/// sample, and `_w` the lowest Allan deviation (`getWhiteNoise`, `getBiasInstability` of its `fitallan_gyr.cpp`).
const MEASURED: [(&str, Sensor, Figure, &str); 8] = [
    (
        "accelerometer_noise_density",
        Sensor::Accel,
        Figure::Noise,
        "m/s²/sqrt(Hz)",
    ),
    (
        "accelerometer_random_walk",
        Sensor::Accel,
        Figure::Walk,
        "m/s³/sqrt(Hz)",
    ),
    (
        "gyroscope_noise_density",
        Sensor::Gyro,
        Figure::Noise,
        "rad/s/sqrt(Hz)",
    ),
    (
        "gyroscope_random_walk",
        Sensor::Gyro,
        Figure::Walk,
        "rad/s²/sqrt(Hz)",
    ),
    ("acc_n", Sensor::Accel, Figure::Noise, "m/s²/sqrt(Hz)"),
    ("acc_w", Sensor::Accel, Figure::Bias, "m/s²"),
    ("gyr_n", Sensor::Gyro, Figure::Noise, "rad/s/sqrt(Hz)"),
    ("gyr_w", Sensor::Gyro, Figure::Bias, "rad/s"),
];

/// Reads figures that another program measured; with the rate of its file (Hz), or `rate_hz` in its place.
///
/// # Errors
/// Line, key and value of what is refused, or no such figure.
pub fn measured(path: &Path, rate_hz: Option<f64>) -> Result<(Datasheet, Option<f64>), Failure> {
    let text = source::text(path).map_err(|e| Failure::io(path, e))?;
    let name = path.display();
    let (mut sheet, mut rate_hz, is_rate_given) =
        (Datasheet::default(), rate_hz, rate_hz.is_some());
    let mut section = "";
    for (line, written) in (1_u64..).zip(text.lines()) {
        let written = written.split('#').next().unwrap_or_default();
        let Some((key, value)) = written.split_once(':') else {
            continue;
        };
        let (key, value) = (key.trim(), value.trim().trim_matches(['"', '\'']).trim());
        // NumPy 2 writes its numbers so
        let value = value
            .trim_start_matches("np.float64(")
            .trim_end_matches(')');
        let refused =
            |reason: &str| Failure::contents(&name, line, format!("\"{key}\" = {value} {reason}"));
        match key {
            _ if value.is_empty() => section = key,
            "update_rate" | "rate_hz" if !is_rate_given => {
                rate_hz = Some(parse::rate_hz(value).map_err(|e| refused(&format!("is {e}")))?);
            }
            "unit" if !["rad/s", "m/s^2"].contains(&value) => {
                let hint =
                    "give the figures with their units: --arw, --gyro-bias, --vrw, --accel-bias";
                return Err(refused("is not the unit of imu_utils").hint(hint));
            }
            _ => {}
        }
        let mut keys = MEASURED.into_iter();
        let Some((_, sensor, figure, unit)) = keys.find(|(known, ..)| *known == key) else {
            continue;
        };
        let is_of_sample = key.ends_with("_n");
        // axes, beside their mean
        if value.is_empty() || key.len() == "acc_n".len() && section != "avg-axis" {
            continue;
        }
        if sheet.value(sensor, figure).is_some() {
            return Err(refused("is given twice").hint("one file for each IMU"));
        }
        // a walk of 0 is none
        if value.parse() == Ok(0.0) {
            continue;
        }
        let mut quantity = StatedQuantity::parse(&format!("{value} {unit}"), figure.units(sensor))
            .map_err(|e| refused(&e))?;
        if is_of_sample {
            let Some(rate_hz) = rate_hz else {
                return Err(refused("is of a sample: the rate is needed")
                    .hint("give the rate with --rate-hz"));
            };
            quantity.value /= rate_hz.sqrt();
            quantity.given = format!(
                "{} {unit}: {key} {value} at {rate_hz} Hz",
                readable(quantity.value)
            );
            sheet.assumptions = [
                "imu_utils: _n is the Allan deviation at 1 s times the root of the rate, _w the lowest Allan deviation",
                "imu_utils: some versions write _n as a density: give that with --arw and --vrw",
            ]
            .map(str::to_owned)
            .into();
        }
        sheet.set(DatasheetEntry {
            sensor,
            figure,
            quantity,
            source: Some(format!("{name}, line {line}")),
            quote: Some(written.trim().to_owned()),
        });
    }
    if sheet.entries.is_empty() {
        let message =
            "no figure of Kalibr (gyroscope_noise_density, …) or imu_utils (gyr_n, … of avg-axis)";
        let refused = Failure::contents(&name, Place::Within, message)
            .hint("give the figures with their units: --arw, --gyro-bias, --gyro-rrw, --vrw, --accel-bias, --accel-rrw");
        return Err(file_kind::or_wrong_kind(&[], path, refused));
    }
    Ok((sheet, rate_hz))
}
