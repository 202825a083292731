//! Model files (TOML): what `calibrate` writes and `synthesize`, `run`, `export` read.
//!
//! ```toml
//! schema = 1
//! rate_hz = 100.0
//! [accel]                                   # all three axes; or [accel.x], [accel.y], [accel.z]
//! processes = [
//!   { type = "WN", sigma2 = 5.2e-5, sigma2_ci95 = [5.1e-5, 5.3e-5] },
//!   { type = "AR1", phi = 0.9835, sigma2 = 1.3e-8 },
//! ]
//! [turn_on]                                 # standard deviation of the constant bias of a switching-on: one, or x, y, z
//! accel_m_s2 = 0.02
//! gyro_rad_s = [1e-3, 1e-3, 2e-3]
//! [provenance]                              # free: how the model was made
//! [[spread.accel]]                          # see `noise::spread`
//! ```
//! A sensor or axis that is not in the file is noise-free in [`ModelFile::model`] and listed in
//! [`ModelFile::missing`].

use super::file_kind::FileKind;
use super::recordings::facts;
use super::recordings::timing::USUAL_RATES_HZ;
use super::toml_file::{OneOrEach, TomlSource, schema_path};
use super::{Failure, atomic, file_kind};
use crate::report::readable;
use nav_sim_calibration::duration;
use nav_sim_navigation::sensors::defects::{MAX_BIAS_M_S2, MAX_BIAS_RAD_S};
use nav_sim_signal::imu::{Axis, Channel, MAX_RATE_HZ, Sensor};
use nav_sim_signal::noise::{
    Composite, Model, Parameter, ParameterDistribution, Process, ProcessKind, Spread, Variation,
};
use nav_sim_signal::units::{Between, NonNegative, Positive, Stationary};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde_json::{Map, json};
use std::borrow::Cow;
use std::fmt;
use std::fmt::Write;
use std::path::Path;
use toml::Value;

/// Key of the provenance that lists figures missing from the data sheet.
pub(crate) const NOT_STATED: &str = "not_stated";
/// Program and version in the provenance.
pub(crate) const PROGRAM: &str = concat!("nav-sim ", env!("CARGO_PKG_VERSION"));

/// The version of the layout that is written; the only one that is read.
pub(crate) const SCHEMA: u64 = 1;

/// A model and what is known about it.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelFile {
    /// The noise.
    pub model: Model,
    /// Axes that the file does not have (empty sums in the model).
    pub missing: Vec<Channel>,
    /// The constant bias of a switching-on.
    pub turn_on: Option<TurnOn>,
    /// Distribution of parameters between replicates.
    pub spread: Option<Spread>,
    /// Confidence intervals of parameters.
    pub intervals: Vec<Interval>,
    /// Provenance: estimator, inputs, fit.
    pub provenance: Option<toml::Table>,
    /// Processes read off the curves of the recordings, of the axes whose model does not describe these.
    pub reading: Option<Box<Self>>,
}

/// Rates and correlation times that no IMU has, in words.
fn unusual_times(model: &Model) -> impl Iterator<Item = String> {
    let rate_hz = model.rate_hz;
    let rate = (!USUAL_RATES_HZ.contains(&rate_hz))
        .then(|| format!("rate_hz = {rate_hz} is an unusual IMU rate"));
    let is_short = |process: &&Process| {
        process.kind() == ProcessKind::GaussMarkov && process.shape() > rate_hz
    };
    let mut processes = model.axes.iter().flat_map(|axis| &axis.processes);
    let short = processes.find(is_short).map(|process| {
        let beta = process.shape();
        format!("GM with beta = {beta} 1/s: its correlation time 1/beta is below a sample")
    });
    rate.into_iter().chain(short)
}

impl ModelFile {
    /// Model for navigation: axes with a reading of the curve use it in place of their processes.
    #[must_use]
    pub fn for_navigation(mut self) -> Self {
        let Some(reading) = self.reading.take() else {
            return self;
        };
        for channel in reading.present() {
            let axis = channel.index();
            self.model.axes[axis] = reading.model.axes[axis].clone();
            if let Some(spread) = &mut self.spread {
                let labels = self.model.axes[axis].labels();
                spread.axes[axis].retain(|law| labels.contains(&law.process));
            }
        }
        self.intervals
            .retain(|i| reading.missing.contains(&i.channel));
        self.intervals.extend(reading.intervals);
        self
    }

    /// Axes that the file has.
    pub fn present(&self) -> impl Iterator<Item = Channel> {
        let is_present = |channel: &Channel| !self.missing.contains(channel);
        Channel::ALL.into_iter().filter(is_present)
    }

    /// Doubts about the file at this path, in words.
    pub(crate) fn doubts(&self, path: &std::path::Path) -> Vec<String> {
        let shown = path.display();
        let unsaid = |channel: &Channel| {
            format!("{shown} has no noise model for {channel}: taken as free of noise")
        };
        let is_empty = |c: &Channel| self.model.axis(*c).processes.is_empty();
        let empty: Vec<Channel> = self.present().filter(is_empty).collect();
        let misfit = self.misfit().map(|misfit| format!("{shown} {misfit}"));
        let out_of_range = facts::out_of_range(&self.model).into_iter();
        misfit
            .into_iter()
            .chain(out_of_range.map(|text| format!("{shown}: {text}")))
            .chain(unusual_times(&self.model).map(|text| format!("{shown}: {text}")))
            .chain(self.missing.iter().chain(&empty).map(unsaid))
            .collect()
    }

    /// Figures or axes that count as zero since the data sheet does not state them.
    pub(crate) fn not_stated(&self) -> Vec<String> {
        let figures = self
            .provenance
            .as_ref()
            .and_then(|table| table.get(NOT_STATED)?.as_array());
        let name = |figure: &toml::Value| figure.as_str().map(str::to_owned);
        match figures {
            Some(figures) => figures.iter().filter_map(name).collect(),
            None => self.missing.iter().map(ToString::to_string).collect(),
        }
    }

    /// A file without axes.
    pub(crate) fn empty(rate_hz: f64) -> Self {
        let axes = Default::default();
        Self {
            missing: Channel::ALL.to_vec(),
            ..Self::new(Model { rate_hz, axes })
        }
    }

    /// A model of all six axes and nothing beside.
    pub(crate) const fn new(model: Model) -> Self {
        Self {
            model,
            missing: Vec::new(),
            turn_on: None,
            spread: None,
            intervals: Vec::new(),
            provenance: None,
            reading: None,
        }
    }
}

/// Standard deviations of the constant bias that each switching-on draws anew, axis by axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TurnOn {
    /// Standard deviations of the accelerometers (m/s²).
    pub accel_m_s2: Option<[f64; 3]>,
    /// Standard deviations of the gyroscopes (rad/s).
    pub gyro_rad_s: Option<[f64; 3]>,
}

impl TurnOn {
    /// Standard deviations of a sensor's axes (m/s² or rad/s).
    #[must_use]
    pub const fn axes(&self, sensor: Sensor) -> Option<[f64; 3]> {
        match sensor {
            Sensor::Accel => self.accel_m_s2,
            Sensor::Gyro => self.gyro_rad_s,
        }
    }

    /// One for the three axes of a sensor, with the sum of their variances (m/s² or rad/s).
    pub(crate) fn sigma(&self, sensor: Sensor) -> Option<f64> {
        let [x, y, z] = self.axes(sensor)?;
        // like axes keep every bit
        let alike = x.to_bits() == y.to_bits() && y.to_bits() == z.to_bits();
        Some(if alike {
            x
        } else {
            ((x * x + y * y + z * z) / 3.0).sqrt()
        })
    }

    /// The key of a sensor.
    const fn key(sensor: Sensor) -> &'static str {
        match sensor {
            Sensor::Accel => "accel_m_s2",
            Sensor::Gyro => "gyro_rad_s",
        }
    }
}

/// The 95 % confidence interval of one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// The axis.
    pub channel: Channel,
    /// Label of the process, as [`nav_sim_signal::noise::Composite::labels`].
    pub process: String,
    /// Name of the parameter, as [`nav_sim_signal::noise::Process::parameters`].
    pub parameter: String,
    /// Lower end (units of the parameter; −∞ if unbounded).
    pub low: f64,
    /// Upper end (units of the parameter).
    pub high: f64,
}

/// Key of a schema under which advice stands on a value that is refused.
pub(super) const HINT: &str = "x-hint";

/// Ending of the key of a parameter's interval.
const CI: &str = "_ci95";

#[cfg(test)]
mod tests;

// What model files hold, for the reader and for editors.

/// Noise model: written by nav-sim calibrate, read by run, fuse, synthesize, export
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Noise model")]
struct ModelTable {
    /// Version of the layout
    #[serde(rename = "schema")]
    #[schemars(range(min = SCHEMA, max = SCHEMA))]
    _schema: Option<u64>,
    /// Sample rate that the variances are of (Hz)
    #[schemars(with = "Positive", range(max = MAX_RATE_HZ))]
    rate_hz: f64,
    accel: Option<SensorTable>,
    gyro: Option<SensorTable>,
    turn_on: Option<TurnOnTable>,
    spread: Option<SpreadTable>,
    /// Provenance of the model
    #[schemars(with = "Option<Map<String, serde_json::Value>>")]
    provenance: Option<toml::Table>,
}

/// All three axes by `processes`, or each by x, y, z
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
struct SensorTable {
    processes: Option<Vec<ProcessTable>>,
    /// Noise for navigation, read off the curve, where the processes do not describe the recordings
    reading: Option<Vec<ProcessTable>>,
    x: Option<AxisTable>,
    y: Option<AxisTable>,
    z: Option<AxisTable>,
}

/// One axis
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
struct AxisTable {
    processes: Vec<ProcessTable>,
    /// Noise for navigation, read off the curve, where the processes do not describe the recordings
    reading: Option<Vec<ProcessTable>>,
}

/// A process: its parameters by their names, and their intervals.
#[derive(Deserialize)]
struct ProcessTable(toml::Table);

impl JsonSchema for ProcessTable {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Process".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut kind = |kind: ProcessKind| {
            let mut properties = Map::new();
            let code = json!({ "type": "string", "const": kind.code() });
            properties.insert("type".to_owned(), code);
            for parameter in kind.parameters() {
                let mut schema = match parameter {
                    Parameter::Phi => generator.subschema_for::<Stationary>(),
                    Parameter::Theta => generator.subschema_for::<Between<-1, 1, false>>(),
                    Parameter::Beta => generator.subschema_for::<Positive>(),
                    Parameter::Slope => json_schema!({ "type": "number" }),
                    _ => generator.subschema_for::<NonNegative>(),
                };
                let hint = match parameter {
                    Parameter::Phi => {
                        "phi = exp(−1/(T·rate_hz)) for a correlation time of T seconds; for phi = 1 use RW"
                    }
                    _ => "a variance is ≥ 0; 0 switches the process off",
                };
                if !matches!(
                    parameter,
                    Parameter::Theta | Parameter::Beta | Parameter::Slope
                ) {
                    schema.insert(HINT.to_owned(), hint.into());
                }
                let end = match parameter {
                    Parameter::Phi | Parameter::Theta => {
                        generator.subschema_for::<Between<-1, 1, false>>()
                    }
                    Parameter::Slope => json_schema!({ "type": "number" }),
                    _ => generator.subschema_for::<NonNegative>(),
                };
                let ends = json!({ "type": "array", "minItems": 2, "maxItems": 2, "items": end });
                let name = parameter.name();
                properties.insert(format!("{name}{CI}"), ends);
                properties.insert(name.to_owned(), schema.to_value());
            }
            let required = properties.keys().filter(|key| !key.ends_with(CI));
            let required: Vec<String> = required.cloned().collect();
            json!({
                "description": format!("In units of {}", kind.units("the signal")),
                "type": "object",
                "properties": properties,
                "required": required,
                "additionalProperties": false,
            })
        };
        json_schema!({ "oneOf": ProcessKind::ALL.map(&mut kind) })
    }
}

/// Standard deviations of the constant bias of a switching-on: one, or one for each axis
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
struct TurnOnTable {
    accel_m_s2: Option<Sigmas<{ MAX_BIAS_M_S2 as i64 }>>,
    gyro_rad_s: Option<Sigmas<{ MAX_BIAS_RAD_S as i64 }>>,
}

/// One standard deviation for the three axes, or one for each.
type Sigmas<const MOST: i64> = OneOrEach<Between<0, MOST, false>, [Between<0, MOST, false>; 3]>;

/// Distribution of parameters between recordings: of all three axes of a sensor, or of each
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SpreadTable {
    accel: Option<OneOrEach<LawAxes, Vec<LawTable>>>,
    gyro: Option<OneOrEach<LawAxes, Vec<LawTable>>>,
}

/// Laws of each axis
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[derive(Default)]
struct LawAxes {
    x: Vec<LawTable>,
    y: Vec<LawTable>,
    z: Vec<LawTable>,
}

/// The law of a parameter of one process, such as AR1_2
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct LawTable {
    process: String,
    parameter: String,
    #[serde(flatten)]
    distribution: ParameterDistribution,
}

/// The JSON schema of a model file, for editors and checkers.
#[must_use]
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(ModelTable).to_value()
}

// Remarks of a calibration in the provenance of its model.

/// Converts a JSON object to a TOML table without its nulls, which TOML lacks.
pub(crate) fn known(json: serde_json::Value) -> toml::Table {
    let mut fields = json.as_object().cloned().unwrap_or_default();
    fields.retain(|_, value| !value.is_null());
    toml::Table::try_from(fields).expect("serialises")
}

/// Disagreement of a model with the recordings that it was fitted to, as its provenance has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// Probability of the J-test, if it was made.
    pub p_value: Option<f64>,
    /// Wavelet variance of the data over that of the model where it is furthest from 1, and that scale (s).
    pub worst: Option<(f64, f64)>,
    /// True if a reading of the curve replaces the model.
    pub is_read: bool,
}

impl fmt::Display for Misfit {
    /// `does not fit its recordings (p = 0.005, data/model 0.33 at 0.02 s)`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let p = self.p_value.map(|p| format!("p = {p:.3}"));
        let worst = self
            .worst
            .map(|(ratio, tau_s)| format!("data/model {} at {}", readable(ratio), duration(tau_s)));
        let figures: Vec<String> = p.into_iter().chain(worst).collect();
        write!(f, "does not fit its recordings ({})", figures.join(", "))?;
        match self.is_read {
            true => write!(f, ": navigation uses the reading of their curve"),
            false => Ok(()),
        }
    }
}

impl ModelFile {
    /// The estimator that made the model, if known.
    pub(crate) fn estimator(&self) -> Option<String> {
        let estimator = self.provenance.as_ref()?.get("estimator")?;
        estimator.as_str().map(str::to_owned)
    }

    /// The worst disagreement of the model with its recordings, where a fit of it does not describe them.
    #[must_use]
    pub fn misfit(&self) -> Option<Misfit> {
        let of_fit = |fit: &Value| {
            let number = |key| fit.get(key).and_then(Value::as_float);
            let (p_value, ratio) = (number("j_p_value"), number("worst_ratio"));
            let is_missed = ratio.is_some() || p_value.is_some_and(|p| p < 0.05);
            is_missed.then(|| Misfit {
                p_value,
                worst: ratio.zip(number("worst_tau_s")),
                is_read: self.reading.is_some(),
            })
        };
        let size = |m: &Misfit| m.worst.map_or(0.0, |(ratio, _)| ratio.ln().abs());
        let misfits = self.fits().filter_map(of_fit);
        misfits.max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// Entries of the provenance for each fit.
    fn fits(&self) -> impl Iterator<Item = &Value> {
        let fits = self.provenance.as_ref().and_then(|all| all.get("fits"));
        fits.and_then(Value::as_array).into_iter().flatten()
    }

    /// The longest averaging time (s) that the calibration saw: half its longest scale.
    pub(crate) fn observed_s(&self) -> Option<f64> {
        let scales = self
            .fits()
            .filter_map(|fit| fit.get("scales")?.as_integer());
        let scales = scales.max().filter(|n| (1..63).contains(n))?;
        Some((scales as f64 - 1.0).exp2() / self.model.rate_hz)
    }
}

// Reading model files.

/// Reads a model file.
///
/// # Errors
/// When the file cannot be read, is not TOML, has unknown keys, lacks some, or has values outside their
/// domains.
pub fn read(path: &Path) -> Result<ModelFile, Failure> {
    let refused = |e| file_kind::or_wrong_kind(&[FileKind::Model], path, e);
    parse(&TomlSource::read(path)?).map_err(refused)
}

/// A model file's text, at the path that messages show.
///
/// # Errors
/// As [`read`].
pub fn from_text(path: &Path, text: &str) -> Result<ModelFile, Failure> {
    parse(&TomlSource::new(&path.display().to_string(), text))
}

pub(super) fn parse(source: &TomlSource) -> Result<ModelFile, Failure> {
    let ModelTable {
        rate_hz,
        accel,
        gyro,
        turn_on,
        spread,
        provenance,
        ..
    } = source.get()?;
    let mut file = ModelFile::new(Model {
        rate_hz,
        axes: Default::default(),
    });
    for (sensor, table) in Sensor::ALL.into_iter().zip([accel, gyro]) {
        match table {
            Some(table) => read_sensor(source, sensor, &table, &mut file)?,
            None => file
                .missing
                .extend(Axis::ALL.map(|axis| Channel { sensor, axis })),
        }
    }
    if file.missing.len() == Channel::ALL.len() {
        return Err(source.missing("", &Sensor::ALL.map(Sensor::name)));
    }
    file.turn_on = turn_on.map(|table| TurnOn {
        accel_m_s2: table
            .accel_m_s2
            .map(|all| [0, 1, 2].map(|axis| all.of(axis))),
        gyro_rad_s: table
            .gyro_rad_s
            .map(|all| [0, 1, 2].map(|axis| all.of(axis))),
    });
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
    source: &TomlSource,
    sensor: Sensor,
    table: &SensorTable,
    file: &mut ModelFile,
) -> Result<(), Failure> {
    let name = sensor.name();
    let own = [&table.x, &table.y, &table.z];
    let is_empty = own.iter().all(|axis| axis.is_none()) || table.reading.is_some();
    if table.processes.is_none() && is_empty {
        return Err(source.missing(name, &["processes"]));
    }
    for (axis, own) in Axis::ALL.into_iter().zip(own) {
        let channel = Channel { sensor, axis };
        let key = format!("{name}.{}", axis.name());
        match (&table.processes, own) {
            (Some(_), Some(_)) => {
                let error = source.refused(&key, "is given for all axes and for this one");
                return Err(error.or_hint(format!("write either [{name}] or one table per axis")));
            }
            (Some(all), None) => {
                read_axis(source, name, all, table.reading.as_ref(), channel, file)?
            }
            (None, Some(own)) => read_axis(
                source,
                &key,
                &own.processes,
                own.reading.as_ref(),
                channel,
                file,
            )?,
            (None, None) => file.missing.push(channel),
        }
    }
    Ok(())
}

fn read_axis(
    source: &TomlSource,
    key: &str,
    processes: &[ProcessTable],
    reading: Option<&Vec<ProcessTable>>,
    channel: Channel,
    file: &mut ModelFile,
) -> Result<(), Failure> {
    read_processes(
        source,
        &format!("{key}.processes"),
        processes,
        channel,
        file,
    )?;
    let Some(read) = reading else { return Ok(()) };
    let rate_hz = file.model.rate_hz;
    let reading = file
        .reading
        .get_or_insert_with(|| Box::new(ModelFile::empty(rate_hz)));
    reading.missing.retain(|other| *other != channel);
    read_processes(source, &format!("{key}.reading"), read, channel, reading)
}

fn read_processes(
    source: &TomlSource,
    key: &str,
    tables: &[ProcessTable],
    channel: Channel,
    file: &mut ModelFile,
) -> Result<(), Failure> {
    let rate_hz = file.model.rate_hz;
    let keys = (1..).map(|i| format!("{key}[{i}]"));
    let tables: Vec<_> = keys.zip(tables.iter().map(|table| &table.0)).collect();
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

/// Largest parameter: sums of larger ones, such as a random walk's variances, could overflow.
const LARGEST: f64 = 1e30;

/// A number, written with a point or not.
fn number(value: &Value) -> f64 {
    let whole = value.as_integer().map(|whole| whole as f64);
    value.as_float().or(whole).unwrap_or(f64::NAN)
}

fn read_process(
    source: &TomlSource,
    key: &str,
    values: &toml::Table,
    rate_hz: f64,
) -> Result<Process, Failure> {
    let code = values["type"].as_str().unwrap_or_default();
    let kind = ProcessKind::named(code).expect("codes");
    let names = kind.parameters().iter().map(|p| p.name());
    let values: Vec<f64> = names.clone().map(|name| number(&values[name])).collect();
    if let Some((name, _)) = names.zip(&values).find(|(_, value)| value.abs() > LARGEST) {
        let reason = format!("is more than {LARGEST:e}");
        return Err(source.refused(&format!("{key}.{name}"), reason));
    }
    Process::of_values(kind, &values, rate_hz).map_err(|e| {
        let key = format!("{key}.{}", e.parameter);
        source.refused(&key, format!("is not {}", e.domain))
    })
}

fn read_laws(
    source: &TomlSource,
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
            let law = law.distribution;
            let variation = Variation::new(file.model.axis(channel), process, parameter, law)
                .map_err(|e| {
                    source.refused(&format!("{key}.{}", e.key), format!("is refused: {e}"))
                })?;
            if into
                .iter()
                .any(|v| (v.process.as_str(), v.of.parameter.name()) == (process, parameter))
            {
                let key = format!("{key}.parameter");
                return Err(source.refused(&key, "of this process is given twice"));
            }
            into.push(variation);
        }
    }
    Ok(())
}

// Writing model files: numbers in the shortest form that reads back to the same bits.

/// Writes a model file, whole or not at all.
///
/// # Errors
/// When the system refuses, or another model is there and is to stay.
pub fn write(path: &Path, file: &ModelFile) -> Result<(), Failure> {
    atomic::write(path, to_toml(file))
}

/// The text of a model file. A sensor whose three axes are alike is written once.
pub fn to_toml(file: &ModelFile) -> String {
    let mut out = format!(
        "#:schema {}\nschema = {SCHEMA}\nrate_hz = {:?}\n",
        schema_path("model"),
        file.model.rate_hz
    );
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
        let value = match axes {
            [x, y, z] if x == y && y == z => format!("{x:?}"),
            axes => format!("{axes:?}"),
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
    let mut out = list(file, channel, "processes");
    if let Some(reading) = &file.reading
        && !reading.missing.contains(&channel)
    {
        out += "# read off the curve, which the processes do not describe: used in navigation and exports\n";
        out += &list(reading, channel, "reading");
    }
    Some(out)
}

fn list(file: &ModelFile, channel: Channel, key: &str) -> String {
    let noise = file.model.axis(channel);
    let mut out = format!("{key} = [\n");
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
    out
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
    let mut table = known(json!(v.law));
    table.insert("process".into(), v.process.as_str().into());
    table.insert("parameter".into(), v.of.parameter.name().into());
    table.to_string()
}
