//! Quantities by the names of their columns.
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
//! | ArduPilot | `TimeUS`, `GyrX`, `AccX`: SI |
//! | Sensor Logger | `time`, `seconds_elapsed`, `z`, `y`, `x` in `Gyroscope.csv`: SI |
//! | Nav Sensor Recorder | `TimestampAcc [ns]`, `AccX [m/s^2]` |
//! | loggers | `ax_mps2`, `gx_radps`, `gyro_x_dps`, `acc_x [mg]`, … |

use nav_sim_navigation::earth::MAX_LATITUDE_DEG;
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};

/// Endings of names, between blanks, each with the SI units in one of that.
pub(crate) type Units = &'static [(&'static str, f64)];

pub(crate) const NONE: Units = &[];
pub(crate) const TIME: Units = &[
    ("s sec secs second seconds", 1.0),
    ("ms msec millis millisec milliseconds 0_001_s", 1e-3),
    ("us usec micros microsec microseconds", 1e-6),
    ("ns nsec nanos nanosec nanoseconds", 1e-9),
];
pub(crate) const ACCELERATION: Units = &[
    ("m_s2 m_s_2 m_s_s mps2 ms2 ms_2 m_sec2 m_sec_2", 1.0),
    ("g", STANDARD_GRAVITY),
    ("mg", 1e-3 * STANDARD_GRAVITY),
    ("ug", 1e-6 * STANDARD_GRAVITY),
];
pub(crate) const ANGULAR_RATE: Units = &[
    ("rad_s rad_s_1 radps rads rad_sec", 1.0),
    ("mrad_s mradps", 1e-3),
    ("deg_s deg_s_1 degps dps deg_sec", DEG),
    ("mdeg_s mdps", 1e-3 * DEG),
    ("deg_h deg_h_1 deg_hr dph", DEG_PER_HOUR),
];
pub(crate) const ANGLE: Units = &[("deg", DEG), ("rad", 1.0)];
const LENGTH: Units = &[("m", 1.0)];
pub(crate) const SPEED: Units = &[
    ("m_s mps m_s_1 m_sec", 1.0),
    ("km_h kmh kph kmph km_hr", 1.0 / 3.6),
    ("mph mi_h", 0.447_04),
];

/// Meaning of a name without a unit.
#[derive(Debug, Clone, Copy)]
pub(crate) enum DefaultUnit {
    /// The quantity in such a unit.
    Is(f64),
    /// The quantity in a unit that is to be found out.
    Unknown,
    /// Something else.
    Not,
}

/// Ends of a range, and the reason for which what is beyond them is refused.
pub(crate) type Range = (f64, f64, &'static str);
pub(crate) const LATITUDE: Range = (
    -MAX_LATITUDE_DEG,
    MAX_LATITUDE_DEG,
    "is not a latitude within ±89.9",
);
pub(crate) const LONGITUDE: Range = (-180.0, 360.0, "is not a longitude");

/// A quantity that a column may hold.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Quantity {
    pub(crate) name: &'static str,
    /// Names without their unit and axis, between blanks; `stamp*` is all that begins so.
    pub(crate) stems: &'static str,
    /// Last part of the name before the unit, with or without an underscore: x, y, z.
    pub(crate) axis: &'static str,
    pub(crate) units: Units,
    pub(crate) bare: DefaultUnit,
    /// Sign of what the file has.
    pub(crate) sign: f64,
    /// Preference among columns of the quantity; without it there may be but one.
    pub(crate) rank: Option<u8>,
    /// True if it is an increment over the sample.
    pub(crate) per_sample: bool,
    /// Numbers that it may be (SI).
    pub(crate) range: Option<Range>,
}

impl Quantity {
    pub(crate) const fn new(
        name: &'static str,
        stems: &'static str,
        units: Units,
        bare: DefaultUnit,
    ) -> Self {
        Self {
            name,
            stems,
            axis: "",
            units,
            bare,
            sign: 1.0,
            rank: None,
            per_sample: false,
            range: None,
        }
    }

    /// An angle: degrees where the name does not say it.
    pub(crate) const fn angle(name: &'static str, stems: &'static str) -> Self {
        Self::new(name, stems, ANGLE, DefaultUnit::Is(DEG))
    }

    /// A length (m).
    pub(crate) const fn length(name: &'static str, stems: &'static str) -> Self {
        Self::new(name, stems, LENGTH, DefaultUnit::Is(1.0))
    }

    /// A speed (m/s).
    pub(crate) const fn speed(name: &'static str, stems: &'static str) -> Self {
        Self::new(name, stems, SPEED, DefaultUnit::Is(1.0))
    }

    /// A number.
    pub(crate) const fn number(name: &'static str, stems: &'static str) -> Self {
        Self::new(name, stems, NONE, DefaultUnit::Is(1.0))
    }

    /// The time (s).
    pub(crate) const fn time(stems: &'static str) -> Self {
        Self {
            rank: Some(0),
            ..Self::new("t_s", stems, TIME, DefaultUnit::Is(1.0))
        }
    }

    /// The quantity limited to a range (degrees).
    pub(crate) const fn within(self, (low, high, reason): Range) -> Self {
        Self {
            range: Some((low * DEG - 1e-9, high * DEG + 1e-9, reason)),
            ..self
        }
    }

    /// The quantity, above 0, as a standard deviation is; the squares of smaller ones are no numbers to divide by.
    pub(crate) const fn positive(self) -> Self {
        const REASON: &str = "is not a standard deviation > 0";
        Self {
            range: Some((1e-9, f64::MAX, REASON)),
            ..self
        }
    }

    /// The quantity, whose unit must be stated.
    pub(crate) const fn with_unit(self) -> Self {
        Self {
            bare: DefaultUnit::Not,
            ..self
        }
    }

    /// The quantity in the other direction.
    pub(crate) const fn reversed(self, stems: &'static str) -> Self {
        Self {
            sign: -1.0,
            stems,
            ..self
        }
    }

    fn has_stem(&self, stem: &str) -> bool {
        let Some(stem) = stem.strip_suffix(self.axis) else {
            return false;
        };
        let is_axis = !self.axis.is_empty();
        let is = |own: &str, stem: &str| {
            let begin = own.strip_suffix('*');
            own == stem || begin.is_some_and(|begin| stem.starts_with(begin))
        };
        let has = |stem: &str| self.stems.split(' ').any(|own| is(own, stem));
        has(stem) || is_axis && has(stem.trim_end_matches('_'))
    }

    /// The factor of a column of this name, of none without a unit; nothing of another quantity.
    fn factor(&self, plain: &str) -> Option<Option<f64>> {
        let endings = self
            .units
            .iter()
            .flat_map(|(names, factor)| names.split(' ').map(move |name| (name, *factor)));
        let stem = |ending: &str| plain.strip_suffix(ending)?.strip_suffix('_');
        let mut with_unit =
            endings.filter(|(ending, _)| stem(ending).is_some_and(|s| self.has_stem(s)));
        match (with_unit.next(), self.bare) {
            (Some((_, factor)), _) => Some(Some(self.sign * factor)),
            (None, DefaultUnit::Is(factor)) if self.has_stem(plain) => {
                Some(Some(self.sign * factor))
            }
            (None, DefaultUnit::Unknown) if self.has_stem(plain) => Some(None),
            _ => None,
        }
    }

    /// True if a name is that of an axis and something else, such as `accel_x_ft_s2`.
    pub(super) fn is_in_unknown_unit(&self, plain: &str) -> bool {
        let rest_of = |stem: &str| {
            let rest = plain.strip_prefix(stem)?.trim_start_matches('_');
            let unit = rest.strip_prefix(self.axis)?.strip_prefix('_')?;
            // `a_x_…` may be anything; `ax_…` is an accelerometer
            let is_clear = stem.len() > 1 || !plain[1..].starts_with('_');
            (is_clear && !unit.is_empty()).then_some(())
        };
        !self.axis.is_empty() && self.stems.split(' ').any(|stem| rest_of(stem).is_some())
    }
}

/// Quantity of a name, and its factor to SI.
pub(crate) fn find(
    quantities: &'static [Quantity],
    name: &str,
) -> Option<(&'static Quantity, Option<f64>)> {
    let plain = normalised(name);
    quantities
        .iter()
        .find_map(|quantity| Some((quantity, quantity.factor(&plain)?)))
}

/// Lower case; every other character than letters and digits becomes one `_` between words.
pub(crate) fn normalised(name: &str) -> String {
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
