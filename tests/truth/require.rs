//! The IMU that a limit needs meets it in sampled runs, and answers are monotone.

use crate::shared::{outage, town, white};
use approx::{assert_abs_diff_eq, assert_relative_eq};
use nav_sim::io::datasheet::{Figure, catalogued};
use nav_sim::navigation::monte_carlo;
use nav_sim::navigation::require::{
    Drift, IMU_PARAMETERS, ImuSearch, IntensityBound, Limit, LimitQuantity, Margins,
    OutagePlacements, RequireError, worst_without_imu_errors,
};
use nav_sim::navigation::scenario::Scenario;
use nav_sim::navigation::sensors::imu::Truth;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::imu::Sensor;
use nav_sim::signal::noise::{Composite, Model, Process};
use nav_sim_navigation::simulation::REPORTED;
use nav_sim_navigation::simulation::lincov::{FilterPass, Track, TruthModel};

const OUTAGE: Outage = Outage {
    start_s: 150.0,
    end_s: 190.0,
};

fn limit(quantity: LimitQuantity, most: f64) -> [Limit; 1] {
    [Limit { quantity, most }]
}

/// Three minutes of town traffic, the default scenario on it.
fn setting() -> (Scenario, Trajectory) {
    (Scenario::default(), town(4))
}

fn need<'a>(
    course: &'a OutagePlacements<'a>,
    scenario: &'a Scenario,
    limits: &'a [Limit],
) -> ImuSearch<'a> {
    ImuSearch {
        course,
        scenario,
        limits,
        t_corr_s: 300.0,
    }
}

fn margins(
    course: &OutagePlacements<'_>,
    scenario: &Scenario,
    model: &Model,
    limits: &[Limit],
) -> Margins {
    Margins::new(
        course.worst(scenario, model, limits).unwrap(),
        worst_without_imu_errors(course, scenario, limits).unwrap(),
    )
}

/// 400 runs of the filter with all states: the share within the 95 % quantile that was asked for is 0.95 within four
/// standard errors of a binomial share, 4 √(0.95·0.05/400) = 0.044.
#[test]
fn the_imu_that_is_named_meets_the_limit_in_sampled_runs() {
    let (scenario, trajectory) = setting();
    let course = OutagePlacements::new(&scenario, &trajectory, &[OUTAGE]).unwrap();
    let limits = limit(LimitQuantity::P95, 12.0);
    let imu = need(&course, &scenario, &limits).allocated().unwrap().0;
    let model = imu.model(scenario.imu.rate_hz);
    let full = scenario.with_full_noise();
    let track = scenario.track(&trajectory, &model, &[OUTAGE]).unwrap();
    let filter_models = [full.filter_model(&model, &[OUTAGE], &track).unwrap()];
    let experiment = scenario.experiment(
        &trajectory,
        Truth::Model(&model),
        &filter_models,
        &[OUTAGE],
        5,
    );
    let result = &monte_carlo::run(&experiment, 400, &|_| {}).unwrap()[0];
    let within = result
        .runs
        .iter()
        .filter(|r| r.outages[0].horizontal_error_end_m <= 12.0)
        .count();
    assert!(
        (within as f64 / 400.0 - 0.95).abs() < 0.044,
        "{within} of 400, {imu:?}"
    );
    let margins = margins(&course, &scenario, &model, &limits);
    assert!(
        margins.met && margins.worst.value / 12.0 > 0.9975,
        "{margins:?}"
    );
}

/// A tighter limit needs a better IMU in every intensity; one intensity alone may be larger than beside others.
#[test]
fn answers_are_monotone() {
    let (scenario, trajectory) = setting();
    let course = OutagePlacements::new(&scenario, &trajectory, &[OUTAGE]).unwrap();
    let limits = [
        limit(LimitQuantity::P95, 30.0),
        limit(LimitQuantity::P95, 10.0),
    ];
    let need = |k: usize| need(&course, &scenario, &limits[k]);
    let [loose, tight] = [0, 1].map(|k| need(k).allocated().unwrap().0);
    assert!(
        loose.values.iter().zip(tight.values).all(|(l, t)| *l > t),
        "{loose:?} {tight:?}"
    );
    for i in 0..IMU_PARAMETERS {
        let beside = need(0).limit_of(&loose, i, 0.1, &[0]).unwrap();
        let alone = need(0).limit_with_others_perfect(&loose, i, &[0]).unwrap();
        let (IntensityBound::AtMost(beside), IntensityBound::AtMost(alone)) = (beside, alone)
        else {
            panic!("{beside:?} {alone:?}")
        };
        assert!(
            loose.values[i] < beside && beside <= alone,
            "{i}: {} {beside} {alone}",
            loose.values[i]
        );
    }
}

#[test]
fn what_gnss_alone_misses_is_refused() {
    let (scenario, trajectory) = setting();
    let course = OutagePlacements::new(&scenario, &trajectory, &[OUTAGE]).unwrap();
    let limits = limit(LimitQuantity::Rmse, 0.05);
    let allocated = need(&course, &scenario, &limits).allocated();
    let Err(RequireError::Floor { value, .. }) = allocated else {
        panic!("an IMU for 5 cm")
    };
    assert!(value > 0.05);
}

/// The limit is kept wherever the outage begins, and met where it is the worst: the answer is sought at a few places and
/// holds for all.
#[test]
fn the_imu_that_is_named_keeps_the_limit_at_every_beginning() {
    let (scenario, trajectory) = setting();
    let begins = |start_s| outage(start_s, start_s + 20.0);
    let outages: Vec<Outage> = (60..=160).map(|s| begins(f64::from(s))).collect();
    let course = OutagePlacements::new(&scenario, &trajectory, &outages).unwrap();
    for most in [3.0, 10.0] {
        let limits = limit(LimitQuantity::P95, most);
        let imu = need(&course, &scenario, &limits).allocated().unwrap().0;
        let model = imu.model(scenario.imu.rate_hz);
        let drifts = course.drifts(&scenario, &model).unwrap();
        let (place, worst) = Drift::largest(&drifts, LimitQuantity::P95).unwrap();
        assert!(
            (0.9975..=1.0).contains(&(worst / most)),
            "{worst} of {most} at {:?}",
            outages[place]
        );
        let values: Vec<f64> = drifts.iter().map(|d| d.value(LimitQuantity::P95)).collect();
        assert_eq!(worst, values.iter().copied().fold(0.0, f64::max));
        let least = values.iter().copied().fold(f64::MAX, f64::min);
        assert!(
            least < 0.95 * worst,
            "the beginnings must differ: {least} {worst}"
        );
    }
}

/// The search takes steps of up to a second, `run` of a fifth: what the steps leave is less than the reserve.
#[test]
fn the_imu_that_is_named_keeps_the_limit_in_the_steps_of_a_run() {
    let (scenario, trajectory) = setting();
    for (start_s, length_s) in [(133.0, 5.0), (120.0, 10.0), (100.0, 20.0), (150.0, 40.0)] {
        let outages = [outage(start_s, start_s + length_s)];
        let course = OutagePlacements::new(&scenario, &trajectory, &outages).unwrap();
        let limits = limit(LimitQuantity::Rmse, 1.0 + 0.005 * length_s * length_s);
        let imu = need(&course, &scenario, &limits).allocated().unwrap().0;
        let model = imu.model(scenario.imu.rate_hz);
        let track = scenario.track(&trajectory, &model, &outages).unwrap();
        let end = end_of_outage(&scenario, &trajectory, &model, &outages, &track);
        let share = end[0].hypot(end[1]) / limits[0].most;
        assert!((0.9975..=1.0).contains(&share), "{length_s} s: {share}");
    }
}

/// White noise in a step of a second is the sum of that in its parts, to rounding.
#[test]
fn white_noise_does_not_know_the_length_of_steps() {
    let (scenario, trajectory) = setting();
    let model = Model::pooled(scenario.imu.rate_hz, &white(1e-3), &white(1e-7));
    let outages = [outage(133.0, 138.0)];
    let track = scenario.track(&trajectory, &model, &outages).unwrap();
    let at_end = |track: &Track| end_of_outage(&scenario, &trajectory, &model, &outages, track);
    for (fine, merged) in at_end(&track).into_iter().zip(at_end(&track.merged())) {
        assert_relative_eq!(merged, fine, max_relative = 1e-9);
    }
}

/// RMSE at the end of an outage of the filter that knows the model.
fn end_of_outage(
    scenario: &Scenario,
    trajectory: &Trajectory,
    model: &Model,
    outage: &[Outage],
    track: &Track,
) -> [f64; REPORTED] {
    let filter_model = scenario
        .with_full_noise()
        .filter_model(model, outage, track)
        .unwrap();
    let experiment = scenario.experiment(trajectory, Truth::Model(model), &[], outage, 1);
    let truth = TruthModel::together(&TruthModel::sources(&experiment, model));
    FilterPass::new(track, &filter_model).errors_at_ends(&truth)[0]
        .errors
        .rmse()
}

/// What a pass along the trajectory with one outage alone finds: outages that overlap, that begin between fixes or within
/// the first second, that last to the end; fixes at 5 Hz, and heights within the outage.
#[test]
fn outages_beside_one_another_are_as_each_alone() {
    let settings = "gnss.rate_hz = 5\nbaro = { rate_hz = 1, sigma_m = 0.5 }";
    for scenario in [Scenario::default(), toml::from_str(settings).unwrap()] {
        let trajectory = town(4);
        let axis = Composite::new(vec![
            Process::white(1e-5).unwrap(),
            Process::ar1(0.9999, 1e-10).unwrap(),
        ]);
        let model = Model::pooled(scenario.imu.rate_hz, &axis, &axis);
        let end_s = trajectory.end_s();
        let outages = [
            outage(150.0, 190.0),
            outage(100.5, 130.25),
            outage(140.0, 170.0),
            outage(0.5, 30.0),
            outage(end_s - 20.0, end_s),
        ];
        let drifts = OutagePlacements::new(&scenario, &trajectory, &outages)
            .unwrap()
            .drifts(&scenario, &model)
            .unwrap();
        for (outage, drift) in outages.iter().map(std::slice::from_ref).zip(drifts) {
            let track = scenario
                .track(&trajectory, &model, outage)
                .unwrap()
                .merged();
            let alone = end_of_outage(&scenario, &trajectory, &model, outage, &track);
            let found = [
                drift.value(LimitQuantity::Rmse),
                drift.angles_deg[0],
                drift.angles_deg[2],
            ];
            let expected = [alone[0].hypot(alone[1]), alone[6], alone[8]];
            assert_relative_eq!(found[..], expected[..], max_relative = 1e-9);
        }
    }
}

/// The error after a part of a long outage is that at the end of a short one, to rounding: who meets a limit at the end
/// of an outage meets it in the curve.
#[test]
fn a_curve_holds_the_ends_of_all_shorter_outages() {
    let (scenario, trajectory) = setting();
    let limits = limit(LimitQuantity::P95, 20.0);
    let course = |end_s: f64| {
        OutagePlacements::new(&scenario, &trajectory, &[Outage { end_s, ..OUTAGE }]).unwrap()
    };
    let at_end = course(170.0);
    let imu = need(&at_end, &scenario, &limits).allocated().unwrap().0;
    let model = imu.model(scenario.imu.rate_hz);
    let end = at_end.drifts(&scenario, &model).unwrap()[0].value(LimitQuantity::P95);
    let curve = &course(190.0).curves(&scenario, &model).unwrap()[0];
    let short = curve.iter().find(|drift| drift.after_s == 20.0).unwrap();
    assert_relative_eq!(short.value(LimitQuantity::P95), end, max_relative = 1e-9);
    assert!(curve.last().is_some_and(|drift| drift.after_s == 40.0) && curve.len() == 40);
}

/// After a minute a curve takes steps of five seconds, and an outage that ends between two of them ends with shorter ones: what
/// they leave beside steps of a second is less than the reserve of the search, in turns and with a bias that changes within one.
#[test]
fn long_steps_through_an_outage_are_as_good_as_short_ones() {
    let (scenario, trajectory) = setting();
    let axis = Composite::new(vec![
        Process::white(1e-5).unwrap(),
        Process::ar1(0.999, 1e-9).unwrap(),
        Process::ar1(0.9999, 1e-10).unwrap(),
    ]);
    let model = Model::pooled(scenario.imu.rate_hz, &axis, &axis);
    let long = [outage(20.0, 170.0)];
    let course = OutagePlacements::new(&scenario, &trajectory, &long).unwrap();
    let curve = &course.curves(&scenario, &model).unwrap()[0];
    assert_eq!(curve.len(), 60 + 18);
    for length_s in [65.0, 67.0, 110.0, 150.0] {
        let outages = [outage(20.0, 20.0 + length_s)];
        let track = scenario
            .track(&trajectory, &model, &outages)
            .unwrap()
            .merged();
        let alone = end_of_outage(&scenario, &trajectory, &model, &outages, &track);
        let expected = [alone[0].hypot(alone[1]), alone[6], alone[8]];
        let at_end = course.drifts_in(&outages, &scenario, &model).unwrap();
        let in_curve = curve.iter().filter(|drift| drift.after_s == length_s);
        for drift in in_curve.chain(&at_end) {
            let rmse = drift.value(LimitQuantity::Rmse);
            let found = [rmse, drift.angles_deg[0], drift.angles_deg[2]];
            assert_relative_eq!(found[..], expected[..], max_relative = 1.5e-3);
        }
    }
}

/// A Rayleigh variable without a mean, its length where the mean is all there is.
#[test]
fn quantiles_of_a_horizontal_error_have_their_closed_forms() {
    let drift = |mean_m, variance: f64| Drift {
        after_s: 1.0,
        mean_m,
        covariance_m2: [[variance, 0.0], [0.0, variance]],
        angles_deg: [0.0; 3],
    };
    for (found, probability) in [(LimitQuantity::P50, 0.5_f64), (LimitQuantity::P95, 0.95)] {
        let rayleigh = 2.0 * (-2.0 * (1.0 - probability).ln()).sqrt();
        assert_relative_eq!(
            drift([0.0; 2], 4.0).value(found),
            rayleigh,
            max_relative = 1e-9
        );
        assert_abs_diff_eq!(drift([3.0, -4.0], 0.0).value(found), 5.0, epsilon = 1e-9);
        // along a mean of 500 σ it is normal; across, it adds σ²/(2·5), 1e-5 m
        let normal = [0.0, 1.644_853_627][usize::from(probability > 0.9)];
        assert_abs_diff_eq!(
            drift([3.0, -4.0], 1e-4).value(found) - 5.0,
            0.01 * normal,
            epsilon = 2e-5
        );
    }
    assert_abs_diff_eq!(
        drift([3.0, -4.0], 2.0).value(LimitQuantity::Rmse),
        29.0_f64.sqrt(),
        epsilon = 1e-12
    );
}

/// An accelerometer bias b that no fix corrects moves a vehicle by b t²/2 in an outage; an IMU without errors leaves what
/// GNSS and start leave.
#[test]
fn an_imu_without_errors_leaves_what_gnss_and_start_leave() {
    let (mut scenario, trajectory) = setting();
    let model = Model::pooled(scenario.imu.rate_hz, &white(1e-8), &white(1e-14));
    // before the first fix nothing is known of the bias: 0.1 m/s² moves by 20 m in 20 s on each axis
    let start = [outage(0.0, 20.0)];
    let margins = |scenario: &Scenario| {
        let course = OutagePlacements::new(scenario, &trajectory, &start).unwrap();
        margins(&course, scenario, &model, &limit(LimitQuantity::Rmse, 6.0))
    };
    scenario.initial.att_sigma_deg = [1e-3; 3];
    scenario.initial.vel_sigma_m_s = [1e-3; 3];
    scenario.initial.pos_sigma_m = [1e-2; 3];
    (
        scenario.imu.turn_on_bias_accel_m_s2,
        scenario.initial.accel_bias_sigma_m_s2,
    ) = (Some(0.1), Some(0.1));
    let biased = margins(&scenario);
    let error = 0.1 * 20.0_f64.powi(2) / 2.0 * 2.0_f64.sqrt();
    assert_relative_eq!(biased.worst.value, error, max_relative = 0.01);
    assert!(
        !biased.met && biased.without_imu_errors.margin() >= 0.0,
        "{biased:?}"
    );
    // a velocity of the start that is off by 10 m/s moves by 200 m in that time, whatever the IMU
    scenario.initial.vel_sigma_m_s = [10.0; 3];
    let fast = margins(&scenario);
    let floor = fast.without_imu_errors.value;
    assert_relative_eq!(floor, 200.0 * 2.0_f64.sqrt(), max_relative = 0.01);
    assert!(fast.without_imu_errors.margin() < 0.0, "{fast:?}");
}

/// White noise and flicker noise whose Allan deviation together is lowest at `floor`, up to 568 s: eight Gauss-Markov
/// processes of one variance, a factor of four apart from 0.25 s on, are level to 4 % from 2 s to 568 s.
fn flicker_noise(density: f64, floor: f64) -> Composite {
    let noise = |s2: f64| {
        let process = |k: i32| Process::gauss_markov(0.25_f64.powi(k), s2, 100.0).unwrap();
        let white = Process::white(density * density * 100.0).unwrap();
        Composite::new(std::iter::once(white).chain((-1..7).map(process)).collect())
    };
    let lowest = |s2: f64| {
        let times = (8..74).map(|k| 100.0 * 2.0_f64.powf(f64::from(k) / 8.0));
        times
            .map(|m| noise(s2).allan_variance(m as u32))
            .fold(f64::MAX, f64::min)
            .sqrt()
    };
    let (mut low, mut high) = (0.0, 10.0 * floor * floor);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if lowest(middle) < floor {
            low = middle
        } else {
            high = middle
        }
    }
    noise(high)
}

/// An IMU of flicker noise whose Allan deviation is as on the datasheet, its lowest point the bias instability, drifts as
/// the model of the datasheet says: the Allan deviation of the one is within 4 % above the floor, that of the other within
/// 7.5 %, and white noise N puts it √(1 + N²/(568 s·B²)) above. (Read as the largest Allan deviation of one Gauss-Markov
/// process the same figures gave little more than half the drift.)
#[test]
fn a_datasheet_is_not_read_optimistically() {
    let (scenario, trajectory) = setting();
    let course = OutagePlacements::new(&scenario, &trajectory, &[OUTAGE]).unwrap();
    let p95 = |model: &Model| course.drifts(&scenario, model).unwrap()[0].value(LimitQuantity::P95);
    for name in ["vn100", "adis16488"] {
        let sheet = catalogued(name).unwrap().unwrap();
        let figures =
            |s| [Figure::Noise, Figure::Bias].map(|figure| sheet.value(s, figure).unwrap());
        let [[n_a, b_a], [n_g, b_g]] = Sensor::ALL.map(figures);
        let truth = Model::pooled(100.0, &flicker_noise(n_a, b_a), &flicker_noise(n_g, b_g));
        let model = sheet.model_file(100.0).unwrap().file.model;
        let above = [(n_a, b_a), (n_g, b_g)].map(|(n, b)| (1.0 + n * n / (567.8 * b * b)).sqrt());
        let ratio = p95(&model) / p95(&truth);
        assert!(
            ratio > 1.0 / 1.04 && ratio < 1.075 * above[0].max(above[1]),
            "{name}: {ratio} {above:?}"
        );
    }
}
