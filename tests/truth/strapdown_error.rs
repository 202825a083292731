//! Integration error of the strapdown: covariance analysis has it as the runs do.

use crate::shared::*;
use nav_sim::app::Context;
use nav_sim::commands::run::{NavigateInputs, TrueImu, navigate};
use nav_sim::navigation::scenario::Method;

/// 300 s northwards at 15 m/s, roll and pitch of 3° at 1.5 Hz, a quarter of a period apart: coning, of which ten samples a
/// second see a part.
fn coning() -> Trajectory {
    let sample = |k: u32| {
        let t_s = 0.01 * f64::from(k);
        let (sin, cos) = (std::f64::consts::TAU * 1.5 * t_s).sin_cos();
        let angle = 3.0_f64.to_radians();
        TrajectorySample {
            t_s,
            lat: 0.8 + 15.0 * t_s / 6.37e6,
            lon: 0.1,
            h: 0.0,
            q_b_n: RollPitchYaw {
                roll: angle * sin,
                pitch: angle * cos,
                yaw: 0.0,
            }
            .to_quat(),
        }
    };
    Trajectory::from_samples(&(0..=30_000).map(sample).collect::<Vec<_>>()).unwrap()
}

/// At 10 Hz the heading runs away by several sigma; runs and covariance analysis agree on it, and the verdict is not
/// "consistent". At 100 Hz the strapdown makes no error that anyone could see.
#[test]
fn coning_that_the_rate_does_not_resolve_is_in_the_verdict() {
    let outages = [outage(150.0, 210.0)];
    let mut scenario = Scenario::default().with_full_noise();
    (scenario.run.method, scenario.run.runs) = (Method::Both, 32);
    let found = |rate_hz: f64| {
        let mut scenario = scenario.clone();
        scenario.imu.rate_hz = rate_hz;
        // of the same density at any rate
        let white = rate_hz / 100.0;
        let model = Model::pooled(
            rate_hz,
            &white_and_walk(white * 5e-5, 3e-11 / white),
            &white_and_walk(white * 1e-7, 1e-13 / white),
        );
        let inputs = NavigateInputs::new(coning(), model, TrueImu::AsBelieved);
        navigate(&inputs, &scenario, &outages, 5, &Context::default())
            .unwrap()
            .summary
    };
    let slow = found(10.0);
    let expected = slow.lincov.as_ref().unwrap();
    let (sampled, analysed) = (&slow.outages[0], &expected.outages[0]);
    for i in 0..9 {
        let off = sampled.rmse_end.0[i] - analysed.rmse_end.0[i];
        assert!(
            off.abs() < 5.0 * sampled.rmse_end_std_error.0[i],
            "state {i}: {off}"
        );
    }
    let verdict = &expected.verdict;
    assert_eq!(verdict.kind, VerdictKind::Overconfident, "{verdict:?}");
    let budget = slow.outages[0].budget.as_ref().unwrap();
    let (_, share) = budget
        .shares
        .iter()
        .find(|(name, _)| name == "strapdown")
        .unwrap();
    assert!(share.0[8] > 0.5, "{share:?}");
    let fast = found(100.0);
    let over_sigma = [slow.strapdown_over_sigma, fast.strapdown_over_sigma];
    assert!(over_sigma[0] > 1.0 && over_sigma[1] < 0.1, "{over_sigma:?}");
    assert_ne!(
        fast.lincov.unwrap().verdict.kind,
        VerdictKind::Overconfident
    );
}
