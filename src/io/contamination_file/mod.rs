//! Contamination files (TOML) and the named ones that come with the program.
//!
//! ```toml
//! schema = 1
//! [[accel]]                        # or [[gyro]]: all axes of the sensor
//! operation = "step"               # amplitude, at_share = 0.5 | at_s
//! replicates = [1, 2]              # default: every one
//! amplitude = [0.004, 0.003]       # one number, or one for each replicate listed
//! [[accel]]
//! operation = "replace"            # share, sigma, mean (default: the signal's)
//! [[accel]]
//! operation = "bursts"             # count = 5, length_samples = 500, spacing_samples = 90000, of_samples,
//!                                  # amplitude, frequency_hz = 5
//! [[accel]]
//! operation = "ar1"                # phi, sigma2
//! [[accel]]
//! operation = "scale"              # process = "RW", parameter = "gamma2", factor
//! ```
//! With `of_samples` the burst's lengths are meant for a record of this many samples and are scaled to the
//! record's length. What the operations do, and in which order: [`nav_sim_signal::noise::contamination`].

use super::Failure;
use super::file_kind::{self, FileKind};
use super::suggest::nearest;
use super::toml_file::TomlSource;
use crate::io::toml_file::OneOrEach;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::Process;
use nav_sim_signal::noise::contamination::{Contamination, Extent, Operation, Rule};
use nav_sim_signal::units::{Between, NonNegative, Positive, Share, Stationary};
use schemars::JsonSchema;
use serde::Deserialize;
use std::num::NonZero;
use std::path::Path;

/// Names and texts of the contaminations that come with the program.
const PRESETS: [(&str, &str); 6] = [
    ("section4-I", "schema = 1\n"),
    (
        "section4-II",
        include_str!("../../../calib_data/contamination/section4-II.toml"),
    ),
    (
        "section4-III",
        include_str!("../../../calib_data/contamination/section4-III.toml"),
    ),
    ("section5-I", "schema = 1\n"),
    (
        "section5-II",
        include_str!("../../../calib_data/contamination/section5-II.toml"),
    ),
    (
        "section5-III",
        include_str!("../../../calib_data/contamination/section5-III.toml"),
    ),
];

/// Names of the contaminations that come with the program: the scenarios of
/// [Minaretzis](nav_sim_signal::bibliography::Minaretzis24), Sections IV and V.
#[must_use]
pub fn names() -> [&'static str; 6] {
    PRESETS.map(|(name, _)| name)
}

/// The contamination of a name, or of a file where there is none of that name.
///
/// # Errors
/// When the file cannot be read or is refused.
pub fn find(name_or_path: &str, rate_hz: f64) -> Result<Contamination, Failure> {
    match PRESETS.iter().find(|(name, _)| *name == name_or_path) {
        Some((name, text)) => parse(&TomlSource::new(name, text), rate_hz),
        None => {
            let path = Path::new(name_or_path);
            let refused = |e| file_kind::or_wrong_kind(&[FileKind::Contamination], path, e);
            parse(&TomlSource::read(path)?, rate_hz).map_err(refused)
        }
    }
}

/// The name of a preset that was meant by what is neither a preset nor a file.
pub(crate) fn nearest_preset(name: &str) -> Option<&'static str> {
    nearest(name, names())
}

fn parse(source: &TomlSource, rate_hz: f64) -> Result<Contamination, Failure> {
    let ContaminationTable { accel, gyro, .. } = source.get()?;
    // the same by the names of keys
    let named = source.table()?;
    let mut rules = Vec::new();
    for (sensor, tables) in [(Sensor::Accel, accel), (Sensor::Gyro, gyro)] {
        for (number, table) in (1..).zip(&tables) {
            let key = format!("{}[{number}]", sensor.name());
            let replicates = table.replicates.as_ref();
            let listed = replicates.map_or(1, Vec::len);
            let values = named[sensor.name()][number - 1].as_table();
            for (name, value) in values.into_iter().flatten() {
                // what replaces samples may have no spread
                let is_size = match name.as_str() {
                    "amplitude" | "share" | "sigma2" => true,
                    "sigma" => matches!(table.operation, OperationTable::HeavyTails { .. }),
                    _ => false,
                };
                let is_zero = |value: &toml::Value| {
                    value.as_integer() == Some(0) || value.as_float() == Some(0.0)
                };
                let is_nothing = match value.as_array() {
                    Some(values) => values.iter().all(is_zero),
                    None => is_zero(value),
                };
                if is_size && is_nothing {
                    let reason = "must not be 0";
                    return Err(source.refused(&format!("{key}.{name}"), reason));
                }
                let count = value.as_array().map_or(listed, Vec::len);
                if count != listed || value.is_array() && replicates.is_none() {
                    let reason = match replicates {
                        Some(_) => format!("has {count} values for {listed} replicates"),
                        None => "is a list, but no \"replicates\" are listed".to_owned(),
                    };
                    return Err(source.refused(&format!("{key}.{name}"), reason));
                }
            }
            for i in 0..listed {
                rules.push(Rule {
                    sensor,
                    replicate: replicates.map(|r| r[i].get()),
                    operation: operation(source, &key, &table.operation, i, rate_hz)?,
                    place: format!("{}, line {}", source.path(), source.line_of(&key)),
                });
            }
        }
    }
    Ok(Contamination {
        name: source.path().to_owned(),
        rules,
    })
}

/// The share of the i-th replicate in a rule.
fn operation(
    source: &TomlSource,
    key: &str,
    described: &OperationTable,
    i: usize,
    rate_hz: f64,
) -> Result<Operation, Failure> {
    let refused = |name: &str, reason: String| source.refused(&format!("{key}.{name}"), reason);
    Ok(match described {
        OperationTable::Step {
            amplitude,
            at_share,
            at_s,
        } => {
            if at_share.is_some() && at_s.is_some() {
                return Err(refused("at_s", "repeats \"at_share\"".to_owned()));
            }
            let share = at_share.as_ref().map_or(0.5, |share| share.of(i));
            let samples = at_s.as_ref().map(|s| (s.of(i) * rate_hz).round() as u64);
            Operation::Step {
                at: samples.map_or(Extent::Share(share), Extent::Samples),
                amplitude: amplitude.of(i),
            }
        }
        OperationTable::Drift { amplitude } => Operation::Drift {
            amplitude: amplitude.of(i),
        },
        OperationTable::Replace {
            share,
            length_samples,
            sigma,
            mean,
        } => Operation::Replace {
            points: Extent::Share(share.of(i)),
            block: Extent::Samples(length_samples.map_or(1, NonZero::get)),
            mean: mean.as_ref().map(|mean| mean.of(i)),
            sigma: sigma.of(i),
        },
        OperationTable::Bursts {
            count,
            length_samples,
            spacing_samples,
            of_samples,
            amplitude,
            frequency_hz,
        } => {
            let extent = |samples: u64| match of_samples {
                Some(period) => Extent::Share(samples as f64 / period.of(i)),
                None => Extent::Samples(samples),
            };
            Operation::Bursts {
                count: count.map_or(5, NonZero::get),
                length: extent(length_samples.map_or(500, NonZero::get)),
                spacing: extent(spacing_samples.map_or(90_000, NonZero::get)),
                amplitude: amplitude.of(i),
                frequency_hz: frequency_hz.as_ref().map_or(5.0, |hz| hz.of(i)),
            }
        }
        OperationTable::Ar1 { phi, sigma2 } => {
            let made = Process::ar1(phi.of(i), sigma2.of(i));
            Operation::Ar1(made.map_err(|e| refused(e.parameter, format!("is not {}", e.domain)))?)
        }
        OperationTable::HeavyTails { freedom, sigma } => Operation::HeavyTails {
            freedom: freedom.of(i),
            sigma: sigma.of(i),
        },
        OperationTable::Scale {
            process,
            parameter,
            factor,
        } => Operation::Scale {
            process: process.clone(),
            parameter: parameter.clone(),
            factor: factor.of(i),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::tests::{answers, told};
    use nav_sim_signal::imu::{Axis, Channel};

    fn rules(name: &str, sensor: Sensor, replicate: u64) -> Vec<Operation> {
        let applies =
            |r: &Rule| r.sensor == sensor && r.replicate.is_none_or(|only| only == replicate);
        find(name, 100.0)
            .unwrap()
            .rules
            .into_iter()
            .filter(applies)
            .map(|r| r.operation)
            .collect()
    }

    /// The paper's items, by the numbers printed there.
    #[test]
    fn presets_are_the_papers() {
        assert!(rules("section5-I", Sensor::Accel, 1).is_empty());
        let step = |amplitude| Operation::Step {
            at: Extent::Share(0.5),
            amplitude,
        };
        let ar1 = |phi, sigma2| Operation::Ar1(Process::ar1(phi, sigma2).unwrap());
        let (points, block) = (Extent::Share(0.01), Extent::Samples(1));
        let replace = |sigma| Operation::Replace {
            points,
            block,
            mean: None,
            sigma,
        };
        let of_accel = rules("section5-II", Sensor::Accel, 6);
        assert_eq!(
            (&of_accel[..2], of_accel.len()),
            (&[step(0.0060), replace(0.16)][..], 3)
        );
        let of_gyro = rules("section5-II", Sensor::Gyro, 7);
        assert_eq!(of_gyro[..2], [step(0.00055), replace(0.026)]);
        let abnormal = rules("section5-III", Sensor::Accel, 8);
        assert_eq!(abnormal[..2], [step(0.0045), replace(0.18)]);
        assert_eq!(abnormal[3], ar1(0.975_761, 3.397_832e-7));
        let abnormal = rules("section5-III", Sensor::Gyro, 5);
        assert_eq!(abnormal[1], replace(0.026));
        assert_eq!(abnormal[3], ar1(0.976_658_0, 5.313_189e-9));
        assert_eq!(rules("section5-III", Sensor::Gyro, 2)[1], replace(0.022));
        for replicate in [1, 2, 4, 5, 6, 7] {
            let rules_of = |name| rules(name, Sensor::Accel, replicate);
            assert_eq!(
                rules_of("section5-III"),
                rules_of("section5-II"),
                "{replicate}"
            );
        }

        let bursts = |replicate| rules("section4-III", Sensor::Accel, replicate).len();
        assert_eq!([1, 2, 3, 4, 8].map(bursts), [3, 3, 3, 2, 3]);
        let (process, parameter) = ("RW".to_owned(), "gamma2".to_owned());
        let scale = Operation::Scale {
            process,
            parameter,
            factor: 4.0,
        };
        assert_eq!(rules("section4-III", Sensor::Accel, 8)[2], scale);
        for name in names() {
            assert!(
                !find(name, 100.0).unwrap().touches(9),
                "{name}: the ninth replicate stays clean"
            );
        }
    }

    #[test]
    fn presets_fit_the_papers_record_and_short_ones() {
        let channel = Channel {
            sensor: Sensor::Gyro,
            axis: Axis::Z,
        };
        for n in [524_284, 4096] {
            let mut x = vec![0.0; n];
            let preset = find("section5-III", 100.0).unwrap();
            preset.apply(&mut x, channel, 5, 100.0, 1).unwrap();
            assert!(x.iter().all(|v| v.is_finite()));
            // The step of 0.0011 stays; the mean of the AR1 over 2048 samples has a deviation of 7e-5.
            let later = &x[n / 2..];
            let mean = later.iter().sum::<f64>() / later.len() as f64;
            assert!(mean > 0.0005, "{mean}");
        }
    }

    #[test]
    fn a_file_says_the_same_in_other_units() {
        let text = "[[gyro]]\noperation = \"step\"\nat_s = 2\namplitude = 1\n[[gyro]]\noperation = \"replace\"\nshare = 0.25\nsigma = 1\nmean = 3.0\n";
        let rules = parse(&TomlSource::new("c.toml", text), 50.0).unwrap().rules;
        assert_eq!(
            rules[0].operation,
            Operation::Step {
                at: Extent::Samples(100),
                amplitude: 1.0
            }
        );
        assert_eq!(rules[0].replicate, None);
        let (points, block) = (Extent::Share(0.25), Extent::Samples(1));
        let replace = Operation::Replace {
            points,
            block,
            mean: Some(3.0),
            sigma: 1.0,
        };
        assert_eq!(rules[1].operation, replace);
    }

    #[test]
    fn mistakes_are_named() {
        let step = [
            "amplitud = 1",
            "at_s = 1",
            "at_s = -1\namplitude = 1",
            "at_s = 1\nat_share = 0.5\namplitude = 1",
            "amplitude = [1, 2]\nreplicates = [1, 2, 3]",
            "amplitude = [1.0]",
            "amplitude = 1\nreplicates = [0]",
            "amplitude = 0",
            "amplitude = [0, 1]\nreplicates = [1, 2]",
        ];
        let other = [
            "jump\"",
            "replace\"\nsigma = 1",
            "replace\"\nshare = 0.5\nsigma = 1\nlength_samples = 0",
            "replace\"\nsigma = 1\nshare = 0.0",
            "replace\"\nshare = 0.1\nsigma = 0\nmean = 1",
            "bursts\"\namplitude = 1\ncount = 0",
            "ar1\"\nphi = 1\nsigma2 = 1",
            "ar1\"\nphi = 0.5\nsigma2 = 0.0",
            "heavy-tails\"\nfreedom = 2\nsigma = 1",
            "heavy-tails\"\nfreedom = 3\nsigma = 0.0",
            "drift\"\namplitude = 0.0",
        ];
        let step = step.map(|keys| format!("[[accel]]\noperation = \"step\"\n{keys}"));
        let other = other.map(|keys| format!("[[gyro]]\noperation = \"{keys}"));
        let read = |text: &String| parse(&TomlSource::new("c.toml", text), 100.0);
        insta::assert_snapshot!(answers(
            step.iter()
                .chain(&other)
                .map(|text| (text, read(text).map_err(|e| told(&e))))
        ));
        assert_eq!(nearest_preset("section5-2"), Some("section5-I"));
    }
}

// What contamination files hold: one description an operation, for readers and for editors.

/// Errors and disturbances put into recordings: nav-sim synthesize --contaminate
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Contamination")]
struct ContaminationTable {
    /// Version of the layout
    #[serde(rename = "schema")]
    #[schemars(range(min = 1, max = 1))]
    _schema: Option<u64>,
    /// Rules for all axes of the accelerometers
    #[serde(default)]
    accel: Vec<RuleTable>,
    /// Rules for all axes of the gyroscopes
    #[serde(default)]
    gyro: Vec<RuleTable>,
}

/// Contamination of the signals of a sensor
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct RuleTable {
    /// Replicates, counted from 1 (default: every one)
    #[schemars(length(min = 1))]
    replicates: Option<Vec<NonZero<u64>>>,
    #[serde(flatten)]
    operation: OperationTable,
}

/// The operations of files, each with its keys.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", tag = "operation")]
enum OperationTable {
    /// A jump of the mean
    Step {
        /// Height of the step (units of the signal)
        amplitude: OneOrEach<f64>,
        /// Position in the record, as a share of it (default: 0.5)
        at_share: Option<OneOrEach<Share>>,
        /// Position in the record (s)
        at_s: Option<OneOrEach<NonNegative>>,
    },
    /// A drift over the whole record
    Drift {
        /// Value at the end of the record (units of the signal)
        amplitude: OneOrEach<f64>,
    },
    /// Samples replaced by outliers
    Replace {
        /// Share of the samples
        share: OneOrEach<Share>,
        /// Samples replaced together (default: 1)
        length_samples: Option<NonZero<u64>>,
        /// Standard deviation of what replaces them
        sigma: OneOrEach<NonNegative>,
        /// Mean of what replaces them (default: the signal's)
        mean: Option<OneOrEach<f64>>,
    },
    /// Bursts of vibration
    Bursts {
        /// Number of bursts (default: 5)
        count: Option<NonZero<u64>>,
        /// Length of a burst (samples; default: 500)
        length_samples: Option<NonZero<u64>>,
        /// From one burst to the next (samples; default: 90000)
        spacing_samples: Option<NonZero<u64>>,
        /// Length of the record that these are meant for (samples; default: as it is)
        of_samples: Option<OneOrEach<AtLeastOne>>,
        /// Amplitude (units of the signal)
        amplitude: OneOrEach<f64>,
        /// Frequency (Hz; default: 5)
        frequency_hz: Option<OneOrEach<Positive>>,
    },
    /// A first-order autoregression on top
    Ar1 {
        /// Coefficient
        phi: OneOrEach<Stationary>,
        /// Innovation variance per sample
        sigma2: OneOrEach<NonNegative>,
    },
    /// Noise with heavy tails on top
    HeavyTails {
        /// Degrees of freedom, more than 2
        freedom: OneOrEach<AboveTwo>,
        /// Scale of Student's t (units of the signal)
        sigma: OneOrEach<NonNegative>,
    },
    /// A parameter of the model, scaled
    Scale {
        /// Process of the model, such as RW
        process: String,
        /// Its parameter, such as gamma2
        parameter: String,
        /// Factor on the signal
        factor: OneOrEach<NonNegative>,
    },
}

/// Degrees of freedom with a variance.
type AboveTwo = Between<2, { i64::MAX }, true>;
type AtLeastOne = Between<1, { i64::MAX }, false>;

/// The JSON schema of such a file.
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(ContaminationTable).to_value()
}
