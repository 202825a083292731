//! Fields of the messages of a topic.

use crate::bytes::{Bytes, Number};
use std::collections::HashMap;

/// Formats within formats: deeper ones are not followed.
const DEEPEST: usize = 8;

/// Formats by their names, each a list of fields `type name;`.
pub(super) type Formats = HashMap<String, String>;

/// Places of a message's own fields; those of formats within it are passed over.
#[derive(Default)]
pub(super) struct Layout {
    fields: HashMap<String, Field>,
}

/// Field of a message.
#[derive(Clone, Copy)]
struct Field {
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
            if let Some(number) = number(type_name) {
                let own = Field { at, number, count };
                layout.fields.insert(field.to_owned(), own);
            }
            at = at.checked_add(size_of(type_name, formats, 0)?.checked_mul(count)?)?;
        }
        Some(layout)
    }

    /// A field of so many numbers.
    fn field(&self, name: &str, count: usize) -> Option<Field> {
        let field = self.fields.get(name).copied();
        field.filter(|field| field.count == count)
    }

    /// Numbers of a field; none where the message is too short or the layout has no such field.
    pub(super) fn numbers<const N: usize>(&self, name: &str, message: &[u8]) -> Option<[f64; N]> {
        let field = self.field(name, N)?;
        let mut bytes = Bytes::little(message.get(field.at..)?);
        let mut values = [0.0; N];
        for value in &mut values {
            *value = field.number.read(&mut bytes)?;
        }
        Some(values)
    }

    /// Time (µs in the message) (ns); none beyond what can be a time.
    pub(super) fn time_ns(&self, name: &str, message: &[u8]) -> Option<i64> {
        let field = self.field(name, 1)?;
        let field = (field.number == Number::Unsigned(8)).then_some(field)?;
        let us = Bytes::little(message.get(field.at..)?).u64()?;
        i64::try_from(us).ok()?.checked_mul(1000)
    }
}

/// Bytes of a type, or of a format.
fn size_of(name: &str, formats: &Formats, depth: usize) -> Option<usize> {
    if let Some(number) = number(name) {
        return Some(number.size());
    }
    let mut fields = fields(formats.get(name).filter(|_| depth <= DEEPEST)?);
    fields.try_fold(0_usize, |sum, (type_name, count, _)| {
        sum.checked_add(size_of(type_name, formats, depth + 1)?.checked_mul(count)?)
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
