//! `wv` and `calibrate` as a user runs them.

use assert_cmd::Command;
use nav_sim::noise::{Ar1, Composite, Process, RandomWalk, White};
use nav_sim::rng::StreamKey;
use rand::RngExt;
use rand_distr::StandardNormal;
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

pub(super) const SAMPLES: usize = 1 << 14;

/// WN + AR1 + RW whose parts lead at different scales of 2^14 samples.
pub(super) fn truth() -> [Process; 3] {
    [
        Process::White(White::new(4e-6).unwrap()),
        Process::Ar1(Ar1::new(0.98, 4e-8).unwrap()),
        Process::RandomWalk(RandomWalk::new(1e-11).unwrap()),
    ]
}

pub(super) fn signal(run: u64, source: &str) -> Vec<f64> {
    let key = StreamKey { seed: 7, scenario: "calibrate", run, source, process: "" };
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
    let output = nav_sim(dir).args(arguments).args(["--format", "json", "-q"]).assert().success();
    serde_json::from_slice(&output.get_output().stdout).unwrap()
}

pub(super) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value}")).iter().map(|v| v.as_f64().unwrap()).collect()
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
    let out =
        json(dir.path(), &["calibrate", "runs", "--model", "N1", "--estimator", "all", "-o", "imu.toml"]);
    assert_eq!(out["fits"].as_array().unwrap().len(), 3);
    let replicates = out["replicates"].as_array().unwrap();
    assert_eq!(replicates.len(), 6);
    assert!(replicates.iter().all(|r| r["verdict"] == "normal"), "{replicates:?}");
    for replicate in replicates {
        assert_eq!(replicate["scores"]["y"]["noise"].as_array().unwrap().len(), 13);
        // Three estimators, four parameters each.
        let left_out = replicate["left_out"].as_array().unwrap();
        assert!(
            left_out.len() == 3 && left_out.iter().all(|l| l["parameters"].as_array().unwrap().len() == 4)
        );
    }
    let model = Composite::new(truth().to_vec());
    for estimator in ["awv", "sr-awv", "dr-awv"] {
        let file =
            nav_sim::formats::model_file::read(&dir.path().join(format!("imu_{estimator}.toml"))).unwrap();
        assert_eq!(file.model.rate_hz.round() as i64, 50);
        let missing: Vec<String> = file.missing.iter().map(ToString::to_string).collect();
        assert_eq!(missing, ["accel.x", "accel.y", "accel.z"], "pooled: one model for the three axes");
        // Four parameters on each of three axes, each with its interval or why there is none.
        let provenance = file.provenance.unwrap();
        let notes = provenance["fits"][0]["notes"].to_string();
        assert_eq!(file.intervals.len() + 3 * notes.matches("no interval").count(), 12, "{notes}");
        for i in file.intervals {
            assert!(i.low < i.high && i.low >= 0.0, "{i:?}");
        }
        assert_eq!(provenance["estimator"].as_str(), Some(estimator));
        let text = std::fs::read_to_string(dir.path().join(format!("imu_{estimator}.wv.json"))).unwrap();
        let curves: Value = serde_json::from_str(&text).unwrap();
        let curve = &curves["curves"][0];
        assert_eq!((curve["sensor"].as_str(), curve["axis"].as_str()), (Some("gyro"), Some("all")));
        assert_eq!(curve["replicates"].as_array().unwrap().len(), 12);
        let (wv, edof) = (numbers(&curve["wv"]), numbers(&curve["edof"]));
        assert_eq!(wv.len(), 13);
        let parts: Vec<Vec<f64>> = ["WN", "AR1", "RW"].map(|l| numbers(&curve["processes"][l])).to_vec();
        for i in 0..13 {
            // The degrees of freedom are conservative: five deviations, 13 × 3 values.
            let deviation = (wv[i] / model.haar_wv(i as u32 + 1) - 1.0) / (2.0 / edof[i]).sqrt();
            assert!(deviation.abs() < 5.0, "{estimator}, level {}: {deviation}", i + 1);
            let implied = curve["implied"][i].as_f64().unwrap();
            assert!((parts.iter().map(|p| p[i]).sum::<f64>() / implied - 1.0).abs() < 1e-12);
            let (low, high) = (numbers(&curve["ci_low"])[i], numbers(&curve["ci_high"])[i]);
            assert!(low < wv[i] && wv[i] < high);
            assert!(
                (curve["tau_s"][i].as_f64().unwrap() / (0.02 * 2_f64.powi(i as i32 + 1)) - 1.0).abs() < 1e-6
            );
        }
    }
}

#[test]
fn a_curve_written_is_a_curve_read() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 3);
    let first = json(dir.path(), &["calibrate", "runs", "--model", "N1", "--pool", "axes", "-o", "imu.toml"]);
    let again = json(dir.path(), &["calibrate", "--curve", "imu.wv.json", "--model", "AR1+WN+RW"]);
    assert_eq!(first["fits"].as_array().unwrap().len(), 2);
    for (a, b) in first["fits"].as_array().unwrap().iter().zip(again["fits"].as_array().unwrap()) {
        assert_eq!(
            (&a["sensor"], &a["axis"], &a["termination"]),
            (&b["sensor"], &b["axis"], &b["termination"])
        );
        assert!((a["objective"].as_f64().unwrap() / b["objective"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    }
    assert_eq!(first["fits"][1]["axis"], "y");
}

/// Without the shortest recording there would be more scales; the diagnosis leaves it out at those of the whole: the fit of
/// the others, to the optimiser's tolerance.
#[test]
fn a_short_recording_is_left_out_at_the_same_scales() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 4);
    let path = dir.path().join("runs/run3.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let short: Vec<&str> = text.lines().take(1 + SAMPLES / 10).collect();
    std::fs::write(&path, short.join("\n") + "\n").unwrap();
    let fit = |weighting: &str, inputs: &[&str], scales: &[&str]| {
        let flags = ["--model", "N1", "--estimator", "awv", "--weighting", weighting];
        json(dir.path(), &[&["calibrate"], inputs, &flags, scales].concat())
    };
    // With the full covariance it ends at all: the scales of the whole are mixed.
    assert_eq!(fit("full", &["runs"], &[])["replicates"][3]["left_out"].as_array().unwrap().len(), 1);
    let all = fit("edof", &["runs"], &[]);
    let moved = &all["replicates"][3]["left_out"][0]["parameters"];
    let scales = all["fits"][0]["scales"].to_string();
    let others = ["runs/run0.csv", "runs/run1.csv", "runs/run2.csv"];
    let rest = fit("edof", &others, &["--scales", &scales]);
    for (i, (process, name)) in [(0, "sigma2"), (1, "phi"), (1, "sigma2")].into_iter().enumerate() {
        let expected = rest["fits"][0]["processes"][process][name].as_f64().unwrap();
        let without = moved[i]["without"].as_f64().unwrap();
        assert!((without / expected - 1.0).abs() < 1e-5, "{name}: {without} {expected}");
    }
}

/// The file of `wv` is a curve file: its classical curves are GMWM's, the robust ones RGMWM's.
#[test]
fn the_curves_of_wv_give_the_fits_of_their_recording() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    json(dir.path(), &["wv", "runs/run1.csv", "-o", "one.wv.json"]);
    let direct = json(
        dir.path(),
        &["calibrate", "runs/run1.csv", "--estimator", "all", "--model", "N1", "-o", "m.toml"],
    );
    let fits = json(dir.path(), &["calibrate", "--curve", "one.wv.json", "--model", "N1"]);
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
        edited.as_object().unwrap().clone().into_iter().chain([("efficiency".into(), 0.into())]).collect(),
    );
    std::fs::write(dir.path().join("none.wv.json"), edited.to_string()).unwrap();
    let stderr = refusal(dir.path(), &["calibrate", "--curve", "none.wv.json", "--model", "N1"], 2);
    assert!(stderr.contains("none.wv.json, head: efficiency = 0 is not a number above 0"), "{stderr}");
    json(dir.path(), &["wv", "runs", "-o", "two.wv.json"]);
    let stderr = refusal(dir.path(), &["calibrate", "--curve", "two.wv.json", "--model", "N1"], 2);
    assert!(stderr.contains("two.wv.json: there are two curves of gyro.x for gmwm"), "{stderr}");
}

#[test]
fn a_table_of_exact_values_gives_back_its_parameters() {
    let dir = tempfile::tempdir().unwrap();
    let mut text = "tau_samples,wv,edof\n".to_owned();
    for level in 1..=15_u32 {
        let wv: f64 = truth().iter().map(|p| p.haar_wv(level)).sum();
        writeln!(text, "{},{wv:e},{}", 1_u64 << level, 5e5 / f64::from(level).exp2()).unwrap();
    }
    std::fs::write(dir.path().join("curve.csv"), text).unwrap();
    let stderr = refusal(dir.path(), &["calibrate", "--curve", "curve.csv", "--model", "N1"], 2);
    assert!(stderr.contains("curve.csv: the curve does not say its sample rate"), "{stderr}");
    assert!(stderr.contains("hint: give the rate with --rate-hz"), "{stderr}");
    let out = json(dir.path(), &["calibrate", "--curve", "curve.csv", "--model", "N1", "--rate-hz", "50"]);
    let processes = &out["fits"][0]["processes"];
    for (i, process) in truth().iter().enumerate() {
        assert_eq!(processes[i]["type"], process.code());
        for (name, value) in process.parameters() {
            assert!((processes[i][name].as_f64().unwrap() / value - 1.0).abs() < 1e-8, "{name}");
        }
    }
    assert_eq!(out["files"].as_array().unwrap().len(), 0);
    let stderr =
        refusal(dir.path(), &["calibrate", "--curve", "curve.csv", "--rate-hz", "50", "-o", "m.toml"], 2);
    assert!(stderr.contains("curve.csv: the curve does not say of which sensor it is"), "{stderr}");
    json(
        dir.path(),
        &["calibrate", "--curve", "curve.csv", "--rate-hz", "50", "--sensor", "gyro", "-o", "m.toml"],
    );
    assert!(dir.path().join("m.toml").exists());
}

#[test]
fn threads_do_not_change_a_byte() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 4);
    for threads in ["1", "2"] {
        let out = format!("m{threads}.toml");
        let seeded = ["calibrate", "runs", "-q", "--seed", "4", "-j", threads, "-o", &out];
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
    assert_eq!((&signals[1]["sensor"], &signals[1]["axis"]), (&"gyro".into(), &"y".into()));
    assert_eq!(signals[0]["samples"], SAMPLES);
    let x = signal(1, "gyro.x");
    let mean = x.iter().sum::<f64>() / SAMPLES as f64;
    let centred: Vec<f64> = x.iter().map(|v| v - mean).collect();
    let expected = nav_sim::wavelet::classical(&centred, 13).unwrap();
    for (actual, expected) in numbers(&signals[0]["classical"]["wv"]).iter().zip(expected) {
        // The file holds all digits; the mean is removed twice along different roads.
        assert!((actual / expected - 1.0).abs() < 1e-9);
    }
    for key in ["wv", "ci_low", "ci_high"] {
        assert_eq!(numbers(&signals[0]["robust"][key]).len(), 13);
    }
    assert_eq!(signals[0]["robust"]["status"][0], "ok");
    let wide = numbers(&signals[0]["classical"]["ci_high"]);
    let out = json(dir.path(), &["wv", "runs/run1.csv", "--intervals", "large-sample", "--scales", "5"]);
    let narrow = numbers(&out["signals"][0]["classical"]["ci_high"]);
    assert_eq!((narrow.len(), out["edof_method"].as_str()), (5, Some("large-sample")));
    assert!(narrow[4] < wide[4]);
    let text = |more: &[&str]| {
        let output = nav_sim(dir.path()).args(["wv", "runs"]).args(more).assert().success();
        String::from_utf8(output.get_output().stdout.clone()).unwrap()
    };
    let (digest, all) = (text(&[]), text(&["--verbose"]));
    assert!(digest.lines().count() <= 20 && digest.contains("gyro.x  rad/s"), "{digest}");
    assert!(
        all.contains("run0.csv · gyro.x · 16384 samples") && all.contains("Allan deviation (rad/s)"),
        "{all}"
    );
    assert!(text(&["--per-file"]).contains("run0.csv  run1.csv"));
    assert!(text(&["--per-file"]).lines().all(|line| line.chars().count() <= 120));
    assert_eq!(text(&["--format", "csv"]).lines().count(), 1 + 4 * 13);
    let stderr = refusal(dir.path(), &["check", "runs/run0.csv", "--format", "csv"], 2);
    assert!(stderr.contains("--format csv is a format of wv alone"), "{stderr}");
}

/// sigma2 is fixed at the truth, phi bounded away from it: the fit is where it was told to be.
#[test]
fn parameters_can_be_fixed_and_bounded() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let spec = "[gyro.WN]\nsigma2 = { fix = 4e-6 }\n[AR1]\nphi = { lower = 0.5, upper = 0.9 }\n";
    std::fs::write(dir.path().join("p.toml"), spec).unwrap();
    let calibrate = ["calibrate", "runs", "--model", "N1", "--estimator", "awv", "-o", "m.toml"];
    let out = json(dir.path(), &[&calibrate[..], &["--parameters", "p.toml"]].concat());
    let processes = &out["fits"][0]["processes"];
    assert_eq!(processes[0]["sigma2"].to_string(), "4e-6", "as given, to the last bit");
    assert!(processes[0].get("sigma2_ci95").is_none(), "nothing is estimated of it");
    assert_eq!(processes[1]["phi"].to_string(), "0.9");
    let notes = out["fits"][0]["notes"].to_string();
    assert!(notes.contains("AR1 phi = 0.9 is at the bound you gave"), "{notes}");
    assert!(!notes.contains("sigma2 ="), "{notes}");
    let scales = out["fits"][0]["scales"].as_u64().unwrap();
    assert_eq!(
        out["fits"][0]["goodness"]["dof"].as_u64().unwrap(),
        scales - 3,
        "phi, sigma2 and gamma2 are free"
    );
    std::fs::write(dir.path().join("p.toml"), "[AR1]\nphi = { lower = 0.9, upper = 0.5 }\n").unwrap();
    let stderr = refusal(dir.path(), &[&calibrate[..], &["--parameters", "p.toml"]].concat(), 2);
    assert!(
        stderr.contains("p.toml, line 2: \"AR1.phi\" = { lower = 0.9, upper = 0.5 } is not possible"),
        "{stderr}"
    );
    std::fs::write(dir.path().join("p.toml"), "[gyro.x.WN]\nsigma2 = { fix = 1 }\n").unwrap();
    let stderr = refusal(dir.path(), &[&calibrate[..], &["--parameters", "p.toml"]].concat(), 2);
    assert!(stderr.contains("the axes are pooled") && stderr.contains("hint: --pool axes"), "{stderr}");
}

#[test]
fn a_model_is_chosen_and_slopes_are_read() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let out =
        json(dir.path(), &["calibrate", "runs", "--model", "auto", "--estimator", "awv", "--pool", "axes"]);
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
        fit["notes"].to_string().contains("QN: no such slope found") && fit["goodness"].is_null(),
        "{fit}"
    );
    let full = json(
        dir.path(),
        &["calibrate", "runs", "--model", "N1", "--estimator", "awv", "--weighting", "full"],
    );
    let sigma2 = full["fits"][0]["processes"][0]["sigma2"].as_f64().unwrap();
    assert!((sigma2 / 4e-6 - 1.0).abs() < 0.1, "{sigma2}");
}

#[test]
fn files_that_are_no_tables_are_refused_as_such() {
    let dir = tempfile::tempdir().unwrap();
    let rows: String = (0..64).map(|t| format!("{},{}\n", 0.01 * f64::from(t), t % 7)).collect();
    let table = format!("t_s,gyro_x_rad_s\n{rows}");
    let utf16: Vec<u8> =
        [0xfeff].into_iter().chain(table.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("utf16.csv", &utf16);
    write("mac.csv", table.replace('\n', "\r").as_bytes());
    write("binary.csv", &[7, 0, 200, 10, 0, 3]);
    write("plain.csv.gz", table.as_bytes());
    write("feet.csv", table.replace("gyro_x_rad_s", "accel_x_ft_s2").as_bytes());
    write("ok.csv", table.as_bytes());
    for (arguments, what, hint) in [
        (&["utf16.csv"][..], "it is in UTF-16", "UTF-8"),
        (&["mac.csv"], "a carriage return only", "one row a line"),
        (&["binary.csv"], "it is binary", "CSV"),
        (&["plain.csv.gz"], "plain.csv.gz: ", "not gzipped"),
        (
            &["feet.csv"],
            "feet.csv, line 1: column \"accel_x_ft_s2\" is in a unit that is not known",
            "_m_s2, _g, _mg",
        ),
        (
            &["ok.csv", "--skip-s", "10"],
            "leaving out the first 10 s leaves 0 samples of 0.64 s",
            "a smaller --skip-s",
        ),
    ] {
        let stderr = refusal(dir.path(), &[&["wv", "-q"], arguments].concat(), 2);
        assert!(
            stderr.contains(what) && stderr.split("hint: ").nth(1).is_some_and(|h| h.contains(hint)),
            "{stderr}"
        );
    }
    let stderr = refusal(dir.path(), &["wv", "nowhere.csv"], 1);
    assert!(stderr.contains("hint: check the path"), "{stderr}");
}

#[test]
fn bad_requests_are_refused_with_a_hint() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let calibrate =
        |more: &[&str], code| refusal(dir.path(), &[&["calibrate", "runs", "-q"], more].concat(), code);
    let check = |stderr: String, parts: &[&str]| {
        for part in parts {
            assert!(stderr.contains(part), "{part:?} is not in {stderr}");
        }
    };
    check(
        calibrate(&["--model", "2*AR+RW"], 2),
        &["error: --model: model \"2*AR+RW\": \"AR\" is no process", "hint: did you mean \"AR1\"?"],
    );
    check(calibrate(&["--model", "2*WN"], 2), &["2 WN are one WN"]);
    check(
        calibrate(&["--trim", "2"], 2),
        &[
            "gyro, dr-awv: trimming 2 replicates at each end needs at least 5 replicates; there are 4",
            "hint:",
        ],
    );
    check(calibrate(&["--trim", "60%"], 2), &["--trim", "a percentage under 50"]);
    check(calibrate(&["--efficiency", "1.5"], 2), &["--efficiency: efficiency 1.5 is out of range"]);
    check(calibrate(&["--scales", "20"], 2), &["run0.csv", "16384", "hint:"]);
    check(
        calibrate(&["--scales", "5"], 2),
        &["WN+QN+2*AR1+RW has 7 parameters, the curve 5 scales", "hint: record for longer"],
    );
    check(calibrate(&["--estimator", "gmwm"], 2), &["gmwm takes one recording at a time; there are 2"]);
    let before = std::fs::read(dir.path().join("runs/run0.csv")).unwrap();
    check(calibrate(&["-o", "runs/run0.csv"], 2), &["is an input of this command and would be overwritten"]);
    std::fs::write(dir.path().join("known.toml"), "[WN]\nsigma2 = { upper = 1.0 }\n").unwrap();
    let onto_parameters = calibrate(&["--model", "WN", "--parameters", "known.toml", "-o", "known.toml"], 2);
    check(
        refusal(dir.path(), &["wv", "runs", "-o", "runs/run0.csv"], 2),
        &["run0.csv is an input of this command"],
    );
    check(onto_parameters, &["known.toml is an input of this command and would be overwritten"]);
    assert_eq!(std::fs::read(dir.path().join("runs/run0.csv")).unwrap(), before);
    std::fs::create_dir(dir.path().join("taken.toml")).unwrap();
    check(calibrate(&["-o", "taken.toml"], 2), &["--out taken.toml: it is a directory", "hint:"]);
    check(calibrate(&["-o", "/dev/full"], 2), &["--out /dev/full: it is a device"]);
    check(refusal(dir.path(), &["calibrate"], 2), &["required"]);
    check(refusal(dir.path(), &["calibrate", "nowhere.csv"], 1), &["nowhere.csv: No such file"]);
    check(refusal(dir.path(), &["wv", "runs", "--axes", "gyro.w"], 2), &["gyro.w", "accel.x"]);
    std::fs::write(dir.path().join("curve.csv"), "tau_samples,wv,edof\n2,1e-5,10\n4,0,5\n").unwrap();
    check(
        refusal(dir.path(), &["calibrate", "--curve", "curve.csv"], 2),
        &["curve.csv, line 3: wv = 0 is not a number from 1e-100 to 1e100", "hint: a curve is a CSV"],
    );
    std::fs::write(dir.path().join("curve.csv"), "tau_samples,wv,edof\n2,1e-5,10\n4,1e-5,5\n").unwrap();
    for flag in
        [["--trim", "1"], ["--skip-s", "0"], ["--estimator", "awv"], ["--scales", "2"], ["--axes", "x"]]
    {
        let arguments = [&["calibrate", "--curve", "curve.csv", "--rate-hz", "1"][..], &flag].concat();
        check(refusal(dir.path(), &arguments, 2), &["cannot be used with", "--curve"]);
    }
    assert!(!dir.path().join("model.toml").exists() && !dir.path().join("model.wv.json").exists());
}

/// A model without `--seed` says which one was drawn, in the file too; the name of the output is the one given; copies of
/// a recording do not count.
#[test]
fn what_was_drawn_is_recorded_and_copies_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let calibrate = ["calibrate", "runs", "--model", "N1", "--bootstrap", "19", "-o", "imu"];
    let output = nav_sim(dir.path()).args(calibrate).assert().success();
    let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
    let seed =
        said.split("(drawn; repeat with --seed ").nth(1).unwrap().split(')').next().unwrap().to_owned();
    let text = std::fs::read_to_string(dir.path().join("imu")).unwrap();
    assert!(text.contains(&format!("seed = {seed}\n")), "{text}");
    assert!(dir.path().join("imu.wv.json").exists() && !dir.path().join("imu.toml").exists());
    let curve = ["calibrate", "--curve", "imu.wv.json", "--model", "N1", "--rate-hz", "50"];
    assert!(refusal(dir.path(), &curve, 2).contains("the curve says its rate, 50 Hz"));

    let copy = dir.path().join("runs/run2.csv");
    // With other line ends: the samples count, not the bytes.
    let text = std::fs::read_to_string(dir.path().join("runs/run0.csv")).unwrap();
    std::fs::write(&copy, text.replace('\n', "\r\n")).unwrap();
    let stderr = refusal(dir.path(), &calibrate, 2);
    assert!(stderr.contains("run2.csv is a copy of runs/run0.csv"), "{stderr}");
    // A recording that costs the others scales is told.
    let rows = std::fs::read_to_string(&copy).unwrap();
    let first: Vec<&str> = rows.lines().take(600).collect();
    std::fs::write(&copy, first.join("\n") + "\n").unwrap();
    let short = ["calibrate", "runs", "--model", "WN+RW", "--bootstrap", "0", "-o", "short.toml"];
    let output = nav_sim(dir.path()).args(short).assert().success();
    let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
    assert!(said.contains("run2.csv: its 599 samples limit all recordings to 8 scales"), "{said}");
}

/// Twenty seconds of another level at the beginning; half of them already left out: what is advised counts from the
/// beginning of the file.
#[test]
fn what_is_skipped_counts_in_the_advice() {
    let dir = tempfile::tempdir().unwrap();
    let mut text = "t_s,gyro_x_rad_s\n".to_owned();
    for (t, x) in signal(0, "gyro.x").iter().enumerate() {
        let level = if t < 3000 { 1e-4 * (3000 - t) as f64 } else { 0.0 };
        writeln!(text, "{:.2},{:e}", 0.02 * t as f64, x + level).unwrap();
    }
    std::fs::write(dir.path().join("warm.csv"), text).unwrap();
    let advised = |skip: &str| {
        let arguments =
            ["calibrate", "warm.csv", "--estimator", "gmwm", "--model", "WN+RW", "--bootstrap", "0"];
        let output = nav_sim(dir.path()).args(arguments).args(["--skip-s", skip]).assert().success();
        let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
        let seconds = said.split("--skip-s ").nth(1).unwrap_or_else(|| panic!("{said}"));
        seconds.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    for skip in ["0", "20"] {
        let seconds = advised(skip);
        assert!((50.0..=85.0).contains(&seconds), "after {skip}: {seconds}");
    }
}

/// The parameters file with its hash and every limit, how the recordings were read, and the curves' hash are in the
/// model file; a file that was read from a pipe is hashed as it was read.
#[test]
fn a_model_says_what_it_was_made_with() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let known = "[WN]\nsigma2 = { fix = 1e-4 }\n[gyro.AR1]\nphi = { lower = 0.5, upper = 0.99 }\n";
    std::fs::write(dir.path().join("known.toml"), known).unwrap();
    let model = |parameters: &str| -> toml::Table {
        let command = format!(
            "{} calibrate runs --model N1 --bootstrap 0 --parameters {parameters} --skip-s 1.5 --gaps ignore --axes \
             gyro --scales 9 --pool sensor --force -o m.toml",
            env!("CARGO_BIN_EXE_nav-sim")
        );
        let shell =
            std::process::Command::new("bash").arg("-c").arg(command).current_dir(dir.path()).output();
        let shell = shell.unwrap();
        assert!(shell.status.success(), "{}", String::from_utf8_lossy(&shell.stderr));
        let text = std::fs::read_to_string(dir.path().join("m.toml")).unwrap();
        text.parse::<toml::Table>().unwrap()["provenance"].as_table().unwrap().clone()
    };
    for parameters in ["known.toml", "<(cat known.toml)"] {
        let provenance = model(parameters);
        assert_eq!(provenance["skip_s"].as_float(), Some(1.5));
        assert_eq!(
            (provenance["gaps"].as_str(), provenance["pool"].as_str()),
            (Some("ignore"), Some("sensor"))
        );
        assert_eq!(
            (provenance["scales"].as_integer(), provenance["weighting"].as_str()),
            (Some(9), Some("model"))
        );
        assert_eq!(provenance["axes"].as_array().unwrap().len(), 3);
        let limits = provenance["limits"].as_array().unwrap();
        assert_eq!((limits[0]["signals"].as_str(), limits[0]["fix"].as_float()), (Some("all"), Some(1e-4)));
        assert_eq!(
            (limits[1]["signals"].as_str(), limits[1]["upper"].as_float()),
            (Some("gyro"), Some(0.99))
        );
        let inputs = provenance["inputs"].as_array().unwrap();
        let own = inputs.iter().find(|i| i["role"].as_str() == Some("parameters")).unwrap();
        assert_eq!(own["blake3"].as_str(), Some(blake3::hash(known.as_bytes()).to_hex().as_str()));
        let curves = std::fs::read(dir.path().join("m.wv.json")).unwrap();
        assert_eq!(provenance["curves_blake3"].as_str(), Some(blake3::hash(&curves).to_hex().as_str()));
    }
}

/// Without a name the output is model.toml: one that no calibration wrote stays as it is.
#[test]
fn a_model_of_the_default_name_replaces_only_its_own_kind() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 1);
    let calibrate = ["calibrate", "runs", "--model", "WN+RW", "--bootstrap", "0"];
    for _ in 0..2 {
        nav_sim(dir.path()).args(calibrate).assert().success();
    }
    let own = "schema = 1\nrate_hz = 50.0\n[gyro]\nprocesses = [{ type = \"WN\", sigma2 = 1.0 }]\n";
    std::fs::write(dir.path().join("model.toml"), own).unwrap();
    let said = refusal(dir.path(), &calibrate, 2);
    assert!(said.contains("model.toml is not a model that nav-sim calibrate wrote"), "{said}");
    assert_eq!(std::fs::read_to_string(dir.path().join("model.toml")).unwrap(), own);
}

/// Scales outside count nothing and are recorded: of a fit with a range that holds two scales for two parameters nothing is left
/// to test.
#[test]
fn a_range_of_scales_is_recorded() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let fit = ["calibrate", "runs", "--model", "WN+RW", "--bootstrap", "0", "--fit-range", "0.04s:20.48s"];
    let out = json(dir.path(), &[&fit[..], &["-o", "m.toml"]].concat());
    assert_eq!(out["fits"][0]["scales"], 13, "all are in the file");
    let text = std::fs::read_to_string(dir.path().join("m.toml")).unwrap();
    let provenance = &text.parse::<toml::Table>().unwrap()["provenance"];
    let range: Vec<f64> =
        provenance["fit_range_s"].as_array().unwrap().iter().filter_map(toml::Value::as_float).collect();
    assert_eq!(range, [0.04, 20.48]);
    let short = ["calibrate", "runs", "--model", "N1", "--fit-range", "1s:2s", "-o", "n.toml"];
    assert!(refusal(dir.path(), &short, 2).contains("scales"));
    assert!(refusal(dir.path(), &["calibrate", "runs", "--fit-range", "2s:1s"], 2).contains("shorter scale"));
}
