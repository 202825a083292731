//! Standard normal numbers, fast: the ziggurat of 256 layers ([Doornik](crate::bibliography::Doornik05)'s
//! ZIGNOR) with its common path small enough to be inlined and the generator kept in registers. A general
//! distribution library's sampler, which is called rather than inlined, costs twice as much here, where
//! noise is as dear as the filter.

use crate::rng::Generator;
use rand::{Rng, RngExt};
use std::sync::LazyLock;

const LAYERS: usize = 256;
/// Beginning of the tail. With this value 256 layers of equal area close at the top (tested).
const R: f64 = 3.654_152_885_361_009;
/// Area of each layer, R·f(R) + ∫_R^∞ f, of the unnormalised density f.
const AREA: f64 = 0.004_928_673_233_974_655;

/// Edges of the layers and the density there.
#[derive(Debug)]
pub(super) struct Ziggurat {
    x: [f64; LAYERS + 1],
    f: [f64; LAYERS + 1],
}

/// The density, unnormalised.
fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp()
}

static ZIGGURAT: LazyLock<Ziggurat> = LazyLock::new(Ziggurat::new);

impl Ziggurat {
    /// The tables, computed once.
    pub(super) fn get() -> &'static Self {
        &ZIGGURAT
    }

    fn new() -> Self {
        let mut x = [0.0; LAYERS + 1];
        // The bottom layer is as wide as a rectangle of its area, which includes the tail.
        x[0] = AREA / density(R);
        x[1] = R;
        // Layers of one area: x[i−1] (f(x[i]) − f(x[i−1])) = AREA. x[LAYERS] stays 0, so the top layer has no
        // part that is accepted unseen.
        for i in 2..LAYERS {
            x[i] = (-2.0 * (AREA / x[i - 1] + density(x[i - 1])).ln()).sqrt();
        }
        Self {
            x,
            f: x.map(density),
        }
    }

    /// A standard normal number.
    #[inline(always)]
    pub(super) fn draw(&self, g: &mut Generator) -> f64 {
        let (layer, u, x) = self.candidate(g);
        // Within the next narrower layer the whole height of this one lies below the density.
        if x.abs() < self.x[layer + 1] {
            return x;
        }
        // By value, so that the generator's address is never taken in the common path.
        let (x, after) = self.edge(g.clone(), layer, u, x);
        *g = after;
        x
    }

    /// A layer, a uniform number in [−1, 1) and the point of the layer there: 8 and 52 bits of one draw.
    #[inline(always)]
    fn candidate(&self, g: &mut Generator) -> (usize, f64, f64) {
        let bits = g.next_u64();
        let layer = (bits & 0xff) as usize;
        // Mantissa bits under the exponent of 2: uniform on [2, 4), and the subtraction is exact. The layer's
        // 8 bits are not among them.
        let u = f64::from_bits((bits >> 12) | 2.0_f64.to_bits()) - 3.0;
        (layer, u, u * self.x[layer])
    }

    /// The 1.2 % that fall on a layer's edge or into the tail.
    #[cold]
    #[inline(never)]
    fn edge(&self, mut g: Generator, mut layer: usize, mut u: f64, mut x: f64) -> (f64, Generator) {
        loop {
            if layer == 0 {
                return (tail(&mut g).copysign(u), g);
            }
            // A uniform height within the layer, accepted below the density: von Neumann's rejection on the
            // edge.
            let (low, high) = (self.f[layer], self.f[layer + 1]);
            if high + (low - high) * g.random::<f64>() < density(x) {
                return (x, g);
            }
            (layer, u, x) = self.candidate(&mut g);
            if x.abs() < self.x[layer + 1] {
                return (x, g);
            }
        }
    }
}

/// A number beyond R (Marsaglia 1964).
fn tail(g: &mut Generator) -> f64 {
    // 1 − U is in (0, 1]: its logarithm is finite.
    let mut exponential = || -(1.0 - g.random::<f64>()).ln();
    loop {
        let (x, y) = (exponential() / R, exponential());
        // f(R + x) is e^(−Rx)·e^(−x²/2) but for a constant: the first factor is drawn, the second accepts
        // with P(y > x²/2).
        if 2.0 * y > x * x {
            return R + x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use statrs::distribution::{ContinuousCDF, Normal};

    #[test]
    fn the_layers_close_at_the_top_and_have_the_area() {
        let z = Ziggurat::new();
        let top = AREA / z.x[LAYERS - 1] + z.f[LAYERS - 1];
        assert!((top - 1.0).abs() < 1e-12, "{top}");
        let beyond = Normal::new(0.0, 1.0).unwrap().sf(R) * std::f64::consts::TAU.sqrt();
        assert!(
            (R * density(R) + beyond - AREA).abs() < 1e-12,
            "{}",
            R * density(R) + beyond
        );
    }

    /// Counts in bins of equal probability, chi-square with 255 degrees of freedom: sd √(2·255).
    #[test]
    fn all_quantiles_are_hit_evenly() {
        const BINS: usize = 256;
        let law = Normal::new(0.0, 1.0).unwrap();
        let mut g = Generator::seed_from_u64(3);
        let n = 1_000_000;
        let mut counts = [0.0; BINS];
        for _ in 0..n {
            counts[(law.cdf(Ziggurat::get().draw(&mut g)) * BINS as f64) as usize] += 1.0;
        }
        let expected = f64::from(n) / BINS as f64;
        let chi2: f64 = counts
            .iter()
            .map(|c: &f64| (c - expected).powi(2) / expected)
            .sum();
        assert!((chi2 - 255.0).abs() < 5.0 * 510.0_f64.sqrt(), "{chi2}");
    }

    /// Tail probabilities, each side, within 5 Poisson standard deviations; and the fourth moment, 3, whose
    /// sampling variance is (E x⁸ − 9)/n = 96/n.
    #[test]
    fn tails_and_fourth_moment() {
        let law = Normal::new(0.0, 1.0).unwrap();
        let mut g = Generator::seed_from_u64(4);
        let n = 8_000_000;
        let bounds = [3.0, R, 4.0, 4.5];
        let (mut above, mut below, mut fourth) = ([0.0; 4], [0.0; 4], 0.0);
        for _ in 0..n {
            let x = Ziggurat::get().draw(&mut g);
            fourth += x.powi(4);
            for (i, b) in bounds.iter().enumerate() {
                above[i] += f64::from(u8::from(x > *b));
                below[i] += f64::from(u8::from(x < -*b));
            }
        }
        for (i, b) in bounds.iter().enumerate() {
            let expected = f64::from(n) * law.sf(*b);
            for count in [above[i], below[i]] {
                let off: f64 = count - expected;
                assert!(
                    off.abs() < 5.0 * expected.sqrt(),
                    "beyond {b}: {count}, {expected}"
                );
            }
        }
        let n = f64::from(n);
        assert!(
            (fourth / n - 3.0).abs() < 5.0 * (96.0 / n).sqrt(),
            "{}",
            fourth / n
        );
    }
}
