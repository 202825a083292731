//! Reading inputs for commands: doubts are said, refusals become failures.

use super::{Failure, Session};
use crate::app::inputs as read;
use crate::formats::model_file::ModelFile;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_signal::imu::Recording;
use std::path::{Path, PathBuf};

/// A trajectory.
pub(super) fn trajectory(path: &Path, session: &Session) -> Result<Trajectory, Failure> {
    Ok(read::trajectory(path, &session.context())?)
}

/// A model; axes that it does not name are said.
pub(super) fn model(path: &Path, session: &Session) -> Result<ModelFile, Failure> {
    Ok(read::model(path, &session.context())?)
}

/// Static recordings, every channel of them; files without a time column at a rate that is given.
pub(super) fn recordings_at(
    paths: &[PathBuf],
    rate_hz: Option<f64>,
    session: &Session,
) -> Result<Vec<Recording>, Failure> {
    Ok(read::recordings(paths, rate_hz, &session.context())?)
}
