//! `nav-sim check`: whether a file is what it should be.

use super::batch::Study;
use super::inspect::inspect;
use crate::app::{Command, Context, Failure, Inputs, PlainAnswer, Result, inputs};
use crate::io::Place;
use crate::io::file_kind::{self, FileKind};
use crate::io::fusion_files::{ImuFile, read_gnss, read_imu, read_initial};
use crate::io::recordings::Gaps;
use crate::io::toml_file::TomlSource;
use crate::io::{contamination_file, curve_file, datasheet, scenario_file};
use crate::parse;
use crate::report::six_digits;
use nav_sim_document::{Document, Note, Tone, counted};
use nav_sim_logs::Stamp;
use nav_sim_navigation::fusion::alignment::moves;
use nav_sim_navigation::gnss::FixSigma;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Check scenario, study, model, trajectory and recording files without running anything
///
/// The kind of a file follows from its contents. A TOML file with [accel] or [gyro] is a noise model; with segments or
/// waypoints a motion profile; with [run] beside [vary], or a trajectory in it, a study of `batch`; with operations
/// one for `synthesize --contaminate`; with lat_deg and yaw_deg an initial state of `fuse`; with [unit] an entry of
/// the catalogue of IMUs; any other is a scenario. A table with lat_deg or n_m is a trajectory, as are .nav, .tum
/// and .gpx; with standard deviations, or heights and neither attitude nor velocity, it is GNSS fixes; with tau_samples
/// (or a .wv.json) a curve; any other table or .npy is a static recording.
#[derive(clap::Args, Debug)]
pub struct CheckFiles {
    /// Files
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Sample rate of recordings without a time column
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz)]
    rate_hz: Option<f64>,
}

impl Command for CheckFiles {
    type Answer = PlainAnswer;
    const NAME: &'static str = "check";
    const PLOT: bool = false;

    fn inputs(&self, _: Inputs) -> Result<Inputs> {
        Ok(Vec::new())
    }

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let (mut files, mut lines, mut failures) = (Vec::new(), Vec::new(), Vec::new());
        for path in &self.files {
            let (found, file) = (
                check(path, self.rate_hz, context),
                path.display().to_string(),
            );
            files.push(json!({
                "file": file,
                "ok": found.is_ok(),
                "found": found.as_ref().map_or_else(ToString::to_string, Clone::clone),
            }));
            match found {
                Ok(found) => lines.push(format!("{file}: {found}")),
                Err(failure) => failures.push(failure),
            }
        }
        let unmet = match failures.len() {
            0 => None,
            1 if files.len() == 1 => failures.pop(),
            wrong => {
                context.warn_each(failures.iter().map(|failure| {
                    let own = failure.clone().for_options(|option| option == "rate-hz");
                    let hint = own.advice().map(|advice| format!("; {advice}"));
                    format!("{failure}{}", hint.unwrap_or_default())
                }));
                let message = format!("{wrong} of {} files refused", files.len());
                Some(if failures.iter().any(|failure| failure.code() == 1) {
                    Failure::failed(message)
                } else {
                    Failure::input(message)
                })
            }
        };
        let document = Document::new("Files", Tone::Good, lines);
        Ok(PlainAnswer::new(files.into(), document).with_unmet(unmet))
    }
}

fn report_notes(notes: &[Note], context: &Context<'_>) {
    for Note { importance, text } in notes {
        context.note(*importance, text);
    }
}

fn drive(imu: &ImuFile, context: &Context<'_>) -> String {
    report_notes(&imu.remarks, context);
    let (samples, rate_hz) = (imu.samples.len(), imu.rate_hz);
    format!("an IMU recording, {samples} samples at {rate_hz:.2} Hz, for fuse")
}

/// Reads a file as what it is, and says what was found.
fn check(path: &Path, rate_hz: Option<f64>, context: &Context<'_>) -> Result<String> {
    let beside = path.parent().unwrap_or(Path::new(""));
    let found = match file_kind::of(path)? {
        FileKind::Scenario => match TomlSource::read(path)?.table()?.is_empty() {
            true => "an empty file; a scenario of defaults",
            false => scenario_file::read(path).map(|_| "a scenario")?,
        },
        FileKind::Study => {
            let cells = Study::read(path, &[])?.cells(beside)?.len();
            return Ok(format!("a study of {}", counted(cells, "cell")));
        }
        FileKind::Model => inputs::model(path, context).map(|_| "a noise model")?,
        FileKind::Log => {
            let log = inspect(path, Stamp::default())?;
            if log.channels.is_empty() {
                let why = log.damage.unwrap_or_else(|| "no channel in it".to_owned());
                return Err(Failure::contents(path.display(), Place::Within, why)
                    .or_hint("copy it again from the recorder"));
            }
            "a log: nav-sim inspect lists its channels"
        }
        FileKind::CatalogueEntry => {
            let name = datasheet::read(path)?.name.unwrap_or_default();
            return Ok(format!("a catalogue entry, {name}"));
        }
        FileKind::Contamination => {
            // the rate only turns seconds into samples
            let found = contamination_file::find(&path.to_string_lossy(), rate_hz.unwrap_or(100.0));
            found.map(|_| "a contamination")?
        }
        FileKind::Curve => curve_file::read(path).map(|_| "wavelet-variance curves")?,
        FileKind::Record => "a record beside a result: nothing to check",
        FileKind::Trajectory => inputs::trajectory(path, context).map(|_| "a trajectory")?,
        FileKind::Initial => read_initial(path).map(|_| "an initial state")?,
        FileKind::Gnss => {
            // standard deviations that no file states are an option of fuse
            let given = FixSigma {
                pos_m: [1.0; 3],
                vel_m_s: Some([1.0; 3]),
            };
            let read = read_gnss(path, None, None, None);
            let unsaid = if read.is_err() {
                ", without standard deviations (fuse --gnss-sigma)"
            } else {
                ""
            };
            let (fixes, notes) =
                read.or_else(|e| read_gnss(path, Some(&given), None, None).map_err(|_| e))?;
            report_notes(&notes, context);
            return Ok(format!("{} GNSS fixes{unsaid}", fixes.len()));
        }
        FileKind::Imu => return Ok(drive(&read_imu(path, None, None)?, context)),
        FileKind::Recording | FileKind::Other => {
            let recordings =
                match inputs::recordings(&[path.to_owned()], rate_hz, Gaps::Keep, context) {
                    Ok(recordings) => recordings,
                    // what is no static recording may be one of a drive or a flight
                    Err(refusal) => {
                        let imu = read_imu(path, None, None).ok();
                        let Some(imu) = imu.filter(|imu| moves(&imu.samples)) else {
                            return Err(refusal);
                        };
                        context.warn(refusal);
                        return Ok(drive(&imu, context));
                    }
                };
            let mut described: Vec<String> = recordings
                .iter()
                .map(|r| {
                    let (channels, rate_hz) = (r.signals.len(), six_digits(r.rate_hz));
                    let channels = counted(channels, "channel");
                    format!("{channels} of {} samples at {rate_hz} Hz", r.len())
                })
                .collect();
            described.dedup();
            let count = match recordings.len() {
                1 => "a static recording".to_owned(),
                n => format!("{n} static recordings"),
            };
            return Ok(format!("read as {count}, {}", described.join("; ")));
        }
    };
    Ok(found.to_owned())
}
