//! Fields of the messages of a topic.

use crate::bytes::Bytes;
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

/// Types of numbers.
#[derive(Debug, Clone, Copy)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    fn new(name: &str) -> Option<Self> {
        Some(match name {
            "int8_t" => Self::I8,
            "uint8_t" | "bool" | "char" => Self::U8,
            "int16_t" => Self::I16,
            "uint16_t" => Self::U16,
            "int32_t" => Self::I32,
            "uint32_t" => Self::U32,
            "int64_t" => Self::I64,
            "uint64_t" => Self::U64,
            "float" => Self::F32,
            "double" => Self::F64,
            _ => return None,
        })
    }

    const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    fn read(self, bytes: &mut Bytes<'_>) -> Option<f64> {
        Some(match self {
            Self::I8 => bytes.u8()?.cast_signed().into(),
            Self::U8 => bytes.u8()?.into(),
            Self::I16 => bytes.u16()?.cast_signed().into(),
            Self::U16 => bytes.u16()?.into(),
            Self::I32 => bytes.i32()?.into(),
            Self::U32 => bytes.u32()?.into(),
            Self::I64 => bytes.u64()?.cast_signed() as f64,
            Self::U64 => bytes.u64()? as f64,
            Self::F32 => f32::from_bits(bytes.u32()?).into(),
            Self::F64 => bytes.f64()?,
        })
    }
}

impl Layout {
    /// The layout of a format; none where it does not parse.
    pub(super) fn new(name: &str, formats: &Formats) -> Option<Self> {
        let mut layout = Self::default();
        let mut at = 0_usize;
        for (type_name, count, field) in fields(formats.get(name)?) {
            let size = match Number::new(type_name) {
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

    /// A field of one number.
    pub(super) fn one(&self, name: &str) -> Option<Field> {
        self.fields
            .get(name)
            .filter(|field| field.count == 1)
            .copied()
    }

    /// A field of three numbers.
    pub(super) fn three(&self, name: &str) -> Option<Field> {
        self.fields
            .get(name)
            .filter(|field| field.count == 3)
            .copied()
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
        let size = match Number::new(type_name) {
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
        let Number::U64 = self.number else {
            return None;
        };
        let us = Bytes::little(message.get(self.at..)?).u64()?;
        i64::try_from(us).ok()?.checked_mul(1000)
    }
}
