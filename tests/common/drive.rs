//! A directory in which `nav-sim` runs as its users run it; a drive of a minute and a noise model.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub const ROOT: &str = env!("CARGO_MANIFEST_DIR");
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_nav-sim");
pub const DRIVE: &str = "
start = { lat_deg = 46.5, lon_deg = 6.5, h_m = 400, heading_deg = 40 }
segment = [
  { kind = \"straight\", duration_s = 5 },
  { kind = \"accelerate\", to_speed_m_s = 10, duration_s = 10 },
  { kind = \"turn\", angle_deg = 90, duration_s = 10 },
  { kind = \"straight\", duration_s = 35 },
]
";
/// White noise and one Gauss-Markov bias: what the filter of 15 states carries without reduction.
pub const MODEL: &str = "
schema = 1
rate_hz = 100.0
[accel]
processes = [{ type = \"WN\", sigma2 = 5.4e-5 }, { type = \"AR1\", phi = 0.9999, sigma2 = 1e-9 }]
[gyro]
processes = [{ type = \"WN\", sigma2 = 2e-6 }, { type = \"AR1\", phi = 0.9999, sigma2 = 4e-12 }]
";
/// Records [`DRIVE`] with the errors of [`MODEL`] into `rec`.
pub const RECORD: &str = "trajectory record drive.toml imu.toml --seed 3 -o rec";

/// A temporary directory with the files of a test.
pub struct Place(tempfile::TempDir);

/// Exit code and output of a command.
#[derive(Debug)]
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

/// A directory with `drive.toml` and `imu.toml`.
pub fn place_with(drive: &str, model: &str) -> Place {
    let place = Place::new();
    place.write("drive.toml", drive);
    place.write("imu.toml", model);
    place
}

impl Place {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A directory with the data of the repository, as the examples name them.
    pub fn checkout() -> Self {
        let place = Self::new();
        for name in ["trajectories", "calib_data", "examples"] {
            std::os::unix::fs::symlink(Path::new(ROOT).join(name), place.at(name)).unwrap();
        }
        place
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    /// Writes a file and the directories that it stands in.
    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::create_dir_all(self.at(name).parent().unwrap()).unwrap();
        fs::write(self.at(name), text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.at(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    /// Rows of a CSV file below its header; a cell that is no number is NaN.
    pub fn table(&self, name: &str) -> Vec<Vec<f64>> {
        let text = self.read(name);
        let cell = |cell: &str| cell.parse().unwrap_or(f64::NAN);
        let row = |line: &str| line.split(',').map(cell).collect();
        text.lines().skip(1).map(row).collect()
    }

    /// Writes a copy of a file with its lines changed; they are counted from 0.
    pub fn edit(&self, from: &str, to: &str, line: impl Fn(usize, &str) -> String) {
        let text = self.read(from);
        let lines = text.lines().enumerate();
        self.write(
            to,
            lines.map(|(k, l)| line(k, l) + "\n").collect::<String>(),
        );
    }

    /// Names of the entries of a directory, sorted.
    pub fn entries(&self, name: &str) -> Vec<String> {
        let name_of = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let entries = fs::read_dir(self.at(name)).unwrap().map(name_of);
        let mut names: Vec<String> = entries.map(|n| n.into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs `nav-sim` as [`nav_sim`] does.
    pub fn run(&self, arguments: &str) -> Ran {
        nav_sim(self.path(), arguments)
    }

    /// Runs `nav-sim`, which must succeed.
    pub fn done(&self, arguments: &str) -> Ran {
        self.ends(arguments, 0)
    }

    /// Runs `nav-sim`, which must end with this code.
    pub fn ends(&self, arguments: &str, code: i32) -> Ran {
        let ran = self.run(arguments);
        assert_eq!(ran.code, code, "{arguments}\n{}{}", ran.stdout, ran.stderr);
        ran
    }

    /// Runs `nav-sim`, which must come to a verdict, good (exit code 0) or bad (3).
    pub fn judged(&self, arguments: &str) -> Ran {
        let ran = self.run(arguments);
        assert!(ran.code == 0 || ran.code == 3, "{arguments}\n{ran:?}");
        ran
    }

    /// The answer of a command that succeeds, as JSON.
    pub fn answer(&self, arguments: &str) -> Value {
        let ran = self.done(&format!("{arguments} --format json"));
        serde_json::from_str(&ran.stdout).unwrap()
    }

    /// Runs a line in a shell that finds this build of nav-sim.
    pub fn shell(&self, line: &str) -> Output {
        let bin = Path::new(PROGRAM).parent().unwrap().display().to_string();
        let path = format!("{bin}:{}", std::env::var("PATH").unwrap_or_default());
        let mut shell = Command::new("bash");
        shell.args(["-o", "pipefail", "-euc", line]);
        shell
            .current_dir(self.path())
            .env("PATH", path)
            .env("LC_ALL", "C");
        shell.output().unwrap()
    }
}

/// Number at a pointer into JSON.
#[track_caller]
pub fn number(value: &Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("{pointer} is no number in {value}"))
}

/// Numbers of a list at a pointer into JSON.
#[track_caller]
pub fn numbers(value: &Value, pointer: &str) -> Vec<f64> {
    let list = value.pointer(pointer).and_then(Value::as_array);
    let list = list.unwrap_or_else(|| panic!("{pointer} is no list in {value}"));
    list.iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Relative difference of two numbers.
pub fn off(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

/// Runs `nav-sim` with `--force`: results of earlier commands of a test are replaced (`tests/cli/transcripts/existing.md` has
/// that they are not without it).
pub fn nav_sim(directory: &Path, arguments: &str) -> Ran {
    plain(directory, &format!("{arguments} --force"))
}

/// Runs `nav-sim` with these arguments alone.
pub fn plain(directory: &Path, arguments: &str) -> Ran {
    let mut command = Command::new(PROGRAM);
    command
        .current_dir(directory)
        .args(arguments.split_whitespace());
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ran {
        code: output.status.code().unwrap(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

/// Runs `nav-sim`, which must succeed.
pub fn done(directory: &Path, arguments: &str) -> Ran {
    let ran = nav_sim(directory, arguments);
    assert_eq!(ran.code, 0, "{arguments}\n{}", ran.stderr);
    ran
}
