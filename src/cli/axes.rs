//! Signals by name, as `--axes` takes them.

use nav_sim_signal::imu::Channel;

/// What one word of `--axes` stands for.
#[derive(Debug, Clone)]
pub(super) struct ChannelSet(pub(super) Vec<Channel>);

impl ChannelSet {
    /// `all`, a sensor (`accel`), an axis of both sensors (`x`) or one channel (`accel.x`).
    pub(super) fn named(word: &str) -> Result<Self, String> {
        let found = Channel::named(word);
        match found.as_slice() {
            [] => Err("not all, accel, gyro, x, y, z, or one channel such as accel.x".into()),
            _ => Ok(Self(found)),
        }
    }
}
