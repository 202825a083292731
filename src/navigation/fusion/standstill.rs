//! Standstill, told from the IMU by a generalised likelihood ratio.
//!
//! The samples of half a second are those of a vehicle that stands, or of one that does whatever fits them best. With
//! white noise σ_a, σ_ω the ratio of both likelihoods is, but for a constant, the exponential of −T/2,
//!
//! T = Σ |f_k − g f̄/|f̄||²/σ_a² + Σ |ω_k − b|²/σ_ω²
//!
//! ([Skog et al.](crate::bibliography::Skog10)), where g is the specific force at rest and b the gyroscope's
//! bias: at rest chi-square of 6N − 2 degrees for N samples (the direction of gravity takes two). g, b, σ_a and σ_ω are
//! those of the recording where fixes or a wheel say that it stands: a data sheet knows no engine.

use crate::imu::ImuIncrement;
use glam::DVec3;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Length of a window (s).
pub const WINDOW_S: f64 = 0.5;
/// Windows in motion that are taken for standstill without fixes or a wheel: this share of the recording's own.
pub const FALSE_ALARMS: f64 = 1e-3;
/// Windows at rest that are missed where their noise is white.
pub const MISSES: f64 = 0.01;
/// Share of the recording's windows at rest below whose largest T the threshold need not fall: an engine's vibration is
/// neither white nor always the same.
const KEPT: f64 = 0.9;
/// Fewest windows at rest that tell the noise.
const FEWEST: usize = 10;

/// What fixes or a wheel say of an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
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
pub struct Standstill {
    /// Standard deviations of a sample at rest: specific force (m/s²), angular rate (rad/s).
    sigma: [f64; 2],
    /// Specific force at rest (m/s²).
    force: f64,
    /// Angular rate at rest (rad/s).
    rate: DVec3,
    /// Largest T of a standstill per degree of freedom: where fixes or a wheel say so too, and by itself.
    thresholds: [f64; 2],
}

/// Means, and pooled variances of a component.
struct Moments {
    mean: [DVec3; 2],
    variance: [f64; 2],
}

fn moments(window: &[ImuIncrement]) -> Moments {
    let n = window.len() as f64;
    let of = |value: fn(&ImuIncrement) -> DVec3| {
        let mean = window.iter().map(value).sum::<DVec3>() / n;
        let squares: f64 = window
            .iter()
            .map(|s| (value(s) - mean).length_squared())
            .sum();
        (mean, squares / (3.0 * (n - 1.0)))
    };
    let [(f, var_f), (w, var_w)] = [of(force), of(rate)];
    Moments {
        mean: [f, w],
        variance: [var_f, var_w],
    }
}

fn force(sample: &ImuIncrement) -> DVec3 {
    sample.dv / sample.dt_s
}

fn rate(sample: &ImuIncrement) -> DVec3 {
    sample.dtheta / sample.dt_s
}

/// Degrees of freedom of T.
fn degrees(samples: usize) -> f64 {
    6.0 * samples as f64 - 2.0
}

impl Standstill {
    /// Learns it from windows of one length; none where too few stand.
    #[must_use]
    pub fn learn(windows: &[(&[ImuIncrement], Motion)]) -> Option<Self> {
        let of = |motion: Motion| {
            windows
                .iter()
                .filter(move |(_, m)| *m == motion)
                .map(|(window, _)| *window)
        };
        let still: Vec<Moments> = of(Motion::Still).map(moments).collect();
        let samples = of(Motion::Still).next()?.len();
        if still.len() < FEWEST {
            return None;
        }
        let median =
            |value: &dyn Fn(&Moments) -> f64| quantile(still.iter().map(value).collect(), 0.5);
        // the median of chi-square of k degrees is k (1 − 2/9k)³ (Wilson and Hilferty)
        let of_median = (1.0 - 2.0 / (27.0 * (samples as f64 - 1.0))).powi(3);
        let mut found = Self {
            sigma: [0, 1].map(|i| (median(&|m| m.variance[i]) / of_median).sqrt()),
            force: median(&|m| m.mean[0].length()),
            rate: DVec3::from_array([0, 1, 2].map(|i| median(&|m| m.mean[1][i]))),
            thresholds: [0.0; 2],
        };
        let of_white = ChiSquared::new(degrees(samples))
            .ok()?
            .inverse_cdf(1.0 - MISSES)
            / degrees(samples);
        let of_still = quantile(
            of(Motion::Still).map(|w| found.statistic(w)).collect(),
            KEPT,
        );
        let moving: Vec<f64> = of(Motion::Moving).map(|w| found.statistic(w)).collect();
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

    /// Whether a window is one of standstill, of which fixes or a wheel say this.
    #[must_use]
    pub fn stands(&self, window: &[ImuIncrement], motion: Motion) -> bool {
        match motion {
            Motion::Still => self.statistic(window) < self.thresholds[0],
            Motion::Unknown => self.statistic(window) < self.thresholds[1],
            Motion::Slow | Motion::Moving => false,
        }
    }
}

/// The value below which this share of all lies.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    let at = ((values.len() as f64 * share) as usize).min(values.len() - 1);
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::StdRng;
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 100.0;
    const N: usize = 50;

    /// White noise at rest with a bias, plus a motion of so much specific force (m/s²) and rate (rad/s) at a time (s).
    fn recording(
        windows: usize,
        seed: u64,
        motion: impl Fn(f64) -> [DVec3; 2],
    ) -> Vec<ImuIncrement> {
        let mut source = StdRng::seed_from_u64(seed);
        let mut noise = |sigma: f64| {
            DVec3::from_array(std::array::from_fn(|_| {
                let normal: f64 = StandardNormal.sample(&mut source);
                sigma * normal
            }))
        };
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

    fn as_moving(imu: &[ImuIncrement], motion: Motion) -> Vec<(&[ImuIncrement], Motion)> {
        imu.chunks(N).map(|window| (window, motion)).collect()
    }

    /// White noise is missed once in a hundred windows: of 4000 the number is binomial, 40 ± 6.3. The noise is learnt to
    /// 0.12 % (a median of 4000 deviations of 147 degrees: 1.25/√(2 · 147 · 4000)), which moves T by 0.03 of its deviation
    /// and the number by 3: four of √(6.3² + 3²).
    #[test]
    fn white_noise_is_missed_as_rarely_as_stated() {
        let learnt = at_rest(4000, 1);
        let found = Standstill::learn(&as_moving(&learnt, Motion::Still)).unwrap();
        assert!(
            (found.sigma[0] / 0.05 - 1.0).abs() < 5e-3
                && (found.sigma[1] / 3e-3 - 1.0).abs() < 5e-3
        );
        let fresh = at_rest(4000, 2);
        let missed = fresh
            .chunks(N)
            .filter(|window| !found.stands(window, Motion::Unknown))
            .count();
        assert!((missed as f64 - 40.0).abs() < 28.0, "{missed}");
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
        let mut windows = as_moving(&rest, Motion::Still);
        windows.extend(as_moving(&moves, Motion::Moving));
        let found = Standstill::learn(&windows).unwrap();
        assert_eq!(
            moves
                .chunks(N)
                .filter(|window| found.stands(window, Motion::Unknown))
                .count(),
            0
        );
        assert!(
            rest.chunks(N)
                .filter(|window| found.stands(window, Motion::Unknown))
                .count()
                > 190
        );
    }

    /// On a road as smooth as standstill the IMU cannot tell: of windows of the same kind that were not learnt from, no
    /// more than the stated share is taken for standstill. Their number is binomial of 4000 about 4, the threshold's own
    /// error (a quantile of 4000) as large: 4 + 4 √(2 · 4).
    #[test]
    fn false_alarms_are_as_rare_as_stated() {
        let (rest, smooth, fresh) = (at_rest(200, 5), at_rest(4000, 6), at_rest(4000, 7));
        let mut windows = as_moving(&rest, Motion::Still);
        windows.extend(as_moving(&smooth, Motion::Moving));
        let found = Standstill::learn(&windows).unwrap();
        let alarms = fresh
            .chunks(N)
            .filter(|window| found.stands(window, Motion::Unknown))
            .count();
        assert!((alarms as f64) < 4.0 + 4.0 * 8.0_f64.sqrt(), "{alarms}");
    }

    #[test]
    fn too_few_windows_at_rest_tell_nothing() {
        let rest = at_rest(FEWEST - 1, 8);
        assert_eq!(Standstill::learn(&as_moving(&rest, Motion::Still)), None);
        assert_eq!(Standstill::learn(&[]), None);
    }
}
