//! Trajectories as CSV.

use crate::io::Failure;
use crate::io::atomic::AtomicFile;
use flate2::{Compression, write::GzEncoder};
use nav_sim_navigation::frames::{RollPitchYaw, wrap_angle};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::units::DEG;
use std::io::{self, Write};
use std::path::Path;

/// Which instants become rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rows {
    /// Evenly spaced ones, from the start (Hz).
    Rate(f64),
    /// Those the trajectory was made from.
    Knots,
}

impl Rows {
    fn times(self, trajectory: &Trajectory) -> Vec<f64> {
        match self {
            Self::Knots => trajectory.knots().to_vec(),
            Self::Rate(rate_hz) => {
                let start_s = trajectory.start_s();
                let steps = ((trajectory.end_s() - start_s) * rate_hz + 1e-6).floor() as u64;
                (0..=steps).map(|k| start_s + k as f64 / rate_hz).collect()
            }
        }
    }
}

/// Writes a trajectory as CSV, packed when the name ends in `.gz`. Positions are written with the digits
/// that read back to them, since accelerations are their second differences; times to the nanosecond,
/// velocities to 1e-9 m/s, angles to 1e-12 degrees.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_csv(path: &Path, trajectory: &Trajectory, rows: Rows) -> Result<(), Failure> {
    let mut file = AtomicFile::create(path)?;
    let io = |e| Failure::io(path, e);
    if path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("gz"))
    {
        let mut packed = GzEncoder::new(&mut file, Compression::default());
        write_rows(&mut packed, trajectory, rows).map_err(io)?;
        packed.finish().map_err(io)?;
    } else {
        write_rows(&mut file, trajectory, rows).map_err(io)?;
    }
    file.commit()
}

/// Writes the header and the rows.
///
/// # Errors
/// What the system says.
pub(crate) fn write_rows(
    out: &mut impl Write,
    trajectory: &Trajectory,
    rows: Rows,
) -> io::Result<()> {
    writeln!(
        out,
        "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg"
    )?;
    for t_s in rows.times(trajectory) {
        let state = trajectory.state(t_s);
        let (v, rpy) = (state.v_n, RollPitchYaw::from_quat(state.q_b_n));
        let (roll, pitch, yaw) = (rpy.roll / DEG, rpy.pitch / DEG, rpy.yaw / DEG);
        writeln!(
            out,
            "{},{},{},{},{},{},{},{},{},{}",
            tidy(t_s, 9),
            state.lat / DEG + 0.0,
            wrap_angle(state.lon) / DEG + 0.0,
            state.h + 0.0,
            tidy(v.x, 9),
            tidy(v.y, 9),
            tidy(v.z, 9),
            tidy(roll, 12),
            tidy(pitch, 12),
            tidy(yaw, 12)
        )?;
    }
    Ok(())
}

/// The nearest number of so many decimals; no negative zero.
fn tidy(x: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (x * scale).round() / scale + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_tidy() {
        let shown =
            [-0.0, 0.1 + 0.2, -1e-14, 45.000_000_000_000_01].map(|x| tidy(x, 9).to_string());
        assert_eq!(shown, ["0", "0.3", "0", "45"]);
    }
}
