//! `nav-sim fuse`: the filter on recorded data.

mod document;

use crate::app::{
    Answer, Command, Context, Failure, Inputs, IntoFailure, OutputFile, OutputKind, Result, inputs,
    refused,
};
use crate::commands::run::reduction_of;
use crate::io::fusion_files::{WEEK_S, read_gnss, read_imu, read_initial, read_wheel};
use crate::io::model_file::ModelFile;
use crate::io::trajectory_file::load_reference;
use crate::parse::{numbers, pair, positive};
use crate::report::json;
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::SMatrix;
use nav_sim_document::{Document, shortest, window};
use nav_sim_navigation::earth::{GravityModel, radii};
use nav_sim_navigation::ekf::{FilterModel, FilterStates, InitialSettings};
use nav_sim_navigation::frames::{NavState, RollPitchYaw, wrap_angle};
use nav_sim_navigation::fusion::alignment::{Alignment, coarse, towards};
use nav_sim_navigation::fusion::judge::{ReferenceOffset, SetupFault, StatedRow, judge};
use nav_sim_navigation::fusion::mounting::{self, Mounting};
use nav_sim_navigation::fusion::{
    AlignmentSummary, AntennaOffset, ClocksApart, Correlation, DriveData, ExcessWhiteNoise,
    Finding, FixRecord, FusionAssessment, FusionError, FusionFigures, FusionSettings, Heading,
    Levelling, Solution, SolutionRow, Start, WeightedSolution, WheelSpeed, WithheldWindows,
    aid_innovations, antenna_offset, assess, check_clocks, clocks_apart, earlier, fuse,
    fuse_correlated, interval_s, outcome, own_noise, predicts_as_well, refine_clock_offset,
    rough_origin, vehicle_velocities, wheel_ratio, withheld,
};
use nav_sim_navigation::gnss::{FixSigma, GnssFix};
use nav_sim_navigation::linalg::median;
use nav_sim_navigation::metrics::{ReductionQuality, VerdictKind};
use nav_sim_navigation::sensors::aiding::{
    AidingSettings, NhcSettings, OdometerSettings, ZuptSettings,
};
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::gnss::{GnssSettings, MAX_LEVER_ARM_M};
use nav_sim_navigation::sensors::outage::{FixedData, Outage, OutagePlan};
use nav_sim_navigation::simulation::lincov::weak_heading;
use nav_sim_navigation::simulation::{BIAS_NAMES, REPORTED_NAMES, lincov};
use nav_sim_navigation::trajectory::reference::Reference;
use nav_sim_signal::imu::ImuIncrement;
use nav_sim_signal::noise::{Composite, Model, ProcessKind, continuous, reduction};
use nav_sim_signal::units::{DEG, Refused};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

impl Command for Fuse {
    type Answer = FuseAnswer;
    const NAME: &'static str = "fuse";
    const OUT: OutputKind = OutputKind::Directory {
        path: "out/fuse",
        files: &FILES,
    };
    const PLOT: bool = false;

    fn inputs(&self, mut given: Inputs) -> Result<Inputs> {
        let initial = self.initial_file();
        given.extend(initial.map(|path| ("initial".to_owned(), path.clone())));
        Ok(given)
    }

    fn run(&self, context: &Context<'_>) -> Result<FuseAnswer> {
        RecordedDrive::read(self, context)?.fuse(context)
    }
}

impl Answer for FuseAnswer {
    fn document(&self) -> Document {
        self.page()
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        directory(self)
    }

    fn record(&self) -> serde_json::Value {
        json!({ "kind": "fusion", "configuration": self.configuration })
    }

    /// A filter that is not overconfident.
    fn unmet(&self) -> Option<Failure> {
        let is_overconfident = self.summary.verdict.kind == VerdictKind::Overconfident;
        is_overconfident
            .then(|| Failure::bound("the solution is overconfident").hint(self.advice()))
    }
}

// Arguments of a fusion.

/// Rows of the solution per second.
const ROWS_HZ: f64 = 10.0;

/// Fuse recorded IMU and GNSS data with the filter of `run` and the noise model MODEL
///
/// IMU: rates (t_s, gyro_x_rad_s … accel_z_m_s2; other units and loggers' names as for `wv`) or increments
/// (dtheta_x_rad … dv_z_m_s, time = end of the interval). GNSS: t_s, lat_deg, lon_deg, h_m, sd_n_m, sd_e_m,
/// sd_d_m, and v_n_m_s … sd_vd_m_s where velocity is measured. Either may be a text file of KF-GINS (7 or 8
/// columns of increments; 7 of position, 13 with velocity). GNSS may also be a solution of RTKLIB (.pos, GPST)
/// or NMEA sentences (GGA, RMC, GST), in seconds of the day or in Unix time, as the IMU is. A log (MCAP, bag,
/// ULog, UBX) may be either, or both. Gaps of up to 5 s are bridged. Writes solution.csv, innovations.csv, errors.csv (with a reference), solution.kml, summary.json, report.html, manifest.json; with
/// --smooth also smoothed.csv, errors_smoothed.csv, smoothed.kml. Exit code 3: the solution is overconfident.
#[derive(clap::Args, Debug, Clone)]
pub struct Fuse {
    /// IMU recording (.csv, .tsv, .txt, .npy, also .gz)
    #[arg(value_name = "IMU")]
    imu: PathBuf,
    /// GNSS fixes (.csv, .txt, .pos, .nmea, also .gz)
    #[arg(value_name = "GNSS")]
    gnss: PathBuf,
    /// Noise model that the filter assumes
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Initial state: a file (TOML), auto (level from the IMU, heading from the GNSS course), or only the heading,
    /// DEG:SD
    #[arg(
        long,
        value_name = "START",
        default_value = "auto",
        allow_hyphen_values = true
    )]
    initial: StartChoice,
    /// GNSS antenna from the IMU: front, right, down (m)
    #[arg(long = "lever-arm", value_name = "X,Y,Z", value_parser = arm, default_value = "0,0,0",
        hide_default_value = true, allow_hyphen_values = true)]
    lever_arm_m: [f64; 3],
    /// Attitude of the IMU in the vehicle: ROLL,PITCH,YAW[:SD,SD,SD] (degrees), flu, rfu, or auto: estimated from
    /// the drive of a road vehicle
    #[arg(long, value_name = "ANGLES", allow_hyphen_values = true)]
    mounting: Option<MountingChoice>,
    /// Reference trajectory to compare with
    #[arg(long, value_name = "TRAJECTORY")]
    reference: Option<PathBuf>,
    /// Window without fixes, in seconds on the clock of the data (repeatable)
    #[arg(long = "outage", value_name = "START:END")]
    outages: Vec<Outage>,
    /// States of the filter: 15 (one bias per axis), 21 (and a scale factor per axis) or full (each process)
    #[arg(long, value_name = "STATES", default_value = "15")]
    filter: FilterStates,
    /// Turn-on biases that the filter expects: standard deviations (m/s², rad/s)
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = pair, hide_short_help = true)]
    turn_on_bias: Option<[f64; 2]>,
    /// Standard deviations of fixes that state none: POS[:VEL] (m, m/s), each one number or north,east,down; x3:2
    /// multiplies the stated ones
    #[arg(long, value_name = "SIGMAS", value_parser = gnss_sigma)]
    gnss_sigma: Option<GnssSigma>,
    /// Time by which the fixes are stamped late (s)
    #[arg(long = "gnss-delay", value_name = "S", value_parser = number, default_value = "0", allow_hyphen_values = true)]
    gnss_delay_s: f64,
    /// Correlation time of the fixes' errors: auto (from the innovations), none, or seconds (of
    /// positions)
    #[arg(long, value_name = "S", value_parser = correlation, default_value = "auto", hide_short_help = true)]
    gnss_correlation: Correlation,
    /// Reject fixes whose NIS exceeds this level of its chi-square distribution, or none
    #[arg(long, value_name = "LEVEL", value_parser = gate, default_value = "0.9999", hide_short_help = true)]
    gate: GateLevel,
    /// Fixes that a second run withholds, to test the filter without a reference: auto or none
    #[arg(long, value_name = "WHICH", value_parser = ["auto", "none"], default_value = "auto", hide_short_help = true, hide_possible_values = true)]
    withhold: String,
    /// Non-holonomic constraint: the rear axle moves neither sideways nor up; needs --mounting
    #[arg(long)]
    nhc: bool,
    /// Zero-velocity updates at standstill
    #[arg(long)]
    zupt: bool,
    /// Wheel speed: a table of t_s and wheel_m_s (or _km_h), negative in reverse
    #[arg(long, value_name = "FILE")]
    odometer: Option<PathBuf>,
    /// Middle of the rear axle from the IMU: front, right, down (m)
    #[arg(long = "rear-axle", hide_short_help = true, value_name = "X,Y,Z", value_parser = arm, default_value = "0,0,0",
        hide_default_value = true, allow_hyphen_values = true)]
    rear_axle_m: [f64; 3],
    /// Names of the IMU's columns, for a file without a header or instead of it
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        hide_short_help = true
    )]
    columns: Option<Vec<String>>,
    /// Topic of the IMU in a log that has several, and of the fixes
    #[arg(
        long,
        value_name = "IMU[,FIXES]",
        value_delimiter = ',',
        hide_short_help = true
    )]
    topic: Vec<String>,
    /// Also smooth the solution (RTS)
    #[arg(long)]
    smooth: bool,
}

impl Fuse {
    /// The file of the initial state; none where it is found in the data.
    fn initial_file(&self) -> Option<&PathBuf> {
        if let StartChoice::File(path) = &self.initial {
            Some(path)
        } else {
            None
        }
    }

    /// Heading at the start, where it is given.
    fn given_heading(&self) -> Option<Heading> {
        match self.initial {
            StartChoice::Heading(heading) => Some(heading),
            _ => None,
        }
    }

    /// Settings of the filter's run.
    fn settings(&self) -> FusionSettings {
        let (q_s_b, mounting_sigma_b) = match self.mounting {
            Some(MountingChoice::Given(q_s_b, sigma_b)) => (q_s_b, sigma_b),
            _ => (DQuat::IDENTITY, DVec3::ZERO),
        };
        FusionSettings {
            q_s_b,
            mounting_sigma_b,
            lever_arm_b: self.lever_arm_m.into(),
            gravity: GravityModel::default(),
            outages: self.outages.clone(),
            gate: self.gate.0,
            rows_hz: ROWS_HZ,
            smooth: self.smooth,
        }
    }
}

/// Attitude of the IMU in the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MountingChoice {
    /// Found from the drive.
    Auto,
    /// From its axes to front, right, down, and standard deviations about these (rad).
    Given(DQuat, DVec3),
}

/// Largest standard deviation of an attitude that small angles describe (degrees).
const MAX_SIGMA_DEG: f64 = 30.0;

impl FromStr for MountingChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let axes = |[x, y, z]: [DVec3; 3]| {
            Self::Given(DQuat::from_mat3(&DMat3::from_cols(x, y, z)), DVec3::ZERO)
        };
        match text {
            "auto" => return Ok(Self::Auto),
            "flu" => return Ok(axes([DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z])),
            "rfu" | "enu" => return Ok(axes([DVec3::Y, DVec3::X, DVec3::NEG_Z])),
            _ => {}
        }
        // nobody mounts by less, and what a drive shows is known no better
        let (angles, sigma) = text.split_once(':').unwrap_or((text, "1,1,1"));
        match (numbers(angles), numbers(sigma)) {
            (Some([roll, pitch, yaw]), Some(sigma_deg))
                if sigma_deg.iter().all(|s| (0.0..=MAX_SIGMA_DEG).contains(s)) =>
            {
                let [roll, pitch, yaw] = [roll, pitch, yaw].map(|angle| angle * DEG);
                Ok(Self::Given(RollPitchYaw { roll, pitch, yaw }.to_quat(), DVec3::from(sigma_deg) * DEG))
            }
            _ => Err(
                "expected degrees, such as -9.5,-60.8,-166.8 or -9.5,-60.8,-166.8:1.5,0.5,0.8, or flu, rfu, auto"
                    .into(),
            ),
        }
    }
}

/// Standard deviations of fixes where the file states none, and factors of what it states, of position and of velocity.
pub type GnssSigma = (Option<FixSigma>, [f64; 2]);

pub(super) fn number(text: &str) -> Result<f64, &'static str> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite())
        .ok_or("not a finite number")
}

fn arm(text: &str) -> Result<[f64; 3], String> {
    let arm: [f64; 3] = numbers(text).ok_or("expected 3 numbers")?;
    if arm.iter().all(|metres| metres.abs() <= MAX_LEVER_ARM_M) {
        Ok(arm)
    } else {
        Err(format!("more than {MAX_LEVER_ARM_M} m"))
    }
}

fn correlation(text: &str) -> Result<Correlation, &'static str> {
    match text {
        "auto" => Ok(Correlation::Auto),
        "none" => Ok(Correlation::None),
        _ => positive(text)
            .map(Correlation::Seconds)
            .map_err(|_| "expected auto, none, or seconds"),
    }
}

/// Level of the gate; none where every fix is used.
#[derive(Debug, Clone, Copy, PartialEq)]
struct GateLevel(Option<f64>);

fn gate(text: &str) -> Result<GateLevel, &'static str> {
    let level = text.parse().ok().filter(|x| (0.5..1.0).contains(x));
    match level {
        None if text != "none" => Err("expected none, or a probability from 0.5 to below 1"),
        level => Ok(GateLevel(level)),
    }
}

fn gnss_sigma(text: &str) -> Result<GnssSigma, &'static str> {
    let Some(factors) = text.strip_prefix('x') else {
        return Ok((Some(fix_sigma(text)?), [1.0; 2]));
    };
    let (position, velocity) = factors.split_once(':').unwrap_or((factors, factors));
    let factor = |text| positive(text).ok().filter(|x| (1e-3..=1e3).contains(x));
    match (factor(position), factor(velocity)) {
        (Some(position), Some(velocity)) => Ok((None, [position, velocity])),
        _ => Err("expected factors from 0.001 to 1000: x3 or x3:2"),
    }
}

/// `POS` or `N,E,D` in metres, then `:VEL` or `:N,E,D` in m/s.
fn fix_sigma(text: &str) -> Result<FixSigma, &'static str> {
    let three = |part: &str| {
        numbers::<3>(part).or(numbers::<1>(part).map(|[all]| [all; 3])).filter(|sigma| sigma.iter().all(|x| *x >= 1e-6)).ok_or(
            "expected metres from 1e-6, one or three (north, east, down), then m/s after a colon: 2,2,4:0.1",
        )
    };
    let (position, velocity) = text
        .split_once(':')
        .map_or((text, None), |(p, v)| (p, Some(v)));
    Ok(FixSigma {
        pos_m: three(position)?,
        vel_m_s: velocity.map(three).transpose()?,
    })
}

/// Start of a fusion.
#[derive(Debug, Clone, PartialEq)]
pub enum StartChoice {
    /// Found in the data.
    Auto,
    /// Found in the data but for the heading.
    Heading(Heading),
    /// Stated in a file.
    File(PathBuf),
}

impl FromStr for StartChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text
            .split_once(':')
            .map(|(deg, sigma)| (number(deg), number(sigma)))
        {
            _ if text == "auto" => Ok(Self::Auto),
            Some((Ok(deg), Ok(sigma_deg)))
                if sigma_deg > 0.0 && sigma_deg <= MAX_SIGMA_DEG && deg.abs() <= 360.0 =>
            {
                let (yaw, sigma) = (deg * DEG, sigma_deg * DEG);
                Ok(Self::Heading(Heading { yaw, sigma }))
            }
            Some((Ok(_), Ok(_))) => Err(format!(
                "expected a heading and its standard deviation of up to {MAX_SIGMA_DEG}°, such as 90:5"
            )),
            _ => Ok(Self::File(text.into())),
        }
    }
}

impl From<FusionError> for Failure {
    fn from(e: FusionError) -> Self {
        let hint = match &e {
            FusionError::Start { .. } => {
                Some("give t_s of the initial state on the clock of the IMU".to_owned())
            }
            FusionError::Place { .. } => {
                Some("check t_s, lat_deg, lon_deg and pos_sigma_m of the initial state".to_owned())
            }
            FusionError::Memory { .. } => {
                Some("use a smaller filter, or fuse the drive in parts".to_owned())
            }
            FusionError::Diverged { .. } => {
                return Self::failed(&e).hint("check axes, units and the initial state");
            }
            _ => None,
        };
        Self::input(e).or_hint_if(hint)
    }
}

// From the files of a request to a solution and its figures.

/// Solution of a recorded drive.
#[derive(Debug, Serialize)]
#[serde(transparent)]
#[non_exhaustive]
pub struct FuseAnswer {
    /// States, standard deviations and innovations.
    #[serde(skip)]
    pub solution: Solution,
    /// Verdict and figures: `summary.json`.
    pub summary: FuseSummary,
    /// Quality of the model reduced to the filter's states, where it loses something.
    #[serde(skip)]
    pub reduction: Option<ReductionQuality>,
    /// Faults of the reference that would explain the errors.
    #[serde(skip)]
    pub reference_faults: Vec<SetupFault>,
    /// Settings, for the manifest.
    #[serde(skip)]
    configuration: Value,
}

/// A drive that was read.
struct RecordedDrive<'a> {
    request: &'a Fuse,
    imu: Vec<ImuIncrement>,
    imu_rate_hz: f64,
    gnss: Vec<GnssFix>,
    wheel: Vec<WheelSpeed>,
    model: ModelFile,
    expected: InitialSettings,
    initial: Option<Start>,
    reference: Option<Reference>,
}

impl<'a> RecordedDrive<'a> {
    /// Reads the files of a request.
    ///
    /// # Errors
    /// A setting out of range, a file that cannot be used.
    fn read(request: &'a Fuse, context: &Context<'_>) -> Result<Self> {
        let (unsaid, [position, velocity]) = request.gnss_sigma.unwrap_or((None, [1.0; 2]));
        let topic = |k: usize| {
            let topic = request.topic.get(k).map(String::as_str);
            topic.filter(|t| !t.is_empty())
        };
        let imu = read_imu(&request.imu, request.columns.as_deref(), topic(0))?;
        let ends = imu.samples.first().zip(imu.samples.last());
        let span = ends.map(|(first, last)| (first.t_s, last.t_s));
        let (mut gnss, remarks) = read_gnss(&request.gnss, unsaid.as_ref(), span, topic(1))?;
        for fix in &mut gnss {
            *fix = fix.with_sigmas_times(position, velocity);
            fix.t_s -= request.gnss_delay_s;
        }
        for note in imu.remarks.into_iter().chain(remarks) {
            context.note(note.importance, note.text);
        }
        let is_unused = |given: &FixSigma| {
            let is_given =
                |sigma: DVec3, own: DVec3| (sigma - own).length() <= 1e-6 * sigma.length();
            let of_velocity = |fix: &GnssFix| fix.velocity.zip(given.vel_m_s);
            gnss.iter().all(|fix| {
                let is_velocity = of_velocity(fix).is_some_and(|(v, own)| {
                    let own = DVec2::new(own[0], own[1]);
                    is_given((v.horizontal_sigma / velocity).extend(0.0), own.extend(0.0))
                });
                !is_velocity && !is_given(fix.pos_sigma_n / position, given.pos_m.into())
            })
        };
        if unsaid.as_ref().is_some_and(is_unused) {
            context.warn(
                "--gnss-sigma is not used: the file states standard deviations; x2 doubles them",
            );
        }
        let wheel = request
            .odometer
            .as_deref()
            .map(read_wheel)
            .transpose()?
            .unwrap_or_default();
        if let (Some(path), [first, .., last], Some((from_s, to_s))) =
            (&request.odometer, &wheel[..], span)
        {
            let covered_s = last.t_s.min(to_s) - first.t_s.max(from_s);
            if covered_s < 0.5 * (to_s - from_s) {
                let (path, covered_s) = (path.display(), covered_s.max(0.0));
                context.warn(format!(
                    "{path} covers {covered_s:.1} s of {:.1} s: another clock or unit of time?",
                    to_s - from_s
                ));
            }
        }
        let initial = request
            .initial_file()
            .map(|path| read_initial(path))
            .transpose()?;
        let model = inputs::model(&request.model, context)?;
        let of_file = initial.as_ref().map(|start| start.sigma.clone());
        let mut expected = of_file.unwrap_or_default();
        if let Some([accel, gyro]) = request.turn_on_bias {
            expected.accel_bias_sigma_m_s2 = Some(accel);
            expected.gyro_bias_sigma_rad_s = Some(gyro);
        }
        inputs::expect_turn_on(&mut expected, model.turn_on, &request.model, context);
        expected.validate().refuse()?;
        let reference = request.reference.as_deref().map(|path| {
            let (reference, warnings) = load_reference(path, None)?;
            context.warn_each(&warnings);
            Ok::<_, Failure>(reference)
        });
        let reference = reference.transpose()?;
        Ok(Self {
            request,
            imu: imu.samples,
            imu_rate_hz: imu.rate_hz,
            gnss,
            wheel,
            model,
            expected,
            initial,
            reference,
        })
    }

    /// Fuses it. Outages are placed on the fixes, those before the start are left out.
    ///
    /// # Errors
    /// Data and settings that do not fit together, or a filter that diverges.
    fn fuse(mut self, context: &Context<'_>) -> Result<FuseAnswer> {
        let origin_s = self.common_origin()?;
        let mut recorded = DriveData {
            imu: &self.imu,
            gnss: &self.gnss,
            aids: &[],
        };
        let mut settings = self.request.settings();
        let aiding = self.request.aiding();
        let configuration = json!({
            "settings": settings,
            "filter": self.request.filter,
            "initial": self.expected,
            "gnss_sigma": self.request.gnss_sigma,
            "gnss_correlation": self.request.gnss_correlation,
            "heading": self.request.given_heading(),
            "gnss_delay_s": self.request.gnss_delay_s,
            "aiding": aiding,
        });
        let stated = &self.model.model;
        let mut noise = own_noise(&self.imu, self.imu_rate_hz, stated);
        let mut own = stated.clone();
        noise.iter().for_each(|noise| noise.apply_to(&mut own));
        let lengths: Vec<f64> = settings
            .outages
            .iter()
            .map(|o| o.end_s - o.start_s)
            .collect();
        let filter_model = |model: &Model| {
            let filter = (model, self.request.filter, &self.expected);
            filter_model(filter, self.imu_rate_hz, &self.gnss, &lengths)
        };
        let (mut believed, mut reduction) = filter_model(&own)?;
        let plan = OutagePlan {
            fixed: settings.outages,
            ..OutagePlan::default()
        };
        let times_s: Vec<f64> = self.gnss.iter().map(|fix| fix.t_s).collect();
        let placed = plan.on(&FixedData::recorded(&times_s), 0)?;
        context.warn_each(&placed.remarks);
        settings.outages = placed.windows;
        let mounting = match self.request.mounting {
            Some(MountingChoice::Auto) => Some(
                mounting::find(&recorded, &settings, &believed)
                    .map_err(|e| Failure::input(e).hint(NOT_MOUNTED))?,
            ),
            _ => None,
        };
        if let Some(Mounting { q_s_b, sigma_b, .. }) = mounting {
            (settings.q_s_b, settings.mounting_sigma_b) = (q_s_b, sigma_b);
        }
        let rest_s = origin_s.map_or(0.0, |_| {
            refine_clock_offset(&recorded, &believed, &settings)
        });
        let gnss = earlier(recorded.gnss, rest_s);
        recorded.gnss = &gnss;
        let delay_s = self.request.gnss_delay_s + origin_s.unwrap_or(0.0) + rest_s;
        if origin_s.is_some() {
            context.warn(format!(
                "clocks without overlap: fused with --gnss-delay={delay_s:.4}, from turns and innovations"
            ));
        }
        let aligned = match (&self.initial, self.request.given_heading()) {
            (Some(start), _) => Ok(Alignment {
                start: beside_mounting(start.clone(), &settings),
                doubts: Vec::new(),
            }),
            (None, Some(heading)) => towards(&recorded, &settings, &believed, heading),
            (None, None) => coarse(&recorded, &settings, &believed),
        };
        let Alignment { start, doubts } = aligned.map_err(|e| {
            Failure::input(e).hint(match self.request.given_heading() {
                Some(_) => "give the state with --initial FILE",
                None => "give the heading with --initial DEG:SD, or all with --initial FILE",
            })
        })?;
        settings.outages.retain(|outage| {
            let is_early = outage.end_s <= start.t_s;
            if is_early {
                let span = window(outage.start_s, outage.end_s);
                context.warn(format!(
                    "outage {span} ends before the solution starts: left out"
                ));
            }
            !is_early
        });
        // the start and the mounting are found without: they are what the vehicle's axes come from
        self.check_wheel(&recorded, &settings.outages)?;
        let aids = vehicle_velocities(&recorded, &self.wheel, &aiding, &settings.outages);
        recorded.aids = &aids;
        if !noise.is_empty() {
            let as_stated = filter_model(stated)?;
            let both = [&believed, &as_stated.0];
            if !predicts_as_well(&recorded, both, &start, &settings) {
                (believed, reduction) = as_stated;
                noise.clear();
            }
        }
        let filter_model = believed.with_vehicle(aiding.state_sigmas());
        let asked = (self.reference.as_ref(), self.request.gnss_correlation);
        let weighed = fuse_correlated(&recorded, &filter_model, &start, &settings, asked)?;
        if self.reference.is_some() && weighed.solution.rows.iter().all(|row| row.error.is_none()) {
            return refused(
                "reference and solution have no time in common",
                "both need one clock",
            );
        }
        context.warn_each(doubt_heading(&weighed.solution, &settings.outages));
        let outcome = outcome(&weighed.solution, &settings.outages);
        let withholds = settings.outages.is_empty() && self.request.withhold == "auto";
        let withheld = match withholds {
            true => withheld(&recorded, &filter_model, &start, &settings, &weighed)?,
            false => None,
        };
        let FusionAssessment { verdict, findings } = assess(&weighed, &outcome, &doubts, withheld);
        let is_correlated = weighed.correlation().is_some();
        let is_unexplained =
            verdict >= VerdictKind::Doubtful || verdict == VerdictKind::Undecided && is_correlated;
        let scene = CauseSearch {
            filter_model: &filter_model,
            start: &start,
            settings: &settings,
            is_given: self.initial.is_some(),
        };
        let cause = is_unexplained.then(|| scene.cause(&recorded));
        let cause = cause.flatten().map(|cause| cause.after(delay_s));
        let kind = match cause {
            Some(_) => verdict.max(VerdictKind::Doubtful),
            None => verdict,
        };
        let grave = findings
            .into_iter()
            .filter(|(verdict, _)| *verdict > VerdictKind::Consistent);
        let evidence = grave.map(|(_, finding)| finding).collect();
        let constants = filter_model
            .groups
            .iter()
            .flatten()
            .filter(|g| g.is_constant())
            .count();
        let rows = &weighed.solution.rows;
        let squares = rows
            .iter()
            .map(|row| row.sigma[0].powi(2) + row.sigma[1].powi(2));
        let summary = FuseSummary {
            schema_version: 1,
            method: "fusion",
            verdict: FuseVerdict {
                kind,
                evidence,
                cause,
            },
            imu_samples: weighed.solution.samples,
            imu_rate_hz: self.imu_rate_hz,
            start_s: start.t_s,
            end_s: rows.last().map_or(start.t_s, |row| row.t_s),
            filter_states: filter_model.states,
            turn_on_states: 3 * constants,
            initial: Initial::new(&start, self.request.initial_file()),
            mounting: mounting.as_ref().map(Into::into),
            horizontal_sigma_rms_m: (squares.sum::<f64>() / rows.len() as f64).sqrt(),
            sigma_factors: weighed.sigma_factors,
            gnss_correlation: fix_correlation(&weighed),
            vehicle: vehicle(&weighed.solution, &aiding),
            imu_noise: noise,
            withheld,
            outcome,
        };
        let is_overconfident = kind == VerdictKind::Overconfident;
        let reference = self.reference.as_ref().filter(|_| is_overconfident);
        let faults = reference.map(|reference| reference_faults(&weighed.solution, reference));
        Ok(FuseAnswer {
            reference_faults: faults.unwrap_or_default(),
            solution: weighed.solution,
            summary,
            reduction,
            configuration,
        })
    }
}

/// Faults of axes, units or heights between a solution and a reference. Its clock and point are for `judge`.
fn reference_faults(solution: &Solution, reference: &Reference) -> Vec<SetupFault> {
    let row = |row: &SolutionRow| StatedRow {
        t_s: row.t_s,
        state: row.state,
        has: [true; 2],
        covariance: SMatrix::from_diagonal(&row.sigma.map(|sigma| sigma * sigma).into()),
        has_correlations: false,
    };
    let rows: Vec<StatedRow> = solution.rows.iter().map(row).collect();
    let judgement = judge(&rows, reference, ReferenceOffset::default(), &[]);
    let mut faults = judgement.map_or(Vec::new(), |judgement| judgement.doubts);
    faults.retain(|fault| !matches!(fault, SetupFault::Offset(_)));
    faults
}

/// Help where the mounting is not found.
const NOT_MOUNTED: &str = "give --mounting ROLL,PITCH,YAW, or minutes of driving with braking and turns, velocities in the fixes and one clock (--gnss-delay)";

impl RecordedDrive<'_> {
    /// Brings fixes to the clock of the IMU where the two have nothing in common and no delay is given; by how much (s).
    fn common_origin(&mut self) -> Result<Option<f64>> {
        let recorded = DriveData {
            imu: &self.imu,
            gnss: &self.gnss,
            aids: &[],
        };
        let Err(apart) = check_clocks(&recorded) else {
            return Ok(None);
        };
        let given_s = self.request.gnss_delay_s;
        let found = (given_s == 0.0).then(|| rough_origin(&recorded)).flatten();
        let origin_s = found.ok_or_else(|| {
            // beginnings may lie any time apart, weeks are counted
            let weeks_s = apart.delay_s().filter(|s| s % WEEK_S == 0.0);
            let hint = weeks_s.map(|s| format!("--gnss-delay={}", given_s + s));
            let clock = || {
                "use one clock: --gnss-delay S takes S seconds off the times of the fixes".into()
            };
            Failure::from(apart).or_hint(hint.unwrap_or_else(clock))
        })?;
        self.gnss = earlier(&self.gnss, origin_s);
        Ok(Some(origin_s))
    }

    /// Refuses a wheel of another time or unit.
    fn check_wheel(&self, recorded: &DriveData<'_>, outages: &[Outage]) -> Result<()> {
        /// Tyres and speeds by noisy positions differ by less, units by more.
        const RATIO: Range<f64> = 0.6..1.55;
        let span = self.imu.first().zip(self.imu.last());
        let is_within =
            |w: &WheelSpeed| span.is_some_and(|(a, b)| (a.t_s..=b.t_s).contains(&w.t_s));
        if !self.wheel.is_empty() && !self.wheel.iter().any(is_within) {
            return refused(
                "wheel and IMU have no time in common",
                "both need one clock",
            );
        }
        match wheel_ratio(recorded, &self.wheel, outages) {
            Some(ratio) if !RATIO.contains(&ratio) => refused(
                format!("the wheel reads {ratio:.2} times the speed of the fixes"),
                "check the unit in the header: _m_s, _km_h or _mph",
            ),
            _ => Ok(()),
        }
    }
}

/// Input of the search for the cause of large innovations.
struct CauseSearch<'a> {
    filter_model: &'a FilterModel,
    start: &'a Start,
    settings: &'a FusionSettings,
    /// True if the start was given.
    is_given: bool,
}

impl CauseSearch<'_> {
    /// Cause of innovations that are large or last: the clocks, else the antenna or a small delay.
    fn cause(&self, recorded: &DriveData<'_>) -> Option<InnovationCause> {
        let small = || {
            antenna_offset(recorded, self.filter_model, self.start, self.settings)
                .map(InnovationCause::Displaced)
        };
        self.clocks(recorded)
            .map(InnovationCause::Clocks)
            .or_else(small)
    }

    /// Clocks that are apart, where the innovations are smaller when they are not: the course of what walks or slips has
    /// other turns than its body.
    fn clocks(&self, recorded: &DriveData<'_>) -> Option<ClocksApart> {
        // turns of the course tell it to tenths of a second, the innovations tell the rest
        let clocks = clocks_apart(recorded, |there| {
            antenna_offset(there, self.filter_model, &self.start(there)?, self.settings)?.delay_s
        })?;
        let gnss = earlier(recorded.gnss, clocks.delay_s);
        let without = self.nis(&DriveData {
            gnss: &gnss,
            ..*recorded
        })?;
        self.nis(recorded)
            .is_none_or(|now| without < now)
            .then_some(clocks)
    }

    /// Mean NIS per component with a start of its own.
    fn nis(&self, recorded: &DriveData<'_>) -> Option<f64> {
        Some(
            outcome(
                &fuse(
                    recorded,
                    self.filter_model,
                    &self.start(recorded)?,
                    self.settings,
                    None,
                )
                .ok()?,
                &[],
            )
            .nis_per_component,
        )
        .filter(|nis| nis.is_finite())
    }

    fn start(&self, recorded: &DriveData<'_>) -> Option<Start> {
        if self.is_given {
            Some(self.start.clone())
        } else {
            coarse(recorded, self.settings, self.filter_model)
                .ok()
                .map(|a| a.start)
        }
    }
}

impl InnovationCause {
    /// The cause, with a delay of the fixes that was given already (s).
    fn after(mut self, given_s: f64) -> Self {
        match &mut self {
            Self::Clocks(clocks) => clocks.delay_s += given_s,
            Self::Displaced(found) => found
                .delay_s
                .iter_mut()
                .for_each(|[delay_s, _]| *delay_s += given_s),
        }
        self
    }
}

/// A start that states the attitude of the vehicle: that of the IMU is known no better than the mounting.
fn beside_mounting(mut start: Start, settings: &FusionSettings) -> Start {
    for (sigma, mounting) in start
        .sigma
        .att_sigma_deg
        .iter_mut()
        .zip((settings.mounting_sigma_b / DEG).to_array())
    {
        *sigma = sigma.hypot(mounting).min(30.0).max(*sigma);
    }
    start
}

/// Heading that the motion between outages hardly shows.
fn doubt_heading(solution: &Solution, outages: &[Outage]) -> Option<String> {
    let start_s = solution.rows.first()?.t_s;
    weak_heading(
        solution
            .rows
            .iter()
            .filter(|row| !outages.iter().any(|o| o.withholds(row.t_s)))
            .map(|row| (row.t_s - start_s, row.sigma[8])),
    )
}

// The filter of a fusion: made for a recording whose trajectory is not known.

/// The filter for an IMU of that rate, these fixes and outages. A reduced filter is made for a built-in drive with
/// the receiver of the fixes; also what the reduction loses.
///
/// # Errors
/// When the model cannot be converted to the rate, or has no such filter.
fn filter_model(
    (model, states, initial): (&Model, FilterStates, &InitialSettings),
    rate_hz: f64,
    gnss: &[GnssFix],
    lengths: &[f64],
) -> Result<(FilterModel, Option<ReductionQuality>)> {
    let model = at_rate(model, rate_hz).refuse_within("the model")?;
    let interval_s = interval_s(gnss).unwrap_or(1.0);
    let window_s = reduction::window_s(lengths.iter().copied().fold(0.0, f64::max));
    let filter_model =
        FilterModel::new(&model, states, interval_s, window_s).refuse_within("the model")?;
    let drive = || {
        lincov::drive(
            &model,
            &ImuSettings::default(),
            &receiver(gnss, interval_s),
            &InitialSettings::default(),
            GravityModel::default(),
            lengths,
        )
    };
    let Some(track) = states.is_reduced().then(drive).flatten() else {
        return Ok((filter_model.with_initial(initial), None));
    };
    let filter_model =
        lincov::reduced_belief(&model, filter_model, &track, lincov::AxisGrouping::All)
            .with_initial(initial);
    let full = FilterModel::new(&model, FilterStates::Full, interval_s, window_s);
    let full = full
        .ok()
        .map(|full| full.with_initial(&beside(states, initial)));
    let made = (&model, &filter_model, full.as_ref());
    let quality = reduction_of(
        made,
        &lincov::FilterPass::new(&track, made.1),
        &Context::default(),
    );
    Ok((filter_model, quality))
}

/// Uncertainties that the filter expects beside the model, including the scale factors of its
/// states.
fn beside(states: FilterStates, initial: &InitialSettings) -> InitialSettings {
    let mut all = initial.clone();
    let ppm = states.scale_sigma() * 1e6;
    if ppm > 0.0 {
        all.accel_scale_sigma_ppm.get_or_insert(ppm);
        all.gyro_scale_sigma_ppm.get_or_insert(ppm);
    }
    all
}

/// The receiver of the fixes: medians.
fn receiver(gnss: &[GnssFix], interval_s: f64) -> GnssSettings {
    let defaults = GnssSettings::default();
    let position = |i: usize| median(gnss.iter().map(|fix| fix.pos_sigma_n[i]));
    let velocity = |i: usize| {
        let sigmas = gnss.iter();
        median(sigmas.filter_map(|fix| Some(fix.velocity?.sigma_n()[i])))
    };
    let velocities = [0, 1, 2].map(velocity);
    let has_velocity = velocities.iter().all(Option::is_some);
    GnssSettings {
        rate_hz: 1.0 / interval_s,
        pos_sigma_m: [0, 1, 2].map(|i| position(i).unwrap_or(defaults.pos_sigma_m[i])),
        vel_sigma_m_s: has_velocity.then(|| velocities.map(Option::unwrap_or_default)),
        ..defaults
    }
}

/// At the rate of the recording, without quantization noise: the filter leaves it out, and it belongs to
/// its own rate.
fn at_rate(model: &Model, rate_hz: f64) -> Result<Model, Refused> {
    let kept = |axis: &Composite| {
        Composite::new(
            axis.processes
                .iter()
                .filter(|p| p.kind() != ProcessKind::Quantization)
                .copied()
                .collect(),
        )
    };
    let axes = std::array::from_fn(|i| kept(&model.axes[i]));
    continuous::at_rate(
        &Model {
            rate_hz: model.rate_hz,
            axes,
        },
        rate_hz,
    )
}

// Verdict and figures of a fusion: `summary.json`.

const STATE: [&str; 9] = [
    "lat_deg",
    "lon_deg",
    "h_m",
    "v_n_m_s",
    "v_e_m_s",
    "v_d_m_s",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
];

/// `summary.json` of a fusion.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FuseSummary {
    schema_version: u32,
    method: &'static str,
    /// Verdict, the findings it rests on and their cause.
    pub verdict: FuseVerdict,
    /// IMU samples used.
    pub imu_samples: usize,
    /// Their rate (Hz).
    pub imu_rate_hz: f64,
    /// First time of the solution (s).
    pub start_s: f64,
    /// Last time of the solution (s).
    pub end_s: f64,
    /// States of the filter, those of a turn-on bias included.
    pub filter_states: usize,
    /// States of a turn-on bias.
    pub turn_on_states: usize,
    initial: Initial,
    #[serde(skip_serializing_if = "Option::is_none")]
    mounting: Option<MountingRow>,
    /// Root mean square of the horizontal standard deviation of the filter (m).
    pub horizontal_sigma_rms_m: f64,
    /// Factors on the stated standard deviations of position and velocity.
    #[serde(skip)]
    pub sigma_factors: [f64; 2],
    /// Correlation of the innovations, and what the filter makes of it; none where fixes are few.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gnss_correlation: Option<Value>,
    /// Vehicle motion model, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<Value>,
    /// White noise of the recording that is used instead of the model's.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub imu_noise: Vec<ExcessWhiteNoise>,
    /// Errors at the ends of windows that were withheld in a second run; none where outages were requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub withheld: Option<WithheldWindows>,
    /// Fixes, NIS, errors at the ends of outages and against the reference.
    #[serde(flatten)]
    pub outcome: FusionFigures,
}

/// Verdict on a solution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FuseVerdict {
    /// In one word.
    pub kind: VerdictKind,
    /// Evidence against the solution, the gravest first.
    pub evidence: Vec<Finding>,
    /// Cause of large innovations, where one was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<InnovationCause>,
}

/// Cause of large innovations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum InnovationCause {
    /// The clocks of IMU and GNSS differ.
    Clocks(ClocksApart),
    /// The antenna is elsewhere, or the fixes are a little late.
    Displaced(AntennaOffset),
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Initial {
    t_s: f64,
    state: BTreeMap<&'static str, f64>,
    sigma: InitialSettings,
    how: Vec<String>,
}

/// A mounting that was found: angles as `--mounting` takes them, standard deviations about front, right, down.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct MountingRow {
    roll_deg: f64,
    pitch_deg: f64,
    yaw_deg: f64,
    sigma_deg: [f64; 3],
    how: String,
}

impl Initial {
    /// The start, from the data or from a file.
    fn new(start: &Start, file: Option<&PathBuf>) -> Self {
        let stated = file.map(|file| format!("as {} says", file.display()));
        let found = start.found.as_ref().map(|found| how(start, found));
        let how = found.unwrap_or(stated.into_iter().collect());
        let state = STATE.into_iter().zip(values(&start.state)).collect();
        Self {
            t_s: start.t_s,
            state,
            sigma: start.sigma.clone(),
            how,
        }
    }
}

/// Sources of a start that was found.
fn how(start: &Start, found: &AlignmentSummary) -> Vec<String> {
    let [.., roll, pitch, yaw] = values(&start.state);
    let [tilt_sigma, _, yaw_sigma] = start.sigma.att_sigma_deg;
    let level = match found.level {
        Levelling::AtRest(until_s) => format!("levelled at rest until {until_s:.2} s"),
        Levelling::InMotion(seconds) => format!("from accelerations over {seconds:.1} s"),
    };
    let source = match (found.is_given, found.is_reversing) {
        (true, _) => "as given",
        (_, true) => "from the course in reverse",
        _ => "from the course",
    };
    vec![
        format!("roll {roll:.2}°, pitch {pitch:.2}° ± {tilt_sigma:.2}° {level}"),
        format!("heading {yaw:.1}° ± {yaw_sigma:.1}° {source}"),
    ]
}

impl From<&Mounting> for MountingRow {
    fn from(found: &Mounting) -> Self {
        // hundredths are what is printed; + 0 takes the sign from -0
        let [roll_deg, pitch_deg, yaw_deg] = found
            .angles_deg()
            .map(|a| (a * 100.0).round() / 100.0 + 0.0);
        let km = found.way_m / 1000.0;
        let widened = match found.sigma_factor {
            1.0 => String::new(),
            factor => format!("; fix sigmas × {factor:.1}"),
        };
        let how = format!(
            "from gravity, accelerations, turns and the attitude along {km:.1} km of track; assumes level roads and no side slip{widened}"
        );
        Self {
            roll_deg,
            pitch_deg,
            yaw_deg,
            sigma_deg: found.sigma_deg(),
            how,
        }
    }
}

/// Position (degrees, m), velocity, roll, pitch, yaw (degrees).
fn values(s: &NavState) -> [f64; 9] {
    let rpy = RollPitchYaw::from_quat(s.q_b_n);
    let [roll, pitch, yaw] = [rpy.roll, rpy.pitch, rpy.yaw].map(|a| a / DEG);
    [
        s.lat / DEG,
        wrap_angle(s.lon) / DEG,
        s.h,
        s.v_n.x,
        s.v_n.y,
        s.v_n.z,
        roll,
        pitch,
        yaw,
    ]
}

// What the vehicle knows of its own motion: settings, figures, table.

/// A road car's axes are known in the IMU's to a degree, its wheel's size to the wear and pressure of a tyre (1 σ).
const MOUNTING_SIGMA_DEG: f64 = 1.0;
const SCALE_SIGMA: f64 = 0.03;

impl Fuse {
    /// Aiding of the filter: only what was requested.
    fn aiding(&self) -> AidingSettings {
        let lever_arm_m = self.rear_axle_m;
        AidingSettings {
            nhc: self.nhc.then(|| NhcSettings {
                mounting_sigma_deg: MOUNTING_SIGMA_DEG,
                lever_arm_m,
                ..NhcSettings::default()
            }),
            odometer: self.odometer.as_ref().map(|_| OdometerSettings {
                scale_sigma: SCALE_SIGMA,
                lever_arm_m,
                ..OdometerSettings::default()
            }),
            zupt: self.zupt.then(ZuptSettings::default),
            heading: None,
        }
    }
}

/// Estimates at the end, and how the aids agree with the solution; none where nothing was asked for.
fn vehicle(solution: &Solution, settings: &AidingSettings) -> Option<Value> {
    if settings.is_none() {
        return None;
    }
    let mut found = json!({ "aids": aid_innovations(&solution.aids) });
    for (i, (key, unit)) in [
        ("wheel_scale", 1.0),
        ("mounting_pitch_deg", DEG),
        ("mounting_yaw_deg", DEG),
    ]
    .into_iter()
    .enumerate()
    {
        if let Some([value, sigma]) = solution
            .vehicle
            .filter(|_| settings.state_sigmas()[i] > 0.0)
            .map(|v| v.map(|estimates| estimates[i] / unit))
        {
            found[key] = json!({ "value": value, "sigma": sigma });
        }
    }
    Some(found)
}

/// Errors of fixes that last: the correlation of their innovations, standard deviations as stated, and the filter's answer.
fn fix_correlation(weighed: &WeightedSolution) -> Option<Value> {
    let [white, of_velocity] = weighed.whiteness;
    let (white, [pos_sigma_factor, vel_sigma_factor]) = (white?, weighed.sigma_factors);
    Some(json!({
        "lag_1": white.lag_1,
        "limit": white.limit,
        "vel_lag_1": of_velocity.map(|white| white.lag_1),
        "is_correlated": weighed.correlation().is_some(),
        "pos_sigma_factor": pos_sigma_factor,
        "vel_sigma_factor": vel_sigma_factor,
        "nis_as_stated": outcome(weighed.with_stated_sigmas(), &[]).nis_per_component,
    }))
}

// Files of a fusion directory: tables, track for maps, summary, page.

/// Names of the files of a fusion directory. The smoothed ones are there where that was asked for.
const FILES: [&str; 8] = [
    "solution.csv",
    "innovations.csv",
    "errors.csv",
    "solution.kml",
    "smoothed.csv",
    "errors_smoothed.csv",
    "smoothed.kml",
    "summary.json",
];

/// The files of a fusion directory; `errors.csv` is empty but for its header without a
/// reference.
fn directory(answer: &FuseAnswer) -> Vec<OutputFile<'static>> {
    let FuseAnswer {
        solution, summary, ..
    } = answer;
    let smoothed = solution.smoothed.as_deref();
    let contents = [
        Some(solution_csv(&solution.rows)),
        Some(innovations_csv(solution)),
        Some(errors_csv(&solution.rows)),
        Some(kml(&solution.rows, "solution")),
        smoothed.map(solution_csv),
        smoothed.map(errors_csv),
        smoothed.map(|rows| kml(rows, "smoothed solution")),
        Some(json(summary)),
    ];
    FILES
        .into_iter()
        .zip(contents)
        .filter_map(|(name, text)| Some(OutputFile::whole(name, text?)))
        .collect()
}

pub(super) const TIME: Columns = ("", &["t_s"], Some(6));

/// Columns of a table: prefix and names, and with how many digits; none: four after the first, and a power of ten.
pub(super) type Columns = (&'static str, &'static [&'static str], Option<usize>);

/// Rows as CSV with as many digits as their size deserves, 1e-10 degrees are 0.01 mm; NaN is an empty cell.
pub(super) fn table(columns: &[Columns], rows: impl Iterator<Item = Vec<f64>>) -> String {
    let columns: Vec<(String, Option<usize>)> = columns
        .iter()
        .flat_map(|(prefix, names, digits)| {
            names
                .iter()
                .map(move |name| (format!("{prefix}{name}"), *digits))
        })
        .collect();
    let head = columns.iter().map(|(name, _)| name.clone());
    let cell = |(x, (_, digits)): (f64, &(String, Option<usize>))| match digits {
        _ if x.is_nan() => String::new(),
        Some(digits) if x.abs() < 1e15 => format!("{x:.digits$}"),
        None => format!("{x:.4e}"),
        _ => shortest(x),
    };
    let rows = rows.map(|row| row.into_iter().zip(&columns).map(cell).collect());
    let lines = std::iter::once(head.collect()).chain(rows);
    lines
        .map(|cells: Vec<String>| cells.join(",") + "\n")
        .collect()
}

/// `solution.csv` and `smoothed.csv`: states, their standard deviations (those of latitude and longitude in degrees), bias
/// estimates, the horizontal standard deviations in metres, and those of the biases.
fn solution_csv(rows: &[SolutionRow]) -> String {
    const COLUMNS: [Columns; 10] = [
        TIME,
        ("", STATE.split_at(2).0, Some(10)),
        ("", &["h_m"], Some(5)),
        ("", STATE.split_at(6).0.split_at(3).1, Some(6)),
        ("", STATE.split_at(6).1, Some(7)),
        ("sd_", STATE.split_at(2).0, None),
        ("sd_", STATE.split_at(2).1, Some(6)),
        ("", &BIAS_NAMES, Some(9)),
        ("sd_", &["n_m", "e_m"], Some(6)),
        ("sd_", &BIAS_NAMES, Some(9)),
    ];
    let row = |row: &SolutionRow| {
        let (NavState { lat, h, .. }, sd) = (row.state, &row.sigma);
        let r = radii(lat.sin());
        let sd_lat = sd[0] / (r.meridian + h) / DEG;
        let sd_lon = sd[1] / ((r.transverse + h) * lat.cos()) / DEG;
        let [bias, bias_sigma] =
            [row.bias, row.bias_sigma].map(|b| b.map(|b| b.to_array()).concat());
        let state = values(&row.state);
        [
            &[row.t_s],
            &state[..],
            &[sd_lat, sd_lon],
            &sd[2..],
            &bias,
            &sd[..2],
            &bias_sigma,
        ]
        .concat()
    };
    table(&COLUMNS, rows.iter().map(row))
}

/// `innovations.csv`: every fix; 1 where it was used.
fn innovations_csv(solution: &Solution) -> String {
    const MEASURED: &[&str] = REPORTED_NAMES.split_at(6).0;
    const COLUMNS: [Columns; 6] = [
        TIME,
        ("", &["used"], Some(0)),
        ("", MEASURED, Some(6)),
        ("sd_", MEASURED, Some(6)),
        ("", &["nis"], Some(4)),
        ("", &["dof"], Some(0)),
    ];
    let six = |list: &[f64]| [0, 1, 2, 3, 4, 5].map(|i| list.get(i).copied().unwrap_or(f64::NAN));
    let row = |fix: &FixRecord| {
        let (used, dof) = (f64::from(u8::from(fix.used)), fix.innovation.len() as f64);
        let [innovation, sigma] = [&fix.innovation, &fix.sigma].map(|list| six(list));
        [&[fix.t_s, used], &innovation[..], &sigma, &[fix.nis, dof]].concat()
    };
    table(&COLUMNS, solution.fixes.iter().map(row))
}

fn errors_csv(rows: &[SolutionRow]) -> String {
    const COLUMNS: [Columns; 3] = [
        TIME,
        ("err_", &REPORTED_NAMES, Some(6)),
        ("", &["nees"], Some(4)),
    ];
    let row =
        |row: &SolutionRow| Some([&[row.t_s], &row.error?.values[..], &[row.error?.nees]].concat());
    table(&COLUMNS, rows.iter().filter_map(row))
}

/// The way as a line on the map, a point a second at most.
fn kml(rows: &[SolutionRow], name: &str) -> String {
    let mut line = String::new();
    let mut last = f64::NEG_INFINITY;
    for (k, row) in rows.iter().enumerate() {
        if row.t_s - last >= 1.0 - 1e-6 || k + 1 == rows.len() {
            let (lon, lat, h) = (
                wrap_angle(row.state.lon) / DEG,
                row.state.lat / DEG,
                row.state.h,
            );
            let _ = write!(line, "{lon:.8},{lat:.8},{h:.2} ");
            last = row.t_s;
        }
    }
    let points = line.trim_end();
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2">
<Document>
<Placemark>
<name>{name}</name>
<Style><LineStyle><color>ff0050ff</color><width>3</width></LineStyle></Style>
<LineString><tessellate>1</tessellate><altitudeMode>clampToGround</altitudeMode>
<coordinates>{points}</coordinates>
</LineString>
</Placemark>
</Document>
</kml>
"#
    )
}

#[cfg(test)]
mod request_tests {
    use super::*;

    /// At rest and level an accelerometer measures g upwards: −z of front, right, down.
    #[test]
    fn axes_of_loggers_are_rotations_to_front_right_down() {
        for (name, x, y) in [("flu", DVec3::X, DVec3::NEG_Y), ("rfu", DVec3::Y, DVec3::X)] {
            let Ok(MountingChoice::Given(q, _)) = name.parse() else {
                panic!("{name}");
            };
            let found = [DVec3::X, DVec3::Y, DVec3::Z].map(|v| (q * v).round());
            assert_eq!(found, [x, y, DVec3::NEG_Z], "{name}");
        }
        let asked = crate::app::Invocation::<Fuse>::of(["imu.csv", "gnss.csv", "m.toml"]).unwrap();
        let settings = asked.request.settings();
        assert_eq!(settings.q_s_b, DQuat::IDENTITY);
    }

    #[test]
    fn standard_deviations_of_a_receiver() {
        let sigma = |text| fix_sigma(text).map(|s| (s.pos_m, s.vel_m_s));
        assert_eq!(sigma("2"), Ok(([2.0; 3], None)));
        assert_eq!(sigma("2,2,4:0.1"), Ok(([2.0, 2.0, 4.0], Some([0.1; 3]))));
        assert_eq!(
            sigma("1:0.1,0.1,0.2"),
            Ok(([1.0; 3], Some([0.1, 0.1, 0.2])))
        );
        for bad in ["", "0", "1,2", "nan", "1:", "1:2:3", "1,2,-3"] {
            assert!(sigma(bad).is_err(), "{bad}");
        }
    }
}
