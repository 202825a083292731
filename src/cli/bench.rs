//! `nav-sim bench`: what a run-epoch costs on this machine (hidden).

use super::{Failure, Session};
use nav_sim_calibration::median;
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::lanes::Level;
use nav_sim_navigation::throughput::{Load, RUN_EPOCHS, model};
use std::time::Instant;

/// Print what a run-epoch costs on this machine, and which vector units are used
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim bench
  nav-sim bench --rounds 50
  nav-sim bench --format json")]
pub(crate) struct Args {
    /// Seconds of eight runs to time; the median of the rounds is printed
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rounds: u32,
}

/// Nanoseconds of a run-epoch.
#[derive(serde::Serialize)]
struct Costs {
    dispatch: String,
    noise_ns: f64,
    filter_ns: f64,
    fix_ns: f64,
    run_epochs_per_s_and_core: f64,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let costs = measure(args.rounds as usize)?;
    let Costs {
        dispatch,
        noise_ns,
        filter_ns,
        fix_ns,
        run_epochs_per_s_and_core: rate,
    } = &costs;
    let text = || {
        format!(
            "vector units  {dispatch}\n\
         noise         {noise_ns:6.1} ns a run-epoch (N2 on six axes: 30 numbers)\n\
         filter        {filter_ns:6.1} ns (15 states, strapdown and covariance at 100 Hz)\n\
         fixes         {fix_ns:6.1} ns (position and velocity at 1 Hz)\n\
         together      {:6.1} ns: {:.2} million run-epochs a second and core",
            noise_ns + filter_ns + fix_ns,
            rate / 1e6
        )
    };
    session.show(|| crate::report::json(&costs), text);
    Ok(())
}

fn measure(rounds: usize) -> Result<Costs, Failure> {
    let model = model().map_err(Failure::could_not)?;
    let level = Level::best();
    let mut load = Load::new(&model, FilterStates::Reduced15, level).map_err(Failure::could_not)?;
    let mut times = [const { Vec::<f64>::new() }; 3];
    for _ in 0..rounds {
        let parts: [&mut dyn FnMut(&mut Load<'_>); 3] =
            [&mut |l| l.noise(), &mut |l| l.filter(), &mut |l| l.fix()];
        for (part, times) in parts.into_iter().zip(&mut times) {
            let start = Instant::now();
            part(&mut load);
            times.push(start.elapsed().as_secs_f64() / RUN_EPOCHS as f64);
        }
    }
    let [noise, filter, fix] = times.map(|t| median(&t));
    Ok(Costs {
        dispatch: level.to_string(),
        noise_ns: noise * 1e9,
        filter_ns: filter * 1e9,
        fix_ns: fix * 1e9,
        run_epochs_per_s_and_core: 1.0 / (noise + filter + fix),
    })
}
