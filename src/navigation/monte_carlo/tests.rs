//! The whole chain, trajectory to sums, against statistics and against itself on other threads.

use super::*;
use crate::earth::{self, GravityModel};
use crate::ekf::{FilterModel, FilterStates, FixUpdate, InitialSettings};
use crate::frames::RollPitchYaw;
use crate::imu::Channel;
use crate::noise::{Composite, Model, Process, VirtualImu};
use crate::rng::StreamKey;
use crate::sensors::aiding::AidingSettings;
use crate::sensors::defects::{Defects, ImuSettings};
use crate::sensors::gnss::{BaroSettings, GnssSettings};
use crate::sensors::imu::Truth;
use crate::sensors::outage::Outage;
use crate::simulation::{Gains, NEES_DOF};
use crate::tests::{assert_chi_square, gauss_markov, key, samples};
use crate::trajectory::Trajectory;
use crate::units::DEG;
use approx::assert_relative_eq;

/// A winding drive of the given length, knots at 2 Hz.
fn trajectory(duration_s: f64) -> Trajectory {
    let (lat, lon) = (46.5 * DEG, 6.6 * DEG);
    let knots = samples((2.0 * duration_s) as u32, 0.5, |t_s| {
        let (north, east) = (12.0 * t_s, 150.0 * (0.05 * t_s).sin());
        let attitude = RollPitchYaw {
            roll: 0.02 * (0.3 * t_s).sin(),
            pitch: 0.03 * (0.1 * t_s).cos(),
            yaw: (7.5 * (0.05 * t_s).cos()).atan2(12.0),
        };
        (
            lat + north / 6.37e6,
            lon + east / (6.39e6 * lat.cos()),
            400.0 + 10.0 * (0.02 * t_s).sin(),
            attitude.to_quat(),
        )
    });
    Trajectory::from_samples(&knots).unwrap()
}

/// White noise and one Gauss-Markov bias an axis: the 15-state filter's own model.
fn model(scale: f64) -> Model {
    let sigma = [0.02, 2e-4].map(|sigma| sigma * f64::sqrt(scale));
    gauss_markov(100.0, [4e-5, 1e-6], sigma, [200.0, 300.0])
}

fn outage(start_s: f64, end_s: f64) -> Outage {
    Outage { start_s, end_s }
}

struct Setting {
    trajectory: Trajectory,
    model: Model,
    filter_models: Vec<FilterModel>,
    gnss: GnssSettings,
    initial: InitialSettings,
    outages: Vec<Outage>,
    defects: ImuSettings,
    baro: Option<BaroSettings>,
    update: FixUpdate,
    gains: Gains,
    seed: u64,
    aiding: AidingSettings,
}

impl Setting {
    fn new(duration_s: f64, belief_scales: &[f64]) -> Self {
        let filter_model = |scale: &f64| {
            FilterModel::new(&model(*scale), FilterStates::Reduced15, 1.0, 800.0).unwrap()
        };
        Self {
            trajectory: trajectory(duration_s),
            model: model(1.0),
            filter_models: belief_scales.iter().map(filter_model).collect(),
            gnss: GnssSettings::default(),
            initial: InitialSettings::default(),
            outages: vec![outage(20.0, 40.0)],
            seed: 3,
            defects: ImuSettings::default(),
            baro: None,
            aiding: AidingSettings::default(),
            update: FixUpdate::default(),
            gains: Gains::default(),
        }
    }

    fn experiment(&self) -> Experiment<'_> {
        Experiment {
            trajectory: &self.trajectory,
            rate_hz: 100.0,
            gravity: GravityModel::Wgs84,
            truth: Truth::Model(&self.model),
            filter_models: &self.filter_models,
            gnss: &self.gnss,
            initial: &self.initial,
            defects: &self.defects,
            baro: self.baro.as_ref(),
            aiding: &self.aiding,
            update: self.update,
            gains: self.gains,
            outages: &self.outages,
            seed: self.seed,
            coverage_level: 0.95,
        }
    }

    fn run(&self, runs: u64) -> Vec<RunResult> {
        run(&self.experiment(), runs, &|_| {}).unwrap()
    }
}

/// Every number to its last bit (the shortest text that reads back as the same number), NaN included.
fn bits<T: std::fmt::Debug + ?Sized>(value: &T) -> String {
    format!("{value:?}")
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let setting = Setting::new(30.0, &[1.0]);
    let result_on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| setting.run(20))
    };
    let one = result_on(1);
    assert!(bits(&one) == bits(&result_on(2)) && bits(&one) == bits(&result_on(3)));
    assert_eq!(one[0].runs.len(), 20);
}

#[test]
fn a_run_does_not_depend_on_how_many_others_there_are_or_on_other_candidates() {
    let setting = Setting::new(30.0, &[1.0]);
    let (eight, many) = (setting.run(8), setting.run(21));
    assert!(bits(&eight[0].runs[..8]) == bits(&many[0].runs[..8]));
    assert!(bits(&setting.run(5)[0].runs[..]) == bits(&many[0].runs[..5]));
    let with_others = Setting::new(30.0, &[2.0, 1.0]).run(8);
    assert!(bits(&with_others[1]) == bits(&eight[0]));
    assert!(with_others[0].epochs != eight[0].epochs);
}

/// After five minutes without fixes tilts are degrees: of the same runs the iterated update has the smaller NEES. In 64 other
/// pairs the mean of the differences was 0.115 and their deviation 0.34, so that 384 put it at 6.6 standard errors; below three
/// it falls by chance in 0.02 %.
#[test]
fn the_iterated_update_is_more_consistent_after_a_long_outage() {
    const PAIRS: u64 = 384;
    let mut setting = Setting::new(460.0, &[1.0]);
    setting.seed = 5;
    setting.outages = vec![outage(60.0, 360.0)];
    let once = setting.run(PAIRS);
    setting.update = FixUpdate::Iterated;
    let iterated = setting.run(PAIRS);
    let gain: Vec<f64> = once[0]
        .runs
        .iter()
        .zip(&iterated[0].runs)
        .map(|(a, b)| a.nees_mean - b.nees_mean)
        .collect();
    let pairs = PAIRS as f64;
    let mean = gain.iter().sum::<f64>() / pairs;
    let variance = gain.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (pairs - 1.0);
    assert!(mean > 3.0 * (variance / pairs).sqrt(), "{mean} {variance}");
    // Until the first fix after it nothing differs but by the fixes before, where errors are small.
    let end = |r: &RunResult| {
        r.runs
            .iter()
            .map(|run| run.outages[0].nees_end)
            .sum::<f64>()
            / pairs
    };
    assert_relative_eq!(end(&once[0]), end(&iterated[0]), max_relative = 0.01);
}

/// Outages change which fixes are used and no random number: before the outage nothing differs.
#[test]
fn outages_leave_the_past_alone() {
    let mut setting = Setting::new(30.0, &[1.0]);
    // Whether gains are shared hangs on the whole run.
    setting.gains = Gains::Shared;
    let with = setting.run(8);
    setting.outages.clear();
    let without = setting.run(8);
    assert!(with[0].epochs[..20] == without[0].epochs[..20]);
    let position = |r: &RunResult| r.epochs[30].see[0] / 8.0;
    assert!(position(&with[0]) > 2.0 * position(&without[0]));
    assert!(with[0].epochs[30].error_sq[0] > without[0].epochs[30].error_sq[0]);
}

/// The sum of the NEES over the runs of a matched experiment, which are worth so many independent ones, is chi-square at every
/// look (99.9 % in all).
fn assert_consistent(result: &RunResult, looks: &[usize], independent: f64) {
    for look in looks {
        let epoch = &result.epochs[*look];
        assert_chi_square(
            epoch.nees[0] * independent / epoch.count as f64,
            NEES_DOF as f64 * independent,
            1e-3 / looks.len() as f64,
        );
    }
}

/// An acceleration (m/s²) along x and east for 20 s without a fix, of an IMU without noise.
fn dragster(a: f64, defects: ImuSettings) -> Setting {
    let east = RollPitchYaw {
        roll: 0.0,
        pitch: 0.0,
        yaw: 90.0 * DEG,
    };
    let straight = |t_s| (0.0, 0.5 * a * t_s * t_s / earth::A, 0.0, east.to_quat());
    Setting {
        trajectory: Trajectory::from_samples(&samples(80, 0.25, straight)).unwrap(),
        model: Model {
            rate_hz: 100.0,
            axes: Default::default(),
        },
        initial: InitialSettings {
            perfect: true,
            ..InitialSettings::default()
        },
        outages: vec![outage(0.0, 100.0)],
        defects,
        ..Setting::new(30.0, &[1.0])
    }
}

/// Without a single fix, a straight acceleration a over t seconds along x and east leaves a velocity error
/// of (bias + scale · a) t, and by Coriolis Ω t² times the false acceleration down: run by run, what the run
/// drew. (The tilt by the false transport rate takes g t²/(6 R) = 1e-4 of it, and transport is v/(R Ω) ≤ 9 %
/// of Coriolis.)
#[test]
fn bias_and_scale_factor_of_the_true_imu_act_as_in_closed_form() {
    let (a, seconds) = (2.0, 20.0);
    let defects = ImuSettings {
        turn_on_bias_accel_m_s2: Some(0.05),
        scale_ppm_accel: 20_000.0,
        ..ImuSettings::default()
    };
    for run in &dragster(a, defects.clone()).run(20)[0].runs {
        let key = StreamKey {
            run: run.run,
            ..key(3)
        };
        let drawn = Defects::draw(&defects, key);
        let along = (drawn.bias[0].x + drawn.matrix[0].x_axis.x * a) * seconds;
        let down = drawn.bias[0].z - drawn.matrix[0].z_axis.z * earth::GRAVITY_EQUATOR;
        let coriolis = earth::OMEGA_IE * down * seconds * seconds;
        let (found, bound) = (
            run.outages[0].error_end[4],
            3e-4 * along.abs() + 0.1 * coriolis.abs(),
        );
        let expected = along + coriolis;
        assert!(
            (found - expected).abs() < bound,
            "run {}: {found} m/s, {expected} m/s",
            run.run
        );
    }
}

/// A barometer of 0.5 m holds the height through an outage that costs metres without it, and the filter
/// stays as sure as it should.
#[test]
fn a_barometer_holds_the_height() {
    let runs = 104;
    let mut setting = Setting::new(80.0, &[1.0]);
    setting.outages = vec![outage(20.0, 60.0)];
    let without = setting.run(8);
    setting.baro = Some(BaroSettings {
        rate_hz: 2.0,
        sigma_m: 0.5,
    });
    let with = setting.run(runs);
    let down = |r: &RunResult, runs: u64| r.epochs[59].see[2] / runs as f64;
    assert!(down(&with[0], runs) < 0.4 && down(&without[0], 8) > 2.0);
    assert_consistent(&with[0], &[10, 30, 59, 75], runs as f64);
}

/// Sums over runs are those of the runs one by one, in every field: 11 runs are two batches.
#[test]
fn sums_of_batches_are_sums_of_runs() {
    let setting = Setting::new(30.0, &[1.0]);
    let experiment = setting.experiment();
    let plan = Plan::new(&experiment).unwrap();
    let runs_from = |first, runs| {
        run_range(&plan, first, runs, &|| true, &|_| {})
            .unwrap()
            .swap_remove(0)
    };
    let together = runs_from(0, 11);
    let mut appended = runs_from(0, 5);
    appended.append(runs_from(5, 6));
    let single: Vec<RunResult> = (0..11).map(|k| runs_from(k, 1)).collect();
    let agree = |sum: f64, parts: &dyn Fn(&EpochSums) -> f64, epoch: usize| {
        let expected: f64 = single.iter().map(|r| parts(&r.epochs[epoch])).sum();
        assert!(
            (sum - expected).abs() <= 1e-9 * expected.abs() + 1e-12,
            "epoch {epoch}: {sum}, {expected}"
        );
    };
    for (k, sums) in together.epochs.iter().chain(&appended.epochs).enumerate() {
        let k = k % together.epochs.len();
        for i in 0..REPORTED {
            agree(sums.see[i], &|e| e.see[i], k);
            agree(sums.see_sq[i], &|e| e.see[i].powi(2), k);
            agree(sums.error_sq[i], &|e| e.error[i].powi(2), k);
            agree(sums.error_4[i], &|e| e.error[i].powi(4), k);
        }
        agree(sums.nees[1], &|e| e.nees[0].powi(2), k);
        agree(sums.pos_error[1], &|e| e.pos_error[0].powi(2), k);
        agree(sums.att_error[1], &|e| e.att_error[0].powi(2), k);
        assert_eq!(sums.first_error, Some(single[0].epochs[k].error));
        assert_eq!(
            sums.covered,
            single.iter().map(|r| r.epochs[k].covered).sum::<u64>()
        );
    }
    assert_eq!((together.run_epochs, appended.run_epochs), (33_000, 33_000));
}

/// What is kept of a run is what its epochs say: means over the run, the mean SEE over the outage (start ≤ t <
/// end), the state at its end, and when the horizontal error is back within that of the receiver, 2√2 m.
#[test]
fn records_agree_with_the_epochs_of_their_run() {
    let mut setting = Setting::new(60.0, &[1.0]);
    setting.gnss.vel_sigma_m_s = None;
    let experiment = setting.experiment();
    let plan = Plan::new(&experiment).unwrap();
    let mut late = 0;
    for k in 0..24 {
        let result = run_range(&plan, k, 1, &|| true, &|_| {})
            .unwrap()
            .swap_remove(0);
        let (record, epochs) = (&result.runs[0], &result.epochs);
        let mean = |value: &dyn Fn(&EpochSums) -> f64, of: &[EpochSums]| {
            of.iter().map(value).sum::<f64>() / of.len() as f64
        };
        let near = |a: f64, b: f64| assert_relative_eq!(a, b, max_relative = 1e-12);
        let outage = &record.outages[0];
        near(record.nees_mean, mean(&|e| e.nees[0], epochs));
        near(record.covered, mean(&|e| e.covered as f64, epochs));
        for i in 0..REPORTED {
            near(
                record.normalised_sq[i],
                mean(&|e| (e.error[i] / e.see[i]).powi(2), epochs),
            );
            near(outage.see_mean[i], mean(&|e| e.see[i], &epochs[20..40]));
        }
        let horizontal = |e: &EpochSums| e.error[0].hypot(e.error[1]);
        let back = epochs[40..]
            .iter()
            .position(|e| horizontal(e) <= 8.0_f64.sqrt());
        near(
            1.0 + outage.reconvergence_s,
            back.map_or(f64::NAN, |s| 1.0 + s as f64),
        );
        late += u32::from(
            back.is_some_and(|s| s > 0 && horizontal(&epochs[40]) <= 2.0 * 8.0_f64.sqrt()),
        );
        // at 40 s, before the fix there: a second of growth after 39 s, and far above what the fix leaves
        assert!(
            outage.see_end[0] > epochs[39].see[0] && outage.see_end[0] > 1.5 * epochs[40].see[0]
        );
        near(
            outage.horizontal_error_end_m,
            outage.error_end[0].hypot(outage.error_end[1]),
        );
    }
    assert!(
        late > 0,
        "no run is between one and two standard deviations of the receiver: the test sees nothing"
    );
}

/// At the very end of a trajectory there is no fix: the end of the outage is the last epoch.
#[test]
fn an_outage_that_outlasts_the_trajectory_ends_with_it() {
    let mut setting = Setting::new(30.0, &[1.0]);
    setting.outages = vec![outage(20.0, 31.0)];
    let result = &setting.run(1)[0];
    let (last, outage) = (&result.epochs[30], &result.runs[0].outages[0]);
    assert_eq!(
        (outage.see_end, outage.error_end, outage.nees_end),
        (last.see, last.error, last.nees[0])
    );
}

/// Errors from windows of static recordings that have a random walk, in a full filter of the same model: with
/// windows of a minute from eight recordings of ten, 80 independent ones, the mean NEES lies where 80 runs put it
/// (99.9 %, all looks together). Started from the recordings' mean the walk is metres a second off.
#[test]
fn windows_of_recordings_leave_the_matched_filter_consistent() {
    let axis = |white: f64, gamma2: f64| {
        let walk = Process::random_walk(gamma2).unwrap();
        Composite::new(vec![Process::white(white).unwrap(), walk])
    };
    let model = Model::pooled(100.0, &axis(4e-5, 3e-9), &axis(1e-6, 1e-12));
    let imu = VirtualImu {
        model: &model,
        spread: None,
        contamination: None,
        seed: 8,
    };
    let recordings: Vec<_> = (1..=8)
        .map(|k| imu.recording(k, &Channel::ALL, 60_000).unwrap())
        .collect();
    let mut setting = Setting::new(60.0, &[]);
    setting.filter_models = vec![FilterModel::new(&model, FilterStates::Full, 1.0, 800.0).unwrap()];
    let experiment = Experiment {
        truth: Truth::Static(&recordings),
        ..setting.experiment()
    };
    let result = &run(&experiment, 160, &|_| {}).unwrap()[0];
    assert_eq!(result.independent_windows, Some(80.0));
    assert_consistent(result, &[5, 20, 39, 60], 80.0);
}

/// At the end of an outage, on the same noise: the errors of runs hang on the gains by far less than they scatter.
#[test]
fn shared_gains_leave_errors_as_they_are() {
    let mut setting = Setting::new(60.0, &[1.0]);
    // A minute is alignment for the most part: with less to align than by default.
    setting.initial.att_sigma_deg = [0.1, 0.1, 0.5];
    setting.gains = Gains::Own;
    let own = setting.run(64).swap_remove(0);
    setting.gains = Gains::Auto;
    let shared = setting.run(64).swap_remove(0);
    assert!(shared.gains.is_shared && !own.gains.is_shared);
    assert!(shared.gains.largest_difference.unwrap() <= 0.03);
    let rmse = |result: &RunResult, i: usize| {
        let squares = result
            .runs
            .iter()
            .map(|r| r.outages[0].error_end[i].powi(2));
        (squares.sum::<f64>() / result.runs.len() as f64).sqrt()
    };
    for i in 0..REPORTED {
        // 64 runs know an RMSE to 9 %.
        let ratio = rmse(&shared, i) / rmse(&own, i);
        assert!((ratio - 1.0).abs() < 0.005, "state {i}: {ratio}");
    }
    assert!(own.runs[5].outages[0].error_end != shared.runs[5].outages[0].error_end);
}

/// A start 20° wrong in yaw is beyond a linear filter: gains are not shared, and the results are those of own gains.
#[test]
fn gains_are_not_shared_where_errors_are_large() {
    let mut setting = Setting::new(60.0, &[1.0]);
    setting.initial.att_sigma_deg[2] = 20.0;
    let auto = setting.run(16).swap_remove(0);
    setting.gains = Gains::Own;
    let own = setting.run(16).swap_remove(0);
    assert!(!auto.gains.is_shared);
    assert!(auto.gains.largest_difference.unwrap() > 0.03);
    assert!(bits(&auto.epochs) == bits(&own.epochs) && bits(&auto.runs) == bits(&own.runs));
}

/// More batches than wait together: 64 of eight runs.
#[test]
fn no_run_is_left_out_whatever_their_number() {
    let mut setting = Setting::new(2.0, &[1.0]);
    setting.outages = vec![outage(0.5, 1.0)];
    let result = setting.run(520).remove(0);
    assert!(result.runs.iter().map(|r| r.run).eq(0..520));
    assert_eq!(result.epochs[0].count, 520);
}
