//! `nav-sim synthesize` as a user runs it.

use assert_cmd::Command;
use nav_sim::io::recordings::{ReadOptions, read};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A directory with a small model in it.
struct Place(TempDir);

const MODEL: &str = r#"schema = 1
rate_hz = 100.0
[accel]
processes = [{ type = "WN", sigma2 = 1.0e-4 }, { type = "RW", gamma2 = 1.0e-8 }]
[gyro.x]
processes = [{ type = "AR1", phi = 0.9, sigma2 = 1.0e-6 }]
[[spread.accel]]
process = "WN"
parameter = "sigma2"
distribution = "beta"
a = 2
b = 2
low = 1.0e-4
width = 1.0e-4
"#;

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        fs::write(place.path("model.toml"), MODEL).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Exit code and what was said.
    fn run(&self, args: &[&str]) -> (i32, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_nav-sim"));
        let output = command
            .current_dir(&self.0)
            .args(["synthesize", "--no-progress"])
            .args(args)
            .output()
            .unwrap();
        (
            output.status.code().unwrap(),
            String::from_utf8(output.stderr).unwrap(),
        )
    }

    fn make(&self, out: &str, args: &[&str]) {
        let (code, said) = self.run(&[args, &["model.toml", "--seed", "5", "-o", out]].concat());
        assert_eq!(code, 0, "{said}");
    }

    fn manifest(&self, out: &str) -> Value {
        serde_json::from_str(&fs::read_to_string(self.path(out).join("manifest.json")).unwrap())
            .unwrap()
    }

    fn bytes(&self, file: &str) -> Vec<u8> {
        fs::read(self.path(file)).unwrap()
    }
}

fn entries(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(directory)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn replicates_read_back_and_the_manifest_says_what_was_drawn() {
    let place = Place::new();
    place.make(
        "out",
        &["--replicates", "3", "--samples", "400", "--spread"],
    );
    assert_eq!(
        entries(&place.path("out")),
        [
            "manifest.json",
            "replicate_1.csv",
            "replicate_2.csv",
            "replicate_3.csv"
        ]
    );
    let (recordings, _) = read(&[place.path("out")], &ReadOptions::default()).unwrap();
    assert_eq!(
        recordings
            .iter()
            .map(|r| (r.len(), r.signals.len()))
            .collect::<Vec<_>>(),
        [(400, 4); 3]
    );

    let manifest = place.manifest("out");
    assert_eq!(
        (manifest["seed"].as_u64(), manifest["samples"].as_u64()),
        (Some(5), Some(400))
    );
    let drawn = |replicate: usize, axis: &str| {
        manifest["replicates"][replicate]["axes"][axis][0]["sigma2"]
            .as_f64()
            .unwrap()
    };
    assert!((1e-4..=2e-4).contains(&drawn(0, "accel.x")));
    assert!((drawn(0, "accel.x") - drawn(1, "accel.x")).abs() > 0.0);
    assert!((drawn(0, "accel.x") - drawn(0, "accel.y")).abs() > 0.0);
    assert!((drawn(0, "gyro.x") - 1e-6).abs() < 1e-18);
}

#[test]
fn the_same_seed_gives_the_same_bytes_at_any_number_of_threads() {
    let place = Place::new();
    let args = ["--replicates", "4", "--samples", "1000", "--spread"];
    place.make("one", &[&args[..], &["-j", "1"]].concat());
    place.make("two", &[&args[..], &["-j", "2"]].concat());
    for k in 1..=4 {
        let file = |out: &str| place.bytes(&format!("{out}/replicate_{k}.csv"));
        assert_eq!(file("one"), file("two"));
    }
}

#[test]
fn contamination_adds_to_the_same_noise() {
    let place = Place::new();
    fs::write(
        place.path("step.toml"),
        "[[accel]]\noperation = \"step\"\nreplicates = [2]\namplitude = 1.0\n",
    )
    .unwrap();
    let args = ["--replicates", "2", "--samples", "300", "--axes", "x"];
    place.make("clean", &args);
    place.make(
        "dirty",
        &[&args[..], &["--contaminate", "step.toml"]].concat(),
    );
    assert_eq!(
        place.bytes("clean/replicate_1.csv"),
        place.bytes("dirty/replicate_1.csv")
    );
    let x = |out: &str, row: usize| -> f64 {
        let text = fs::read_to_string(place.path(out).join("replicate_2.csv")).unwrap();
        text.lines()
            .nth(row + 1)
            .unwrap()
            .split(',')
            .nth(1)
            .unwrap()
            .parse()
            .unwrap()
    };
    assert!((x("dirty", 149) - x("clean", 149)).abs() < 1e-15);
    assert!((x("dirty", 150) - x("clean", 150) - 1.0).abs() < 1e-8);
    assert_eq!(
        place.manifest("dirty")["replicates"][0]["contaminated"],
        false
    );
    assert_eq!(
        place.manifest("dirty")["replicates"][1]["contaminated"],
        true
    );
    place.make(
        "paper",
        &[
            "--replicates",
            "9",
            "--samples",
            "4096",
            "--contaminate",
            "section5-III",
        ],
    );
    assert_eq!(
        place.manifest("paper")["replicates"][8]["contaminated"],
        false
    );
}

#[test]
fn mistakes_are_refused_and_leave_nothing() {
    let place = Place::new();
    let refused = |args: &[&str], message: &str, hint: &str| {
        let (code, said) = place.run(&[args, &["-o", "out"]].concat());
        assert_eq!(code, 2, "{said}");
        assert!(said.contains(&format!("error: {message}")), "{said}");
        assert!(said.contains(hint), "{said}");
        assert_eq!(entries(place.0.path()), ["model.toml", "plain.toml"]);
    };
    fs::write(
        place.path("plain.toml"),
        "schema = 1\n[[accel]]\noperation = \"step\"\namplitude = 1.0\nreplicates = [9]\n",
    )
    .unwrap();
    refused(
        &[
            "model.toml",
            "--replicates",
            "8",
            "--contaminate",
            "plain.toml",
        ],
        "--contaminate plain.toml: affects none of the replicates 1 to 8",
        "counted from 1",
    );
    fs::write(
        place.path("plain.toml"),
        "rate_hz = 100\n[gyro]\nprocesses = [{ type = \"WN\", sigma2 = 1 }]\n",
    )
    .unwrap();
    refused(
        &["plain.toml", "--spread"],
        "plain.toml: no [spread] to draw from",
        "leave --spread out",
    );
    refused(
        &["plain.toml", "--axes", "accel"],
        "plain.toml has no noise model for these axes",
        "",
    );
    refused(
        &["model.toml", "--duration", "0.01"],
        "1 samples: a recording has 2 to 1e9",
        "",
    );
    refused(&["model.toml", "--samples", "1"], "--samples='1'", "");
    refused(
        &["model.toml", "--axes", "wheel"],
        "--axes='wheel'",
        "such as accel.x",
    );
    fs::write(
        place.path("plain.toml"),
        "[[accel]]\noperation = \"step\"\nat_s = 5\namplitude = 1\n",
    )
    .unwrap();
    refused(
        &[
            "model.toml",
            "--samples",
            "100",
            "--contaminate",
            "plain.toml",
        ],
        "plain.toml, line 1: a step needs 500 samples, the record has 100 (replicate 1)",
        "",
    );
    fs::write(
        place.path("plain.toml"),
        "schema = 1\n\n[[gyro]]\noperation = \"scale\"\nprocess = \"DR\"\nparameter = \"slope\"\nfactor = 2\n",
    )
    .unwrap();
    refused(
        &["model.toml", "--contaminate", "plain.toml"],
        "plain.toml, line 3: gyro.x has no DR slope to scale, only",
        "",
    );
    fs::write(
        place.path("plain.toml"),
        "rate_hz = 100\n[gyro]\nprocesses = [{ type = \"WN\", sigma2 = 1 }]\n",
    )
    .unwrap();
    refused(
        &[
            "plain.toml",
            "--axes",
            "gyro",
            "--contaminate",
            "section4-III",
        ],
        "section4-III, line 5: corrupts the accel, which is not made",
        "another contamination",
    );
    fs::write(
        place.path("plain.toml"),
        "[[accel]]\noperation = \"step\"\nat_s = 5\namplitude = 1\n",
    )
    .unwrap();
    refused(
        &["plain.toml"],
        "plain.toml, line 1: \"accel\" = [[accel]] is not a table",
        "",
    );
}

#[test]
fn an_unknown_contamination_is_answered_with_the_nearest() {
    let place = Place::new();
    let (code, said) = place.run(&["model.toml", "--contaminate", "section5-IIII", "-o", "out"]);
    assert_eq!(code, 2);
    assert!(
        said.contains("section5-IIII: No such file")
            && said.contains("did you mean \"section5-III\"?"),
        "{said}"
    );
}

#[test]
fn recordings_of_another_job_are_not_mixed_in_and_inputs_not_overwritten() {
    let place = Place::new();
    place.make("out", &["--replicates", "3", "--samples", "10"]);
    let again = [
        "model.toml",
        "--replicates",
        "3",
        "--samples",
        "20",
        "--seed",
        "5",
        "-o",
        "out",
    ];
    let (code, said) = place.run(&again);
    assert_eq!(code, 2);
    assert!(said.contains("out holds another result"), "{said}");
    let (code, said) = place.run(&[&again[..], &["--force"]].concat());
    assert_eq!(code, 0, "{said}");
    let (code, said) = place.run(&again);
    assert_eq!(code, 0, "the same once more: {said}");
    let (recordings, _) = read(&[place.path("out")], &ReadOptions::default()).unwrap();
    assert_eq!(recordings[0].len(), 20);
    let (code, said) = place.run(&[
        "model.toml",
        "--replicates",
        "2",
        "--samples",
        "10",
        "-o",
        "out",
    ]);
    assert_eq!(code, 2);
    assert!(said.contains("out holds another result"), "{said}");

    fs::rename(place.path("model.toml"), place.path("manifest.json")).unwrap();
    let (code, said) = place.run(&["manifest.json", "--samples", "10", "-o", "."]);
    assert_eq!(code, 2);
    assert!(
        said.contains("manifest.json is an input and would be overwritten"),
        "{said}"
    );
    assert_eq!(place.bytes("manifest.json"), MODEL.as_bytes());
}

/// Recordings of the user's own, under the names of replicates, are never replaced.
#[test]
fn recordings_that_this_command_did_not_make_are_left_alone() {
    let place = Place::new();
    let own = "t_s,accel_x_m_s2\n0,1\n0.01,2\n";
    let refused = |message: &str| {
        let (code, said) = place.run(&[
            "model.toml",
            "--replicates",
            "2",
            "--samples",
            "10",
            "-o",
            "own",
        ]);
        assert_eq!(code, 2, "{said}");
        assert!(said.contains(message), "{said}");
        assert_eq!(place.bytes("own/replicate_2.csv"), own.as_bytes());
    };
    fs::create_dir(place.path("own")).unwrap();
    fs::write(place.path("own/replicate_2.csv"), own).unwrap();
    refused("own is not of this command");
    fs::write(place.path("own/manifest.json"), "{\"command\": \"run\"}").unwrap();
    refused("own is not of this command");
    // beside replicates of this command, too
    fs::remove_dir_all(place.path("own")).unwrap();
    place.make("own", &["--samples", "10"]);
    fs::write(place.path("own/replicate_2.csv"), own).unwrap();
    refused("own is not of this command");
}

/// Interrupted, it ends with 128 + signal and leaves nothing; a signal that it was started to ignore does nothing.
#[test]
fn an_interrupt_leaves_nothing() {
    let place = Place::new();
    let began = || {
        entries(place.0.path())
            .iter()
            .any(|name| name.ends_with(".partial"))
    };
    for (signal, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        // what starts the tests may ignore signals (`nohup`, a script's background), and a child inherits that
        let mut child = std::process::Command::new("env")
            .current_dir(&place.0)
            .args([
                "--default-signal=INT,TERM,HUP",
                env!("CARGO_BIN_EXE_nav-sim"),
            ])
            .args([
                "synthesize",
                "model.toml",
                "--replicates",
                "1000",
                "--samples",
                "100000",
                "-o",
                "out",
            ])
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        while !began() {
            assert!(child.try_wait().unwrap().is_none());
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let kill = format!("kill -{signal} {}", child.id());
        assert!(
            std::process::Command::new("sh")
                .args(["-c", &kill])
                .status()
                .unwrap()
                .success()
        );
        assert_eq!(child.wait().unwrap().code(), Some(code));
        assert_eq!(entries(place.0.path()), ["model.toml"]);
    }
    let script = format!(
        "trap '' HUP; {} synthesize model.toml --samples 300000 --no-progress -o out & \
         while kill -0 $! && ! ls -A | grep -q partial; do :; done; kill -HUP $!; wait $!",
        env!("CARGO_BIN_EXE_nav-sim")
    );
    let ran = std::process::Command::new("sh")
        .current_dir(&place.0)
        .args(["-c", &script])
        .output()
        .unwrap();
    assert!(
        ran.status.success(),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
    assert_eq!(
        entries(&place.path("out")),
        ["manifest.json", "replicate_1.csv"]
    );
}
