//! Topics of PX4 that hold samples and fixes (the files `msg/*.msg` of PX4-Autopilot).

use super::layout::{Field, Layout};
use crate::channel::Content;
use crate::sample::{Fix, ImuSample, Motion, Stamp, stated};

/// Content of a topic, and its rank: what the autopilot fuses comes before what a single device measures.
pub(super) fn content(name: &str, layout: &Layout) -> (Content, u8) {
    let imu = || ImuFields::new(name, layout, Stamp::Header).map(|_| Content::Imu);
    let fix = || FixFields::new(layout, Stamp::Header).map(|_| Content::Fix);
    let (content, rank) = match name {
        "sensor_combined" => (imu(), 0),
        "vehicle_imu" => (imu(), 1),
        "vehicle_gps_position" => (fix(), 0),
        "sensor_gps" => (fix(), 1),
        _ => (None, 0),
    };
    (content.unwrap_or(Content::Other), rank)
}

/// Time of a message.
#[derive(Debug, Clone, Copy)]
struct Time {
    /// That of the sensor, where the topic has one.
    sample: Option<Field>,
    published: Field,
}

impl Time {
    fn new(layout: &Layout, stamp: Stamp) -> Option<Self> {
        let sample = if stamp == Stamp::Header {
            layout.one("timestamp_sample")
        } else {
            None
        };
        Some(Self {
            sample,
            published: layout.one("timestamp")?,
        })
    }

    fn ns(self, message: &[u8]) -> Option<i64> {
        // 0 is a time that was not set
        let sample = self
            .sample
            .and_then(|field| field.time_ns(message))
            .filter(|ns| *ns > 0);
        sample.or_else(|| self.published.time_ns(message))
    }
}

/// Fields of samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct ImuFields {
    time: Time,
    accel: Field,
    gyro: Field,
    /// Intervals of velocity and angle (µs), where these are increments.
    intervals: Option<[Field; 2]>,
}

impl ImuFields {
    /// The fields of a topic; none where it lacks one.
    pub(super) fn new(topic: &str, layout: &Layout, stamp: Stamp) -> Option<Self> {
        let time = Time::new(layout, stamp)?;
        if topic == "sensor_combined" {
            let (accel, gyro) = (
                layout.three("accelerometer_m_s2")?,
                layout.three("gyro_rad")?,
            );
            return Some(Self {
                time,
                accel,
                gyro,
                intervals: None,
            });
        }
        let (accel, gyro) = (
            layout.three("delta_velocity")?,
            layout.three("delta_angle")?,
        );
        // before PX4 1.12 there was one interval
        let interval = |name: &str| layout.one(name).or_else(|| layout.one("dt"));
        let intervals = Some([interval("delta_velocity_dt")?, interval("delta_angle_dt")?]);
        Some(Self {
            time,
            accel,
            gyro,
            intervals,
        })
    }

    /// A sample; none where the message is too short.
    pub(super) fn sample(&self, message: &[u8]) -> Option<ImuSample> {
        let (accel, gyro) = (self.accel.triad(message)?, self.gyro.triad(message)?);
        let motion = match self.intervals {
            None => Motion::Rates {
                accel_m_s2: accel,
                gyro_rad_s: gyro,
            },
            Some(intervals) => {
                let [dv_dt, dtheta_dt] = intervals.map(|field| field.value(message));
                let (dv_dt_s, dtheta_dt_s) = (dv_dt? / 1e6, dtheta_dt? / 1e6);
                Motion::Increments {
                    dv_m_s: accel,
                    dtheta_rad: gyro,
                    dv_dt_s,
                    dtheta_dt_s,
                }
            }
        };
        Some(ImuSample {
            stamp_ns: self.time.ns(message)?,
            motion,
        })
    }
}

/// Field, and the factor that makes degrees and metres of it.
#[derive(Debug, Clone, Copy)]
struct Scaled {
    field: Field,
    per_unit: f64,
}

impl Scaled {
    /// A field of `double`, since PX4 1.14, or the integer that was there before.
    fn new(layout: &Layout, name: &str, integer: &str, per_unit: f64) -> Option<Self> {
        let new = layout.one(name).map(|field| Self {
            field,
            per_unit: 1.0,
        });
        new.or_else(|| layout.one(integer).map(|field| Self { field, per_unit }))
    }

    fn value(self, message: &[u8]) -> Option<f64> {
        Some(self.field.value(message)? / self.per_unit)
    }
}

/// Fields of fixes.
#[derive(Debug, Clone, Copy)]
pub(super) struct FixFields {
    time: Time,
    fix_type: Field,
    /// Latitude, longitude, height above the ellipsoid.
    place: [Scaled; 3],
    /// Standard deviations: horizontal, vertical (m), speed (m/s).
    sigma: [Field; 3],
    velocity: [Field; 3],
    has_velocity: Field,
}

impl FixFields {
    /// The fields of a topic; none where it lacks one.
    pub(super) fn new(layout: &Layout, stamp: Stamp) -> Option<Self> {
        let one = |name| layout.one(name);
        Some(Self {
            time: Time::new(layout, stamp)?,
            fix_type: one("fix_type")?,
            place: [
                Scaled::new(layout, "latitude_deg", "lat", 1e7)?,
                Scaled::new(layout, "longitude_deg", "lon", 1e7)?,
                Scaled::new(layout, "altitude_ellipsoid_m", "alt_ellipsoid", 1e3)?,
            ],
            // a standard deviation in spite of its name (SensorGps.msg: "speed accuracy estimate, (metres/sec)")
            sigma: [one("eph")?, one("epv")?, one("s_variance_m_s")?],
            velocity: [one("vel_n_m_s")?, one("vel_e_m_s")?, one("vel_d_m_s")?],
            has_velocity: one("vel_ned_valid")?,
        })
    }

    /// A fix, if the message has one in three dimensions; none at all where the message is too short.
    pub(super) fn fix(&self, message: &[u8]) -> Option<Option<Fix>> {
        const THREE_DIMENSIONS: f64 = 3.0;
        let value = |field: Field| field.value(message);
        let [lat, lon, h] = self.place.map(|scaled| scaled.value(message));
        let [horizontal, vertical, speed] = self.sigma.map(value);
        let (horizontal, speed) = (horizontal?, speed?);
        let [north, east, down] = self.velocity.map(value);
        let velocity = [north?, east?, down?];
        let has_velocity = value(self.has_velocity)? != 0.0;
        let fix = Fix {
            stamp_ns: self.time.ns(message)?,
            gps_tow_ms: None,
            lat_deg: lat?,
            lon_deg: lon?,
            h_m: h?,
            sd_ned_m: stated([horizontal, horizontal, vertical?]),
            v_ned_m_s: has_velocity.then_some(velocity),
            sd_v_ned_m_s: stated([speed; 3]).filter(|_| has_velocity),
        };
        Some((value(self.fix_type)? >= THREE_DIMENSIONS).then_some(fix))
    }
}
