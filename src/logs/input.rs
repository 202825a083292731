//! Bytes of a log, with their offsets.

use std::fmt;
use std::fmt::{Display, Formatter};
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes that are read at once.
const BUFFER: usize = 1 << 16;

trait ByteSource: Read + Seek + Send {}
impl<T: Read + Seek + Send> ByteSource for T {}

/// Bytes to be read in order, with seeking.
pub(crate) struct LogInput {
    source: BufReader<Box<dyn ByteSource>>,
    position: u64,
    length: u64,
    /// Byte of the file where the chunk stands whose unpacked bytes these are.
    chunk: Option<u64>,
}

impl LogInput {
    fn new(source: Box<dyn ByteSource>, length: u64, chunk: Option<u64>) -> Self {
        Self {
            source: BufReader::with_capacity(BUFFER, source),
            position: 0,
            length,
            chunk,
        }
    }

    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self::new(Box::new(file), length, None))
    }

    /// The unpacked bytes of a chunk.
    pub(crate) fn chunk(bytes: Vec<u8>, offset: u64) -> Self {
        let length = bytes.len() as u64;
        Self::new(Box::new(Cursor::new(bytes)), length, Some(offset))
    }

    pub(crate) const fn position(&self) -> u64 {
        self.position
    }

    pub(crate) const fn length(&self) -> u64 {
        self.length
    }

    pub(crate) const fn left(&self) -> u64 {
        self.length.saturating_sub(self.position)
    }

    /// Byte of the file.
    pub(crate) fn offset(&self) -> u64 {
        self.chunk.unwrap_or(self.position)
    }

    /// Holds when so many bytes are there.
    pub(crate) fn expect(&self, needed: u64) -> Result<(), LogError> {
        let left = self.left();
        match self.chunk {
            _ if needed <= left => Ok(()),
            None => Err(LogError::truncated(self.position, needed, left)),
            Some(chunk) => Err(LogError::malformed(chunk, "a record goes beyond its chunk")),
        }
    }

    pub(crate) fn skip(&mut self, bytes: u64) -> Result<(), LogError> {
        self.expect(bytes)?;
        self.seek(self.position + bytes)
    }

    pub(crate) fn seek(&mut self, position: u64) -> Result<(), LogError> {
        match position.checked_signed_diff(self.position) {
            Some(step) => self.source.seek_relative(step)?,
            None => _ = self.source.seek(SeekFrom::Start(position))?,
        }
        self.position = position;
        Ok(())
    }

    fn fill(&mut self, into: &mut [u8]) -> Result<(), LogError> {
        self.expect(into.len() as u64)?;
        self.source.read_exact(into)?;
        self.position += into.len() as u64;
        Ok(())
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], LogError> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, LogError> {
        Ok(self.array::<1>()?[0])
    }

    pub(crate) fn u16(&mut self) -> Result<u16, LogError> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, LogError> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, LogError> {
        self.array().map(u64::from_le_bytes)
    }

    /// This many bytes, which are there and not too many: both are known before anything is allocated.
    pub(crate) fn bytes(&mut self, count: u64, limit: u64) -> Result<Vec<u8>, LogError> {
        self.expect(count)?;
        if count > limit {
            return Err(LogError::too_large(self.offset(), count, limit));
        }
        let mut bytes = vec![0; count as usize];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    /// The bytes from here on, as many as there are or so many.
    pub(crate) fn take(self, bytes: u64) -> impl Read {
        self.source.take(bytes)
    }
}

// Numbers within the bytes of a message.

/// Bytes of a message, read in order; `None` beyond their end.
#[derive(Clone, Copy)]
pub(crate) struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
    is_big_endian: bool,
    /// Numbers are aligned to their own size, at most to so many bytes.
    alignment: usize,
}

impl<'a> Bytes<'a> {
    pub(crate) const fn little(all: &'a [u8]) -> Self {
        Self::new(all, false, 1)
    }

    pub(crate) const fn new(all: &'a [u8], is_big_endian: bool, alignment: usize) -> Self {
        Self {
            all,
            at: 0,
            is_big_endian,
            alignment,
        }
    }

    pub(crate) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.all.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.next_multiple_of(N.min(self.alignment));
        let mut bytes = *self.take(N)?.first_chunk::<N>()?;
        if self.is_big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.number().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Option<i32> {
        self.number().map(i32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    pub(crate) fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Some(values)
    }

    /// A string behind its length.
    pub(crate) fn string(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.take(length as usize)
    }
}

/// Text of a name in a file.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Types of numbers, with their bytes.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Number {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Number {
    pub(crate) const fn size(self) -> usize {
        let (Self::Signed(size) | Self::Unsigned(size) | Self::Float(size)) = self;
        size
    }

    pub(crate) fn read(self, bytes: &mut Bytes<'_>) -> Option<f64> {
        Some(match self {
            Self::Signed(1) => bytes.u8()?.cast_signed().into(),
            Self::Signed(2) => bytes.u16()?.cast_signed().into(),
            Self::Signed(4) => bytes.i32()?.into(),
            Self::Signed(_) => bytes.u64()?.cast_signed() as f64,
            Self::Unsigned(1) => bytes.u8()?.into(),
            Self::Unsigned(2) => bytes.u16()?.into(),
            Self::Unsigned(4) => bytes.u32()?.into(),
            Self::Unsigned(_) => bytes.u64()? as f64,
            Self::Float(4) => f32::from_bits(bytes.u32()?).into(),
            Self::Float(_) => bytes.f64()?,
        })
    }
}

// Formats, told by their first bytes.

/// Bytes from the start of a file that [`recognise`] looks at.
pub const HEAD: usize = 4096;

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogFormat {
    /// MCAP, of ROS 2 or ROS 1.
    Mcap,
    /// Bag of ROS 1, version 2.0.
    Bag,
    /// Log of PX4.
    Ulog,
    /// Messages of a u-blox receiver, perhaps among others.
    Ubx,
    /// Arrays of NumPy in a zip archive.
    Npz,
    /// One that is not read: its name, and the command that makes one that is.
    Other(&'static str, &'static str),
}

impl LogFormat {
    /// Name, as in a sentence.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mcap => "an MCAP log",
            Self::Bag => "a ROS 1 bag",
            Self::Ulog => "a PX4 ULog",
            Self::Ubx => "a u-blox UBX log",
            Self::Npz => "a NumPy .npz",
            Self::Other(name, _) => name,
        }
    }

    /// The command that makes a file that is read, for a format that is not.
    #[must_use]
    pub const fn conversion(self) -> Option<&'static str> {
        match self {
            Self::Other(_, conversion) => Some(conversion),
            _ => None,
        }
    }
}

const MATLAB: &str =
    "in MATLAB: writematrix(imu, 'imu.csv'), and read it with --columns, which names its columns";
const NOVATEL: LogFormat = LogFormat::Other(
    "a NovAtel log",
    "GPGGA, GPRMC and GPGST as fixes; IMU counts times their scale factors as a table t_s, accel_x_m_s2 … gyro_z_rad_s",
);
const HDF5: LogFormat = LogFormat::Other("an HDF5 file, as MATLAB 7.3 writes", MATLAB);
/// First bytes of the formats that have such.
const MAGIC: [(&[u8], LogFormat); 14] = [
    (b"\xaa\x44\x12", NOVATEL),
    (b"\xaa\x44\x13", NOVATEL),
    (
        b"$IMURAW\0",
        LogFormat::Other(
            "an Inertial Explorer .imr",
            "in Inertial Explorer: Tools > View Raw IMU Data, saved as text with units in the header",
        ),
    ),
    (
        b"\xff\x5a",
        LogFormat::Other(
            "an SBG log",
            "in sbgCenter or with sbgBasicLogger: export as CSV or text, with units in the header",
        ),
    ),
    (b"\x89MCAP0\r\n", LogFormat::Mcap),
    (b"#ROSBAG V", LogFormat::Bag),
    (b"ULog\x01\x12\x35", LogFormat::Ulog),
    (
        b"SQLite format 3\0",
        LogFormat::Other(
            "a SQLite database, as rosbag2 writes (.db3)",
            "mcap convert FILE.db3 FILE.mcap",
        ),
    ),
    // a description of the description of messages comes first
    (
        b"\xa3\x95\x80",
        LogFormat::Other(
            "an ArduPilot DataFlash log",
            "mavlogdump.py --format csv --types IMU FILE.bin > imu.csv",
        ),
    ),
    (
        b"MATLAB 5.0 MAT-file",
        LogFormat::Other("a MATLAB .mat file", MATLAB),
    ),
    (b"MATLAB 7.3 MAT-file", HDF5),
    (b"\x89HDF\r\n\x1a\n", HDF5),
    // preamble of an Xbus message, and the bus itself
    (
        b"\xfa\xff",
        LogFormat::Other(
            "an Xsens .mtb log",
            "in MT Manager: File > Export, as ASCII (.txt)",
        ),
    ),
    (
        b"$@",
        LogFormat::Other(
            "a Septentrio SBF log",
            "bin2asc -f FILE.sbf -m PVTGeodetic2 -t",
        ),
    ),
];
/// First bytes of a zip archive with and without files.
const ZIP: [&[u8]; 2] = [b"PK\x03\x04", b"PK\x05\x06"];
/// First bytes of a message of u-blox.
pub(crate) const UBX_SYNC: [u8; 2] = [0xb5, 0x62];

/// Format of a file by its first bytes, at best [`HEAD`] of them.
///
/// ```
/// use nav_sim_logs::{LogFormat, recognise};
///
/// assert_eq!(recognise(b"\x89MCAP0\r\n\x01"), Some(LogFormat::Mcap));
/// let kind = recognise(b"SQLite format 3\0\x10\0").expect("a known one");
/// assert_eq!(kind.conversion(), Some("mcap convert FILE.db3 FILE.mcap"));
/// assert_eq!(recognise(b"t_s,gyro_x\n0.0,1.0\n"), None);
/// ```
#[must_use]
pub fn recognise(head: &[u8]) -> Option<LogFormat> {
    if let Some((_, kind)) = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Some(*kind);
    }
    if ZIP.iter().any(|magic| head.starts_with(magic)) {
        return Some(if first_name(head).is_some_and(|n| n.ends_with(b".npy")) {
            LogFormat::Npz
        } else {
            LogFormat::Other("a zip archive", "unzip FILE.zip")
        });
    }
    // ASCII logs of NovAtel: `#BESTPOSA,`, short `%RAWIMUSA,`, abbreviated `<BESTPOS `
    if let Some(b'#' | b'%' | b'<') = head.first()
        && let Some(name) = head[1..].split(|b| b", ".contains(b)).next()
        && name.len() > 4
        && (name.ends_with(b"A") || head[0] == b'<')
        && name
            .iter()
            .all(|b| b.is_ascii_digit() || b.is_ascii_uppercase())
    {
        return Some(NOVATEL);
    }
    // the label of the first line stands in its columns 61 to 80
    if head
        .get(60..80)
        .is_some_and(|label| label == b"RINEX VERSION / TYPE")
    {
        return Some(LogFormat::Other(
            "a RINEX file",
            "rnx2rtkp -o fixes.pos rover.obs base.obs FILE.nav",
        ));
    }
    head.windows(2)
        .enumerate()
        .any(|(i, w)| w == UBX_SYNC && is_ubx(&head[i..]))
        .then_some(LogFormat::Ubx)
}

/// Name of the first file in a zip archive.
fn first_name(head: &[u8]) -> Option<&[u8]> {
    let length = u16::from_le_bytes(*head.get(26..)?.first_chunk()?);
    head.get(30..30 + usize::from(length))
}

/// A whole message of u-blox with its checksum; or the start of one that is the first of the file, as it may
/// be longer than the bytes that are here.
fn is_ubx(bytes: &[u8]) -> bool {
    let Some(length) = bytes.get(4..).and_then(|b| b.first_chunk()) else {
        return false;
    };
    let length = usize::from(u16::from_le_bytes(*length));
    bytes.get(2..8 + length).is_some_and(|body| {
        let (summed, sum) = body.split_at(4 + length);
        ubx_checksum(summed) == sum
    })
}

/// Checksum of a message of u-blox, over class, number, length and payload (RFC 1145, over bytes).
pub(crate) fn ubx_checksum(bytes: &[u8]) -> [u8; 2] {
    let (a, b) = bytes.iter().fold((0_u8, 0_u8), |(a, b), byte| {
        let a = a.wrapping_add(*byte);
        (a, b.wrapping_add(a))
    });
    [a, b]
}

// Errors of reading a log.

/// Error of reading a log; what to do about it is its [`hint`](Self::hint).
#[derive(Debug)]
pub struct LogError {
    /// Kind of the error.
    pub fault: LogFault,
    /// Byte of the file; that of the chunk for what is packed within it.
    pub offset: Option<u64>,
    /// Topic, where one was being read.
    topic: Option<String>,
    message: String,
}

/// Kinds of errors.
#[derive(Debug)]
#[non_exhaustive]
pub enum LogFault {
    /// The operating system refused.
    Io(io::Error),
    /// The file ends where its writer did not end it.
    Cut,
    /// An encoding or a compression that is not known.
    Encoding,
    /// Stamps of a topic run backwards.
    TimeBack,
    /// Bytes that do not follow the format.
    Damage,
    /// No topic is the one that is named, or several could be.
    Topic,
    /// No topic has what is wanted.
    NoTopic,
    /// A format that is known by its first bytes, and is not read.
    NotRead(LogFormat),
}

impl Display for LogError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if let Some(offset) = self.offset {
            write!(f, "byte {offset}")?;
            let mut topic = self.topic.iter();
            topic.try_for_each(|topic| write!(f, ", topic {topic}"))?;
            f.write_str(": ")?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for LogError {}

impl From<io::Error> for LogError {
    fn from(e: io::Error) -> Self {
        let message = e.to_string();
        Self::new(LogFault::Io(e), message)
    }
}

impl LogError {
    pub(crate) fn new(fault: LogFault, message: impl Into<String>) -> Self {
        Self {
            fault,
            offset: None,
            topic: None,
            message: message.into(),
        }
    }

    pub(crate) fn at(offset: u64, fault: LogFault, message: impl Into<String>) -> Self {
        Self {
            offset: Some(offset),
            ..Self::new(fault, message)
        }
    }

    pub(crate) fn malformed(offset: u64, message: impl Into<String>) -> Self {
        Self::at(offset, LogFault::Damage, message)
    }

    /// A record beyond the end of the file.
    pub(crate) fn truncated(offset: u64, needed: u64, left: u64) -> Self {
        let message = format!("cut off, a record of {needed} bytes has {left}");
        Self::at(offset, LogFault::Cut, message)
    }

    /// A length beyond what any such message has.
    pub(crate) fn too_large(offset: u64, bytes: u64, limit: u64) -> Self {
        Self::malformed(
            offset,
            format!("{bytes} bytes where at most {limit} make sense"),
        )
    }

    pub(crate) fn encoding(offset: u64, encoding: &[u8]) -> Self {
        let message = format!("unknown encoding {:?}", text(encoding));
        Self::at(offset, LogFault::Encoding, message)
    }

    /// No topic of what is wanted among these.
    pub(crate) fn no_topic(what: &str, topics: &[String]) -> Self {
        let there = match topics {
            [] => String::new(),
            _ => format!("; there are {}", topics.join(", ")),
        };
        let fault = match topics {
            [] => LogFault::NoTopic,
            _ => LogFault::Topic,
        };
        Self::new(fault, format!("no topic has {what}{there}"))
    }

    /// Byte at which a file ends that its writer did not end.
    pub(crate) fn cut(&self) -> Option<u64> {
        self.offset.filter(|_| matches!(self.fault, LogFault::Cut))
    }

    /// The error with the name of its topic.
    pub(crate) fn of_topic(mut self, name: &str) -> Self {
        self.topic.get_or_insert_with(|| name.to_owned());
        self
    }

    /// Advice on what to do.
    #[must_use]
    pub const fn hint(&self) -> Option<&'static str> {
        match self.fault {
            LogFault::Cut | LogFault::Damage => Some("the file is damaged: copy it again"),
            LogFault::NotRead(kind) => kind.conversion(),
            _ => None,
        }
    }
}
