//! The smoother of `fuse`: a closed form at rest, consistency over simulated recordings, and identities.

use crate::fusion::{filter_model, model, plainly_recorded, recorded, run, settings};
use crate::shared::{data, gauss_markov, outage, shipped, stands, two_sided, white};
use approx::assert_relative_eq;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use nav_sim::navigation::ekf::{FilterModel, FilterStates, InitialSettings};
use nav_sim::navigation::fusion::{DriveData, Solution};
use nav_sim::navigation::fusion::{
    FixCounts, FusionError, FusionSettings, SolutionRow, Start, fuse, outcome,
};
use nav_sim::navigation::gnss::GnssFix;
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::gnss::GnssSettings;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::{Plan, record};
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::noise::{Composite, Model};
use nav_sim_navigation::earth::radii;

const OUTAGE: Outage = Outage {
    start_s: 300.0,
    end_s: 390.0,
};

fn smoothing() -> FusionSettings {
    FusionSettings {
        smooth: true,
        outages: vec![OUTAGE],
        ..settings()
    }
}

fn rows(solution: &Solution) -> &[SolutionRow] {
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
    let trajectory = stands(60.0);
    let free = Model {
        rate_hz: 100.0,
        axes: Default::default(),
    };
    let believed = Model::pooled(100.0, &white(SIGMA2), &Composite::default());
    let filter_model = FilterModel::new(&believed, FilterStates::Full, 1.0, 800.0).unwrap();
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
    let smooth = FusionSettings {
        smooth: true,
        ..settings()
    };
    let mut solution = Solution::default();
    plainly_recorded(&trajectory, &free, 1, |recording, _| {
        let recorded = DriveData {
            gnss: &gnss,
            ..data(recording)
        };
        solution = fuse(&recorded, &filter_model, &start, &smooth, Some(&reference)).unwrap();
    });
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
    assert!(worst.iter().all(|w| *w < ALLOWED), "{worst:?}");
}

/// A simulated experiment: what makes the errors, and what the filter expects.
struct Experiment {
    name: &'static str,
    states: FilterStates,
    scenario: &'static str,
    biases: [&'static [(f64, f64)]; 2],
}

const EXPERIMENTS: [Experiment; 3] = [
    Experiment {
        name: "15",
        states: FilterStates::Reduced15,
        scenario: "gnss.lever_arm_m = [0.8, -0.3, -1.2]",
        biases: [&[(5e-4, 200.0)], &[(5e-6, 300.0)]],
    },
    Experiment {
        name: "21 and turn-on biases",
        states: FilterStates::Reduced21,
        scenario: "imu = { turn_on_bias_accel_m_s2 = 0.02, turn_on_bias_gyro_rad_s = 1e-4, scale_ppm_accel = 300, scale_ppm_gyro = 300 }\n\
                   initial = { accel_bias_sigma_m_s2 = 0.02, gyro_bias_sigma_rad_s = 1e-4 }\n\
                   gnss.vel_sigma_m_s = \"none\"",
        biases: [&[(5e-4, 200.0)], &[(5e-6, 300.0)]],
    },
    Experiment {
        name: "full",
        states: FilterStates::Full,
        scenario: "",
        biases: [&[(5e-4, 200.0), (1e-3, 2.0)], &[(5e-6, 300.0), (1e-5, 5.0)]],
    },
];

impl Experiment {
    /// Its recordings, fused and smoothed.
    fn solutions(&self, trajectory: &Trajectory, runs: u64) -> Vec<Solution> {
        let [accel, gyro] = [0, 1].map(|i| gauss_markov([1e-5, 1e-8][i], self.biases[i]));
        let model = Model::pooled(100.0, &accel, &gyro);
        let scenario: Scenario = toml::from_str(self.scenario).unwrap();
        assert_eq!(scenario.validate(), Ok(()));
        let filter_model = FilterModel::new(&model, self.states, 1.0, 800.0)
            .unwrap()
            .with_initial(&scenario.initial);
        let experiment = scenario.experiment(trajectory, Truth::Model(&model), &[], &[], 23);
        let plan = Plan::new(&experiment).unwrap();
        let settings = FusionSettings {
            lever_arm_b: scenario.gnss.lever_arm_m.into(),
            ..smoothing()
        };
        let reference = trajectory.clone().into();
        let solution = |run: u64| {
            let recording = record(&plan, run);
            let start = Start {
                t_s: trajectory.start_s(),
                state: recording.start,
                sigma: scenario.initial.clone(),
                found: None,
            };
            fuse(
                &data(&recording),
                &filter_model,
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
    let trajectory = shipped("land_vehicle");
    for experiment in &EXPERIMENTS {
        let solutions = experiment.solutions(&trajectory, RUNS);
        let name = experiment.name;
        for look in looks {
            let nees: f64 = solutions
                .iter()
                .map(|s| rows(s)[look].error.unwrap().nees)
                .sum();
            let p = two_sided(nees, 9.0 * RUNS as f64);
            assert!(p >= 2e-4, "{name}, NEES at {look} s: {nees}");
            for state in 0..9 {
                let change = |s: &Solution| {
                    let (f, s) = (&s.rows[look], &rows(s)[look]);
                    let moved = f.error.unwrap().values[state] - s.error.unwrap().values[state];
                    moved.powi(2) / (f.sigma[state].powi(2) - s.sigma[state].powi(2))
                };
                let sum = solutions.iter().map(change).sum::<f64>();
                let p = two_sided(sum, RUNS as f64);
                assert!(
                    p >= 2e-5,
                    "{name}, change of state {state} at {look} s: {sum}"
                );
            }
        }
        // root mean square of smoothed over filtered, of the same rows
        let ratio = |within: &dyn Fn(&SolutionRow) -> bool, of: &dyn Fn(&[f64; 9]) -> f64| {
            let sum = |rows: &[SolutionRow]| -> f64 {
                let some = rows.iter().filter(|row| within(row));
                some.map(|row| of(&row.error.unwrap().values).powi(2)).sum()
            };
            let of = |rows: fn(&Solution) -> &[SolutionRow]| {
                solutions.iter().map(|s| sum(rows(s))).sum::<f64>()
            };
            let (smoothed, filtered) = (of(rows), of(|s| s.rows.as_slice()));
            (smoothed / filtered).sqrt()
        };
        let ratios: Vec<f64> = (0..9)
            .map(|i| ratio(&|_| true, &|values| values[i]))
            .collect();
        assert!(ratios.iter().all(|r| *r < 1.0), "{name}: {ratios:?}");
        let [within, outside] = [true, false].map(|is| {
            ratio(&|row| OUTAGE.withholds(row.t_s) == is, &|e| {
                e[0].hypot(e[1])
            })
        });
        assert!(within < outside, "{name}: {within} {outside}");
        let farthest = |rows: &[SolutionRow]| {
            let sigma = |row: &&SolutionRow| row.sigma[0].hypot(row.sigma[1]);
            let rows = rows.iter().filter(|row| OUTAGE.withholds(row.t_s));
            rows.max_by(|a, b| sigma(a).total_cmp(&sigma(b)))
                .unwrap()
                .t_s
        };
        for solution in &solutions {
            let [filtered, smoothed] = [&solution.rows, rows(solution)].map(farthest);
            assert!((OUTAGE.end_s - filtered).abs() < 1.5 && (345.0 - smoothed).abs() < 15.0);
        }
    }
}

/// Identities: the filter is the same, to the bit, whether a tape runs along or not; at the last mark smoothed is
/// filtered, to the bit; no deviation grows; more rows are more marks, which change nothing; and without fixes there is
/// nothing to smooth, to rounding.
#[test]
fn smoothing_changes_nothing_that_it_should_not() {
    let trajectory = shipped("figure_eight");
    let gnss = GnssSettings {
        lever_arm_m: [0.8, -0.3, -1.2],
        ..GnssSettings::default()
    };
    recorded(&trajectory, &model(), &gnss, 1, |recording, start| {
        let solve = |rows_hz: f64, smooth: bool, outages: [Outage; 1]| {
            let settings = FusionSettings {
                outages: outages.into(),
                lever_arm_b: gnss.lever_arm_m.into(),
                rows_hz,
                smooth,
                ..settings()
            };
            let data = DriveData {
                imu: &recording.imu[..12_000],
                ..data(recording)
            };
            run(data, start, &settings, &trajectory)
        };
        let short = [outage(60.0, 80.0)];
        let (coarse, fine) = (solve(1.0, true, short), solve(5.0, true, short));
        let filtered = Solution {
            smoothed: None,
            ..coarse.clone()
        };
        assert_eq!(filtered, solve(1.0, false, short));
        assert_eq!(rows(&coarse).len(), coarse.rows.len());
        assert_eq!(rows(&coarse).last(), coarse.rows.last());
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
                assert_relative_eq!(same.sigma[i], row.sigma[i], max_relative = 1e-6);
            }
        }
        // without a fix there is nothing to smooth
        let free = solve(1.0, true, [outage(0.0, 1e4)]);
        for (filtered, smoothed) in free.rows.iter().zip(rows(&free)) {
            let apart = |of: fn(&SolutionRow) -> [f64; 9]| {
                (0..9)
                    .map(|i| (of(filtered)[i] - of(smoothed)[i]).abs() / filtered.sigma[i])
                    .fold(0.0, f64::max)
            };
            assert!(apart(|row| row.error.unwrap().values) < 1e-9 && apart(|row| row.sigma) < 1e-6);
        }
    });
}

#[test]
fn a_tape_that_is_too_long_is_refused() {
    plainly_recorded(&stands(60.0), &model(), 1, |recording, start| {
        let imu: Vec<_> = recording
            .imu
            .iter()
            .cycle()
            .take(1_000_000)
            .copied()
            .collect();
        let recorded = DriveData {
            imu: &imu,
            ..data(recording)
        };
        let long = FusionSettings {
            rows_hz: 30_000.0,
            smooth: true,
            ..settings()
        };
        let refused = fuse(&recorded, &filter_model(&model()), start, &long, None).unwrap_err();
        let FusionError::Memory {
            bytes, states: 15, ..
        } = refused
        else {
            panic!("{refused}")
        };
        assert!((2.8e9..3.5e9).contains(&bytes), "{bytes}");
    });
}
