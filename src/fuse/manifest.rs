//! `manifest.json` of a fusion: its configuration and inputs, to make it again.

use crate::app::{Input, contents};
use nav_sim_navigation::ekf::{FilterStates, InitialSettings};
use nav_sim_navigation::fusion::mounting::Mounted;
use nav_sim_navigation::fusion::{Correlation, Heading, Settings};
use nav_sim_navigation::gnss::FixSigma;
use nav_sim_navigation::sensors::aiding::AidingSettings;
use serde::{Deserialize, Serialize};

/// Source of a fusion directory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct FuseManifest {
    /// Layout version.
    pub(crate) schema_version: u32,
    /// `fusion`.
    pub(crate) kind: Kind,
    /// Version of nav-sim.
    pub(crate) version: String,
    /// The command as given.
    pub(crate) command: Vec<String>,
    /// All that decides the result beside the files.
    pub(crate) configuration: Configuration,
    /// Every file that was read.
    pub(crate) inputs: Vec<Input>,
    /// Time from start to results (s).
    pub(crate) wall_s: f64,
}

/// Tells the directory of a fusion from that of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    Fusion,
}

/// Settings of a fusion beside its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Configuration {
    /// Settings of the filter's run; where the mounting is found, about which axes it is looked for.
    pub(crate) settings: Settings,
    /// Source of the mounting.
    pub(crate) mounted: Mounted,
    /// States of the filter.
    pub(crate) filter: FilterStates,
    /// The filter's expectation at the start, and of the IMU beside the model.
    pub(crate) initial: InitialSettings,
    /// Standard deviations of fixes that state none.
    pub(crate) gnss_sigma: Option<FixSigma>,
    /// Factors of the standard deviations of position and velocity.
    pub(crate) gnss_sigma_factor: [f64; 2],
    /// How long errors of positions last.
    #[serde(default)]
    pub(crate) gnss_correlation: Correlation,
    /// Heading at the start, where it was given.
    #[serde(default)]
    pub(crate) heading: Option<Heading>,
    /// What is believed of the vehicle's own knowledge.
    #[serde(default, skip_serializing_if = "AidingSettings::is_none")]
    pub(crate) aiding: AidingSettings,
    /// How much earlier than its time a fix is taken to be (s).
    pub(crate) gnss_delay_s: f64,
}

impl FuseManifest {
    /// Whether a fusion of the one is a fusion of the other: all that decides the results is the same.
    pub(crate) fn is_same_fusion(&self, other: &Self) -> bool {
        (&self.version, &self.configuration) == (&other.version, &other.configuration)
            && contents(&self.inputs) == contents(&other.inputs)
    }
}
