//! Common data of all runs of an experiment, computed once: ideal samples, reference, schedule.

use super::gains::{Gains, SharedGains};
use super::lincov::Track;
use crate::earth::{GravityModel, MAX_LATITUDE};
use crate::ekf::{FilterModel, FixUpdate, InitialSettings};
use crate::frames::NavState;
use crate::imu::ImuSample;
use crate::noise::continuous::same_rate;
use crate::sensors::aiding::{Aid, AidingSettings};
use crate::sensors::defects::{ErrorInputs, ImuSettings};
use crate::sensors::gnss::{BaroSettings, GnssSettings};
use crate::sensors::imu::{Truth, TruthError, best_spans};
use crate::sensors::outage::Outage;
use crate::strapdown::MAX_ROTATION;
use crate::trajectory::Trajectory;
use crate::units::{DEG, Refused};
use glam::DVec3;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::sync::{Arc, OnceLock};

/// One experiment: a trajectory, what makes the errors, the filters' models, what is measured when.
#[derive(Debug, Clone)]
pub struct Experiment<'a> {
    /// The reference.
    pub trajectory: &'a Trajectory,
    /// Rate of the IMU (Hz).
    pub rate_hz: f64,
    /// Gravity of truth and filter.
    pub gravity: GravityModel,
    /// Source of the inertial errors.
    pub truth: Truth<'a>,
    /// The candidates: filters that run on the same noise, each with its own belief.
    pub filter_models: &'a [FilterModel],
    /// The receiver; its standard deviations are both truth and belief.
    pub gnss: &'a GnssSettings,
    /// The start.
    pub initial: &'a InitialSettings,
    /// Errors of the true IMU beside its noise.
    pub defects: &'a ImuSettings,
    /// A barometer, if there is one.
    pub baro: Option<&'a BaroSettings>,
    /// Vehicle constraints and sensors.
    pub aiding: &'a AidingSettings,
    /// Measurement update with a fix: standard or iterated.
    pub update: FixUpdate,
    /// Source of the gains.
    pub gains: Gains,
    /// When fixes are missing.
    pub outages: &'a [Outage],
    /// Seed of all random numbers.
    pub seed: u64,
    /// Level of the coverage statistic, between 0 and 1.
    pub coverage_level: f64,
}

impl Experiment<'_> {
    /// The quantile of the coverage statistic: a filter believes in a chi-square law.
    pub(crate) fn coverage_quantile(&self) -> f64 {
        let chi2 = ChiSquared::new(super::COVERAGE_DOF as f64);
        let chi2 = chi2.expect("positive");
        chi2.inverse_cdf(self.coverage_level)
    }
}

/// Reason that an experiment cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// Trajectory, IMU and filter do not fit together.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The truth does not serve.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// A measurement that meets no sample.
    #[error(transparent)]
    BetweenSamples(Refused),
}

fn refused<T>(message: String) -> Result<T, ExperimentError> {
    Err(Refused(message).into())
}

/// Something happens after this many IMU samples.
#[derive(Debug)]
pub(super) struct Event {
    /// IMU samples from the start.
    pub sample: usize,
    /// Time on the trajectory (s).
    pub t_s: f64,
    /// Reference state.
    pub reference: NavState,
    /// Reference position and velocity of the antenna: lat, lon (rad), h (m), v_n (m/s).
    pub antenna: ([f64; 3], DVec3),
    /// True if the receiver has an epoch here.
    pub gnss_epoch: bool,
    /// True if its fix is used.
    pub fix: bool,
    /// True if the barometer has a height here.
    pub baro: bool,
    /// Aiding measurements of the vehicle here.
    pub aids: Vec<TrueAid>,
    /// True if the epoch is reported (1 Hz).
    pub report: bool,
}

/// The shared part of all runs.
#[derive(Debug)]
pub struct Plan<'a> {
    pub(crate) experiment: &'a Experiment<'a>,
    pub(super) ideal: Arc<Vec<ImuSample>>,
    /// Averaging times of recordings that make the inertial errors.
    pub(super) spans: Vec<[usize; 6]>,
    pub(super) start: NavState,
    pub(super) events: Vec<Event>,
    /// For each outage: how many reports fall into it, and the event of the first fix after it (or the
    /// last event, when the trajectory ends first).
    pub(super) outages: Vec<(f64, usize)>,
    /// Quantile of the coverage statistic.
    pub(super) coverage_quantile: f64,
    /// The reference as a covariance analysis has it, if it was made already.
    pub(super) track: Option<&'a Track>,
    decision: OnceLock<SharedGains>,
}

impl<'a> Plan<'a> {
    /// Computes the ideal IMU and the schedule, and checks that everything fits together.
    ///
    /// # Errors
    /// The contradiction, with values.
    pub fn new(experiment: &'a Experiment<'a>) -> Result<Self, ExperimentError> {
        let rate_hz = experiment.rate_hz;
        for filter_model in experiment.filter_models {
            if !same_rate(filter_model.rate_hz, rate_hz) {
                return refused(format!(
                    "the filter's model is at {} Hz, the IMU at {rate_hz} Hz",
                    filter_model.rate_hz
                ));
            }
        }
        let Experiment {
            trajectory,
            gravity,
            ..
        } = *experiment;
        let ideal = trajectory.ideal(rate_hz, gravity)?;
        for (k, sample) in ideal.iter().enumerate() {
            check_rotation(experiment, k, sample)?;
        }
        let events = schedule(experiment, ideal.len())?;
        experiment.truth.check(rate_hz, ideal.len())?;
        let outages = experiment.outages.iter();
        Ok(Self {
            experiment,
            ideal,
            spans: best_spans(&experiment.truth),
            start: trajectory.state(trajectory.start_s()),
            outages: outages.map(|o| effects(o, &events)).collect(),
            events,
            coverage_quantile: experiment.coverage_quantile(),
            track: None,
            decision: OnceLock::new(),
        })
    }

    /// The plan of an experiment whose track is known: shared gains are then found sooner.
    pub fn with_track(self, track: &'a Track) -> Self {
        let track = Some(track);
        Self { track, ..self }
    }

    /// True for the first fix after an outage, and for the last event if there is none.
    pub(super) fn ends_outage(&self, event: usize) -> bool {
        self.outages.iter().any(|(_, end)| *end == event)
    }

    /// The gains of the candidates, decided when a run first needs them.
    pub(super) fn decision(&self) -> &SharedGains {
        self.decision.get_or_init(|| SharedGains::new(self))
    }

    /// Motion and temperature of the IMU in the middle of a sample.
    pub(super) fn error_inputs(&self, sample: usize) -> ErrorInputs {
        error_inputs(self.experiment, sample, &self.ideal[sample], &self.ideal[0])
    }

    /// IMU samples of one run.
    pub(crate) fn samples(&self) -> usize {
        self.ideal.len()
    }
}

fn effects(outage: &Outage, events: &[Event]) -> (f64, usize) {
    let reports = events
        .iter()
        .filter(|e| e.report && outage.withholds(e.t_s))
        .count();
    let end = outage.end_among(events.iter().map(|e| (e.t_s, e.fix)));
    (reports as f64, end)
}

/// Motion and temperature of the IMU in the middle of a sample; `first` is the first sample.
pub(super) fn error_inputs(
    experiment: &Experiment<'_>,
    index: usize,
    sample: &ImuSample,
    first: &ImuSample,
) -> ErrorInputs {
    let t_s = experiment.trajectory.start_s() + (index as f64 + 0.5) / experiment.rate_hz;
    ErrorInputs::at(experiment.defects, sample, t_s, first)
}

/// Refuses a sample in which the vehicle turns too fast for the strapdown.
pub(super) fn check_rotation(
    experiment: &Experiment<'_>,
    index: usize,
    sample: &ImuSample,
) -> Result<(), ExperimentError> {
    let rate_hz = experiment.rate_hz;
    let angle = sample.omega_ib_b.length() / rate_hz;
    if angle <= MAX_ROTATION {
        return Ok(());
    }
    let t_s = experiment.trajectory.start_s() + index as f64 / rate_hz;
    let (angle, most) = (angle / DEG, MAX_ROTATION / DEG);
    refused(format!(
        "the vehicle turns {angle:.1}° within one IMU sample at {t_s} s; at most {most:.1}° at {rate_hz} Hz"
    ))
}

/// Reports at every second from the start, fixes at every GNSS epoch after it, in time order.
pub(super) fn schedule(
    experiment: &Experiment<'_>,
    samples: usize,
) -> Result<Vec<Event>, ExperimentError> {
    let Experiment {
        trajectory,
        rate_hz,
        gnss,
        ..
    } = *experiment;
    let step = |fix_hz: f64, what| {
        let between = || {
            let multiple = "is not a whole multiple of the rate";
            Refused(format!(
                "the IMU rate {rate_hz} Hz {multiple} {fix_hz} Hz of {what}"
            ))
        };
        samples_per(rate_hz, fix_hz).ok_or_else(|| ExperimentError::BetweenSamples(between()))
    };
    let per_fix = step(gnss.rate_hz, "GNSS")?;
    let baro = experiment
        .baro
        .map(|b| step(b.rate_hz, "the barometer"))
        .transpose()?;
    let aids: Vec<(Aid, usize)> = experiment
        .aiding
        .rates()
        .map(|(aid, rate_hz)| step(rate_hz, aid.name()).map(|step| (aid, step)))
        .collect::<Result<_, _>>()?;
    // Rounded for each second anew: a rate that is no whole number would drift against the seconds.
    let reports = (0_u32..).map(|s| (f64::from(s) * rate_hz).round() as usize);
    let reports: Vec<usize> = reports.take_while(|k| *k <= samples).collect();
    let mut all = reports.clone();
    let steps = [Some(per_fix), baro].into_iter().flatten();
    let steps = steps.chain(aids.iter().map(|(_, step)| *step));
    all.extend(steps.flat_map(|step| (step..=samples).step_by(step)));
    // The last sample is an event, so that an outage that lasts to the end has an end.
    all.push(samples);
    all.sort_unstable();
    all.dedup();
    let event = |sample: usize| {
        let t_s = trajectory.start_s() + sample as f64 / rate_hz;
        let reference = trajectory.state(t_s);
        if reference.lat.abs() > MAX_LATITUDE {
            return refused(format!(
                "the trajectory reaches latitude {}° at {t_s} s, beyond ±89.9°",
                reference.lat / DEG
            ));
        }
        // None at the very start: the initial deviations are those of a vehicle that GNSS has helped to align
        // already.
        let is_due = |step: usize| sample > 0 && sample.is_multiple_of(step);
        let gnss_epoch = is_due(per_fix);
        let withheld = Outage::any_withholds(experiment.outages, t_s);
        Ok(Event {
            sample,
            t_s,
            reference,
            antenna: antenna(experiment, t_s, &reference),
            gnss_epoch,
            fix: gnss_epoch && !withheld,
            baro: baro.is_some_and(is_due),
            aids: aided(
                experiment,
                t_s,
                aids.iter().filter(|(_, step)| is_due(*step)),
            ),
            report: reports.binary_search(&sample).is_ok(),
        })
    };
    let events: Vec<Event> = all.into_iter().map(event).collect::<Result<_, _>>()?;
    check_sideslip(experiment, &events)?;
    Ok(events)
}

/// IMU samples from one measurement to the next; none where measurements would fall between samples, to be used late or
/// never.
pub(crate) fn samples_per(imu_hz: f64, fix_hz: f64) -> Option<usize> {
    let samples = imu_hz / fix_hz;
    // Relative to the count: a rate that was written with seven digits or more still counts as a whole
    // divisor.
    let is_whole = samples >= 0.5 && (samples - samples.round()).abs() <= 1e-6 * samples;
    is_whole.then(|| samples.round() as usize)
}

/// Position (lat, lon, h) and velocity in n of the antenna.
fn antenna(experiment: &Experiment<'_>, t_s: f64, reference: &NavState) -> ([f64; 3], DVec3) {
    let arm_b = DVec3::from(experiment.gnss.lever_arm_m);
    if arm_b == DVec3::ZERO {
        return (reference.place(), reference.v_n);
    }
    let k = experiment.trajectory.kinematics(t_s);
    let arm_e = k.q_b_e * arm_b;
    // Exact, through e, where the filter linearises: what it neglects shows as an error of the filter, not of
    // the truth.
    let (lat, lon, h) = crate::earth::ecef_to_geodetic(k.r_e + arm_e);
    let swing_n = reference.q_b_n * k.omega_eb_b.cross(arm_b);
    ([lat, lon, h], reference.v_n + swing_n)
}

// What a vehicle measures of itself along its reference, before any error.

/// Sine of a pitch of 80°.
const STEEP: f64 = 0.985;
/// Share of what a filter states of the constraint that the reference may have of its own: runs and analysis forgive it.
const FORGIVEN: f64 = 0.3;

/// Below these a vehicle stands (m/s, rad/s): a hundredth of the pace of a walk, and what a gyroscope would not show.
const STANDS_M_S: f64 = 0.01;
const STANDS_RAD_S: f64 = 0.01 * DEG;

/// A measurement of the vehicle by itself, as it would be without error.
#[derive(Debug, Clone, Copy)]
pub(super) struct TrueAid {
    pub aid: Aid,
    /// Velocity of the point that it belongs to, in b (m/s).
    pub v_b: DVec3,
    /// Acceleration of the vehicle with respect to the Earth, in b (m/s²).
    pub a_b: DVec3,
    /// True if an outage withholds it.
    pub withheld: bool,
}

/// True measurements of these aids.
fn aided<'a>(
    experiment: &Experiment<'_>,
    t_s: f64,
    aids: impl Iterator<Item = &'a (Aid, usize)>,
) -> Vec<TrueAid> {
    let mut aids = aids.peekable();
    if aids.peek().is_none() {
        return Vec::new();
    }
    let in_outage = Outage::any_withholds(experiment.outages, t_s);
    let k = experiment.trajectory.kinematics(t_s);
    let to_b = k.q_b_e.inverse();
    let (v_b, a_b) = (to_b * k.v_e, to_b * k.a_e);
    let stands = v_b.length() < STANDS_M_S && k.omega_eb_b.length() < STANDS_RAD_S;
    // Near the vertical there is no yaw: within ten degrees none is measured.
    let nose = experiment.trajectory.state(t_s).q_b_n * DVec3::X;
    let has_yaw = nose.z.abs() < STEEP;
    aids.filter(|(aid, _)| (*aid != Aid::Zupt || stands) && (*aid != Aid::Heading || has_yaw))
        .map(|(aid, _)| {
            let swing = k.omega_eb_b.cross(experiment.aiding.lever_arm_b(*aid));
            let withheld = in_outage && experiment.aiding.is_of_gnss(*aid);
            TrueAid {
                aid: *aid,
                v_b: v_b + swing,
                a_b,
                withheld,
            }
        })
        .collect()
}

/// A constraint that the reference itself does not keep tells of another vehicle, or of another point of it.
fn check_sideslip(experiment: &Experiment<'_>, events: &[Event]) -> Result<(), ExperimentError> {
    let Some(nhc) = &experiment.aiding.nhc else {
        return Ok(());
    };
    let squares: Vec<f64> = events
        .iter()
        .flat_map(|event| event.aids.iter().filter(|a| a.aid == Aid::Nhc))
        .map(|a| 0.5 * (a.v_b.y * a.v_b.y + a.v_b.z * a.v_b.z))
        .collect();
    let rms_m_s = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    if rms_m_s <= FORGIVEN * nhc.sigma_m_s {
        return Ok(());
    }
    refused(format!(
        "aiding.nhc.sigma_m_s = {}: the reference itself moves sideways and up with {rms_m_s:.2} m/s (rms) at this point, over 0.3 of it: set lever_arm_m to the rear axle, or a larger sigma",
        nhc.sigma_m_s
    ))
}
