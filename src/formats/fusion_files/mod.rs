//! What `fuse` reads: recorded IMU data, GNSS fixes, an initial state. Our own tables, the headers that
//! recordings may have, and the text files of KF-GINS.

mod error;
mod fixes;
mod inertial;
mod initial;

pub use error::FusionFileError;
pub use fixes::{FixSigma, read_gnss};
pub use inertial::{ImuFile, read_imu};
pub use initial::read_initial;

use crate::formats::trajectory_file::table::{self, Numbers, Table};
use std::path::Path;

/// How many columns a table of numbers between blanks without a header has; none of any other text.
fn bare_columns(text: &str) -> Option<usize> {
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|l| !(l.is_empty() || l.starts_with(['#', '%', '/'])))?;
    let cells: Vec<&str> = first.split_whitespace().collect();
    (cells.len() > 1 && cells.iter().all(|c| c.parse::<f64>().is_ok())).then_some(cells.len())
}

/// The table of a file, its columns named when it has no header.
fn table(path: &Path, text: &str, columns: Option<&[&str]>) -> Result<Table, FusionFileError> {
    Ok(Table::read(&path.display().to_string(), text.as_bytes(), columns, Numbers::Finite)?)
}

fn text(path: &Path) -> Result<String, FusionFileError> {
    Ok(table::text(path)?)
}
