//! `nav-sim choose`: which noise model, on the user's own recordings.

use super::calibrate::ESTIMATORS;
use super::jobs::unknown_model;
use super::parse::words;
use super::pictures::PlotArgs;
use super::read::{self, placed};
use super::recordings::{ReadingArgs, Said, WHOLE};
use super::run::Words;
use super::{Failure, Session};
use crate::calibrate::{CalibrationNote, CalibrationOptions};
use crate::choose::{self, Candidate, ChoiceDrive, ChoiceReport, Inflation};
use crate::formats::recordings::Gaps;
use crate::run::{OutageFlag, checked_scenario};
use nav_sim_calibration::{Bootstrap, Estimator, ModelChoice, Settings, Trim};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::outage::Outage;
use std::path::PathBuf;

/// Choose the noise model for a filter by navigating on recordings left out of its calibration
///
/// Leaves out one recording at a time, calibrates every candidate on the others and navigates along TRAJECTORY with
/// windows of the one left out. Ranks the candidates by the mean log density of the true errors at the ends of outages
/// under the filter's covariance, which rewards accuracy and consistency together. Also prints RMSE, NEES and coverage,
/// with intervals over recordings. Writes report.html, ranking.json and model.toml, the winner calibrated on all
/// recordings.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml --replicates 4 --samples 16384 -o recordings
  nav-sim choose recordings --trajectory trajectories/figure_eight.toml --outage 60:90 \\
      --estimator awv,dr-awv --inflate none,x10
  nav-sim choose recordings --trajectory trajectories/figure_eight.toml --outage 60:90 \\
      --estimator awv --model N1,WN+RW --filter 15,full -o out/models --format json")]
pub(crate) struct Args {
    /// Static recordings, three or more files, or directories of them
    #[arg(required = true, value_name = "RECORDINGS")]
    inputs: Vec<PathBuf>,
    /// Trajectory: motion profile (.toml) or table (.csv)
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    /// Window without fixes, in seconds (repeatable) (default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END")]
    outages: Vec<OutageFlag>,
    /// Estimators to compare [default: awv, sr-awv, dr-awv and, for comparison, gmwm and avlr of single recordings]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = words::<Estimator>(EACH))]
    estimator: Vec<Estimator>,
    /// Models to compare, such as N2,N1,WN+RW,auto [default: N2, and WN+RW with awv]
    #[arg(long, value_name = "MODELS", value_delimiter = ',')]
    model: Vec<String>,
    /// Filters to compare: 15, 21, full [default: 15, and full with awv]
    #[arg(long, value_name = "STATES", value_delimiter = ',')]
    filter: Vec<FilterStates>,
    /// How models are inflated: none, tuned (consistent in the mean for the models of the single recordings), x10 (ten
    /// times the standard deviations) [default: none, and all three with awv]
    #[arg(long, value_name = "HOW", value_delimiter = ',')]
    inflate: Vec<Inflation>,
    /// Runs on each recording (default: two for each window that fits side by side, 16 to 64)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    runs: Option<u64>,
    /// What DR-AWV drops at each end of each scale: a number, or a share such as 30%
    #[arg(long, value_name = "A", default_value_t)]
    trim: Trim,
    /// Scenario file: receiver, start, what filters expect (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotArgs,
    /// Directory to make
    #[arg(long, short, value_name = "DIR", default_value = "out/choice")]
    out: PathBuf,
    /// What to do where the time jumps or stands still
    #[arg(long, value_parser = words::<Gaps>(WHOLE), default_value_t)]
    gaps: Gaps,
    #[command(flatten)]
    recordings: ReadingArgs,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let candidates = candidates(args)?;
    let inputs = args.inputs.iter().chain([&args.trajectory]).chain(&args.scenario).map(PathBuf::as_path);
    let _own = choose::claim_choice(&args.out, inputs, session.existing())?;
    let _picture = args.plot.claim(args.inputs.iter().chain([&args.trajectory]), session)?;
    let scenario = checked_scenario(args.scenario.as_deref(), &args.outages)?;
    let trajectory = read::trajectory(&args.trajectory, session)?;
    let seed = session.seed(scenario.run.seed);
    let outages = outages(&scenario, (trajectory.start_s(), trajectory.end_s()), seed, session)?;
    let options = CalibrationOptions {
        reading: args.recordings.options(args.gaps),
        skip_warm_up: args.recordings.skips_warm_up(),
        settings: Settings { trim: args.trim, ..Settings::default() },
        bootstrap: Some(Bootstrap { seed, ..Bootstrap::default() }),
        turn_on: false,
        ..CalibrationOptions::default()
    };
    let drive = ChoiceDrive { trajectory, scenario, outages: outages.clone(), seed, runs: args.runs };
    let words = Words::new(session);
    let chosen = choose::choose(&args.inputs, &options, &candidates, drive, &mut Said::new(session), &words)?;
    let shown = args.trajectory.display().to_string();
    let report = ChoiceReport {
        ranking: &chosen.ranking,
        influence: Some(&chosen.influence),
        outages: &outages,
        trajectory: &shown,
        seed,
    };
    let note = CalibrationNote {
        efficiency_convention: nav_sim_signal::wavelet::Convention::Exact,
        reading: args.recordings.provenance(args.gaps),
        seed: Some(seed),
        inputs: Vec::new(),
    };
    chosen.write(&args.out, &args.trajectory, note, &report)?;
    let document = session.answer(&report);
    args.plot.draw(&document, session)?;
    session.say(format!(
        "wrote {0}: report.html, ranking.json, model.toml (nav-sim export {0}/model.toml)",
        args.out.display()
    ));
    Ok(())
}

/// The estimators that are one.
const EACH: &[(&str, &str)] = ESTIMATORS.split_at(6).0;

/// Those that are usual, or all combinations of what is given.
fn candidates(args: &Args) -> Result<Vec<Candidate>, Failure> {
    let Args { estimator, model, filter, inflate, .. } = args;
    if estimator.is_empty() && model.is_empty() && filter.is_empty() && inflate.is_empty() {
        return Ok(Candidate::usual());
    }
    let mut models = model
        .iter()
        .map(|m| m.parse().map_err(unknown_model))
        .collect::<Result<Vec<ModelChoice>, Failure>>()?;
    if models.is_empty() {
        models.push(ModelChoice::default());
    }
    let averages = [Estimator::Awv, Estimator::SrAwv, Estimator::DrAwv];
    let candidates = Candidate::product(
        if estimator.is_empty() { &averages } else { estimator },
        &models,
        if filter.is_empty() { &[FilterStates::Reduced15] } else { filter },
        if inflate.is_empty() { &[Inflation::None] } else { inflate },
    );
    if candidates.iter().any(Candidate::is_eligible) {
        return Ok(candidates);
    }
    Err(Failure::input("no candidate uses all recordings: gmwm, rgmwm and avlr take one at a time")
        .hint("add awv, sr-awv or dr-awv to --estimator"))
}

fn outages(
    scenario: &Scenario,
    span_s: (f64, f64),
    seed: u64,
    session: &Session,
) -> Result<Vec<Outage>, Failure> {
    let outages = placed(scenario, span_s, seed, session)?;
    if outages.is_empty() {
        return Err(Failure::input("there is no outage, and candidates are judged at the ends of outages")
            .hint("give one with --outage START:END"));
    }
    Ok(outages)
}
