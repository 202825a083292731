//! Drives, models and laws that several of these tests need.

use crate::common::drive::{MODEL, place_with};
use nav_sim::io::{model_file, trajectory_file};
use nav_sim::navigation::fusion::DriveData;
use nav_sim::navigation::sensors::outage::Outage;
use nav_sim::navigation::simulation::SimulatedRecording;
use nav_sim::navigation::trajectory::Trajectory;
use nav_sim::signal::noise::{Composite, Model, Process};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::path::{Path, PathBuf};

pub(crate) fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A trajectory that is shipped.
pub(crate) fn shipped(name: &str) -> Trajectory {
    let path = root("trajectories").join(format!("{name}.toml"));
    let (trajectory, warnings) = trajectory_file::load(&path, None).unwrap();
    assert!(warnings.is_empty(), "{name}: {warnings:?}");
    trajectory
}

/// The model of a virtual IMU that is shipped, or of the examples.
pub(crate) fn shipped_model(path: &str) -> Model {
    model_file::read(&root(path)).unwrap().model
}

/// A drive at 46° of latitude of segments as files have them, with ramps of a second.
pub(crate) fn drive(speed_m_s: f64, segments: &str) -> Trajectory {
    let start = "lat_deg = 46, lon_deg = 6, h_m = 300, heading_deg = 40";
    let text = format!(
        "start = {{ {start}, speed_m_s = {speed_m_s} }}\nvehicle = {{ ramp_s = 1 }}\nsegment = [{segments}]"
    );
    let place = place_with(&text, MODEL);
    trajectory_file::load(&place.path().join("drive.toml"), None)
        .unwrap()
        .0
}

pub(crate) fn stands(seconds: f64) -> Trajectory {
    drive(
        0.0,
        &format!("{{ kind = 'straight', duration_s = {seconds} }}"),
    )
}

/// Blocks of town traffic of three quarters of a minute each.
pub(crate) fn town(blocks: usize) -> Trajectory {
    let block = "{ kind = 'accelerate', to_speed_m_s = 14, duration_s = 10 },
        { kind = 'straight', duration_s = 14 },
        { kind = 'turn', angle_deg = 90, duration_s = 9 },
        { kind = 'accelerate', to_speed_m_s = 6, duration_s = 10 },
        { kind = 'turn', angle_deg = -60, duration_s = 9 },";
    drive(0.0, &block.repeat(blocks))
}

pub(crate) fn outage(start_s: f64, end_s: f64) -> Outage {
    Outage { start_s, end_s }
}

/// White noise and Gauss-Markov processes of (standard deviation, correlation time in s), at 100 Hz.
pub(crate) fn gauss_markov(white: f64, biases: &[(f64, f64)]) -> Composite {
    let bias = |(s, t_s): &(f64, f64)| Process::gauss_markov(1.0 / t_s, s * s, 100.0).unwrap();
    let white = Process::white(white).unwrap();
    Composite::new(
        std::iter::once(white)
            .chain(biases.iter().map(bias))
            .collect(),
    )
}

pub(crate) fn white_and_walk(white: f64, walk: f64) -> Composite {
    let walk = Process::random_walk(walk).unwrap();
    Composite::new(vec![Process::white(white).unwrap(), walk])
}

pub(crate) fn white(sigma2: f64) -> Composite {
    Composite::new(vec![Process::white(sigma2).unwrap()])
}

/// A recording without what the vehicle knows.
pub(crate) fn data(recording: &SimulatedRecording) -> DriveData<'_> {
    DriveData {
        imu: &recording.imu,
        gnss: &recording.gnss,
        aids: &[],
    }
}

/// Probability of a sum of squares as far out as this one, on either side.
pub(crate) fn two_sided(sum: f64, dof: f64) -> f64 {
    let p = ChiSquared::new(dof).unwrap().cdf(sum);
    2.0 * p.min(1.0 - p)
}

/// A sum of squares is chi-square of so many degrees (1e-4 on either side).
#[track_caller]
pub(crate) fn inside(sum: f64, dof: f64) {
    let p = two_sided(sum, dof);
    assert!(p >= 2e-4, "{sum} of {dof} degrees: p = {p}");
}
