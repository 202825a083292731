//! `nav-sim run`: the main job.

mod inputs;
mod output;
mod words;

use super::filter::{FilterArgs, no_filter};
use super::parse::one_of;
use super::pictures::PlotArgs;
use super::{Failure, Session};
use crate::formats::scenario_file;
use crate::jobs::{self, NavigateError, Navigation};
use crate::report::requirement::requirement_line;
use crate::report::{Manifest, TrajectorySeries, run_words, window};
use inputs::Inputs;
use nav_sim_navigation::metrics::{Requirement, Summary};
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::imu::TruthError;
use nav_sim_navigation::sensors::outage::{NotAnOutage, Outage, PlacedOutages};
use nav_sim_navigation::simulation::ExperimentError;
use std::path::{Path, PathBuf};

use output::{manifest, write};
pub(super) use words::Words;

/// Navigate by INS/GNSS along TRAJECTORY with MODEL in the filter: Monte Carlo or covariance analysis
///
/// Writes a run directory: epochs.csv (ASEE, RMSE, bias, NEES, coverage at 1 Hz), fan.csv (quantiles of the
/// horizontal error), runs.csv, summary.json, report.html, manifest.json. The same seed gives every model the same
/// noise, so that runs can be compared pair by pair (see `nav-sim compare`).
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml --seed 1 --runs 20
  nav-sim run trajectories/figure_eight.toml calib_data/tactical.toml \\
      --outage 60:90 --filter full --runs 8 -o out/full
  nav-sim run trajectories/land_vehicle.toml calib_data/consumer_mems.toml \\
      --truth calib_data/tactical.toml --runs 8 -o out/mismatch")]
pub(crate) struct Args {
    /// Trajectory: motion profile (.toml) or table (.csv)
    trajectory: PathBuf,
    /// Noise model that the filter believes
    model: PathBuf,
    /// Noise model that makes the INS errors (default: MODEL itself)
    #[arg(long, value_name = "MODEL2", conflicts_with = "recordings")]
    truth: Option<PathBuf>,
    /// Static recording whose windows make the INS errors (repeatable)
    #[arg(long = "static", value_name = "FILE")]
    recordings: Vec<PathBuf>,
    /// Sample rate of static recordings without a time column
    #[arg(long = "rate-hz", value_name = "HZ", value_parser = super::parse::rate_hz, requires = "recordings")]
    static_rate_hz: Option<f64>,
    /// Window without fixes, in seconds (repeatable), or "none" (default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END", value_parser = parse_outage)]
    outages: Vec<OutageArg>,
    /// Monte-Carlo runs (default: 100)
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    #[command(flatten)]
    filter: FilterArgs,
    /// How statistics are computed: monte-carlo (sampled runs), lincov (linear covariance analysis, no sampling) or
    /// both (runs, compared with their expected values)
    #[arg(long, value_name = "METHOD", value_parser = one_of::<Method>(&Method::NAMES))]
    method: Option<Method>,
    /// Limit on an error at the end of every outage, as NAME<=LIMIT (repeatable): p50_m, p95_m (horizontal),
    /// rmse_pos_e_m, yaw_deg and the other states; exit code 3 if it is not met
    #[arg(long, value_name = "NAME<=LIMIT")]
    require: Vec<Requirement>,
    /// Scenario file whose [gnss] section is used
    #[arg(long, value_name = "FILE")]
    gnss: Option<PathBuf>,
    /// All settings of the run in one TOML file; flags override it (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
    /// Run directory to make
    #[arg(long, short, value_name = "DIR", default_value = "out/run")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum OutageArg {
    None,
    Window(Outage),
}

pub(super) fn parse_outage(text: &str) -> Result<OutageArg, String> {
    if text == "none" {
        return Ok(OutageArg::None);
    }
    text.parse().map(OutageArg::Window).map_err(|e: NotAnOutage| e.to_string())
}

/// The windows among the values of `--outage`, of which "none" stands alone.
pub(super) fn windows_of(outages: &[OutageArg]) -> Result<Vec<Outage>, Failure> {
    if outages.len() > 1 && outages.iter().any(|o| matches!(o, OutageArg::None)) {
        let message = "--outage none stands beside other outages";
        return Err(Failure::input(message).hint("give the windows, or none alone"));
    }
    let window = |o: &OutageArg| match o {
        OutageArg::None => None,
        OutageArg::Window(outage) => Some(*outage),
    };
    Ok(outages.iter().filter_map(window).collect())
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut scenario = scenario(args)?;
    let inputs = Inputs::read(args, &mut scenario, session)?;
    scenario.run.seed = seed(&scenario, session);
    let seed = scenario.run.seed.unwrap_or_default();
    let span = (inputs.job.trajectory.start_s(), inputs.job.trajectory.end_s());
    let outages = outages(&scenario, span, seed, session).map_err(|e| match &args.scenario {
        Some(path) if args.outages.is_empty() => e.within(&path.display().to_string()),
        _ => e,
    })?;
    requirable(&args.require, outages.is_empty())?;
    if scenario.run.method == Method::Lincov && args.runs.is_some() {
        session.warn("--runs counts nothing here: --method lincov makes none; both makes them beside it");
    }
    let manifest = manifest(
        scenario.clone(),
        &outages,
        scenario.run.seed,
        inputs.files.clone(),
        inputs.note.clone(),
        session,
    );
    let _own = output::claim(&args.out, &manifest, session)?;
    let _picture = args.plot.claim(inputs.files.iter().map(|i| &i.path), session)?;
    let words = Words::new(session);
    let found = jobs::navigate(&inputs.job, &scenario, &outages, seed, &words);
    let mut found = found.map_err(|e| impossible(e, args))?;
    found.summary.require = args.require.iter().map(|r| r.check(&found.summary)).collect();
    let epochs = found.runs.as_ref().map_or(0, |runs| runs.run_epochs) as f64;
    let independent_windows = found.runs.as_ref().and_then(|runs| runs.independent_windows);
    let wall_s = words.runs_s();
    let throughput_epochs_per_s = if wall_s > 0.0 { epochs / wall_s } else { 0.0 };
    let manifest = Manifest { independent_windows, wall_s, throughput_epochs_per_s, ..manifest };
    write(&found, &manifest, &TrajectorySeries::of(&inputs.job.trajectory), &args.out)?;
    show(args, &found, throughput_epochs_per_s, session)?;
    output::doubt_filter(&found.summary, &scenario, &inputs.job.truth, session);
    session.wrote(&args.out);
    all_finite(&found.summary)?;
    not_far_off(&found.summary, &scenario)?;
    required(&found.summary)
}

/// What is printed of the run, and its picture.
fn show(
    args: &Args,
    found: &Navigation,
    throughput_epochs_per_s: f64,
    session: &Session,
) -> Result<(), Failure> {
    let summary = &found.summary;
    let shown = match session.json() {
        true => crate::report::summary_json(summary, throughput_epochs_per_s),
        false => run_words::text(summary),
    };
    session.result(shown.trim_end());
    args.plot.write(|| crate::report::run_svg(&found.epochs, &found.fan, &found.summary), session)?;
    if throughput_epochs_per_s > 0.0 {
        session.say(format!("{:.2} million IMU epochs/s", throughput_epochs_per_s / 1e6));
    }
    if session.verbose() && !session.json() {
        session.result(run_words::sensitivity_table(&found.summary).trim_end());
    }
    Ok(())
}

/// Refuses requirements of the ends of outages without an outage.
fn requirable(all: &[Requirement], no_outage: bool) -> Result<(), Failure> {
    match all.iter().find(|r| no_outage && r.needs_outage()) {
        Some(r) => {
            let message = format!("--require {r}: {} is of the ends of outages, and there is none", r.name());
            Err(Failure::input(message).hint("give an outage with --outage START:END"))
        }
        None => Ok(()),
    }
}

/// Whether everything required is met.
fn required(summary: &Summary) -> Result<(), Failure> {
    let missed: Vec<String> =
        summary.require.iter().filter(|met| !met.met).map(|met| requirement_line(met, summary)).collect();
    if missed.is_empty() { Ok(()) } else { Err(Failure::bound(missed.join("; "))) }
}

/// The seed of all random numbers: drawn where nobody gives one and there are any, and none where there are not.
fn seed(scenario: &Scenario, session: &Session) -> Option<u64> {
    let draws = scenario.run.method != Method::Lincov || scenario.outage_random.is_some();
    if draws {
        return Some(session.seed(scenario.run.seed));
    }
    session.asked_seed().or(scenario.run.seed)
}

/// A filter whose errors are of another order than it believes did what was asked for, and is of no use.
fn not_far_off(summary: &Summary, scenario: &Scenario) -> Result<(), Failure> {
    if !summary.verdict.is_far_off() {
        return Ok(());
    }
    let message = format!(
        "the filter is overconfident by far: NEES {:.0}, {} if it is right",
        summary.nees.mean, summary.nees.dof
    );
    let hint = match scenario.doubts().is_empty() {
        true => "the results are written; does MODEL describe the errors of --truth or --static?",
        false => "the results are written; the warnings name what the filter does not expect",
    };
    Err(Failure::bound(message).hint(hint))
}

/// A run that diverged is left out of every number; the exit code says that there was one.
pub(super) fn all_finite(summary: &Summary) -> Result<(), Failure> {
    if summary.diverged == 0 {
        return Ok(());
    }
    if summary.diverged == summary.runs {
        let failure = Failure::could_not(format!("all {} runs diverged: there is no result", summary.runs));
        return Err(failure.hint("does the model fit the IMU, are [imu] and [initial] plausible?"));
    }
    let failure = Failure::bound(format!("{} of {} runs diverged", summary.diverged, summary.runs));
    Err(failure.hint("their indices are in summary.json, under diverged_runs; they are in no other number"))
}

/// A scenario file, the default without one, with the outages of the command line in the place of its own.
pub(super) fn scenario_with(path: Option<&Path>, outages: &[OutageArg]) -> Result<Scenario, Failure> {
    let mut scenario = path.map(scenario_file::read).transpose()?.unwrap_or_default();
    if !outages.is_empty() {
        scenario.outage = Some(windows_of(outages)?);
        (scenario.outage_periodic, scenario.outage_random) = (None, None);
    }
    Ok(scenario)
}

/// The scenario file with the flags over it, checked.
fn scenario(args: &Args) -> Result<Scenario, Failure> {
    let mut scenario = scenario_with(args.scenario.as_deref(), &args.outages)?;
    if let Some(path) = &args.gnss {
        scenario.gnss = scenario_file::read(path)?.gnss;
    }
    scenario.run.runs = args.runs.unwrap_or(scenario.run.runs);
    scenario.run.method = args.method.unwrap_or(scenario.run.method);
    args.filter.over(&mut scenario.filter.states, &mut scenario.initial);
    scenario.validate().map_err(Failure::input)?;
    Ok(scenario)
}

/// The scenario of [`scenario_with`], checked.
pub(super) fn checked_scenario(path: Option<&Path>, outages: &[OutageArg]) -> Result<Scenario, Failure> {
    let scenario = scenario_with(path, outages)?;
    scenario.validate().map_err(Failure::input)?;
    Ok(scenario)
}

/// The outages on a trajectory; what is doubtful about them is said.
pub(super) fn placed(
    scenario: &Scenario,
    span_s: (f64, f64),
    seed: u64,
    session: &Session,
) -> Result<Vec<Outage>, Failure> {
    let PlacedOutages { windows, remarks } = scenario.outages_on(span_s, seed)?;
    session.warn_all(&remarks);
    Ok(windows)
}

/// The outages on this trajectory, said.
fn outages(
    scenario: &Scenario,
    span: (f64, f64),
    seed: u64,
    session: &Session,
) -> Result<Vec<Outage>, Failure> {
    let windows = placed(scenario, span, seed, session)?;
    let shown: Vec<String> = windows.iter().map(|o| window(o.start_s, o.end_s)).collect();
    session.say(&match shown.as_slice() {
        [] => "no outage".to_owned(),
        some => format!("outages {}", some.join(", ")),
    });
    Ok(windows)
}

/// A job that cannot be done.
fn impossible(e: NavigateError, args: &Args) -> Failure {
    let failure = Failure::input(&e);
    match e {
        NavigateError::Experiment(ExperimentError::Truth(TruthError::TooShort { .. })) => {
            failure.hint("each run takes a window as long as the trajectory: record for longer")
        }
        NavigateError::Experiment(ExperimentError::Truth(TruthError::Rate { rate_hz, .. })) => {
            failure.hint(format!("set rate_hz = {rate_hz} in the [imu] section of a --scenario file"))
        }
        NavigateError::Experiment(_) => failure,
        NavigateError::Belief(e) => no_filter(
            &e,
            &args.model,
            args.gnss.as_deref().or(args.scenario.as_deref()),
            "raise it, or take the full filter (--filter full), which reduces nothing",
        ),
        NavigateError::Reduction(e) => Failure::could_not(e),
        NavigateError::RecordedTruth => failure.hint(
            "calibrate the recordings and give the model with --truth in the place of --static, or use --method \
             monte-carlo",
        ),
        NavigateError::Gate(_) => failure.hint("remove the key, or use --method monte-carlo"),
        NavigateError::NotFinite => Failure::could_not(e).hint("do the models fit the IMU, are [imu] and [initial] plausible?"),
    }
}
