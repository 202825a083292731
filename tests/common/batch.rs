//! A study of eight cells of a few milliseconds, and how to run parts of it.

#[path = "drive.rs"]
mod drive;

pub use drive::MODEL;
use drive::{DRIVE, place_with};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// Four units of two cells.
pub const STUDY: &str = "
[run]
trajectory = \"drive.toml\"
truth = \"imu.toml\"
outage = [\"30:+{length_s}\"]
runs = 77
seed = 5
[vary]
length_s = [2, 4, 8, 16]
[vary.model]
imu = { model = \"imu.toml\" }
wrong = { model = \"wrong.toml\" }
";
pub const CELLS: usize = 8;

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

/// `nav-sim …` in a directory.
pub fn command(dir: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_nav-sim"));
    command.current_dir(dir).args(arguments.split_whitespace());
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

/// The exit code and what it said.
pub fn ran(dir: &Path, arguments: &str) -> (i32, String) {
    let Output { status, stderr, .. } = command(dir, arguments).output().unwrap();
    (
        status.code().unwrap(),
        String::from_utf8_lossy(&stderr).into_owned(),
    )
}

/// What it said; it must have ended with this code.
pub fn ended(dir: &Path, arguments: &str, code: i32) -> String {
    let (ended, said) = ran(dir, arguments);
    assert_eq!(ended, code, "{arguments}\n{said}");
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

/// Results and the tables of cells, with their bytes.
pub fn results(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = ["results.csv", "summary.json", "report.html"]
        .map(|name| dir.join(name))
        .to_vec();
    for cell in cells(dir) {
        files.extend(["epochs.csv", "runs.csv"].map(|name| cell.join(name)));
    }
    let of_file = |path: PathBuf| {
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        (path.strip_prefix(dir).unwrap().to_owned(), bytes)
    };
    files.into_iter().map(of_file).collect()
}

/// The finished cells of a study directory.
pub fn cells(dir: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir.join("cells"))
        .into_iter()
        .flatten()
        .flatten();
    let mut cells: Vec<PathBuf> = entries
        .map(|e| e.path())
        .filter(|path| path.join("manifest.json").exists())
        .collect();
    cells.sort();
    cells
}
