//! Covariance analysis compared with Monte-Carlo runs: three trajectories, three filters, a truth as believed, one process
//! of it four times as strong, and the other errors that the true IMU and the receiver can have.
//!
//! `cargo run --release --example 07_lincov_against_runs -- RUNS TRAJECTORY… TRUTH…` (default 2000, the three shipped
//! trajectories, all truths). Every ten seconds: the largest departure of the ASEE in per cent, and since when it is within two; the
//! largest departures of RMSE (nine states), NEES and coverage in Monte-Carlo standard errors, and how many of how many
//! RMSE are beyond four of them. At the ends of the outages: how far the number of runs below the expected p50 and p95 of the
//! horizontal error is from its binomial mean, in standard deviations. Every truth has random numbers of its own.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::io::{model_file, trajectory_file};
use nav_sim::navigation::ekf::FilterStates;
use nav_sim::navigation::metrics::{ExpectedRun, OutageSummary, epochs};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::RunResult;
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::imu::Channel;
use nav_sim::signal::noise::{Model, ProcessKind};
use std::error::Error;
use std::path::Path;

type Failure = Box<dyn Error>;

/// A process whose variance is four times what is believed: kind, and which of its kind.
const STRONGER: [(&str, ProcessKind, usize); 5] = [
    ("WN × 4", ProcessKind::White, 0),
    ("QN × 4", ProcessKind::Quantization, 0),
    ("AR1_1 × 4", ProcessKind::Ar1, 0),
    ("AR1_2 × 4", ProcessKind::Ar1, 1),
    ("RW × 4", ProcessKind::RandomWalk, 0),
];

/// What is there beside noise; the filter of 21 states expects scale factors.
const BESIDE: [(&str, &str); 5] = [
    ("as believed", ""),
    (
        "turn-on bias",
        "imu = { turn_on_bias_accel_m_s2 = 0.02, turn_on_bias_gyro_rad_s = 2e-4 }",
    ),
    (
        "scale factor",
        "imu = { scale_ppm_accel = 1000, scale_ppm_gyro = 1000 }",
    ),
    (
        "coloured GNSS",
        "gnss = { correlated_pos_sigma_m = [3, 3, 5], correlation_time_s = 60 }",
    ),
    ("lever arm", "gnss = { lever_arm_m = [1.0, -0.5, -1.2] }"),
];

/// How far the ASEE of the runs may be from the expected one (per cent): what attitude errors do to second order, in the
/// velocity down before all, is not in linear theory.
const AIM: f64 = 2.0;
/// Every how many epochs of a second runs and expectation are compared.
const EVERY_S: usize = 10;

/// All axes with the variance of one process times four.
fn stronger(model: &Model, kind: ProcessKind, which: usize) -> Result<Model, Failure> {
    let mut stronger = model.clone();
    for channel in Channel::ALL {
        let mut own = stronger.axes[channel.index()]
            .processes
            .iter_mut()
            .filter(|p| p.kind() == kind);
        let process = own.nth(which).ok_or("the model has no such process")?;
        *process = process.times(4.0)?;
    }
    Ok(stronger)
}

/// One truth in three filters.
fn compare(
    (trajectory, name): (&Trajectory, &str),
    (case, settings): (&str, &str),
    (model, truth): (&Model, &Model),
    (runs, seed): (u64, u64),
) -> Result<(), Failure> {
    let scenario: Scenario = toml::from_str(settings)?;
    let outages = Outage::PAPER;
    let track = scenario.track(trajectory, model, &outages)?;
    let mut filter_models = Vec::new();
    for states in FilterStates::ALL {
        let mut own = scenario.clone();
        own.filter.states = states;
        filter_models.push(own.filter_model(model, &outages, &track)?);
    }
    let experiment = scenario.experiment(
        trajectory,
        Truth::Model(truth),
        &filter_models,
        &outages,
        seed,
    );
    let sampled = monte_carlo::run(&experiment, runs, &|_| {})?;
    for ((states, filter_model), sampled) in
        FilterStates::ALL.iter().zip(&filter_models).zip(&sampled)
    {
        let expected = ExpectedRun::along(&track, &experiment, filter_model, truth)
            .ok_or("the covariance ran away")?;
        println!(
            "| {name} | {case} | {states} | {} |",
            departures(sampled, &expected)
        );
    }
    Ok(())
}

/// How far runs are from what is expected of them.
fn departures(sampled: &RunResult, expected: &ExpectedRun) -> String {
    let (mut asee, mut rmse, mut nees, mut coverage) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut within_from_s = 0.0;
    let (mut beyond, mut all, mut worst) = (0, 0, 0.0_f64);
    let farther = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
    for (s, e) in epochs(sampled)
        .iter()
        .zip(&expected.epochs)
        .step_by(EVERY_S)
    {
        for i in 0..9 {
            let excess = 100.0 * (s.asee.0[i].value / e.asee.0[i].value - 1.0);
            asee = farther(asee, excess);
            if excess.abs() > AIM {
                within_from_s = e.t_s + EVERY_S as f64;
            }
            let z = (s.rmse.0[i].value - e.rmse.0[i].value) / s.rmse.0[i].std_error;
            (rmse, all, beyond) = (farther(rmse, z), all + 1, beyond + u32::from(z.abs() > 4.0));
            worst = farther(worst, 100.0 * (s.rmse.0[i].value / e.rmse.0[i].value - 1.0));
        }
        nees = farther(nees, (s.nees.value - e.nees.value) / s.nees.std_error);
        // where nearly nothing is left outside, one run more or less is the scatter
        let share = e.coverage.clamp(0.0, 1.0);
        let error = (share * (1.0 - share) / s.count as f64)
            .sqrt()
            .max(1.0 / s.count as f64);
        coverage = farther(coverage, (s.coverage - e.coverage) / error);
    }
    let quantiles = quantiles_at_ends(sampled, expected).fold(0.0, farther);
    format!(
        "{asee:+.2} | {within_from_s:.0} | {rmse:+.1} | {beyond} of {all} | {worst:+.1} | {nees:+.1} | {coverage:+.1} | {quantiles:+.1}"
    )
}

/// Runs whose horizontal error at an outage's end is below the expected p50 and p95: their number less its binomial mean, in
/// standard deviations.
fn quantiles_at_ends(sampled: &RunResult, expected: &ExpectedRun) -> impl Iterator<Item = f64> {
    let both = |(i, outage): (usize, &OutageSummary)| {
        [
            (0.5, outage.horizontal_error_end_m.p50),
            (0.95, outage.horizontal_error_end_m.p95),
        ]
        .map(|(p, quantile)| {
            let below = sampled
                .runs
                .iter()
                .filter(|r| r.outages[i].horizontal_error_end_m <= quantile)
                .count();
            let count = sampled.runs.len() as f64;
            (below as f64 - p * count) / (p * (1.0 - p) * count).sqrt()
        })
    };
    expected.summary.outages.iter().enumerate().flat_map(both)
}

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let runs: u64 = arguments.next().map_or(Ok(2000), |a| a.parse())?;
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let model = model_file::read(&here.join("calib_data/consumer_mems.toml"))?.model;
    let mut truths: Vec<(&str, &str, Model)> = BESIDE
        .iter()
        .map(|(case, settings)| (*case, *settings, model.clone()))
        .collect();
    for (case, kind, which) in STRONGER {
        truths.push((case, "", stronger(&model, kind, which)?));
    }
    let (wanted, mut names): (Vec<String>, Vec<String>) =
        arguments.partition(|a| truths.iter().any(|(case, _, _)| case == a));
    if names.is_empty() {
        names = ["land_vehicle", "figure_eight", "fixed_wing"]
            .map(str::to_owned)
            .to_vec();
    }
    println!("{runs} runs\n");
    println!(
        "| trajectory | truth | filter | ASEE, % | ASEE within {AIM} % from, s | RMSE, z | beyond 4 | RMSE, % | NEES, z | coverage, z | p50 and p95, z |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for name in &names {
        let file = here.join(format!("trajectories/{name}.toml"));
        let (trajectory, _) = trajectory_file::load(&file, None)?;
        for (seed, (case, settings, truth)) in (1..).zip(&truths) {
            if wanted.is_empty() || wanted.iter().any(|w| w == case) {
                compare(
                    (&trajectory, name),
                    (case, settings),
                    (&model, truth),
                    (runs, seed),
                )?;
            }
        }
    }
    Ok(())
}
