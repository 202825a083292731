//! What a calibration leaves open, from the recordings to the figures of `run --method lincov`.

use crate::common::drive::*;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The draws stand beside the model, and every figure at an outage's end has an interval, the same at any number of
/// threads; an edited model is not of its draws.
#[test]
fn intervals_go_from_recordings_to_navigation() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    done(dir, "synthesize imu.toml --replicates 4 --samples 8192 --seed 1 -o made");
    let said = done(dir, "calibrate made --model WN+RW --seed 1 -o m.toml").stderr;
    assert!(said.contains("wrote m.toml, m.wv.json, m.draws.json"), "{said}");
    let analysis = |model: &str, out: &str| {
        done(dir, &format!("run drive.toml {model} --method lincov --outage 30:45 {out}"))
    };
    let ran = analysis("m.toml", "-o out -j 1");
    assert!(ran.stderr.contains("95 % by the calibration, end of 30–45 s: p95 "), "{}", ran.stdout);
    let summary = json(&dir.join("out/summary.json"));
    let outage = &summary["outages"][0];
    let holds = |ends: &Value, value: &Value| {
        let [low, high, value] = [&ends[0], &ends[1], value].map(|v| v.as_f64().unwrap());
        assert!(low < value && value < high, "{low} {value} {high}");
    };
    for state in nav_sim::navigation::simulation::REPORTED_NAMES {
        for figure in ["asee_end", "asee_mean", "rmse_end"] {
            holds(&outage[format!("{figure}_ci95")][state], &outage[figure][state]);
        }
    }
    // Over the outage the position leans on the fixes before it, whose noise is no part of the calibration: the interval
    // of its mean is narrower than that at the end, and it is this one that a ratio of means gets.
    let half_of_log = |figure: &str| {
        let ends = &outage[figure]["pos_e_m"];
        0.5 * (ends[1].as_f64().unwrap() / ends[0].as_f64().unwrap()).ln()
    };
    let [mean, end] = ["asee_mean_ci95", "asee_end_ci95"].map(half_of_log);
    assert!(0.0 < mean && mean < 0.8 * end, "{mean} {end}");
    done(dir, "run drive.toml imu.toml --method lincov --outage 30:45 -o known");
    done(dir, "compare out --reference known -o ratios.json");
    let rows = json(&dir.join("ratios.json"))["rows"].as_array().unwrap().clone();
    assert!(rows.iter().all(|row| row["calibration_half_pct"].is_null()), "one of them has no draws");
    fs::copy(dir.join("m.toml"), dir.join("n.toml")).unwrap();
    fs::copy(dir.join("m.draws.json"), dir.join("n.draws.json")).unwrap();
    analysis("n.toml", "-o same");
    done(dir, "compare out --reference same -o even.json");
    let rows = json(&dir.join("even.json"))["rows"].as_array().unwrap().clone();
    let east = rows.iter().find(|row| row["state"] == "pos_e_m").unwrap();
    let expected = 100.0 * mean.hypot(mean);
    assert!(
        (east["calibration_half_pct"].as_f64().unwrap() / expected - 1.0).abs() < 1e-6,
        "{east} {expected}"
    );
    let horizontal = &outage["horizontal_error_end_m"];
    holds(&horizontal["p95_ci95"], &horizontal["p95"]);
    assert!(outage["sensitivity"]["gyro.RW.gamma2"]["yaw_deg"].as_f64().unwrap() > 0.0);
    analysis("m.toml", "-o again -j 2");
    assert_eq!(json(&dir.join("again/summary.json")), summary);

    let edited = fs::read_to_string(dir.join("m.toml")).unwrap().replacen("sigma2 = ", "sigma2 = 1", 1);
    fs::write(dir.join("m.toml"), edited).unwrap();
    let ran = analysis("m.toml", "-o other");
    assert!(ran.stderr.contains("m.draws.json is not of m.toml: no intervals"), "{}", ran.stderr);
    fs::write(dir.join("m.draws.json"), "{").unwrap();
    let ran = nav_sim(dir, "run drive.toml m.toml --method lincov --outage 30:45 -o other");
    assert!(ran.stderr.contains("m.draws.json, line 1: "), "{}", ran.stderr);
    done(dir, "run drive.toml m.toml --truth imu.toml --method lincov --verbose --outage 30:45 -o other");
}
