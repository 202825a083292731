//! What covariance analysis expects, against runs that are drawn: a drive of two minutes with an outage, for what
//! the true IMU and the receiver can have and filters do or do not expect.

use crate::shared::{outage, stands, white};
use approx::assert_relative_eq;
use nav_sim::navigation::earth::GravityModel;
use nav_sim::navigation::metrics::{Estimate, ExpectedRun, epochs};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{OutageRecord, RunResult};
use nav_sim::navigation::trajectory::Trajectory;

use nav_sim::signal::noise::{Composite, Model, Process};
use nav_sim_navigation::earth::gravity_down;
use nav_sim_navigation::metrics::Budget;
use nav_sim_navigation::simulation::Gains;
use nav_sim_navigation::simulation::lincov::{FilterPass, TruthModel};

const RATE_HZ: f64 = 100.0;
const RUNS: u64 = 400;
const OUTAGE: Outage = Outage {
    start_s: 70.0,
    end_s: 100.0,
};
/// Standard errors that a figure may be off: 117 RMSE of a case beyond it with probability 1e-4 (Bonferroni; the
/// scatter of 400 squares is nearly normal).
const BOUND: f64 = 4.9;

pub(super) fn drive() -> Trajectory {
    crate::shared::drive(
        6.0,
        "{ kind = 'accelerate', to_speed_m_s = 12, duration_s = 8, climb_m = 1 },
        { kind = 'turn', angle_deg = 90, duration_s = 9, climb_m = 1 },
        { kind = 'straight', duration_s = 6, climb_m = 1 },
        { kind = 'turn', angle_deg = -80, duration_s = 9, climb_m = 1 },
        { kind = 'accelerate', to_speed_m_s = 5, duration_s = 8, climb_m = 1 },
        { kind = 'turn', angle_deg = 70, duration_s = 9, climb_m = 1 },
        { kind = 'accelerate', to_speed_m_s = 15, duration_s = 8, climb_m = 1 },
        { kind = 'turn', angle_deg = -60, duration_s = 9, climb_m = 1 },
        { kind = 'straight', duration_s = 12, climb_m = 1 },
        { kind = 'accelerate', to_speed_m_s = 8, duration_s = 8, climb_m = 1 },
        { kind = 'turn', angle_deg = 100, duration_s = 9, climb_m = 1 },
        { kind = 'straight', duration_s = 5, climb_m = 1 },
        { kind = 'accelerate', to_speed_m_s = 14, duration_s = 8, climb_m = 1 },
        { kind = 'turn', angle_deg = -45, duration_s = 9, climb_m = 1 },
        { kind = 'straight', duration_s = 8, climb_m = 1 }",
    )
}

/// White and quantization noise, a fast and a slow correlated bias, a random walk; all variances times `scale`.
fn model(scale: f64) -> Model {
    let axis = |unit: f64| {
        let s = scale * unit;
        Composite::new(vec![
            Process::white(5e-5 * s).unwrap(),
            Process::quantization(1e-6 * s).unwrap(),
            Process::ar1(0.98, 1e-7 * s).unwrap(),
            Process::ar1(0.9997, 6e-9 * s).unwrap(),
            Process::random_walk(1e-10 * s).unwrap(),
        ])
    };
    Model::pooled(RATE_HZ, &axis(1.0), &axis(1e-3))
}

/// A filter that believes in `model(1.0)`, with errors of `truth`: runs and expectation agree.
fn assert_agree(name: &str, truth: &Model) {
    let scenario: Scenario = toml::from_str(name).unwrap();
    scenario.validate().unwrap();
    let (path, believed, outages) = (drive(), model(1.0), [OUTAGE]);
    let track = scenario.track(&path, &believed, &outages).unwrap();
    let filter_models = [scenario.filter_model(&believed, &outages, &track).unwrap()];
    let mut experiment =
        scenario.experiment(&path, Truth::Model(truth), &filter_models, &outages, 11);
    let expected = ExpectedRun::along(&track, &experiment, &filter_models[0], truth).unwrap();
    for gains in [Gains::Own, Gains::Auto] {
        experiment.gains = gains;
        let sampled = &monte_carlo::run(&experiment, RUNS, &|_| {}).unwrap()[0];
        assert_epochs_agree(name, sampled, &expected);
        assert_outage_agrees(name, sampled, &expected);
        let nis = Estimate::mean_of(sampled.runs.iter().map(|r| r.nis.0), None);
        let z = (nis.value - expected.record.nis.0) / nis.std_error;
        assert!(
            z.abs() < BOUND,
            "{name}: NIS {} {}",
            nis.value,
            expected.record.nis.0
        );
    }
}

/// Every ten seconds: ASEE within half a percent, RMSE and bias within their standard errors, NEES and coverage.
fn assert_epochs_agree(name: &str, sampled: &RunResult, expected: &ExpectedRun) {
    for (s, e) in epochs(sampled).iter().zip(&expected.epochs).step_by(10) {
        assert_eq!((s.t_s, s.gnss, s.count), (e.t_s, e.gnss, RUNS));
        let near = |what: &str, sampled: Estimate, expected: f64| {
            let z = (sampled.value - expected) / sampled.std_error;
            // a perfect start has neither error nor scatter, but for the rounding of the attitude's error
            let same = (sampled.value - expected).abs() < 1e-15;
            assert!(
                same || z.abs() < BOUND,
                "{name}, {what} at {} s: {} {expected}, z {z}",
                s.t_s,
                sampled.value
            );
        };
        for i in 0..9 {
            let ratio = s.asee.0[i].value / e.asee.0[i].value;
            assert!(
                (ratio - 1.0).abs() < 5e-3,
                "{name}, ASEE {i} at {} s: {ratio}",
                s.t_s
            );
            near(&format!("RMSE {i}"), s.rmse.0[i], e.rmse.0[i].value);
            near(&format!("bias {i}"), s.bias.0[i], e.bias.0[i].value);
        }
        for (sampled, expected) in s.bias_asee.iter().zip(e.bias_asee) {
            assert!(expected > 0.0);
            assert_relative_eq!(*sampled, expected, max_relative = 5e-3);
        }
        near("NEES", s.nees, e.nees.value);
        near("position error", s.mean_pos_err_m, e.mean_pos_err_m.value);
        near(
            "attitude error",
            s.mean_att_err_deg,
            e.mean_att_err_deg.value,
        );
        let binomial = (e.coverage * (1.0 - e.coverage) / RUNS as f64).sqrt();
        // where nearly nothing is left outside, the law of the few is Poisson's: two of them more
        let slack = BOUND * binomial + 2.0 / RUNS as f64;
        assert!(
            (s.coverage - e.coverage).abs() < slack,
            "{name}: {} {} at {} s",
            s.coverage,
            e.coverage,
            s.t_s
        );
    }
}

/// At the outage's end: RMSE, NEES, and as many runs below each quantile as a binomial law allows.
fn assert_outage_agrees(name: &str, sampled: &RunResult, expected: &ExpectedRun) {
    let summary = &expected.summary;
    let outage = &summary.outages[0];
    let records = || sampled.runs.iter().map(|r| &r.outages[0]);
    let near = |what: &str, found: Estimate, expected: f64| {
        let z = (found.value - expected) / found.std_error;
        assert!(
            z.abs() < BOUND,
            "{name}, {what} at the end: {found:?} {expected}"
        );
    };
    for i in 0..9 {
        let squares = records().map(|o| o.error_end[i].powi(2));
        let rmse = Estimate::mean_of(squares, None).root();
        near(&format!("RMSE {i}"), rmse, outage.rmse_end.0[i]);
    }
    let mean = |of: fn(&OutageRecord) -> f64| Estimate::mean_of(records().map(of), None);
    near("NEES", mean(|o| o.nees_end), outage.nees_end);
    near(
        "density",
        mean(|o| o.log_density_end),
        outage.log_density_end,
    );
    let h = &outage.horizontal_error_end_m;
    for (p, quantile) in [(0.5, h.p50), (0.95, h.p95)] {
        let below = records()
            .filter(|o| o.horizontal_error_end_m <= quantile)
            .count() as f64;
        let (mean, deviation) = (p * RUNS as f64, (p * (1.0 - p) * RUNS as f64).sqrt());
        assert!(
            (below - mean).abs() < 4.0 * deviation,
            "{name}: {below} of {RUNS} below p = {p}"
        );
    }
}

const BIAS: &str = "imu = { turn_on_bias_accel_m_s2 = 0.02, turn_on_bias_gyro_rad_s = 2e-4 }";
const BIAS_EXPECTED: &str =
    "initial = { accel_bias_sigma_m_s2 = 0.02, gyro_bias_sigma_rad_s = 2e-4 }";
const SCALE: &str = "imu = { scale_ppm_accel = 2000, scale_ppm_gyro = 2000 }";
const SCALE_EXPECTED: &str = "filter.states = '21'\n\
    initial = { accel_scale_sigma_ppm = 2000, gyro_scale_sigma_ppm = 1000 }";
const ARM: &str = "gnss.lever_arm_m = [1.0, -0.5, -1.2]";

/// Scenarios of a filter that is right but for what it does not expect: matched filters, turn-on biases, scale factors and
/// misalignments, what no filter has states for (forces on gyroscopes, rectified vibration, an IMU that warms and cools), a lever
/// arm, a barometer, a receiver with memory.
#[test]
fn runs_agree_whatever_a_filter_expects_or_not() {
    for scenario in [
        "filter.states = '15'",
        "filter.states = '21'",
        "filter.states = 'full'",
        BIAS,
        &format!("{BIAS}\n{BIAS_EXPECTED}"),
        BIAS_EXPECTED,
        SCALE,
        &format!("{SCALE}\n{SCALE_EXPECTED}"),
        "imu.misalignment_rad = 1e-3",
        &format!("imu.g_sensitivity_rad_s_per_m_s2 = 5e-5\n{ARM}"),
        "imu.vibration = { rms_m_s2 = 8.0, rectification_s2_m = 2e-4 }",
        "imu.temperature = { profile_c = [[5, 20], [60, 35], [80, 30]], accel_m_s2_k = 1e-3, gyro_rad_s_k = 1e-5 }",
        &format!(
            "{ARM}\nimu = {{ scale_ppm_gyro = 2000, misalignment_rad = 1e-3, turn_on_bias_gyro_rad_s = 2e-4 }}"
        ),
        "gnss = { correlated_pos_sigma_m = [3, 2, 5], correlation_time_s = 30, rate_hz = 2 }\n\
        baro = { rate_hz = 1, sigma_m = 0.5 }",
        "gnss.vel_sigma_m_s = 'none'\ninitial.perfect = true",
    ] {
        assert_agree(scenario, &model(1.0));
    }
}

/// A truth four times as bad as believed; and a drift, which is the same in every run: it is in the mean of the errors, with its
/// sign.
#[test]
fn runs_of_another_truth_agree() {
    let mut drifting = model(1.0);
    for (axis, slope) in [(0, 2e-6), (1, -3e-6), (4, 3e-9), (5, -5e-9)] {
        drifting.axes[axis]
            .processes
            .push(Process::drift(slope).unwrap());
    }
    for truth in [model(4.0), drifting] {
        assert_agree("", &truth);
        assert_agree("filter.states = 'full'", &truth);
    }
}

/// Standing still for 20 s without a fix from a perfect start: a turn-on bias of deviation b makes b t²/2 down, a
/// scale factor s makes s g t²/2, a drift of slope k per sample k f t³/6 (known sign: all of it is mean). The
/// gravity gradient (time constant 570 s) adds (20/570)²/6, and the step of the covariance (0.2 s) is exact here.
#[test]
fn constants_of_the_true_imu_have_their_closed_forms() {
    let (path, outages) = (stands(20.0), [outage(0.0, 20.0)]);
    let believed = Model::pooled(RATE_HZ, &white(1e-4), &white(1e-4));
    let down = |imu: &str, truth: &Model| {
        let scenario: Scenario = toml::from_str(&format!("initial.perfect = true\n{imu}")).unwrap();
        let track = scenario.track(&path, &believed, &outages).unwrap();
        let filter_models = [scenario.filter_model(&believed, &outages, &track).unwrap()];
        let experiment =
            scenario.experiment(&path, Truth::Model(truth), &filter_models, &outages, 1);
        let sources = TruthModel::together(&TruthModel::sources(&experiment, truth));
        let end = FilterPass::new(&track, &filter_models[0])
            .errors(&sources)
            .outage_ends[0];
        (end.errors.rmse()[2], end.errors.mean[2])
    };
    let none = Model {
        rate_hz: RATE_HZ,
        axes: Default::default(),
    };
    let (bias, mean) = down("imu.turn_on_bias_accel_m_s2 = 0.01", &none);
    assert_relative_eq!(bias, 2.0, max_relative = 1.5e-3);
    assert_eq!(mean, 0.0);
    let (scale, _) = down("imu.scale_ppm_accel = 1000", &none);
    let g = gravity_down(GravityModel::default(), 46.0_f64.to_radians().sin(), 300.0);
    assert_relative_eq!(scale, 1e-3 * g * 200.0, max_relative = 1.5e-3);
    let mut drifting = none.clone();
    drifting.axes[2]
        .processes
        .push(Process::drift(1e-6).unwrap());
    let (rmse, mean) = down("", &drifting);
    // 100 a second, each a hundredth of a second later: k f t³/6 (1 + 3/(2n))
    assert_relative_eq!(mean, 1e-6 * RATE_HZ * 8000.0 / 6.0, max_relative = 2e-3);
    assert_relative_eq!(rmse, mean.abs(), max_relative = 1e-12);
}

/// Shares of every state sum to 1; together the sources make the mean squares of the whole truth: covariances add over
/// independent sources.
#[test]
fn budgets_add_up_to_the_true_errors() {
    let text = "
        imu = { turn_on_bias_accel_m_s2 = 0.01, scale_ppm_gyro = 500, misalignment_rad = 1e-3 }
        gnss = { lever_arm_m = [1.0, -0.5, -1.2], correlated_pos_sigma_m = [3, 2, 5] }
        baro = { rate_hz = 1, sigma_m = 0.5 }
        initial = { accel_bias_sigma_m_s2 = 0.02 }
        filter.states = '21'
    ";
    let scenario: Scenario = toml::from_str(text).unwrap();
    let (path, believed, outages) = (drive(), model(1.0), [OUTAGE]);
    let mut truth = model(4.0);
    truth.axes[3].processes.push(Process::drift(1e-9).unwrap());
    let track = scenario.track(&path, &believed, &outages).unwrap();
    let filter_models = [scenario.filter_model(&believed, &outages, &track).unwrap()];
    let experiment = scenario.experiment(&path, Truth::Model(&truth), &filter_models, &outages, 1);
    let filter = FilterPass::new(&track, &filter_models[0]);
    let sources = TruthModel::sources(&experiment, &truth);
    let end = filter.errors(&TruthModel::together(&sources)).outage_ends[0];
    let deviations = end.errors.rmse();
    let budget = &Budget::at_outage_ends(&filter, &sources)[0];
    for i in 0..9 {
        let sum: f64 = budget.shares.iter().map(|(_, shares)| shares.0[i]).sum();
        assert!((sum - 1.0).abs() < 1e-9, "state {i}: {sum}");
        let ratio = budget.total[i] / deviations[i].powi(2);
        assert!((ratio - 1.0).abs() < 1e-9, "state {i}: {ratio}");
        assert!(
            budget
                .shares
                .iter()
                .all(|(_, shares)| shares.0[i] >= -1e-12)
        );
    }
    let names: Vec<&str> = sources.iter().map(|source| source.name.as_str()).collect();
    let expected = [
        "initial",
        "gnss.position",
        "gnss.velocity",
        "baro",
        "accel.WN",
        "accel.QN",
        "accel.AR1_1",
        "accel.AR1_2",
        "accel.RW",
        "accel.turn_on_bias",
        "accel.misalignment",
        "gyro.WN",
        "gyro.QN",
        "gyro.AR1_1",
        "gyro.AR1_2",
        "gyro.RW",
        "gyro.scale",
        "gyro.misalignment",
        "drift",
        "gnss.correlated",
        "strapdown",
    ];
    assert_eq!(names, expected);
}
