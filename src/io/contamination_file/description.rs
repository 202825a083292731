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
    pub(super) _schema: Option<Version>,
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
#[serde(rename_all = "kebab-case")]
#[schemars(tag = "operation")]
pub(super) enum Described {
    /// A jump of the mean
    Step(Step),
    /// A drift over the whole record
    Drift(Drift),
    /// Samples replaced by outliers
    Replace(Replace),
    /// Bursts of vibration
    Bursts(Bursts),
    /// A first-order autoregression on top
    Ar1(Autoregression),
    /// Noise with heavy tails on top
    HeavyTails(HeavyTails),
    /// A parameter of the model, scaled
    Scale(Scale),
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Step {
    /// Height of the step (units of the signal)
    pub(super) amplitude: OneOrEach<Finite>,
    /// Where in the record, as a share of it (default: 0.5)
    pub(super) at_share: Option<OneOrEach<Share>>,
    /// Where in the record (samples)
    pub(super) at_samples: Option<u64>,
    /// Where in the record (s)
    pub(super) at_s: Option<OneOrEach<NonNegative>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Drift {
    /// Value at the end of the record (units of the signal)
    pub(super) amplitude: OneOrEach<Finite>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Replace {
    /// Share of the samples
    pub(super) share: Option<OneOrEach<Share>>,
    /// Number of samples
    pub(super) points: Option<u64>,
    /// Samples replaced together (default: 1)
    pub(super) length_samples: Option<NonZero<u64>>,
    /// Standard deviation of what replaces them
    pub(super) sigma: OneOrEach<NonNegative>,
    /// Mean of what replaces them (default: the signal's)
    pub(super) mean: Option<Mean>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Bursts {
    /// Number of bursts (default: 5)
    pub(super) count: Option<u64>,
    /// Length of a burst (samples; default: 500)
    pub(super) length_samples: Option<u64>,
    /// From one burst to the next (samples; default: 90000)
    pub(super) spacing_samples: Option<u64>,
    /// Length of the record that these are meant for (samples; default: as it is)
    pub(super) of_samples: Option<OneOrEach<AtLeastOne>>,
    /// Amplitude (units of the signal)
    pub(super) amplitude: OneOrEach<Finite>,
    /// Frequency (Hz; default: 5)
    pub(super) frequency_hz: Option<OneOrEach<Positive>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Autoregression {
    /// Coefficient
    pub(super) phi: OneOrEach<Stationary>,
    /// Innovation variance per sample
    pub(super) sigma2: OneOrEach<NonNegative>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct HeavyTails {
    /// Degrees of freedom, more than 2
    pub(super) freedom: OneOrEach<AboveTwo>,
    /// Scale of Student's t (units of the signal)
    pub(super) sigma: OneOrEach<NonNegative>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(!deny_unknown_fields)]
pub(super) struct Scale {
    /// Process of the model, such as RW
    pub(super) process: String,
    /// Its parameter, such as gamma2
    pub(super) parameter: String,
    /// What it is multiplied by
    pub(super) factor: OneOrEach<NonNegative>,
}

/// Degrees of freedom with a variance.
pub(super) type AboveTwo = Between<2, { i64::MAX }, true>;
pub(super) type AtLeastOne = Between<1, { i64::MAX }, false>;

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
