//! Entries for fuzzing: each reads what a file holds as its command does, and must not panic. `tests/fuzz` runs them from a
//! small corpus with a fixed seed, `fuzz/` at length.

use crate::commands::batch::{Study, part_of};
use crate::commands::run::directory as run_directory;
use crate::io::recordings::ReadOptions;
use crate::io::trajectory_file;
use crate::io::{contamination_file, curve_file, datasheet, draws_file, fusion_files, model_file};
use crate::io::{recordings, scenario_file};
use nav_sim_logs::{Content, Log, Stamp};
use nav_sim_navigation::gnss::FixSigma;
use std::cell::OnceCell;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A reader: the name of its corpus, the name of its file, and the function.
pub type Target = (&'static str, &'static str, fn(&Path));

/// All readers: recordings, drives, trajectories, then the program's own files.
pub const TARGETS: [Target; 30] = [
    ("recording_csv", "a.csv", recording),
    ("recording_gz", "a.csv.gz", recording),
    ("recording_npy", "a.npy", recording),
    ("npz", "a.npz", recording),
    ("mcap", "a.mcap", log),
    ("bag", "a.bag", log),
    ("ulog", "a.ulg", log),
    ("ubx", "a.ubx", log),
    ("imu", "a.csv", imu),
    ("imu_kf_gins", "a.txt", imu),
    ("fixes", "a.csv", fixes),
    ("fixes_kf_gins", "a.txt", fixes),
    ("nmea", "a.nmea", fixes),
    ("rtklib", "a.pos", fixes),
    ("initial", "a.toml", |path| {
        _ = fusion_files::read_initial(path)
    }),
    ("trajectory", "a.csv", trajectory),
    ("tum", "a.tum", trajectory),
    ("kf_gins", "a.nav", trajectory),
    ("gpx", "a.gpx", trajectory),
    ("motion", "a.toml", trajectory),
    ("model", "a.toml", |path| _ = model_file::read(path)),
    ("datasheet", "a.toml", |path| _ = datasheet::read(path)),
    ("figures", "a.yaml", |path| {
        _ = datasheet::measured(path, Some(100.0))
    }),
    ("contamination", "a.toml", |path| {
        _ = contamination_file::find(&path.display().to_string(), 100.0)
    }),
    ("scenario", "a.toml", |path| _ = scenario_file::read(path)),
    ("study", "a.toml", |path| {
        _ = Study::read(path, &[]).and_then(|study| study.cells(Path::new("")));
    }),
    ("part", "a.part", part),
    ("curves", "a.json", |path| _ = curve_file::read(path)),
    ("draws", "a.draws.json", |path| {
        _ = draws_file::read(&path.with_file_name("a.toml"))
    }),
    ("manifest", "manifest.json", |path| {
        _ = run_directory::read(path.parent().expect("a directory"))
    }),
];

thread_local! {
    static PLACE: OnceCell<TempDir> = const { OnceCell::new() };
}

/// Reads bytes as the file of a target: in memory where the system has such a place.
///
/// # Panics
/// When there is no target of that name.
pub fn read(target: &str, bytes: &[u8]) {
    let mut targets = TARGETS.into_iter();
    let found = targets.find(|(name, ..)| *name == target);
    let (_, name, read) = found.expect("target");
    PLACE.with(|place| {
        let in_memory = || tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
        let place = place.get_or_init(|| in_memory().expect("a directory"));
        let directory = place.path().join(target);
        fs::create_dir_all(&directory).expect("a directory");
        let path = directory.join(name);
        fs::write(&path, bytes).expect("a file");
        read(&path);
    });
}

/// A recording without a time column is one of 100 Hz.
fn recording(path: &Path) {
    let options = ReadOptions {
        rate_hz: Some(100.0),
        ..ReadOptions::default()
    };
    _ = recordings::read(&[path.to_owned()], &options);
}

fn log(path: &Path) {
    let Ok(log) = Log::open(path) else { return };
    for channel in log.channels() {
        match channel.content {
            Content::Imu => _ = log.imu(channel, Stamp::Header),
            Content::Fix => _ = log.fixes(channel, Stamp::Log),
            Content::Other => {}
        }
    }
}

fn imu(path: &Path) {
    _ = fusion_files::read_imu(path, None, None);
}

/// Fixes that state no deviations have one of 3 m.
fn fixes(path: &Path) {
    let sigma = FixSigma {
        pos_m: [3.0; 3],
        vel_m_s: None,
    };
    _ = fusion_files::read_gnss(path, Some(&sigma), Some((0.0, 100.0)), None);
}

/// To drive along, and to compare with.
fn trajectory(path: &Path) {
    let origin = Some([0.8, 0.1, 400.0]);
    _ = trajectory_file::load(path, origin);
    _ = trajectory_file::load_reference(path, None);
}

/// Tests the file as read, and with a corrected checksum, so that more than the checksum is tried.
fn part(path: &Path) {
    let bytes = fs::read(path).expect("a file");
    _ = part_of(&bytes);
    _ = part_of(&[&bytes, &blake3::hash(&bytes).as_bytes()[..]].concat());
}
