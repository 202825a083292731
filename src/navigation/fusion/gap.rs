//! Gaps in a recording: what is missing is bridged, and the filter is told how little is known of it.
//!
//! The bridge is the mean of the samples on either side. How wrong its mean specific force and mean angular rate
//! are is read from the recording itself: the same bridge laid over windows of the gap's length elsewhere. If the
//! error were one constant over the gap (standard deviation σ, length T), it would add σ²T² to the variance of
//! velocity (or attitude), σ²T³/2 to its covariance with position and σ²T⁴/4 to position. White noise of density
//! σ²T adds the same, the same, and σ²T⁴/3: that is what the filter gets.

use crate::imu::ImuIncrement;
use glam::DVec3;

/// Longest gap that is bridged (s). Beyond it the heading after a turn is wrong by more than a linear filter finds back
/// from: of nine gaps of 9 s where turns begin, one ended at a NEES of thousands; none of 5 s above 30.
pub const LONGEST_S: f64 = 5.0;
/// A sample that lasts so many median ones is a bridge.
const LONG: f64 = 1.5;
/// Samples on either side that a bridge is made of.
const BESIDE: usize = 5;
/// Share of the windows that end nearer than σ: drives are mostly straight, and a gap in a turn must not be told to
/// a filter as one in a straight.
const SHARE: f64 = 0.99;
/// σ of a recording with fewer windows than [`FEWEST`]: a car's hard braking (m/s²) and turning (rad/s).
const UNKNOWN: [f64; 2] = [3.0, 0.5];
/// Fewest windows that tell.
const FEWEST: usize = 20;

/// Standard deviations of the means over a gap on each axis: specific force (m/s²), angular rate (rad/s).
pub type Spread = [DVec3; 2];

/// Fills the holes between samples. `step_s` is how long a sample lasts.
#[must_use]
pub fn bridged(samples: &[ImuIncrement], step_s: f64) -> Vec<ImuIncrement> {
    let hole = |k: usize| samples[k].t_s - samples[k].dt_s - samples[k - 1].t_s;
    let holes: Vec<usize> = (1..samples.len())
        .filter(|k| hole(*k) > (LONG - 1.0) * step_s)
        .collect();
    let mut filled = Vec::with_capacity(samples.len() + holes.len());
    let mut done = 0;
    for (i, &k) in holes.iter().enumerate() {
        filled.extend_from_slice(&samples[done..k]);
        // not beyond the next hole
        let end = holes.get(i + 1).copied().unwrap_or(samples.len());
        // A few samples only: further away the motion is no longer that at the edges of the gap.
        let before = rates(&samples[k.saturating_sub(BESIDE).max(done)..k]);
        let after = rates(&samples[k..(k + BESIDE).min(end)]);
        let dt_s = hole(k);
        let [dv, dtheta] = [0, 1].map(|i| 0.5 * (before[i] + after[i]) * dt_s);
        filled.push(ImuIncrement {
            t_s: samples[k].t_s - samples[k].dt_s,
            dt_s,
            dtheta,
            dv,
        });
        done = k;
    }
    filled.extend_from_slice(&samples[done..]);
    filled
}

/// Mean specific force (m/s²) and angular rate (rad/s).
fn rates(samples: &[ImuIncrement]) -> [DVec3; 2] {
    let seconds: f64 = samples.iter().map(|s| s.dt_s).sum();
    [
        samples.iter().map(|s| s.dv).sum::<DVec3>() / seconds,
        samples.iter().map(|s| s.dtheta).sum::<DVec3>() / seconds,
    ]
}

/// Which samples of a recording are bridges, and how far from the truth.
pub(super) struct Bridges<'a> {
    imu: &'a [ImuIncrement],
    step_s: f64,
    /// By length in steps.
    known: Vec<(usize, Spread)>,
}

impl<'a> Bridges<'a> {
    pub(super) fn new(imu: &'a [ImuIncrement]) -> Self {
        let mut lengths: Vec<f64> = imu.iter().map(|s| s.dt_s).collect();
        lengths.sort_by(f64::total_cmp);
        let step_s = lengths.get(lengths.len() / 2).copied().unwrap_or(1.0);
        Self {
            imu,
            step_s,
            known: Vec::new(),
        }
    }

    /// The spread of a sample that is a bridge; none of any other.
    pub(super) fn spread(&mut self, sample: &ImuIncrement) -> Option<Spread> {
        if sample.dt_s <= LONG * self.step_s {
            return None;
        }
        let steps = (sample.dt_s / self.step_s).round() as usize;
        if let Some((_, spread)) = self.known.iter().find(|(n, _)| *n == steps) {
            return Some(*spread);
        }
        let spread = self.of_windows(steps);
        self.known.push((steps, spread));
        Some(spread)
    }

    /// How far the mean of a window of so many samples is from its bridge.
    fn of_windows(&self, steps: usize) -> Spread {
        let mut off: [Vec<f64>; 6] = Default::default();
        let whole = steps + 2 * BESIDE;
        // Windows overlap by half: nearly all that the recording tells, at twice the cost of windows side by
        // side.
        for first in (0..self.imu.len().saturating_sub(whole)).step_by((steps / 2).max(1)) {
            let part = &self.imu[first..first + whole];
            // A bridge says nothing about the quality of bridges.
            if part.iter().any(|s| s.dt_s > LONG * self.step_s) {
                continue;
            }
            let (before, window, after) = (
                rates(&part[..BESIDE]),
                rates(&part[BESIDE..BESIDE + steps]),
                rates(&part[BESIDE + steps..]),
            );
            for sensor in 0..2 {
                let error = window[sensor] - 0.5 * (before[sensor] + after[sensor]);
                (0..3).for_each(|axis| off[3 * sensor + axis].push(error[axis].abs()));
            }
        }
        if off[0].len() < FEWEST {
            return UNKNOWN.map(DVec3::splat);
        }
        let at = ((off[0].len() - 1) as f64 * SHARE) as usize;
        let sigma = off.map(|mut errors| *errors.select_nth_unstable_by(at, f64::total_cmp).1);
        [
            DVec3::new(sigma[0], sigma[1], sigma[2]),
            DVec3::new(sigma[3], sigma[4], sigma[5]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(k: usize, rate: f64) -> ImuIncrement {
        let dt_s = 0.01;
        ImuIncrement {
            t_s: (k + 1) as f64 * dt_s,
            dt_s,
            dtheta: DVec3::Z * rate * dt_s,
            dv: DVec3::X * dt_s,
        }
    }

    #[test]
    fn a_bridge_lasts_from_the_sample_before_to_the_one_after() {
        let mut imu: Vec<_> = (0..100)
            .map(|k| sample(k, if k < 50 { 0.1 } else { 0.3 }))
            .collect();
        imu.drain(40..60);
        let filled = bridged(&imu, 0.01);
        assert_eq!(filled.len(), 81);
        let bridge = filled[40];
        assert!((bridge.t_s - 0.6).abs() < 1e-12 && (bridge.dt_s - 0.2).abs() < 1e-12);
        assert!((bridge.dtheta.z - 0.2 * 0.2).abs() < 1e-12 && (bridge.dv.x - 0.2).abs() < 1e-12);
        assert_eq!(bridged(&filled, 0.01).len(), 81);
    }

    /// A rate that alternates slowly with amplitude 1: over half a period its mean differs from the ends by up to
    /// 2/π, and a window of the recording's own motion says so.
    #[test]
    fn the_spread_is_that_of_the_recording() {
        let imu: Vec<_> = (0..60_000)
            .map(|k| sample(k, (std::f64::consts::TAU * k as f64 / 1000.0).sin()))
            .collect();
        let mut bridges = Bridges::new(&imu);
        assert!(bridges.spread(&imu[7]).is_none());
        let [accel, gyro] = bridges
            .spread(&ImuIncrement {
                dt_s: 5.0,
                ..imu[7]
            })
            .unwrap();
        // mean of sin over half a period, 2/π at its extremes, less the samples beside it, 252.5 from its middle;
        // windows a quarter of a period apart meet the extremes
        let beside = (std::f64::consts::TAU * 0.2525).cos();
        assert!(
            (gyro.z - (std::f64::consts::FRAC_2_PI - beside)).abs() < 1e-3,
            "{gyro}"
        );
        assert!(accel.length() < 1e-9 && gyro.x == 0.0);
        let short = Bridges::new(&imu[..1000]).spread(&ImuIncrement {
            dt_s: 5.0,
            ..imu[7]
        });
        assert_eq!(short, Some(UNKNOWN.map(DVec3::splat)));
    }
}
