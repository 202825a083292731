//! Formats, told by their first bytes.

/// Bytes from the start of a file that [`recognise`] looks at.
pub const HEAD: usize = 4096;

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
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
    /// Bag of ROS 2 in SQLite; not read.
    Sqlite,
    /// Log of ArduPilot; not read.
    DataFlash,
    /// MATLAB's format up to version 7; not read.
    Mat5,
    /// HDF5, as MATLAB's format of version 7.3 is; not read.
    Hdf5,
    /// Binary log of Xsens; not read.
    Mtb,
    /// Binary blocks of Septentrio; not read.
    Sbf,
    /// Observations or orbits in RINEX; not read.
    Rinex,
    /// Archive of anything but arrays; not read.
    Zip,
}

impl Kind {
    /// Name, as in a sentence.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mcap => "an MCAP log",
            Self::Bag => "a ROS 1 bag",
            Self::Ulog => "a PX4 ULog",
            Self::Ubx => "a u-blox UBX log",
            Self::Npz => "a NumPy .npz",
            Self::Sqlite => "a SQLite database, as rosbag2 writes (.db3)",
            Self::DataFlash => "an ArduPilot DataFlash log",
            Self::Mat5 => "a MATLAB .mat file",
            Self::Hdf5 => "an HDF5 file, as MATLAB 7.3 writes",
            Self::Mtb => "an Xsens .mtb log",
            Self::Sbf => "a Septentrio SBF log",
            Self::Rinex => "a RINEX file",
            Self::Zip => "a zip archive",
        }
    }

    /// The command that makes a file that is read, for a format that is not.
    #[must_use]
    pub const fn conversion(self) -> Option<&'static str> {
        Some(match self {
            Self::Sqlite => "mcap convert FILE.db3 FILE.mcap",
            Self::DataFlash => "mavlogdump.py --format csv --types IMU FILE.bin > imu.csv",
            Self::Mat5 | Self::Hdf5 => "in MATLAB: writematrix(imu, 'imu.csv')",
            Self::Mtb => "in MT Manager: File > Export, as ASCII (.txt)",
            Self::Sbf => "bin2asc -f FILE.sbf -m PVTGeodetic2 -t",
            Self::Rinex => "rnx2rtkp -o fixes.pos rover.obs base.obs FILE.nav",
            Self::Zip => "unzip FILE.zip",
            Self::Mcap | Self::Bag | Self::Ulog | Self::Ubx | Self::Npz => return None,
        })
    }
}

/// First bytes of the formats that have such.
const MAGIC: [(&[u8], Kind); 10] = [
    (b"\x89MCAP0\r\n", Kind::Mcap),
    (b"#ROSBAG V", Kind::Bag),
    (b"ULog\x01\x12\x35", Kind::Ulog),
    (b"SQLite format 3\0", Kind::Sqlite),
    // a description of the description of messages comes first
    (b"\xa3\x95\x80", Kind::DataFlash),
    (b"MATLAB 5.0 MAT-file", Kind::Mat5),
    (b"MATLAB 7.3 MAT-file", Kind::Hdf5),
    (b"\x89HDF\r\n\x1a\n", Kind::Hdf5),
    // preamble of an Xbus message, and the bus itself
    (b"\xfa\xff", Kind::Mtb),
    (b"$@", Kind::Sbf),
];
/// First bytes of a zip archive with and without files.
const ZIP: [&[u8]; 2] = [b"PK\x03\x04", b"PK\x05\x06"];
/// First bytes of a message of u-blox.
pub(crate) const UBX_SYNC: [u8; 2] = [0xb5, 0x62];

/// Format of a file by its first bytes, at best [`HEAD`] of them.
///
/// ```
/// use nav_sim_logs::{Kind, recognise};
///
/// assert_eq!(recognise(b"\x89MCAP0\r\n\x01"), Some(Kind::Mcap));
/// let kind = recognise(b"SQLite format 3\0\x10\0").expect("a known one");
/// assert_eq!(kind.conversion(), Some("mcap convert FILE.db3 FILE.mcap"));
/// assert_eq!(recognise(b"t_s,gyro_x\n0.0,1.0\n"), None);
/// ```
#[must_use]
pub fn recognise(head: &[u8]) -> Option<Kind> {
    if let Some((_, kind)) = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Some(*kind);
    }
    if ZIP.iter().any(|magic| head.starts_with(magic)) {
        return Some(if first_name(head).is_some_and(|n| n.ends_with(b".npy")) {
            Kind::Npz
        } else {
            Kind::Zip
        });
    }
    // the label of the first line stands in its columns 61 to 80
    if head
        .get(60..80)
        .is_some_and(|label| label == b"RINEX VERSION / TYPE")
    {
        return Some(Kind::Rinex);
    }
    head.windows(2)
        .enumerate()
        .any(|(i, w)| w == UBX_SYNC && is_ubx(&head[i..]))
        .then_some(Kind::Ubx)
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
