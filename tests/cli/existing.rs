//! A file takes the place of an earlier result, a directory that of the same run; nothing else is replaced.

use crate::common::drive::{MODEL, Ran, done, place_with, plain};
use std::fs;

const DRIVE: &str = "
start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }
segment = [{ kind = \"straight\", duration_s = 5 }, { kind = \"accelerate\", to_speed_m_s = 10, duration_s = 10 }]
";

fn refused(ran: &Ran, what: &str) {
    assert_eq!(ran.code, 2, "{what}: {}", ran.stderr);
    assert!(
        ran.stderr.contains(what) && ran.stderr.contains("--force"),
        "{}",
        ran.stderr
    );
}

/// The answer of another kind takes no model's place, with `--force` neither.
#[test]
fn a_model_is_replaced_by_models_only() {
    let place = place_with(DRIVE, MODEL);
    done(place.path(), "datasheet --unit stim300 -o model.toml");
    let convert = "trajectory convert drive.toml -o model.toml --force";
    let ran = plain(place.path(), convert);
    assert!(
        ran.code == 2 && ran.stderr.contains("model.toml is not of this command"),
        "{}",
        ran.stderr
    );
    done(place.path(), "datasheet --unit adis16448 -o model.toml");
}

/// Each command twice, then as it makes something else.
#[test]
fn files_take_the_place_of_results_and_directories_that_of_the_same_run() {
    let place = place_with(DRIVE, MODEL);
    let at = |name: &str| place.path().join(name);
    done(
        place.path(),
        "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec",
    );
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o log",
    );
    done(
        place.path(),
        "run drive.toml imu.toml --runs 2 --outage none --seed 1 -o reference",
    );
    let calibrate = "calibrate rec --model WN+RW --bootstrap 0 -o out.toml";
    let fuse = "fuse log/imu.csv log/gnss.csv imu.toml --initial log/initial.toml -o fused";
    for (command, change, file) in [
        (
            "run drive.toml imu.toml --runs 2 --outage none --seed 1 -o run",
            "--seed 2",
            "run/summary.json",
        ),
        (fuse, "--lever-arm 1,0,0", "fused/solution.csv"),
        (
            "synthesize imu.toml --samples 64 --seed 1 -o made",
            "--samples 65",
            "made/replicate_1.csv",
        ),
        (
            "trajectory record drive.toml imu.toml --seed 1 -o again",
            "--seed 2",
            "again/imu.csv",
        ),
        (calibrate, "--weighting edof", "out.toml"),
        (calibrate, "--scales 5", "out.svg"),
        (
            "export imu.toml --target kalibr -o imu.yaml",
            "--policy envelope",
            "imu.yaml",
        ),
        (
            "datasheet --unit stim300 -o sheet.toml",
            "--rate-hz 200",
            "sheet.toml",
        ),
        (
            "compare run --reference reference",
            "--reference run",
            "comparison.json",
        ),
        ("wv rec -o wv.json --plot wv.html", "--scales 5", "wv.json"),
        (
            "trajectory convert drive.toml --rate-hz 1 -o drive.csv",
            "--rate-hz 2",
            "drive.csv",
        ),
        (
            "trajectory generate drive.toml --rate-hz 1 -o drive.csv.gz",
            "--rate-hz 2",
            "drive.csv.gz",
        ),
    ] {
        for _ in 0..2 {
            let ran = plain(place.path(), command);
            assert_eq!(ran.code, 0, "{command}\n{}", ran.stderr);
        }
        let before = fs::read(at(file)).unwrap();
        let flag = change.split(' ').next().unwrap();
        let mut other = match command.split_once(&format!("{flag} ")) {
            Some((start, rest)) => {
                format!(
                    "{start}{change}{}",
                    rest.split_once(' ')
                        .map_or(String::new(), |(_, end)| format!(" {end}"))
                )
            }
            None => format!("{command} {change}"),
        };
        if file.contains('/') {
            refused(&plain(place.path(), &other), "holds");
            assert!(fs::read(at(file)).unwrap() == before, "{other}");
            other += " --force";
        }
        let ran = plain(place.path(), &other);
        assert_eq!(ran.code, 0, "{other}\n{}", ran.stderr);
        assert!(fs::read(at(file)).unwrap() != before, "{other}");
    }
}

/// A fusion is known by what decides it: not by the words of its command, its order, or where its files are.
#[test]
fn a_fusion_is_known_by_its_configuration_and_the_contents_of_its_files() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "trajectory record drive.toml imu.toml --seed 3 -o log",
    );
    fs::copy(
        place.path().join("log/imu.csv"),
        place.path().join("copy.csv"),
    )
    .unwrap();
    let start = "--initial log/initial.toml";
    let given = "--outage 8:11 --gnss-sigma x2:1 --mounting 0,0,1:1,1,1";
    let fuse = format!("fuse log/imu.csv log/gnss.csv imu.toml {start}");
    let first = plain(place.path(), &format!("{fuse} {given} -o out"));
    assert_eq!(first.code, 0, "{}", first.stderr);
    let manifest: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(place.path().join("out/manifest.json")).unwrap())
            .unwrap();
    let configuration = &manifest["configuration"];
    assert_eq!(configuration["settings"]["outages"][0]["end_s"], 11.0);
    assert_eq!(
        configuration["gnss_sigma"][1],
        serde_json::json!([2.0, 1.0])
    );
    let same = [
        "fuse copy.csv log/gnss.csv imu.toml --mounting=0,0,1.0:1,1,1 --gnss-sigma x2.0:1.0",
        " --outage 8.0:11 --lever-arm 0,0,0 --filter 15 -j 1 -q --out=out ",
        start,
    ]
    .concat();
    let again = plain(place.path(), &same);
    assert_eq!(again.code, 0, "{}", again.stderr);
    for other in [
        "--smooth",
        "--lever-arm 0,0,1",
        "--gnss-correlation none",
        "--turn-on-bias 0.02,1e-4",
    ] {
        refused(
            &plain(place.path(), &format!("{fuse} {given} {other} -o out")),
            "holds another result",
        );
    }
    let text = fs::read_to_string(place.path().join("copy.csv")).unwrap();
    fs::write(place.path().join("copy.csv"), text.trim_end()).unwrap();
    refused(&plain(place.path(), &same), "holds another result");
}

/// Another that writes there now is met before the work, even with `--force`; what a killed one left is not in the way
/// and is removed. The two writers' lock is the operating system's, taken here as another process takes it.
#[test]
fn what_another_command_writes_is_refused_at_once() {
    let place = place_with(DRIVE, MODEL);
    let at = |name: &str| place.path().join(name);
    done(
        place.path(),
        "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec",
    );
    fs::create_dir(at("there")).unwrap();
    let run = "run drive.toml imu.toml --runs 2 --outage none --seed 1 --force";
    for (command, marker, output) in [
        (format!("{run} -o new"), ".new.claim", "new"),
        (format!("{run} -o there"), "there/.claim", "there"),
        (
            format!("{run} -o new --plot a.svg"),
            ".a.svg.claim",
            "a.svg",
        ),
        (
            "calibrate rec --model WN --bootstrap 0 -o m.toml --force".to_owned(),
            ".m.toml.claim",
            "m.toml",
        ),
        (
            "tune imu.toml --truth imu.toml --trajectory drive.toml --outage 5:10 -o t.toml"
                .to_owned(),
            ".t.toml.claim",
            "t.toml",
        ),
        ("wv rec -o wv.json".to_owned(), ".wv.json.claim", "wv.json"),
    ] {
        let held = fs::File::create(at(marker)).unwrap();
        held.lock().unwrap();
        let ran = plain(place.path(), &command);
        assert_eq!(ran.code, 2, "{command}: {}", ran.stderr);
        let told = format!(
            "error: {output} is being written by another nav-sim\n\nhint: choose another output with --out"
        );
        assert!(ran.stderr.contains(&told), "{}", ran.stderr);
        // not by closing it: a process that another test is starting may share it for a moment
        held.unlock().unwrap();
        let ran = plain(place.path(), &command);
        assert_eq!(ran.code, 0, "{command}: {}", ran.stderr);
        assert!(!at(marker).exists(), "{command}");
    }
}

/// Before the work, and with `--force` too; another result gives way.
#[test]
fn what_nav_sim_did_not_write_is_never_replaced() {
    let place = place_with(DRIVE, MODEL);
    let at = |name: &str| place.path().join(name);
    done(
        place.path(),
        "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec",
    );
    let header = "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg\n";
    let own_table = format!("{header}0.0,46.5,6.5,400.0,0.0,0.0,0.0,0.0,0.0,0.0\n");
    let own_model = fs::read_to_string(at("imu.toml")).unwrap();
    let calibrate = "calibrate rec --model WN --bootstrap 0 -o";
    for (command, file, own) in [
        (format!("{calibrate} m.toml"), "m.toml", own_model.as_str()),
        (
            format!("{calibrate} m.toml"),
            "m.wv.json",
            "{ \"schema_version\": 1 }",
        ),
        (format!("{calibrate} m.toml"), "m.html", "<html></html>"),
        (format!("{calibrate} m.toml"), "m.svg", "<svg></svg>"),
        (
            "datasheet --unit stim300 -o imu.toml".to_owned(),
            "imu.toml",
            own_model.as_str(),
        ),
        ("wv rec -o a.json".to_owned(), "a.json", "{}"),
        (
            "trajectory convert drive.toml --rate-hz 1 -o own.csv".to_owned(),
            "own.csv",
            own_table.as_str(),
        ),
    ] {
        fs::write(at(file), own).unwrap();
        for force in ["", " --force"] {
            let ran = plain(place.path(), &format!("{command}{force}"));
            let told = format!("{file} is not of this command: not replaced");
            assert!(
                ran.code == 2 && ran.stderr.contains(&told),
                "{command}: {}",
                ran.stderr
            );
            assert!(
                ran.stdout.is_empty() && !ran.stderr.contains("4096"),
                "{command}: {}",
                ran.stderr
            );
            assert_eq!(fs::read_to_string(at(file)).unwrap(), own, "{command}");
        }
        fs::remove_file(at(file)).unwrap();
    }
    done(place.path(), "datasheet --unit stim300 -o m.toml");
    done(place.path(), &format!("{calibrate} m.toml"));
}

/// A model, a page, curves or a trajectory do not give way to what is no such thing, nor does a part of a directory.
#[test]
fn results_of_another_kind_are_not_replaced() {
    let place = place_with(DRIVE, MODEL);
    let dir = place.path();
    done(dir, "synthesize imu.toml --samples 4096 --seed 1 -o rec");
    let run = "run drive.toml imu.toml --method lincov --outage none";
    done(dir, &format!("{run} -o run"));
    done(dir, "datasheet --unit stim300 -o m.toml");
    done(dir, "trajectory convert drive.toml --rate-hz 1 -o d.csv");
    done(dir, "wv rec -o wv.json");
    let study = "[run]\ntrajectory = \"drive.toml\"\nmodel = \"imu.toml\"\nmethod = \"lincov\"\n";
    fs::write(dir.join("study.toml"), study).unwrap();
    for (command, file) in [
        ("wv rec -o m.toml", "m.toml"),
        ("export imu.toml --target kalibr -o m.toml", "m.toml"),
        ("trajectory convert drive.toml -o m.toml", "m.toml"),
        ("datasheet --unit stim300 -o d.csv", "d.csv"),
        ("wv rec -o run/summary.json", "run/summary.json"),
        ("wv rec --plot run/report.html", "run/report.html"),
        ("compare run --reference run -o wv.json", "wv.json"),
        ("batch study.toml -o run", "run/summary.json"),
        ("batch study.toml -o rec", "rec/manifest.json"),
    ] {
        let before = fs::read(dir.join(file)).unwrap();
        let ran = plain(dir, &format!("{command} --force"));
        let told = format!("{file} is not of this command: not replaced");
        assert_eq!(ran.code, 2, "{command}: {}", ran.stderr);
        assert!(ran.stderr.contains(&told), "{command}: {}", ran.stderr);
        assert!(fs::read(dir.join(file)).unwrap() == before, "{command}");
    }
}

/// Where a manifest names files elsewhere, they stay.
#[test]
fn a_manifest_removes_nothing_outside_its_directory() {
    let place = place_with(DRIVE, MODEL);
    let at = |name: &str| place.path().join(name);
    let run = "run drive.toml imu.toml --method lincov -o run --outage";
    done(place.path(), &format!("{run} none"));
    let text = fs::read_to_string(at("run/manifest.json")).unwrap();
    let text = text.replace(
        "\"outputs\": {",
        "\"outputs\": {\n    \"../kept.txt\": \"\",",
    );
    fs::write(at("run/manifest.json"), text).unwrap();
    fs::write(at("kept.txt"), "mine").unwrap();
    done(place.path(), &format!("{run} 5:10"));
    assert_eq!(fs::read_to_string(at("kept.txt")).unwrap(), "mine");
}

/// The default name has the newest, and what stands beside it is of the newest.
#[test]
fn a_second_calibration_takes_the_place_of_the_first() {
    let place = place_with(DRIVE, MODEL);
    let text = |name: &str| fs::read_to_string(place.path().join(name)).unwrap();
    for (rec, seed) in [("a", 1), ("b", 2)] {
        done(
            place.path(),
            &format!("synthesize imu.toml --samples 4096 --seed {seed} -o {rec}"),
        );
        let calibrate =
            "calibrate {rec} --axes gyro.x --estimator rgmwm --model WN+RW --bootstrap 19"
                .replace("{rec}", rec);
        let ran = plain(place.path(), &calibrate);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        done(place.path(), &format!("{calibrate} --seed 1 -o {rec}.toml"));
        assert!(text("model.toml").contains(&format!("{rec}/replicate_1.csv")));
        assert_eq!(text("model.wv.json"), text(&format!("{rec}.wv.json")));
    }
    let mut names: Vec<_> = fs::read_dir(place.path())
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().into_string().ok())
        .filter(|name| name.starts_with("model"))
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "model.draws.json",
            "model.html",
            "model.svg",
            "model.toml",
            "model.wv.json"
        ]
    );
}

/// Two outputs of one name, whatever either is.
#[test]
fn two_outputs_of_one_name_are_refused_at_once() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec",
    );
    for (command, output) in [
        (
            "run drive.toml imu.toml --runs 2 --outage none -o a.svg --plot a.svg",
            "a.svg",
        ),
        ("calibrate rec --model WN --bootstrap 0 -o a.svg", "a.svg"),
        ("wv rec -o a.html --plot a.html", "a.html"),
        ("compare log --reference log -o a.html", "a.html"),
        ("calibrate rec --model WN --bootstrap 0 -o a.html", "a.html"),
    ] {
        let ran = plain(place.path(), command);
        let told = format!("error: {output} is another output of this command\n");
        assert!(
            ran.code == 2 && ran.stderr.contains(&told),
            "{}",
            ran.stderr
        );
        assert!(!place.path().join(output).exists(), "{command}");
    }
}

/// What `init` makes is not in the way of `calibrate`; a file that is no calibration is told before the work.
#[test]
fn calibrate_begins_where_init_ended_and_replaces_no_other_model() {
    let place = tempfile::tempdir().unwrap();
    let calibrate = "calibrate rec --model WN+RW --bootstrap 0 --seed 1";
    for command in [
        "init .",
        "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec",
        calibrate,
    ] {
        let ran = plain(place.path(), command);
        assert_eq!(ran.code, 0, "{command}\n{}", ran.stderr);
    }
    let own = fs::read(place.path().join("imu.toml")).unwrap();
    let ran = plain(place.path(), &format!("{calibrate} -o imu.toml"));
    assert!(
        ran.code == 2 && ran.stderr.contains("imu.toml is not of this command"),
        "{}",
        ran.stderr
    );
    assert!(fs::read(place.path().join("imu.toml")).unwrap() == own);
}

/// The output of the command itself, redirected into the directory of its recordings, is no recording.
#[test]
fn an_empty_file_in_a_directory_is_passed_over() {
    let place = place_with(DRIVE, MODEL);
    done(
        place.path(),
        "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec",
    );
    fs::write(place.path().join("rec/all.txt"), "").unwrap();
    let ran = plain(place.path(), "wv rec");
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("all.txt: skipped, it is empty"),
        "{}",
        ran.stderr
    );
}
