//! Tables of numbers in files of any kind, and the dictionaries that say which quantities their columns hold.
//!
//! A reader is `read(path, &DICTIONARY, &asked)`: columns with a factor to SI and the line of each row.

mod containers;
mod quantity;
mod text;

pub(crate) use containers::is_oxts;
#[cfg(test)]
pub(crate) use quantity::find;
pub(crate) use quantity::{ACCELERATION, ANGLE, ANGULAR_RATE, NONE, SPEED, TIME};
pub(crate) use quantity::{Bare, Quantity, Units, normalised};

use super::suggest::nearest;
use super::{Failure, Place, help, logs, source};
use crate::failure::is_damage;
use nav_sim_logs::Kind as LogKind;
use std::fmt::Display;
use std::io::Cursor;
use std::path::Path;

/// Quantities of a kind of table, and words for what is refused.
pub(crate) struct Dictionary {
    /// Quantities; of several columns of one with a rank, the first by rank is taken.
    pub(crate) quantities: &'static [Quantity],
    /// Names of the columns of texts without a header, by their number.
    pub(crate) bare: &'static [&'static [&'static str]],
    /// Names of the columns of arrays without names.
    pub(crate) array: &'static [&'static [&'static str]],
    /// Numbers that a cell may hold.
    pub(crate) numbers: Numbers,
    /// Advice where columns are not found.
    pub(crate) advice: &'static str,
    /// Advice of a cell that is refused.
    pub(crate) bad_cell: fn(Failure, &str) -> Failure,
}

impl Dictionary {
    /// Finite numbers in named columns.
    pub(crate) const fn new(quantities: &'static [Quantity], advice: &'static str) -> Self {
        Self {
            quantities,
            bare: &[],
            array: &[],
            numbers: Numbers::Finite,
            advice,
            bad_cell: |error, _| error,
        }
    }
}

/// Numbers that a table may hold.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Numbers {
    /// Finite ones.
    Finite,
    /// Any: who reads it leaves those rows out.
    Any,
}

/// Choices of who reads a table.
#[derive(Default)]
pub(crate) struct Asked<'a> {
    /// Names of the columns, in place of a header or where there is none.
    pub(crate) names: Option<&'a [String]>,
    /// Quantities that are not wanted: neither parsed nor checked.
    pub(crate) unwanted: Option<&'a (dyn Fn(&Quantity) -> bool + Sync)>,
    /// Choice within a log.
    pub(crate) log: logs::LogOptions,
}

/// Columns of a file, before anything is decided about time and units.
#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) path: String,
    /// Line of the header, from 1; 0 where there is none.
    header_line: u64,
    pub(crate) columns: Vec<Column>,
    /// Names of columns that mean nothing here.
    pub(crate) ignored: Vec<String>,
    /// Comments before the header, without their marks.
    pub(crate) comments: Vec<String>,
    /// Rate that is stated beside the columns (Hz), and where.
    pub(crate) rate_hz: Option<(f64, &'static str)>,
    /// Lines of the rows, where it has some.
    lines: Vec<u64>,
    /// True if the text has no header.
    pub(crate) is_bare: bool,
    /// Notes on skipped and assumed parts.
    pub(crate) assumptions: Vec<String>,
    /// Warnings.
    pub(crate) warnings: Vec<String>,
}

/// A column with a meaning.
#[derive(Debug)]
pub(crate) struct Column {
    /// Name in the file.
    pub(crate) name: String,
    pub(crate) quantity: &'static Quantity,
    /// SI units in one of its own; none where the name does not say the unit.
    pub(crate) factor: Option<f64>,
    /// Numbers as they stand in the file.
    pub(crate) values: Vec<f64>,
}

impl Column {
    /// The number of a row, in SI.
    pub(crate) fn si(&self, row: usize) -> f64 {
        self.values[row] * self.factor.unwrap_or(1.0)
    }
}

/// Reads a table.
///
/// # Errors
/// When the file cannot be read, names no column that is known, or has a cell that is no number.
pub(crate) fn read(
    path: &Path,
    dictionary: &Dictionary,
    asked: &Asked<'_>,
) -> Result<Table, Failure> {
    let ends_in = |ending: &str| {
        path.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(ending))
    };
    let name = path.display().to_string();
    let of = |columns| containers::table(path, columns, dictionary, asked);
    let table = match logs::kind_of(path) {
        #[cfg(feature = "npz")]
        Some(LogKind::Npz) => {
            let (columns, rate_hz) = containers::npz(path)?;
            Ok(Table {
                rate_hz: rate_hz.map(|hz| (hz, containers::RATE)),
                ..of(columns)?
            })
        }
        Some(_) => containers::log(path, dictionary, asked),
        None if ends_in("npy") => of(containers::npy(path, dictionary, asked)?),
        #[cfg(feature = "parquet")]
        None if ends_in("parquet") => of(containers::parquet(path)?),
        #[cfg(not(feature = "parquet"))]
        None if ends_in("parquet") => {
            let message = "is Apache Parquet, which this build does not read";
            let refusal = Failure::contents(name, Place::Itself, message);
            Err(refusal.or_hint("build with --features parquet, or write CSV"))
        }
        None if is_oxts(path) => {
            let assumptions = vec!["KITTI oxts, axes front, left, up".to_owned()];
            Ok(Table {
                assumptions,
                ..of(containers::oxts(path)?)?
            })
        }
        None => {
            let reader = source::table(path).map_err(|e| unreadable(path, e))?;
            text::read(&name, reader, dictionary, asked)
        }
    }?;
    table.filled()
}

/// Reads a table from a text that is held.
///
/// # Errors
/// Those of [`read`].
pub(crate) fn parse(
    name: &str,
    text: &str,
    dictionary: &Dictionary,
    asked: &Asked<'_>,
) -> Result<Table, Failure> {
    let reader = Box::new(Cursor::new(text.to_owned()));
    text::read(name, reader, dictionary, asked)?.filled()
}

/// Error of the system on a table, with a hint.
pub(crate) fn unreadable(path: &Path, e: std::io::Error) -> Failure {
    let is_cut = is_damage(e.kind()) && e.kind() != std::io::ErrorKind::FileTooLarge;
    let failure = Failure::io(path, e);
    match is_cut {
        true => failure.hint(
            "the file is cut off, or not gzipped though it ends in .gz: copy it again, or rename it",
        ),
        false => failure,
    }
}

/// At most `longest` characters of what a file holds, safe to print.
pub(crate) fn shown(text: &str, longest: usize) -> String {
    let escaped = |c: char| match c.is_control() {
        true => c.escape_default().collect(),
        false => vec![c],
    };
    let short: String = text.chars().take(longest).flat_map(escaped).collect();
    if text.chars().nth(longest).is_some() {
        short + "…"
    } else {
        short
    }
}

/// Reasons for which a file of a directory is passed over.
pub(crate) const NO_COLUMN: &str = "no column is a known one";
const IS_EMPTY: &str = "it is empty";

/// A table without rows.
fn empty(path: &str) -> Failure {
    Failure::contents(path, Place::Within, "no rows in it").passing_over(IS_EMPTY)
}

/// Beyond this a number is no measurement, and its square may be no number.
const LARGEST: f64 = 1e100;
const BEYOND: &str = "is beyond 1e100, no measurement";
/// Rows from one look at the memory to the next.
const BETWEEN: usize = 1 << 16;

impl Table {
    /// A table of columns by their names, without rows yet.
    fn new(
        path: &str,
        header_line: u64,
        names: &[String],
        dictionary: &Dictionary,
        asked: &Asked<'_>,
        is_si: bool,
    ) -> Result<(Self, Vec<Option<usize>>), Failure> {
        let mut table = Self {
            path: path.to_owned(),
            header_line,
            columns: Vec::new(),
            ignored: Vec::new(),
            comments: Vec::new(),
            rate_hz: None,
            lines: Vec::new(),
            is_bare: false,
            assumptions: Vec::new(),
            warnings: Vec::new(),
        };
        let unwanted = |quantity: &Quantity| asked.unwanted.is_some_and(|is| is(quantity));
        let mut places: Vec<usize> = Vec::new();
        for (place, name) in names.iter().enumerate() {
            let name = name.trim().to_owned();
            match quantity::find(dictionary.quantities, &name) {
                Some((quantity, _)) if unwanted(quantity) => table.ignored.push(name),
                Some((quantity, factor)) => {
                    let values = Vec::new();
                    let is_signal = quantity.rank.is_none();
                    let factor = factor.or((is_si && is_signal).then_some(1.0));
                    places.push(place);
                    table.columns.push(Column {
                        name,
                        quantity,
                        factor,
                        values,
                    });
                }
                None => table.ignored.push(name),
            }
        }
        table.choose(&mut places)?;
        table.no_unknown_unit(dictionary, asked)?;
        let of_place = |place| places.iter().position(|p| *p == place);
        Ok((table, (0..names.len()).map(of_place).collect()))
    }

    /// Keeps one column of each quantity.
    fn choose(&mut self, places: &mut Vec<usize>) -> Result<(), Failure> {
        let rank = |c: &Column| c.quantity.rank.map(|rank| (rank, c.factor.is_none()));
        let mut k = 1;
        while k < self.columns.len() {
            // speeds are chosen by who reads them
            if self.columns[k].quantity.of_words {
                k += 1;
                continue;
            }
            let (name, later) = (self.columns[k].quantity.name, &self.columns[k]);
            let Some(i) = self.columns[..k]
                .iter()
                .position(|c| c.quantity.name == name)
            else {
                k += 1;
                continue;
            };
            let earlier = &self.columns[i];
            let (Some(first), Some(second)) = (rank(earlier), rank(later)) else {
                let (a, b) = (&earlier.name, &later.name);
                let message = format!("columns \"{a}\" and \"{b}\" both give {name}");
                return Err(self.refused(message).or_hint("remove one of them"));
            };
            let out = if second < first { i } else { k };
            places.remove(out);
            self.ignored.push(self.columns.remove(out).name);
        }
        Ok(())
    }

    /// A column that is an axis by its name, but in a unit that is not known, must not be dropped in silence.
    fn no_unknown_unit(&self, dictionary: &Dictionary, asked: &Asked<'_>) -> Result<(), Failure> {
        for name in &self.ignored {
            let plain = normalised(name);
            let is_meant = |q: &&Quantity| {
                q.is_in_unknown_unit(&plain)
                    && !self.has(q.name)
                    && !asked.unwanted.is_some_and(|is| is(q))
            };
            if let Some(quantity) = dictionary.quantities.iter().find(is_meant) {
                let endings: Vec<String> = quantity
                    .units
                    .iter()
                    .map(|(names, _)| format!("_{}", names[0]))
                    .collect();
                let message = format!("column \"{name}\" is in a unit that is not known");
                return Err(self
                    .refused(message)
                    .or_hint(format!("end its name in one of {}", endings.join(", ")))
                    .or(help::COLUMN_NAMES)
                    .or(help::CHANNELS));
            }
        }
        Ok(())
    }

    /// Appends a number to a column; `written`: as the file has it.
    fn push(
        &mut self,
        column: usize,
        value: f64,
        written: Option<&[u8]>,
        line: u64,
        dictionary: &Dictionary,
    ) -> Result<(), Failure> {
        let own = &mut self.columns[column];
        let is_measured = value.is_finite() && value.abs() <= LARGEST;
        if is_measured || dictionary.numbers != Numbers::Finite || own.quantity.may_be_empty {
            own.values.push(value);
            return Ok(());
        }
        let text = written.map_or_else(
            || value.to_string(),
            |cell| shown(&String::from_utf8_lossy(cell.trim_ascii()), 40),
        );
        let (text, reason) = match value.is_finite() {
            true if written.is_none() => (format!("{value:e}"), BEYOND),
            true => (text, BEYOND),
            false => (format!("\"{text}\""), "is not finite"),
        };
        Err(self.bad_cell(&self.columns[column].name, line, &text, reason, dictionary))
    }

    fn bad_cell(
        &self,
        column: &str,
        line: u64,
        value: &str,
        reason: &str,
        dictionary: &Dictionary,
    ) -> Failure {
        let mut error = Failure::cell(&self.path, line, column, value, reason);
        let point = value.trim_matches('"').replacen(',', ".", 1);
        if point.len() + 2 == value.len() && value.contains(',') && point.parse::<f64>().is_ok() {
            error = error.or_hint("write decimals with a point: 0.5, not 0,5");
        }
        (dictionary.bad_cell)(error, value)
    }

    /// Refuses a table without rows, or whose rows end before others.
    fn filled(mut self) -> Result<Self, Failure> {
        let is_clock =
            |c: &Column| !(c.quantity.may_be_empty && c.values.iter().any(|v| v.is_nan()));
        self.columns.retain(is_clock);
        let uneven = |c: &&Column| c.values.len() != self.columns[0].values.len();
        if let Some(other) = self.columns.iter().find(uneven) {
            let (rows, first) = (other.values.len(), &self.columns[0]);
            let message = format!(
                "{} has {rows} rows, {} has {}",
                other.name,
                first.name,
                first.values.len()
            );
            return Err(Failure::contents(self.path, Place::Within, message));
        }
        if self.columns.first().is_some_and(|c| c.values.is_empty()) {
            return Err(empty(&self.path));
        }
        Ok(self)
    }

    /// Refuses columns whose rows, so many or more, do not fit into the memory that is free.
    fn fits(&self, rows: u64) -> Result<(), Failure> {
        let bytes = |rows: u64| rows.saturating_mul((size_of::<f64>() * self.columns.len()) as u64);
        let held = bytes(self.rows() as u64);
        let free = free_memory().map_or(u64::MAX, |free| free.saturating_add(held));
        if bytes(rows) <= free {
            return Ok(());
        }
        let [needed, free] = [bytes(rows), free].map(|bytes| bytes.div_ceil(1 << 20));
        let message = format!("its samples need {needed} MiB of memory, and {free} MiB are free");
        let refusal = Failure::contents(&self.path, Place::Within, message);
        Err(refusal.or(help::FEWER_CHANNELS))
    }

    /// Something wrong with the header.
    pub(crate) fn refused(&self, message: impl Display) -> Failure {
        Failure::contents(&self.path, self.header_line.max(1), message)
    }

    pub(crate) fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }

    /// Line of a row (its number, from 1, in a file without lines).
    pub(crate) fn line(&self, row: usize) -> u64 {
        self.lines.get(row).copied().unwrap_or(row as u64 + 1)
    }

    /// The column of a quantity.
    pub(crate) fn get(&self, quantity: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.quantity.name == quantity)
    }

    pub(crate) fn has(&self, quantity: &str) -> bool {
        self.get(quantity).is_some()
    }

    /// Columns of several quantities; none where one is missing.
    pub(crate) fn all<const N: usize>(&self, quantities: [&str; N]) -> Option<[&Column; N]> {
        let found: Option<Vec<&Column>> = quantities.iter().map(|q| self.get(q)).collect();
        found?.try_into().ok()
    }

    /// Takes a column out.
    pub(crate) fn take(&mut self, quantity: &str) -> Option<Column> {
        let at = self
            .columns
            .iter()
            .position(|c| c.quantity.name == quantity)?;
        Some(self.columns.swap_remove(at))
    }

    /// Keeps the rows of which that holds.
    pub(crate) fn retain(&mut self, keep: impl Fn(&Self, usize) -> bool) {
        let kept: Vec<usize> = (0..self.rows()).filter(|row| keep(self, *row)).collect();
        self.lines = kept.iter().map(|row| self.line(*row)).collect();
        for column in &mut self.columns {
            column.values = kept.iter().map(|row| column.values[*row]).collect();
        }
    }

    /// Refuses a table without one of the quantities that are needed; a column that nearly has the name of a missing one
    /// is a slip.
    ///
    /// # Errors
    /// Error for a missing column, with the dictionary's advice.
    pub(crate) fn require<'a>(
        &self,
        needed: impl IntoIterator<Item = &'a str>,
        dictionary: &Dictionary,
    ) -> Result<(), Failure> {
        let missing: Vec<&str> = needed.into_iter().filter(|q| !self.has(q)).collect();
        let slip = |name: &String| Some((name.clone(), nearest(name, missing.iter().copied())?));
        if let Some((name, meant)) = self.ignored.iter().find_map(slip) {
            let refusal = self.refused(format!("unknown column \"{name}\""));
            return Err(refusal.or_hint(format!("did you mean \"{meant}\"?")));
        }
        let columns = match &missing[..] {
            [] => return Ok(()),
            [one] => format!("column {one} is missing"),
            many => format!("columns {} are missing", many.join(", ")),
        };
        let refusal = self.refused(columns).passing_over(NO_COLUMN);
        Err(refusal.or_hint(dictionary.advice))
    }

    /// Columns of quantities that are needed.
    ///
    /// # Errors
    /// Those of [`Self::require`].
    pub(crate) fn columns<const N: usize>(
        &self,
        needed: [&str; N],
        dictionary: &Dictionary,
    ) -> Result<[&Column; N], Failure> {
        self.require(needed, dictionary)?;
        self.all(needed)
            .ok_or_else(|| self.refused(dictionary.advice))
    }
}

/// Memory that is free (bytes), where the system says it.
fn free_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let (_, rest) = text.split_once("MemAvailable:")?;
    Some(rest.split_whitespace().next()?.parse::<u64>().ok()? << 10)
}

#[cfg(test)]
mod tests;
