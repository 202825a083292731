//! `nav-sim calibrate`: replicate static recordings → noise model.

use super::{Failure, Session, read};
use crate::calibrate::{Calibration, CalibrationNote, CalibrationRequest, ModelFiles};
use crate::jobs::JobError;
use nav_sim_calibration::{Settings, diagnose};
use std::path::{Path, PathBuf};

/// Fit a noise model to static recordings
///
/// Each recording is one replicate. By default the three axes of a sensor are pooled: there is one model per
/// sensor, and the signals of its axes are replicates of one another. The model goes to a TOML file. Beside it,
/// <model>.wv.json holds the curves, <model>.draws.json the draws behind the intervals, <model>.html a page and
/// <model>.svg its figures. With `--estimator all` there is such a set for each estimator, <model>_<estimator>.toml and so on.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim synthesize calib_data/consumer_mems.toml \\
      --replicates 5 --samples 65536 --spread --seed 1 -o static
  nav-sim calibrate static -o model.toml
  nav-sim calibrate static --estimator all --model \"AR1+RW+WN\" --pool axes -o imu.toml")]
pub(crate) struct Args {
    #[command(flatten)]
    request: CalibrationRequest,
    /// The model file (default: model.toml; none for --curve)
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut request = args.request.clone();
    let settings = request.settings()?;
    match &args.request.curve {
        Some(path) => curves(
            &mut request,
            path,
            (&settings, args.out.as_deref()),
            session,
        ),
        None => recordings(&mut request, settings, args.out.as_deref(), session),
    }
}

fn recordings(
    request: &mut CalibrationRequest,
    settings: Settings,
    out: Option<&Path>,
    session: &Session,
) -> Result<(), Failure> {
    let out = out.unwrap_or(Path::new("model.toml"));
    let listed = read::listed(&request.inputs)?;
    let (mut outputs, _claims) = ModelFiles::claim(
        out,
        &request.estimator.possible(),
        &listed,
        session.existing(),
    )?;
    draw(request, session);
    let measured = request.measure(settings, &session.context())?;
    let files: Vec<PathBuf> = measured
        .report
        .files
        .iter()
        .map(|f| f.path.clone())
        .collect();
    outputs.retain(|files| measured.settings.estimators.contains(&files.estimator));
    // Before the long half: what was read is still there.
    let note = request.note(&files, &measured.settings)?;
    let calibration = {
        let progress = session.progress("steps of the fits", measured.steps());
        measured.calibrate(&|steps| progress.add(steps))?
    };
    finish(&outputs, &calibration, &note, session)
}

/// Fitting curves that come from elsewhere.
fn curves(
    request: &mut CalibrationRequest,
    path: &Path,
    (settings, out): (&Settings, Option<&Path>),
    session: &Session,
) -> Result<(), Failure> {
    let (curves, is_unsaid) = request.curves(path, settings)?;
    match out {
        // What is only printed needs a sensor for its units alone.
        None if is_unsaid => session.say(format!(
            "{}: taken as of an accelerometer (--axes gyro: of a gyroscope)",
            path.display()
        )),
        Some(_) if is_unsaid => {
            return Err(JobError::NoSensor {
                path: path.display().to_string(),
            }
            .into());
        }
        _ => (),
    }
    let (outputs, _claims) = match out {
        Some(out) => ModelFiles::claim(
            out,
            &curves.settings.estimators,
            &[path.to_owned()],
            session.existing(),
        )?,
        None => Default::default(),
    };
    draw(request, session);
    let calibration = curves.calibrate(request.draws())?;
    let note = request.note(&[path.to_owned()], &calibration.settings)?;
    finish(&outputs, &calibration, &note, session)
}

/// Gives the draws a seed, where there are any.
fn draw(request: &mut CalibrationRequest, session: &Session) {
    if request.bootstrap > 0 {
        request.seed = session.seed(None);
    }
}

/// Writes one model and its curves for each estimator, and prints the fits.
fn finish(
    outputs: &[ModelFiles],
    calibration: &Calibration,
    note: &CalibrationNote,
    session: &Session,
) -> Result<(), Failure> {
    let diagnoses = diagnose(
        &calibration.groups,
        &calibration.outcomes,
        &calibration.settings,
    );
    let files = ModelFiles::write_all(outputs, calibration, note, &diagnoses)?;
    let files: Vec<String> = files
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    session.answer(&calibration.answer(&diagnoses, files.clone()));
    if !files.is_empty() {
        session.say(format!("wrote {}", files.join(", ")));
    }
    Ok(())
}
