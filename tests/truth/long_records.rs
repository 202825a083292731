//! The classical wavelet variance of 10⁸ samples on an offset of 9.81, to 1e-12 against exact integers.

use nav_sim::signal::wavelet::classical;

const SAMPLES: usize = 100_000_000;
const LEVELS: u32 = 25;
/// A sample is OFFSET + k·2⁻⁴⁸ with |k| < 2²⁸: exact in double precision.
const UNIT: f64 = 1.0 / (1_u64 << 48) as f64;
const OFFSET: f64 = 9.8125;

/// The whole number of a sample: a mix of the bits of its index.
fn k(t: usize) -> i64 {
    let mut z = (t as u64)
        .wrapping_add(1)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 35) as i64 - (1 << 28)
}

/// Σ (2m·W_t)² in units of 2⁻⁹⁶, the difference of the two sums of m samples carried along: no rounding.
fn exact(level: u32) -> f64 {
    let m = 1_usize << (level - 1);
    let mut difference: i128 = (0..m).map(|t| i128::from(k(t + m) - k(t))).sum();
    let count = SAMPLES - 2 * m + 1;
    let mut squares: i128 = 0;
    for t in 0..count {
        squares += difference * difference;
        if t + 1 < count {
            difference += i128::from(k(t + 2 * m) - 2 * k(t + m) + k(t));
        }
    }
    squares as f64 * UNIT * UNIT / (4.0 * (m as f64) * (m as f64) * count as f64)
}

/// 1.6 GB of memory: `cargo test --test truth long_records -- --ignored`.
#[test]
#[ignore = "1.6 GB of memory"]
fn a_hundred_million_samples_keep_twelve_digits() {
    let signal: Vec<f64> = (0..SAMPLES).map(|t| OFFSET + k(t) as f64 * UNIT).collect();
    let nu = classical(&signal, LEVELS).unwrap();
    for level in [1, 2, 3, 8, 15, 20, 25] {
        let error = nu[level as usize - 1] / exact(level) - 1.0;
        assert!(error.abs() < 1e-12, "level {level}: {error:e}");
    }
}
