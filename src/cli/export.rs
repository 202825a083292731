//! `nav-sim export`: a noise model as the parameters of other programs.

use super::parse::one_of;
use super::pictures::claim_output;
use super::{Failure, Session};
use crate::export::{self, Target};
use crate::formats::atomic::{self, Written};
use crate::formats::model_file;
use crate::report;
use nav_sim_signal::noise::practical::{Horizon, Policy};
use std::path::PathBuf;

/// Write a noise model as the parameters of another program
///
/// Other filters know white noise (N) and one bias process, a random walk (K) or a Gauss-Markov process. --policy says
/// which such pair stands for the model's noisiest axis over --horizon.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim export calib_data/consumer_mems.toml --target kalibr -o imu.yaml
  nav-sim export calib_data/consumer_mems.toml --target px4 --policy envelope --horizon 1s:30s
  nav-sim export calib_data/tactical.toml --target kf-gins --format json")]
pub(crate) struct Args {
    /// Noise model (TOML)
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Program to export to
    #[arg(long, value_name = "PROGRAM", value_parser = one_of::<Target>(&Target::NAMES))]
    target: Target,
    /// strict: WN and RW as they are; matched: the model's Allan deviation at 1 s and the closest bias; envelope: the
    /// smallest pair that is nowhere below the model
    #[arg(long, value_name = "POLICY", value_parser = one_of::<Policy>(&Policy::NAMES), default_value = Policy::Matched.name())]
    policy: Policy,
    /// Averaging times over which the pair stands for the model
    #[arg(long, value_name = "FROM:TO", value_parser = horizon, default_value = "1s:100s")]
    horizon: Horizon,
    /// File to write to (default: stdout)
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn horizon(text: &str) -> Result<Horizon, String> {
    let (from_s, to_s) = super::parse::seconds_range(text)?;
    Ok(Horizon { from_s, to_s })
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let file = model_file::read(&args.model)?;
    let shown = args.model.display().to_string();
    let _own = claim_output(args.out.as_deref(), [&args.model], Written::Export, session)?;
    let export = export::exported(&file, args.target, args.policy, args.horizon)
        .map_err(|failure| failure.within(&shown))?;
    let text = export.text(&shown);
    if let Some(out) = &args.out {
        atomic::write(out, text.clone() + "\n")?;
    }
    for line in export.summary() {
        session.say(&line);
    }
    for doubt in export.doubts() {
        session.warn(&doubt);
    }
    match &args.out {
        _ if session.json() => session.result(report::json(&export.json(&shown)).trim_end()),
        Some(out) => session.result(format!("{}: {}", out.display(), args.target.name)),
        None => session.result(&text),
    }
    Ok(())
}
