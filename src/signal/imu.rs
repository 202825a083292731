//! Inertial samples and static recordings.

use glam::DVec3;
use std::fmt;

/// Highest sample rate accepted (Hz): above any inertial sensor's, and a bound on what one run can hold.
pub const MAX_RATE_HZ: f64 = 100_000.0;

/// Kind of inertial sensor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Sensor {
    /// Accelerometer (m/s²).
    #[default]
    Accel,
    /// Gyroscope (rad/s).
    Gyro,
}

crate::named!(Sensor { Accel = "accel", Gyro = "gyro" }, in files);

impl Sensor {
    /// Unit of a sample.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Accel => "m/s²",
            Self::Gyro => "rad/s",
        }
    }
}

/// Axis of the sensor triad (body frame: front, right, down).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// Front.
    X,
    /// Right.
    Y,
    /// Down.
    Z,
}

crate::named!(Axis { X = "x", Y = "y", Z = "z" }, in files);

/// One of the six signals of an IMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Channel {
    /// The sensor.
    pub sensor: Sensor,
    /// The axis of the sensor.
    pub axis: Axis,
}

impl Channel {
    /// All six channels: accelerometer x, y, z, gyroscope x, y, z.
    pub const ALL: [Self; 6] = {
        let mut all = [Self {
            sensor: Sensor::Accel,
            axis: Axis::X,
        }; 6];
        let mut i = 0;
        while i < 6 {
            all[i] = Self {
                sensor: Sensor::ALL[i / 3],
                axis: Axis::ALL[i % 3],
            };
            i += 1;
        }
        all
    };
    /// Position in [`Channel::ALL`].
    pub const fn index(self) -> usize {
        self.sensor as usize * 3 + self.axis as usize
    }

    /// Channels that a word stands for: `all`, a sensor (`accel`), an axis of both sensors (`x`) or one
    /// channel (`accel.x`); none for any other.
    pub fn named(word: &str) -> Vec<Self> {
        let meant = |c: &Self| {
            word == "all"
                || word == c.sensor.name()
                || word == c.axis.name()
                || word == c.to_string()
        };
        Self::ALL.into_iter().filter(meant).collect()
    }
}

impl fmt::Display for Channel {
    /// `accel.x`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.sensor.name(), self.axis.name())
    }
}

/// Mean angular rate and specific force over one sample interval (t_{k−1}, t_k].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuSample {
    /// Angular rate of b with respect to i, in b (rad/s).
    pub omega_ib_b: DVec3,
    /// Specific force of b, in b (m/s²).
    pub f_ib_b: DVec3,
}

impl ImuSample {
    /// Component vector of one sensor: specific force (m/s²) or angular rate (rad/s).
    pub const fn of(&self, sensor: Sensor) -> DVec3 {
        match sensor {
            Sensor::Accel => self.f_ib_b,
            Sensor::Gyro => self.omega_ib_b,
        }
    }
}

/// One recorded sample: what the sensors summed up over an interval that ends at `t_s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuIncrement {
    /// End of the interval (s).
    pub t_s: f64,
    /// Length of the interval (s).
    pub dt_s: f64,
    /// ∫ omega_ib dt in the axes of the sensor (rad).
    pub dtheta: DVec3,
    /// ∫ f_ib dt in the axes of the sensor (m/s).
    pub dv: DVec3,
}

/// One signal of a static recording, its mean removed.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// The channel.
    pub channel: Channel,
    /// The mean that was removed: gravity, Earth rate, turn-on bias (m/s² or rad/s).
    pub mean: f64,
    /// The samples less their mean (m/s² or rad/s).
    pub samples: Vec<f64>,
}

/// One static replicate: some or all of the six channels at one rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// File name or other label.
    pub name: String,
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// The signals, in the order of [`Channel::ALL`], all of the same length.
    pub signals: Vec<Signal>,
}

impl Recording {
    /// The signal of a channel, if recorded.
    pub fn signal(&self, channel: Channel) -> Option<&Signal> {
        self.signals.iter().find(|s| s.channel == channel)
    }
    /// Samples per signal.
    pub fn len(&self) -> usize {
        self.signals.first().map_or(0, |s| s.samples.len())
    }
    /// Returns true if it holds no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
