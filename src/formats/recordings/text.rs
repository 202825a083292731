//! Text tables: comment head, header, rows.

use super::error::{COLUMNS, empty, sample, shown, unreadable};
use super::header::{HeaderPlace, Layout, Role, classify};
use super::lines::Blanks;
use super::options::ReadOptions;
use super::table::{BETWEEN, BEYOND, Column, LARGEST, Lines, Notes, Raw, empty_columns, fits};
use crate::formats::error::decimal_comma;
use crate::formats::{FileError, Kind, Place, Setting, source};
use std::io::{BufRead, Cursor, Read};
use std::path::Path;

type Reader = Box<dyn BufRead>;

/// Longest line a header may be; what is longer is no text table.
const LONGEST_HEADER: u64 = 1 << 16;
const BUFFER: usize = 1 << 17;

/// Reads a text table.
pub(super) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let name = path.display().to_string();
    let io = |source| unreadable(path, source);
    let reader = source::table(path).map_err(io)?;
    parse(&name, reader, options)
}

/// Reads a text table from its bytes.
pub(super) fn parse(
    name: &str,
    mut reader: Reader,
    options: &ReadOptions,
) -> Result<Raw, FileError> {
    let head = Head::read(name, &mut reader, options)?;
    let place = HeaderPlace {
        path: name,
        line: head.line,
    };
    let layout = Layout::new(place, &head.names, head.xsens, options.channels.as_deref())?;
    let (indices, mut columns) = empty_columns(&layout);
    let mut notes = Notes::default();
    if head.is_latin_1 && options.columns.is_none() {
        notes
            .assumptions
            .push("header not in UTF-8, taken as ISO-8859-1".to_owned());
    }
    let lines = read_rows(name, reader, &head, &indices, &mut columns, &mut notes)?;
    if lines.is_empty() {
        return Err(empty(name));
    }
    columns.retain(|c| c.role != Role::Ticks || c.values.iter().all(|v| v.is_finite()));
    let head_rate = head.rate_hz.map(|rate_hz| (rate_hz, "head of the file"));
    let ignored = layout.ignored;
    Ok(Raw {
        path: name.to_owned(),
        columns,
        ignored,
        head_rate,
        lines,
        notes,
    })
}

/// What stands before the rows.
#[derive(Debug)]
struct Head {
    names: Vec<String>,
    delimiter: u8,
    /// Line of the header, from 1.
    line: u64,
    /// Lines before the first row that `reader` still holds (or `first_row`).
    lines_before: u64,
    /// The first row, where it was read while looking for a header.
    first_row: Vec<u8>,
    /// Whether the head is that of an Xsens MT Manager export.
    xsens: bool,
    rate_hz: Option<f64>,
    /// Whether the header is no UTF-8: `²` and `°` are one byte each then.
    is_latin_1: bool,
}

impl Head {
    fn read(name: &str, reader: &mut Reader, options: &ReadOptions) -> Result<Self, FileError> {
        let (mut line, mut xsens, mut rate_hz) = (0, false, None);
        loop {
            let mut bytes = Vec::new();
            let io = |source| unreadable(Path::new(name), source);
            reader
                .by_ref()
                .take(LONGEST_HEADER)
                .read_until(b'\n', &mut bytes)
                .map_err(io)?;
            if bytes.is_empty() {
                return Err(empty(name));
            }
            if let Some(what) = no_text(&bytes) {
                let message = format!("is no table of text: {what}");
                return Err(FileError::contents(name, Place::Itself, message).advice(
                    "save it as CSV in UTF-8, one row a line; arrays end in .npy, gzipped tables in .gz",
                ));
            }
            line += 1;
            let utf_8 = std::str::from_utf8(&bytes).ok().map(str::to_owned);
            let is_latin_1 = utf_8.is_none();
            let text = utf_8.unwrap_or_else(|| bytes.iter().map(|b| char::from(*b)).collect());
            let text = text.trim_start_matches('\u{feff}').trim();
            if let Some(comment) = text.strip_prefix("//") {
                xsens = true;
                rate_hz = rate_hz.or_else(|| rate_in(comment));
                continue;
            }
            if text.is_empty() || text.to_lowercase().starts_with("sep=") {
                continue;
            }
            let header = text.trim_start_matches(['#', '%']).trim_start();
            let delimiter = delimiter_of(header);
            let cells = match delimiter {
                b' ' => split(
                    &header
                        .split_ascii_whitespace()
                        .collect::<Vec<_>>()
                        .join(" "),
                    delimiter,
                ),
                _ => split(header, delimiter),
            };
            if text.starts_with(['#', '%'])
                && Layout::new(HeaderPlace { path: name, line }, &cells, xsens, None).is_err()
            {
                continue;
            }
            let numeric = cells.iter().all(|c| c.trim().parse::<f64>().is_ok());
            let names = match &options.columns {
                Some(names) => names.clone(),
                None if numeric || (bytes.len() as u64) == LONGEST_HEADER => {
                    return Err(no_header(name, line, &shown(text, 60)));
                }
                None => cells,
            };
            let first_row = if numeric { bytes } else { Vec::new() };
            let lines_before = if numeric { line - 1 } else { line };
            return Ok(Self {
                names,
                delimiter,
                line,
                lines_before,
                first_row,
                xsens,
                rate_hz,
                is_latin_1,
            });
        }
    }
}

fn no_header(path: &str, line: u64, found: &str) -> FileError {
    let message = format!("a header that names the columns is missing, found \"{found}\"");
    FileError::new(path, line, Kind::Header(message.into()))
        .advice(COLUMNS)
        .setting(Setting::ColumnNames)
}

/// The rate in a comment such as `Update Rate: 100.0Hz`.
fn rate_in(comment: &str) -> Option<f64> {
    let lower = comment.to_lowercase();
    let words = ["update rate", "sample rate", "sampling rate", "output rate"];
    let after = words.iter().find_map(|w| lower.split_once(w))?.1;
    let value = after.trim_start_matches(|c: char| !c.is_ascii_digit());
    let digits: String = value
        .chars()
        .take_while(|c| c.is_ascii_digit() || *c == '.')
        .collect();
    digits.parse().ok().filter(|r: &f64| *r > 0.0)
}

fn delimiter_of(header: &str) -> u8 {
    let count = |d: u8| header.bytes().filter(|b| *b == d).count();
    // Of equals, the last. Spaces separate only where nothing else does and they are not inside one name.
    let best = [b',', b';', b'\t']
        .into_iter()
        .max_by_key(|d| count(*d))
        .filter(|d| count(*d) > 0);
    let spaced = count(b' ') > 0 && classify(header, true).is_none();
    best.unwrap_or(if spaced { b' ' } else { b',' })
}

/// The cells of a line, quotes removed, without empty ones at the end.
fn split(text: &str, delimiter: u8) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .delimiter(delimiter)
        .from_reader(text.as_bytes());
    let mut record = csv::ByteRecord::new();
    let read = reader.read_byte_record(&mut record);
    let mut cells: Vec<String> = match read {
        Ok(true) => record
            .iter()
            .map(|c| String::from_utf8_lossy(c).trim().to_owned())
            .collect(),
        _ => Vec::new(),
    };
    while cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    cells
}

/// Appends every row's values to their columns; what is passed over becomes a note.
fn read_rows(
    name: &str,
    reader: Reader,
    head: &Head,
    indices: &[usize],
    columns: &mut [Column],
    notes: &mut Notes,
) -> Result<Lines, FileError> {
    let rows = Cursor::new(head.first_row.clone()).chain(reader);
    let rows: Box<dyn Read> = if head.delimiter == b' ' {
        Box::new(Blanks::new(rows))
    } else {
        Box::new(rows)
    };
    let mut rows = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(head.delimiter)
        .buffer_capacity(BUFFER)
        .from_reader(rows);
    let (mut lines, mut record, mut sample) = (Lines::default(), csv::ByteRecord::new(), 0);
    let mut has_units = false;
    let expected = head.names.len();
    // of a packed file no more than what is read is known
    let length = std::fs::metadata(name).map_or(0, |m| m.len());
    let cannot = |e| unreadable(Path::new(name), of_csv(e));
    while rows.read_byte_record(&mut record).map_err(cannot)? {
        let line = head.lines_before + line_of(&record, rows.position().line());
        let found = record.len();
        if sample == 0 && !has_units && found == expected && is_words(&record) {
            has_units = true;
            notes
                .assumptions
                .push(format!("line {line} has words and no numbers: passed over"));
            continue;
        }
        let trailing = found == expected + 1
            && record
                .get(expected)
                .is_some_and(|c| c.trim_ascii().is_empty());
        if found != expected && !trailing {
            if record.iter().all(|c| c.trim_ascii().is_empty()) {
                continue;
            }
            // a logger that lost its power within a row
            if found < expected
                && sample > 0
                && !rows.read_byte_record(&mut record).map_err(cannot)?
            {
                notes
                    .assumptions
                    .push(format!("line {line}, the last, is cut off: left out"));
                break;
            }
            return Err(FileError::row_length(name, line, found, expected));
        }
        if sample % BETWEEN == 0 {
            let expected = (sample as u64).saturating_mul(length) / rows.position().byte().max(1);
            fits(name, columns, expected.max((sample + BETWEEN) as u64))?;
        }
        for (index, column) in indices.iter().zip(columns.iter_mut()) {
            let cell = record.get(*index).unwrap_or_default();
            match number(cell) {
                Some(value) if value.abs() <= LARGEST => column.values.push(value),
                // A clock that the exporter leaves empty is no clock: passed over below.
                _ if column.role == Role::Ticks => column.values.push(f64::NAN),
                parsed => return Err(bad_cell(name, line, &column.name, cell, parsed)),
            }
        }
        lines.push(sample, line);
        sample += 1;
    }
    Ok(lines)
}

/// Whether a row has units, say, below the names: no cell begins as a number does.
fn is_words(record: &csv::ByteRecord) -> bool {
    let begins = |cell: &[u8]| cell.trim_ascii().first().copied();
    let is_word = |cell: &[u8]| {
        number(cell).is_none()
            && begins(cell).is_none_or(|b| !b.is_ascii_digit() && !b"+-.".contains(&b))
    };
    record.iter().all(is_word) && record.iter().any(|cell| begins(cell).is_some())
}

/// What the system said, with its kind.
fn of_csv(e: csv::Error) -> std::io::Error {
    match e.into_kind() {
        csv::ErrorKind::Io(source) => source,
        other => std::io::Error::other(format!("{other:?}")),
    }
}

/// What a line shows a file to be that is no text of lines, if it does.
fn no_text(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Some("it is in UTF-16");
    }
    let control = bytes
        .iter()
        .filter(|b| b.is_ascii_control() && !b"\t\r\n".contains(b))
        .count();
    if bytes.contains(&0) || 20 * control > bytes.len() {
        return Some("it is binary");
    }
    let lone = bytes
        .windows(2)
        .any(|pair| pair[0] == b'\r' && !b"\r\n".contains(&pair[1]));
    lone.then_some("its lines end in a carriage return only")
}

/// Line of a record that ended before line `next`. (The record's own position is that before any empty
/// lines.)
fn line_of(record: &csv::ByteRecord, next: u64) -> u64 {
    let start = record.position().map_or(0, csv::Position::line);
    // behind a last row without a line end the reader stands in the row itself
    if next <= start + 1 {
        return start;
    }
    let inside = record.as_slice().iter().filter(|b| **b == b'\n').count() as u64;
    next.saturating_sub(1 + inside)
}

#[inline]
pub(super) fn number(cell: &[u8]) -> Option<f64> {
    std::str::from_utf8(cell.trim_ascii()).ok()?.parse().ok()
}

fn bad_cell(path: &str, line: u64, column: &str, cell: &[u8], parsed: Option<f64>) -> FileError {
    let value = shown(&String::from_utf8_lossy(cell.trim_ascii()), 40);
    let quoted = format!("\"{value}\"");
    match parsed {
        None if decimal_comma(&value) => {
            FileError::cell(path, line, column, quoted, "is not a number")
        }
        None => sample(path, line, column, &quoted, "is not a number"),
        Some(number) if number.is_finite() => sample(path, line, column, &value, BEYOND),
        Some(_) => sample(path, line, column, &quoted, "is not finite"),
    }
}
