//! Measurements of a vehicle by itself: closed forms, and runs beside the covariance analysis.

use super::Scenario;
use crate::monte_carlo::run;
use crate::simulation::REPORTED;
use crate::simulation::lincov::{
    AssessedInstant, FilterPass, STRAPDOWN, Track, TruthModel, strapdown_over_sigma,
};
use crate::tests::*;

const RATE_HZ: f64 = 50.0;
pub(crate) const OUTAGE: Outage = Outage {
    start_s: 30.0,
    end_s: 85.0,
};

/// A street with bends, a stop from 44 s to 58 s, and a way on.
pub(crate) fn town() -> Trajectory {
    drive(
        13.0,
        "{ kind = 'turn', angle_deg = 70, duration_s = 12 },
        { kind = 'straight', duration_s = 10 },
        { kind = 'turn', angle_deg = -120, duration_s = 14 },
        { kind = 'accelerate', to_speed_m_s = 0, duration_s = 8 },
        { kind = 'straight', duration_s = 14 },
        { kind = 'accelerate', to_speed_m_s = 16, duration_s = 10 },
        { kind = 'turn', angle_deg = 50, duration_s = 10 },
        { kind = 'straight', duration_s = 12 }",
    )
}

/// What makes the errors of runs, and a filter with a state for each process knows.
pub(crate) fn consumer() -> Model {
    gauss_markov(RATE_HZ, [2e-5, 5e-7], [0.01, 1e-4], [200.0; 2])
}

/// A scenario with these keys of its section `aiding`.
pub(crate) fn scenario(aiding: &str) -> Scenario {
    let mut scenario: Scenario = toml::from_str(&format!("[aiding]\n{aiding}")).unwrap();
    scenario.imu.rate_hz = RATE_HZ;
    scenario.filter.states = FilterStates::Full;
    scenario.initial.att_sigma_deg = [0.2, 0.2, 0.5];
    scenario.validate().unwrap();
    scenario
}

/// Errors and beliefs at the end of the outage by the covariance analysis, and the root mean squares of errors and the
/// mean stated deviations of `runs` runs there.
fn classical_and_robust(scenario: &Scenario, runs: u64) -> (AssessedInstant, [[f64; REPORTED]; 2]) {
    let (trajectory, model) = (town(), consumer());
    let outages = [OUTAGE];
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let filter_models = [scenario.filter_model(&model, &outages, &track).unwrap()];
    let experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&model),
        &filter_models,
        &outages,
        5,
    );
    let truth = TruthModel::together(&TruthModel::sources(&experiment, &model));
    let judged = FilterPass::new(&track, &filter_models[0])
        .errors_at_ends(&truth)
        .remove(0);
    let found = run(&experiment, runs, &|_| {}).unwrap().remove(0).runs;
    let ends = || found.iter().map(|run| &run.outages[0]);
    let rms = |i: usize| (ends().map(|o| o.error_end[i].powi(2)).sum::<f64>() / runs as f64).sqrt();
    let see = |i: usize| ends().map(|o| o.see_end[i]).sum::<f64>() / runs as f64;
    (judged, [std::array::from_fn(rms), std::array::from_fn(see)])
}

/// Each kind of aiding, with an error that the filter knows and with one that it does not: the root mean square of n
/// runs has the relative deviation √(1/2n), and lies within four of the covariance analysis. What filters state hardly
/// scatters; it follows their own estimates, to a per cent here.
#[test]
fn runs_have_the_errors_that_the_analysis_states() {
    let runs = 400;
    let horizontal = |x: [f64; REPORTED]| x[0].hypot(x[1]);
    let free = horizontal(classical_and_robust(&scenario(""), runs).0.errors.rmse());
    let nhc = "nhc.lever_arm_m = [-0.15, 0.3, 0.5]";
    let moving = "noise_sigma_m_s = 0.02, sideslip_s2_m = 0.004, walk_sigma_m_s = 0.08, correlation_time_s = 3";
    let slips = "slip_s2_m = 0.005, noise_sigma_m_s = 0.01, scale_sigma = 0.005";
    let turned = "truth = { offset_sigma_deg = 0.6, walk_sigma_deg = 0.5 }";
    for (is_of_use, aiding) in [
        (true, nhc.into()),
        (false, format!("{nhc}\nnhc.truth.mounting_sigma_deg = 0.5")),
        (
            true,
            format!("{nhc}\nnhc.mounting_sigma_deg = 0.5\nnhc.truth.mounting_sigma_deg = 0.5"),
        ),
        (false, format!("{nhc}\nnhc.truth = {{ {moving} }}")),
        (true, "odometer = {}".into()),
        (
            true,
            "odometer = { scale_sigma = 0.01, truth.scale_sigma = 0.01 }".into(),
        ),
        (false, format!("odometer.truth = {{ {slips} }}")),
        (true, "zupt = {}".into()),
        (false, "zupt.truth.walk_sigma_m_s = 0.1".into()),
        (true, "heading = {}".into()),
        (false, format!("heading = {{ {turned} }}")),
        (
            false,
            format!("heading = {{ source = 'antennas', {turned} }}"),
        ),
    ] {
        let (judged, [rms, see]) = classical_and_robust(&scenario(&aiding), runs);
        let (expected, sigma) = (judged.errors.rmse(), judged.sigma());
        for i in 0..REPORTED {
            let ratio = rms[i] / expected[i];
            assert!(
                (ratio - 1.0).abs() < 4.0 / (2.0 * runs as f64).sqrt(),
                "{aiding}, state {i}: {ratio}"
            );
            let ratio = see[i] / sigma[i];
            assert!((ratio - 1.0).abs() < 0.02, "{aiding}, state {i}: {ratio}");
        }
        // what a filter leaves out may harm it
        assert!(
            !is_of_use || horizontal(expected) < free,
            "{aiding} is of use"
        );
    }
}

/// On a straight road a filter that follows a wheel drifts along the track by scale × distance.
#[test]
fn the_scale_of_a_wheel_moves_a_position_along_the_track() {
    let (speed, seconds) = (20.0, 60.0);
    let trajectory = drive(speed, "{ kind = 'straight', duration_s = 100 }");
    let scenario =
        scenario("odometer = { rate_hz = 10, sigma_m_s = 0.001, truth.scale_sigma = 0.01 }");
    // No fix before, which would contradict the wheel.
    let outages = [Outage {
        start_s: 0.5,
        end_s: seconds,
    }];
    // A loud accelerometer: the wheel alone says how fast the vehicle is.
    let model = gauss_markov(RATE_HZ, [1.0, 1e-12], [1e-3, 1e-6], [200.0; 2]);
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let filter_models = [scenario.filter_model(&model, &outages, &track).unwrap()];
    let experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&model),
        &filter_models,
        &outages,
        5,
    );
    let sources = TruthModel::sources(&experiment, &model);
    let wheel = sources
        .iter()
        .find(|source| source.name == "aiding.odometer.scale")
        .unwrap();
    let errors = FilterPass::new(&track, &filter_models[0]).errors_at_ends(&wheel.side)[0].errors;
    let (north, east) = ((40.0 * DEG).cos(), (40.0 * DEG).sin());
    let p = errors.covariance;
    let along =
        (p[0][0] * north * north + 2.0 * p[0][1] * north * east + p[1][1] * east * east).sqrt();
    let expected = 0.01 * speed * seconds;
    // the first interval of the wheel, 0.1 s, has not its whole error
    assert!(
        (along / expected - 1.0).abs() < 0.1 / seconds,
        "{along} of {expected}"
    );
}

/// Where a filter follows zero velocities that creep by a Gauss-Markov process, its position is the integral of that, of variance
/// 2 σ² τ (t − τ (1 − e^(−t/τ))).
#[test]
fn a_creep_that_lasts_moves_a_position_by_its_integral() {
    let (sigma, tau, seconds) = (0.02, 10.0_f64, 119.0);
    let trajectory = drive(0.0, "{ kind = 'straight', duration_s = 121 }");
    let scenario = scenario(&format!(
        "zupt = {{ rate_hz = 10, sigma_m_s = 0.001, \
         truth = {{ walk_sigma_m_s = {sigma}, correlation_time_s = {tau} }} }}"
    ));
    let outages = [Outage {
        start_s: 0.5,
        end_s: seconds,
    }];
    let model = gauss_markov(RATE_HZ, [1.0, 1e-12], [1e-3, 1e-6], [200.0; 2]);
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let filter_models = [scenario.filter_model(&model, &outages, &track).unwrap()];
    let experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&model),
        &filter_models,
        &outages,
        5,
    );
    let creep = TruthModel::sources(&experiment, &model)
        .into_iter()
        .find(|source| source.name == "aiding.zupt.creep")
        .unwrap();
    let errors = FilterPass::new(&track, &filter_models[0]).errors_at_ends(&creep.side)[0].errors;
    let lasting_s = seconds - tau * (1.0 - (-seconds / tau).exp());
    let expected = sigma * (2.0 * tau * lasting_s).sqrt();
    // along the vehicle; the mean over 0.1 s takes a little of it
    let [north, east, ..] = errors.rmse();
    assert_relative_eq!(north.hypot(east), expected, max_relative = 0.01);
}

/// At rest a velocity error is a random walk of variance q a second, measured every second with variance r: its variance
/// after a measurement settles at (√(q² + 4 q r) − q)/2, the root of P = (P + q) r/(P + q + r).
#[test]
fn zero_velocity_at_rest_has_the_steady_state_of_the_scalar_filter() {
    let trajectory = drive(0.0, "{ kind = 'straight', duration_s = 120 }");
    let mut scenario = scenario("zupt.sigma_m_s = 0.03");
    scenario.initial.att_sigma_deg = [1e-9; 3];
    let outages = [Outage {
        start_s: 1.0,
        end_s: 119.5,
    }];
    let white = 1e-3;
    let model = gauss_markov(RATE_HZ, [white, 1e-20], [1e-9, 1e-12], [200.0; 2]);
    let track: Track = scenario.track(&trajectory, &model, &outages).unwrap();
    let filter_model = scenario.filter_model(&model, &outages, &track).unwrap();
    let judged = &FilterPass::new(&track, &filter_model)
        .errors(&TruthModel::default())
        .reports[118];
    // a sample's variance, times its interval squared, at fifty samples a second
    let (q, r) = (white / RATE_HZ, 0.03_f64.powi(2));
    let expected = (0.5 * ((q * q + 4.0 * q * r).sqrt() - q)).sqrt();
    for sigma in &judged.sigma()[3..6] {
        assert_relative_eq!(*sigma, expected, max_relative = 1e-3);
    }
}

#[test]
fn a_state_for_the_wheel_keeps_a_filter_honest() {
    let nees = |scale_sigma: f64| {
        let odometer =
            format!("odometer.truth.scale_sigma = 0.02\nodometer.scale_sigma = {scale_sigma}");
        classical_and_robust(&scenario(&odometer), 1)
            .0
            .consistency()
            .nees
    };
    assert_abs_diff_eq!(nees(0.02), 9.0, epsilon = 1e-6);
    assert!(nees(0.0) > 20.0, "{}", nees(0.0));
}

/// A vehicle that moves sideways by itself is no road vehicle.
#[test]
fn a_constraint_that_the_reference_does_not_keep_is_refused() {
    // a point ten metres to the front swings outwards in every turn
    let scenario = scenario("nhc.lever_arm_m = [10, 0, 0]");
    let error = scenario
        .track(&town(), &consumer(), &[])
        .unwrap_err()
        .to_string();
    let expected = "aiding.nhc.sigma_m_s = 0.2: the reference itself";
    assert!(error.starts_with(expected), "{error}");
}

/// Means over an outage are those of the reports in it; a ratio over a run is a root mean square; and what the strapdown errs
/// by is looked for at the ends of outages too. Here ten samples a second see a part of a coning of 2 Hz, and the heading runs
/// away until the end, half a second after the last report.
#[test]
fn figures_of_a_pass_are_those_of_its_instants() {
    let coning = samples(6050, 0.01, |t_s| {
        let (sin, cos) = (std::f64::consts::TAU * 2.0 * t_s).sin_cos();
        let attitude = RollPitchYaw {
            roll: 3.0 * DEG * sin,
            pitch: 3.0 * DEG * cos,
            yaw: 0.0,
        };
        let q_b_n = attitude.to_quat();
        (0.8 + 15.0 * t_s / 6.37e6, 0.1, 0.0, q_b_n)
    });
    let trajectory = Trajectory::from_samples(&coning).unwrap();
    let mut scenario = scenario("");
    scenario.imu.rate_hz = 10.0;
    let model = gauss_markov(10.0, [2e-6, 5e-9], [1e-4, 1e-6], [200.0; 2]);
    let outages = [Outage {
        start_s: 0.0,
        end_s: 100.0,
    }];
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let filter_models = [scenario.filter_model(&model, &outages, &track).unwrap()];
    let pass = FilterPass::new(&track, &filter_models[0]);
    let mut found = pass.assess(&filter_models[0], &model);
    let window = Outage {
        start_s: 20.0,
        end_s: 40.0,
    };
    let within = found.reports.iter().filter(|r| window.withholds(r.after_s));
    let sigmas: Vec<[f64; REPORTED]> = within.map(|r| r.sigma).collect();
    assert_eq!(sigmas.len(), 20);
    let means = pass.sigma_means(&[window])[0];
    for i in 0..REPORTED {
        let mean = sigmas.iter().map(|sigma| sigma[i]).sum::<f64>() / 20.0;
        assert_relative_eq!(means[i], mean, max_relative = 1e-12);
    }

    found.reports.truncate(2);
    for (report, ratio) in found.reports.iter_mut().zip([1.0, 7.0]) {
        report.rmse = report.sigma.map(|sigma| ratio * sigma);
    }
    for ratio in found.ratio_over_run() {
        assert_relative_eq!(ratio, 5.0, max_relative = 1e-12);
    }

    let experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&model),
        &filter_models,
        &outages,
        5,
    );
    let strapdown = TruthModel::sources(&experiment, &model)
        .into_iter()
        .find(|source| source.name == STRAPDOWN)
        .unwrap();
    let law = pass.errors(&strapdown.side);
    let largest = |of: &[AssessedInstant]| {
        of.iter()
            .flat_map(|judged| std::iter::zip(judged.errors.rmse(), judged.sigma()))
            .map(|(error, sigma)| error / sigma)
            .fold(0.0, f64::max)
    };
    let [of_reports, of_end] = [&law.reports[1..], &law.outage_ends].map(largest);
    assert!(of_end > of_reports, "{of_end} {of_reports}");
    assert_relative_eq!(
        strapdown_over_sigma(&track, &filter_models[0]),
        of_end,
        max_relative = 1e-12
    );
}
