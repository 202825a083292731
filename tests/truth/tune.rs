//! Tuned models are consistent: the factor of a process that is larger in truth is found, and sampled runs agree.

use crate::shared::{town, white_and_walk};
use approx::{assert_abs_diff_eq, assert_relative_eq};
use nav_sim::navigation::ekf::FilterModel;
use nav_sim::navigation::metrics::{Estimate, ExpectedRun, VerdictKind};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::trajectory::Trajectory;

use nav_sim::signal::imu::Sensor;
use nav_sim::signal::noise::Model;
use nav_sim_navigation::simulation::lincov::{
    ConsistencyCriterion, Factor, Filter, Track, TrueErrors, TuningProblem, scaled,
};

const OUTAGES: [Outage; 1] = [Outage {
    start_s: 200.0,
    end_s: 260.0,
}];

fn model(accel: f64, gyro: f64) -> Model {
    let gyro = white_and_walk(1e-8, gyro * 1e-12);
    Model::pooled(100.0, &white_and_walk(1e-4, accel * 1e-10), &gyro)
}

struct Drive {
    scenario: Scenario,
    trajectory: Trajectory,
    track: Track,
}

fn drive() -> Drive {
    let (scenario, trajectory) = (Scenario::default().with_full_noise(), town(5));
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
    fn filter_model(&self, model: &Model) -> FilterModel {
        self.scenario
            .filter_model(model, &OUTAGES, &self.track)
            .unwrap()
    }

    fn factors(&self, truths: &[Model], aim: ConsistencyCriterion) -> Vec<Factor> {
        let filter: &Filter<'_> =
            &|model: &Model| self.scenario.filter_model(model, &OUTAGES, &self.track);
        let model = &model(1.0, 1.0);
        let truths: &[TrueErrors] = &truths
            .iter()
            .cloned()
            .map(TrueErrors::from)
            .collect::<Vec<_>>();
        let task = TuningProblem {
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
            ConsistencyCriterion::Mean => {
                assert_relative_eq!(consistency.nees, 9.0, max_relative = 5e-3)
            }
            ConsistencyCriterion::Worst => {
                assert_relative_eq!(consistency.largest.ratio, 1.0, max_relative = 5e-3)
            }
        }
        factors
    }

    /// What a filter with these factors is expected to do.
    fn expected(&self, factors: &[Factor], truth: &Model) -> ExpectedRun {
        let filter_model = self.filter_model(&scaled(&model(1.0, 1.0), factors));
        let truly = Truth::Model(truth);
        let experiment = self
            .scenario
            .experiment(&self.trajectory, truly, &[], &OUTAGES, 1);
        ExpectedRun::along(&self.track, &experiment, &filter_model, truth).unwrap()
    }

    /// NEES at the outage's end of a hundred runs.
    fn sampled_nees(&self, filter_model: FilterModel, truth: &Model) -> Estimate {
        let filter_models = [filter_model];
        let experiment = self.scenario.experiment(
            &self.trajectory,
            Truth::Model(truth),
            &filter_models,
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
    let factors = drive.factors(std::slice::from_ref(&truth), ConsistencyCriterion::Mean);
    for factor in &factors {
        let expected = if factor.sensor == Sensor::Gyro {
            4.0
        } else {
            1.0
        };
        assert_relative_eq!(factor.on_variance, expected, max_relative = 0.05);
    }
    let before = drive.sampled_nees(drive.filter_model(&model(1.0, 1.0)), &truth);
    let after = drive.sampled_nees(
        drive.filter_model(&scaled(&model(1.0, 1.0), &factors)),
        &truth,
    );
    let deviation = (18.0_f64 / 100.0).sqrt();
    assert_abs_diff_eq!(after.value, 9.0, epsilon = 4.0 * deviation);
    assert!(before.value - 9.0 > 6.0 * deviation, "{before:?}");
}

#[test]
fn a_model_that_is_true_needs_no_factor() {
    let drive = drive();
    for aim in [ConsistencyCriterion::Mean, ConsistencyCriterion::Worst] {
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
    let gyro = white_and_walk(1e-6, 1e-12);
    let truth = Model::pooled(100.0, &white_and_walk(1e-4, 1e-10), &gyro);
    let factors = drive.factors(std::slice::from_ref(&truth), ConsistencyCriterion::Worst);
    let verdict = drive.expected(&factors, &truth).summary.verdict;
    assert_ne!(
        verdict.kind,
        VerdictKind::Overconfident,
        "{verdict:?} {factors:?}"
    );
    assert!(verdict.ratio < 1.01, "{verdict:?}");
}

/// Of two truths, each larger in another sensor, neither is underrated; and the factors are those of the two.
#[test]
fn the_worst_of_two_truths_is_covered() {
    let drive = drive();
    let truths = [model(4.0, 1.0), model(1.0, 4.0)];
    let factors = drive.factors(&truths, ConsistencyCriterion::Worst);
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
    let factors = drive.factors(std::slice::from_ref(&truth), ConsistencyCriterion::Worst);
    let largest = |factors: &[Factor]| {
        let record = drive.expected(factors, &truth).record;
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
        let largest = largest(&factors);
        assert!(largest > 1.001, "{largest} {factors:?}");
    }
}
