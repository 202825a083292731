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
    done(
        dir,
        "synthesize imu.toml --replicates 4 --samples 8192 --seed 1 -o made",
    );
    let said = done(dir, "calibrate made --model WN+RW --seed 1 -o m.toml").stderr;
    assert!(
        said.contains("wrote m.draws.json, m.wv.json, m.toml, m.html, m.svg"),
        "{said}"
    );
    let analysis = |model: &str, out: &str| {
        done(
            dir,
            &format!("run drive.toml {model} --method lincov --outage 30:45 {out}"),
        )
    };
    let ran = analysis("m.toml", "-o out -j 1");
    assert!(ran.stdout.contains("p95 (m)  95 % from"), "{}", ran.stdout);
    let summary = json(&dir.join("out/summary.json"));
    let outage = &summary["outages"][0];
    let holds = |ends: &Value, value: &Value| {
        let [low, high, value] = [&ends[0], &ends[1], value].map(|v| v.as_f64().unwrap());
        assert!(low < value && value < high, "{low} {value} {high}");
    };
    for state in nav_sim::navigation::simulation::REPORTED_NAMES {
        for figure in ["asee_end", "asee_mean", "rmse_end"] {
            holds(
                &outage[format!("{figure}_ci95")][state],
                &outage[figure][state],
            );
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
    done(
        dir,
        "run drive.toml imu.toml --method lincov --outage 30:45 -o known",
    );
    let east = |run: &str, reference: &str| {
        let said = done(
            dir,
            &format!("compare {run} --reference {reference} -o ratios.json"),
        );
        let rows = json(&dir.join("ratios.json"))["rows"].clone();
        let mut rows = rows.as_array().unwrap().iter();
        let row = rows.find(|row| row["state"] == "pos_e_m").unwrap();
        (row.clone(), said.stdout)
    };
    let half = |(row, _): &(Value, String)| row["calibration_half_pct"].as_f64().unwrap();
    let is_near = |found: f64, expected: f64| {
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    };
    // one side alone is known to be uncertain
    let one = east("out", "known");
    let ratio = 100.0 + one.0["ratio_error_pct"].as_f64().unwrap();
    is_near(half(&one), ratio * mean);
    let words = "95 % intervals (±) of the runs and the calibrations\n";
    assert!(one.1.contains(words), "{}", one.1);
    // another file with the same draws, as if of other recordings
    let text = fs::read_to_string(dir.join("m.toml")).unwrap();
    fs::write(dir.join("n.toml"), text + "# another\n").unwrap();
    fs::copy(dir.join("m.draws.json"), dir.join("n.draws.json")).unwrap();
    analysis("n.toml", "-o same");
    is_near(half(&east("out", "same")), 100.0 * mean.hypot(mean));
    // by runs as by covariance analysis; one model on both sides has one calibration
    let by_runs = "--runs 4 --seed 1 --outage 30:45";
    for (model, out) in [
        ("m.toml", "sampled"),
        ("n.toml", "sampled_n"),
        ("m.toml --filter full", "full"),
    ] {
        done(dir, &format!("run drive.toml {model} {by_runs} -o {out}"));
    }
    let sampled = east("sampled", "sampled_n");
    assert!(
        (half(&sampled) / (100.0 * mean.hypot(mean)) - 1.0).abs() < 1e-3,
        "{sampled:?}"
    );
    assert!(east("full", "sampled").0["calibration_half_pct"].is_null());
    let horizontal = &outage["horizontal_error_end_m"];
    holds(&horizontal["p95_ci95"], &horizontal["p95"]);
    analysis("m.toml", "-o again -j 2");
    assert_eq!(json(&dir.join("again/summary.json")), summary);

    let edited =
        fs::read_to_string(dir.join("m.toml"))
            .unwrap()
            .replacen("sigma2 = ", "sigma2 = 1", 1);
    fs::write(dir.join("m.toml"), edited).unwrap();
    let ran = analysis("m.toml", "-o other");
    assert!(
        ran.stderr
            .contains("m.draws.json is not of m.toml: no intervals"),
        "{}",
        ran.stderr
    );
    fs::write(dir.join("m.draws.json"), "{").unwrap();
    let ran = nav_sim(
        dir,
        "run drive.toml m.toml --method lincov --outage 30:45 -o other",
    );
    assert!(
        ran.stderr.contains("m.draws.json, line 1: "),
        "{}",
        ran.stderr
    );
    done(
        dir,
        "run drive.toml m.toml --truth imu.toml --method lincov --verbose --outage 30:45 -o other",
    );
}

/// What recordings differ by goes from them into the model, and from the model into other recordings and into plans.
#[test]
fn spread_goes_from_recordings_to_the_model_and_on() {
    let law = |sensor: &str, median: &str| {
        format!(
            "[[spread.{sensor}]]\nprocess = \"WN\"\nparameter = \"sigma2\"\ndistribution = \"lognormal\"\nmedian = {median}\nsd = 0.3\n"
        )
    };
    let place = place_with(
        DRIVE,
        &format!("{MODEL}{}{}", law("accel", "5.4e-5"), law("gyro", "2e-6")),
    );
    let dir = place.path();
    done(
        dir,
        "synthesize imu.toml --spread --replicates 5 --samples 4096 --seed 1 -o made",
    );
    let found = done(
        dir,
        "calibrate made --model WN+RW --bootstrap 60 --seed 1 --format json -o m.toml",
    )
    .stdout;
    let found: Value = serde_json::from_str(&found).unwrap();
    let spread = &found["fits"][0]["parameter_spread"][0];
    assert_eq!(
        (&spread["process"], &spread["distribution"]),
        (&"WN".into(), &"lognormal".into()),
        "{found}"
    );
    // of 12 degrees of freedom or fewer: 0.3 within a factor of two
    assert!(
        (0.15..0.6).contains(&spread["sd"].as_f64().unwrap()),
        "{spread}"
    );
    let text = fs::read_to_string(dir.join("m.toml")).unwrap();
    assert!(
        text.contains("[[spread.accel]]") && text.contains("sd_ci95 = ["),
        "{text}"
    );
    done(
        dir,
        "synthesize m.toml --spread --replicates 2 --samples 4096 --seed 1 -o again",
    );
    let planned = done(
        dir,
        "design m.toml --recordings 4 --hours 0.01 --draws 40 --format json",
    )
    .stdout;
    assert!(planned.contains("endless_half_width_pct"), "{planned}");
}

/// 200 s at 100 Hz without one sample in fifty: all 13 scales are there, to 81.92 s, with their degrees of freedom.
#[test]
fn lost_samples_cost_no_scale() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    done(
        dir,
        "synthesize imu.toml --replicates 1 --samples 20000 --axes gyro.x --seed 1 -o made",
    );
    let whole = fs::read_to_string(dir.join("made/replicate_1.csv")).unwrap();
    // a multiplicative hash: no pattern in time
    let is_lost = |k: usize| (k * 40_503) % 65_536 < 65_536 / 50;
    let kept: Vec<&str> = whole
        .lines()
        .enumerate()
        .filter(|(k, _)| *k == 0 || !is_lost(*k))
        .map(|(_, l)| l)
        .collect();
    fs::write(dir.join("lost.csv"), kept.join("\n") + "\n").unwrap();
    let curves = |file: &str| -> Value {
        serde_json::from_str(&done(dir, &format!("wv {file} --format json")).stdout).unwrap()
    };
    let (lost, whole) = (curves("lost.csv"), curves("made/replicate_1.csv"));
    let (lost, whole) = (&lost["signals"][0], &whole["signals"][0]);
    assert_eq!(lost["tau_s"], whole["tau_s"]);
    assert_eq!(lost["tau_s"][12], 81.92);
    for j in 0..13 {
        let at = |curve: &Value, key: &str| curve[key][j].as_f64().unwrap();
        let share = at(lost, "edof") / at(whole, "edof");
        assert!((0.94..=1.0).contains(&share), "{j}: {share}");
    }
    done(
        dir,
        "calibrate lost.csv --model WN+RW --estimator gmwm --bootstrap 40 --seed 1 -o m.toml",
    );
}

/// Flicker noise goes wherever a model goes, and comes back from recordings.
#[test]
fn flicker_noise_is_read_by_all() {
    let axis = |sigma2: &str, b2: &str| {
        format!(
            "processes = [{{ type = \"WN\", sigma2 = {sigma2} }}, {{ type = \"FN\", b2 = {b2} }}]\n"
        )
    };
    let model = format!(
        "rate_hz = 100.0\n[accel]\n{}[gyro]\n{}",
        axis("5.4e-5", "1e-7"),
        axis("2e-6", "1e-8")
    );
    let place = place_with(DRIVE, &model);
    let dir = place.path();
    done(
        dir,
        "synthesize imu.toml --replicates 4 --samples 65536 --axes gyro --seed 1 -o made",
    );
    let found = done(
        dir,
        "calibrate made --model WN+FN --estimator awv --bootstrap 100 --seed 1 --format json -o m.toml",
    )
    .stdout;
    let found: Value = serde_json::from_str(&found).unwrap();
    let fitted = &found["fits"][0]["processes"][1];
    let [low, high] = [0, 1].map(|i| fitted["b2_ci95"][i].as_f64().unwrap());
    assert!(low < 1e-8 && 1e-8 < high && high < 2.0 * low, "{fitted}");
    done(dir, "export imu.toml --target kalibr");
    let lincov = done(
        dir,
        "run drive.toml imu.toml --method lincov --filter full --outage 30:45 -o full",
    );
    assert!(
        lincov.stdout.starts_with("verdict: consistent"),
        "{}",
        lincov.stdout
    );
    done(
        dir,
        "run drive.toml imu.toml --runs 4 --outage 30:45 --seed 1 -o runs",
    );
    done(dir, "check imu.toml");
}

/// Two calibrations of one IMU by other recordings are told apart in 4 % of comparisons of ten figures; twice the variance of the
/// gyroscope's white noise, known to some percent from 12 signals, is N and WN of the gyroscope alone.
#[test]
fn a_change_between_calibrations_is_told_from_chance() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    let louder = MODEL.replacen("sigma2 = 2e-6", "sigma2 = 4e-6", 1);
    assert_ne!(louder, MODEL);
    fs::write(dir.join("louder.toml"), louder).unwrap();
    for (seed, of) in [(1, "imu"), (2, "imu"), (3, "louder")] {
        let recordings = "--replicates 4 --samples 8192";
        done(
            dir,
            &format!("synthesize {of}.toml {recordings} --seed {seed} -o made{seed}"),
        );
        done(
            dir,
            &format!("calibrate made{seed} --model WN+RW --seed {seed} -o {seed}.toml"),
        );
    }
    let compared = |words: &str| {
        let said = done(dir, &format!("compare {words} --format json -o found.json")).stdout;
        serde_json::from_str::<Value>(&said).unwrap()
    };
    let changed = |found: &Value| -> Vec<String> {
        let rows = found["rows"].as_array().unwrap().iter();
        let mut names: Vec<String> = rows
            .filter(|row| row["changed"] == true)
            .map(|row| format!("{} {}", row["signal"], row["figure"]).replace('"', ""))
            .collect();
        names.sort();
        names
    };
    let same = compared("1.toml 2.toml");
    assert!(
        same["judged"].as_u64().unwrap() >= 6 && changed(&same).is_empty(),
        "{same}"
    );
    let other = compared("1.toml 3.toml");
    assert_eq!(changed(&other), ["gyro N", "gyro WN sigma2"], "{other}");
    // the reference may be named; a ratio is over it
    let turned = compared("1.toml --reference 3.toml");
    let ratio = |found: &Value| {
        let mut rows = found["rows"].as_array().unwrap().iter();
        let row = rows.find(|row| row["signal"] == "gyro" && row["figure"] == "N");
        row.unwrap()["ratio"].as_f64().unwrap()
    };
    assert!(
        (ratio(&other) / 2.0_f64.sqrt() - 1.0).abs() < 0.1,
        "{other}"
    );
    assert!((ratio(&other) * ratio(&turned) - 1.0).abs() < 1e-12);
    let unjudged = done(dir, "compare imu.toml louder.toml -o found.json").stdout;
    assert!(
        unjudged.starts_with("not judged: no shared figure"),
        "{unjudged}"
    );

    done(dir, "run drive.toml imu.toml --runs 2 --seed 1 -o out");
    for (words, problem) in [
        ("out 1.toml", "1.toml is a file: runs are directories"),
        (
            "out --reference 1.toml",
            "1.toml is a file: runs are directories",
        ),
        ("1.toml", "1.toml is a file: runs are directories"),
        ("out", "no run to compare"),
    ] {
        let ran = nav_sim(dir, &format!("compare {words}"));
        assert!(
            ran.code == 2 && ran.stderr.contains(problem),
            "{words}: {}",
            ran.stderr
        );
    }
}
