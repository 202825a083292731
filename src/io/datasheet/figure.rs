//! The figures of a datasheet and the units they are given in.

use nav_sim_signal::imu::Sensor;
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};

/// A figure of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// White noise: velocity or angle random walk, noise density.
    Noise,
    /// Bias instability: the lowest point of the Allan deviation.
    Bias,
    /// Correlation time of the bias.
    CorrelationTime,
    /// Rate random walk.
    Walk,
    /// Constant bias of a switching-on: its repeatability from one to the next.
    TurnOn,
    /// Initial tolerance of the zero offset, which is measured and removed before use.
    Offset,
    /// Scale-factor error.
    Scale,
}

nav_sim_signal::named!(Figure {
    Noise = "noise", Bias = "bias", CorrelationTime = "corr_time", Walk = "walk", TurnOn = "turn_on", Offset = "offset", Scale = "scale"
});

/// Units as people write them, each with what one of it is in SI; ppm for scale factors.
type Units = &'static [(&'static str, f64)];

const ACCEL_NOISE: Units = &[
    ("m/s/sqrt(h)", 1.0 / 60.0),
    ("m/s/sqrt(s)", 1.0),
    ("ft/s/sqrt(h)", 0.3048 / 60.0),
    ("m/s²/sqrt(Hz)", 1.0),
    ("mg/sqrt(Hz)", 1e-3 * STANDARD_GRAVITY),
    ("ug/sqrt(Hz)", 1e-6 * STANDARD_GRAVITY),
];
const GYRO_NOISE: Units = &[
    ("deg/sqrt(h)", DEG / 60.0),
    ("deg/sqrt(s)", DEG),
    ("deg/s/sqrt(Hz)", DEG),
    ("mdeg/s/sqrt(Hz)", 1e-3 * DEG),
    ("deg/h/sqrt(Hz)", DEG_PER_HOUR),
    ("rad/sqrt(s)", 1.0),
    ("rad/s/sqrt(Hz)", 1.0),
];
const ACCELERATION: Units = &[
    ("ug", 1e-6 * STANDARD_GRAVITY),
    ("mg", 1e-3 * STANDARD_GRAVITY),
    ("mGal", 1e-5),
    ("m/s²", 1.0),
];
const RATE: Units = &[
    ("deg/h", DEG_PER_HOUR),
    ("deg/s", DEG),
    ("mdeg/s", 1e-3 * DEG),
    ("rad/s", 1.0),
];
const ACCEL_WALK: Units = &[
    ("m/s²/sqrt(s)", 1.0),
    ("m/s²/sqrt(h)", 1.0 / 60.0),
    ("m/s³/sqrt(Hz)", 1.0),
    ("mg/sqrt(h)", 1e-3 * STANDARD_GRAVITY / 60.0),
    ("ug/sqrt(h)", 1e-6 * STANDARD_GRAVITY / 60.0),
];
const GYRO_WALK: Units = &[
    ("deg/h/sqrt(h)", DEG_PER_HOUR / 60.0),
    ("deg/s/sqrt(s)", DEG),
    ("deg/s/sqrt(h)", DEG / 60.0),
    ("rad/s/sqrt(s)", 1.0),
    ("rad/s²/sqrt(Hz)", 1.0),
];
const TIME: Units = &[("s", 1.0), ("min", 60.0), ("h", 3600.0)];
const RATIO: Units = &[("ppm", 1.0), ("%", 1e4)];

impl Figure {
    /// The units it may be given in.
    pub(crate) const fn units(self, sensor: Sensor) -> Units {
        match (self, sensor) {
            (Self::Noise, Sensor::Accel) => ACCEL_NOISE,
            (Self::Noise, Sensor::Gyro) => GYRO_NOISE,
            (Self::Bias | Self::TurnOn | Self::Offset, Sensor::Accel) => ACCELERATION,
            (Self::Bias | Self::TurnOn | Self::Offset, Sensor::Gyro) => RATE,
            (Self::Walk, Sensor::Accel) => ACCEL_WALK,
            (Self::Walk, Sensor::Gyro) => GYRO_WALK,
            (Self::CorrelationTime, _) => TIME,
            (Self::Scale, _) => RATIO,
        }
    }
}

/// The largest figure (SI, ppm for scale factors).
const MOST: f64 = 1e12;

/// A figure as given, and what it is in SI (ppm for scale factors).
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// As given: "0.34 deg/sqrt(h)".
    pub given: String,
    /// In SI.
    pub value: f64,
}

impl Quantity {
    /// A number and one of the units; °, µ, √, ², dps and hr are read too.
    ///
    /// # Errors
    /// When there is no positive number, no unit, or one that does not fit.
    pub(crate) fn parse(text: &str, units: Units) -> Result<Self, String> {
        let given = text.trim();
        // of "0.5e-3 deg/h" the longest beginning that is a number; 'e' may begin no unit here
        let end = given
            .find(|c: char| !(c.is_ascii_digit() || ".+-eE".contains(c)))
            .unwrap_or(given.len());
        let (number, unit) = (&given[..end], given[end..].trim());
        let fitting = || {
            units
                .iter()
                .map(|(name, _)| *name)
                .collect::<Vec<_>>()
                .join(", ")
        };
        let number = number
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite() && *x > 0.0);
        let Some(number) = number else {
            return Err(format!(
                "does not begin with a number > 0, such as 0.1 {}",
                units[0].0
            ));
        };
        if unit.is_empty() {
            return Err(format!("has no unit; units that fit: {}", fitting()));
        }
        match units.iter().find(|(name, _)| plain(name) == plain(unit)) {
            Some((_, factor)) if number * factor > MOST => Err(format!(
                "is more than {MOST:e} in SI units, which no sensor has"
            )),
            Some((_, factor)) => Ok(Self {
                given: given.to_owned(),
                value: number * factor,
            }),
            None => Err(format!(
                "has the unit {unit}, which does not fit; units that fit: {}",
                fitting()
            )),
        }
    }
}

/// A unit without the freedom of its spelling.
fn plain(unit: &str) -> String {
    let bare = |c: &char| !c.is_whitespace() && !"()".contains(*c);
    let mut text = unit.chars().filter(bare).collect::<String>().to_lowercase();
    for (written, meant) in [
        ("µ", "u"),
        ("μ", "u"),
        ("°", "deg"),
        ("º", "deg"),
        ("²", "2"),
        ("³", "3"),
        ("^", ""),
        ("dps", "deg/s"),
        ("fps", "ft/s"),
        ("hr", "h"),
        ("√", "sqrt"),
        ("/rthz", "/sqrthz"),
        ("/rth", "/sqrth"),
        ("/rts", "/sqrts"),
    ] {
        text = text.replace(written, meant);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(sensor: Sensor, figure: Figure, text: &str) -> Result<f64, String> {
        Quantity::parse(text, figure.units(sensor))
            .map(|q| q.value)
            .map_err(|e| e.to_string())
    }

    /// Each unit against its definition, written out independently of the table.
    #[test]
    fn units_are_what_they_are_defined_as() {
        let (g, deg) = (9.806_65, std::f64::consts::PI / 180.0);
        let cases = [
            (Sensor::Accel, Figure::Noise, "0.06 m/s/√h", 0.001),
            (Sensor::Accel, Figure::Noise, "60 µg/√Hz", 60e-6 * g),
            (Sensor::Accel, Figure::Noise, "60 ug/rtHz", 60e-6 * g),
            (Sensor::Gyro, Figure::Noise, "0.6 deg/rt(hr)", 0.01 * deg),
            (Sensor::Accel, Figure::Noise, "0.14mg/sqrt(Hz)", 0.14e-3 * g),
            (Sensor::Accel, Figure::Noise, "1e-3 (m/s²)/sqrt(Hz)", 1e-3),
            (
                Sensor::Accel,
                Figure::Noise,
                "0.065 fps/sqrt(hr)",
                0.065 * 0.3048 / 60.0,
            ),
            (Sensor::Gyro, Figure::Noise, "0.6 °/√hr", 0.01 * deg),
            (
                Sensor::Gyro,
                Figure::Noise,
                "0.01 deg/s/sqrt(Hz)",
                0.01 * deg,
            ),
            (Sensor::Gyro, Figure::Noise, "10 mdps/√Hz", 0.01 * deg),
            (Sensor::Gyro, Figure::Noise, "2 dps/√Hz", 2.0 * deg),
            (Sensor::Gyro, Figure::Noise, "36 °/h/√Hz", 0.01 * deg),
            (Sensor::Gyro, Figure::Noise, "1.5E-5 rad/s/sqrt(Hz)", 1.5e-5),
            (Sensor::Accel, Figure::Bias, "40 ug", 40e-6 * g),
            (Sensor::Accel, Figure::TurnOn, "2 mg", 2e-3 * g),
            (Sensor::Accel, Figure::Bias, "13 mGal", 13e-5),
            (Sensor::Accel, Figure::TurnOn, "0.1 m/s^2", 0.1),
            (Sensor::Gyro, Figure::Bias, "10 °/h", 10.0 * deg / 3600.0),
            (Sensor::Gyro, Figure::TurnOn, "0.2 deg/s", 0.2 * deg),
            (
                Sensor::Gyro,
                Figure::Walk,
                "6 deg/h/sqrt(h)",
                6.0 * deg / 3600.0 / 60.0,
            ),
            (Sensor::Accel, Figure::Walk, "60 ug/sqrt(h)", 1e-6 * g),
            (Sensor::Gyro, Figure::CorrelationTime, "5 min", 300.0),
            (Sensor::Accel, Figure::CorrelationTime, "2 h", 7200.0),
            (Sensor::Accel, Figure::Scale, "0.05 %", 500.0),
        ];
        for (sensor, figure, text, expected) in cases {
            let value = parse(sensor, figure, text).unwrap();
            assert!(
                (value / expected - 1.0).abs() < 1e-14,
                "{text}: {value:e} {expected:e}"
            );
        }
    }

    /// A number in any unit, written and read in any other that fits, is the same number.
    #[test]
    fn units_round_trip() {
        for sensor in Sensor::ALL {
            for (figure, from, to) in Figure::ALL.into_iter().flat_map(|figure| {
                let units = figure.units(sensor);
                units
                    .iter()
                    .flat_map(move |from| units.iter().map(move |to| (figure, from, to)))
            }) {
                let converted = parse(sensor, figure, &format!("0.3 {}", from.0)).unwrap() / to.1;
                let back =
                    parse(sensor, figure, &format!("{converted:e} {}", to.0)).unwrap() / from.1;
                assert!((back / 0.3 - 1.0).abs() < 1e-14, "{} {}", from.0, to.0);
            }
        }
    }

    #[test]
    fn what_is_no_figure_is_refused_with_the_units_that_fit() {
        let fitting = "units that fit: deg/h, deg/s, mdeg/s, rad/s";
        let refused = |text| parse(Sensor::Gyro, Figure::Bias, text).unwrap_err();
        assert_eq!(refused("10"), format!("has no unit; {fitting}"));
        assert_eq!(
            refused("10 ug"),
            format!("has the unit ug, which does not fit; {fitting}")
        );
        assert_eq!(
            refused("1e300 deg/s"),
            "is more than 1e12 in SI units, which no sensor has"
        );
        for text in [
            "",
            "deg/h",
            "-1 deg/h",
            "0 deg/h",
            "1e999 deg/h",
            "nan deg/h",
            "1.2.3 deg/h",
        ] {
            assert_eq!(
                refused(text),
                "does not begin with a number > 0, such as 0.1 deg/h",
                "{text}"
            );
        }
    }
}
