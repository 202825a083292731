//! Motion profiles in TOML.

use crate::io::Failure;
use crate::io::toml_file::TomlSource;
use nav_sim_navigation::trajectory::Trajectory;
use nav_sim_navigation::trajectory::profile::{Bank, Profile, ProfileStart, Segment, SegmentKind};
use nav_sim_signal::units::{Between, Positive};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::Path;

/// A drive by what the vehicle does: the trajectory of nav-sim run
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Motion profile")]
struct ProfileTable {
    start: ProfileStart,
    #[serde(default)]
    vehicle: Vehicle,
    /// Segments of the motion, in order
    #[schemars(length(min = 1))]
    segment: Vec<Segment>,
}

/// Motion of the vehicle
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Vehicle {
    /// Roll in turns: level as a land vehicle (default), or as an aircraft
    bank: Bank,
    /// Time over which accelerations and rates build up and fade (s; default: 2)
    ramp_s: Positive,
}

impl Default for Vehicle {
    fn default() -> Self {
        Self {
            bank: Bank::default(),
            ramp_s: Between(2.0),
        }
    }
}

/// The JSON schema of such a file.
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(ProfileTable).to_value()
}

pub(super) fn load(path: &Path) -> Result<Trajectory, Failure> {
    build(&TomlSource::read(path)?)
}

pub(super) fn build(source: &TomlSource) -> Result<Trajectory, Failure> {
    let file: ProfileTable = source.get()?;
    let profile = Profile {
        start: file.start,
        bank: file.vehicle.bank,
        ramp_s: file.vehicle.ramp_s.0,
        segments: file.segment,
    };
    profile.build().map_err(|e| {
        let key = e.problem.key;
        let path = match e.segment {
            Some(i) => {
                let is_climb = matches!(profile.segments[i].kind, SegmentKind::Climb { .. });
                let key = if is_climb && key == "climb_m" {
                    "height_m"
                } else {
                    key
                };
                format!("segment[{}].{key}", i + 1)
            }
            None if key == "segment" => key.to_owned(),
            None => format!("start.{key}"),
        };
        source
            .refused(&path, e.problem.to_string())
            .or_hint_if(e.problem.advice.map(str::to_owned))
    })
}
