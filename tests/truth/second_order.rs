//! What attitude errors do to second order: to the vertical channel, and to the NEES of a filter whose model is right; against closed
//! forms and against runs.

use nav_sim::navigation::metrics::{Estimate, Expected, Summary};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::OutageRecord;
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::navigation::trajectory::profile::{Bank, Kind, Length, Profile, Segment, Start};
use nav_sim::prelude::{TrajectoryOptions, load_trajectory};
use nav_sim::signal::noise::{Ar1, Composite, Kind as Noise, Model, Process, White};
use nav_sim_navigation::simulation::lincov::{FilterPass, TruthSide};
use std::path::Path;

const RUNS: u64 = 300;
const OUTAGE: Outage = Outage { start_s: 0.0, end_s: 120.0 };
/// Tilt and heading at the start (1 σ, °): those of `Scenario::default`.
const TILT: f64 = 0.5;
const HEADING: f64 = 2.0;

/// Two minutes at rest and a fix.
fn standing() -> Trajectory {
    let start = Start { t_s: 0.0, lat: 0.8, lon: 0.1, h: 300.0, heading: 0.7, speed: 0.0 };
    let segments =
        vec![Segment { kind: Kind::Straight(Length::Duration(121.0)), climb_m: 0.0, ramp_s: None }];
    Profile { start, bank: Bank::None, ramp_s: 1.0, segments }.build().unwrap()
}

/// An IMU so quiet that velocity and position follow from the attitude of the start: what is left of them once that is
/// known is small, and so is what its product must exceed to be seen.
fn quiet() -> Model {
    let axis = |sigma2: f64, innovation: f64| {
        Composite::new(vec![
            Process::White(White::new(sigma2).unwrap()),
            Process::Ar1(Ar1::new(0.9999, innovation).unwrap()),
        ])
    };
    Model::pooled(100.0, &axis(5.4e-7, 1e-13), &axis(2e-10, 4e-18))
}

/// What the outage's end has in each run, and what is predicted there, for a heading known so well.
fn outage(heading_deg: f64) -> (Vec<OutageRecord>, f64) {
    let scenario: Scenario =
        toml::from_str(&format!("initial.att_sigma_deg = [{TILT:?}, {TILT:?}, {heading_deg:?}]")).unwrap();
    let (path, model, outages) = (standing(), quiet(), [OUTAGE]);
    let track = scenario.track(&path, &model, &outages).unwrap();
    let beliefs = [scenario.belief(&model, &outages, &track).unwrap()];
    let experiment = scenario.experiment(&path, Truth::Model(&model), &beliefs, &outages, 7);
    let runs = monte_carlo::run(&experiment, RUNS, &|_| {}).unwrap().remove(0).runs;
    let expected = Expected::along(&track, &experiment, &beliefs[0], &model).unwrap().summary();
    (runs.into_iter().map(|run| run.outages[0].clone()).collect(), expected.outages[0].second_order.nees)
}

/// The same draws with a heading of 2° and of 0.01°: all else, also what the tilts alone shift downwards, is in both, so that
/// the difference of the NEES is what heading error times tilt adds. Run by run that is proportional to ψ_d² (ψ_n² + ψ_e²), of
/// mean 2 σ_d² σ²: the prediction times this share, within 3.5 standard errors of what remains (a product of first and second
/// order, of mean 0). The prediction is of the last epoch, a second before the end, until which u grows as t² at most
/// and uᵀP⁻¹u as t⁴, (120/119)⁴. Next orders are σ_d² = 0.1 % of it.
#[test]
fn heading_error_times_tilt_adds_to_the_nees_what_is_predicted() {
    let ((with, predicted), (without, nothing)) = (outage(HEADING), outage(0.01));
    assert!(predicted > 50.0 && nothing < 0.01, "{predicted} {nothing}");
    let share = |end: &OutageRecord| {
        let [roll, pitch, yaw] = [6, 7, 8].map(|state| end.error_end[state]);
        yaw * yaw * (roll * roll + pitch * pitch) / (2.0 * HEADING * HEADING * TILT * TILT)
    };
    let pairs = || with.iter().zip(&without);
    let rest = pairs().map(|(with, without)| with.nees_end - without.nees_end - predicted * share(with));
    let rest = Estimate::mean_of(rest, None);
    let share = Estimate::mean_of(with.iter().map(share), None);
    println!("predicted {predicted} × {share:?}, beside it {rest:?}");
    // how far the shares themselves are from 1: the tilts and headings are those that the prediction is made of
    assert!((share.value - 1.0).abs() < 3.5 * share.std_error, "{share:?}");
    let to_the_end = ((120.0_f64 / 119.0).powi(4) - 1.0) * predicted * share.value;
    let slack = 3.5 * rest.std_error;
    assert!(-slack < rest.value && rest.value < slack + to_the_end, "{rest:?} beside {predicted}");
    assert!(slack < 0.06 * predicted, "{rest:?} tells nothing of {predicted}");
}

/// Position and velocity down among the reported states.
const DOWN: [usize; 2] = [2, 5];

/// Two tilts of variance σ² that stand still for T shift the velocity down by ½gT(ψ_n² + ψ_e²), of mean square 2(gTσ²)², and the
/// position down by a quarter of gT² in place of the half of gT: ½(gT²σ²)². A filter that is right states as much more. Tilts
/// are turned by the Earth's rate and by the velocity that they make, by ω T = 1.5e-3 and gT²/2R = 3e-4 of themselves, and the square hardly.
#[test]
fn tilts_that_stand_still_in_closed_form() {
    let scenario: Scenario =
        toml::from_str(&format!("initial.att_sigma_deg = [{TILT:?}, {TILT:?}, 0.01]")).unwrap();
    let seconds = 20.0;
    let outages = [Outage { start_s: 0.0, end_s: seconds }];
    let (path, model) = (standing(), quiet());
    let track = scenario.track(&path, &model, &outages).unwrap();
    let belief = scenario.belief(&model, &outages, &track).unwrap();
    let beliefs = [belief];
    let experiment = scenario.experiment(&path, Truth::Model(&model), &beliefs, &outages, 1);
    let end = &Expected::along(&track, &experiment, &beliefs[0], &model).unwrap().outages[0];
    let sources = TruthSide::together(&TruthSide::sources(&experiment, &model));
    let linear = FilterPass::new(&track, &beliefs[0]).errors(&sources).outage_ends[0];
    let shift = 9.807 * seconds * TILT.to_radians().powi(2);
    let squares = [(shift * seconds).powi(2) / 2.0, 2.0 * shift.powi(2)];
    for (i, square) in DOWN.into_iter().zip(squares) {
        for (with, without) in [(end.rmse_end, linear.errors.rmse()), (end.asee_end, linear.sigma())] {
            let added = with.0[i].value.powi(2) - without[i].powi(2);
            assert!((added / square - 1.0).abs() < 2e-3, "state {i}: {added} of {square}");
        }
    }
}

/// The consumer IMU with a slow gyroscope process of twice the standard deviation, as the filter believes it to be, 90 s without
/// fixes: the filters of runs state more of the velocity down than the one along the reference, by what the analysis says, which
/// holds their mean to half a per cent. Its linear part alone does not.
#[test]
fn the_filters_of_runs_state_what_is_expected_of_the_vertical_channel() {
    let outages = [Outage { start_s: 300.0, end_s: 390.0 }];
    let scenario = Scenario::default();
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = here.join("trajectories/land_vehicle.toml");
    let path = load_trajectory(&path, &TrajectoryOptions::default()).unwrap().0;
    let mut model =
        nav_sim::formats::model_file::read(&here.join("calib_data/consumer_mems.toml")).unwrap().model;
    for axis in &mut model.axes[3..] {
        let slow = axis.processes.iter_mut().filter(|process| process.kind() == Noise::Ar1).nth(1).unwrap();
        let sigma2 = 4.0 * slow.values()[1];
        *slow = slow.with_parameter("sigma2", sigma2, model.rate_hz).unwrap().unwrap();
    }
    let track = scenario.track(&path, &model, &outages).unwrap();
    let beliefs = [scenario.with_full_noise().belief(&model, &outages, &track).unwrap()];
    let experiment = scenario.experiment(&path, Truth::Model(&model), &beliefs, &outages, 3);
    let sampled = monte_carlo::run(&experiment, RUNS, &|_| {}).unwrap().remove(0);
    let epochs = nav_sim::navigation::metrics::epochs(&sampled);
    let sampled = &Summary::of(&sampled, &epochs, 3).outages[0];
    let expected = &Expected::along(&track, &experiment, &beliefs[0], &model).unwrap().outages[0];
    let linear = FilterPass::new(&track, &beliefs[0]).sigma_at_ends()[0];
    for i in 0..9 {
        let runs = sampled.asee_end.0[i];
        let excess = runs / expected.asee_end.0[i].value - 1.0;
        let slack = 3.5 * sampled.asee_end_std_error.0[i] / runs;
        assert!(excess.abs() < 5e-3 + slack, "state {i}: {excess} ± {}", slack / 3.5);
        let z = (sampled.rmse_end.0[i] - expected.rmse_end.0[i].value) / sampled.rmse_end_std_error.0[i];
        assert!(z.abs() < 4.0, "state {i}: {z} standard errors");
        let excess = runs / linear[i] - 1.0;
        assert!(i != 5 || excess > 1e-2 + slack, "velocity down: {excess} ± {}", slack / 3.5);
    }
}

/// The consumer IMU at rest with fixes: the filters of runs take their errors of the specific force for accelerations and believe to learn
/// the heading from them, by which they state 1 % less of it after 15 s than the filter along the reference. The analysis has their
/// mean to half a per cent, in every state; also where more makes tilts than the filter believes in, and where a bias and the tilt
/// that stands for it cancel.
#[test]
fn the_filters_of_runs_state_what_is_expected_while_they_settle() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let model =
        nav_sim::formats::model_file::read(&here.join("calib_data/consumer_mems.toml")).unwrap().model;
    let mut noisy = model.clone();
    for axis in &mut noisy.axes {
        let white = axis.processes.iter_mut().find(|process| process.kind() == Noise::White).unwrap();
        let sigma2 = 4.0 * white.values()[0];
        *white = white.with_parameter("sigma2", sigma2, model.rate_hz).unwrap().unwrap();
    }
    let turn_on = "imu = { turn_on_bias_accel_m_s2 = 0.05, turn_on_bias_gyro_rad_s = 2e-4 }";
    for (settings, truth) in [("", &model), ("", &noisy), (turn_on, &model)] {
        state_what_is_expected(&toml::from_str(settings).unwrap(), &model, truth);
    }
}

fn state_what_is_expected(scenario: &Scenario, model: &Model, truth: &Model) {
    let path = standing();
    let track = scenario.track(&path, model, &[]).unwrap();
    let beliefs = [scenario.with_full_noise().belief(model, &[], &track).unwrap()];
    let experiment = scenario.experiment(&path, Truth::Model(truth), &beliefs, &[], 3);
    let sampled = monte_carlo::run(&experiment, RUNS, &|_| {}).unwrap().remove(0);
    let expected = Expected::along(&track, &experiment, &beliefs[0], truth).unwrap().epochs;
    let sources = TruthSide::together(&TruthSide::sources(&experiment, truth));
    let linear = FilterPass::new(&track, &beliefs[0]).errors(&sources).reports;
    let epochs = nav_sim::navigation::metrics::epochs(&sampled);
    for (second, (sampled, expected)) in epochs.iter().zip(&expected).enumerate() {
        for i in 0..9 {
            let runs = sampled.asee.0[i];
            let slack = 3.5 * runs.std_error / runs.value;
            let excess = runs.value / expected.asee.0[i].value - 1.0;
            assert!(excess.abs() < 5e-3 + slack, "{second} s, state {i}: {excess}");
            if (second, i) == (15, 8) {
                let excess = runs.value / linear[second].sigma()[i] - 1.0;
                assert!(excess < -5e-3 - slack, "yaw: {excess} ± {}", slack / 3.5);
            }
        }
    }
}
