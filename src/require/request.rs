//! The request of a search for an IMU: the arguments of `nav-sim require`.

use super::given::GivenImu;
use super::needed::NeededImu;
use super::ranking::{Ranking, stated_in_words};
use super::{Ask, CatalogueUnit, Misplaced, Requirements};
use crate::app::Answered;
use crate::app::Context;
use crate::app::Failure;
use crate::app::inputs as read;
use crate::formats::datasheet::{self, CATALOGUE, Datasheet};
use crate::formats::file_kind::{self, FileKind};
use crate::formats::input::listed;
use crate::formats::model_file::{self, ModelFile};
use crate::formats::scenario_file;
use crate::parse;
use crate::report::Answer;
use nav_sim_document::Document;
use nav_sim_navigation::require::{Limit, Quantity, RequireError, Worst};
use nav_sim_navigation::sensors::aiding::AidingSettings;
use nav_sim_navigation::sensors::outage::NotAnOutage;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Limits on the errors after an outage, and where they hold.
#[derive(clap::Args, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RequireRequest {
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
    #[arg(long = "require", value_name = "NAME<=LIMIT")]
    #[serde(rename = "require")]
    pub limits: Vec<LimitFlag>,
    /// Scenario file whose section gnss is used
    #[arg(long, value_name = "FILE")]
    pub gnss: Option<PathBuf>,
    /// Scenario file: receiver, start, IMU rate, aiding (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// What the vehicle knows of its own motion: a car moves neither sideways nor up; with MODEL, a table with and without
    #[arg(long, value_name = "KIND", value_parser = parse::one_of::<Vehicle>(&Vehicle::NAMES))]
    pub vehicle: Option<Vehicle>,
    /// Rank the catalogued IMUs (`nav-sim datasheet --list`), or those of a directory of entries and model files
    #[arg(long, value_name = "DIR", num_args = 0..=1, default_missing_value = Catalogue::BUILT_IN,
        conflicts_with = "model")]
    pub catalogue: Option<Catalogue>,
}

impl Default for RequireRequest {
    fn default() -> Self {
        Self {
            trajectory: PathBuf::new(),
            model: None,
            outage: Ask::Length(60.0),
            start: None,
            limits: Vec::new(),
            gnss: None,
            scenario: None,
            vehicle: None,
            catalogue: None,
        }
    }
}

/// A vehicle that knows something of its own motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Vehicle {
    /// A road vehicle.
    Car,
}

nav_sim_signal::named!(Vehicle { Car = "car" }, in files);

/// A value of `--require`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitFlag(pub Limit);

parse::textual!(LimitFlag);

impl fmt::Display for LimitFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}<={}", self.0.quantity.name(), self.0.most)
    }
}

impl FromStr for LimitFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let limit = || {
            let (name, most) = text.split_once("<=").or_else(|| text.split_once('<'))?;
            let quantity = Quantity::ALL
                .into_iter()
                .find(|quantity| quantity.name() == name.trim())?;
            Some(Self(Limit {
                quantity,
                most: parse::positive(most.trim()).ok()?,
            }))
        };
        let names = Quantity::ALL.map(Quantity::name).join(", ");
        limit().ok_or_else(|| {
            format!("expected NAME<=LIMIT with a positive limit, NAME one of {names}")
        })
    }
}

parse::textual!(Ask);

impl fmt::Display for Ask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length(length_s) => length_s.fmt(f),
            Self::Window(outage) => write!(f, "{}:{}", outage.start_s, outage.end_s),
            Self::Longest => f.write_str("longest"),
        }
    }
}

impl FromStr for Ask {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
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

/// Units that are ranked.
#[derive(Debug, Clone, PartialEq)]
pub enum Catalogue {
    /// Those that are known by name.
    BuiltIn,
    /// Entries and model files of a directory.
    Directory(PathBuf),
}

impl Catalogue {
    const BUILT_IN: &str = "built-in";
}

parse::textual!(Catalogue);

impl fmt::Display for Catalogue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BuiltIn => f.write_str(Self::BUILT_IN),
            Self::Directory(path) => path.display().fmt(f),
        }
    }
}

impl FromStr for Catalogue {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(if text == Self::BUILT_IN {
            Self::BuiltIn
        } else {
            Self::Directory(text.into())
        })
    }
}

/// What is found.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Found {
    /// The IMU that is needed.
    Needed(Box<NeededImu>),
    /// What a given one makes of the limits.
    Given(Box<GivenImu>),
    /// Several of them, the best first.
    Ranked(Ranking),
}

impl Answer for Found {
    fn document(&self) -> Document {
        match self {
            Self::Needed(needed) => needed.document(),
            Self::Given(given) => given.document(),
            Self::Ranked(ranking) => ranking.document(),
        }
    }
}

impl Found {
    /// The limits that are not kept.
    pub(crate) fn unmet(&self) -> Option<Failure> {
        match self {
            Self::Needed(_) => None,
            Self::Given(judged) => {
                let margins = judged.margins.as_ref().filter(|margins| !margins.met())?;
                let Worst { limit, value, .. } = margins.worst;
                let [value, most] = [value, limit.most].map(|x| limit.quantity.shown(x));
                Some(Failure::bound(format!(
                    "{} is {value}, the limit is {most}",
                    limit.quantity.name()
                )))
            }
            Self::Ranked(ranking) => (!ranking.is_met())
                .then(|| Failure::bound("no unit keeps the limits by figures that are all stated")),
        }
    }
}

impl RequireRequest {
    /// What is found, and the model of the IMU that is needed.
    pub(crate) fn found(
        &self,
        context: &Context<'_>,
    ) -> Result<(Found, Option<ModelFile>), Failure> {
        self.possible()?;
        let asked = self.requirements(context)?;
        match (&self.model, &self.catalogue) {
            (Some(path), _) => Ok((given(path, &asked, self.vehicle, context)?, None)),
            (None, Some(Catalogue::BuiltIn)) => Ok((ranked(&catalogue(&asked)?, &asked)?, None)),
            (None, Some(Catalogue::Directory(directory))) => Ok((
                ranked(&units_of(directory, &asked, context)?, &asked)?,
                None,
            )),
            (None, None) => {
                let needed = sought(&asked)?;
                let file = asked.model_file(&needed);
                Ok((Found::Needed(Box::new(needed)), Some(file)))
            }
        }
    }

    /// As `nav-sim require` prints it; the IMU that is needed is the file `needed.toml`.
    ///
    /// # Errors
    /// What is wrong with a file or a setting, or that no IMU keeps the limits.
    pub fn answer(&self, context: &Context<'_>) -> Result<Answered, Failure> {
        let (found, needed) = self.found(context)?;
        let files = needed
            .map(|file| ("needed.toml".to_owned(), model_file::to_toml(&file)))
            .into_iter()
            .collect();
        Ok(Answered {
            files,
            unmet: found.unmet(),
            ..Answered::of(&found)
        })
    }

    /// Refuses what contradicts itself.
    pub(crate) fn possible(&self) -> Result<(), Failure> {
        if let (Ask::Window(outage), Some(start_s)) = (self.outage, self.start) {
            let message = format!(
                "--start {start_s} beside --outage {}:{}",
                outage.start_s, outage.end_s
            );
            return Err(
                Failure::input(message).hint("an outage of a length alone has an earliest start")
            );
        }
        if self.model.is_none() && self.outage == Ask::Longest {
            return Err(Failure::input("--outage longest needs a MODEL")
                .hint("without one, give a length in seconds"));
        }
        Ok(())
    }

    /// The limits that are given; at least one.
    fn limits(&self) -> Result<Vec<Limit>, Failure> {
        let limits: Vec<Limit> = self.limits.iter().map(|limit| limit.0).collect();
        if limits.is_empty() {
            let hint = "give one, such as --require 'p95_m<=5' or --require 'yaw_deg<=1'";
            return Err(Failure::input("no limit is given").hint(hint));
        }
        Ok(limits)
    }

    /// What is asked, with the files read.
    fn requirements(&self, context: &Context<'_>) -> Result<Requirements, Failure> {
        let limits = self.limits()?;
        let mut scenario = self
            .scenario
            .as_deref()
            .map(scenario_file::read)
            .transpose()?
            .unwrap_or_default();
        if let Some(path) = &self.gnss {
            scenario.gnss = scenario_file::read(path)?.gnss;
        }
        if self.vehicle == Some(Vehicle::Car) {
            if !scenario.aiding.is_none() {
                return Err(
                    Failure::input("--vehicle car beside [aiding] of --scenario")
                        .hint("give one of them"),
                );
            }
            scenario.aiding = AidingSettings::car();
        }
        scenario.validate().map_err(Failure::input)?;
        let trajectory = read::trajectory(&self.trajectory, context)?;
        Requirements::new(scenario, trajectory, limits, self.outage, self.start).map_err(
            |e: Misplaced| {
                let earlier = if self.start.is_some() {
                    ", or an earlier --start"
                } else {
                    ""
                };
                Failure::input(e).hint(format!("a shorter --outage{earlier}"))
            },
        )
    }
}

/// The IMU that is needed.
fn sought(requirements: &Requirements) -> Result<NeededImu, Failure> {
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
    vehicle: Option<Vehicle>,
    context: &Context<'_>,
) -> Result<Found, Failure> {
    let unusable = |e: RequireError| Failure::input(format!("{}: {e}", path.display()));
    let file = read::model(path, context)?;
    let mut scenario = requirements.scenario.clone();
    read::expect_turn_on(&mut scenario.initial, &file, path, context);
    read::make_turn_on(&mut scenario.imu, &file, path, context);
    let not_stated = stated_in_words(&file.not_stated());
    if !not_stated.is_empty() {
        let text = format!(
            "{}: what is not stated counts as none: {not_stated}",
            path.display()
        );
        context.warn(text);
    }
    let model = read::at_rate(path, &file.model, scenario.imu.rate_hz, context)?;
    let mut judged = requirements.judged(&scenario, &model).map_err(unusable)?;
    if vehicle.is_some() {
        judged.aidings = requirements.aidings(&scenario, &model).map_err(unusable)?;
    }
    Ok(Found::Given(Box::new(judged)))
}

/// The units, the best first.
fn ranked(units: &[CatalogueUnit], requirements: &Requirements) -> Result<Found, Failure> {
    Ok(Found::Ranked(
        requirements.ranked(units).map_err(Failure::input)?,
    ))
}

/// The units that are known by name.
fn catalogue(requirements: &Requirements) -> Result<Vec<CatalogueUnit>, Failure> {
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
) -> Result<Vec<CatalogueUnit>, Failure> {
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
        let file = read::model(path, context)?;
        let model = read::at_rate(path, &file.model, asked.scenario.imu.rate_hz, context)?;
        Ok(asked.unit(name, &file, model))
    };
    paths.iter().map(unit).collect()
}

fn of_sheet(
    name: String,
    sheet: &Datasheet,
    requirements: &Requirements,
) -> Result<CatalogueUnit, Failure> {
    let made = sheet.model_file(requirements.scenario.imu.rate_hz);
    let file = made
        .map_err(|e| Failure::input(format!("{name}: {e}")))?
        .file;
    Ok(requirements.unit(name, &file, file.model.clone()))
}
