//! The Rust examples run.

#![allow(clippy::unwrap_used, reason = "a test")]

#[path = "../examples/01_robust_wavelet_variance.rs"]
mod robust_wavelet_variance;

#[path = "../examples/02_calibrate.rs"]
mod calibrate;

#[path = "../examples/03_ideal_imu.rs"]
mod ideal_imu;

#[test]
fn examples_run() {
    robust_wavelet_variance::main().unwrap();
    calibrate::main().unwrap();
    ideal_imu::main().unwrap();
}

#[test]
fn examples_are_short() {
    for entry in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "rs") {
            let lines = std::fs::read_to_string(&path).unwrap().lines().count();
            assert!(lines <= 80, "{} has {lines} lines", path.display());
        }
    }
}
