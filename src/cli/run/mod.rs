//! `nav-sim run`: the main job.

mod inputs;
mod output;
pub(super) mod reduced;

use super::filter::FilterArgs;
use super::{Failure, Session};
use inputs::Inputs;
use nav_sim::ekf::Belief;
use nav_sim::formats::scenario_file;
use nav_sim::imu::Sensor;
use nav_sim::metrics::Summary;
use nav_sim::monte_carlo;
use nav_sim::noise::reduction::window_s;
use nav_sim::report::{Manifest, seconds};
use nav_sim::scenario::{Method, Scenario};
use nav_sim::sensors::imu::TruthError;
use nav_sim::sensors::outage::{Outage, PlacedOutages};
use nav_sim::simulation::lincov::{Assessment, assess, weak_heading};
use nav_sim::simulation::{Experiment, ExperimentError, RunResult};
use std::path::PathBuf;
use std::time::Instant;

pub(super) use output::{empty_or_new, manifest, not_of_another_command, text, write};

/// Monte-Carlo INS/GNSS navigation along TRAJECTORY with MODEL in the filter
///
/// Writes a run directory: epochs.csv (ASEE, RMSE, bias, NEES, coverage at 1 Hz), runs.csv, summary.json,
/// report.html, manifest.json. The same seed gives the same noise to every model, so that runs can be
/// compared pair by pair (see `nav-sim compare`).
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
    /// How statistics are found: monte-carlo
    #[arg(long, value_name = "METHOD", value_parser = parse_method)]
    method: Option<Method>,
    /// Scenario file whose [gnss] section is used
    #[arg(long, value_name = "FILE")]
    gnss: Option<PathBuf>,
    /// Everything of the run in one TOML file; flags win over it (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
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
    let numbers = text.split_once(':').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    let (start_s, end_s) = numbers.ok_or("expected START:END in seconds, such as 300:390, or none")?;
    let outage = Outage { start_s, end_s };
    outage.validate().map_err(|e| e.to_string())?;
    Ok(OutageArg::Window(outage))
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

fn parse_method(text: &str) -> Result<Method, String> {
    match text {
        "monte-carlo" => Ok(Method::MonteCarlo),
        "lincov" => Ok(Method::Lincov),
        _ => Err("expected monte-carlo".to_owned()),
    }
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut scenario = scenario(args)?;
    let inputs = Inputs::read(args, &mut scenario, session)?;
    let seed = session.seed(scenario.run.seed);
    let span = (inputs.trajectory.start_s(), inputs.trajectory.end_s());
    let outages = outages(&scenario, span, seed, session).map_err(|e| match &args.scenario {
        Some(path) if args.outages.is_empty() => e.within(&path.display().to_string()),
        _ => e,
    })?;
    output::try_open(&args.out, &inputs.files)?;
    let unusable = |e| Failure::input(format!("{}: {e}", args.model.display()));
    let track = scenario.track(&inputs.trajectory, &inputs.model, &outages).map_err(impossible)?;
    let belief = scenario.belief(&inputs.model, &outages, &track).map_err(unusable)?;
    doubt_biases(&belief, session);
    scenario.doubts().iter().for_each(|doubt| session.printer.warn(doubt));
    let experiment = scenario.experiment(
        &inputs.trajectory,
        inputs.truth(),
        std::slice::from_ref(&belief),
        &outages,
        seed,
    );
    let reduction = if scenario.filter.states.is_reduced() {
        let longest = outages.iter().map(|o| o.end_s - o.start_s).fold(0.0, f64::max);
        let (interval_s, window_s) = (1.0 / scenario.gnss.rate_hz, window_s(longest));
        let model = &inputs.model;
        let full = scenario.with_full_noise().belief(model, &outages, &track).ok();
        let made = reduced::Made { model, belief: &belief, full, track: &track, interval_s, window_s };
        Some(reduced::reduction(&made, session)?)
    } else {
        None
    };
    doubt_heading(&assess(&track, &belief, &inputs.model), session);
    let (results, wall_s) = simulate(&experiment, scenario.run.runs, session)?;
    let manifest = manifest(scenario, &outages, seed, inputs.files.clone(), inputs.note.clone(), session);
    let throughput_epochs_per_s = results[0].run_epochs as f64 / wall_s;
    let independent_windows = results[0].independent_windows;
    let manifest = Manifest { independent_windows, wall_s, throughput_epochs_per_s, ..manifest };
    let summary = write(&results[0], &manifest, reduction, &args.out)?;
    let shown = if session.json() { nav_sim::report::summary_json } else { text };
    session.printer.result(shown(&summary, throughput_epochs_per_s).trim_end());
    output::doubt_filter(&summary, session);
    session.printer.say(&format!("wrote {}", args.out.display()));
    all_finite(&summary)?;
    not_lost(&summary)
}

/// A filter whose errors are of another order than it believes did what was asked for, and is of no use.
fn not_lost(summary: &Summary) -> Result<(), Failure> {
    if !summary.verdict.is_lost() {
        return Ok(());
    }
    let message =
        format!("the filter is lost: NEES {:.0}, {} if it is right", summary.nees.mean, summary.nees.dof);
    Err(Failure::bound(message)
        .hint("the results are written; does MODEL describe the errors of --truth or --static?"))
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

/// The scenario file with the flags over it, checked.
fn scenario(args: &Args) -> Result<Scenario, Failure> {
    let mut scenario = args.scenario.as_deref().map(scenario_file::read).transpose()?.unwrap_or_default();
    if let Some(path) = &args.gnss {
        scenario.gnss = scenario_file::read(path)?.gnss;
    }
    if !args.outages.is_empty() {
        scenario.outage = Some(windows_of(&args.outages)?);
        (scenario.outage_periodic, scenario.outage_random) = (None, None);
    }
    scenario.run.runs = args.runs.unwrap_or(scenario.run.runs);
    scenario.run.method = args.method.unwrap_or(scenario.run.method);
    args.filter.over(&mut scenario.filter.states, &mut scenario.initial);
    scenario.validate().map_err(Failure::input)?;
    Ok(scenario)
}

/// The outages on this trajectory, said.
fn outages(
    scenario: &Scenario,
    span: (f64, f64),
    seed: u64,
    session: &Session,
) -> Result<Vec<Outage>, Failure> {
    let PlacedOutages { windows, remarks } = scenario.outages_on(span, seed)?;
    remarks.iter().for_each(|remark| session.printer.warn(&remark.to_string()));
    let shown: Vec<String> =
        windows.iter().map(|o| format!("{}–{} s", seconds(o.start_s), seconds(o.end_s))).collect();
    session.printer.say(&match shown.as_slice() {
        [] => "no outage".to_owned(),
        some => format!("outages {}", some.join(", ")),
    });
    Ok(windows)
}

/// A Gauss-Markov process of phi ≈ 1 may have any stationary variance: a filter that starts with it believes
/// nothing of its first sensor readings.
fn doubt_biases(belief: &Belief, session: &Session) {
    for (sensor, limit) in [(Sensor::Accel, 1.0), (Sensor::Gyro, 0.1)] {
        let sigma = belief.process_sigma(sensor);
        if sigma > limit {
            session.printer.warn(&format!(
                "the filter starts with a bias of {sigma:.3} {} ({} of the model, its correlated processes together): \
                 an AR1 of phi near 1? `nav-sim calibrate --parameters` bounds it",
                sensor.unit(),
                sensor.name()
            ));
        }
    }
}

/// Where the motion hardly shows the heading, no filter of this kind is to be believed.
fn doubt_heading(assessment: &Assessment, session: &Session) {
    let measured = assessment.reports.iter().filter(|r| r.measured);
    if let Some(doubt) = weak_heading(measured.map(|r| (r.after_s, r.sigma[8]))) {
        session.printer.warn(&doubt.to_string());
    }
}

/// An experiment that does not fit together.
fn impossible(e: ExperimentError) -> Failure {
    let failure = Failure::input(&e);
    match e {
        ExperimentError::Truth(TruthError::TooShort { .. }) => {
            failure.hint("each run takes a window as long as the trajectory: record for longer")
        }
        ExperimentError::Truth(TruthError::Rate { rate_hz, .. }) => {
            failure.hint(format!("set rate_hz = {rate_hz} in the [imu] section of a --scenario file"))
        }
        _ => failure,
    }
}

/// All runs, and how long they took (s).
pub(super) fn simulate(
    experiment: &Experiment<'_>,
    runs: u64,
    session: &Session,
) -> Result<(Vec<RunResult>, f64), Failure> {
    let start = Instant::now();
    let progress = session.progress("runs", runs);
    let results = monte_carlo::run(experiment, runs, &|n| progress.add(n)).map_err(impossible)?;
    Ok((results, start.elapsed().as_secs_f64()))
}
