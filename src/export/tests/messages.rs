//! LiDAR-inertial odometry, Gazebo and messages of ROS, each by the recursion of its own program.

use super::*;

/// LIO-SAM's own steps: GTSAM integrates N² over the interval of each sample, and between nodes a bias has K√Δt. In a second
/// of 200 samples, and of nodes 0.4 s apart, velocity and bias grow by N² and K².
#[test]
fn lio_sam_has_densities() {
    let export = walks(Target::LioSam);
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
    let export = walks(Target::FastLio);
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
    let export = markovs(Target::Gazebo);
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
    // each value is explained once, of x
    let explained = |key: &str| {
        text.lines()
            .filter(|l| l.contains(&format!("<!-- {key}:")))
            .count()
    };
    assert!(
        export.entries.iter().all(|entry| explained(entry.key) == 1),
        "{text}"
    );
    // what has no bias switches it off
    let white = self::export(
        Target::Gazebo,
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
    let export = walks(Target::RosImuCovariance);
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
