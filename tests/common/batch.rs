//! A study of 50 units of a few milliseconds, and how to run parts of it.

#[path = "drive.rs"]
mod drive;

pub use drive::MODEL;
use drive::{DRIVE, place_with};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// Five cells of ten units; two columns.
pub const STUDY: &str = "
runs = 77
unit_runs = 8
seed = 5
metrics = [\"outages\", \"ratios\", \"epochs\"]
trajectory = [{ file = \"drive.toml\" }]
truth = [{ model = \"imu.toml\" }]
candidate = [{ model = \"imu.toml\" }, { name = \"wrong\", model = \"wrong.toml\" }]
outages = [{ sweep = { start_s = 30, duration_s = [2, 4, 8, 16] } }, { name = \"none\", windows = [] }]
";
pub const UNITS: usize = 50;

/// A directory with the study and what it needs.
pub fn place() -> tempfile::TempDir {
    let dir = place_with(DRIVE, MODEL);
    std::fs::write(dir.path().join("study.toml"), STUDY).unwrap();
    std::fs::write(
        dir.path().join("wrong.toml"),
        MODEL.replace("4e-12", "4e-13"),
    )
    .unwrap();
    dir
}

/// `nav-sim batch …` in a directory.
pub fn command(dir: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_nav-sim"));
    command
        .current_dir(dir)
        .arg("batch")
        .args(arguments.split_whitespace());
    for variable in [
        "HQ_TASK_ID",
        "SLURM_ARRAY_TASK_ID",
        "PBS_ARRAY_INDEX",
        "JOB_COMPLETION_INDEX",
    ] {
        command.env_remove(variable);
    }
    command
}

pub fn batch(dir: &Path, arguments: &str) -> Output {
    command(dir, arguments).output().unwrap()
}

/// What it said; it must have succeeded.
pub fn done(dir: &Path, arguments: &str) -> String {
    let output = batch(dir, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success(),
        "{arguments}: {:?}\n{said}",
        output.status
    );
    said
}

/// What it said; it must have ended with this code.
pub fn refused(dir: &Path, arguments: &str, code: i32) -> String {
    let output = batch(dir, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments}\n{said}");
    said
}

pub fn spawn(dir: &Path, arguments: &str) -> Child {
    let mut command = command(dir, arguments);
    command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Every merged file with its bytes.
pub fn results(dir: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(dir.join("results")).unwrap();
    let mut files: Vec<(String, Vec<u8>)> = entries
        .map(|e| e.unwrap().path())
        .map(|p| {
            (
                p.file_name().unwrap().to_string_lossy().into_owned(),
                std::fs::read(&p).unwrap(),
            )
        })
        .collect();
    files.sort();
    files
}

/// The unit files of a study directory.
pub fn units(dir: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(dir.join("units")) else {
        return Vec::new();
    };
    let inner = entries
        .flatten()
        .flat_map(|e| std::fs::read_dir(e.path()).unwrap().flatten());
    let mut files: Vec<PathBuf> = inner
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "unit"))
        .collect();
    files.sort();
    files
}
