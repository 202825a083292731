//! Messages of a u-blox receiver (Interface Description of the ZED-F9R, UBX-19056845): NAV-PVT and ESF-MEAS.
//!
//! A receiver's log is a stream of bytes with other protocols between: what is no message with its checksum is passed
//! over, also one that is cut off at the end.

use crate::bytes::Bytes;
use crate::channel::{Channel, Content};
use crate::error::Error;
use crate::format::{Format, Opened};
use crate::input::{Input, Origin};
use crate::recognise::{UBX_SYNC, ubx_checksum};
use crate::sample::{Clock, Fix, ImuSample, Motion, NS, Stamp, stated};
use crate::stream::Stream;
use chrono::NaiveDate;
use std::collections::BTreeMap;

const NAV_PVT: [u8; 2] = [0x01, 0x07];
const ESF_MEAS: [u8; 2] = [0x10, 0x02];
const MS: i64 = NS / 1000;

/// Opens a log.
pub(crate) fn open(origin: Origin) -> Result<Opened, Error> {
    let mut messages = Messages {
        input: origin.open()?,
        only: None,
        rejected: 0,
    };
    let mut channels = BTreeMap::new();
    while let Some(message) = messages.next_message()? {
        let channel = channels
            .entry(message.id)
            .or_insert_with(|| new_channel(message.id));
        let stamp_ns = match message.id {
            NAV_PVT => pvt(&message.payload).map(|fix| fix.stamp_ns),
            ESF_MEAS => time_tag_ns(&message.payload),
            _ => None,
        };
        match stamp_ns {
            Some(ns) => channel.count(1, ns, ns),
            None => channel.messages += u64::from(channel.content == Content::Other),
        }
    }
    let mut channels: Vec<Channel> = channels.into_values().collect();
    if messages.rejected > 0 {
        let mut rejected = Channel::new("UBX", "checksum failed", Content::Other);
        rejected.messages = messages.rejected;
        channels.push(rejected);
    }
    Ok(Opened {
        channels,
        damage: None,
        format: Box::new(Ubx { origin }),
    })
}

fn new_channel(id: [u8; 2]) -> Channel {
    match id {
        NAV_PVT => Channel::new("NAV-PVT", "UBX-NAV-PVT", Content::Fix),
        ESF_MEAS => Channel {
            clock: Clock::Boot,
            ..Channel::new("ESF-MEAS", "UBX-ESF-MEAS", Content::Imu)
        },
        [class, number] => {
            let name = format!("UBX-{class:02X}-{number:02X}");
            Channel::new(name.clone(), name, Content::Other)
        }
    }
}

/// Message of the receiver.
struct Message {
    offset: u64,
    id: [u8; 2],
    payload: Vec<u8>,
}

/// Messages of a file: all, or those with one number.
struct Messages {
    input: Input,
    only: Option<[u8; 2]>,
    /// Messages whose checksum failed.
    rejected: u64,
}

impl Messages {
    fn next_message(&mut self) -> Result<Option<Message>, Error> {
        while self.input.left() >= 8 {
            let offset = self.input.position();
            if self.input.u8()? != UBX_SYNC[0] || self.input.u8()? != UBX_SYNC[1] {
                self.input.seek(offset + 1)?;
                continue;
            }
            let head: [u8; 4] = self.input.array()?;
            let length = u64::from(u16::from_le_bytes([head[2], head[3]]));
            if self.input.left() < length + 2 {
                self.input.seek(offset + 1)?;
                continue;
            }
            let mut body = head.to_vec();
            body.extend(self.input.bytes(length, length)?);
            if self.input.array()? != ubx_checksum(&body) {
                self.rejected += 1;
                self.input.seek(offset + 1)?;
                continue;
            }
            let id = [head[0], head[1]];
            if self.only.is_none_or(|only| only == id) {
                return Ok(Some(Message {
                    offset,
                    id,
                    payload: body.split_off(4),
                }));
            }
        }
        Ok(None)
    }
}

impl Iterator for Messages {
    type Item = Result<Message, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_message().transpose()
    }
}

struct Ubx {
    origin: Origin,
}

impl Ubx {
    fn stream<T: 'static>(
        &self,
        only: [u8; 2],
        mut decode: impl FnMut(&[u8]) -> Option<T> + Send + 'static,
    ) -> Result<Stream<T>, Error> {
        let messages = Messages {
            input: self.origin.open()?,
            only: Some(only),
            rejected: 0,
        };
        Ok(Box::new(messages.filter_map(move |message| {
            message
                .map(|m| decode(&m.payload).map(|sample| (m.offset, sample)))
                .transpose()
        })))
    }
}

impl Format for Ubx {
    fn imu(&self, _: &Channel, _: Stamp) -> Result<Stream<ImuSample>, Error> {
        let mut measured = Measured::default();
        self.stream(ESF_MEAS, move |payload| measured.add(payload))
    }

    fn fixes(&self, _: &Channel, _: Stamp) -> Result<Stream<Fix>, Error> {
        self.stream(NAV_PVT, pvt)
    }
}

/// A fix of NAV-PVT in three dimensions, flagged good, at a date and time that are valid. Its accuracies are taken as one
/// standard deviation of each axis, as the ROS driver of u-blox does (`ublox_gps`, `NavSatFix` of NAV-PVT).
fn pvt(payload: &[u8]) -> Option<Fix> {
    const GNSS_3D: u8 = 3;
    const WITH_SENSORS: u8 = 4;
    // nanoseconds since 1970 end in 2262
    const LAST_YEAR: u16 = 2200;
    let mut b = Bytes::little(payload);
    let (tow_ms, year) = (b.u32()?, b.u16()?);
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
    Some(Fix {
        stamp_ns: (before + i64::from(second)) * NS + i64::from(nano),
        gps_tow_ms: Some(tow_ms),
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
struct Measured {
    time_ns: i64,
    gyro_rad_s: [Option<f64>; 3],
    accel_m_s2: [Option<f64>; 3],
}

impl Measured {
    /// Adds the axes of an ESF-MEAS; a sample when all six of a time are there, as some receivers send gyroscopes
    /// and accelerometers one after the other.
    fn add(&mut self, payload: &[u8]) -> Option<ImuSample> {
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
        let motion = Motion::Rates {
            accel_m_s2: all(self.accel_m_s2)?,
            gyro_rad_s: all(self.gyro_rad_s)?,
        };
        *self = Self {
            time_ns,
            ..Self::default()
        };
        Some(ImuSample {
            stamp_ns: time_ns,
            motion,
        })
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
