//! Filters whose models are right are as sure as they should be, on three shipped trajectories, with 15 states
//! and with all states of the model; a model that is wrong by 4 in any parameter shows.

use nav_sim::io::trajectory_file::load;
use nav_sim::navigation::ekf::{Belief, FilterStates};
use nav_sim::navigation::metrics::{EpochMetrics, Expected};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::gnss::BaroSettings;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{NEES_DOF, RunResult};
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::noise::{Composite, Model, Process};
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};
use std::path::Path;

const RUNS: u64 = 48;
/// Where the runs are looked at (s): inside and outside of the outage, the errors' memory apart.
const LOOKS: [usize; 6] = [60, 250, 389, 500, 650, 850];
const OUTAGES: [Outage; 1] = [Outage {
    start_s: 300.0,
    end_s: 390.0,
}];
const TRAJECTORIES: [&str; 3] = ["land_vehicle.toml", "figure_eight.toml", "fixed_wing.toml"];

fn trajectory(name: &str) -> Trajectory {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("trajectories")
        .join(name);
    load(&path, None).unwrap().0
}

/// White noise and a Gauss-Markov process of standard deviation s and correlation time t_s, at 100 Hz.
fn axis(sigma2: f64, s: f64, t_s: f64) -> Composite {
    let phi = (-0.01 / t_s).exp();
    let bias = Process::ar1(phi, s * s * (1.0 - phi * phi)).unwrap();
    Composite::new(vec![Process::white(sigma2).unwrap(), bias])
}

/// Scales: accelerometer white, bias variance, correlation time; the same of the gyroscope.
fn model(scale: [f64; 6]) -> Model {
    let [aw, ab, at, gw, gb, gt] = scale;
    // so noisy that each parameter matters between fixes of 0.04 m/s: a vibrating unit
    let accel = axis(0.1 * aw, 0.05 * ab.sqrt(), 100.0 * at);
    let gyro = axis(1e-4 * gw, 5e-4 * gb.sqrt(), 200.0 * gt);
    Model::pooled(100.0, &accel, &gyro)
}

fn run(trajectory: &Trajectory, truth: &Model, beliefs: &[Belief]) -> Vec<RunResult> {
    let scenario = Scenario::default();
    let experiment = scenario.experiment(trajectory, Truth::Model(truth), beliefs, &OUTAGES, 23);
    monte_carlo::run(&experiment, RUNS, &|_| {}).unwrap()
}

/// How improbable the result is if the filter is right: the smallest two-sided p of NEES and coverage at every
/// look and of all NIS together, times their number (Bonferroni).
fn improbability(result: &RunResult) -> f64 {
    let two_sided = |p: f64| 2.0 * p.min(1.0 - p);
    let nees_law = ChiSquared::new((NEES_DOF as u64 * RUNS) as f64).unwrap();
    let misses = Binomial::new(0.05, RUNS).unwrap();
    let mut smallest = 1.0_f64;
    for look in LOOKS {
        let epoch = &result.epochs[look];
        assert_eq!(epoch.count, RUNS);
        smallest = smallest.min(two_sided(nees_law.cdf(epoch.nees[0])));
        let missed = RUNS - epoch.covered;
        let (below, above) = (
            misses.cdf(missed),
            misses.sf(missed) + misses.cdf(missed) - misses.cdf(missed.saturating_sub(1)),
        );
        let above = if missed == 0 { 1.0 } else { above };
        smallest = smallest.min(2.0 * below.min(above));
    }
    // Σ NIS over so many fixes is normal: mean 6 n, variance 12 n
    let (sum, n) = nis(result);
    let deviations = (sum - 6.0 * n) / (12.0 * n).sqrt();
    let normal = statrs::distribution::Normal::new(0.0, 1.0).unwrap();
    smallest = smallest.min(two_sided(normal.cdf(deviations)));
    smallest * (2.0 * LOOKS.len() as f64 + 1.0)
}

fn nis(result: &RunResult) -> (f64, f64) {
    let sum = result.runs.iter().map(|r| r.nis.0 * r.nis.1 as f64).sum();
    (sum, result.runs.iter().map(|r| r.nis.1).sum::<u64>() as f64)
}

fn report(trajectory: &str, filter: &str, result: &RunResult) -> f64 {
    let p = improbability(result);
    let nees = LOOKS.map(|l| result.epochs[l].nees[0] / RUNS as f64);
    let covered = LOOKS.iter().map(|l| result.epochs[*l].covered).sum::<u64>() as f64
        / (LOOKS.len() as u64 * RUNS) as f64;
    let (sum, n) = nis(result);
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    println!(
        "| {trajectory} | {filter} | {mean:.2} | {:.2} | {:.4} | {covered:.3} | {p:.1e} |",
        nees[2],
        sum / n / 6.0
    );
    p
}

/// p ≥ 1e-3 for each of the matched filters, p ≤ 1e-6 for each wrong one. The table is printed with
/// `cargo test --test truth consistency -- --nocapture`.
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
    let belief = |m: &Model, states| Belief::new(m, states, 1.0, 800.0).unwrap();
    let beliefs = [
        belief(&right, FilterStates::Reduced15),
        belief(&right, FilterStates::Full),
    ];
    let mut matched = Vec::new();
    println!(
        "| trajectory | filter | NEES | at 389 s | NIS | coverage | p |\n|---|---|---|---|---|---|---|"
    );
    for name in TRAJECTORIES {
        let results = run(&trajectory(name), &right, &beliefs);
        matched.push(report(name, "15", &results[0]));
        matched.push(report(name, "full", &results[1]));
    }
    // One trajectory shows them all.
    let beliefs = [0, 1, 2, 3, 4, 5].map(|i| belief(&with(i, factor(i)), FilterStates::Reduced15));
    let results = run(&trajectory(TRAJECTORIES[0]), &right, &beliefs);
    let p = |i: usize| {
        let what = format!("{} x {}", names[i], factor(i));
        report(TRAJECTORIES[0], &what, &results[i])
    };
    let wrong = [0, 1, 2, 3, 4, 5].map(p);
    assert!(matched.iter().all(|p| *p > 1e-3), "{matched:?}");
    assert!(wrong.iter().all(|p| *p < 1e-6), "{names:?} {wrong:?}");
}

/// The full filter of a model with two Gauss-Markov processes and a random walk an axis: 27 states.
#[test]
fn the_full_filter_of_a_larger_model_is_inside() {
    let larger = |small: &Composite, slow_s: f64, gamma2: f64| {
        let phi = (-0.01_f64 / 700.0).exp();
        let mut processes = small.processes.clone();
        processes.push(Process::ar1(phi, slow_s * slow_s * (1.0 - phi * phi)).unwrap());
        processes.push(Process::random_walk(gamma2).unwrap());
        Composite::new(processes)
    };
    let small = model([1.0; 6]);
    let (accel, gyro) = (
        larger(&small.axes[0], 0.01, 1e-10),
        larger(&small.axes[3], 1e-4, 1e-14),
    );
    let truth = Model::pooled(100.0, &accel, &gyro);
    let belief = Belief::new(&truth, FilterStates::Full, 1.0, 800.0).unwrap();
    assert_eq!(belief.states, 27);
    for name in TRAJECTORIES {
        let p = report(
            name,
            "27",
            &run(&trajectory(name), &truth, std::slice::from_ref(&belief))[0],
        );
        assert!(p > 1e-3, "{name}: {p}");
    }
}

/// After five minutes without fixes the mean velocity down of a filter whose model is right is off by what the tilts make
/// to second order, ∫ g (ψ_roll² + ψ_pitch²)/2 dt, and by nothing to first order: the mean over runs, within 3.5 of its own
/// standard errors and a tenth (tilts are not Gaussian in a finite sample: the mean squares of 256 runs are known to
/// √(2/256) = 9 %).
#[test]
fn long_outages_shift_the_velocity_down_by_the_square_of_the_tilts() {
    let outages = [Outage {
        start_s: 100.0,
        end_s: 400.0,
    }];
    let mut file = nav_sim::io::model_file::read(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("calib_data/consumer_mems.toml"),
    )
    .unwrap();
    file.spread = None;
    let scenario = Scenario::default();
    let trajectory = trajectory("land_vehicle.toml");
    let track = scenario.track(&trajectory, &file.model, &outages).unwrap();
    let full = scenario
        .with_full_noise()
        .belief(&file.model, &outages, &track)
        .unwrap();
    let beliefs = [full];
    let experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&file.model),
        &beliefs,
        &outages,
        5,
    );
    let result = monte_carlo::run(&experiment, 256, &|_| {})
        .unwrap()
        .remove(0);
    let epochs = nav_sim::navigation::metrics::epochs(&result);
    let tilts = |e: &EpochMetrics| {
        [6, 7]
            .map(|i| e.rmse.0[i].value.to_radians().powi(2))
            .iter()
            .sum::<f64>()
    };
    let shift: f64 = epochs
        .iter()
        .filter(|e| outages[0].withholds(e.t_s))
        .map(|e| 9.80665 / 2.0 * tilts(e))
        .sum();
    let end = epochs.iter().rev().find(|e| e.t_s < 399.5).unwrap();
    let (mean, error) = (end.bias.0[5].value, end.bias.0[5].std_error);
    assert!(
        (mean - shift).abs() < 3.5 * error + 0.1 * shift,
        "{mean} ± {error} against {shift}"
    );
    assert!(mean > 3.0 * error, "{mean} ± {error} could be chance");
    // linear theory knows where it ends; a height in ten minutes falls into no outage of five, one a second corrects it
    let baros = [
        None,
        Some(BaroSettings {
            rate_hz: 1.0 / 600.0,
            sigma_m: 1.0,
        }),
        Some(BaroSettings {
            rate_hz: 1.0,
            sigma_m: 1.0,
        }),
    ];
    for (baro, is_beyond) in baros.into_iter().zip([true, true, false]) {
        let scenario = Scenario {
            baro,
            ..Scenario::default()
        };
        let track = scenario.track(&trajectory, &file.model, &outages).unwrap();
        let experiment = scenario.experiment(
            &trajectory,
            Truth::Model(&file.model),
            &beliefs,
            &outages,
            5,
        );
        let expected = Expected::along(&track, &experiment, &beliefs[0], &file.model).unwrap();
        assert_eq!(
            expected.summary.outages[0].beyond_linear, is_beyond,
            "{:?}",
            scenario.baro
        );
    }
}
