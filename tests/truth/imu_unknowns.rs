//! Turn-on biases, scale factors and drifts of the true IMU: a filter that expects them is as sure as it should
//! be, one that does not is far too sure.

use crate::common::drive::{DRIVE, MODEL, done, nav_sim, place_with};
use crate::shared::{gauss_markov, shipped, two_sided};
use nav_sim::navigation::ekf::FilterModel;
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{NEES_DOF, RunResult};
use nav_sim::signal::noise::{Model, Process};
use std::fs;

const RUNS: u64 = 24;
/// Where the runs are looked at (s), inside and outside of the outage.
const LOOKS: [usize; 5] = [60, 250, 389, 500, 850];
const OUTAGES: [Outage; 1] = [Outage {
    start_s: 300.0,
    end_s: 390.0,
}];

/// A tactical IMU whose model the filter of 15 states carries as it is.
fn tactical() -> Model {
    Model::pooled(
        100.0,
        &gauss_markov(1e-5, &[(5e-4, 200.0)]),
        &gauss_markov(1e-8, &[(5e-6, 300.0)]),
    )
}

fn scenario(text: &str) -> Scenario {
    let scenario: Scenario = toml::from_str(text).unwrap();
    assert_eq!(scenario.validate(), Ok(()));
    scenario
}

/// The runs of the true IMU of `truth`, and the filters of the scenarios on them.
fn run(
    truth: &Model,
    imu: &Scenario,
    filters: &[(&Model, Scenario)],
    seed: u64,
    runs: u64,
) -> Vec<RunResult> {
    let trajectory = shipped("land_vehicle");
    let filter_model = |(model, own): &(&Model, Scenario)| {
        let track = own.track(&trajectory, model, &OUTAGES).unwrap();
        own.filter_model(model, &OUTAGES, &track).unwrap()
    };
    let filter_models: Vec<FilterModel> = filters.iter().map(filter_model).collect();
    let experiment = imu.experiment(
        &trajectory,
        Truth::Model(truth),
        &filter_models,
        &OUTAGES,
        seed,
    );
    monte_carlo::run(&experiment, runs, &|_| {}).unwrap()
}

/// The sum of the NEES at a look is chi-square of 9 degrees a run: the smallest two-sided p of all looks, times
/// their number (Bonferroni), and the mean NEES of all looks.
fn improbability(results: &[&RunResult]) -> (f64, f64) {
    let (mut smallest, mut mean) = (1.0_f64, 0.0);
    for look in LOOKS {
        let count: u64 = results.iter().map(|r| r.epochs[look].count).sum();
        let sum: f64 = results.iter().map(|r| r.epochs[look].nees[0]).sum();
        smallest = smallest.min(two_sided(sum, (NEES_DOF as u64 * count) as f64));
        mean += sum / count as f64 / LOOKS.len() as f64;
    }
    (smallest * LOOKS.len() as f64, mean)
}

/// Whether runs are as their filter says, or far from it.
#[track_caller]
fn assert_matched(results: &[&RunResult], is_matched: bool) {
    let (p, mean) = improbability(results);
    match is_matched {
        true => assert!(p > 1e-3, "NEES {mean}, p = {p}"),
        false => assert!(
            p < 1e-9 && mean > 1.5 * NEES_DOF as f64,
            "NEES {mean}, p = {p}"
        ),
    }
}

/// 0.02 m/s² and 1e-4 rad/s of turn-on bias: constant states hold them, with 15 states and with all.
#[test]
fn a_turn_on_bias_that_is_expected_is_found() {
    let bias = "[imu]\nturn_on_bias_accel_m_s2 = 0.02\nturn_on_bias_gyro_rad_s = 1e-4\n";
    let expected =
        format!("{bias}[initial]\naccel_bias_sigma_m_s2 = 0.02\ngyro_bias_sigma_rad_s = 1e-4\n");
    let larger = Model::pooled(
        100.0,
        &gauss_markov(1e-5, &[(5e-4, 200.0), (1e-3, 2.0)]),
        &gauss_markov(1e-8, &[(5e-6, 300.0), (1e-5, 5.0)]),
    );
    let full = scenario(&format!("{expected}[filter]\nstates = \"full\""));
    let (reduced, unaware) = (scenario(&expected), scenario(bias));
    let model = tactical();
    let found = run(
        &model,
        &unaware,
        &[(&model, reduced), (&model, unaware.clone())],
        31,
        RUNS,
    );
    assert_matched(&[&found[0]], true);
    assert_matched(&[&found[1]], false);
    let found = run(&larger, &unaware, &[(&larger, full)], 32, RUNS);
    assert_matched(&[&found[0]], true);
}

/// 300 ppm on every axis: the filter of 21 states expects it, and any filter that is told.
#[test]
fn scale_factors_of_300_ppm_are_found_by_21_states() {
    let imu = scenario("[imu]\nscale_ppm_accel = 300\nscale_ppm_gyro = 300");
    let model = tactical();
    let told = "[filter]\nstates = \"full\"\n[initial]\naccel_scale_sigma_ppm = 300\ngyro_scale_sigma_ppm = 300";
    let filters = [
        (&model, scenario("filter.states = 21")),
        (&model, scenario(told)),
        (&model, scenario("")),
    ];
    let found = run(&model, &imu, &filters, 33, RUNS);
    for (result, is_matched) in found.iter().zip([true, true, false]) {
        assert_matched(&[result], is_matched);
    }
}

/// A drift has a known magnitude; its sign is not known to the filter. The NEES is quadratic in the slopes, so
/// that its mean over sign patterns of which each two axes differ half of the time is that of independent
/// random slopes: 9. (Its variance is smaller than that of a chi-square: the bounds are wide.)
#[test]
fn a_drift_is_as_uncertain_as_its_magnitude() {
    const HADAMARD: [[f64; 6]; 8] = [
        [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0],
        [1.0, -1.0, -1.0, 1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0, 1.0, -1.0, -1.0],
        [1.0, 1.0, 1.0, -1.0, -1.0, -1.0],
        [-1.0, 1.0, -1.0, -1.0, 1.0, -1.0],
        [1.0, -1.0, -1.0, -1.0, -1.0, 1.0],
        [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0],
    ];
    // 0.02 m/s² and 1e-4 rad/s in 900 s
    let slopes = [2e-7, 2e-7, 2e-7, 1e-9, 1e-9, 1e-9];
    let drifting = |signs: [f64; 6]| {
        let mut model = tactical();
        for ((axis, slope), sign) in model.axes.iter_mut().zip(slopes).zip(signs) {
            axis.processes.push(Process::drift(sign * slope).unwrap());
        }
        model
    };
    let (plain, none) = (tactical(), scenario(""));
    let full = scenario("filter.states = 'full'");
    let of_signs = |(seed, signs): (u64, [f64; 6])| {
        let model = drifting(signs);
        run(
            &model,
            &none,
            &[(&model, none.clone()), (&model, full.clone())],
            seed,
            4,
        )
    };
    let results: Vec<_> = (40..).zip(HADAMARD).map(of_signs).collect();
    for i in [0, 1] {
        let of_filter: Vec<&RunResult> = results.iter().map(|r| &r[i]).collect();
        assert_matched(&of_filter, true);
        assert_eq!(of_filter[0].filter_states, 21);
    }
    let unaware = run(
        &drifting(HADAMARD[0]),
        &none,
        &[(&plain, none.clone())],
        40,
        8,
    );
    assert_matched(&[&unaware[0]], false);
}

/// A recorded drive whose IMU has scale factors of 300 ppm: the filter of 21 states is nearer to the reference.
#[test]
fn fusion_with_scale_factors_is_nearer_to_the_reference() {
    let model = "schema = 1\nrate_hz = 100.0\n\
        [accel]\nprocesses = [{ type = \"WN\", sigma2 = 1e-5 }, { type = \"AR1\", phi = 0.99995, sigma2 = 2.5e-11 }]\n\
        [gyro]\nprocesses = [{ type = \"WN\", sigma2 = 1e-8 }, { type = \"AR1\", phi = 0.99997, sigma2 = 1.5e-15 }]\n";
    let place = place_with(DRIVE, model);
    let path = place.path();
    let settings = "[imu]\nscale_ppm_accel = 3000\nscale_ppm_gyro = 3000\n\
        [initial]\naccel_scale_sigma_ppm = 3000\n";
    fs::write(path.join("scenario.toml"), settings).unwrap();
    done(
        path,
        "trajectory record drive.toml imu.toml --scenario scenario.toml --seed 3 -o rec",
    );
    let start = fs::read_to_string(path.join("rec/initial.toml")).unwrap();
    assert!(
        start.contains("accel_scale_sigma_ppm = 3000.0\n"),
        "{start}"
    );
    let nees = |scale_ppm: &str, states: &str| {
        let known = start.replace("accel_scale_sigma_ppm = 3000.0\n", scale_ppm);
        fs::write(path.join("start.toml"), known).unwrap();
        let command = format!(
            "fuse rec/imu.csv rec/gnss.csv imu.toml --initial start.toml --reference rec/reference.csv \
             --filter {states} -o out{states}"
        );
        let ran = nav_sim(path, &format!("{command} --format json"));
        let summary: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        (
            ran.code,
            summary["filter_states"].as_u64().unwrap(),
            summary["reference"]["nees_mean"].as_f64().unwrap(),
        )
    };
    let both = "accel_scale_sigma_ppm = 3000.0\ngyro_scale_sigma_ppm = 3000.0\n";
    let (told, unaware) = (nees(both, "21"), nees("", "15"));
    // exit code 3: the reference contradicts the solution
    assert_eq!((told.0, told.1, unaware.0, unaware.1), (0, 21, 3, 15));
    assert!(
        told.2 < 20.0 && unaware.2 > 3.0 * told.2,
        "{told:?} {unaware:?}"
    );
}

/// A model with a drift can be calibrated, and so it can be used: with any filter.
#[test]
fn a_model_with_a_drift_runs_with_any_filter() {
    let model = MODEL.replace(
        "sigma2 = 2e-6 }",
        "sigma2 = 2e-6 }, { type = \"DR\", slope = 1e-8 }",
    );
    let place = place_with(DRIVE, &model);
    for (states, number) in [("15", 18), ("21", 24), ("full", 18)] {
        let command = format!(
            "run drive.toml imu.toml --runs 1 --outage 30:40 --filter {states} --seed 1 -o o{states}"
        );
        done(place.path(), &command);
        let summary =
            fs::read_to_string(place.path().join(format!("o{states}/summary.json"))).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        assert_eq!(summary["filter_states"], number, "{states}");
    }
}
