//! The smoother of `fuse`: a closed form at rest, consistency over simulated recordings, and identities.

use crate::common::drive::{DRIVE, MODEL, place_with};
use crate::fusion::{belief, model, recorded, run, settings, shipped};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use nav_sim::io::trajectory_file;
use nav_sim::navigation::ekf::{Belief, FilterStates, InitialSettings};
use nav_sim::navigation::fusion::{FixCounts, FusionError, Row, Settings, Start, fuse, outcome};
use nav_sim::navigation::fusion::{Recorded, Solution};
use nav_sim::navigation::gnss::GnssFix;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::gnss::GnssSettings;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{Plan, SimulatedRecording as Recording, record};
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::noise::{Composite, Model, Process};
use nav_sim_navigation::earth::radii;
use statrs::distribution::{ChiSquared, ContinuousCDF};

const OUTAGE: Outage = Outage {
    start_s: 300.0,
    end_s: 390.0,
};

fn smoothing() -> Settings {
    Settings {
        smooth: true,
        outages: vec![OUTAGE],
        ..settings()
    }
}

fn rows(solution: &Solution) -> &[Row] {
    solution.smoothed.as_ref().unwrap()
}

/// White acceleration of power q and position fixes: a platform at rest whose attitude is known. Position is then an
/// integrated Wiener process, its covariance closed, and what all fixes together say of it one linear solution.
///
/// What the Earth adds is not in the closed form: Coriolis, 1e-4 /s, and Schuler's frequency, 1.2e-3 /s, over the
/// 20 s between the fixes on either side of the outage and twice the correlation time of the filter beside it (10 s):
/// (1.2e-3 · 40)²/2 = 1.2e-3 of a deviation. Twice that is allowed.
#[test]
fn at_rest_the_smoothed_position_is_the_closed_form_of_an_integrated_wiener_process() {
    const SIGMA2: f64 = 1.0;
    const Q: f64 = SIGMA2 * 0.01;
    const ALLOWED: f64 = 2.5e-3;
    let place = place_with(
        "start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }\n\
         segment = [{ kind = \"straight\", duration_s = 60 }]",
        MODEL,
    );
    let trajectory = trajectory_file::load(&place.path().join("drive.toml"), None)
        .unwrap()
        .0;
    let free = Model {
        rate_hz: 100.0,
        axes: Default::default(),
    };
    let white = Composite::new(vec![Process::white(SIGMA2).unwrap()]);
    let believed = Model::pooled(100.0, &white, &Composite::new(Vec::new()));
    let belief = Belief::new(&believed, FilterStates::Full, 1.0, 800.0).unwrap();
    let truth = trajectory.state(trajectory.start_s());
    let sigma = InitialSettings {
        pos_sigma_m: [2.0; 3],
        vel_sigma_m_s: [0.5; 3],
        att_sigma_deg: [1e-9; 3],
        ..InitialSettings::default()
    };
    let start = Start {
        t_s: trajectory.start_s(),
        state: truth,
        sigma,
        found: None,
    };
    // fixes between the samples too, without a pattern, north and east each its own
    let times: Vec<f64> = (1..60)
        .filter(|k| !(20..40).contains(k))
        .map(|k| f64::from(k) + 0.0037)
        .collect();
    let offset = |k: usize, axis: usize| ((k * 7 + axis * 5 + k * k) % 11) as f64 * 0.4 - 2.0;
    let r = radii(truth.lat.sin());
    let fix = |(k, t_s): (usize, &f64)| GnssFix {
        t_s: *t_s,
        lat: truth.lat + offset(k, 0) / (r.meridian + truth.h),
        lon: truth.lon + offset(k, 1) / ((r.transverse + truth.h) * truth.lat.cos()),
        h: truth.h,
        pos_sigma_n: DVec3::splat(1.5),
        velocity: None,
    };
    let gnss: Vec<GnssFix> = times.iter().enumerate().map(fix).collect();
    let reference = trajectory.clone().into();
    let smooth = Settings {
        smooth: true,
        ..settings()
    };
    let mut solution = Solution::default();
    recorded(
        &trajectory,
        &free,
        &GnssSettings::default(),
        1,
        |recording, _| {
            let recorded = Recorded {
                imu: &recording.imu,
                gnss: &gnss,
                aids: &[],
            };
            solution = fuse(&recorded, &belief, &start, &smooth, Some(&reference)).unwrap();
        },
    );
    // covariance of positions at two times: the start, and ∫∫ of white acceleration
    let prior = |a: f64, b: f64| {
        let (s, t) = (a.min(b), a.max(b));
        4.0 + 0.25 * a * b + Q * (s * s * t / 2.0 - s * s * s / 6.0)
    };
    let n = times.len();
    let all = DMatrix::from_fn(n, n, |i, j| {
        prior(times[i], times[j]) + if i == j { 2.25 } else { 0.0 }
    });
    let inverse = all.try_inverse().unwrap();
    let mut worst = [0.0_f64; 2];
    for row in rows(&solution) {
        let with = DVector::from_fn(n, |i, _| prior(row.t_s, times[i]));
        let sigma = (prior(row.t_s, row.t_s) - (with.transpose() * &inverse * &with)[0]).sqrt();
        for axis in 0..2 {
            let z = DVector::from_fn(n, |k, _| offset(k, axis));
            let mean = (with.transpose() * &inverse * z)[0];
            worst[0] = worst[0].max((row.sigma[axis] / sigma - 1.0).abs());
            worst[1] = worst[1].max((row.error.unwrap().values[axis] - mean).abs() / sigma);
        }
    }
    println!(
        "closed form: deviation {:.1e}, mean {:.1e} of a deviation",
        worst[0], worst[1]
    );
    assert!(worst.iter().all(|w| *w < ALLOWED), "{worst:?}");
}

/// A simulated experiment: what makes the errors, and what the filter expects.
struct Experiment {
    name: &'static str,
    states: FilterStates,
    scenario: &'static str,
    biases: &'static [[(f64, f64); 2]],
}

const EXPERIMENTS: [Experiment; 3] = [
    Experiment {
        name: "15",
        states: FilterStates::Reduced15,
        scenario: "gnss.lever_arm_m = [0.8, -0.3, -1.2]",
        biases: &[[(5e-4, 200.0), (5e-6, 300.0)]],
    },
    Experiment {
        name: "21 and turn-on biases",
        states: FilterStates::Reduced21,
        scenario: "imu = { turn_on_bias_accel_m_s2 = 0.02, turn_on_bias_gyro_rad_s = 1e-4, scale_ppm_accel = 300, scale_ppm_gyro = 300 }\n\
                   initial = { accel_bias_sigma_m_s2 = 0.02, gyro_bias_sigma_rad_s = 1e-4 }\n\
                   gnss.vel_sigma_m_s = \"none\"",
        biases: &[[(5e-4, 200.0), (5e-6, 300.0)]],
    },
    Experiment {
        name: "full",
        states: FilterStates::Full,
        scenario: "",
        biases: &[[(5e-4, 200.0), (5e-6, 300.0)], [(1e-3, 2.0), (1e-5, 5.0)]],
    },
];

/// White noise and Gauss-Markov biases of these standard deviations and correlation times (s), at 100 Hz.
fn axis(white: f64, biases: impl Iterator<Item = (f64, f64)>) -> Composite {
    let ar1 = |(sigma, t_corr_s): (f64, f64)| {
        let phi = (-0.01 / t_corr_s).exp();
        Process::ar1(phi, sigma * sigma * (1.0 - phi * phi)).unwrap()
    };
    Composite::new(
        std::iter::once(Process::white(white).unwrap())
            .chain(biases.map(ar1))
            .collect(),
    )
}

impl Experiment {
    /// Its recordings, fused and smoothed.
    fn solutions(&self, trajectory: &Trajectory, runs: u64) -> Vec<Solution> {
        let of = |i: usize| self.biases.iter().map(move |pair| pair[i]);
        let model = Model::pooled(100.0, &axis(1e-5, of(0)), &axis(1e-8, of(1)));
        let scenario: Scenario = toml::from_str(self.scenario).unwrap();
        assert_eq!(scenario.validate(), Ok(()));
        let belief = Belief::new(&model, self.states, 1.0, 800.0)
            .unwrap()
            .with_initial(&scenario.initial);
        let experiment = scenario.experiment(trajectory, Truth::Model(&model), &[], &[], 23);
        let plan = Plan::new(&experiment).unwrap();
        let settings = Settings {
            lever_arm_b: scenario.gnss.lever_arm_m.into(),
            ..smoothing()
        };
        let reference = trajectory.clone().into();
        let solution = |run: u64| {
            let Recording {
                imu, gnss, start, ..
            } = record(&plan, run);
            let sigma = scenario.initial.clone();
            let start = Start {
                t_s: trajectory.start_s(),
                state: start,
                sigma,
                found: None,
            };
            fuse(
                &Recorded {
                    imu: &imu,
                    gnss: &gnss,
                    aids: &[],
                },
                &belief,
                &start,
                &settings,
                Some(&reference),
            )
            .unwrap()
        };
        (0..runs).map(solution).collect()
    }
}

/// Over recordings made from what each filter believes: the sum of the NEES of smoothed rows is chi-square of nine
/// degrees a run at every look (two-sided 1e-4 each), what smoothing changes is as large as the covariances say (the
/// variance of filter less smoother is the difference of theirs), every state is nearer to the truth, and in an outage
/// more so than outside; the farthest is in the middle of the outage, where the filter's is at its end.
#[test]
fn smoothed_errors_are_as_large_as_stated_and_smaller_than_the_filter_s() {
    const RUNS: u64 = 8;
    let looks = [3, 120, 320, 345, 380, 500, 700, 880];
    let trajectory = shipped("land_vehicle.toml");
    for experiment in &EXPERIMENTS {
        let solutions = experiment.solutions(&trajectory, RUNS);
        let inside = |sum: f64, dof: f64, what: &str, p_least: f64| {
            let p = ChiSquared::new(dof).unwrap().cdf(sum);
            assert!(
                (p_least..=1.0 - p_least).contains(&p),
                "{}, {what}: {sum} of {dof}: p = {p}",
                experiment.name
            );
        };
        for look in looks {
            let nees = solutions
                .iter()
                .map(|s| rows(s)[look].error.unwrap().nees)
                .sum::<f64>();
            inside(nees, 9.0 * RUNS as f64, &format!("NEES at {look} s"), 1e-4);
            for state in 0..9 {
                let change = |s: &Solution| {
                    let (f, s) = (&s.rows[look], &rows(s)[look]);
                    let moved = f.error.unwrap().values[state] - s.error.unwrap().values[state];
                    moved.powi(2) / (f.sigma[state].powi(2) - s.sigma[state].powi(2))
                };
                let sum = solutions.iter().map(change).sum::<f64>();
                inside(
                    sum,
                    RUNS as f64,
                    &format!("change of state {state} at {look} s"),
                    1e-5,
                );
            }
        }
        let mean_square = |rows: &dyn Fn(&Solution) -> Vec<Row>, of: &dyn Fn(&Row) -> f64| {
            let all: Vec<f64> = solutions
                .iter()
                .flat_map(rows)
                .map(|row| of(&row).powi(2))
                .collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        let ratio = |within: &dyn Fn(&Row) -> bool, of: &dyn Fn(&Row) -> f64| {
            let some = |all: &[Row]| {
                all.iter()
                    .filter(|row| within(row))
                    .cloned()
                    .collect::<Vec<_>>()
            };
            (mean_square(&|s| some(rows(s)), of) / mean_square(&|s| some(&s.rows), of)).sqrt()
        };
        let ratios: Vec<f64> = (0..9)
            .map(|i| ratio(&|_| true, &|row| row.error.unwrap().values[i]))
            .collect();
        assert!(
            ratios.iter().all(|r| *r < 1.0),
            "{}: {ratios:?}",
            experiment.name
        );
        let horizontal =
            |row: &Row| row.error.unwrap().values[0].hypot(row.error.unwrap().values[1]);
        let [within, outside] =
            [true, false].map(|is| ratio(&|row| OUTAGE.withholds(row.t_s) == is, &horizontal));
        assert!(within < outside, "{}: {within} {outside}", experiment.name);
        let farthest = |rows: &[Row]| {
            let rows = rows.iter().filter(|row| OUTAGE.withholds(row.t_s));
            rows.max_by(|a, b| {
                a.sigma[0]
                    .hypot(a.sigma[1])
                    .total_cmp(&b.sigma[0].hypot(b.sigma[1]))
            })
            .unwrap()
            .t_s
        };
        for solution in &solutions {
            assert!((OUTAGE.end_s - farthest(&solution.rows)).abs() < 1.5);
            assert!(
                (345.0 - farthest(rows(solution))).abs() < 15.0,
                "{}",
                farthest(rows(solution))
            );
        }
        println!(
            "{}: RMSE smoothed over filter {ratios:.2?}; in the outage {within:.2}",
            experiment.name
        );
    }
}

/// Identities: the filter is the same, to the bit, whether a tape runs along or not; at the last mark smoothed is
/// filtered, to the bit; no deviation grows; more rows are more marks, which change nothing; and without fixes there is
/// nothing to smooth, to rounding.
#[test]
fn smoothing_changes_nothing_that_it_should_not() {
    let trajectory = shipped("figure_eight.toml");
    let gnss = GnssSettings {
        lever_arm_m: [0.8, -0.3, -1.2],
        ..GnssSettings::default()
    };
    recorded(&trajectory, &model(), &gnss, 1, |recording, start| {
        let imu = &recording.imu[..12_000];
        let outages = vec![Outage {
            start_s: 60.0,
            end_s: 80.0,
        }];
        let fixes = &recording.gnss;
        let plain = Settings {
            outages,
            lever_arm_b: gnss.lever_arm_m.into(),
            ..settings()
        };
        let smooth = |rows_hz: f64, smooth: bool| {
            run(
                imu,
                fixes,
                start,
                &Settings {
                    gate: None,
                    rows_hz,
                    smooth,
                    ..plain.clone()
                },
                &trajectory,
            )
        };
        let (coarse, fine) = (smooth(1.0, true), smooth(5.0, true));
        assert_eq!(
            Solution {
                smoothed: None,
                ..coarse.clone()
            },
            smooth(1.0, false)
        );
        assert_eq!(
            (rows(&coarse).last(), rows(&coarse).len()),
            (coarse.rows.last(), coarse.rows.len())
        );
        let FixCounts { used, withheld, .. } = outcome(&coarse, &[]).fixes;
        assert!(used > 70 && withheld == 20, "{used} {withheld}");
        for (filtered, smoothed) in coarse.rows.iter().zip(rows(&coarse)) {
            assert_eq!(filtered.t_s, smoothed.t_s);
            for i in 0..9 {
                // angles are taken at the attitude of each, which differ by up to a degree
                let rounding = if i < 6 { 1e-9 } else { 1e-2 };
                assert!(
                    smoothed.sigma[i] <= filtered.sigma[i] * (1.0 + rounding),
                    "{i} at {} s",
                    filtered.t_s
                );
            }
            let grown =
                [0, 1].map(|s| (smoothed.bias_sigma[s] / filtered.bias_sigma[s]).max_element());
            assert!(grown.iter().all(|g| *g <= 1.0 + 1e-9), "{grown:?}");
        }
        // between marks the error is linear, so that more of them leave the rounding; at 5 Hz they are where the filter
        // applies the Earth's terms anyway
        for row in rows(&coarse) {
            let same = rows(&fine)
                .iter()
                .find(|r| (r.t_s - row.t_s).abs() < 1e-6)
                .unwrap();
            for i in 0..9 {
                let apart =
                    (row.error.unwrap().values[i] - same.error.unwrap().values[i]) / row.sigma[i];
                assert!(apart.abs() < 1e-6, "{i} at {} s: {apart:e}", row.t_s);
                assert!((same.sigma[i] / row.sigma[i] - 1.0).abs() < 1e-6);
            }
        }
        // without a fix there is nothing to smooth
        let all = vec![Outage {
            start_s: 0.0,
            end_s: 1e4,
        }];
        let free = run(
            imu,
            fixes,
            start,
            &Settings {
                smooth: true,
                outages: all,
                ..plain.clone()
            },
            &trajectory,
        );
        for (filtered, smoothed) in free.rows.iter().zip(rows(&free)) {
            let apart = |of: fn(&Row) -> [f64; 9]| {
                (0..9)
                    .map(|i| (of(filtered)[i] - of(smoothed)[i]).abs() / filtered.sigma[i])
                    .fold(0.0, f64::max)
            };
            assert!(apart(|row| row.error.unwrap().values) < 1e-9 && apart(|row| row.sigma) < 1e-6);
        }
    });
}

/// A tape that does not fit is refused before the filter runs: with a row for each of a million samples, 15 states take
/// 15² + 15·16/2 numbers a row for the links alone, 2.8 GB.
#[test]
fn a_tape_that_is_too_long_is_refused() {
    let place = place_with(DRIVE, MODEL);
    let trajectory = trajectory_file::load(&place.path().join("drive.toml"), None)
        .unwrap()
        .0;
    recorded(
        &trajectory,
        &model(),
        &GnssSettings::default(),
        1,
        |recording, start| {
            let imu: Vec<_> = recording
                .imu
                .iter()
                .cycle()
                .take(1_000_000)
                .copied()
                .collect();
            let recorded = Recorded {
                imu: &imu,
                gnss: &recording.gnss,
                aids: &[],
            };
            let long = Settings {
                gate: None,
                rows_hz: 30_000.0,
                smooth: true,
                ..settings()
            };
            let refused = fuse(&recorded, &belief(&model()), start, &long, None).unwrap_err();
            let FusionError::Memory {
                bytes, states: 15, ..
            } = refused
            else {
                panic!("{refused}")
            };
            assert!((2.8e9..3.5e9).contains(&bytes), "{bytes}");
        },
    );
}
