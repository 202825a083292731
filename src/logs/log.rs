//! A log of any format.

use crate::channel::{Channel, Content, choose};
use crate::error::Error;
use crate::format::{Format, Opened};
use crate::input::Origin;
use crate::recognise::{HEAD, Kind, recognise};
use crate::sample::{Fix, ImuSample, Stamp};
use crate::stream::{Damage, Samples};
use std::path::Path;
use std::sync::Arc;

/// Log whose channels are known.
///
/// ```
/// use nav_sim_logs::{Content, Error, Log, Stamp};
///
/// # fn main() -> Result<(), Error> {
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/ros2_zstd.mcap");
/// let log = Log::open(path.as_ref())?;
/// let imu = log.channels().iter().find(|c| c.content == Content::Imu).expect("one is there");
/// assert_eq!((imu.topic.as_str(), imu.messages), ("/imu", 40));
///
/// // no topic is named, as there is but one
/// for sample in log.imu(None, Stamp::Header)? {
///     let sample = sample?;
///     let (accel_m_s2, _gyro_rad_s) = sample.motion.rates();
///     assert!(accel_m_s2[2] > 9.0 && sample.t_s() > 1.7e9);
/// }
/// # Ok(())
/// # }
/// ```
pub struct Log {
    kind: Kind,
    channels: Vec<Channel>,
    damage: Option<Damage>,
    file_bytes: u64,
    format: Box<dyn Format>,
}

impl Log {
    /// Opens a file and finds its channels.
    ///
    /// # Errors
    /// When the format is not one that is read, or the file is damaged before its end.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::new(Origin::File(path.to_owned()))
    }

    /// Finds the channels of a file that is held.
    ///
    /// # Errors
    /// Those of [`Self::open`].
    pub fn from_bytes(bytes: impl Into<Arc<[u8]>>) -> Result<Self, Error> {
        Self::new(Origin::Bytes(bytes.into()))
    }

    fn new(origin: Origin) -> Result<Self, Error> {
        let kind = recognise(&origin.head(HEAD as u64)?).ok_or(Error::Unknown)?;
        let file_bytes = origin.open()?.length();
        let opened = match kind {
            #[cfg(feature = "mcap")]
            Kind::Mcap => crate::ros::open::<crate::mcap::Mcap>(origin),
            #[cfg(feature = "bag")]
            Kind::Bag => crate::ros::open::<crate::bag::Bag>(origin),
            #[cfg(feature = "ulog")]
            Kind::Ulog => crate::ulog::open(origin),
            #[cfg(feature = "ubx")]
            Kind::Ubx => crate::ubx::open(origin),
            _ => Err(Error::NotRead(kind)),
        };
        let Opened {
            channels,
            damage,
            format,
        } = opened?;
        Ok(Self {
            kind,
            channels,
            damage,
            file_bytes,
            format,
        })
    }

    /// Format of the file.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        self.kind
    }

    /// Channels, in order of their topics.
    #[must_use]
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Cut at which the file is taken to end.
    #[must_use]
    pub const fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Samples of an IMU: of this topic, or of the only one.
    ///
    /// # Errors
    /// When there is no such topic, or several and none is named.
    pub fn imu(&self, topic: Option<&str>, stamp: Stamp) -> Result<Samples<ImuSample>, Error> {
        let channel = choose(&self.channels, Content::Imu, topic)?;
        Ok(Samples::new(
            self.format.imu(channel, stamp)?,
            channel,
            self.file_bytes,
        ))
    }

    /// Fixes of a receiver: of this topic, or of the only one.
    ///
    /// # Errors
    /// When there is no such topic, or several and none is named.
    pub fn fixes(&self, topic: Option<&str>, stamp: Stamp) -> Result<Samples<Fix>, Error> {
        let channel = choose(&self.channels, Content::Fix, topic)?;
        Ok(Samples::new(
            self.format.fixes(channel, stamp)?,
            channel,
            self.file_bytes,
        ))
    }
}

impl std::fmt::Debug for Log {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Log")
            .field("kind", &self.kind)
            .field("channels", &self.channels)
            .finish_non_exhaustive()
    }
}
