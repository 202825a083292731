//! From a directory of static recordings to the drift after an outage: calibrate, run, print.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::prelude::*;
use std::path::Path;

pub(crate) fn drift(recordings: &Path, drive: &Path) -> Result<f64, Box<dyn std::error::Error>> {
    let words = [recordings.as_os_str(), "--bootstrap=0".as_ref()];
    let calibrate = Invocation::<Calibrate>::of(words)?.request;
    let model = calibrate.run(&Context::default())?.model(Estimator::DrAwv);
    let (trajectory, _) = load_trajectory(drive, None)?;
    let inputs = NavigateInputs::new(trajectory, model, TrueImu::AsBelieved);
    let mut scenario = Scenario::default();
    scenario.run.runs = 16;
    let outage = Outage {
        start_s: 300.0,
        end_s: 390.0,
    };
    let found = navigate(&inputs, &scenario, &[outage], 1, &Context::default())?;
    let end = found.summary.outages[0].horizontal_error_end_m;
    println!(
        "after 90 s without GNSS: {:.0} m (median), {:.0} m (95 %)",
        end.p50, end.p95
    );
    Ok(end.p50)
}

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut paths = std::env::args_os().skip(1);
    let (Some(recordings), Some(drive)) = (paths.next(), paths.next()) else {
        return Err("usage: 06_library RECORDINGS TRAJECTORY".into());
    };
    drift(recordings.as_ref(), drive.as_ref()).map(drop)
}
