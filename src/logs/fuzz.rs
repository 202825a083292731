//! Entries for fuzzing: each reads all that a file holds, and must not panic.

use crate::input::Origin;
use crate::log::Log;
use crate::{Content, Kind, Stamp};

fn log(kind: Kind, bytes: &[u8]) {
    let Ok(log) = Log::of_kind(kind, Origin::Bytes(bytes.into())) else {
        return;
    };
    for channel in log.channels() {
        let topic = Some(channel.topic.as_str());
        match channel.content {
            Content::Imu => _ = log.imu(topic, Stamp::Header).map(Iterator::count),
            Content::Fix => _ = log.fixes(topic, Stamp::Log).map(Iterator::count),
            Content::Other => {}
        }
    }
}

/// Reads an MCAP.
pub fn mcap(bytes: &[u8]) {
    log(Kind::Mcap, bytes);
}

/// Reads a ROS 1 bag.
pub fn bag(bytes: &[u8]) {
    log(Kind::Bag, bytes);
}

/// Reads a ULog.
pub fn ulog(bytes: &[u8]) {
    log(Kind::Ulog, bytes);
}

/// Reads messages of u-blox.
pub fn ubx(bytes: &[u8]) {
    log(Kind::Ubx, bytes);
}

/// Reads all arrays of an archive.
#[cfg(feature = "npz")]
pub fn npz(bytes: &[u8]) {
    if let Ok(archive) = crate::npz::Archive::from_bytes(bytes) {
        archive.names().for_each(|name| _ = archive.read(name));
    }
}
