//! The border: units that headers, keys and flags name, and the values they may take. Inside, everything
//! is SI and radians.
//!
//! ```
//! use nav_sim_signal::units::DEG_PER_HOUR;
//!
//! // The Earth turns by 15.041 degrees an hour.
//! assert!((15.041_067 * DEG_PER_HOUR - 7.292_115e-5).abs() < 1e-11);
//! ```

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::borrow::Cow;

/// One degree in radians.
pub const DEG: f64 = std::f64::consts::PI / 180.0;
/// Standard gravity, exact (m/s²).
pub const STANDARD_GRAVITY: f64 = 9.806_65;
/// One degree per hour in rad/s.
pub const DEG_PER_HOUR: f64 = DEG / 3600.0;

/// A setting outside its domain, named by its key.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{key} = {value} is refused: {requirement}")]
pub struct SettingError {
    /// Key within its section, as in scenario files.
    pub key: String,
    /// The value refused.
    pub value: String,
    /// Accepted values, in words.
    pub requirement: String,
    /// Advice, where the requirement alone does not say what to do.
    pub advice: Option<&'static str>,
}

impl SettingError {
    /// The refusal of a value.
    pub fn new(key: &str, value: impl ToString, requirement: impl Into<String>) -> Self {
        Self {
            key: key.to_owned(),
            value: value.to_string(),
            requirement: requirement.into(),
            advice: None,
        }
    }

    /// The error with advice.
    pub const fn with_advice(mut self, advice: &'static str) -> Self {
        self.advice = Some(advice);
        self
    }

    /// The error with the section's name before the key.
    pub fn in_section(mut self, section: &str) -> Self {
        self.key = format!("{section}.{}", self.key);
        self
    }
}

/// Data or settings for which there is no answer, in words.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Refused(pub String);

/// A number between two whole ones, or one of them unless it is open; `i64::MAX` is no end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
pub struct Between<const LOW: i64, const HIGH: i64, const OPEN: bool>(pub f64);

/// A part of a whole.
pub type Share = Between<0, 1, false>;
/// A number ≥ 0.
pub type NonNegative = Between<0, { i64::MAX }, false>;
/// A number > 0.
pub type Positive = Between<0, { i64::MAX }, true>;
/// A number between 0 and 1, neither of them.
pub type Probability = Between<0, 1, true>;
/// Coefficients of a stationary AR(1), as [`Process::ar1`](crate::noise::Process::ar1) takes them.
pub type Stationary = Between<-1, 1, true>;

/// A number ≥ 0 that a sensor can have, in its unit.
pub type Amount = Between<0, 1_000_000_000, false>;

/// A number > 0 that a sensor can have, in its unit: with others a filter divides by nothing, or by what is no number.
pub struct Measurable;

impl JsonSchema for Measurable {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Measurable".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number", "minimum": 1e-6, "maximum": 1e9 })
    }
}

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> From<Between<LOW, HIGH, OPEN>> for f64 {
    fn from(value: Between<LOW, HIGH, OPEN>) -> Self {
        value.0
    }
}

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> JsonSchema for Between<LOW, HIGH, OPEN> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Between".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let [least, most] = match OPEN {
            true => ["exclusiveMinimum", "exclusiveMaximum"],
            false => ["minimum", "maximum"],
        };
        let mut schema = json_schema!({ "type": "number", least: LOW });
        if HIGH < i64::MAX {
            schema.insert(most.to_owned(), HIGH.into());
        }
        schema
    }
}
