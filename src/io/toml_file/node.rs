//! A value of a TOML file as serde reads it. What is refused comes with the path of its key.
//!
//! A word chooses among the kinds of a table (`type = "AR1"`), in an enum without attributes of serde for it; the keys that
//! all kinds have stand in a struct around it, whose field has the name of the word.

use super::dotted;
use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, Expected, IntoDeserializer, MapAccess,
    SeqAccess, Unexpected, VariantAccess, Visitor,
};
use serde::forward_to_deserialize_any;
use std::fmt;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Words that choose among the kinds of a table.
const TAGS: [&str; 4] = ["type", "operation", "kind", "distribution"];

/// What is wrong, and the path of the value or of its table.
#[derive(Debug)]
pub(super) struct Refusal {
    pub(super) path: String,
    pub(super) what: What,
}

#[derive(Debug)]
pub(super) enum What {
    Unknown(String, &'static [&'static str]),
    Missing(&'static str),
    Variant(String, &'static [&'static str]),
    NoList,
    /// In words that follow the value.
    Reason(String),
}

impl From<What> for Refusal {
    fn from(what: What) -> Self {
        Self {
            path: String::new(),
            what,
        }
    }
}

impl Refusal {
    /// The same, within a key or an entry of a list.
    fn within(self, part: &str) -> Self {
        let path = match self.path.as_str() {
            "" => part.to_owned(),
            path if path.starts_with('[') => format!("{part}{path}"),
            path => dotted(part, path),
        };
        Self { path, ..self }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl std::error::Error for Refusal {}

impl Error for Refusal {
    fn custom<T: fmt::Display>(message: T) -> Self {
        let message = message.to_string();
        let words = match message.split(' ').next() {
            Some("is" | "has" | "lists" | "needs" | "of") => message,
            Some("not") => format!("is {message}"),
            Some("expected") => message.replacen("expected", "is not", 1),
            _ => format!("is refused: {message}"),
        };
        What::Reason(words).into()
    }

    fn invalid_type(_: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let expected = expected.to_string();
        let words = match expected.as_str() {
            "f64" => "a number",
            "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number ≥ 0",
            "a nonzero u64" => "a whole number ≥ 1",
            "a string" => "a text in quotes",
            "a sequence" => "a list",
            "a boolean" => "true or false",
            "path string" => "a path",
            other if other.starts_with("struct") => "a table",
            other => other,
        };
        let verb = if words.starts_with("is ") {
            ""
        } else {
            "is not "
        };
        What::Reason(format!("{verb}{words}")).into()
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(_: usize, expected: &dyn Expected) -> Self {
        What::Reason(format!("is not {expected}")).into()
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        What::Variant(variant.to_owned(), expected).into()
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        What::Unknown(field.to_owned(), expected).into()
    }

    fn missing_field(field: &'static str) -> Self {
        What::Missing(field).into()
    }
}

/// A value.
pub(super) struct Node<'a>(pub(super) &'a DeValue<'a>);

impl<'de> Deserializer<'de> for Node<'_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let no_number = || Refusal::from(What::Reason("is too large a number".to_owned()));
        match self.0 {
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Integer(number) => {
                let digits = number.as_str();
                let parsed = i64::from_str_radix(digits, number.radix());
                visitor.visit_i64(parsed.map_err(|_| no_number())?)
            }
            DeValue::Float(number) => {
                visitor.visit_f64(number.as_str().parse().map_err(|_| no_number())?)
            }
            DeValue::Boolean(is) => visitor.visit_bool(*is),
            DeValue::Datetime(time) => visitor.visit_string(time.to_string()),
            DeValue::Array(items) => visitor.visit_seq(Entries { items, next: 0 }),
            DeValue::Table(table) => visitor.visit_map(Keys::of(table, |_| true)),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        match self.0 {
            DeValue::Table(_) => Err(What::NoList.into()),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        if let DeValue::Array(_) = self.0 {
            return Err(What::Reason("is not a table".to_owned()).into());
        }
        let tag = fields.iter().find(|field| TAGS.contains(field));
        let (DeValue::Table(table), Some(tag)) = (self.0, tag) else {
            return self.deserialize_any(visitor);
        };
        if !table.contains_key(*tag) {
            return Err(What::Missing(tag).into());
        }
        let mut keys = Keys::of(table, |key| fields.contains(&key) && key != *tag);
        keys.rest = Some((tag, fields, table));
        visitor.visit_map(keys)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        match self.0 {
            DeValue::String(word) => visitor.visit_enum(word.as_ref().into_deserializer()),
            DeValue::Table(table) => visitor.visit_enum(Kind { table, passed: &[] }),
            _ => Err(What::Reason("is not a table".to_owned()).into()),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct tuple
        tuple_struct map identifier ignored_any
    }
}

/// Entries of a list, from a place on.
struct Entries<'a> {
    items: &'a [Spanned<DeValue<'a>>],
    next: usize,
}

impl<'de> SeqAccess<'de> for Entries<'_> {
    type Error = Refusal;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Refusal> {
        let Some(item) = self.items.get(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        let number = format!("[{}]", self.next);
        let read = seed.deserialize(Node(item.get_ref()));
        read.map(Some).map_err(|e| e.within(&number))
    }
}

/// Keys of a table, the last one to be read first.
struct Keys<'a> {
    keys: Vec<(&'a str, &'a DeValue<'a>)>,
    value: Option<(&'a str, &'a DeValue<'a>)>,
    /// A word whose kind has the keys that are none of these fields.
    rest: Option<(&'static str, &'static [&'static str], &'a DeTable<'a>)>,
}

impl<'a> Keys<'a> {
    fn of(table: &'a DeTable<'a>, is_wanted: impl Fn(&str) -> bool) -> Self {
        let all = table
            .iter()
            .map(|(key, value)| (key.get_ref().as_ref(), value.get_ref()));
        let mut keys: Vec<_> = all.filter(|(key, _)| is_wanted(key)).collect();
        keys.reverse();
        Self {
            keys,
            value: None,
            rest: None,
        }
    }
}

impl<'de> MapAccess<'de> for Keys<'_> {
    type Error = Refusal;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Refusal> {
        self.value = self.keys.pop();
        let key = self
            .value
            .map(|(key, _)| key)
            .or(self.rest.map(|(tag, ..)| tag));
        let name = |key: &str| seed.deserialize(StrDeserializer::new(key));
        key.map(name).transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refusal> {
        if let Some((key, value)) = self.value.take() {
            return seed.deserialize(Node(value)).map_err(|e| e.within(key));
        }
        let Some((_, passed, table)) = self.rest.take() else {
            return Err(What::Reason("has no value".to_owned()).into());
        };
        seed.deserialize(Kind { table, passed })
    }
}

/// A table whose word chooses its kind, without the keys that are passed.
struct Kind<'a> {
    table: &'a DeTable<'a>,
    passed: &'static [&'static str],
}

impl<'a> Kind<'a> {
    fn tag(&self) -> Option<&'static str> {
        TAGS.into_iter().find(|tag| self.table.contains_key(*tag))
    }
}

impl<'de> Deserializer<'de> for Kind<'_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_enum(self)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct tuple
        tuple_struct map identifier ignored_any option newtype_struct seq struct enum
    }
}

impl<'de> EnumAccess<'de> for Kind<'_> {
    type Error = Refusal;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Refusal> {
        let tag = self.tag().ok_or(What::Missing(TAGS[0]))?;
        let word = self.table.get(tag).and_then(|word| word.get_ref().as_str());
        let word = word.ok_or_else(|| {
            let what = What::Reason("is not a text in quotes".to_owned());
            Refusal::from(what).within(tag)
        })?;
        let variant = seed.deserialize(StrDeserializer::new(word));
        Ok((variant.map_err(|e: Refusal| e.within(tag))?, self))
    }
}

impl<'de> VariantAccess<'de> for Kind<'_> {
    type Error = Refusal;

    fn unit_variant(self) -> Result<(), Refusal> {
        Ok(())
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Refusal> {
        let tag = self.tag();
        let is_own = |key: &str| Some(key) != tag && !self.passed.contains(&key);
        let keys = Keys::of(self.table, is_own);
        seed.deserialize(serde::de::value::MapAccessDeserializer::new(keys))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, _: V) -> Result<V::Value, Refusal> {
        Err(What::Reason("is not a table".to_owned()).into())
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        let tag = self.tag();
        let is_own = |key: &str| Some(key) != tag && !self.passed.contains(&key);
        visitor.visit_map(Keys::of(self.table, is_own))
    }
}
