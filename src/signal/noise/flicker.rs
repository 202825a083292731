//! Flicker noise by Gauss-Markov processes: what a data sheet's bias instability is read as.
//!
//! [IEEE 952](crate::bibliography::Ieee952) calls bias instability the floor of the Allan deviation, 0.664 times the
//! coefficient of a flicker noise, and manufacturers read it off there. No process of finitely many states has a floor;
//! a Gauss-Markov process has a peak, below which it is lower on both sides. Processes of one variance whose correlation
//! times are a factor of 16 apart have an Allan deviation that is level between the first peak and the last: with x
//! correlation times per average, the Allan variance of one is
//!
//! σ²·(2/x)·[1 − (3 − 4e^(−x) + e^(−2x))/(2x)],
//!
//! and the sum of three is at least 0.448 σ² and at most 1.15 times that (the deviation: 1.07).

use super::{GaussMarkov, ParameterError};

/// Ratio of neighbouring correlation times.
const APART: f64 = 16.0;
/// The shortest correlation time, unless the longest is shorter (s): what is faster is hidden by white noise.
const SHORTEST_S: f64 = 1.0;
/// Lowest Allan variance between the peaks of one, two, three processes of variance 1; more change it by less than 1e-3.
const LOWEST: [f64; 3] = [
    GaussMarkov::ALLAN_PEAK * GaussMarkov::ALLAN_PEAK,
    0.436_065_855_9,
    0.448_028_281_7,
];

/// A bias whose Allan deviation has a floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flicker {
    /// The floor (units).
    pub floor: f64,
    /// Longest correlation time (s).
    pub t_corr_s: f64,
}

impl Flicker {
    /// The Allan deviation is nowhere below the floor between these averaging times (s): 1.9 times the shortest and the
    /// longest correlation time.
    #[must_use]
    pub fn range_s(&self) -> (f64, f64) {
        let shortest_s = self.t_corr_s * APART.powi(1 - self.count());
        (
            GaussMarkov::ALLAN_PEAK_AT * shortest_s,
            GaussMarkov::ALLAN_PEAK_AT * self.t_corr_s,
        )
    }

    /// The Gauss-Markov processes whose sum has this floor, the slowest first.
    ///
    /// # Errors
    /// When a number is not positive.
    pub fn processes(&self, rate_hz: f64) -> Result<Vec<GaussMarkov>, ParameterError> {
        // One variance for all, such that the lowest Allan variance between the peaks is the square of the
        // floor.
        let s2 = self.floor * self.floor / LOWEST[(self.count() as usize).min(LOWEST.len()) - 1];
        let process = |k: i32| GaussMarkov::new(APART.powi(k) / self.t_corr_s, s2, rate_hz);
        (0..self.count()).map(process).collect()
    }

    fn count(&self) -> i32 {
        1 + ((self.t_corr_s / SHORTEST_S).log2() / APART.log2()).max(0.0) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Composite, Process};

    /// Over averages every 1/64 octave between the peaks; sampled at 100 Hz the shortest (1.2 s) is the continuous one to
    /// (dt/T)²/12 = 6e-6.
    #[test]
    fn between_the_peaks_the_floor_is_kept_and_nearly_reached() {
        for (t_corr_s, count, highest) in [
            (10.0, 1, 1.0),
            (100.0, 2, 1.033),
            (300.0, 3, 1.075),
            (9000.0, 4, 1.08),
        ] {
            let flicker = Flicker {
                floor: 3e-5,
                t_corr_s,
            };
            let noise = Composite::new(
                flicker
                    .processes(100.0)
                    .unwrap()
                    .into_iter()
                    .map(Process::GaussMarkov)
                    .collect(),
            );
            assert_eq!(noise.processes.len(), count);
            let (from_s, to_s) = flicker.range_s();
            let steps = ((to_s / from_s).log2() * 64.0).ceil().max(1.0);
            let times =
                (0..=steps as u32).map(|k| from_s * (to_s / from_s).powf(f64::from(k) / steps));
            let ratios: Vec<f64> = times
                .map(|t| noise.allan_variance((100.0 * t).round() as u32).sqrt() / 3e-5)
                .collect();
            let (low, high) = ratios
                .iter()
                .fold((f64::MAX, 0.0_f64), |(l, h), r| (l.min(*r), h.max(*r)));
            assert!(
                (1.0 - 1e-4..1.001).contains(&low) && high < highest + 1e-3,
                "{t_corr_s}: {low} {high}"
            );
        }
    }

    #[test]
    fn what_is_no_floor_is_refused() {
        for flicker in [
            Flicker {
                floor: f64::NAN,
                t_corr_s: 300.0,
            },
            Flicker {
                floor: 1.0,
                t_corr_s: 0.0,
            },
        ] {
            assert!(flicker.processes(100.0).is_err(), "{flicker:?}");
        }
    }
}
