//! Measurements of a vehicle by itself: closed forms, and runs beside the covariance analysis.

use super::Scenario;
use crate::ekf::FilterStates;
use crate::monte_carlo::run;
use crate::noise::{Composite, Model, Process};
use crate::sensors::aiding::{
    AidingSettings, HeadingErrors, HeadingSettings, HeadingSource, NhcErrors, NhcSettings,
    OdometerErrors, OdometerSettings, ZuptErrors, ZuptSettings,
};
use crate::sensors::imu::Truth;
use crate::sensors::outage::Outage;
use crate::simulation::REPORTED;
use crate::simulation::lincov::{FilterPass, Judged, Track, TruthSide};
use crate::trajectory::Trajectory;
use crate::trajectory::profile::{
    Acceleration, Bank, Length, Profile, ProfileStart, Segment, SegmentKind, Turning,
};
use crate::units::DEG;

const RATE_HZ: f64 = 50.0;
pub(crate) const OUTAGE: Outage = Outage {
    start_s: 30.0,
    end_s: 85.0,
};

fn drive(speed: f64, kinds: Vec<SegmentKind>) -> Trajectory {
    let start = ProfileStart {
        t_s: 0.0,
        lat: 0.8,
        lon: 0.1,
        h: 400.0,
        heading: 40.0 * DEG,
        speed,
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
        ramp_s: 2.0,
        segments,
    }
    .build()
    .unwrap()
}

/// A street with bends, a stop from 44 s to 58 s, and a way on.
pub(crate) fn town() -> Trajectory {
    let straight = |s: f64| SegmentKind::Straight(Length::Duration(s));
    let accelerate = |to_speed: f64, s: f64| SegmentKind::Accelerate {
        to_speed,
        by: Acceleration::Duration(s),
    };
    let turn = |deg: f64, s: f64| SegmentKind::Turn {
        angle: deg * DEG,
        by: Turning::Duration(s),
    };
    let kinds = vec![
        turn(70.0, 12.0),
        straight(10.0),
        turn(-120.0, 14.0),
        accelerate(0.0, 8.0),
        straight(14.0),
        accelerate(16.0, 10.0),
        turn(50.0, 10.0),
        straight(12.0),
    ];
    drive(13.0, kinds)
}

/// What makes the errors of runs, and a filter with a state for each process knows.
pub(crate) fn consumer() -> Model {
    model([2e-5, 5e-7], [0.01, 1e-4])
}

fn model(white: [f64; 2], bias: [f64; 2]) -> Model {
    let axis = |white: f64, deviation: f64| {
        let phi = (-1.0 / (RATE_HZ * 200.0)).exp();
        let bias = Process::ar1(phi, deviation * deviation * (1.0 - phi * phi)).unwrap();
        Composite::new(vec![Process::white(white).unwrap(), bias])
    };
    Model::pooled(RATE_HZ, &axis(white[0], bias[0]), &axis(white[1], bias[1]))
}

pub(crate) fn scenario(aiding: AidingSettings) -> Scenario {
    let mut scenario = Scenario {
        aiding,
        ..Scenario::default()
    };
    scenario.imu.rate_hz = RATE_HZ;
    scenario.filter.states = FilterStates::Full;
    scenario.initial.att_sigma_deg = [0.2, 0.2, 0.5];
    scenario.validate().unwrap();
    scenario
}

/// Errors and beliefs at the end of the outage by the covariance analysis, and the root mean squares of errors and the
/// mean stated deviations of `runs` runs there.
fn both(scenario: &Scenario, runs: u64) -> (Judged, [[f64; REPORTED]; 2]) {
    let (trajectory, model) = (town(), consumer());
    let outages = [OUTAGE];
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let beliefs = [scenario.belief(&model, &outages, &track).unwrap()];
    let experiment = scenario.experiment(&trajectory, Truth::Model(&model), &beliefs, &outages, 5);
    let truth = TruthSide::together(&TruthSide::sources(&experiment, &model));
    let judged = FilterPass::new(&track, &beliefs[0])
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
    let nhc = |mounting_sigma_deg, truth| {
        let lever_arm_m = [-0.15, 0.3, 0.5];
        Some(NhcSettings {
            mounting_sigma_deg,
            lever_arm_m,
            truth,
            ..NhcSettings::default()
        })
    };
    let wheel = |scale_sigma, truth| {
        Some(OdometerSettings {
            scale_sigma,
            truth,
            ..OdometerSettings::default()
        })
    };
    let mounted = NhcErrors {
        mounting_sigma_deg: 0.5,
        ..NhcErrors::default()
    };
    let moving = NhcErrors {
        noise_sigma_m_s: Some(0.02),
        sideslip_s2_m: 0.004,
        walk_sigma_m_s: 0.08,
        correlation_time_s: 3.0,
        ..NhcErrors::default()
    };
    let scaled = OdometerErrors {
        scale_sigma: 0.01,
        ..OdometerErrors::default()
    };
    let slips = OdometerErrors {
        slip_s2_m: 0.005,
        noise_sigma_m_s: Some(0.01),
        scale_sigma: 0.005,
    };
    let creeping = ZuptErrors {
        walk_sigma_m_s: 0.1,
        ..ZuptErrors::default()
    };
    let turned = HeadingErrors {
        offset_sigma_deg: 0.6,
        walk_sigma_deg: 0.5,
        ..HeadingErrors::default()
    };
    let none = AidingSettings::default;
    let zupt = |truth| {
        Some(ZuptSettings {
            truth,
            ..ZuptSettings::default()
        })
    };
    let heading = |truth| {
        Some(HeadingSettings {
            truth,
            ..HeadingSettings::default()
        })
    };
    let antennas = |truth| {
        let source = HeadingSource::Antennas;
        Some(HeadingSettings {
            source,
            truth,
            ..HeadingSettings::default()
        })
    };
    let cases = [
        (
            "nhc",
            AidingSettings {
                nhc: nhc(0.0, NhcErrors::default()),
                ..none()
            },
        ),
        (
            "nhc, mounting unknown",
            AidingSettings {
                nhc: nhc(0.0, mounted.clone()),
                ..none()
            },
        ),
        (
            "nhc, mounting a state",
            AidingSettings {
                nhc: nhc(0.5, mounted),
                ..none()
            },
        ),
        (
            "nhc, slip and suspension",
            AidingSettings {
                nhc: nhc(0.0, moving),
                ..none()
            },
        ),
        (
            "odometer",
            AidingSettings {
                odometer: wheel(0.0, OdometerErrors::default()),
                ..none()
            },
        ),
        (
            "odometer, scale a state",
            AidingSettings {
                odometer: wheel(0.01, scaled),
                ..none()
            },
        ),
        (
            "odometer, scale and slip unknown",
            AidingSettings {
                odometer: wheel(0.0, slips),
                ..none()
            },
        ),
        (
            "zupt",
            AidingSettings {
                zupt: zupt(ZuptErrors::default()),
                ..none()
            },
        ),
        (
            "zupt, creeping",
            AidingSettings {
                zupt: zupt(creeping),
                ..none()
            },
        ),
        (
            "heading",
            AidingSettings {
                heading: heading(HeadingErrors::default()),
                ..none()
            },
        ),
        (
            "heading, turned",
            AidingSettings {
                heading: heading(turned.clone()),
                ..none()
            },
        ),
        (
            "heading, of antennas",
            AidingSettings {
                heading: antennas(turned),
                ..none()
            },
        ),
    ];
    let runs = 400;
    let free = both(&scenario(none()), runs).0.errors.rmse();
    // what a filter leaves out may harm it
    let is_unknown = |name: &str| name.contains(',') && !name.ends_with("a state");
    for (name, aiding) in cases {
        let (judged, [rms, see]) = both(&scenario(aiding), runs);
        let (expected, sigma) = (judged.errors.rmse(), judged.sigma());
        for i in 0..REPORTED {
            let ratio = rms[i] / expected[i];
            assert!(
                (ratio - 1.0).abs() < 4.0 / (2.0 * runs as f64).sqrt(),
                "{name}, state {i}: {ratio}"
            );
            assert!(
                (see[i] / sigma[i] - 1.0).abs() < 0.02,
                "{name}, state {i}: {} {}",
                see[i],
                sigma[i]
            );
        }
        let horizontal = |x: [f64; REPORTED]| x[0].hypot(x[1]);
        assert!(
            is_unknown(name) || horizontal(expected) < horizontal(free),
            "{name} is of use"
        );
    }
}

/// On a straight road a filter that follows a wheel drifts along the track by scale × distance.
#[test]
fn the_scale_of_a_wheel_moves_a_position_along_the_track() {
    let (speed, seconds) = (20.0, 60.0);
    let trajectory = drive(speed, vec![SegmentKind::Straight(Length::Duration(100.0))]);
    let odometer = OdometerSettings {
        rate_hz: 10.0,
        sigma_m_s: 0.001,
        truth: OdometerErrors {
            scale_sigma: 0.01,
            ..OdometerErrors::default()
        },
        ..OdometerSettings::default()
    };
    let scenario = scenario(AidingSettings {
        odometer: Some(odometer),
        ..AidingSettings::default()
    });
    // No fix before, which would contradict the wheel.
    let outages = [Outage {
        start_s: 0.5,
        end_s: seconds,
    }];
    // A loud accelerometer: the wheel alone says how fast the vehicle is.
    let model = model([1.0, 1e-12], [1e-3, 1e-6]);
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let beliefs = [scenario.belief(&model, &outages, &track).unwrap()];
    let experiment = scenario.experiment(&trajectory, Truth::Model(&model), &beliefs, &outages, 5);
    let sources = TruthSide::sources(&experiment, &model);
    let wheel = sources
        .iter()
        .find(|source| source.name == "aiding.odometer.scale")
        .unwrap();
    let errors = FilterPass::new(&track, &beliefs[0]).errors_at_ends(&wheel.side)[0].errors;
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

/// At rest a velocity error is a random walk of variance q a second, measured every second with variance r: its variance
/// after a measurement settles at (√(q² + 4 q r) − q)/2, the root of P = (P + q) r/(P + q + r).
#[test]
fn zero_velocity_at_rest_has_the_steady_state_of_the_scalar_filter() {
    let trajectory = drive(0.0, vec![SegmentKind::Straight(Length::Duration(120.0))]);
    let zupt = Some(ZuptSettings {
        sigma_m_s: 0.03,
        ..ZuptSettings::default()
    });
    let mut scenario = scenario(AidingSettings {
        zupt,
        ..AidingSettings::default()
    });
    scenario.initial.att_sigma_deg = [1e-9; 3];
    let outages = [Outage {
        start_s: 1.0,
        end_s: 119.5,
    }];
    let white = 1e-3;
    let model = model([white, 1e-20], [1e-9, 1e-12]);
    let track: Track = scenario.track(&trajectory, &model, &outages).unwrap();
    let belief = scenario.belief(&model, &outages, &track).unwrap();
    let judged = &FilterPass::new(&track, &belief)
        .errors(&TruthSide::default())
        .reports[118];
    // a sample's variance, times its interval squared, at fifty samples a second
    let (q, r) = (white / RATE_HZ, 0.03_f64.powi(2));
    let expected = (0.5 * ((q * q + 4.0 * q * r).sqrt() - q)).sqrt();
    for (i, sigma) in judged.sigma().into_iter().enumerate().skip(3).take(3) {
        assert!(
            (sigma / expected - 1.0).abs() < 1e-3,
            "axis {i}: {sigma} {expected}"
        );
    }
}

/// A filter that has a state for the error that there is states its errors: a NEES of nine; without, it is overconfident.
#[test]
fn a_state_for_the_wheel_keeps_a_filter_honest() {
    let truth = OdometerErrors {
        scale_sigma: 0.02,
        ..OdometerErrors::default()
    };
    let nees = |scale_sigma| {
        let odometer = Some(OdometerSettings {
            scale_sigma,
            truth: truth.clone(),
            ..OdometerSettings::default()
        });
        let scenario = scenario(AidingSettings {
            odometer,
            ..AidingSettings::default()
        });
        both(&scenario, 1).0.consistency().nees
    };
    assert!((nees(0.02) - 9.0).abs() < 1e-6, "{}", nees(0.02));
    assert!(nees(0.0) > 20.0, "{}", nees(0.0));
}

/// A vehicle that moves sideways by itself is no road vehicle.
#[test]
fn a_constraint_that_the_reference_does_not_keep_is_refused() {
    // a point ten metres to the front swings outwards in every turn
    let nhc = Some(NhcSettings {
        lever_arm_m: [10.0, 0.0, 0.0],
        ..NhcSettings::default()
    });
    let scenario = scenario(AidingSettings {
        nhc,
        ..AidingSettings::default()
    });
    let error = scenario.track(&town(), &consumer(), &[]).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("aiding.nhc.sigma_m_s = 0.2: the reference itself"),
        "{error}"
    );
}
