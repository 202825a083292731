//! Two filters on the same noise: one has the model that made it, the other takes the gyroscopes' bias for ten
//! times as steady. Prints the errors that they claim and the true ones.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::io::trajectory_file::load;
use nav_sim::navigation::ekf::{FilterModel, FilterStates};
use nav_sim::navigation::metrics::{Summary, epochs};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::signal::noise::{Composite, Model, Process};
use std::path::Path;

fn model(gyro_bias_sigma: f64) -> Result<Model, Box<dyn std::error::Error>> {
    let phi = 0.9999_f64; // a correlation time of 100 s at 100 Hz
    let bias = |sigma: f64| Process::ar1(phi, sigma * sigma * (1.0 - phi * phi));
    let accel = Composite::new(vec![Process::white(1e-4)?, bias(5e-3)?]);
    let gyro = Composite::new(vec![Process::white(1e-6)?, bias(gyro_bias_sigma)?]);
    Ok(Model::pooled(100.0, &accel, &gyro))
}

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("trajectories/land_vehicle.toml");
    let (trajectory, _) = load(&path, None)?;
    let truth = model(1e-4)?;
    let filter_model = |m: &Model| FilterModel::new(m, FilterStates::Full, 1.0, 800.0);
    let filter_models = [filter_model(&truth)?, filter_model(&model(1e-5)?)?];
    let scenario = Scenario::default();
    let experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&truth),
        &filter_models,
        &Outage::PAPER,
        1,
    );
    let results = monte_carlo::run(&experiment, 16, &|_| {})?;
    for (name, result) in ["right", "optimist"].iter().zip(&results) {
        let summary = Summary::of(result, &epochs(result), 1);
        let end = summary.outages[0].horizontal_error_end_m;
        println!(
            "{name:8}: NEES {:5.2} of {}, coverage {:.2} of 0.95",
            summary.nees.mean, 9, summary.coverage.mean
        );
        println!(
            "          after 90 s without GNSS {:.0} m (median), {:.0} m (95 %)",
            end.p50, end.p95
        );
    }
    let nees = |i: usize| {
        let all = epochs(&results[i]);
        all.iter().map(|e| e.nees.value).sum::<f64>() / all.len() as f64
    };
    assert!(nees(0) < 11.0 && nees(1) > 2.0 * nees(0));
    Ok(())
}
