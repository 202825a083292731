//! What is refused, what is recorded, and what is replaced.

use super::*;

#[test]
fn files_that_are_no_tables_are_refused_as_such() {
    let dir = tempfile::tempdir().unwrap();
    let rows: String = (0..64)
        .map(|t| format!("{},{}\n", 0.01 * f64::from(t), t % 7))
        .collect();
    let table = format!("t_s,gyro_x_rad_s\n{rows}");
    let utf16: Vec<u8> = [0xfeff]
        .into_iter()
        .chain(table.encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("utf16.csv", &utf16);
    write("mac.csv", table.replace('\n', "\r").as_bytes());
    write("binary.csv", &[7, 0, 200, 10, 0, 3]);
    write("plain.csv.gz", table.as_bytes());
    write(
        "feet.csv",
        table.replace("gyro_x_rad_s", "accel_x_ft_s2").as_bytes(),
    );
    write("ok.csv", table.as_bytes());
    for (arguments, what, hint) in [
        (&["utf16.csv"][..], "it is in UTF-16", "UTF-8"),
        (&["mac.csv"], "a carriage return only", "one row a line"),
        (&["binary.csv"], "it is binary", "CSV"),
        (&["plain.csv.gz"], "plain.csv.gz: ", "not gzipped"),
        (
            &["feet.csv"],
            "feet.csv, line 1: column \"accel_x_ft_s2\" is in an unknown unit",
            "_m_s2, _g, _mg",
        ),
        (
            &["ok.csv", "--skip-s", "10"],
            "ok.csv: 0 samples, but ",
            "a smaller --skip-s",
        ),
    ] {
        let stderr = refusal(dir.path(), &[&["wv", "-q"], arguments].concat(), 2);
        assert!(
            stderr.contains(what)
                && stderr
                    .split("hint: ")
                    .nth(1)
                    .is_some_and(|h| h.contains(hint)),
            "{stderr}"
        );
    }
    let stderr = refusal(dir.path(), &["wv", "nowhere.csv"], 2);
    assert!(stderr.contains("hint: check the path"), "{stderr}");
}

#[test]
fn bad_requests_are_refused_with_a_hint() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let calibrate = |more: &[&str], code| {
        refusal(
            dir.path(),
            &[&["calibrate", "runs", "-q"], more].concat(),
            code,
        )
    };
    let check = |stderr: String, parts: &[&str]| {
        for part in parts {
            assert!(stderr.contains(part), "{part:?} is not in {stderr}");
        }
    };
    check(
        calibrate(&["--model", "2*AR+RW"], 2),
        &[
            "error: --model: model \"2*AR+RW\": \"AR\" is no process",
            "hint: did you mean \"AR1\"?",
        ],
    );
    check(calibrate(&["--model", "2*WN"], 2), &["2 WN equal one WN"]);
    check(
        calibrate(&["--trim", "2"], 2),
        &[
            "gyro, dr-awv: a trim of 2 at each end needs 5 replicates; there are 4",
            "hint:",
        ],
    );
    check(
        calibrate(&["--trim", "60%"], 2),
        &["--trim", "a percentage under 50"],
    );
    check(
        calibrate(&["--efficiency", "1.5"], 2),
        &["--efficiency: efficiency 1.5 is out of range"],
    );
    check(
        calibrate(&["--scales", "20"], 2),
        &["run0.csv", "16384", "hint:"],
    );
    check(
        calibrate(&["--scales", "5"], 2),
        &[
            "WN+QN+2*AR1+RW has 7 parameters, the curve 5 scales",
            "hint: record for longer",
        ],
    );
    check(
        calibrate(&["--estimator", "gmwm"], 2),
        &["gmwm takes one recording; there are 2"],
    );
    let before = std::fs::read(dir.path().join("runs/run0.csv")).unwrap();
    check(
        calibrate(&["-o", "runs/run0.csv"], 2),
        &["is an input and would be overwritten"],
    );
    check(
        refusal(dir.path(), &["wv", "runs", "-o", "runs/run0.csv"], 2),
        &["run0.csv is an input and would be overwritten"],
    );
    assert_eq!(
        std::fs::read(dir.path().join("runs/run0.csv")).unwrap(),
        before
    );
    std::fs::create_dir(dir.path().join("taken.toml")).unwrap();
    check(
        calibrate(&["-o", "taken.toml"], 2),
        &["taken.toml is not a file", "hint:"],
    );
    check(
        calibrate(&["-o", "/dev/full"], 2),
        &["/dev/full is not a file"],
    );
    check(refusal(dir.path(), &["calibrate"], 2), &["required"]);
    check(
        refusal(dir.path(), &["calibrate", "nowhere.csv"], 2),
        &["nowhere.csv: No such file"],
    );
    check(
        refusal(dir.path(), &["wv", "runs", "--axes", "gyro.w"], 2),
        &["gyro.w", "accel.x"],
    );
    std::fs::write(
        dir.path().join("curve.csv"),
        "tau_samples,wv,edof\n2,1e-5,10\n4,0,5\n",
    )
    .unwrap();
    check(
        refusal(dir.path(), &["calibrate", "--curve", "curve.csv"], 2),
        &[
            "curve.csv, line 3: wv = 0 is not a number from 1e-100 to 1e100",
            "hint: a curve is a CSV",
        ],
    );
    std::fs::write(
        dir.path().join("curve.csv"),
        "tau_samples,wv,edof\n2,1e-5,10\n4,1e-5,5\n",
    )
    .unwrap();
    for flag in [["--trim", "1"], ["--skip-s", "0"], ["--estimator", "awv"]] {
        let arguments = [
            &["calibrate", "--curve", "curve.csv", "--rate-hz", "1"][..],
            &flag,
        ]
        .concat();
        check(
            refusal(dir.path(), &arguments, 2),
            &["cannot be used with", "--curve"],
        );
    }
    assert!(!dir.path().join("model.toml").exists() && !dir.path().join("model.wv.json").exists());
}

/// A model without `--seed` says which one was drawn, in the file too; the name of the output is the one given; copies of
/// a recording do not count.
#[test]
fn what_was_drawn_is_recorded_and_copies_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let calibrate = [
        "calibrate",
        "runs",
        "--model",
        "N1",
        "--bootstrap",
        "19",
        "-o",
        "imu",
    ];
    nav_sim(dir.path()).args(calibrate).assert().success();
    let text = std::fs::read_to_string(dir.path().join("imu")).unwrap();
    assert!(text.contains("seed = 1\n"), "{text}");
    assert!(dir.path().join("imu.wv.json").exists() && !dir.path().join("imu.toml").exists());
    let curve = [
        "calibrate",
        "--curve",
        "imu.wv.json",
        "--model",
        "N1",
        "--rate-hz",
        "50",
    ];
    assert!(refusal(dir.path(), &curve, 2).contains("the curve is at 50 Hz"));

    let copy = dir.path().join("runs/run2.csv");
    // With other line ends: the samples count, not the bytes.
    let text = std::fs::read_to_string(dir.path().join("runs/run0.csv")).unwrap();
    std::fs::write(&copy, text.replace('\n', "\r\n")).unwrap();
    let stderr = refusal(dir.path(), &calibrate, 2);
    assert!(
        stderr.contains("run2.csv is a copy of runs/run0.csv"),
        "{stderr}"
    );
    // Of three recordings a short one lacks the longest scales, of two it limits both.
    let mut rows = "t_s,gyro_x_rad_s,gyro_y_rad_s\n".to_owned();
    let [x, y] = ["gyro.x", "gyro.y"].map(|channel| signal(2, channel));
    for t in 0..599 {
        writeln!(rows, "{:.2},{:e},{:e}", 0.02 * t as f64, x[t], y[t]).unwrap();
    }
    std::fs::write(&copy, rows).unwrap();
    let short = [
        "calibrate",
        "runs",
        "--model",
        "WN+RW",
        "--bootstrap",
        "0",
        "-o",
        "short.toml",
    ];
    let said_and_scales = || {
        let output = nav_sim(dir.path()).args(short).assert().success();
        let curves = std::fs::read_to_string(dir.path().join("short.wv.json")).unwrap();
        let curves: serde_json::Value = serde_json::from_str(&curves).unwrap();
        let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
        (said, curves["curves"][0]["tau_s"].as_array().unwrap().len())
    };
    let (said, scales) = said_and_scales();
    assert!(
        said.contains(
            "run2.csv: 599 samples have 8 scales, most recordings 13; the average has 13"
        ),
        "{said}"
    );
    assert_eq!(scales, 13);
    std::fs::remove_file(dir.path().join("runs/run1.csv")).unwrap();
    let (said, scales) = said_and_scales();
    assert!(
        said.contains("run2.csv: 599 samples have 8 scales, most recordings 13; the average has 8"),
        "{said}"
    );
    assert_eq!(scales, 8);
}

/// Twenty seconds of another level at the beginning; half of them already left out: what is advised counts from the
/// beginning of the file.
#[test]
fn what_is_skipped_counts_in_the_advice() {
    let dir = tempfile::tempdir().unwrap();
    let mut text = "t_s,gyro_x_rad_s\n".to_owned();
    for (t, x) in signal(0, "gyro.x").iter().enumerate() {
        let level = if t < 3000 {
            1e-4 * (3000 - t) as f64
        } else {
            0.0
        };
        writeln!(text, "{:.2},{:e}", 0.02 * t as f64, x + level).unwrap();
    }
    std::fs::write(dir.path().join("warm.csv"), text).unwrap();
    let said_with = |skip: &str| {
        let arguments =
            "calibrate warm.csv --estimator gmwm --model WN+RW --bootstrap 0".split(' ');
        let output = nav_sim(dir.path())
            .args(arguments)
            .args(["--skip-s", skip])
            .assert()
            .success();
        String::from_utf8(output.get_output().stderr.clone()).unwrap()
    };
    let seconds = |said: &str, before: &str| {
        let rest = said
            .split(before)
            .nth(1)
            .unwrap_or_else(|| panic!("{said}"));
        rest.split_whitespace()
            .next()
            .unwrap()
            .parse::<f64>()
            .unwrap()
    };
    for skip in ["0", "20"] {
        let advised = seconds(&said_with(skip), "--skip-s ");
        assert!((50.0..=85.0).contains(&advised), "after {skip}: {advised}");
    }
}

/// How the recordings were read and the curves' hash are in the model file.
#[test]
fn a_model_says_what_it_was_made_with() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let arguments = "calibrate runs --model N1 --bootstrap 0 --skip-s 1.5 --gaps ignore --axes gyro --scales 9 \
                     --pool sensor -o m.toml";
    Command::cargo_bin("nav-sim")
        .unwrap()
        .args(arguments.split_whitespace())
        .current_dir(dir.path())
        .assert()
        .success();
    let text = std::fs::read_to_string(dir.path().join("m.toml")).unwrap();
    let model: toml::Table = text.parse().unwrap();
    let provenance = &model["provenance"];
    assert_eq!(provenance["skip_s"].as_float(), Some(1.5));
    assert_eq!(
        (provenance["gaps"].as_str(), provenance["pool"].as_str()),
        (Some("ignore"), Some("sensor"))
    );
    assert_eq!(
        (
            provenance["scales"].as_integer(),
            provenance["weighting"].as_str()
        ),
        (Some(9), Some("model"))
    );
    assert_eq!(provenance["axes"].as_array().unwrap().len(), 3);
    let curves = std::fs::read(dir.path().join("m.wv.json")).unwrap();
    assert_eq!(
        provenance["curves_blake3"].as_str(),
        Some(blake3::hash(&curves).to_hex().as_str())
    );
}

/// A calibration replaces an earlier one; what none wrote stays as it is.
#[test]
fn a_model_of_the_default_name_replaces_only_its_own_kind() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 1);
    let calibrate = ["calibrate", "runs", "--bootstrap", "0"];
    for model in ["WN+RW", "WN"] {
        nav_sim(dir.path())
            .args(calibrate)
            .args(["--model", model])
            .assert()
            .success();
        let text = std::fs::read_to_string(dir.path().join("model.toml")).unwrap();
        assert!(text.contains(&format!("model = \"{model}\"")), "{text}");
    }
    let own = "schema = 1\nrate_hz = 50.0\n[gyro]\nprocesses = [{ type = \"WN\", sigma2 = 1.0 }]\n";
    std::fs::write(dir.path().join("model.toml"), own).unwrap();
    let said = refusal(dir.path(), &calibrate, 2);
    assert!(said.contains("model.toml is not of this command"), "{said}");
    assert_eq!(
        std::fs::read_to_string(dir.path().join("model.toml")).unwrap(),
        own
    );
}

/// Scales outside count nothing and are recorded: of a fit with a range that holds two scales for two parameters nothing is left
/// to test.
#[test]
fn a_range_of_scales_is_recorded() {
    let dir = tempfile::tempdir().unwrap();
    recordings(dir.path(), 2);
    let fit = [
        "calibrate",
        "runs",
        "--model",
        "WN+RW",
        "--bootstrap",
        "0",
        "--scales",
        "0.04s:20.48s",
    ];
    let out = json(dir.path(), &[&fit[..], &["-o", "m.toml"]].concat());
    assert_eq!(out["fits"][0]["scales"], 13, "all are in the file");
    let text = std::fs::read_to_string(dir.path().join("m.toml")).unwrap();
    let provenance = &text.parse::<toml::Table>().unwrap()["provenance"];
    let range: Vec<f64> = provenance["fit_range_s"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(toml::Value::as_float)
        .collect();
    assert_eq!(range, [0.04, 20.48]);
    let short = [
        "calibrate",
        "runs",
        "--model",
        "N1",
        "--scales",
        "1s:2s",
        "-o",
        "n.toml",
    ];
    assert!(refusal(dir.path(), &short, 2).contains("scales"));
    assert!(
        refusal(dir.path(), &["calibrate", "runs", "--scales", "2s:1s"], 2)
            .contains("shorter scale")
    );
}
