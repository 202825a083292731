//! What a column is, by its name.
//!
//! | written by | names |
//! |---|---|
//! | this program | `t_s`, `accel_x_m_s2`, `gyro_x_rad_s`; increments `dv_x_m_s`, `dtheta_x_rad` |
//! | EuRoC, TUM-VI | `#timestamp [ns]`, `w_RS_S_x [rad s^-1]`, `a_RS_S_x [m s^-2]` |
//! | Kalibr, ROS | `timestamp`, `omega_x`, `alpha_x`; `field.header.stamp`, `field.angular_velocity.x` |
//! | x-io | `Time (s)`, `Gyroscope X (deg/s)`, `Accelerometer X (g)` |
//! | gnss-ins-sim | `accel_x (m/s^2)`, `gyro_x (deg/s)` |
//! | Xsens MT Manager | `PacketCounter`, `SampleTimeFine`, `Acc_X`, `Gyr_X` below a `//` head: SI |
//! | GNSS/INS units | `gps_week`, `tow_s`; `iTOW`; `gps_time` |
//! | ArduPilot | `TimeUS` |
//! | loggers | `ax_mps2`, `gx_radps`, `gyro_x_dps`, `acc_x [mg]`, … |

use super::error::{COLUMNS, no_unit, shown};
use crate::formats::{FileError, Kind, Setting};
use nav_sim_signal::imu::{Axis, Channel, Sensor};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};

/// What a column is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Role {
    /// Time, with its unit in seconds if that is known.
    Time {
        /// Seconds in one unit.
        unit_s: Option<f64>,
    },
    /// A packet counter that starts again at 0 after 65535.
    Counter,
    /// A clock of 0.1 ms ticks that starts again at 0 after 2³² − 1.
    Ticks,
    /// A signal.
    Signal {
        /// Which.
        channel: Channel,
        /// Its unit.
        unit: Unit,
    },
}

/// The unit of a signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Unit {
    /// That many SI units.
    Si(f64),
    /// That many SI units, per sample interval.
    Increment(f64),
    /// Not said: m/s², g or mg, to be told from gravity.
    FromGravity,
}

/// A column that was recognised.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub(super) index: usize,
    pub(super) name: String,
    pub(super) role: Role,
}

/// The columns of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub(super) found: Vec<Found>,
    pub(super) ignored: Vec<String>,
}

/// Where a header stands, for messages.
#[derive(Debug, Clone, Copy)]
pub(super) struct HeaderPlace<'a> {
    pub(super) path: &'a str,
    pub(super) line: u64,
}

impl HeaderPlace<'_> {
    fn refuse(self, message: String) -> FileError {
        FileError::contents(self.path, self.line, message)
    }
}

/// Endings of time columns and their length in seconds.
const TIME_UNITS: &[(&[&str], f64)] = &[
    (&["s", "sec", "secs", "second", "seconds"], 1.0),
    (&["ms", "msec", "millis", "milliseconds"], 1e-3),
    (&["us", "usec", "micros", "microseconds"], 1e-6),
    (&["ns", "nsec", "nanos", "nanoseconds"], 1e-9),
];
/// Endings of accelerometer columns and their size in m/s².
const ACCEL_UNITS: &[(&[&str], f64)] = &[
    (
        &[
            "m_s2", "m_s_2", "m_s_s", "mps2", "ms2", "ms_2", "m_sec2", "m_sec_2",
        ],
        1.0,
    ),
    (&["g"], STANDARD_GRAVITY),
    (&["mg"], 1e-3 * STANDARD_GRAVITY),
    (&["ug"], 1e-6 * STANDARD_GRAVITY),
];
/// Endings of gyroscope columns and their size in rad/s.
const GYRO_UNITS: &[(&[&str], f64)] = &[
    (&["rad_s", "rad_s_1", "radps", "rads", "rad_sec"], 1.0),
    (&["mrad_s", "mradps"], 1e-3),
    (&["deg_s", "deg_s_1", "degps", "dps", "deg_sec"], DEG),
    (&["mdeg_s", "mdps"], 1e-3 * DEG),
    (&["deg_h", "deg_h_1", "deg_hr", "dph"], DEG_PER_HOUR),
];
/// Names before the axis letter.
const ACCEL: &[&str] = &[
    "accel",
    "acc",
    "accelerometer",
    "acceleration",
    "specific_force",
    "lin_acc",
    "a",
    "f",
    "raw_acc",
];
const GYRO: &[&str] = &[
    "gyro",
    "gyr",
    "gyroscope",
    "angular_rate",
    "ang_vel",
    "g",
    "w",
    "raw_gyro",
];
/// Names before the axis letter that mean SI by convention.
const ACCEL_SI: &[&str] = &[
    "linear_acceleration",
    "field_linear_acceleration",
    "a_rs_s",
    "alpha",
];
const GYRO_SI: &[&str] = &[
    "angular_velocity",
    "field_angular_velocity",
    "w_rs_s",
    "omega",
];
const TIME: &[&str] = &[
    "t",
    "time",
    "timestamp",
    "time_stamp",
    "elapsed",
    "elapsed_time",
    "epoch",
];
/// Times whose names hold their unit, and the length of that (s).
const TIME_IN: &[(&str, f64)] = &[("timeus", 1e-6), ("timems", 1e-3), ("itow", 1e-3)];
/// Time of a receiver, of the week or not: the last to be taken, because it may be that of its last fix.
const GPS_TIME: &[&str] = &[
    "tow",
    "gps_tow",
    "gpstow",
    "time_of_week",
    "gps_time_of_week",
    "sow",
    "gps_sow",
    "seconds_of_week",
    "second_of_week",
    "gps_seconds_of_week",
    "gps_seconds",
    "gps_time",
    "gpstime",
    "gps_timestamp",
];
/// Time of measurement, preferred to the time of arrival beside it.
const STAMP: &[&str] = &["field_header_stamp", "header_stamp", "stamp"];

/// What a name means; `si` if the file's kind says that unit-less names are SI.
///
/// None if it means nothing here; an error with the name if a gyroscope's unit is not said.
pub(in crate::formats) fn classify(name: &str, si: bool) -> Option<Result<Role, ()>> {
    let name = normalise(name);
    match name.as_str() {
        "packetcounter" | "packet_counter" => return Some(Ok(Role::Counter)),
        "sampletimefine" => return Some(Ok(Role::Ticks)),
        _ => {}
    }
    let is_time = |stem: &str| {
        [TIME, STAMP, GPS_TIME]
            .iter()
            .any(|names| names.contains(&stem))
    };
    if is_time(&name) {
        return Some(Ok(Role::Time { unit_s: None }));
    }
    if let Some((_, unit)) = TIME_IN.iter().find(|(own, _)| *own == name) {
        return Some(Ok(Role::Time {
            unit_s: Some(*unit),
        }));
    }
    if let Some((stem, unit)) = split_unit(&name, TIME_UNITS)
        && is_time(stem)
    {
        return Some(Ok(Role::Time { unit_s: Some(unit) }));
    }
    increment(&name).or_else(|| signal(&name, si))
}

fn signal(name: &str, si: bool) -> Option<Result<Role, ()>> {
    for (sensor, units) in [(Sensor::Accel, ACCEL_UNITS), (Sensor::Gyro, GYRO_UNITS)] {
        if let Some((stem, factor)) = split_unit(name, units)
            && let Some((axis, _)) = stem_axis(stem, sensor)
        {
            let channel = Channel { sensor, axis };
            return Some(Ok(Role::Signal {
                channel,
                unit: Unit::Si(factor),
            }));
        }
        if let Some((axis, convention)) = stem_axis(name, sensor) {
            let channel = Channel { sensor, axis };
            return Some(match sensor {
                _ if si || convention => Ok(Role::Signal {
                    channel,
                    unit: Unit::Si(1.0),
                }),
                Sensor::Accel => Ok(Role::Signal {
                    channel,
                    unit: Unit::FromGravity,
                }),
                Sensor::Gyro => Err(()),
            });
        }
    }
    None
}

fn increment(name: &str) -> Option<Result<Role, ()>> {
    for axis in Axis::ALL {
        for (stem, sensor, factor) in [
            (format!("dv_{}_m_s", axis.name()), Sensor::Accel, 1.0),
            (format!("dv_{}_mps", axis.name()), Sensor::Accel, 1.0),
            (format!("dtheta_{}_rad", axis.name()), Sensor::Gyro, 1.0),
            (format!("dtheta_{}_deg", axis.name()), Sensor::Gyro, DEG),
        ] {
            if name == stem {
                let channel = Channel { sensor, axis };
                return Some(Ok(Role::Signal {
                    channel,
                    unit: Unit::Increment(factor),
                }));
            }
        }
    }
    None
}

/// Lower case; every other character than letters and digits becomes one `_` between words.
pub(in crate::formats) fn normalise(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars().flat_map(char::to_lowercase) {
        match c {
            '°' => out.push_str("deg"),
            '²' => out.push('2'),
            'µ' | 'μ' => out.push('u'),
            c if c.is_ascii_alphanumeric() => out.push(c),
            _ if out.is_empty() || out.ends_with('_') => {}
            _ => out.push('_'),
        }
    }
    out.trim_end_matches('_').to_owned()
}

/// The name without its unit, and the unit; the longest ending wins.
pub(in crate::formats) fn split_unit<'a>(
    name: &'a str,
    units: &[(&[&str], f64)],
) -> Option<(&'a str, f64)> {
    let endings = units
        .iter()
        .flat_map(|(names, factor)| names.iter().map(move |n| (*n, *factor)));
    let stem = |ending: &str| name.strip_suffix(ending)?.strip_suffix('_');
    let hits = endings.filter_map(|(ending, factor)| stem(ending).map(|s| (s, factor)));
    hits.min_by_key(|(stem, _)| stem.len())
}

/// The channel of a name such as `accel_x_ft_s2`: a sensor, an axis, and something else.
fn in_unknown_unit(name: &str) -> Option<Channel> {
    let channel_of_stem = |sensor: Sensor, stem: &str| {
        let rest = name.strip_prefix(stem)?.trim_start_matches('_');
        let axis = Axis::ALL.into_iter().find(|a| rest.starts_with(a.name()))?;
        let unit = rest[1..].strip_prefix('_')?;
        // `a_x_…` may be anything; `ax_…` is an accelerometer.
        let clear = stem.len() > 1 || !name[1..].starts_with('_');
        (clear && !unit.is_empty()).then_some(Channel { sensor, axis })
    };
    let stems = [(Sensor::Accel, ACCEL), (Sensor::Gyro, GYRO)];
    let mut all = stems
        .into_iter()
        .flat_map(|(sensor, names)| names.iter().map(move |n| (sensor, *n)));
    all.find_map(|(sensor, stem)| channel_of_stem(sensor, stem))
}

/// The axis of a signal's name, and whether the name means SI by convention.
fn stem_axis(stem: &str, sensor: Sensor) -> Option<(Axis, bool)> {
    let axis = Axis::ALL.into_iter().find(|a| stem.ends_with(a.name()))?;
    let name = stem[..stem.len() - 1].trim_end_matches('_');
    let (free, convention) = match sensor {
        Sensor::Accel => (ACCEL, ACCEL_SI),
        Sensor::Gyro => (GYRO, GYRO_SI),
    };
    let si = convention.contains(&name);
    (si || free.contains(&name)).then_some((axis, si))
}

impl Layout {
    /// The columns with a meaning among `names`, of the `wanted` channels (all if none are given).
    pub(super) fn new(
        place: HeaderPlace<'_>,
        names: &[String],
        si: bool,
        wanted: Option<&[Channel]>,
    ) -> Result<Self, FileError> {
        let (mut found, mut ignored): (Vec<Found>, Vec<String>) = (Vec::new(), Vec::new());
        let mut without_unit = None;
        for (index, name) in names.iter().enumerate() {
            let name = name.trim().to_owned();
            match classify(&name, si) {
                Some(Ok(Role::Signal { channel, .. }))
                    if wanted.is_some_and(|w| !w.contains(&channel)) =>
                {
                    ignored.push(name);
                }
                Some(Ok(role)) => found.push(Found { index, name, role }),
                Some(Err(())) => without_unit = without_unit.or(Some(name)),
                None => ignored.push(name),
            }
        }
        if let Some(column) = without_unit {
            return Err(no_unit(place.path, place.line, &column));
        }
        let mut layout = Self { found, ignored };
        layout.one_time_column();
        layout.no_channel_twice(place)?;
        layout.no_unknown_unit(place, wanted)?;
        if !layout
            .found
            .iter()
            .any(|f| matches!(f.role, Role::Signal { .. }))
        {
            let quoted: Vec<String> = names
                .iter()
                .take(20)
                .map(|n| format!("\"{}\"", shown(n.trim(), 40)))
                .collect();
            let message = format!(
                "no accelerometer or gyroscope column among {}",
                quoted.join(", ")
            );
            return Err(
                FileError::new(place.path, place.line, Kind::Columns(message.into()))
                    .advice(COLUMNS)
                    .setting(Setting::ColumnNames),
            );
        }
        Ok(layout)
    }

    /// Keeps one time column: the stamp of the measurement, else one whose unit is known, else the first.
    fn one_time_column(&mut self) {
        let rank = |f: &Found| match f.role {
            Role::Time { .. } if STAMP.iter().any(|s| normalise(&f.name).starts_with(s)) => Some(0),
            Role::Time { .. } if GPS_TIME.iter().any(|s| normalise(&f.name).starts_with(s)) => {
                Some(3)
            }
            Role::Time { unit_s: Some(_) } => Some(1),
            Role::Time { unit_s: None } => Some(2),
            _ => None,
        };
        let best = self
            .found
            .iter()
            .filter_map(|f| rank(f).map(|r| (r, f.index)))
            .min();
        let (kept, passed): (Vec<Found>, Vec<Found>) = std::mem::take(&mut self.found)
            .into_iter()
            .partition(|f| rank(f).is_none() || best.is_some_and(|(_, index)| f.index == index));
        self.found = kept;
        self.ignored.extend(passed.into_iter().map(|f| f.name));
    }

    /// A column that is an axis by its name but in a unit that is not known must not be dropped in silence: unless
    /// another column is that axis, or it is not wanted.
    fn no_unknown_unit(
        &self,
        place: HeaderPlace<'_>,
        wanted: Option<&[Channel]>,
    ) -> Result<(), FileError> {
        let refuse = |name: &str, endings: &str| {
            place
                .refuse(format!("column \"{name}\" is in a unit that is not known"))
                .advice(format!("end its name in one of {endings}"))
                .setting(Setting::ColumnNames)
                .setting(Setting::Channels)
        };
        let has_channel =
            |f: &Found, channel| matches!(f.role, Role::Signal { channel: c, .. } if c == channel);
        for name in &self.ignored {
            let plain = normalise(name);
            for (stem, endings) in [("dv_", "_m_s, _mps"), ("dtheta_", "_rad, _deg")] {
                if ["x_", "y_", "z_"]
                    .iter()
                    .any(|axis| plain.starts_with(&format!("{stem}{axis}")))
                {
                    return Err(refuse(name, endings));
                }
            }
            let Some(channel) = in_unknown_unit(&plain) else {
                continue;
            };
            let missed = wanted.is_none_or(|w| w.contains(&channel));
            if missed && !self.found.iter().any(|f| has_channel(f, channel)) {
                let units = match channel.sensor {
                    Sensor::Accel => ACCEL_UNITS,
                    Sensor::Gyro => GYRO_UNITS,
                };
                let units: Vec<String> = units
                    .iter()
                    .map(|(names, _)| format!("_{}", names[0]))
                    .collect();
                return Err(refuse(name, &units.join(", ")));
            }
        }
        Ok(())
    }

    fn no_channel_twice(&self, place: HeaderPlace<'_>) -> Result<(), FileError> {
        for channel in Channel::ALL {
            let of_channel =
                |f: &&Found| matches!(f.role, Role::Signal { channel: c, .. } if c == channel);
            let mut names = self.found.iter().filter(of_channel).map(|f| f.name.clone());
            if let (Some(first), Some(second)) = (names.next(), names.next()) {
                let message = format!("columns \"{first}\" and \"{second}\" are both {channel}");
                return Err(place.refuse(message));
            }
        }
        Ok(())
    }
}

/// The names of an array's columns where none are given: six channels in the order of [`Channel::ALL`],
/// before them the time if there are seven.
pub(super) fn npy_order(columns: usize) -> Option<Vec<String>> {
    let six = Channel::ALL.map(column_name).to_vec();
    match columns {
        6 => Some(six),
        7 => Some([vec!["t_s".to_owned()], six].concat()),
        _ => None,
    }
}

/// The name of a channel's column in files of this program.
pub(crate) fn column_name(channel: Channel) -> String {
    let unit = match channel.sensor {
        Sensor::Accel => "m_s2",
        Sensor::Gyro => "rad_s",
    };
    format!("{}_{}_{unit}", channel.sensor.name(), channel.axis.name())
}

#[cfg(test)]
mod tests;
