//! `nav-sim efficiency`: Monte-Carlo study of the estimators themselves.

use super::parse::words;
use super::{Failure, Session};
use crate::efficiency::{self, EfficiencyFile, EstimatorStudy};
use crate::formats::atomic;
use crate::report;
use nav_sim_calibration::Weighting;
use nav_sim_calibration::efficiency::StudyError;
use std::path::{Path, PathBuf};

/// Study the estimators themselves by Monte Carlo
///
/// Draws H sets of K replicates from a model with [spread], contaminates each set in several ways, estimates
/// from it, and says how far from theta_0 the estimates are: robust RMSE (eq. 15 of the paper), its
/// Monte-Carlo error, and the median relative error. What is finished is kept in the output directory
/// (sets.csv): a study that was stopped continues where it was, to the same results; more --sets extend it.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim efficiency examples/paper_fig2.toml --sets 4 --samples 8192 -o quick
  nav-sim efficiency examples/paper_fig2.toml --sets 2 --samples 8192 --sensitivity -o curves
  nav-sim efficiency examples/paper_fig2.toml --sets 6 --samples 8192 -o quick --format json")]
pub(crate) struct Args {
    /// The study (TOML)
    #[arg(value_name = "STUDY")]
    study: PathBuf,
    /// Directory of the results, finished and unfinished
    #[arg(long, short, value_name = "DIR", default_value = "efficiency")]
    out: PathBuf,
    /// Sets of replicates, instead of the study's
    #[arg(long, value_name = "H", value_parser = clap::value_parser!(u64).range(1..=1 << 40))]
    sets: Option<u64>,
    /// Samples of a replicate, instead of the study's
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u64).range(4..=1 << 40))]
    samples: Option<u64>,
    /// Weights of the scales, instead of the study's
    #[arg(long, value_name = "W", value_parser = words::<Weighting>(&WEIGHTINGS))]
    weighting: Option<Weighting>,
    /// Also write sensitivity.csv: how far one outlier, or one replicate with an abnormal random walk, moves
    /// each estimate of the first set, against its size
    #[arg(long)]
    sensitivity: bool,
}

const WEIGHTINGS: [(&str, &str); 2] = [
    (Weighting::Model.name(), "Those of calibrate"),
    (Weighting::Edof.name(), "Those of the literature"),
];

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let file = efficiency::file::read(&args.study)?;
    let mut design = file.design;
    if let Some(samples) = args.samples {
        design = design.with_samples(samples as usize);
    }
    design.weighting = args.weighting.unwrap_or(design.weighting);
    let of_study = |e: StudyError| Failure::input(format!("{}: {e}", args.study.display()));
    let mut study = EstimatorStudy::new(design).map_err(of_study)?;
    study.design.seed = session.seed(file.seed);
    let sets = args.sets.unwrap_or(file.sets);
    let mut directory = study.open(&args.out)?;
    let done = directory.done.len() as u64;
    if done > 0 {
        session.say(format!("{done} sets are there already"));
    }
    if directory.told > done {
        let (out, told) = (args.out.display(), directory.told);
        session.warn(format!("{out}/sets.csv was cut: {done} of the {told} sets of {out}/results.json are left; the rest is estimated anew"));
    }
    let progress = session.progress("sets", sets.saturating_sub(done));
    // Long enough that no thread waits for the last set of a block for a large part of it.
    let block = 8 * session.threads() as u64;
    study.estimate(sets, block, &mut directory, &|sets| progress.add(sets))?;
    write(&args.out, &study.results(sets, &directory), session)?;
    if args.sensitivity {
        atomic::write(
            &args.out.join("sensitivity.csv"),
            study.sensitivity().map_err(of_study)?,
        )?;
    }
    session.wrote(&args.out);
    Ok(())
}

fn write(out: &Path, results: &EfficiencyFile, session: &Session) -> Result<(), Failure> {
    let document = session.answer(results);
    atomic::write(
        &out.join("results.csv"),
        efficiency::efficiency_csv(results),
    )?;
    atomic::write(&out.join("results.json"), report::json(results))?;
    atomic::write(&out.join("rmse.svg"), document.svg())?;
    Ok(atomic::write(&out.join("report.html"), document.html())?)
}
