//! `nav-sim datasheet`: models from data sheets, and the catalogue of IMUs.

use crate::app::{Command, Context, Failure, IntoFailure, OutputKind, PlainAnswer, Result};
use crate::io::datasheet::{
    CATALOGUE, Datasheet, DatasheetEntry, Figure, GRADE, StatedQuantity, catalogued, measured, read,
};
use crate::io::model_file;
use crate::io::recordings::facts::out_of_range;
use crate::io::suggest::nearest;
use crate::parse;
use nav_sim_document::{Document, Tone};
use nav_sim_signal::imu::Sensor;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Make a noise model from the figures of a data sheet, in their own units: an assumption, not a calibration
///
/// The model has white noise of the given density, Gauss-Markov processes whose Allan deviation has the bias
/// instability as its minimum, and a random walk. [provenance] of the model file holds every figure as given and the
/// parameters that follow from it. Flags override the entry of the catalogue, and the file of --from.
#[derive(clap::Args, Debug, Clone)]
pub struct DatasheetArgs {
    /// Catalogue entry (TOML)
    #[arg(value_name = "ENTRY", conflicts_with = "unit")]
    entry: Option<PathBuf>,
    /// Catalogue entry by name (see --list)
    #[arg(long, value_name = "NAME")]
    unit: Option<String>,
    /// Figures that Kalibr, allan_variance_ros or imu_utils measured (YAML)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["entry", "unit"])]
    from: Option<PathBuf>,
    /// Figures in the place of the entry's.
    #[command(flatten)]
    figures: Figures,
    /// List the catalogue
    #[arg(long)]
    list: bool,
    /// Sample rate of the model [default: that of --from, else 100]
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz)]
    rate_hz: Option<f64>,
}

impl Command for DatasheetArgs {
    type Answer = PlainAnswer;
    const NAME: &'static str = "datasheet";
    const OUT: OutputKind = OutputKind::File {
        name: "model.toml",
        help: "Model file (default: stdout)",
    };
    const PLOT: bool = false;
    const PRINTS_FILE: bool = true;

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        if self.list {
            let units = CATALOGUE.iter().map(|(name, _)| catalogued_unit(name));
            let units = units.collect::<Result<Vec<_>>>()?;
            let document = Document::new("Data sheets", Tone::Good, units.iter().flat_map(lines));
            let json = json!({ "schema_version": 1, "units": units });
            return Ok(PlainAnswer::new(json, document));
        }
        let (mut sheet, rate_hz) = match (&self.entry, &self.unit, &self.from) {
            (Some(path), ..) => (read(path)?, None),
            (_, Some(name), _) => (named(name)?, None),
            (.., Some(path)) => measured(path, self.rate_hz)?,
            _ => (Datasheet::default(), None),
        };
        if self.from.is_some() {
            for assumption in &sheet.assumptions {
                context.remark(assumption);
            }
        }
        self.figures.over(&mut sheet);
        let rate_hz = self.rate_hz.or(rate_hz).unwrap_or(100.0);
        let made = sheet.model_file(rate_hz).map_err(Failure::input)?;
        if made.file.missing.len() == made.file.model.axes.len() {
            return Err(Failure::input("no figure gives a noise model")
                .hint("give --vrw and --arw, or --unit NAME (nav-sim datasheet --list)"));
        }
        Sensor::ALL
            .into_iter()
            .flat_map(|sensor| lacking(&sheet, sensor))
            .chain(made.doubts)
            .chain(out_of_range(&made.file.model))
            .for_each(|doubt| context.warn(doubt));
        context.remark("an assumption, not a calibration");
        // a model file with the same keys as JSON
        let text = model_file::to_toml(&made.file);
        let json = text.parse::<toml::Table>().refuse()?;
        let document = Document::new("Data sheet", Tone::Good, [""; 0]);
        Ok(PlainAnswer::new(json!(json), document).with([("", text)]))
    }
}

/// Figures: a number and its unit, such as '0.15 deg/sqrt(h)'; others in a catalogue entry.
#[derive(clap::Args, Debug, Clone, Default, PartialEq)]
#[command(next_help_heading = "Figures, a number and its unit ('0.15 deg/sqrt(h)')")]
pub struct Figures {
    /// Velocity random walk or noise density of the accelerometers: m/s/sqrt(h), ug/sqrt(Hz), …
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::Noise))]
    vrw: Option<StatedQuantity>,
    /// Angle random walk or noise density of the gyroscopes: deg/sqrt(h), deg/s/sqrt(Hz), …
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Gyro, Figure::Noise))]
    arw: Option<StatedQuantity>,
    /// Bias instability of the accelerometers: ug, mg, m/s²
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::Bias))]
    accel_bias: Option<StatedQuantity>,
    /// Bias instability of the gyroscopes: deg/h, deg/s, rad/s
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Gyro, Figure::Bias))]
    gyro_bias: Option<StatedQuantity>,
    /// Rate random walk K of the accelerometers: m/s²/sqrt(h), m/s³/sqrt(Hz), …
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::Walk))]
    accel_rrw: Option<StatedQuantity>,
    /// Rate random walk K of the gyroscopes: deg/h/sqrt(h), rad/s²/sqrt(Hz), …
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Gyro, Figure::Walk))]
    gyro_rrw: Option<StatedQuantity>,
    /// Longest correlation time of both biases: s, min, h [default: 300 s, with a warning]
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::CorrelationTime))]
    corr_time: Option<StatedQuantity>,
    /// Turn-on bias of the accelerometers, as a standard deviation: mg, m/s²
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::TurnOn))]
    accel_turn_on: Option<StatedQuantity>,
    /// Turn-on bias of the gyroscopes, as a standard deviation: deg/s, deg/h
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Gyro, Figure::TurnOn))]
    gyro_turn_on: Option<StatedQuantity>,
}

/// Checks a figure of a sensor.
fn figure(
    sensor: Sensor,
    figure: Figure,
) -> impl Fn(&str) -> Result<StatedQuantity, String> + Clone {
    move |text| StatedQuantity::parse(text, figure.units(sensor))
}

impl Figures {
    /// Puts them into a sheet, over its own.
    fn over(&self, sheet: &mut Datasheet) {
        let given = [
            (Sensor::Accel, Figure::Noise, &self.vrw),
            (Sensor::Gyro, Figure::Noise, &self.arw),
            (Sensor::Accel, Figure::Bias, &self.accel_bias),
            (Sensor::Gyro, Figure::Bias, &self.gyro_bias),
            (Sensor::Accel, Figure::Walk, &self.accel_rrw),
            (Sensor::Gyro, Figure::Walk, &self.gyro_rrw),
            (Sensor::Accel, Figure::CorrelationTime, &self.corr_time),
            (Sensor::Gyro, Figure::CorrelationTime, &self.corr_time),
            (Sensor::Accel, Figure::TurnOn, &self.accel_turn_on),
            (Sensor::Gyro, Figure::TurnOn, &self.gyro_turn_on),
        ];
        for (sensor, figure, quantity) in given {
            if let Some(quantity) = quantity {
                sheet.set(DatasheetEntry {
                    sensor,
                    figure,
                    quantity: quantity.clone(),
                    source: Some("command line".into()),
                    quote: None,
                });
            }
        }
    }
}

fn named(name: &str) -> Result<Datasheet> {
    if let Some(sheet) = catalogued(name) {
        return sheet;
    }
    Err(
        Failure::input(format!("--unit {name} is not in the catalogue")).hint(
            match nearest(name, CATALOGUE.iter().map(|(known, _)| *known)) {
                Some(meant) => format!("did you mean \"{meant}\"?"),
                None => "nav-sim datasheet --list shows all".to_owned(),
            },
        ),
    )
}

fn lacking(sheet: &Datasheet, sensor: Sensor) -> impl Iterator<Item = String> {
    sheet.lacking(sensor).map(move |(figure, entry)| {
        let (name, flag) = match (figure, sensor) {
            (Figure::Noise, Sensor::Accel) => ("white noise", "vrw".to_owned()),
            (Figure::Noise, Sensor::Gyro) => ("white noise", "arw".to_owned()),
            (Figure::Bias, _) => ("bias instability", format!("{sensor}-bias")),
            _ => ("turn-on bias", format!("{sensor}-turn-on")),
        };
        match entry {
            Some(entry) => {
                let given = &entry.quantity.given;
                format!(
                    "{sensor}: {name} {given} by grade, not stated by the data sheet (--{flag})"
                )
            }
            None => format!("{sensor}: no {name} (--{flag})"),
        }
    })
}

/// A catalogued unit with the figures of its data sheet.
fn catalogued_unit(name: &str) -> Result<Value> {
    let sheet = named(name)?;
    let figure = |e: &DatasheetEntry| {
        json!({
            "sensor": e.sensor,
            "figure": e.figure.name(),
            "given": e.quantity.given,
            "source": e.source,
        })
    };
    let figures: Value = sheet.entries.iter().map(figure).collect();
    Ok(json!({ "unit": name, "name": sheet.name, "class": sheet.class, "figures": figures }))
}

/// The unit, and a line of figures for each sensor.
fn lines(unit: &Value) -> [String; 3] {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let figures = |sensor: Sensor| {
        let own = unit["figures"].as_array().into_iter().flatten();
        let own = own.filter(|f| f["sensor"] == sensor.name());
        let shown: Vec<_> = own
            .map(|f| {
                let grade = if f["source"] == GRADE { " (grade)" } else { "" };
                text(&f["figure"]) + " " + &text(&f["given"]) + grade
            })
            .collect();
        format!("  {sensor:<5} {}", shown.join(", "))
    };
    let [name, class, title] = ["unit", "class", "name"].map(|key| text(&unit[key]));
    let [accel, gyro] = Sensor::ALL.map(figures);
    [format!("{name:<12} {class:<12} {title}"), accel, gyro]
}
