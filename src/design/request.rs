//! The request of a design: the arguments of `nav-sim design`.

use super::{Design, DesignInputs, Designs, Destination, design};
use crate::app::Answered;
use crate::app::Context;
use crate::app::Failure;
use crate::app::inputs as read;
use crate::app::inputs::OutageFlag;
use crate::calibrate::ESTIMATORS;
use crate::commands::run::{NavigateInputs, TrueImu};
use crate::formats::model_file::ModelFile;
use crate::parse;
use nav_sim_calibration::{Bootstrap, Estimator, Settings};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_navigation::scenario::{Method, Scenario};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// An IMU, and the recordings that are planned of it.
#[derive(clap::Args, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DesignRequest {
    /// Noise model of the IMU, as far as it is known
    pub model: PathBuf,
    /// Number of recordings [default: a table of 3, 6 and 12]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub recordings: Option<u32>,
    /// Length of each in hours [default: a table of 1, 3 and 10]
    #[arg(long, value_name = "HOURS", value_parser = parse::positive)]
    pub hours: Option<f64>,
    /// How they will be calibrated
    #[arg(long, value_name = "ESTIMATOR", value_parser = parse::words::<Estimator>(AVERAGES), default_value_t)]
    pub estimator: Estimator,
    /// Draws of the bootstrap
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(40..=10_000))]
    pub draws: u32,
    /// Trajectory: motion profile (.toml) or table (.csv)
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Window without fixes, in seconds (repeatable; default: 300:390 and 700:790)
    #[arg(long = "outage", value_name = "START:END", requires = "trajectory")]
    #[serde(rename = "outage")]
    pub outages: Vec<OutageFlag>,
    /// Seed of the draws (1 without it).
    #[arg(skip)]
    pub seed: Option<u64>,
}

impl Default for DesignRequest {
    fn default() -> Self {
        Self {
            model: PathBuf::new(),
            recordings: None,
            hours: None,
            estimator: Estimator::default(),
            draws: 200,
            trajectory: None,
            outages: Vec::new(),
            seed: None,
        }
    }
}

/// The estimators of several recordings.
const AVERAGES: &[(&str, &str)] = ESTIMATORS.split_at(3).0;

/// Longest recording that is planned (h): a year.
const LONGEST_H: f64 = 8766.0;

impl DesignRequest {
    /// The designs.
    pub(crate) fn made(&self, context: &Context<'_>) -> Result<Designs, Failure> {
        if self.hours.is_some_and(|hours| hours > LONGEST_H) {
            return Err(Failure::input("--hours: longer than a year"));
        }
        let file = read::model(&self.model, context)?;
        let mut scenario = self.scenario()?;
        let mut navigation = None;
        if let Some(path) = &self.trajectory {
            let trajectory = read::trajectory(path, context)?;
            let span = (trajectory.start_s(), trajectory.end_s());
            let outages = scenario.outages_on(span, 0)?.windows;
            scenario.imu.rate_hz = file.model.rate_hz;
            scenario.validate().map_err(Failure::input)?;
            let inputs = NavigateInputs::new(trajectory, file.model.clone(), TrueImu::AsBelieved);
            navigation = Some((inputs, outages));
        }
        let destination = navigation.as_mut().map(|(inputs, outages)| Destination {
            inputs,
            scenario: &scenario,
            outages,
        });
        Ok(Designs {
            schema_version: 1,
            designs: self.designs(&file, destination)?,
        })
    }

    /// As `nav-sim design` prints it.
    ///
    /// # Errors
    /// What is wrong with a file or a setting, or that the recordings are too few or too short.
    pub fn answer(&self, context: &Context<'_>) -> Result<Answered, Failure> {
        Ok(Answered::of(&self.made(context)?))
    }

    /// Drives are analysed, with a state for every process.
    fn scenario(&self) -> Result<Scenario, Failure> {
        let mut scenario = Scenario::default();
        scenario.run.method = Method::Lincov;
        scenario.filter.states = FilterStates::Full;
        if !self.outages.is_empty() {
            scenario.outage = Some(crate::app::inputs::windows_of(&self.outages)?);
        }
        Ok(scenario)
    }

    /// One design for each number of recordings and length.
    fn designs(
        &self,
        file: &ModelFile,
        navigation: Option<Destination<'_>>,
    ) -> Result<Vec<Design>, Failure> {
        let settings = Settings::default();
        let bootstrap = Bootstrap {
            draws: self.draws as usize,
            seed: self.seed.unwrap_or(1),
        };
        let mut inputs = DesignInputs {
            file,
            estimator: self.estimator,
            settings: &settings,
            bootstrap,
            navigation,
        };
        let recordings = self.recordings.map_or(vec![3, 6, 12], |k| vec![k as usize]);
        let hours = self.hours.map_or(vec![1.0, 3.0, 10.0], |h| vec![h]);
        let mut designs = Vec::new();
        for k in recordings {
            for h in &hours {
                let design = design(&mut inputs, k, *h);
                designs.push(
                    design.map_err(|e| Failure::input(e).hint("more, or longer recordings"))?,
                );
            }
        }
        Ok(designs)
    }
}
