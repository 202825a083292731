//! Outage sets, one by one and swept.

use super::error::DescriptionError;
use super::rules::{MAX_CELLS, exactly_one};
use crate::formats::toml_file::OneOrEach;
use nav_sim_navigation::sensors::outage::{Outage, OutagePlan, PeriodicOutages, RandomOutages};
use nav_sim_signal::units::{Positive, SettingError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A number or a list of numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a number or a list of numbers")]
pub(crate) enum OneOrMany {
    /// One.
    One(f64),
    /// Several.
    Many(Vec<f64>),
}

impl OneOrMany {
    fn values(&self) -> &[f64] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Many(values) => values,
        }
    }
}

/// A window of each start and duration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sweep {
    /// First instants without a fix (s).
    pub start_s: OneOrMany,
    /// Durations (s).
    #[schemars(with = "OneOrEach<Positive>")]
    pub duration_s: OneOrMany,
}

/// Regular outages of each combination.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Periodic {
    /// Start of the first (s).
    pub first_s: OneOrMany,
    /// From one start to the next (s).
    #[schemars(with = "OneOrEach<Interval>")]
    pub every_s: OneOrMany,
    /// Length of each (s).
    #[schemars(with = "OneOrEach<Positive>")]
    pub duration_s: OneOrMany,
}

/// Random outages of each combination.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Random {
    /// Outages per hour of time with fixes.
    #[schemars(with = "OneOrEach<PerHour>")]
    pub rate_per_hour: OneOrMany,
    /// Length of each (s).
    #[schemars(with = "OneOrEach<Positive>")]
    pub duration_s: OneOrMany,
}

/// In schemas, what [`PeriodicOutages`] accepts.
#[derive(JsonSchema)]
#[schemars(inline)]
#[expect(dead_code, reason = "what describes files, for editors")]
struct Interval(#[schemars(range(min = PeriodicOutages::LEAST_INTERVAL_S))] f64);

/// In schemas, what [`RandomOutages`] accepts.
#[derive(JsonSchema)]
#[schemars(inline)]
#[expect(dead_code, reason = "what describes files, for editors")]
struct PerHour(#[schemars(with = "Positive", range(max = RandomOutages::MOST_PER_HOUR))] f64);

/// `[[outages]]`: one of `windows`, `sweep`, `periodic`, `random`. The latter three take numbers or lists
/// of numbers and make one set for each combination.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OutagesEntry {
    /// Name in the results; a sweep adds its values: `name(300,60)`.
    #[serde(default)]
    pub name: String,
    /// Windows one by one, together one set; an empty list is the set without outages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub windows: Option<Vec<Outage>>,
    /// A window of each start and duration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    /// Regular outages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub periodic: Option<Periodic>,
    /// Random outages, drawn once a set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub random: Option<Random>,
}

/// One outage set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OutageSet {
    /// Its name.
    pub name: String,
    /// Its windows.
    pub plan: OutagePlan,
}

/// The sets an entry stands for.
pub(super) fn expand(
    entry: &OutagesEntry,
    index: usize,
) -> Result<Vec<OutageSet>, DescriptionError> {
    let said = [
        entry.windows.is_some(),
        entry.sweep.is_some(),
        entry.periodic.is_some(),
        entry.random.is_some(),
    ];
    let key = format!("outages[{}]", index + 1);
    exactly_one(key.clone(), &said, "windows, sweep, periodic, random")?;
    let swept = swept(entry);
    let axes = swept.iter().flat_map(|(axes, _)| axes);
    let sets = axes.fold(1_usize, |n, axis| n.saturating_mul(axis.values().len()));
    if sets > MAX_CELLS {
        let reason = format!("makes more than {MAX_CELLS} outage sets");
        return Err(DescriptionError::refused(&key, sets, reason));
    }
    let sets = match (&entry.windows, swept) {
        (Some(windows), _) => {
            vec![(
                OutagePlan {
                    fixed: windows.clone(),
                    ..OutagePlan::default()
                },
                Vec::new(),
            )]
        }
        (None, Some((axes, plan))) => product(&axes)
            .into_iter()
            .map(|values| (plan(&values), values))
            .collect(),
        (None, None) => Vec::new(),
    };
    if sets.is_empty() {
        return Err(DescriptionError::Empty { axis: key });
    }
    let several = sets.len() > 1;
    let named = |(plan, values): (OutagePlan, Vec<f64>)| {
        plan.validate()
            .map_err(|e| refused(entry, &key, &values, e))?;
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        let name = if several {
            format!("{}({})", entry.name, values.join(","))
        } else {
            entry.name.clone()
        };
        Ok(OutageSet { name, plan })
    };
    sets.into_iter().map(named).collect()
}

/// The refusal of a value by the key that the entry has it under, of which a plan knows other names.
fn refused(entry: &OutagesEntry, key: &str, values: &[f64], e: SettingError) -> DescriptionError {
    // a window that does not end after its start has no length
    let e = match (&entry.sweep, values) {
        (Some(_), [_, duration_s]) if e.key.ends_with("end_s") => SettingError::new(
            "sweep.duration_s",
            duration_s,
            "it must be a finite number > 0",
        ),
        _ => e,
    };
    let fixed = if entry.sweep.is_some() {
        ("outage[1]", "sweep")
    } else {
        ("outage[", "windows[")
    };
    let names = [
        fixed,
        ("outage_periodic", "periodic"),
        ("outage_random", "random"),
    ];
    let written = names.iter().fold(e.key, |name, (of_plan, of_entry)| {
        name.replace(of_plan, of_entry)
    });
    DescriptionError::refused(
        &format!("{key}.{written}"),
        e.value,
        format!("is refused: {}", e.requirement),
    )
}

/// What an entry is swept over, and the outages of one combination.
type Swept<'a> = (Vec<&'a OneOrMany>, fn(&[f64]) -> OutagePlan);

fn swept(entry: &OutagesEntry) -> Option<Swept<'_>> {
    match (&entry.sweep, &entry.periodic, &entry.random) {
        (Some(s), ..) => Some((vec![&s.start_s, &s.duration_s], |v| OutagePlan {
            fixed: vec![Outage {
                start_s: v[0],
                end_s: v[0] + v[1],
            }],
            ..OutagePlan::default()
        })),
        (_, Some(p), _) => Some((vec![&p.first_s, &p.every_s, &p.duration_s], |v| {
            OutagePlan {
                periodic: Some(PeriodicOutages {
                    first_s: v[0],
                    every_s: v[1],
                    duration_s: v[2],
                }),
                ..OutagePlan::default()
            }
        })),
        (.., Some(r)) => Some((vec![&r.rate_per_hour, &r.duration_s], |v| OutagePlan {
            random: Some(RandomOutages {
                rate_per_hour: v[0],
                duration_s: v[1],
            }),
            ..OutagePlan::default()
        })),
        _ => None,
    }
}

/// Every combination of values, the last axis fastest.
fn product(axes: &[&OneOrMany]) -> Vec<Vec<f64>> {
    let mut combinations: Vec<Vec<f64>> = vec![Vec::new()];
    for axis in axes {
        let longer = |c: &Vec<f64>| {
            axis.values()
                .iter()
                .map(|v| [&c[..], &[*v]].concat())
                .collect::<Vec<_>>()
        };
        combinations = combinations.iter().flat_map(longer).collect();
    }
    combinations
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_value_is_told_by_its_key() {
        let positive = "it must be a finite number > 0";
        let cases = [
            (
                "windows = [{ start_s = 25, end_s = 24 }]",
                "windows[1].end_s",
                "24",
                "it must come after start_s = 25",
            ),
            (
                "sweep = { start_s = [300, 400], duration_s = [10, 0] }",
                "sweep.duration_s",
                "0",
                positive,
            ),
            (
                "sweep = { start_s = 300, duration_s = -4 }",
                "sweep.duration_s",
                "-4",
                positive,
            ),
            (
                "sweep = { start_s = 300, duration_s = nan }",
                "sweep.duration_s",
                "NaN",
                positive,
            ),
            (
                "sweep = { start_s = inf, duration_s = 4 }",
                "sweep.start_s",
                "inf",
                "it must be a finite number",
            ),
            (
                "periodic = { first_s = 10, every_s = 100, duration_s = [5, 0] }",
                "periodic.duration_s",
                "0",
                positive,
            ),
            (
                "random = { rate_per_hour = 4, duration_s = [0, 4] }",
                "random.duration_s",
                "0",
                positive,
            ),
        ];
        for (text, key, value, requirement) in cases {
            let entry: OutagesEntry = toml::from_str(text).unwrap();
            let refusal = expand(&entry, 0).unwrap_err().to_string();
            assert_eq!(
                refusal,
                format!("\"outages[1].{key}\" = {value} is refused: {requirement}")
            );
        }
    }
}
