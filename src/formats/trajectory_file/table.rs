//! Text tables of numbers.

use crate::formats::{FileError as Error, Kind, Place, source};
use std::io::{BufRead, Read};
use std::path::Path;

/// A text table of numbers.
#[derive(Debug)]
pub(in crate::formats) struct Table {
    pub(in crate::formats) path: String,
    /// Line of the header, from 1.
    pub(in crate::formats) header_line: u64,
    pub(in crate::formats) columns: Vec<String>,
    /// The lines that begin with `#`, without it.
    pub(in crate::formats) comments: Vec<String>,
    /// Line in the file, values.
    pub(in crate::formats) rows: Vec<(u64, Vec<f64>)>,
}

/// Opens a file, unpacking it when its name ends in `.gz`.
pub(in crate::formats) fn open(path: &Path) -> Result<Box<dyn BufRead>, Error> {
    source::table(path).map_err(|source| Error::io(path, source))
}

/// The whole text of a file; what is not UTF-8 in it (a degree sign of another encoding) is replaced.
pub(in crate::formats) fn text(path: &Path) -> Result<String, Error> {
    let mut bytes = Vec::new();
    let io = |source| Error::io(path, source);
    open(path)?.read_to_end(&mut bytes).map_err(io)?;
    Ok(source::without_mark(
        String::from_utf8_lossy(&bytes).into_owned(),
    ))
}

/// Which numbers a table may hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::formats) enum Numbers {
    /// A cell that is not finite is refused.
    Finite,
    /// Any: who reads it leaves those rows out.
    Any,
    /// Any, and a row may end where this column begins: the cells from there on are then empty, and read as NaN.
    UpTo(&'static str),
}

/// Longest line of a table (bytes).
const LONGEST_LINE: u64 = 1 << 16;

impl Table {
    /// Reads a table. Without `columns` its first line that is no comment names them; with them it has no
    /// header and its cells stand between blanks.
    pub(in crate::formats) fn read(
        path: &str,
        mut reader: impl BufRead,
        columns: Option<&[&str]>,
        numbers: Numbers,
    ) -> Result<Self, Error> {
        let mut separator = if columns.is_some() { ' ' } else { ',' };
        let mut table = Self::of_columns(path, columns.unwrap_or_default());
        let (mut number, mut bytes) = (0, Vec::new());
        loop {
            bytes.clear();
            let read = reader
                .by_ref()
                .take(LONGEST_LINE)
                .read_until(b'\n', &mut bytes);
            number += 1;
            match read.map_err(|source| Error::io(Path::new(path), source))? {
                0 => break,
                n if n as u64 == LONGEST_LINE => {
                    let message = "a line of more than 64 KiB: not a table of text";
                    return Err(Error::contents(path, number, message));
                }
                _ => {}
            }
            let line = String::from_utf8_lossy(&bytes);
            let text = line.trim_start_matches('\u{feff}').trim();
            if let Some(comment) = text.strip_prefix(['#', '%']) {
                table.comments.push(comment.trim().to_owned());
            } else if text.is_empty() {
            } else if table.columns.is_empty() {
                separator = separator_of(text);
                table.header(number, &cells(text, separator))?;
            } else {
                table.row(number, &cells(text, separator), numbers)?;
            }
        }
        if table.rows.is_empty() {
            Err(no_rows(path))
        } else {
            Ok(table)
        }
    }

    /// A table of these columns, without rows yet.
    pub(in crate::formats) fn of_columns(path: &str, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|&name| name.to_owned()).collect();
        Self {
            path: path.to_owned(),
            header_line: 0,
            columns,
            comments: Vec::new(),
            rows: Vec::new(),
        }
    }

    fn header(&mut self, line: u64, cells: &[&str]) -> Result<(), Error> {
        if cells.iter().all(|c| c.parse::<f64>().is_ok()) {
            let found: String = cells.join(",").chars().take(60).collect();
            let message = format!("a header that names the columns is missing, found \"{found}\"");
            return Err(
                Error::new(self.path.as_str(), line, Kind::Header(message.into())).advice(COLUMNS),
            );
        }
        self.header_line = line;
        self.columns = cells.iter().map(|&c| c.to_owned()).collect();
        Ok(())
    }

    fn row(&mut self, line: u64, cells: &[&str], numbers: Numbers) -> Result<(), Error> {
        let (found, expected) = (cells.len(), self.columns.len());
        if found != expected {
            return Err(Error::row_length(&self.path, line, found, expected));
        }
        let number = |(i, cell): (usize, &&str)| match cell.parse::<f64>() {
            Ok(value) if value.is_finite() || numbers != Numbers::Finite => Ok(value),
            Ok(_) => Err(self.cell(line, i, cell, "is not finite")),
            Err(_) => Err(self.cell(line, i, &format!("\"{cell}\""), "is not a number")),
        };
        let end = match numbers {
            Numbers::UpTo(name) => self.columns.iter().position(|c| c == name),
            _ => None,
        };
        let end = end
            .filter(|end| cells[*end..].iter().all(|cell| cell.is_empty()))
            .unwrap_or(expected);
        let mut values = cells[..end]
            .iter()
            .enumerate()
            .map(number)
            .collect::<Result<Vec<f64>, _>>()?;
        values.resize(expected, f64::NAN);
        self.rows.push((line, values));
        Ok(())
    }

    /// Where the columns of those names are.
    ///
    /// # Errors
    /// A name that is missing, or that two columns have.
    pub(in crate::formats) fn named<const N: usize>(
        &self,
        names: [&str; N],
    ) -> Result<[usize; N], Error> {
        let refused = |message: String| {
            Error::new(
                self.path.as_str(),
                self.header_line,
                Kind::Columns(message.into()),
            )
        };
        let mut found = [0; N];
        for (at, name) in found.iter_mut().zip(names) {
            let mut places = (0..self.columns.len()).filter(|i| self.columns[*i] == name);
            *at = places
                .next()
                .ok_or_else(|| refused(format!("no column is named \"{name}\"")))?;
            if places.next().is_some() {
                return Err(refused(format!("two columns are named \"{name}\"")));
            }
        }
        Ok(found)
    }

    /// The refusal of a cell.
    pub(in crate::formats) fn cell(
        &self,
        line: u64,
        column: usize,
        value: &str,
        reason: &'static str,
    ) -> Error {
        let (column, value) = (
            &self.columns[column],
            value.chars().take(40).collect::<String>(),
        );
        let error = Error::cell(&self.path, line, column, value, reason);
        if column.contains("_deg") {
            error.advice(DEGREES)
        } else {
            error
        }
    }
}

/// Columns of a trajectory.
pub(super) const COLUMNS: &str = "a trajectory has the columns t_s, lat_deg, lon_deg, h_m (or n_m, e_m, d_m) and may have roll_deg, pitch_deg, yaw_deg";
const DEGREES: &str = "degrees: latitude within ±89.9, longitude and yaw in (−180, 180] or [0, 360), pitch within ±90";

/// A file without rows.
pub(super) fn no_rows(path: &str) -> Error {
    Error::new(path, Place::Within, Kind::Empty("no rows in it"))
}

fn separator_of(header: &str) -> char {
    [',', ';', '\t']
        .into_iter()
        .find(|&s| header.contains(s))
        .unwrap_or(' ')
}

fn cells(line: &str, separator: char) -> Vec<&str> {
    if separator == ' ' {
        return line.split_whitespace().collect();
    }
    line.split(separator)
        .map(|c| c.trim().trim_matches('"'))
        .collect()
}
