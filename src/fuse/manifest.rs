//! The configuration of a fusion in its manifest.

use nav_sim_navigation::ekf::{FilterStates, InitialSettings};
use nav_sim_navigation::fusion::mounting::Mounted;
use nav_sim_navigation::fusion::{Correlation, Heading, Settings};
use nav_sim_navigation::gnss::FixSigma;
use nav_sim_navigation::sensors::aiding::AidingSettings;
use serde::{Deserialize, Serialize};

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
