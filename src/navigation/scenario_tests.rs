//! Scenarios as files have them.

use super::*;
use crate::noise::{Composite, Process};
use crate::simulation::lincov::FilterPass;
use crate::tests::drive;

/// Ten seconds at rest.
fn standing() -> Trajectory {
    drive(0.0, "{ kind = 'straight', duration_s = 10 }")
}

#[test]
fn an_empty_file_is_the_papers_setting() {
    let scenario: Scenario = toml::from_str("").unwrap();
    assert_eq!(scenario.validate(), Ok(()));
    assert_eq!(
        (
            scenario.run.runs,
            scenario.imu.rate_hz,
            scenario.gnss.rate_hz
        ),
        (100, 100.0, 1.0)
    );
    let variance = |sigma: [f64; 3]| sigma.map(|s| (s * s * 1e6).round() / 1e6);
    assert_eq!(variance(scenario.gnss.pos_sigma_m), [4.0, 4.0, 16.0]);
    assert_eq!(
        variance(scenario.gnss.vel_sigma_m_s.unwrap()),
        [0.0016, 0.0016, 0.0036]
    );
    assert_eq!(
        scenario.outages_on((0.0, 900.0), 1).unwrap().windows,
        Outage::PAPER
    );
    let without: Scenario = toml::from_str("outage = []").unwrap();
    assert!(
        without
            .outages_on((0.0, 900.0), 1)
            .unwrap()
            .windows
            .is_empty()
    );
}

#[test]
fn every_key_of_the_interface_is_understood() {
    let text = r#"
        outage = []
        run = { runs = 7, seed = 3, method = "monte-carlo" }
        filter = { states = "full", gravity = "first-order" }
        [imu]
        rate_hz = 200.0
        turn_on_bias_accel_m_s2 = 0.0
        [gnss]
        rate_hz = 5
        pos_sigma_m = [1, 1, 2]
        vel_sigma_m_s = "none"
        lever_arm_m = [0.5, 0, -1]
        [initial]
        att_sigma_deg = [1, 1, 5]
        accel_bias_sigma_m_s2 = 0.01
        perfect = true
        [outage_periodic]
        first_s = 10
        every_s = 100
        duration_s = 20
        [outage_random]
        rate_per_hour = 3
        duration_s = 10
    "#;
    let scenario: Scenario = toml::from_str(text).unwrap();
    assert_eq!(scenario.validate(), Ok(()));
    assert_eq!(scenario.filter.states, FilterStates::Full);
    assert!(scenario.outages().fixed.is_empty());
    let again: Scenario = toml::from_str(&toml::to_string(&scenario).unwrap()).unwrap();
    assert_eq!(again, scenario);
}

#[test]
fn what_the_filter_does_not_expect_is_found_of_each_sensor() {
    let found = |text: &str| toml::from_str::<Scenario>(text).unwrap().unexpected();
    assert!(found("").is_empty());
    let bias = found("imu = { turn_on_bias_gyro_rad_s = 1e-4, turn_on_bias_accel_m_s2 = 0.02 }");
    let accel = "a turn-on bias of 0.02 m/s², the filter expects 0: initial.accel_bias_sigma_m_s2 ";
    assert!(bias.len() == 2 && bias[0].contains(accel), "{bias:?}");
    let expected = "imu.turn_on_bias_gyro_rad_s = 1e-4\ninitial.gyro_bias_sigma_rad_s = ";
    assert_eq!(
        (
            found(&format!("{expected}1e-4")).len(),
            found(&format!("{expected}4e-5")).len()
        ),
        (0, 1)
    );
    let scale = found("imu.scale_ppm_accel = 300").concat();
    assert!(
        scale.contains("of 300 ppm, the filter expects 0: "),
        "{scale}"
    );
    assert!(found("imu.scale_ppm_accel = 300\nfilter.states = 21").is_empty());
    for (setting, remedy) in [
        ("imu.misalignment_rad = 1e-3", "calibrate the IMU"),
        (
            "imu.g_sensitivity_rad_s_per_m_s2 = 1e-4",
            "initial.gyro_bias",
        ),
        (
            "imu.vibration = { rms_m_s2 = 5, rectification_s2_m = 1e-4 }",
            "initial.accel_bias",
        ),
        (
            "imu.temperature = { profile_c = [[0, 20]], gyro_rad_s_k = 1e-6 }",
            "initial.gyro_bias",
        ),
    ] {
        let [found] = &found(setting)[..] else {
            panic!("{setting}")
        };
        let in_no_filter = format!(" is in no filter: {remedy}");
        assert!(found.contains(&in_no_filter), "{setting}: {found}");
    }
    // white noise of 2 m is known to 0.2 m from the hundred fixes of the default correlation time
    let coloured = |m: f64| found(&format!("gnss.correlated_pos_sigma_m = [{m}, 0.0, 0.0]"));
    let correlated = "the true receiver errs by 0.11, 0, 0 m over 100 s, ";
    assert!(coloured(0.09).is_empty() && coloured(0.11)[0].starts_with(correlated));
}

/// With N1 an axis has two bias states: 9 + 12, scale factors 6, turn-on biases of the gyroscope 3.
#[test]
fn what_is_expected_beside_the_model_adds_states_to_any_filter() {
    let axis = Composite::new(vec![
        Process::ar1(0.99, 1e-8).unwrap(),
        Process::random_walk(1e-12).unwrap(),
    ]);
    let model = Model::pooled(100.0, &axis, &axis);
    let states = |text: &str| {
        let scenario: Scenario = toml::from_str(text).unwrap();
        assert_eq!(scenario.validate(), Ok(()));
        let track = scenario.track(&standing(), &model, &[]).unwrap();
        let full = scenario
            .with_full_noise()
            .filter_model(&model, &[], &track)
            .unwrap()
            .states;
        (
            scenario.filter_model(&model, &[], &track).unwrap().states,
            full,
        )
    };
    for (text, expected) in [
        ("", (15, 21)),
        ("filter.states = 21", (21, 27)),
        (
            "initial.gyro_bias_sigma_rad_s = 1e-4\nfilter.states = 21",
            (24, 30),
        ),
        (
            "initial.gyro_scale_sigma_ppm = 0\nfilter.states = 21",
            (18, 24),
        ),
        ("initial.accel_scale_sigma_ppm = 100", (18, 24)),
    ] {
        assert_eq!(states(text), expected, "{text}");
    }
}

/// What is checked is what is simulated: a third of the IMU's rate with seven digits or more, which has every third sample.
#[test]
fn a_rate_is_accepted_where_it_is_simulated() {
    let model = Model::pooled(100.0, &Composite::default(), &Composite::default());
    for (rate, accepted) in [
        ("33.33333", true),
        ("33.333333333", true),
        ("33.333", false),
        ("200", false),
    ] {
        for sensor in ["gnss", "baro.sigma_m = 1\nbaro"] {
            let scenario: Scenario = toml::from_str(&format!("{sensor}.rate_hz = {rate}")).unwrap();
            let simulated = scenario.track(&standing(), &model, &[]).is_ok();
            assert_eq!(
                (scenario.validate().is_ok(), simulated),
                (accepted, accepted),
                "{sensor} {rate}"
            );
        }
    }
}

/// A bias that grows by d in every sample, of which the filter knows |d|, moves a position at rest by
/// d n (n + 1)(2n + 1)/(12 f²) in n samples without fixes. (Gravity's gradient takes (t/807 s)²/20 of it, and adds twice
/// as much downwards; a step's bias is its mean, which leaves 2e-4.)
#[test]
fn a_drift_that_a_filter_knows_grows_with_time() {
    let (slope, rate_hz, t_s) = (1e-6, 100.0, 10.0);
    let axis = |slope: f64, white: f64| {
        let drift = Process::drift(slope).unwrap();
        Composite::new(vec![Process::white(white).unwrap(), drift])
    };
    let model = Model::pooled(rate_hz, &axis(slope, 1e-20), &axis(1e-20, 1e-24));
    let text = "filter.states = 'full'\n[initial]\npos_sigma_m = [1e-6, 1e-6, 1e-6]\n\
                vel_sigma_m_s = [1e-9, 1e-9, 1e-9]\natt_sigma_deg = [1e-9, 1e-9, 1e-9]";
    let scenario: Scenario = toml::from_str(text).unwrap();
    let outages = [Outage {
        start_s: 0.5,
        end_s: t_s,
    }];
    let track = scenario.track(&standing(), &model, &outages).unwrap();
    let filter_model = scenario.filter_model(&model, &outages, &track).unwrap();
    let sigma = FilterPass::new(&track, &filter_model).sigma_at_ends()[0];
    let n = rate_hz * t_s;
    let expected = slope * n * (n + 1.0) * (2.0 * n + 1.0) / (12.0 * rate_hz * rate_hz);
    for (i, sigma) in sigma.into_iter().enumerate().take(3) {
        assert!((sigma / expected - 1.0).abs() < 1e-3, "axis {i}: {sigma} m");
    }
}

#[test]
fn refusals_name_section_and_key() {
    for text in [
        "run.runs = 0",
        "run.runs = 99999999999",
        "run.coverage_level = 95",
        "imu.rate_hz = 1e9",
        "imu.rate_hz = -1",
        "imu.turn_on_bias_gyro_rad_s = 100",
        "imu.turn_on_bias_gyro_rad_s = nan",
        "imu.turn_on_bias_accel_m_s2 = 100",
        "imu.scale_ppm_gyro = -1",
        "imu.scale_ppm_accel = 2e5",
        "imu.misalignment_rad = 0.5",
        "imu.g_sensitivity_rad_s_per_m_s2 = 2",
        "imu.vibration.rms_m_s2 = -1\nimu.vibration.rectification_s2_m = 1e-4",
        "imu.temperature.profile_c = []",
        "imu.temperature.profile_c = [[5, 20], [5, 30]]",
        "gnss.rate_hz = 0",
        "gnss.rate_hz = 3",
        "gnss.rate_hz = 200",
        "gnss.pos_sigma_m = [0, 1, 1]",
        "gnss.pos_sigma_m = [2, nan, 4]",
        "gnss.vel_sigma_m_s = [0.1, 0, 0.1]",
        "gnss.lever_arm_m = [0, 120, 0]",
        "gnss.lever_arm_m = [0, inf, 0]",
        "gnss.correlation_time_s = 0",
        "baro.sigma_m = 0\nbaro.rate_hz = 1",
        "baro.rate_hz = 3\nbaro.sigma_m = 1",
        "initial.pos_sigma_m = [1e7, 1, 1]",
        "initial.pos_sigma_m = [0, 1, 1]",
        "initial.vel_sigma_m_s = [1, 1, 5000]",
        "initial.vel_sigma_m_s = [1, -1, 1]",
        "initial.att_sigma_deg = [1, 1, 180]",
        "initial.att_sigma_deg = [1, 1, 90]",
        "initial.gyro_bias_sigma_rad_s = 5",
        "initial.gyro_bias_sigma_rad_s = -1",
        "initial.accel_bias_sigma_m_s2 = 50",
        "initial.gyro_scale_sigma_ppm = 2e5",
        "initial.accel_scale_sigma_ppm = -1",
        "outage_periodic.duration_s = 10\noutage_periodic.every_s = 10\noutage_periodic.first_s = 0",
        "outage_random.rate_per_hour = nan\noutage_random.duration_s = 10",
    ] {
        let scenario: Scenario = toml::from_str(text).unwrap();
        let key = text.split(" = ").next().unwrap();
        assert_eq!(scenario.validate().unwrap_err().key, key, "{text}");
    }
    let scenario: Scenario = toml::from_str("outage = [{ start_s = 9, end_s = 9 }]").unwrap();
    assert_eq!(scenario.validate().unwrap_err().key, "outage[1].end_s");
}
