//! Figures of `nav-sim run`, on a drive of a minute; its words are in `transcripts/run.md`.

use crate::common::drive::*;
use serde_json::{Value, json};

fn place() -> Place {
    place_with(
        DRIVE,
        &format!("{MODEL}[provenance]\nestimator = \"dr-awv\"\n"),
    )
}

/// Runs the drive with these options, and returns the summary.
fn summary(place: &Place, options: &str) -> Value {
    place.judged(&format!("run drive.toml imu.toml -o out {options}"));
    place.json("out/summary.json")
}

#[test]
fn a_run_directory_holds_what_the_interface_says() {
    let place = place();
    let found = summary(&place, "--runs 10 --outage 30:40 --seed 5");
    for (key, expected) in [("runs", 10), ("filter_states", 15), ("seed", 5)] {
        assert_eq!(found[key], expected);
    }
    let outage = &found["outages"][0];
    assert_eq!(number(outage, "/end_s"), 40.0);
    assert!(number(outage, "/asee_mean/pos_e_m") > 0.1);
    assert!(outage["verdict"]["kind"].is_string() && outage["verdict"]["worst_state"].is_string());
    assert!(number(outage, "/verdict/ratio") > 0.0, "{outage}");
    assert_eq!(found["verdict"]["kind"], "undecided");
    assert_eq!(found["verdict"]["by_covariance_analysis"], "consistent");
    assert!(
        (2.0..4.0).contains(&number(&found, "/verdict/times_to_decide")),
        "{found}"
    );
    assert!(number(&found, "/throughput_epochs_per_s") > 0.0);
    let manifest = place.json("out/manifest.json");
    assert_eq!(manifest["configuration"]["run"]["seed"], 5);
    let hash = blake3::hash(DRIVE.as_bytes()).to_hex();
    assert_eq!(manifest["inputs"][0]["blake3"], hash.as_str());
    assert_eq!(manifest["estimator"], "dr-awv");
    let epochs = place.table("out/epochs.csv");
    assert_eq!(epochs.len(), 61); // 0 … 60 s
    assert_eq!([29, 30, 39, 40].map(|s| epochs[s][1]), [1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let place = place();
    let command = "run drive.toml imu.toml --runs 20 --outage 30:40 --seed 9";
    let [one, two] = [1, 2].map(|j| place.done(&format!("{command} -j {j} -o {j}")).stdout);
    assert_eq!(one, two);
    for name in ["epochs.csv", "runs.csv", "summary.json", "report.html"] {
        // the throughput is the one number that the seed does not determine
        let [one, two] = [1, 2].map(|run| {
            let text = place.read(&format!("{run}/{name}"));
            let lines = text
                .lines()
                .filter(|l| !l.contains("throughput_epochs_per_s"));
            lines.map(str::to_owned).collect::<Vec<_>>()
        });
        assert_eq!(one, two, "{name}");
    }
    // seed 1 is the default
    let [default, first] = ["", "--seed 1"].map(|seed| {
        summary(&place, &format!("--runs 2 --outage none {seed}"));
        (
            place.read("out/epochs.csv"),
            place.json("out/manifest.json")["seed"].clone(),
        )
    });
    assert_eq!(default, first);
    assert_eq!(first.1, 1);
}

/// A filter whose accelerometer is 300 times as bad as it believes.
#[test]
fn a_filter_that_is_far_off_is_overconfident() {
    let place = place();
    place.write("rough.toml", MODEL.replace("1e-9", "1e-4"));
    let found = summary(
        &place,
        "--truth rough.toml --runs 8 --outage 20:50 --seed 3",
    );
    let verdict = &found["verdict"];
    assert_eq!(verdict["kind"], "overconfident");
    assert!(
        number(verdict, "/nees") > 100.0 && number(verdict, "/ratio") > 3.0,
        "{verdict}"
    );
}

#[test]
fn accuracy_is_told_without_outages() {
    let found = summary(&place(), "--runs 8 --outage none --seed 3");
    for state in ["pos_e_m", "vel_n_m_s"] {
        let [rmse, asee] =
            ["rmse", "asee"].map(|key| number(&found, &format!("/accuracy/{key}_mean/{state}")));
        // 8 runs of a matched filter, some tens of independent seconds each
        assert!(
            (0.6..1.5).contains(&(rmse / asee)),
            "{state}: {rmse} {asee}"
        );
    }
}

#[test]
fn flags_win_over_the_scenario_file() {
    let place = place();
    place.write(
        "s.toml",
        "outage = [{ start_s = 20, end_s = 30 }]\nrun = { runs = 3, seed = 4 }\n[gnss]\nrate_hz = 2\n",
    );
    let found = summary(&place, "--scenario s.toml --runs 2");
    assert_eq!((&found["runs"], &found["seed"]), (&2.into(), &4.into()));
    assert_eq!(number(&found, "/outages/0/start_s"), 20.0);
    assert_eq!(found["nis"]["fixes"], 2 * (120 - 20));
}

#[test]
fn candidates_with_the_same_seed_are_paired() {
    let place = place();
    place.write("louder.toml", MODEL.replace("1e-9", "4e-9"));
    for (model, out) in [("imu.toml", "reference"), ("louder.toml", "louder")] {
        let common = "--runs 8 --outage 30:50 --seed 3 --truth imu.toml";
        place.done(&format!("run drive.toml {model} {common} -o {out}"));
    }
    let ran = place.done("compare louder reference --reference reference --state pos_e_m");
    assert_eq!(ran.stderr, "wrote comparison.json, comparison.html\n");
    let comparison = place.json("comparison.json");
    let row = &comparison["rows"][1];
    assert_eq!(
        (&comparison["paired"], &row["state"]),
        (&true.into(), &"pos_e_m".into())
    );
    // the filter that believes in more noise believes itself less, beyond doubt
    assert!(number(row, "/ci95_pct/0") > 0.0, "{row}");
}

/// Whatever ends a run before its time, nothing is left that looks like one.
#[test]
fn a_run_that_is_killed_leaves_nothing_to_clean_up() {
    let place = place_with(DRIVE, MODEL);
    let command = "run drive.toml imu.toml --runs 1000000 --outage none --seed 1 -q -o out";
    let mut child = std::process::Command::new(PROGRAM)
        .args(command.split_whitespace())
        .current_dir(place.path())
        .spawn()
        .unwrap();
    // before its output is claimed it only tries whether it may write there
    while !place.at(".out.claim").exists() {
        assert!(
            child.try_wait().unwrap().is_none(),
            "a million runs already?"
        );
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    // but for the marker of its output, which is in nobody's way and goes with the next run
    assert_eq!(place.entries(""), [".out.claim", "drive.toml", "imu.toml"]);
    place.done("run drive.toml imu.toml --runs 2 --outage none --seed 1 -q -o out");
    assert_eq!(place.entries(""), ["drive.toml", "imu.toml", "out"]);
}

/// A truth that the filter does not know, and a barometer, all by the scenario file: they change the
/// run, are kept in its manifest, and show in its figures.
#[test]
fn the_true_imu_the_receiver_and_the_barometer_follow_the_scenario() {
    let place = place();
    place.write(
        "s.toml",
        "
imu = { turn_on_bias_accel_m_s2 = 0.2, scale_ppm_gyro = 2000, misalignment_rad = 0.002 }
gnss = { correlated_pos_sigma_m = [5, 5, 5], correlation_time_s = 30 }
baro = { rate_hz = 2, sigma_m = 0.5 }
outage = [{ start_s = 30, end_s = 45 }]
",
    );
    let plain = summary(&place, "--runs 8 --seed 2 --outage 30:45");
    // a filter that expects none of it is lost
    let worse = summary(&place, "--runs 8 --seed 2 --scenario s.toml");
    assert_eq!(worse["verdict"]["kind"], "overconfident");
    let [plain_nees, nees] = [&plain, &worse].map(|summary| number(summary, "/nees/mean"));
    assert!(nees > 2.0 * plain_nees, "{plain_nees} {nees}");
    let [plain_down, down] =
        [&plain, &worse].map(|summary| number(summary, "/outages/0/asee_mean/pos_d_m"));
    assert!(down < 0.5 * plain_down, "{plain_down} {down}");
    let kept = place.json("out/manifest.json");
    assert_eq!(number(&kept, "/configuration/imu/scale_ppm_gyro"), 2000.0);
}

/// A model of several processes is reduced to 15 states and compared with the full filter; a model that fits 15 states, and the
/// full filter, are left alone.
#[test]
fn the_reduction_of_the_model_is_kept() {
    let place = place();
    let process = "phi = 0.9999, sigma2 = 1e-9 }";
    let two = format!("{process}, {{ type = \"AR1\", phi = 0.99, sigma2 = 1e-7 }}");
    place.write("two.toml", MODEL.replace(process, &two));
    let reduction = |model: &str| {
        place.done(&format!(
            "run drive.toml {model} --runs 2 --outage 20:40 --seed 1 -o out"
        ));
        place.json("out/summary.json")["reduction"].clone()
    };
    let ratio = number(&reduction("two.toml"), "/outage_end/0/pos_e_m");
    assert!((0.5..2.0).contains(&ratio), "{ratio}");
    assert!(reduction("imu.toml").is_null());
    assert!(reduction("two.toml --filter full").is_null());
}

/// Covariance analysis makes the same directory, but for the table of runs; it needs no seed, and `compare` reads it.
#[test]
fn covariance_analysis_is_a_method_of_run() {
    let place = place();
    let expected = "--method lincov --outage 30:45 -o expected";
    place.done(&format!("run drive.toml imu.toml {expected}"));
    let found = place.json("expected/summary.json");
    assert_eq!(
        (&found["method"], &found["runs"]),
        (&"lincov".into(), &0.into())
    );
    for key in ["asee_mean", "asee_end", "rmse_mean", "rmse_end"] {
        assert!(
            number(&found, &format!("/outages/0/{key}/pos_e_m")) > 0.1,
            "{key}"
        );
    }
    let horizontal = &found["outages"][0]["horizontal_error_end_m"];
    let [p50, p95, p999] = ["/p50", "/p95", "/p999"].map(|key| number(horizontal, key));
    assert!(
        p50 < p95 && p95 < p999 && horizontal["max"].is_null(),
        "{horizontal}"
    );
    assert!(!place.at("expected/runs.csv").exists());
    assert!((number(&found, "/coverage/mean") - 0.95).abs() < 0.01);
    // nothing is drawn: no seed, no runs, no interval, no band, and no column for any of them
    let page = place.read("expected/report.html");
    let page = page
        .split("<body>")
        .nth(1)
        .unwrap()
        .split("Configuration")
        .next()
        .unwrap();
    let drawn = [
        "seed",
        "runs",
        "interval",
        "95 % band",
        "re-convergence",
        "epochs inside",
        ">–<",
        "[–",
    ];
    assert!(
        !drawn.into_iter().any(|words| page.contains(words)),
        "{page}"
    );
    let manifest = place.json("expected/manifest.json");
    let seeds = [
        &found["seed"],
        &manifest["seed"],
        &manifest["configuration"]["run"]["seed"],
    ];
    assert!(seeds.iter().all(|seed| seed.is_null()), "{seeds:?}");
    // one that is given is on record
    assert_eq!(
        summary(&place, "--method lincov --outage 30:45 --seed 7")["seed"],
        7
    );

    for options in [
        "--runs 16 --outage 30:45 --seed 2 -o sampled",
        "--method lincov --filter full --outage 30:45 -o full",
    ] {
        place.done(&format!("run drive.toml imu.toml {options}"));
    }
    let row = |run: &str| {
        place.done(&format!("compare {run} --reference expected"));
        place.json("comparison.json")["rows"][0].clone()
    };
    assert!(number(&row("sampled"), "/ratio_error_pct").abs() < 1.0);
    // nothing is drawn on either side: no interval, which one of no width would hide
    let exact = row("full");
    assert!(
        exact["ci95_pct"].is_null() && exact["rmse_end_ci95_pct"].is_null(),
        "{exact}"
    );
}

#[test]
fn runs_stand_beside_what_is_expected_of_them() {
    let place = place();
    let found = summary(&place, "--method both --runs 40 --outage 30:45 --seed 2");
    let of = |pointer: &str| found.pointer(pointer).unwrap();
    assert_eq!([of("/method"), of("/lincov/method")], ["both", "lincov"]);
    let verdicts = [
        "/verdict/kind",
        "/lincov/verdict/kind",
        "/verdict/by_covariance_analysis",
    ];
    assert_eq!(verdicts.map(of), ["consistent"; 3]);
    assert!(place.at("out/runs.csv").exists());
}

/// Two runs tell nothing of a filter whose accelerometer is twice as bad as it believes: the verdict is that of the runs, and
/// covariance analysis has its word beside it.
#[test]
fn few_runs_do_not_hide_a_filter_that_is_wrong() {
    let place = place();
    place.write("rough.toml", MODEL.replace("1e-9", "4e-9"));
    let run = "--truth rough.toml --outage 20:50 --seed 2";
    let sampled = summary(&place, &format!("{run} --runs 2"));
    let expected = summary(&place, &format!("{run} --method lincov"));
    assert_eq!(sampled["verdict"]["kind"], "undecided");
    assert_eq!(sampled["outages"][0]["verdict"]["kind"], "undecided");
    assert_eq!(
        sampled["verdict"]["by_covariance_analysis"],
        "overconfident"
    );
    assert_eq!(expected["verdict"]["kind"], "overconfident");
    assert_eq!(
        (&sampled["method"], &sampled["lincov"]),
        (&"monte-carlo".into(), &Value::Null)
    );
}

/// Shares of the sources of errors add up to one, with runs and without; of recordings nobody knows them.
#[test]
fn the_sources_of_errors_add_up() {
    let place = place();
    place.done("synthesize imu.toml --replicates 1 --samples 7000 --seed 1 -o made");
    let budget = |options: &str| {
        let found = summary(
            &place,
            &format!("--runs 2 --seed 1 --outage 30:45 {options}"),
        );
        found["outages"][0]["budget"].clone()
    };
    for method in ["lincov", "monte-carlo"] {
        let budget = budget(&format!("--method {method}"));
        let shares = budget.as_object().unwrap().values();
        let sum: f64 = shares.map(|shares| number(shares, "/yaw_deg")).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{budget}");
    }
    assert!(budget("--static made/replicate_1.csv").is_null());
}

/// A law without width is another truth, to the last bit; with one every run has its own.
#[test]
fn each_run_has_a_truth_of_its_own() {
    let law = |sd: &str| {
        format!(
            "{MODEL}\n[[spread.gyro]]\nprocess = \"WN\"\nparameter = \"sigma2\"\ndistribution = \"lognormal\"\nmedian = 4e-8\nsd = {sd}\n"
        )
    };
    let place = place();
    place.write("fixed.toml", law("0.0"));
    place.write("drawn.toml", law("0.5"));
    let truth = MODEL.replace("sigma2 = 2e-6", "sigma2 = 4e-8");
    assert_ne!(truth, MODEL);
    place.write("truth.toml", truth);
    let runs = |arguments: &str| {
        place.done(&format!(
            "run drive.toml {arguments} --runs 9 --outage 30:40 --seed 5 -o out"
        ));
        place.read("out/runs.csv")
    };
    let fixed = runs("fixed.toml --spread");
    assert_eq!(fixed, runs("imu.toml --truth truth.toml"));
    assert_ne!(fixed, runs("drawn.toml --spread"));
    assert_eq!(place.json("out/manifest.json")["spread"], true);
}

/// After five minutes with a consumer IMU linear theory finds no fault in a filter whose NEES in runs is 16 in place of 9: a verdict of
/// covariance analysis says until where it holds, and beside runs, which need not contradict it significantly, they decide. A
/// figure beyond linear theory shows no limit, horizontal errors excepted, in which the second order has no part.
#[test]
fn a_verdict_of_linear_theory_says_until_where_it_holds() {
    let place = Place::checkout();
    let run = |options: &str| {
        let files = "trajectories/land_vehicle.toml calib_data/consumer_mems.toml";
        place.judged(&format!("run {files} {options} -o out"));
        place.json("out/summary.json")
    };
    let kind = |found: &Value| {
        json!([
            found["verdict"]["kind"],
            found["verdict"]["beyond_linear"],
            found["lincov"]["verdict"]["kind"]
        ])
    };
    let long = run("--method lincov --outage 300:600");
    assert_eq!(kind(&long), json!(["doubtful", 0, null]));
    let short = run("--method lincov --outage 300:360");
    assert_eq!(kind(&short), json!(["consistent", null, null]));
    let both = run("--method both --outage 300:600 --runs 40 --seed 1");
    assert_eq!(kind(&both), json!(["overconfident", 0, "doubtful"]));

    let limits = "--outage 200:500 --outage 550:850 --require p95_m<=20000 --require pos_d_m<=60";
    let of = |found: &Value, k: usize| {
        json!([
            found["require"][k]["met"],
            found["require"][k]["beyond_linear"]
        ])
    };
    let analysis = run(&format!("{limits} --method lincov"));
    assert_eq!(
        [0, 1].map(|k| of(&analysis, k)),
        [json!([true, null]), json!([false, 0])]
    );
    // beside runs they decide
    let both = run(&format!("{limits} --method both --runs 60 --seed 1"));
    let value = |k: usize| number(&both, &format!("/require/{k}/value"));
    assert_eq!(value(1), number(&both, "/outages/1/rmse_end/pos_d_m"));
    assert_eq!(
        value(0),
        number(&both, "/lincov/outages/0/horizontal_error_end_m/p95")
    );
}

/// With a gyroscope of twice the deviations the first fixes after the outage put its shift into the biases: the warning names the update
/// that avoids it, and with that the errors after the outage are no longer what is worst.
#[test]
fn the_iterated_update_is_named_where_it_helps() {
    let place = Place::checkout();
    let loud = place
        .read("calib_data/consumer_mems.toml")
        .replace("sigma2 = 1.5e-06", "sigma2 = 6e-06")
        .replace("1.610566e-13", "6.4e-13")
        .replace("2.724096e-10", "1.1e-9");
    place.write("loud.toml", loud);
    for (update, is_over_run) in [("ekf", true), ("iterated", false)] {
        place.write("update.toml", format!("filter.update = \"{update}\"\n"));
        let ran = place.judged(
            "run trajectories/land_vehicle.toml loud.toml --filter full --outage 300:600 --runs 40 --seed 12 \
             --scenario update.toml -o out",
        );
        let verdict = &place.json("out/summary.json")["verdict"];
        assert_eq!(verdict["worst_outage"].is_null(), is_over_run, "{update}");
        let is_named = ran.stderr.contains("; filter.update = \"iterated\" does\n");
        assert_eq!(is_named, is_over_run, "{}", ran.stderr);
    }
}
