//! The IMU that a limit needs, what a given one makes of it, and a ranking of several.

mod given;
mod needed;
mod ranking;

pub use needed::Ask;
pub(crate) use needed::{CatalogueUnit, Requirements};

use crate::app::inputs::{self, ScenarioArgs, files};
use crate::app::{Answer, Command, Context, Failure, Out, OutputFile, Result};
use crate::io::atomic::Written;
use crate::io::datasheet::{self, CATALOGUE, Datasheet};
use crate::io::file_kind::{self, FileKind};
use crate::io::input::listed;
use crate::io::model_file::{self, ModelFile};
use crate::io::scenario_file;
use crate::parse;
use given::GivenImu;
use nav_sim_document::{
    Axis, Chart, Document, Importance, Panel, Series, readable, seconds, window,
};
use nav_sim_navigation::require::{Limit, Quantity, RequireError, Worst};
use nav_sim_navigation::sensors::aiding::AidingSettings;
use nav_sim_navigation::sensors::outage::{NotAnOutage, Outage};
use needed::NeededImu;
use ranking::{Ranking, stated_in_words};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::str::FromStr;

// `nav-sim require`: which IMU a limit needs, and what a given one makes of it.

/// Find the IMU that keeps the errors at the end of an outage within limits, or judge MODEL by them
///
/// Uses linear covariance analysis along TRAJECTORY of a filter that knows its IMU. Without MODEL it finds the white noise
/// and bias instability that each sensor may have beside the turn-on biases of [imu] in --scenario. With MODEL it says
/// whether the limits are kept (exit code 3: they are not), and the longest outage that it bridges.
#[derive(clap::Args, Debug, Clone)]
#[command(before_help = "\
Examples:
  nav-sim require trajectories/figure_eight.toml --outage 60 \\
      --require 'p95_m<=50' -o needed.toml
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage 60:120 --require 'rmse_m<=100'
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage longest --require 'p95_m<=20'")]
pub struct Require {
    /// Trajectory: motion profile (.toml) or table (.csv)
    pub trajectory: PathBuf,
    /// Noise model of an IMU
    pub model: Option<PathBuf>,
    /// Outage: a length in seconds (tried from every second on), START:END, or "longest" (needs MODEL)
    #[arg(long, value_name = "SECONDS")]
    pub outage: Ask,
    /// Earliest start of the outage in seconds [default: 300, less if the trajectory is short]
    #[arg(long, value_name = "SECONDS", value_parser = parse::non_negative)]
    pub start: Option<f64>,
    /// Limit at the end of the outage, as NAME<=LIMIT (repeatable): p50_m, p95_m, rmse_m (horizontal), roll_deg, pitch_deg,
    /// yaw_deg
    #[arg(id = "require", long = "require", value_name = "NAME<=LIMIT")]
    pub limits: Vec<Limit>,
    /// Scenario file whose section gnss is used
    #[arg(long, value_name = "FILE")]
    pub gnss: Option<PathBuf>,
    /// Receiver, start, IMU rate, aiding.
    #[command(flatten)]
    pub settings: ScenarioArgs,
    /// What the vehicle knows of its own motion: a car moves neither sideways nor up; with MODEL, a table with and without
    #[arg(long, value_name = "KIND", value_parser = ["car"])]
    pub vehicle: Option<String>,
    /// Rank the catalogued IMUs (`nav-sim datasheet --list`), or those of a directory of entries and model files
    #[arg(long, value_name = "DIR", num_args = 0..=1, default_missing_value = BUILT_IN, conflicts_with = "model")]
    pub catalogue: Option<PathBuf>,
}

/// Stands for the units that are known by name.
const BUILT_IN: &str = "built-in";

impl FromStr for Ask {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "longest" => Ok(Self::Longest),
            window if window.contains(':') => window
                .parse()
                .map(Self::Window)
                .map_err(|e: NotAnOutage| e.to_string()),
            length => parse::positive(length)
                .map(Self::Length)
                .map_err(|_| "expected a length in seconds, START:END or longest".to_owned()),
        }
    }
}

/// What is found.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Found {
    /// The IMU that is needed.
    Needed(Box<NeededImu>),
    /// What a given one makes of the limits.
    Given(Box<GivenImu>),
    /// Several of them, the best first.
    Ranked(Ranking),
}

/// What a limit needs, or what one or several IMUs make of it.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct RequireAnswer {
    found: Found,
    #[serde(skip)]
    file: Option<ModelFile>,
}

impl Command for Require {
    type Answer = RequireAnswer;
    const NAME: &'static str = "require";
    const OUT: Out = Out::File {
        kind: Written::Required,
        name: "needed.toml",
        help: "Model file to write, of the required IMU",
    };

    fn check_out(&self) -> Result<()> {
        if self.model.is_none() && self.catalogue.is_none() {
            return Ok(());
        }
        let message = "--out is for the required IMU: it cannot be used with MODEL or --catalogue";
        Err(Failure::input(message).hint("--plot FILE.html writes the page"))
    }

    fn inputs(&self) -> Result<Vec<(&'static str, PathBuf)>> {
        if let (Ask::Window(outage), Some(start_s)) = (self.outage, self.start) {
            let Outage {
                start_s: from,
                end_s: to,
            } = outage;
            let message = format!("--start {start_s} beside --outage {from}:{to}");
            return Err(
                Failure::input(message).hint("an outage of a length alone has an earliest start")
            );
        }
        if self.model.is_none() && self.outage == Ask::Longest {
            return Err(Failure::input("--outage longest needs a MODEL")
                .hint("without one, give a length in seconds"));
        }
        Ok(files("trajectory", [&self.trajectory])
            .chain(files("model", &self.model))
            .chain(files("scenario", &self.settings.scenario))
            .chain(files("gnss", &self.gnss))
            .collect())
    }

    fn run(&self, context: &Context<'_>) -> Result<RequireAnswer> {
        let asked = self.requirements(context)?;
        let of_others = |found| RequireAnswer { found, file: None };
        match (&self.model, &self.catalogue) {
            (Some(path), _) => given(path, &asked, self.vehicle.is_some(), context).map(of_others),
            (None, Some(directory)) => {
                let units = match directory.as_os_str() == BUILT_IN {
                    true => catalogue(&asked)?,
                    false => units_of(directory, &asked, context)?,
                };
                Ok(of_others(Found::Ranked(asked.ranked(&units)?)))
            }
            (None, None) => {
                let needed = sought(&asked)?;
                let file = Some(asked.model_file(&needed));
                let found = Found::Needed(Box::new(needed));
                Ok(RequireAnswer { found, file })
            }
        }
    }
}

impl Answer for RequireAnswer {
    fn document(&self) -> Document {
        match &self.found {
            Found::Needed(needed) => needed.document(),
            Found::Given(given) => given.document(),
            Found::Ranked(ranking) => ranking.document(),
        }
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        let file = self.file.as_ref().map(model_file::to_toml);
        file.map(|text| OutputFile::whole("", text))
            .into_iter()
            .collect()
    }

    /// The limits that are not kept.
    fn unmet(&self) -> Option<Failure> {
        match &self.found {
            Found::Needed(_) => None,
            Found::Given(judged) => {
                let missed = judged.judged.as_ref().filter(|judged| !judged.met)?;
                let Worst { limit, value, .. } = missed.worst;
                let [value, most] = [value, limit.most].map(|x| limit.quantity.shown(x));
                Some(Failure::bound(format!(
                    "{} is {value}, the limit is {most}",
                    limit.quantity
                )))
            }
            Found::Ranked(ranking) => (!ranking.is_met())
                .then(|| Failure::bound("no unit keeps the limits by figures that are all stated")),
        }
    }
}

impl Require {
    /// What is asked, with the files read.
    fn requirements(&self, context: &Context<'_>) -> Result<Requirements> {
        if self.limits.is_empty() {
            let hint = "give one, such as --require 'p95_m<=5' or --require 'yaw_deg<=1'";
            return Err(Failure::input("no limit is given").hint(hint));
        }
        let mut scenario = self.settings.read()?;
        if let Some(path) = &self.gnss {
            scenario.gnss = scenario_file::read(path)?.gnss;
        }
        if self.vehicle.is_some() {
            if !scenario.aiding.is_none() {
                return Err(
                    Failure::input("--vehicle car beside [aiding] of --scenario")
                        .hint("give one of them"),
                );
            }
            scenario.aiding = AidingSettings::car();
        }
        scenario.validate().map_err(Failure::input)?;
        let trajectory = inputs::trajectory(&self.trajectory, context)?;
        let limits = self.limits.clone();
        Requirements::new(scenario, trajectory, limits, self.outage, self.start)
    }
}

/// The IMU that is needed.
fn sought(requirements: &Requirements) -> Result<NeededImu> {
    requirements.needed().map_err(|e| {
        let hint = match e {
            RequireError::Loose { .. } => "a smaller limit, or a longer outage",
            _ => "a larger limit, a shorter outage, or a better receiver ([gnss] of --scenario)",
        };
        Failure::input(e).hint(hint)
    })
}

/// What a given IMU makes of the limits.
fn given(
    path: &Path,
    requirements: &Requirements,
    has_vehicle: bool,
    context: &Context<'_>,
) -> Result<Found> {
    let unusable = |e: RequireError| Failure::input(format!("{}: {e}", path.display()));
    let file = inputs::model(path, context)?;
    let mut scenario = requirements.scenario.clone();
    inputs::expect_turn_on(&mut scenario.initial, &file, path, context);
    inputs::make_turn_on(&mut scenario.imu, &file, path, context);
    let not_stated = stated_in_words(&file.not_stated());
    if !not_stated.is_empty() {
        let text = format!(
            "{}: what is not stated counts as none: {not_stated}",
            path.display()
        );
        context.warn(text);
    }
    let model = inputs::at_rate(path, &file.model, scenario.imu.rate_hz, context)?;
    let mut judged = requirements.judged(&scenario, &model).map_err(unusable)?;
    if has_vehicle {
        judged.aidings = requirements.aidings(&scenario, &model).map_err(unusable)?;
    }
    Ok(Found::Given(Box::new(judged)))
}

/// The units that are known by name.
fn catalogue(requirements: &Requirements) -> Result<Vec<CatalogueUnit>> {
    let unit = |(name, _): &(&str, &str)| {
        let sheet = datasheet::catalogued(name).expect("a name of the catalogue")?;
        of_sheet((*name).to_owned(), &sheet, requirements)
    };
    CATALOGUE.iter().map(unit).collect()
}

/// The model files and catalogue entries of a directory.
fn units_of(
    directory: &Path,
    asked: &Requirements,
    context: &Context<'_>,
) -> Result<Vec<CatalogueUnit>> {
    if !directory.exists() {
        let message = format!(
            "--catalogue {}: there is no such directory",
            directory.display()
        );
        return Err(Failure::input(message)
            .hint("without a directory, --catalogue ranks the catalogued IMUs"));
    }
    let mut paths = listed(&[directory.to_owned()])?;
    paths.retain(|p| p.extension().is_some_and(|e| e == "toml"));
    if paths.is_empty() {
        let message = format!("{}: no model file (.toml)", directory.display());
        return Err(Failure::input(message)
            .hint("make them with `nav-sim calibrate` or `nav-sim datasheet`"));
    }
    let unit = |path: &PathBuf| {
        let name = path
            .file_stem()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        if file_kind::of(path)? == FileKind::CatalogueEntry {
            return of_sheet(name, &datasheet::read(path)?, asked);
        }
        let file = inputs::model(path, context)?;
        let model = inputs::at_rate(path, &file.model, asked.scenario.imu.rate_hz, context)?;
        Ok(asked.unit(name, &file, model))
    };
    paths.iter().map(unit).collect()
}

fn of_sheet(name: String, sheet: &Datasheet, requirements: &Requirements) -> Result<CatalogueUnit> {
    let made = sheet.model_file(requirements.scenario.imu.rate_hz);
    let file = made
        .map_err(|e| Failure::input(format!("{name}: {e}")))?
        .file;
    Ok(requirements.unit(name, &file, file.model.clone()))
}

// Limits, the places of an outage, and what all answers share: curves of drift, doubts.

/// Lengths of an outage on the curves of units (s).
pub(super) const CURVE_S: [u32; 7] = [1, 3, 10, 30, 60, 120, 300];
/// Longest outage that is looked at (s).
pub(super) const LONGEST_S: f64 = 600.0;
/// What confirms a figure of covariance analysis.
pub(super) const CONFIRM: &str = "confirm with nav-sim run --method both";
/// Last line of each page.
pub(super) const CHECKED: &str = "covariance analysis against sampled runs: docs/validation.md.";
/// Caption of drift curves.
pub(super) const DRIFT: &str =
    "The error at the end of an outage against its length, at the worst of the places.";

/// The error after an outage; none where the trajectory is too short.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct DriftPoint {
    pub outage_s: u32,
    pub value: Option<f64>,
}

/// Warns of an outage in which errors are beyond linear theory.
pub(super) fn note_beyond(beyond: Option<Outage>, document: &mut Document) {
    if let Some(Outage { start_s, end_s }) = beyond {
        let place = window(start_s, end_s);
        let text = format!("beyond linear theory in outage {place}: {CONFIRM}");
        document.note(Importance::Warning, text);
    }
}

/// What was asked, and where.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Question {
    /// The limits.
    pub limits: Vec<Limit>,
    /// The places of the outage.
    pub outages: Vec<Outage>,
}

impl Question {
    /// `p95_m ≤ 5 after an outage of 60 s (the worst of 541 starts tried, 300 to 840 s)`
    pub(super) fn in_words(&self) -> String {
        let first = self.outages[0];
        let worst = if self.outages.len() > 1 {
            "the worst of "
        } else {
            ""
        };
        let length = seconds(first.end_s - first.start_s);
        format!(
            "{} after an outage of {length} s ({worst}{})",
            self.limits_in_words(),
            self.starts()
        )
    }

    /// Places where the outage was tried: `541 starts tried, 300 to 840 s`, or `from 300 s on`.
    pub(super) fn starts(&self) -> String {
        let [first, last] =
            [self.outages.first(), self.outages.last()].map(|o| o.map_or(0.0, |o| o.start_s));
        if last > first {
            format!(
                "{} starts tried, {} to {} s",
                self.outages.len(),
                seconds(first),
                seconds(last)
            )
        } else {
            format!("from {} s on", seconds(first))
        }
    }

    pub(super) fn limits_in_words(&self) -> String {
        let limit = |l: &Limit| format!("{} ≤ {}", l.quantity, readable(l.most));
        self.limits.iter().map(limit).collect::<Vec<_>>().join(", ")
    }

    /// `p95_m 4.87 at the end of outage 300–360 s`
    pub(super) fn worst(&self, worst: &Worst) -> String {
        let outage = self.outages.get(worst.place).unwrap_or(&self.outages[0]);
        let place = window(outage.start_s, outage.end_s);
        format!(
            "{} {} at the end of outage {place}",
            worst.limit.quantity,
            readable(worst.value)
        )
    }
}

/// A quantity and its unit, for axes and heads.
pub(super) const fn quantity_in_words(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::P50 => "horizontal error, median (m)",
        Quantity::P95 => "horizontal error, 95 % quantile (m)",
        Quantity::Rmse => "horizontal error, RMSE (m)",
        Quantity::Roll => "roll, RMSE (°)",
        Quantity::Pitch => "pitch, RMSE (°)",
        Quantity::Yaw => "yaw, RMSE (°)",
    }
}

pub(super) fn drift_chart(quantity: Quantity, series: Vec<Series>) -> Chart {
    let panel = Panel {
        height: 1.3,
        ..Panel::new(Axis::log(quantity_in_words(quantity)), series)
    };
    Chart::new(
        "Drift without fixes",
        Axis::log("length of the outage (s)"),
        vec![panel],
    )
}

pub(super) fn points(curve: &[DriftPoint]) -> Vec<(f64, f64)> {
    let point = |p: &DriftPoint| (f64::from(p.outage_s), p.value.unwrap_or(f64::NAN));
    curve.iter().map(point).collect()
}
