//! Filters whose models are right are as sure as they should be, on three shipped trajectories, with 15 states
//! and with all states of the model; a model that is wrong by 4 in any parameter shows.

use crate::shared::{gauss_markov, outage, shipped, shipped_model, two_sided};
use approx::assert_abs_diff_eq;
use nav_sim::navigation::ekf::{FilterModel, FilterStates};
use nav_sim::navigation::metrics::{EpochMetrics, ExpectedRun};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::gnss::BaroSettings;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{NEES_DOF, RunRecord, RunResult};
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::noise::{Model, Process};
use statrs::distribution::{Binomial, DiscreteCDF};

const RUNS: u64 = 48;
/// Where the runs are looked at (s): inside and outside of the outage, the errors' memory apart.
const LOOKS: [usize; 6] = [60, 250, 389, 500, 650, 850];
const OUTAGES: [Outage; 1] = [Outage {
    start_s: 300.0,
    end_s: 390.0,
}];
const TRAJECTORIES: [&str; 3] = ["land_vehicle", "figure_eight", "fixed_wing"];

/// Scales: accelerometer white, bias variance, correlation time; the same of the gyroscope.
fn model(scale: [f64; 6]) -> Model {
    let [aw, ab, at, gw, gb, gt] = scale;
    // so noisy that each parameter matters between fixes of 0.04 m/s: a vibrating unit
    let accel = gauss_markov(0.1 * aw, &[(0.05 * ab.sqrt(), 100.0 * at)]);
    let gyro = gauss_markov(1e-4 * gw, &[(5e-4 * gb.sqrt(), 200.0 * gt)]);
    Model::pooled(100.0, &accel, &gyro)
}

fn run(trajectory: &Trajectory, truth: &Model, filter_models: &[FilterModel]) -> Vec<RunResult> {
    let scenario = Scenario::default();
    let experiment =
        scenario.experiment(trajectory, Truth::Model(truth), filter_models, &OUTAGES, 23);
    monte_carlo::run(&experiment, RUNS, &|_| {}).unwrap()
}

/// How improbable the result is if the filter is right: the smallest two-sided p of NEES and coverage at every
/// look and of all NIS together, times their number (Bonferroni).
fn improbability(result: &RunResult) -> f64 {
    let misses = Binomial::new(0.05, RUNS).unwrap();
    let mut smallest = 1.0_f64;
    for look in LOOKS {
        let epoch = &result.epochs[look];
        assert_eq!(epoch.count, RUNS);
        smallest = smallest.min(two_sided(epoch.nees[0], (NEES_DOF as u64 * RUNS) as f64));
        let missed = RUNS - epoch.covered;
        let (below, above) = (
            misses.cdf(missed),
            misses.sf(missed) + misses.cdf(missed) - misses.cdf(missed.saturating_sub(1)),
        );
        let above = if missed == 0 { 1.0 } else { above };
        smallest = smallest.min(2.0 * below.min(above));
    }
    let nis = |of: fn(&RunRecord) -> f64| result.runs.iter().map(of).sum::<f64>();
    let (sum, n) = (nis(|r| r.nis.0 * r.nis.1 as f64), nis(|r| r.nis.1 as f64));
    smallest = smallest.min(two_sided(sum, 6.0 * n));
    smallest * (2.0 * LOOKS.len() as f64 + 1.0)
}

/// p ≥ 1e-3 for each of the matched filters, p ≤ 1e-6 for each wrong one.
#[test]
fn matched_models_are_inside_and_a_factor_of_four_is_outside() {
    let right = model([1.0; 6]);
    let names = [
        "accel white",
        "accel bias",
        "accel time",
        "gyro white",
        "gyro bias",
        "gyro time",
    ];
    let with = |i: usize, factor: f64| {
        let mut scale = [1.0; 6];
        scale[i] = factor;
        model(scale)
    };
    // too little noise, or a bias that changes too slowly: a filter that trusts itself too much
    let factor = |i: usize| {
        if names[i].ends_with("time") {
            4.0
        } else {
            0.25
        }
    };
    let filter_model =
        |m: &Model| FilterModel::new(m, FilterStates::Reduced15, 1.0, 800.0).unwrap();
    for name in TRAJECTORIES {
        let p = improbability(&run(&shipped(name), &right, &[filter_model(&right)])[0]);
        assert!(p > 1e-3, "{name}: {p}");
    }
    // One trajectory shows them all.
    let filter_models = [0, 1, 2, 3, 4, 5].map(|i| filter_model(&with(i, factor(i))));
    let results = run(&shipped(TRAJECTORIES[0]), &right, &filter_models);
    for (name, result) in names.iter().zip(&results) {
        let p = improbability(result);
        assert!(p < 1e-6, "{name}: {p}");
    }
}

/// The full filter of a model with two Gauss-Markov processes and a random walk an axis: 27 states.
#[test]
fn the_full_filter_of_a_larger_model_is_inside() {
    let axis = |white: f64, biases: &[(f64, f64)], gamma2: f64| {
        let mut axis = gauss_markov(white, biases);
        axis.processes.push(Process::random_walk(gamma2).unwrap());
        axis
    };
    let accel = axis(0.1, &[(0.05, 100.0), (0.01, 700.0)], 1e-10);
    let gyro = axis(1e-4, &[(5e-4, 200.0), (1e-4, 700.0)], 1e-14);
    let truth = Model::pooled(100.0, &accel, &gyro);
    let filter_model = FilterModel::new(&truth, FilterStates::Full, 1.0, 800.0).unwrap();
    assert_eq!(filter_model.states, 27);
    for name in TRAJECTORIES {
        let result = &run(&shipped(name), &truth, std::slice::from_ref(&filter_model))[0];
        let p = improbability(result);
        assert!(p > 1e-3, "{name}: {p}");
    }
}

/// After five minutes without fixes the mean velocity down of a filter whose model is right is off by what the tilts make
/// to second order, ∫ g (ψ_roll² + ψ_pitch²)/2 dt, and by nothing to first order: the mean over runs, within 3.5 of its own
/// standard errors and a tenth (tilts are not Gaussian in a finite sample: the mean squares of 256 runs are known to
/// √(2/256) = 9 %).
#[test]
fn long_outages_shift_the_velocity_down_by_the_square_of_the_tilts() {
    let outages = [outage(100.0, 400.0)];
    let model = shipped_model("calib_data/consumer_mems.toml");
    let scenario = Scenario::default();
    let trajectory = shipped("land_vehicle");
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let filter_models = [scenario
        .with_full_noise()
        .filter_model(&model, &outages, &track)
        .unwrap()];
    let truth = Truth::Model(&model);
    let experiment = scenario.experiment(&trajectory, truth, &filter_models, &outages, 5);
    let result = monte_carlo::run(&experiment, 256, &|_| {})
        .unwrap()
        .remove(0);
    let epochs = nav_sim::navigation::metrics::epochs(&result);
    let tilts = |e: &EpochMetrics| -> f64 {
        [6, 7]
            .iter()
            .map(|i| e.rmse.0[*i].value.to_radians().powi(2))
            .sum()
    };
    let shift: f64 = epochs
        .iter()
        .filter(|e| outages[0].withholds(e.t_s))
        .map(|e| 9.80665 / 2.0 * tilts(e))
        .sum();
    let end = epochs.iter().rev().find(|e| e.t_s < 399.5).unwrap();
    let (mean, error) = (end.bias.0[5].value, end.bias.0[5].std_error);
    assert_abs_diff_eq!(mean, shift, epsilon = 3.5 * error + 0.1 * shift);
    assert!(mean > 3.0 * error, "{mean} ± {error} could be chance");
    // linear theory knows where it ends; a height in ten minutes falls into no outage of five, one a second corrects it
    for (interval_s, is_beyond) in [(None, true), (Some(600.0), true), (Some(1.0), false)] {
        let baro = interval_s.map(|interval_s: f64| BaroSettings {
            rate_hz: 1.0 / interval_s,
            sigma_m: 1.0,
        });
        let scenario = Scenario {
            baro,
            ..Scenario::default()
        };
        let track = scenario.track(&trajectory, &model, &outages).unwrap();
        let experiment = scenario.experiment(&trajectory, truth, &filter_models, &outages, 5);
        let expected = ExpectedRun::along(&track, &experiment, &filter_models[0], &model).unwrap();
        assert_eq!(
            expected.summary.outages[0].beyond_linear, is_beyond,
            "{interval_s:?}"
        );
    }
}
