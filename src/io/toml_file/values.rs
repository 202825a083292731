//! Numbers with bounds, and one value or a list of them.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, IgnoredAny, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// A number that is neither nan nor inf.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(try_from = "f64", into = "f64")]
#[schemars(inline)]
pub(crate) struct Finite(pub(crate) f64);

impl TryFrom<f64> for Finite {
    type Error = &'static str;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        if value.is_finite() {
            Ok(Self(value))
        } else {
            Err("is not a finite number such as 1.5e-4")
        }
    }
}

impl From<Finite> for f64 {
    fn from(value: Finite) -> Self {
        value.0
    }
}

/// A number between two whole ones, or one of them unless it is open; `i64::MAX` is no end.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "f64")]
pub(crate) struct Between<const LOW: i64, const HIGH: i64, const OPEN: bool>(pub(crate) f64);

/// A part of a whole.
pub(crate) type Share = Between<0, 1, false>;
pub(crate) type NonNegative = Between<0, { i64::MAX }, false>;
pub(crate) type Positive = Between<0, { i64::MAX }, true>;
/// Coefficients of a stationary AR(1), as [`Ar1::new`](nav_sim_signal::noise::Ar1::new) takes them.
pub(crate) type Stationary = Between<-1, 1, true>;

impl<const LOW: i64, const HIGH: i64, const OPEN: bool> TryFrom<f64> for Between<LOW, HIGH, OPEN> {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, Self::Error> {
        let (low, high) = (
            LOW as f64,
            if HIGH == i64::MAX {
                f64::MAX
            } else {
                HIGH as f64
            },
        );
        let is_inside = if OPEN {
            low < value && value < high
        } else {
            (low..=high).contains(&value)
        };
        match (HIGH, OPEN) {
            _ if is_inside => Ok(Self(value)),
            (i64::MAX, true) => Err(format!("is not a finite number > {LOW}")),
            (i64::MAX, false) => Err(format!("is not a finite number ≥ {LOW}")),
            (_, true) => {
                Err(format!("is not between {LOW} and {HIGH} (exclusive)").replace('-', "−"))
            }
            (_, false) => Err(format!("is not between {LOW} and {HIGH}")),
        }
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
        format!("Between_{LOW}_{HIGH}_{OPEN}").into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let (least, most) = if OPEN {
            ("exclusiveMinimum", "exclusiveMaximum")
        } else {
            ("minimum", "maximum")
        };
        let mut schema = json_schema!({ "type": "number" });
        schema.insert(least.to_owned(), LOW.into());
        if HIGH < i64::MAX {
            schema.insert(most.to_owned(), HIGH.into());
        }
        schema
    }
}

/// The version of a file's layout: there is one
#[derive(Deserialize, JsonSchema)]
#[serde(try_from = "u64")]
#[schemars(inline, extend("minimum" = 1, "maximum" = 1))]
pub(crate) struct Version;

impl TryFrom<u64> for Version {
    type Error = &'static str;

    fn try_from(version: u64) -> Result<Self, Self::Error> {
        if version == 1 {
            Ok(Self)
        } else {
            Err("is not a schema this version reads: it reads 1")
        }
    }
}

/// One value for all, or a list with one for each.
#[derive(Debug, JsonSchema)]
#[schemars(untagged, inline)]
pub(crate) enum OneOrEach<One, Each = Vec<One>> {
    One(One),
    Each(Each),
}

impl<One: Copy + Into<f64>> OneOrEach<One> {
    /// The one, or the i-th of a list (NaN beyond it).
    pub(crate) fn of(&self, i: usize) -> f64 {
        match self {
            Self::One(value) => (*value).into(),
            Self::Each(values) => values.get(i).map_or(f64::NAN, |value| (*value).into()),
        }
    }
}

impl<'de, One: Deserialize<'de>, Each: Deserialize<'de>> Deserialize<'de> for OneOrEach<One, Each> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(EitherVisitor(PhantomData))
    }
}

struct EitherVisitor<One, Each>(PhantomData<(One, Each)>);

impl<'de, One: Deserialize<'de>, Each: Deserialize<'de>> Visitor<'de> for EitherVisitor<One, Each> {
    type Value = OneOrEach<One, Each>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("one value or a list of them")
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        One::deserialize(number.into_deserializer()).map(OneOrEach::One)
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        One::deserialize(number.into_deserializer()).map(OneOrEach::One)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        One::deserialize(MapAccessDeserializer::new(map)).map(OneOrEach::One)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let each = Each::deserialize(SeqAccessDeserializer::new(&mut list))?;
        match list.next_element::<IgnoredAny>()? {
            None => Ok(OneOrEach::Each(each)),
            Some(_) => Err(A::Error::custom("is too long a list")),
        }
    }
}
