//! Reference trajectories.

use crate::error;
use crate::work::work;
use nav_sim::failure::Failure;
use nav_sim::navigation::frames::RollPitchYaw;
use nav_sim::prelude::{TrajectoryOptions, load_trajectory};
use nav_sim::signal::units::DEG;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

const COLUMNS: [&str; 10] = [
    "t_s",
    "lat_deg",
    "lon_deg",
    "h_m",
    "v_n_m_s",
    "v_e_m_s",
    "v_d_m_s",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
];

/// Columns, first and last instant (s), doubts.
type States<'py> = (Bound<'py, PyDict>, (f64, f64), Vec<String>);

/// The states of a trajectory file so often a second (Hz), a column each; its first and last instant (s); the doubts about it.
#[pyfunction]
#[pyo3(signature = (path, rate_hz, hidden))]
pub(crate) fn trajectory_states<'py>(
    py: Python<'py>,
    path: PathBuf,
    rate_hz: f64,
    hidden: &str,
) -> PyResult<States<'py>> {
    if !(rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ) {
        let message =
            format!("rate_hz: {rate_hz} is not a rate above 0 and up to {MAX_RATE_HZ} Hz");
        return Err(error::refused(py, &message));
    }
    let read = work(py, None, move |_| {
        let (trajectory, doubts) = load_trajectory(&path, &TrajectoryOptions::default())?;
        // the end counts where rounding alone keeps it out
        let last = ((trajectory.end_s() - trajectory.start_s()) * rate_hz + 1e-6).floor() as usize;
        let states = (0..=last).map(|k| {
            let t_s = trajectory.start_s() + k as f64 / rate_hz;
            let state = trajectory.state(t_s);
            let RollPitchYaw { roll, pitch, yaw } = RollPitchYaw::from_quat(state.q_b_n);
            let [n, e, d] = state.v_n.to_array();
            let [lat, lon] = [state.lat / DEG, state.lon / DEG];
            [
                t_s,
                lat,
                lon,
                state.h,
                n,
                e,
                d,
                roll / DEG,
                pitch / DEG,
                yaw / DEG,
            ]
        });
        Ok::<_, Failure>((
            states.collect::<Vec<_>>(),
            (trajectory.start_s(), trajectory.end_s()),
            doubts,
        ))
    })?;
    let (states, span_s, doubts) =
        read.map_err(|failure| error::of_failure(py, &failure, hidden))?;
    let columns = PyDict::new(py);
    for (k, name) in COLUMNS.into_iter().enumerate() {
        columns.set_item(
            name,
            PyArray1::from_vec(py, states.iter().map(|state| state[k]).collect()),
        )?;
    }
    Ok((
        columns,
        span_s,
        doubts
            .iter()
            .map(|doubt| error::shown(&doubt.to_string(), hidden))
            .collect(),
    ))
}

/// Highest rate that is of use (Hz).
const MAX_RATE_HZ: f64 = 100_000.0;
