//! Whether the differences from a reference are as large as the standard deviations say.

use super::{FromReference, Verdict};

/// Root mean square of error over standard deviation, of all states together, that is not believed: below and above.
/// A drive in which no error ever changes shows nine of them once: chi-square is below 9/4 once in 76 such drives, above
/// 81/4 once in 61.
const ALL_STATES: (f64, f64) = (0.5, 1.5);
/// The same of one state by itself: one of nine that never change is three standard deviations off once in 41 drives.
const ONE_STATE: f64 = 3.0;

/// A verdict on standard deviations, by a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Confidence {
    /// [`Verdict::Ok`], [`Verdict::Underconfident`] or [`Verdict::Overconfident`].
    pub verdict: Verdict,
    /// Root mean square of error over standard deviation, of all states together.
    pub over_sigma: f64,
    /// The state that is farthest off in the direction of the verdict; of a right one, that with the largest errors.
    pub state: usize,
    /// The same of this state.
    pub over_sigma_of_state: f64,
}

impl FromReference {
    /// Whether the errors are as large as stated.
    #[must_use]
    pub fn confidence(&self) -> Confidence {
        let over_sigma = (self.nees_mean / self.over_sigma.len() as f64).sqrt();
        let by_size = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1);
        let states = || self.over_sigma.into_iter().enumerate();
        let largest = states().max_by(by_size).unwrap_or_default();
        let (verdict, (state, over_sigma_of_state)) = if over_sigma > ALL_STATES.1 || largest.1 > ONE_STATE {
            (Verdict::Overconfident, largest)
        } else if over_sigma < ALL_STATES.0 {
            (Verdict::Underconfident, states().min_by(by_size).unwrap_or_default())
        } else {
            (Verdict::Ok, largest)
        };
        Confidence { verdict, over_sigma, state, over_sigma_of_state }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    #[test]
    fn the_state_is_the_one_farthest_off() {
        let confidence = |over_sigma: [f64; 9], nees_mean: f64| {
            let found = FromReference { over_sigma, nees_mean, ..FromReference::default() }.confidence();
            (found.verdict, found.state)
        };
        let with = |state: usize, value: f64| std::array::from_fn(|i| if i == state { value } else { 1.0 });
        assert_eq!(confidence(with(8, 1.4), 9.0), (Verdict::Ok, 8));
        assert_eq!(confidence(with(8, 1.4), 9.0 * 1.6 * 1.6), (Verdict::Overconfident, 8));
        assert_eq!(confidence(with(2, 3.1), 9.0), (Verdict::Overconfident, 2));
        assert_eq!(confidence(with(6, 0.1), 9.0 * 0.16), (Verdict::Underconfident, 6));
    }

    /// Right standard deviations are called wrong by chance in fewer than 1 of 18 drives, however little errors change
    /// within them.
    #[test]
    fn chance_is_no_verdict() {
        let (nine, one) = (ChiSquared::new(9.0).unwrap(), ChiSquared::new(1.0).unwrap());
        let (below, above) = (nine.cdf(9.0 * ALL_STATES.0.powi(2)), nine.sf(9.0 * ALL_STATES.1.powi(2)));
        let in_one = 9.0 * one.sf(ONE_STATE.powi(2));
        assert!((1.0 / below).round() == 76.0 && (1.0 / above).round() == 61.0, "{below} {above}");
        assert!((1.0 / in_one).round() == 41.0 && below + above + in_one < 1.0 / 18.0, "{in_one}");
    }
}
