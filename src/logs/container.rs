//! Containers of messages in chunks, as MCAP and the bags of ROS 1 are.

use crate::channel::{Content, ImuReading, LogFix, LogSample, NS, Scan, Stamp, stated};
use crate::input::{Bytes, LogError, LogFault, LogInput, text};
use std::collections::HashMap;
use std::io;
use std::io::Read;

/// Record of a container.
pub(crate) enum ContainerRecord {
    /// A chunk, whose packed bytes come next.
    Chunk(Chunk),
    /// A message, whose bytes come next.
    Message(MessageHead),
    /// A channel: its number, topic, type and encoding.
    Channel(u32, [String; 3]),
    /// One that was passed over.
    Other,
}

/// Head of a message.
pub(crate) struct MessageHead {
    channel: u32,
    log_ns: i64,
    pub(crate) size: u64,
}

/// Shows all records of a container to `each`, those within chunks too. Who is shown a message reads its bytes or skips
/// them.
fn walk(
    input: &mut LogInput,
    each: &mut dyn FnMut(ContainerRecord, &mut LogInput) -> Result<(), LogError>,
) -> Result<(), LogError> {
    let mut records = Records::default();
    let magic: [u8; 8] = input.array()?;
    let next = match magic == MCAP_MAGIC {
        true => Records::mcap,
        false => {
            let version: [u8; 5] = input.array()?;
            let magic = [&magic[..], &version].concat();
            if magic != BAG_MAGIC {
                return Err(LogError::encoding(0, magic.trim_ascii_end()));
            }
            Records::bag
        }
    };
    while let Some(record) = next(&mut records, input)? {
        match record {
            ContainerRecord::Chunk(chunk) => {
                let mut inside = chunk.open(input)?;
                while let Some(record) = next(&mut records, &mut inside)? {
                    if matches!(record, ContainerRecord::Chunk(_)) {
                        return Err(LogError::malformed(chunk.offset, "a chunk within a chunk"));
                    }
                    each(record, &mut inside)?;
                }
            }
            record => each(record, input)?,
        }
    }
    if records.end == 0 || records.end > input.length() {
        let message = "the end is missing: still being written, or interrupted";
        return Err(LogError::at(input.offset(), LogFault::Cut, message));
    }
    Ok(())
}

/// Largest message that is read (bytes): an IMU's has 400.
const LARGEST_MESSAGE: u64 = 1 << 20;

/// Finds and counts the channels of a container, or reads the messages of one, which may stand out of order in the file.
pub(crate) fn scan(input: &mut LogInput, scan: &mut Scan<'_>) -> Result<(), LogError> {
    let mut found = Vec::new();
    let channels = &mut scan.channels;
    let outcome = walk(input, &mut |record, input| {
        match (record, scan.wanted) {
            (ContainerRecord::Message(head), Some((channel, stamp)))
                if head.channel == channel.id =>
            {
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
            }
            (ContainerRecord::Message(head), _) => {
                input.skip(head.size)?;
                channels.entry(head.channel).or_default().count(head.log_ns);
            }
            (ContainerRecord::Channel(id, [topic, type_name, encoding]), _) => {
                let channel = channels.entry(id).or_default();
                if channel.topic.is_empty() {
                    channel.content = match type_name.as_str() {
                        "sensor_msgs/msg/Imu" | "sensor_msgs/Imu" => Content::Imu,
                        "sensor_msgs/msg/NavSatFix" | "sensor_msgs/NavSatFix" => Content::Fix,
                        _ => Content::Other,
                    };
                    (channel.topic, channel.type_name) = (topic, type_name);
                    channel.encoding = encoding;
                }
            }
            _ => {}
        }
        Ok(())
    });
    channels.retain(|id, channel| {
        channel.id = *id;
        !channel.topic.is_empty()
    });
    found.sort_by_key(|(log_ns, ..)| *log_ns);
    let found = found
        .into_iter()
        .map(|(_, offset, sample)| (offset, sample));
    scan.samples.extend(found);
    outcome
}

// Chunks and their compressions.

/// Largest chunk (bytes); writers end theirs at a few MB.
const LARGEST_CHUNK: u64 = 256 << 20;

/// Chunk of a container: where it stands, and how it is packed.
pub(crate) struct Chunk {
    /// Byte of its first packed byte.
    pub(crate) offset: u64,
    /// Name of the compression in the file.
    compression: Vec<u8>,
    packed: u64,
    unpacked: u64,
    /// CRC of the unpacked bytes; 0 where there is none.
    crc: u32,
}

impl Chunk {
    /// Unpacks it: the input stands at its first byte.
    pub(crate) fn open(&self, input: &mut LogInput) -> Result<LogInput, LogError> {
        if self.unpacked > LARGEST_CHUNK {
            return Err(LogError::too_large(
                self.offset,
                self.unpacked,
                LARGEST_CHUNK,
            ));
        }
        let packed = input.bytes(self.packed, LARGEST_CHUNK)?;
        let bytes = match self.compression.as_slice() {
            b"" | b"none" => packed,
            #[cfg(feature = "mcap")]
            b"zstd" => self.unpack(|| {
                ruzstd::decoding::StreamingDecoder::new(packed.as_slice()).map_err(io::Error::other)
            })?,
            b"lz4" => self.unpack(|| Ok(lz4_flex::frame::FrameDecoder::new(packed.as_slice())))?,
            #[cfg(feature = "bag")]
            b"bz2" => self.unpack(|| Ok(bzip2::read::MultiBzDecoder::new(packed.as_slice())))?,
            unknown => return Err(LogError::encoding(self.offset, unknown)),
        };
        if bytes.len() as u64 != self.unpacked {
            return Err(LogError::malformed(
                self.offset,
                "a chunk has not the length it states",
            ));
        }
        #[cfg(feature = "mcap")]
        if self.crc != 0 && self.crc != crc32fast::hash(&bytes) {
            return Err(LogError::malformed(self.offset, "CRC failed"));
        }
        Ok(LogInput::chunk(bytes, self.offset))
    }

    /// Unpacks at most a byte more than the chunk states; memory grows with what is unpacked, not with what is stated.
    fn unpack<R: Read>(
        &self,
        decoder: impl FnOnce() -> io::Result<R>,
    ) -> Result<Vec<u8>, LogError> {
        let fault = |error: io::Error| {
            LogError::malformed(self.offset, format!("a chunk cannot be unpacked: {error}"))
        };
        let mut bytes = Vec::with_capacity(self.unpacked.min(8 * self.packed) as usize);
        decoder()
            .map_err(fault)?
            .take(self.unpacked + 1)
            .read_to_end(&mut bytes)
            .map_err(fault)?;
        Ok(bytes)
    }
}

// Logs of ROS: topics of a container.

/// Message of a channel.
struct Message {
    /// Time of arrival, where it is the one that counts.
    log_ns: Option<i64>,
    offset: u64,
    data: Vec<u8>,
}

/// Body of a message, and its stamp. Behind the header: in ROS 1 a sequence number, the time, a name; in ROS 2 the same
/// without the number.
fn body<'a>(encoding: &str, message: &'a Message) -> Result<(Bytes<'a>, i64), LogError> {
    let mut bytes = match encoding {
        "ros1" => Bytes::little(&message.data),
        "cdr" => cdr(message)?,
        other => return Err(LogError::encoding(message.offset, other.as_bytes())),
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
fn cdr(message: &Message) -> Result<Bytes<'_>, LogError> {
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
            return Err(LogError::encoding(
                message.offset,
                format!("CDR {:02x?}", &head[..2]).as_bytes(),
            ));
        }
    };
    Ok(Bytes::new(rest, is_big_endian, most))
}

fn short(message: &Message) -> LogError {
    LogError::malformed(
        message.offset,
        format!("a message of {} bytes is too short", message.data.len()),
    )
}

/// A sample of `sensor_msgs/Imu`: the orientation and the covariances are passed over.
fn imu(encoding: &str, message: &Message) -> Result<LogSample, LogError> {
    let (mut bytes, stamp_ns) = body(encoding, message)?;
    let mut sample = || {
        bytes.f64s::<{ 4 + 9 }>()?;
        let gyro_rad_s = bytes.f64s()?;
        bytes.f64s::<9>()?;
        let accel_m_s2 = bytes.f64s()?;
        bytes.f64s::<9>()?;
        Some(LogSample::Imu(ImuReading {
            stamp_ns,
            accel_m_s2,
            gyro_rad_s,
        }))
    };
    sample().ok_or_else(|| short(message))
}

/// A fix of `sensor_msgs/NavSatFix`; none where its status is below 0.
fn fix(encoding: &str, message: &Message) -> Result<Option<LogSample>, LogError> {
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
        LogSample::Fix(Box::new(LogFix {
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

// Records of a ROS 1 bag (<https://wiki.ros.org/Bags/Format/2.0>).

const BAG_MAGIC: [u8; 13] = *b"#ROSBAG V2.0\n";
/// Longest header of a record (bytes).
const LONGEST_HEADER: u64 = 1 << 20;
/// State of the reading.
#[derive(Default)]
struct Records {
    /// Types of the messages of an MCAP file, by the numbers of their schemas.
    types: HashMap<u16, String>,
    /// Byte of what is written last, the index of a bag or the footer; 0 until it is known.
    end: u64,
}

impl Records {
    /// The next record of a bag, or of a chunk of it; none at its end.
    fn bag(&mut self, input: &mut LogInput) -> Result<Option<ContainerRecord>, LogError> {
        if input.left() == 0 {
            return Ok(None);
        }
        let offset = input.offset();
        let length = u64::from(input.u32()?);
        let header = input.bytes(length, LONGEST_HEADER)?;
        let size = u64::from(input.u32()?);
        input.expect(size)?;
        let fault = || LogError::malformed(offset, "a record of a bag does not parse");
        let fields = Fields(&header);
        let record = match fields.bytes(b"op").ok_or_else(fault)? {
            // a message
            [0x02] => bag_message(fields, size),
            // the start of the bag
            [0x03] => {
                input.skip(size)?;
                if let Some(name) = fields.bytes(b"encryptor").filter(|name| !name.is_empty()) {
                    return Err(LogError::encoding(offset, name));
                }
                let index = fields.bytes(b"index_pos");
                let index = index.and_then(|b| Bytes::little(b).u64());
                self.end = index.ok_or_else(fault)?;
                Some(ContainerRecord::Other)
            }
            [0x05] => {
                let compression = fields.bytes(b"compression").ok_or_else(fault)?.to_vec();
                let unpacked = fields.u32(b"size").ok_or_else(fault)?.into();
                let offset = input.offset();
                Some(ContainerRecord::Chunk(Chunk {
                    offset,
                    compression,
                    packed: size,
                    unpacked,
                    crc: 0,
                }))
            }
            [0x07] => connection(fields, &input.bytes(size, LARGEST_RECORD)?),
            _ => {
                input.skip(size)?;
                Some(ContainerRecord::Other)
            }
        };
        record.ok_or_else(fault).map(Some)
    }
}

/// Fields of a header: each is a length, then `name=value`.
#[derive(Clone, Copy)]
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(self, name: &[u8]) -> Option<&'a [u8]> {
        let mut bytes = Bytes::little(self.0);
        while let Some(field) = bytes.string() {
            if let Some(value) = field
                .strip_prefix(name)
                .and_then(|rest| rest.strip_prefix(b"="))
            {
                return Some(value);
            }
        }
        None
    }

    fn u32(self, name: &[u8]) -> Option<u32> {
        Bytes::little(self.bytes(name)?).u32()
    }
}

/// Seconds and nanoseconds (ns).
fn time_ns(bytes: &mut Bytes<'_>) -> Option<i64> {
    Some(i64::from(bytes.u32()?) * NS + i64::from(bytes.u32()?))
}

fn bag_message(fields: Fields<'_>, size: u64) -> Option<ContainerRecord> {
    let log_ns = time_ns(&mut Bytes::little(fields.bytes(b"time")?))?;
    Some(ContainerRecord::Message(MessageHead {
        channel: fields.u32(b"conn")?,
        log_ns,
        size,
    }))
}

fn connection(fields: Fields<'_>, data: &[u8]) -> Option<ContainerRecord> {
    let (topic, type_name) = (fields.bytes(b"topic")?, Fields(data).bytes(b"type")?);
    let named = [text(topic), text(type_name), "ros1".to_owned()];
    Some(ContainerRecord::Channel(fields.u32(b"conn")?, named))
}

// Records of MCAP (<https://mcap.dev/spec>).

/// Numbers of kinds of records.
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MCAP_MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// Largest record that is read whole (bytes): a definition of messages, a schema, the index of a chunk.
const LARGEST_RECORD: u64 = 64 << 20;

impl Records {
    /// The next record of an MCAP file, or of a chunk of it; none at its end.
    fn mcap(&mut self, input: &mut LogInput) -> Result<Option<ContainerRecord>, LogError> {
        let offset = input.offset();
        if input.left() == 0 {
            return Ok(None);
        }
        let (code, length) = (input.u8()?, input.u64()?);
        input.expect(length)?;
        let fault = || {
            LogError::malformed(
                offset,
                format!("record {code:#04x} of {length} bytes does not parse"),
            )
        };
        let record = match code {
            0x00 => return Err(LogError::malformed(offset, "record of kind 0")),
            // the footer
            0x02 => {
                input.skip(length)?;
                if input.array()? != MCAP_MAGIC {
                    return Err(fault());
                }
                self.end = input.position();
                return Ok(None);
            }
            SCHEMA | CHANNEL => {
                let body = input.bytes(length, LARGEST_RECORD)?;
                self.body(code, &body).ok_or_else(fault)?
            }
            0x05 => message(input, length, fault)?,
            0x06 => ContainerRecord::Chunk(mcap_chunk(input, length)?),
            _ => {
                input.skip(length)?;
                ContainerRecord::Other
            }
        };
        Ok(Some(record))
    }

    /// A record that is read whole.
    fn body(&mut self, code: u8, body: &[u8]) -> Option<ContainerRecord> {
        let mut bytes = Bytes::little(body);
        let id = bytes.u16()?;
        match code {
            SCHEMA => {
                self.types.insert(id, text(bytes.string()?));
                Some(ContainerRecord::Other)
            }
            _ => {
                let type_name = self.types.get(&bytes.u16()?).cloned().unwrap_or_default();
                let (topic, encoding) = (text(bytes.string()?), text(bytes.string()?));
                Some(ContainerRecord::Channel(
                    id.into(),
                    [topic, type_name, encoding],
                ))
            }
        }
    }
}

/// A message behind its channel, number and two times.
fn message(
    input: &mut LogInput,
    length: u64,
    fault: impl Fn() -> LogError,
) -> Result<ContainerRecord, LogError> {
    let size = length.checked_sub(22).ok_or_else(&fault)?;
    let channel = u32::from(input.u16()?);
    input.u32()?;
    let log_ns = i64::try_from(input.u64()?).map_err(|_| fault())?;
    input.u64()?;
    Ok(ContainerRecord::Message(MessageHead {
        channel,
        log_ns,
        size,
    }))
}

/// A chunk behind its times, length, CRC and compression.
fn mcap_chunk(input: &mut LogInput, length: u64) -> Result<Chunk, LogError> {
    const LONGEST_NAME: u64 = 64;
    let start = input.position();
    input.skip(16)?;
    let (unpacked, crc) = (input.u64()?, input.u32()?);
    let name = u64::from(input.u32()?);
    let compression = input.bytes(name, LONGEST_NAME)?;
    let packed = input.u64()?;
    let offset = input.offset();
    if (input.position() - start).checked_add(packed) != Some(length) {
        return Err(LogError::malformed(
            offset,
            "a chunk has not the length of its record",
        ));
    }
    Ok(Chunk {
        offset,
        compression,
        packed,
        unpacked,
        crc,
    })
}
