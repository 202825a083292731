//! The catalogue of IMUs as a list.

use crate::formats::FileError;
use crate::formats::datasheet::{CATALOGUE, Datasheet, Entry, catalogued};
use crate::report;
use nav_sim_signal::imu::Sensor;
use serde_json::{Value, json};

fn units() -> Result<Vec<(&'static str, Datasheet)>, FileError> {
    let units = CATALOGUE.iter().filter_map(|(name, _)| Some((*name, catalogued(name)?)));
    units.map(|(name, sheet)| Ok((name, sheet?))).collect()
}

/// Name, class, and the figures of both sensors as given.
///
/// # Errors
/// An entry that cannot be read.
pub(crate) fn catalogue_text() -> Result<String, FileError> {
    let mut lines = Vec::new();
    for (unit, sheet) in units()? {
        let (class, name) = (sheet.class.as_deref(), sheet.name.as_deref());
        lines.push(format!("{unit:<12} {:<12} {}", class.unwrap_or_default(), name.unwrap_or_default()));
        for sensor in Sensor::ALL {
            let of_sensor = sheet.entries.iter().filter(|e| e.sensor == sensor);
            let shown: Vec<String> =
                of_sensor.map(|e| format!("{} {}", e.figure.key(), e.quantity.given)).collect();
            lines.push(format!("  {:<5} {}", sensor.name(), shown.join(", ")));
        }
    }
    Ok(lines.join("\n"))
}

/// The same with the sources of the figures, as JSON.
///
/// # Errors
/// An entry that cannot be read.
pub(crate) fn catalogue_json() -> Result<String, FileError> {
    let figure = |e: &Entry| json!({ "sensor": e.sensor.name(), "figure": e.figure.key(), "given": e.quantity.given, "source": e.source });
    let unit = |(unit, sheet): (&str, Datasheet)| {
        let figures: Vec<Value> = sheet.entries.iter().map(figure).collect();
        json!({ "unit": unit, "name": sheet.name, "class": sheet.class, "figures": figures })
    };
    let units: Vec<Value> = units()?.into_iter().map(unit).collect();
    Ok(report::json(&json!({ "schema_version": 1, "units": units })))
}
