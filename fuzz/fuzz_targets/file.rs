//! Bytes as a file of a certain ending, read as a recording.

use nav_sim::formats::recordings::{self, ReadOptions};
use std::cell::OnceCell;
use std::path::PathBuf;
use tempfile::TempDir;

thread_local! {
    static PLACE: OnceCell<TempDir> = const { OnceCell::new() };
}

/// The file with these bytes.
pub fn file(bytes: &[u8], name: &str) -> PathBuf {
    PLACE.with(|place| {
        let place = place.get_or_init(|| tempfile::tempdir_in("/dev/shm").expect("a directory"));
        let path = place.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        path
    })
}

/// Reads a recording without a time column as one of 100 Hz.
pub fn recording(bytes: &[u8], name: &str) {
    let options = ReadOptions { rate_hz: Some(100.0), ..ReadOptions::default() };
    _ = recordings::read(&[file(bytes, name)], &options);
}
