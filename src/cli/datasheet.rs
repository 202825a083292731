//! `nav-sim datasheet`: a datasheet's figures → a model file.

use super::pictures::claim_output;
use super::{Failure, Session, parse};
use crate::formats::atomic::Written;
use crate::formats::datasheet::{self, CATALOGUE, Datasheet, Entry, Figure, Quantity};
use crate::formats::model_file;
use crate::formats::suggest::nearest;
use nav_sim_signal::imu::Sensor;
use std::path::PathBuf;

/// Make a noise model from the figures of a data sheet, in their own units: an assumption, not a calibration
///
/// The model has white noise of the given density, Gauss-Markov processes whose Allan deviation has the bias
/// instability as its minimum, and a random walk. [provenance] of the model file holds every figure as given and the
/// parameters that follow from it. Flags override the entry of the catalogue.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim datasheet --unit stim300 --rate-hz 100 -o stim300.toml
  nav-sim datasheet calib_data/catalogue/adis16470.toml --corr-time 100s -o adis16470.toml
  nav-sim datasheet --list")]
pub(crate) struct Args {
    /// Catalogue entry (TOML)
    #[arg(value_name = "ENTRY", conflicts_with = "unit")]
    entry: Option<PathBuf>,
    /// Catalogue entry by name (see --list)
    #[arg(long, value_name = "NAME")]
    unit: Option<String>,
    /// List the catalogue
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    figures: Figures,
    /// Sample rate of the model
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz, default_value = "100")]
    rate_hz: f64,
    /// Model file to write (default: to stdout)
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Figures: a number and its unit, such as '0.15 deg/sqrt(h)'; others in a catalogue entry.
#[derive(clap::Args, Debug)]
#[command(next_help_heading = "Figures, a number and its unit ('0.15 deg/sqrt(h)')")]
struct Figures {
    /// Velocity random walk or noise density of the accelerometers: m/s/sqrt(h), ug/sqrt(Hz), …
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::Noise))]
    vrw: Option<Quantity>,
    /// Angle random walk or noise density of the gyroscopes: deg/sqrt(h), deg/s/sqrt(Hz), …
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Gyro, Figure::Noise))]
    arw: Option<Quantity>,
    /// Bias instability of the accelerometers: ug, mg, m/s²
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::Bias))]
    accel_bias: Option<Quantity>,
    /// Bias instability of the gyroscopes: deg/h, deg/s, rad/s
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Gyro, Figure::Bias))]
    gyro_bias: Option<Quantity>,
    /// Longest correlation time of both biases: s, min, h [default: 300 s, with a warning]
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::CorrelationTime))]
    corr_time: Option<Quantity>,
    /// Turn-on bias of the accelerometers, as a standard deviation: mg, m/s²
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Accel, Figure::TurnOn))]
    accel_turn_on: Option<Quantity>,
    /// Turn-on bias of the gyroscopes, as a standard deviation: deg/s, deg/h
    #[arg(long, value_name = "FIGURE", value_parser = figure(Sensor::Gyro, Figure::TurnOn))]
    gyro_turn_on: Option<Quantity>,
}

/// Reads a figure of a sensor.
fn figure(sensor: Sensor, figure: Figure) -> impl Fn(&str) -> Result<Quantity, String> + Clone {
    move |text| Quantity::parse(text, figure.units(sensor)).map_err(|e| e.to_string())
}

impl Figures {
    /// Those that are given, in the place of those of an entry.
    fn over(&self, sheet: &mut Datasheet) {
        let given = [
            (Sensor::Accel, Figure::Noise, &self.vrw),
            (Sensor::Gyro, Figure::Noise, &self.arw),
            (Sensor::Accel, Figure::Bias, &self.accel_bias),
            (Sensor::Gyro, Figure::Bias, &self.gyro_bias),
            (Sensor::Accel, Figure::CorrelationTime, &self.corr_time),
            (Sensor::Gyro, Figure::CorrelationTime, &self.corr_time),
            (Sensor::Accel, Figure::TurnOn, &self.accel_turn_on),
            (Sensor::Gyro, Figure::TurnOn, &self.gyro_turn_on),
        ];
        for (sensor, figure, quantity) in given {
            if let Some(quantity) = quantity.clone() {
                sheet.set(Entry {
                    sensor,
                    figure,
                    quantity,
                    source: Some("command line".into()),
                    quote: None,
                });
            }
        }
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    if args.list {
        let listed = if session.json() {
            crate::datasheet::catalogue_json()?
        } else {
            crate::datasheet::catalogue_text()?
        };
        session.result(listed.trim_end());
        return Ok(());
    }
    let _own = claim_output(args.out.as_deref(), &args.entry, Written::Datasheet, session)?;
    let mut sheet = match (&args.entry, &args.unit) {
        (Some(path), _) => datasheet::read(path)?,
        (None, Some(name)) => named(name)?,
        (None, None) => Datasheet::default(),
    };
    args.figures.over(&mut sheet);
    let made = sheet.model_file(args.rate_hz).map_err(Failure::input)?;
    if made.file.missing.len() == made.file.model.axes.len() {
        let failure = Failure::input("no figure is given that makes a noise model");
        return Err(failure.hint("give --vrw and --arw, or --unit NAME (nav-sim datasheet --list)"));
    }
    for sensor in Sensor::ALL {
        doubt(&sheet, sensor, session);
    }
    session.warn_all(&made.doubts);
    let Some(out) = &args.out else {
        let toml = model_file::to_toml(&made.file);
        session.result(&if session.json() { as_json(&toml)? } else { toml.trim_end().to_owned() });
        return Ok(());
    };
    model_file::write(out, &made.file)?;
    if session.json() {
        session.result(&as_json(&model_file::to_toml(&made.file))?);
    }
    session.say(format!("wrote {}: an assumption, not a calibration", out.display()));
    Ok(())
}

/// A model file with the same keys as JSON.
fn as_json(toml: &str) -> Result<String, Failure> {
    let table: toml::Table = toml.parse().map_err(Failure::could_not)?;
    serde_json::to_string_pretty(&table).map_err(Failure::could_not)
}

/// What the figures lack, and what a model file does not hold.
fn doubt(sheet: &Datasheet, sensor: Sensor, session: &Session) {
    let name = sensor.name();
    let flag = if sensor == Sensor::Accel { "--vrw" } else { "--arw" };
    if sheet.value(sensor, Figure::Noise).is_none() {
        session.warn(format!("{name}: no white noise is given ({flag})"));
    }
    if sheet.value(sensor, Figure::Bias).is_none() {
        session.warn(format!("{name}: no bias instability is given (--{name}-bias)"));
    }
    if sheet.value(sensor, Figure::TurnOn).is_none() {
        session.warn(format!("{name}: no turn-on bias is given (--{name}-turn-on)"));
    }
    if let Some(offset) = sheet.given(sensor, Figure::Offset) {
        session
            .say(format!("{name}: the zero offset of ±{offset} is removed before use and not in the model"));
    }
    if let Some(ppm) = sheet.value(sensor, Figure::Scale) {
        session.say(format!("{name}: the scale factor of {ppm} ppm is not in the model: run --scale-ppm"));
    }
}

fn named(name: &str) -> Result<Datasheet, Failure> {
    if let Some(sheet) = datasheet::catalogued(name) {
        return Ok(sheet?);
    }
    let failure = Failure::input(format!("--unit {name}: the catalogue has no such unit"));
    Err(failure.hint(match nearest(name, CATALOGUE.iter().map(|(known, _)| *known)) {
        Some(meant) => format!("did you mean {meant}?"),
        None => "nav-sim datasheet --list shows what there is".to_owned(),
    }))
}
