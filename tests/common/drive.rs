//! A drive of a minute, a noise model, and the program as a user runs it.

use std::path::Path;
use std::process::Command;

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

/// A directory with `drive.toml` and `imu.toml`.
pub fn place_with(drive: &str, model: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("drive.toml"), drive).unwrap();
    std::fs::write(directory.path().join("imu.toml"), model).unwrap();
    directory
}

pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

/// With `--force`: what earlier commands of a test left is replaced (that it is refused otherwise: tests/cli/existing.rs).
pub fn nav_sim(directory: &Path, arguments: &str) -> Ran {
    plain(directory, &format!("{arguments} --force"))
}

/// As written.
pub fn plain(directory: &Path, arguments: &str) -> Ran {
    let output = Command::new(env!("CARGO_BIN_EXE_nav-sim"))
        .current_dir(directory)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ran {
        code: output.status.code().unwrap(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

/// It must have succeeded.
pub fn done(directory: &Path, arguments: &str) -> Ran {
    let ran = nav_sim(directory, arguments);
    assert_eq!(ran.code, 0, "{arguments}\n{}", ran.stderr);
    ran
}
