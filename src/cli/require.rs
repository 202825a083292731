//! `nav-sim require`: which IMU a limit needs, and what a given one makes of it.

use super::{Failure, Session, parse, read, turn_on};
use nav_sim::formats::atomic::{AtomicFile, guard_inputs};
use nav_sim::formats::model_file::{self, ModelFile};
use nav_sim::formats::scenario_file;
use nav_sim::noise::Model;
use nav_sim::report::require as words;
use nav_sim::report::require::{CURVE_S, Longest, NeededImu, Question, RankedUnit};
use nav_sim::require::{
    Answer, Course, Detail, Drift, IMU_PARAMETERS, ImuParameters, Limit, Margins, Need, Quantity,
    RequireError, Worst, evenly,
};
use nav_sim::scenario::Scenario;
use nav_sim::sensors::outage::Outage;
use nav_sim::simulation::ExperimentError;
use nav_sim::trajectory::Trajectory;
use std::path::{Path, PathBuf};

/// Say which IMU keeps the errors at the end of an outage within limits, or what MODEL makes of them
///
/// By linear covariance analysis of the filter that knows its IMU, along TRAJECTORY with its fixes. Without MODEL: the
/// white noise and bias instability that each sensor may have. With MODEL: whether it keeps the limits (exit code 3:
/// it does not), what decides, and the longest outage that it bridges.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim require trajectories/figure_eight.toml --outage 60 --p95-m 50 -o needed.toml
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage 60:120 --rmse-m 100
  nav-sim require trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage longest --p95-m 20")]
pub(crate) struct Args {
    /// Trajectory: motion profile (.toml) or table (.csv)
    trajectory: PathBuf,
    /// Noise model of an IMU
    model: Option<PathBuf>,
    /// Outage: its length in seconds at several places, START:END, or "longest" (needs MODEL)
    #[arg(long, value_name = "SECONDS", value_parser = parse_ask)]
    outage: Ask,
    /// Earliest start of the outage in seconds [default: 300, less where the trajectory is short]
    #[arg(long, value_name = "SECONDS", value_parser = parse::non_negative)]
    start: Option<f64>,
    #[command(flatten)]
    limits: Limits,
    /// Scenario file whose [gnss] section is used
    #[arg(long, value_name = "FILE")]
    gnss: Option<PathBuf>,
    /// Scenario file: receiver, start, IMU rate (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Correlation time of the biases of the IMU that is sought
    #[arg(long, value_name = "SECONDS", value_parser = parse::positive, default_value = "300", conflicts_with = "model")]
    corr_time_s: f64,
    /// Also a curve of equal drift: eight gyroscope biases, and the velocity random walk that each leaves
    #[arg(long, conflicts_with = "model")]
    iso_drift: bool,
    /// Rank the IMUs of a directory of model files
    #[arg(long, value_name = "DIR", conflicts_with_all = ["model", "iso_drift", "out"])]
    catalogue: Option<PathBuf>,
    /// Model file of the IMU that is sought
    #[arg(long, short, value_name = "FILE", conflicts_with = "model")]
    out: Option<PathBuf>,
}

/// At the end of the outage; at least one.
#[derive(clap::Args, Debug)]
#[command(next_help_heading = "Limits at the end of the outage")]
struct Limits {
    /// 95 % quantile of the horizontal error
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    p95_m: Option<f64>,
    /// Median of the horizontal error
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    p50_m: Option<f64>,
    /// RMSE of the horizontal position
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    rmse_m: Option<f64>,
    /// RMSE of roll
    #[arg(long, value_name = "DEGREES", value_parser = parse::positive)]
    roll_deg: Option<f64>,
    /// RMSE of pitch
    #[arg(long, value_name = "DEGREES", value_parser = parse::positive)]
    pitch_deg: Option<f64>,
    /// RMSE of yaw
    #[arg(long, value_name = "DEGREES", value_parser = parse::positive)]
    yaw_deg: Option<f64>,
}

impl Limits {
    fn given(&self) -> Result<Vec<Limit>, Failure> {
        let all = [
            (Quantity::P95, self.p95_m),
            (Quantity::P50, self.p50_m),
            (Quantity::Rmse, self.rmse_m),
            (Quantity::Angle(0), self.roll_deg),
            (Quantity::Angle(1), self.pitch_deg),
            (Quantity::Angle(2), self.yaw_deg),
        ];
        let limit = |(quantity, most): (Quantity, Option<f64>)| Some(Limit { quantity, most: most? });
        let limits: Vec<Limit> = all.into_iter().filter_map(limit).collect();
        if limits.is_empty() {
            return Err(
                Failure::input("no limit is given").hint("give one, such as --p95-m 5 or --yaw-deg 1")
            );
        }
        Ok(limits)
    }
}

/// The outage that is asked for.
#[derive(Debug, Clone, Copy)]
enum Ask {
    Length(f64),
    Window(Outage),
    Longest,
}

fn parse_ask(text: &str) -> Result<Ask, String> {
    let expected = "expected a length in seconds, START:END or longest";
    if text == "longest" {
        return Ok(Ask::Longest);
    }
    let Some((start, end)) = text.split_once(':') else {
        return parse::positive(text).map(Ask::Length).map_err(|_| expected.to_owned());
    };
    let numbers = start.parse().ok().zip(end.parse().ok()).ok_or(expected)?;
    let outage = Outage { start_s: numbers.0, end_s: numbers.1 };
    outage.validate().map_err(|e| e.to_string())?;
    Ok(Ask::Window(outage))
}

/// Earliest start of an outage where nothing else is said (s): by then a filter has aligned itself.
const SETTLED_S: f64 = 300.0;
/// Places of an outage of which only the length is given.
const PLACES: u32 = 4;
/// Longest outage that is looked at (s).
const LONGEST_S: f64 = 600.0;
/// Points of a curve of equal drift.
const POINTS: u32 = 8;

/// What is asked, with the files read.
struct Setting {
    scenario: Scenario,
    trajectory: Trajectory,
    limits: Vec<Limit>,
    ask: Ask,
    first_s: f64,
}

impl Setting {
    fn read(args: &Args, session: &Session) -> Result<Self, Failure> {
        let limits = args.limits.given()?;
        let mut scenario = args.scenario.as_deref().map(scenario_file::read).transpose()?.unwrap_or_default();
        if let Some(path) = &args.gnss {
            scenario.gnss = scenario_file::read(path)?.gnss;
        }
        scenario.validate().map_err(Failure::input)?;
        let trajectory = read::trajectory(&args.trajectory, session)?;
        let (start_s, end_s) = (trajectory.start_s(), trajectory.end_s());
        let length_s = match args.outage {
            Ask::Length(length_s) => length_s,
            Ask::Window(outage) => outage.end_s - outage.start_s,
            Ask::Longest => 1.0,
        };
        let first_s =
            args.start.unwrap_or_else(|| start_s + SETTLED_S.min(0.5 * (end_s - start_s - length_s)));
        let begins_s = if let Ask::Window(outage) = args.outage { outage.start_s } else { first_s };
        if begins_s < start_s || begins_s + length_s > end_s {
            let message = format!("an outage of {length_s} s from {begins_s} s on is not on the trajectory");
            let hint =
                format!("it lasts from {start_s} to {end_s} s: a shorter --outage, or an earlier --start");
            return Err(Failure::input(message).hint(hint));
        }
        Ok(Self { scenario, trajectory, limits, ask: args.outage, first_s })
    }

    /// The places of the outage; those of one second where the longest is sought.
    fn outages(&self) -> Vec<Outage> {
        let length_s = match self.ask {
            Ask::Window(outage) => return vec![outage],
            Ask::Length(length_s) => length_s,
            Ask::Longest => 1.0,
        };
        evenly(self.first_s, self.trajectory.end_s(), length_s, PLACES)
    }

    /// Outages as long as the trajectory allows at several places.
    fn long_outages(&self) -> Vec<Outage> {
        let end_s = self.trajectory.end_s();
        if let Ask::Window(outage) = self.ask {
            let end_s = end_s.min(outage.start_s + LONGEST_S);
            return vec![Outage { end_s, ..outage }];
        }
        let asked = if let Ask::Length(length_s) = self.ask { length_s } else { 1.0 };
        let length_s = (0.5 * (end_s - self.first_s)).floor().min(LONGEST_S).max(asked);
        evenly(self.first_s, end_s, length_s, PLACES)
    }

    fn course(&self, outages: &[Outage], detail: Detail) -> Result<Course<'_>, Failure> {
        let course = Course::new(&self.scenario, &self.trajectory, outages, detail);
        course.map_err(|e: ExperimentError| Failure::input(e))
    }

    fn question(&self, outages: Vec<Outage>) -> Question {
        Question { limits: self.limits.clone(), outages }
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    if args.model.is_none() && matches!(args.outage, Ask::Longest) {
        return Err(
            Failure::input("--outage longest needs a MODEL").hint("without one, give a length in seconds")
        );
    }
    let setting = Setting::read(args, session)?;
    match (&args.model, &args.catalogue) {
        (Some(path), _) => given(path, &setting, session),
        (None, Some(directory)) => ranked(directory, &setting, session),
        (None, None) => sought(args, &setting, session),
    }
}

/// The IMU that is needed.
fn sought(args: &Args, setting: &Setting, session: &Session) -> Result<(), Failure> {
    if let Some(out) = &args.out {
        guard_inputs(out, [args.trajectory.as_path()])?;
        drop(AtomicFile::create(out)?);
    }
    let outages = setting.outages();
    let course = setting.course(&outages, Detail::End)?;
    let (scenario, limits) = (&setting.scenario, setting.limits.as_slice());
    let need = Need { course: &course, scenario, limits, t_corr_s: args.corr_time_s };
    let found = || -> Result<NeededImu, RequireError> {
        let (imu, shares) = need.allocated()?;
        let mut needed = NeededImu {
            imu,
            shares,
            alone: [Answer::Any; IMU_PARAMETERS],
            others_better: [Answer::Any; IMU_PARAMETERS],
            iso_drift: None,
        };
        for i in 0..needed.alone.len() {
            needed.alone[i] = need.quite_alone(&imu, i)?;
            needed.others_better[i] = need.alone(&imu, i, 0.1)?;
        }
        if args.iso_drift {
            needed.iso_drift = Some(need.iso_drift(&imu, POINTS)?);
        }
        Ok(needed)
    };
    let needed = found().map_err(|e| {
        Failure::input(e)
            .hint("a larger limit, a shorter outage, or a better receiver ([gnss] of --scenario)")
    })?;
    let question = setting.question(outages);
    let shown = if session.json() {
        needed.json(&question)
    } else {
        let tables: Vec<String> = needed.tables().iter().map(|t| super::compare::table(t)).collect();
        format!("{}\n\n{}", needed.verdict(&question), tables.join("\n\n"))
    };
    session.printer.result(shown.trim_end());
    if let Some(out) = &args.out {
        model_file::write(out, &needed_file(&needed.imu, &question, scenario.imu.rate_hz))?;
        session.printer.say(&format!("wrote {}", out.display()));
    }
    Ok(())
}

fn needed_file(imu: &ImuParameters, question: &Question, rate_hz: f64) -> ModelFile {
    let mut provenance = toml::Table::new();
    let mut put = |key: &str, value: toml::Value| provenance.insert(key.to_owned(), value);
    put("program", format!("nav-sim {}", env!("CARGO_PKG_VERSION")).into());
    put("made_by", "require".into());
    put("label", "what a limit needs: not a calibration".into());
    put("question", question.in_words().into());
    for (i, name) in ImuParameters::NAMES.iter().enumerate() {
        put(name, ImuParameters::in_datasheets(i, imu.values[i]).into());
    }
    ModelFile { provenance: Some(provenance), ..ModelFile::new(imu.model(rate_hz)) }
}

/// What a given IMU makes of the limits.
fn given(path: &Path, setting: &Setting, session: &Session) -> Result<(), Failure> {
    let unusable = |e| Failure::input(format!("{}: {e}", path.display()));
    let file = read::model(path, session)?;
    let (scenario, model) = unit(path, &file, setting, session)?;
    let long = setting.course(&setting.long_outages(), Detail::Seconds)?;
    let longest = longest(&long.curves(&scenario, &model).map_err(unusable)?, &setting.limits);
    if matches!(setting.ask, Ask::Longest) {
        let question = setting.question(long.outages().collect());
        let shown = if session.json() {
            words::longest_json(longest, &question)
        } else {
            words::longest_verdict(longest, &question)
        };
        session.printer.result(shown.trim_end());
        return Ok(());
    }
    let outages = setting.outages();
    let course = setting.course(&outages, Detail::End)?;
    let margins = Margins::of(&course, &scenario, &model, &setting.limits).map_err(unusable)?;
    let length_s = outages.iter().map(|o| o.end_s - o.start_s).fold(0.0, f64::max);
    let longest = longest.beside(length_s, margins.met());
    let question = setting.question(outages);
    let verdict = words::margins_verdict(&margins, &question, longest);
    let shown = if session.json() {
        words::margins_json(&margins, &question, longest)
    } else {
        format!("{verdict}\n\n{}", super::compare::table(&words::margins_rows(&margins)))
    };
    session.printer.result(shown.trim_end());
    if margins.met() {
        return Ok(());
    }
    let worst = margins.worst;
    let (name, most) = (worst.limit.quantity.name(), worst.limit.most);
    Err(Failure::bound(format!("{name} is {:.3}, the limit is {most}", worst.value)))
}

/// A model at the rate of the IMU, and the scenario of that unit: its turn-on biases are there and expected.
fn unit(
    path: &Path,
    file: &ModelFile,
    setting: &Setting,
    session: &Session,
) -> Result<(Scenario, Model), Failure> {
    let mut scenario = setting.scenario.clone();
    turn_on::expect(&mut scenario.initial, file, path, session);
    turn_on::make(&mut scenario.imu, file, path, session);
    let model = read::at_rate(path, &file.model, scenario.imu.rate_hz, session)?;
    Ok((scenario, model))
}

/// The errors after a time without fixes at every place where the outage lasts so long.
fn after(curves: &[Vec<Drift>], length_s: f64) -> Vec<Drift> {
    let there = |curve: &Vec<Drift>| curve.iter().find(|d| (d.after_s - length_s).abs() < 1e-3).copied();
    curves.iter().filter_map(there).collect()
}

/// The longest outage within the limits, in whole seconds.
fn longest(curves: &[Vec<Drift>], limits: &[Limit]) -> Longest {
    let lengths: Vec<f64> = curves.first().map_or_else(Vec::new, |c| c.iter().map(|d| d.after_s).collect());
    let is_missed = |length_s: &f64| {
        Worst::of(limits, &after(curves, *length_s)).is_some_and(|worst| worst.margin() < 0.0)
    };
    match lengths.iter().position(is_missed) {
        Some(0) => Longest::Seconds(0.0),
        Some(first) => Longest::Seconds(lengths[first - 1]),
        None => Longest::AtLeast(lengths.last().copied().unwrap_or(0.0)),
    }
}

/// The units of a directory, the best first.
fn ranked(directory: &Path, setting: &Setting, session: &Session) -> Result<(), Failure> {
    let length_s = match setting.ask {
        Ask::Length(length_s) => length_s,
        Ask::Window(outage) => outage.end_s - outage.start_s,
        Ask::Longest => 1.0,
    };
    let paths: Vec<PathBuf> = read::listed(&[directory.to_owned()])?
        .into_iter()
        .filter(|p| p.extension().is_some_and(|e| e == "toml"))
        .collect();
    if paths.is_empty() {
        let message = format!("{}: no model file (.toml)", directory.display());
        return Err(Failure::input(message).hint("make them with `nav-sim calibrate` or `nav-sim datasheet`"));
    }
    let outages = setting.long_outages();
    let course = setting.course(&outages, Detail::Seconds)?;
    let mut units = Vec::new();
    for path in &paths {
        let file = read::model(path, session)?;
        let (scenario, model) = unit(path, &file, setting, session)?;
        let curves = course
            .curves(&scenario, &model)
            .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
        let hardest = |length_s: f64| Worst::of(&setting.limits, &after(&curves, length_s));
        let worst = hardest(length_s)
            .ok_or_else(|| Failure::input(format!("{length_s} s is not a whole number of seconds")))?;
        let quantity = worst.limit.quantity;
        let value = |s: u32| {
            let drifts = after(&curves, f64::from(s));
            drifts.iter().map(|d| d.value(quantity)).reduce(f64::max)
        };
        units.push(RankedUnit {
            name: path.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            worst,
            curve: CURVE_S.map(value),
            longest: longest(&curves, &setting.limits),
        });
    }
    units.sort_by(|a, b| b.worst.margin().total_cmp(&a.worst.margin()));
    let cut = outages.iter().map(|o| Outage { end_s: o.start_s + length_s, ..*o }).collect();
    let question = setting.question(cut);
    let shown = if session.json() {
        words::catalogue_json(&units, &question)
    } else {
        format!("{}:\n\n{}", question.in_words(), super::compare::table(&words::catalogue_rows(&units)))
    };
    session.printer.result(shown.trim_end());
    Ok(())
}
