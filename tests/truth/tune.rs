//! Tuned models are consistent: the factor of a process that is larger in truth is found, and sampled runs agree.

use nav_sim::navigation::ekf::Belief;
use nav_sim::navigation::metrics::{Estimate, Expected, VerdictKind};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::navigation::trajectory::profile::{
    Acceleration, Bank, Length, Profile, ProfileStart as Start, Segment, SegmentKind as Kind,
    Turning,
};
use nav_sim::signal::imu::Sensor;
use nav_sim::signal::noise::{Composite, Model, Process};
use nav_sim_navigation::simulation::lincov::{
    Aim, Factor, Filter, Task, Track, TrueErrors, scaled,
};

const OUTAGES: [Outage; 1] = [Outage {
    start_s: 200.0,
    end_s: 260.0,
}];

/// White noise and random walks of a consumer IMU, the random walks times `accel` and `gyro`.
fn model(accel: f64, gyro: f64) -> Model {
    let axis = |white: f64, walk: f64| {
        Composite::new(vec![
            Process::white(white).unwrap(),
            Process::random_walk(walk).unwrap(),
        ])
    };
    Model::pooled(100.0, &axis(1e-4, accel * 1e-10), &axis(1e-8, gyro * 1e-12))
}

/// Four minutes of town traffic.
fn trajectory() -> Trajectory {
    let faster = |to_speed: f64| Kind::Accelerate {
        to_speed,
        by: Acceleration::Duration(10.0),
    };
    let turn = |deg: f64| Kind::Turn {
        angle: deg.to_radians(),
        by: Turning::Duration(9.0),
    };
    let block = [
        faster(14.0),
        Kind::Straight(Length::Duration(14.0)),
        turn(90.0),
        faster(6.0),
        turn(-60.0),
    ];
    let segments = block.into_iter().cycle().take(26);
    let segments = segments
        .map(|kind| Segment {
            kind,
            climb_m: 0.0,
            ramp_s: None,
        })
        .collect();
    let start = Start {
        t_s: 0.0,
        lat: 0.8,
        lon: 0.1,
        h: 0.0,
        heading: 0.7,
        speed: 0.0,
    };
    Profile {
        start,
        bank: Bank::None,
        ramp_s: 1.0,
        segments,
    }
    .build()
    .unwrap()
}

struct Drive {
    scenario: Scenario,
    trajectory: Trajectory,
    track: Track,
}

fn drive() -> Drive {
    let (scenario, trajectory) = (Scenario::default().with_full_noise(), trajectory());
    let track = scenario
        .track(&trajectory, &model(1.0, 1.0), &OUTAGES)
        .unwrap();
    Drive {
        scenario,
        trajectory,
        track,
    }
}

impl Drive {
    fn belief(&self, model: &Model) -> Belief {
        self.scenario.belief(model, &OUTAGES, &self.track).unwrap()
    }

    fn factors(&self, truths: &[Model], aim: Aim) -> Vec<Factor> {
        let filter: &Filter<'_> =
            &|model: &Model| self.scenario.belief(model, &OUTAGES, &self.track);
        let model = &model(1.0, 1.0);
        let truths: &[TrueErrors] = &truths
            .iter()
            .cloned()
            .map(TrueErrors::from)
            .collect::<Vec<_>>();
        let task = Task {
            model,
            truths,
            track: &self.track,
            full: filter,
            filter,
            aim,
        };
        let factors = task.factors().unwrap();
        let consistency = task.consistency(filter, &factors).unwrap();
        match aim {
            Aim::Mean => assert!(
                (consistency.nees / 9.0 - 1.0).abs() < 5e-3,
                "{consistency:?}"
            ),
            Aim::Worst => assert!(
                (consistency.largest.ratio - 1.0).abs() < 5e-3,
                "{consistency:?}"
            ),
        }
        factors
    }

    /// NEES at the outage's end of a hundred runs.
    fn sampled_nees(&self, belief: Belief, truth: &Model) -> Estimate {
        let beliefs = [belief];
        let experiment = self.scenario.experiment(
            &self.trajectory,
            Truth::Model(truth),
            &beliefs,
            &OUTAGES,
            11,
        );
        let result = &monte_carlo::run(&experiment, 100, &|_| {}).unwrap()[0];
        Estimate::mean_of(result.runs.iter().map(|r| r.outages[0].nees_end), None)
    }
}

/// The sensor whose variances are four times as large is multiplied by four, the other is left alone. The sum of the NEES of
/// 100 runs is chi-square of 900 degrees: 9 ± 0.42 for one, where four deviations are passed by chance with p = 1e-4.
#[test]
fn a_sensor_four_times_as_noisy_is_found_and_runs_agree() {
    let drive = drive();
    let four = Factor {
        sensor: Sensor::Gyro,
        on_variance: 4.0,
    };
    let truth = scaled(&model(1.0, 1.0), &[four]);
    let factors = drive.factors(std::slice::from_ref(&truth), Aim::Mean);
    for factor in &factors {
        let expected = if factor.sensor == Sensor::Gyro {
            4.0
        } else {
            1.0
        };
        assert!(
            (factor.on_variance / expected - 1.0).abs() < 0.05,
            "{factors:?}"
        );
    }
    let before = drive.sampled_nees(drive.belief(&model(1.0, 1.0)), &truth);
    let after = drive.sampled_nees(drive.belief(&scaled(&model(1.0, 1.0), &factors)), &truth);
    let deviation = (18.0_f64 / 100.0).sqrt();
    assert!((after.value - 9.0).abs() < 4.0 * deviation, "{after:?}");
    assert!(before.value - 9.0 > 6.0 * deviation, "{before:?}");
}

#[test]
fn a_model_that_is_true_needs_no_factor() {
    let drive = drive();
    for aim in [Aim::Mean, Aim::Worst] {
        let factors = drive.factors(&[model(1.0, 1.0)], aim);
        assert!(
            factors.iter().all(|f| f.on_variance == 1.0) && factors.len() == 2,
            "{factors:?}"
        );
    }
}

/// White noise of the gyroscope that is a hundred times as large shows in the attitude while fixes come, more than at the end of
/// an outage, where velocity and position have grown: the tuned filter is honest in both, as a verdict on a run has it.
#[test]
fn a_tuned_filter_is_honest_over_the_run_as_a_verdict_judges_it() {
    let drive = drive();
    let axis = |white: f64, walk: f64| {
        Composite::new(vec![
            Process::white(white).unwrap(),
            Process::random_walk(walk).unwrap(),
        ])
    };
    let truth = Model::pooled(100.0, &axis(1e-4, 1e-10), &axis(1e-6, 1e-12));
    let factors = drive.factors(std::slice::from_ref(&truth), Aim::Worst);
    let belief = drive.belief(&scaled(&model(1.0, 1.0), &factors));
    let experiment =
        drive
            .scenario
            .experiment(&drive.trajectory, Truth::Model(&truth), &[], &OUTAGES, 1);
    let summary = Expected::along(&drive.track, &experiment, &belief, &truth)
        .unwrap()
        .summary;
    assert!(
        summary.verdict.kind != VerdictKind::Overconfident,
        "{:?} {factors:?}",
        summary.verdict
    );
    assert!(summary.verdict.ratio < 1.01, "{:?}", summary.verdict);
}

/// Of two truths, each larger in another sensor, neither is underrated; and the factors are those of the two.
#[test]
fn the_worst_of_two_truths_is_covered() {
    let drive = drive();
    let truths = [model(4.0, 1.0), model(1.0, 4.0)];
    let factors = drive.factors(&truths, Aim::Worst);
    assert!(
        factors.len() == 2 && factors.iter().all(|f| (2.0..6.0).contains(&f.on_variance)),
        "{factors:?}"
    );
}

/// The factors are the smallest to 2 %: with all of them less by that, or any one of them, some error exceeds its sigma.
#[test]
fn no_factor_is_larger_than_it_must_be() {
    let drive = drive();
    let truth = model(9.0, 4.0);
    let factors = drive.factors(std::slice::from_ref(&truth), Aim::Worst);
    let largest = |factors: &[Factor]| {
        let belief = drive.belief(&scaled(&model(1.0, 1.0), factors));
        let experiment =
            drive
                .scenario
                .experiment(&drive.trajectory, Truth::Model(&truth), &[], &OUTAGES, 1);
        let record = Expected::along(&drive.track, &experiment, &belief, &truth)
            .unwrap()
            .record;
        let ends = &record.outages[0];
        let at_end = (0..9).map(|i| (ends.error_end[i] / ends.see_end[i]).powi(2));
        at_end
            .chain(record.normalised_sq)
            .fold(0.0, f64::max)
            .sqrt()
    };
    assert!(largest(&factors) < 1.0015, "{factors:?}");
    let smaller = |is_of: &dyn Fn(usize) -> bool| -> Vec<Factor> {
        let less = |(i, f): (usize, &Factor)| Factor {
            on_variance: f.on_variance * if is_of(i) { 0.98 } else { 1.0 },
            ..*f
        };
        factors.iter().enumerate().map(less).collect()
    };
    for factors in [
        smaller(&|_| true),
        smaller(&|i| i == 0),
        smaller(&|i| i == 1),
    ] {
        assert!(
            largest(&factors) > 1.001,
            "{} {factors:?}",
            largest(&factors)
        );
    }
}
