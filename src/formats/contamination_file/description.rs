//! What contamination files hold: one description an operation, for readers and for editors.

use crate::formats::FileError;
use crate::formats::toml_described::{Finite, OneOrEach};
use crate::formats::toml_file::Section;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use std::borrow::Cow;

/// Errors and disturbances put into recordings: nav-sim synthesize --contaminate
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Contamination")]
pub(super) struct Description {
    /// Version of the layout
    #[schemars(range(min = 1, max = 1))]
    pub(super) schema: Option<u64>,
    /// Of all axes of the accelerometers
    #[serde(default, rename = "accel")]
    #[schemars(with = "Vec<RuleDescription>")]
    _accel: IgnoredAny,
    /// Of all axes of the gyroscopes
    #[serde(default, rename = "gyro")]
    #[schemars(with = "Vec<RuleDescription>")]
    _gyro: IgnoredAny,
}

/// What is done to the signals of a sensor
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[expect(dead_code, reason = "what describes files, for editors")]
struct RuleDescription {
    #[schemars(flatten)]
    of: Of,
    #[schemars(flatten)]
    operation: Described,
}

#[derive(Deserialize, JsonSchema)]
pub(super) struct Of {
    /// Replicates, counted from 1 (default: every one)
    #[schemars(length(min = 1), inner(range(min = 1)))]
    pub(super) replicates: Option<Vec<u64>>,
}

/// The operations of files, each with its keys.
#[derive(JsonSchema)]
#[schemars(tag = "operation", rename_all = "kebab-case")]
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
pub(super) struct Step {
    /// Height of the step (units of the signal)
    pub(super) amplitude: Numbers,
    /// Where in the record, as a share of it (default: 0.5)
    #[schemars(with = "Option<OneOrEach<Share>>")]
    pub(super) at_share: Option<Numbers>,
    /// Where in the record (samples)
    pub(super) at_samples: Option<u64>,
    /// Where in the record (s)
    #[schemars(with = "Option<OneOrEach<NonNegative>>")]
    pub(super) at_s: Option<Numbers>,
}

#[derive(Deserialize, JsonSchema)]
pub(super) struct Drift {
    /// Value at the end of the record (units of the signal)
    pub(super) amplitude: Numbers,
}

#[derive(Deserialize, JsonSchema)]
pub(super) struct Replace {
    /// Share of the samples
    #[schemars(with = "Option<OneOrEach<Share>>")]
    pub(super) share: Option<Numbers>,
    /// Number of samples
    pub(super) points: Option<u64>,
    /// Samples replaced together (default: 1)
    #[schemars(range(min = 1))]
    pub(super) length_samples: Option<u64>,
    /// Standard deviation of what replaces them
    #[schemars(with = "OneOrEach<NonNegative>")]
    pub(super) sigma: Numbers,
    /// Mean of what replaces them (default: the signal's)
    pub(super) mean: Option<Mean>,
}

#[derive(Deserialize, JsonSchema)]
pub(super) struct Bursts {
    /// Number of bursts (default: 5)
    pub(super) count: Option<u64>,
    /// Length of a burst (samples; default: 500)
    pub(super) length_samples: Option<u64>,
    /// From one burst to the next (samples; default: 90000)
    pub(super) spacing_samples: Option<u64>,
    /// Length of the record that these are meant for (samples; default: as it is)
    #[schemars(with = "Option<OneOrEach<AtLeastOne>>")]
    pub(super) of_samples: Option<Numbers>,
    /// Amplitude (units of the signal)
    pub(super) amplitude: Numbers,
    /// Frequency (Hz; default: 5)
    #[schemars(with = "Option<OneOrEach<Positive>>")]
    pub(super) frequency_hz: Option<Numbers>,
}

#[derive(Deserialize, JsonSchema)]
pub(super) struct Autoregression {
    /// Coefficient
    #[schemars(with = "OneOrEach<Stationary>")]
    pub(super) phi: Numbers,
    /// Innovation variance per sample
    #[schemars(with = "OneOrEach<NonNegative>")]
    pub(super) sigma2: Numbers,
}

#[derive(Deserialize, JsonSchema)]
pub(super) struct HeavyTails {
    /// Degrees of freedom, more than 2
    #[schemars(with = "OneOrEach<AboveTwo>")]
    pub(super) freedom: Numbers,
    /// Scale of Student's t (units of the signal)
    #[schemars(with = "OneOrEach<NonNegative>")]
    pub(super) sigma: Numbers,
}

#[derive(Deserialize, JsonSchema)]
pub(super) struct Scale {
    /// Process of the model, such as RW
    pub(super) process: String,
    /// Its parameter, such as gamma2
    pub(super) parameter: String,
    /// What it is multiplied by
    #[schemars(with = "OneOrEach<NonNegative>")]
    pub(super) factor: Numbers,
}

/// Numbers between two whole ones, for schemas and for the reader: open without them; `i64::MAX` is no end.
pub(super) struct Between<const LOW: i64, const HIGH: i64, const OPEN: bool>;

/// A part of a whole.
pub(super) type Share = Between<0, 1, false>;
pub(super) type NonNegative = Between<0, { i64::MAX }, false>;
pub(super) type Positive = Between<0, { i64::MAX }, true>;
pub(super) type AtLeastOne = Between<1, { i64::MAX }, false>;
/// Degrees of freedom with a variance.
pub(super) type AboveTwo = Between<2, { i64::MAX }, true>;
/// Coefficients of a stationary AR(1), as [`Ar1::new`](nav_sim_signal::noise::Ar1::new) takes them.
type Stationary = Between<-1, 1, true>;

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> Between<LOW, HIGH, OPEN> {
    pub(super) fn contains(value: f64) -> bool {
        let (low, high) = (LOW as f64, if HIGH == i64::MAX { f64::INFINITY } else { HIGH as f64 });
        if OPEN { low < value && value < high } else { (low..=high).contains(&value) }
    }
}

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> JsonSchema for Between<LOW, HIGH, OPEN> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Between_{LOW}_{HIGH}_{OPEN}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let (least, most) =
            if OPEN { ("exclusiveMinimum", "exclusiveMaximum") } else { ("minimum", "maximum") };
        let mut schema = json_schema!({ "type": "number" });
        schema.insert(least.to_owned(), LOW.into());
        if HIGH < i64::MAX {
            schema.insert(most.to_owned(), HIGH.into());
        }
        schema
    }
}

/// One number for all, or one for each replicate listed
#[derive(Deserialize, JsonSchema)]
#[serde(untagged, expecting = "is neither a finite number nor a list of finite numbers")]
pub(super) enum Numbers {
    One(Finite),
    Each(Vec<Finite>),
}

#[derive(Deserialize, JsonSchema)]
#[serde(untagged, expecting = "is neither a number nor \"signal\"")]
pub(super) enum Mean {
    Own(Numbers),
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

/// What a table of a file describes.
pub(super) fn describe(section: &Section<'_>) -> Result<Described, FileError> {
    fn keys_of<T: DeserializeOwned + JsonSchema>(section: &Section<'_>) -> Result<T, FileError> {
        section.read_own(&["operation", "replicates"])
    }
    match section.require_str("operation")? {
        "step" => keys_of(section).map(Described::Step),
        "drift" => keys_of(section).map(Described::Drift),
        "replace" => keys_of(section).map(Described::Replace),
        "bursts" => keys_of(section).map(Described::Bursts),
        "ar1" => keys_of(section).map(Described::Ar1),
        "heavy-tails" => keys_of(section).map(Described::HeavyTails),
        "scale" => keys_of(section).map(Described::Scale),
        _ => {
            let hint = "operations: step, drift, replace, bursts, ar1, heavy-tails, scale".to_owned();
            Err(section.refuse("operation", "is not an operation", Some(hint)))
        }
    }
}
