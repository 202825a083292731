//! `nav-sim design`: how many recordings, and how long.

use super::calibrate::ESTIMATORS;
use super::pictures::PlotArgs;
use super::{Failure, Session, parse, read};
use crate::design::{self, Design, DesignInputs, Designs, Destination};
use crate::formats::model_file::ModelFile;
use crate::run::{NavigateInputs, OutageFlag, TrueImu, windows_of};
use nav_sim_calibration::{Bootstrap, Estimator, Settings};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::scenario::{Method, Scenario};
use std::path::PathBuf;

/// Predict how well a number of recordings of given length would determine an IMU like MODEL
///
/// Draws the wavelet variances of recordings from their sampling distribution, with the [spread] of MODEL between
/// recordings, and calibrates them as `nav-sim calibrate` would. The expected interval is made of the scatter of these
/// estimates about MODEL. What one calibration states is made of the scatter of its own recordings, half of them more and half
/// less; where a parameter is known to ± 100 %, rather less. 200 draws know such an interval to about 20 %. With --trajectory there is also the
/// interval on the horizontal error (95 % quantile) at the end of each outage, for a filter that knows the IMU.
/// Without --recordings or --hours a table of several is printed.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim design calib_data/tactical.toml --recordings 6 --hours 2
  nav-sim design calib_data/consumer_mems.toml --recordings 6 --hours 1 --draws 50 --estimator awv
  nav-sim design calib_data/tactical.toml --recordings 4 --hours 1 --draws 50 \\
      --trajectory trajectories/figure_eight.toml --outage 300:360")]
pub(crate) struct Args {
    /// Noise model of the IMU, as far as it is known
    model: PathBuf,
    /// Number of recordings [default: a table of 3, 6 and 12]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=1000))]
    recordings: Option<u32>,
    /// Length of each in hours [default: a table of 1, 3 and 10]
    #[arg(long, value_name = "HOURS", value_parser = parse::positive)]
    hours: Option<f64>,
    /// How they will be calibrated
    #[arg(long, value_name = "ESTIMATOR", value_parser = parse::words::<Estimator>(AVERAGES), default_value_t)]
    estimator: Estimator,
    /// Draws of the bootstrap
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(40..=10_000))]
    draws: u32,
    /// Trajectory: motion profile (.toml) or table (.csv)
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    /// Window without fixes, in seconds (repeatable; default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END", requires = "trajectory")]
    outages: Vec<OutageFlag>,
    #[command(flatten)]
    plot: PlotArgs,
}

/// The estimators of several recordings.
const AVERAGES: &[(&str, &str)] = ESTIMATORS.split_at(3).0;

/// Longest recording that is planned (h): a year.
const LONGEST_H: f64 = 8766.0;

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    if args.hours.is_some_and(|hours| hours > LONGEST_H) {
        return Err(Failure::input("--hours: longer than a year"));
    }
    let _pictures = args.plot.claim(std::iter::once(&args.model).chain(&args.trajectory), session)?;
    let file = read::model(&args.model, session)?;
    let mut scenario = scenario(args)?;
    let mut navigation = None;
    if let Some(path) = &args.trajectory {
        let trajectory = read::trajectory(path, session)?;
        let span = (trajectory.start_s(), trajectory.end_s());
        let outages = scenario.outages_on(span, 0)?.windows;
        scenario.imu.rate_hz = file.model.rate_hz;
        scenario.validate().map_err(Failure::input)?;
        let inputs = NavigateInputs::new(trajectory, file.model.clone(), TrueImu::AsBelieved);
        navigation = Some((inputs, outages));
    }
    let destination =
        navigation.as_mut().map(|(inputs, outages)| Destination { inputs, scenario: &scenario, outages });
    let designs = Designs { schema_version: 1, designs: designs(args, &file, destination, session)? };
    let document = session.answer(&designs);
    args.plot.draw(&document, session)
}

/// Drives are analysed, with a state for every process.
fn scenario(args: &Args) -> Result<Scenario, Failure> {
    let mut scenario = Scenario::default();
    scenario.run.method = Method::Lincov;
    scenario.filter.states = FilterStates::Full;
    if !args.outages.is_empty() {
        scenario.outage = Some(windows_of(&args.outages)?);
    }
    Ok(scenario)
}

/// One design for each number of recordings and length.
fn designs(
    args: &Args,
    file: &ModelFile,
    navigation: Option<Destination<'_>>,
    session: &Session,
) -> Result<Vec<Design>, Failure> {
    let settings = Settings::default();
    let bootstrap = Bootstrap { draws: args.draws as usize, seed: session.asked_seed().unwrap_or(1) };
    let mut inputs =
        DesignInputs { file, estimator: args.estimator, settings: &settings, bootstrap, navigation };
    let recordings = args.recordings.map_or(vec![3, 6, 12], |k| vec![k as usize]);
    let hours = args.hours.map_or(vec![1.0, 3.0, 10.0], |h| vec![h]);
    let mut designs = Vec::new();
    for k in recordings {
        for h in &hours {
            let design = design::design(&mut inputs, k, *h);
            designs.push(design.map_err(|e| Failure::input(e).hint("more, or longer recordings"))?);
        }
    }
    Ok(designs)
}
