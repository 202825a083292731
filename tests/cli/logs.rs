//! Logs of other programs in the commands that read recordings. The files are written by independent programs, whose sums
//! stand beside them (`src/logs/tests/data`).

use crate::common::drive::*;
use nav_sim::io::recordings::{self, ReadOptions};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("src/logs/tests/data")
        .join(name)
}

/// Count and sums of accelerations and angular rates of a channel, as its writer has them.
fn expected(file: &str, topic: &str) -> (usize, Vec<f64>) {
    let text = fs::read_to_string(data("expected.csv")).unwrap();
    let row = text
        .lines()
        .find(|line| line.starts_with(&format!("{file},{topic},")))
        .unwrap();
    let cells: Vec<&str> = row.split(',').collect();
    (
        cells[2].parse().unwrap(),
        cells[5..11]
            .iter()
            .map(|cell| cell.parse().unwrap())
            .collect(),
    )
}

#[test]
fn samples_of_logs_are_those_of_their_writers() {
    for (file, topic) in [
        ("ros2_zstd.mcap", "/imu"),
        ("ros2_lz4.mcap", "/imu"),
        ("ros1_bz2.bag", "/imu"),
        ("ros1_lz4.bag", "/imu"),
        ("px4.ulg", "sensor_combined"),
    ] {
        let (read, report) = recordings::read(&[data(file)], &ReadOptions::default()).unwrap();
        let (count, sums) = expected(file, topic);
        assert!(
            (report.files[0].rate_hz - 100.0).abs() < 1e-3,
            "{file}: {} Hz",
            report.files[0].rate_hz
        );
        assert_eq!(read[0].signals.len(), 6, "{file}");
        for (signal, sum) in read[0].signals.iter().zip(sums) {
            assert_eq!(signal.samples.len(), count, "{file}");
            // rounding of a few dozen additions of numbers near 10
            let off = signal.mean * count as f64 - sum;
            assert!(off.abs() < 1e-11, "{file} {}: {off:e}", signal.channel);
        }
    }
}

/// One recording, as a table of this program and as independent writers put it into logs and arrays: the same numbers.
#[test]
fn a_recording_has_the_same_curves_in_every_format() {
    let formats = Path::new(env!("CARGO_MANIFEST_DIR")).join("calib_data/formats");
    let curves = |file: &str| {
        let ran = nav_sim(&formats, &format!("wv {file} --format json"));
        assert_eq!(ran.code, 0, "{file}: {}", ran.stderr);
        ran.stdout.replace(file, "")
    };
    let expected = curves("own.csv");
    for file in ["log.mcap", "log.bag", "arrays.npz"] {
        assert_eq!(curves(file), expected, "{file}");
    }
    #[cfg(feature = "parquet")]
    assert_eq!(curves("table.parquet"), expected);
    #[cfg(not(feature = "parquet"))]
    {
        let ran = nav_sim(&formats, "wv table.parquet");
        assert!(
            ran.code == 2 && ran.stderr.contains("hint: build with --features parquet"),
            "{}",
            ran.stderr
        );
    }
}

/// The same recording as the files of KITTI have it: one line of thirty numbers a sample, times beside them.
#[test]
fn a_directory_of_kitti_is_one_recording() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("calib_data/formats/own.csv");
    let place = tempfile::tempdir().unwrap();
    fs::create_dir_all(place.path().join("oxts/data")).unwrap();
    let text = fs::read_to_string(&own).unwrap();
    let mut times = String::new();
    for (k, line) in text.lines().skip(1).enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let mut numbers = ["0"; 30];
        numbers[11..14].copy_from_slice(&cells[1..4]);
        numbers[17..20].copy_from_slice(&cells[4..7]);
        fs::write(
            place.path().join(format!("oxts/data/{k:010}.txt")),
            numbers.join(" "),
        )
        .unwrap();
        times += &format!(
            "2011-09-26 13:02:{:02}.{:02}0000000\n",
            20 + k / 100,
            k % 100
        );
    }
    fs::write(place.path().join("oxts/timestamps.txt"), times).unwrap();
    let variances = |file: &str| {
        let ran = nav_sim(place.path(), &format!("wv {file} --format json"));
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let found: Value = serde_json::from_str(&ran.stdout).unwrap();
        found["signals"]
            .as_array()
            .unwrap()
            .iter()
            .map(|s| s["classical"]["wv"].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(variances("oxts"), variances(&own.display().to_string()));
    fs::write(place.path().join("oxts/data/0000000007.txt"), "1 2 3").unwrap();
    let ran = nav_sim(place.path(), "wv oxts");
    assert!(
        ran.code == 2 && ran.stderr.contains("0000000007.txt, line 1"),
        "{}",
        ran.stderr
    );
}

/// A gyroscope without a unit could be in degrees or radians: it is not guessed.
#[test]
fn arrays_without_a_unit_are_refused() {
    for file in ["arrays.npz", "arrays_deflated.npz"] {
        let ran = nav_sim(Path::new("."), &format!("wv {}", data(file).display()));
        assert_eq!(ran.code, 2, "{}", ran.stdout);
        assert!(
            ran.stderr.contains("column \"gyro_x\" has no unit"),
            "{}",
            ran.stderr
        );
    }
}

#[test]
fn of_several_imus_one_is_named() {
    let bag = data("ros1_two_imus.bag");
    let ran = nav_sim(Path::new("."), &format!("wv {}", bag.display()));
    assert_eq!(ran.code, 2, "{}", ran.stdout);
    assert!(
        ran.stderr
            .contains("2 topics have IMU samples: /imu, /imu_rear"),
        "{}",
        ran.stderr
    );
    assert!(ran.stderr.contains("hint: --topic NAME"), "{}", ran.stderr);
    let ran = nav_sim(
        Path::new("."),
        &format!("wv {} --topic /imu_rear --format json", bag.display()),
    );
    assert_eq!(ran.code, 0, "{}", ran.stderr);
}

/// `fuse` names the topics of the IMU and of the fixes.
#[test]
fn of_several_imus_fuse_takes_the_one_named() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("imu.toml"), MODEL).unwrap();
    let bag = data("ros1_two_imus.bag");
    let fuse = |options: &str| {
        let command = format!("fuse {0} {0} imu.toml {options}", bag.display());
        let ran = nav_sim(place.path(), &command);
        assert_eq!(ran.code, 2, "{}", ran.stdout);
        ran.stderr
    };
    assert!(fuse("").contains("hint: --topic NAME"), "{}", fuse(""));
    // no word of the topic: four hundredths of a second are no drive
    assert!(
        !fuse("--topic /imu_rear").contains("have IMU samples"),
        "{}",
        fuse("--topic /imu_rear")
    );
    let none = fuse("--topic /imu_rear,/none");
    assert!(
        none.contains("no topic has") && none.contains("/none"),
        "{none}"
    );
}

/// A log that is cut at its end is read up to the cut, with a warning; one that is damaged before is refused with the byte.
#[test]
fn a_cut_log_is_read_up_to_there_and_a_damaged_one_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let whole = fs::read(data("ros2_unchunked.mcap")).unwrap();
    fs::write(place.path().join("cut.mcap"), &whole[..whole.len() / 2]).unwrap();
    let ran = nav_sim(place.path(), "wv cut.mcap --scales 1");
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("warning: cut.mcap: byte ") && ran.stderr.contains("read up to there"),
        "{}",
        ran.stderr
    );
    let mut damaged = whole.clone();
    damaged[8] = 0;
    fs::write(place.path().join("damaged.mcap"), damaged).unwrap();
    let ran = nav_sim(place.path(), "wv damaged.mcap");
    assert!(
        ran.code == 2 && ran.stderr.contains("damaged.mcap: byte "),
        "{}",
        ran.stderr
    );
    let ran = nav_sim(place.path(), "inspect cut.mcap --format json");
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let found: Value = serde_json::from_str(&ran.stdout).unwrap();
    let said = found["damage"].as_str().unwrap();
    assert!(
        said.contains("read up to there")
            && said.ends_with(&format!("of {} bytes", whole.len() / 2)),
        "{said}"
    );
    let imu = found["channels"]
        .as_array()
        .unwrap()
        .iter()
        .find(|c| c["content"] == "imu")
        .unwrap();
    let messages = imu["messages"].as_u64().unwrap();
    assert!(0 < messages && messages < 12, "{messages}");
}

#[test]
fn a_format_that_is_not_read_is_named_with_its_conversion() {
    let place = tempfile::tempdir().unwrap();
    for (name, bytes, said, hint) in [
        (
            "a.db3",
            &b"SQLite format 3\0 and so on"[..],
            "rosbag2",
            "mcap convert",
        ),
        (
            "a.bin",
            b"\xa3\x95\x80 and so on",
            "DataFlash",
            "mavlogdump.py",
        ),
        (
            "a.mat",
            b"MATLAB 5.0 MAT-file, Platform: x",
            "MATLAB .mat",
            "writematrix",
        ),
        (
            "b.mat",
            b"\x89HDF\r\n\x1a\n and so on",
            "HDF5",
            "writematrix",
        ),
    ] {
        fs::write(place.path().join(name), bytes).unwrap();
        for command in ["wv", "calibrate", "inspect", "check"] {
            let ran = nav_sim(place.path(), &format!("{command} {name}"));
            assert_eq!(ran.code, 2, "{command} {name}: {}", ran.stderr);
            assert!(
                ran.stderr.contains(said) && ran.stderr.contains(hint),
                "{command} {name}: {}",
                ran.stderr
            );
        }
    }
}

#[test]
fn the_channels_of_a_log_are_listed() {
    let ran = nav_sim(
        Path::new("."),
        &format!("inspect {} --format json", data("ros2_zstd.mcap").display()),
    );
    let found: Value = serde_json::from_str(&ran.stdout).unwrap();
    let channels = found["channels"].as_array().unwrap();
    let imu = channels.iter().find(|c| c["topic"] == "/imu").unwrap();
    assert_eq!(
        (&imu["messages"], &imu["rate_hz"], &imu["gaps"]),
        (&40.into(), &100.0.into(), &0.into())
    );
    assert_eq!(channels.iter().filter(|c| c["content"] == "fix").count(), 1);
}
