//! What errors of second order add to the NEES of a filter whose model is right, against runs.

use nav_sim::metrics::{Estimate, Expected};
use nav_sim::monte_carlo;
use nav_sim::noise::{Ar1, Composite, Model, Process, White};
use nav_sim::scenario::Scenario;
use nav_sim::sensors::imu::Truth;
use nav_sim::sensors::outage::Outage;
use nav_sim::simulation::OutageRecord;
use nav_sim::trajectory::Trajectory;
use nav_sim::trajectory::profile::{Bank, Kind, Length, Profile, Segment, Start};

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
    (runs.into_iter().map(|run| run.outages[0].clone()).collect(), expected.outages[0].second_order_nees)
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
