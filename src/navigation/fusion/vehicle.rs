//! Velocity measurements that a vehicle provides: no sideways or vertical motion (NHC), wheel
//! speed, standstill (ZUPT).

use super::alignment::courses;
use super::{DriveData, Whiteness, kept};
use crate::imu::ImuIncrement;
use crate::linalg::median;
use crate::metrics::{Band, chi_square_band};
use crate::sensors::aiding::{Aid, AidingSettings};
use crate::sensors::outage::Outage;
use glam::DVec3;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Speeds below and above which a vehicle stands and moves (m/s).
const SPEEDS: (f64, f64) = (0.3, 1.0);
/// Time over which a speed is valid (s).
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
#[derive(Debug, Clone, Copy)]
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
#[derive(Debug, Clone, Copy, Serialize)]
pub struct AidInnovations {
    /// `nhc`, `odometer` or `zupt`.
    pub aid: &'static str,
    /// Measurements.
    pub count: usize,
    /// Mean NIS divided by the number of components: 1 if right.
    pub nis_per_component: f64,
    /// 95 % band of it for a consistent filter.
    pub nis_band: Band,
    /// Autocorrelation of the innovations from one measurement to the next; none where they are few.
    pub whiteness: Option<Whiteness>,
}

/// The innovations of each aid there is.
pub fn aid_innovations(records: &[AidRecord]) -> Vec<AidInnovations> {
    let worth = |aid: Aid| {
        let own: Vec<&AidRecord> = records.iter().filter(|r| r.aid == aid).collect();
        let (count, axes) = (own.len(), aid.axes().len());
        let band = chi_square_band(axes, count as f64);
        let series: Vec<(f64, &[f64])> = own
            .iter()
            .map(|r| (r.t_s, r.normalised.as_slice()))
            .collect();
        (count > 0).then(|| AidInnovations {
            aid: aid.name(),
            count,
            nis_per_component: own.iter().map(|r| r.nis()).sum::<f64>() / (count * axes) as f64,
            nis_band: Band {
                lower: band.lower / axes as f64,
                upper: band.upper / axes as f64,
            },
            whiteness: Whiteness::of_series(&series),
        })
    };
    Aid::ALL.into_iter().filter_map(worth).collect()
}

/// The measurements of a recording: the constraint and standstill at sample times, a wheel at its own. Fixes that are
/// withheld tell nothing of standstill, which is none where the recording shows too little of it.
pub fn vehicle_velocities(
    recorded: &DriveData<'_>,
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
    let scene = StandstillSearch {
        imu,
        speeds,
        step_s: median(imu.iter().map(|s| s.dt_s)).unwrap_or(1.0),
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
        match aid {
            Aid::Nhc | Aid::Zupt => {
                let at_rest = aid == Aid::Zupt;
                let samples = every(imu, |s| s.t_s, rate_hz).filter(|k| stands(*k) == at_rest);
                all.extend(samples.map(|k| measured(imu[k].t_s, 0.0)));
            }
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

/// Median ratio of the wheel's speed to that of the fixes while moving; none where they never move.
pub fn wheel_ratio(
    recorded: &DriveData<'_>,
    wheel: &[WheelSpeed],
    outages: &[Outage],
) -> Option<f64> {
    let ratio = |(t_s, speed): (f64, f64)| {
        let turned = wheel.get(wheel.partition_point(|w| w.t_s < t_s))?;
        let is_near = turned.t_s - t_s < 0.5 * REACH_S && speed > 3.0 * SPEEDS.1;
        is_near.then(|| turned.m_s.abs() / speed)
    };
    median(speeds(recorded, outages).into_iter().filter_map(ratio))
}

/// The first element of each interval of 1/`rate_hz`.
fn every<T>(all: &[T], t_s: impl Fn(&T) -> f64, rate_hz: f64) -> impl Iterator<Item = usize> {
    let mut due_s = all.first().map_or(0.0, &t_s);
    all.iter().enumerate().filter_map(move |(k, element)| {
        let late_s = t_s(element) - due_s + 1e-6;
        let is_due = t_s(element) >= due_s - 1e-6;
        if is_due {
            due_s += (late_s * rate_hz).floor().max(0.0) / rate_hz + 1.0 / rate_hz;
        }
        is_due.then_some(k)
    })
}

/// Horizontal speeds of the fixes: their own, or by positions a second apart.
fn speeds(recorded: &DriveData<'_>, outages: &[Outage]) -> Vec<(f64, f64)> {
    let courses = courses(&kept(recorded.gnss, outages), recorded.imu).into_iter();
    courses.map(|m| (m.fix.t_s, m.speed())).collect()
}

/// A recording that may stand.
struct StandstillSearch<'a> {
    imu: &'a [ImuIncrement],
    /// Times (s) and speeds (m/s).
    speeds: Vec<(f64, f64)>,
    step_s: f64,
}

impl StandstillSearch<'_> {
    /// The samples of the half second that ends with sample `k`; none where it bridges a gap.
    fn window(&self, k: usize) -> Option<&[ImuIncrement]> {
        let samples = (WINDOW_S / self.step_s).round().max(2.0) as usize;
        let window = &self.imu[(k + 1).checked_sub(samples)?..=k];
        window
            .iter()
            .all(|s| s.dt_s <= LONG * self.step_s)
            .then_some(window)
    }

    fn motion(&self, t_s: f64) -> MotionState {
        let from = self.speeds.partition_point(|(t, _)| *t < t_s - REACH_S);
        let near = &self.speeds[from..self.speeds.partition_point(|(t, _)| *t <= t_s + REACH_S)];
        match near {
            [] => MotionState::Unknown,
            _ if near.iter().all(|(_, speed)| *speed < SPEEDS.0) => MotionState::Still,
            _ if near.iter().all(|(_, speed)| *speed > SPEEDS.1) => MotionState::Moving,
            _ => MotionState::Slow,
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

// Standstill, told from the IMU by a generalised likelihood ratio.
//
// The samples of half a second are those of a vehicle that stands, or of one that does whatever fits them best. With
// white noise σ_a, σ_ω the ratio of both likelihoods is, but for a constant, the exponential of −T/2,
//
// T = Σ |f_k − g f̄/|f̄||²/σ_a² + Σ |ω_k − b|²/σ_ω²
//
// ([Skog et al.](crate::bibliography::Skog10)), where g is the specific force at rest and b the gyroscope's
// bias: at rest chi-square of 6N − 2 degrees for N samples (the direction of gravity takes two). g, b, σ_a and σ_ω are
// those of the recording where fixes or a wheel say that it stands: a data sheet knows no engine.

/// Length of a window (s).
const WINDOW_S: f64 = 0.5;
/// Windows in motion that are taken for standstill without fixes or a wheel: this share of the recording's own.
const FALSE_ALARMS: f64 = 1e-3;
/// Windows at rest that are missed where their noise is white.
pub(super) const MISSES: f64 = 0.01;
/// Share of the recording's windows at rest below whose largest T the threshold need not fall: an engine's vibration is
/// neither white nor always the same.
const KEPT: f64 = 0.9;
/// Fewest windows at rest that tell the noise.
const FEWEST: usize = 10;

/// Motion at an instant according to fixes or a wheel.
#[derive(Clone, Copy, PartialEq)]
enum MotionState {
    /// It stands.
    Still,
    /// Neither is sure.
    Slow,
    /// It moves.
    Moving,
    /// Nothing.
    Unknown,
}

/// The test of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Standstill {
    /// Standard deviations of a sample at rest: specific force (m/s²), angular rate (rad/s).
    sigma: [f64; 2],
    /// Specific force at rest (m/s²).
    force: f64,
    /// Angular rate at rest (rad/s).
    rate: DVec3,
    /// Largest T of a standstill per degree of freedom: where fixes or a wheel say so too, and by itself.
    thresholds: [f64; 2],
}

/// Means and pooled variances of a component, of specific force and angular rate.
type Moments = [(DVec3, f64); 2];

fn moments(window: &[ImuIncrement]) -> Moments {
    let n = window.len() as f64;
    [force, rate].map(|value: fn(&ImuIncrement) -> DVec3| {
        let mean = window.iter().map(value).sum::<DVec3>() / n;
        let squares: f64 = window
            .iter()
            .map(|s| (value(s) - mean).length_squared())
            .sum();
        (mean, squares / (3.0 * (n - 1.0)))
    })
}

pub(super) fn force(sample: &ImuIncrement) -> DVec3 {
    sample.dv / sample.dt_s
}

pub(super) fn rate(sample: &ImuIncrement) -> DVec3 {
    sample.dtheta / sample.dt_s
}

/// Degrees of freedom of T.
fn degrees(samples: usize) -> f64 {
    6.0 * samples as f64 - 2.0
}

impl Standstill {
    /// Learns it from windows of one length; none where too few stand.
    fn learn(windows: &[(&[ImuIncrement], MotionState)]) -> Option<Self> {
        let of = |motion: MotionState| {
            windows
                .iter()
                .filter(move |(_, m)| *m == motion)
                .map(|(window, _)| *window)
        };
        let still: Vec<Moments> = of(MotionState::Still).map(moments).collect();
        let samples = of(MotionState::Still).next()?.len();
        if still.len() < FEWEST {
            return None;
        }
        let median =
            |value: &dyn Fn(&Moments) -> f64| quantile(still.iter().map(value).collect(), 0.5);
        // the median of chi-square of k degrees is k (1 − 2/9k)³ (Wilson and Hilferty)
        let of_median = (1.0 - 2.0 / (27.0 * (samples as f64 - 1.0))).powi(3);
        let mut found = Self {
            sigma: [0, 1].map(|i| (median(&|m| m[i].1) / of_median).sqrt()),
            force: median(&|m| m[0].0.length()),
            rate: DVec3::from_array([0, 1, 2].map(|i| median(&|m| m[1].0[i]))),
            thresholds: [0.0; 2],
        };
        let of_white = ChiSquared::new(degrees(samples))
            .ok()?
            .inverse_cdf(1.0 - MISSES)
            / degrees(samples);
        let of_still = quantile(
            of(MotionState::Still).map(|w| found.statistic(w)).collect(),
            KEPT,
        );
        let moving: Vec<f64> = of(MotionState::Moving)
            .map(|w| found.statistic(w))
            .collect();
        let of_moving = if moving.is_empty() {
            f64::INFINITY
        } else {
            quantile(moving, FALSE_ALARMS)
        };
        let of_rest = of_white.max(of_still);
        found.thresholds = [of_rest, of_rest.min(of_moving)];
        Some(found)
    }

    /// T per degree of freedom.
    fn statistic(&self, window: &[ImuIncrement]) -> f64 {
        let mean = window.iter().map(force).sum::<DVec3>().normalize_or_zero() * self.force;
        let [var_f, var_w] = self.sigma.map(|sigma| sigma * sigma);
        let of_sample = |s: &ImuIncrement| {
            (force(s) - mean).length_squared() / var_f
                + (rate(s) - self.rate).length_squared() / var_w
        };
        window.iter().map(of_sample).sum::<f64>() / degrees(window.len())
    }

    /// Returns true if the vehicle stands still in a window, given the motion by fixes or a wheel.
    fn stands(&self, window: &[ImuIncrement], motion: MotionState) -> bool {
        match motion {
            MotionState::Still => self.statistic(window) < self.thresholds[0],
            MotionState::Unknown => self.statistic(window) < self.thresholds[1],
            MotionState::Slow | MotionState::Moving => false,
        }
    }
}

/// The value below which this share of all lies.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    let at = ((values.len() as f64 * share) as usize).min(values.len() - 1);
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod standstill_tests {
    use super::*;
    use crate::tests::normals;
    use approx::assert_abs_diff_eq;

    const RATE_HZ: f64 = 100.0;
    const N: usize = 50;

    /// White noise at rest with a bias, plus a motion of so much specific force (m/s²) and rate (rad/s) at a time (s).
    fn recording(
        windows: usize,
        seed: u64,
        motion: impl Fn(f64) -> [DVec3; 2],
    ) -> Vec<ImuIncrement> {
        let mut normal = normals(seed);
        let mut noise = |sigma: f64| DVec3::from_array(std::array::from_fn(|_| sigma * normal()));
        let dt_s = 1.0 / RATE_HZ;
        let sample = |k: usize| {
            let t_s = (k + 1) as f64 * dt_s;
            let [f, w] = motion(t_s);
            let dv = (DVec3::new(0.3, -0.1, -9.79) + f + noise(0.05)) * dt_s;
            let dtheta = (DVec3::new(2e-3, -1e-3, 4e-3) + w + noise(3e-3)) * dt_s;
            ImuIncrement {
                t_s,
                dt_s,
                dtheta,
                dv,
            }
        };
        (0..windows * N).map(sample).collect()
    }

    fn at_rest(windows: usize, seed: u64) -> Vec<ImuIncrement> {
        recording(windows, seed, |_| [DVec3::ZERO; 2])
    }

    /// Number of windows that are taken for standstill.
    fn stands(found: &Standstill, imu: &[ImuIncrement]) -> usize {
        imu.chunks(N)
            .filter(|window| found.stands(window, MotionState::Unknown))
            .count()
    }

    fn as_moving(imu: &[ImuIncrement], motion: MotionState) -> Vec<(&[ImuIncrement], MotionState)> {
        imu.chunks(N).map(|window| (window, motion)).collect()
    }

    /// White noise is missed once in a hundred windows: of 4000 the number is binomial, 40 ± 6.3. The noise is learnt to
    /// 0.12 % (a median of 4000 deviations of 147 degrees: 1.25/√(2 · 147 · 4000)), which moves T by 0.03 of its deviation
    /// and the number by 3: four of √(6.3² + 3²).
    #[test]
    fn white_noise_is_missed_as_rarely_as_stated() {
        let learnt = at_rest(4000, 1);
        let found = Standstill::learn(&as_moving(&learnt, MotionState::Still)).unwrap();
        assert!(
            (found.sigma[0] / 0.05 - 1.0).abs() < 5e-3
                && (found.sigma[1] / 3e-3 - 1.0).abs() < 5e-3
        );
        let fresh = at_rest(4000, 2);
        let missed = 4000 - stands(&found, &fresh);
        assert_abs_diff_eq!(missed as f64, 40.0, epsilon = 28.0);
    }

    /// A car that sways by 0.3 m/s² and turns by 2 deg/s never stands.
    #[test]
    fn motion_is_no_standstill() {
        let rest = at_rest(200, 3);
        let sway = |t: f64| {
            [
                DVec3::Y * 0.3 * (6.0 * t).sin(),
                DVec3::Z * 0.035 * (0.7 * t).cos().signum(),
            ]
        };
        let moves = recording(2000, 4, sway);
        let mut windows = as_moving(&rest, MotionState::Still);
        windows.extend(as_moving(&moves, MotionState::Moving));
        let found = Standstill::learn(&windows).unwrap();
        // of 200 windows at rest two are missed on average: more than nine by chance in 4e-5
        assert!(stands(&found, &moves) == 0 && stands(&found, &rest) > 190);
    }

    /// On a road as smooth as standstill the IMU cannot tell: of windows of the same kind that were not learnt from, no
    /// more than the stated share is taken for standstill. Their number is binomial of 4000 about 4, the threshold's own
    /// error (a quantile of 4000) as large: 4 + 4 √(2 · 4).
    #[test]
    fn false_alarms_are_as_rare_as_stated() {
        let (rest, smooth, fresh) = (at_rest(200, 5), at_rest(4000, 6), at_rest(4000, 7));
        let mut windows = as_moving(&rest, MotionState::Still);
        windows.extend(as_moving(&smooth, MotionState::Moving));
        let found = Standstill::learn(&windows).unwrap();
        let alarms = stands(&found, &fresh);
        assert!((alarms as f64) < 4.0 + 4.0 * 8.0_f64.sqrt(), "{alarms}");
    }

    #[test]
    fn too_few_windows_at_rest_tell_nothing() {
        let rest = at_rest(FEWEST - 1, 8);
        assert_eq!(
            Standstill::learn(&as_moving(&rest, MotionState::Still)),
            None
        );
        assert_eq!(Standstill::learn(&[]), None);
    }
}
