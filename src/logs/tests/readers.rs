//! Logs of independent writers (tests/data/README.md): the samples are those that independent readers find.

#![allow(clippy::unwrap_used, reason = "a test")]
#![cfg(all(
    feature = "mcap",
    feature = "bag",
    feature = "ulog",
    feature = "ubx",
    feature = "npz"
))]

use nav_sim_logs::{
    Clock, Content, ImuReading, Log, LogFault, LogFix, LogFormat, Stamp, npz, recognise,
};
use std::path::PathBuf;

fn path(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "data", name]
        .iter()
        .collect()
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(path(name)).unwrap()
}

fn open(name: &str) -> Log {
    Log::open(&path(name)).unwrap()
}

/// Stamps and values of a topic.
fn rows(log: &Log, topic: &str, stamp: Stamp) -> Vec<(i64, Vec<f64>)> {
    let of_sample = |s: ImuReading| (s.stamp_ns, [s.accel_m_s2, s.gyro_rad_s].concat());
    let of_fix = |f: LogFix| {
        let triads = [f.sd_ned_m, f.v_ned_m_s, f.sd_v_ned_m_s]
            .into_iter()
            .flatten()
            .flatten();
        (
            f.stamp_ns,
            [f.lat_deg, f.lon_deg, f.h_m]
                .into_iter()
                .chain(triads)
                .collect(),
        )
    };
    let channel = log.channels().iter().find(|c| c.topic == topic).unwrap();
    match channel.content {
        Content::Imu => {
            let samples = log.imu(channel, stamp).unwrap();
            samples.into_iter().map(of_sample).collect()
        }
        _ => {
            let fixes = log.fixes(channel, stamp).unwrap();
            fixes.into_iter().map(of_fix).collect()
        }
    }
}

#[test]
fn samples_are_those_of_independent_readers() {
    let expected = std::fs::read_to_string(path("expected.csv")).unwrap();
    assert_eq!(expected.lines().count(), 35);
    for line in expected.lines() {
        let cells: Vec<&str> = line.split(',').collect();
        let [file, topic, count, first, last] = cells[..5] else {
            panic!("{line}")
        };
        let rows = rows(&open(file), topic, Stamp::Header);
        let integers = [rows.len() as i64, rows[0].0, rows[rows.len() - 1].0];
        assert_eq!(
            integers.map(|i| i.to_string()),
            [count, first, last],
            "{line}"
        );
        assert_eq!(rows[0].1.len(), cells.len() - 5, "{line}");
        for (column, cell) in cells[5..].iter().enumerate() {
            let (sum, expected) = (
                rows.iter().map(|r| r.1[column]).sum::<f64>(),
                cell.parse::<f64>().unwrap(),
            );
            // a sum of n numbers of which none exceeds M is rounded by n²·M·ε at most, in either order
            let largest = rows.iter().map(|r| r.1[column].abs()).fold(0.0, f64::max);
            let bound = 2.0 * (rows.len() * rows.len()) as f64 * largest * f64::EPSILON;
            assert!(
                (sum - expected).abs() <= bound,
                "{line}: column {column} sums to {sum}"
            );
        }
    }
}

#[test]
fn counts_and_times_are_known_before_reading() {
    for (file, messages) in [
        ("ros2_zstd.mcap", 40),
        ("ros2_indexless.mcap", 12),
        ("ros1_lz4.bag", 40),
    ] {
        let log = open(file);
        let imu = log.channels().iter().find(|c| c.topic == "/imu").unwrap();
        assert_eq!(
            (imu.content, imu.messages, imu.clock),
            (Content::Imu, messages, Clock::Unix)
        );
        // arrivals are 3 ms late
        let first_ns = 1_764_000_000_253_000_000;
        assert_eq!(
            (imu.first_ns, imu.last_ns),
            (
                Some(first_ns),
                Some(first_ns + (messages as i64 - 1) * 10_000_000)
            )
        );
        let note = log.channels().iter().find(|c| c.topic == "/note").unwrap();
        assert_eq!(
            (note.content, note.type_name.ends_with("/String")),
            (Content::Other, true)
        );
    }
}

#[test]
fn arrivals_are_3_ms_after_the_headers() {
    for file in [
        "ros2_zstd.mcap",
        "ros2_unordered.mcap",
        "ros2_unordered_unchunked.mcap",
        "ros1_unordered.bag",
    ] {
        let [header, log] =
            [Stamp::Header, Stamp::Log].map(|stamp| rows(&open(file), "/imu", stamp));
        assert!(
            header.iter().zip(&log).all(|(h, l)| l.0 - h.0 == 3_000_000),
            "{file}"
        );
    }
}

#[test]
fn the_topic_is_named_where_there_are_several() {
    let log = open("ros1_two_imus.bag");
    let error = log.channel(Content::Imu, None).unwrap_err();
    assert_eq!(
        error.to_string(),
        "2 topics have IMU samples: /imu, /imu_rear"
    );
    let rear = log.channel(Content::Imu, Some("/imu_rear")).unwrap();
    assert_eq!(log.imu(rear, Stamp::Header).unwrap().len(), 16);
    let error = log.channel(Content::Imu, Some("/fix")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "no topic has IMU samples and the name /fix; there are /imu, /imu_rear"
    );
    // what an autopilot fuses goes before its single sensors
    let px4 = open("px4.ulg");
    let topic = |content| px4.channel(content, None).unwrap().topic.as_str();
    assert_eq!(topic(Content::Imu), "sensor_combined");
    assert_eq!(topic(Content::Fix), "vehicle_gps_position");
}

#[test]
fn arrays_are_those_that_were_written() {
    for file in ["arrays.npz", "arrays_deflated.npz"] {
        let mut archive = npz::Archive::open(&path(file)).unwrap();
        assert_eq!(
            archive.names(),
            ["t_ns", "gyro", "accel", "flag", "cube", "name"]
        );
        let gyro = archive.read("gyro").unwrap();
        assert_eq!(gyro.shape, [40, 3]);
        let rate_x = |k: usize| 0.1 * (k as f64 / 3.0).sin();
        assert!(
            (0..40).all(|k| (gyro.values[3 * k] - rate_x(k)).abs() < 1e-16),
            "{file}"
        );
        // single precision, big-endian, columns first
        let accel = archive.read("accel").unwrap();
        assert!(
            (0..40).all(
                |k| (accel.values[3 * k + 2] - 9.8 - 0.01 * (7.0 * k as f64).sin()).abs() < 1e-6
            )
        );
        let cube = archive.read("cube").unwrap();
        assert_eq!(
            (cube.shape, cube.values),
            (vec![2, 3, 4], (0..24).map(f64::from).collect())
        );
        assert_eq!(archive.read("flag").unwrap().values, [1.0, 0.0]);
        let fault = |name: &str, archive: &mut npz::Archive| archive.read(name).unwrap_err().fault;
        assert!(matches!(fault("name", &mut archive), LogFault::Encoding));
        assert!(matches!(fault("mag", &mut archive), LogFault::Topic));
    }
}

#[test]
fn formats_are_told_by_their_first_bytes() {
    let kind = |name: &str| recognise(&bytes(name));
    assert_eq!(kind("rosbags.mcap"), Some(LogFormat::Mcap));
    assert_eq!(kind("ros1_bz2.bag"), Some(LogFormat::Bag));
    assert_eq!(kind("px4.ulg"), Some(LogFormat::Ulog));
    // sentences come first
    assert_eq!(kind("ublox.ubx"), Some(LogFormat::Ubx));
    assert_eq!(kind("arrays.npz"), Some(LogFormat::Npz));
    let rinex = format!(
        "{:<60}RINEX VERSION / TYPE\n",
        "     3.04           OBSERVATION DATA    M"
    );
    let zip = b"PK\x03\x04\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x07\0\0\0imu.csv";
    let not_read: [(&[u8], &str); 9] = [
        (b"SQLite format 3\0", "a SQLite database"),
        (
            b"\xa3\x95\x80\x80\x59FMT\0BBnNZ",
            "an ArduPilot DataFlash log",
        ),
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "a MATLAB .mat"),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "an HDF5 file"),
        (b"\x89HDF\r\n\x1a\n\0\0", "an HDF5 file"),
        (b"\xfa\xff\x0c\x04", "an Xsens .mtb log"),
        (b"$@\x34\x12\xa7\x0f\x60\0", "a Septentrio SBF log"),
        (rinex.as_bytes(), "a RINEX file"),
        (zip, "a zip archive"),
    ];
    for (head, name) in not_read {
        let kind = recognise(head).unwrap();
        assert!(kind.name().starts_with(name), "{}", kind.name());
        let place = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(place.path(), head).unwrap();
        let error = Log::open(place.path()).unwrap_err();
        assert!(matches!(error.fault, LogFault::NotRead(k) if k == kind));
        assert_eq!(error.hint(), kind.conversion());
        assert!(error.hint().is_some());
    }
    assert_eq!(recognise(b"t_s,accel_x_m_s2\n0,1\n"), None);
    assert_eq!(recognise(b""), None);
}
