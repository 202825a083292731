//! `nav-sim check`: whether a file is what it should be.

use super::{Failure, Session, parse, read};
use nav_sim::formats::fusion_files::{read_gnss, read_imu, read_initial};
use nav_sim::formats::{
    contamination_file, curve_file, efficiency_file, model_file, parameters_file, scenario_file,
};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Check scenario, study, model, trajectory and recording files without running anything
///
/// What a file is follows from its contents: a TOML with [accel] or [gyro] is a noise model, one with
/// segments or waypoints a motion profile, one with candidates a study of `batch`, one with sets of
/// replicates a study of `efficiency`, one with bounds of parameters (lower, upper, fix) or operations that of
/// `calibrate --parameters` or `synthesize --contaminate`, one with lat_deg and yaw_deg an initial
/// state of `fuse`, any other a scenario; a table with lat_deg or n_m is a trajectory, as are .nav, .tum and .gpx, or with standard
/// deviations GNSS fixes, with tau_samples (or a .wv.json) a curve, any other table or .npy a static recording.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim check calib_data/consumer_mems.toml
  nav-sim check trajectories/land_vehicle.toml examples/paper_table1.toml
  nav-sim init study && nav-sim check study/scenario.toml")]
pub(crate) struct Args {
    /// Files
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Sample rate of recordings without a time column
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz)]
    rate_hz: Option<f64>,
    /// Also print what a file comes to: scenarios and studies with every key, defaults included; models axis by axis
    #[arg(long)]
    dry_run: bool,
}

/// What is said of a file in JSON.
#[derive(serde::Serialize)]
struct Checked {
    file: String,
    ok: bool,
    /// What it is, or what is wrong.
    found: String,
}

/// Every file is looked at, whatever the others are.
pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut failures = Vec::new();
    let mut checked = Vec::new();
    for path in &args.files {
        let file = path.display().to_string();
        match check(path, args.rate_hz, session) {
            Ok(found) if session.json() => checked.push(Checked { file, ok: true, found }),
            Ok(found) => {
                session.printer.result(&format!("{file}: {found}"));
                if args.dry_run {
                    resolved(path)?.into_iter().for_each(|text| session.printer.result(text.trim_end()));
                }
            }
            Err(failure) => {
                checked.push(Checked { file, ok: false, found: failure.to_string() });
                failures.push(failure);
            }
        }
    }
    if session.json() {
        session.printer.result(nav_sim::report::json(&checked).trim_end());
    }
    let (Some(last), wrong, all) = (failures.pop(), failures.len() + 1, args.files.len()) else {
        return Ok(());
    };
    if all == 1 {
        return Err(last);
    }
    failures.iter().chain([&last]).for_each(|failure| session.printer.failure(failure));
    let message = format!("{wrong} of {all} files are not as they should be");
    let unreadable = failures.iter().chain([&last]).any(|failure| failure.code() == 1);
    Err(if unreadable { Failure::could_not(message) } else { Failure::input(message) })
}

/// The configuration that a file stands for, every key of it.
fn resolved(path: &Path) -> Result<Option<String>, Failure> {
    let text = match kind(path)? {
        Kind::Scenario => toml::to_string(&scenario_file::read(path)?).map_err(Failure::could_not)?,
        Kind::Study => {
            toml::to_string(&nav_sim::study::file::read(path)?.study).map_err(Failure::could_not)?
        }
        Kind::Model => model_file::to_toml(&model_file::read(path)?),
        _ => return Ok(None),
    };
    Ok(Some(text))
}

/// Reads a file as what it is, and says what was found.
fn check(path: &Path, rate_hz: Option<f64>, session: &Session) -> Result<String, Failure> {
    match kind(path)? {
        Kind::Scenario => {
            let scenario = scenario_file::read(path)?;
            Ok(format!("a scenario of {} runs", scenario.run.runs))
        }
        Kind::Study => {
            nav_sim::study::named_files::exist(path)?;
            let study = nav_sim::study::file::read(path)?.study;
            let (candidates, sets) = (study.candidates().len(), study.outage_sets().map_or(0, |s| s.len()));
            Ok(format!("a study of {candidates} candidates, {sets} outage sets, {} runs each", study.runs))
        }
        Kind::Efficiency => {
            let study = efficiency_file::read(path)?;
            Ok(format!("a study of estimators on {} sets of recordings", study.sets))
        }
        Kind::Model => {
            let file = read::model(path, session)?;
            let labels: Vec<String> = file.model.axes.iter().map(|axis| axis.labels().join(" + ")).collect();
            let (accel, gyro) = (&labels[0], &labels[3]);
            Ok(format!("a noise model at {} Hz, accel {accel}, gyro {gyro}", file.model.rate_hz))
        }
        Kind::Parameters => {
            parameters_file::check(path)?;
            Ok("bounds of parameters; whether a model has those, calibrate says".to_owned())
        }
        Kind::Contamination => {
            // The rate only turns seconds into samples.
            let rules = contamination_file::find(&path.to_string_lossy(), rate_hz.unwrap_or(100.0))?.rules;
            Ok(format!("a contamination of {} operations", rules.len()))
        }
        Kind::Curve => {
            let curves = curve_file::read(path).map_err(|e| {
                let failure = if e.is_content() { Failure::input(&e) } else { Failure::could_not(&e) };
                failure.maybe_hint(e.hint())
            })?;
            let scales: Vec<String> = curves.iter().map(|c| c.curve.levels.len().to_string()).collect();
            Ok(format!("wavelet-variance curves, of {} scales", scales.join(", ")))
        }
        Kind::Trajectory => {
            let trajectory = read::trajectory(path, session)?;
            let seconds = trajectory.end_s() - trajectory.start_s();
            Ok(format!("a trajectory of {seconds} s"))
        }
        Kind::Initial => {
            let start = read_initial(path)?;
            Ok(format!("an initial state at {} s", start.t_s))
        }
        Kind::Gnss => {
            let (fixes, remarks) = read_gnss(path, None).map_err(read::refused_for_fusion)?;
            remarks.iter().for_each(|remark| session.printer.warn(remark));
            let span = fixes.first().zip(fixes.last()).map_or(0.0, |(a, b)| b.t_s - a.t_s);
            let velocity = if fixes.iter().any(|f| f.velocity.is_some()) { " with velocity" } else { "" };
            Ok(format!("{} GNSS fixes{velocity} over {span} s", fixes.len()))
        }
        Kind::Imu => {
            let imu = read_imu(path).map_err(read::refused_for_fusion)?;
            imu.remarks.iter().for_each(|remark| session.printer.warn(remark));
            Ok(format!(
                "an IMU recording of {} samples at {:.2} Hz, for fuse",
                imu.samples.len(),
                imu.rate_hz
            ))
        }
        Kind::Recording => {
            let recordings = read::recordings_at(&[path.to_owned()], rate_hz, session)?;
            let one = |r: &nav_sim::imu::Recording| {
                format!("{} channels of {} samples at {} Hz", r.signals.len(), r.len(), r.rate_hz)
            };
            Ok(format!(
                "read as a static recording, {}",
                recordings.iter().map(one).collect::<Vec<_>>().join("; ")
            ))
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Scenario,
    Study,
    Efficiency,
    Model,
    Parameters,
    Contamination,
    Curve,
    Trajectory,
    Initial,
    Gnss,
    Imu,
    Recording,
}

fn kind(path: &Path) -> Result<Kind, Failure> {
    let name = path.to_string_lossy().to_lowercase();
    if path.is_dir() || name.ends_with(".npy") {
        return Ok(Kind::Recording);
    }
    let plain = name.strip_suffix(".gz").unwrap_or(&name);
    if [".nav", ".tum", ".gpx"].iter().any(|ending| plain.ends_with(ending)) {
        return Ok(Kind::Trajectory);
    }
    let error = |e| Failure::could_not(format!("{}: {e}", path.display()));
    let file = std::fs::File::open(path).map_err(error)?;
    let mut reader: Box<dyn Read> =
        if name.ends_with(".gz") { Box::new(flate2::read::GzDecoder::new(file)) } else { Box::new(file) };
    let mut head = Vec::new();
    match reader.by_ref().take(HEAD).read_to_end(&mut head) {
        // A damaged one: the reader of recordings says how.
        Err(_) if name.ends_with(".gz") => return Ok(Kind::Recording),
        read => read.map_err(error)?,
    };
    let text = String::from_utf8_lossy(&head);
    if name.ends_with(".json") {
        return Ok(Kind::Curve);
    }
    Ok(if name.ends_with(".toml") { toml_kind(&text) } else { table_kind(&text) })
}

/// Bytes of a file that tell what it is: all of a TOML, the header of a table.
const HEAD: u64 = 1 << 20;

fn toml_kind(text: &str) -> Kind {
    // What does not parse is read as a scenario, whose reader says where it is wrong.
    let table: toml::Table = text.parse().unwrap_or_default();
    let has = |keys: &[&str]| keys.iter().any(|key| table.contains_key(*key));
    let sensors = || ["accel", "gyro"].iter().filter_map(|sensor| table.get(*sensor));
    if sensors().any(toml::Value::is_array) {
        Kind::Contamination
    } else if table.values().any(bounds) {
        Kind::Parameters
    } else if has(&["accel", "gyro"]) {
        Kind::Model
    } else if has(&["lat_deg", "yaw_deg"]) {
        Kind::Initial
    } else if has(&["segment", "waypoint", "start", "vehicle"]) {
        Kind::Trajectory
    } else if has(&["candidate", "trajectory", "truth"]) {
        Kind::Study
    } else if has(&["sets", "replicates", "estimators"]) {
        Kind::Efficiency
    } else {
        Kind::Scenario
    }
}

/// Whether there is a bound of a parameter in it.
fn bounds(value: &toml::Value) -> bool {
    let Some(table) = value.as_table() else { return false };
    let of_parameter =
        ["lower", "upper", "fix"].iter().any(|key| table.get(*key).is_some_and(|v| !v.is_table()));
    of_parameter || table.iter().any(|(key, value)| key != "spread" && bounds(value))
}

/// The texts of KF-GINS, numbers between blanks without a header: increments are small, latitudes are not.
fn bare_kind(text: &str) -> Option<Kind> {
    let mut lines = text.lines().map(str::trim);
    let first = lines.find(|l| !(l.is_empty() || l.starts_with(['#', '%', '/'])))?;
    let numbers: Option<Vec<f64>> = first.split_whitespace().map(|c| c.parse().ok()).collect();
    match numbers.as_deref() {
        Some([_, lat, lon, _, _, _, _]) if lat.abs().max(lon.abs()) > 0.5 => Some(Kind::Gnss),
        Some(row) if row.len() == 13 => Some(Kind::Gnss),
        Some(row) if (7..=8).contains(&row.len()) => Some(Kind::Imu),
        _ => None,
    }
}

fn table_kind(text: &str) -> Kind {
    let position = |line: &str| line.contains("lat_deg") || line.contains("n_m") && line.contains("e_m");
    let fixes = |line: &str| {
        position(line) && ["sd_", "std_", "sigma_"].iter().any(|s| line.contains(s)) && !line.contains("yaw")
    };
    if let Some(kind) = bare_kind(text) {
        kind
    } else if text.trim_start_matches('\u{feff}').trim_start().starts_with("ini lat") {
        Kind::Trajectory
    } else if text.lines().take(20).any(|line| line.contains("tau_samples")) {
        Kind::Curve
    } else if text.lines().take(20).any(fixes) {
        Kind::Gnss
    } else if text.lines().take(20).any(position) {
        Kind::Trajectory
    } else {
        Kind::Recording
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_tell_the_kind() {
        assert_eq!(toml_kind("[accel]\nprocesses = []"), Kind::Model);
        assert_eq!(toml_kind("start = {}\nsegment = []"), Kind::Trajectory);
        assert_eq!(toml_kind("runs = 3\n[[candidate]]"), Kind::Study);
        assert_eq!(toml_kind("sets = 500\nmodel = 'n1.toml'"), Kind::Efficiency);
        assert_eq!(toml_kind("[run]\nruns = 3"), Kind::Scenario);
        assert_eq!(toml_kind("[gyro.AR1_1]\nphi = { fix = 0.98 }"), Kind::Parameters);
        assert_eq!(toml_kind("[WN]\nsigma2 = { lower = 0.1 }"), Kind::Parameters);
        assert_eq!(toml_kind("[[accel]]\noperation = 'ar1'"), Kind::Contamination);
        assert_eq!(table_kind("tau_samples,wv,edof"), Kind::Curve);
        assert_eq!(toml_kind("t_s = 0\nlat_deg = 46\nyaw_deg = 3"), Kind::Initial);
        assert_eq!(table_kind("t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m"), Kind::Gnss);
        assert_eq!(table_kind("t_s,lat_deg,lon_deg,h_m,yaw_deg,sd_yaw_deg"), Kind::Trajectory);
        assert_eq!(table_kind("ini lat (deg),ini lon (deg)"), Kind::Trajectory);
        assert_eq!(table_kind("1 30.5 114.2 20 1 1 2\n"), Kind::Gnss);
        assert_eq!(table_kind("1 30.5 114.2 20 0 0 0 1 1 2 0.1 0.1 0.1\n"), Kind::Gnss);
        assert_eq!(table_kind("1 1e-5 2e-5 -1e-5 0.01 0.02 -0.098\n"), Kind::Imu);
        assert_eq!(toml_kind("= broken"), Kind::Scenario);
        assert_eq!(table_kind("# origin\nt_s, lat_deg, lon_deg"), Kind::Trajectory);
        assert_eq!(table_kind("t_s,accel_x_m_s2,gyro_z_rad_s"), Kind::Recording);
    }
}
