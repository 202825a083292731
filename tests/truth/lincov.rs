//! The covariance of true errors without sampling: against closed forms and against Monte Carlo.

use glam::DVec3;
use nav_sim::navigation::ekf::{Belief, FilterStates, InitialSettings};
use nav_sim::navigation::metrics::{Estimate, SampleSize};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::navigation::trajectory::profile::{
    Acceleration, Bank, Length, Profile, ProfileStart as Start, Segment, SegmentKind as Kind,
    Turning,
};
use nav_sim::signal::noise::{Composite, Model, Process};
use nav_sim_navigation::simulation::lincov::{DRIFT, FilterPass, TruthSide, assess};

const RATE_HZ: f64 = 100.0;

fn trajectory(kinds: Vec<Kind>) -> Trajectory {
    let start = Start {
        t_s: 0.0,
        lat: 0.8,
        lon: 0.1,
        h: 0.0,
        heading: 0.7,
        speed: 0.0,
    };
    let segment = |kind| Segment {
        kind,
        climb_m: 0.0,
        ramp_s: None,
    };
    let segments = kinds.into_iter().map(segment).collect();
    Profile {
        start,
        bank: Bank::None,
        ramp_s: 1.0,
        segments,
    }
    .build()
    .unwrap()
}

fn still(seconds: f64) -> Kind {
    Kind::Straight(Length::Duration(seconds))
}

/// Errors of a filter that stands still for 20 s without a fix, from a perfect start: the true standard
/// deviations of velocity and position down at the end.
fn standing(process: Process) -> [f64; 2] {
    let noise = Composite::new(vec![process]);
    let model = Model::pooled(RATE_HZ, &noise, &Composite::default());
    let trajectory = trajectory(vec![still(20.0)]);
    let initial = InitialSettings {
        perfect: true,
        ..InitialSettings::default()
    };
    let scenario = Scenario {
        initial,
        ..Scenario::default()
    };
    let outages = [Outage {
        start_s: 0.0,
        end_s: 20.0,
    }];
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let white = Composite::new(vec![Process::white(1e-4).unwrap()]);
    let belief = Model::pooled(RATE_HZ, &white, &white);
    let belief = Belief::new(&belief, FilterStates::Reduced15, 1.0, 800.0).unwrap();
    let end = assess(&track, &belief, &model).outage_ends[0];
    [end.rmse[5], end.rmse[2]]
}

/// A filter that is right has the NEES 9 after four hours as at the beginning: 14 400 corrections of 16 digits, which do not grow
/// along the unaided vertical channel (e^(14400/400) = 4e15 where they do), leave 1e-9.
#[test]
fn a_filter_that_is_right_is_so_after_hours() {
    let noise = Composite::new(vec![
        Process::white(1e-6).unwrap(),
        Process::random_walk(1e-12).unwrap(),
    ]);
    let gyro = Composite::new(vec![Process::white(1e-10).unwrap()]);
    let model = Model::pooled(5.0, &noise, &gyro);
    let path = trajectory(vec![
        Kind::Accelerate {
            to_speed: 9.0,
            by: Acceleration::Peak(1.5),
        },
        still(14_400.0),
    ]);
    let track = Scenario::default().track(&path, &model, &[]).unwrap();
    let belief = Belief::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
    let reports = assess(&track, &belief, &model).reports;
    let farthest = reports
        .iter()
        .map(|r| (r.nees - 9.0).abs())
        .fold(0.0, f64::max);
    assert!(
        reports.len() > 14_400 && farthest < 1e-9,
        "{farthest:e} of {}",
        reports.len()
    );
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
        assert!(
            (found / variance.sqrt() - 1.0).abs() < 1.5e-3,
            "{found} {}",
            variance.sqrt()
        );
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
    let path = trajectory(vec![still(21.0)]);
    let mut scenario = Scenario::default();
    scenario.initial.vel_sigma_m_s = [100.0; 3];
    scenario.gnss.lever_arm_m = [arm_m, 0.0, 0.0];
    (scenario.gnss.pos_sigma_m, scenario.gnss.vel_sigma_m_s) = ([1e6; 3], Some([1e-3; 3]));
    let outages = [Outage {
        start_s: 0.0,
        end_s: n / RATE_HZ,
    }];
    let track = scenario.track(&path, &truth, &outages).unwrap();
    let white = |sigma2| Composite::new(vec![Process::white(sigma2).unwrap()]);
    let believed = Model::pooled(RATE_HZ, &white(1e-4), &white(1e-8));
    let beliefs = [Belief::new(&believed, FilterStates::Reduced15, 1.0, 800.0).unwrap()];
    let experiment = scenario.experiment(&path, Truth::Model(&truth), &beliefs, &outages, 1);
    let sources = TruthSide::sources(&experiment, &truth);
    let drift = sources.iter().find(|source| source.name == DRIFT).unwrap();
    let law = FilterPass::new(&track, &beliefs[0]).errors(&drift.side);
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
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
    }
}

/// A model of every process but drift, and a filter that believes in a quarter of its bias and white noise.
fn wrong() -> (Model, Belief) {
    let axis = |scale: f64, belief: bool| {
        let share = if belief { 0.25 } else { 1.0 };
        let mut processes = vec![
            Process::white(share * 1e-4 * scale).unwrap(),
            Process::ar1(0.9995, share * 4e-8 * scale).unwrap(),
        ];
        if !belief {
            processes.push(Process::random_walk(2e-9 * scale).unwrap());
            processes.push(Process::ar1(0.98, 1e-6 * scale).unwrap());
            processes.push(Process::quantization(1e-4 * scale).unwrap());
            processes.push(Process::ma1(0.4, 3e-5 * scale).unwrap());
        }
        Composite::new(processes)
    };
    let model = |belief| Model::pooled(RATE_HZ, &axis(1.0, belief), &axis(1e-3, belief));
    (
        model(false),
        Belief::new(&model(true), FilterStates::Reduced15, 1.0, 800.0).unwrap(),
    )
}

/// 400 runs of a filter that is wrong, with a lever arm: RMSE, NEES and mean standard deviations at the end of an
/// outage and after it. Of 18 RMSE the largest deviation stays below 4.2 standard errors with p = 5e-4.
#[test]
fn sampled_runs_scatter_as_computed() {
    let turn = |deg: f64, s: f64| Kind::Turn {
        angle: deg.to_radians(),
        by: Turning::Duration(s),
    };
    let faster = |to_speed: f64| Kind::Accelerate {
        to_speed,
        by: Acceleration::Duration(8.0),
    };
    let path = trajectory(vec![
        still(5.0),
        faster(12.0),
        turn(90.0, 8.0),
        still(9.0),
        turn(-80.0, 8.0),
        faster(6.0),
        turn(60.0, 8.0),
        faster(15.0),
        still(8.0),
    ]);
    let (truth, belief) = wrong();
    let mut scenario = Scenario::default();
    scenario.gnss.lever_arm_m = [1.0, -0.5, -1.2];
    let outages = [Outage {
        start_s: 35.0,
        end_s: 55.0,
    }];
    let beliefs = [belief];
    let experiment = scenario.experiment(&path, Truth::Model(&truth), &beliefs, &outages, 7);
    let result = &monte_carlo::run(&experiment, 400, &|_| {}).unwrap()[0];
    let track = scenario.track(&path, &truth, &outages).unwrap();
    let computed = assess(&track, &beliefs[0], &truth);
    let at = computed.reports.len() - 3;
    let (sampled, report) = (&result.epochs[at], &computed.reports[at]);
    let far = |found: Estimate, expected: f64| (found.value - expected).abs() / found.std_error;
    for i in 0..9 {
        let ends = result
            .runs
            .iter()
            .map(|r| r.outages[0].error_end[i].powi(2));
        let end = far(
            Estimate::mean_of(ends, None).root(),
            computed.outage_ends[0].rmse[i],
        );
        let later = Estimate::root_mean_square(
            SampleSize::of(sampled.count, None),
            sampled.error_sq[i],
            sampled.error_4[i],
        );
        assert!(
            end < 4.2 && far(later, report.rmse[i]) < 4.2,
            "state {i}: {end}"
        );
        let see = sampled.see[i] / sampled.count as f64;
        assert!(
            (see / report.sigma[i] - 1.0).abs() < 5e-3,
            "state {i}: {see} {}",
            report.sigma[i]
        );
    }
    let biases = FilterPass::new(&track, &beliefs[0]).biases[at];
    for (sum, sigma) in sampled.bias_see.iter().zip(biases) {
        let see = sum / sampled.count as f64;
        assert!(
            sigma > 0.0 && (see / sigma - 1.0).abs() < 5e-3,
            "{see} {sigma}"
        );
    }
    let nees = Estimate::mean(
        SampleSize::of(sampled.count, None),
        sampled.nees[0],
        sampled.nees[1],
    );
    assert!(
        far(nees, report.nees) < 4.2,
        "{} {}",
        nees.value,
        report.nees
    );
    // and the filter is wrong enough for that to be a test
    assert!(report.nees > 12.0 && computed.outage_ends[0].ratio()[0] > 1.3);
}

/// A filter with a state for every process is right: every ratio 1, NEES 9, divergence 0.
#[test]
fn a_matched_filter_is_right() {
    let processes = vec![
        Process::white(1e-4).unwrap(),
        Process::ar1(0.99, 1e-7).unwrap(),
        Process::random_walk(1e-10).unwrap(),
    ];
    let noise = Composite::new(processes);
    let gyro = Composite::new(vec![Process::white(1e-7).unwrap()]);
    let model = Model::pooled(RATE_HZ, &noise, &gyro);
    let path = trajectory(vec![
        still(10.0),
        Kind::Accelerate {
            to_speed: 9.0,
            by: Acceleration::Peak(1.5),
        },
        still(30.0),
    ]);
    let scenario = Scenario::default();
    let outages = [Outage {
        start_s: 15.0,
        end_s: 30.0,
    }];
    let track = scenario.track(&path, &model, &outages).unwrap();
    let belief = Belief::new(&model, FilterStates::Full, 1.0, 800.0).unwrap();
    let computed = assess(&track, &belief, &model);
    assert!(belief.white[0] != DVec3::ZERO && !computed.reports.is_empty());
    for found in computed.reports.iter().chain(&computed.outage_ends) {
        assert!(
            (found.nees - 9.0).abs() < 1e-6 && found.divergence.abs() < 1e-6,
            "{found:?}"
        );
        assert!(found.ratio().iter().all(|r| (r - 1.0).abs() < 1e-8));
    }
}
