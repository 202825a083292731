//! Median and median absolute deviation.

/// 1 / normal quantile of ¾.
const MAD_TO_DEVIATION: f64 = 1.482_602_218_505_602;

/// The median; NaN of nothing.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

/// 1.4826 × median |x − median|: the standard deviation of Gaussian numbers.
pub(super) fn deviation(values: &[f64]) -> f64 {
    let centre = median(values);
    let distances: Vec<f64> = values.iter().map(|x| (x - centre).abs()).collect();
    MAD_TO_DEVIATION * median(&distances)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        assert_eq!((median(&[3.0, 1.0, 2.0]), median(&[4.0, 1.0, 2.0, 3.0])), (2.0, 2.5));
        approx::assert_relative_eq!(deviation(&[1.0, 2.0, 3.0, 4.0, 100.0]), MAD_TO_DEVIATION);
    }
}
