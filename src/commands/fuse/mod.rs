//! `nav-sim fuse`: the filter on recorded data.

mod document;
mod drive;
mod files;
mod summary;

pub use drive::FuseAnswer;
pub use summary::{Cause, FuseSummary};

use crate::app::inputs::files;
use crate::app::{Answer, Command, Context, Failure, Out, OutputFile, Result};
use drive::Drive;
use glam::{DMat3, DQuat, DVec3};
use nav_sim_document::Document;
use nav_sim_navigation::earth::GravityModel;
use nav_sim_navigation::ekf::{FilterStates, InitialSettings};
use nav_sim_navigation::frames::RollPitchYaw;
use nav_sim_navigation::fusion::alignment::AlignmentError;
use nav_sim_navigation::fusion::mounting::MountingError;
use nav_sim_navigation::fusion::{Correlation, FusionError, Heading, Settings};
use nav_sim_navigation::gnss::FixSigma;
use nav_sim_navigation::metrics::VerdictKind;
use nav_sim_navigation::sensors::gnss::MAX_LEVER_ARM_M;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_signal::units::DEG;
use serde_json::json;
use std::path::PathBuf;
use std::str::FromStr;

impl Command for Fuse {
    type Answer = FuseAnswer;
    const NAME: &'static str = "fuse";
    const OUT: Out = Out::Directory {
        path: "out/fuse",
        files: &self::files::FILES,
    };
    const PLOT: bool = false;

    fn inputs(&self) -> Result<Vec<(&'static str, PathBuf)>> {
        Ok(files("imu", [&self.imu])
            .chain(files("gnss", [&self.gnss]))
            .chain(files("model", [&self.model]))
            .chain(files("initial", self.initial_file()))
            .chain(files("odometer", &self.odometer))
            .chain(files("reference", &self.reference))
            .collect())
    }

    fn run(&self, context: &Context<'_>) -> Result<FuseAnswer> {
        Drive::read(self, context)?.fuse(context)
    }
}

impl Answer for FuseAnswer {
    fn document(&self) -> Document {
        self.page()
    }

    fn files(&self) -> Vec<OutputFile<'_>> {
        self::files::directory(self)
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
/// or NMEA sentences (GGA; RMC or VTG, GST), in seconds of the day or in Unix time, as the IMU is. A log (MCAP, bag,
/// ULog, UBX) may be either, or both. Gaps of up to 5 s are bridged, with the uncertainty that the recording shows over such times elsewhere. Writes solution.csv,
/// innovations.csv, errors.csv (with a reference), solution.kml, summary.json, report.html, manifest.json; with
/// --smooth also smoothed.csv, errors_smoothed.csv, smoothed.kml. Exit code 3: the solution is overconfident.
#[derive(clap::Args, Debug, Clone)]
#[command(before_help = "\
Examples:
  nav-sim trajectory record trajectories/land_vehicle.toml calib_data/tactical.toml -o drive
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --reference drive/reference.csv --outage 300:360 --smooth -o out/fused
  nav-sim fuse drive/imu.csv drive/gnss.csv calib_data/tactical.toml \\
      --initial drive/initial.toml -o out/given")]
pub struct Fuse {
    /// IMU recording (.csv, .tsv, .txt, .npy, also .gz)
    #[arg(value_name = "IMU")]
    pub imu: PathBuf,
    /// GNSS fixes (.csv, .txt, .pos, .nmea, also .gz)
    #[arg(value_name = "GNSS")]
    pub gnss: PathBuf,
    /// Noise model that the filter believes
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// Initial state: a file (TOML); the heading and its standard deviation (degrees), where the course does not show it;
    /// auto: level from the IMU, heading from the GNSS course
    #[arg(
        long,
        alias = "heading",
        value_name = "FILE|DEG:SD|auto",
        default_value = "auto",
        allow_hyphen_values = true
    )]
    pub initial: StartChoice,
    /// GNSS antenna from the IMU: front, right, down (m)
    #[arg(long = "lever-arm", value_name = "X,Y,Z", value_parser = arm, default_value = "0,0,0",
        hide_default_value = true, allow_hyphen_values = true)]
    pub lever_arm_m: [f64; 3],
    /// Attitude of the IMU in the vehicle (degrees) if its axes are not front, right, down; after a colon the standard
    /// deviations about the vehicle's front, right, down (1 where not given); flu or rfu: axes of that name; auto:
    /// estimated from the drive of a road vehicle
    #[arg(
        long,
        value_name = "ROLL,PITCH,YAW[:SD,SD,SD]|flu|rfu|auto",
        allow_hyphen_values = true
    )]
    pub mounting: Option<MountingChoice>,
    /// Reference trajectory to compare with; stretches where it jumps are left out
    #[arg(long, value_name = "TRAJECTORY")]
    pub reference: Option<PathBuf>,
    /// Window in which fixes are withheld, on the clock of the data in seconds (repeatable)
    #[arg(long = "outage", value_name = "START:END")]
    pub outages: Vec<Outage>,
    /// States of the filter: 15 (one bias an axis, to which the model is reduced), 21 (and a scale factor an axis) or
    /// full (a bias state for each process)
    #[arg(long, value_name = "STATES", default_value = "15")]
    pub filter: FilterStates,
    /// Constant biases that the filter expects beside the model: standard deviations, accelerometer in m/s²,
    /// gyroscope in rad/s
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = at_least_zero)]
    pub turn_on_bias: Option<[f64; 2]>,
    /// Standard deviations where the GNSS file states none: of the position in m, and after a colon of the velocity in
    /// m/s; each one number or north,east,down. x3 or x3:2: times what it states
    #[arg(long, value_name = "POS[:VEL]|xPOS[:VEL]", value_parser = gnss_sigma)]
    pub gnss_sigma: Option<GnssSigma>,
    /// Time by which receiver or logger stamp the fixes late (s)
    #[arg(long = "gnss-delay", value_name = "S", value_parser = number, default_value = "0", allow_hyphen_values = true)]
    pub gnss_delay_s: f64,
    /// How long errors of positions last: as the innovations show, no longer than a fix, or so many seconds
    #[arg(long, value_name = "auto|none|SECONDS", value_parser = correlation, default_value = "auto")]
    pub gnss_correlation: Correlation,
    /// Road vehicle: its rear axle moves neither sideways nor up; needs the mounting of the IMU
    #[arg(long)]
    pub nhc: bool,
    /// The velocity is zero where IMU and fixes show that the vehicle stands
    #[arg(long)]
    pub zupt: bool,
    /// Speed of a wheel: a table of t_s and wheel_m_s (or _km_h), negative in reverse; its scale is estimated
    #[arg(long, value_name = "FILE")]
    pub odometer: Option<PathBuf>,
    /// Middle of the rear axle from the IMU: front, right, down (m)
    #[arg(long = "rear-axle", value_name = "X,Y,Z", value_parser = arm, default_value = "0,0,0",
        hide_default_value = true, allow_hyphen_values = true)]
    pub rear_axle_m: [f64; 3],
    /// Names of the IMU's columns, for a file without a header or instead of it
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub columns: Option<Vec<String>>,
    /// Topic of the IMU in a log that has several; after a comma that of the fixes
    #[arg(long, value_name = "IMU[,FIXES]", value_delimiter = ',')]
    pub topic: Vec<String>,
    /// Also smooth the solution: every row is then estimated from all fixes, later ones included
    #[arg(long)]
    pub smooth: bool,
}

impl Fuse {
    /// The file of the initial state; none where it is found in the data.
    pub(super) fn initial_file(&self) -> Option<&PathBuf> {
        if let StartChoice::File(path) = &self.initial {
            Some(path)
        } else {
            None
        }
    }

    /// Heading at the start, where it is given.
    pub(super) fn given_heading(&self) -> Option<Heading> {
        match self.initial {
            StartChoice::Heading(heading) => Some(heading),
            _ => None,
        }
    }

    /// The filter's expectation of constant biases, over that of a file.
    pub(super) fn expected(&self, of_file: InitialSettings) -> InitialSettings {
        let Some([accel, gyro]) = self.turn_on_bias else {
            return of_file;
        };
        InitialSettings {
            accel_bias_sigma_m_s2: Some(accel),
            gyro_bias_sigma_rad_s: Some(gyro),
            ..of_file
        }
    }

    /// Settings of the filter's run.
    pub(super) fn settings(&self) -> Settings {
        let (q_s_b, mounting_sigma_b) = match self.mounting {
            Some(MountingChoice::Given(q_s_b, sigma_b)) => (q_s_b, sigma_b),
            _ => (DQuat::IDENTITY, DVec3::ZERO),
        };
        Settings {
            q_s_b,
            mounting_sigma_b,
            lever_arm_b: self.lever_arm_m.into(),
            gravity: GravityModel::default(),
            outages: self.outages.clone(),
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
        match (list(angles), list(sigma)) {
            (Some([roll, pitch, yaw]), Some(sigma_deg))
                if sigma_deg.iter().all(|s: &f64| (0.0..=MAX_SIGMA_DEG).contains(s)) =>
            {
                let [roll, pitch, yaw] = [roll, pitch, yaw].map(|angle: f64| angle * DEG);
                let q_s_b = RollPitchYaw { roll, pitch, yaw }.to_quat();
                Ok(Self::Given(q_s_b, DVec3::from(sigma_deg) * DEG))
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

/// Finite numbers between commas.
fn list<const N: usize>(text: &str) -> Option<[f64; N]> {
    let all: Option<Vec<f64>> = text.split(',').map(|x| number(x.trim()).ok()).collect();
    all?.try_into().ok()
}

pub(super) fn number(text: &str) -> Result<f64, &'static str> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite())
        .ok_or("not a finite number")
}

fn arm(text: &str) -> Result<[f64; 3], String> {
    let arm: [f64; 3] = list(text).ok_or("expected 3 numbers between commas")?;
    match arm.iter().all(|metres| metres.abs() <= MAX_LEVER_ARM_M) {
        true => Ok(arm),
        false => Err(format!("more than {MAX_LEVER_ARM_M} m")),
    }
}

fn at_least_zero(text: &str) -> Result<[f64; 2], &'static str> {
    let pair = list(text).filter(|pair| pair.iter().all(|x| *x >= 0.0));
    pair.ok_or("expected two numbers ≥ 0, such as 0.1,0.002")
}

fn correlation(text: &str) -> Result<Correlation, &'static str> {
    match text {
        "auto" => Ok(Correlation::Auto),
        "none" => Ok(Correlation::None),
        _ => number(text)
            .ok()
            .filter(|seconds| *seconds > 0.0)
            .map(Correlation::Seconds)
            .ok_or("expected auto, none, or a correlation time in seconds"),
    }
}

fn gnss_sigma(text: &str) -> Result<GnssSigma, &'static str> {
    let Some(factors) = text.strip_prefix('x') else {
        return Ok((Some(fix_sigma(text)?), [1.0; 2]));
    };
    let (position, velocity) = factors.split_once(':').unwrap_or((factors, factors));
    let factor = |text: &str| number(text).ok().filter(|factor| *factor > 0.0);
    let both = factor(position).zip(factor(velocity));
    both.map(|(position, velocity)| (None, [position, velocity]))
        .ok_or("expected factors > 0: x3 or x3:2")
}

/// `POS` or `N,E,D` in metres, then `:VEL` or `:N,E,D` in m/s.
fn fix_sigma(text: &str) -> Result<FixSigma, &'static str> {
    let three = |part: &str| {
        let three = list::<3>(part).or(list::<1>(part).map(|[all]| [all; 3]));
        three.filter(|sigma| sigma.iter().all(|x| *x > 0.0)).ok_or(
            "expected metres above 0, one or three (north, east, down), and after a colon m/s: 2,2,4:0.1",
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
        let asked = crate::app::Asked::<Fuse>::of(["imu.csv", "gnss.csv", "m.toml"]).unwrap();
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
        let numbers = text
            .split_once(':')
            .map(|(deg, sigma)| (number(deg), number(sigma)));
        match numbers {
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
            FusionError::Clocks { .. } => e.delay_s().map(|s| format!("--gnss-delay {s}")),
            FusionError::Start { .. } => {
                Some("give t_s of the initial state on the clock of the IMU".to_owned())
            }
            FusionError::Place { .. } => {
                Some("check t_s, lat_deg, lon_deg and pos_sigma_m of the initial state".to_owned())
            }
            FusionError::Memory { .. } => {
                Some("a filter of fewer states, or the drive in parts".to_owned())
            }
            FusionError::Diverged { .. } => {
                let failure = Self::could_not(&e);
                return failure.hint("check axes, units and the initial state");
            }
            _ => None,
        };
        Self::input(e).maybe_hint(hint)
    }
}

impl From<AlignmentError> for Failure {
    fn from(e: AlignmentError) -> Self {
        Self::input(e)
            .hint("give the heading with --initial DEG:SD, or the whole start with --initial FILE")
    }
}

impl From<MountingError> for Failure {
    fn from(e: MountingError) -> Self {
        Self::input(e).hint(
            "give --mounting ROLL,PITCH,YAW, or minutes of driving with braking and turns, and velocities in the fixes",
        )
    }
}
