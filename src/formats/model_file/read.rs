//! Reading model files.

use super::{CI, Interval, ModelFile, SCHEMA, TurnOn};
use crate::formats::FileError;
use crate::formats::suggest::nearest;
use crate::formats::toml_file::{Section, Source};
use nav_sim_navigation::sensors::defects::{MAX_BIAS_M_S2, MAX_BIAS_RAD_S};
use nav_sim_signal::imu::{Axis, Channel, MAX_RATE_HZ, Sensor};
use nav_sim_signal::noise::{
    Composite, Kind, Law, Model, ParameterError, Process, Spread, SpreadError, Variation,
};
use std::path::Path;

/// Reads a model file.
///
/// # Errors
/// When the file cannot be read, is not TOML, has unknown keys, lacks some, or has values outside their
/// domains.
pub fn read(path: &Path) -> Result<ModelFile, FileError> {
    parse(&Source::read(path)?).map_err(|e| {
        let is_toml = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        if is_toml || !e.remedies.is_empty() { e } else { e.advice(NOT_A_MODEL) }
    })
}

/// For a file of another kind in the place of a model.
const NOT_A_MODEL: &str =
    "a model is a TOML file, as calibrate and datasheet write them: are the arguments in another order?";

/// A model file's text, at the path that messages show.
///
/// # Errors
/// As [`read`].
pub(crate) fn from_text(path: &Path, text: &str) -> Result<ModelFile, FileError> {
    parse(&Source::new(&path.display().to_string(), text))
}

pub(super) fn parse(source: &Source) -> Result<ModelFile, FileError> {
    let table = source.parse()?;
    let root = source.root(&table);
    root.only(&["schema", "rate_hz", "accel", "gyro", "turn_on", "spread", "provenance"])?;
    check_schema(&root)?;
    let rate_hz = root.require_f64("rate_hz")?;
    if !(rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ) {
        let reason = format!("is not a rate: it must be > 0 and at most {MAX_RATE_HZ}");
        return Err(root.refuse("rate_hz", reason, None));
    }
    let mut file = ModelFile::new(Model { rate_hz, axes: Default::default() });
    for sensor in Sensor::ALL {
        read_sensor(&root, sensor, &mut file)?;
    }
    if file.missing.len() == Channel::ALL.len() {
        return Err(root.missing_one_of(&["accel", "gyro"]));
    }
    file.turn_on = root.section("turn_on")?.map(|s| read_turn_on(&s)).transpose()?;
    file.spread = root.section("spread")?.map(|s| read_spread(&s, &file)).transpose()?;
    file.provenance = root.section("provenance")?.and_then(|_| source.owned_table("provenance"));
    Ok(file)
}

fn check_schema(root: &Section<'_>) -> Result<(), FileError> {
    match root.u64("schema")? {
        None | Some(SCHEMA) => Ok(()),
        Some(_) => {
            let reason = format!("is not a schema this version reads: it reads {SCHEMA}");
            Err(root.refuse("schema", reason, Some("was the file made by a newer nav-sim?".into())))
        }
    }
}

fn read_sensor(root: &Section<'_>, sensor: Sensor, file: &mut ModelFile) -> Result<(), FileError> {
    let Some(section) = root.section(sensor.name())? else {
        file.missing.extend(Axis::ALL.map(|axis| Channel { sensor, axis }));
        return Ok(());
    };
    section.only(&["processes", "x", "y", "z"])?;
    let pooled = section.has("processes");
    for axis in Axis::ALL {
        let channel = Channel { sensor, axis };
        let axis_section = section.section(axis.name())?;
        if let Some(axis_section) = &axis_section {
            axis_section.only(&["processes"])?;
        }
        match axis_section.as_ref().or(pooled.then_some(&section)) {
            Some(_) if pooled && axis_section.is_some() => {
                let hint = format!("write either [{sensor}] or one table an axis", sensor = sensor.name());
                let reason = "is given both for all axes and for this one";
                return Err(section.refuse(axis.name(), reason, Some(hint)));
            }
            Some(table) => read_processes(table, channel, file)?,
            None => file.missing.push(channel),
        }
    }
    let found = file.missing.iter().filter(|c| c.sensor == sensor).count() < Axis::ALL.len();
    if found { Ok(()) } else { Err(section.missing("processes")) }
}

fn read_turn_on(section: &Section<'_>) -> Result<TurnOn, FileError> {
    section.only(&Sensor::ALL.map(TurnOn::key))?;
    let [accel_m_s2, gyro_rad_s] = Sensor::ALL.map(|sensor| read_turn_on_of(section, sensor));
    Ok(TurnOn { accel_m_s2: accel_m_s2?, gyro_rad_s: gyro_rad_s? })
}

fn read_turn_on_of(section: &Section<'_>, sensor: Sensor) -> Result<Option<[f64; 3]>, FileError> {
    let key = TurnOn::key(sensor);
    let axes = match section.is_list(key) {
        false => section.f64(key)?.map(|all| [all; 3]),
        true => match section.f64s(key)?.as_deref() {
            Some(&[x, y, z]) => Some([x, y, z]),
            _ => return Err(section.refuse(key, "is not one number or three, x, y, z", None)),
        },
    };
    let limit = match sensor {
        Sensor::Accel => MAX_BIAS_M_S2,
        Sensor::Gyro => MAX_BIAS_RAD_S,
    };
    if axes.iter().flatten().any(|sigma| !(0.0..=limit).contains(sigma)) {
        let reason = format!("is not a standard deviation between 0 and {limit} {}", sensor.unit());
        return Err(section.refuse(key, reason, None));
    }
    Ok(axes)
}

fn read_processes(table: &Section<'_>, channel: Channel, file: &mut ModelFile) -> Result<(), FileError> {
    if !table.has("processes") {
        return Err(table.missing("processes"));
    }
    let sections = table.sections("processes")?;
    let rate_hz = file.model.rate_hz;
    let processes = sections.iter().map(|s| read_process(s, rate_hz)).collect::<Result<_, _>>()?;
    let noise = Composite::new(processes);
    for ((section, process), label) in sections.iter().zip(&noise.processes).zip(noise.labels()) {
        for (parameter, _) in process.parameters() {
            if let Some([low, high]) = section.interval(&format!("{parameter}{CI}"))? {
                let (process, parameter) = (label.clone(), parameter.to_owned());
                file.intervals.push(Interval { channel, process, parameter, low, high });
            }
        }
    }
    file.model.axes[channel.index()] = noise;
    Ok(())
}

/// What is made of larger parameters, such as the sum of a random walk's variances, may be no number any more.
const LARGEST: f64 = 1e30;

fn read_process(section: &Section<'_>, rate_hz: f64) -> Result<Process, FileError> {
    let code = section.require_str("type")?;
    let Some(kind) = Kind::named(code) else {
        let codes = || Kind::ALL.iter().map(|kind| kind.code());
        let hint = match nearest(code, codes()) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => format!("processes: {}", codes().collect::<Vec<_>>().join(", ")),
        };
        return Err(section.refuse("type", "is not a process", Some(hint)));
    };
    let names: Vec<&str> = kind.parameters().iter().map(|p| p.name()).collect();
    let ci: Vec<String> = names.iter().map(|n| format!("{n}{CI}")).collect();
    let legal: Vec<&str> =
        ["type"].iter().chain(&names).copied().chain(ci.iter().map(String::as_str)).collect();
    section.only(&legal)?;
    let values = names.iter().map(|n| section.require_f64(n)).collect::<Result<Vec<_>, _>>()?;
    if let Some((name, _)) = names.iter().zip(&values).find(|(_, value)| value.abs() > LARGEST) {
        let reason = format!("is more than {LARGEST:e}, which no sensor has");
        return Err(section.refuse(name, reason, None));
    }
    let process = kind.process(&values, rate_hz).expect("as many values as the kind has parameters");
    process.map_err(|e| refuse_parameter(section, &e))
}

fn refuse_parameter(section: &Section<'_>, e: &ParameterError) -> FileError {
    let hint = match e.parameter {
        "phi" => {
            "phi = exp(−1/(T·rate_hz)) for a correlation time of T seconds; phi = 1 is a random walk: RW"
        }
        "sigma2" | "gamma2" | "q2" | "s2" => "a variance is never negative; 0 switches the process off",
        _ => return section.refuse(e.parameter, format!("is not {}", e.domain), None),
    };
    section.refuse(e.parameter, format!("is not {}", e.domain), Some(hint.into()))
}

fn read_spread(section: &Section<'_>, file: &ModelFile) -> Result<Spread, FileError> {
    section.only(&Sensor::ALL.map(Sensor::name))?;
    let mut spread = Spread::default();
    for sensor in Sensor::ALL {
        let pooled = section.is_list(sensor.name());
        let sensor_section = if pooled { None } else { section.section(sensor.name())? };
        if let Some(sensor_section) = &sensor_section {
            sensor_section.only(&Axis::ALL.map(Axis::name))?;
        }
        for axis in Axis::ALL {
            let channel = Channel { sensor, axis };
            let laws = match &sensor_section {
                _ if pooled => section.sections(sensor.name())?,
                Some(sensor_section) => sensor_section.sections(axis.name())?,
                None => Vec::new(),
            };
            let into = &mut spread.axes[channel.index()];
            for law in laws {
                let variation = read_variation(&law, file.model.axis(channel), file.model.rate_hz)?;
                let same = |v: &Variation| {
                    v.process() == variation.process() && v.parameter() == variation.parameter()
                };
                if into.iter().any(same) {
                    return Err(law.refuse("parameter", "of this process already has a law", None));
                }
                into.push(variation);
            }
        }
    }
    Ok(spread)
}

fn read_variation(section: &Section<'_>, noise: &Composite, rate_hz: f64) -> Result<Variation, FileError> {
    const COMMON: [&str; 3] = ["process", "parameter", "distribution"];
    let law = match section.require_str("distribution")? {
        "beta" => {
            section.only(&[&COMMON[..], &["a", "b", "low", "width"]].concat())?;
            let get = |key| section.require_f64(key);
            Law::Beta { a: get("a")?, b: get("b")?, low: get("low")?, width: get("width")? }
        }
        "normal" => {
            section.only(&[&COMMON[..], &["sd"]].concat())?;
            Law::Normal { sd: section.require_f64("sd")? }
        }
        _ => {
            let hint = Some("distributions: beta, normal".into());
            return Err(section.refuse("distribution", "is not a distribution known here", hint));
        }
    };
    let (process, parameter) = (section.require_str("process")?, section.require_str("parameter")?);
    Variation::new(noise, rate_hz, process, parameter, law).map_err(|e| refuse_law(section, &e))
}

fn refuse_law(section: &Section<'_>, e: &SpreadError) -> FileError {
    let one_of = |known: &[String]| Some(format!("there: {}", known.join(", ")));
    match e {
        SpreadError::NoProcess { known, .. } => {
            section.refuse("process", "is no process of this model", one_of(known))
        }
        SpreadError::NoParameter { process, known, .. } => {
            let hint = Some(format!("there: {}", known.join(", ")));
            section.refuse("parameter", format!("is no parameter of {process}"), hint)
        }
        SpreadError::Constant { name, domain, .. } => section.refuse(name, format!("is not {domain}"), None),
        SpreadError::Reaches(e) => {
            let reason = format!("reaches {} = {}, which is not {}", e.parameter, e.value, e.domain);
            section.refuse("distribution", reason, None)
        }
    }
}
