//! `choose` as a user runs it.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

/// A gyroscope whose random walk is most of the error after ten seconds: white noise alone cannot describe it.
const MODEL: &str = r#"rate_hz = 100.0
[accel]
processes = [{ type = "WN", sigma2 = 1e-5 }, { type = "RW", gamma2 = 1e-10 }]
[gyro]
processes = [{ type = "WN", sigma2 = 1e-8 }, { type = "RW", gamma2 = 1e-10 }]
"#;

const DRIVE: [&str; 6] = [
    "--trajectory",
    "trajectories/figure_eight.toml",
    "--outage",
    "40:60",
    "--seed",
    "1",
];

fn nav_sim(directory: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("nav-sim")
        .unwrap()
        .current_dir(directory)
        .args(arguments)
        .assert()
}

/// Recordings of [`MODEL`], long enough for the way to the end of the outage, or not.
fn recordings(samples: &str, replicates: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("trajectories");
    std::os::unix::fs::symlink(target, directory.path().join("trajectories")).unwrap();
    std::fs::write(directory.path().join("model.toml"), MODEL).unwrap();
    let arguments = [
        "synthesize",
        "model.toml",
        "--replicates",
        replicates,
        "--samples",
        samples,
        "--seed",
        "1",
        "-o",
        "r",
    ];
    nav_sim(directory.path(), &arguments).success();
    directory
}

fn choose(directory: &Path, more: &[&str]) -> assert_cmd::assert::Assert {
    nav_sim(directory, &[&["choose", "r"], &DRIVE[..], more].concat())
}

fn said(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

#[test]
fn the_model_that_made_the_recordings_is_chosen_and_written() {
    let directory = recordings("16384", "4");
    let arguments = [
        "--estimator",
        "awv,gmwm",
        "--model",
        "WN,WN+RW",
        "--inflate",
        "none,x10",
        "-o",
        "out",
    ];
    let output = choose(
        directory.path(),
        &[&arguments[..], &["--format", "json"]].concat(),
    )
    .success();
    let found: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert_eq!(found["winner"], "awv WN+RW, 15", "{found}");
    let candidates = found["candidates"].as_array().unwrap();
    assert_eq!(candidates.len(), 8);
    let of = |name: &str| candidates.iter().find(|c| c["candidate"] == name).unwrap();
    // without the random walk the filter is lost, ten times the deviations are far too many
    let nees = |name: &str| of(name)["nees"]["value"].as_f64().unwrap();
    assert!(
        nees("awv WN, 15") > 90.0 && nees("awv WN+RW, 15, x10") < 3.0,
        "{found}"
    );
    // four recordings hold some nine windows side by side: 9 ± √(18/9), of which three are allowed
    assert!((nees("awv WN+RW, 15") - 9.0).abs() < 4.3, "{found}");
    assert_eq!(
        (
            &of("awv WN+RW, 15, x10")["tied"],
            &of("gmwm WN+RW, 15")["eligible"]
        ),
        (&false.into(), &false.into())
    );
    let folds = of("awv WN+RW, 15")["folds"].as_array().unwrap();
    assert_eq!(folds.len(), 4, "each recording judges: {found}");
    for fold in folds {
        let (rmse, believed) = (&fold["rmse_m"], &fold["believed_m"]);
        let ratio = rmse.as_f64().unwrap() / believed.as_f64().unwrap();
        // two windows of two components: the root of a chi-square of four degrees over four, outside in 1e-3
        assert!(
            fold["windows"] == 16 && (0.15..2.4).contains(&ratio),
            "{fold}"
        );
    }
    let file = std::fs::read_to_string(directory.path().join("out/ranking.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&file).unwrap(), found);
    let model: toml::Table = std::fs::read_to_string(directory.path().join("out/model.toml"))
        .unwrap()
        .parse()
        .unwrap();
    // a random walk of 12 signals of 164 s, seen from some 3 s on: 12 × 50 steps, known to √(2/600) = 6 %; six of these
    let walk = model["gyro"]["processes"][1]["gamma2"].as_float().unwrap();
    assert!((walk / 1e-10 - 1.0).abs() < 0.4, "{walk}");
    assert_eq!(model["provenance"]["estimator"].as_str(), Some("awv"));
    // what is there is not replaced
    let again = choose(directory.path(), &["-o", "out"]).code(2);
    assert!(
        said(&again).contains("holds another result"),
        "{}",
        said(&again)
    );
    let force = [
        "--estimator",
        "awv",
        "--model",
        "WN+RW",
        "-o",
        "out",
        "--force",
    ];
    choose(directory.path(), &force).success();
    let replaced = std::fs::read_to_string(directory.path().join("out/ranking.json")).unwrap();
    assert_eq!(
        serde_json::from_str::<Value>(&replaced).unwrap()["candidates"]
            .as_array()
            .unwrap()
            .len(),
        1
    );
}

/// Twelve candidates on one screen, the best of them; with `--verbose` all, with what is believed and covered.
#[test]
fn what_is_printed_fits_a_screen() {
    let directory = recordings("8192", "4");
    let text = |more: &[&str]| {
        let arguments = ["--model", "WN,WN+RW", "--inflate", "none,x10", "--force"];
        let output = choose(directory.path(), &[&arguments[..], more].concat()).success();
        String::from_utf8(output.get_output().stdout.clone()).unwrap()
    };
    let brief = text(&[]);
    assert!(
        brief.lines().count() <= 20 && brief.contains("log score (nats)"),
        "{brief}"
    );
    assert!(
        brief.lines().all(|line| line.chars().count() <= 120),
        "{brief}"
    );
    assert!(!brief.contains("believed (m)"), "{brief}");
    let whole = text(&["--verbose"]);
    assert!(
        whole.contains("believed (m)") && whole.contains("coverage"),
        "{whole}"
    );
}

#[test]
fn three_recordings_tell_no_candidates_apart() {
    let directory = recordings("16384", "3");
    let arguments = ["--estimator", "awv", "--model", "WN,WN+RW"];
    let output = choose(directory.path(), &arguments).success();
    let shown = String::from_utf8(output.get_output().stdout.clone()).unwrap();
    assert!(
        shown.starts_with("undecided: 3 recordings cannot separate 2 candidates; awv WN+RW, 15"),
        "{shown}"
    );
    assert!(shown.lines().count() <= 20, "{shown}");
    assert!(
        shown
            .lines()
            .filter(|line| line.starts_with("  "))
            .all(|line| line.chars().count() <= 120),
        "{shown}"
    );
}

/// The first sixteenth of one recording is its warm-up: left out, it is as if it had never been recorded, for the curves and
/// for the windows that are navigated on.
#[test]
fn a_warm_up_that_is_left_out_counts_for_nothing() {
    const WARM_UP: usize = 1024;
    let directory = recordings("16384", "3");
    let path = |k: usize| directory.path().join(format!("r/replicate_{k}.csv"));
    let texts = [1, 2, 3].map(|k| std::fs::read_to_string(path(k)).unwrap());
    let ranking = |out: &str, more: &[&str]| {
        let arguments = ["--estimator", "awv", "--model", "WN+RW", "-o", out];
        choose(directory.path(), &[&arguments[..], more].concat()).success();
        let file =
            std::fs::read_to_string(directory.path().join(out).join("ranking.json")).unwrap();
        let fold =
            serde_json::from_str::<Value>(&file).unwrap()["candidates"][0]["folds"][0].clone();
        [&fold["rmse_m"], &fold["nees"], &fold["believed_m"]].map(|v| v.as_f64().unwrap())
    };
    let warm = |(k, row): (usize, &str)| match (row.rsplit_once(','), k) {
        (Some((rest, last)), 1..=WARM_UP) => {
            format!("{rest},{}\n", last.parse::<f64>().unwrap() + 0.1)
        }
        _ => format!("{row}\n"),
    };
    let begun: String = texts[0].lines().enumerate().map(warm).collect();
    std::fs::write(path(1), begun).unwrap();
    let left_out = ranking("left_out", &["--skip-s", "10.24"]);
    for (k, text) in (1..).zip(&texts) {
        let rows = text.lines().enumerate();
        let kept = rows.filter(|(k, _)| !(1..=WARM_UP).contains(k));
        let never: String = kept.map(|(_, row)| format!("{row}\n")).collect();
        std::fs::write(path(k), never).unwrap();
    }
    let never = ranking("never", &[]);
    // samples are kept from the first one of the file on: the same but for their rounding
    assert!(
        left_out
            .iter()
            .zip(never)
            .all(|(a, b)| (a / b - 1.0).abs() < 1e-8),
        "{left_out:?} {never:?}"
    );
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let directory = recordings("8192", "3");
    let ranking = |threads: &str| {
        let arguments = [
            "--estimator",
            "awv",
            "--model",
            "WN+RW",
            "-j",
            threads,
            "-o",
            threads,
        ];
        choose(directory.path(), &arguments).success();
        std::fs::read(directory.path().join(threads).join("ranking.json")).unwrap()
    };
    assert_eq!(ranking("1"), ranking("2"));
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let directory = recordings("8192", "2");
    let refused = |arguments: &[&str], words: [&str; 2]| {
        let said = said(&choose(directory.path(), arguments).code(2));
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
        assert!(!directory.path().join("out/choice").exists());
    };
    refused(
        &[],
        [
            "2 recordings are too few to leave one out",
            "hint: one file is one recording",
        ],
    );
    refused(
        &["--estimator", "gmwm"],
        ["gmwm, rgmwm and avlr take one recording", "add awv"],
    );
    refused(&["--model", "N3"], ["--model", "hint"]);
    refused(&["--inflate", "more"], ["more", "none, x10"]);
    let none = [
        "choose",
        "r",
        "--trajectory",
        "trajectories/figure_eight.toml",
        "--outage",
        "none",
    ];
    let message = said(&nav_sim(directory.path(), &none).code(2));
    assert!(
        message.contains("compared at the ends of outages"),
        "{message}"
    );
}

/// One of six recordings has noise of 0.2 s beside the model's, which no other has: it is calibrated on, judges nothing, and is
/// named.
#[test]
fn an_abnormal_recording_judges_no_candidate() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    std::fs::copy(
        root.join("examples/quick_drive.toml"),
        at.join("drive.toml"),
    )
    .unwrap();
    std::fs::write(at.join("model.toml"), MODEL).unwrap();
    let bad = root
        .join("examples/one_bad_recording.toml")
        .display()
        .to_string();
    let made = "synthesize model.toml --replicates 6 --samples 16384 --seed 1 -o r --contaminate";
    nav_sim(at, &made.split(' ').chain([&*bad]).collect::<Vec<_>>()).success();
    let words = "choose r --trajectory drive.toml --outage 40:59 --seed 1 --estimator awv,dr-awv --model WN+RW --runs 8 -o of_r";
    let output = nav_sim(at, &words.split(' ').collect::<Vec<_>>()).success();
    let said = said(&output);
    let ranking = std::fs::read_to_string(at.join("of_r/ranking.json")).unwrap();
    let ranking: Value = serde_json::from_str(&ranking).unwrap();
    let folds = ranking["candidates"][0]["folds"].as_array().unwrap();
    assert_eq!(folds.len(), 5, "{folds:?} {said}");
    assert!(
        said.contains(
            "abnormal, ranks no candidate (nav-sim calibrate says how): r/replicate_4.csv"
        ),
        "{said}"
    );
    let judged = |name: &str| {
        folds
            .iter()
            .any(|fold| fold["recording"].as_str().unwrap().contains(name))
    };
    assert!(judged("replicate_3") && !judged("replicate_4"), "{folds:?}");
}
