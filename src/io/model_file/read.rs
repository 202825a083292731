//! Reading model files.

use super::description::{Description, LawAxes, LawTable, SensorTable, TurnOnTable};
use super::{CI, Interval, ModelFile, TurnOn};
use crate::io::Failure;
use crate::io::file_kind::{self, FileKind};
use crate::io::toml_file::{Finite, OneOrEach, Source};
use nav_sim_navigation::sensors::defects::{MAX_BIAS_M_S2, MAX_BIAS_RAD_S};
use nav_sim_signal::imu::{Axis, Channel, MAX_RATE_HZ, Sensor};
use nav_sim_signal::noise::{
    Composite, Kind, Model, ParameterError, Process, Spread, SpreadError, Variation,
};
use std::path::Path;
use toml::Value;

/// Reads a model file.
///
/// # Errors
/// When the file cannot be read, is not TOML, has unknown keys, lacks some, or has values outside their
/// domains.
pub fn read(path: &Path) -> Result<ModelFile, Failure> {
    parse(&Source::read(path)?).map_err(|e| {
        use FileKind as K;
        match file_kind::of(path) {
            Ok(K::Trajectory | K::Recording | K::Imu | K::Gnss | K::Curve | K::Record) => {
                e.hint(NOT_A_MODEL)
            }
            _ => e,
        }
    })
}

/// For a file of another kind in the place of a model.
const NOT_A_MODEL: &str = "a model is a TOML file, as calibrate and datasheet write them: are the arguments in another order?";

/// A model file's text, at the path that messages show.
///
/// # Errors
/// As [`read`].
pub fn from_text(path: &Path, text: &str) -> Result<ModelFile, Failure> {
    parse(&Source::new(&path.display().to_string(), text))
}

pub(super) fn parse(source: &Source) -> Result<ModelFile, Failure> {
    let Description {
        rate_hz: Finite(rate_hz),
        accel,
        gyro,
        turn_on,
        spread,
        provenance,
        ..
    } = source.get()?;
    // the same by the names of keys
    let named: toml::Table = source.get()?;
    if !(rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ) {
        let reason = format!("is not a rate: it must be > 0 and at most {MAX_RATE_HZ}");
        return Err(source.refused("rate_hz", reason));
    }
    let mut file = ModelFile::new(Model {
        rate_hz,
        axes: Default::default(),
    });
    for (sensor, table) in Sensor::ALL.into_iter().zip([accel, gyro]) {
        match table {
            Some(table) => read_sensor(source, sensor, table, &named[sensor.name()], &mut file)?,
            None => file
                .missing
                .extend(Axis::ALL.map(|axis| Channel { sensor, axis })),
        }
    }
    if file.missing.len() == Channel::ALL.len() {
        return Err(source.missing("", &Sensor::ALL.map(Sensor::name)));
    }
    file.turn_on = turn_on
        .map(|table| read_turn_on(source, &table))
        .transpose()?;
    if let Some(spread) = spread {
        let mut read = Spread::default();
        for (sensor, laws) in Sensor::ALL.into_iter().zip([spread.accel, spread.gyro]) {
            let Some(laws) = laws else { continue };
            read_laws(source, sensor, &laws, &file, &mut read)?;
        }
        file.spread = Some(read);
    }
    file.provenance = provenance;
    Ok(file)
}

fn read_sensor(
    source: &Source,
    sensor: Sensor,
    table: SensorTable,
    named: &Value,
    file: &mut ModelFile,
) -> Result<(), Failure> {
    let name = sensor.name();
    let own = [table.x, table.y, table.z];
    if table.processes.is_none() && own.iter().all(Option::is_none) {
        return Err(source.missing(name, &["processes"]));
    }
    for (axis, own) in Axis::ALL.into_iter().zip(own) {
        let channel = Channel { sensor, axis };
        let key = format!("{name}.{}", axis.name());
        match (&table.processes, own) {
            (Some(_), Some(_)) => {
                let error = source.refused(&key, "is given both for all axes and for this one");
                return Err(error.or_hint(format!("write either [{name}] or one table an axis")));
            }
            (Some(_), None) => read_processes(source, name, named, channel, file)?,
            (None, Some(_)) => read_processes(source, &key, &named[axis.name()], channel, file)?,
            (None, None) => file.missing.push(channel),
        }
    }
    Ok(())
}

fn read_turn_on(source: &Source, table: &TurnOnTable) -> Result<TurnOn, Failure> {
    let axes = |sensor: Sensor, given: &Option<OneOrEach<Finite, [Finite; 3]>>, limit: f64| {
        let axes = match given {
            None => return Ok(None),
            Some(OneOrEach::One(all)) => [all.0; 3],
            Some(OneOrEach::Each(each)) => each.map(|sigma| sigma.0),
        };
        if axes.iter().all(|sigma| (0.0..=limit).contains(sigma)) {
            return Ok(Some(axes));
        }
        let reason = format!(
            "is not a standard deviation between 0 and {limit} {}",
            sensor.unit()
        );
        Err(source.refused(&format!("turn_on.{}", TurnOn::key(sensor)), reason))
    };
    Ok(TurnOn {
        accel_m_s2: axes(Sensor::Accel, &table.accel_m_s2, MAX_BIAS_M_S2)?,
        gyro_rad_s: axes(Sensor::Gyro, &table.gyro_rad_s, MAX_BIAS_RAD_S)?,
    })
}

fn read_processes(
    source: &Source,
    key: &str,
    named: &Value,
    channel: Channel,
    file: &mut ModelFile,
) -> Result<(), Failure> {
    let rate_hz = file.model.rate_hz;
    let tables = named["processes"].as_array().into_iter().flatten();
    let tables: Vec<(String, &Value)> = (1..)
        .zip(tables)
        .map(|(i, table)| (format!("{key}.processes[{i}]"), table))
        .collect();
    let processes = tables
        .iter()
        .map(|(key, values)| read_process(source, key, values, rate_hz));
    let noise = Composite::new(processes.collect::<Result<_, _>>()?);
    for (((key, values), process), label) in tables.iter().zip(&noise.processes).zip(noise.labels())
    {
        for (parameter, _) in process.parameters() {
            let name = format!("{parameter}{CI}");
            let Some(ends) = values.get(&name).and_then(Value::as_array) else {
                continue;
            };
            let [low, high] = [0, 1].map(|end| number(&ends[end]));
            if low.is_nan() || high.is_nan() || low > high {
                return Err(source.refused(&format!("{key}.{name}"), "is not a pair [low, high]"));
            }
            let (process, parameter) = (label.clone(), parameter.to_owned());
            file.intervals.push(Interval {
                channel,
                process,
                parameter,
                low,
                high,
            });
        }
    }
    file.model.axes[channel.index()] = noise;
    Ok(())
}

/// What is made of larger parameters, such as the sum of a random walk's variances, may be no number any more.
const LARGEST: f64 = 1e30;

/// A number, written with a point or not.
fn number(value: &Value) -> f64 {
    let whole = value.as_integer().map(|whole| whole as f64);
    value.as_float().or(whole).unwrap_or(f64::NAN)
}

fn read_process(
    source: &Source,
    key: &str,
    values: &Value,
    rate_hz: f64,
) -> Result<Process, Failure> {
    let code = values["type"].as_str().unwrap_or_default();
    let kind = Kind::named(code).expect("the description has the codes of the kinds");
    let names = kind.parameters().iter().map(|p| p.name());
    let values: Vec<f64> = names.clone().map(|name| number(&values[name])).collect();
    if let Some((name, _)) = names.zip(&values).find(|(_, value)| value.abs() > LARGEST) {
        let reason = format!("is more than {LARGEST:e}, which no sensor has");
        return Err(source.refused(&format!("{key}.{name}"), reason));
    }
    let process = kind
        .process(&values, rate_hz)
        .expect("as many values as the kind has parameters");
    process.map_err(|e| refuse_parameter(source, key, &e))
}

fn refuse_parameter(source: &Source, key: &str, e: &ParameterError) -> Failure {
    let refusal = source.refused(
        &format!("{key}.{}", e.parameter),
        format!("is not {}", e.domain),
    );
    match e.parameter {
        "phi" => refusal.or_hint(
            "phi = exp(−1/(T·rate_hz)) for a correlation time of T seconds; phi = 1 is a random walk: RW",
        ),
        "sigma2" | "gamma2" | "q2" | "s2" => {
            refusal.or_hint("a variance is never negative; 0 switches the process off")
        }
        _ => refusal,
    }
}

fn read_laws(
    source: &Source,
    sensor: Sensor,
    laws: &OneOrEach<LawAxes, Vec<LawTable>>,
    file: &ModelFile,
    into: &mut Spread,
) -> Result<(), Failure> {
    for axis in Axis::ALL {
        let channel = Channel { sensor, axis };
        let (key, laws) = match laws {
            OneOrEach::Each(all) => (format!("spread.{}", sensor.name()), all),
            OneOrEach::One(LawAxes { x, y, z }) => {
                (format!("spread.{channel}"), [x, y, z][axis as usize])
            }
        };
        let into = &mut into.axes[channel.index()];
        for (i, law) in (1..).zip(laws) {
            let key = format!("{key}[{i}]");
            let (process, parameter) = (law.process.as_str(), law.parameter.as_str());
            let law = law.distribution.law();
            let variation = Variation::new(
                file.model.axis(channel),
                file.model.rate_hz,
                process,
                parameter,
                law,
            )
            .map_err(|e| refuse_law(source, &key, &e))?;
            if into
                .iter()
                .any(|v| (v.process.as_str(), v.of.parameter.name()) == (process, parameter))
            {
                let key = format!("{key}.parameter");
                return Err(source.refused(&key, "of this process already has a law"));
            }
            into.push(variation);
        }
    }
    Ok(())
}

fn refuse_law(source: &Source, key: &str, e: &SpreadError) -> Failure {
    let name = match e {
        SpreadError::NoProcess { .. } => "process",
        SpreadError::NoParameter { .. } => "parameter",
        SpreadError::Constant { name, .. } => name,
        SpreadError::Lognormal | SpreadError::Reaches(_) => "distribution",
    };
    source.refused(&format!("{key}.{name}"), format!("is refused: {e}"))
}
