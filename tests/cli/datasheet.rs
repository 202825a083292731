//! Models made of data sheets; the words of `datasheet` are in `transcripts/files.md`.

use crate::common::drive::*;
use nav_sim::io::model_file;

const G: f64 = 9.806_65;

#[test]
fn figures_in_the_units_of_a_datasheet_become_a_model() {
    let place = Place::new();
    place.done(
        "datasheet --vrw 0.02m/s/sqrt(h) --arw 0.15°/√h --accel-bias 40ug --gyro-bias 10deg/h --corr-time 5min \
         --accel-turn-on 2mg --rate-hz 200 -o model.toml",
    );
    let file = model_file::read(&place.at("model.toml")).unwrap();
    assert_eq!(file.model.rate_hz, 200.0);
    let processes = &file.model.axes[0].processes;
    let (names, accel): (Vec<&str>, Vec<f64>) =
        processes.iter().flat_map(|p| p.parameters()).unzip();
    assert_eq!(names, ["sigma2", "beta", "s2", "beta", "s2", "beta", "s2"]);
    // three processes a factor of 16 apart: their Allan variance is lowest at 0.4480 of the variance of one
    let s2 = (40e-6 * G).powi(2) / 0.448_028_281_7;
    let sigma2 = (0.02_f64 / 60.0).powi(2) * 200.0;
    let beta = 1.0 / 300.0;
    let expected = [sigma2, beta, s2, 16.0 * beta, s2, 256.0 * beta, s2];
    for ((name, found), expected) in names.iter().zip(&accel).zip(expected) {
        let allowed = if *name == "s2" { 1e-9 } else { 1e-12 };
        assert!(
            off(*found, expected) < allowed,
            "{name}: {found:e} {expected:e}"
        );
    }
    let turn_on = file.turn_on.unwrap();
    assert!(off(turn_on.accel_m_s2.unwrap()[0], 2e-3 * G) < 1e-12);
    assert_eq!(turn_on.gyro_rad_s, None);
    let provenance = file.provenance.unwrap();
    // the correlation time is of both sensors
    assert_eq!(provenance["figures"].as_array().unwrap().len(), 7);
}

/// Figures of Kalibr become a model, its export is read as the same figures, and again.
#[test]
fn figures_of_kalibr_come_back_from_an_export() {
    let place = Place::new();
    let yaml = "accelerometer_noise_density: 0.0025\naccelerometer_random_walk: 7.1e-05\ngyroscope_noise_density: 1.9e-4\n\
         gyroscope_random_walk: 2.6e-06\nupdate_rate: 200.0\n";
    place.write("imu.yaml", yaml);
    let flags = "--vrw 0.15m/s/sqrt(h) --accel-rrw 4.26e-3m/s^2/sqrt(h) --arw 1.9e-4rad/s/sqrt(Hz) --gyro-rrw 2.6e-6rad/s^2/sqrt(Hz)";
    for command in [
        "datasheet --from imu.yaml -o a.toml",
        "export a.toml --target kalibr -o back.yaml",
        "datasheet --from back.yaml -o b.toml",
        &format!("datasheet {flags} --rate-hz 200 -o c.toml"),
    ] {
        place.done(command);
    }
    let [a, b, c] = ["a.toml", "b.toml", "c.toml"].map(|name| {
        let model = model_file::read(&place.at(name)).unwrap().model;
        assert_eq!(model.rate_hz, 200.0);
        let processes = model.axes.into_iter().flat_map(|noise| noise.processes);
        processes.flat_map(|p| p.parameters()).collect::<Vec<_>>()
    });
    assert_eq!((a.len(), b.len(), c.len()), (12, 12, 12));
    for ((a, b), c) in a.iter().zip(&b).zip(&c) {
        assert!(a.0 == b.0 && a.0 == c.0, "{a:?} {b:?} {c:?}");
        assert!(
            off(a.1, b.1) < 1e-12 && off(a.1, c.1) < 1e-12,
            "{a:?} {b:?} {c:?}"
        );
    }
}
