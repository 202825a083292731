//! `nav-sim check`: whether a file is what it should be.

use super::{Failure, Session, parse};
use crate::app::inputs;
use crate::commands::batch::Study;
use crate::commands::inspect::inspect;
use crate::io::file_kind::{self, FileKind};
use crate::io::fusion_files::{read_gnss, read_imu, read_initial};
use crate::io::logs::LogOptions;
use crate::io::{contamination_file, curve_file, datasheet, model_file, scenario_file};
use crate::report::six_digits;
use nav_sim_document::seconds;
use nav_sim_navigation::fusion::alignment::moves;
use nav_sim_navigation::gnss::FixSigma;
use std::path::{Path, PathBuf};

/// Check scenario, study, model, trajectory and recording files without running anything
///
/// What a file is follows from its contents. A TOML file with [accel] or [gyro] is a noise model; with segments or
/// waypoints a motion profile; with [run] beside [vary], or a trajectory in it, a study of `batch`; with operations
/// one for `synthesize --contaminate`; with lat_deg and yaw_deg an initial state of `fuse`; with [unit] an entry of
/// the catalogue of IMUs; any other is a scenario. A table with lat_deg or n_m is a trajectory, as are .nav, .tum
/// and .gpx; with standard deviations it is GNSS fixes; with tau_samples (or a .wv.json) a curve; any other table or
/// .npy is a static recording.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim check calib_data/consumer_mems.toml
  nav-sim check trajectories/land_vehicle.toml examples/quick_study.toml
  nav-sim init study && nav-sim check study/scenario.toml")]
pub(crate) struct Args {
    /// Files
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Sample rate of recordings without a time column
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz)]
    rate_hz: Option<f64>,
    /// Also print the contents: scenarios and studies with every key, defaults included; models axis by axis
    #[arg(long)]
    dry_run: bool,
}

/// The JSON of one file.
#[derive(serde::Serialize)]
struct Checked {
    file: String,
    ok: bool,
    /// Its kind, or its error.
    found: String,
}

/// Every file is looked at, whatever the others are.
pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut failures = Vec::new();
    let mut checked = Vec::new();
    for path in &args.files {
        let file = path.display().to_string();
        match check(path, args.rate_hz, session) {
            Ok(found) if session.json() => checked.push(Checked {
                file,
                ok: true,
                found,
            }),
            Ok(found) => {
                session.result(format!("{file}: {found}"));
                if args.dry_run {
                    resolved(path)?
                        .into_iter()
                        .for_each(|text| session.result(text.trim_end()));
                }
            }
            Err(failure) => {
                checked.push(Checked {
                    file,
                    ok: false,
                    found: failure.to_string(),
                });
                failures.push(failure);
            }
        }
    }
    if session.json() {
        session.result(crate::report::json(&checked).trim_end());
    }
    let (Some(last), wrong, all) = (failures.pop(), failures.len() + 1, args.files.len()) else {
        return Ok(());
    };
    if all == 1 {
        return Err(last);
    }
    failures
        .iter()
        .chain([&last])
        .for_each(|failure| session.printer.failure(failure));
    let message = format!("{wrong} of {all} files are refused");
    let unreadable = failures
        .iter()
        .chain([&last])
        .any(|failure| failure.code() == 1);
    Err(if unreadable {
        Failure::could_not(message)
    } else {
        Failure::input(message)
    })
}

/// The configuration that a file stands for, every key of it.
fn resolved(path: &Path) -> Result<Option<String>, Failure> {
    let text = match file_kind::of(path)? {
        FileKind::Scenario => {
            toml::to_string(&scenario_file::read(path)?).map_err(Failure::could_not)?
        }
        FileKind::Model => model_file::to_toml(&model_file::read(path)?),
        _ => return Ok(None),
    };
    Ok(Some(text))
}

/// Reads a file as what it is, and says what was found.
fn check(path: &Path, rate_hz: Option<f64>, session: &Session) -> Result<String, Failure> {
    match file_kind::of(path)? {
        FileKind::Scenario => {
            let scenario = scenario_file::read(path)?;
            Ok(format!("a scenario of {} runs", scenario.run.runs))
        }
        FileKind::Study => {
            let cells = Study::read(path, &[])?.cells(path.parent().unwrap_or(Path::new("")))?;
            Ok(format!("a study of {} cells", cells.len()))
        }
        FileKind::Model => model(path, session),
        FileKind::Log => {
            let log = inspect(path, &LogOptions::default())?;
            Ok(format!(
                "{} of {} channels (nav-sim inspect lists them)",
                log.format,
                log.channels.len()
            ))
        }
        FileKind::CatalogueEntry => {
            let sheet = datasheet::read(path)?;
            let name = sheet.name.unwrap_or_default();
            Ok(format!(
                "a catalogue entry, {name}, of {} figures",
                sheet.entries.len()
            ))
        }
        FileKind::Contamination => {
            // The rate only turns seconds into samples.
            let rules =
                contamination_file::find(&path.to_string_lossy(), rate_hz.unwrap_or(100.0))?.rules;
            Ok(format!("a contamination of {} operations", rules.len()))
        }
        FileKind::Curve => {
            let curves = curve_file::read(path)?;
            let scales: Vec<String> = curves
                .iter()
                .map(|c| c.curve.levels.len().to_string())
                .collect();
            Ok(format!(
                "wavelet-variance curves, of {} scales",
                scales.join(", ")
            ))
        }
        FileKind::Record => Ok(
            "a record that nav-sim wrote beside a result: nothing in it to be checked".to_owned(),
        ),
        FileKind::Trajectory => {
            let trajectory = inputs::trajectory(path, &session.context())?;
            let span = trajectory.end_s() - trajectory.start_s();
            Ok(format!("a trajectory of {span} s"))
        }
        FileKind::Initial => {
            let start = read_initial(path)?;
            Ok(format!("an initial state at {} s", start.t_s))
        }
        FileKind::Gnss => gnss(path, session),
        FileKind::Imu => imu(path, session),
        FileKind::Recording => recording(path, rate_hz, session),
    }
}

fn model(path: &Path, session: &Session) -> Result<String, Failure> {
    let file = inputs::model(path, &session.context())?;
    let labels: Vec<String> = file
        .model
        .axes
        .iter()
        .map(|axis| axis.labels().join(" + "))
        .collect();
    let (accel, gyro) = (&labels[0], &labels[3]);
    Ok(format!(
        "a noise model at {} Hz, accel {accel}, gyro {gyro}",
        file.model.rate_hz
    ))
}

fn gnss(path: &Path, session: &Session) -> Result<String, Failure> {
    // standard deviations that no file states are an option of fuse
    let given = FixSigma {
        pos_m: [1.0; 3],
        vel_m_s: Some([1.0; 3]),
    };
    let read = read_gnss(path, None, None, None).map(|read| (read, ""));
    let ((fixes, remarks), unsaid) = match read {
        Err(e) => match read_gnss(path, Some(&given), None, None) {
            Ok(read) => (read, ", without standard deviations (fuse --gnss-sigma)"),
            Err(_) => return Err(e),
        },
        Ok(read) => read,
    };
    remarks
        .iter()
        .for_each(|remark| session.printer.remark(remark));
    let span = fixes
        .first()
        .zip(fixes.last())
        .map_or(0.0, |(a, b)| b.t_s - a.t_s);
    let velocity = if fixes.iter().any(|f| f.velocity.is_some()) {
        " with velocity"
    } else {
        ""
    };
    Ok(format!(
        "{} GNSS fixes{velocity} over {} s{unsaid}",
        fixes.len(),
        seconds(span)
    ))
}

fn imu(path: &Path, session: &Session) -> Result<String, Failure> {
    let imu = read_imu(path, None, None)?;
    imu.remarks
        .iter()
        .for_each(|remark| session.printer.remark(remark));
    Ok(format!(
        "an IMU recording of {} samples at {:.2} Hz, for fuse",
        imu.samples.len(),
        imu.rate_hz
    ))
}

/// What is no static recording may be one of a drive or a flight, which `fuse` reads.
fn moving(path: &Path, session: &Session) -> Option<String> {
    let imu = read_imu(path, None, None).ok()?;
    if !moves(&imu.samples) {
        return None;
    }
    imu.remarks
        .iter()
        .for_each(|remark| session.printer.remark(remark));
    let (samples, rate_hz) = (imu.samples.len(), imu.rate_hz);
    Some(format!(
        "an IMU recording of {samples} samples at {rate_hz:.2} Hz that moves, for fuse; not a static one"
    ))
}

fn recording(path: &Path, rate_hz: Option<f64>, session: &Session) -> Result<String, Failure> {
    let recordings = match inputs::recordings(&[path.to_owned()], rate_hz, &session.context()) {
        Ok(recordings) => recordings,
        Err(refusal) => return moving(path, session).ok_or(refusal),
    };
    let mut described: Vec<String> = recordings
        .iter()
        .map(|r| {
            format!(
                "{} channels of {} samples at {} Hz",
                r.signals.len(),
                r.len(),
                six_digits(r.rate_hz)
            )
        })
        .collect();
    described.dedup();
    let count = match recordings.len() {
        1 => "a static recording".to_owned(),
        n => format!("{n} static recordings"),
    };
    Ok(format!("read as {count}, {}", described.join("; ")))
}
