//! The files of a fusion.

use super::Args;
use crate::cli::run::Words;
use crate::cli::{Failure, Session, parse, read, turn_on};
use crate::ekf::{Belief, FilterStates, InitialSettings};
use crate::formats::fusion_files::{FixSigma, ImuFile, read_gnss, read_imu, read_initial};
use crate::frames::RollPitchYaw;
use crate::fusion::alignment::{self, Alignment};
use crate::fusion::{FusionError, Recorded, Settings, Start, check_clocks};
use crate::gnss::GnssFix;
use crate::jobs::{FusionFilter, FusionFilterError};
use crate::report::Input;
use crate::sensors::outage::{FixedData, OutagePlan, PlacedOutages};
use crate::trajectory::reference::Reference;
use crate::units::DEG;
use glam::{DMat3, DQuat, DVec3};
use std::path::PathBuf;

/// What was read, ready to use.
pub(super) struct Inputs {
    pub(super) imu: ImuFile,
    pub(super) gnss: Vec<GnssFix>,
    pub(super) belief: Belief,
    pub(super) reference: Option<Reference>,
    initial: Option<Start>,
    /// Every file with its hash.
    pub(super) files: Vec<Input>,
}

impl Inputs {
    pub(super) fn read(args: &Args, settings: &Settings, session: &Session) -> Result<Self, Failure> {
        let given = (args.initial.as_os_str() != "auto").then_some(&args.initial);
        let mut named: Vec<(&str, &PathBuf)> =
            vec![("imu", &args.imu), ("gnss", &args.gnss), ("model", &args.model)];
        named.extend(given.map(|p| ("initial", p)));
        named.extend(args.reference.iter().map(|p| ("reference", p)));
        let files = named.iter().map(|(role, path)| read::input(role, path)).collect::<Result<_, _>>()?;
        let imu = read_imu(&args.imu).map_err(read::refused_for_fusion)?;
        let (mut gnss, remarks) =
            read_gnss(&args.gnss, args.gnss_sigma.as_ref()).map_err(read::refused_for_fusion)?;
        imu.remarks.iter().chain(&remarks).for_each(|r| session.printer.warn(r));
        if let Some(parse::Pair([position, velocity])) = args.gnss_sigma_factor {
            scale(&mut gnss, position, velocity);
        }
        check_clocks(&Recorded { imu: &imu.samples, gnss: &gnss }).map_err(impossible)?;
        let initial = given.map(|path| read_initial(path)).transpose()?;
        let start = initial.as_ref().map(|start| start.sigma.clone()).unwrap_or_default();
        let belief = belief(args, start, settings, &imu, &gnss, session)?;
        let reference = args.reference.as_deref().map(|path| read::reference(path, session)).transpose()?;
        Ok(Self { imu, gnss, belief, reference, initial, files })
    }

    /// Where the filter starts.
    pub(super) fn start(
        &self,
        args: &Args,
        recorded: &Recorded<'_>,
        settings: &Settings,
    ) -> Result<Alignment, Failure> {
        if let Some(start) = &self.initial {
            return Ok(Alignment { start: start.clone(), doubts: Vec::new() });
        }
        alignment::coarse(recorded, settings, &self.belief).map_err(|e| {
            let failure = Failure::input(format!("{}: {e}", args.gnss.display()));
            failure.hint("give the start with --initial FILE (t_s, lat_deg, lon_deg, h_m, roll_deg, pitch_deg, yaw_deg)")
        })
    }
}

/// What does not fit together.
pub(super) fn impossible(e: FusionError) -> Failure {
    let failure =
        if matches!(e, FusionError::Diverged { .. }) { Failure::could_not(&e) } else { Failure::input(&e) };
    failure.maybe_hint(e.hint())
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

/// The IMU in the vehicle: its axes named as the logger names them, turned by the mounting.
pub(super) fn mounting(axes: LoggerAxes, angles_deg: Option<parse::Triple>) -> DQuat {
    let frd = angles_deg.map_or(DQuat::IDENTITY, |parse::Triple([roll, pitch, yaw])| {
        RollPitchYaw { roll: roll * DEG, pitch: pitch * DEG, yaw: yaw * DEG }.to_quat()
    });
    frd * axes.to_frd()
}

/// The settings with their outages placed on the fixes.
pub(super) fn with_outages(
    settings: Settings,
    recorded: &Recorded<'_>,
    session: &Session,
) -> Result<Settings, Failure> {
    let times_s: Vec<f64> = recorded.gnss.iter().map(|fix| fix.t_s).collect();
    let plan = OutagePlan { fixed: settings.outages.clone(), ..OutagePlan::default() };
    let PlacedOutages { windows, remarks } = plan.on(&FixedData::recorded(&times_s), 0)?;
    remarks.iter().for_each(|remark| session.printer.warn(&remark.to_string()));
    Ok(Settings { outages: windows, ..settings })
}

fn scale(gnss: &mut [GnssFix], position: f64, velocity: f64) {
    for fix in gnss {
        fix.pos_sigma_n *= position;
        if let Some((_, sigma)) = &mut fix.velocity {
            *sigma *= velocity;
        }
    }
}

/// The filter for the model, with what it expects at the start.
fn belief(
    args: &Args,
    mut initial: InitialSettings,
    settings: &Settings,
    imu: &ImuFile,
    gnss: &[GnssFix],
    session: &Session,
) -> Result<Belief, Failure> {
    let shown = args.model.display();
    let file = read::model(&args.model, session)?;
    let (from, to) = (file.model.rate_hz, imu.rate_hz);
    if (to / from - 1.0).abs() > 0.01 {
        session.printer.say(&format!("{shown}: converted from {from} Hz to {to:.3} Hz"));
    }
    let mut states = FilterStates::default();
    args.filter.over(&mut states, &mut initial);
    turn_on::expect(&mut initial, &file, &args.model, session);
    initial.validate().map_err(Failure::input)?;
    let filter = FusionFilter { model: &file.model, states, initial: &initial };
    filter.belief(to, gnss, &settings.outages, &Words::new(session)).map_err(|e| match e {
        FusionFilterError::Reduction(e) => Failure::could_not(e),
        e => Failure::input(format!("{shown}: {e}")),
    })
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
