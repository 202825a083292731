//! Contamination files (TOML) and the named ones that come with the program.
//!
//! ```toml
//! schema = 1
//! [[accel]]                        # or [[gyro]]: all axes of the sensor
//! operation = "step"               # amplitude, at_share = 0.5 | at_samples | at_s
//! replicates = [1, 2]              # default: every one
//! amplitude = [0.004, 0.003]       # one number, or one for each replicate listed
//! [[accel]]
//! operation = "replace"            # share | points, sigma, mean (default: the signal's)
//! [[accel]]
//! operation = "bursts"             # count = 5, length_samples = 500, spacing_samples = 90000, of_samples,
//!                                  # amplitude, frequency_hz = 5
//! [[accel]]
//! operation = "ar1"                # phi, sigma2
//! [[accel]]
//! operation = "scale"              # process = "RW", parameter = "gamma2", factor
//! ```
//! With `of_samples` the burst's lengths are meant for a record of so many samples and are scaled to the
//! record's length. What the operations do, and in which order: [`nav_sim_signal::noise::contamination`].

mod description;

use super::Failure;
use super::suggest::nearest;
use super::toml_file::{OneOrEach, Source};
use description::{Described, Description, Mean, RuleTable};
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::noise::contamination::{Contamination, Extent, Operation, Rule};
use nav_sim_signal::noise::{Ar1, ParameterError};
use std::num::NonZero;
use std::path::Path;

pub(crate) use description::schema;

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
        Some((name, text)) => parse(&Source::new(name, text), rate_hz),
        None => parse(&Source::read(Path::new(name_or_path))?, rate_hz),
    }
}

/// The name of a preset that was meant by what is neither a preset nor a file.
pub(crate) fn meant(name: &str) -> Option<&'static str> {
    nearest(name, names())
}

fn parse(source: &Source, rate_hz: f64) -> Result<Contamination, Failure> {
    let Description { accel, gyro, .. } = source.get()?;
    let mut rules = Vec::new();
    for (sensor, tables) in [(Sensor::Accel, accel), (Sensor::Gyro, gyro)] {
        for (i, table) in (1..).zip(&tables) {
            let key = format!("{}[{i}]", sensor.name());
            read_rules(source, sensor, key, table, rate_hz, &mut rules)?;
        }
    }
    Ok(Contamination {
        name: source.path().to_owned(),
        rules,
    })
}

fn read_rules(
    source: &Source,
    sensor: Sensor,
    key: String,
    table: &RuleTable,
    rate_hz: f64,
    into: &mut Vec<Rule>,
) -> Result<(), Failure> {
    let RuleTable {
        replicates,
        operation,
    } = table;
    if replicates.as_ref().is_some_and(Vec::is_empty) {
        return Err(source.refused(&format!("{key}.replicates"), "lists none"));
    }
    let place = format!("{}, line {}", source.path(), source.line_of(&key));
    let listed = replicates.as_ref().map_or(1, Vec::len);
    let mut entry = Entry {
        source,
        key,
        i: 0,
        listed,
    };
    for i in 0..listed {
        entry.i = i;
        let operation = entry.operation(operation, rate_hz)?;
        let replicate = replicates.as_ref().map(|r| r[i].get());
        into.push(Rule {
            sensor,
            replicate,
            operation,
            place: place.clone(),
        });
    }
    Ok(())
}

/// One replicate's share of a rule.
struct Entry<'a> {
    source: &'a Source,
    key: String,
    i: usize,
    listed: usize,
}

impl Entry<'_> {
    fn refused(&self, key: &str, reason: impl std::fmt::Display) -> Failure {
        self.source.refused(&format!("{}.{key}", self.key), reason)
    }

    /// A number, or this replicate's of a list.
    fn number<T: Copy + Into<f64>>(&self, key: &str, given: &OneOrEach<T>) -> Result<f64, Failure> {
        match given {
            OneOrEach::One(value) => Ok((*value).into()),
            OneOrEach::Each(values) if values.len() == self.listed => Ok(values[self.i].into()),
            OneOrEach::Each(values) => {
                let reason = format!("has {} values for {} replicates", values.len(), self.listed);
                Err(self.refused(key, reason))
            }
        }
    }

    fn optional<T: Copy + Into<f64>>(
        &self,
        key: &str,
        given: &Option<OneOrEach<T>>,
    ) -> Result<Option<f64>, Failure> {
        given
            .as_ref()
            .map(|given| self.number(key, given))
            .transpose()
    }

    /// Refuses more than one of several ways to say the same.
    fn at_most_one(&self, keys: &[(&str, bool)]) -> Result<(), Failure> {
        let mut given = keys.iter().filter(|(_, is_given)| *is_given);
        match (given.next(), given.next()) {
            (Some((first, _)), Some((second, _))) => {
                Err(self.refused(second, format!("says again what \"{first}\" says")))
            }
            _ => Ok(()),
        }
    }

    fn operation(&self, operation: &Described, rate_hz: f64) -> Result<Operation, Failure> {
        Ok(match operation {
            Described::Step {
                amplitude,
                at_share,
                at_samples,
                at_s,
            } => {
                self.at_most_one(&[
                    ("at_share", at_share.is_some()),
                    ("at_samples", at_samples.is_some()),
                    ("at_s", at_s.is_some()),
                ])?;
                let share = self.optional("at_share", at_share)?.unwrap_or(0.5);
                let seconds = self.optional("at_s", at_s)?;
                let samples = seconds.map(|seconds| (seconds * rate_hz).round() as u64);
                Operation::Step {
                    at: at_samples
                        .or(samples)
                        .map_or(Extent::Share(share), Extent::Samples),
                    amplitude: self.number("amplitude", amplitude)?,
                }
            }
            Described::Drift { amplitude } => Operation::Drift {
                amplitude: self.number("amplitude", amplitude)?,
            },
            Described::Replace {
                share,
                points,
                length_samples,
                sigma,
                mean,
            } => {
                self.at_most_one(&[("share", share.is_some()), ("points", points.is_some())])?;
                let points = match (points, self.optional("share", share)?) {
                    (Some(points), _) => Extent::Samples(*points),
                    (None, Some(share)) => Extent::Share(share),
                    (None, None) => {
                        return Err(self.source.missing(&self.key, &["share", "points"]));
                    }
                };
                let mean = match mean {
                    None | Some(Mean::Kept(_)) => None,
                    Some(Mean::Own(mean)) => Some(self.number("mean", mean)?),
                };
                Operation::Replace {
                    points,
                    block: Extent::Samples(length_samples.map_or(1, NonZero::get)),
                    mean,
                    sigma: self.number("sigma", sigma)?,
                }
            }
            Described::Bursts {
                count,
                length_samples,
                spacing_samples,
                of_samples,
                amplitude,
                frequency_hz,
            } => {
                let period = self.optional("of_samples", of_samples)?;
                let extent = |samples: u64| match period {
                    Some(period) => Extent::Share(samples as f64 / period),
                    None => Extent::Samples(samples),
                };
                let frequency_hz = self.optional("frequency_hz", frequency_hz)?;
                Operation::Bursts {
                    count: count.unwrap_or(5),
                    length: extent(length_samples.unwrap_or(500)),
                    spacing: extent(spacing_samples.unwrap_or(90_000)),
                    amplitude: self.number("amplitude", amplitude)?,
                    frequency_hz: frequency_hz.unwrap_or(5.0),
                }
            }
            Described::Ar1 { phi, sigma2 } => {
                let (phi, sigma2) = (self.number("phi", phi)?, self.number("sigma2", sigma2)?);
                let refused =
                    |e: ParameterError| self.refused(e.parameter, format!("is not {}", e.domain));
                Operation::Ar1(Ar1::new(phi, sigma2).map_err(refused)?)
            }
            Described::HeavyTails { freedom, sigma } => Operation::HeavyTails {
                freedom: self.number("freedom", freedom)?,
                sigma: self.number("sigma", sigma)?,
            },
            Described::Scale {
                process,
                parameter,
                factor,
            } => Operation::Scale {
                process: process.clone(),
                parameter: parameter.clone(),
                factor: self.number("factor", factor)?,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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

    fn refusal(text: &str) -> String {
        let e = parse(&Source::new("c.toml", text), 100.0).unwrap_err();
        format!("{e} | {}", e.advice().unwrap_or_default())
    }

    /// The paper's items, by the numbers printed there.
    #[test]
    fn presets_are_the_papers() {
        assert!(rules("section5-I", Sensor::Accel, 1).is_empty());
        let half = Extent::Share(0.5);
        let (points, block) = (Extent::Share(0.01), Extent::Samples(1));
        let replace = |sigma| Operation::Replace {
            points,
            block,
            mean: None,
            sigma,
        };
        let second = rules("section5-II", Sensor::Accel, 6);
        assert_eq!(
            second[0],
            Operation::Step {
                at: half,
                amplitude: 0.0060
            }
        );
        assert_eq!(second[1], replace(0.16));
        assert_eq!(second.len(), 3);
        assert_eq!(
            rules("section5-II", Sensor::Gyro, 7)[0],
            Operation::Step {
                at: half,
                amplitude: 0.00055
            }
        );
        assert_eq!(rules("section5-II", Sensor::Gyro, 7)[1], replace(0.026));

        let abnormal = rules("section5-III", Sensor::Accel, 8);
        assert_eq!(
            abnormal[0],
            Operation::Step {
                at: half,
                amplitude: 0.0045
            }
        );
        assert_eq!(abnormal[1], replace(0.18));
        assert_eq!(
            abnormal[3],
            Operation::Ar1(Ar1::new(0.975_761, 3.397_832e-7).unwrap())
        );
        let abnormal = rules("section5-III", Sensor::Gyro, 5);
        assert_eq!(abnormal[1], replace(0.026));
        assert_eq!(
            abnormal[3],
            Operation::Ar1(Ar1::new(0.976_658_0, 5.313_189e-9).unwrap())
        );
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
            assert!(x.iter().all(|v| v.is_finite()) && x[n - 1] > 0.0005);
        }
    }

    #[test]
    fn a_file_says_the_same_in_other_units() {
        let text = "[[gyro]]\noperation = \"step\"\nat_s = 2\namplitude = 1\n[[gyro]]\noperation = \"replace\"\npoints = 7\nsigma = 1\nmean = 3.0\n";
        let rules = parse(&Source::new("c.toml", text), 50.0).unwrap().rules;
        assert_eq!(
            rules[0].operation,
            Operation::Step {
                at: Extent::Samples(100),
                amplitude: 1.0
            }
        );
        assert_eq!(rules[0].replicate, None);
        let (points, block) = (Extent::Samples(7), Extent::Samples(1));
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
        let step = |keys: &str| refusal(&format!("[[accel]]\noperation = \"step\"\n{keys}\n"));
        assert_eq!(
            step("amplitud = 1"),
            "c.toml, line 3: unknown key \"accel[1].amplitud\" | did you mean \"amplitude\"?"
        );
        assert_eq!(
            step("at_s = 1"),
            "c.toml, line 1: \"accel[1].amplitude\" is missing | add the key \"accel[1].amplitude\""
        );
        assert_eq!(
            step("at_s = -1\namplitude = 1"),
            "c.toml, line 3: \"accel[1].at_s\" = -1 is not a finite number ≥ 0 | "
        );
        assert_eq!(
            step("at_s = 1\nat_share = 0.5\namplitude = 1"),
            "c.toml, line 3: \"accel[1].at_s\" = 1 says again what \"at_share\" says | "
        );
        assert_eq!(
            step("amplitude = [1, 2]\nreplicates = [1, 2, 3]"),
            "c.toml, line 3: \"accel[1].amplitude\" = [1, 2] has 2 values for 3 replicates | "
        );
        assert_eq!(
            step("amplitude = 1\nreplicates = [0]"),
            "c.toml, line 4: \"accel[1].replicates\" = 0 is not a whole number ≥ 1 | "
        );
        assert_eq!(
            refusal("[[gyro]]\noperation = \"jump\"\n"),
            "c.toml, line 2: \"gyro[1].operation\" = \"jump\" is not one of \"step\", \"drift\", \"replace\", \"bursts\", \"ar1\", \"heavy-tails\", \"scale\" | "
        );
        assert_eq!(
            refusal("[[gyro]]\noperation = \"replace\"\nsigma = 1\n"),
            "c.toml, line 1: \"gyro[1].share\" or \"gyro[1].points\" is missing | add the key \"gyro[1].share\" or \"gyro[1].points\""
        );
        assert_eq!(
            refusal("[[gyro]]\noperation = \"ar1\"\nphi = 1\nsigma2 = 1\n"),
            "c.toml, line 3: \"gyro[1].phi\" = 1 is not between −1 and 1 (exclusive) | "
        );
        assert_eq!(
            refusal("[[gyro]]\noperation = \"heavy-tails\"\nfreedom = 2\nsigma = 1\n"),
            "c.toml, line 3: \"gyro[1].freedom\" = 2 is not a finite number > 2 | "
        );
        assert_eq!(
            refusal(
                "[[gyro]]\noperation = \"replace\"\npoints = 9\nsigma = 1\nlength_samples = 0\n"
            ),
            "c.toml, line 5: \"gyro[1].length_samples\" = 0 is not a whole number ≥ 1 | "
        );
        assert_eq!(meant("section5-2"), Some("section5-I"));
    }
}
