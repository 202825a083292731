//! `nav-sim fuse`: the filter on recorded data.

mod inputs;
mod output;

use super::filter::FilterArgs;
use super::parse::one_of;
use super::pictures::PlotArgs;
use super::run::{parse_outage, windows_of};
use super::{Failure, Session, parse};
use crate::earth::GravityModel;
use crate::formats::fusion_files::FixSigma;
use crate::fusion::alignment::Alignment;
use crate::fusion::{self, Assessment, Recorded, Settings, Verdict};
use crate::report::{FusionSummary, fusion_page, seconds};
use crate::sensors::gnss::MAX_LEVER_ARM_M;
use crate::sensors::outage::Outage;
use crate::simulation::lincov::weak_heading;
use inputs::Inputs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What to look at where a solution is not to be believed.
const ADVICE: &str = "are the IMU's axes front, right, down (if not: --axes, --mounting), its units right, the start true \
                      (if not: --initial FILE), the receiver's standard deviations honest (if not: --gnss-sigma-factor), the clocks of \
                      the two files one, to milliseconds, and the antenna where the IMU is (if not: --lever-arm)?";
/// The same where the fixes agree with the solution and the reference does not.
const LASTING: &str = "the filter takes the errors of the fixes as white: where they last, give larger standard deviations \
                       (--gnss-sigma-factor); is the reference's attitude that of the vehicle (if not: --mounting)?";
/// A distance from the reference that no filter makes: another place, or another time (m).
const ELSEWHERE_M: f64 = 10_000.0;

/// Fuse recorded IMU and GNSS data with the filter of `run`, MODEL telling it the noise of the IMU
///
/// IMU: rates (t_s, gyro_x_rad_s … accel_z_m_s2; other units and loggers' names as for `wv`) or increments
/// (dtheta_x_rad … dv_z_m_s, time = end of the interval). GNSS: t_s, lat_deg, lon_deg, h_m, sd_n_m, sd_e_m,
/// sd_d_m, and v_n_m_s … sd_vd_m_s where velocity is measured. Or both as the text files of KF-GINS: 7 or 8
/// columns of increments; 7 of position, 13 with velocity; GNSS also as a solution of RTKLIB (.pos, GPST). Up to 5 s without samples are bridged, as uncertain
/// as the recording is over such times elsewhere. Writes solution.csv, innovations.csv, errors.csv (with a
/// reference), solution.kml, summary.json, report.html, manifest.json.
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim trajectory record trajectories/land_vehicle.toml calib_data/tactical.toml -o drive
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --reference drive/reference.csv --outage 300:360 -o out/fused
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --initial drive/initial.toml --nis-gate 0.999 -o out/given")]
pub(crate) struct Args {
    /// IMU recording (.csv, .tsv, .txt, .npy, also .gz)
    #[arg(value_name = "IMU")]
    imu: PathBuf,
    /// GNSS fixes (.csv, .txt, .pos, also .gz)
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
    /// Attitude of the IMU in the vehicle, where its axes are not front, right, down (degrees)
    #[arg(long, value_name = "ROLL,PITCH,YAW", value_parser = parse::triple, allow_hyphen_values = true)]
    mounting: Option<parse::Triple>,
    /// What the logger calls x, y, z; the mounting turns what is front, right, down then
    #[arg(long, value_name = "AXES", value_enum, default_value = "frd")]
    axes: inputs::LoggerAxes,
    /// How gravity falls with height: wgs84 (second order) or first-order
    #[arg(long, value_name = "MODEL", value_parser = one_of::<GravityModel>(&GravityModel::NAMES), default_value = "wgs84")]
    gravity: GravityModel,
    /// Trajectory to compare with; stretches where it jumps are left out
    #[arg(long, value_name = "TRAJECTORY")]
    reference: Option<PathBuf>,
    /// Window in which fixes are withheld, on the clock of the data in seconds (repeatable)
    #[arg(long = "outage", value_name = "START:END", value_parser = parse_outage)]
    outages: Vec<super::run::OutageArg>,
    #[command(flatten)]
    filter: FilterArgs,
    /// Standard deviations where the GNSS file states none: of the position in m, and after a colon of the velocity in
    /// m/s; each one number or north,east,down
    #[arg(long, value_name = "POS[:VEL]", value_parser = inputs::parse_sigma)]
    gnss_sigma: Option<FixSigma>,
    /// Multiply the receiver's standard deviations, of position and of velocity
    #[arg(long, value_name = "POS,VEL", value_parser = parse::positive_pair)]
    gnss_sigma_factor: Option<parse::Pair>,
    /// Refuse fixes whose NIS is above the chi-square quantile of this probability
    #[arg(long, value_name = "P", value_parser = parse::probability)]
    nis_gate: Option<f64>,
    /// Rows of the solution a second
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = parse::rate_hz)]
    rate_hz: f64,
    #[command(flatten)]
    plot: PlotArgs,
    /// Directory to make
    #[arg(long, short, value_name = "DIR", default_value = "out/fuse")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let begin = Instant::now();
    let settings = settings(args)?;
    let inputs = Inputs::read(args, &settings, session)?;
    output::claim(&args.out, &inputs.files, session)?;
    args.plot.guard(&inputs.files.iter().map(|i| PathBuf::from(&i.path)).collect::<Vec<_>>())?;
    let recorded = Recorded { imu: &inputs.imu.samples, gnss: &inputs.gnss };
    let settings = inputs::with_outages(settings, &recorded, session)?;
    let Alignment { start, doubts } = inputs.start(args, &recorded, &settings)?;
    for line in &start.how {
        session.printer.say(&format!("initial state at {} s: {line}", seconds(start.t_s)));
    }
    let settings = without_early_outages(settings, start.t_s, session);
    let solution = fusion::fuse(&recorded, &inputs.belief, &start, &settings, inputs.reference.as_ref())
        .map_err(inputs::impossible)?;
    if inputs.reference.is_some() && solution.rows.iter().all(|row| row.error.is_none()) {
        let message = "the reference and the solution have no time in common";
        return Err(Failure::input(message).hint("both need one clock"));
    }
    let outcome = fusion::outcome(&solution, &settings.outages);
    let constants = inputs.belief.groups.iter().flatten().filter(|g| g.is_constant()).count();
    let (rate_hz, states) = (inputs.imu.rate_hz, [inputs.belief.states, 3 * constants]);
    let assessment = fusion::assess(&solution, &outcome, &doubts).explained(&recorded);
    warn(&assessment, &outcome, session);
    doubt_heading(&solution, &settings.outages, session);
    let summary = FusionSummary::of(&solution, (&outcome, &assessment), &start, rate_hz, states);
    let wall_s = begin.elapsed().as_secs_f64();
    output::write(&solution, &summary, inputs.files, wall_s, &args.out)?;
    session.show(|| crate::report::json(&summary), || summary.text());
    session.wrote(&args.out);
    args.plot.write(|| fusion_page(&solution, &summary, &[]).svg(), session)?;
    believed(&assessment, &args.out, outcome.nis_per_component)
}

/// Windows that end before the filter starts withhold nothing: no outages.
fn without_early_outages(mut settings: Settings, start_s: f64, session: &Session) -> Settings {
    let is_early = |o: &Outage| o.end_s <= start_s;
    for o in settings.outages.iter().filter(|o| is_early(o)) {
        session.printer.warn(&format!(
            "outage {}:{} lies before the start of the solution at {} s: it is not an outage",
            seconds(o.start_s),
            seconds(o.end_s),
            seconds(start_s)
        ));
    }
    settings.outages.retain(|o| !is_early(o));
    settings
}

/// Where the motion hardly shows the heading, no filter of this kind is to be believed.
fn doubt_heading(solution: &fusion::Solution, outages: &[Outage], session: &Session) {
    let start_s = solution.rows.first().map_or(0.0, |row| row.t_s);
    let fixed = solution.rows.iter().filter(|row| !outages.iter().any(|o| o.withholds(row.t_s)));
    if let Some(doubt) = weak_heading(fixed.map(|row| (row.t_s - start_s, row.sigma[8]))) {
        session.printer.warn(&doubt.to_string());
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
        lever_arm_b,
        gravity: args.gravity,
        outages: windows_of(&args.outages)?,
        nis_gate: args.nis_gate,
        rows_hz: args.rate_hz,
    })
}

/// Says what makes the solution, or the comparison with the reference, doubtful.
fn warn(assessment: &Assessment, outcome: &fusion::Outcome, session: &Session) {
    let told = |(verdict, text): &(Verdict, String)| match verdict {
        Verdict::Ok | Verdict::Underconfident => session.printer.say(&format!("note: {text}")),
        Verdict::Doubtful | Verdict::Overconfident => session.printer.warn(text),
    };
    assessment.reasons.iter().for_each(told);
    if assessment.verdict == Verdict::Doubtful {
        session.printer.say(&format!("hint: {ADVICE}"));
    }
    if let Some(far) = outcome.horizontal_max_m.filter(|m| *m > ELSEWHERE_M) {
        let message = format!(
            "the solution is up to {far:.0} m from the reference: is that of this drive, on this clock?"
        );
        session.printer.warn(&message);
    }
}
