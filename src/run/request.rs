//! The request of a run: the arguments of `nav-sim run`, which a script fills in as fields.

use super::error::RunError;
use crate::formats::scenario_file;
use crate::parse;
use nav_sim_navigation::ekf::{FilterStates, InitialSettings};
use nav_sim_navigation::metrics::Requirement;
use nav_sim_navigation::scenario::{Method, Scenario};
use nav_sim_navigation::sensors::outage::{NotAnOutage, Outage};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// What is to be navigated, and how.
#[derive(clap::Args, Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunRequest {
    /// Trajectory: motion profile (.toml) or table (.csv)
    pub trajectory: PathBuf,
    /// Noise model that the filter believes
    pub model: PathBuf,
    /// Noise model that makes the INS errors (default: MODEL itself)
    #[arg(long, value_name = "MODEL2", conflicts_with = "recordings")]
    pub truth: Option<PathBuf>,
    /// Draw the parameters that make the errors of each run from the spread that their model states
    #[arg(long, conflicts_with = "recordings")]
    pub spread: bool,
    /// Static recording whose windows make the INS errors (repeatable)
    #[arg(long = "static", value_name = "FILE")]
    #[serde(rename = "static")]
    pub recordings: Vec<PathBuf>,
    /// Sample rate of static recordings without a time column
    #[arg(long, value_name = "HZ", value_parser = parse::rate_hz, requires = "recordings")]
    pub rate_hz: Option<f64>,
    /// Window without fixes, in seconds (repeatable), or "none" (default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END")]
    #[serde(rename = "outage")]
    pub outages: Vec<OutageFlag>,
    /// Monte-Carlo runs (default: 100)
    #[arg(long, value_name = "N")]
    pub runs: Option<u64>,
    /// States of the filter, and what it expects beside the model.
    #[command(flatten)]
    pub filter: FilterRequest,
    /// How statistics are computed: monte-carlo (sampled runs), lincov (linear covariance analysis, no sampling) or
    /// both (runs, compared with their expected values)
    #[arg(long, value_name = "METHOD", value_parser = parse::one_of::<Method>(&Method::NAMES))]
    pub method: Option<Method>,
    /// Limit on an error at the end of every outage, as NAME<=LIMIT (repeatable): p50_m, p95_m (horizontal),
    /// rmse_pos_e_m, yaw_deg and the other states; or "consistent"; exit code 3 if it is not met
    #[arg(long, value_name = "NAME<=LIMIT")]
    pub require: Vec<Requirement>,
    /// Scenario file whose section gnss is used
    #[arg(long, value_name = "FILE")]
    pub gnss: Option<PathBuf>,
    /// All settings of the run in one TOML file; flags override it (see `nav-sim schema scenario`)
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Seed of all random numbers; that of the scenario without it.
    #[arg(skip)]
    pub seed: Option<u64>,
}

/// States of the filter.
#[derive(clap::Args, Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FilterRequest {
    /// States of the filter: 15 (one bias per axis, to which the model is reduced), 21 (and a scale factor per axis)
    /// or full (a bias state for each process) [default: 15]
    #[arg(long = "filter", value_name = "STATES")]
    pub states: Option<FilterStates>,
    /// Constant biases that the filter expects in addition to the model (a calibration would remove them): standard
    /// deviations, accelerometer in m/s², gyroscope in rad/s; 3 states each
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = parse::pair)]
    pub turn_on_bias: Option<[f64; 2]>,
    /// Scale-factor errors that the filter expects: standard deviations in parts per million; 3 states each
    /// [default: 300,300 with --filter 21, else none]
    #[arg(long, value_name = "ACCEL,GYRO", value_parser = parse::pair)]
    pub scale_ppm: Option<[f64; 2]>,
}

impl FilterRequest {
    /// Puts what is given over the settings of a file.
    pub(crate) fn over(&self, states: &mut FilterStates, initial: &mut InitialSettings) {
        *states = self.states.unwrap_or(*states);
        if let Some([accel, gyro]) = self.turn_on_bias {
            (initial.accel_bias_sigma_m_s2, initial.gyro_bias_sigma_rad_s) =
                (Some(accel), Some(gyro));
        }
        if let Some([accel, gyro]) = self.scale_ppm {
            (initial.accel_scale_sigma_ppm, initial.gyro_scale_sigma_ppm) =
                (Some(accel), Some(gyro));
        }
    }
}

/// A value of `--outage`: a window, or that there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OutageFlag {
    /// Not even the default ones.
    None,
    /// A window without fixes.
    Window(Outage),
}

impl FromStr for OutageFlag {
    type Err = NotAnOutage;

    fn from_str(text: &str) -> Result<Self, NotAnOutage> {
        if text == "none" {
            Ok(Self::None)
        } else {
            text.parse().map(Self::Window)
        }
    }
}

parse::textual!(OutageFlag);

impl fmt::Display for OutageFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Window(Outage { start_s, end_s }) => write!(f, "{start_s}:{end_s}"),
        }
    }
}

/// The windows among the values of `--outage`, of which "none" stands alone.
pub(crate) fn windows_of(outages: &[OutageFlag]) -> Result<Vec<Outage>, RunError> {
    if outages.len() > 1 && outages.contains(&OutageFlag::None) {
        return Err(RunError::Outages);
    }
    let window = |flag: &OutageFlag| match flag {
        OutageFlag::None => None,
        OutageFlag::Window(outage) => Some(*outage),
    };
    Ok(outages.iter().filter_map(window).collect())
}

/// A scenario file, the default without one, with the outages of a request in the place of its own.
fn scenario_with(path: Option<&Path>, outages: &[OutageFlag]) -> Result<Scenario, RunError> {
    let mut scenario = path
        .map(scenario_file::read)
        .transpose()?
        .unwrap_or_default();
    if !outages.is_empty() {
        scenario.outage = Some(windows_of(outages)?);
        (scenario.outage_periodic, scenario.outage_random) = (None, None);
    }
    Ok(scenario)
}

/// The same, checked.
pub(crate) fn checked_scenario(
    path: Option<&Path>,
    outages: &[OutageFlag],
) -> Result<Scenario, RunError> {
    let scenario = scenario_with(path, outages)?;
    scenario.validate()?;
    Ok(scenario)
}

impl RunRequest {
    /// The scenario file with the request over it, checked.
    pub(super) fn settings(&self) -> Result<Scenario, RunError> {
        let mut scenario = scenario_with(self.scenario.as_deref(), &self.outages)?;
        if let Some(path) = &self.gnss {
            scenario.gnss = scenario_file::read(path)?.gnss;
        }
        scenario.run.runs = self.runs.unwrap_or(scenario.run.runs);
        scenario.run.method = self.method.unwrap_or(scenario.run.method);
        self.filter
            .over(&mut scenario.filter.states, &mut scenario.initial);
        scenario.validate()?;
        Ok(scenario)
    }

    /// The file that has the settings of receiver and outages.
    pub(super) fn settings_file(&self) -> Option<PathBuf> {
        self.gnss.clone().or_else(|| self.scenario.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A request in a file has the names of the flags, and comes back as it was.
    #[test]
    fn a_request_is_a_file_too() {
        let text = "trajectory = \"a.csv\"\nmodel = \"m.toml\"\noutage = [\"30:45\"]\nrequire = [\"p95_m<=5\", \"consistent\"]\n\
                    method = \"lincov\"\n[filter]\nstates = \"full\"\nscale_ppm = [100.0, 200.0]\n";
        let request: RunRequest = toml::from_str(text).unwrap();
        assert_eq!(
            request.outages,
            [OutageFlag::Window(Outage {
                start_s: 30.0,
                end_s: 45.0
            })]
        );
        assert_eq!(request.require[1].name(), "consistent");
        let again: RunRequest = toml::from_str(&toml::to_string(&request).unwrap()).unwrap();
        assert_eq!(again, request);
        assert!(toml::from_str::<RunRequest>("outage = [\"45:30\"]").is_err());
        assert!(toml::from_str::<RunRequest>("outages = []").is_err());
    }
}
