//! One smooth stretch of motion: speed, heading and height go from one value to another with bell- or
//! table-shaped rates, so that acceleration and angular rate are continuous.

/// The shape of a change from 0 to 1 over x in [0, 1]: its rate rises over a share `ramp` of the time as a
/// quintic smooth step, stays, and falls likewise. Value, rate, and the rate's first two derivatives are
/// continuous; outside [0, 1] nothing changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::trajectory) struct Shape {
    /// Share of the whole that each ramp takes, in (0, 1/2].
    ramp: f64,
}

impl Shape {
    pub(in crate::trajectory) fn new(ramp: f64) -> Self {
        Self {
            ramp: ramp.min(0.5),
        }
    }

    /// Largest rate; reached in the middle.
    fn peak(self) -> f64 {
        1.0 / (1.0 - self.ramp)
    }

    /// Rate of change at x.
    pub(super) fn rate(self, x: f64) -> f64 {
        let y = (x.min(1.0 - x) / self.ramp).clamp(0.0, 1.0);
        // 10y³ − 15y⁴ + 6y⁵: first and second derivative are zero at both ends.
        self.peak() * y * y * y * (10.0 + y * (6.0 * y - 15.0))
    }

    /// The change so far: the integral of the rate.
    pub(in crate::trajectory) fn value(self, x: f64) -> f64 {
        if x > 0.5 {
            // The rate is symmetric about the middle: one formula for both ramps, and exactly 1 at the end.
            return 1.0 - self.value(1.0 - x);
        }
        let y = (x / self.ramp).clamp(0.0, 1.0);
        let ramped = self.ramp * y.powi(4) * (2.5 + y * (y - 3.0));
        self.peak() * (ramped + (x - self.ramp).max(0.0))
    }

    /// The integral of the change so far.
    pub(super) fn integral(self, x: f64) -> f64 {
        if x > 0.5 {
            return x - 0.5 + self.integral(1.0 - x); // from value(x) = 1 − value(1 − x)
        }
        let y = (x / self.ramp).clamp(0.0, 1.0);
        let ramped = self.ramp * self.ramp * y.powi(5) * (0.5 + y * (y / 7.0 - 0.5));
        let past = (x - self.ramp).max(0.0);
        self.peak() * (ramped + past * (0.5 * self.ramp + 0.5 * past))
    }
}

/// A stretch of motion: everything as a function of the share x of its duration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    /// Duration (s).
    pub(super) duration: f64,
    pub(super) shape: Shape,
    /// Speed along the path at the start, and its change (m/s).
    pub(super) speed: [f64; 2],
    /// Heading at the start, and its change (rad).
    pub(super) heading: [f64; 2],
    /// Height at the start, and its change (m).
    pub(super) height: [f64; 2],
}

/// The motion at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    /// Horizontal speed (m/s).
    pub(super) horizontal: f64,
    /// Heading (rad) and its rate (rad/s).
    pub(super) heading: f64,
    pub(super) heading_rate: f64,
    /// Angle of the path above the horizon (rad).
    pub(super) slope: f64,
    /// Height (m).
    pub(super) h: f64,
}

impl Piece {
    /// Length of the path (m): the mean of a symmetric change is half of it.
    pub(super) fn length(&self) -> f64 {
        self.duration * (self.speed[0] + 0.5 * self.speed[1])
    }

    /// Sine of the steepest slope; the height changes with the path, not with time, so that a vehicle that
    /// starts or stops on a hill follows the road.
    pub(super) fn steepest(&self) -> f64 {
        if self.height[1] == 0.0 {
            0.0
        } else {
            (self.height[1] / self.length()).abs() * self.shape.peak()
        }
    }

    pub(super) fn at(&self, x: f64) -> Motion {
        let speed = self.speed[0] + self.speed[1] * self.shape.value(x);
        let (mut sin_slope, mut h) = (0.0, self.height[0]);
        if self.height[1] != 0.0 {
            let path = self.duration * (self.speed[0] * x + self.speed[1] * self.shape.integral(x));
            let share = path / self.length();
            sin_slope = self.height[1] / self.length() * self.shape.rate(share);
            h += self.height[1] * self.shape.value(share);
        }
        Motion {
            // Speed is along the path; what climbs does not go forwards.
            horizontal: speed * (1.0 - sin_slope * sin_slope).sqrt(),
            heading: self.heading[0] + self.heading[1] * self.shape.value(x),
            heading_rate: self.heading[1] * self.shape.rate(x) / self.duration,
            slope: sin_slope.asin(),
            h,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_value_and_integral_are_derivatives_of_one_another() {
        for ramp in [0.05, 0.3, 0.5] {
            let s = Shape::new(ramp);
            assert_eq!(
                (s.value(0.0), s.value(1.0), s.integral(0.0)),
                (0.0, 1.0, 0.0)
            );
            assert!(
                (s.integral(1.0) - 0.5).abs() < 1e-15 && (s.rate(0.5) - s.peak()).abs() < 1e-15
            );
            for k in 1..200 {
                let (x, step) = (f64::from(k) / 200.0, 1e-5);
                let slope = |f: &dyn Fn(f64) -> f64| (f(x + step) - f(x - step)) / (2.0 * step);
                assert!(
                    (slope(&|x| s.value(x)) - s.rate(x)).abs() < 1e-6,
                    "{ramp} {x}"
                );
                assert!(
                    (slope(&|x| s.integral(x)) - s.value(x)).abs() < 1e-9,
                    "{ramp} {x}"
                );
            }
        }
    }

    #[test]
    fn height_follows_the_path_also_from_rest() {
        let shape = Shape::new(0.25);
        let piece = Piece {
            duration: 10.0,
            shape,
            speed: [0.0, 8.0],
            heading: [0.0; 2],
            height: [100.0, 3.0],
        };
        let step = 1e-4;
        for k in 1..100 {
            let x = f64::from(k) / 100.0;
            let [before, now, after] = [x - step, x, x + step].map(|x| piece.at(x));
            let vertical = (after.h - before.h) / (2.0 * step * piece.duration);
            assert!((now.slope.tan() * now.horizontal - vertical).abs() < 1e-6);
        }
        assert_eq!(piece.at(0.0).slope, 0.0);
        assert!((piece.at(1.0).h - 103.0).abs() < 1e-12 && (piece.length() - 40.0).abs() < 1e-12);
    }
}
