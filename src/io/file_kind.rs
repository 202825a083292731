//! Kind of a file, from its extension and contents.

use super::fusion_files::{FIXES, bare_row, is_nmea, is_rtklib};
use super::table::{Quantity, quantities};
use super::trajectory_file::DICTIONARY as TRAJECTORIES;
use super::{Failure, curve_file, logs, recordings, source};
use std::path::Path;

/// The kinds of files that commands read.
#[derive(Debug, PartialEq)]
pub(crate) enum FileKind {
    /// A scenario of `run`.
    Scenario,
    /// A study of `batch`.
    Study,
    /// A noise model.
    Model,
    /// An entry of the catalogue of IMUs.
    CatalogueEntry,
    /// A contamination of recordings.
    Contamination,
    /// Wavelet-variance curves.
    Curve,
    /// Record of a result that no command reads alone: manifests, draws, summaries.
    Record,
    /// A trajectory.
    Trajectory,
    /// The initial state of a fusion.
    Initial,
    /// Recorded GNSS fixes.
    Gnss,
    /// A recording of an IMU under way.
    Imu,
    /// A log.
    Log,
    /// A recording of an IMU, most likely a static one.
    Recording,
    /// A table of other columns or none, or a directory: what reads recordings says more.
    Other,
}

impl FileKind {
    /// Words for it, with the command that takes it; none for what may be anything.
    const fn described(&self) -> Option<&'static str> {
        Some(match self {
            Self::Model => "a noise model: run, fuse, tune, synthesize and export take it",
            Self::Study => "a study: batch takes it",
            Self::CatalogueEntry => "data-sheet figures: datasheet makes a model of them",
            Self::Contamination => "a contamination: synthesize --contaminate takes it",
            Self::Curve => "wavelet-variance curves: calibrate --curve takes them",
            Self::Record => "a record beside a result: no command reads it alone",
            Self::Trajectory => "a trajectory: run takes it, and --trajectory of others",
            Self::Initial => "an initial state: fuse --initial takes it",
            Self::Gnss => "GNSS fixes: second file of fuse",
            Self::Imu => "a recording under way: first file of fuse",
            Self::Recording => "a recording of an IMU: wv, calibrate and fuse take it",
            Self::Other => "a table: wv, calibrate and fuse take recordings",
            Self::Log => "a log: nav-sim inspect lists its channels",
            Self::Scenario => return None,
        })
    }
}

/// The refusal of a file that was expected to be of other kinds.
pub(crate) fn or_wrong_kind(expected: &[FileKind], path: &Path, refusal: Failure) -> Failure {
    // of what is known no better, the reader's own advice says more
    let is_vague = |kind: &FileKind| *kind == FileKind::Other && refusal.advice().is_some();
    let is_other = |kind: &FileKind| !(expected.contains(kind) || is_vague(kind));
    let other = of(path).ok().filter(is_other);
    match other.and_then(|kind| kind.described()) {
        Some(what) => refusal.hint(format!(
            "it holds {what}; are the arguments in another order?"
        )),
        None => refusal,
    }
}

/// Kind of the file at a path. A pipe is read, and reads the same again.
///
/// # Errors
/// When the system refuses.
pub(crate) fn of(path: &Path) -> Result<FileKind, Failure> {
    let name = path.to_string_lossy().to_lowercase();
    if path.is_dir() {
        return Ok(FileKind::Other);
    }
    if name.ends_with(".npy") {
        return Ok(FileKind::Recording);
    }
    match logs::kind_of(path) {
        Some(nav_sim_logs::LogFormat::Npz) => return Ok(FileKind::Recording),
        Some(_) => return Ok(FileKind::Log),
        None => {}
    }
    let plain = name.strip_suffix(".gz").unwrap_or(&name);
    if [".nav", ".tum", ".gpx"]
        .iter()
        .any(|ending| plain.ends_with(ending))
    {
        return Ok(FileKind::Trajectory);
    }
    let text = match source::head(path) {
        // A damaged one: the reader of recordings says how.
        Err(_) if plain != name => return Ok(FileKind::Other),
        read => read.map_err(|e| Failure::io(path, e))?,
    };
    if name.ends_with(".json") || text.trim_start().starts_with('{') {
        // What this program says of its results has a version; of those only curves have wavelet variances to be read.
        let has = |key: &str| text.contains(key);
        return Ok(match has("\"schema_version\"") && !has("\"wv\"") {
            true => FileKind::Record,
            false => FileKind::Curve,
        });
    }
    // No table of numbers is TOML, which needs no ending then: a pipe has none.
    let table = text
        .parse::<toml::Table>()
        .ok()
        .filter(|table| !table.is_empty());
    Ok(match table {
        None if !name.ends_with(".toml") => table_kind(&text),
        table => toml_kind(&table.unwrap_or_default()),
    })
}

/// Kind of a TOML table. Text that does not parse counts as a scenario, whose reader reports the
/// fault.
fn toml_kind(table: &toml::Table) -> FileKind {
    let has = |keys: &[&str]| keys.iter().any(|key| table.contains_key(*key));
    let sensors = || {
        ["accel", "gyro"]
            .iter()
            .filter_map(|sensor| table.get(*sensor))
    };
    let run = table.get("run").and_then(toml::Value::as_table);
    let in_run = run.is_some_and(|run| run.contains_key("trajectory"));
    if has(&["unit"]) {
        FileKind::CatalogueEntry
    } else if sensors().any(toml::Value::is_array) {
        FileKind::Contamination
    } else if has(&["accel", "gyro"]) {
        FileKind::Model
    } else if has(&["lat_deg", "yaw_deg"]) {
        FileKind::Initial
    } else if has(&["segment", "waypoint", "start", "vehicle"]) {
        FileKind::Trajectory
    } else if has(&["vary"]) || in_run {
        FileKind::Study
    } else {
        FileKind::Scenario
    }
}

/// Numbers without a header: increments are small, latitudes are not, and three accelerations are 1 g or 9.8 m/s².
fn bare_kind(text: &str) -> Option<FileKind> {
    let (row, delimiter) = bare_row(text)?;
    let is_place = |lat: f64, lon: f64, h: f64| {
        let norm = lat.hypot(lon).hypot(h);
        lat.abs().max(lon.abs()) > 5.0
            && ![1.0, 9.8, 1e3].iter().any(|g| (norm / g - 1.0).abs() < 0.1)
    };
    match row[..] {
        [_, lat, lon, _, _, _, _] if delimiter == b' ' && lat.abs().max(lon.abs()) > 0.5 => {
            Some(FileKind::Gnss)
        }
        [_, lat, lon, h, ..] if delimiter != b' ' && is_place(lat, lon, h) => Some(FileKind::Gnss),
        [_, _, _, _, _, _, _] | [_, _, _, _, _, _, _, _] if delimiter == b' ' => {
            Some(FileKind::Imu)
        }
        [_, _, _, _, _, _, _, _, _, _, _, _, _] => Some(FileKind::Gnss),
        _ => None,
    }
}

fn table_kind(text: &str) -> FileKind {
    let of = |dictionary| quantities(text, dictionary);
    let (fix, path) = (of(&FIXES), of(&TRAJECTORIES));
    let has = |all: &[&Quantity], name: &str| all.iter().any(|quantity| quantity.name == name);
    let is_position = ["lat_deg", "e_m", "qw"].iter().any(|name| has(&path, name));
    let is_stated = |q: &&Quantity| q.name.starts_with("sd_") || q.name == "week";
    let is_fix = (is_position || has(&fix, "x_ecef_m")) && fix.iter().any(is_stated);
    // of a trajectory more is known than places
    let is_whole = ["lat_deg", "lon_deg", "h_m"]
        .iter()
        .all(|name| has(&path, name))
        && !["v_n_m_s", "roll_deg", "yaw_deg"]
            .iter()
            .any(|name| has(&path, name));
    let is_signal = of(&recordings::DICTIONARY)
        .iter()
        .any(|q| !q.axis.is_empty());
    if let Some(kind) = bare_kind(text) {
        kind
    } else if is_nmea(text) || is_rtklib(text) {
        FileKind::Gnss
    } else if has(&of(&curve_file::DICTIONARY), "tau_samples") {
        FileKind::Curve
    } else if is_signal {
        // beside positions signals tell nothing of what the file is for
        match is_position {
            true => FileKind::Other,
            false => FileKind::Recording,
        }
    } else if is_fix && !has(&path, "roll_deg") || is_whole {
        FileKind::Gnss
    } else if is_position {
        FileKind::Trajectory
    } else {
        FileKind::Other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_tell_the_kind() {
        for (text, kind) in [
            ("[accel]\nprocesses = []", FileKind::Model),
            (
                "[unit]\nname = 'a'\n[gyro]\nnoise = {}",
                FileKind::CatalogueEntry,
            ),
            ("start = {}\nsegment = []", FileKind::Trajectory),
            (
                "[run]\nruns = 3\n[vary]\nmodel = ['a', 'b']",
                FileKind::Study,
            ),
            ("[run]\nruns = 3", FileKind::Scenario),
            ("[[accel]]\noperation = 'ar1'", FileKind::Contamination),
            ("t_s = 0\nlat_deg = 46\nyaw_deg = 3", FileKind::Initial),
            ("= broken", FileKind::Scenario),
        ] {
            assert_eq!(toml_kind(&text.parse().unwrap_or_default()), kind, "{text}");
        }
        for (text, kind) in [
            ("$GPGGA,123519,4807.038,N,01131.000,E,1", FileKind::Gnss),
            ("tau_samples,wv,edof", FileKind::Curve),
            (
                "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m",
                FileKind::Gnss,
            ),
            (
                "t_s,lat_deg,lon_deg,h_m,yaw_deg,sd_yaw_deg",
                FileKind::Trajectory,
            ),
            ("1 30.5 114.2 20 1 1 2\n", FileKind::Gnss),
            ("1 30.5 114.2 20 0 0 0 1 1 2 0.1 0.1 0.1\n", FileKind::Gnss),
            ("1 1e-5 2e-5 -1e-5 0.01 0.02 -0.098\n", FileKind::Imu),
            ("0,46.5,6.5,400,2,2,4\n", FileKind::Gnss),
            ("0,46.5,6.5,400\n", FileKind::Gnss),
            ("0,0 46,5 6,5 400,0 2,0 2,0 4,0\n", FileKind::Gnss),
            ("t_s,lat_deg,lon_deg,h_m,status", FileKind::Gnss),
            (
                "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m,yaw_deg",
                FileKind::Gnss,
            ),
            ("0,9.79,0.1,0.2,1e-3,2e-3,1e-3\n", FileKind::Other),
            (
                "0.007,1.011,0.038,-0.160\n0.01,7,1.011,0.038,-0.1,0.1,33\n",
                FileKind::Other,
            ),
            ("# origin\nt_s, lat_deg, lon_deg", FileKind::Trajectory),
            ("t_s,accel_x_m_s2,gyro_z_rad_s", FileKind::Recording),
        ] {
            assert_eq!(table_kind(text), kind, "{text}");
        }
    }

    #[test]
    fn a_pipe_without_an_ending_is_known_by_its_contents() {
        let dir = tempfile::tempdir().unwrap();
        for (name, text, kind) in [
            ("63", "[run]\nruns = 3\n", FileKind::Scenario),
            ("64", "[unit]\nname = 'a'\n", FileKind::CatalogueEntry),
            ("65", "t_s,accel_x_m_s2\n0,1\n", FileKind::Recording),
            ("66", "{ \"curves\": [] }", FileKind::Curve),
        ] {
            let path = dir.path().join(name);
            assert!(
                std::process::Command::new("mkfifo")
                    .arg(&path)
                    .status()
                    .unwrap()
                    .success()
            );
            let writer = std::thread::spawn({
                let path = path.clone();
                move || std::fs::write(path, text).unwrap()
            });
            assert_eq!(of(&path).unwrap(), kind);
            writer.join().unwrap();
            assert_eq!(of(&path).unwrap(), kind, "what was read is kept");
        }
    }
}
