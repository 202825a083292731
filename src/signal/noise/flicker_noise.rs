//! Flicker noise, of spectral density B²/(2π|f|): the bias instability of [IEEE 952](crate::bibliography::Ieee952), fitted.
//!
//! Sampled, it is the white noise of variance B² through (1 − z⁻¹)^(−1/2), the fractional difference of
//! [Kasdin](crate::bibliography::Kasdin95): S = B²/(2|sin πf|), f in cycles a sample, which is B²/(2π|f|) at low frequencies whatever
//! the rate. Neighbours at distance k differ by
//!
//! E (X_{t+k} − X_t)² = 4B² ∫₀^½ sin²(πfk)/sin(πf) df = (4B²/π) O_k, O_k = Σ_{i=1}^k 1/(2i − 1),
//!
//! from which the Allan variance follows for every average; it rises from 2B²/π to (2 ln 2/π)B² = (0.664 B)².
//!
//! Nothing of finitely many states is flicker noise. With s = |sin πf| and u = e^x
//!
//! 1/(2s) = (1/π) ∫ u/(u² + s²) dx,
//!
//! and u/(u² + s²) is the spectrum of an AR1 of φ = e^(−2 asinh u), σ² = 4φu. The trapezoidal rule with step h makes of that a sum of
//! AR1 whose correlation times are a factor e^h apart, each of stationary variance B²h/π or less; its spectrum is off by at most
//! 2 sech(π²/h) between the ends (the transform of sech): 5e-4 for a factor of 3, 3.5 % for a factor of 8.

use super::ar1::{ALLAN_PEAK, ALLAN_PEAK_AT};
use super::{ParameterError, Process};
use std::f64::consts::{LN_2, PI};
use std::sync::OnceLock;

/// The AR1 that stand for flicker noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ar1Bank {
    /// Ratio of neighbouring correlation times.
    pub ratio: f64,
    /// Shortest correlation time (samples): what is faster is white noise.
    pub shortest: f64,
    /// Longest correlation time (samples).
    pub longest: f64,
}

impl Ar1Bank {
    /// For synthesis and the truth of an analysis: off by 5e-4 in all records of up to 10⁸ samples.
    pub const FINE: Self = Self {
        ratio: 3.0,
        shortest: 0.12,
        longest: 1e11,
    };
    /// For filters: within 3.5 % from 512 samples to 10⁵, with five states.
    pub const FILTER: Self = Self {
        ratio: 8.0,
        shortest: 64.0,
        longest: 2.7e5,
    };
}

/// Averages up to which the Allan variance is summed; beyond, its distance from the limit falls with their square
/// (but for a logarithm, 2e-8 of the limit).
const SUMMED: u32 = 2048;
/// Its limit per B².
const FLOOR: f64 = 2.0 * LN_2 / PI;

/// Haar wavelet variance per unit of B².
pub(super) fn haar_shape(level: u32) -> f64 {
    static SHAPES: OnceLock<[f64; 40]> = OnceLock::new();
    let shapes = SHAPES.get_or_init(|| std::array::from_fn(|j| 0.5 * allan_shape(1 << j.min(31))));
    shapes[(level as usize).clamp(1, shapes.len()) - 1]
}

/// Allan variance of averages over m samples per unit of B².
pub(super) fn allan_shape(samples: u32) -> f64 {
    if samples > SUMMED {
        let nearest = summed(SUMMED) - FLOOR;
        return FLOOR + nearest * (f64::from(SUMMED) / f64::from(samples)).powi(2);
    }
    summed(samples.max(1))
}

/// Half of E (mean of m − mean of the m before)²: the mean squared difference across the two less that within them.
fn summed(samples: u32) -> f64 {
    let m = f64::from(samples);
    let (mut odd, mut sum) = (0.0, 0.0);
    for k in 1..2 * samples {
        let k = f64::from(k);
        odd += 1.0 / (2.0 * k - 1.0);
        let across = m - (k - m).abs();
        let within = 2.0 * (m - k).max(0.0);
        sum += (across - within) * odd;
    }
    2.0 / PI * sum / (m * m)
}

/// Variance at the beginning of what is slower than the fastest AR1 of a filter: of all that is synthesised, however slow.
pub(super) fn initial_variance(b2: f64) -> f64 {
    let fastest = (-1.0 / Ar1Bank::FILTER.shortest).exp() * (1.0 - 1e-9);
    let parts = Ar1Bank::FINE.parts(b2).into_iter();
    let slow = parts.filter_map(|part| part.recursion().filter(|[phi, ..]| *phi >= fastest));
    slow.map(|[.., variance]| variance).sum()
}

impl Ar1Bank {
    /// White noise and the AR1 whose sum stands for it, the fastest first.
    pub(super) fn parts(self, b2: f64) -> Vec<Process> {
        let Ar1Bank {
            ratio,
            shortest,
            longest,
        } = self;
        let step = ratio.ln();
        // A correlation time of T samples is 1/(2 asinh u).
        let of_time = |samples: f64| (0.5 / samples).sinh();
        let (first, last) = (of_time(shortest), of_time(longest));
        let count = ((first / last).ln() / step + 1e-9).floor() as i32 + 1;
        // Faster ones have the spectrum 1/u where they are felt: a geometric sum.
        let white = b2 * step / PI / first / (ratio - 1.0);
        let ar1 = |k: i32| {
            let u = first * ratio.powi(-k);
            let phi = (-2.0 * u.asinh()).exp();
            Process::ar1(phi, b2 * step / PI * 4.0 * phi * u)
        };
        std::iter::once(Process::white(white))
            .chain((0..count).map(ar1))
            .filter_map(Result::ok)
            .collect()
    }
}

// Flicker noise by Gauss-Markov processes: what a data sheet's bias instability is read as.
//
// [IEEE 952](crate::bibliography::Ieee952) calls bias instability the floor of the Allan deviation, 0.664 times the
// coefficient of a flicker noise, and manufacturers read it off there. No process of finitely many states has a floor;
// a Gauss-Markov process has a peak, below which it is lower on both sides. Processes of one variance whose correlation
// times are a factor of 16 apart have an Allan deviation that is level between the first peak and the last: with x
// correlation times per average, the Allan variance of one is
//
// σ²·(2/x)·[1 − (3 − 4e^(−x) + e^(−2x))/(2x)],
//
// and the sum of three is at least 0.448 σ² and at most 1.15 times that (the deviation: 1.07).

/// Ratio of neighbouring correlation times.
const APART: f64 = 16.0;
/// The shortest correlation time, unless the longest is shorter (s): what is faster is hidden by white noise.
const SHORTEST_S: f64 = 1.0;
/// Lowest Allan variance between the peaks of one, two, three processes of variance 1; more change it by less than 1e-3.
const LOWEST: [f64; 3] = [ALLAN_PEAK * ALLAN_PEAK, 0.436_065_855_9, 0.448_028_281_7];

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
    pub fn range_s(&self) -> (f64, f64) {
        let shortest_s = self.t_corr_s * APART.powi(1 - self.count());
        (ALLAN_PEAK_AT * shortest_s, ALLAN_PEAK_AT * self.t_corr_s)
    }

    /// The Gauss-Markov processes whose sum has this floor, the slowest first.
    ///
    /// # Errors
    /// When a number is not positive.
    pub fn processes(&self, rate_hz: f64) -> Result<Vec<Process>, ParameterError> {
        // One variance for all, such that the lowest Allan variance between the peaks is the square of the
        // floor.
        let s2 = self.floor * self.floor / LOWEST[(self.count() as usize).min(LOWEST.len()) - 1];
        let process = |k: i32| Process::gauss_markov(APART.powi(k) / self.t_corr_s, s2, rate_hz);
        (0..self.count()).map(process).collect()
    }

    fn count(&self) -> i32 {
        1 + ((self.t_corr_s / SHORTEST_S).log2() / APART.log2()).max(0.0) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Composite;
    use approx::{assert_abs_diff_eq, assert_relative_eq};

    /// nu_1 = E (X_1 − X_0)²/4 = B²/π, and the limit ln 2/π·B²; between, the integral of the spectrum 4 sin⁴(πfm)/(m² sin²(πf))/4
    /// ([Percival]) by the midpoint rule.
    #[test]
    fn the_wavelet_variance_is_the_integral_of_the_spectrum() {
        assert_abs_diff_eq!(haar_shape(1), 1.0 / PI, epsilon = 1e-15);
        assert_abs_diff_eq!(haar_shape(30), LN_2 / PI, epsilon = 1e-9);
        for level in [2, 5, 9] {
            let m = f64::from(1_u32 << (level - 1));
            let n = 1 << 20;
            let sum: f64 = (0..n)
                .map(|i| {
                    let f = 0.5 * (f64::from(i) + 0.5) / f64::from(n);
                    let (s, sm) = ((PI * f).sin(), (PI * f * m).sin());
                    sm.powi(4) / (m * m * s * s) / (2.0 * s)
                })
                .sum();
            let integral = sum / f64::from(n);
            assert_relative_eq!(haar_shape(level), integral, max_relative = 1e-6);
        }
        // where the sum ends and the limit begins
        let (summed, beyond) = (summed(4096), allan_shape(4096));
        assert_relative_eq!(summed, beyond, max_relative = 2e-8);
    }

    /// The stated errors, in the wavelet variance (a mean of the spectrum, so no larger): of synthesis from the first scale to 2^24
    /// samples, of filters from 2^9 to 2^17.
    #[test]
    fn the_sums_are_off_by_what_is_said() {
        let noise = Process::flicker(4.0).unwrap();
        for (ladder, levels, error) in [
            (Ar1Bank::FINE, 1..=24, 6e-4),
            (Ar1Bank::FILTER, 9..=17, 0.035),
        ] {
            let sum = Composite::new(noise.parts(ladder));
            for level in levels {
                let ratio = sum.haar_wv(level) / (4.0 * haar_shape(level));
                assert!((ratio - 1.0).abs() < error, "{ladder:?}, {level}: {ratio}");
            }
        }
        assert!(noise.parts(Ar1Bank::FILTER).len() <= 7);
    }
}

#[cfg(test)]
mod flicker_tests {
    use super::*;
    use crate::noise::Composite;

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
            let noise = Composite::new(flicker.processes(100.0).unwrap());
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
