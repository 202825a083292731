//! Entries for fuzzing: each reads what a file holds as its command does, and must not panic. `tests/fuzz` runs them from a
//! small corpus with a fixed seed, `fuzz/` at length.

use crate::commands::batch::{Study, part_of};
use crate::commands::run::directory as run_directory;
use crate::io::recordings::ReadOptions;
use crate::io::trajectory_file::{self, Options};
use crate::io::{contamination_file, curve_file, datasheet, draws_file, fusion_files, model_file};
use crate::io::{recordings, scenario_file};
use nav_sim_navigation::gnss::FixSigma;
use std::cell::OnceCell;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// A reader under the name of its corpus.
pub type Target = (&'static str, fn(&[u8]));

/// All readers: recordings, drives, trajectories, then the program's own files.
pub const TARGETS: [Target; 29] = [
    ("recording_csv", |bytes| {
        recording("recording_csv", "a.csv", bytes)
    }),
    ("recording_gz", |bytes| {
        recording("recording_gz", "a.csv.gz", bytes)
    }),
    ("recording_npy", |bytes| {
        recording("recording_npy", "a.npy", bytes)
    }),
    ("mcap", nav_sim_logs_fuzz::mcap),
    ("bag", nav_sim_logs_fuzz::bag),
    ("ulog", nav_sim_logs_fuzz::ulog),
    ("ubx", nav_sim_logs_fuzz::ubx),
    ("npz", nav_sim_logs_fuzz::npz),
    ("imu", |bytes| {
        _ = fusion_files::read_imu(&written("imu", "a.csv", bytes), None, None)
    }),
    ("imu_kf_gins", |bytes| {
        _ = fusion_files::read_imu(&written("imu_kf_gins", "a.txt", bytes), None, None)
    }),
    ("fixes", |bytes| fixes("fixes", "a.csv", bytes)),
    ("fixes_kf_gins", |bytes| {
        fixes("fixes_kf_gins", "a.txt", bytes)
    }),
    ("nmea", |bytes| fixes("nmea", "a.nmea", bytes)),
    ("rtklib", |bytes| fixes("rtklib", "a.pos", bytes)),
    ("initial", |bytes| {
        _ = fusion_files::read_initial(&written("initial", "a.toml", bytes))
    }),
    ("trajectory", |bytes| {
        trajectory("trajectory", "a.csv", bytes)
    }),
    ("tum", |bytes| trajectory("tum", "a.tum", bytes)),
    ("kf_gins", |bytes| trajectory("kf_gins", "a.nav", bytes)),
    ("gpx", |bytes| trajectory("gpx", "a.gpx", bytes)),
    ("motion", |bytes| trajectory("motion", "a.toml", bytes)),
    ("model", |bytes| {
        _ = model_file::read(&written("model", "a.toml", bytes))
    }),
    ("datasheet", |bytes| {
        _ = datasheet::read(&written("datasheet", "a.toml", bytes))
    }),
    ("contamination", contamination),
    ("scenario", |bytes| {
        _ = scenario_file::read(&written("scenario", "a.toml", bytes))
    }),
    ("study", |bytes| {
        let path = written("study", "a.toml", bytes);
        _ = Study::read(&path, &[]).and_then(|study| study.cells(std::path::Path::new("")));
    }),
    ("part", part),
    ("curves", |bytes| {
        _ = curve_file::read(&written("curves", "a.json", bytes))
    }),
    ("draws", draws),
    ("manifest", |bytes| {
        _ = run_directory::read(&directory("manifest", "manifest.json", bytes))
    }),
];

#[cfg(all(
    feature = "mcap",
    feature = "bag",
    feature = "ulog",
    feature = "ubx",
    feature = "npz"
))]
use nav_sim_logs::fuzz as nav_sim_logs_fuzz;

/// Formats that this build does not read.
#[cfg(not(all(
    feature = "mcap",
    feature = "bag",
    feature = "ulog",
    feature = "ubx",
    feature = "npz"
)))]
mod nav_sim_logs_fuzz {
    pub(super) fn mcap(_: &[u8]) {}
    pub(super) use mcap as bag;
    pub(super) use mcap as ulog;
    pub(super) use mcap as ubx;
    pub(super) use mcap as npz;
}

/// The reader of a name.
///
/// # Panics
/// When there is none.
#[must_use]
pub fn target(name: &str) -> fn(&[u8]) {
    TARGETS
        .iter()
        .find(|(known, _)| *known == name)
        .expect("a target of that name")
        .1
}

thread_local! {
    static PLACE: OnceCell<TempDir> = const { OnceCell::new() };
}

/// The file of a target, with these bytes: in memory where the system has such a place.
fn written(target: &str, name: &str, bytes: &[u8]) -> PathBuf {
    PLACE.with(|place| {
        let in_memory = || tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
        let directory = place
            .get_or_init(|| in_memory().expect("a directory"))
            .path()
            .join(target);
        fs::create_dir_all(&directory).expect("a directory");
        let path = directory.join(name);
        fs::write(&path, bytes).expect("a file");
        path
    })
}

/// The same, as its directory.
fn directory(target: &str, name: &str, bytes: &[u8]) -> PathBuf {
    let mut path = written(target, name, bytes);
    path.pop();
    path
}

/// A recording without a time column is one of 100 Hz.
fn recording(target: &str, name: &str, bytes: &[u8]) {
    let options = ReadOptions {
        rate_hz: Some(100.0),
        ..ReadOptions::default()
    };
    _ = recordings::read(&[written(target, name, bytes)], &options);
}

/// Fixes that state no deviations have one of 3 m.
fn fixes(target: &str, name: &str, bytes: &[u8]) {
    let sigma = FixSigma {
        pos_m: [3.0; 3],
        vel_m_s: None,
    };
    _ = fusion_files::read_gnss(
        &written(target, name, bytes),
        Some(&sigma),
        Some((0.0, 100.0)),
        None,
    );
}

/// To drive along, and to compare with.
fn trajectory(target: &str, name: &str, bytes: &[u8]) {
    let path = written(target, name, bytes);
    let options = Options {
        origin: Some([0.8, 0.1, 400.0]),
    };
    _ = trajectory_file::load(&path, &options);
    _ = trajectory_file::load_reference(&path, &options);
}

fn contamination(bytes: &[u8]) {
    let path = written("contamination", "a.toml", bytes);
    _ = contamination_file::find(&path.display().to_string(), 100.0);
}

/// As read, and with a checksum that is right, so that more than the checksum is tried.
fn part(bytes: &[u8]) {
    _ = part_of(bytes);
    _ = part_of(&[bytes, blake3::hash(bytes).as_bytes()].concat());
}

/// The draws beside a model.
fn draws(bytes: &[u8]) {
    let path = written("draws", "a.draws.json", bytes).with_file_name("a.toml");
    _ = draws_file::read(&path);
}
