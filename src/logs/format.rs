//! Formats: what opening a file gives.

use crate::channel::Channel;
use crate::error::Error;
use crate::sample::{Fix, ImuSample, Stamp};
use crate::stream::{Damage, Stream};

/// Channels of a file, and the reader of their messages.
pub(crate) struct Opened {
    pub(crate) channels: Vec<Channel>,
    pub(crate) damage: Option<Damage>,
    pub(crate) format: Box<dyn Format>,
}

/// Reader of the messages of a format.
pub(crate) trait Format: Send + Sync {
    fn imu(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<ImuSample>, Error>;
    fn fixes(&self, channel: &Channel, stamp: Stamp) -> Result<Stream<Fix>, Error>;
}
