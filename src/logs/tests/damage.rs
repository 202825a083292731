//! Damaged logs: an error with its place, or what stands before the damage, and never a panic.

#![allow(clippy::unwrap_used, reason = "a test")]
#![cfg(all(
    feature = "mcap",
    feature = "bag",
    feature = "ulog",
    feature = "ubx",
    feature = "npz"
))]

use nav_sim_logs::{Content, Log, LogError, LogFault, Stamp, npz};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(
        [env!("CARGO_MANIFEST_DIR"), "tests", "data", name]
            .iter()
            .collect::<PathBuf>(),
    )
    .unwrap()
}

/// Opens a file of these bytes.
fn from_bytes<T>(
    bytes: &[u8],
    open: fn(&Path) -> Result<T, LogError>,
) -> (TempDir, Result<T, LogError>) {
    let in_memory = || tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
    let place = in_memory().unwrap();
    let path = place.path().join("log");
    std::fs::write(&path, bytes).unwrap();
    (place, open(&path))
}

fn refused(bytes: &[u8]) -> LogError {
    match from_bytes(bytes, Log::open) {
        (_, Err(error)) => error,
        (_place, Ok(log)) => {
            let imu = log.channel(Content::Imu, None).unwrap();
            log.imu(imu, Stamp::Header).unwrap_err()
        }
    }
}

/// Number of samples, the error of the cut, and the bytes before it.
fn cut(bytes: &[u8]) -> (usize, String, u64) {
    let (_place, log) = from_bytes(bytes, Log::open);
    let log = log.unwrap();
    let imu = log.channel(Content::Imu, None).unwrap();
    let count = log.imu(imu, Stamp::Header).unwrap().len();
    let damage = log.damage().unwrap();
    assert_eq!(damage.file_bytes, bytes.len() as u64);
    (count, damage.error.to_string(), damage.read_bytes)
}

/// Reads all that a log holds.
fn log(bytes: &[u8]) {
    let (_place, Ok(log)) = from_bytes(bytes, Log::open) else {
        return;
    };
    for channel in log.channels() {
        match channel.content {
            Content::Imu => _ = log.imu(channel, Stamp::Header),
            Content::Fix => _ = log.fixes(channel, Stamp::Log),
            Content::Other => {}
        }
    }
}

fn archive(bytes: &[u8]) {
    if let (_place, Ok(mut archive)) = from_bytes(bytes, npz::Archive::open) {
        let names = archive.names();
        names.iter().for_each(|name| _ = archive.read(name));
    }
}

type Reader = fn(&[u8]);
const FILES: [(&str, Reader); 18] = [
    ("ros2_zstd.mcap", log),
    ("ros2_lz4.mcap", log),
    ("ros2_indexless.mcap", log),
    ("ros2_unchunked.mcap", log),
    ("ros2_unordered.mcap", log),
    ("ros2_unordered_unchunked.mcap", log),
    ("rosbags.mcap", log),
    ("ros1.mcap", log),
    ("big_endian.mcap", log),
    ("ros1_unordered.bag", log),
    ("ros1_none.bag", log),
    ("ros1_bz2.bag", log),
    ("ros1_lz4.bag", log),
    ("ros1_two_imus.bag", log),
    ("px4.ulg", log),
    ("ublox.ubx", log),
    ("arrays.npz", archive),
    ("arrays_deflated.npz", archive),
];

/// Step between the bytes that are tried in files that are not small; odd, so that each of the four changes comes up.
const STEP: usize = 13;

fn steps(length: usize) -> impl Iterator<Item = usize> {
    (0..length).step_by(if length < 4000 { 1 } else { STEP })
}

#[test]
fn no_truncation_panics() {
    for (file, read) in FILES {
        let all = bytes(file);
        steps(all.len()).for_each(|end| read(&all[..end]));
    }
}

#[test]
fn no_single_byte_panics() {
    for (file, read) in FILES {
        let mut all = bytes(file);
        for k in steps(all.len()) {
            let was = all[k];
            all[k] = [0, 0xff, was ^ 1, was ^ 0x80][k % 4];
            read(&all);
            all[k] = was;
        }
    }
}

#[test]
fn a_truncated_file_is_read_up_to_there() {
    for file in ["ros2_unchunked.mcap", "ros2_zstd.mcap", "ros1_none.bag"] {
        let all = bytes(file);
        let mut most = 0;
        let most_of_it = all.len() * 3 / 4;
        for end in [most_of_it, most_of_it + 1, all.len() - 1] {
            let (count, error, read) = cut(&all[..end]);
            assert!(
                error.contains("cut off") || error.contains("the end is missing"),
                "{file}: {error}"
            );
            assert!(
                count > 0 && count >= most && read <= end as u64,
                "{file}: {count} samples in {end} bytes"
            );
            most = count;
        }
    }
}

#[test]
fn a_file_without_its_end_is_still_being_written() {
    let all = bytes("ros2_unchunked.mcap");
    // records: a kind, a length, a body; the magic bytes come before the first
    let mut ends = vec![8];
    while let Some(head) = all
        .get(ends[ends.len() - 1] + 1..)
        .and_then(|rest| rest.first_chunk())
    {
        ends.push(ends[ends.len() - 1] + 9 + u64::from_le_bytes(*head) as usize);
    }
    for end in &ends[4..8] {
        let log = from_bytes(&all[..*end], Log::open).1.unwrap();
        let error = &log.damage().unwrap().error;
        assert!(
            matches!(error.fault, LogFault::Cut) && error.offset == Some(*end as u64),
            "{error}"
        );
    }
    // a bag whose writer has not gone back to its start
    let mut bag = bytes("ros1_none.bag");
    let at = bag.windows(10).position(|w| w == b"index_pos=").unwrap() + 10;
    bag[at..at + 8].fill(0);
    let (count, _, read) = cut(&bag);
    assert_eq!((count, read), (12, bag.len() as u64));
}

#[test]
fn a_changed_chunk_fails_its_crc() {
    // not packed: the change is in a message, where nothing but the CRC can tell
    let mut all = bytes("ros2_indexless.mcap");
    let frame = b"imu_link";
    let places: Vec<usize> = (0..all.len() - 8)
        .filter(|k| &all[*k..k + 8] == frame)
        .collect();
    all[places[11] + 60] ^= 1;
    assert!(refused(&all).to_string().ends_with("CRC failed"));
}

#[test]
fn time_that_goes_back_is_refused() {
    // the seconds of the header of the eighth sample
    let mut all = bytes("ros2_unchunked.mcap");
    let places: Vec<usize> = (0..all.len() - 8)
        .filter(|k| &all[*k..k + 8] == b"imu_link")
        .collect();
    let seconds = places[7] - 12;
    assert_eq!(all[seconds..seconds + 4], 1_764_000_000_u32.to_le_bytes());
    all[seconds..seconds + 4].copy_from_slice(&1_763_999_999_u32.to_le_bytes());
    let error = refused(&all);
    let text = error.to_string();
    assert!(
        text.ends_with("topic /imu: time goes back from 1764000000.31 s to 1763999999.32 s"),
        "{text}"
    );
    // the arrivals are in order
    let (_place, log) = from_bytes(&all, Log::open);
    let log = log.unwrap();
    let imu = log.channel(Content::Imu, None).unwrap();
    assert_eq!(log.imu(imu, Stamp::Log).unwrap().len(), 12);
}

#[test]
fn lengths_and_encodings_are_checked_before_anything_is_unpacked() {
    let all = bytes("ros2_zstd.mcap");
    // the chunk: kind, length, two times, then the length it unpacks to
    let at = all
        .windows(8)
        .position(|w| w == [4, 0, 0, 0, b'z', b's', b't', b'd'])
        .unwrap();
    let mut large = all.clone();
    large[at - 12..at - 4].copy_from_slice(&(2_u64 << 30).to_le_bytes());
    let error = refused(&large);
    assert!(
        error
            .to_string()
            .contains(": 2147483648 bytes where at most"),
        "{error}"
    );
    let mut unknown = all;
    unknown[at + 7] = b'x';
    assert!(
        refused(&unknown)
            .to_string()
            .ends_with(": unknown encoding \"zstx\"")
    );
    assert!(matches!(
        refused(b"#ROSBAG V1.2\n").fault,
        LogFault::Encoding
    ));
    // a message of 2 GB in a file that is that long is refused, in a shorter one it is cut off
    let mut bag = bytes("ros1_none.bag");
    let at = bag
        .windows(16)
        .position(|w| w == b"compression=none")
        .unwrap();
    let size = bag[at..].windows(5).position(|w| w == b"size=").unwrap() + at + 9;
    bag[size..size + 4].copy_from_slice(&(2_u32 << 30).to_le_bytes());
    let log = from_bytes(&bag, Log::open).1.unwrap();
    let error = &log.damage().unwrap().error;
    assert!(error.to_string().contains("a record of 2147483648 bytes"));
}

#[test]
fn what_is_no_message_of_a_receiver_is_passed_over() {
    let all = bytes("ublox.ubx");
    let count = |bytes: &[u8]| {
        let (_place, log) = from_bytes(bytes, Log::open);
        let log = log.unwrap();
        let fix = log.channel(Content::Fix, None).unwrap();
        let fixes = log.fixes(fix, Stamp::Header).unwrap().len();
        let failed = log
            .channels()
            .iter()
            .find(|c| c.type_name == "checksum failed")
            .map_or(0, |c| c.messages);
        (fixes, failed)
    };
    assert_eq!(count(&all), (8, 0));
    // a start of a message that is none, just before one; a message that is cut off
    let noise = [
        b"\xb5\x62\xb5\x62\x01",
        all.as_slice(),
        b"\xb5\x62\x01\x07\x5c\0\x01",
    ]
    .concat();
    assert_eq!(count(&noise).0, 8);
    let mut changed = all;
    let first = changed
        .windows(4)
        .position(|w| w == [0xb5, 0x62, 1, 7])
        .unwrap();
    changed[first + 40] ^= 1;
    assert_eq!(count(&changed), (7, 1));
}
