//! `nav-sim fuse`: the filter on recorded data.

mod inputs;
mod output;

use super::pictures::PlotArgs;
use super::run::Words;
use super::{Failure, Printer, Session, parse};
use crate::jobs::{FuseError, Fused, FusionFilter, FusionFilterError};
use crate::report::{FusionManifest, fusion_page};
use crate::run::{FilterRequest, OutageFlag, windows_of};
use inputs::Inputs;
use nav_sim_navigation::earth::GravityModel;
use nav_sim_navigation::fusion::{Assessment, FusionError, Settings, Verdict};
use nav_sim_navigation::gnss::FixSigma;
use nav_sim_navigation::sensors::gnss::MAX_LEVER_ARM_M;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What to look at where a solution is not to be believed.
const ADVICE: &str = "are the IMU's axes front, right, down (if not: --axes, --mounting), its units right, the start true \
                      (if not: --initial FILE), the receiver's standard deviations honest (if not: --gnss-sigma-factor), the clocks of \
                      the two files one, to milliseconds (if not: --gnss-delay), and the antenna where the IMU is (if not: --lever-arm)?";
/// The same where the fixes agree with the solution and the reference does not.
const LASTING: &str = "the filter takes the errors of the fixes as white: where they last, give larger standard deviations \
                       (--gnss-sigma-factor); is the reference's attitude that of the vehicle (if not: --mounting)?";
/// What helps where a drive does not show the mounting.
const UNMOUNTED: &str = "give --mounting ROLL,PITCH,YAW; or record some minutes of driving forwards with braking, \
                         accelerating and turns on both sides, with velocities in the GNSS file; an IMU that was never \
                         calibrated needs --turn-on-bias, an antenna apart from it --lever-arm, and fixes that lag behind (clocks) contradict every mounting";
/// A distance from the reference that no filter makes: another place, or another time (m).
const ELSEWHERE_M: f64 = 10_000.0;

/// Fuse recorded IMU and GNSS data with the filter of `run` and the noise model MODEL
///
/// IMU: rates (t_s, gyro_x_rad_s … accel_z_m_s2; other units and loggers' names as for `wv`) or increments
/// (dtheta_x_rad … dv_z_m_s, time = end of the interval). GNSS: t_s, lat_deg, lon_deg, h_m, sd_n_m, sd_e_m,
/// sd_d_m, and v_n_m_s … sd_vd_m_s where velocity is measured. Either may be a text file of KF-GINS (7 or 8
/// columns of increments; 7 of position, 13 with velocity). GNSS may also be a solution of RTKLIB (.pos, GPST)
/// or NMEA sentences (GGA; RMC or VTG, GST), in seconds of the day or in Unix time, as the IMU is. Gaps of up to
/// 5 s are bridged, with the uncertainty that the recording shows over such times elsewhere. Writes solution.csv,
/// innovations.csv, errors.csv (with a reference), solution.kml, summary.json, report.html, manifest.json; with
/// --smooth also smoothed.csv, errors_smoothed.csv, smoothed.kml.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory record trajectories/land_vehicle.toml calib_data/tactical.toml -o drive
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --reference drive/reference.csv --outage 300:360 --smooth -o out/fused
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --initial drive/initial.toml --nis-gate 0.999 -o out/given")]
pub(crate) struct Args {
    /// IMU recording (.csv, .tsv, .txt, .npy, also .gz)
    #[arg(value_name = "IMU")]
    imu: PathBuf,
    /// GNSS fixes (.csv, .txt, .pos, .nmea, also .gz)
    #[arg(value_name = "GNSS")]
    gnss: PathBuf,
    /// Noise model that the filter believes
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Initial state (TOML), or auto: level from the IMU, heading from the GNSS course
    #[arg(long, value_name = "FILE|auto", default_value = "auto")]
    initial: PathBuf,
    /// GNSS antenna from the IMU: front, right, down (m)
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::triple, allow_hyphen_values = true)]
    lever_arm: Option<parse::Triple>,
    /// Attitude of the IMU in the vehicle (degrees) if its axes are not front, right, down; after a colon the standard
    /// deviations about the vehicle's front, right, down; auto: estimated from the drive of a road vehicle
    #[arg(long, value_name = "ROLL,PITCH,YAW[:SD,SD,SD]|auto", value_parser = inputs::parse_mounting, allow_hyphen_values = true)]
    mounting: Option<inputs::MountingArg>,
    /// What the logger calls x, y, z; --mounting applies after this
    #[arg(long, value_name = "AXES", value_enum, default_value = "frd")]
    axes: inputs::LoggerAxes,
    /// Reference trajectory to compare with; stretches where it jumps are left out
    #[arg(long, value_name = "TRAJECTORY")]
    reference: Option<PathBuf>,
    /// Window in which fixes are withheld, on the clock of the data in seconds (repeatable)
    #[arg(long = "outage", value_name = "START:END")]
    outages: Vec<OutageFlag>,
    #[command(flatten)]
    filter: FilterRequest,
    /// Standard deviations where the GNSS file states none: of the position in m, and after a colon of the velocity in
    /// m/s; each one number or north,east,down
    #[arg(long, value_name = "POS[:VEL]", value_parser = inputs::parse_sigma)]
    gnss_sigma: Option<FixSigma>,
    /// Take the fixes for those of so many seconds before their times: how late the receiver or the logger stamps them
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = parse::finite, allow_hyphen_values = true)]
    gnss_delay: f64,
    /// Multiply the receiver's standard deviations, of position and of velocity
    #[arg(long, value_name = "POS,VEL", value_parser = parse::positive_pair)]
    gnss_sigma_factor: Option<parse::Pair>,
    /// Refuse fixes whose NIS is above the chi-square quantile of this probability
    #[arg(long, value_name = "P", value_parser = parse::probability)]
    nis_gate: Option<f64>,
    /// Rows of the solution per second
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = parse::rate_hz)]
    rate_hz: f64,
    /// Also smooth the solution: every row is then estimated from all fixes, later ones included
    #[arg(long)]
    smooth: bool,
    #[command(flatten)]
    plot: PlotArgs,
    /// Directory to make
    #[arg(long, short, value_name = "DIR", default_value = "out/fuse")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let begin = Instant::now();
    let settings = settings(args)?;
    let (inputs, files) = Inputs::read(args, session)?;
    let manifest = output::manifest(inputs.configuration(args, &settings), files);
    let _own = output::claim(&args.out, &manifest, session)?;
    let _picture = args.plot.claim(manifest.inputs.iter().map(|i| &i.path), session)?;
    let Inputs { drive, model, states, expected } = inputs;
    let filter = FusionFilter { model: &model.model, states, initial: &expected };
    let fused = drive.fuse(&filter, settings, &Words::new(session)).map_err(|e| impossible(e, args))?;
    let Fused { solution, outcome, assessment, summary, .. } = fused;
    let manifest = FusionManifest { wall_s: begin.elapsed().as_secs_f64(), ..manifest };
    output::write(&solution, &summary, &manifest, &args.out)?;
    session.show(|| crate::report::json(&summary), || summary.text());
    session.wrote(&args.out);
    args.plot.write(|| fusion_page(&solution, &summary, &[]).svg(), session)?;
    believed(&assessment, &args.out, outcome.nis_per_component)
}

/// Why there is no solution, and what helps.
fn impossible(e: FuseError, args: &Args) -> Failure {
    match e {
        FuseError::Fusion(e @ FusionError::Diverged { .. }) => Failure::could_not(&e).maybe_hint(e.hint()),
        FuseError::Fusion(e) => Failure::input(&e).maybe_hint(e.hint()),
        FuseError::Filter(FusionFilterError::Reduction(e)) => Failure::could_not(e),
        FuseError::Filter(e) => Failure::input(format!("{}: {e}", args.model.display())),
        FuseError::Outage(e) => e.into(),
        FuseError::Alignment(e) => Failure::input(format!("{}: {e}", args.gnss.display())).hint(
            "give the start with --initial FILE (t_s, lat_deg, lon_deg, h_m, roll_deg, pitch_deg, yaw_deg)",
        ),
        FuseError::Mounting(e) => Failure::input(&e).hint(UNMOUNTED),
        FuseError::NothingInCommon => Failure::input(e).hint("both need one clock"),
    }
}

/// Exit code 3 for a solution that is not to be believed.
fn believed(assessment: &Assessment, out: &Path, nis: f64) -> Result<(), Failure> {
    if assessment.verdict < Verdict::Overconfident {
        return Ok(());
    }
    let message = format!("the solution in {} is not to be believed (see the warnings above)", out.display());
    // where the innovations are as small as they should be, it is the reference that contradicts
    Err(Failure::bound(message).hint(if nis < 1.0 { LASTING } else { ADVICE }))
}

fn settings(args: &Args) -> Result<Settings, Failure> {
    let lever_arm_b = args.lever_arm.map_or(glam::DVec3::ZERO, |t| t.0.into());
    if lever_arm_b.abs().max_element() > MAX_LEVER_ARM_M {
        let message = format!(
            "--lever-arm {}, {}, {}: more than {MAX_LEVER_ARM_M} m",
            lever_arm_b.x, lever_arm_b.y, lever_arm_b.z
        );
        return Err(Failure::input(message).hint("metres from the IMU to the antenna: front, right, down"));
    }
    Ok(Settings {
        q_s_b: inputs::mounting(args.axes, args.mounting),
        mounting_sigma_b: args.mounting.map_or(glam::DVec3::ZERO, inputs::MountingArg::sigma_b),
        lever_arm_b,
        gravity: GravityModel::default(),
        outages: windows_of(&args.outages)?,
        nis_gate: args.nis_gate,
        rows_hz: args.rate_hz,
        smooth: args.smooth,
    })
}

/// Says what makes the solution, or the comparison with the reference, doubtful.
pub(super) fn judge(assessment: &Assessment, farthest_m: Option<f64>, printer: &Printer) {
    let told = |(verdict, text): &(Verdict, String)| match verdict {
        Verdict::Ok | Verdict::Underconfident => printer.say(&format!("note: {text}")),
        Verdict::Doubtful | Verdict::Overconfident => printer.warn(text),
    };
    assessment.reasons.iter().for_each(told);
    if assessment.verdict == Verdict::Doubtful {
        printer.say(&format!("hint: {ADVICE}"));
    }
    if let Some(far) = farthest_m.filter(|m| *m > ELSEWHERE_M) {
        let message = format!(
            "the solution is up to {far:.0} m from the reference: is that of this drive, on this clock?"
        );
        printer.warn(&message);
    }
}
