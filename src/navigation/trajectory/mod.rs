//! Reference trajectories: splines through samples, motion profiles, imports.
//!
//! A [`Trajectory`] is a curve with two continuous derivatives through position and attitude samples.
//! Everything a sensor could measure follows from it by differentiation, so the ideal IMU and the
//! reference agree to rounding, whatever the samples were.

pub mod ideal_imu;
pub mod plausibility;
pub mod profile;
pub mod reference;
mod spline;

use crate::earth::{GravityModel, MAX_LATITUDE, e_to_n, ecef_to_geodetic, geodetic_to_ecef};
use crate::frames::{NavState, q_e_n};
use crate::imu::ImuSample;
use crate::units::{DEG, Refused};
use glam::{DQuat, DVec3};
use ideal_imu::ideal_imu;
use spline::{Cubic, Spline};
use std::sync::{Arc, Mutex, PoisonError};

/// The largest rotation between two consecutive samples (rad): 60°. Beyond it the way round is a guess.
pub const MAX_ROTATION: f64 = 60.0 * DEG;

/// Position and attitude at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrajectorySample {
    /// Time (s).
    pub t_s: f64,
    /// Geodetic latitude (rad).
    pub lat: f64,
    /// Longitude (rad); may cross ±180°.
    pub lon: f64,
    /// Height above the WGS-84 ellipsoid (m).
    pub h: f64,
    /// Attitude: takes b, returns n.
    pub q_b_n: DQuat,
}

/// Samples that no trajectory goes through. `index` counts samples from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// A spline needs four samples.
    #[error("{found} samples: a trajectory needs at least 4")]
    TooFew {
        /// Number of samples.
        found: usize,
    },
    /// NaN or infinity.
    #[error("{what} = {value} is not a finite number")]
    NotFinite {
        /// Index of the sample.
        index: usize,
        /// Name of the quantity.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Time stands still or goes back.
    #[error("time goes from {previous_s} s to {t_s} s: it must increase")]
    Time {
        /// Index of the sample.
        index: usize,
        /// Its time.
        t_s: f64,
        /// The time before it.
        previous_s: f64,
    },
    /// Too near a pole, or not a latitude.
    #[error("latitude {lat_deg}° at {t_s} s is beyond ±89.9°")]
    Latitude {
        /// Index of the sample.
        index: usize,
        /// Its time.
        t_s: f64,
        /// Its latitude (deg).
        lat_deg: f64,
    },
    /// More than 60° of rotation from one sample to the next.
    #[error("attitude turns {angle_deg:.1}° between {previous_s} s and {t_s} s: more than 60°")]
    Rotation {
        /// Index of the sample.
        index: usize,
        /// Its time.
        t_s: f64,
        /// The time before it.
        previous_s: f64,
        /// The angle (deg).
        angle_deg: f64,
    },
}

impl TrajectoryError {
    /// The sample at fault, counted from 0, if it is one.
    pub const fn index(&self) -> Option<usize> {
        match self {
            Self::TooFew { .. } => None,
            Self::NotFinite { index, .. }
            | Self::Time { index, .. }
            | Self::Latitude { index, .. }
            | Self::Rotation { index, .. } => Some(*index),
        }
    }
}

/// Position, its derivatives, attitude and angular rate at an instant, with respect to the Earth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// Position in e (m).
    pub r_e: DVec3,
    /// Velocity with respect to the Earth, in e (m/s).
    pub v_e: DVec3,
    /// Its derivative in e (m/s²).
    pub a_e: DVec3,
    /// Attitude: takes b, returns e.
    pub q_b_e: DQuat,
    /// Angular rate of b with respect to e, in b (rad/s).
    pub omega_eb_b: DVec3,
}

/// A twice continuously differentiable motion: a cubic spline through position in e relative to the first
/// point (for digits) and through the attitude quaternion q_b_e, normalised after interpolation. No Euler
/// angle is interpolated, so yaw may wrap and pitch may pass ±90°.
#[derive(Debug, Clone)]
pub struct Trajectory {
    origin_e: DVec3,
    curve: Arc<Spline<7>>,
    /// The ideal IMU computed last, shared by all clones.
    ideal: Arc<Mutex<Option<IdealImu>>>,
}

/// Rate (Hz), gravity, samples.
type IdealImu = (f64, GravityModel, Arc<Vec<ImuSample>>);

impl Trajectory {
    /// The trajectory through samples of increasing time.
    ///
    /// # Errors
    /// Fewer than four samples, a value that is not finite, time that does not increase, latitude beyond
    /// ±89.9°, more than 60° of rotation between two samples.
    pub fn from_samples(samples: &[TrajectorySample]) -> Result<Self, TrajectoryError> {
        check(samples)?;
        let origin_e = geodetic_to_ecef(samples[0].lat, samples[0].lon, samples[0].h);
        let mut q_last = DQuat::IDENTITY;
        let mut values = Vec::with_capacity(samples.len());
        for (index, s) in samples.iter().enumerate() {
            // Small numbers for the spline, whose second derivatives would else lose digits to 6.4e6 m. The
            // rounding of the samples themselves, 1e-9 m, becomes part of the motion, for reference and IMU
            // alike.
            let r = geodetic_to_ecef(s.lat, s.lon, s.h) - origin_e;
            // With respect to e, not n: the axes of n turn as the vehicle moves, ever faster towards a pole.
            let mut q = q_e_n(s.lat, s.lon).inverse() * s.q_b_n.normalize();
            if q.dot(q_last) < 0.0 {
                q = -q; // q and −q are the same attitude: stay on the side of the last sample
            }
            if index > 0 {
                check_rotation(samples, index, q_last, q)?;
            }
            q_last = q;
            values.push([r.x, r.y, r.z, q.x, q.y, q.z, q.w]);
        }
        let t_s = samples.iter().map(|s| s.t_s).collect();
        Ok(Self::of(origin_e, Spline::not_a_knot(t_s, values)))
    }

    /// Time of the first sample (s).
    pub fn start_s(&self) -> f64 {
        self.knots()[0]
    }

    /// Time of the last sample (s).
    pub fn end_s(&self) -> f64 {
        self.knots()[self.knots().len() - 1]
    }

    /// Times of the first and the last sample (s).
    pub fn span_s(&self) -> (f64, f64) {
        (self.start_s(), self.end_s())
    }

    /// Times of the samples (s): the third derivative is constant between two of them.
    pub fn knots(&self) -> &[f64] {
        self.curve.knots()
    }

    /// The motion as far as its first sample at or after `t_s`.
    pub fn until(&self, t_s: f64) -> Self {
        Self::of(self.origin_e, self.curve.until(t_s))
    }

    fn of(origin_e: DVec3, curve: Spline<7>) -> Self {
        Self {
            origin_e,
            curve: Arc::new(curve),
            ideal: Arc::default(),
        }
    }

    /// The samples of [`ideal_imu()`], computed once for many runs.
    ///
    /// # Errors
    /// As [`ideal_imu()`].
    pub fn ideal(
        &self,
        rate_hz: f64,
        gravity: GravityModel,
    ) -> Result<Arc<Vec<ImuSample>>, Refused> {
        let mut last = self.ideal.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((rate, model, samples)) = &*last
            && (*rate, *model) == (rate_hz, gravity)
        {
            return Ok(samples.clone());
        }
        let samples = Arc::new(ideal_imu(self, rate_hz, gravity)?);
        *last = Some((rate_hz, gravity, samples.clone()));
        Ok(samples)
    }

    /// The motion with respect to the Earth. Outside start and end the first and last pieces continue.
    pub fn kinematics(&self, t_s: f64) -> Kinematics {
        self.piece(t_s).kinematics(t_s)
    }

    /// The part between two knots around `t_s`.
    pub(crate) fn piece(&self, t_s: f64) -> Piece {
        Piece {
            origin_e: self.origin_e,
            cubic: self.curve.piece(t_s),
        }
    }

    /// Position, velocity and attitude in n. Outside start and end the first and last pieces continue.
    pub fn state(&self, t_s: f64) -> NavState {
        let k = self.kinematics(t_s);
        let (lat, lon, h) = ecef_to_geodetic(k.r_e);
        let q_b_n = q_e_n(lat, lon) * k.q_b_e;
        NavState {
            lat,
            lon,
            h,
            v_n: e_to_n(lat, lon, k.v_e),
            q_b_n: q_b_n.normalize(),
        }
    }
}

/// A trajectory between two knots, for many instants there.
pub(crate) struct Piece {
    origin_e: DVec3,
    cubic: Cubic<7>,
}

impl Piece {
    /// The motion with respect to the Earth.
    pub(crate) fn kinematics(&self, t_s: f64) -> Kinematics {
        let [[x, y, z, qx, qy, qz, qw], first, second] = self.cubic.at(t_s);
        let p = DQuat::from_xyzw(qx, qy, qz, qw);
        let p_dot = DQuat::from_xyzw(first[3], first[4], first[5], first[6]);
        let norm2 = p.length_squared();
        // q = p/|p|: the derivative of |p| is along q and has no vector part in q* q̇.
        // q̇ = ½ q ω (ω in b), hence ω = 2 vec(q* q̇).
        let rate = p.conjugate() * p_dot;
        Kinematics {
            r_e: self.origin_e + DVec3::new(x, y, z),
            v_e: DVec3::new(first[0], first[1], first[2]),
            a_e: DVec3::new(second[0], second[1], second[2]),
            q_b_e: p * norm2.sqrt().recip(),
            omega_eb_b: rate.xyz() * (2.0 / norm2),
        }
    }
}

fn check(samples: &[TrajectorySample]) -> Result<(), TrajectoryError> {
    if samples.len() < 4 {
        return Err(TrajectoryError::TooFew {
            found: samples.len(),
        });
    }
    let mut previous_s = f64::NEG_INFINITY;
    for (index, s) in samples.iter().enumerate() {
        let named = [("t_s", s.t_s), ("lat", s.lat), ("lon", s.lon), ("h", s.h)];
        if let Some((what, value)) = named.into_iter().find(|(_, v)| !v.is_finite()) {
            return Err(TrajectoryError::NotFinite { index, what, value });
        }
        let norm = s.q_b_n.length();
        // Zero, NaN and infinity alike: none can be made a unit quaternion.
        if !norm.is_normal() {
            return Err(TrajectoryError::NotFinite {
                index,
                what: "attitude",
                value: norm,
            });
        }
        if s.t_s <= previous_s {
            return Err(TrajectoryError::Time {
                index,
                t_s: s.t_s,
                previous_s,
            });
        }
        if s.lat.abs() > MAX_LATITUDE {
            return Err(TrajectoryError::Latitude {
                index,
                t_s: s.t_s,
                lat_deg: s.lat / DEG,
            });
        }
        previous_s = s.t_s;
    }
    Ok(())
}

fn check_rotation(
    samples: &[TrajectorySample],
    index: usize,
    from: DQuat,
    to: DQuat,
) -> Result<(), TrajectoryError> {
    let angle = (from.conjugate() * to).to_scaled_axis().length();
    if angle <= MAX_ROTATION {
        return Ok(());
    }
    let (t_s, previous_s) = (samples[index].t_s, samples[index - 1].t_s);
    Err(TrajectoryError::Rotation {
        index,
        t_s,
        previous_s,
        angle_deg: angle / DEG,
    })
}

#[cfg(test)]
mod tests;
