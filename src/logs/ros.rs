//! Logs of ROS: topics of a container.

use crate::bytes::{Alignment, Bytes, Order};
use crate::channel::{Channel, Content};
use crate::container::{Dialect, Message, Reader, Survey, survey};
use crate::error::Error;
use crate::format::{Format, Opened};
use crate::input::Origin;
use crate::sample::{Fix, ImuSample, Motion, NS, Stamp, stated};
use crate::stream::Stream;
use std::marker::PhantomData;

/// Opens a container.
pub(crate) fn open<D: Dialect + Sync>(origin: Origin) -> Result<Opened, Error> {
    let mut survey = survey::<D>(&origin)?;
    let channel = |(id, definition): (&u32, &crate::container::Definition)| {
        let content = content(&definition.type_name);
        let mut channel = Channel::new(&definition.topic, &definition.type_name, content);
        channel.id = *id;
        if let Some(tally) = survey.tallies.get(id) {
            channel.count(tally.messages, tally.first_ns, tally.last_ns);
        }
        channel
    };
    let mut channels: Vec<Channel> = survey.definitions.iter().map(channel).collect();
    channels.sort_by(|a, b| a.topic.cmp(&b.topic));
    let damage = survey.damage.take();
    Ok(Opened {
        channels,
        damage,
        format: Box::new(Ros::<D> {
            origin,
            survey,
            dialect: PhantomData,
        }),
    })
}

/// A container that was surveyed.
struct Ros<D> {
    origin: Origin,
    survey: Survey,
    dialect: PhantomData<D>,
}

/// Decoder of a message in an encoding.
type Decode<T> = fn(&str, &Message, Stamp) -> Result<Option<T>, Error>;

impl<D: Dialect> Ros<D> {
    fn stream<T: 'static>(
        &self,
        channel: &Channel,
        stamp: Stamp,
        decode: Decode<T>,
    ) -> Result<Stream<T>, Error> {
        let definition = self.survey.definitions.get(&channel.id);
        let encoding = definition.map(|d| d.encoding.clone()).unwrap_or_default();
        let reader = Reader::<D>::new(&self.origin, &self.survey, channel.id)?;
        Ok(Box::new(reader.filter_map(move |message| {
            let decoded = message
                .and_then(|m| Ok(decode(&encoding, &m, stamp)?.map(|sample| (m.offset, sample))));
            decoded.transpose()
        })))
    }
}

impl<D: Dialect + Sync> Format for Ros<D> {
    fn imu(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<ImuSample>, Error> {
        self.stream(channel, stamp, imu)
    }

    fn fixes(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<Fix>, Error> {
        self.stream(channel, stamp, fix)
    }
}

/// Content of a type of messages.
fn content(type_name: &str) -> Content {
    match type_name {
        "sensor_msgs/msg/Imu" | "sensor_msgs/Imu" => Content::Imu,
        "sensor_msgs/msg/NavSatFix" | "sensor_msgs/NavSatFix" => Content::Fix,
        _ => Content::Other,
    }
}

/// Body of a message, and its stamp.
struct Body<'a> {
    bytes: Bytes<'a>,
    stamp_ns: i64,
}

/// Behind the header: in ROS 1 a sequence number, the time, a name; in ROS 2 the same without the number.
fn body<'a>(encoding: &str, message: &'a Message, stamp: Stamp) -> Result<Body<'a>, Error> {
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
    Ok(Body {
        bytes,
        stamp_ns: if stamp == Stamp::Log {
            message.log_ns
        } else {
            header_ns
        },
    })
}

/// Common Data Representation (OMG DDSI-RTPS 2.3, 10.2): the order of bytes, then numbers that are aligned from there
/// on; in its second version to 4 bytes at most.
fn cdr(message: &Message) -> Result<Bytes<'_>, Error> {
    let (head, rest) = message
        .data
        .split_at_checked(4)
        .ok_or_else(|| short(message))?;
    let (order, most) = match head[..2] {
        [0, 0] => (Order::Big, 8),
        [0, 1] => (Order::Little, 8),
        [0, 6] => (Order::Big, 4),
        [0, 7] => (Order::Little, 4),
        _ => {
            return Err(Error::encoding(
                message.offset,
                format!("CDR {:02x?}", &head[..2]).as_bytes(),
            ));
        }
    };
    Ok(Bytes::new(rest, order, Alignment::UpTo(most)))
}

fn short(message: &Message) -> Error {
    Error::malformed(
        message.offset,
        format!("a message of {} bytes is too short", message.data.len()),
    )
}

/// A sample of `sensor_msgs/Imu`: the orientation and the covariances are passed over.
fn imu(encoding: &str, message: &Message, stamp: Stamp) -> Result<Option<ImuSample>, Error> {
    let Body {
        mut bytes,
        stamp_ns,
    } = body(encoding, message, stamp)?;
    let mut motion = || {
        bytes.skip_f64s(4 + 9)?;
        let gyro_rad_s = bytes.f64s()?;
        bytes.skip_f64s(9)?;
        let accel_m_s2 = bytes.f64s()?;
        bytes.skip_f64s(9)?;
        Some(Motion::Rates {
            accel_m_s2,
            gyro_rad_s,
        })
    };
    let motion = motion().ok_or_else(|| short(message))?;
    Ok(Some(ImuSample { stamp_ns, motion }))
}

/// A fix of `sensor_msgs/NavSatFix`; none where its status is below 0.
fn fix(encoding: &str, message: &Message, stamp: Stamp) -> Result<Option<Fix>, Error> {
    let Body {
        mut bytes,
        stamp_ns,
    } = body(encoding, message, stamp)?;
    let mut rest = || {
        let status = bytes.u8()?.cast_signed();
        bytes.u16()?;
        Some((status, bytes.f64s::<3>()?, bytes.f64s::<9>()?, bytes.u8()?))
    };
    let (status, [lat_deg, lon_deg, h_m], covariance, covariance_type) =
        rest().ok_or_else(|| short(message))?;
    // the covariance is that of east, north, up (m²); type 0 is unknown
    let sd = [covariance[4], covariance[0], covariance[8]].map(f64::sqrt);
    let sd_ned_m = if covariance_type == 0 {
        None
    } else {
        stated(sd)
    };
    let (gps_tow_ms, v_ned_m_s, sd_v_ned_m_s) = (None, None, None);
    let fix = Fix {
        stamp_ns,
        gps_tow_ms,
        lat_deg,
        lon_deg,
        h_m,
        sd_ned_m,
        v_ned_m_s,
        sd_v_ned_m_s,
    };
    let is_place = [lat_deg, lon_deg, h_m].iter().all(|v| v.is_finite());
    Ok((status >= 0 && is_place).then_some(fix))
}
