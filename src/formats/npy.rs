//! NumPy arrays (`.npy`, versions 1 to 3): real numbers, one or two dimensions.
//!
//! Format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>. Read here rather than
//! by a library because a file is untrusted: sizes are checked against the bytes that are there before
//! anything is allocated.

use super::{FileError, Place};
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array of real numbers: its header read, its elements to come.
#[derive(Debug)]
pub(crate) struct Array<R> {
    path: String,
    header: Header,
    elements: R,
}

/// Opens an array; a vector is an array of one column.
///
/// # Errors
/// When it cannot be read, is no array of real numbers of one or two dimensions, or is cut off.
pub(crate) fn open(path: &Path) -> Result<Array<BufReader<File>>, FileError> {
    let name = path.display().to_string();
    let io = |source| FileError::io(path, source);
    let file = File::open(path).map_err(io)?;
    let size = file.metadata().map_err(io)?.len();
    parse(&name, BufReader::with_capacity(1 << 17, file), size)
}

/// What the header says.
#[derive(Debug, PartialEq)]
struct Header {
    kind: u8,
    width: usize,
    big_endian: bool,
    fortran: bool,
    rows: usize,
    columns: usize,
}

fn parse<R: Read>(path: &str, mut reader: R, size: u64) -> Result<Array<R>, FileError> {
    let malformed = |what| malformed(path, what);
    let io = |source: io::Error| match source.kind() {
        io::ErrorKind::UnexpectedEof => malformed("the header is cut off"),
        _ => FileError::io(Path::new(path), source),
    };
    let mut start = [0; 8];
    reader.read_exact(&mut start).map_err(io)?;
    if !start.starts_with(MAGIC) {
        return Err(malformed("it does not begin with \\x93NUMPY"));
    }
    let mut length = [0; 4];
    let width = if start[6] == 1 { 2 } else { 4 };
    reader.read_exact(&mut length[..width]).map_err(io)?;
    let length = u64::from(u32::from_le_bytes(length));
    let before = 8 + width as u64 + length;
    if before > size {
        return Err(malformed("the header is cut off"));
    }
    let mut text = Vec::new();
    reader
        .by_ref()
        .take(length)
        .read_to_end(&mut text)
        .map_err(io)?;
    let header = Header::parse(path, &String::from_utf8_lossy(&text))?;
    let elements = header
        .rows
        .checked_mul(header.columns)
        .and_then(|n| n.checked_mul(header.width));
    let expected = elements.map_or(u64::MAX, |n| n as u64);
    if size - before < expected {
        let message = format!(
            "cut off: {expected} bytes of elements expected, {} found",
            size - before
        );
        return Err(FileError::contents(path, Place::Within, message));
    }
    Ok(Array {
        path: path.to_owned(),
        header,
        elements: reader,
    })
}

fn malformed(path: &str, defect: &str) -> FileError {
    FileError::contents(path, Place::Within, format!("not a NumPy array: {defect}"))
}

impl Header {
    fn parse(path: &str, text: &str) -> Result<Self, FileError> {
        let malformed = |what| malformed(path, what);
        let after = |key: &str| {
            let (_, rest) = text.split_once(key)?;
            Some(
                rest.trim_start_matches(['\'', '"'])
                    .trim_start()
                    .strip_prefix(':')?
                    .trim_start(),
            )
        };
        let dtype = after("descr").ok_or_else(|| malformed("its header has no type"))?;
        let unknown = || {
            let dtype: String = dtype.chars().take_while(|c| *c != ',').take(30).collect();
            let message =
                format!("elements of type {dtype} are not read, only f4, f8, i1 … i8, u1 … u8");
            FileError::contents(path, Place::Within, message)
        };
        let code = dtype
            .strip_prefix(['\'', '"'])
            .and_then(|d| d.split(['\'', '"']).next());
        let (big_endian, kind, width) =
            element_type(code.ok_or_else(unknown)?).ok_or_else(unknown)?;
        let fortran = after("fortran_order").ok_or_else(|| malformed("its header has no order"))?;
        let shape = after("shape").and_then(|s| s.strip_prefix('(')?.split_once(')'));
        let (shape, _) = shape.ok_or_else(|| malformed("its header has no shape"))?;
        let sizes: Option<Vec<usize>> = shape
            .split(',')
            .map(str::trim)
            .filter(|s| !s.is_empty())
            .map(|s| s.parse().ok())
            .collect();
        let (rows, columns) = match sizes.as_deref() {
            Some(&[rows]) => (rows, 1),
            Some(&[rows, columns]) => (rows, columns),
            Some(other) => {
                let message = format!(
                    "an array of {} dimensions, samples × columns are needed",
                    other.len()
                );
                return Err(FileError::contents(path, Place::Within, message));
            }
            None => return Err(malformed("its header has no shape")),
        };
        Ok(Self {
            kind,
            width,
            big_endian,
            fortran: fortran.starts_with("True"),
            rows,
            columns,
        })
    }

    #[inline]
    fn element(&self, bytes: &[u8]) -> f64 {
        let mut wide = [0_u8; 8];
        for (i, byte) in wide.iter_mut().enumerate().take(self.width) {
            *byte = bytes[if self.big_endian {
                self.width - 1 - i
            } else {
                i
            }];
        }
        let unsigned = u64::from_le_bytes(wide);
        let unused = 64 - 8 * self.width as u32;
        match (self.kind, self.width) {
            (b'f', 8) => f64::from_bits(unsigned),
            (b'f', _) => f64::from(f32::from_bits(unsigned as u32)),
            (b'u', _) => unsigned as f64,
            _ => (((unsigned << unused) as i64) >> unused) as f64,
        }
    }
}

/// Byte order, kind and width of a type code such as `<f8`.
fn element_type(code: &str) -> Option<(bool, u8, usize)> {
    let &[order, kind, width] = code.as_bytes() else {
        return None;
    };
    let width = usize::from(width.checked_sub(b'0')?);
    let known = match kind {
        b'f' => matches!(width, 4 | 8),
        b'i' | b'u' => matches!(width, 1 | 2 | 4 | 8),
        _ => false,
    };
    (known && matches!(order, b'<' | b'>' | b'|' | b'=')).then_some((order == b'>', kind, width))
}

impl<R: Read> Array<R> {
    /// Its rows.
    pub(crate) const fn rows(&self) -> usize {
        self.header.rows
    }

    /// Its columns.
    pub(crate) const fn columns(&self) -> usize {
        self.header.columns
    }

    /// Shows every element, with its row and column, in the order of the file.
    ///
    /// # Errors
    /// When it cannot be read, and what `show` returns.
    pub(crate) fn each(
        mut self,
        mut show: impl FnMut(usize, usize, f64) -> Result<(), FileError>,
    ) -> Result<(), FileError> {
        let Header {
            rows,
            columns,
            width,
            fortran,
            ..
        } = self.header;
        let mut bytes = [0; 8];
        for i in 0..rows * columns {
            let element = &mut bytes[..width];
            self.elements
                .read_exact(element)
                .map_err(|source| FileError::io(Path::new(&self.path), source))?;
            let (row, column) = if fortran {
                (i % rows, i / rows)
            } else {
                (i / columns, i % columns)
            };
            show(row, column, self.header.element(element))?;
        }
        Ok(())
    }
}

/// Writes the header of a C-ordered array of `f64`; the elements follow, little-endian, row by row.
///
/// # Errors
/// When the system refuses.
pub(crate) fn write_header(to: &mut impl Write, rows: usize, columns: usize) -> io::Result<()> {
    let mut text =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    // Elements begin at a multiple of 64 bytes; the header ends in a newline.
    while !(10 + text.len() + 1).is_multiple_of(64) {
        text.push(' ');
    }
    text.push('\n');
    to.write_all(MAGIC)?;
    to.write_all(&[1, 0])?;
    to.write_all(&(text.len() as u16).to_le_bytes())?;
    to.write_all(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u8, header: &str, elements: &[u8]) -> Vec<u8> {
        let length = header.len() as u32;
        let mut bytes = [
            MAGIC,
            &[version, 0],
            &length.to_le_bytes()[..if version == 1 { 2 } else { 4 }],
        ]
        .concat();
        bytes.extend(header.as_bytes());
        bytes.extend(elements);
        bytes
    }

    /// The columns.
    fn read_bytes(bytes: &[u8]) -> Result<Vec<Vec<f64>>, FileError> {
        let array = parse("a.npy", bytes, bytes.len() as u64)?;
        let mut columns = vec![Vec::new(); array.columns()];
        array.each(|row, column, value| {
            assert_eq!(columns[column].len(), row);
            columns[column].push(value);
            Ok(())
        })?;
        Ok(columns)
    }

    #[test]
    fn what_is_written_reads_back() {
        let mut bytes = Vec::new();
        write_header(&mut bytes, 3, 2).unwrap();
        assert_eq!(bytes.len() % 64, 0);
        for v in [0.1_f64, -2.0, 3e-300, 4.0, 5.0, 6.0] {
            bytes.extend(v.to_le_bytes());
        }
        let expected = vec![vec![0.1, 3e-300, 5.0], vec![-2.0, 4.0, 6.0]];
        assert_eq!(read_bytes(&bytes).unwrap(), expected);
    }

    /// Bytes as numpy 2.x writes them: `np.save` of a Fortran-ordered big-endian int16 array.
    #[test]
    fn orders_types_and_versions() {
        let header = "{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }\n";
        let elements: Vec<u8> = [1_i16, -2, 3, -4, 5, -6]
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect();
        let expected = vec![vec![1.0, -2.0], vec![3.0, -4.0], vec![5.0, -6.0]];
        for version in [1, 2, 3] {
            assert_eq!(
                read_bytes(&file(version, header, &elements)).unwrap(),
                expected
            );
        }
        let vector = file(
            1,
            "{'descr': '<f4', 'fortran_order': False, 'shape': (2,), }",
            &[0, 0, 128, 63, 0, 0, 0, 192],
        );
        assert_eq!(read_bytes(&vector).unwrap(), [[1.0, -2.0]]);
    }

    #[test]
    fn refusals_say_what_is_wrong() {
        let message = |bytes: &[u8]| read_bytes(bytes).unwrap_err().to_string();
        let with = |header: &str| message(&file(1, header, &[0; 8]));
        assert_eq!(
            message(b"PK\x03\x04 zip file"),
            "a.npy: not a NumPy array: it does not begin with \\x93NUMPY"
        );
        assert_eq!(
            message(b"\x93NUM"),
            "a.npy: not a NumPy array: the header is cut off"
        );
        assert_eq!(
            with("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"),
            "a.npy: elements of type '|O' are not read, only f4, f8, i1 … i8, u1 … u8"
        );
        assert_eq!(
            with("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,), }"),
            "a.npy: elements of type [('a' are not read, only f4, f8, i1 … i8, u1 … u8"
        );
        assert_eq!(
            with("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1, 1), }"),
            "a.npy: an array of 3 dimensions, samples × columns are needed"
        );
        assert_eq!(
            with("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 6), }"),
            "a.npy: cut off: 96 bytes of elements expected, 8 found"
        );
        assert_eq!(
            with("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 99999999999), }"),
            "a.npy: cut off: 18446744073709551615 bytes of elements expected, 8 found"
        );
    }

    mod garbage {
        use super::*;
        use proptest::prelude::*;

        proptest! {
            #[test]
            fn never_panics(header in ".{0,80}", tail in prop::collection::vec(any::<u8>(), 0..64), version in 0u8..4) {
                let _ = read_bytes(&file(version, &header, &tail));
            }

            #[test]
            fn never_panics_on_any_shape(rows: u64, columns: u64, tail in prop::collection::vec(any::<u8>(), 0..64)) {
                let header = format!("{{'descr': '<f8', 'fortran_order': True, 'shape': ({rows}, {columns}), }}");
                let _ = read_bytes(&file(1, &header, &tail));
            }
        }
    }
}
