//! Writing model files: numbers in the shortest form that reads back to the same bits.

use super::{CI, Interval, ModelFile, SCHEMA, TurnOn};
use crate::io::Failure;
use crate::io::atomic;
use nav_sim_signal::imu::{Axis, Channel, Sensor};
use nav_sim_signal::noise::{Law, Process, Variation};
use std::fmt::Write;
use std::path::Path;

/// Writes a model file, whole or not at all.
///
/// # Errors
/// When the system refuses, or another model is there and is to stay.
pub fn write(path: &Path, file: &ModelFile) -> Result<(), Failure> {
    atomic::write(path, to_toml(file))
}

/// The text of a model file. A sensor whose three axes are alike is written once.
pub fn to_toml(file: &ModelFile) -> String {
    let mut out = format!("schema = {SCHEMA}\nrate_hz = {:?}\n", file.model.rate_hz);
    for sensor in Sensor::ALL {
        let tables = Axis::ALL.map(|axis| processes(file, Channel { sensor, axis }));
        write_axes(&mut out, sensor, &tables, |name, table| {
            format!("\n[{name}]\n{table}")
        });
    }
    out.push_str(&turn_on(file));
    for sensor in Sensor::ALL {
        let tables = Axis::ALL.map(|axis| laws(file, Channel { sensor, axis }));
        write_axes(&mut out, sensor, &tables, |name, laws| {
            laws.iter()
                .map(|law| format!("\n[[spread.{name}]]\n{law}"))
                .collect()
        });
    }
    if let Some(provenance) = &file.provenance {
        let mut table = toml::Table::new();
        table.insert("provenance".into(), provenance.clone().into());
        let _ = write!(out, "\n{table}");
    }
    out
}

fn turn_on(file: &ModelFile) -> String {
    let Some(turn_on) = &file.turn_on else {
        return String::new();
    };
    let mut out = String::from("\n[turn_on]\n");
    for sensor in Sensor::ALL {
        let Some(axes) = turn_on.axes(sensor) else {
            continue;
        };
        let alike = axes.iter().all(|sigma| *sigma == axes[0]);
        let value = if alike {
            format!("{:?}", axes[0])
        } else {
            format!("{axes:?}")
        };
        let _ = writeln!(out, "{} = {value}", TurnOn::key(sensor));
    }
    out
}

/// One table for the sensor if the three are alike, else one an axis; none where there is nothing.
fn write_axes<T: PartialEq>(
    out: &mut String,
    sensor: Sensor,
    tables: &[Option<T>; 3],
    table: impl Fn(&str, &T) -> String,
) {
    if tables.iter().all(|t| *t == tables[0]) {
        if let Some(text) = &tables[0] {
            out.push_str(&table(sensor.name(), text));
        }
        return;
    }
    for (axis, text) in Axis::ALL.iter().zip(tables) {
        if let Some(text) = text {
            out.push_str(&table(&format!("{}.{}", sensor.name(), axis.name()), text));
        }
    }
}

fn processes(file: &ModelFile, channel: Channel) -> Option<String> {
    if file.missing.contains(&channel) {
        return None;
    }
    let noise = file.model.axis(channel);
    let mut out = String::from("processes = [\n");
    for (process, label) in noise.processes.iter().zip(noise.labels()) {
        let is_of_process = |i: &&Interval| i.channel == channel && i.process == label;
        let intervals: Vec<&Interval> = file.intervals.iter().filter(is_of_process).collect();
        let _ = writeln!(
            out,
            "  {{ {} }}, # {}",
            keys(process, &intervals),
            process.kind().units(channel.sensor.unit())
        );
    }
    out.push_str("]\n");
    Some(out)
}

fn keys(process: &Process, intervals: &[&Interval]) -> String {
    let mut out = format!("type = \"{}\"", process.code());
    for (name, value) in process.parameters() {
        let _ = write!(out, ", {name} = {value:?}");
        if let Some(i) = intervals.iter().find(|i| i.parameter == name) {
            let _ = write!(out, ", {name}{CI} = [{:?}, {:?}]", i.low, i.high);
        }
    }
    out
}

fn laws(file: &ModelFile, channel: Channel) -> Option<Vec<String>> {
    let laws = &file.spread.as_ref()?.axes[channel.index()];
    (!laws.is_empty()).then(|| laws.iter().map(law).collect())
}

fn law(v: &Variation) -> String {
    let constants = match v.law {
        Law::Beta { a, b, low, width } => {
            format!(
                "distribution = \"beta\"\na = {a:?}\nb = {b:?}\nlow = {low:?}\nwidth = {width:?}"
            )
        }
        Law::Normal { sd } => format!("distribution = \"normal\"\nsd = {sd:?}"),
        Law::Lognormal {
            median,
            sd,
            ci95: None,
        } => {
            format!("distribution = \"lognormal\"\nmedian = {median:?}\nsd = {sd:?}")
        }
        Law::Lognormal {
            median,
            sd,
            ci95: Some(ci95),
        } => format!(
            "distribution = \"lognormal\"\nmedian = {median:?}\nmedian{CI} = {:?}\nsd = {sd:?}\nsd{CI} = {:?}",
            ci95.median, ci95.sd
        ),
    };
    format!(
        "process = \"{}\"\nparameter = \"{}\"\n{constants}\n",
        v.process,
        v.of.parameter.name()
    )
}
