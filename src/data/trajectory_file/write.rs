//! Trajectories as CSV.

use crate::data::atomic::{AtomicFile, WriteError};
use crate::frames::RollPitchYaw;
use crate::trajectory::Trajectory;
use crate::units::DEG;
use flate2::{Compression, write::GzEncoder};
use std::io::{self, Write};
use std::path::Path;

/// Which instants become rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rows {
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

/// Writes a trajectory as CSV, packed when the name ends in `.gz`. Every number is written with the digits
/// that read back to it, so that the same trajectory comes out of the file.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(path: &Path, trajectory: &Trajectory, rows: Rows) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    let io = |e| WriteError::io(path, e);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
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
pub fn write_rows(out: &mut impl Write, trajectory: &Trajectory, rows: Rows) -> io::Result<()> {
    writeln!(out, "t_s,lat_deg,lon_deg,h_m,v_n_m_s,v_e_m_s,v_d_m_s,roll_deg,pitch_deg,yaw_deg")?;
    for t_s in rows.times(trajectory) {
        let state = trajectory.state(t_s);
        let (v, rpy) = (state.v_n, RollPitchYaw::from_quat(state.q_b_n));
        let (roll, pitch, yaw) = (rpy.roll / DEG, rpy.pitch / DEG, rpy.yaw / DEG);
        writeln!(
            out,
            "{t_s},{},{},{},{},{},{},{roll},{pitch},{yaw}",
            state.lat / DEG,
            state.lon / DEG,
            state.h,
            v.x,
            v.y,
            v.z
        )?;
    }
    Ok(())
}
