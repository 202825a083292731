//! What `calibrate` says: on one screen, on its page, of N and K, on its way, and of bad samples.

use super::calibrate::{json, nav_sim, numbers, recordings, refusal};

/// One screen: the verdict on the recordings first, then the test of the model, and no more than twenty lines for both sensors.
#[test]
fn what_is_printed_fits_a_screen() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 4);
    let lines = |more: &[&str]| {
        let arguments =
            ["calibrate", "runs", "--bootstrap", "19", "--no-progress", "--seed", "1", "-o", "m.toml"];
        let output = nav_sim(dir.path()).args(arguments).args(more).assert().success();
        let output = output.get_output();
        let all = [&output.stdout, &output.stderr].map(|t| String::from_utf8(t.clone()).unwrap());
        (all[0].lines().count() + all[1].lines().count(), all[0].clone())
    };
    let (count, text) = lines(&[]);
    assert!(count <= 20, "{count} lines: {text}");
    let first = text.lines().next().unwrap();
    assert!(first.contains(" fit") && first.contains("4 recordings × 2 axes"), "{text}");
    assert!(text.contains("angle random walk N") && text.contains("deg/sqrt(h)"), "{text}");
    assert!(text.contains("J-test p = "), "{text}");
    assert!(lines(&["--verbose"]).0 > count);
    assert!(lines(&["--estimator", "all"]).0 <= 20);
}

/// N, K and B of the JSON are those that `export` has of the model file, to the last bit; N is that of the noise: sigma2 of nine
/// signals of 16384 samples is known to √(2/(9·16384·0.6)) = 0.5 % or so, N to half of that, eight of which are allowed.
#[test]
fn practitioners_parameters_are_those_of_export() {
    let dir = tempfile::tempdir().unwrap();
    let processes = "processes = [{ type = \"WN\", sigma2 = 4e-6 }, { type = \"RW\", gamma2 = 1e-12 }]";
    let model = format!("schema = 1\nrate_hz = 50.0\n[accel]\n{processes}\n[gyro]\n{processes}\n");
    std::fs::write(dir.path().join("imu.toml"), model).unwrap();
    let synthesize =
        ["synthesize", "imu.toml", "--replicates", "3", "--samples", "16384", "--seed", "1", "-o", "made"];
    nav_sim(dir.path()).args(synthesize).assert().success();
    let calibrate =
        ["calibrate", "made", "--model", "WN+RW", "--bootstrap", "39", "--seed", "1", "-o", "m.toml"];
    let out = json(dir.path(), &calibrate);
    let exported = json(dir.path(), &["export", "m.toml", "--target", "kalibr"]);
    for fit in out["fits"].as_array().unwrap() {
        let own = &fit["parameters"]["white_and_walk"];
        let of_export = &exported["sensors"][fit["sensor"].as_str().unwrap()]["axes"]["x"]["white_and_walk"];
        for key in ["n", "k"] {
            assert_eq!(own[key]["value"], of_export[key]["value"], "{fit}");
            assert_eq!(own[key]["data_sheet"], of_export[key]["data_sheet"]);
        }
        let density = own["n"]["value"].as_f64().unwrap();
        assert!((density / (4e-6_f64 / 50.0).sqrt() - 1.0).abs() < 0.02, "{density}");
        let ends = numbers(&own["n"]["ci95"]);
        assert!(ends[0] < density && density < ends[1] && ends[1] / ends[0] < 1.05, "{ends:?}");
        assert!(fit["missed"].as_array().unwrap().is_empty());
    }
}

/// N is one number wherever it is shown: of white noise, a fast AR1 and a random walk that of all three together, not that of WN
/// alone, which is said to be that.
#[test]
fn the_page_and_the_terminal_say_the_same_of_n_and_k() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let fit = ["calibrate", "runs", "--model", "N1", "--bootstrap", "19", "--seed", "1", "-o", "m.toml"];
    let print = |more: &[&str]| {
        let output = nav_sim(dir.path()).args(fit).args(more).assert().success();
        String::from_utf8(output.get_output().stdout.clone()).unwrap()
    };
    let text = print(&[]);
    assert!(text.contains("N, K matched over 1–100 s"), "{text}");
    let row = text.lines().find(|l| l.contains("angle random walk N")).unwrap();
    let value = row.split("random walk N").nth(1).unwrap().split_whitespace().next().unwrap();
    let page = std::fs::read_to_string(dir.path().join("m.html")).unwrap();
    let (heading, first) =
        (page.find("N and K matched over 1–100 s").unwrap(), page.find("<svg class=\"chart").unwrap());
    assert!(heading < first, "the figures of the verdict stand first");
    let cell = "/fits/0/parameters/white_and_walk/n/data_sheet/value\">";
    assert!(page.contains(&format!("{cell}{value}</td>")), "{value}");
    let verbose = print(&["--verbose"]);
    for page_or_text in [&page, &verbose] {
        assert!(page_or_text.contains("angle random walk of WN alone"));
        assert!(page_or_text.contains("rate random walk of RW alone"));
    }
    assert!(
        verbose.contains(&format!("matched over 1–100 s: angle random walk N {value} deg/sqrt(h)")),
        "{verbose}"
    );
}

/// A random walk takes over from the white noise at √3 N/K = √(3 sigma2/gamma2) samples, here 1732 or 35 s: a minute at 50 Hz has
/// averages of 10 s at most, and its K is not stated; 11 minutes have such of 82 s or more.
#[test]
fn a_random_walk_that_nobody_saw_is_not_stated() {
    let dir = tempfile::tempdir().unwrap();
    let processes = "processes = [{ type = \"WN\", sigma2 = 4e-6 }, { type = \"RW\", gamma2 = 4e-12 }]";
    let model = format!("schema = 1\nrate_hz = 50.0\n[gyro]\n{processes}\n");
    std::fs::write(dir.path().join("imu.toml"), model).unwrap();
    for (samples, is_observed) in [("3000", false), ("32768", true)] {
        let make = [
            "synthesize",
            "imu.toml",
            "--replicates",
            "3",
            "--samples",
            samples,
            "--seed",
            "1",
            "-o",
            "made",
        ];
        nav_sim(dir.path()).args(make).assert().success();
        let fit =
            ["calibrate", "made", "--model", "WN+RW", "--bootstrap", "19", "--seed", "1", "-o", "m.toml"];
        let text =
            String::from_utf8(nav_sim(dir.path()).args(fit).assert().success().get_output().stdout.clone());
        let text = text.unwrap();
        let row = text.lines().find(|l| l.contains("rate random walk K")).unwrap();
        assert_eq!(!row.contains("not observed"), is_observed, "{text}");
        assert_eq!(
            json(dir.path(), &fit)["fits"][0]["parameters"]["white_and_walk"]["k"]["observed"],
            is_observed
        );
    }
}

/// A line every 10 %, however many fits there are and whoever chose the model: ten of them, the last of them at 100 %.
#[test]
fn fits_say_how_far_they_are() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 3);
    for more in [&["--model", "N1", "--estimator", "all"][..], &["--model", "auto", "--axes", "gyro.x"]] {
        let fit = ["calibrate", "runs", "--bootstrap", "40", "--seed", "1", "-o", "m.toml"];
        let output = nav_sim(dir.path()).args(fit).args(more).assert().success();
        let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
        let lines: Vec<&str> = said.lines().filter(|l| l.contains(" steps of the fits, ")).collect();
        assert!(lines.last().unwrap().starts_with("100 %"), "{said}");
        assert!((if more[1] == "auto" { 3 } else { 10 }..=10).contains(&lines.len()), "{said}");
        let quiet = nav_sim(dir.path()).args(fit).args(more).arg("--no-progress").assert().success();
        assert!(!String::from_utf8_lossy(&quiet.get_output().stderr).contains("steps of the fits"));
    }
}

/// A sample that is none: the hint leads past the gap that its line leaves, and does. Times of day are to be seconds.
#[test]
fn the_hint_at_a_missing_sample_leads_on() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 1);
    let path = dir.path().join("runs/run0.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let fit = ["calibrate", "runs", "--model", "WN+RW", "--bootstrap", "0", "-o", "m.toml"];
    let with = |line: &str| {
        let edit = |(i, l): (usize, &str)| if i == 99 { line.to_owned() } else { format!("{l}\n") };
        std::fs::write(&path, text.lines().enumerate().map(edit).collect::<String>()).unwrap();
    };
    for cell in ["", "nan"] {
        with(&format!("1.96,{cell},0\n"));
        let said = refusal(dir.path(), &fit, 2);
        assert!(said.contains("line 100") && said.contains("--gaps ignore or --gaps split"), "{said}");
    }
    with("");
    nav_sim(dir.path()).args(fit).args(["--gaps", "ignore"]).assert().success();
    let rows: String = (0..50).map(|k| format!("2024-05-01T10:00:{k:02}.0,0.1,0.2\n")).collect();
    std::fs::write(&path, format!("t_s,gyro_x_rad_s,gyro_y_rad_s\n{rows}")).unwrap();
    let said = refusal(dir.path(), &fit, 2);
    assert!(said.contains("hint: write the time in seconds"), "{said}");
}
