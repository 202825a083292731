//! The files of a fusion.

use super::Args;
use crate::cli::{Failure, Session, parse, read};
use glam::DQuat;
use nav_sim::data::fusion_files::{FusionFileError, ImuFile, read_gnss, read_imu, read_initial};
use nav_sim::ekf::{Belief, FilterStates, InitialSettings};
use nav_sim::frames::RollPitchYaw;
use nav_sim::fusion::alignment::{self, Alignment};
use nav_sim::fusion::{FusionError, Recorded, Settings, Start, check_clocks};
use nav_sim::gnss::GnssFix;
use nav_sim::noise::{Composite, Model, Process, continuous, reduction};
use nav_sim::report::Input;
use nav_sim::sensors::outage::{Outage, OutagePlan};
use nav_sim::trajectory::reference::Reference;
use nav_sim::units::DEG;
use std::path::{Path, PathBuf};

impl From<FusionFileError> for Failure {
    fn from(e: FusionFileError) -> Self {
        let failure = if e.is_io() { Self::could_not(&e) } else { Self::input(&e) };
        // without the option of the commands for static recordings
        let hint = e.hint().map(|h| h.replace("give the names with --columns", "correct the header"));
        failure.maybe_hint(hint)
    }
}

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
        let imu = read_imu(&args.imu)?;
        let (mut gnss, remarks) = read_gnss(&args.gnss)?;
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

/// The IMU in the vehicle.
pub(super) fn mounting(angles_deg: Option<parse::Triple>) -> DQuat {
    let Some(parse::Triple([roll, pitch, yaw])) = angles_deg else { return DQuat::IDENTITY };
    RollPitchYaw { roll: roll * DEG, pitch: pitch * DEG, yaw: yaw * DEG }.to_quat()
}

/// The settings with outages as `run` has them: those that overlap or touch are one.
pub(super) fn with_outages(
    mut settings: Settings,
    recorded: &Recorded<'_>,
    session: &Session,
) -> Result<Settings, Failure> {
    check_outages(&settings.outages, recorded)?;
    let asked = settings.outages.len();
    let plan = OutagePlan { fixed: settings.outages, ..OutagePlan::default() };
    settings.outages = plan.windows((f64::NEG_INFINITY, f64::INFINITY), 0).map_err(Failure::input)?;
    if settings.outages.len() < asked {
        session.printer.warn("outages that overlap or touch are made one");
    }
    Ok(settings)
}

/// An outage outside the data withholds nothing, or less than it says: that is a mistake.
fn check_outages(outages: &[Outage], recorded: &Recorded<'_>) -> Result<(), Failure> {
    let (first, last) = (recorded.gnss.first(), recorded.gnss.last());
    let span = first.zip(last).map(|(a, b)| format!("the fixes run from {} to {} s", a.t_s, b.t_s));
    let empty = |o: &&Outage| !recorded.gnss.iter().any(|f| o.withholds(f.t_s + 1e-9));
    if let Some(o) = outages.iter().find(empty) {
        let message = format!("--outage {}:{} withholds no fix", o.start_s, o.end_s);
        return Err(Failure::input(message).maybe_hint(span));
    }
    let outside = |o: &&Outage| {
        // an outage may last until a fix later than the last would come
        let interval = recorded.gnss.windows(2).map(|w| w[1].t_s - w[0].t_s).fold(0.0, f64::max);
        let over = |t: Option<&GnssFix>, sign: f64, at: f64| {
            t.is_some_and(|f| sign * (at - f.t_s) > interval + 1e-6)
        };
        over(first, -1.0, o.start_s) || over(last, 1.0, o.end_s)
    };
    if let Some(o) = outages.iter().find(outside) {
        let message = format!("--outage {}:{} does not lie within the fixes", o.start_s, o.end_s);
        return Err(Failure::input(message).maybe_hint(span));
    }
    Ok(())
}

fn scale(gnss: &mut [GnssFix], position: f64, velocity: f64) {
    for fix in gnss {
        fix.pos_sigma_n *= position;
        if let Some((_, sigma)) = &mut fix.velocity {
            *sigma *= velocity;
        }
    }
}

/// The filter's states for the model at the rate of the recording, with what it expects at the start.
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
    let model = at_rate(&file.model, imu.rate_hz).map_err(|e| Failure::input(format!("{shown}: {e}")))?;
    if (imu.rate_hz / file.model.rate_hz - 1.0).abs() > 0.01 {
        let (from, to) = (file.model.rate_hz, imu.rate_hz);
        session.printer.say(&format!("{shown}: converted from {from} Hz to {to:.3} Hz"));
    }
    let longest = settings.outages.iter().map(|o| o.end_s - o.start_s).fold(0.0, f64::max);
    let mut steps: Vec<f64> = gnss.windows(2).map(|w| w[1].t_s - w[0].t_s).collect();
    steps.sort_by(f64::total_cmp);
    let interval_s = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
    let window_s = reduction::window_s(longest);
    let mut states = FilterStates::default();
    args.filter.over(&mut states, &mut initial);
    initial.validate().map_err(Failure::input)?;
    let belief = Belief::new(&model, states, interval_s, window_s)
        .map_err(|e| Failure::input(format!("{shown}: {e}")))?;
    Ok(belief.with_initial(&initial))
}

/// At the rate of the recording, without quantization noise: the filter leaves it out, and it belongs to
/// its own rate.
fn at_rate(model: &Model, rate_hz: f64) -> Result<Model, continuous::RateError> {
    let kept = |axis: &Composite| {
        let processes = axis.processes.iter().filter(|p| !matches!(p, Process::Quantization(_)));
        Composite::new(processes.copied().collect())
    };
    let axes = std::array::from_fn(|i| kept(&model.axes[i]));
    continuous::at_rate(&Model { rate_hz: model.rate_hz, axes }, rate_hz)
}

/// Where an output would fall on an input.
pub(super) fn guarded(out: &Path, inputs: &[Input]) -> Result<(), Failure> {
    for name in nav_sim::report::FUSION_FILES {
        let paths = inputs.iter().map(|i| Path::new(&i.path));
        nav_sim::data::atomic::guard_inputs(&out.join(name), paths)?;
    }
    Ok(())
}
