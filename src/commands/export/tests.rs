use super::targets::number;
use super::*;
use crate::io::model_file::TurnOn;
use nav_sim_signal::imu::Channel;
use nav_sim_signal::noise::{Model, Process};
use nav_sim_signal::units::{DEG, STANDARD_GRAVITY};

const RATE: f64 = 200.0;
/// Data sheet: 0.02 m/s/√h and 0.15 °/√h.
const N_A: f64 = 0.02 / 60.0;
const N_G: f64 = 0.15 * DEG / 60.0;
const K_A: f64 = 3e-5;
const K_G: f64 = 2e-7;

fn white(density: f64) -> Process {
    Process::white(density * density * RATE).unwrap()
}

fn walk(density: f64) -> Process {
    Process::random_walk(density * density / RATE).unwrap()
}

fn markov(sigma: f64, t_corr_s: f64) -> Process {
    Process::gauss_markov(1.0 / t_corr_s, sigma * sigma, RATE).unwrap()
}

/// A model with turn-on biases of 0.05 m/s² and 10 °/h.
fn file(model: Model) -> ModelFile {
    let turn_on = TurnOn {
        accel_m_s2: Some([0.05; 3]),
        gyro_rad_s: Some([10.0 * DEG / 3600.0; 3]),
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
    let model = Model::pooled(RATE, &Composite::new(accel), &Composite::new(gyro));
    exported(target, &file(model), policy).unwrap()
}

fn walks(target: &str) -> Export {
    export(
        target,
        vec![white(N_A), walk(K_A)],
        vec![white(N_G), walk(K_G)],
        Policy::Matched,
    )
}

/// Biases of 40 µg and 5 °/h, 300 s each.
fn markovs(target: &str) -> Export {
    let (accel, gyro) = (
        markov(40e-6 * STANDARD_GRAVITY, 300.0),
        markov(5.0 * DEG / 3600.0, 300.0),
    );
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

fn assert_values(export: &Export, expected: &[(&str, f64)]) {
    for (key, expected) in expected {
        let found = value(export, key);
        assert!(
            (found / expected - 1.0).abs() < 1e-12,
            "{key}: {found:e} {expected:e}"
        );
    }
}

/// What Kalibr reads back from the text is what the model has: 0.15 °/√h = 4.363e-5 rad/s/√Hz.
#[test]
fn kalibr_reads_back_the_densities() {
    for target in ["kalibr", "openvins"] {
        let text = walks(target).text("model.toml");
        let read = |key: &str| -> f64 {
            let line = text
                .lines()
                .find_map(|l| l.trim().strip_prefix(key)?.strip_prefix(": "))
                .unwrap();
            line.split('#').next().unwrap().trim().parse().unwrap()
        };
        let expected = [
            ("accelerometer_noise_density", N_A),
            ("accelerometer_random_walk", K_A),
            ("gyroscope_noise_density", N_G),
            ("gyroscope_random_walk", K_G),
            ("update_rate", RATE),
        ];
        for (key, expected) in expected {
            assert!((read(key) / expected - 1.0).abs() < 1e-12, "{key}");
        }
        assert!((read("gyroscope_noise_density") - 4.363_323_13e-5).abs() < 1e-13);
    }
}

/// Standard deviations of a sample at 200 Hz. In one second a velocity or angle must grow by N²: 200 intervals with two ends of
/// weight dt/2 each. The bias is K √200.
#[test]
fn vins_has_noise_of_a_sample() {
    let dt = 1.0_f64 / 200.0;
    let of_end = (1.0 / (200.0 * 2.0 * (dt / 2.0).powi(2))).sqrt();
    let root = 200.0_f64.sqrt();
    let expected = [
        ("acc_n", N_A * of_end),
        ("gyr_n", N_G * of_end),
        ("acc_w", K_A * root),
        ("gyr_w", K_G * root),
    ];
    assert_values(&walks("vins"), &expected);
}

#[test]
fn gtsam_has_covariances() {
    let expected = [
        ("setAccelerometerCovariance", N_A * N_A),
        ("setGyroscopeCovariance", N_G * N_G),
        ("setBiasAccCovariance", K_A * K_A),
        ("setBiasOmegaCovariance", K_G * K_G),
    ];
    assert_values(&walks("gtsam"), &expected);
}

/// In one second of steps, velocity and bias must grow by N² and K²: 1/dt steps of (dt·noise)² each.
#[test]
fn autopilots_grow_as_the_noise_does() {
    let (n_a, n_g, k_a, k_g) = (0.02, 1e-3, 1e-4, 2e-6);
    let noise = |target| {
        export(
            target,
            vec![white(n_a), walk(k_a)],
            vec![white(n_g), walk(k_g)],
            Policy::Matched,
        )
    };
    let px4 = [
        ("EKF2_ACC_NOISE", n_a),
        ("EKF2_GYR_NOISE", n_g),
        ("EKF2_ACC_B_NOISE", k_a),
        ("EKF2_GYR_B_NOISE", k_g),
    ];
    let ardupilot = [
        ("EK3_ACC_P_NSE", n_a),
        ("EK3_GYRO_P_NSE", n_g),
        ("EK3_ABIAS_P_NSE", k_a),
        ("EK3_GBIAS_P_NSE", k_g),
    ];
    for (target, dt, keys) in [("px4", 0.01_f64, px4), ("ardupilot", 0.012, ardupilot)] {
        let export = noise(target);
        for (key, density) in keys {
            let variance_of_a_second = (dt * value(&export, key)).powi(2) / dt;
            assert!(
                (variance_of_a_second / (density * density) - 1.0).abs() < 1e-12,
                "{key}"
            );
        }
        assert!(
            export.doubts().iter().any(|d| d.contains("vibration")),
            "{:?}",
            export.doubts()
        );
    }
}

/// 3.3e-4/√0.01 = 3.3e-3 m/s² is below PX4's 0.01.
#[test]
fn values_outside_documented_ranges_are_told() {
    let export = walks("px4");
    let entries = export.filled(&[]).0;
    let accel = entries.iter().find(|e| e.key == "EKF2_ACC_NOISE").unwrap();
    assert!((accel.wanted.unwrap() / (N_A / 0.1) - 1.0).abs() < 1e-12);
    assert_eq!(accel.value, 0.01);
    let told = "EKF2_ACC_NOISE is 1.000e-2, the end of its range, for 3.333e-3";
    assert!(
        export.doubts().iter().any(|d| d == told),
        "{:?}",
        export.doubts()
    );
    assert!(
        export
            .text("m")
            .contains("param set EKF2_ACC_NOISE 0.01  # m/s^2; "),
        "{}",
        export.text("m")
    );
}

/// Every Gauss-Markov target in the units of its documents: 0.15 °/√h, 0.02 m/s/√h, 5 °/h, 40 µg, 300 s.
#[test]
fn gauss_markov_targets_have_data_sheet_units() {
    let milligal = 40e-6 * STANDARD_GRAVITY / 1e-5;
    let kf_gins = [
        ("arw", 0.15),
        ("vrw", 0.02),
        ("gbstd", 5.0),
        ("abstd", milligal),
        ("corrtime", 300.0 / 3600.0),
    ];
    assert_values(&markovs("kf-gins"), &kf_gins);
    let simulator = [
        ("gyro_arw", 0.15),
        ("accel_vrw", 0.02),
        ("gyro_b_stability", 5.0),
        ("accel_b_stability", 40e-6 * STANDARD_GRAVITY),
        ("gyro_b_corr", 300.0),
        ("accel_b_corr", 300.0),
        ("gyro_b", 10.0),
        ("accel_b", 0.05),
    ];
    assert_values(&markovs("gnss-ins-sim"), &simulator);
    // PSINS's µg is of its own g0
    let ug = 9.780_326_771_4e-6;
    let psins = [
        ("web", 0.15),
        ("wdb", N_A / ug),
        ("eb", 10.0),
        ("db", 0.05 / ug),
        ("sqrtR0G", 5.0),
        ("TauG", 300.0),
        ("sqrtR0A", 40e-6 * STANDARD_GRAVITY / ug),
        ("TauA", 300.0),
    ];
    assert_values(&markovs("psins"), &psins);
    let sigma = 5.0 * DEG / 3600.0;
    let navego = [
        ("imu.arw", N_G),
        ("imu.vrw", N_A),
        ("imu.g_std", N_G * RATE.sqrt()),
        ("imu.gb_dyn", sigma),
        ("imu.gb_corr", 300.0),
        // white noise of this density through 1/(s + 1/T) has variance q²T/2
        ("imu.gb_psd", sigma * (2.0_f64 / 300.0).sqrt()),
        ("imu.gb_sta", 10.0 * DEG / 3600.0),
        ("imu.ab_sta", 0.05),
    ];
    assert_values(&markovs("navego"), &navego);
}

#[test]
fn pyins_has_si_units() {
    let expected = [
        ("accel_bias_sd", 0.05),
        ("accel_noise", N_A),
        ("accel_bias_walk", K_A),
        ("gyro_bias_sd", 10.0 * DEG / 3600.0),
        ("gyro_noise", N_G),
        ("gyro_bias_walk", K_G),
    ];
    assert_values(&walks("pyins"), &expected);
}

/// White noise of BiasInstability through 1/(1 − phi z⁻¹) has variance B²/(1 − phi²) and decays as phi^k.
#[test]
fn matlabs_filter_is_the_gauss_markov_bias() {
    let export = markovs("matlab");
    let (b, phi) = (
        value(&export, "gyro.BiasInstability"),
        value(&export, "gyro.BiasInstabilityCoefficients"),
    );
    let sigma = 5.0 * DEG / 3600.0;
    assert!((b / (1.0 - phi * phi).sqrt() / sigma - 1.0).abs() < 1e-10);
    assert!((phi.ln() * 300.0 * RATE + 1.0).abs() < 1e-10);
    assert_values(
        &export,
        &[("gyro.NoiseDensity", N_G), ("accel.NoiseDensity", N_A)],
    );
}

/// Each line of every target carries its unit; the head is comments.
#[test]
fn every_value_has_its_unit_on_its_line() {
    for target in Target::ALL {
        let export = if target.bias == Bias::Walk {
            walks(target.name)
        } else {
            markovs(target.name)
        };
        let text = export.text("model.toml");
        assert!(
            text.contains(" × the model") && text.contains("200 Hz"),
            "{text}"
        );
        for entry in export.filled(&[]).0 {
            let line = text.lines().find(|l| {
                l.contains(entry.key.rsplit('.').next().unwrap())
                    && l.contains(&number(entry.value.abs()))
            });
            assert!(
                line.is_some() && text.contains(&format!("{}; ", entry.unit)),
                "{}:\n{text}",
                entry.key
            );
        }
    }
}

/// KF-GINS has one correlation time: of all times from 2 s to 200 s the one with the least sum of squares of both
/// sensors, and the certificate is of that pair.
#[test]
fn kf_gins_has_one_correlation_time() {
    let (accel, gyro) = (
        vec![white(1e-4), markov(1e-3, 10.0)],
        vec![white(1e-5), markov(1e-4, 40.0)],
    );
    let export = export("kf-gins", accel.clone(), gyro.clone(), Policy::Matched);
    let curves = [accel, gyro]
        .map(|p| AllanCurve::largest(&[&Composite::new(p)], RATE, Horizon::default()).unwrap());
    let misfit = |t_corr_s: f64| -> f64 {
        let samples: Vec<u32> = (0..=106)
            .map(|k| (RATE * 2.0_f64.powf(f64::from(k) / 16.0)).round() as u32)
            .collect();
        let of_sensor = |curve: &AllanCurve, processes: &[Process]| -> f64 {
            let pair = curve.pair(Policy::Matched, Bias::MarkovOf(t_corr_s));
            let model = Composite::new(processes.to_vec());
            let log =
                |m: &u32| 0.5 * (pair.allan_variance(*m, RATE) / model.allan_variance(*m)).ln();
            samples.iter().map(|m| log(m).powi(2)).sum()
        };
        of_sensor(&curves[0], &[white(1e-4), markov(1e-3, 10.0)])
            + of_sensor(&curves[1], &[white(1e-5), markov(1e-4, 40.0)])
    };
    let found_s = value(&export, "corrtime") * 3600.0;
    let best = (0..=60)
        .map(|i| 2.0 * 100.0_f64.powf(f64::from(i) / 60.0))
        .map(misfit)
        .fold(f64::MAX, f64::min);
    assert!(
        10.0 < found_s && found_s < 40.0 && misfit(found_s) < 1.001 * best,
        "{found_s} s"
    );
    assert!((export.sensors[0].exported.markov.unwrap().t_corr_s / found_s - 1.0).abs() < 1e-12);
}

/// A sensor whose noise is white leaves the correlation time to the other, whichever it is: the pair comes back exactly,
/// a random walk as the longest time that the search knows (thirty horizons).
#[test]
fn a_sensor_without_a_bias_has_no_say_in_the_correlation_time() {
    let (bias, t_s) = (5.0 * DEG / 3600.0, 300.0);
    let (still, moving) = (vec![white(N_A)], vec![white(N_G), markov(bias, t_s)]);
    for policy in [Policy::Matched, Policy::Envelope] {
        let gyro_moves = export("kf-gins", still.clone(), moving.clone(), policy);
        let accel_moves = export("kf-gins", moving.clone(), still.clone(), policy);
        for (export, sensor) in [(gyro_moves, 1), (accel_moves, 0)] {
            let markov = export.sensors[sensor].exported.markov.unwrap();
            assert!(
                (value(&export, "corrtime") * 3600.0 / t_s - 1.0).abs() < 1e-2,
                "{policy:?} {markov:?}"
            );
            assert!(
                (markov.sigma / bias - 1.0).abs() < 1e-2,
                "{policy:?} {markov:?}"
            );
        }
        let walk = export(
            "kf-gins",
            vec![white(N_A), walk(K_A)],
            still.clone(),
            policy,
        );
        assert!(
            (value(&walk, "corrtime") * 3600.0 / 3000.0 - 1.0).abs() < 1e-6,
            "{policy:?}"
        );
    }
    // where nothing wanders, no time is said
    let white = export("navego", still.clone(), still, Policy::Matched);
    assert!(value(&white, "imu.gb_corr").is_infinite());
}

#[test]
fn doubts_are_told() {
    let fast = Process::ar1(0.5, 1e-6).unwrap();
    let strict = export(
        "kalibr",
        vec![fast, walk(K_A)],
        vec![white(N_G), walk(K_G)],
        Policy::Strict,
    );
    let doubts = strict.doubts().join("\n");
    assert!(
        doubts.contains("accel: N is 0") && doubts.contains("--policy matched"),
        "{doubts}"
    );
    // K²/3 over K²/3 + sigma2 dt/(1 − phi)²: √(3e-10/(3e-10 + 2e-8)) = 0.122
    assert!(
        doubts.contains("accel: 0.12 times the model's Allan deviation at 1.00 s"),
        "{doubts}"
    );
    assert_eq!(walks("kalibr").doubts(), Vec::<String>::new());
    let still = export(
        "kalibr",
        vec![white(N_A)],
        vec![white(N_G), walk(K_G)],
        Policy::Matched,
    );
    let doubts = still.doubts().join("\n");
    assert!(
        doubts.contains("accel: K is 0") && !doubts.contains("gyro: K is 0"),
        "{doubts}"
    );
    let wandering = markovs("kf-gins").doubts().join("\n");
    assert!(!wandering.contains("K is 0"), "{wandering}");
    // of 3 q²/(T/dt)² at 1 s as much as N²/T: half of the variance; an envelope has it in its N
    let coarse = || Process::quantization(N_A * N_A * RATE * RATE / 3.0).unwrap();
    for (policy, is_told) in [(Policy::Matched, true), (Policy::Envelope, false)] {
        let accel = vec![white(N_A), walk(K_A), coarse()];
        let told = export("kalibr", accel, vec![white(N_G), walk(K_G)], policy)
            .doubts()
            .join("\n");
        let share =
            "quantization noise or drift, 50 % of the Allan variance at 1.00 s, is left out";
        assert_eq!(told.contains(share), is_told, "{policy:?}: {told}");
    }
}

/// A random walk has no deviation of its own at the start: that which it reaches within the horizon, 100 s, stands for it.
#[test]
fn a_walk_begins_with_what_it_reaches() {
    let axis = |n, k| Composite::new(vec![white(n), walk(k)]);
    let model = Model::pooled(RATE, &axis(N_A, K_A), &axis(N_G, K_G));
    let export = exported("pyins", &ModelFile::new(model), Policy::Strict).unwrap();
    for (key, k) in [("accel_bias_sd", K_A), ("gyro_bias_sd", K_G)] {
        assert!(
            (value(&export, key) / (10.0 * k) - 1.0).abs() < 1e-6,
            "{key}: {:e}",
            value(&export, key)
        );
    }
}

#[test]
fn axes_that_differ_are_told() {
    let axis = |scale: f64| Composite::new(vec![white(scale * N_A), walk(K_A)]);
    let gyro = Composite::new(vec![white(N_G), walk(K_G)]);
    let mut model = Model::pooled(RATE, &axis(1.0), &gyro);
    model.axes[2] = axis(2.0);
    let mut file = file(model);
    let export = exported("kalibr", &file, Policy::Strict).unwrap();
    assert_values(&export, &[("accelerometer_noise_density", 2.0 * N_A)]);
    let told = export.doubts().join("\n");
    assert!(
        told.contains("accel: axes differ (Allan deviation at 1 s: x 0.50, y 0.50, z 1.00)"),
        "{told}"
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
    let refused = |target: &str, bias: fn() -> Process| {
        let model = Model::pooled(
            RATE,
            &Composite::new(vec![white(N_A), bias()]),
            &Composite::new(vec![white(N_G), bias()]),
        );
        let refused = exported(target, &file(model), Policy::Strict);
        refused.unwrap_err().to_string()
    };
    // what does not wander has nothing to drop
    export("kalibr", vec![white(N_A)], vec![white(N_G)], Policy::Strict);
    let said = refused("kalibr", || markov(1e-3, 100.0));
    assert_eq!(
        said,
        "kalibr has no Gauss-Markov bias, and the model's accel has one"
    );
    let said = refused("kf-gins", || walk(K_A));
    assert_eq!(
        said,
        "kf-gins has no random walk, and the model's accel has one"
    );
}

/// LIO-SAM's own steps: GTSAM integrates N² over the interval of each sample, and between nodes a bias has K√Δt. In a second
/// of 200 samples, and of nodes 0.4 s apart, velocity and bias grow by N² and K².
#[test]
fn lio_sam_has_densities() {
    let export = walks("lio-sam");
    for (noise, bias, n, k) in [
        ("imuAccNoise", "imuAccBiasN", N_A, K_A),
        ("imuGyrNoise", "imuGyrBiasN", N_G, K_G),
    ] {
        let (dt, node_s) = (1.0 / RATE, 0.4_f64);
        let covariance = value(&export, noise).powi(2);
        // each discrete sample has variance covariance/dt, and counts for dt
        let velocity: f64 = (0..200).map(|_| covariance / dt * dt * dt).sum();
        let walked = (value(&export, bias) * node_s.sqrt()).powi(2) / node_s;
        assert!(
            (velocity / (n * n) - 1.0).abs() < 1e-12 && (walked / (k * k) - 1.0).abs() < 1e-12,
            "{noise}"
        );
    }
}

/// FAST-LIO's own recursion, P ← F P Fᵀ + (dt·f_w) Q (dt·f_w)ᵀ: in a second of 200 samples the white noise makes a velocity or
/// angle of N², and the bias grows by K². The shipped values are told by how many standard deviations of these they are.
#[test]
fn fast_lio_has_variances_of_a_sample() {
    let export = walks("fast-lio");
    for (noise, bias, n, k) in [
        ("acc_cov", "b_acc_cov", N_A, K_A),
        ("gyr_cov", "b_gyr_cov", N_G, K_G),
    ] {
        let dt = 1.0 / RATE;
        let (mut velocity, mut walked) = (0.0, 0.0);
        for _ in 0..200 {
            velocity += dt * value(&export, noise) * dt;
            walked += dt * value(&export, bias) * dt;
        }
        assert!(
            (velocity / (n * n) - 1.0).abs() < 1e-12 && (walked / (k * k) - 1.0).abs() < 1e-12,
            "{noise}"
        );
    }
    // √(0.1/(200 N²)): √5e-4/(0.02/60) = 67.1
    let text = export.text("m");
    assert!(
        text.contains("the shipped 0.1 is 67.1 times its standard deviation"),
        "{text}"
    );
}

/// Gazebo's own recursion in its variances: the bias of each sample ends at that of the model and keeps exp(−dt/τ) of itself,
/// from 0 at the start.
#[test]
fn gazebo_has_a_gauss_markov_bias() {
    let export = markovs("gazebo");
    for (sensor, n, sigma, turn_on) in [
        (
            "angular_velocity",
            N_G,
            5.0 * DEG / 3600.0,
            10.0 * DEG / 3600.0,
        ),
        ("linear_acceleration", N_A, 40e-6 * STANDARD_GRAVITY, 0.05),
    ] {
        let of = |key: &str| value(&export, &format!("{sensor}.{key}"));
        let (stddev, tau_s, dt) = (
            of("dynamic_bias_stddev"),
            of("dynamic_bias_correlation_time"),
            1.0 / RATE,
        );
        let driven = -stddev * stddev * tau_s / 2.0 * (-2.0 * dt / tau_s).exp_m1();
        let phi = (-dt / tau_s).exp();
        let mut variance = 0.0;
        // ten correlation times: e^-20 is left of the start
        for _ in 0..(10.0 * tau_s * RATE) as usize {
            variance = phi * phi * variance + driven;
        }
        assert!(
            (variance / (sigma * sigma) - 1.0).abs() < 1e-8,
            "{sensor}: {variance:e}"
        );
        assert!((tau_s / 300.0 - 1.0).abs() < 1e-9);
        assert!((of("stddev") / (n * RATE.sqrt()) - 1.0).abs() < 1e-12);
        assert!((of("bias_stddev") / turn_on - 1.0).abs() < 1e-12 && of("bias_mean") == 0.0);
    }
    let text = export.text("m --policy matched");
    let (mut depth, mut open) = (0, Vec::new());
    for tag in text.split('<').skip(1).filter(|tag| !tag.starts_with('!')) {
        let name: String = tag
            .trim_start_matches('/')
            .chars()
            .take_while(|c| c.is_alphabetic() || *c == '_')
            .collect();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name))
        } else {
            open.push(name)
        }
        depth = depth.max(open.len());
    }
    assert!(open.is_empty() && depth == 5, "{text}");
    assert!(text.lines().all(|l| l.matches("--").count() <= 2), "{text}");
    // what has no bias switches it off
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
    for (key, n) in [
        ("linear_acceleration_covariance", N_A),
        ("angular_velocity_covariance", N_G),
    ] {
        // information of independent measurements adds
        let information: f64 = (0..200).map(|_| 1.0 / value(&export, key)).sum();
        assert!((1.0 / information / (n * n) - 1.0).abs() < 1e-12, "{key}");
        let text = export.text("m");
        let line = text.lines().find(|l| l.starts_with(key)).unwrap();
        let nine = line.split(['[', ']']).nth(1).unwrap();
        let nine: Vec<f64> = nine.split(", ").map(|x| x.parse().unwrap()).collect();
        let variance = value(&export, key);
        let expected = [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance];
        assert_eq!(nine, expected);
    }
}

/// A name with a line break, a control sequence or the end of a comment stays in its comment, in every syntax.
#[test]
fn names_of_models_forge_nothing() {
    for target in Target::ALL {
        let export = if target.bias == Bias::Walk {
            walks(target.name)
        } else {
            markovs(target.name)
        };
        let clean = export.text("m");
        let text = export.text("m\nupdate_rate: 1\u{1b}[2J\r --> <imu>");
        assert_eq!(text.lines().count(), clean.lines().count(), "{text}");
        assert!(
            !text.contains('\u{1b}') && !text.contains("m --> <imu>"),
            "{text}"
        );
        assert!(
            !text
                .lines()
                .any(|line| line.starts_with("update_rate: 1\u{1b}"))
        );
        assert!(
            !clean.contains('{') || target.name == "gnss-ins-sim",
            "{text}"
        );
        assert!(!text.contains("NaN"), "{text}");
    }
}

/// Of a model that does not fit, the figures of its reading are exported.
#[test]
fn a_reading_is_exported_in_the_place_of_the_processes() {
    let model = |n_a, n_g| {
        let axis = |n| Composite::new(vec![white(n)]);
        Model::pooled(RATE, &axis(n_a), &axis(n_g))
    };
    let mut read = file(model(3.0 * N_A, 2.0 * N_G));
    read.reading = Some(Box::new(ModelFile::new(model(N_A, N_G))));
    let [accel, gyro] = exported("kalibr", &read, Policy::Matched).unwrap().sensors;
    for (found, exact) in [(accel, N_A), (gyro, N_G)] {
        assert!((found.exported.density / exact - 1.0).abs() < 1e-9);
    }
}
