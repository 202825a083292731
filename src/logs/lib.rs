//! Logs of inertial sensors and GNSS receivers. A [`Log`] is a file with its channels; one that holds samples of an IMU
//! or fixes of a receiver is read in SI units; of the file no more is held than a chunk.
//!
//! | format | feature | samples | fixes |
//! |---|---|---|---|
//! | MCAP (ROS 2, ROS 1) | `mcap` | `sensor_msgs/Imu` | `sensor_msgs/NavSatFix` |
//! | ROS 1 bag 2.0 | `bag` | `sensor_msgs/Imu` | `sensor_msgs/NavSatFix` |
//! | PX4 ULog | `ulog` | `sensor_combined`, `vehicle_imu` | `vehicle_gps_position`, `sensor_gps` |
//! | u-blox UBX | `ubx` | ESF-MEAS | NAV-PVT |
//! | NumPy .npz | `npz` | arrays by name, in the module of that name | |
//!
//! All features are on by default. [`recognise()`] tells these formats, and others that are not read, by their first
//! bytes. The opening example is that of [`Log`].

#![cfg_attr(
    not(all(
        feature = "mcap",
        feature = "bag",
        feature = "ulog",
        feature = "ubx",
        feature = "npz"
    )),
    allow(
        dead_code,
        unused_variables,
        reason = "what formats share, where some are left out"
    )
)]

// L0: errors, samples, bytes
mod bytes;
mod recognise;
mod sample;
// L1
mod error;
// L2
mod channel;
mod input;
// L3
pub mod npy;
#[cfg(feature = "npz")]
pub mod npz;
#[cfg(any(feature = "mcap", feature = "bag"))]
mod unpack;
// L4
#[cfg(any(feature = "mcap", feature = "bag"))]
mod container;
// L5: formats
#[cfg(feature = "bag")]
mod bag;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(any(feature = "mcap", feature = "bag"))]
mod ros;
#[cfg(feature = "ubx")]
mod ubx;
#[cfg(feature = "ulog")]
mod ulog;
// L6
mod log;

pub use channel::{Channel, Content};
pub use error::{Error, Fault, Place};
pub use log::{Damage, Log};
pub use recognise::{HEAD, Kind, recognise};
pub use sample::{Clock, Fix, ImuSample, Stamp, in_seconds};
