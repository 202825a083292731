//! Cubic spline interpolation of several quantities over common knots.

/// A twice continuously differentiable piecewise cubic through N quantities. The end conditions are
/// "not-a-knot": the first two pieces are one cubic, and the last two, so that a cubic is reproduced and
/// the error is of fourth order up to the ends.
#[derive(Debug, Clone)]
pub(super) struct Spline<const N: usize> {
    t: Vec<f64>,
    y: Vec<[f64; N]>,
    /// Second derivatives at the knots.
    m: Vec<[f64; N]>,
}

impl<const N: usize> Spline<N> {
    /// Through `y` at the knots `t`: at least four, finite, strictly increasing (the caller's promise).
    pub(super) fn not_a_knot(t: Vec<f64>, y: Vec<[f64; N]>) -> Self {
        let last = t.len() - 1;
        let h: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
        let slope = |i: usize, c: usize| (y[i + 1][c] - y[i][c]) / h[i];
        // Thomas algorithm on the interior knots 1..last, all quantities at once.
        let mut upper = vec![0.0; last];
        let mut m = vec![[0.0; N]; last + 1];
        for i in 1..last {
            let (mut a, mut b, mut c) = (h[i - 1], 2.0 * (h[i - 1] + h[i]), h[i]);
            // m₀ = m₁ + (m₁ − m₂) h₀/h₁, the third derivative continued to the end, put into the first
            // equation.
            if i == 1 {
                b += h[0] + h[0] * h[0] / h[1];
                c -= h[0] * h[0] / h[1];
                a = 0.0;
            }
            if i == last - 1 {
                b += h[i] + h[i] * h[i] / h[i - 1];
                a -= h[i] * h[i] / h[i - 1];
                c = 0.0;
            }
            // The diagonal dominates for any spacing, the changed rows included: (h₀ + 2h₁) > |h₁ − h₀|. No
            // pivoting.
            let pivot = b - a * upper[i - 1];
            upper[i] = c / pivot;
            for k in 0..N {
                m[i][k] = (6.0 * (slope(i, k) - slope(i - 1, k)) - a * m[i - 1][k]) / pivot;
            }
        }
        for i in (1..last - 1).rev() {
            for k in 0..N {
                m[i][k] -= upper[i] * m[i + 1][k];
            }
        }
        for k in 0..N {
            m[0][k] = m[1][k] + (m[1][k] - m[2][k]) * h[0] / h[1];
            m[last][k] =
                m[last - 1][k] + (m[last - 1][k] - m[last - 2][k]) * h[last - 1] / h[last - 2];
        }
        Self { t, y, m }
    }

    pub(super) fn knots(&self) -> &[f64] {
        &self.t
    }

    /// The curve as far as the first knot at or after `t`.
    pub(super) fn until(&self, t: f64) -> Self {
        // The second derivatives are kept, not solved for anew: the curve before the cut is the same to the
        // last bit.
        let kept = (self.t.partition_point(|&knot| knot < t) + 1).clamp(2, self.t.len());
        Self {
            t: self.t[..kept].to_vec(),
            y: self.y[..kept].to_vec(),
            m: self.m[..kept].to_vec(),
        }
    }

    /// Value, first and second derivative. Outside the knots the first and last pieces continue.
    #[cfg(test)]
    fn at(&self, t: f64) -> [[f64; N]; 3] {
        self.piece(t).at(t)
    }

    /// The cubic at `t`; the first and last outside the knots.
    pub(super) fn piece(&self, t: f64) -> Cubic<N> {
        let i = self
            .t
            .partition_point(|&knot| knot <= t)
            .clamp(1, self.t.len() - 1)
            - 1;
        let h = self.t[i + 1] - self.t[i];
        let mut cubic = Cubic {
            begin: self.t[i],
            value: self.y[i],
            slope: [0.0; N],
            second: self.m[i],
            third: [0.0; N],
        };
        for k in 0..N {
            let (m0, m1) = (self.m[i][k], self.m[i + 1][k]);
            cubic.third[k] = (m1 - m0) / h;
            // First derivative at the left knot of the cubic with these values and second derivatives.
            cubic.slope[k] = (self.y[i + 1][k] - self.y[i][k]) / h - h * (2.0 * m0 + m1) / 6.0;
        }
        cubic
    }
}

/// A cubic through N quantities: value and derivatives at its left knot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cubic<const N: usize> {
    begin: f64,
    value: [f64; N],
    slope: [f64; N],
    second: [f64; N],
    third: [f64; N],
}

impl<const N: usize> Cubic<N> {
    /// Value, first and second derivative.
    pub(super) fn at(&self, t: f64) -> [[f64; N]; 3] {
        let dt = t - self.begin;
        let mut all = [[0.0; N]; 3];
        for k in 0..N {
            let (slope, m, third) = (self.slope[k], self.second[k], self.third[k]);
            all[0][k] = self.value[k] + dt * (slope + dt * (m / 2.0 + dt * third / 6.0));
            all[1][k] = slope + dt * (m + dt * third / 2.0);
            all[2][k] = m + dt * third;
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn uneven() -> Vec<f64> {
        vec![-1.0, -0.4, 0.3, 0.35, 1.2, 2.0, 2.9]
    }

    #[test]
    fn a_cubic_is_reproduced_with_its_derivatives() {
        for n in 4..=7 {
            let t: Vec<f64> = uneven()[..n].to_vec();
            let f = |t: f64| 2.0 - t + 0.5 * t * t - 0.25 * t * t * t;
            let s = Spline::not_a_knot(t.clone(), t.iter().map(|&t| [f(t), -f(t)]).collect());
            for k in 0..=40 {
                let x = -1.0 + (t[n - 1] + 1.0) * f64::from(k) / 40.0;
                let [value, first, second] = s.at(x);
                assert!((value[0] - f(x)).abs() < 1e-13 && (value[1] + f(x)).abs() < 1e-13);
                assert_abs_diff_eq!(first[0], -1.0 + x - 0.75 * x * x, epsilon = 1e-12);
                assert_abs_diff_eq!(second[0], 1.0 - 1.5 * x, epsilon = 1e-11);
            }
        }
    }

    #[test]
    fn value_slope_and_curvature_are_continuous_at_the_knots() {
        let t = uneven();
        let s = Spline::not_a_knot(t.clone(), t.iter().map(|&t| [(3.0 * t).sin()]).collect());
        for &knot in &t[1..t.len() - 1] {
            let (left, right) = (s.at(knot.next_down()), s.at(knot));
            assert_abs_diff_eq!(left[0][0], right[0][0], epsilon = 1e-13);
            assert_abs_diff_eq!(left[1][0], right[1][0], epsilon = 1e-12);
            assert_abs_diff_eq!(left[2][0], right[2][0], epsilon = 1e-11);
        }
    }

    /// The error of cubic spline interpolation is ≤ 5/384 h⁴ max|f⁗| inside (Hall & Meyer 1976), and of
    /// fourth order at the ends too under not-a-knot: halving h divides it by about 16.
    #[test]
    fn error_is_of_fourth_order_up_to_the_ends() {
        let worst = |n: u32| {
            let t: Vec<f64> = (0..=n).map(|i| 2.0 * f64::from(i) / f64::from(n)).collect();
            let s = Spline::not_a_knot(t.clone(), t.iter().map(|t| [t.sin()]).collect());
            (0..=1000)
                .map(|k| 2.0 * f64::from(k) / 1000.0)
                .map(|x| (s.at(x)[0][0] - x.sin()).abs())
                .fold(0.0, f64::max)
        };
        let (coarse, fine) = (worst(20), worst(40));
        assert!(
            fine < 5.0 / 384.0 * 0.05_f64.powi(4) * 20.0 && coarse / fine > 12.0,
            "{coarse} {fine}"
        );
    }
}
