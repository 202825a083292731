//! Logs of ROS: topics of a container.

use crate::bytes::Bytes;
use crate::channel::{Channel, Content, Each};
use crate::container::{self, Dialect, Record, walk};
use crate::error::Error;
use crate::input::Input;
use crate::sample::{Fix, ImuSample, NS, Sample, Stamp, stated};
use std::collections::BTreeMap;

/// Largest message that is read (bytes): an IMU's has 400.
const LARGEST_MESSAGE: u64 = 1 << 20;

/// Finds the topics.
pub(crate) fn survey<D: Dialect>(
    input: &mut Input,
    channels: &mut BTreeMap<u32, Channel>,
) -> Result<(), Error> {
    let outcome = container::survey::<D>(input, channels);
    for channel in channels.values_mut() {
        channel.content = match channel.type_name.as_str() {
            "sensor_msgs/msg/Imu" | "sensor_msgs/Imu" => Content::Imu,
            "sensor_msgs/msg/NavSatFix" | "sensor_msgs/NavSatFix" => Content::Fix,
            _ => Content::Other,
        };
    }
    outcome
}

/// Reads the messages of a topic, which may stand out of order in the file.
pub(crate) fn read<D: Dialect>(
    input: &mut Input,
    channel: &Channel,
    stamp: Stamp,
    each: Each<'_>,
) -> Result<(), Error> {
    let mut found = Vec::new();
    let outcome = walk::<D>(input, true, &mut |record, input| {
        let Record::Message(head) = record else {
            return Ok(());
        };
        if head.channel != channel.id {
            return input.skip(head.size);
        }
        let message = Message {
            log_ns: (stamp == Stamp::Log).then_some(head.log_ns),
            offset: input.offset(),
            data: input.bytes(head.size, LARGEST_MESSAGE)?,
        };
        let sample = match channel.content {
            Content::Imu => imu(&channel.encoding, &message).map(Some)?,
            _ => fix(&channel.encoding, &message)?,
        };
        found.extend(sample.map(|sample| (head.log_ns, message.offset, sample)));
        Ok(())
    });
    found.sort_by_key(|(log_ns, ..)| *log_ns);
    for (_, offset, sample) in found {
        each(offset, sample)?;
    }
    outcome
}

/// Message of a channel.
struct Message {
    /// Time of arrival, where it is the one that counts.
    log_ns: Option<i64>,
    offset: u64,
    data: Vec<u8>,
}

/// Body of a message, and its stamp. Behind the header: in ROS 1 a sequence number, the time, a name; in ROS 2 the same
/// without the number.
fn body<'a>(encoding: &str, message: &'a Message) -> Result<(Bytes<'a>, i64), Error> {
    let mut bytes = match encoding {
        "ros1" => Bytes::little(&message.data),
        "cdr" => cdr(message)?,
        other => return Err(Error::encoding(message.offset, other.as_bytes())),
    };
    let mut header = || {
        if encoding == "ros1" {
            bytes.u32()?;
        }
        let header_ns = i64::from(bytes.i32()?) * NS + i64::from(bytes.u32()?);
        bytes.string()?;
        Some(header_ns)
    };
    let header_ns = header().ok_or_else(|| short(message))?;
    Ok((bytes, message.log_ns.unwrap_or(header_ns)))
}

/// Common Data Representation (OMG DDSI-RTPS 2.3, 10.2): the order of bytes, then numbers that are aligned from there
/// on; in its second version to 4 bytes at most.
fn cdr(message: &Message) -> Result<Bytes<'_>, Error> {
    let (head, rest) = message
        .data
        .split_at_checked(4)
        .ok_or_else(|| short(message))?;
    let (is_big_endian, most) = match head[..2] {
        [0, 0] => (true, 8),
        [0, 1] => (false, 8),
        [0, 6] => (true, 4),
        [0, 7] => (false, 4),
        _ => {
            return Err(Error::encoding(
                message.offset,
                format!("CDR {:02x?}", &head[..2]).as_bytes(),
            ));
        }
    };
    Ok(Bytes::new(rest, is_big_endian, most))
}

fn short(message: &Message) -> Error {
    Error::malformed(
        message.offset,
        format!("a message of {} bytes is too short", message.data.len()),
    )
}

/// A sample of `sensor_msgs/Imu`: the orientation and the covariances are passed over.
fn imu(encoding: &str, message: &Message) -> Result<Sample, Error> {
    let (mut bytes, stamp_ns) = body(encoding, message)?;
    let mut sample = || {
        bytes.f64s::<{ 4 + 9 }>()?;
        let gyro_rad_s = bytes.f64s()?;
        bytes.f64s::<9>()?;
        let accel_m_s2 = bytes.f64s()?;
        bytes.f64s::<9>()?;
        Some(Sample::Imu(ImuSample {
            stamp_ns,
            accel_m_s2,
            gyro_rad_s,
        }))
    };
    sample().ok_or_else(|| short(message))
}

/// A fix of `sensor_msgs/NavSatFix`; none where its status is below 0.
fn fix(encoding: &str, message: &Message) -> Result<Option<Sample>, Error> {
    let (mut bytes, stamp_ns) = body(encoding, message)?;
    let mut rest = || {
        let status = bytes.u8()?.cast_signed();
        bytes.u16()?;
        Some((status, bytes.f64s::<3>()?, bytes.f64s::<9>()?, bytes.u8()?))
    };
    let (status, place, covariance, covariance_type) = rest().ok_or_else(|| short(message))?;
    let [lat_deg, lon_deg, h_m] = place;
    // the covariance is that of east, north, up (m²); type 0 is unknown
    let sd = [covariance[4], covariance[0], covariance[8]].map(f64::sqrt);
    let is_fix = status >= 0 && place.iter().all(|v| v.is_finite());
    Ok(is_fix.then(|| {
        Sample::Fix(Box::new(Fix {
            stamp_ns,
            lat_deg,
            lon_deg,
            h_m,
            sd_ned_m: stated(sd).filter(|_| covariance_type != 0),
            v_ned_m_s: None,
            sd_v_ned_m_s: None,
        }))
    }))
}
