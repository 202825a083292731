//! `wv` and `calibrate` as a user runs them.

mod requests;

use assert_cmd::Command;
use nav_sim::signal::noise::{Composite, Process};
use nav_sim::signal::rng::StreamKey;
use rand::RngExt;
use rand_distr::StandardNormal;
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

pub(super) const SAMPLES: usize = 1 << 14;

/// WN + AR1 + RW whose parts lead at different scales of 2^14 samples.
pub(super) fn truth() -> [Process; 3] {
    [
        Process::white(4e-6).unwrap(),
        Process::ar1(0.98, 4e-8).unwrap(),
        Process::random_walk(1e-11).unwrap(),
    ]
}

pub(super) fn signal(run: u64, source: &str) -> Vec<f64> {
    let key = StreamKey {
        seed: 7,
        scenario: "calibrate",
        run,
        source,
        process: "",
    };
    let mut generator = key.generator();
    let mut normal = || generator.sample::<f64, _>(StandardNormal);
    let mut ar1 = (4e-8_f64 / (1.0 - 0.98 * 0.98)).sqrt() * normal();
    let mut walk = 0.0;
    (0..SAMPLES)
        .map(|_| {
            ar1 = 0.98 * ar1 + 2e-4 * normal();
            walk += 1e-11_f64.sqrt() * normal();
            2e-3 * normal() + ar1 + walk
        })
        .collect()
}

/// Replicates of gyro x and y at 50 Hz.
pub(super) fn recordings(dir: &Path, count: u64) -> PathBuf {
    let runs = dir.join("runs");
    std::fs::create_dir(&runs).unwrap();
    for run in 0..count {
        let (x, y) = (signal(run, "gyro.x"), signal(run, "gyro.y"));
        let mut text = "t_s,gyro_x_rad_s,gyro_y_rad_s\n".to_owned();
        for t in 0..SAMPLES {
            writeln!(text, "{:.2},{:e},{:e}", 0.02 * t as f64, x[t], y[t]).unwrap();
        }
        std::fs::write(runs.join(format!("run{run}.csv")), text).unwrap();
    }
    runs
}

/// What an earlier command of a test left is replaced.
pub(super) fn nav_sim(dir: &Path) -> Command {
    let mut command = Command::cargo_bin("nav-sim").unwrap();
    command.current_dir(dir).arg("--force");
    command
}

pub(super) fn json(dir: &Path, arguments: &[&str]) -> Value {
    let output = nav_sim(dir)
        .args(arguments)
        .args(["--format", "json", "-q"])
        .assert()
        .success();
    serde_json::from_slice(&output.get_output().stdout).unwrap()
}

pub(super) fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap_or_else(|| panic!("{value}"))
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

#[track_caller]
pub(super) fn refusal(dir: &Path, arguments: &[&str], code: i32) -> String {
    let output = nav_sim(dir).args(arguments).assert().code(code);
    assert!(output.get_output().stdout.is_empty());
    String::from_utf8(output.get_output().stderr.clone()).unwrap()
}

#[test]
fn recordings_become_a_model_file_and_its_curves() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 6);
    let out = json(
        dir.path(),
        &[
            "calibrate",
            "runs",
            "--model",
            "N1",
            "--estimator",
            "all",
            "-o",
            "imu.toml",
        ],
    );
    assert_eq!(out["fits"].as_array().unwrap().len(), 3);
    let replicates = out["replicates"].as_array().unwrap();
    assert_eq!(replicates.len(), 6);
    assert!(
        replicates.iter().all(|r| r["verdict"] == "normal"),
        "{replicates:?}"
    );
    let model = Composite::new(truth().to_vec());
    for estimator in ["awv", "sr-awv", "dr-awv"] {
        let file = nav_sim::io::model_file::read(&dir.path().join(format!("imu_{estimator}.toml")))
            .unwrap();
        assert_eq!(file.model.rate_hz.round() as i64, 50);
        let missing: Vec<String> = file.missing.iter().map(ToString::to_string).collect();
        assert_eq!(
            missing,
            ["accel.x", "accel.y", "accel.z"],
            "pooled: one model for the three axes"
        );
        // Four parameters on each of three axes, each with its interval or why there is none.
        let provenance = file.provenance.unwrap();
        let notes = provenance["fits"][0]["notes"].to_string();
        assert_eq!(
            file.intervals.len() + 3 * notes.matches("no interval").count(),
            12,
            "{notes}"
        );
        for i in file.intervals {
            assert!(i.low < i.high && i.low >= 0.0, "{i:?}");
        }
        assert_eq!(provenance["estimator"].as_str(), Some(estimator));
        let text =
            std::fs::read_to_string(dir.path().join(format!("imu_{estimator}.wv.json"))).unwrap();
        let curves: Value = serde_json::from_str(&text).unwrap();
        let curve = &curves["curves"][0];
        assert_eq!(
            (curve["sensor"].as_str(), curve["axis"].as_str()),
            (Some("gyro"), Some("all"))
        );
        assert_eq!(curve["replicates"].as_array().unwrap().len(), 12);
        let (wv, edof) = (numbers(&curve["wv"]), numbers(&curve["edof"]));
        assert_eq!(wv.len(), 13);
        let parts: Vec<Vec<f64>> = ["WN", "AR1", "RW"]
            .map(|l| numbers(&curve["processes"][l]))
            .to_vec();
        for i in 0..13 {
            // The degrees of freedom are conservative: five deviations, 13 × 3 values.
            let deviation = (wv[i] / model.haar_wv(i as u32 + 1) - 1.0) / (2.0 / edof[i]).sqrt();
            assert!(
                deviation.abs() < 5.0,
                "{estimator}, level {}: {deviation}",
                i + 1
            );
            let implied = curve["implied"][i].as_f64().unwrap();
            assert!((parts.iter().map(|p| p[i]).sum::<f64>() / implied - 1.0).abs() < 1e-12);
            let (low, high) = (numbers(&curve["ci_low"])[i], numbers(&curve["ci_high"])[i]);
            assert!(low < wv[i] && wv[i] < high);
            assert!(
                (curve["tau_s"][i].as_f64().unwrap() / (0.02 * 2_f64.powi(i as i32 + 1)) - 1.0)
                    .abs()
                    < 1e-6
            );
        }
    }
}

#[test]
fn a_curve_written_is_a_curve_read() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 3);
    let first = json(
        dir.path(),
        &[
            "calibrate",
            "runs",
            "--model",
            "N1",
            "--pool",
            "axes",
            "-o",
            "imu.toml",
        ],
    );
    let again = json(
        dir.path(),
        &[
            "calibrate",
            "--curve",
            "imu.wv.json",
            "--model",
            "AR1+WN+RW",
        ],
    );
    assert_eq!(first["fits"].as_array().unwrap().len(), 2);
    for (a, b) in first["fits"]
        .as_array()
        .unwrap()
        .iter()
        .zip(again["fits"].as_array().unwrap())
    {
        assert_eq!(
            (&a["sensor"], &a["axis"], &a["termination"]),
            (&b["sensor"], &b["axis"], &b["termination"])
        );
        assert!(
            (a["objective"].as_f64().unwrap() / b["objective"].as_f64().unwrap() - 1.0).abs()
                < 1e-9
        );
    }
    assert_eq!(first["fits"][1]["axis"], "y");
}

/// The file of `wv` is a curve file: its classical curves are GMWM's, the robust ones RGMWM's.
#[test]
fn the_curves_of_wv_give_the_fits_of_their_recording() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    json(dir.path(), &["wv", "runs/run1.csv", "-o", "one.wv.json"]);
    let direct = json(
        dir.path(),
        &[
            "calibrate",
            "runs/run1.csv",
            "--estimator",
            "all",
            "--model",
            "N1",
            "-o",
            "m.toml",
        ],
    );
    let fits = json(
        dir.path(),
        &["calibrate", "--curve", "one.wv.json", "--model", "N1"],
    );
    let sorted = |out: &Value| {
        let key = |f: &Value| (f["estimator"].to_string(), f["axis"].to_string());
        let mut fits: Vec<_> = out["fits"]
            .as_array()
            .unwrap()
            .iter()
            .map(|f| (key(f), f["objective"].as_f64().unwrap()))
            .collect();
        fits.sort_by(|a, b| a.0.cmp(&b.0));
        fits
    };
    let (direct, fits) = (sorted(&direct), sorted(&fits));
    assert_eq!(direct.len(), 4);
    for (a, b) in direct.iter().zip(&fits) {
        assert!(a.0 == b.0 && (a.1 / b.1 - 1.0).abs() < 1e-9, "{a:?} {b:?}");
    }
    json(dir.path(), &["check", "one.wv.json"]);
    let text = std::fs::read_to_string(dir.path().join("one.wv.json")).unwrap();
    let edited: Value = serde_json::from_str(&text).unwrap();
    let edited = Value::Object(
        edited
            .as_object()
            .unwrap()
            .clone()
            .into_iter()
            .chain([("efficiency".into(), 0.into())])
            .collect(),
    );
    std::fs::write(dir.path().join("none.wv.json"), edited.to_string()).unwrap();
    let stderr = refusal(
        dir.path(),
        &["calibrate", "--curve", "none.wv.json", "--model", "N1"],
        2,
    );
    assert!(
        stderr.contains("none.wv.json, head: efficiency = 0 is not above 0"),
        "{stderr}"
    );
    json(dir.path(), &["wv", "runs", "-o", "two.wv.json"]);
    let stderr = refusal(
        dir.path(),
        &["calibrate", "--curve", "two.wv.json", "--model", "N1"],
        2,
    );
    assert!(
        stderr.contains("two.wv.json: two curves of gyro.x for gmwm"),
        "{stderr}"
    );
}

#[test]
fn a_table_of_exact_values_gives_back_its_parameters() {
    let dir = tempfile::tempdir().unwrap();
    let mut text = "tau_samples,wv,edof\n".to_owned();
    for level in 1..=15_u32 {
        let wv: f64 = truth().iter().map(|p| p.haar_wv(level)).sum();
        writeln!(
            text,
            "{},{wv:e},{}",
            1_u64 << level,
            5e5 / f64::from(level).exp2()
        )
        .unwrap();
    }
    std::fs::write(dir.path().join("curve.csv"), text).unwrap();
    let stderr = refusal(
        dir.path(),
        &["calibrate", "--curve", "curve.csv", "--model", "N1"],
        2,
    );
    assert!(
        stderr.contains("curve.csv: the curve states no sample rate"),
        "{stderr}"
    );
    assert!(
        stderr.contains("hint: give the rate with --rate-hz"),
        "{stderr}"
    );
    let out = json(
        dir.path(),
        &[
            "calibrate",
            "--curve",
            "curve.csv",
            "--model",
            "N1",
            "--rate-hz",
            "50",
        ],
    );
    let processes = &out["fits"][0]["processes"];
    for (i, process) in truth().iter().enumerate() {
        assert_eq!(processes[i]["type"], process.code());
        for (name, value) in process.parameters() {
            assert!(
                (processes[i][name].as_f64().unwrap() / value - 1.0).abs() < 1e-8,
                "{name}"
            );
        }
    }
    let stderr = refusal(
        dir.path(),
        &[
            "calibrate",
            "--curve",
            "curve.csv",
            "--rate-hz",
            "50",
            "-o",
            "m.toml",
        ],
        2,
    );
    assert!(
        stderr.contains("curve.csv: the curve names no sensor"),
        "{stderr}"
    );
    json(
        dir.path(),
        &[
            "calibrate",
            "--curve",
            "curve.csv",
            "--rate-hz",
            "50",
            "--axes",
            "gyro",
            "-o",
            "m.toml",
        ],
    );
    assert!(dir.path().join("m.toml").exists());
}

#[test]
fn threads_do_not_change_a_byte() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 4);
    for threads in ["1", "2"] {
        let out = format!("m{threads}.toml");
        let seeded = [
            "calibrate",
            "runs",
            "-q",
            "--seed",
            "4",
            "-j",
            threads,
            "-o",
            &out,
        ];
        nav_sim(dir.path()).args(seeded).assert().success();
    }
    let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
    assert_eq!(read("m1.toml"), read("m2.toml"));
    assert!(read("m1.toml").contains("seed = 4\n"));
    assert_eq!(read("m1.wv.json"), read("m2.wv.json"));
}

#[test]
fn wv_prints_the_curves_of_every_signal() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let out = json(dir.path(), &["wv", "runs/run1.csv"]);
    let signals = out["signals"].as_array().unwrap();
    assert_eq!(signals.len(), 2);
    assert_eq!(
        (&signals[1]["sensor"], &signals[1]["axis"]),
        (&"gyro".into(), &"y".into())
    );
    assert_eq!(signals[0]["samples"], SAMPLES);
    let x = signal(1, "gyro.x");
    let mean = x.iter().sum::<f64>() / SAMPLES as f64;
    let centred: Vec<f64> = x.iter().map(|v| v - mean).collect();
    let expected = nav_sim::signal::wavelet::classical(&centred, 13).unwrap();
    for (actual, expected) in numbers(&signals[0]["classical"]["wv"]).iter().zip(expected) {
        // The file holds all digits; the mean is removed twice along different roads.
        assert!((actual / expected - 1.0).abs() < 1e-9);
    }
    for key in ["wv", "ci_low", "ci_high"] {
        assert_eq!(numbers(&signals[0]["robust"][key]).len(), 13);
    }
    assert_eq!(signals[0]["robust"]["status"][0], "ok");
    let wide = numbers(&signals[0]["classical"]["ci_high"]);
    let out = json(
        dir.path(),
        &[
            "wv",
            "runs/run1.csv",
            "--intervals",
            "large-sample",
            "--scales",
            "5",
        ],
    );
    let narrow = numbers(&out["signals"][0]["classical"]["ci_high"]);
    assert_eq!(
        (narrow.len(), out["edof_method"].as_str()),
        (5, Some("large-sample"))
    );
    assert!(narrow[4] < wide[4]);
    let text = |more: &[&str]| {
        let output = nav_sim(dir.path())
            .args(["wv", "runs"])
            .args(more)
            .assert()
            .success();
        String::from_utf8(output.get_output().stdout.clone()).unwrap()
    };
    let digest = text(&[]);
    assert!(
        digest.lines().count() <= 20 && digest.contains("gyro.x (rad/s)"),
        "{digest}"
    );
}

#[test]
fn a_model_is_chosen_and_slopes_are_read() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let out = json(
        dir.path(),
        &[
            "calibrate",
            "runs",
            "--model",
            "auto",
            "--estimator",
            "awv",
            "--pool",
            "axes",
        ],
    );
    let fit = &out["fits"][0];
    let ranking = fit["ranking"].as_array().unwrap();
    let chosen: Vec<&Value> = ranking.iter().filter(|c| c["chosen"] == true).collect();
    assert_eq!((chosen.len(), &chosen[0]["model"]), (1, &fit["model"]));
    assert!(!fit["reasons"].as_array().unwrap().is_empty());
    let avlr = ["calibrate", "runs/run0.csv", "--estimator", "avlr"];
    let out = json(dir.path(), &[&avlr[..], &["--model", "WN+RW"]].concat());
    let sigma2 = out["fits"][0]["processes"][0]["sigma2"].as_f64().unwrap();
    // The AR1 is seen from the first scales on: high, but not by an order of magnitude.
    assert!((4e-6..8e-6).contains(&sigma2), "{sigma2}");
    let stderr = refusal(dir.path(), &avlr, 2);
    assert!(
        stderr.contains("AR1 has no slope of its own") && stderr.contains("hint: --model WN+RW"),
        "{stderr}"
    );
    // The curve of white noise begins with the slope −½: no quantization noise, whatever its end does.
    let out = json(dir.path(), &[&avlr[..], &["--model", "WN+QN+RW"]].concat());
    let fit = &out["fits"][0];
    assert_eq!(fit["zero"].to_string(), "[\"QN\"]");
    assert!(
        fit["notes"].to_string().contains("QN is zero") && fit["goodness"].is_null(),
        "{fit}"
    );
}
