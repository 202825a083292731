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

use super::{Ar1, ParameterError, Process, White, non_negative};
use std::f64::consts::{LN_2, PI};
use std::sync::OnceLock;

/// Flicker noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlickerNoise {
    b2: f64,
}

/// The AR1 that stand for flicker noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ladder {
    /// Ratio of neighbouring correlation times.
    pub ratio: f64,
    /// Shortest correlation time (samples): what is faster is white noise.
    pub shortest: f64,
    /// Longest correlation time (samples).
    pub longest: f64,
}

impl Ladder {
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

impl FlickerNoise {
    /// Code in model files.
    pub(crate) const CODE: &'static str = "FN";
    /// Averages up to which the Allan variance is summed; beyond, its distance from the limit falls with their square
    /// (but for a logarithm, 2e-8 of the limit).
    const SUMMED: u32 = 2048;
    /// Its limit per B².
    const FLOOR: f64 = 2.0 * LN_2 / PI;

    /// B² (units²).
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn new(b2: f64) -> Result<Self, ParameterError> {
        Ok(Self {
            b2: non_negative(Self::CODE, "b2", b2)?,
        })
    }

    /// B² (units²).
    #[must_use]
    pub const fn b2(&self) -> f64 {
        self.b2
    }

    /// Haar wavelet variance per unit of B².
    #[must_use]
    pub fn haar_shape(level: u32) -> f64 {
        static SHAPES: OnceLock<[f64; 40]> = OnceLock::new();
        let shapes = SHAPES
            .get_or_init(|| std::array::from_fn(|j| 0.5 * Self::allan_shape(1.0, 1 << j.min(31))));
        shapes[(level as usize).clamp(1, shapes.len()) - 1]
    }

    pub(crate) fn haar_wv(&self, level: u32) -> f64 {
        self.b2 * Self::haar_shape(level)
    }

    /// Allan variance of averages over m samples, of a B².
    pub(super) fn allan_shape(b2: f64, samples: u32) -> f64 {
        if samples > Self::SUMMED {
            let nearest = Self::summed(Self::SUMMED) - Self::FLOOR;
            return b2
                * (Self::FLOOR + nearest * (f64::from(Self::SUMMED) / f64::from(samples)).powi(2));
        }
        b2 * Self::summed(samples.max(1))
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

    /// White noise and the AR1 whose sum stands for it, the fastest first.
    #[must_use]
    pub fn parts(&self, ladder: Ladder) -> Vec<Process> {
        let Ladder {
            ratio,
            shortest,
            longest,
        } = ladder;
        let step = ratio.ln();
        // A correlation time of T samples is 1/(2 asinh u).
        let of_time = |samples: f64| (0.5 / samples).sinh();
        let (first, last) = (of_time(shortest), of_time(longest));
        let count = ((first / last).ln() / step + 1e-9).floor() as i32 + 1;
        // Faster ones have the spectrum 1/u where they are felt: a geometric sum.
        let white = self.b2 * step / PI / first / (ratio - 1.0);
        let ar1 = |k: i32| {
            let u = first * ratio.powi(-k);
            let phi = (-2.0 * u.asinh()).exp();
            Ar1::new(phi, self.b2 * step / PI * 4.0 * phi * u).map(Process::Ar1)
        };
        let white = White::new(white).map(Process::White);
        std::iter::once(white)
            .chain((0..count).map(ar1))
            .filter_map(Result::ok)
            .collect()
    }

    /// Variance at the beginning of what is slower than the fastest AR1 of a filter: of all that is synthesised, however slow.
    #[must_use]
    pub fn initial_variance(&self) -> f64 {
        let fastest = (-1.0 / Ladder::FILTER.shortest).exp() * (1.0 - 1e-9);
        let slow = |part: Process| match part {
            Process::Ar1(p) if p.phi() >= fastest => p.variance(),
            _ => 0.0,
        };
        self.parts(Ladder::FINE).into_iter().map(slow).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Composite, Model, Synthesizer};
    use crate::rng::StreamKey;
    use crate::wavelet::classical;

    /// nu_1 = E (X_1 − X_0)²/4 = B²/π, and the limit ln 2/π·B²; between, the integral of the spectrum 4 sin⁴(πfm)/(m² sin²(πf))/4
    /// ([Percival]) by the midpoint rule.
    #[test]
    fn the_wavelet_variance_is_the_integral_of_the_spectrum() {
        assert!((FlickerNoise::haar_shape(1) - 1.0 / PI).abs() < 1e-15);
        assert!((FlickerNoise::haar_shape(30) - LN_2 / PI).abs() < 1e-9);
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
            assert!(
                (FlickerNoise::haar_shape(level) / integral - 1.0).abs() < 1e-6,
                "{level}: {integral}"
            );
        }
        // where the sum ends and the limit begins
        let (summed, beyond) = (
            FlickerNoise::summed(4096),
            FlickerNoise::allan_shape(1.0, 4096),
        );
        assert!((summed / beyond - 1.0).abs() < 2e-8, "{summed} {beyond}");
    }

    /// The stated errors, in the wavelet variance (a mean of the spectrum, so no larger): of synthesis from the first scale to 2^24
    /// samples, of filters from 2^9 to 2^17.
    #[test]
    fn the_sums_are_off_by_what_is_said() {
        let noise = FlickerNoise::new(4.0).unwrap();
        for (ladder, levels, error) in [
            (Ladder::FINE, 1..=24, 6e-4),
            (Ladder::FILTER, 9..=17, 0.035),
        ] {
            let sum = Composite::new(noise.parts(ladder));
            for level in levels {
                let ratio = sum.haar_wv(level) / noise.haar_wv(level);
                assert!((ratio - 1.0).abs() < error, "{ladder:?}, {level}: {ratio}");
            }
        }
        assert!(noise.parts(Ladder::FILTER).len() <= 7);
    }

    /// 100 records of 2^12 samples: the mean wavelet variance is within four of its standard errors.
    #[test]
    fn what_is_synthesised_has_its_wavelet_variance() {
        let axis = Composite::new(vec![Process::Flicker(FlickerNoise::new(1.0).unwrap())]);
        let model = Model::pooled(100.0, &axis, &axis);
        let measured = |run| {
            let key = StreamKey {
                seed: 1,
                scenario: "",
                run,
                source: "",
                process: "",
            };
            let mut x = vec![0.0; 1 << 12];
            Synthesizer::new(&model.axes[0], key).fill(&mut x);
            classical(&x, 9).unwrap()
        };
        let all: Vec<Vec<f64>> = (0..100).map(measured).collect();
        for j in 0..9 {
            let mean = all.iter().map(|nu| nu[j]).sum::<f64>() / 100.0;
            let variance = all.iter().map(|nu| (nu[j] - mean).powi(2)).sum::<f64>() / 99.0;
            let expected = FlickerNoise::haar_shape(j as u32 + 1);
            assert!(
                (mean - expected).abs() < 4.0 * (variance / 100.0).sqrt(),
                "{j}: {mean} {expected}"
            );
        }
    }
}
