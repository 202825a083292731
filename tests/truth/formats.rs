//! The examples of `calib_data/`: one recording in every format, and the virtual IMUs.

use crate::shared::*;
use nav_sim::io::model_file;
use nav_sim::io::recordings::{ReadOptions, read};
use nav_sim::signal::imu::Recording;

fn recording(name: &str, rate_hz: Option<f64>) -> Recording {
    let options = ReadOptions {
        rate_hz,
        ..ReadOptions::default()
    };
    let path = root("calib_data").join(name);
    let (mut recordings, report) = read(&[path], &options).unwrap();
    let warnings = report.all_warnings();
    assert!(warnings.is_empty(), "{name}: {warnings:?}");
    assert_eq!(recordings.len(), 1, "{name}");
    recordings.remove(0)
}

/// Values are printed with eight digits: those just above 1 g to 5e-8 g, 5e-7 m/s², beside 5e-8 m/s² of the
/// reference. The array is in single precision: half a unit in the last place of 9.8 is 4.8e-7.
#[test]
fn every_format_holds_the_same_recording() {
    let own = recording("formats/own.csv", None);
    assert_eq!((own.len(), own.signals.len()), (500, 6));
    for (name, rate_hz, channels, digits) in [
        ("formats/other_units.tsv", None, 6, 6e-7),
        ("formats/euroc.csv", None, 6, 6e-7),
        ("formats/kalibr.csv", None, 6, 6e-7),
        ("formats/x-io.csv", None, 6, 6e-7),
        ("formats/gnss-ins-sim_gyro-0.csv", Some(100.0), 3, 6e-7),
        ("formats/xsens_mt_manager.txt", None, 6, 6e-7),
        ("formats/compressed.csv.gz", None, 6, 6e-7),
        ("formats/array.npy", Some(100.0), 6, 1e-6),
    ] {
        let other = recording(name, rate_hz);
        assert!(
            (other.rate_hz - 100.0).abs() < 1e-6,
            "{name}: {} Hz",
            other.rate_hz
        );
        assert_eq!(
            (other.len(), other.signals.len()),
            (500, channels),
            "{name}"
        );
        for signal in &other.signals {
            let reference = own.signal(signal.channel).unwrap();
            for (a, b) in signal.samples.iter().zip(&reference.samples) {
                let (a, b) = (a + signal.mean, b + reference.mean);
                assert!(
                    (a - b).abs() < digits,
                    "{name}, {}: {a}, {b}",
                    signal.channel
                );
            }
        }
    }
}

/// Lowest Allan deviation, √(2 ν) at the Haar scale where ν is least.
fn floor(noise: &Composite) -> f64 {
    let deviation = |level| (2.0 * noise.haar_wv(level)).sqrt();
    (1..=18).map(deviation).fold(f64::INFINITY, f64::min)
}

fn noise_density(noise: &Composite, rate_hz: f64) -> f64 {
    let (_, sigma2) = noise.processes[0].parameters()[0];
    (sigma2 / rate_hz).sqrt()
}

/// What the heads of the files say they amount to, to the digits printed there.
#[test]
fn the_virtual_imus_are_what_they_say() {
    let (micro_g, deg_h) = (9.806_65e-6, 1.0_f64.to_radians() / 3600.0);
    let deg_root_h = 1.0_f64.to_radians() / 60.0;
    for (name, accel_density, accel_floor, arw, gyro_floor) in [
        (
            "consumer_mems.toml",
            (75.0, 0.5),
            (40.0, 0.5),
            (0.42, 0.005),
            (8.3, 0.05),
        ),
        (
            "tactical.toml",
            (51.0, 0.5),
            (12.0, 0.5),
            (0.04, 0.0005),
            (0.29, 0.005),
        ),
    ] {
        let file = model_file::read(&root("calib_data").join(name)).unwrap();
        assert!(file.missing.is_empty());
        assert!(file.spread.unwrap().axes.iter().all(|laws| laws.len() == 7));
        let (accel, gyro) = (&file.model.axes[0], &file.model.axes[3]);
        for (what, value, (said, digits)) in [
            (
                "accel density",
                noise_density(accel, 100.0) / micro_g,
                accel_density,
            ),
            ("accel floor", floor(accel) / micro_g, accel_floor),
            ("gyro density", noise_density(gyro, 100.0) / deg_root_h, arw),
            ("gyro floor", floor(gyro) / deg_h, gyro_floor),
        ] {
            assert!(
                (value - said).abs() < digits,
                "{name}, {what}: {value}, said {said}"
            );
        }
    }
}
