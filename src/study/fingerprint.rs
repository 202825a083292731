//! Whether this build on this machine makes the same numbers as the one that planned.

use super::unit::{Finding, UnitResult};
use super::unit_file::encode;
use nav_sim_navigation::ekf::{Belief, FilterStates};
use nav_sim_navigation::frames::RollPitchYaw;
use nav_sim_navigation::monte_carlo;
use nav_sim_navigation::scenario::Scenario;
use nav_sim_navigation::sensors::imu::Truth;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::trajectory::{Trajectory, TrajectorySample};
use nav_sim_signal::noise::{Ar1, Composite, Model, Process, Quantization, RandomWalk, White};

/// Runs of the experiment.
const RUNS: u64 = 3;

/// Hash of the bits that a small experiment makes here: 4 s of a climbing turn, synthesised errors, both
/// filters, a fix, an outage. Another processor, system library or compiler may round the last digit of a
/// sine otherwise; units of the two would make a table that neither of them makes.
pub(crate) fn fingerprint() -> String {
    let bits = results().map_or_else(
        || b"this build runs no experiment".to_vec(),
        |found| encode(&found),
    );
    blake3::hash(&bits).to_hex()[..16].to_owned()
}

fn results() -> Option<UnitResult> {
    let trajectory = Trajectory::from_samples(&samples()).ok()?;
    let model = model()?;
    let (scenario, outages) = (
        Scenario::default(),
        [Outage {
            start_s: 1.5,
            end_s: 2.5,
        }],
    );
    let belief = |states| Belief::new(&model, states, 1.0, 800.0).ok();
    let beliefs = [
        belief(FilterStates::Reduced15)?,
        belief(FilterStates::Full)?,
    ];
    let experiment = scenario.experiment(&trajectory, Truth::Model(&model), &beliefs, &outages, 1);
    let results = monte_carlo::run(&experiment, RUNS, &|_| {}).ok()?;
    let columns = results.into_iter().map(Finding::Sampled).collect();
    Some(UnitResult {
        id: String::new(),
        first: 0,
        runs: RUNS,
        columns,
    })
}

fn samples() -> Vec<TrajectorySample> {
    let sample = |k: u32| {
        let t_s = f64::from(k);
        let attitude = RollPitchYaw {
            roll: 0.1 * t_s.sin(),
            pitch: 0.05,
            yaw: 0.2 * t_s,
        };
        TrajectorySample {
            t_s,
            lat: 0.8 + 3e-6 * (0.2 * t_s).sin(),
            lon: 0.2 + 3e-6 * t_s,
            h: 400.0 + t_s,
            q_b_n: attitude.to_quat(),
        }
    };
    (0..=4).map(sample).collect()
}

fn model() -> Option<Model> {
    let composite = |unit: f64| {
        Some(Composite::new(vec![
            Process::White(White::new(1e-5 * unit).ok()?),
            Process::Quantization(Quantization::new(1e-7 * unit).ok()?),
            Process::Ar1(Ar1::new(0.99, 1e-8 * unit).ok()?),
            Process::RandomWalk(RandomWalk::new(1e-11 * unit).ok()?),
        ]))
    };
    Some(Model::pooled(100.0, &composite(1.0)?, &composite(1e-2)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_experiment_runs_and_repeats() {
        let found = results().unwrap();
        let is_whole = |column: &Finding| match column {
            Finding::Sampled(r) => {
                r.runs.len() == RUNS as usize && r.runs.iter().all(|run| !run.diverged)
            }
            Finding::Expected(_) => false,
        };
        assert!(found.columns.len() == 2 && found.columns.iter().all(is_whole));
        assert_eq!(fingerprint(), fingerprint());
    }
}
