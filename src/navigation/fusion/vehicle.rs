//! What a vehicle knows of its own velocity, made from a recording: it moves neither sideways nor up, a wheel turns, it
//! stands.

use super::Recorded;
use super::correlation::{Whiteness, middle};
use super::standstill::{Motion, Standstill, WINDOW_S};
use crate::earth::ned_difference;
use crate::frames::NavState;
use crate::imu::ImuIncrement;
use crate::metrics::{Band, chi_square_band};
use crate::sensors::aiding::{Aid, AidingSettings};
use crate::sensors::outage::Outage;
use glam::{DQuat, DVec3};
use serde::Serialize;

/// Speeds below and above which a vehicle stands and moves (m/s).
const SPEEDS: (f64, f64) = (0.3, 1.0);
/// How far a speed tells (s).
const REACH_S: f64 = 1.0;
/// A sample so many times as long as the median one bridges a gap.
const LONG: f64 = 1.5;

/// Forward speed of a wheel, negative in reverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelSpeed {
    /// Time (s).
    pub t_s: f64,
    /// Speed (m/s).
    pub m_s: f64,
}

/// Velocity of a point of the vehicle along some of its axes, as the vehicle knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleVelocity {
    /// Time (s).
    pub t_s: f64,
    /// Source, which decides the axes.
    pub aid: Aid,
    /// Forward, right, down (m/s).
    pub velocity_b: DVec3,
    /// Standard deviation along each axis, white (m/s).
    pub sigma_m_s: f64,
    /// The point from the IMU: front, right, down (m).
    pub lever_arm_b: DVec3,
}

/// Such a velocity as the filter saw it, before using it.
#[derive(Debug, Clone, PartialEq)]
pub struct AidRecord {
    /// Time (s).
    pub t_s: f64,
    /// Source.
    pub aid: Aid,
    /// Innovations over their standard deviations, each given those before: independent, of variance 1 if right.
    pub normalised: Vec<f64>,
}

impl AidRecord {
    pub(super) fn nis(&self) -> f64 {
        self.normalised.iter().map(|z| z * z).sum()
    }
}

/// Innovations of an aid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AidInnovations {
    /// `nhc`, `odometer` or `zupt`.
    pub aid: &'static str,
    /// Measurements.
    pub count: usize,
    /// Mean NIS divided by the number of components: 1 if right.
    pub nis_per_component: f64,
    /// Where that lies if right, 95 %.
    pub nis_band: Band,
    /// Autocorrelation of the innovations from one measurement to the next; none where they are few.
    pub whiteness: Option<Whiteness>,
}

/// The innovations of each aid there is.
#[must_use]
pub fn aid_innovations(records: &[AidRecord]) -> Vec<AidInnovations> {
    let worth = |aid: Aid| {
        let own: Vec<&AidRecord> = records.iter().filter(|r| r.aid == aid).collect();
        let (count, axes) = (own.len(), aid.axes().len());
        let components = (count * axes) as f64;
        let band = chi_square_band(axes, count as f64);
        let per_component = |nis: f64| nis / axes as f64;
        let series: Vec<(f64, &[f64])> = own
            .iter()
            .map(|r| (r.t_s, r.normalised.as_slice()))
            .collect();
        (count > 0).then(|| AidInnovations {
            aid: aid.name(),
            count,
            nis_per_component: own.iter().map(|r| r.nis()).sum::<f64>() / components,
            nis_band: Band {
                lower: per_component(band.lower),
                upper: per_component(band.upper),
            },
            whiteness: Whiteness::of_series(&series),
        })
    };
    Aid::ALL.into_iter().filter_map(worth).collect()
}

/// The measurements of a recording: the constraint and standstill at sample times, a wheel at its own. Fixes that are
/// withheld tell nothing of standstill, which is none where the recording shows too little of it.
#[must_use]
pub fn vehicle_velocities(
    recorded: &Recorded<'_>,
    wheel: &[WheelSpeed],
    settings: &AidingSettings,
    outages: &[Outage],
) -> Vec<VehicleVelocity> {
    let imu = recorded.imu;
    let speeds = if wheel.is_empty() {
        speeds(recorded, outages)
    } else {
        wheel.iter().map(|w| (w.t_s, w.m_s.abs())).collect()
    };
    let scene = Scene {
        imu,
        speeds,
        step_s: middle(imu.iter().map(|s| s.dt_s).collect()).unwrap_or(1.0),
    };
    let test = settings.zupt.as_ref().and_then(|_| scene.test());
    let stands = |k: usize| test.is_some_and(|test| scene.stands(&test, k));
    let mut all = Vec::new();
    for (aid, rate_hz) in settings.rates() {
        let measured = |t_s: f64, forward: f64| VehicleVelocity {
            t_s,
            aid,
            velocity_b: DVec3::X * forward,
            sigma_m_s: settings.sigmas(aid)[0],
            lever_arm_b: settings.lever_arm_b(aid),
        };
        let samples = || every(imu, |s| s.t_s, rate_hz);
        match aid {
            Aid::Nhc => all.extend(
                samples()
                    .filter(|k| !stands(*k))
                    .map(|k| measured(imu[k].t_s, 0.0)),
            ),
            Aid::Zupt => all.extend(
                samples()
                    .filter(|k| stands(*k))
                    .map(|k| measured(imu[k].t_s, 0.0)),
            ),
            Aid::Odometer => {
                let turned = every(wheel, |w| w.t_s, rate_hz);
                all.extend(turned.map(|k| measured(wheel[k].t_s, wheel[k].m_s)));
            }
            Aid::Heading => {}
        }
    }
    // stable: at one instant in the order of the aids
    all.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    all
}

/// How many times the speed of the fixes a wheel reads where both move: the median; none where they never do.
#[must_use]
pub fn wheel_ratio(
    recorded: &Recorded<'_>,
    wheel: &[WheelSpeed],
    outages: &[Outage],
) -> Option<f64> {
    let ratio = |(t_s, speed): (f64, f64)| {
        let turned = wheel.get(wheel.partition_point(|w| w.t_s < t_s))?;
        let is_near = turned.t_s - t_s < 0.5 * REACH_S && speed > 3.0 * SPEEDS.1;
        is_near.then(|| turned.m_s.abs() / speed)
    };
    middle(
        speeds(recorded, outages)
            .into_iter()
            .filter_map(ratio)
            .collect(),
    )
}

/// The first element of each interval of 1/`rate_hz`.
fn every<T>(all: &[T], t_s: impl Fn(&T) -> f64, rate_hz: f64) -> impl Iterator<Item = usize> {
    let mut due_s = all.first().map_or(0.0, &t_s);
    let is_due = move |element: &T| {
        let now_s = t_s(element);
        let due = now_s >= due_s - 1e-6;
        if due {
            due_s += ((now_s - due_s + 1e-6) * rate_hz).floor().max(0.0) / rate_hz + 1.0 / rate_hz;
        }
        due
    };
    let mut is_due = is_due;
    all.iter()
        .enumerate()
        .filter_map(move |(k, element)| is_due(element).then_some(k))
}

/// Horizontal speeds of the fixes: their own, or by positions a second apart.
fn speeds(recorded: &Recorded<'_>, outages: &[Outage]) -> Vec<(f64, f64)> {
    let known: Vec<_> = recorded
        .gnss
        .iter()
        .filter(|f| !outages.iter().any(|o| o.withholds(f.t_s)))
        .collect();
    let of_velocity = |k: usize| known[k].velocity.map(|v| v.v_n().truncate().length());
    let of_positions = |k: usize| {
        let now = known[k];
        let before = known[..k]
            .iter()
            .rev()
            .find(|f| now.t_s - f.t_s >= REACH_S - 0.01)?;
        let place = NavState {
            lat: before.lat,
            lon: before.lon,
            h: before.h,
            v_n: DVec3::ZERO,
            q_b_n: DQuat::IDENTITY,
        };
        let metres = ned_difference(&place, now.lat, now.lon, now.h)
            .truncate()
            .length();
        let seconds = now.t_s - before.t_s;
        (seconds < 2.0 * REACH_S).then(|| metres / seconds)
    };
    (0..known.len())
        .filter_map(|k| Some((known[k].t_s, of_velocity(k).or_else(|| of_positions(k))?)))
        .collect()
}

/// A recording that may stand.
struct Scene<'a> {
    imu: &'a [ImuIncrement],
    /// Times (s) and speeds (m/s).
    speeds: Vec<(f64, f64)>,
    step_s: f64,
}

impl Scene<'_> {
    /// The samples of the half second that ends with sample `k`; none where it bridges a gap.
    fn window(&self, k: usize) -> Option<&[ImuIncrement]> {
        let samples = (WINDOW_S / self.step_s).round().max(2.0) as usize;
        let window = &self.imu[(k + 1).checked_sub(samples)?..=k];
        window
            .iter()
            .all(|s| s.dt_s <= LONG * self.step_s)
            .then_some(window)
    }

    fn motion(&self, t_s: f64) -> Motion {
        let from = self.speeds.partition_point(|(t, _)| *t < t_s - REACH_S);
        let near = &self.speeds[from..self.speeds.partition_point(|(t, _)| *t <= t_s + REACH_S)];
        match near {
            [] => Motion::Unknown,
            _ if near.iter().all(|(_, speed)| *speed < SPEEDS.0) => Motion::Still,
            _ if near.iter().all(|(_, speed)| *speed > SPEEDS.1) => Motion::Moving,
            _ => Motion::Slow,
        }
    }

    fn test(&self) -> Option<Standstill> {
        let windows = every(self.imu, |s| s.t_s, 1.0 / WINDOW_S)
            .filter_map(|k| Some((self.window(k)?, self.motion(self.imu[k].t_s))));
        Standstill::learn(&windows.collect::<Vec<_>>())
    }

    fn stands(&self, test: &Standstill, k: usize) -> bool {
        self.window(k)
            .is_some_and(|window| test.stands(window, self.motion(self.imu[k].t_s)))
    }
}
