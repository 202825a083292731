//! A study of eight cells of a few milliseconds, and how to run parts of it.

use super::drive::*;
use std::path::Path;
use std::process::{Child, Command, Stdio};

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

/// A directory with the study and the files that it names.
pub fn place() -> Place {
    let place = place_with(DRIVE, MODEL);
    place.write("study.toml", STUDY);
    place.write("wrong.toml", MODEL.replace("4e-12", "4e-13"));
    place
}

/// Returns a `nav-sim` command in a directory, on no scheduler.
pub fn command(dir: &Path, arguments: &str) -> Command {
    let mut command = Command::new(PROGRAM);
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

/// Runs a command, and returns its exit code and its errors.
pub fn ran(dir: &Path, arguments: &str) -> (i32, String) {
    let output = command(dir, arguments).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code().unwrap(), errors)
}

/// Runs a command that must end with this code, and returns its errors.
pub fn ended(dir: &Path, arguments: &str, code: i32) -> String {
    let (ended, errors) = ran(dir, arguments);
    assert_eq!(ended, code, "{arguments}\n{errors}");
    errors
}

pub fn spawn(dir: &Path, arguments: &str) -> Child {
    let mut command = command(dir, arguments);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Results and the tables of cells of a study directory, by name.
pub fn results(place: &Place, study: &str) -> Vec<(String, String)> {
    let mut files = ["results.csv", "summary.json", "report.html"]
        .map(str::to_owned)
        .to_vec();
    for cell in cells(place, study) {
        files.extend(["epochs.csv", "runs.csv"].map(|name| format!("cells/{cell}/{name}")));
    }
    let read = |name: String| (name.clone(), place.read(&format!("{study}/{name}")));
    files.into_iter().map(read).collect()
}

/// Names of the finished cells of a study directory, sorted.
pub fn cells(place: &Place, study: &str) -> Vec<String> {
    let cells = format!("{study}/cells");
    if !place.at(&cells).exists() {
        return Vec::new();
    }
    let mut names = place.entries(&cells);
    names.retain(|name| place.at(&format!("{cells}/{name}/manifest.json")).exists());
    names
}
