//! Samples of an ideal integrating IMU along a trajectory.

use crate::earth::{GravityModel, OMEGA_IE, gravity_down, normal};
use crate::imu::{ImuSample, MAX_RATE_HZ};
use crate::trajectory::{Kinematics, Piece, Trajectory};
use crate::units::Refused;
use glam::DVec3;

/// Angular rate omega_ib_b and specific force f_ib_b at an instant
/// ([Groves](crate::bibliography::Groves13), eqs. 2.26, 2.125 and 2.147 without inertial frame):
///
/// f_ib_b = C_e_b (a_e + 2 omega_ie_e × v_e − g_e), omega_ib_b = omega_eb_b + C_e_b omega_ie_e.
fn ideal_imu_at(k: &Kinematics, gravity: GravityModel) -> ImuSample {
    let omega_ie_e = DVec3::new(0.0, 0.0, OMEGA_IE);
    // Gravity along the normal of the ellipsoid, as the filter has it: its north component is left out on
    // both sides.
    let (up_e, h) = normal(k.r_e);
    let g_e = up_e * -gravity_down(gravity, up_e.z, h);
    let q_e_b = k.q_b_e.conjugate();
    ImuSample {
        omega_ib_b: k.omega_eb_b + q_e_b * omega_ie_e,
        // In e the centrifugal acceleration is part of g_e, hence no omega_ie × (omega_ie × r) here.
        f_ib_b: q_e_b * (k.a_e + 2.0 * omega_ie_e.cross(k.v_e) - g_e),
    }
}

/// The samples of a perfect integrating IMU: sample k is the mean of omega_ib_b and of f_ib_b (in the
/// rotating axes of b) over (start + k dt, start + (k+1) dt], k = 0, 1, … as long as the trajectory lasts.
///
/// Three-point Gauss-Legendre quadrature between consecutive instants of {sample times, spline knots},
/// where the integrand is smooth: its relative error is (ω dt)⁶/2016000, 5e-13 at ω dt = 0.1 rad.
///
/// # Errors
/// A rate that is not positive and finite; a trajectory shorter than one sample.
pub fn ideal_imu(
    trajectory: &Trajectory,
    rate_hz: f64,
    gravity: GravityModel,
) -> Result<Vec<ImuSample>, Refused> {
    Ok(IdealSamples::new(trajectory, rate_hz, gravity)?.collect())
}

/// The samples of [`ideal_imu`] one after the other.
pub(crate) struct IdealSamples<'a> {
    trajectory: &'a Trajectory,
    rate_hz: f64,
    gravity: GravityModel,
    /// Samples still to come.
    knots: &'a [f64],
    /// The motion up to the first of them.
    piece: Piece,
    samples: std::ops::Range<usize>,
}

impl<'a> IdealSamples<'a> {
    /// Prepares the samples of [`ideal_imu`].
    pub(crate) fn new(
        trajectory: &'a Trajectory,
        rate_hz: f64,
        gravity: GravityModel,
    ) -> Result<Self, Refused> {
        if !(rate_hz > 0.0 && rate_hz <= MAX_RATE_HZ) {
            return Err(Refused(format!(
                "IMU rate {rate_hz} Hz is not a number > 0 and ≤ {MAX_RATE_HZ}"
            )));
        }
        let duration_s = trajectory.end_s() - trajectory.start_s();
        // A duration of 900 s at 100 Hz is 90000 samples, also when it was written 899.9999999 s.
        let n = (duration_s * rate_hz + 1e-6).floor() as usize;
        if n == 0 {
            return Err(Refused(format!(
                "the trajectory lasts {duration_s} s: less than one sample at {rate_hz} Hz"
            )));
        }
        Ok(Self {
            trajectory,
            rate_hz,
            gravity,
            knots: &trajectory.knots()[1..],
            piece: trajectory.piece(trajectory.start_s()),
            samples: 0..n,
        })
    }

    /// Mean over (from, to].
    fn mean(&mut self, from: f64, to: f64) -> ImuSample {
        let mut sum = ImuSample::default();
        let mut left = from;
        // A cubic spline has a jump of its third derivative at a knot: quadrature across it would lose its order.
        while let Some((&knot, rest)) = self.knots.split_first().filter(|(knot, _)| **knot < to) {
            if knot > left {
                self.add_integral(&mut sum, left, knot);
                left = knot;
            }
            self.knots = rest;
            self.piece = self.trajectory.piece(knot);
        }
        self.add_integral(&mut sum, left, to);
        let dt = to - from;
        ImuSample {
            omega_ib_b: sum.omega_ib_b / dt,
            f_ib_b: sum.f_ib_b / dt,
        }
    }

    fn add_integral(&self, sum: &mut ImuSample, from: f64, to: f64) {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        // Three points are exact for polynomials of degree five within the piece.
        let node = 0.6_f64.sqrt();
        for (x, weight) in [(-node, 5.0 / 9.0), (0.0, 8.0 / 9.0), (node, 5.0 / 9.0)] {
            let sample = ideal_imu_at(&self.piece.kinematics(middle + half * x), self.gravity);
            sum.omega_ib_b += sample.omega_ib_b * (weight * half);
            sum.f_ib_b += sample.f_ib_b * (weight * half);
        }
    }
}

impl Iterator for IdealSamples<'_> {
    type Item = ImuSample;

    fn next(&mut self) -> Option<ImuSample> {
        let k = self.samples.next()?;
        let start_s = self.trajectory.start_s();
        let [from, to] = [k, k + 1].map(|k| start_s + k as f64 / self.rate_hz);
        Some(self.mean(from, to))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.samples.size_hint()
    }
}

impl ExactSizeIterator for IdealSamples<'_> {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::{omega_en_n, omega_ie_n};
    use crate::tests::*;

    const WGS84: GravityModel = GravityModel::Wgs84;

    fn through(n: u32, dt_s: f64, at: impl Fn(f64) -> (f64, f64, f64, DQuat)) -> Trajectory {
        Trajectory::from_samples(&samples(n, dt_s, at)).unwrap()
    }

    #[test]
    fn at_rest_it_measures_earth_rate_and_minus_gravity() {
        for (lat_deg, h) in [(-70.0, 0.0), (0.0, 3000.0), (46.5, 400.0)] {
            let (lat, q_b_n) = (
                lat_deg * DEG,
                RollPitchYaw {
                    roll: 0.1,
                    pitch: 0.3,
                    yaw: 2.0,
                }
                .to_quat(),
            );
            let trajectory = through(4, 1.0, |_| (lat, 3.0, h, q_b_n));
            let g_n = DVec3::Z * gravity_down(WGS84, lat.sin(), h);
            let samples = ideal_imu(&trajectory, 50.0, WGS84).unwrap();
            assert_eq!(samples.len(), 200);
            for s in samples {
                assert!((q_b_n * s.omega_ib_b - omega_ie_n(lat)).length() < 1e-16);
                assert!((q_b_n * s.f_ib_b + g_n).length() < 1e-13);
            }
        }
    }

    /// v̇ = f + g − (2 omega_ie + omega_en) × v ([Groves](crate::bibliography::Groves13) eq. 5.53), with
    /// v constant eastwards along a parallel, and with a constant latitude rate along a meridian.
    #[test]
    fn flight_along_parallel_and_meridian_obeys_the_navigation_equation() {
        for (lat_rate, lon_rate) in [(0.0, 6e-5), (4e-5, 0.0)] {
            let (lat0, lon0, h) = (-40.0 * DEG, 179.9 * DEG, 10_000.0);
            let trajectory = through(100, 1.0, |t| {
                (lat0 + lat_rate * t, lon0 + lon_rate * t, h, DQuat::IDENTITY)
            });
            let s = ideal_imu_at(&trajectory.kinematics(50.25), WGS84);
            let lat = lat0 + lat_rate * 50.25;
            let r = radii(lat.sin());
            let v_n = DVec3::new(
                (r.meridian + h) * lat_rate,
                (r.transverse + h) * lat.cos() * lon_rate,
                0.0,
            );
            let w2 = 1.0 - crate::earth::E2 * lat.sin().powi(2);
            let curvature = 3.0 * crate::earth::E2 * lat.sin() * lat.cos() * r.meridian / w2;
            let a_n = DVec3::X * curvature * lat_rate * lat_rate;
            let (ie, en) = (omega_ie_n(lat), omega_en_n(lat, h, v_n));
            let g_n = DVec3::Z * gravity_down(WGS84, lat.sin(), h);
            let f_n = a_n - g_n + (2.0 * ie + en).cross(v_n);
            // n and b coincide; rounding of positions of 1e-9 m over 1 s² is what remains.
            assert!((s.f_ib_b - f_n).length() < 1e-8, "{} {f_n}", s.f_ib_b);
            assert!((s.omega_ib_b - ie - en).length() < 1e-13);
        }
    }

    /// Spinning about the front axis at rest at the equator: the mean over an interval of the specific
    /// force that turns by ω dt is its value at the middle times sin(ω dt/2)/(ω dt/2).
    #[test]
    fn samples_are_means_in_the_turning_axes() {
        let omega = 2.0;
        let trajectory = through(400, 0.01, |t| {
            (0.0, 0.0, 0.0, DQuat::from_rotation_x(omega * t))
        });
        let g = gravity_down(WGS84, 0.0, 0.0);
        for rate_hz in [20.0, 33.0, 100.0] {
            let dt = 1.0 / rate_hz;
            let sinc = (omega * dt / 2.0).sin() / (omega * dt / 2.0);
            for (k, s) in ideal_imu(&trajectory, rate_hz, WGS84)
                .unwrap()
                .iter()
                .enumerate()
            {
                let angle = omega * (k as f64 + 0.5) * dt;
                let expected = DVec3::new(0.0, -angle.sin(), -angle.cos()) * g * sinc;
                // the spline's error
                assert!((s.f_ib_b - expected).length() < 1e-7 * g);
                assert_abs_diff_eq!(s.omega_ib_b.x - omega, OMEGA_IE, epsilon = 1e-6);
            }
        }
    }

    /// Knots inside sample intervals: the sum of the samples is the integral whatever the rate, since the
    /// quadrature is split there. 7 Hz intervals hold several knots of a jerky 10 Hz trajectory, whose jumps
    /// of jerk (50 m/s³) would show as 1e-2 m/s. Quadrature: (7 rad/s · 0.1 s)⁶/2016000 · 4 s · 10 m/s².
    #[test]
    fn the_integral_does_not_depend_on_the_rate() {
        let jerky = |t: f64| {
            (
                0.8,
                0.1,
                (t * 7.0).sin() * 0.2,
                DQuat::from_rotation_y((t * 5.0).sin() * 0.1),
            )
        };
        let trajectory = through(40, 0.1, jerky);
        let integral = |rate_hz: f64| {
            let samples = ideal_imu(&trajectory, rate_hz, WGS84).unwrap();
            samples.iter().map(|s| s.f_ib_b).sum::<DVec3>() / rate_hz
        };
        let fine = integral(1000.0);
        for rate_hz in [7.0, 13.0, 100.0] {
            assert!(
                (integral(rate_hz) - fine).length() < 2e-6,
                "{rate_hz} Hz: {}",
                integral(rate_hz) - fine
            );
        }
    }

    #[test]
    fn impossible_rates_are_refused() {
        let trajectory = through(4, 1.0, |_| (0.8, 0.1, 0.0, DQuat::IDENTITY));
        for (rate_hz, expected) in [
            (0.0, "IMU rate 0 Hz is not a number > 0 and ≤ 100000"),
            (f64::NAN, "IMU rate NaN Hz is not a number > 0 and ≤ 100000"),
            (
                1e9,
                "IMU rate 1000000000 Hz is not a number > 0 and ≤ 100000",
            ),
            (
                0.1,
                "the trajectory lasts 4 s: less than one sample at 0.1 Hz",
            ),
        ] {
            let error = ideal_imu(&trajectory, rate_hz, WGS84).unwrap_err();
            assert_eq!(error.to_string(), expected);
        }
    }
}
