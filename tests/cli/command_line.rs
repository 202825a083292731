//! What the program does as a program: exit codes, streams, messages.

use crate::common::drive;
use assert_cmd::Command;
use std::process::Stdio;

pub(super) fn nav_sim() -> Command {
    Command::new(env!("CARGO_BIN_EXE_nav-sim"))
}

#[test]
fn usage_errors_exit_with_2_and_suggest() {
    let output = nav_sim().arg("compar").output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said.contains("error: unrecognized subcommand") && said.contains("'compare'"),
        "{said}"
    );
    let alone = nav_sim().output().unwrap();
    let overview = String::from_utf8(alone.stderr).unwrap();
    assert_eq!(alone.status.code(), Some(2));
    assert!(
        overview.lines().count() <= 20 && overview.contains("calibrate"),
        "{overview}"
    );
}

#[test]
fn a_closed_pipe_is_success() {
    let program = env!("CARGO_BIN_EXE_nav-sim");
    let mut child = std::process::Command::new(program)
        .args(["completions", "bash"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        (output.status.code(), output.stderr.as_slice()),
        (Some(0), &b""[..])
    );
}

/// Nobody reads what is shown: the files are written all the same, and the exit code is that of the verdict.
#[test]
fn a_closed_pipe_loses_neither_files_nor_the_verdict() {
    let place = drive::place_with(drive::DRIVE, drive::MODEL);
    std::fs::write(
        place.path().join("rough.toml"),
        drive::MODEL.replace("1e-9", "1e-4"),
    )
    .unwrap();
    let code = |arguments: &str| {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_nav-sim"))
            .current_dir(place.path())
            .args(arguments.split(' '))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        child.wait().unwrap().code().unwrap()
    };
    let run = "run drive.toml imu.toml --runs 8 --outage 20:50 --seed 3 -o";
    assert_eq!(code(&format!("{run} bad --truth rough.toml")), 3);
    assert_eq!(code(&format!("{run} good")), 0);
    assert_eq!(
        code("compare good --reference bad -o comparison.json --plot ratios.svg"),
        0
    );
    assert_eq!(
        code("tune imu.toml --truth rough.toml -o tuned.toml --plot tuned.html"),
        0
    );
    for file in [
        "comparison.json",
        "comparison.html",
        "ratios.svg",
        "tuned.toml",
        "tuned.html",
    ] {
        assert!(place.path().join(file).exists(), "{file}");
    }
}

#[test]
fn a_full_disk_exits_with_1() {
    let full = std::fs::File::options()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let program = env!("CARGO_BIN_EXE_nav-sim");
    let output = std::process::Command::new(program)
        .args(["man"])
        .stdout(full)
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        String::from_utf8_lossy(&output.stderr)
            .starts_with("error: standard output: the disk is full")
    );
}

/// What the system refuses is said in words with advice, once; the numbers of the system are nobody's business.
#[test]
fn what_the_system_refuses_is_said_in_words() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let rows: String = (0..100)
        .map(|k| format!("{:.2},{}\n", 0.01 * f64::from(k), k % 7))
        .collect();
    std::fs::write(at("a.csv"), format!("t_s,gyro_x_rad_s\n{rows}")).unwrap();
    std::fs::write(at("cut.csv.gz"), [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 0x8d]).unwrap();
    std::fs::create_dir(at("there")).unwrap();
    for (command, told, hint) in [
        (
            "wv a.csv -o a.csv/x.json",
            "a.csv/x.json: a file is where a directory is needed",
            "name another path",
        ),
        (
            "wv a.csv -o there",
            "there: it is a directory, not a file",
            "name a file",
        ),
        (
            "run there there",
            "there: it is a directory, not a file",
            "name a file",
        ),
        (
            "wv cut.csv.gz",
            "cut.csv.gz: ",
            "the file is cut off or not gzipped",
        ),
    ] {
        let mut program = nav_sim();
        let output = program
            .current_dir(place.path())
            .args(command.split(' '))
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(said.contains(&format!("error: {told}")), "{said}");
        assert!(
            said.contains(&format!("hint: {hint}")) && !said.contains("os error"),
            "{said}"
        );
        assert_eq!(
            said.matches("is cut off").count(),
            usize::from(hint.contains("cut")),
            "{said}"
        );
    }
}

#[test]
fn colour_comes_when_asked_for_only() {
    let said = |color: &str| {
        let args = ["--color", color, "man", "nope"];
        String::from_utf8(nav_sim().args(args).output().unwrap().stderr).unwrap()
    };
    assert!(
        said("auto").starts_with("error: no command is named \"nope\"\n\nhint: "),
        "{}",
        said("auto")
    );
    assert!(
        said("always").starts_with("\u{1b}[1;31merror:\u{1b}[0m no command"),
        "{}",
        said("always")
    );
}

#[test]
fn a_directory_that_is_no_run_is_refused_with_advice() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let output = nav_sim()
        .args(["compare", path, "--reference", path])
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    let expected = format!("error: {path}/manifest.json: No such file or directory");
    assert!(
        said.starts_with(&expected) && said.contains("\n\nhint: not a finished run directory"),
        "{said}"
    );
}

/// Pipes are read once and serve as files do: what is computed and what is recorded of them is of the same bytes.
#[test]
fn inputs_may_be_pipes() {
    let directory = tempfile::tempdir().unwrap();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = env!("CARGO_BIN_EXE_nav-sim");
    let model = root.join("calib_data/tactical.toml").display().to_string();
    let script = format!(
        "set -e; {program} synthesize <(cat {model}) --samples 512 --seed 1 -o out; \
         {program} wv <(cat out/replicate_1.csv) > piped; {program} wv out/replicate_1.csv > plain"
    );
    let output = std::process::Command::new("bash")
        .current_dir(&directory)
        .args(["-c", &script])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let read = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&read("out/manifest.json")).unwrap();
    let bytes = std::fs::read(&model).unwrap();
    assert_eq!(
        manifest["inputs"][0]["blake3"],
        blake3::hash(&bytes).to_hex().to_string()
    );
    assert_eq!(
        read("piped").replace("/dev/fd/63", "out/replicate_1.csv"),
        read("plain")
    );
}

#[test]
fn text_that_is_not_utf_8_is_refused_with_its_line() {
    let directory = tempfile::tempdir().unwrap();
    let model = directory.path().join("a.toml");
    std::fs::write(&model, b"schema = 1\n# \xe9\n").unwrap();
    let output = nav_sim()
        .arg("synthesize")
        .arg(&model)
        .args(["-o", "x"])
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("a.toml: line 2 is not text in UTF-8"),
        "{said}"
    );
}

#[test]
fn the_version_says_more_if_asked() {
    let said = |words: &[&str]| {
        let output = nav_sim().args(words).output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        String::from_utf8(output.stdout).unwrap()
    };
    let short = format!("nav-sim {}\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(said(&["-V"]), short);
    for words in [&["--version"][..], &["--version", "-v"]] {
        let long = said(words);
        assert!(
            long.contains("build  ")
                && long.contains("vector units  ")
                && long.contains(std::env::consts::ARCH),
            "{long}"
        );
    }
}

/// A negative number is the value of the option before it, and the option says what is wrong with it.
#[test]
fn negative_values_are_refused_in_the_words_of_their_option() {
    for (arguments, reason) in [
        (
            "run a.toml b.toml --seed -1",
            "not a whole number from 0 to",
        ),
        (
            "run a.toml b.toml --runs -3",
            "--runs='-3': not a whole number ≥ 0",
        ),
        (
            "compare a --reference b --format latex",
            "--format='latex': not one of text, json",
        ),
        ("calibrate a --skip-s -5", "not a finite number ≥ 0"),
        (
            "design a --recordings 3 --hours -2",
            "not a finite number > 0",
        ),
        (
            "run a.toml b.toml --turn-on-bias -0.3,0.01",
            "expected two numbers ≥ 0",
        ),
        (
            "datasheet --arw -0.15deg/h",
            "does not begin with a number > 0",
        ),
    ] {
        let output = nav_sim().args(arguments.split(' ')).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert!(
            said.contains(reason) && !said.contains("tip:"),
            "{arguments}: {said}"
        );
    }
}

/// Advice on an unknown option that cannot be followed is left out.
#[test]
fn an_unknown_option_is_refused() {
    let words = ["run", "a.toml", "b.toml", "--zigzag", "8"];
    let output = nav_sim().args(words).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    let hint = "hint: --help shows usage and examples\n";
    assert_eq!(
        said,
        format!("error: unexpected argument --zigzag found\n\n{hint}")
    );
}

/// Commands that only write files tell them in JSON too.
#[test]
fn json_is_spoken_by_commands_that_write_files() {
    let place = tempfile::tempdir().unwrap();
    let json = |arguments: &str| -> serde_json::Value {
        let arguments = arguments.split(' ').chain(["--format", "json"]);
        let output = nav_sim()
            .current_dir(place.path())
            .args(arguments)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let made = json("init .");
    assert!(
        made["written"]
            .as_array()
            .unwrap()
            .iter()
            .any(|f| f == "./imu.toml"),
        "{made}"
    );
    assert_eq!(json("init .")["kept"], made["written"]);
    let drive = "trajectories/figure_eight.toml";
    for (command, file) in [("convert", "eight.csv"), ("generate", "rows.csv")] {
        let table = json(&format!("trajectory {command} {drive} -o {file}"));
        assert!(table["rows"].as_u64() > Some(100), "{table}");
    }
    let units = json("datasheet --list");
    assert!(
        units["units"].as_array().unwrap().len() >= 17
            && units["units"][0]["figures"][0]["given"].is_string()
    );
}
