//! The covariance of true errors without sampling, against closed forms. (Against runs: `lincov_sampled`.)

use crate::shared::{drive, outage, stands, white};
use approx::assert_relative_eq;
use nav_sim::navigation::ekf::{FilterModel, FilterStates, InitialSettings};
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::signal::noise::{Composite, Model, Process};
use nav_sim_navigation::simulation::lincov::{DRIFT, FilterPass, TruthModel, assess};

const RATE_HZ: f64 = 100.0;

/// Errors of a filter that stands still for 20 s without a fix, from a perfect start: the true standard
/// deviations of velocity and position down at the end.
fn standing(process: Process) -> [f64; 2] {
    let noise = Composite::new(vec![process]);
    let model = Model::pooled(RATE_HZ, &noise, &Composite::default());
    let trajectory = stands(20.0);
    let initial = InitialSettings {
        perfect: true,
        ..InitialSettings::default()
    };
    let scenario = Scenario {
        initial,
        ..Scenario::default()
    };
    let track = scenario
        .track(&trajectory, &model, &[outage(0.0, 20.0)])
        .unwrap();
    let filter_model = Model::pooled(RATE_HZ, &white(1e-4), &white(1e-4));
    let filter_model =
        FilterModel::new(&filter_model, FilterStates::Reduced15, 1.0, 800.0).unwrap();
    let end = assess(&track, &filter_model, &model).outage_ends[0];
    [end.rmse[5], end.rmse[2]]
}

/// A filter with a state for every process is right: every ratio 1, NEES 9, divergence 0, after four hours as at the beginning and
/// at the end of an outage: 14 400 corrections of 16 digits, which do not grow along the unaided vertical channel
/// (e^(14400/400) = 4e15 where they do), leave 1e-9.
#[test]
fn a_filter_that_is_right_is_so_after_hours() {
    let accel = Composite::new(vec![
        Process::white(1e-6).unwrap(),
        Process::ar1(0.99, 1e-9).unwrap(),
        Process::random_walk(1e-12).unwrap(),
    ]);
    let model = Model::pooled(5.0, &accel, &white(1e-10));
    let path = drive(
        0.0,
        "{ kind = 'accelerate', to_speed_m_s = 9, accel_m_s2 = 1.5 },
        { kind = 'straight', duration_s = 14400 }",
    );
    let track = Scenario::default()
        .track(&path, &model, &[outage(200.0, 230.0)])
        .unwrap();
    let filter_model = FilterModel::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
    let computed = assess(&track, &filter_model, &model);
    assert!(computed.reports.len() > 14_370 && computed.outage_ends.len() == 1);
    for found in computed.reports.iter().chain(&computed.outage_ends) {
        let is_right = (found.nees - 9.0).abs() < 1e-9 && found.divergence.abs() < 1e-9;
        assert!(
            is_right && found.ratio().iter().all(|r| (r - 1.0).abs() < 1e-9),
            "{found:?}"
        );
    }
}

/// The vertical channel over n samples of dt, whose gravity gradient (time constant 570 s) adds (20/570)²/6,
/// 2e-4. White noise: sums of n samples. Random walk: gamma2 f t³/3 and gamma2 f t⁵/20, to 1/n. Quantization
/// noise: dt (U_n − U_0), whose variance does not grow. MA1: dt ((1 + theta) sum of the innovations but the
/// ends, which keep theta and 1).
#[test]
fn a_vehicle_that_stands_has_the_closed_forms_of_each_process() {
    let (dt, n) = (1.0 / RATE_HZ, 2000.0_f64);
    let t = n * dt;
    let near = |found: f64, variance: f64| {
        assert_relative_eq!(found, variance.sqrt(), max_relative = 1.5e-3);
    };
    let [v, r] = standing(Process::white(1e-4).unwrap());
    near(v, 1e-4 * dt * dt * n);
    near(r, 1e-4 * dt * t * t * t / 3.0);
    let [v, r] = standing(Process::random_walk(1e-10).unwrap());
    near(v, 1e-10 * RATE_HZ * t.powi(3) / 3.0);
    near(r, 1e-10 * RATE_HZ * t.powi(5) / 20.0);
    let [v, _] = standing(Process::quantization(1e-4).unwrap());
    near(v, 2e-4 * dt * dt);
    let theta = -0.6_f64;
    let [v, _] = standing(Process::ma1(theta, 1e-4).unwrap());
    near(
        v,
        1e-4 * dt * dt * ((1.0 + theta).powi(2) * (n - 1.0) + theta * theta + 1.0),
    );
    // of a Gauss-Markov process that starts anywhere: 2 s² T² (t/T − 1 + e^{−t/T})
    let (time, phi) = (5.0_f64, (-dt / 5.0).exp());
    let [v, _] = standing(Process::ar1(phi, 1e-8).unwrap());
    let variance = 1e-8 / (1.0 - phi * phi);
    near(
        v,
        2.0 * variance * time * time * (t / time - 1.0 + (-t / time).exp()),
    );
}

/// A drift of the gyroscope moves the velocity that the filter works out for its antenna: one that knows nothing of its
/// velocity takes it from the first fix, and is off by C (rate error × arm), whatever it did before. The three axes
/// drift alike, by n samples of the slope: the error is 2 m times that across the arm and down. White noise of the
/// gyroscope is none here, and believing 1e-6 of the velocity of a fix that is known to 1 mm/s is none either.
#[test]
fn a_drift_of_the_gyroscope_is_felt_at_the_end_of_a_lever_arm() {
    let (slope, arm_m, n) = (1e-6, 2.0, 2000.0);
    let gyro = Composite::new(vec![Process::drift(slope).unwrap()]);
    let truth = Model::pooled(RATE_HZ, &Composite::default(), &gyro);
    let path = stands(21.0);
    let mut scenario = Scenario::default();
    scenario.initial.vel_sigma_m_s = [100.0; 3];
    scenario.gnss.lever_arm_m = [arm_m, 0.0, 0.0];
    (scenario.gnss.pos_sigma_m, scenario.gnss.vel_sigma_m_s) = ([1e6; 3], Some([1e-3; 3]));
    let outages = [outage(0.0, n / RATE_HZ)];
    let track = scenario.track(&path, &truth, &outages).unwrap();
    let believed = Model::pooled(RATE_HZ, &white(1e-4), &white(1e-8));
    let filter_models = [FilterModel::new(&believed, FilterStates::Reduced15, 1.0, 800.0).unwrap()];
    let experiment = scenario.experiment(&path, Truth::Model(&truth), &filter_models, &outages, 1);
    let sources = TruthModel::sources(&experiment, &truth);
    let drift = sources.iter().find(|source| source.name == DRIFT).unwrap();
    let law = FilterPass::new(&track, &filter_models[0]).errors(&drift.side);
    let fix = law
        .reports
        .iter()
        .map(|report| &report.errors)
        .find(|errors| errors.fix)
        .unwrap();
    assert_eq!(fix.after_s, n / RATE_HZ);
    let [north, east, down] = [3, 4, 5].map(|i| fix.rmse()[i]);
    let expected = arm_m * slope * n;
    for found in [north.hypot(east), down] {
        assert_relative_eq!(found, expected, max_relative = 1e-3);
    }
}
