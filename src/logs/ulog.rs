//! Logs of PX4 (<https://docs.px4.io/main/en/dev_log/ulog_file_format.html>).

use crate::channel::{
    Clock, Content, ImuReading, LogChannel, LogFix, LogSample, Scan, Stamp, stated,
};
use crate::input::{Bytes, LogError, LogInput, Number, text};
use std::collections::HashMap;

/// Counts the messages of each topic, or reads the samples or fixes of one.
pub(crate) fn scan(input: &mut LogInput, scan: &mut Scan<'_>) -> Result<(), LogError> {
    messages(input, |topic, offset, message| {
        if let Some((channel, stamp)) = scan.wanted {
            if topic.id == channel.id {
                let sample = sample(channel.content, &topic.layout, message, stamp);
                let short = || LogError::malformed(offset, "a message is shorter than its format");
                let sample = sample.ok_or_else(short)?;
                scan.samples.extend(sample.map(|sample| (offset, sample)));
            }
            return Ok(());
        }
        let new = || {
            let (content, rank) = content(&topic.name);
            let sample = sample(content, &topic.layout, message, Stamp::Header);
            let named = match topic.instance {
                0 => topic.name.clone(),
                instance => format!("{}.{instance}", topic.name),
            };
            LogChannel {
                topic: named,
                type_name: topic.name.clone(),
                // one that lacks fields is another topic
                content: sample.map_or(Content::Other, |_| content),
                rank,
                clock: Clock::Boot,
                id: topic.id,
                ..LogChannel::default()
            }
        };
        let channel = scan.channels.entry(topic.id).or_insert_with(new);
        match topic.layout.time_ns("timestamp", message) {
            Some(ns) => channel.count(ns),
            None => channel.messages += 1,
        }
        Ok(())
    })
}

// Fields of the messages of a topic.

/// Formats by their names, each a list of fields `type name;`.
type Formats = HashMap<String, String>;

/// Places of a message's own fields, up to a format within it: no sample and no fix has one.
#[derive(Default)]
struct Layout {
    fields: HashMap<String, UlogField>,
}

/// Field of a message.
#[derive(Clone, Copy)]
struct UlogField {
    at: usize,
    number: Number,
    count: usize,
}

/// The type of a name.
fn number(name: &str) -> Option<Number> {
    Some(match name {
        "int8_t" => Number::Signed(1),
        "uint8_t" | "bool" | "char" => Number::Unsigned(1),
        "int16_t" => Number::Signed(2),
        "uint16_t" => Number::Unsigned(2),
        "int32_t" => Number::Signed(4),
        "uint32_t" => Number::Unsigned(4),
        "int64_t" => Number::Signed(8),
        "uint64_t" => Number::Unsigned(8),
        "float" => Number::Float(4),
        "double" => Number::Float(8),
        _ => return None,
    })
}

impl Layout {
    fn new(name: &str, formats: &Formats) -> Option<Self> {
        let mut layout = Self::default();
        let mut at = 0_usize;
        for (type_name, count, field) in fields(formats.get(name)?) {
            let Some(number) = number(type_name) else {
                break;
            };
            let own = UlogField { at, number, count };
            layout.fields.insert(field.to_owned(), own);
            at = at.checked_add(number.size().checked_mul(count)?)?;
        }
        Some(layout)
    }

    /// A field of this many numbers.
    fn field(&self, name: &str, count: usize) -> Option<UlogField> {
        let field = self.fields.get(name).copied();
        field.filter(|field| field.count == count)
    }

    /// Numbers of a field; none where the message is too short or the layout has no such field.
    fn numbers<const N: usize>(&self, name: &str, message: &[u8]) -> Option<[f64; N]> {
        let field = self.field(name, N)?;
        let mut bytes = Bytes::little(message.get(field.at..)?);
        let mut values = [0.0; N];
        for value in &mut values {
            *value = field.number.read(&mut bytes)?;
        }
        Some(values)
    }

    /// Time (µs in the message) (ns); none beyond what can be a time.
    fn time_ns(&self, name: &str, message: &[u8]) -> Option<i64> {
        let field = self.field(name, 1)?;
        let field = (field.number == Number::Unsigned(8)).then_some(field)?;
        let us = Bytes::little(message.get(field.at..)?).u64()?;
        i64::try_from(us).ok()?.checked_mul(1000)
    }
}

/// Type, number and name of each field: `float[3] gyro_rad;`.
fn fields(format: &str) -> impl Iterator<Item = (&str, usize, &str)> {
    format.split(';').filter_map(|field| {
        let (type_name, name) = field.trim().split_once(' ')?;
        let (type_name, count) = match type_name.split_once('[') {
            Some((type_name, count)) => (type_name, count.trim_end_matches(']').parse().ok()?),
            None => (type_name, 1),
        };
        Some((type_name, count, name))
    })
}

// Messages of a log.

const MAGIC: [u8; 7] = *b"ULog\x01\x12\x35";
/// Flag of data that was appended after the log had ended (a crash dump), and all others.
const APPENDED: u8 = 1;

/// Topic of a log.
struct Topic {
    id: u32,
    name: String,
    instance: u8,
    layout: Layout,
}

/// Shows the messages of topics, each with its byte.
fn messages(
    input: &mut LogInput,
    mut each: impl FnMut(&Topic, u64, &[u8]) -> Result<(), LogError>,
) -> Result<(), LogError> {
    if input.array()? != MAGIC {
        return Err(LogError::malformed(0, "not the start of a ULog file"));
    }
    // version and time of the start
    input.skip(9)?;
    let (mut formats, mut topics) = (Formats::new(), HashMap::new());
    // byte from which on data was appended: what comes before it may be cut, and it is no flight
    let mut end = u64::MAX;
    loop {
        let offset = input.position();
        if input.left() == 0 || offset + 3 > end {
            return Ok(());
        }
        let (size, kind) = (u64::from(input.u16()?), input.u8()?);
        if input.position() + size > end {
            return Ok(());
        }
        let body = input.bytes(size, size)?;
        let fault = || {
            let kind = char::from(kind);
            LogError::malformed(offset, format!("message {kind:?} does not parse"))
        };
        let mut bytes = Bytes::little(&body);
        match kind {
            b'D' => {
                let id = bytes.u16().ok_or_else(fault)?;
                if let Some(topic) = topics.get(&id) {
                    each(topic, offset, &body[2..])?;
                }
            }
            b'F' => {
                let format = text(&body);
                let (name, fields) = format.split_once(':').ok_or_else(fault)?;
                formats.insert(name.to_owned(), fields.to_owned());
            }
            b'A' => {
                let (instance, id) = bytes.u8().zip(bytes.u16()).ok_or_else(fault)?;
                let name = text(&body[3..]);
                if let Some(layout) = Layout::new(&name, &formats) {
                    let topic = Topic {
                        id: id.into(),
                        name,
                        instance,
                        layout,
                    };
                    topics.insert(id, topic);
                }
            }
            // flags that tell of data a reader has to know of
            b'B' => {
                bytes.take(8).ok_or_else(fault)?;
                let flags = bytes.take(8).ok_or_else(fault)?;
                if flags[0] & !APPENDED != 0 || flags[1..].iter().any(|flags| *flags != 0) {
                    let flags = format!("ULog flags {flags:02x?}");
                    return Err(LogError::encoding(offset, flags.as_bytes()));
                }
                if flags[0] & APPENDED != 0 {
                    let mut starts = || Some([bytes.u64()?, bytes.u64()?, bytes.u64()?]);
                    let starts = starts().ok_or_else(fault)?.into_iter();
                    end = starts.filter(|at| *at > 0).min().unwrap_or(u64::MAX);
                }
            }
            _ => {}
        }
    }
}

// Topics of PX4 that hold samples and fixes (the files `msg/*.msg` of PX4-Autopilot).

/// Content of a topic, and its rank: what the autopilot fuses comes before what a single device measures.
fn content(name: &str) -> (Content, u8) {
    match name {
        "sensor_combined" => (Content::Imu, 0),
        "vehicle_imu" => (Content::Imu, 1),
        "vehicle_gps_position" => (Content::Fix, 0),
        "sensor_gps" => (Content::Fix, 1),
        _ => (Content::Other, 0),
    }
}

/// A sample or fix, if the message has one; none at all where the message is too short.
fn sample(
    content: Content,
    layout: &Layout,
    message: &[u8],
    stamp: Stamp,
) -> Option<Option<LogSample>> {
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
        return Some(Some(LogSample::Imu(ImuReading {
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
    let fix = LogFix {
        stamp_ns,
        lat_deg: place("latitude_deg", "lat", 1e7)?,
        lon_deg: place("longitude_deg", "lon", 1e7)?,
        h_m: place("altitude_ellipsoid_m", "alt_ellipsoid", 1e3)?,
        sd_ned_m: stated([horizontal, horizontal, vertical]),
        v_ned_m_s: has_velocity.then_some(velocity),
        sd_v_ned_m_s: stated([speed; 3]).filter(|_| has_velocity),
    };
    Some((one("fix_type")? >= THREE_DIMENSIONS).then(|| LogSample::Fix(Box::new(fix))))
}
