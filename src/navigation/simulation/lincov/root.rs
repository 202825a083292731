//! Where a function that falls crosses zero.

/// How a crossing is sought.
pub(crate) struct Crossing {
    /// Where the variable may go.
    pub(crate) bounds: (f64, f64),
    /// First step away from the start; it doubles until there is a bracket.
    pub(crate) step: f64,
    /// A value this close to zero is zero.
    pub(crate) exact: f64,
}

/// Evaluations within a bracket. The Illinois rule gains a digit in two of them.
const TRIALS: usize = 40;

impl Crossing {
    /// The variable and its value: within `exact` of zero, or at a bound where there is no crossing. From a value
    /// above zero the variable goes up. A bracket first, then regula falsi with the Illinois rule, which
    /// keeps it.
    pub(crate) fn from<E>(
        &self,
        start: f64,
        mut value: impl FnMut(f64) -> Result<f64, E>,
    ) -> Result<(f64, f64), E> {
        let mut near = (start, value(start)?);
        if near.1.abs() <= self.exact {
            return Ok(near);
        }
        // The function falls: a value above zero means that the crossing lies above.
        let mut step = self.step.copysign(near.1);
        let mut far = near;
        while far.1 * near.1 > 0.0 {
            near = far;
            let next = (near.0 + step).clamp(self.bounds.0, self.bounds.1);
            if next == near.0 {
                return Ok(near);
            }
            far = (next, value(next)?);
            // Zero may be where the function ends and not where it crosses.
            if far.1.abs() <= self.exact {
                return Ok(far);
            }
            step *= 2.0;
        }
        for _ in 0..TRIALS {
            if far.1.abs() <= self.exact || !far.1.is_finite() {
                break;
            }
            let middle = (near.0 * far.1 - far.0 * near.1) / (far.1 - near.1);
            let found = (middle, value(middle)?);
            // Illinois: the end that stays is given half of its value, since plain regula falsi keeps one end
            // for ever where the function is convex.
            near = if found.1 * far.1 < 0.0 {
                far
            } else {
                (near.0, 0.5 * near.1)
            };
            far = found;
        }
        Ok(far)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn found(start: f64, f: impl Fn(f64) -> f64) -> f64 {
        let crossing = Crossing {
            bounds: (-5.0, 5.0),
            step: 0.1,
            exact: 1e-9,
        };
        let Ok((x, _)) = crossing.from::<Infallible>(start, |x| Ok(f(x)));
        x
    }

    #[test]
    fn a_crossing_is_found_from_either_side_and_a_bound_where_there_is_none() {
        let falling = |x: f64| (-x).exp() - 2.0;
        for start in [-4.0, 0.0, 4.0] {
            assert!((found(start, falling) + std::f64::consts::LN_2).abs() < 1e-8);
        }
        assert_eq!(
            (found(0.0, |x| 9.0 - x), found(0.0, |x| -9.0 - x)),
            (5.0, -5.0)
        );
        // it comes close to zero from above and never crosses
        assert!(found(0.0, |x| (-20.0 * x).exp()) < 2.0);
        // a step: the bracket closes on it
        assert!((found(0.0, |x| if x < 1.25 { 1.0 } else { -1.0 }) - 1.25).abs() < 0.1);
    }
}
