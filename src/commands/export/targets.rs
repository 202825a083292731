//! The programs that parameters are written for: a template each, and the one substitution that fills them.
//!
//! `{gyro.N deg/sqrt(h)}` is white noise in that unit. A placeholder is `{QUANTITY [UNIT] [in LOW..HIGH] [else TEXT] [as KEY]}`;
//! those with a unit are the entries of the file, named by the first word of their line or by `as`. Quantities are those of
//! [`Export::quantity`], with `^2`, `*f`, `*sqrt(f)`, `*sqrt(2f)` or `/sqrt(SECONDS)` behind them; `in` clamps to the documented
//! range, `else` stands for what is not finite. `{=}` repeats the last value, `{unit}` its unit; `{head OPEN|CLOSE}` is the head of comments.

use super::{Export, ExportEntry, SensorExport};
use nav_sim_document::one_line;
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_signal::names::UnknownName;
use nav_sim_signal::noise::practical::{BiasModel, Markov};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR};
use std::str::FromStr;

/// A program that parameters are written for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Its name on the command line.
    pub name: &'static str,
    /// Role of the bias in the target's filter.
    pub(super) bias: BiasModel,
    /// True if both sensors share one correlation time.
    pub(super) has_one_time: bool,
    /// True if it flies a vehicle, whose vibration no static recording holds.
    pub(super) vibrates: bool,
    template: &'static str,
}

const WALK: Target = Target {
    name: "",
    bias: BiasModel::Walk,
    has_one_time: false,
    vibrates: false,
    template: "",
};
const MARKOV: Target = Target {
    bias: BiasModel::Markov,
    ..WALK
};

const TARGETS: [Target; 16] = [
    // Continuous-time densities, made discrete by update_rate (https://github.com/ethz-asl/kalibr/wiki/IMU-Noise-Model).
    Target {
        name: "kalibr",
        template: include_str!("templates/kalibr.yaml.in"),
        ..WALK
    },
    // The keys of Kalibr below imu0; it divides by the time step itself (https://docs.openvins.com/gs-calibration.html).
    Target {
        name: "openvins",
        template: include_str!("templates/openvins.yaml.in"),
        ..WALK
    },
    // VINS-Mono and VINS-Fusion: standard deviations of a sample, N√(2f), and of the bias's slope over one sample interval, K√f:
    // the integration multiplies both by dt (https://github.com/HKUST-Aerial-Robotics/VINS-Mono,
    // vins_estimator/src/factor/integration_base.h). Its midpoint rule gives each end of an interval half the weight and takes the
    // ends as independent from interval to interval: a velocity grows by f·2·(dt/2)²·acc_n² a second, half of what noise of that
    // deviation in every sample makes. Hence the 2.
    Target {
        name: "vins",
        template: include_str!("templates/vins.yaml.in"),
        ..WALK
    },
    // Covariances of continuous-time noise, the squares of N and K
    // (https://docs.ros.org/en/api/gtsam/html/structgtsam_1_1PreintegrationCombinedParams.html).
    Target {
        name: "gtsam",
        template: include_str!("templates/gtsam.cpp.in"),
        ..WALK
    },
    // Densities, which it squares for GTSAM, and of the biases takes times the root of the time between two nodes
    // (https://github.com/TixiaoShan/LIO-SAM, imuPreintegration.cpp).
    Target {
        name: "lio-sam",
        template: include_str!("templates/lio-sam.yaml.in"),
        ..WALK
    },
    // FAST-LIO2 and FAST-LIVO2: variances per sample, N²f and K²f: the covariance grows by (dt·f_w) Q (dt·f_w)ᵀ a sample, f times a
    // second (https://github.com/hku-mars/FAST_LIO, esekfom.hpp and IMU_Processing.hpp). What it ships is tuned to vibration.
    Target {
        name: "fast-lio",
        template: include_str!("templates/fast-lio.yaml.in"),
        ..WALK
    },
    // The nine numbers of the message: the variance of a sample's white noise, N²f. What moves slowly is no noise of a sample, and
    // the filter that reads the message estimates it as a bias (https://docs.ros.org/en/api/sensor_msgs/html/msg/Imu.html).
    Target {
        name: "ros-imu-covariance",
        template: include_str!("templates/ros-imu-covariance.yaml.in"),
        ..WALK
    },
    // EKF2 adds (dt·noise)² to the variance of velocity or angle in a step of dt, and (dt·bias noise)² to that of the bias: N/√dt
    // and K/√dt (https://docs.px4.io/main/en/advanced_config/parameter_reference.html, covariance.cpp). The units follow: the bias
    // noise is in units per second.
    Target {
        name: "px4",
        vibrates: true,
        template: include_str!("templates/px4.params.in"),
        ..WALK
    },
    // EKF3 adds (dt·noise)² to velocity and angle and (dt²·bias noise)² to biases of increments in a step of dt: N/√dt and K/√dt as
    // in PX4, with dt of 12 ms (https://ardupilot.org/copter/docs/parameters.html, AP_NavEKF3_core.cpp). Ground stations refuse a
    // line with more than a name and a value.
    Target {
        name: "ardupilot",
        vibrates: true,
        template: include_str!("templates/ardupilot.param.in"),
        ..WALK
    },
    // White noise per √h and Gauss-Markov biases of one correlation time (https://github.com/i2Nav-WHU/KF-GINS,
    // dataset/kf-gins.yaml and its unit conversions in kf_gins.cpp). It always has states of scale factors.
    Target {
        name: "kf-gins",
        has_one_time: true,
        template: include_str!("templates/kf-gins.yaml.in"),
        ..MARKOV
    },
    // SI units (https://github.com/rodralez/NaveGo). The filter drives the biases by white noise of gb_psd and ab_psd: they are
    // given as sigma √(2/T), so that the biases have the standard deviations given.
    Target {
        name: "navego",
        template: include_str!("templates/navego.m.in"),
        ..MARKOV
    },
    // The arguments of imuerrset (http://www.psins.org.cn, base/base1/imuerrset.m), with PSINS's own g0.
    Target {
        name: "psins",
        template: include_str!("templates/psins.m.in"),
        ..MARKOV
    },
    // A Gauss-Markov bias whose \"stability\" is its standard deviation (https://github.com/Aceinna/gnss-ins-sim, README and
    // imu_model.py). The constant bias is that of one standard deviation, where the model states a turn-on bias.
    Target {
        name: "gnss-ins-sim",
        template: include_str!("templates/gnss-ins-sim.py.in"),
        ..MARKOV
    },
    // SI units, root densities (https://github.com/nmayorov/pyins, pyins/inertial_sensor.py).
    Target {
        name: "pyins",
        template: include_str!("templates/pyins.py.in"),
        ..WALK
    },
    // imuSensor: with NoiseType "single-sided" a sample has NoiseDensity·√f, as here
    // (https://www.mathworks.com/help/nav/ref/gyroparams-properties.html; the default "double-sided" would want √2 N). White noise
    // of standard deviation BiasInstability through 1/(1 − phi z⁻¹) is the Gauss-Markov bias, exactly, at this rate.
    Target {
        name: "matlab",
        template: include_str!("templates/matlab.m.in"),
        ..MARKOV
    },
    // SDF: white noise of a sample, a constant bias drawn once, and a bias of each sample b ← b·exp(−dt/τ) + σ_d·w with
    // σ_d² = −s²τ/2·expm1(−2dt/τ): stationary with s²τ/2, so that s = σ√(2/τ) makes a Gauss-Markov process of σ exactly, from zero
    // at the start (https://github.com/gazebosim/gz-sensors, GaussianNoiseModel.cc). A correlation time of 0 switches it off.
    Target {
        name: "gazebo",
        template: include_str!("templates/gazebo.xml.in"),
        ..MARKOV
    },
];

impl Target {
    /// All of them.
    pub const ALL: [Self; TARGETS.len()] = TARGETS;
    /// Their names, in the same order.
    pub const NAMES: [&'static str; TARGETS.len()] = {
        let (mut names, mut i) = ([""; TARGETS.len()], 0);
        while i < TARGETS.len() {
            names[i] = TARGETS[i].name;
            i += 1;
        }
        names
    };
}

impl FromStr for Target {
    type Err = UnknownName;

    fn from_str(word: &str) -> Result<Self, UnknownName> {
        TARGETS
            .into_iter()
            .find(|target| target.name == word)
            .ok_or_else(|| UnknownName {
                word: word.to_owned(),
                legal: &Self::NAMES,
            })
    }
}

/// PSINS has a gravity of its own, `glv.g0` (m/s²); no other target has µg.
const PSINS_UG: f64 = 9.780_326_771_4e-6;
/// √3600: from per √s to per √h.
const ROOT_HOUR: f64 = 60.0;

/// A quantity in a unit of some target, from SI.
fn in_unit(x: f64, unit: &str) -> f64 {
    match unit {
        "deg/sqrt(h)" | "deg/sqrt(hr)" | "deg/rt-hr" => x / DEG * ROOT_HOUR,
        "m/s/sqrt(hr)" | "m/s/rt-hr" => x * ROOT_HOUR,
        "deg/h" | "deg/hr" => x / DEG_PER_HOUR,
        "mGal" => x / 1e-5,
        "ug" | "ug/sqrt(Hz)" => x / PSINS_UG,
        "hr" => x / 3600.0,
        "ppm" => x * 1e6,
        _ => x,
    }
}

/// A number that reads back to the same, with a point: YAML 1.1 takes `2e-5` for a text.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0.0".to_owned();
    }
    let is_plain = (1e-3..1e6).contains(&value.abs());
    let text = if is_plain {
        format!("{value}")
    } else {
        format!("{value:e}")
    };
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, ""));
    let point = if digits.contains('.') { "" } else { ".0" };
    let e = if is_plain { "" } else { "e" };
    format!("{digits}{point}{e}{exponent}")
}

/// A text that stays within its comment, whatever a file is called: no line of its own, no control sequence, no end of XML.
fn comment(text: &str) -> String {
    one_line(text).replace("--", "- -")
}

impl Export {
    /// Fills the template: the entries of the file, and its text below the comments of `head`.
    pub(super) fn filled(&self, head: &[String]) -> (Vec<ExportEntry>, String) {
        let (mut entries, mut text): (Vec<ExportEntry>, String) = (Vec::new(), String::new());
        let mut last = String::new();
        for template in self.target.template.lines() {
            let (mut line, mut rest, mut meaning) = (String::new(), template, None);
            while let Some((before, placeholder, after)) = next(rest) {
                line += before;
                let (name, argument) = placeholder.split_once(' ').unwrap_or((placeholder, ""));
                match (name, entries.last()) {
                    ("=", _) => line += &last,
                    ("f", _) => line += &self.rate_hz.to_string(),
                    ("head", _) => {
                        let (open, close) = argument.split_once('|').unwrap_or_default();
                        let comments: Vec<String> = head
                            .iter()
                            .map(|l| format!("{open}{}{close}", comment(l)))
                            .collect();
                        line += &comments.join("\n");
                    }
                    ("unit", Some(entry)) => {
                        line += entry.unit;
                        meaning = Some(line.len());
                    }
                    ("accel.unstated" | "gyro.unstated", _) => {
                        let sensor = &self.sensors[usize::from(name.starts_with('g'))];
                        if sensor.turn_on.is_none() {
                            line += "; the model states no turn-on bias";
                        }
                    }
                    ("shipped", Some(entry)) if entry.value > 0.0 => {
                        let times = nav_sim_document::readable(
                            (argument.parse().unwrap_or(f64::NAN) / entry.value).sqrt(),
                        );
                        line += &format!(
                            "; the shipped {argument} is {times} times its standard deviation"
                        );
                    }
                    ("shipped" | "unit", _) => {}
                    _ => {
                        let (shown, entry) = self.value(name, argument, &line);
                        line += &shown;
                        last = shown;
                        entries.extend(entry);
                    }
                }
                rest = after;
            }
            line += rest;
            if let (Some(start), Some(entry)) = (meaning, entries.last_mut()) {
                entry.meaning = line[start..].trim_matches([';', ' ', '-', '>']).to_owned();
            }
            text += &line;
            text.push('\n');
        }
        text.pop();
        (entries, text)
    }

    /// A value as it is written, and its entry where it has a unit; `line` stands before it.
    fn value(
        &self,
        name: &str,
        argument: &'static str,
        line: &str,
    ) -> (String, Option<ExportEntry>) {
        let words: Vec<&'static str> = argument.split(' ').collect();
        let after = |word: &str| words.iter().position(|w| *w == word).map(|i| words[i + 1]);
        let unit = words.first().copied().filter(|w| !["", "else"].contains(w));
        let asked = in_unit(self.quantity(name), unit.unwrap_or_default());
        let value = after("in")
            .and_then(|range| range.split_once(".."))
            .and_then(|(low, high)| Some((low.parse().ok()?, high.parse().ok()?)))
            .map_or(asked, |(low, high)| asked.clamp(low, high));
        let infinite = after("else").unwrap_or("Inf");
        let is_number = value.is_finite();
        let value = if is_number {
            value
        } else {
            infinite.parse().unwrap_or(value)
        };
        let key = line
            .split(|c: char| !(c.is_alphanumeric() || "._".contains(c)))
            .find(|w| !w.is_empty());
        let entry = unit.map(|unit| ExportEntry {
            key: after("as").or(key).unwrap_or_default().to_owned(),
            value,
            unit,
            meaning: String::new(),
            wanted: (value != asked && is_number).then_some(asked),
        });
        (
            if is_number {
                number(value)
            } else {
                infinite.to_owned()
            },
            entry,
        )
    }

    /// A quantity by its name (SI): `accel.N`, `gyro.K*sqrt(f)`, `rate`, a number.
    fn quantity(&self, name: &str) -> f64 {
        let (base, operation) = name.split_at(name.find(['^', '*', '/']).unwrap_or(name.len()));
        let [accel, gyro] = &self.sensors;
        let x = match base.split_once('.') {
            Some(("accel", symbol)) => accel.quantity(symbol, self.rate_hz),
            Some((_, symbol)) => gyro.quantity(symbol, self.rate_hz),
            None if base == "rate" => self.rate_hz,
            None if base == "scale" => FilterStates::Reduced21.scale_sigma(),
            None if base == "T" => accel.markov().t_corr_s.min(gyro.markov().t_corr_s),
            None => base.parse().unwrap_or(f64::NAN),
        };
        match operation {
            "" => x,
            "^2" => x * x,
            "^2*f" => x * x * self.rate_hz,
            "*sqrt(f)" => x * self.rate_hz.sqrt(),
            "*sqrt(2f)" => x * (2.0 * self.rate_hz).sqrt(),
            step => {
                x / step
                    .strip_prefix("/sqrt(")
                    .and_then(|s| s.strip_suffix(')')?.parse::<f64>().ok())
                    .unwrap_or(f64::NAN)
                    .sqrt()
            }
        }
    }
}

/// Text before the next placeholder, the placeholder, and the text behind it.
fn next(text: &'static str) -> Option<(&'static str, &'static str, &'static str)> {
    let (before, rest) = text.split_once('{')?;
    let (placeholder, after) = rest.split_once('}')?;
    Some((before, placeholder, after))
}

impl SensorExport {
    /// The Gauss-Markov bias; of no size and endless memory where the pair has none: the correlation time that a search leaves to
    /// a bias of no size means nothing.
    fn markov(&self) -> Markov {
        self.exported
            .markov
            .filter(|m| m.sigma > 0.0)
            .unwrap_or(Markov {
                sigma: 0.0,
                t_corr_s: f64::INFINITY,
            })
    }

    fn quantity(&self, symbol: &str, rate_hz: f64) -> f64 {
        let markov = self.markov();
        let samples = markov.t_corr_s * rate_hz;
        match symbol {
            "N" => self.exported.density,
            // Programs that list K beside a Gauss-Markov bias do not use it; it is that of the other pair.
            "K" => self.largest.walk.walk,
            "sigma" => markov.sigma,
            "T" => markov.t_corr_s,
            "T_or_0" if markov.sigma == 0.0 => 0.0,
            "T_or_0" => markov.t_corr_s,
            "drive" => markov.drive(),
            "phi" => (-1.0 / samples).exp(),
            // σ√(1 − phi²) without cancellation
            "step" => markov.sigma * (-(-2.0 / samples).exp_m1()).sqrt(),
            "start" => self.bias_sd,
            "turn_on" => self.turn_on.unwrap_or(0.0),
            _ => f64::NAN,
        }
    }
}
