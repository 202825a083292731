//! `nav-sim synthesize`: replicate recordings from a noise model.

use super::{Failure, Session};
use crate::synthesize::SynthesisRequest;
use nav_sim_signal::imu::Channel;
use std::path::{Path, PathBuf};

/// Synthesise static recordings from a noise model
///
/// Writes replicate_1, replicate_2, … and a manifest.json with the parameters that were drawn. The same seed gives the
/// same noise with and without contamination, and at any number of threads.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml \\
      --replicates 9 --samples 65536 --spread --seed 1 -o replicates
  nav-sim synthesize calib_data/consumer_mems.toml --replicates 8 --samples 65536 \\
      --axes x --contaminate section5-II -o corrupted
  nav-sim synthesize calib_data/tactical.toml --duration 600 -o tactical")]
pub(crate) struct Args {
    #[command(flatten)]
    request: SynthesisRequest,
    /// Directory to write to
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let request = &args.request;
    let job = request.synthesis(&session.context())?;
    let contamination = request.contaminate.as_deref().map(Path::new);
    let inputs = contamination.into_iter().chain([request.model.as_path()]);
    let _own = job.claim(&args.out, inputs, session.existing())?;
    let progress = session.progress("replicates", request.replicates);
    let manifest = job.write(&args.out, || progress.add(1))?;
    let text = || {
        let axes: Vec<String> = job.channels.iter().map(Channel::to_string).collect();
        format!(
            "{}: {} replicates of {} samples at {} Hz, {}, seed {}",
            args.out.display(),
            request.replicates,
            job.samples,
            job.file.model.rate_hz,
            axes.join(" "),
            job.seed
        )
    };
    session.show(|| manifest, text);
    Ok(())
}
