//! Whether the motion shows the heading.

use std::fmt;

/// Standard deviation of the heading from which an error-state filter is not to be believed (degrees): the sine
/// of the error is no longer the error, and noise is taken for information about the heading.
const LARGE_DEG: f64 = 5.0;
/// Time that an alignment may take (s).
const SETTLED_S: f64 = 120.0;

/// A heading that is hardly observable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadingDoubt {
    /// Its largest standard deviation while there are fixes (degrees).
    pub sigma_deg: f64,
    /// When (s from the start).
    pub after_s: f64,
}

impl fmt::Display for HeadingDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // beyond half a turn a linear deviation is only a large number
        let sigma = if self.sigma_deg < 180.0 {
            format!("{:.0}°", self.sigma_deg)
        } else {
            "over 180°".to_owned()
        };
        write!(
            f,
            "the heading is hardly observable: its standard deviation is {sigma} after {:.0} s although there are \
             fixes (horizontal accelerations are too small to show it); there the filter's sigma of yaw may be \
             several times too small, with any number of states",
            self.after_s
        )
    }
}

/// Where the heading is hardly observable: `while_fixed` are the times from the start (s) at which fixes are used,
/// and the standard deviations of yaw there (degrees). The first two minutes belong to the alignment.
#[must_use]
pub fn weak_heading(while_fixed: impl Iterator<Item = (f64, f64)>) -> Option<HeadingDoubt> {
    let settled = while_fixed.filter(|(after_s, _)| *after_s >= SETTLED_S);
    let worst = settled.max_by(|a, b| a.1.total_cmp(&b.1));
    let (after_s, sigma_deg) = worst.filter(|(_, sigma_deg)| *sigma_deg > LARGE_DEG)?;
    Some(HeadingDoubt { sigma_deg, after_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_deviation_after_the_alignment_decides() {
        assert_eq!(weak_heading([(10.0, 20.0), (200.0, 4.0)].into_iter()), None);
        let doubt = weak_heading([(10.0, 20.0), (200.0, 7.0), (300.0, 6.0)].into_iter());
        assert_eq!(
            doubt,
            Some(HeadingDoubt {
                sigma_deg: 7.0,
                after_s: 200.0
            })
        );
    }
}
