//! `nav-sim require`: which IMU a limit needs, and what a given one makes of it.

use super::pictures::{PlotArgs, claim_output};
use super::{Failure, Session, parse, read, turn_on};
use crate::formats::atomic::Written;
use crate::formats::datasheet::{self, CATALOGUE, Datasheet};
use crate::formats::file_kind::{self, FileKind};
use crate::formats::model_file;
use crate::formats::scenario_file;
use crate::require::{Ask, CatalogueUnit, Misplaced, Requirements, stated_in_words};
use nav_sim_navigation::require::{Limit, Quantity, RequireError, Worst};
use nav_sim_navigation::sensors::outage::NotAnOutage;
use std::path::{Path, PathBuf};

/// Find the IMU that keeps the errors at the end of an outage within limits, or judge MODEL by them
///
/// Uses linear covariance analysis along TRAJECTORY of a filter that knows its IMU. Without MODEL it finds the white noise
/// and bias instability that each sensor may have beside the turn-on biases of [imu] in --scenario. With MODEL it says
/// whether the limits are kept (exit code 3: they are not), which part of the IMU decides, and the longest outage that it
/// bridges.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim require trajectories/figure_eight.toml --outage 60 \\
      --require 'p95_m<=50' -o needed.toml
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage 60:120 --require 'rmse_m<=100'
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage longest --require 'p95_m<=20'")]
pub(crate) struct Args {
    /// Trajectory: motion profile (.toml) or table (.csv)
    trajectory: PathBuf,
    /// Noise model of an IMU
    model: Option<PathBuf>,
    /// Outage: a length in seconds (tried from every second on), START:END, or "longest" (needs MODEL)
    #[arg(long, value_name = "SECONDS", value_parser = parse_ask)]
    outage: Ask,
    /// Earliest start of the outage in seconds [default: 300, less if the trajectory is short]
    #[arg(long, value_name = "SECONDS", value_parser = parse::non_negative)]
    start: Option<f64>,
    /// Limit at the end of the outage, as NAME<=LIMIT (repeatable): p50_m, p95_m, rmse_m (horizontal), roll_deg, pitch_deg,
    /// yaw_deg
    #[arg(long = "require", value_name = "NAME<=LIMIT", value_parser = parse_limit)]
    limits: Vec<Limit>,
    #[command(flatten)]
    old: OldLimits,
    /// Scenario file whose [gnss] section is used
    #[arg(long, value_name = "FILE")]
    gnss: Option<PathBuf>,
    /// Scenario file: receiver, start, IMU rate (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Also print a curve of equal drift: eight gyroscope biases, and the velocity random walk that each allows
    #[arg(long, conflicts_with = "model")]
    iso_drift: bool,
    /// Rank the catalogued IMUs (`nav-sim datasheet --list`), or those of a directory of entries and model files
    #[arg(long, value_name = "DIR", num_args = 0..=1, conflicts_with_all = ["model", "iso_drift", "out"])]
    catalogue: Option<Option<PathBuf>>,
    #[command(flatten)]
    plot: PlotArgs,
    /// Model file to write, of the required IMU
    #[arg(long, short, value_name = "FILE", conflicts_with = "model")]
    out: Option<PathBuf>,
}

/// Limits of the release before, by a name each.
#[derive(clap::Args, Debug)]
struct OldLimits {
    #[arg(long, hide = true, value_parser = parse::positive)]
    p95_m: Option<f64>,
    #[arg(long, hide = true, value_parser = parse::positive)]
    p50_m: Option<f64>,
    #[arg(long, hide = true, value_parser = parse::positive)]
    rmse_m: Option<f64>,
    #[arg(long, hide = true, value_parser = parse::positive)]
    roll_deg: Option<f64>,
    #[arg(long, hide = true, value_parser = parse::positive)]
    pitch_deg: Option<f64>,
    #[arg(long, hide = true, value_parser = parse::positive)]
    yaw_deg: Option<f64>,
}

/// The limits that are given; at least one.
fn limits(args: &Args) -> Result<Vec<Limit>, Failure> {
    let OldLimits { p95_m, p50_m, rmse_m, roll_deg, pitch_deg, yaw_deg } = args.old;
    let old = Quantity::ALL.into_iter().zip([p95_m, p50_m, rmse_m, roll_deg, pitch_deg, yaw_deg]);
    let old = old.filter_map(|(quantity, most)| Some(Limit { quantity, most: most? }));
    let limits: Vec<Limit> = args.limits.iter().copied().chain(old).collect();
    if limits.is_empty() {
        let hint = "give one, such as --require 'p95_m<=5' or --require 'yaw_deg<=1'";
        return Err(Failure::input("no limit is given").hint(hint));
    }
    Ok(limits)
}

fn parse_limit(text: &str) -> Result<Limit, String> {
    let limit = || {
        let (name, most) = text.split_once("<=").or_else(|| text.split_once('<'))?;
        let quantity = Quantity::ALL.into_iter().find(|quantity| quantity.name() == name.trim())?;
        Some(Limit { quantity, most: parse::positive(most.trim()).ok()? })
    };
    let names = Quantity::ALL.map(Quantity::name).join(", ");
    limit().ok_or_else(|| format!("expected NAME<=LIMIT with a positive limit, NAME one of {names}"))
}

fn parse_ask(text: &str) -> Result<Ask, String> {
    match text {
        "longest" => Ok(Ask::Longest),
        window if window.contains(':') => {
            window.parse().map(Ask::Window).map_err(|e: NotAnOutage| e.to_string())
        }
        length => parse::positive(length)
            .map(Ask::Length)
            .map_err(|_| "expected a length in seconds, START:END or longest".to_owned()),
    }
}

/// What is asked, with the files read.
fn requirements(args: &Args, session: &Session) -> Result<Requirements, Failure> {
    let limits = limits(args)?;
    let mut scenario = args.scenario.as_deref().map(scenario_file::read).transpose()?.unwrap_or_default();
    if let Some(path) = &args.gnss {
        scenario.gnss = scenario_file::read(path)?.gnss;
    }
    scenario.validate().map_err(Failure::input)?;
    let trajectory = read::trajectory(&args.trajectory, session)?;
    Requirements::new(scenario, trajectory, limits, args.outage, args.start).map_err(|e: Misplaced| {
        let earlier = if args.start.is_some() { ", or an earlier --start" } else { "" };
        Failure::input(e).hint(format!("a shorter --outage{earlier}"))
    })
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    if let (Ask::Window(outage), Some(start_s)) = (args.outage, args.start) {
        let message = format!("--start {start_s} beside --outage {}:{}", outage.start_s, outage.end_s);
        return Err(Failure::input(message).hint("an outage of a length alone has an earliest start"));
    }
    if args.model.is_none() && args.outage == Ask::Longest {
        return Err(
            Failure::input("--outage longest needs a MODEL").hint("without one, give a length in seconds")
        );
    }
    let _pictures = args.plot.claim(std::iter::once(&args.trajectory).chain(&args.model), session)?;
    let asked = requirements(args, session)?;
    match (&args.model, &args.catalogue) {
        (Some(path), _) => given(path, args, &asked, session),
        (None, Some(directory)) => ranked(directory.as_deref(), args, &asked, session),
        (None, None) => sought(args, &asked, session),
    }
}

/// The IMU that is needed.
fn sought(args: &Args, requirements: &Requirements, session: &Session) -> Result<(), Failure> {
    let _own = claim_output(args.out.as_deref(), [&args.trajectory], Written::Required, session)?;
    let needed = requirements.needed(args.iso_drift).map_err(|e| {
        let hint = match e {
            RequireError::Loose { .. } => "a smaller limit, or a longer outage",
            _ => "a larger limit, a shorter outage, or a better receiver ([gnss] of --scenario)",
        };
        Failure::input(e).hint(hint)
    })?;
    let drawn = args.plot.draw(&session.answer(&needed), session);
    if let Some(out) = &args.out {
        model_file::write(out, &requirements.model_file(&needed))?;
        session.wrote(out);
    }
    drawn
}

/// What a given IMU makes of the limits.
fn given(path: &Path, args: &Args, requirements: &Requirements, session: &Session) -> Result<(), Failure> {
    let unusable = |e: RequireError| Failure::input(format!("{}: {e}", path.display()));
    let file = read::model(path, session)?;
    let mut scenario = requirements.scenario.clone();
    turn_on::expect(&mut scenario.initial, &file, path, session);
    turn_on::make(&mut scenario.imu, &file, path, session);
    let not_stated = stated_in_words(&file.not_stated());
    if !not_stated.is_empty() {
        session.warn(format!("{}: what is not stated counts as none: {not_stated}", path.display()));
    }
    let model = read::at_rate(path, &file.model, scenario.imu.rate_hz, session)?;
    let judged = requirements.judged(&scenario, &model).map_err(unusable)?;
    args.plot.draw(&session.answer(&judged), session)?;
    let Some(margins) = judged.margins.filter(|margins| !margins.met()) else { return Ok(()) };
    let Worst { limit, value, .. } = margins.worst;
    let [value, most] = [value, limit.most].map(|x| limit.quantity.shown(x));
    Err(Failure::bound(format!("{} is {value}, the limit is {most}", limit.quantity.name())))
}

/// The units of the catalogue or of a directory, the best first.
fn ranked(
    directory: Option<&Path>,
    args: &Args,
    requirements: &Requirements,
    session: &Session,
) -> Result<(), Failure> {
    let units = match directory {
        Some(directory) => units_of(directory, requirements, session)?,
        None => catalogue(requirements)?,
    };
    let ranking = requirements.ranked(&units).map_err(Failure::input)?;
    args.plot.draw(&session.answer(&ranking), session)?;
    if ranking.is_met() {
        return Ok(());
    }
    Err(Failure::bound("no unit keeps the limits by figures that are all stated"))
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
    session: &Session,
) -> Result<Vec<CatalogueUnit>, Failure> {
    if !directory.exists() {
        let message = format!("--catalogue {}: there is no such directory", directory.display());
        return Err(
            Failure::input(message).hint("without a directory, --catalogue ranks the catalogued IMUs")
        );
    }
    let mut paths = read::listed(&[directory.to_owned()])?;
    paths.retain(|p| p.extension().is_some_and(|e| e == "toml"));
    if paths.is_empty() {
        let message = format!("{}: no model file (.toml)", directory.display());
        return Err(Failure::input(message).hint("make them with `nav-sim calibrate` or `nav-sim datasheet`"));
    }
    let unit = |path: &PathBuf| {
        let name = path.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        if file_kind::of(path)? == FileKind::CatalogueEntry {
            return of_sheet(name, &datasheet::read(path)?, asked);
        }
        let file = read::model(path, session)?;
        let model = read::at_rate(path, &file.model, asked.scenario.imu.rate_hz, session)?;
        Ok(asked.unit(name, &file, model))
    };
    paths.iter().map(unit).collect()
}

fn of_sheet(name: String, sheet: &Datasheet, requirements: &Requirements) -> Result<CatalogueUnit, Failure> {
    let made = sheet.model_file(requirements.scenario.imu.rate_hz);
    let file = made.map_err(|e| Failure::input(format!("{name}: {e}")))?.file;
    Ok(requirements.unit(name, &file, file.model.clone()))
}
