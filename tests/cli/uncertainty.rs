//! Calibration uncertainty, from the recordings to the figures of `run --method lincov`.

use crate::common::drive::*;
use serde_json::Value;
use std::fs;

#[track_caller]
fn assert_inside(ends: &Value, value: &Value) {
    let [low, high, value] = [&ends[0], &ends[1], value].map(|v| v.as_f64().unwrap());
    assert!(low < value && value < high, "{low} {value} {high}");
}

/// The draws stand beside the model, and every figure at an outage's end has an interval, the same at any number of
/// threads; an edited model is not of its draws.
#[test]
fn intervals_go_from_recordings_to_navigation() {
    let place = place_with(DRIVE, MODEL);
    place.done("synthesize imu.toml --replicates 4 --samples 8192 --seed 1 -o made");
    place.done("calibrate made --model WN+RW --seed 1 -o m.toml");
    let analysis = |arguments: &str| {
        place.done(&format!(
            "run drive.toml {arguments} --method lincov --outage 30:45"
        ))
    };
    let ran = analysis("m.toml -o out -j 1");
    assert!(ran.stdout.contains("p95 (m)  95 % from"), "{}", ran.stdout);
    let summary = place.json("out/summary.json");
    let outage = &summary["outages"][0];
    for state in nav_sim::navigation::simulation::REPORTED_NAMES {
        for figure in ["asee_end", "asee_mean", "rmse_end"] {
            assert_inside(
                &outage[format!("{figure}_ci95")][state],
                &outage[figure][state],
            );
        }
    }
    let horizontal = &outage["horizontal_error_end_m"];
    assert_inside(&horizontal["p95_ci95"], &horizontal["p95"]);
    // Over the outage the position leans on the fixes before it, whose noise is no part of the calibration: the interval
    // of its mean is narrower than that at the end, and it is this one that a ratio of means gets.
    let [mean, end] = ["asee_mean_ci95", "asee_end_ci95"].map(|figure| {
        let ends = numbers(outage, &format!("/{figure}/pos_e_m"));
        0.5 * (ends[1] / ends[0]).ln()
    });
    assert!(0.0 < mean && mean < 0.8 * end, "{mean} {end}");
    analysis("imu.toml -o known");
    // another file with the same draws, as if of other recordings
    place.write("n.toml", place.read("m.toml") + "# another\n");
    fs::copy(place.at("m.draws.json"), place.at("n.draws.json")).unwrap();
    analysis("n.toml -o same");
    for (model, out) in [
        ("m.toml", "sampled"),
        ("n.toml", "sampled_n"),
        ("m.toml --filter full", "full"),
    ] {
        let runs = "--runs 4 --seed 1 --outage 30:45";
        place.done(&format!("run drive.toml {model} {runs} -o {out}"));
    }
    let east = |run: &str, reference: &str| {
        let found = place.answer(&format!("compare {run} --reference {reference}"));
        let mut rows = found["rows"].as_array().unwrap().iter();
        rows.find(|row| row["state"] == "pos_e_m").unwrap().clone()
    };
    // one side alone is known to be uncertain, then both; by runs as by covariance analysis
    let one = east("out", "known");
    let ratio = 100.0 + number(&one, "/ratio_error_pct");
    let both = 100.0 * mean.hypot(mean);
    for (row, expected, allowed) in [
        (one, ratio * mean, 1e-6),
        (east("out", "same"), both, 1e-6),
        (east("sampled", "sampled_n"), both, 1e-3),
    ] {
        assert!(
            off(number(&row, "/calibration_half_pct"), expected) < allowed,
            "{row}"
        );
    }
    // one model on both sides has one calibration
    assert!(east("full", "sampled")["calibration_half_pct"].is_null());
    analysis("m.toml -o again -j 2");
    assert_eq!(place.json("again/summary.json"), summary);

    place.write(
        "m.toml",
        place.read("m.toml").replacen("sigma2 = ", "sigma2 = 1", 1),
    );
    let note = "m.draws.json is not of m.toml: no intervals";
    let errors = analysis("m.toml -o other").stderr;
    assert!(errors.contains(note), "{errors}");
    place.write("m.draws.json", "{");
    let ran = place.run("run drive.toml m.toml --method lincov --outage 30:45 -o other");
    assert!(
        ran.stderr.contains("m.draws.json, line 1: "),
        "{}",
        ran.stderr
    );
    analysis("m.toml --truth imu.toml --verbose -o other");
}

/// Laws by which recordings differ go from them into the model, and from the model into other recordings and into plans.
#[test]
fn spread_goes_from_recordings_to_the_model_and_on() {
    let law = |(sensor, median): (&str, &str)| {
        format!(
            "[[spread.{sensor}]]\nprocess = \"WN\"\nparameter = \"sigma2\"\ndistribution = \"lognormal\"\nmedian = {median}\nsd = 0.3\n"
        )
    };
    let laws = [("accel", "5.4e-5"), ("gyro", "2e-6")].map(law).concat();
    let place = place_with(DRIVE, &format!("{MODEL}{laws}"));
    place.done("synthesize imu.toml --spread --replicates 5 --samples 4096 --seed 1 -o made");
    let found = place.answer("calibrate made --model WN+RW --bootstrap 60 --seed 1 -o m.toml");
    let spread = &found["fits"][0]["parameter_spread"][0];
    let law = (&spread["process"], &spread["distribution"]);
    assert_eq!(law, (&"WN".into(), &"lognormal".into()), "{found}");
    // of 12 degrees of freedom or fewer: 0.3 within a factor of two
    assert!((0.15..0.6).contains(&number(spread, "/sd")), "{spread}");
    let model: toml::Table = place.read("m.toml").parse().unwrap();
    assert!(model["spread"]["accel"][0]["sd_ci95"].is_array());
    place.done("synthesize m.toml --spread --replicates 2 --samples 4096 --seed 1 -o again");
    let planned = place.answer("design m.toml --recordings 4 --hours 0.01 --draws 40");
    let parameters = planned["designs"][0]["parameters"].as_array().unwrap();
    assert!(
        parameters
            .iter()
            .any(|p| p["endless_half_width_pct"].is_number()),
        "{planned}"
    );
}

/// White noise whose variance differs by 1.7 % between recordings (the beta law of the shipped IMU): half an hour adds
/// next to nothing to that, and four times the recordings have half the interval.
#[test]
fn intervals_shrink_with_recordings_and_not_with_hours_where_recordings_differ() {
    let place = Place::checkout();
    let half_width = |plan: &str| {
        let design = "design calib_data/consumer_mems.toml --draws 60 --estimator awv";
        let found = place.answer(&format!("{design} {plan}"));
        let mut parameters = found["designs"][0]["parameters"].as_array().unwrap().iter();
        let is_white = |p: &&Value| p["signals"] == "gyro" && p["parameter"] == "WN sigma2";
        number(parameters.find(is_white).unwrap(), "/half_width_pct")
    };
    let few = half_width("--recordings 3 --hours 0.5");
    // 60 draws know a 95 % interval to about 20 %, the ratio of two to 28 %; two of these are allowed
    let many = half_width("--recordings 12 --hours 0.5");
    assert!(off(many / few, 0.5) < 0.6, "{few} {many}");
    let longer = half_width("--recordings 3 --hours 2");
    assert!(off(longer, few) < 0.6, "{few} {longer}");
}

/// 200 s at 100 Hz without one sample in fifty: all 13 scales are there, to 81.92 s, with their degrees of freedom.
#[test]
fn lost_samples_cost_no_scale() {
    let place = place_with(DRIVE, MODEL);
    place.done("synthesize imu.toml --replicates 1 --samples 20000 --axes gyro.x --seed 1 -o made");
    let whole = place.read("made/replicate_1.csv");
    // a multiplicative hash: no pattern in time
    let is_lost = |k: usize| (k * 40_503) % 65_536 < 65_536 / 50;
    let kept = whole
        .lines()
        .enumerate()
        .filter(|(k, _)| *k == 0 || !is_lost(*k));
    place.write(
        "lost.csv",
        kept.map(|(_, line)| format!("{line}\n"))
            .collect::<String>(),
    );
    let curve = |file: &str, key: &str| {
        numbers(
            &place.answer(&format!("wv {file}")),
            &format!("/signals/0/{key}"),
        )
    };
    let [lost, whole] = ["lost.csv", "made/replicate_1.csv"].map(|file| curve(file, "tau_s"));
    assert_eq!(lost, whole);
    assert_eq!((lost.len(), lost[12]), (13, 81.92));
    let [lost, whole] = ["lost.csv", "made/replicate_1.csv"].map(|file| curve(file, "edof"));
    assert_eq!((lost.len(), whole.len()), (13, 13));
    for (lost, whole) in lost.into_iter().zip(whole) {
        assert!((0.94..=1.0).contains(&(lost / whole)), "{lost} {whole}");
    }
    place.done(
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
    let (accel, gyro) = (axis("5.4e-5", "1e-7"), axis("2e-6", "1e-8"));
    let place = place_with(
        DRIVE,
        &format!("rate_hz = 100.0\n[accel]\n{accel}[gyro]\n{gyro}"),
    );
    place.done("synthesize imu.toml --replicates 4 --samples 65536 --axes gyro --seed 1 -o made");
    let found = place
        .answer("calibrate made --model WN+FN --estimator awv --bootstrap 100 --seed 1 -o m.toml");
    let ends = numbers(&found, "/fits/0/processes/1/b2_ci95");
    assert!(
        ends[0] < 1e-8 && 1e-8 < ends[1] && ends[1] < 2.0 * ends[0],
        "{ends:?}"
    );
    place.done("run drive.toml imu.toml --method lincov --filter full --outage 30:45 -o full");
    assert_eq!(
        place.json("full/summary.json")["verdict"]["kind"],
        "consistent"
    );
    for command in [
        "export imu.toml --target kalibr",
        "run drive.toml imu.toml --runs 4 --outage 30:45 --seed 1 -o runs",
        "check imu.toml",
    ] {
        place.done(command);
    }
}

/// Two calibrations of one IMU by other recordings are told apart in 4 % of comparisons of ten figures; twice the variance of the
/// gyroscope's white noise, known to some percent from 12 signals, is N and WN of the gyroscope alone.
#[test]
fn a_change_between_calibrations_is_told_from_chance() {
    let place = place_with(DRIVE, MODEL);
    let louder = MODEL.replace("sigma2 = 2e-6", "sigma2 = 4e-6");
    assert_ne!(louder, MODEL);
    place.write("louder.toml", louder);
    for (k, model) in [(1, "imu"), (2, "imu"), (3, "louder")] {
        let recordings = "--replicates 4 --samples 8192";
        place.done(&format!(
            "synthesize {model}.toml {recordings} --seed {k} -o made{k}"
        ));
        place.done(&format!(
            "calibrate made{k} --model WN+RW --seed {k} -o {k}.toml"
        ));
    }
    let compared = |models: &str| place.answer(&format!("compare {models} -o found.json"));
    let changed = |found: &Value| {
        let rows = found["rows"].as_array().unwrap().iter();
        let rows = rows.filter(|row| row["changed"] == true);
        let name = |key: &str, row: &Value| row[key].as_str().unwrap().to_owned();
        let names = rows.map(|row| name("signal", row) + " " + &name("figure", row));
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    };
    let same = compared("1.toml 2.toml");
    assert!(
        number(&same, "/judged") >= 6.0 && changed(&same).is_empty(),
        "{same}"
    );
    let other = compared("1.toml 3.toml");
    assert_eq!(changed(&other), ["gyro N", "gyro WN sigma2"], "{other}");
    // the reference may be named; a ratio is over it
    let turned = compared("1.toml --reference 3.toml");
    let [ratio, inverse] = [&other, &turned].map(|found| {
        let mut rows = found["rows"].as_array().unwrap().iter();
        let row = rows.find(|row| row["signal"] == "gyro" && row["figure"] == "N");
        number(row.unwrap(), "/ratio")
    });
    assert!(off(ratio, 2.0_f64.sqrt()) < 0.1, "{other}");
    assert!((ratio * inverse - 1.0).abs() < 1e-12);
}
