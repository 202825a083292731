//! Logs of other programs, written by independent programs, whose sums stand beside them (`src/logs/tests/data`). What commands
//! say of them is in `transcripts/command_line.md`.

use crate::common::drive::*;
use nav_sim::io::recordings::{self, ReadOptions};
use std::fs;
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(ROOT).join("src/logs/tests/data").join(name)
}

/// Count and sums of accelerations and angular rates of a channel, as its writer has them.
fn expected(file: &str, topic: &str) -> (usize, Vec<f64>) {
    let text = fs::read_to_string(data("expected.csv")).unwrap();
    let start = format!("{file},{topic},");
    let row = text
        .lines()
        .find_map(|line| line.strip_prefix(&start))
        .unwrap();
    let cells: Vec<&str> = row.split(',').collect();
    let sums = cells[3..9].iter().map(|cell| cell.parse().unwrap());
    (cells[0].parse().unwrap(), sums.collect())
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
        let rate_hz = report.files[0].rate_hz;
        assert!((rate_hz - 100.0).abs() < 1e-3, "{file}: {rate_hz} Hz");
        assert_eq!((read[0].signals.len(), sums.len()), (6, 6), "{file}");
        for (signal, sum) in read[0].signals.iter().zip(sums) {
            assert_eq!(signal.samples.len(), count, "{file}");
            // rounding of a few dozen additions of numbers near 10
            let off = signal.mean * count as f64 - sum;
            assert!(off.abs() < 1e-11, "{file} {}: {off:e}", signal.channel);
        }
    }
}

#[test]
fn parquet_holds_the_recording_of_the_other_formats() {
    let formats = Path::new(ROOT).join("calib_data/formats");
    let curves = |file: &str| nav_sim(&formats, &format!("wv {file} --format json"));
    let ran = curves("table.parquet");
    if cfg!(feature = "parquet") {
        assert_eq!(
            ran.stdout.replace("table.parquet", "own.csv"),
            curves("own.csv").stdout
        );
    } else {
        let hint = "hint: build with --features parquet, or write CSV";
        assert_eq!(
            (ran.code, ran.stderr.lines().last()),
            (2, Some(hint)),
            "{ran:?}"
        );
    }
}
