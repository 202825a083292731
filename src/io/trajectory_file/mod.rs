//! Trajectory files: CSV, motion profiles (TOML), imports.

mod doubts;
mod gpx;
mod imports;
mod profile;
mod reference;
mod samples;
mod write;

pub(crate) use profile::schema as profile_schema;
pub(crate) use samples::parse_origin;
pub(crate) use write::{Rows, csv};

use super::table::{Asked, Numbers, parse as parse_text};
use super::{Failure, Place, source};
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::reference::Reference;
use std::path::Path;

/// How to read a trajectory file.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Where local coordinates begin: latitude, longitude (rad), height (m). Without it: the file's own
    /// `# origin:` line.
    pub origin: Option<[f64; 3]>,
}

const KNOWN: &str =
    ".toml (motion profile), .csv, .tsv, .txt, .nav (KF-GINS), .tum or .gpx (also .gz)";

/// Reads a trajectory: a motion profile (`.toml`), or a table with a header (`.csv`, `.tsv`, `.txt`) whose columns
/// are `t_s`, `lat_deg`, `lon_deg`, `h_m` or `n_m`, `e_m`, `d_m` (in the plane that touches the Earth at the
/// origin), `roll_deg`, `pitch_deg`, `yaw_deg`. Columns `v_n_m_s`, `v_e_m_s`, `v_d_m_s` are compared with the
/// positions. Without attitude, heading and pitch follow the path.
///
/// Of other tools: KF-GINS results (`.nav`), TUM (`.tum`), GPX (`.gpx`). All but profiles may be packed (`.gz`).
///
/// # Errors
/// Whatever is wrong with the file, with its line.
pub fn load(path: &Path, options: &Options) -> Result<(Trajectory, Vec<String>), Failure> {
    match parse(path, options, Numbers::Finite)? {
        Parsed::Profile(trajectory) => Ok((trajectory, Vec::new())),
        Parsed::Rows(rows) => rows.trajectory(),
    }
}

/// Reads a trajectory that is only compared with. Where its position or attitude jumps as no vehicle does, where
/// rows are missing, not finite or out of range, it is left out and the rest is used; what was left out is
/// among the warnings.
///
/// # Errors
/// What cannot be read at all, with its line; rows of which no stretch is usable.
pub(crate) fn load_reference(
    path: &Path,
    options: &Options,
) -> Result<(Reference, Vec<String>), Failure> {
    match parse(path, options, Numbers::Any)? {
        Parsed::Profile(trajectory) => Ok((trajectory.into(), Vec::new())),
        Parsed::Rows(rows) => rows.reference(),
    }
}

enum Parsed {
    Profile(Trajectory),
    Rows(samples::Rows),
}

fn parse(path: &Path, options: &Options, numbers: Numbers) -> Result<Parsed, Failure> {
    let name = path.display().to_string();
    let lower = name.to_lowercase();
    let plain = lower.strip_suffix(".gz").unwrap_or(&lower);
    let text = || source::table_text(path);
    let rows = match plain.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "toml" => return Ok(Parsed::Profile(profile::load(path)?)),
        "nav" => imports::kf_gins(&name, &text()?, options, numbers),
        "tum" => imports::tum(&name, &text()?, options, numbers),
        "gpx" => gpx::gpx(&name, &text()?),
        "csv" | "tsv" | "txt" => parse_table(&name, &text()?, options, numbers),
        _ => Err(Failure::contents(
            name,
            Place::Within,
            format!("a trajectory file ends in {KNOWN}"),
        )),
    };
    rows.map(Parsed::Rows)
}

fn parse_table(
    name: &str,
    text: &str,
    options: &Options,
    numbers: Numbers,
) -> Result<samples::Rows, Failure> {
    let table = parse_text(name, text, &samples::dictionary(numbers), &Asked::default())?;
    samples::rows(table, options, numbers)
}

#[cfg(test)]
mod tests;
