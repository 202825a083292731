//! Samples of an IMU and fixes of a receiver.

/// Nanoseconds of a second.
pub(crate) const NS: i64 = 1_000_000_000;

/// Stamp that a sample is given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Stamp {
    /// Time of measurement, as the message states it.
    #[default]
    Header,
    /// Time of arrival, as the logger states it; that of measurement where it states none.
    Log,
}

/// Origin of a channel's stamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// 1 January 1970, without leap seconds, if the writer's clock was set.
    Unix,
    /// Start of the device.
    Boot,
}

/// Sample of an IMU, in the sensor's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuSample {
    /// Stamp (ns); where the motion is increments, the end of their interval.
    pub stamp_ns: i64,
    /// Specific force and angular rate.
    pub motion: Motion,
}

/// Motion as the sensor gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Rates.
    Rates {
        /// Specific force (m/s²).
        accel_m_s2: [f64; 3],
        /// Angular rate (rad/s).
        gyro_rad_s: [f64; 3],
    },
    /// Increments over an interval.
    Increments {
        /// Velocity increment (m/s).
        dv_m_s: [f64; 3],
        /// Angle increment (rad).
        dtheta_rad: [f64; 3],
        /// Interval of the velocity increment (s).
        dv_dt_s: f64,
        /// Interval of the angle increment (s).
        dtheta_dt_s: f64,
    },
}

impl Motion {
    /// Specific force (m/s²) and angular rate (rad/s): of increments, their means over the interval.
    #[must_use]
    pub fn rates(&self) -> ([f64; 3], [f64; 3]) {
        match *self {
            Self::Rates {
                accel_m_s2,
                gyro_rad_s,
            } => (accel_m_s2, gyro_rad_s),
            Self::Increments {
                dv_m_s,
                dtheta_rad,
                dv_dt_s,
                dtheta_dt_s,
            } => (
                dv_m_s.map(|v| v / dv_dt_s),
                dtheta_rad.map(|a| a / dtheta_dt_s),
            ),
        }
    }
}

/// Position fix of a receiver; messages without a fix in three dimensions are passed over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Stamp (ns).
    pub stamp_ns: i64,
    /// Time of the GPS week (ms), where the receiver states it.
    pub gps_tow_ms: Option<u32>,
    /// Latitude (deg).
    pub lat_deg: f64,
    /// Longitude (deg).
    pub lon_deg: f64,
    /// Height above the ellipsoid (m).
    pub h_m: f64,
    /// Standard deviations north, east, down (m).
    pub sd_ned_m: Option<[f64; 3]>,
    /// Velocity north, east, down (m/s).
    pub v_ned_m_s: Option<[f64; 3]>,
    /// Its standard deviations (m/s).
    pub sd_v_ned_m_s: Option<[f64; 3]>,
}

/// Standard deviations, where they are some: 0 and the largest number stand for unknown ones.
pub(crate) fn stated(sd: [f64; 3]) -> Option<[f64; 3]> {
    const UNKNOWN: f64 = 1e6;
    sd.iter().all(|s| *s > 0.0 && *s < UNKNOWN).then_some(sd)
}

/// Anything with a stamp.
pub(crate) trait Stamped {
    fn stamp_ns(&self) -> i64;
}

impl Stamped for ImuSample {
    fn stamp_ns(&self) -> i64 {
        self.stamp_ns
    }
}

impl Stamped for Fix {
    fn stamp_ns(&self) -> i64 {
        self.stamp_ns
    }
}

impl ImuSample {
    /// Stamp (s); around 1.7e9 s a `f64` resolves 0.24 µs.
    #[must_use]
    pub const fn t_s(&self) -> f64 {
        in_seconds(self.stamp_ns)
    }
}

impl Fix {
    /// Stamp (s); around 1.7e9 s a `f64` resolves 0.24 µs.
    #[must_use]
    pub const fn t_s(&self) -> f64 {
        in_seconds(self.stamp_ns)
    }
}

/// Seconds of a stamp, rounded once: a product with 1e-9 would round twice.
const fn in_seconds(ns: i64) -> f64 {
    (ns / NS) as f64 + (ns % NS) as f64 / NS as f64
}
