//! Results are never replaced silently: what holds another result is refused, the same is written again.

use crate::common::drive::{MODEL, Ran, done, place_with, plain};
use std::fs;

const DRIVE: &str = "
start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }
segment = [{ kind = \"straight\", duration_s = 5 }, { kind = \"accelerate\", to_speed_m_s = 10, duration_s = 10 }]
";

fn refused(ran: &Ran, what: &str) {
    assert_eq!(ran.code, 2, "{what}: {}", ran.stderr);
    assert!(ran.stderr.contains(what) && ran.stderr.contains("--force"), "{}", ran.stderr);
}

/// Each command twice (the same: fine), then as it makes something else (refused, the old stays), then with --force.
#[test]
fn another_result_is_refused() {
    let place = place_with(DRIVE, MODEL);
    let at = |name: &str| place.path().join(name);
    done(place.path(), "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec");
    done(place.path(), "trajectory record drive.toml imu.toml --seed 3 -o log");
    done(place.path(), "run drive.toml imu.toml --runs 2 --outage none --seed 1 -o reference");
    let calibrate = "calibrate rec --model WN+RW --bootstrap 0 -o out.toml";
    let fuse = "fuse log/imu.csv log/gnss.csv imu.toml --initial log/initial.toml -o fused";
    for (command, change, file) in [
        ("run drive.toml imu.toml --runs 2 --outage none --seed 1 -o run", "--seed 2", "run/summary.json"),
        (fuse, "--lever-arm 1,0,0", "fused/solution.csv"),
        ("synthesize imu.toml --samples 64 --seed 1 -o made", "--samples 65", "made/replicate_1.csv"),
        ("trajectory record drive.toml imu.toml --seed 1 -o again", "--seed 2", "again/imu.csv"),
        (calibrate, "--weighting edof", "out.toml"),
        ("export imu.toml --target kalibr -o imu.yaml", "--policy envelope", "imu.yaml"),
        ("datasheet --unit stim300 -o sheet.toml", "--rate-hz 200", "sheet.toml"),
        ("compare run --reference reference", "--reference run", "comparison.json"),
        ("wv rec -o wv.json", "--scales 5", "wv.json"),
        ("trajectory convert drive.toml --rate-hz 1 -o drive.csv", "--rate-hz 2", "drive.csv"),
        ("trajectory generate drive.toml --rate-hz 1 -o drive.csv.gz", "--rate-hz 2", "drive.csv.gz"),
    ] {
        for _ in 0..2 {
            let ran = plain(place.path(), command);
            assert_eq!(ran.code, 0, "{command}\n{}", ran.stderr);
        }
        let before = fs::read(at(file)).unwrap();
        let flag = change.split(' ').next().unwrap();
        let other = match command.split_once(&format!("{flag} ")) {
            Some((start, rest)) => {
                format!(
                    "{start}{change}{}",
                    rest.split_once(' ').map_or(String::new(), |(_, end)| format!(" {end}"))
                )
            }
            None => format!("{command} {change}"),
        };
        refused(&plain(place.path(), &other), "holds");
        assert!(fs::read(at(file)).unwrap() == before, "{other}");
        let ran = plain(place.path(), &format!("{other} --force"));
        assert_eq!(ran.code, 0, "{other}\n{}", ran.stderr);
        assert!(fs::read(at(file)).unwrap() != before, "{other}");
    }
    // A seed that is drawn makes another model: known before the work.
    let ran = plain(place.path(), "calibrate rec --model WN+RW --bootstrap 19 -o out.toml");
    refused(&ran, "out.toml");
    assert!(!ran.stderr.contains("recordings at"), "{}", ran.stderr);
}

/// A fusion is known by what decides it: not by the words of its command, its order, or where its files are.
#[test]
fn a_fusion_is_known_by_its_configuration_and_the_contents_of_its_files() {
    let place = place_with(DRIVE, MODEL);
    done(place.path(), "trajectory record drive.toml imu.toml --seed 3 -o log");
    fs::copy(place.path().join("log/imu.csv"), place.path().join("copy.csv")).unwrap();
    let start = "--initial log/initial.toml";
    let given = "--outage 8:11 --gnss-sigma-factor 2,1 --mounting 0,0,1:1,1,1 --nis-gate 0.999";
    let fuse = format!("fuse log/imu.csv log/gnss.csv imu.toml {start}");
    let first = plain(place.path(), &format!("{fuse} {given} -o out"));
    assert_eq!(first.code, 0, "{}", first.stderr);
    let manifest: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(place.path().join("out/manifest.json")).unwrap()).unwrap();
    let configuration = &manifest["configuration"];
    assert_eq!(configuration["settings"]["outages"][0]["end_s"], 11.0);
    assert_eq!(configuration["gnss_sigma_factor"], serde_json::json!([2.0, 1.0]));
    let same = [
        "fuse copy.csv log/gnss.csv imu.toml --nis-gate .999 --mounting=0,0,1.0:1,1,1 --gnss-sigma-factor 2.0,1.0",
        " --outage 8.0:11 --lever-arm 0,0,0 --axes frd --gravity wgs84 --filter 15 --rate-hz 10 -j 1 -q --out=out ",
        start,
    ]
    .concat();
    let again = plain(place.path(), &same);
    assert_eq!(again.code, 0, "{}", again.stderr);
    for other in ["--smooth", "--lever-arm 0,0,1", "--gnss-sigma 5", "--turn-on-bias 0.02,1e-4", "--axes flu"]
    {
        refused(
            &plain(place.path(), &format!("{fuse} {given} {other} -o out")),
            "holds the result of another",
        );
    }
    let text = fs::read_to_string(place.path().join("copy.csv")).unwrap();
    fs::write(place.path().join("copy.csv"), text.trim_end()).unwrap();
    refused(&plain(place.path(), &same), "holds the result of another");
}

/// Another that writes there now is met before the work, even with `--force`; what a killed one left is not in the way
/// and is removed. The two writers' lock is the operating system's, taken here as another process takes it.
#[test]
fn what_another_command_writes_is_refused_at_once() {
    let place = place_with(DRIVE, MODEL);
    let at = |name: &str| place.path().join(name);
    done(place.path(), "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec");
    fs::create_dir(at("there")).unwrap();
    let run = "run drive.toml imu.toml --runs 2 --outage none --seed 1 --force";
    for (command, marker, output) in [
        (format!("{run} -o new"), ".new.claim", "new"),
        (format!("{run} -o there"), "there/.claim", "there"),
        (format!("{run} -o new --plot a.svg"), ".a.svg.claim", "a.svg"),
        ("calibrate rec --model WN --bootstrap 0 -o m.toml --force".to_owned(), ".m.toml.claim", "m.toml"),
        (
            "tune imu.toml --truth imu.toml --trajectory drive.toml --outage 5:10 -o t.toml".to_owned(),
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

/// What the work has made is kept beside what is not replaced, under the first name that is free or holds the same.
#[test]
fn a_result_that_is_refused_after_the_work_is_not_lost() {
    let place = place_with(DRIVE, MODEL);
    let at = |name: &str| place.path().join(name);
    let text = |name: &str| fs::read_to_string(at(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    done(place.path(), "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec");
    let calibrate = "calibrate rec --model WN+RW --bootstrap 0 --seed 1 --quiet";
    done(place.path(), &format!("{calibrate} --weighting edof -o wanted.toml --plot wanted.svg"));
    done(place.path(), &format!("{calibrate} -o m.toml --plot m.svg"));
    let before = text("m.toml");
    for _ in 0..2 {
        let ran = plain(place.path(), &format!("{calibrate} --weighting edof -o m.toml --plot m.svg"));
        refused(&ran, "error: m.toml holds another result, this one is in m-2.toml");
        assert!(!ran.stdout.is_empty(), "the fits are shown");
    }
    assert_eq!(text("m.toml"), before);
    // the curves beside it are its own: the hash in the model says so
    for (beside, wanted) in
        [("m-2.toml", "wanted.toml"), ("m-2.wv.json", "wanted.wv.json"), ("m-2.svg", "wanted.svg")]
    {
        assert_eq!(text(beside), text(wanted), "{beside}");
    }
    assert!(at("m-2.html").exists() && !at("m-3.toml").exists());

    done(place.path(), "wv rec --scales 5 -o wanted.json --page wanted.html");
    fs::write(at("a.json"), "{}").unwrap();
    fs::write(at("a.page.html"), "mine").unwrap();
    let ran = plain(place.path(), "wv rec --scales 5 -o a.json --page a.page.html");
    refused(&ran, "a.json holds another result, this one is in a-2.json");
    assert_eq!((text("a-2.json"), text("a-2.page.html")), (text("wanted.json"), text("wanted.html")));
    assert_eq!((text("a.json"), text("a.page.html")), ("{}".to_owned(), "mine".to_owned()));
}

/// A run whose seed is drawn is another one the next time: the hint says how to make the first one again.
#[test]
fn a_run_of_another_seed_is_told_the_first_ones() {
    let place = place_with(DRIVE, MODEL);
    let run = "run drive.toml imu.toml --outage none";
    done(place.path(), &format!("{run} --runs 2 --seed 77"));
    for (runs, is_same) in [("--runs 2", true), ("--runs 3", false)] {
        let ran = plain(place.path(), &format!("{run} {runs}"));
        refused(&ran, "holds the result of another");
        assert_eq!(ran.stderr.contains("with --seed 77,"), is_same, "{}", ran.stderr);
    }
}

/// Two outputs of one name, whatever either is.
#[test]
fn two_outputs_of_one_name_are_refused_at_once() {
    let place = place_with(DRIVE, MODEL);
    done(place.path(), "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec");
    for (command, output) in [
        ("run drive.toml imu.toml --runs 2 --outage none -o a.svg --plot a.svg", "a.svg"),
        ("calibrate rec --model WN --bootstrap 0 -o a.svg --plot ./a.svg", "./a.svg"),
        ("wv rec -o a.html --page a.html", "a.html"),
        ("compare log --reference log -o a.html", "a.html"),
        ("calibrate rec --model WN --bootstrap 0 -o a.html", "a.html"),
    ] {
        let ran = plain(place.path(), command);
        let told = format!("error: {output} is another output of the same command\n");
        assert!(ran.code == 2 && ran.stderr.contains(&told), "{}", ran.stderr);
        assert!(!place.path().join(output).exists(), "{command}");
    }
}

/// What `init` makes is not in the way of `calibrate`; a file that is no calibration is told before the work.
#[test]
fn calibrate_begins_where_init_ended_and_replaces_no_other_model() {
    let place = tempfile::tempdir().unwrap();
    let calibrate = "calibrate rec --model WN+RW --bootstrap 0 --seed 1";
    for command in ["init .", "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec", calibrate]
    {
        let ran = plain(place.path(), command);
        assert_eq!(ran.code, 0, "{command}\n{}", ran.stderr);
    }
    let own = fs::read(place.path().join("imu.toml")).unwrap();
    let ran = plain(place.path(), &format!("{calibrate} -o imu.toml"));
    refused(&ran, "imu.toml holds another result");
    assert!(!ran.stderr.contains("4096 samples"), "{}", ran.stderr);
    assert!(fs::read(place.path().join("imu.toml")).unwrap() == own);
    let ran = plain(place.path(), &format!("{calibrate} -o imu.toml --force"));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
}

/// The output of the command itself, redirected into the directory of its recordings, is no recording.
#[test]
fn an_empty_file_in_a_directory_is_passed_over() {
    let place = place_with(DRIVE, MODEL);
    done(place.path(), "synthesize imu.toml --replicates 2 --samples 4096 --seed 1 -o rec");
    fs::write(place.path().join("rec/all.txt"), "").unwrap();
    let ran = plain(place.path(), "wv rec");
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stderr.contains("all.txt: passed over, it is empty"), "{}", ran.stderr);
}
