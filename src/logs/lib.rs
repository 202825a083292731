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
    allow(dead_code, unused_variables, reason = "shared by formats")
)]

// L0: bytes and errors
mod input;
// L1: channels and samples
mod channel;
// L2: arrays
pub mod npy;
#[cfg(feature = "npz")]
pub mod npz;
// L3: formats
#[cfg(any(feature = "mcap", feature = "bag"))]
mod container;
#[cfg(feature = "ubx")]
mod ubx;
#[cfg(feature = "ulog")]
mod ulog;
// L4
mod log;

pub use channel::{Clock, Content, ImuReading, LogChannel, LogFix, Stamp, in_seconds};
pub use input::{HEAD, LogError, LogFault, LogFormat, recognise};
pub use log::{Log, Truncation};
