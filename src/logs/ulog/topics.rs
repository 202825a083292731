//! Topics of PX4 that hold samples and fixes (the files `msg/*.msg` of PX4-Autopilot).

use super::layout::Layout;
use super::messages::Data;
use crate::channel::Content;
use crate::sample::{Fix, ImuSample, Sample, Stamp, stated};

/// Content of a topic, and its rank: what the autopilot fuses comes before what a single device measures.
pub(super) fn content(name: &str) -> (Content, u8) {
    match name {
        "sensor_combined" => (Content::Imu, 0),
        "vehicle_imu" => (Content::Imu, 1),
        "vehicle_gps_position" => (Content::Fix, 0),
        "sensor_gps" => (Content::Fix, 1),
        _ => (Content::Other, 0),
    }
}

/// A sample or fix, if the message has one; none at all where the message is too short.
pub(super) fn sample(
    content: Content,
    layout: &Layout,
    data: &Data,
    stamp: Stamp,
) -> Option<Option<Sample>> {
    let message = &data.bytes;
    let one = |name| layout.numbers::<1>(name, message).map(|[value]| value);
    let three = |name| layout.numbers::<3>(name, message);
    // 0 is a time that was not set
    let measured = layout.time_ns("timestamp_sample", message);
    let measured = measured.filter(|ns| *ns > 0 && stamp == Stamp::Header);
    let stamp_ns = measured.or_else(|| layout.time_ns("timestamp", message))?;
    if content == Content::Imu {
        let rates = || Some((three("accelerometer_m_s2")?, three("gyro_rad")?));
        let increments = || {
            // before PX4 1.12 there was one interval
            let seconds = |name| Some(one(name).or_else(|| one("dt"))? / 1e6);
            let (dv_s, dtheta_s) = (seconds("delta_velocity_dt")?, seconds("delta_angle_dt")?);
            let (dv, dtheta) = (three("delta_velocity")?, three("delta_angle")?);
            Some((dv.map(|v| v / dv_s), dtheta.map(|a| a / dtheta_s)))
        };
        let (accel_m_s2, gyro_rad_s) = rates().or_else(increments)?;
        return Some(Some(Sample::Imu(ImuSample {
            stamp_ns,
            accel_m_s2,
            gyro_rad_s,
        })));
    }
    const THREE_DIMENSIONS: f64 = 3.0;
    // a field of `double`, since PX4 1.14, or the integer that was there before
    let place = |name, integer, per_unit| one(name).or_else(|| Some(one(integer)? / per_unit));
    let (horizontal, vertical) = (one("eph")?, one("epv")?);
    // a standard deviation in spite of its name (SensorGps.msg: "speed accuracy estimate, (metres/sec)")
    let speed = one("s_variance_m_s")?;
    let has_velocity = one("vel_ned_valid")? != 0.0;
    let velocity = [one("vel_n_m_s")?, one("vel_e_m_s")?, one("vel_d_m_s")?];
    let fix = Fix {
        stamp_ns,
        lat_deg: place("latitude_deg", "lat", 1e7)?,
        lon_deg: place("longitude_deg", "lon", 1e7)?,
        h_m: place("altitude_ellipsoid_m", "alt_ellipsoid", 1e3)?,
        sd_ned_m: stated([horizontal, horizontal, vertical]),
        v_ned_m_s: has_velocity.then_some(velocity),
        sd_v_ned_m_s: stated([speed; 3]).filter(|_| has_velocity),
    };
    Some((one("fix_type")? >= THREE_DIMENSIONS).then(|| Sample::Fix(Box::new(fix))))
}
