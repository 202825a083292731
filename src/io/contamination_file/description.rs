//! What contamination files hold: one description an operation, for readers and for editors.

use crate::io::toml_file::{
    Between, Finite, NonNegative, OneOrEach, Positive, Share, Stationary, Version,
};
use schemars::JsonSchema;
use serde::Deserialize;
use std::num::NonZero;

/// Errors and disturbances put into recordings: nav-sim synthesize --contaminate
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Contamination")]
pub(super) struct Description {
    /// Version of the layout
    #[serde(rename = "schema")]
    _schema: Option<Version>,
    /// Of all axes of the accelerometers
    #[serde(default)]
    pub(super) accel: Vec<RuleTable>,
    /// Of all axes of the gyroscopes
    #[serde(default)]
    pub(super) gyro: Vec<RuleTable>,
}

/// What is done to the signals of a sensor
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct RuleTable {
    /// Replicates, counted from 1 (default: every one)
    #[schemars(length(min = 1))]
    pub(super) replicates: Option<Vec<NonZero<u64>>>,
    #[schemars(flatten)]
    pub(super) operation: Described,
}

/// The operations of files, each with its keys.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[schemars(tag = "operation", !deny_unknown_fields)]
pub(super) enum Described {
    /// A jump of the mean
    Step {
        /// Height of the step (units of the signal)
        amplitude: OneOrEach<Finite>,
        /// Where in the record, as a share of it (default: 0.5)
        at_share: Option<OneOrEach<Share>>,
        /// Where in the record (samples)
        at_samples: Option<u64>,
        /// Where in the record (s)
        at_s: Option<OneOrEach<NonNegative>>,
    },
    /// A drift over the whole record
    Drift {
        /// Value at the end of the record (units of the signal)
        amplitude: OneOrEach<Finite>,
    },
    /// Samples replaced by outliers
    Replace {
        /// Share of the samples
        share: Option<OneOrEach<Share>>,
        /// Number of samples
        points: Option<u64>,
        /// Samples replaced together (default: 1)
        length_samples: Option<NonZero<u64>>,
        /// Standard deviation of what replaces them
        sigma: OneOrEach<NonNegative>,
        /// Mean of what replaces them (default: the signal's)
        mean: Option<Mean>,
    },
    /// Bursts of vibration
    Bursts {
        /// Number of bursts (default: 5)
        count: Option<u64>,
        /// Length of a burst (samples; default: 500)
        length_samples: Option<u64>,
        /// From one burst to the next (samples; default: 90000)
        spacing_samples: Option<u64>,
        /// Length of the record that these are meant for (samples; default: as it is)
        of_samples: Option<OneOrEach<AtLeastOne>>,
        /// Amplitude (units of the signal)
        amplitude: OneOrEach<Finite>,
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
        /// What it is multiplied by
        factor: OneOrEach<NonNegative>,
    },
}

/// Degrees of freedom with a variance.
type AboveTwo = Between<2, { i64::MAX }, true>;
type AtLeastOne = Between<1, { i64::MAX }, false>;

#[derive(Deserialize, JsonSchema)]
#[serde(untagged, expecting = "is neither a number nor \"signal\"")]
pub(super) enum Mean {
    Own(OneOrEach<Finite>),
    Kept(Signal),
}

#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(super) enum Signal {
    Signal,
}

/// The JSON schema of such a file.
pub(crate) fn schema() -> serde_json::Value {
    schemars::schema_for!(Description).to_value()
}
