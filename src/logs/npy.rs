//! Arrays in NumPy's own format, `.npy` (`numpy.lib.format`).

use crate::input::{Bytes, LogError, LogInput, Number};
use std::io;
use std::io::Read;
use std::path::Path;

/// Longest header (bytes).
const LONGEST_HEADER: usize = 1 << 16;
/// Numbers that are read together.
const BLOCK: usize = 8192;

/// Array of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// Numbers, the last dimension running fastest.
    pub values: Vec<f64>,
}

/// Reads the array of a file.
///
/// # Errors
/// When it is cut off, or no array of real numbers.
pub fn read(path: &Path) -> Result<Array, LogError> {
    let input = LogInput::open(path)?;
    let size = input.length();
    read_from(&mut input.take(size), size, 0)
}

/// Reads an array that has so many bytes with its header.
pub(crate) fn read_from(from: &mut impl Read, size: u64, offset: u64) -> Result<Array, LogError> {
    let fault = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof => LogError::truncated(offset, size + 1, size),
        _ => LogError::malformed(offset, format!("not a NumPy array: {error}")),
    };
    let (text, header_bytes) = header_text(from).map_err(fault)?;
    let unparsed = || {
        let text = text.trim();
        LogError::malformed(
            offset,
            format!("the header of an array does not parse: {text}"),
        )
    };
    let (kind, shape, is_fortran) = parse(&text).ok_or_else(unparsed)?;
    let known = number(kind).ok_or_else(|| LogError::encoding(offset, kind.as_bytes()));
    let (is_big_endian, number) = known?;
    let count = shape.iter().try_fold(1_usize, |n, of| n.checked_mul(*of));
    let bytes = count.and_then(|count| count.checked_mul(number.size()));
    let left = size.saturating_sub(header_bytes);
    let needed = bytes.map_or(u64::MAX, |bytes| bytes as u64);
    let Some(bytes) = bytes.filter(|_| needed <= left) else {
        return Err(LogError::truncated(offset + header_bytes, needed, left));
    };
    let mut values = Vec::new();
    let mut block = vec![0; BLOCK * number.size()];
    let mut left = bytes;
    while left > 0 {
        let most = left.min(block.len());
        let part = &mut block[..most];
        from.read_exact(part).map_err(fault)?;
        left -= part.len();
        let mut numbers = Bytes::new(part, is_big_endian, 1);
        values.extend(std::iter::from_fn(|| number.read(&mut numbers)));
    }
    if is_fortran {
        values = transposed(&values, &shape);
    }
    Ok(Array { shape, values })
}

/// The header's text, and the bytes up to its end.
fn header_text(from: &mut impl Read) -> io::Result<(String, u64)> {
    let mut start = [0; 10];
    from.read_exact(&mut start)?;
    if !start.starts_with(b"\x93NUMPY") {
        return Err(io::Error::other("does not begin with \\x93NUMPY"));
    }
    let mut length = usize::from(u16::from_le_bytes([start[8], start[9]]));
    let mut before = 10;
    if start[6] > 1 {
        let mut more = [0; 2];
        from.read_exact(&mut more)?;
        length |= usize::from(u16::from_le_bytes(more)) << 16;
        before = 12;
    }
    if length > LONGEST_HEADER {
        return Err(io::Error::other(format!("a header of {length} bytes")));
    }
    let mut text = vec![0; length];
    from.read_exact(&mut text)?;
    Ok((crate::input::text(&text), (before + length) as u64))
}

/// Type, shape and order of the dictionary `{'descr': '<f8', 'fortran_order': False, 'shape': (40, 3), }`.
fn parse(text: &str) -> Option<(&str, Vec<usize>, bool)> {
    let value = |key: &str| Some(text.split_once(key)?.1.trim_start_matches([' ', ':']));
    let (shape, _) = value("'shape'")?.strip_prefix('(')?.split_once(')')?;
    let lengths = shape.split(',').map(str::trim).filter(|n| !n.is_empty());
    let shape: Option<Vec<usize>> = lengths.map(|n| n.parse().ok()).collect();
    let is_fortran = value("'fortran_order'")?.starts_with("True");
    Some((value("'descr'")?, shape?, is_fortran))
}

/// Order and type of numbers from `'<f8'`.
fn number(text: &str) -> Option<(bool, Number)> {
    let code = text.strip_prefix('\'')?.split_once('\'')?.0;
    let mut characters = code.chars();
    let is_big_endian = characters.next()? == '>';
    let kind = characters.next()?;
    let size = characters.as_str().parse().ok()?;
    let number = match (kind, size) {
        ('f', 4 | 8) => Number::Float(size),
        ('i', 1 | 2 | 4 | 8) => Number::Signed(size),
        ('u' | 'b', 1) | ('u', 2 | 4 | 8) => Number::Unsigned(size),
        _ => return None,
    };
    Some((is_big_endian, number))
}

/// Numbers of an array whose first dimension runs fastest, the last running fastest.
fn transposed(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let Some((rows, inner)) = shape.split_first().filter(|(rows, _)| **rows > 0) else {
        return values.to_vec();
    };
    let row = |row: usize| {
        let own: Vec<f64> = values.iter().skip(row).step_by(*rows).copied().collect();
        transposed(&own, inner)
    };
    (0..*rows).flat_map(row).collect()
}
