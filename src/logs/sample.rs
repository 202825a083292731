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

impl std::str::FromStr for Stamp {
    type Err = &'static str;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name {
            "header" => Ok(Self::Header),
            "log" => Ok(Self::Log),
            _ => Err("neither header nor log"),
        }
    }
}

/// Origin of a channel's stamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Clock {
    /// 1 January 1970, without leap seconds, if the writer's clock was set.
    #[default]
    Unix,
    /// Start of the device.
    Boot,
}

/// Sample of an IMU, in the sensor's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuSample {
    /// Stamp (ns); where the sensor gives increments, the end of their interval.
    pub stamp_ns: i64,
    /// Specific force (m/s²); of increments, the mean over the interval.
    pub accel_m_s2: [f64; 3],
    /// Angular rate (rad/s); of increments, the mean over the interval.
    pub gyro_rad_s: [f64; 3],
}

/// Position fix of a receiver; messages without a fix in three dimensions are passed over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Stamp (ns).
    pub stamp_ns: i64,
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

/// What a message holds. Samples are many, fixes are few.
pub(crate) enum Sample {
    Imu(ImuSample),
    Fix(Box<Fix>),
}

impl Sample {
    pub(crate) const fn stamp_ns(&self) -> i64 {
        match self {
            Self::Imu(sample) => sample.stamp_ns,
            Self::Fix(fix) => fix.stamp_ns,
        }
    }
}

/// Standard deviations, where they are some: 0 and the largest number stand for unknown ones.
pub(crate) fn stated(sd: [f64; 3]) -> Option<[f64; 3]> {
    const UNKNOWN: f64 = 1e6;
    sd.iter().all(|s| *s > 0.0 && *s < UNKNOWN).then_some(sd)
}

/// Seconds of a stamp, rounded once: a product with 1e-9 would round twice. Around 1.7e9 s a `f64` resolves 0.24 µs.
#[must_use]
pub const fn in_seconds(ns: i64) -> f64 {
    (ns / NS) as f64 + (ns % NS) as f64 / NS as f64
}
