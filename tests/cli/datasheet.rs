//! `nav-sim datasheet` as a user runs it, and the turn-on bias that a model file states.

use crate::common::drive::*;
use nav_sim::io::model_file;
use serde_json::Value;
use std::fs;

const G: f64 = 9.806_65;

#[test]
fn figures_in_the_units_of_a_datasheet_become_a_model() {
    let place = tempfile::tempdir().unwrap();
    let ran = done(
        place.path(),
        "datasheet --vrw 0.02m/s/sqrt(h) --arw 0.15°/√h --accel-bias 40ug --gyro-bias 10deg/h --corr-time 5min \
         --accel-turn-on 2mg --rate-hz 200 -o model.toml",
    );
    assert!(
        ran.stderr
            .contains("an assumption, not a calibration\nwrote model.toml\n"),
        "{}",
        ran.stderr
    );
    let file = model_file::read(&place.path().join("model.toml")).unwrap();
    assert_eq!(file.model.rate_hz, 200.0);
    let near = |value: f64, expected: f64| {
        assert!(
            (value / expected - 1.0).abs() < 1e-12,
            "{value:e} {expected:e}"
        )
    };
    let accel = file.model.axes[0]
        .processes
        .iter()
        .flat_map(|p| p.parameters())
        .collect::<Vec<_>>();
    near(accel[0].1, (0.02_f64 / 60.0).powi(2) * 200.0);
    near(accel[1].1, 1.0 / 300.0);
    // three processes a factor of 16 apart: their Allan variance is lowest at 0.4480 of the variance of one
    near(accel[5].1, 256.0 / 300.0);
    let s2 = (40e-6 * G).powi(2) / 0.448_028_281_7;
    assert!(
        [2, 4, 6]
            .iter()
            .all(|i| (accel[*i].1 / s2 - 1.0).abs() < 1e-9),
        "{accel:?}"
    );
    let names = ["sigma2", "beta", "s2", "beta", "s2", "beta", "s2"];
    assert_eq!(
        accel.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
        names
    );
    near(file.turn_on.unwrap().accel_m_s2.unwrap()[0], 2e-3 * G);
    assert_eq!(file.turn_on.unwrap().gyro_rad_s, None);
    let provenance = file.provenance.unwrap();
    assert!(
        provenance["label"]
            .as_str()
            .unwrap()
            .starts_with("assumed from")
    );
    assert_eq!(provenance["figures"].as_array().unwrap().len(), 7); // the correlation time is of both sensors
}

#[test]
fn a_unit_that_is_missing_or_wrong_is_refused_with_those_that_fit() {
    let place = tempfile::tempdir().unwrap();
    let refused = |arguments: &str, parts: &[&str]| {
        let ran = nav_sim(
            place.path(),
            &format!("datasheet -o model.toml {arguments}"),
        );
        assert_eq!(ran.code, 2, "{arguments}\n{}", ran.stderr);
        for part in parts {
            assert!(ran.stderr.contains(part), "{arguments}\n{}", ran.stderr);
        }
        assert!(!place.path().join("model.toml").exists());
    };
    refused(
        "--gyro-bias 10",
        &[
            "--gyro-bias",
            "'10'",
            "has no unit; expected deg/h, deg/s, mdeg/s, rad/s",
        ],
    );
    refused(
        "--arw 10deg/h",
        &["--arw", "has the unit deg/h; expected", "deg/sqrt(h)"],
    );
    refused("--corr-time 300ms", &["--corr-time", "expected s, min, h"]);
    refused(
        "--vrw=-1ug/sqrt(Hz)",
        &["--vrw", "does not begin with a number > 0"],
    );
    refused(
        "--vrw=1e300m/s/sqrt(h)",
        &["--vrw", "is more than 1e12 in SI units"],
    );
    refused("", &["no figure gives a noise model", "--unit NAME"]);
    refused("--accel-turn-on 2mg", &["no figure gives a noise model"]);
    refused(
        "--unit stim30",
        &["is not in the catalogue", "did you mean \"stim300\"?"],
    );
}

#[test]
fn flags_win_over_an_entry_and_what_is_assumed_is_said() {
    let place = tempfile::tempdir().unwrap();
    let ran = done(
        place.path(),
        "datasheet --unit STIM300 --arw 0.3deg/sqrt(h)",
    );
    assert!(
        ran.stdout.contains("given = \"0.3 deg/sqrt(h)\"")
            || ran.stdout.contains("given = \"0.3deg/sqrt(h)\"")
    );
    assert!(!ran.stdout.contains("0.15 deg/sqrt(h)"), "{}", ran.stdout);
    assert!(
        ran.stderr
            .contains("accel: no correlation time given; 300 s assumed"),
        "{}",
        ran.stderr
    );
    let json: Value =
        serde_json::from_str(&done(place.path(), "datasheet --unit stim300 --format json").stdout)
            .unwrap();
    assert_eq!(
        (
            json["gyro"]["processes"][0]["type"].as_str(),
            json["schema"].as_i64()
        ),
        (Some("WN"), Some(1))
    );
    let list = done(place.path(), "datasheet --list").stdout;
    assert!(
        list.contains("stim300      tactical     Sensonor (Safran) STIM300\n"),
        "{list}"
    );
    assert!(list.contains("noise 0.15 deg/sqrt(h)"), "{list}");
}

/// The turn-on bias of a model file: expected by the filter, had by the true IMU; what is given elsewhere wins.
#[test]
fn a_run_takes_the_turn_on_bias_of_the_model_file() {
    let place = place_with(
        DRIVE,
        &format!("{MODEL}[turn_on]\naccel_m_s2 = 0.02\ngyro_rad_s = 1e-4\n"),
    );
    fs::write(place.path().join("quiet.toml"), MODEL).unwrap();
    let configuration = |arguments: &str| -> (String, Value) {
        let ran = done(
            place.path(),
            &format!("run drive.toml imu.toml --runs 2 --outage none --seed 5 {arguments} -o out"),
        );
        let manifest = fs::read_to_string(place.path().join("out/manifest.json")).unwrap();
        fs::remove_dir_all(place.path().join("out")).unwrap();
        (
            ran.stderr,
            serde_json::from_str::<Value>(&manifest).unwrap()["configuration"].clone(),
        )
    };
    let (said, used) = configuration("");
    assert!(
        said.contains("imu.toml: the filter expects a turn-on bias of 0.0200 m/s² (accel, 1 σ)"),
        "{said}"
    );
    assert!(
        said.contains("imu.toml: the true IMU has a turn-on bias of 1.00e-4 rad/s (gyro, 1 σ)"),
        "{said}"
    );
    assert_eq!(used["initial"]["accel_bias_sigma_m_s2"], 0.02);
    assert_eq!(used["imu"]["turn_on_bias_gyro_rad_s"], 1e-4);
    let (_, used) = configuration("--turn-on-bias 0.05,0.001");
    assert_eq!(used["initial"]["accel_bias_sigma_m_s2"], 0.05);
    assert_eq!(used["imu"]["turn_on_bias_accel_m_s2"], 0.02);
    let (said, used) = configuration("--truth quiet.toml");
    assert!(!said.contains("the true IMU has"), "{said}");
    assert!(used["imu"]["turn_on_bias_accel_m_s2"].is_null(), "{used}");
    // what a scenario says wins, zero too
    fs::write(
        place.path().join("zero.toml"),
        "imu.turn_on_bias_gyro_rad_s = 0\n",
    )
    .unwrap();
    let (said, used) = configuration("--scenario zero.toml");
    assert!(
        said.contains("the true IMU has a turn-on bias of 0.0200 m/s²"),
        "{said}"
    );
    assert!(
        !said.contains("the true IMU has a turn-on bias of 1.00e-4"),
        "{said}"
    );
    assert_eq!(used["imu"]["turn_on_bias_gyro_rad_s"], 0.0);
}

/// Figures of Kalibr become a model, its export is read as the same figures, and again.
#[test]
fn figures_of_kalibr_come_back_from_an_export() {
    let place = tempfile::tempdir().unwrap();
    let yaml = "accelerometer_noise_density: 0.0025\naccelerometer_random_walk: 7.1e-05\ngyroscope_noise_density: 1.9e-4\n\
         gyroscope_random_walk: 2.6e-06\nupdate_rate: 200.0\n";
    fs::write(place.path().join("imu.yaml"), yaml).unwrap();
    let ran = done(place.path(), "datasheet --from imu.yaml -o a.toml");
    assert!(
        ran.stderr
            .contains("gyro: no turn-on bias (--gyro-turn-on)"),
        "{}",
        ran.stderr
    );
    done(place.path(), "export a.toml --target kalibr -o back.yaml");
    done(place.path(), "datasheet --from back.yaml -o b.toml");
    let flags = "--vrw 0.15m/s/sqrt(h) --accel-rrw 4.26e-3m/s^2/sqrt(h) --arw 1.9e-4rad/s/sqrt(Hz) --gyro-rrw 2.6e-6rad/s^2/sqrt(Hz)";
    done(
        place.path(),
        &format!("datasheet {flags} --rate-hz 200 -o c.toml"),
    );
    let [a, b, c] = ["a", "b", "c"].map(|name| {
        model_file::read(&place.path().join(format!("{name}.toml")))
            .unwrap()
            .model
    });
    assert_eq!((a.rate_hz, b.rate_hz), (200.0, 200.0));
    for (axis, expected) in a.axes.iter().enumerate() {
        for other in [&b, &c].map(|model| &model.axes[axis]) {
            let values = |noise: &nav_sim::signal::noise::Composite| -> Vec<(&str, f64)> {
                noise
                    .processes
                    .iter()
                    .flat_map(|p| p.parameters())
                    .collect()
            };
            for ((name, x), (other_name, y)) in values(expected).into_iter().zip(values(other)) {
                assert!(
                    name == other_name && (x / y - 1.0).abs() < 1e-12,
                    "{name} {x:e} {y:e}"
                );
            }
        }
    }
}
