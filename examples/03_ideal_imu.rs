//! From a motion profile to the samples of a perfect IMU, and what they are at rest.
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nav_sim::io::trajectory_file::load;
use nav_sim::navigation::earth::GravityModel;
use nav_sim::navigation::trajectory::ideal_imu::ideal_imu;
use std::path::Path;

pub(crate) fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("trajectories/land_vehicle.toml");
    let (trajectory, _) = load(&path, None)?;
    let samples = ideal_imu(&trajectory, 100.0, GravityModel::Wgs84)?;
    let seconds = trajectory.end_s() - trajectory.start_s();
    println!("{seconds:.0} s, {} samples", samples.len());
    let fastest = samples
        .iter()
        .map(|s| s.omega_ib_b.length())
        .fold(0.0, f64::max);
    println!("turns at up to {:.1} deg/s", fastest.to_degrees());
    // The vehicle stands at first: the accelerometers feel gravity, the gyroscopes the Earth's rotation.
    let first = samples[100];
    println!(
        "at rest |f| = {:.5} m/s², |omega| = {:.6e} rad/s",
        first.f_ib_b.length(),
        first.omega_ib_b.length()
    );
    assert!((first.f_ib_b.length() - 9.807).abs() < 2e-3);
    assert!((first.omega_ib_b.length() - 7.292_115e-5).abs() < 1e-9);
    Ok(())
}
