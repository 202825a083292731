//! Figures of `wv` and `calibrate`; their words are in `transcripts/calibrate.md`.

use crate::common::drive::*;
use nav_sim::io::model_file;
use nav_sim::signal::noise::{Composite, Process};
use nav_sim::signal::rng::StreamKey;
use rand::RngExt;
use rand_distr::StandardNormal;
use serde_json::Value;
use std::fmt::Write;

const SAMPLES: usize = 1 << 14;

/// WN + AR1 + RW whose parts lead at different scales of 2^14 samples.
fn truth() -> [Process; 3] {
    [
        Process::white(4e-6).unwrap(),
        Process::ar1(0.98, 4e-8).unwrap(),
        Process::random_walk(1e-11).unwrap(),
    ]
}

fn signal(run: u64, source: &str) -> Vec<f64> {
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
    let mut sample = |_| {
        ar1 = 0.98 * ar1 + 2e-4 * normal();
        walk += 1e-11_f64.sqrt() * normal();
        2e-3 * normal() + ar1 + walk
    };
    (0..SAMPLES).map(&mut sample).collect()
}

/// Replicates of gyro x and y at 50 Hz in `runs`.
fn recorded(count: u64) -> Place {
    let place = Place::new();
    for run in 0..count {
        let (x, y) = (signal(run, "gyro.x"), signal(run, "gyro.y"));
        let mut text = "t_s,gyro_x_rad_s,gyro_y_rad_s\n".to_owned();
        for t in 0..SAMPLES {
            writeln!(text, "{:.2},{:e},{:e}", 0.02 * t as f64, x[t], y[t]).unwrap();
        }
        place.write(&format!("runs/run{run}.csv"), text);
    }
    place
}

/// Fits of an answer, by sensor, axis and estimator.
fn fits(answer: &Value) -> Vec<(String, f64)> {
    let key = |fit: &Value| format!("{} {} {}", fit["sensor"], fit["axis"], fit["estimator"]);
    let fits = answer["fits"].as_array().unwrap().iter();
    let mut fits: Vec<_> = fits
        .map(|fit| (key(fit), number(fit, "/objective")))
        .collect();
    fits.sort_by(|a, b| a.0.cmp(&b.0));
    fits
}

#[track_caller]
fn assert_same(a: &Value, b: &Value, count: usize) {
    let (a, b) = (fits(a), fits(b));
    assert_eq!((a.len(), b.len()), (count, count));
    for (a, b) in a.iter().zip(&b) {
        assert!(a.0 == b.0 && off(a.1, b.1) < 1e-9, "{a:?} {b:?}");
    }
}

#[test]
fn recordings_become_a_model_file_and_its_curves() {
    let place = recorded(6);
    let out = place.answer("calibrate runs --model N1 --estimator all -o imu.toml");
    assert_eq!(out["fits"].as_array().unwrap().len(), 3);
    let replicates = out["replicates"].as_array().unwrap();
    assert_eq!(replicates.len(), 6);
    assert!(replicates.iter().all(|r| r["verdict"] == "normal"));
    let model = Composite::new(truth().to_vec());
    for estimator in ["awv", "sr-awv", "dr-awv"] {
        let file = model_file::read(&place.at(&format!("imu_{estimator}.toml"))).unwrap();
        assert_eq!(file.model.rate_hz.round() as i64, 50);
        let missing: Vec<String> = file.missing.iter().map(ToString::to_string).collect();
        // pooled: one model for the three axes
        assert_eq!(missing, ["accel.x", "accel.y", "accel.z"]);
        // four parameters on each of three axes, each with its interval or the reason why there is none
        let provenance = file.provenance.unwrap();
        let notes = provenance["fits"][0]["notes"].to_string();
        let without = notes.matches("no interval").count();
        assert_eq!(file.intervals.len() + 3 * without, 12, "{notes}");
        let is_sound = |i: &model_file::Interval| 0.0 <= i.low && i.low < i.high;
        assert!(file.intervals.iter().all(is_sound));
        assert_eq!(provenance["estimator"].as_str(), Some(estimator));
        let text = place.read(&format!("imu_{estimator}.wv.json"));
        let hash = blake3::hash(text.as_bytes()).to_hex();
        assert_eq!(provenance["curves_blake3"].as_str(), Some(hash.as_str()));
        let curves: Value = serde_json::from_str(&text).unwrap();
        let curve = &curves["curves"][0];
        assert_eq!(
            (&curve["sensor"], &curve["axis"]),
            (&"gyro".into(), &"all".into())
        );
        assert_eq!(curve["replicates"].as_array().unwrap().len(), 12);
        let of = |key: &str| {
            let values = numbers(curve, key);
            assert_eq!(values.len(), 13, "{key}");
            values
        };
        let [wv, edof, implied, tau_s] = ["/wv", "/edof", "/implied", "/tau_s"].map(of);
        let [low, high] = ["/ci_low", "/ci_high"].map(of);
        let parts = ["WN", "AR1", "RW"].map(|process| of(&format!("/processes/{process}")));
        for i in 0..13 {
            // the degrees of freedom are conservative: five deviations, 13 × 3 values
            let deviation = (wv[i] / model.haar_wv(i as u32 + 1) - 1.0) / (2.0 / edof[i]).sqrt();
            assert!(
                deviation.abs() < 5.0,
                "{estimator}, level {}: {deviation}",
                i + 1
            );
            assert!(off(parts.iter().map(|p| p[i]).sum(), implied[i]) < 1e-12);
            assert!(low[i] < wv[i] && wv[i] < high[i]);
            assert!(off(tau_s[i], 0.02 * 2_f64.powi(i as i32 + 1)) < 1e-6);
        }
    }
}

/// Curves of `calibrate` and of `wv` give the fits of their recordings: the classical curves of `wv` are GMWM's, the robust
/// ones RGMWM's.
#[test]
fn a_curve_written_is_a_curve_read() {
    let place = recorded(3);
    let direct = place.answer("calibrate runs --model N1 --pool axes -o imu.toml");
    let again = place.answer("calibrate --curve imu.wv.json --model AR1+WN+RW");
    assert_same(&direct, &again, 2);
    place.done("wv runs/run1.csv -o one.wv.json");
    let direct = place.answer("calibrate runs/run1.csv --estimator all --model N1 -o m.toml");
    let again = place.answer("calibrate --curve one.wv.json --model N1");
    assert_same(&direct, &again, 4);
}

#[test]
fn a_table_of_exact_values_gives_back_its_parameters() {
    let place = Place::new();
    let mut text = "tau_samples,wv,edof\n".to_owned();
    for level in 1..=15_u32 {
        let wv: f64 = truth().iter().map(|p| p.haar_wv(level)).sum();
        let edof = 5e5 / f64::from(level).exp2();
        writeln!(text, "{},{wv:e},{edof}", 1_u64 << level).unwrap();
    }
    place.write("curve.csv", text);
    let out = place.answer("calibrate --curve curve.csv --model N1 --rate-hz 50");
    let processes = &out["fits"][0]["processes"];
    for (i, process) in truth().iter().enumerate() {
        assert_eq!(processes[i]["type"], process.code());
        for (name, value) in process.parameters() {
            assert!(
                off(number(&processes[i], &format!("/{name}")), value) < 1e-8,
                "{name}"
            );
        }
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let place = recorded(4);
    for threads in [1, 2] {
        place.done(&format!(
            "calibrate runs -q --seed 4 -j {threads} -o m{threads}.toml"
        ));
    }
    assert_eq!(place.read("m1.toml"), place.read("m2.toml"));
    assert_eq!(place.read("m1.wv.json"), place.read("m2.wv.json"));
}

#[test]
fn wv_prints_the_curves_of_every_signal() {
    let place = recorded(2);
    let out = place.answer("wv runs/run1.csv");
    let signals = out["signals"].as_array().unwrap();
    assert_eq!((signals.len(), &signals[1]["axis"]), (2, &"y".into()));
    assert_eq!(signals[0]["samples"], SAMPLES);
    let x = signal(1, "gyro.x");
    let mean = x.iter().sum::<f64>() / SAMPLES as f64;
    let centred: Vec<f64> = x.iter().map(|v| v - mean).collect();
    let expected = nav_sim::signal::wavelet::classical(&centred, 13).unwrap();
    let found = numbers(&signals[0], "/classical/wv");
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.into_iter().zip(expected) {
        // the file holds all digits; the mean is removed twice along different roads
        assert!(off(found, expected) < 1e-9);
    }
    for key in ["wv", "ci_low", "ci_high"] {
        assert_eq!(numbers(&signals[0], &format!("/robust/{key}")).len(), 13);
    }
    assert_eq!(signals[0]["robust"]["status"][0], "ok");
    let wide = numbers(&signals[0], "/classical/ci_high");
    let out = place.answer("wv runs/run1.csv --intervals large-sample --scales 5");
    let narrow = numbers(&out, "/signals/0/classical/ci_high");
    assert_eq!(
        (narrow.len(), &out["edof_method"]),
        (5, &"large-sample".into())
    );
    assert!(narrow[4] < wide[4]);
}

#[test]
fn a_model_is_chosen_and_slopes_are_read() {
    let place = recorded(2);
    let out = place.answer("calibrate runs --model auto --estimator awv --pool axes");
    let fit = &out["fits"][0];
    let ranking = fit["ranking"].as_array().unwrap();
    let chosen: Vec<&Value> = ranking.iter().filter(|c| c["chosen"] == true).collect();
    assert_eq!((chosen.len(), &chosen[0]["model"]), (1, &fit["model"]));
    assert!(!fit["reasons"].as_array().unwrap().is_empty());
    let avlr = "calibrate runs/run0.csv --estimator avlr --model";
    let sigma2 = number(
        &place.answer(&format!("{avlr} WN+RW")),
        "/fits/0/processes/0/sigma2",
    );
    // the AR1 is seen from the first scales on: high, but not by an order of magnitude
    assert!((4e-6..8e-6).contains(&sigma2), "{sigma2}");
    // the curve of white noise begins with the slope −½: no quantization noise, whatever its end does
    let out = place.answer(&format!("{avlr} WN+QN+RW"));
    let fit = &out["fits"][0];
    assert_eq!(fit["zero"], serde_json::json!(["QN"]));
    assert!(fit["goodness"].is_null(), "{fit}");
}

/// Recordings of one model for both sensors at 50 Hz in `made`.
fn made(processes: &str, synthesize: &str) -> Place {
    let place = Place::new();
    let processes = format!("processes = [{processes}]");
    let model = format!("schema = 1\nrate_hz = 50.0\n[accel]\n{processes}\n[gyro]\n{processes}\n");
    place.write("imu.toml", model);
    place.done(&format!(
        "synthesize imu.toml --samples 16384 --seed 1 -o made {synthesize}"
    ));
    place
}

/// Quantization as IEEE 952 has it, of the increments: q2 = 4e-4 at 50 Hz is 0.02/50 = 4e-4 m/s, and rad. Of four signals of 16384 samples
/// it is known to 1 % or so; 8 % are allowed. A rate would be fifty times as large.
#[test]
fn quantization_is_that_of_increments() {
    let noise = r#"{ type = "WN", sigma2 = 4e-5 }, { type = "QN", q2 = 4e-4 }"#;
    let place = made(noise, "--replicates 4 --axes x");
    let text = place
        .done("calibrate made --model WN+QN --bootstrap 0 --seed 1 --verbose -o m.toml")
        .stdout;
    for unit in ["m/s", "rad"] {
        let label = format!("quantization Q ({unit})");
        let rest = text.split(&label).nth(1).unwrap();
        let value: f64 = rest.split_whitespace().next().unwrap().parse().unwrap();
        assert!(off(value, 4e-4) < 0.08, "{text}");
    }
}

/// N, K and B of the JSON are those that `export` has of the model file, to the last bit; N is that of the noise: sigma2 of nine
/// signals of 16384 samples is known to √(2/(9·16384·0.6)) = 0.5 % or so, N to half of that, eight of which are allowed.
#[test]
fn practitioners_parameters_are_those_of_export() {
    let noise = r#"{ type = "WN", sigma2 = 4e-6 }, { type = "RW", gamma2 = 1e-10 }"#;
    let place = made(noise, "--replicates 3");
    let out = place.answer("calibrate made --model WN+RW --bootstrap 39 --seed 1 -o m.toml");
    let exported = place.answer("export m.toml --target kalibr");
    let fits = out["fits"].as_array().unwrap();
    assert_eq!(fits.len(), 2);
    for fit in fits {
        let sensor = fit["sensor"].as_str().unwrap();
        let of_export = &exported["sensors"][sensor]["largest"]["walk"];
        let [degrees, hour] = match sensor {
            "gyro" => [180.0 / std::f64::consts::PI, 3600.0],
            _ => [1.0, 1.0],
        };
        let (density, walk) = (number(of_export, "/density"), number(of_export, "/walk"));
        let n = number(fit, "/figures/N/value");
        assert!(off(n, density * degrees * 60.0) < 1e-12, "{fit}");
        let k = number(fit, "/figures/K/value");
        assert!(off(k, walk * degrees * hour * 60.0) < 1e-12, "{fit}");
        assert!(off(density, (4e-6_f64 / 50.0).sqrt()) < 0.02, "{density}");
        let ends = numbers(fit, "/figures/N/ci95");
        assert!(
            ends[0] < n && n < ends[1] && ends[1] / ends[0] < 1.05,
            "{ends:?}"
        );
        assert!(fit["missed"].as_array().unwrap().is_empty());
    }
}
