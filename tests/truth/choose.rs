//! The influence of a scale of the wavelet variance on the error after an outage, against brute force: the curve
//! changed, fitted again, covariance analysis of the new model.

use nav_sim::calibration::{Estimator, Group, ModelChoice, ModelSpec, Scope, Settings, fit_curve};
use nav_sim::choose::{Drive, Laboratory};
use nav_sim::prelude::*;
use nav_sim::signal::imu::Sensor;
use nav_sim::signal::noise::{Ar1, Composite, Model, Process, RandomWalk, White};
use nav_sim::signal::wavelet::Curve;

const RATE_HZ: f64 = 100.0;

fn n1(sigma2: f64, phi: f64, ar1: f64, gamma2: f64) -> Composite {
    Composite::new(vec![
        Process::White(White::new(sigma2).unwrap()),
        Process::Ar1(Ar1::new(phi, ar1).unwrap()),
        Process::RandomWalk(RandomWalk::new(gamma2).unwrap()),
    ])
}

/// A curve that the model does not describe exactly, as of some 4000 s.
fn curve(model: &Composite) -> Curve {
    let levels: Vec<u32> = (1..=17).collect();
    let wobble = |level: u32| 1.0 + 0.02 * (f64::from(level * level % 7) - 3.0);
    Curve {
        wv: levels
            .iter()
            .map(|l| model.haar_wv(*l) * wobble(*l))
            .collect(),
        edof: levels.iter().map(|l| f64::from(1 << (18 - l))).collect(),
        levels,
        ..Curve::default()
    }
}

/// Within 2 % of brute force wherever the influence is a twentieth of the largest or more.
#[test]
fn influence_in_navigation_is_that_of_brute_force() {
    let sensors = [
        (Sensor::Accel, curve(&n1(5e-5, 0.99, 5e-9, 3e-11))),
        (Sensor::Gyro, curve(&n1(1.5e-6, 0.999, 1e-11, 1.6e-13))),
    ];
    let settings = Settings {
        estimators: vec![Estimator::Awv],
        model: ModelChoice::Given(ModelSpec::n1()),
        rate_hz: RATE_HZ,
        ..Settings::default()
    };
    let group = |sensor| Group {
        scope: Scope { sensor, axis: None },
        replicates: Vec::new(),
    };
    let fitted = |sensor, curve: &Curve| {
        fit_curve(&group(sensor), Estimator::Awv, curve.clone(), &settings).unwrap()
    };
    let outcomes = sensors
        .clone()
        .map(|(sensor, curve)| fitted(sensor, &curve));
    let laboratory = Laboratory::new(Vec::new(), settings.clone(), None);
    let groups = sensors.clone().map(|(sensor, _)| group(sensor));
    for (name, start_s) in [
        ("figure_eight", 60.0),
        ("land_vehicle", 300.0),
        ("fixed_wing", 200.0),
    ] {
        let path = format!("trajectories/{name}.toml");
        let (trajectory, _) =
            load_trajectory(path.as_ref(), &TrajectoryOptions::default()).unwrap();
        let outage = Outage {
            start_s,
            end_s: start_s + 60.0,
        };
        let drive = Drive::new(&trajectory, Scenario::default(), vec![outage], RATE_HZ, 1).unwrap();
        let influence = drive
            .influence(&laboratory, &groups, &outcomes, &settings)
            .unwrap();
        let largest = influence
            .scales
            .iter()
            .map(|s| s.on_error.abs())
            .fold(0.0, f64::max);
        let mut compared = 0;
        for (at, scale) in influence.scales.iter().enumerate() {
            if scale.on_error.abs() < 0.05 * largest {
                continue;
            }
            let (of, level) = (at / 17, at % 17);
            let error = |by: f64| {
                let mut changed = sensors[of].1.clone();
                changed.wv[level] *= 1.0 + by;
                let again = fitted(sensors[of].0, &changed);
                let composites = [0, 1].map(|s| if s == of { &again } else { &outcomes[s] });
                let [accel, gyro] = composites.map(|o| &o.fit.composite);
                drive
                    .horizontal_rmse(&Model::pooled(RATE_HZ, accel, gyro))
                    .unwrap()
                    .ln()
            };
            let brute = (error(5e-3) - error(-5e-3)) / 1e-2;
            let off = (scale.on_error / brute - 1.0).abs();
            assert!(
                off < 0.02,
                "{name}, {} at {} s: {} against {brute}",
                scale.signals,
                scale.tau_s,
                scale.on_error
            );
            compared += 1;
        }
        assert!(
            compared >= 4,
            "{name}: {compared} of {}",
            influence.scales.len()
        );
    }
}
