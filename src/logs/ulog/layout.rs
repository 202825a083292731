//! Fields of the messages of a topic.

use crate::bytes::{Bytes, Number};
use std::collections::HashMap;

/// Formats within formats: deeper ones are not followed.
const DEEPEST: usize = 8;

/// Formats by their names, each a list of fields `type name;`.
pub(super) type Formats = HashMap<String, String>;

/// Places of a message's own fields; those of formats within it are passed over.
#[derive(Debug, Clone, Default)]
pub(super) struct Layout {
    fields: HashMap<String, Field>,
}

/// Field of a message.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field {
    at: usize,
    number: Number,
    count: usize,
}

/// The type of a name.
fn number(name: &str) -> Option<Number> {
    Some(match name {
        "int8_t" => Number::Signed(1),
        "uint8_t" | "bool" | "char" => Number::Unsigned(1),
        "int16_t" => Number::Signed(2),
        "uint16_t" => Number::Unsigned(2),
        "int32_t" => Number::Signed(4),
        "uint32_t" => Number::Unsigned(4),
        "int64_t" => Number::Signed(8),
        "uint64_t" => Number::Unsigned(8),
        "float" => Number::Float(4),
        "double" => Number::Float(8),
        _ => return None,
    })
}

impl Layout {
    /// The layout of a format; none where it does not parse.
    pub(super) fn new(name: &str, formats: &Formats) -> Option<Self> {
        let mut layout = Self::default();
        let mut at = 0_usize;
        for (type_name, count, field) in fields(formats.get(name)?) {
            let size = match number(type_name) {
                Some(number) => {
                    layout
                        .fields
                        .insert(field.to_owned(), Field { at, number, count });
                    number.size()
                }
                None => size_of_format(type_name, formats, 0)?,
            };
            at = at.checked_add(size.checked_mul(count)?)?;
        }
        Some(layout)
    }

    /// A field of so many numbers.
    fn field(&self, name: &str, count: usize) -> Option<Field> {
        let field = self.fields.get(name).copied();
        field.filter(|field| field.count == count)
    }

    pub(super) fn one(&self, name: &str) -> Option<Field> {
        self.field(name, 1)
    }

    pub(super) fn three(&self, name: &str) -> Option<Field> {
        self.field(name, 3)
    }

    /// Time of a message (µs in it) (ns).
    pub(super) fn time_ns(&self, message: &[u8]) -> Option<i64> {
        self.one("timestamp")?.time_ns(message)
    }
}

/// Bytes of a format.
fn size_of_format(name: &str, formats: &Formats, depth: usize) -> Option<usize> {
    if depth > DEEPEST {
        return None;
    }
    fields(formats.get(name)?).try_fold(0_usize, |sum, (type_name, count, _)| {
        let size = match number(type_name) {
            Some(number) => number.size(),
            None => size_of_format(type_name, formats, depth + 1)?,
        };
        sum.checked_add(size.checked_mul(count)?)
    })
}

/// Type, number and name of each field: `float[3] gyro_rad;`.
fn fields(format: &str) -> impl Iterator<Item = (&str, usize, &str)> {
    format.split(';').filter_map(|field| {
        let (type_name, name) = field.trim().split_once(' ')?;
        let (type_name, count) = match type_name.split_once('[') {
            Some((type_name, count)) => (type_name, count.trim_end_matches(']').parse().ok()?),
            None => (type_name, 1),
        };
        Some((type_name, count, name))
    })
}

impl Field {
    fn numbers<const N: usize>(self, message: &[u8]) -> Option<[f64; N]> {
        let mut bytes = Bytes::little(message.get(self.at..)?);
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.number.read(&mut bytes)?;
        }
        Some(values)
    }

    pub(super) fn value(self, message: &[u8]) -> Option<f64> {
        self.numbers::<1>(message).map(|[value]| value)
    }

    pub(super) fn triad(self, message: &[u8]) -> Option<[f64; 3]> {
        self.numbers(message)
    }

    /// Time (µs in the message) (ns); none beyond what can be a time.
    pub(super) fn time_ns(self, message: &[u8]) -> Option<i64> {
        if self.number != Number::Unsigned(8) {
            return None;
        }
        let us = Bytes::little(message.get(self.at..)?).u64()?;
        i64::try_from(us).ok()?.checked_mul(1000)
    }
}
