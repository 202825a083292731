//! The files of a fusion.

use super::Args;
use crate::cli::{Failure, Session, parse, read, turn_on};
use crate::formats::fusion_files::{read_gnss, read_imu, read_initial};
use crate::formats::model_file::ModelFile;
use crate::jobs::RecordedDrive;
use crate::report::{FusionConfiguration, Input};
use glam::{DMat3, DQuat, DVec3};
use nav_sim_navigation::ekf::{FilterStates, InitialSettings};
use nav_sim_navigation::frames::RollPitchYaw;
use nav_sim_navigation::fusion::Settings;
use nav_sim_navigation::fusion::mounting::Mounted;
use nav_sim_navigation::gnss::FixSigma;
use nav_sim_signal::units::DEG;
use std::path::PathBuf;

/// What was read, ready to use.
pub(super) struct Inputs {
    pub(super) drive: RecordedDrive,
    pub(super) model: ModelFile,
    pub(super) states: FilterStates,
    /// What the filter expects at the start, and of the IMU beside the model.
    pub(super) expected: InitialSettings,
}

impl Inputs {
    /// Reads them; also every file with its hash.
    pub(super) fn read(args: &Args, session: &Session) -> Result<(Self, Vec<Input>), Failure> {
        let given = (args.initial.as_os_str() != "auto").then_some(&args.initial);
        let mut named: Vec<(&str, &PathBuf)> =
            vec![("imu", &args.imu), ("gnss", &args.gnss), ("model", &args.model)];
        named.extend(given.map(|p| ("initial", p)));
        named.extend(args.reference.iter().map(|p| ("reference", p)));
        let files = named.iter().map(|(role, path)| read::input(role, path)).collect::<Result<_, _>>()?;
        let imu = read_imu(&args.imu).map_err(read::refused_for_fusion)?;
        let ends_s = imu.samples.first().zip(imu.samples.last()).map(|(first, last)| (first.t_s, last.t_s));
        let (gnss, remarks) =
            read_gnss(&args.gnss, args.gnss_sigma.as_ref(), ends_s).map_err(read::refused_for_fusion)?;
        imu.remarks.iter().chain(&remarks).for_each(|remark| session.printer.remark(remark));
        let initial = given.map(|path| read_initial(path)).transpose()?;
        let model = read::model(&args.model, session)?;
        let (from, to) = (model.model.rate_hz, imu.rate_hz);
        if (to / from - 1.0).abs() > 0.01 {
            let shown = args.model.display();
            session.say(format!("{shown}: converted from {from} Hz to {to:.3} Hz"));
        }
        let mut expected = initial.as_ref().map(|start| start.sigma.clone()).unwrap_or_default();
        let mut states = FilterStates::default();
        args.filter.over(&mut states, &mut expected);
        turn_on::expect(&mut expected, &model, &args.model, session);
        expected.validate().map_err(Failure::input)?;
        let reference = args.reference.as_deref().map(|path| read::reference(path, session)).transpose()?;
        let mut drive = RecordedDrive {
            imu: imu.samples,
            rate_hz: imu.rate_hz,
            gnss,
            delay_s: 0.0,
            mounted: args.mounting.map_or_else(Mounted::default, MountingArg::mounted),
            initial,
            reference,
        };
        if let Some(parse::Pair([position, velocity])) = args.gnss_sigma_factor {
            drive.scale_sigma(position, velocity);
        }
        drive.earlier(args.gnss_delay);
        Ok((Self { drive, model, states, expected }, files))
    }

    /// What decides the fusion beside the files.
    pub(super) fn configuration(&self, args: &Args, settings: &Settings) -> FusionConfiguration {
        FusionConfiguration {
            settings: settings.clone(),
            mounted: self.drive.mounted,
            filter: self.states,
            initial: self.expected.clone(),
            gnss_sigma: args.gnss_sigma,
            gnss_sigma_factor: args.gnss_sigma_factor.map_or([1.0; 2], |factor| factor.0),
            gnss_delay_s: args.gnss_delay,
        }
    }
}

/// What a logger calls x, y and z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub(super) enum LoggerAxes {
    /// Front, right, down
    #[default]
    Frd,
    /// Front, left, up
    Flu,
    /// Right, front, up: east, north, up of an IMU that points north
    Rfu,
    /// The same as rfu
    Enu,
}

impl LoggerAxes {
    /// Takes a vector in the logger's axes to front, right, down.
    fn to_frd(self) -> DQuat {
        let columns = match self {
            Self::Frd => return DQuat::IDENTITY,
            Self::Flu => [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z],
            Self::Rfu | Self::Enu => [DVec3::Y, DVec3::X, DVec3::NEG_Z],
        };
        DQuat::from_mat3(&DMat3::from_cols(columns[0], columns[1], columns[2]))
    }
}

/// `POS` or `N,E,D` in metres, then `:VEL` or `:N,E,D` in m/s.
pub(super) fn parse_sigma(text: &str) -> Result<FixSigma, String> {
    let three = |part: &str| {
        let numbers: Option<Vec<f64>> = part.split(',').map(|x| x.trim().parse().ok()).collect();
        let numbers = numbers.filter(|n| n.iter().all(|x: &f64| x.is_finite() && *x > 0.0))?;
        match numbers[..] {
            [all] => Some([all; 3]),
            [n, e, d] => Some([n, e, d]),
            _ => None,
        }
    };
    let (position, velocity) = text.split_once(':').map_or((text, None), |(p, v)| (p, Some(v)));
    let expected =
        || "expected metres above 0, one or three (north, east, down), and after a colon m/s: 2,2,4:0.1";
    let pos_m = three(position).ok_or_else(expected)?;
    let vel_m_s = velocity.map(|v| three(v).ok_or_else(expected)).transpose()?;
    Ok(FixSigma { pos_m, vel_m_s })
}

/// How the IMU sits in the vehicle, as the user says.
#[derive(Debug, Clone, Copy)]
pub(super) enum MountingArg {
    /// Found from the drive.
    Auto,
    /// Roll, pitch, yaw, and their standard deviations about the vehicle's front, right, down (degrees).
    Angles(parse::Triple, parse::Triple),
}

impl MountingArg {
    fn mounted(self) -> Mounted {
        match self {
            Self::Auto => Mounted::AsFound,
            Self::Angles(..) => Mounted::AsGiven,
        }
    }

    /// Standard deviations about front, right, down (rad).
    pub(super) fn sigma_b(self) -> DVec3 {
        match self {
            Self::Auto => DVec3::ZERO,
            Self::Angles(_, sigma_deg) => DVec3::from(sigma_deg.0) * DEG,
        }
    }
}

/// Largest standard deviation of a mounting that small angles describe (degrees).
const MAX_MOUNTING_SIGMA_DEG: f64 = 30.0;

/// `auto` or `ROLL,PITCH,YAW[:SD,SD,SD]` in degrees.
pub(super) fn parse_mounting(text: &str) -> Result<MountingArg, String> {
    if text == "auto" {
        return Ok(MountingArg::Auto);
    }
    let (angles, sigma) = text.split_once(':').unwrap_or((text, "0,0,0"));
    let known = |sigma: &parse::Triple| sigma.0.iter().all(|s| (0.0..=MAX_MOUNTING_SIGMA_DEG).contains(s));
    let both = parse::triple(angles).ok().zip(parse::triple(sigma).ok().filter(known));
    both.map(|(angles, sigma)| MountingArg::Angles(angles, sigma)).ok_or_else(|| {
        format!(
            "expected roll, pitch, yaw in degrees, such as -9.5,-60.8,-166.8, or with standard deviations of 0 to \
             {MAX_MOUNTING_SIGMA_DEG}° about the vehicle's front, right, down, -9.5,-60.8,-166.8:1.5,0.5,0.8, or auto"
        )
    })
}

/// The IMU in the vehicle: its axes named as the logger names them, turned by the mounting.
pub(super) fn mounting(axes: LoggerAxes, angles: Option<MountingArg>) -> DQuat {
    let frd = match angles {
        Some(MountingArg::Angles(parse::Triple([roll, pitch, yaw]), _)) => {
            RollPitchYaw { roll: roll * DEG, pitch: pitch * DEG, yaw: yaw * DEG }.to_quat()
        }
        Some(MountingArg::Auto) | None => DQuat::IDENTITY,
    };
    frd * axes.to_frd()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At rest and level an accelerometer measures g upwards: −z of front, right, down.
    #[test]
    fn axes_of_loggers_are_rotations_to_front_right_down() {
        let to = |axes: LoggerAxes, v: DVec3| (axes.to_frd() * v).round();
        for axes in [LoggerAxes::Flu, LoggerAxes::Rfu, LoggerAxes::Enu] {
            assert_eq!(to(axes, DVec3::Z), DVec3::NEG_Z, "{axes:?}");
        }
        assert_eq!((to(LoggerAxes::Flu, DVec3::X), to(LoggerAxes::Flu, DVec3::Y)), (DVec3::X, DVec3::NEG_Y));
        assert_eq!((to(LoggerAxes::Rfu, DVec3::X), to(LoggerAxes::Rfu, DVec3::Y)), (DVec3::Y, DVec3::X));
        assert_eq!(mounting(LoggerAxes::Frd, None), DQuat::IDENTITY);
    }

    #[test]
    fn standard_deviations_of_a_receiver() {
        let sigma = |text| parse_sigma(text).map(|s| (s.pos_m, s.vel_m_s));
        assert_eq!(sigma("2"), Ok(([2.0; 3], None)));
        assert_eq!(sigma("2,2,4:0.1"), Ok(([2.0, 2.0, 4.0], Some([0.1; 3]))));
        assert_eq!(sigma("1:0.1,0.1,0.2"), Ok(([1.0; 3], Some([0.1, 0.1, 0.2]))));
        for bad in ["", "0", "1,2", "nan", "1:", "1:2:3", "1,2,-3"] {
            assert!(sigma(bad).is_err(), "{bad}");
        }
    }
}
