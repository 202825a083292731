//! Strapdown mechanisation on WGS-84, eight runs at a time.
//!
//! Quaternion attitude with two-sample coning, velocity with two-sample sculling and rotation
//! compensation to third order ([Savage](crate::bibliography::Savage98)), Earth and transport rate at the middle of the
//! interval, trapezoidal position in (lat, lon, h) ([Groves](crate::bibliography::Groves13), sec. 5.4–5.5).
//! No small-angle, flat-Earth or Euler-angle assumption: any heading and attitude, either hemisphere,
//! across ±180° of longitude. Latitude and longitude lose their meaning at the poles: whoever drives the
//! mechanisation refuses |lat| > [`MAX_LATITUDE`](crate::earth::MAX_LATITUDE).
//!
//! ```
//! use glam::{DQuat, DVec3};
//! use nav_sim_navigation::earth::{GravityModel, gravity_down, omega_ie_n};
//! use nav_sim_navigation::frames::NavState;
//! use nav_sim_signal::lanes::{Lanes, Vec3};
//! use nav_sim_navigation::strapdown::Strapdown;
//!
//! let start = NavState { lat: 0.9, lon: 0.2, h: 100.0, v_n: DVec3::ZERO, q_b_n: DQuat::IDENTITY };
//! let mut vehicle = Strapdown::<Lanes>::new(&start, GravityModel::Wgs84);
//! // At rest gyroscopes feel the rotation of the Earth, accelerometers the support against gravity.
//! let gravity = gravity_down(GravityModel::Wgs84, start.lat.sin(), start.h);
//! let (dtheta, dv) = (omega_ie_n(start.lat) * 0.01, DVec3::new(0.0, 0.0, -gravity * 0.01));
//! for _ in 0..6000 {
//!     vehicle.step(Vec3::splat(dtheta), Vec3::splat(dv), 0.01);
//! }
//! assert!(vehicle.lane(0).v_n.length() < 1e-9);
//! assert!((vehicle.lane(0).lat - start.lat).abs() < 1e-14);
//! ```

use crate::earth::{GravityModel, OMEGA_IE, Parallel};
use crate::frames::{NavState, wrap_angle};
use crate::lanes::{Lanes, Mat3, Quat, Real, Vec3, Wide};
use glam::DVec3;

/// Largest rotation of one sample interval (rad); beyond it the two-sample algorithm is not valid.
pub const MAX_ROTATION: f64 = 0.5;

/// The navigation states of eight runs, and the increments of the sample before; in memory, or in
/// registers inside a kernel.
#[derive(Debug, Clone, Copy)]
pub struct Strapdown<L = Lanes> {
    /// Geodetic latitude (rad).
    pub lat: L,
    /// Longitude (rad), not wrapped.
    pub lon: L,
    /// Height above the ellipsoid (m).
    pub h: L,
    /// Velocity with respect to the Earth in n (m/s).
    pub v_n: Vec3<L>,
    /// Attitude: takes b, returns n.
    pub q_b_n: Quat<L>,
    /// Angle increment of the sample before (rad).
    dtheta_before: Vec3<L>,
    /// Velocity increment of the sample before (m/s).
    dv_before: Vec3<L>,
    /// Coriolis acceleration of the sample before (m/s²), slow enough to extrapolate with.
    coriolis_before: Vec3<L>,
    gravity: GravityModel,
}

/// Intermediate results of a step, about which the filter linearises.
#[derive(Debug, Clone, Copy)]
pub struct StepTrace<L> {
    /// Attitude matrix at the middle of the step, takes b, returns n.
    pub c_b_n: Mat3<L>,
    /// Velocity increment by specific force in n: ∫ f_ib_n dt (m/s).
    pub dv_n: Vec3<L>,
}

impl Strapdown {
    /// The state of one lane.
    pub fn lane(&self, i: usize) -> NavState {
        NavState {
            lat: self.lat[i],
            lon: wrap_angle(self.lon[i]),
            h: self.h[i],
            v_n: self.v_n.lane(i),
            q_b_n: self.q_b_n.lane(i).normalize(),
        }
    }

    /// Sets the state of one lane.
    pub(crate) fn set_lane(&mut self, i: usize, state: &NavState) {
        (self.lat[i], self.lon[i], self.h[i]) = (state.lat, state.lon, state.h);
        self.v_n.set_lane(i, state.v_n);
        self.q_b_n.set_lane(i, state.q_b_n);
    }

    /// Into registers.
    #[inline(always)]
    pub(crate) fn load<W: Wide>(&self) -> Strapdown<W> {
        Strapdown {
            lat: W::load(&self.lat),
            lon: W::load(&self.lon),
            h: W::load(&self.h),
            v_n: self.v_n.load(),
            q_b_n: self.q_b_n.load(),
            dtheta_before: self.dtheta_before.load(),
            dv_before: self.dv_before.load(),
            coriolis_before: self.coriolis_before.load(),
            gravity: self.gravity,
        }
    }

    /// From registers.
    #[inline(always)]
    pub(crate) fn store<W: Wide>(&mut self, ins: &Strapdown<W>) {
        ins.lat.store(&mut self.lat);
        ins.lon.store(&mut self.lon);
        ins.h.store(&mut self.h);
        self.v_n.store(ins.v_n);
        self.q_b_n.store(ins.q_b_n);
        self.dtheta_before.store(ins.dtheta_before);
        self.dv_before.store(ins.dv_before);
        self.coriolis_before.store(ins.coriolis_before);
    }
}

impl<L: Real> Strapdown<L> {
    /// Starts every lane from the same state.
    pub fn new(start: &NavState, gravity: GravityModel) -> Self {
        let zero = Vec3::splat(DVec3::ZERO);
        Self {
            lat: L::from(start.lat),
            lon: L::from(start.lon),
            h: L::from(start.h),
            v_n: Vec3::splat(start.v_n),
            q_b_n: Quat::splat(start.q_b_n),
            // No sample before the first: its coning and sculling are those of a vehicle that has just begun
            // to turn. A vehicle in steady rotation has no such correction (parallel increments), so nothing
            // is lost at rest.
            dtheta_before: zero,
            dv_before: zero,
            coriolis_before: zero,
            gravity,
        }
    }

    /// The gravity model in use.
    pub(crate) const fn gravity(&self) -> GravityModel {
        self.gravity
    }

    /// Advances by one sample interval of dt seconds.
    ///
    /// `dtheta` = ∫ omega_ib_b dt (rad) and `dv` = ∫ f_ib_b dt (m/s) over the interval, in the rotating
    /// body axes, as an integrating IMU gives them (its mean rates times dt).
    #[inline(always)]
    pub fn step(&mut self, dtheta: Vec3<L>, dv: Vec3<L>, dt: f64) -> StepTrace<L> {
        let (half, sixth, twelfth) = (L::from(0.5), L::from(1.0 / 6.0), L::from(1.0 / 12.0));
        let seconds = L::from(dt);
        // Coning and sculling from this sample and the one before (Savage 1998, two-sample form).
        // 1/12 is exact where the rate is linear in time over both intervals; what is left is of order dt⁴ a
        // step.
        let phi_b = self.dtheta_before.cross(dtheta).mul_add(twelfth, dtheta);
        // Without the triple product, θ²/6 of the specific force is lost in every turn: dt² overall.
        let sculling = self.dtheta_before.cross(dv) + self.dv_before.cross(dtheta);
        // (1 − cos θ)/θ² → 1/2 and (1 − sin θ/θ)/θ² → 1/6: rotation of the body while the specific force is
        // summed.
        let turned = dtheta.cross(dv * half + dtheta.cross(dv) * sixth);
        let dv_sf_b = sculling.mul_add(twelfth, dv + turned);
        self.dtheta_before = dtheta;
        self.dv_before = dv;

        let c_before = self.q_b_n.to_matrix();
        let dv_sf_n = c_before * dv_sf_b;
        let mid = self.at_middle(dv_sf_n, dt);
        // Rotation of n against inertial space over the interval; positive as n turns, so it is taken off the
        // attitude.
        let zeta = (mid.omega_ie_n + mid.omega_en_n) * seconds;

        // Velocity: specific force with the rotation of n, gravity, Coriolis.
        // On the average over the interval n has turned by half of zeta away from the axes of its beginning.
        let dv_n = dv_sf_n - zeta.cross(dv_sf_n) * half;
        // 2 ω_ie is the Coriolis term of the turning Earth, ω_en comes with writing v in n, which turns
        // against e.
        let coriolis = (mid.omega_ie_n + mid.omega_ie_n + mid.omega_en_n).cross(mid.v_n);
        self.coriolis_before = coriolis;
        let mut v_new = self.v_n + dv_n - coriolis * seconds;
        v_new[2] += mid.gravity * dt;

        // Position by the trapezoidal rule.
        // Radii and cos(lat) are those of the middle, hence the rule is of second order in position as well.
        let v_mean = (self.v_n + v_new) * half;
        self.lat += v_mean[0] * dt * mid.per_meridian;
        self.lon += v_mean[1] * dt * mid.per_transverse * mid.per_cos_lat;
        self.h -= v_mean[2] * dt;
        self.v_n = v_new;

        // Attitude: b turns by phi_b, n by zeta (≤ 3e-4 rad, second order suffices to rounding).
        let half_zeta = zeta * half;
        let q_n = Quat {
            w: half_zeta.dot(half_zeta) * -0.5 + 1.0,
            v: -half_zeta,
        };
        // Renormalised at every step: products of unit quaternions lose their norm by a random walk of
        // rounding, and a norm off by 1e-10 would scale the specific force.
        self.q_b_n = (q_n * self.q_b_n * Quat::from_rotation_vector(phi_b)).renormalised();
        let mut c_b_n = self.q_b_n.to_matrix();
        for i in 0..3 {
            for j in 0..3 {
                // The mean of both ends is that of the middle times cos(θ/2) in the plane of rotation: second
                // order in θ, as the error map is; it only weighs noise and biases, never the nominal state.
                c_b_n.0[i][j] = (c_before.0[i][j] + c_b_n.0[i][j]) * 0.5;
            }
        }
        StepTrace { c_b_n, dv_n }
    }

    /// Velocity, rates, radii and gravity at the middle of the interval, extrapolated by half of it.
    #[inline(always)]
    fn at_middle(&self, dv_sf_n: Vec3<L>, dt: f64) -> MidStep<L> {
        let (s, c) = self.lat.sin_cos();
        let parallel = Parallel::at(s);
        let r = parallel.radii();
        let half = L::from(0.5 * dt);
        // A velocity that is wrong by O(dt²) is enough: it enters through Coriolis (1e-4 /s), the radii and
        // gravity alone.
        let mut v_n = self.v_n + dv_sf_n * L::from(0.5) - self.coriolis_before * half;
        v_n[2] += parallel.gravity_down(self.gravity, self.h) * half;
        let h = self.h - (self.v_n[2] + v_n[2]) * (0.25 * dt);
        // one division for both
        let (meridian, transverse) = (r.meridian + h, r.transverse + h);
        let inverse = L::from(1.0) / (meridian * transverse);
        let (per_meridian, per_transverse) = (inverse * transverse, inverse * meridian);
        let half_dlat = v_n[0] * half * per_meridian;
        // First-order rotation of (sin, cos): half_dlat²/2 is 3e-15 at 100 m/s and 100 Hz, and no second
        // sin_cos is paid.
        let (sin_lat, cos_lat) = (s + c * half_dlat, c - s * half_dlat);
        let per_cos_lat = L::from(1.0) / cos_lat;
        let east = v_n[1] * per_transverse;
        MidStep {
            v_n,
            omega_ie_n: Vec3([cos_lat * OMEGA_IE, L::from(0.0), sin_lat * -OMEGA_IE]),
            omega_en_n: Vec3([
                east,
                -(v_n[0] * per_meridian),
                -(east * sin_lat * per_cos_lat),
            ]),
            gravity: parallel.nearby(sin_lat).gravity_down(self.gravity, h),
            per_meridian,
            per_transverse,
            per_cos_lat,
        }
    }
}

/// Quantities at the middle of a step.
struct MidStep<L> {
    v_n: Vec3<L>,
    omega_ie_n: Vec3<L>,
    omega_en_n: Vec3<L>,
    gravity: L,
    /// 1/(R_N + h) (1/m).
    per_meridian: L,
    /// 1/(R_E + h) (1/m).
    per_transverse: L,
    per_cos_lat: L,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::gravity_down;
    use crate::tests::*;

    /// Angle between two attitudes (rad), exact for small ones (an arc cosine is not).
    fn angle(a: DQuat, b: DQuat) -> f64 {
        2.0 * (a.inverse() * b).xyz().length()
    }

    fn start(lat_deg: f64, v_n: DVec3) -> NavState {
        let q_b_n = RollPitchYaw {
            roll: 0.1,
            pitch: -0.2,
            yaw: 2.0,
        }
        .to_quat();
        NavState {
            lat: lat_deg * DEG,
            lon: 3.1,
            h: 500.0,
            v_n,
            q_b_n,
        }
    }

    /// At rest on the Earth the sensors feel Earth rate and −g: nothing may move.
    #[test]
    fn a_stationary_imu_stays_where_it_is() {
        let state = start(-35.0, DVec3::ZERO);
        let g_n = DVec3::Z * gravity_down(GravityModel::Wgs84, state.lat.sin(), state.h);
        let (omega_n, f_n) = (earth::omega_ie_n(state.lat), -g_n);
        let b = state.q_b_n.inverse();
        let mut ins = Strapdown::new(&state, GravityModel::Wgs84);
        for _ in 0..90_000 {
            ins.step(
                Vec3::splat(b * omega_n * 0.01),
                Vec3::splat(b * f_n * 0.01),
                0.01,
            );
        }
        let end = ins.lane(7);
        let moved = earth::ned_difference(state.place(), end.place());
        // What the scheme leaves out is of second order in the rotation of a sample, (7e-7)²·g/4 =
        // 1.2e-12 m/s² of false acceleration: 0.5 µm in 900 s, and rounding beside it.
        assert!(moved.length() < 3e-6, "moved {moved}");
        let (v, turned) = (end.v_n.length(), angle(end.q_b_n, state.q_b_n));
        // rounding of the attitude: ≤ 4e-16 rad a step, 4e-11 rad if all one way; v ≤ g·4e-11·900 s/2
        assert!(v < 1.8e-7 && turned < 4e-11, "{v:e} m/s, {turned:e} rad");
    }

    /// Level flight along a parallel at constant speed, in closed form: the body follows n.
    #[test]
    fn flight_along_a_parallel_closes_over_one_hour() {
        let v_n = DVec3::new(0.0, 200.0, 0.0);
        let state = NavState {
            q_b_n: DQuat::IDENTITY,
            ..start(48.0, v_n)
        };
        let (w_ie, w_en) = (
            earth::omega_ie_n(state.lat),
            earth::omega_en_n(state.lat, state.h, v_n),
        );
        let g_n = DVec3::Z * gravity_down(GravityModel::Wgs84, state.lat.sin(), state.h);
        let f_n = (2.0 * w_ie + w_en).cross(v_n) - g_n;
        let mut ins = Strapdown::new(&state, GravityModel::Wgs84);
        let dt = 0.02;
        for _ in 0..180_000 {
            ins.step(Vec3::splat((w_ie + w_en) * dt), Vec3::splat(f_n * dt), dt);
        }
        let end = ins.lane(0);
        let transverse = radii(state.lat.sin()).transverse;
        let lon = 3.1 + 200.0 * 3600.0 / ((transverse + state.h) * state.lat.cos());
        let expected = NavState { lon, ..state };
        let error = earth::ned_difference(expected.place(), end.place());
        // Second order in n's rotation per sample: (2e-6)²·g/4 = 1e-11 m/s², 0.06 mm in an hour; the
        // vertical channel is unstable and multiplies it by cosh(√(2g/R)·3600 s) = 280 at most.
        assert!(
            error.truncate().length() < 1e-3 && error.z.abs() < 1.7e-2,
            "error {error}"
        );
        let dv = end.v_n - v_n;
        assert!(dv.truncate().length() < 1e-6 && dv.z.abs() < 1e-5, "{dv}");
    }

    /// Classical coning motion: the two-sample algorithm's drift is that of Savage (1998), of 4th order,
    /// 240 times below the uncorrected one here.
    #[test]
    fn coning_drift_is_of_fourth_order() {
        let (amplitude, omega): (f64, f64) = (2.0 * DEG, 2.0 * std::f64::consts::PI * 2.0);
        let attitude = |t: f64| {
            let axis = DVec3::new((omega * t).cos(), (omega * t).sin(), 0.0);
            DQuat::from_axis_angle(axis, amplitude)
        };
        // Body rate of a coning motion (exact): omega (−sin a sin ωt, sin a cos ωt, 2 sin²(a/2)) rotated.
        let drift = |dt: f64| {
            let state = NavState {
                lat: 0.0,
                lon: 0.0,
                h: 0.0,
                v_n: DVec3::ZERO,
                q_b_n: attitude(0.0),
            };
            let mut ins = Strapdown::new(&state, GravityModel::Wgs84);
            let steps = (20.0 / dt).round() as usize;
            for k in 0..steps {
                let (a, b) = (k as f64 * dt * omega, (k + 1) as f64 * dt * omega);
                let (sa, cz) = (amplitude.sin(), 1.0 - amplitude.cos());
                let integral = DVec3::new(
                    sa * (b.cos() - a.cos()),
                    sa * (b.sin() - a.sin()),
                    -cz * (b - a),
                );
                // Earth rate as the body feels it, at the interval's middle, so that n does not drift
                let mid = attitude((k as f64 + 0.5) * dt);
                let earth = mid.inverse() * earth::omega_ie_n(0.0) * dt;
                ins.step(Vec3::splat(integral + earth), Vec3::ZERO, dt);
                ins.set_lane(
                    0,
                    &NavState {
                        q_b_n: ins.lane(0).q_b_n,
                        ..state
                    },
                );
            }
            angle(ins.lane(0).q_b_n, attitude(20.0))
        };
        let (coarse, fine) = (drift(0.02), drift(0.01));
        assert!(fine < 2e-5, "drift {fine:e} rad");
        assert!(coarse / fine > 12.0, "order: {coarse:e} / {fine:e}");
    }
}
