//! Figures of the targets; their texts and warnings are in `tests/cli/transcripts/export.md`.

use super::targets::number;
use super::*;
use crate::io::model_file::TurnOn;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::{Model, Process};
use nav_sim_signal::units::{DEG, STANDARD_GRAVITY};

const RATE: f64 = 200.0;
const DT: f64 = 1.0 / RATE;
/// Data sheet: 0.02 m/s/√h and 0.15 °/√h.
const N_A: f64 = 0.02 / 60.0;
const N_G: f64 = 0.15 * DEG / 60.0;
const K_A: f64 = 3e-5;
const K_G: f64 = 2e-7;
/// Gauss-Markov biases of 40 µg and 5 °/h, 300 s each.
const B_A: f64 = 40e-6 * STANDARD_GRAVITY;
const B_G: f64 = 5.0 * DEG / 3600.0;
/// Turn-on biases.
const T_A: f64 = 0.05;
const T_G: f64 = 10.0 * DEG / 3600.0;

fn white(density: f64) -> Process {
    Process::white(density * density * RATE).unwrap()
}

fn walk(density: f64) -> Process {
    Process::random_walk(density * density / RATE).unwrap()
}

fn markov(sigma: f64, t_corr_s: f64) -> Process {
    Process::gauss_markov(1.0 / t_corr_s, sigma * sigma, RATE).unwrap()
}

fn model(accel: Vec<Process>, gyro: Vec<Process>) -> Model {
    Model::pooled(RATE, &Composite::new(accel), &Composite::new(gyro))
}

/// A model with its turn-on biases.
fn file(model: Model) -> ModelFile {
    let turn_on = TurnOn {
        accel_m_s2: Some([T_A; 3]),
        gyro_rad_s: Some([T_G; 3]),
    };
    ModelFile {
        turn_on: Some(turn_on),
        ..ModelFile::new(model)
    }
}

fn exported(target: &str, file: &ModelFile, policy: Policy) -> Result<Export, Failure> {
    Export::new(file, target.parse().unwrap(), policy, Horizon::default())
}

fn export(target: &str, accel: Vec<Process>, gyro: Vec<Process>, policy: Policy) -> Export {
    exported(target, &file(model(accel, gyro)), policy).unwrap()
}

fn walks(target: &str) -> Export {
    let (accel, gyro) = (vec![white(N_A), walk(K_A)], vec![white(N_G), walk(K_G)]);
    export(target, accel, gyro, Policy::Matched)
}

fn markovs(target: &str) -> Export {
    let (accel, gyro) = (markov(B_A, 300.0), markov(B_G, 300.0));
    export(
        target,
        vec![white(N_A), accel],
        vec![white(N_G), gyro],
        Policy::Strict,
    )
}

fn value(export: &Export, key: &str) -> f64 {
    let found = export.filled(&[]).0.into_iter().find(|e| e.key == key);
    found.unwrap_or_else(|| panic!("{key}")).value
}

#[track_caller]
fn assert_near(name: &str, found: f64, expected: f64, tolerance: f64) {
    let off = (found / expected - 1.0).abs();
    assert!(off < tolerance, "{name}: {found:e} {expected:e}");
}

#[track_caller]
fn assert_values(export: &Export, expected: &[(&str, f64)]) {
    for (key, expected) in expected {
        assert_near(key, value(export, key), *expected, 1e-12);
    }
}

/// Every target in the units of its documents.
#[test]
fn values_have_the_units_of_their_documents() {
    let kalibr = [
        ("accelerometer_noise_density", N_A),
        ("accelerometer_random_walk", K_A),
        ("gyroscope_noise_density", N_G),
        ("gyroscope_random_walk", K_G),
        ("update_rate", RATE),
    ];
    for target in ["kalibr", "openvins"] {
        assert_values(&walks(target), &kalibr);
    }
    let gtsam = [
        ("setAccelerometerCovariance", N_A * N_A),
        ("setGyroscopeCovariance", N_G * N_G),
        ("setBiasAccCovariance", K_A * K_A),
        ("setBiasOmegaCovariance", K_G * K_G),
    ];
    assert_values(&walks("gtsam"), &gtsam);
    let pyins = [
        ("accel_bias_sd", T_A),
        ("accel_noise", N_A),
        ("accel_bias_walk", K_A),
        ("gyro_bias_sd", T_G),
        ("gyro_noise", N_G),
        ("gyro_bias_walk", K_G),
    ];
    assert_values(&walks("pyins"), &pyins);
    // mGal and hours
    let kf_gins = [
        ("arw", 0.15),
        ("vrw", 0.02),
        ("gbstd", 5.0),
        ("abstd", B_A / 1e-5),
        ("corrtime", 300.0 / 3600.0),
    ];
    assert_values(&markovs("kf-gins"), &kf_gins);
    let simulator = [
        ("gyro_arw", 0.15),
        ("accel_vrw", 0.02),
        ("gyro_b_stability", 5.0),
        ("accel_b_stability", B_A),
        ("gyro_b_corr", 300.0),
        ("accel_b_corr", 300.0),
        ("gyro_b", 10.0),
        ("accel_b", T_A),
    ];
    assert_values(&markovs("gnss-ins-sim"), &simulator);
    // PSINS's µg is of its own g0
    let ug = 9.780_326_771_4e-6;
    let psins = [
        ("web", 0.15),
        ("wdb", N_A / ug),
        ("eb", 10.0),
        ("db", T_A / ug),
        ("sqrtR0G", 5.0),
        ("TauG", 300.0),
        ("sqrtR0A", B_A / ug),
        ("TauA", 300.0),
    ];
    assert_values(&markovs("psins"), &psins);
    let navego = [
        ("imu.arw", N_G),
        ("imu.vrw", N_A),
        ("imu.g_std", N_G * RATE.sqrt()),
        ("imu.gb_dyn", B_G),
        ("imu.gb_corr", 300.0),
        // white noise of this density through 1/(s + 1/T) has variance q²T/2
        ("imu.gb_psd", B_G * (2.0_f64 / 300.0).sqrt()),
        ("imu.gb_sta", T_G),
        ("imu.ab_sta", T_A),
    ];
    assert_values(&markovs("navego"), &navego);
}

/// In a second of steps of each program's own recursion, a velocity or angle must grow by N² and a bias by K².
#[test]
fn velocity_and_bias_grow_as_the_noise_does() {
    // within the ranges that PX4 and ArduPilot document
    let densities = [0.02, 1e-3, 1e-4, 2e-6];
    let [n_a, n_g, k_a, k_g] = densities;
    // the midpoint rule: intervals with two ends of weight dt/2 each
    let midpoint: fn(f64) -> f64 = |noise| 2.0 * (0.5 * DT * noise).powi(2) / DT;
    let stepped: fn(f64) -> f64 = |noise| noise * noise * DT;
    // GTSAM: each discrete sample has variance covariance/dt, and counts for dt; between nodes a bias has K√Δt
    let density: fn(f64) -> f64 = |noise| noise * noise;
    // FAST-LIO: P ← F P Fᵀ + (dt·f_w) Q (dt·f_w)ᵀ
    let variance: fn(f64) -> f64 = |covariance| covariance * DT * DT / DT;
    // steps of 0.01 s and of 0.012 s
    let px4: fn(f64) -> f64 = |noise| (0.01 * noise).powi(2) / 0.01;
    let ardupilot: fn(f64) -> f64 = |noise| (0.012 * noise).powi(2) / 0.012;
    for (target, keys, of_noise, of_bias) in [
        ("vins", "acc_n gyr_n acc_w gyr_w", midpoint, stepped),
        (
            "lio-sam",
            "imuAccNoise imuGyrNoise imuAccBiasN imuGyrBiasN",
            density,
            density,
        ),
        (
            "fast-lio",
            "acc_cov gyr_cov b_acc_cov b_gyr_cov",
            variance,
            variance,
        ),
        (
            "px4",
            "EKF2_ACC_NOISE EKF2_GYR_NOISE EKF2_ACC_B_NOISE EKF2_GYR_B_NOISE",
            px4,
            px4,
        ),
        (
            "ardupilot",
            "EK3_ACC_P_NSE EK3_GYRO_P_NSE EK3_ABIAS_P_NSE EK3_GBIAS_P_NSE",
            ardupilot,
            ardupilot,
        ),
    ] {
        let (accel, gyro) = (vec![white(n_a), walk(k_a)], vec![white(n_g), walk(k_g)]);
        let export = export(target, accel, gyro, Policy::Matched);
        let keys: Vec<&str> = keys.split(' ').collect();
        for (k, density) in densities.into_iter().enumerate() {
            let growth = if k < 2 { of_noise } else { of_bias };
            assert_near(
                keys[k],
                growth(value(&export, keys[k])),
                density * density,
                1e-12,
            );
        }
    }
}

/// White noise of BiasInstability through 1/(1 − phi z⁻¹) has variance B²/(1 − phi²) and decays as phi^k.
#[test]
fn matlabs_filter_is_the_gauss_markov_bias() {
    let export = markovs("matlab");
    let b = value(&export, "gyro.BiasInstability");
    let phi = value(&export, "gyro.BiasInstabilityCoefficients");
    assert_near("bias", b / (1.0 - phi * phi).sqrt(), B_G, 1e-10);
    assert_near("phi", -phi.ln() * 300.0 * RATE, 1.0, 1e-10);
    assert_values(
        &export,
        &[("gyro.NoiseDensity", N_G), ("accel.NoiseDensity", N_A)],
    );
}

/// KF-GINS has one correlation time: of all times from 2 s to 200 s the one with the least sum of squares of both
/// sensors, and the certificate is of that pair.
#[test]
fn kf_gins_has_one_correlation_time() {
    let processes = [
        vec![white(1e-4), markov(1e-3, 10.0)],
        vec![white(1e-5), markov(1e-4, 40.0)],
    ];
    let [accel, gyro] = processes.clone();
    let export = export("kf-gins", accel, gyro, Policy::Matched);
    let misfit = |t_corr_s: f64| -> f64 {
        let of_sensor = |processes: &Vec<Process>| -> f64 {
            let model = Composite::new(processes.clone());
            let curve = AllanCurve::largest(&[&model], RATE, Horizon::default()).unwrap();
            let pair = curve.pair(Policy::Matched, BiasModel::MarkovOf(t_corr_s));
            let samples =
                (0..=106).map(|k| (RATE * 2.0_f64.powf(f64::from(k) / 16.0)).round() as u32);
            let log = |m| 0.5 * (pair.allan_variance(m, RATE) / model.allan_variance(m)).ln();
            samples.map(|m| log(m).powi(2)).sum()
        };
        processes.iter().map(of_sensor).sum()
    };
    let found_s = value(&export, "corrtime") * 3600.0;
    let times = (0..=60).map(|i| 2.0 * 100.0_f64.powf(f64::from(i) / 60.0));
    let best = times.map(misfit).fold(f64::MAX, f64::min);
    assert!(10.0 < found_s && found_s < 40.0, "{found_s} s");
    assert!(misfit(found_s) < 1.001 * best, "{found_s} s");
    let certified = export.sensors[0].exported.markov.unwrap();
    assert_near("certificate", certified.t_corr_s, found_s, 1e-12);
}

/// A sensor whose noise is white leaves the correlation time to the other, whichever it is: the pair comes back exactly,
/// a random walk as the longest time that the search knows (thirty horizons).
#[test]
fn a_sensor_without_a_bias_has_no_say_in_the_correlation_time() {
    let (still, moving) = (vec![white(N_A)], vec![white(N_G), markov(B_G, 300.0)]);
    let hours = |export: &Export| value(export, "corrtime");
    for policy in [Policy::Matched, Policy::Envelope] {
        for sensor in [0, 1] {
            let mut sensors = [still.clone(), still.clone()];
            sensors[sensor] = moving.clone();
            let [accel, gyro] = sensors;
            let export = export("kf-gins", accel, gyro, policy);
            let markov = export.sensors[sensor].exported.markov.unwrap();
            assert_near("time", hours(&export) * 3600.0, 300.0, 1e-2);
            assert_near("sigma", markov.sigma, B_G, 1e-2);
        }
        let walk = export(
            "kf-gins",
            vec![white(N_A), walk(K_A)],
            still.clone(),
            policy,
        );
        assert_near("walk", hours(&walk) * 3600.0, 3000.0, 1e-6);
    }
    // where nothing wanders, no time is said
    let white = export("navego", still.clone(), still, Policy::Matched);
    assert!(value(&white, "imu.gb_corr").is_infinite());
}

/// Quantization noise is left out of a matched pair, as is said; an envelope has it in its N. Its share, of 3 q²/(T/dt)² at 1 s as
/// much as N²/T, is half of the variance.
#[test]
fn processes_that_are_left_out_are_told() {
    let coarse = Process::quantization(N_A * N_A * RATE * RATE / 3.0).unwrap();
    for (policy, count) in [(Policy::Matched, 1), (Policy::Envelope, 0)] {
        let accel = vec![white(N_A), walk(K_A), coarse];
        let export = export("kalibr", accel, vec![white(N_G), walk(K_G)], policy);
        let share =
            "quantization noise or drift, 50 % of the Allan variance at 1.00 s, is left out";
        let told = export.doubts().join("\n");
        assert_eq!(told.matches(share).count(), count, "{policy:?}: {told}");
    }
    assert!(walks("kalibr").doubts().is_empty());
}

/// A random walk has no deviation of its own at the start: that which it reaches within the horizon, 100 s, stands for it.
#[test]
fn a_walk_begins_with_the_deviation_that_it_reaches() {
    let model = model(vec![white(N_A), walk(K_A)], vec![white(N_G), walk(K_G)]);
    let export = exported("pyins", &ModelFile::new(model), Policy::Strict).unwrap();
    for (key, k) in [("accel_bias_sd", K_A), ("gyro_bias_sd", K_G)] {
        assert_near(key, value(&export, key), 10.0 * k, 1e-6);
    }
}

#[test]
fn the_largest_of_axes_that_differ_is_exported() {
    let mut model = model(vec![white(N_A), walk(K_A)], vec![white(N_G), walk(K_G)]);
    model.axes[2] = Composite::new(vec![white(2.0 * N_A), walk(K_A)]);
    let mut file = file(model);
    let export = exported("kalibr", &file, Policy::Strict).unwrap();
    assert_values(&export, &[("accelerometer_noise_density", 2.0 * N_A)]);
    let told = "accel: axes differ (Allan deviation at 1 s: x 0.50, y 0.50, z 1.00)";
    assert!(
        export.doubts()[0].starts_with(told),
        "{:?}",
        export.doubts()
    );
    file.missing = Channel::named("gyro");
    let refused = exported("kalibr", &file, Policy::Strict).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "the model has no gyro, and kalibr needs both"
    );
}

#[test]
fn numbers_are_numbers_in_yaml() {
    let shown = [2e-5, 1.25e-7, 100.0, 0.02, 0.0, 1e7].map(number);
    assert_eq!(
        shown,
        ["2.0e-5", "1.25e-7", "100.0", "0.02", "0.0", "1.0e7"]
    );
}

/// A strict pair takes the model's bias as it is, of either kind, or is refused.
#[test]
fn a_strict_pair_does_not_drop_the_bias() {
    let strict = |target: &str, bias: Vec<Process>| {
        let [accel, gyro] = [N_A, N_G].map(|n| [vec![white(n)], bias.clone()].concat());
        let exported = exported(target, &file(model(accel, gyro)), Policy::Strict);
        exported.err().map(|failure| failure.to_string())
    };
    // a model that does not wander has nothing to drop
    assert_eq!(strict("kalibr", Vec::new()), None);
    for (target, bias, kind) in [
        ("kalibr", markov(1e-3, 100.0), "Gauss-Markov bias"),
        ("kf-gins", walk(K_A), "random walk"),
    ] {
        let refusal = format!("{target} has no {kind}, and the model's accel has one");
        assert_eq!(strict(target, vec![bias]), Some(refusal));
    }
}

/// Gazebo's own recursion in its variances: the bias of each sample ends at that of the model and keeps exp(−dt/τ) of itself,
/// from 0 at the start.
#[test]
fn gazebo_has_a_gauss_markov_bias() {
    let export = markovs("gazebo");
    for (sensor, n, sigma, turn_on) in [
        ("angular_velocity", N_G, B_G, T_G),
        ("linear_acceleration", N_A, B_A, T_A),
    ] {
        let of = |key: &str| value(&export, &format!("{sensor}.{key}"));
        let tau_s = of("dynamic_bias_correlation_time");
        let stddev = of("dynamic_bias_stddev");
        let driven = -stddev * stddev * tau_s / 2.0 * (-2.0 * DT / tau_s).exp_m1();
        let phi = (-DT / tau_s).exp();
        // ten correlation times: e^-20 is left of the start
        let steps = (10.0 * tau_s * RATE) as usize;
        let variance = (0..steps).fold(0.0, |variance, _| phi * phi * variance + driven);
        assert_near(sensor, variance, sigma * sigma, 1e-8);
        assert_near(sensor, tau_s, 300.0, 1e-9);
        assert_near(sensor, of("stddev"), n * RATE.sqrt(), 1e-12);
        assert_near(sensor, of("bias_stddev"), turn_on, 1e-12);
        assert_eq!(of("bias_mean"), 0.0);
    }
    // a model without a bias switches it off
    let white = self::export(
        "gazebo",
        vec![white(N_A)],
        vec![white(N_G)],
        Policy::Matched,
    );
    assert_eq!(
        value(&white, "angular_velocity.dynamic_bias_correlation_time"),
        0.0
    );
}

/// A filter that averages the samples of a second, each with the variance of the message, knows the mean to N.
#[test]
fn ros_messages_have_the_variance_of_a_sample() {
    let export = walks("ros-imu-covariance");
    let keys = [
        ("linear_acceleration_covariance", N_A),
        ("angular_velocity_covariance", N_G),
    ];
    for (key, n) in keys {
        // information of independent measurements adds
        assert_near(key, value(&export, key) / RATE, n * n, 1e-12);
    }
}

/// A name with a line break, a control sequence or the end of a comment stays in its comment, in every syntax.
#[test]
fn names_of_models_forge_nothing() {
    for target in Target::ALL {
        let export = if target.bias == BiasModel::Walk {
            walks
        } else {
            markovs
        }(target.name);
        let clean = export.text("m");
        let text = export.text("m\nupdate_rate: 1\u{1b}[2J\r --> <imu>");
        assert_eq!(text.lines().count(), clean.lines().count(), "{text}");
        let forged = ["\u{1b}", "m --> <imu>", "\nupdate_rate: 1\u{1b}", "NaN"];
        assert!(!forged.iter().any(|words| text.contains(words)), "{text}");
        // a comment of XML ends at the second pair of hyphens
        assert!(
            text.lines().all(|line| line.matches("--").count() <= 2),
            "{text}"
        );
        for entry in export.filled(&[]).0 {
            let name = entry.key.rsplit('.').next().unwrap();
            let shown = number(entry.value.abs());
            let is_shown = |line: &str| line.contains(name) && line.contains(&shown);
            assert!(clean.lines().any(is_shown), "{}:\n{clean}", entry.key);
        }
    }
}

/// The figures of its reading are exported of a model that does not fit.
#[test]
fn a_reading_is_exported_in_the_place_of_the_processes() {
    let whites = |n_a, n_g| model(vec![white(n_a)], vec![white(n_g)]);
    let mut read = file(whites(3.0 * N_A, 2.0 * N_G));
    read.reading = Some(Box::new(ModelFile::new(whites(N_A, N_G))));
    let sensors = exported("kalibr", &read, Policy::Matched).unwrap().sensors;
    for (sensor, density) in sensors.iter().zip([N_A, N_G]) {
        assert_near("density", sensor.exported.density, density, 1e-9);
    }
}
