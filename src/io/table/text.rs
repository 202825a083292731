//! Tables of text: RFC 4180 with `,` `;` tab or blanks, comments and other lines before the header.

use super::quantity::find;
use super::{Asked, BETWEEN, Dictionary, Table, empty, shown, unreadable};
use crate::io::{Failure, Place, help};
use std::io::{BufRead, Cursor, Read};
use std::path::Path;

type Reader = Box<dyn BufRead>;

/// Longest line before the rows (bytes); what is longer is no table of text.
const LONGEST: u64 = 1 << 16;
/// Lines that may stand before the header.
const MOST_BEFORE: u64 = 200;
const BUFFER: usize = 1 << 17;

/// Reads a table.
pub(super) fn read(
    path: &str,
    mut reader: Reader,
    dictionary: &Dictionary,
    asked: &Asked<'_>,
) -> Result<Table, Failure> {
    let head = Head::read(path, &mut reader, dictionary, asked)?;
    let (mut table, places) = Table::new(
        path,
        head.line,
        &head.names,
        dictionary,
        asked,
        head.is_xsens,
    )?;
    table.rate_hz = head.rate_hz.map(|rate_hz| (rate_hz, "head of the file"));
    table.is_bare = head.is_bare;
    if head.is_latin_1 && asked.names.is_none() {
        let text = "header not in UTF-8, taken as ISO-8859-1";
        table.assumptions.push(text.to_owned());
    }
    if !table.columns.is_empty() {
        head.rows(&mut table, reader, &places, dictionary)?;
    }
    table.comments.splice(..0, head.comments);
    Ok(table)
}

/// Lines before the rows.
struct Head {
    names: Vec<String>,
    delimiter: u8,
    /// Line of the header, from 1.
    line: u64,
    /// Lines before the rows, and the first row where it was read in search of a header.
    before: u64,
    first_row: Vec<u8>,
    comments: Vec<String>,
    /// True if it is that of an Xsens MT Manager export, which is in SI.
    is_xsens: bool,
    rate_hz: Option<f64>,
    /// True if there is no header.
    is_bare: bool,
    /// True if the header is no UTF-8: `²` and `°` are one byte each then.
    is_latin_1: bool,
}

impl Head {
    fn read(
        path: &str,
        reader: &mut Reader,
        dictionary: &Dictionary,
        asked: &Asked<'_>,
    ) -> Result<Self, Failure> {
        let mut head = Self {
            names: Vec::new(),
            delimiter: b',',
            line: 0,
            before: 0,
            first_row: Vec::new(),
            comments: Vec::new(),
            is_xsens: false,
            rate_hz: None,
            is_bare: false,
            is_latin_1: false,
        };
        // the first line of words, which is the header where none names a quantity
        let mut words: Option<(u64, Vec<String>)> = None;
        for line in 1.. {
            let mut bytes = Vec::new();
            let read = reader.by_ref().take(LONGEST).read_until(b'\n', &mut bytes);
            read.map_err(|e| unreadable(Path::new(path), e))?;
            let is_end = bytes.is_empty() || line > MOST_BEFORE;
            if is_end && let Some((line, names)) = words.take() {
                (head.line, head.names) = (line, names);
                return Ok(head);
            }
            if is_end {
                return Err(empty(path));
            }
            if let Some(what) = no_text(&bytes) {
                let message = format!("is no table of text: {what}");
                return Err(Failure::contents(path, Place::Itself, message).or_hint(
                    "save it as CSV in UTF-8, one row a line; arrays end in .npy, gzipped tables in .gz",
                ));
            }
            let utf_8 = std::str::from_utf8(&bytes).ok().map(str::to_owned);
            head.is_latin_1 = utf_8.is_none();
            let text = utf_8.unwrap_or_else(|| bytes.iter().map(|b| char::from(*b)).collect());
            let text = text.trim_start_matches('\u{feff}').trim();
            if let Some(comment) = text.strip_prefix("//") {
                head.is_xsens = true;
                head.rate_hz = head.rate_hz.or_else(|| rate_in(comment));
                continue;
            }
            if text.is_empty() || text.to_lowercase().starts_with("sep=") {
                continue;
            }
            let inside = text.trim_start_matches(['#', '%']).trim();
            let delimiter = delimiter_of(inside, dictionary);
            let cells = split(inside, delimiter);
            let known = |cell: &&String| {
                find(dictionary.quantities, cell).is_some_and(|(q, _)| q.rank.is_none())
            };
            let known = cells.iter().filter(known).count();
            if inside.len() < text.len() {
                head.comments.push(inside.to_owned());
                // words between blanks may be those of a sentence
                if known == 0 || delimiter == b' ' && 2 * known + 1 < cells.len() {
                    continue;
                }
            }
            (head.delimiter, head.line, head.before) = (delimiter, line, line);
            if cells
                .iter()
                .all(|c| number(c.as_bytes(), delimiter).is_some())
            {
                (head.first_row, head.before) = (bytes, line - 1);
                if let Some((line, names)) = words.take() {
                    // what names no quantity is the header all the same: its reader says what it lacks
                    (head.line, head.names) = (line, names);
                    return Ok(head);
                }
                head.is_bare = asked.names.is_none();
                head.names = asked
                    .names
                    .map(<[String]>::to_vec)
                    .or_else(|| layout(dictionary.bare, cells.len()))
                    .ok_or_else(|| no_header(path, line, &cells, text, dictionary))?;
                return Ok(head);
            }
            let names = asked.names.map_or(cells, <[String]>::to_vec);
            if known > 0 || asked.names.is_some() {
                head.names = names;
                return Ok(head);
            }
            words.get_or_insert((line, names));
        }
        unreachable!("the lines end")
    }

    /// Appends the rows; what is passed over becomes a note.
    fn rows(
        &self,
        table: &mut Table,
        reader: Reader,
        places: &[Option<usize>],
        dictionary: &Dictionary,
    ) -> Result<(), Failure> {
        let path = table.path.clone();
        let rows = Cursor::new(self.first_row.clone()).chain(reader);
        let rows: Box<dyn Read> = match self.delimiter {
            b' ' => Box::new(Blanks {
                inner: rows,
                is_inside: false,
            }),
            _ => Box::new(rows),
        };
        let mut rows = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.delimiter)
            .buffer_capacity(BUFFER)
            .from_reader(rows);
        // of a packed file no more than what is read is known
        let length = std::fs::metadata(&path).map_or(0, |m| m.len());
        let cannot = |e| unreadable(Path::new(&path), of_csv(e));
        let (mut record, mut row, mut has_units) = (csv::ByteRecord::new(), 0, false);
        let expected = places.len();
        while rows.read_byte_record(&mut record).map_err(cannot)? {
            let line = self.before + line_of(&record, rows.position().line());
            let found = record.len();
            let first = record.get(0).unwrap_or_default().trim_ascii_start();
            if first.starts_with(b"#") || first.starts_with(b"%") {
                let cells: Vec<&[u8]> = record.iter().collect();
                let text = String::from_utf8_lossy(&cells.join(&self.delimiter)).into_owned();
                table
                    .comments
                    .push(text.trim_start_matches(['#', '%', ' ']).to_owned());
                continue;
            }
            if row == 0 && !has_units && found == expected && is_words(&record) {
                has_units = true;
                let text = format!("line {line} has words and no numbers: passed over");
                table.assumptions.push(text);
                continue;
            }
            let is_empty = |cell: &[u8]| cell.trim_ascii().is_empty();
            let is_trailing = found == expected + 1 && record.get(expected).is_some_and(is_empty);
            if found != expected && !is_trailing {
                if record.iter().all(is_empty) {
                    continue;
                }
                // a logger that lost its power within a row
                let is_cut = found < expected && row > 0;
                if is_cut && !rows.read_byte_record(&mut record).map_err(cannot)? {
                    let text = format!("line {line}, the last, is cut off: left out");
                    table.assumptions.push(text);
                    break;
                }
                return Err(Failure::row_length(&path, line, found, expected));
            }
            if row % BETWEEN == 0 {
                let all = (row as u64).saturating_mul(length) / rows.position().byte().max(1);
                table.fits(all.max((row + BETWEEN) as u64))?;
            }
            for (cell, column) in record.iter().zip(places) {
                let Some(column) = *column else { continue };
                let value = match number(cell, self.delimiter) {
                    Some(value) => value,
                    None if table.columns[column].quantity.may_be_empty => f64::NAN,
                    None => {
                        let value = shown(&String::from_utf8_lossy(cell.trim_ascii()), 40);
                        let (value, reason) = (format!("\"{value}\""), "is not a number");
                        let name = &table.columns[column].name;
                        return Err(table.bad_cell(name, line, &value, reason, dictionary));
                    }
                };
                table.push(column, value, Some(cell), line, dictionary)?;
            }
            table.lines.push(line);
            row += 1;
        }
        Ok(())
    }
}

/// The names of so many columns.
pub(super) fn layout(layouts: &[&[&str]], columns: usize) -> Option<Vec<String>> {
    let found = layouts.iter().find(|names| names.len() == columns)?;
    Some(found.iter().map(|name| (*name).to_owned()).collect())
}

fn no_header(
    path: &str,
    line: u64,
    cells: &[String],
    text: &str,
    dictionary: &Dictionary,
) -> Failure {
    let refused =
        |message: String| Failure::contents(path, line, message).or_hint(dictionary.advice);
    if !dictionary.bare.is_empty() {
        return refused(format!("{} columns without a header", cells.len()));
    }
    let found = shown(text, 60);
    refused(format!(
        "a header that names the columns is missing, found \"{found}\""
    ))
    .or(help::COLUMN_NAMES)
}

/// The rate in a comment such as `Update Rate: 100.0Hz`.
fn rate_in(comment: &str) -> Option<f64> {
    let lower = comment.to_lowercase();
    let words = ["update rate", "sample rate", "sampling rate", "output rate"];
    let after = words.iter().find_map(|w| lower.split_once(w))?.1;
    let value = after.trim_start_matches(|c: char| !c.is_ascii_digit());
    let end = value.find(|c: char| !c.is_ascii_digit() && c != '.');
    let digits = &value[..end.unwrap_or(value.len())];
    digits.parse().ok().filter(|r: &f64| *r > 0.0)
}

/// The separator of the cells of a line: of equals the last. Blanks do only where nothing else does and they are not inside
/// one name.
fn delimiter_of(line: &str, dictionary: &Dictionary) -> u8 {
    let count = |d: u8| line.bytes().filter(|b| *b == d).count();
    let most = [b',', b';', b'\t'].into_iter().max_by_key(|d| count(*d));
    let is_spaced = count(b' ') > 0 && find(dictionary.quantities, line).is_none();
    most.filter(|d| count(*d) > 0)
        .unwrap_or(if is_spaced { b' ' } else { b',' })
}

/// The cells of a line, quotes removed, without empty ones at the end.
fn split(text: &str, delimiter: u8) -> Vec<String> {
    let blanks: String;
    let text = match delimiter {
        b' ' => {
            blanks = text.split_ascii_whitespace().collect::<Vec<_>>().join(" ");
            &blanks
        }
        _ => text,
    };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .delimiter(delimiter)
        .from_reader(text.as_bytes());
    let record = reader
        .records()
        .next()
        .and_then(Result::ok)
        .unwrap_or_default();
    let mut cells: Vec<String> = record.iter().map(|c| c.trim().to_owned()).collect();
    while cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    cells
}

/// True if a row has units, say, below the names: no cell begins as a number does.
fn is_words(record: &csv::ByteRecord) -> bool {
    let first = |cell: &[u8]| cell.trim_ascii().first().copied();
    let is_word = |cell: &[u8]| {
        let begins = |b: u8| !b.is_ascii_digit() && !b"+-.".contains(&b);
        number(cell, b',').is_none() && first(cell).is_none_or(begins)
    };
    record.iter().all(is_word) && record.iter().any(|cell| first(cell).is_some())
}

/// Error of the system, with its kind.
fn of_csv(e: csv::Error) -> std::io::Error {
    match e.into_kind() {
        csv::ErrorKind::Io(source) => source,
        other => std::io::Error::other(format!("{other:?}")),
    }
}

/// The reason why a line is no text, if there is one.
fn no_text(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Some("it is in UTF-16");
    }
    if bytes.len() as u64 == LONGEST {
        return Some("a line is longer than 64 KiB");
    }
    let is_control = |b: &&u8| b.is_ascii_control() && !b"\t\r\n".contains(b);
    if bytes.contains(&0) || 20 * bytes.iter().filter(is_control).count() > bytes.len() {
        return Some("it is binary");
    }
    let is_lone = |pair: &[u8]| pair[0] == b'\r' && !b"\r\n".contains(&pair[1]);
    let has_lone = bytes.windows(2).any(is_lone);
    has_lone.then_some("its lines end in a carriage return only")
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

/// A number; with a decimal comma where semicolons separate.
#[inline]
pub(super) fn number(cell: &[u8], delimiter: u8) -> Option<f64> {
    let text = std::str::from_utf8(cell.trim_ascii()).ok()?;
    let comma = || text.replacen(',', ".", 1).parse().ok();
    let parsed = text.parse().ok();
    parsed.or_else(|| if delimiter == b';' { comma() } else { None })
}

/// Bytes with one blank for several blanks and tabs, and none at the beginning of a line.
struct Blanks<R> {
    inner: R,
    /// True if a blank may follow.
    is_inside: bool,
}

impl<R: Read> Read for Blanks<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            let count = self.inner.read(buffer)?;
            let mut kept = 0;
            for i in 0..count {
                let byte = if buffer[i] == b'\t' { b' ' } else { buffer[i] };
                if byte != b' ' || self.is_inside {
                    buffer[kept] = byte;
                    kept += 1;
                }
                self.is_inside = !b" \r\n".contains(&byte);
            }
            // blanks alone are not the end
            if kept > 0 || count == 0 {
                return Ok(kept);
            }
        }
    }
}
