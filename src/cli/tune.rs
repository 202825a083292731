//! `nav-sim tune`: factors on a noise model that make its filter consistent.

use super::parse::one_of;
use super::pictures::{PlotArgs, claim_output};
use super::read::placed;
use super::run::no_filter;
use super::{Failure, Session, read, turn_on};
use crate::formats::atomic::Written;
use crate::formats::draws_file::{self, Draws};
use crate::formats::model_file::{self, ModelFile};
use crate::report::{Input, unexpected_line};
use crate::run::{OutageFlag, checked_scenario};
use crate::tune::{self, Truths, TuneInputs};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov::{Aim, Per, Track, TrueErrors, drive};
use nav_sim_signal::noise::Model;
use std::path::{Path, PathBuf};

/// Find the smallest factors on MODEL that make its filter consistent for another truth
///
/// Factors multiply variances of all processes but quantization noise, which is in no filter. They are found by linear
/// covariance analysis along the trajectory. Where no factor makes the filter consistent, the exit code is 3 and no model
/// is written.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim tune calib_data/tactical.toml --truth calib_data/consumer_mems.toml -o tuned.toml
  nav-sim tune calib_data/tactical.toml --for mean \\
      --truth calib_data/tactical.toml calib_data/consumer_mems.toml \\
      --trajectory trajectories/figure_eight.toml --outage 60:90
  nav-sim tune calib_data/tactical.toml --per process --format json \\
      --truth calib_data/consumer_mems.toml")]
pub(crate) struct Args {
    /// Noise model to be tuned
    model: PathBuf,
    /// Noise models that may make the errors, such as those of single recordings
    #[arg(long = "truth", value_name = "MODEL2", num_args = 1..)]
    truths: Vec<PathBuf>,
    /// Truths are MODEL itself and the draws of its calibration (MODEL.draws.json, which `calibrate` writes), each with the
    /// parameters of a recording of its own where MODEL has a [spread]: errors count up to the upper end of their 95 % interval
    #[arg(long, conflicts_with = "truths")]
    intervals: bool,
    /// Trajectory: motion profile (.toml) or table (.csv) [default: a built-in drive with outages of that length]
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    /// Window without fixes, in seconds (repeatable), or "none" (default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END")]
    outages: Vec<OutageFlag>,
    /// Meaning of consistent: worst, no error of any truth exceeds what the filter states; mean, the NEES is right on average
    #[arg(long = "for", value_name = "AIM", value_parser = one_of::<Aim>(&Aim::NAMES), default_value_t)]
    aim: Aim,
    /// Whether each sensor or each process has a factor of its own
    #[arg(long, value_name = "WHAT", value_parser = one_of::<Per>(&Per::NAMES), default_value_t)]
    per: Per,
    /// Filter to tune: full, 15 or 21 (these take longer); the filter that `run` makes by default is assessed too
    #[arg(long, value_name = "STATES", default_value = "full")]
    filter: FilterStates,
    /// Scenario file: receiver, start, IMU rate (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
    /// Model file to write
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// What helps where fixes are too rare to reduce a model.
const RARE_FIXES: &str = "raise it: the verdict is of the filter of 15 states too, whatever --filter tunes";

/// Longest schedule of outages that is looked at where no trajectory says how long (s).
const DAY_S: f64 = 86_400.0;

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    refuse_recordings(args)?;
    let mut scenario = checked_scenario(args.scenario.as_deref(), &args.outages)?;
    let files = files(args)?;
    let _pictures = args.plot.claim(files.iter().map(|f| &f.path), session)?;
    let _own = claim_output(args.out.as_deref(), files.iter().map(|f| &f.path), Written::Tuned, session)?;
    let file = read::model(&args.model, session)?;
    let model = read::at_rate(&args.model, &file.model, scenario.imu.rate_hz, session)?;
    turn_on::expect(&mut scenario.initial, &file, &args.model, session);
    let truths = truths(args, (&file, &model), &scenario, session)?;
    let (track, outages) = track(args, &scenario, &model, session)?;
    let result = tune::tune(&TuneInputs {
        scenario: &scenario,
        model: &model,
        truths,
        track: &track,
        outages: &outages,
        states: args.filter,
        per: args.per,
        aim: args.aim,
    });
    let result = result.map_err(|e| no_filter(&e, &args.model, args.scenario.as_deref(), RARE_FIXES))?;
    let document = session.answer(&result);
    let drawn = args.plot.draw(&document, session);
    if let Some(unmet) = result.unmet() {
        drawn?;
        let failure = Failure::bound(format!("{}: {unmet}; no tuned model is written", args.model.display()));
        return Err(failure.hint(result.remedy()));
    }
    if let Some(out) = &args.out {
        let goal = format!("{} of {}", args.aim, if args.intervals { "intervals" } else { "truths" });
        let tuned = tune::tuned(&file, &result.factors, &goal, &files);
        model_file::write(out, &tuned)?;
        session.wrote(out);
    }
    drawn
}

/// A directory or a table holds samples: a truth is a model.
fn refuse_recordings(args: &Args) -> Result<(), Failure> {
    if args.truths.is_empty() && !args.intervals {
        return Err(Failure::input("no truth to be consistent with: neither --truth nor --intervals is given")
            .hint("give models (--truth OTHER.toml, one a recording), or --intervals for a MODEL of `nav-sim calibrate`"));
    }
    let is_samples =
        |p: &&PathBuf| p.is_dir() || p.extension().is_some_and(|e| e == "csv" || e == "npy" || e == "gz");
    match args.truths.iter().find(is_samples) {
        None => Ok(()),
        Some(path) => Err(Failure::input(format!("--truth {}: recordings, not a model", path.display()))
            .hint("make a model of each: nav-sim calibrate FILE --estimator gmwm -o FILE.toml")),
    }
}

fn files(args: &Args) -> Result<Vec<Input>, Failure> {
    let draws = draws_file::beside(&args.model);
    let mut named = vec![("model", &args.model)];
    named.extend((args.intervals && draws.exists()).then_some(("draws", &draws)));
    named.extend(args.truths.iter().map(|p| ("truth", p)));
    named.extend(args.trajectory.iter().map(|p| ("trajectory", p)));
    named.extend(args.scenario.iter().map(|p| ("scenario", p)));
    named.iter().map(|(role, path)| read::input(role, path)).collect()
}

/// What may be true, at the rate of the IMU: noise, turn-on bias, and what the scenario states of the true IMU and
/// receiver.
fn truths(
    args: &Args,
    (file, model): (&ModelFile, &Model),
    scenario: &Scenario,
    session: &Session,
) -> Result<Truths, Failure> {
    let true_errors = |path: &Path, model: Model, turned_on: &ModelFile| {
        let (mut imu, gnss) = (scenario.imu.clone(), scenario.gnss.clone());
        turn_on::make(&mut imu, turned_on, path, session);
        TrueErrors { model, imu, gnss }
    };
    let truths = if args.intervals {
        let draws = draws(&args.model, file, scenario.imu.rate_hz, session.asked_seed().unwrap_or(1))?;
        let estimate = true_errors(&args.model, model.clone(), file);
        let names = vec![format!("{} and the {} draws beside it", args.model.display(), draws.models.len())];
        let drawn = draws.models.into_iter().map(|model| TrueErrors { model, ..estimate.clone() });
        let errors = std::iter::once(estimate.clone()).chain(drawn).collect();
        Truths { names, errors, stretch: Some(draws.stretch) }
    } else {
        let truth = |path: &PathBuf| {
            let file = read::model(path, session)?;
            let model = read::at_rate(path, &file.model, scenario.imu.rate_hz, session)?;
            Ok::<_, Failure>((path.display().to_string(), true_errors(path, model, &file)))
        };
        let named = args.truths.iter().map(truth).collect::<Result<Vec<_>, _>>()?;
        let (names, errors) = named.into_iter().unzip();
        Truths { names, errors, stretch: None }
    };
    let mut doubts = Vec::new();
    for truth in &truths.errors {
        for doubt in (Scenario { imu: truth.imu.clone(), ..scenario.clone() }).unexpected() {
            if !doubts.contains(&doubt) {
                doubts.push(doubt);
            }
        }
    }
    session.warn_all(doubts.iter().map(unexpected_line));
    Ok(truths)
}

/// The draws beside a model file; what the intervals in the file itself leave out is how its parameters hang together.
fn draws(path: &Path, file: &ModelFile, rate_hz: f64, seed: u64) -> Result<Draws, Failure> {
    let missing =
        || format!("{}: the draws of its calibration are missing", draws_file::beside(path).display());
    let found =
        draws_file::of_recordings(path, file, rate_hz, seed).and_then(|draws| draws.ok_or_else(missing));
    found.map_err(|doubt| {
        Failure::input(doubt)
            .hint("calibrate again: the draws are written beside MODEL, unless with --bootstrap 0")
    })
}

/// The way of the analysis with its outages.
fn track(
    args: &Args,
    scenario: &Scenario,
    model: &Model,
    session: &Session,
) -> Result<(Track, Vec<Outage>), Failure> {
    let seed = session.asked_seed().or(scenario.run.seed).unwrap_or(0);
    let Some(path) = &args.trajectory else {
        let outages = scenario.outages_on((0.0, DAY_S), seed)?.windows;
        let lengths: Vec<f64> = outages.iter().map(|o| o.end_s - o.start_s).collect();
        let track = drive(model, &scenario.gnss, &lengths).ok_or_else(|| {
            Failure::input("no built-in drive for this receiver").hint("give a trajectory with --trajectory")
        })?;
        session.say("along a built-in drive with outages as long; --trajectory takes another");
        return Ok((track, outages));
    };
    let trajectory = read::trajectory(path, session)?;
    let outages = placed(scenario, (trajectory.start_s(), trajectory.end_s()), seed, session)?;
    let track = scenario.track(&trajectory, model, &outages).map_err(Failure::input)?;
    Ok((track, outages))
}
