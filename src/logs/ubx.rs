//! Messages of a u-blox receiver (Interface Description of the ZED-F9R, UBX-19056845): NAV-PVT and ESF-MEAS.
//!
//! A receiver's log is a stream of bytes with other protocols between: what is no message with its checksum is passed
//! over, also one that is cut off at the end.

use crate::channel::{Clock, Content, ImuReading, LogChannel, LogFix, LogSample, NS, Scan, stated};
use crate::input::{Bytes, LogError, LogInput, UBX_SYNC, ubx_checksum};
use chrono::NaiveDate;

/// Class and number of messages, as one number.
const NAV_PVT: u32 = 0x0107;
const ESF_MEAS: u32 = 0x1002;
/// Number of a channel of messages whose checksum failed.
const REJECTED: u32 = u32::MAX;
const MS: i64 = NS / 1000;

/// Counts the messages of each kind, or reads the samples or fixes of one.
pub(crate) fn scan(input: &mut LogInput, scan: &mut Scan<'_>) -> Result<(), LogError> {
    let mut measured = UbxAxes::default();
    messages(input, |id, offset, payload| {
        if let Some((channel, _)) = scan.wanted {
            let sample = match id {
                _ if id != channel.id => None,
                ESF_MEAS => measured.add(payload).map(LogSample::Imu),
                _ => pvt(payload).map(|fix| LogSample::Fix(Box::new(fix))),
            };
            scan.samples.extend(sample.map(|sample| (offset, sample)));
            return;
        }
        let channel = scan.channels.entry(id).or_insert_with(|| new_channel(id));
        let stamp_ns = match id {
            NAV_PVT => pvt(payload).map(|fix| fix.stamp_ns),
            ESF_MEAS => time_tag_ns(payload),
            _ => None,
        };
        match stamp_ns {
            Some(ns) => channel.count(ns),
            None => channel.messages += u64::from(channel.content == Content::Other),
        }
    })
}

fn new_channel(id: u32) -> LogChannel {
    let (topic, type_name, content, clock) = match id {
        NAV_PVT => ("NAV-PVT", "UBX-NAV-PVT", Content::Fix, Clock::Unix),
        ESF_MEAS => ("ESF-MEAS", "UBX-ESF-MEAS", Content::Imu, Clock::Boot),
        REJECTED => ("UBX", "checksum failed", Content::Other, Clock::Unix),
        _ => {
            let topic = format!("UBX-{:02X}-{:02X}", id >> 8, id & 0xff);
            return LogChannel {
                type_name: topic.clone(),
                topic,
                ..LogChannel::default()
            };
        }
    };
    LogChannel {
        topic: topic.to_owned(),
        type_name: type_name.to_owned(),
        content,
        clock,
        id,
        ..LogChannel::default()
    }
}

/// Shows the messages of a file, each with its number and its byte.
fn messages(input: &mut LogInput, mut each: impl FnMut(u32, u64, &[u8])) -> Result<(), LogError> {
    while input.left() >= 8 {
        let offset = input.position();
        let (sync, head): ([u8; 2], [u8; 4]) = (input.array()?, input.array()?);
        let length = u64::from(u16::from_le_bytes([head[2], head[3]]));
        if sync != UBX_SYNC || input.left() < length + 2 {
            input.seek(offset + 1)?;
            continue;
        }
        let body = [&head[..], &input.bytes(length, length)?].concat();
        if input.array()? == ubx_checksum(&body) {
            let id = u16::from_be_bytes([head[0], head[1]]);
            each(id.into(), offset, &body[4..]);
        } else {
            each(REJECTED, offset, &[]);
            input.seek(offset + 1)?;
        }
    }
    Ok(())
}

/// A fix of NAV-PVT in three dimensions, flagged good, at a date and time that are valid. Its accuracies are taken as one
/// standard deviation of each axis, as the ROS driver of u-blox does (`ublox_gps`, `NavSatFix` of NAV-PVT).
fn pvt(payload: &[u8]) -> Option<LogFix> {
    const GNSS_3D: u8 = 3;
    const WITH_SENSORS: u8 = 4;
    // nanoseconds since 1970 end in 2262
    const LAST_YEAR: u16 = 2200;
    let mut b = Bytes::little(payload);
    b.u32()?;
    let year = b.u16()?;
    let (month, day, hour, minute, second) = (b.u8()?, b.u8()?, b.u8()?, b.u8()?, b.u8()?);
    let valid = b.u8()?;
    b.u32()?;
    let (nano, fix_type, flags) = (b.i32()?, b.u8()?, b.u8()?);
    b.take(2)?;
    let [lon, lat, h] = [b.i32()?, b.i32()?, b.i32()?].map(f64::from);
    b.i32()?;
    let [horizontal, vertical] = [b.u32()?, b.u32()?].map(|a| f64::from(a) / 1e3);
    let velocity = [b.i32()?, b.i32()?, b.i32()?].map(|v| f64::from(v) / 1e3);
    b.take(8)?;
    let speed_accuracy = f64::from(b.u32()?) / 1e3;
    let is_fix = matches!(fix_type, GNSS_3D | WITH_SENSORS) && flags & 1 != 0 && valid & 3 == 3;
    if !is_fix || year > LAST_YEAR {
        return None;
    }
    let date = NaiveDate::from_ymd_opt(year.into(), month.into(), day.into())?;
    // a leap second has the number 60
    let minute = date.and_hms_opt(hour.into(), minute.into(), 0)?;
    let before = minute.and_utc().timestamp();
    Some(LogFix {
        stamp_ns: (before + i64::from(second)) * NS + i64::from(nano),
        lat_deg: lat / 1e7,
        lon_deg: lon / 1e7,
        h_m: h / 1e3,
        sd_ned_m: stated([horizontal, horizontal, vertical]),
        v_ned_m_s: Some(velocity),
        sd_v_ned_m_s: stated([speed_accuracy; 3]),
    })
}

/// Time of the sensor (ms) of an ESF-MEAS (ns).
fn time_tag_ns(payload: &[u8]) -> Option<i64> {
    Some(i64::from(Bytes::little(payload).u32()?) * MS)
}

/// Axes measured at one time.
#[derive(Default)]
struct UbxAxes {
    time_ns: i64,
    gyro_rad_s: [Option<f64>; 3],
    accel_m_s2: [Option<f64>; 3],
}

impl UbxAxes {
    /// Adds the axes of an ESF-MEAS; a sample when all six of a time are there, as some receivers send gyroscopes
    /// and accelerometers one after the other.
    fn add(&mut self, payload: &[u8]) -> Option<ImuReading> {
        let time_ns = time_tag_ns(payload)?;
        if time_ns != self.time_ns {
            *self = Self {
                time_ns,
                ..Self::default()
            };
        }
        let mut bytes = Bytes::little(payload.get(8..)?);
        let count = payload[5] >> 3;
        for _ in 0..count {
            self.put(bytes.u32()?);
        }
        let all = |axes: [Option<f64>; 3]| Some([axes[0]?, axes[1]?, axes[2]?]);
        let sample = ImuReading {
            stamp_ns: time_ns,
            accel_m_s2: all(self.accel_m_s2)?,
            gyro_rad_s: all(self.gyro_rad_s)?,
        };
        *self = Self {
            time_ns,
            ..Self::default()
        };
        Some(sample)
    }

    /// A measurement: 24 bits with sign, then its type.
    fn put(&mut self, word: u32) {
        let value = f64::from((word << 8).cast_signed() >> 8);
        let (rad_s, m_s2) = ((value / 4096.0).to_radians(), value / 1024.0);
        match (word >> 24) & 0x3f {
            14 => self.gyro_rad_s[0] = Some(rad_s),
            13 => self.gyro_rad_s[1] = Some(rad_s),
            5 => self.gyro_rad_s[2] = Some(rad_s),
            kind @ 16..=18 => self.accel_m_s2[kind as usize - 16] = Some(m_s2),
            _ => {}
        }
    }
}
