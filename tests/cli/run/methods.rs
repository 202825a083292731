//! Covariance analysis, requirements, and where errors come from.

use super::*;

/// Covariance analysis makes the same directory, but for the table of runs; it needs no seed, and `compare` reads it.
#[test]
fn covariance_analysis_is_a_method_of_run() {
    let place = place();
    let ran = done(
        place.path(),
        "run drive.toml imu.toml --method lincov --outage 30:45 -o expected",
    );
    assert!(
        ran.stdout.starts_with("verdict: consistent: NEES 9.0"),
        "{}",
        ran.stdout
    );
    assert!(!ran.stderr.contains("seed"), "{}", ran.stderr);
    let out = place.path().join("expected");
    let summary = json(&out.join("summary.json"));
    assert_eq!(
        (&summary["method"], &summary["runs"]),
        (&"lincov".into(), &0.into())
    );
    let outage = &summary["outages"][0];
    for key in ["asee_mean", "asee_end", "rmse_mean", "rmse_end"] {
        assert!(outage[key]["pos_e_m"].as_f64().unwrap() > 0.1, "{key}");
    }
    let horizontal = &outage["horizontal_error_end_m"];
    let quantile = |name: &str| horizontal[name].as_f64().unwrap();
    assert!(quantile("p50") < quantile("p95") && quantile("p95") < quantile("p999"));
    assert!(horizontal["max"].is_null() && !out.join("runs.csv").exists());
    assert!((summary["coverage"]["mean"].as_f64().unwrap() - 0.95).abs() < 0.01);
    // nothing is drawn: no seed, no runs, no interval, no band, and no column for any of them
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("INS/GNSS lincov"));
    let page = page
        .split("<body>")
        .nth(1)
        .unwrap()
        .split("Configuration")
        .next()
        .unwrap();
    for words in [
        "seed",
        "runs",
        "interval",
        "95 % band",
        "re-convergence",
        "epochs inside",
        ">–<",
        "[–",
    ] {
        assert!(!page.contains(words), "{words}: {page}");
    }
    let manifest = json(&out.join("manifest.json"));
    let seeds = [
        &summary["seed"],
        &manifest["seed"],
        &manifest["configuration"]["run"]["seed"],
    ];
    assert!(seeds.iter().all(|seed| seed.is_null()), "{seeds:?}");
    // one that is given is on record
    done(
        place.path(),
        "run drive.toml imu.toml --method lincov --outage 30:45 --seed 7 -o given",
    );
    let given = fs::read_to_string(place.path().join("given/summary.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&given).unwrap()["seed"], 7);

    done(
        place.path(),
        "run drive.toml imu.toml --runs 16 --outage 30:45 --seed 2 -o sampled",
    );
    let ran = done(place.path(), "compare sampled --reference expected");
    assert!(
        ran.stderr
            .contains("the method is not that of the reference"),
        "{}",
        ran.stderr
    );
    let row = json(&place.path().join("comparison.json"))["rows"][0].clone();
    assert!(
        row["ratio_error_pct"].as_f64().unwrap().abs() < 1.0,
        "{row}"
    );
    done(
        place.path(),
        "run drive.toml imu.toml --method lincov --filter full --outage 30:45 -o full",
    );
    // nothing is drawn on either side: no interval, which one of no width would hide
    let ran = done(
        place.path(),
        "compare full --reference expected -o exact.json",
    );
    assert!(!ran.stdout.contains('±'), "{}", ran.stdout);
    let row = json(&place.path().join("exact.json"))["rows"][0].clone();
    assert!(
        row["ci95_pct"].is_null() && row["rmse_end_ci95_pct"].is_null(),
        "{row}"
    );
    let csv = done(
        place.path(),
        "compare full --reference expected --table csv -o exact.json",
    )
    .stdout;
    let cells: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    assert!(
        cells[7].parse::<f64>().is_ok() && cells[8..11] == ["", "", ""],
        "{csv}"
    );
}

/// Fixes too rare for a reduction are the fault of the receiver's rate, not of the model: the full filter takes both.
#[test]
fn fixes_too_rare_for_the_reduction_are_blamed_on_their_rate() {
    let place = place();
    fs::write(place.path().join("rare.toml"), "[gnss]\nrate_hz = 0.001\n").unwrap();
    // two biases an axis: one alone is its own filter
    let walk = MODEL.replace(
        "{ type = \"AR1\"",
        "{ type = \"RW\", gamma2 = 1e-14 }, { type = \"AR1\"",
    );
    fs::write(place.path().join("walk.toml"), walk).unwrap();
    let full = "hint: raise it, or use --filter full";
    for (command, hint) in [
        (
            "run drive.toml walk.toml --runs 2 --scenario rare.toml -o out",
            full,
        ),
        (
            "run drive.toml walk.toml --method lincov --gnss rare.toml -o out",
            full,
        ),
        (
            "tune walk.toml --truth walk.toml --scenario rare.toml",
            "hint: raise it: the verdict includes",
        ),
    ] {
        let ran = nav_sim(place.path(), command);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        for words in [
            "error: rare.toml: gnss.rate_hz = 0.001 is refused",
            "at most 231.7 s",
            hint,
        ] {
            assert!(ran.stderr.contains(words), "{command}: {}", ran.stderr);
        }
        assert!(!ran.stderr.contains("walk.toml:"), "{}", ran.stderr);
    }
    done(
        place.path(),
        "run drive.toml walk.toml --method lincov --filter full --scenario rare.toml -o out",
    );
}

#[test]
fn runs_stand_beside_what_is_expected_of_them() {
    let place = place();
    let command = "run drive.toml imu.toml --method both --runs 40 --outage 30:45 --seed 2 -o out";
    let ran = done(place.path(), command);
    assert!(
        ran.stdout
            .lines()
            .next()
            .unwrap()
            .ends_with("covariance analysis: consistent"),
        "{}",
        ran.stdout
    );
    let summary = json(&place.path().join("out/summary.json"));
    assert_eq!(
        (&summary["method"], &summary["lincov"]["method"]),
        (&"both".into(), &"lincov".into())
    );
    let verdicts =
        [&summary["verdict"], &summary["lincov"]["verdict"]].map(|verdict| &verdict["kind"]);
    assert_eq!(verdicts, ["consistent", "consistent"]);
    assert_eq!(summary["verdict"]["by_covariance_analysis"], "consistent");
    let page = fs::read_to_string(place.path().join("out/report.html")).unwrap();
    assert!(page.contains("INS/GNSS both"), "{page}");
    assert!(place.path().join("out/runs.csv").exists());
}

/// Two runs tell nothing of a filter whose accelerometer is twice as bad as it believes: the verdict is that of the runs, and
/// covariance analysis has its word beside it.
#[test]
fn few_runs_do_not_hide_a_filter_that_is_wrong() {
    let place = place();
    fs::write(
        place.path().join("rough.toml"),
        MODEL.replace("1e-9", "4e-9"),
    )
    .unwrap();
    let command = "run drive.toml imu.toml --truth rough.toml --outage 20:50 --seed 2";
    let sampled = done(place.path(), &format!("{command} --runs 2 -o out"));
    let verdict = sampled.stdout.lines().next().unwrap();
    assert!(
        verdict.starts_with("verdict: undecided: 2 runs miss errors below "),
        "{verdict}"
    );
    assert!(
        verdict.ends_with("; covariance analysis: overconfident"),
        "{verdict}"
    );
    assert!(
        sampled
            .stderr
            .contains("warning: the filter is overconfident: "),
        "{}",
        sampled.stderr
    );
    done(
        place.path(),
        &format!("{command} --method lincov -o expected"),
    );
    let summary = |run: &str| json(&place.path().join(run).join("summary.json"));
    let (sampled, expected) = (summary("out"), summary("expected"));
    assert_eq!(sampled["verdict"]["kind"], "undecided");
    assert_eq!(sampled["outages"][0]["verdict"]["kind"], "undecided");
    assert_eq!(
        sampled["verdict"]["by_covariance_analysis"],
        expected["verdict"]["kind"]
    );
    assert_eq!(expected["verdict"]["kind"], "overconfident");
    assert_eq!(
        (&sampled["method"], &sampled["lincov"]),
        (&"monte-carlo".into(), &Value::Null)
    );
}

#[test]
fn what_covariance_analysis_cannot_do_is_refused() {
    let place = place();
    done(
        place.path(),
        "synthesize imu.toml --replicates 1 --samples 7000 --seed 1 -o made",
    );
    let command =
        "run drive.toml imu.toml --method both --outage none --static made/replicate_1.csv -o out";
    let ran = nav_sim(place.path(), command);
    assert!(
        ran.code == 2 && ran.stderr.contains("covariance analysis needs a model"),
        "{}",
        ran.stderr
    );
    assert!(
        ran.stderr.contains("hint: calibrate the recordings"),
        "{}",
        ran.stderr
    );
}

/// Three requirements: one that is met, two that are not; told before the verdict, kept, and exit code 3.
#[test]
fn requirements_decide_the_exit_code() {
    let place = place();
    let command = "run drive.toml imu.toml --method lincov --outage 30:45 -o out";
    let ran = nav_sim(
        place.path(),
        &format!("{command} --require p95_m<=1000 --require rmse_yaw_deg<=90"),
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stdout.starts_with("required p95_m<=1000: met, "),
        "{}",
        ran.stdout
    );
    let ran = nav_sim(place.path(), &format!("{command} --require consistent"));
    assert!(
        ran.code == 0 && ran.stdout.contains("required consistent: met"),
        "{}{}",
        ran.stdout,
        ran.stderr
    );
    let ran = nav_sim(
        place.path(),
        &format!("{command} --require p95_m<=0.1 --require yaw_deg<=90"),
    );
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(
        ran.stdout.starts_with("required p95_m<=0.1: NOT MET, "),
        "{}",
        ran.stdout
    );
    assert!(
        ran.stderr.contains("error: required p95_m<=0.1: NOT MET, "),
        "{}",
        ran.stderr
    );
    let kept = &json(&place.path().join("out/summary.json"))["require"];
    assert_eq!(
        (&kept[0]["met"], &kept[1]["met"]),
        (&false.into(), &true.into())
    );
    refused(
        "run drive.toml imu.toml --outage none --seed 1 --require p95_m<=5 -o out",
        2,
        "--require p95_m<=5: p95_m needs",
    );
    refused(
        "run drive.toml imu.toml --require p95<=5 -o out",
        2,
        "--require='p95<=5'",
    );
}

/// What errors are made of is in the summary, in the page and, the largest sources, on the screen, with runs and
/// without; of recordings nobody knows it.
#[test]
fn the_sources_of_errors_are_told() {
    let place = place();
    for method in ["lincov", "monte-carlo"] {
        let command = format!(
            "run drive.toml imu.toml --method {method} --runs 2 --seed 1 --outage 30:45 -o out"
        );
        let ran = done(place.path(), &command);
        assert!(
            ran.stderr
                .contains("note: sources of the horizontal error at the end of 30–45 s: "),
            "{}",
            ran.stderr
        );
        assert!(ran.stdout.lines().count() <= 20, "{}", ran.stdout);
        let outage = json(&place.path().join("out/summary.json"))["outages"][0].clone();
        let sum = |budget: &Value| -> f64 {
            budget
                .as_object()
                .unwrap()
                .values()
                .map(|shares| shares["yaw_deg"].as_f64().unwrap())
                .sum()
        };
        assert!((sum(&outage["budget"]) - 1.0).abs() < 1e-9);
        let page = fs::read_to_string(place.path().join("out/report.html")).unwrap();
        assert!(page.contains("Sources of errors") && page.contains("gnss.position"));
    }
    done(
        place.path(),
        "synthesize imu.toml --replicates 1 --samples 7000 --seed 1 -o made",
    );
    let command = "run drive.toml imu.toml --runs 2 --seed 1 --outage 30:45 --static made/replicate_1.csv -o out";
    let ran = done(place.path(), command);
    assert!(!ran.stderr.contains("sources of"), "{}", ran.stderr);
    let outage = json(&place.path().join("out/summary.json"))["outages"][0].clone();
    assert!(outage["budget"].is_null());
}

/// A table of positions with a metre of noise now and then is no motion of a vehicle: said before the run, once, with the command
/// that tells more.
#[test]
fn a_motion_that_nothing_makes_is_doubted() {
    let place = place();
    let dir = place.path();
    done(
        dir,
        "trajectory convert drive.toml --rate-hz 10 -o rough.csv",
    );
    let text = fs::read_to_string(dir.join("rough.csv")).unwrap();
    let column = text
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|name| name == "h_m")
        .unwrap();
    let rough = |(i, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if i > 0 && i % 20 == 0 {
            cells[column] = (cells[column].parse::<f64>().unwrap() + 1.0).to_string();
        }
        cells.join(",") + "\n"
    };
    fs::write(
        dir.join("rough.csv"),
        text.lines().enumerate().map(rough).collect::<String>(),
    )
    .unwrap();
    let run = |drive: &str| {
        done(
            dir,
            &format!("run {drive} imu.toml --runs 1 --outage none --seed 1 -o out"),
        )
        .stderr
    };
    let said = run("rough.csv");
    assert_eq!(
        said.matches("nav-sim trajectory check rough.csv lists them")
            .count(),
        1,
        "{said}"
    );
    assert!(
        said.contains(", beyond ") && said.contains("more such stretches"),
        "{said}"
    );
    assert!(!run("drive.toml").contains("trajectory check"));
}

/// What is wrong with a filter is what it does not expect: the warning names the largest of it and what helps, and neither
/// `tune` nor the size of the errors, which is its consequence.
#[test]
fn the_remedy_is_for_what_the_filter_does_not_expect() {
    let place = place();
    let put = |name: &str, text: &str| fs::write(place.path().join(name), text).unwrap();
    put(
        "turned_on.toml",
        &format!("{MODEL}[turn_on]\naccel_m_s2 = 0.5\ngyro_rad_s = 1e-6\n"),
    );
    put(
        "coloured.toml",
        "gnss.correlated_pos_sigma_m = [9, 9, 9]\ngnss.correlation_time_s = 60\n",
    );
    put("scaled.toml", "imu.scale_ppm_gyro = 50000\n");
    put("crossed.toml", "imu.misalignment_rad = 0.03\n");
    let cases = [
        (
            "--truth turned_on.toml",
            "the true accel has a turn-on bias of 0.5 m/s²",
            "initial.accel_bias_sigma_m_s2",
        ),
        (
            "--scenario coloured.toml",
            "the true receiver errs by 9, 9, 9 m over 60 s",
            "a larger gnss.pos_sigma_m",
        ),
        (
            "--scenario scaled.toml",
            "the true gyro has a scale-factor error of 50000 ppm",
            "initial.gyro_scale_sigma_ppm",
        ),
        (
            "--scenario crossed.toml",
            "imu.misalignment_rad = 0.03 rad is in no filter",
            "calibrate the IMU for it",
        ),
    ];
    for (arguments, cause, helps) in cases {
        for method in ["lincov", "both --runs 8"] {
            let command = format!(
                "run drive.toml imu.toml {arguments} --outage 30:40 --seed 1 --method {method} -o out"
            );
            let ran = nav_sim(place.path(), &command);
            let warning = ran
                .stderr
                .lines()
                .find(|line| line.starts_with("warning: the filter is "))
                .unwrap();
            assert!(
                warning.contains(cause) && warning.contains(helps),
                "{warning}"
            );
            assert!(!warning.contains("nav-sim tune"), "{warning}");
        }
    }
    nav_sim(
        place.path(),
        "run drive.toml imu.toml --scenario coloured.toml --method lincov --outage none -o page",
    );
    let page = fs::read_to_string(place.path().join("page/report.html")).unwrap();
    assert!(page.contains("correlated_pos_sigma_m"), "{page}");
}

/// Scale factors err most where the vehicle turns, not at the ends of outages: runs name them all the same. A bias that is
/// twice what the filter expects is no noise of the model, whose white noise and random walks every filter contains.
#[test]
fn no_cause_is_named_that_is_not_there() {
    let place = place();
    let walk = |white: &str, walk: &str| {
        format!(
            "processes = [{{ type = \"WN\", sigma2 = {white} }}, {{ type = \"RW\", gamma2 = {walk} }}]"
        )
    };
    let model = format!(
        "rate_hz = 100.0\n[accel]\n{}\n[gyro]\n{}\n",
        walk("5.4e-5", "3.3e-11"),
        walk("1e-7", "1e-15")
    );
    let put = |name: &str, text: &str| fs::write(place.path().join(name), text).unwrap();
    put("walk.toml", &model);
    put(
        "scaled.toml",
        "imu.scale_ppm_accel = 500\nimu.scale_ppm_gyro = 500\n",
    );
    put(
        "biased.toml",
        "imu.turn_on_bias_accel_m_s2 = 0.01\ninitial.accel_bias_sigma_m_s2 = 0.0053\n",
    );
    let drive = format!(
        "{}/trajectories/land_vehicle.toml",
        env!("CARGO_MANIFEST_DIR")
    );
    let warning = |options: &str| {
        let ran = nav_sim(
            place.path(),
            &format!("run {drive} walk.toml --seed 1 {options} -o out"),
        );
        let of_filter = |line: &&str| line.starts_with("warning: the filter is overconfident");
        ran.stderr.lines().find(of_filter).unwrap().to_owned()
    };
    for method in ["lincov", "monte-carlo --runs 40"] {
        let said = warning(&format!("--scenario scaled.toml --method {method}"));
        assert!(
            said.contains("a scale-factor error of 500 ppm") && said.contains("--scale-ppm"),
            "{said}"
        );
    }
    let said = warning("--scenario biased.toml --filter full --outage 20:60 --method lincov");
    assert!(
        said.contains("nav-sim tune --scenario") && !said.contains("noise"),
        "{said}"
    );
}

/// A law without width is another truth, to the last bit; with one every run has its own.
#[test]
fn each_run_has_a_truth_of_its_own() {
    let law = |sd: &str| {
        format!(
            "\n[[spread.gyro]]\nprocess = \"WN\"\nparameter = \"sigma2\"\ndistribution = \"lognormal\"\nmedian = 4e-8\nsd = {sd}\n"
        )
    };
    let place = place();
    let put = |name: &str, text: String| fs::write(place.path().join(name), text).unwrap();
    let white = MODEL
        .split("[gyro]")
        .nth(1)
        .unwrap()
        .split("sigma2 = ")
        .nth(1)
        .unwrap();
    let white = white.split([',', ' ', '}']).next().unwrap();
    let (accel, gyro) = MODEL.split_once("[gyro]").unwrap();
    let truth = format!("{accel}[gyro]{}", gyro.replacen(white, "4e-8", 1));
    put("fixed.toml", format!("{MODEL}{}", law("0.0")));
    put("drawn.toml", format!("{MODEL}{}", law("0.5")));
    put("truth.toml", truth);
    let runs = |arguments: &str, out: &str| {
        done(
            place.path(),
            &format!("run drive.toml {arguments} --runs 9 --outage 30:40 --seed 5 -o {out}"),
        );
        fs::read_to_string(place.path().join(out).join("runs.csv")).unwrap()
    };
    let fixed = runs("fixed.toml --spread", "fixed");
    assert_eq!(fixed, runs("imu.toml --truth truth.toml", "truth"));
    let drawn = runs("drawn.toml --spread", "drawn");
    assert_ne!(drawn, fixed);
    let manifest = fs::read_to_string(place.path().join("drawn/manifest.json")).unwrap();
    assert!(manifest.contains("\"spread\": true"), "{manifest}");
}

#[test]
fn a_spread_that_is_not_there_or_cannot_be_analysed_is_refused() {
    refused(
        "run drive.toml imu.toml --spread --seed 1",
        2,
        "imu.toml: no [spread] to draw from",
    );
}
