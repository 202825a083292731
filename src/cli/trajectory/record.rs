//! `nav-sim trajectory record`.

use super::{Source, wrote};
use crate::app::inputs;
use crate::cli::{Failure, Session};
use crate::io::atomic::{AtomicDir, Claim, Found, claim_directory};
use crate::io::scenario_file;
use crate::io::trajectory_file::{Rows, write_rows};
use crate::report::{gnss_csv, imu_csv, initial_toml};
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::aiding::AidingSettings;
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::simulation::{Plan, record};
use nav_sim_signal::noise::continuous;
use std::path::PathBuf;

/// Names of the files, in the order of writing.
const FILES: [&str; 4] = ["imu.csv", "gnss.csv", "reference.csv", "initial.toml"];

/// Write what an IMU with the noise of MODEL and a GNSS receiver record along a trajectory
///
/// The files are those that `fuse` reads: imu.csv (rates), gnss.csv, reference.csv (the truth, 10 Hz),
/// initial.toml (a start drawn from the initial standard deviations). The noise is that of the first run of
/// `run` with the same seed; a turn-on bias that MODEL states is drawn too.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory record trajectories/land_vehicle.toml calib_data/tactical.toml -o recorded
  nav-sim trajectory record trajectories/figure_eight.toml calib_data/tactical.toml --seed 1
  nav-sim trajectory record trajectories/fixed_wing.toml calib_data/consumer_mems.toml \\
      --scenario examples/scenario.toml -o flight")]
pub(super) struct Args {
    #[command(flatten)]
    source: Source,
    /// Noise model of the IMU
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Scenario file whose [imu], [gnss] and [initial] sections are used
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Directory to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/recording")]
    out: PathBuf,
}

pub(super) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut scenario = args
        .scenario
        .as_deref()
        .map(scenario_file::read)
        .transpose()?
        .unwrap_or_default();
    let (trajectory, _) = args.source.read(session)?;
    let shown = args.model.display();
    let context = session.context();
    let file = inputs::model(&args.model, &context)?;
    let model = continuous::at_rate(&file.model, scenario.imu.rate_hz)
        .map_err(|e| Failure::input(format!("{shown}: {e}")))?;
    inputs::make_turn_on(&mut scenario.imu, &file, &args.model, &context);
    let seed = session.seed(scenario.run.seed);
    // a recording is what IMU and receiver give: neither barometer nor wheel, no filter
    let scenario = Scenario {
        baro: None,
        aiding: AidingSettings::default(),
        ..scenario
    };
    let experiment = scenario.experiment(&trajectory, Truth::Model(&model), &[], &[], seed);
    let plan = Plan::new(&experiment).map_err(Failure::input)?;
    let recording = record(&plan, 0);
    let mut reference = Vec::new();
    write_rows(&mut reference, &trajectory, Rows::Rate(10.0)).map_err(Failure::could_not)?;
    let initial = initial_toml(trajectory.start_s(), &recording.start, &scenario.initial);
    let contents = [
        imu_csv(&recording.imu).into_bytes(),
        gnss_csv(&recording.gnss).into_bytes(),
        reference,
        initial.into_bytes(),
    ];
    let _own = claim(args, &contents, session)?;
    let mut directory = AtomicDir::create(&args.out)?;
    for (name, contents) in FILES.iter().zip(contents) {
        directory.write(name, contents)?;
    }
    directory.commit()?;
    wrote(&args.out, session);
    Ok(())
}

/// Refuses to overwrite an input, what this command did not make, or a recording that is not this one.
fn claim(args: &Args, contents: &[Vec<u8>; 4], session: &Session) -> Result<Claim, Failure> {
    let inputs = [
        Some(&args.source.path),
        Some(&args.model),
        args.scenario.as_ref(),
    ];
    let inputs = inputs.into_iter().flatten().map(|path| path.as_path());
    let recognise = |_: &str| {
        let present = FILES.map(|name| std::fs::read(args.out.join(name)).ok());
        let is_whole = present.iter().all(Option::is_some);
        let is_same = present
            .iter()
            .zip(contents)
            .all(|(file, made)| file.as_ref() == Some(made));
        Ok(if is_whole {
            Found::result(is_same)
        } else {
            Found::Foreign
        })
    };
    claim_directory(&args.out, &FILES, inputs, session.existing(), recognise)
}
