//! Catalogue entries (TOML): real IMUs, each figure with its source.
//!
//! ```toml
//! [unit]
//! manufacturer = "Sensonor"
//! name = "STIM300"
//! class = "tactical"                  # consumer, industrial, tactical, navigation
//! assumptions = ["…"]
//! [gyro]                              # noise, bias, corr_time, walk, turn_on, offset, scale
//! noise = { value = "0.15 deg/sqrt(h)", source = "document, revision, page; where it was read", quote = "…" }
//! ```

use super::{Datasheet, Entry, Figure, Quantity};
use crate::io::Failure;
use crate::io::toml_file::Source;
use nav_sim_signal::imu::Sensor;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    unit: Unit,
    #[serde(default)]
    accel: BTreeMap<String, Given>,
    #[serde(default)]
    gyro: BTreeMap<String, Given>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Unit {
    manufacturer: String,
    name: String,
    class: String,
    #[serde(default)]
    assumptions: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    value: String,
    source: String,
    quote: Option<String>,
}

/// Reads an entry.
///
/// # Errors
/// File, line, key and value of what is refused.
pub fn read(path: &Path) -> Result<Datasheet, Failure> {
    parse(&Source::read(path)?)
}

/// The entry of that name, if the catalogue has it; capitals do not matter.
#[must_use]
pub fn catalogued(name: &str) -> Option<Result<Datasheet, Failure>> {
    let (name, text) = CATALOGUE
        .iter()
        .find(|(known, _)| known.eq_ignore_ascii_case(name))?;
    Some(parse(&Source::new(name, text)))
}

pub(super) fn parse(source: &Source) -> Result<Datasheet, Failure> {
    let file: File = source.get()?;
    let mut entries = Vec::new();
    for (sensor, table) in [(Sensor::Accel, file.accel), (Sensor::Gyro, file.gyro)] {
        for (key, given) in table {
            entries.push(entry(source, sensor, &key, given)?);
        }
    }
    let name = Some(format!("{} {}", file.unit.manufacturer, file.unit.name));
    Ok(Datasheet {
        name,
        class: Some(file.unit.class),
        entries,
        assumptions: file.unit.assumptions,
    })
}

fn entry(source: &Source, sensor: Sensor, key: &str, given: Given) -> Result<Entry, Failure> {
    let path = format!("{}.{key}", sensor.name());
    let Ok(figure) = key.parse::<Figure>() else {
        return Err(source.unknown(&path, Figure::NAMES.into_iter()));
    };
    let quantity = Quantity::parse(&given.value, figure.units(sensor))
        .map_err(|e| source.refused(&format!("{path}.value"), e.to_string()))?;
    Ok(Entry {
        sensor,
        figure,
        quantity,
        source: Some(given.source),
        quote: given.quote,
    })
}
