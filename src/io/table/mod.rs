//! Tables of numbers in files of any kind, and the dictionaries that say which quantities their columns hold.
//!
//! A reader is `read(path, &DICTIONARY)`: columns with a factor to SI and the line of each row.

use super::recordings::timing::median_step;
use super::suggest::nearest;
use super::{Failure, Place, help, logs, source};
use crate::failure::is_damage;
use chrono::NaiveDateTime;
use nav_sim_document::{counted, one_line};
use nav_sim_logs::npy::Array;
use nav_sim_logs::{Clock, Content, LogChannel, LogFormat, in_seconds, npy};
pub(crate) use quantity::find;
pub(crate) use quantity::{
    ACCELERATION, ANGLE, ANGULAR_RATE, DefaultUnit, LATITUDE, LONGITUDE, NONE, Quantity, SPEED,
    TIME, Units, normalised,
};
use std::borrow::Cow;
use std::fmt::Display;
use std::io::{BufRead, Cursor, Read};
use std::path::{Path, PathBuf};

mod quantity;

/// Quantities of a kind of table, and words for what is refused.
pub(crate) struct Dictionary<'a> {
    /// Quantities; of several columns of one with a rank, the first by rank is taken.
    pub(crate) quantities: &'static [Quantity],
    /// Headers of texts without one, by the number of their columns.
    pub(crate) bare: &'static [&'static str],
    /// Column names of arrays.
    pub(crate) array: &'static [&'static str],
    /// True if cells that hold no number of their range are NaN: who reads them leaves those rows out.
    pub(crate) is_partial: bool,
    /// Advice where columns are not found.
    pub(crate) advice: &'static str,
    /// Advice where a cell is refused.
    pub(crate) bad_cell: &'static str,
    /// Names of the columns, in place of a header or where there is none.
    pub(crate) names: Option<&'a [String]>,
    /// Quantities that are not wanted: neither parsed nor checked.
    pub(crate) unwanted: Option<&'a (dyn Fn(&Quantity) -> bool + Sync)>,
    /// Choice within a log.
    pub(crate) log: Option<&'a logs::LogOptions>,
}

impl Dictionary<'_> {
    /// Finite numbers in named columns.
    pub(crate) const fn new(quantities: &'static [Quantity], advice: &'static str) -> Self {
        Self {
            quantities,
            bare: &[],
            array: &[],
            is_partial: false,
            advice,
            bad_cell: "",
            names: None,
            unwanted: None,
            log: None,
        }
    }
}

/// Columns of a file, before anything is decided about time and units.
#[derive(Debug, Default)]
pub(crate) struct InputTable {
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
    /// Advice where columns are not found.
    advice: &'static str,
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
    /// Its place among the columns of the file.
    place: usize,
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
pub(crate) fn read(path: &Path, dictionary: &Dictionary<'_>) -> Result<InputTable, Failure> {
    let ends_in = |ending: &str| {
        path.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(ending))
    };
    let name = path.display().to_string();
    let of = |columns| of_columns(&name, columns, dictionary);
    source::open(path).map_err(|e| unreadable(path, e))?;
    let table = match logs::kind_of(path) {
        #[cfg(feature = "npz")]
        Some(LogFormat::Npz) => {
            let (columns, rate_hz) = npz(path)?;
            Ok(InputTable {
                rate_hz: rate_hz.map(|hz| (hz, RATE)),
                ..of(columns)?
            })
        }
        Some(_) => log(path, dictionary.log, &of),
        None if ends_in("npy") => of(npy(path, dictionary)?),
        #[cfg(feature = "parquet")]
        None if ends_in("parquet") => of(parquet(path)?),
        #[cfg(not(feature = "parquet"))]
        None if ends_in("parquet") => {
            let message = "is Apache Parquet, which this build cannot read";
            let refusal = Failure::contents(&name, Place::Itself, message);
            Err(refusal.or_hint("build with --features parquet, or write CSV"))
        }
        None if is_oxts(path) => {
            let assumptions = vec!["KITTI oxts, axes front, left, up".to_owned()];
            Ok(InputTable {
                assumptions,
                ..of(oxts(path)?)?
            })
        }
        None => {
            let reader = source::table(path).map_err(|e| unreadable(path, e))?;
            read_text(&name, reader, dictionary)
        }
    }?;
    table.filled()
}

/// Reads a table from a text that is held.
///
/// # Errors
/// As [`read`].
pub(crate) fn parse(
    name: &str,
    text: &str,
    dictionary: &Dictionary<'_>,
) -> Result<InputTable, Failure> {
    let reader = Box::new(Cursor::new(text.to_owned()));
    read_text(name, reader, dictionary)?.filled()
}

/// Quantities of a dictionary that the header of a text names.
pub(crate) fn quantities(text: &str, dictionary: &Dictionary<'_>) -> Vec<&'static Quantity> {
    let reader = Box::new(Cursor::new(text.to_owned()));
    let head = HeaderLines::read(&mut Lines::new("", reader), dictionary);
    let names = head.map(|head| head.names).unwrap_or_default();
    let known = names.iter().map(|name| find(dictionary.quantities, name));
    known.flatten().map(|(quantity, _)| quantity).collect()
}

/// Error of the system on a table, with a hint.
pub(crate) fn unreadable(path: &Path, e: std::io::Error) -> Failure {
    use std::io::ErrorKind as K;
    let is_cut = is_damage(e.kind()) && !matches!(e.kind(), K::FileTooLarge | K::Unsupported);
    let failure = Failure::io(path, e);
    match is_cut {
        true => failure.hint("the file is cut off or not gzipped: copy it again, or rename it"),
        false => failure,
    }
}

/// At most `longest` characters of what a file holds, safe to print.
pub(crate) fn shown(text: &str, longest: usize) -> String {
    let short: String = text.chars().take(longest).collect();
    let short = one_line(&short);
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
    Failure::contents(path, Place::Within, "no rows in it").skipped_as(IS_EMPTY)
}

/// Columns beside which rates and accelerations are in SI: of ArduPilot and of Sensor Logger.
const IN_SI: [&str; 3] = ["timeus", "timems", SENSOR_LOGGER];
pub(crate) const SENSOR_LOGGER: &str = "seconds_elapsed";
/// Number of the IMU, of several in one file of ArduPilot.
pub(crate) const INSTANCE: &str = "instance";
/// Counter of Xsens, in ticks of 0.1 ms where MT Manager writes it, in other units elsewhere.
pub(crate) const TICKS: &str = "sampletimefine";

/// The sensor that a file is named after, as those of phones are.
fn sensor_of(path: &str) -> Option<&'static str> {
    let name = Path::new(path).file_name()?.to_str()?.to_lowercase();
    let sensors = [("gyr", "gyro"), ("acc", "accel")];
    let found = sensors.iter().find(|(part, _)| name.contains(part));
    found.map(|(_, sensor)| *sensor)
}

/// Beyond this a number is no measurement, and its square may be no number.
const LARGEST: f64 = 1e100;
const BEYOND: &str = "is beyond 1e100, no measurement";
/// Numbers at which counters of time start again: of 16 and 32 bits, the latter also of microseconds and milliseconds told in
/// seconds, and of the GPS week (s, ms).
const TURNS: [f64; 6] = [
    65_536.0,
    4_294_967_296.0,
    4_294.967_296,
    4_294_967.296,
    604_800.0,
    604_800_000.0,
];
/// Steps that may be missing where one does.
const MOST_MISSED: f64 = 100.0;
/// Rows from one look at the memory to the next.
const BETWEEN: usize = 1 << 16;

impl InputTable {
    /// A table of columns by their names, without rows yet.
    fn new(
        path: &str,
        header_line: u64,
        names: &[String],
        dictionary: &Dictionary<'_>,
        is_xsens: bool,
    ) -> Result<Self, Failure> {
        let mut table = Self {
            path: path.to_owned(),
            header_line,
            advice: dictionary.advice,
            ..Self::default()
        };
        let unwanted = |quantity: &Quantity| dictionary.unwanted.is_some_and(|is| is(quantity));
        let is_si = is_xsens || names.iter().any(|name| IN_SI.contains(&&*normalised(name)));
        let found = |name: &str| quantity::find(dictionary.quantities, name);
        let is_axis = |name: &String| found(name).is_some_and(|(q, _)| !q.axis.is_empty());
        let sensor = match names.iter().any(is_axis) {
            true => None,
            false => sensor_of(path),
        };
        let of_sensor = |name: &str| {
            let is_axis = name.starts_with(['x', 'y', 'z', 'X', 'Y', 'Z']);
            found(&format!("{}_{name}", sensor.filter(|_| is_axis)?))
        };
        for (place, name) in names.iter().enumerate() {
            let name = name.trim().to_owned();
            let known = found(&name).or_else(|| of_sensor(&name));
            match known.filter(|(q, _)| is_si || q.name != INSTANCE) {
                Some((quantity, _)) if unwanted(quantity) => table.ignored.push(name),
                Some((quantity, factor)) => {
                    let values = Vec::new();
                    let is_signal = quantity.rank.is_none();
                    let factor = factor
                        .or((is_si && is_signal).then_some(1.0))
                        .or((is_xsens && quantity.stems == TICKS).then_some(1e-4));
                    table.columns.push(Column {
                        name,
                        quantity,
                        factor,
                        values,
                        place,
                    });
                }
                None => table.ignored.push(name),
            }
        }
        table.choose()?;
        table.no_unknown_unit(dictionary)?;
        Ok(table)
    }

    /// Keeps one column of each quantity.
    fn choose(&mut self) -> Result<(), Failure> {
        let rank = |c: &Column| c.quantity.rank.map(|rank| (rank, c.factor.is_none()));
        let mut k = 1;
        while k < self.columns.len() {
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
                return Err(self.refused(message).or_hint("give one of them"));
            };
            let out = if second < first { i } else { k };
            self.ignored.push(self.columns.remove(out).name);
        }
        Ok(())
    }

    /// A column that is an axis by its name, but in a unit that is not known, must not be dropped in silence.
    fn no_unknown_unit(&self, dictionary: &Dictionary<'_>) -> Result<(), Failure> {
        for name in &self.ignored {
            let plain = normalised(name);
            let is_meant = |q: &&Quantity| {
                q.is_in_unknown_unit(&plain)
                    && !self.has(q.name)
                    && !dictionary.unwanted.is_some_and(|is| is(q))
            };
            if let Some(quantity) = dictionary.quantities.iter().find(is_meant) {
                let problem = "is in an unknown unit";
                let other = quantity.name.replace('.', "_");
                let advice = format!("convert it, and end {other}");
                let refusal = self.unit(name, quantity, problem, &advice);
                return Err(refusal.or_option(help::CHANNELS));
            }
        }
        Ok(())
    }

    /// The refusal of the unit of a column.
    fn unit(&self, name: &str, quantity: &Quantity, problem: &str, advice: &str) -> Failure {
        let endings = quantity
            .units
            .iter()
            .filter_map(|(names, _)| Some(format!("_{}", names.split(' ').next()?)));
        let endings: Vec<String> = endings.collect();
        self.refused(format!("column \"{name}\" {problem}"))
            .or_hint(format!("{advice} in one of {}", endings.join(", ")))
            .or_option(help::COLUMN_NAMES)
    }

    /// The refusal of a column whose unit cannot be known.
    pub(crate) fn no_unit(&self, column: &Column) -> Failure {
        let problem = "has no unit in its name";
        self.unit(&column.name, column.quantity, problem, "end its name")
    }

    /// Appends a number to a column; `written`: as the file has it.
    fn push(
        &mut self,
        column: usize,
        value: f64,
        written: Option<&[u8]>,
        line: u64,
        dictionary: &Dictionary<'_>,
    ) -> Result<(), Failure> {
        let own = &mut self.columns[column];
        let si = value * own.factor.unwrap_or(1.0);
        let outside = own
            .quantity
            .range
            .filter(|(low, high, _)| !(*low..=*high).contains(&si));
        let is_measured = value.is_finite() && value.abs() <= LARGEST;
        if is_measured && outside.is_none() || dictionary.is_partial {
            let is_inside = value.is_nan() || outside.is_none();
            own.values.push(if is_inside { value } else { f64::NAN });
            return Ok(());
        }
        let text = written.map_or_else(
            || value.to_string(),
            |cell| shown(&String::from_utf8_lossy(cell.trim_ascii()), 40),
        );
        let (text, reason) = match outside {
            _ if !value.is_finite() => (format!("\"{text}\""), "is not a finite number"),
            Some((.., reason)) if is_measured => (text, reason),
            _ => (text, BEYOND),
        };
        Err(self.bad_cell(&self.columns[column].name, line, &text, reason, dictionary))
    }

    fn bad_cell(
        &self,
        column: &str,
        line: u64,
        value: &str,
        reason: &str,
        dictionary: &Dictionary<'_>,
    ) -> Failure {
        let error = Failure::cell(&self.path, line, column, value, reason);
        let point = value.trim_matches('"').replacen(',', ".", 1);
        if point.len() + 2 == value.len() && value.contains(',') && point.parse::<f64>().is_ok() {
            return error.or_hint("write decimals with a point: 0.5, not 0,5");
        }
        let is_time = value.matches(':').count() > 1;
        let time = "write the time in seconds from any instant, and name the column t_s";
        match (is_time, dictionary.bad_cell) {
            (true, _) => error.or_hint(time),
            (false, "") => error,
            (false, advice) => error.or_hint(advice),
        }
    }

    /// Refuses a table without rows, or whose rows end before others.
    fn filled(mut self) -> Result<Self, Failure> {
        let uneven = |c: &&Column| c.values.len() != self.columns[0].values.len();
        if let Some(other) = self.columns.iter().find(uneven) {
            let (rows, first) = (other.values.len(), &self.columns[0]);
            let message = format!(
                "{} has {rows} rows, {} has {}",
                other.name,
                first.name,
                first.values.len()
            );
            return Err(Failure::contents(self.path, Place::Within, message)
                .or_hint("write all columns with the same number of rows"));
        }
        if self.columns.first().is_some_and(|c| c.values.is_empty()) {
            return Err(empty(&self.path));
        }
        self.unwrap_counter();
        Ok(self)
    }

    /// Counts the time on where its counter starts again.
    fn unwrap_counter(&mut self) {
        let is_in_week = self.has("week");
        let mut time = self.columns.iter_mut().find(|c| c.quantity.name == "t_s");
        let Some(time) = time.as_mut().filter(|_| !is_in_week) else {
            return;
        };
        let (mut step, mut added, mut count) = (f64::NAN, 0.0, 0);
        for row in 1..time.values.len() {
            let back = time.values[row - 1] - added - time.values[row];
            if back > 0.0 {
                if step.is_nan() {
                    step = median_step(&time.values);
                }
                let is_turn = |turn: &&f64| (0.0..=MOST_MISSED * step).contains(&(**turn - back));
                if let Some(turn) = TURNS.iter().find(is_turn) {
                    (added, count) = (added + turn, count + 1);
                }
            }
            time.values[row] += added;
        }
        if count > 0 {
            let name = &time.name;
            let text = format!("column \"{name}\" starts again {count} times: counted on");
            self.assumptions.push(text);
        }
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
        let message = format!("its samples need {needed} MiB of memory, {free} MiB are free");
        let refusal = Failure::contents(&self.path, Place::Within, message);
        Err(refusal.or_option(("axes", "take fewer signals at a time with --axes")))
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

    /// Keeps these rows.
    pub(crate) fn keep(&mut self, rows: &[usize]) {
        self.lines = rows.iter().map(|row| self.line(*row)).collect();
        for column in &mut self.columns {
            column.values = rows.iter().map(|row| column.values[*row]).collect();
        }
    }

    /// Keeps the rows of finite numbers; what was left out, in words.
    pub(crate) fn drop_incomplete_rows(&mut self) -> Option<String> {
        let all = self.rows();
        let is_whole = |row: &usize| self.columns.iter().all(|c| c.values[*row].is_finite());
        let kept: Vec<usize> = (0..all).filter(is_whole).collect();
        self.keep(&kept);
        let count = all - kept.len();
        let rows = counted(count, "row");
        (count > 0).then(|| format!("{rows} left out: values not finite, or out of range"))
    }

    /// Refuses a table without one of the quantities that are needed; a column that nearly has the name of a missing one
    /// is a slip.
    ///
    /// # Errors
    /// Error for a missing column, with the dictionary's advice.
    pub(crate) fn require<'a>(
        &self,
        needed: impl IntoIterator<Item = &'a str>,
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
        let refusal = self.refused(columns).skipped_as(NO_COLUMN);
        Err(refusal.or_hint(self.advice))
    }

    /// Columns of quantities that are needed.
    ///
    /// # Errors
    /// As [`Self::require`].
    pub(crate) fn columns<const N: usize>(
        &self,
        needed: [&str; N],
    ) -> Result<[&Column; N], Failure> {
        self.require(needed)?;
        self.all(needed).ok_or_else(|| self.refused(self.advice))
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

// Tables of text: RFC 4180 with `,` `;` tab or blanks, comments and other lines before the header.

/// Longest line (bytes); what is longer is no table of text.
const LONGEST: u64 = 1 << 16;
/// Lines that may stand before the header.
const MOST_BEFORE: u64 = 200;

/// Lines of a text, one at a time.
struct Lines<'a> {
    path: &'a str,
    reader: Box<dyn BufRead>,
    /// The line read last, its number from 1, and the bytes up to its end.
    line: Vec<u8>,
    number: u64,
    bytes: u64,
}

impl<'a> Lines<'a> {
    const fn new(path: &'a str, reader: Box<dyn BufRead>) -> Self {
        Self {
            path,
            reader,
            line: Vec::new(),
            number: 0,
            bytes: 0,
        }
    }

    /// Appends a line to the last one; false at the end.
    fn more(&mut self) -> Result<bool, Failure> {
        let mut reader = self.reader.by_ref().take(LONGEST);
        let read = reader.read_until(b'\n', &mut self.line);
        let count = read.map_err(|e| unreadable(Path::new(self.path), e))?;
        self.number += 1;
        self.bytes += count as u64;
        Ok(count > 0)
    }

    /// Reads a line; false at the end.
    fn next(&mut self) -> Result<bool, Failure> {
        self.line.clear();
        self.more()
    }

    /// True if a quote that begins a cell is open at the end of the line.
    fn is_open(&self, delimiter: u8) -> bool {
        if !self.line.contains(&b'"') || self.line.starts_with(b"#") {
            return false;
        }
        let (mut is_open, mut before) = (false, delimiter);
        let is_blank = |byte: u8| byte == b' ' && delimiter != b' ';
        for byte in &self.line {
            is_open ^= is_quote(*byte, is_open, before, delimiter);
            before = if is_blank(*byte) { before } else { *byte };
        }
        is_open
    }
}

/// Reads a table.
fn read_text(
    path: &str,
    reader: Box<dyn BufRead>,
    dictionary: &Dictionary<'_>,
) -> Result<InputTable, Failure> {
    let mut lines = Lines::new(path, reader);
    let head = HeaderLines::read(&mut lines, dictionary)?;
    let mut table = InputTable::new(path, head.line, &head.names, dictionary, head.is_xsens)?;
    table.rate_hz = head.rate_hz.map(|rate_hz| (rate_hz, "head of the file"));
    table.is_bare = head.is_bare;
    if head.is_latin_1 && dictionary.names.is_none() {
        let text = "header not in UTF-8, read as ISO-8859-1";
        table.assumptions.push(text.to_owned());
    }
    let units = head.units_line.map(|line| format!("units by line {line}"));
    table.assumptions.extend(units);
    if !table.columns.is_empty() {
        head.rows(&mut table, lines, dictionary)?;
    }
    table.comments.splice(..0, head.comments);
    Ok(table)
}

/// Lines before the rows.
#[derive(Default)]
struct HeaderLines {
    names: Vec<String>,
    delimiter: u8,
    /// Line of the header, from 1.
    line: u64,
    /// True if the line read last is the first row.
    has_row: bool,
    comments: Vec<String>,
    /// True if it is that of an Xsens MT Manager export, which is in SI.
    is_xsens: bool,
    rate_hz: Option<f64>,
    /// True if there is no header.
    is_bare: bool,
    /// True if the header is no UTF-8: `²` and `°` are one byte each then.
    is_latin_1: bool,
    /// True if the rows are sentences, which end in a checksum.
    is_sentences: bool,
    /// Line of the units, where they have one of their own.
    units_line: Option<u64>,
}

/// Columns of the sentences of an IMU, by their first cells ([VectorNav VN-100 manual](https://www.vectornav.com/)).
const SENTENCES: [(&str, &str); 3] = [
    ("$VNIMU", "mag_x mag_y mag_z"),
    ("$VNYMR", "yaw pitch roll mag_x mag_y mag_z"),
    ("$VNQMR", "q_0 q_1 q_2 q_3 mag_x mag_y mag_z"),
];
const OF_SENTENCE: &str = "accel_x_m_s2 accel_y_m_s2 accel_z_m_s2 gyro_x_rad_s gyro_y_rad_s gyro_z_rad_s temperature pressure";

impl HeaderLines {
    fn read(lines: &mut Lines<'_>, dictionary: &Dictionary<'_>) -> Result<Self, Failure> {
        let mut head = Self {
            delimiter: b',',
            ..Self::default()
        };
        // lines of words, of which one is the header where none names a quantity
        let mut words: Vec<(u64, Vec<String>)> = Vec::new();
        // lines of numbers that no header fits, and the refusal of the first
        let mut counts: Vec<usize> = Vec::new();
        let mut refusal = None;
        while lines.next()? && lines.number <= MOST_BEFORE {
            let line = lines.number;
            if let Some(what) = no_text(&lines.line) {
                let message = format!("is no table of text: {what}");
                return Err(Failure::contents(lines.path, Place::Itself, message).or_hint(
                    "save it as CSV in UTF-8, one row a line; arrays end in .npy, gzipped tables in .gz",
                ));
            }
            let utf_8 = std::str::from_utf8(&lines.line).ok().map(str::to_owned);
            head.is_latin_1 = utf_8.is_none();
            let latin_1 = || lines.line.iter().map(|b| char::from(*b)).collect();
            let text: String = utf_8.unwrap_or_else(latin_1);
            let text = text.trim_start_matches('\u{feff}').trim();
            if let Some(comment) = text.strip_prefix("//") {
                head.is_xsens = true;
                head.rate_hz = head.rate_hz.or_else(|| rate_in(comment));
                continue;
            }
            let start = text.get(..4).unwrap_or_default();
            if text.is_empty() || start.eq_ignore_ascii_case("sep=") {
                continue;
            }
            let inside = text.trim_start_matches(['#', '%']).trim();
            let (cells, delimiter) = cells(inside, dictionary);
            if cells.is_empty() {
                continue;
            }
            if let Some(first) = cells.first().filter(|cell| cell.starts_with('$')) {
                return head.of_sentences(lines.path, line, first, cells.len(), dictionary);
            }
            let is_known = |cell: &str| {
                find(dictionary.quantities, cell).is_some_and(|(q, _)| q.rank.is_none())
            };
            let known = cells.iter().filter(|cell| is_known(cell)).count();
            let is_number = |cell: &&String| number(cell.as_bytes(), delimiter).is_some();
            let numbers = cells.iter().filter(is_number).count();
            // words between blanks may be those of a sentence
            let is_header =
                known > 0 && numbers == 0 && (delimiter != b' ' || 2 * known + 1 >= cells.len());
            if inside.len() < text.len() {
                head.comments.push(inside.to_owned());
                if !is_header {
                    continue;
                }
            }
            (head.delimiter, head.line) = (delimiter, line);
            if 2 * numbers > cells.len() {
                head.has_row = true;
                let is_one = |(_, names): &&(u64, Vec<String>)| names.len() == cells.len();
                let mut fitting = words.iter().filter(is_one);
                if let (Some((line, names)), None) = (fitting.next(), dictionary.names) {
                    (head.line, head.names) = (*line, names.clone());
                    if let Some((line, units)) = fitting.next() {
                        head.name_units(*line, units, dictionary);
                    }
                    return Ok(head);
                }
                head.is_bare = dictionary.names.is_none();
                let names = dictionary.names.map(<[String]>::to_vec);
                let bare = || {
                    layout(dictionary.bare, cells.len())
                        .filter(|_| words.is_empty() && counts.is_empty())
                };
                if let Some(names) = names.or_else(bare) {
                    head.names = names;
                    return Ok(head);
                }
                if words
                    .iter()
                    .any(|(_, cells)| cells.iter().any(|c| is_known(c)))
                {
                    break;
                }
                counts.push(cells.len());
                let no_header = || no_header(lines.path, line, text, cells.len(), dictionary);
                refusal.get_or_insert_with(no_header);
                head.has_row = false;
                continue;
            }
            if is_header && !counts.contains(&cells.len()) && dictionary.names.is_none() {
                head.is_bare = false;
                head.names = cells;
                while lines.next()? && lines.line.trim_ascii().is_empty() {}
                let below = split(&lines.line, delimiter);
                head.has_row = !(lines.line.is_empty()
                    || below.len() >= head.names.len() && is_text_row(&below));
                if !head.has_row && !lines.line.is_empty() {
                    let text = String::from_utf8_lossy(&lines.line);
                    let units = words_of(text.trim(), delimiter);
                    head.name_units(lines.number, &units, dictionary);
                }
                return Ok(head);
            }
            words.push((line, cells));
        }
        // what names no quantity is the header all the same: its reader says what it lacks
        let first = words.into_iter().next();
        if let (None, Some(refusal)) = (&first, refusal) {
            return Err(refusal);
        }
        (head.line, head.names) = first.ok_or_else(|| empty(lines.path))?;
        Ok(head)
    }

    /// Puts the units that stand in a line of their own behind the names.
    fn name_units(&mut self, line: u64, units: &[String], dictionary: &Dictionary<'_>) {
        self.units_line = Some(line);
        for (name, unit) in self.names.iter_mut().zip(units) {
            let whole = format!("{name} {unit}");
            let is_without = find(dictionary.quantities, name).is_some_and(|(_, f)| f.is_none());
            if is_without && !unit.is_empty() || find(dictionary.quantities, &whole).is_some() {
                *name = whole;
            }
        }
    }

    /// Rows that are sentences, with such a first cell.
    fn of_sentences(
        self,
        path: &str,
        line: u64,
        first: &str,
        count: usize,
        dictionary: &Dictionary<'_>,
    ) -> Result<Self, Failure> {
        let Some((_, names)) = SENTENCES.iter().find(|(address, _)| *address == first) else {
            let message = format!("sentences ({}), no table", shown(first, 20));
            return Err(Failure::contents(path, line, message).or_hint(dictionary.advice));
        };
        let names = ["address", names, OF_SENTENCE].join(" ");
        let names = names.split(' ').take(count).map(str::to_owned);
        Ok(Self {
            names: names.collect(),
            line,
            has_row: true,
            is_sentences: true,
            ..self
        })
    }

    /// Appends the rows; what is passed over becomes a note.
    fn rows(
        &self,
        table: &mut InputTable,
        mut lines: Lines<'_>,
        dictionary: &Dictionary<'_>,
    ) -> Result<(), Failure> {
        let path = lines.path;
        // of a packed file no more than what is read is known
        let length = std::fs::metadata(path).map_or(0, |m| m.len());
        let (expected, mut row) = (self.names.len(), 0);
        let mut is_there = self.has_row || lines.next()?;
        while is_there {
            let line = lines.number;
            let mut is_open = lines.is_open(self.delimiter);
            while is_open && lines.line.len() < LONGEST as usize && lines.more()? {
                is_open = lines.is_open(self.delimiter);
            }
            if is_open {
                return Err(Failure::contents(path, line, "a quote is not closed")
                    .or_hint("close it, or remove it"));
            }
            let sum = self
                .is_sentences
                .then(|| lines.line.iter().rposition(|b| *b == b'*'));
            lines
                .line
                .truncate(sum.flatten().unwrap_or(lines.line.len()));
            let cells = split(&lines.line, self.delimiter);
            let first = cells
                .first()
                .map_or(&[][..], |cell| cell.trim_ascii_start());
            let is_empty = |cell: &Cow<'_, [u8]>| cell.trim_ascii().is_empty();
            if first.starts_with(b"#") || first.starts_with(b"%") {
                let text = String::from_utf8_lossy(&lines.line);
                let inside = text.trim_start_matches(['#', '%', ' ']).trim_end();
                table.comments.push(inside.to_owned());
            } else if cells.iter().all(is_empty) {
            } else if cells.len() < expected || !cells[expected..].iter().all(is_empty) {
                let found = cells.len();
                let is_split =
                    |cell: &Cow<'_, [u8]>| number(cell, b',').is_some() && !cell.contains(&b'.');
                let is_mark = self.delimiter == b','
                    && (expected + 1..=2 * expected).contains(&found)
                    && cells.iter().all(is_split);
                while lines.next()? && lines.line.trim_ascii().is_empty() {}
                // a logger that lost its power within a row
                if found < expected && row > 0 && lines.line.is_empty() {
                    let text = format!("line {line}, the last, is cut off: left out");
                    table.assumptions.push(text);
                    return Ok(());
                }
                if is_mark {
                    let message = "commas separate the cells and are their decimal marks";
                    return Err(Failure::contents(path, line, message).or_hint(
                        "write decimals with a point, or separate cells with semicolons",
                    ));
                }
                return Err(Failure::row_length(path, line, found, expected));
            } else {
                if row % BETWEEN == 0 {
                    let all = (row as u64).saturating_mul(length) / lines.bytes.max(1);
                    table.fits(all.max((row + BETWEEN) as u64))?;
                }
                for column in 0..table.columns.len() {
                    let cell = &cells[table.columns[column].place];
                    let Some(value) = number(cell, self.delimiter) else {
                        let value = shown(&String::from_utf8_lossy(cell.trim_ascii()), 40);
                        let (value, reason) = (format!("\"{value}\""), "is not a number");
                        let name = &table.columns[column].name;
                        return Err(table.bad_cell(name, line, &value, reason, dictionary));
                    };
                    table.push(column, value, Some(cell), line, dictionary)?;
                }
                table.lines.push(line);
                row += 1;
            }
            is_there = lines.next()?;
        }
        Ok(())
    }
}

/// The header of this many columns.
fn layout(headers: &[&str], columns: usize) -> Option<Vec<String>> {
    let names = headers.iter().map(|header| header.split(' '));
    let found = names
        .into_iter()
        .find(|names| names.clone().count() == columns)?;
    Some(found.map(str::to_owned).collect())
}

fn no_header(
    path: &str,
    line: u64,
    text: &str,
    count: usize,
    dictionary: &Dictionary<'_>,
) -> Failure {
    let found = shown(text, 60);
    let message = format!("no header with column names, found \"{found}\"");
    let names = layout(dictionary.array, count).map(|names| names.join(","));
    let option = format!(
        "name its {count} columns: --columns {}",
        names.unwrap_or_else(|| "t_s,accel_x_m_s2,…".to_owned())
    );
    let refusal = Failure::contents(path, line, message).or_hint(dictionary.advice);
    match dictionary.array {
        [] => refusal,
        _ => refusal.or_option(("columns", option)),
    }
}

/// The cells of a line as words, and what separates them.
pub(super) fn cells(line: &str, dictionary: &Dictionary<'_>) -> (Vec<String>, u8) {
    let delimiter = delimiter_of(line, dictionary);
    (words_of(line, delimiter), delimiter)
}

/// The cells of a line as words, without empty ones at its end.
fn words_of(line: &str, delimiter: u8) -> Vec<String> {
    let cells = split(line.as_bytes(), delimiter);
    let is_full = |cell: &Cow<'_, [u8]>| !cell.trim_ascii().is_empty();
    let count = cells.iter().rposition(is_full).map_or(0, |at| at + 1);
    let word = |cell: &Cow<'_, [u8]>| String::from_utf8_lossy(cell).trim().to_owned();
    cells[..count].iter().map(word).collect()
}

/// The rate in a comment such as `Update Rate: 100.0Hz`.
fn rate_in(comment: &str) -> Option<f64> {
    let lower = comment.to_lowercase();
    let words = ["update rate", "sample rate", "sampling rate", "output rate"];
    let after = words.iter().find_map(|w| lower.split_once(w))?.1;
    let value = after.trim_start_matches(|c: char| !c.is_ascii_digit());
    let digits = value
        .split(|c: char| !c.is_ascii_digit() && c != '.')
        .next()?;
    digits.parse().ok().filter(|r: &f64| *r > 0.0)
}

/// The separator of the cells of a line: the most frequent of comma, semicolon and tab, of equals the last; but of n cells
/// between semicolons, tabs or blanks each may have a decimal comma. Blanks do only where nothing else does and they are not
/// inside one name.
fn delimiter_of(line: &str, dictionary: &Dictionary<'_>) -> u8 {
    let count = |d: u8| line.bytes().filter(|b| *b == d).count();
    let [commas, semicolons, tabs] = [b',', b';', b'\t'].map(count);
    let others = semicolons.max(tabs);
    let is_spaced = count(b' ') > 0 && find(dictionary.quantities, line).is_none();
    let is_number = |cell: &str| {
        !(cell.starts_with(',') || cell.ends_with(',')) && number(cell.as_bytes(), b' ').is_some()
    };
    let are_numbers = || line.split_whitespace().all(is_number);
    match () {
        () if others > 0 && tabs >= semicolons && commas <= others + 1 => b'\t',
        () if others > 0 && commas <= others + 1 => b';',
        () if is_spaced && (commas == 0 || are_numbers()) => b' ',
        () => b',',
    }
}

/// The cells of a line, quotes removed.
fn split(line: &[u8], delimiter: u8) -> Vec<Cow<'_, [u8]>> {
    let is_end = |b: &u8| b"\r\n".contains(b);
    let line = &line[..line.iter().rposition(|b| !is_end(b)).map_or(0, |at| at + 1)];
    if line.contains(&b'"') {
        let (mut cells, mut start) = (Vec::with_capacity(16), 0);
        let (mut is_open, mut before) = (false, delimiter);
        let is_blank = |byte: u8| byte == b' ' && delimiter != b' ';
        for (k, byte) in line.iter().chain([&delimiter]).enumerate() {
            let is_end = *byte == delimiter && !is_open || k == line.len();
            if is_end && (delimiter != b' ' || start < k) {
                cells.push(unquoted(&line[start..k]));
            }
            start = if is_end { k + 1 } else { start };
            is_open ^= is_quote(*byte, is_open, before, delimiter);
            before = if is_blank(*byte) { before } else { *byte };
        }
        return cells;
    }
    // Large tables spend their time here: the vector does not grow, and a cell costs one comparison a byte.
    let mut cells = Vec::with_capacity(16);
    match delimiter {
        b' ' => {
            let parts = line.split(|b| b" \t".contains(b));
            cells.extend(parts.filter(|part| !part.is_empty()).map(Cow::Borrowed));
        }
        _ => cells.extend(line.split(|b| *b == delimiter).map(Cow::Borrowed)),
    }
    cells
}

/// True if a byte is a quote that begins or ends a quoted cell, or one of two that stand for one.
const fn is_quote(byte: u8, is_open: bool, before: u8, delimiter: u8) -> bool {
    byte == b'"' && (is_open || before == delimiter || before == b'"')
}

/// Contents of a cell without the quotes around it.
fn unquoted(cell: &[u8]) -> Cow<'_, [u8]> {
    let inside = cell
        .trim_ascii()
        .strip_prefix(b"\"")
        .and_then(|c| c.strip_suffix(b"\""));
    match inside {
        Some(inside) if inside.contains(&b'"') => {
            let text = String::from_utf8_lossy(inside);
            text.replace("\"\"", "\"").into_bytes().into()
        }
        _ => inside.unwrap_or(cell).into(),
    }
}

/// True if a row has units, say, below the names: no cell begins as a number does.
fn is_text_row(cells: &[Cow<'_, [u8]>]) -> bool {
    let is_word = |cell: &Cow<'_, [u8]>| {
        let first = cell.trim_ascii().first();
        number(cell, b',').is_none() && first.is_none_or(|b| !b"+-.0123456789".contains(b))
    };
    cells.iter().all(is_word)
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

/// A number; with a decimal comma where something else separates.
#[inline]
pub(super) fn number(cell: &[u8], delimiter: u8) -> Option<f64> {
    let text = std::str::from_utf8(cell.trim_ascii()).ok()?;
    let comma = || text.replacen(',', ".", 1).parse().ok();
    let parsed = text.parse().ok();
    parsed.or_else(|| if delimiter == b',' { None } else { comma() })
}

// Tables that are no text: arrays of NumPy, Parquet, directories of KITTI, logs.

/// Columns by their names.
type Columns = Vec<(String, Vec<f64>)>;

/// The table of such columns.
fn of_columns(
    path: &str,
    columns: Columns,
    dictionary: &Dictionary<'_>,
) -> Result<InputTable, Failure> {
    let names: Vec<String> = match dictionary.names {
        Some(names) if names.len() != columns.len() => {
            return Err(Failure::row_length(path, 1, columns.len(), names.len()));
        }
        Some(names) => names.to_vec(),
        None => columns.iter().map(|(name, _)| name.clone()).collect(),
    };
    let mut table = InputTable::new(path, 0, &names, dictionary, false)?;
    table.fits(columns.first().map_or(0, |(_, values)| values.len() as u64))?;
    for column in 0..table.columns.len() {
        let (_, values) = &columns[table.columns[column].place];
        for (row, value) in values.iter().enumerate() {
            table.push(column, *value, None, table.line(row), dictionary)?;
        }
    }
    Ok(table)
}

/// Every `step`-th number from the `first` on.
fn strided(array: &Array, first: usize, step: usize) -> Vec<f64> {
    array
        .values
        .iter()
        .skip(first)
        .step_by(step)
        .copied()
        .collect()
}

/// Reads an array: columns named by who asks, or by their number.
fn npy(path: &Path, dictionary: &Dictionary<'_>) -> Result<Columns, Failure> {
    let array = npy::read(path).map_err(|e| logs::refused(path, e))?;
    let refused = |message: String| Failure::contents(path.display(), Place::Within, message);
    let count = match array.shape[..] {
        [_] => 1,
        [_, columns] => columns,
        _ => {
            let dimensions = array.shape.len();
            return Err(refused(format!(
                "an array of {dimensions} dimensions, not samples × columns"
            )));
        }
    };
    let named = dictionary.names.map(|_| vec![String::new(); count]);
    let names = named.or_else(|| layout(dictionary.array, count));
    let names = names.ok_or_else(|| {
        refused(format!("an array of {count} columns of unknown names"))
            .or_hint(dictionary.advice)
            .or_option(help::COLUMN_NAMES)
    })?;
    let columns = (0..).zip(names);
    Ok(columns
        .map(|(k, name)| (name, strided(&array, k, count)))
        .collect())
}

/// Name of the array of a single number that states the rate (Hz).
#[cfg(feature = "npz")]
const RATE: &str = "rate_hz";

/// Reads named arrays: a vector is a column, an array of three columns the three axes of a sensor. Also the rate (Hz), if
/// it is stated.
#[cfg(feature = "npz")]
fn npz(path: &Path) -> Result<(Columns, Option<f64>), Failure> {
    use nav_sim_logs::{LogFault, npz::Archive};
    let refused = |e| logs::refused(path, e);
    let mut archive = Archive::open(path).map_err(refused)?;
    let (mut columns, mut rate_hz) = (Vec::new(), None);
    for name in archive.names() {
        let Array { shape, values } = match archive.read(&name) {
            // texts and the like are passed over
            Err(e) if matches!(e.fault, LogFault::Encoding) => {
                columns.push((name, Vec::new()));
                continue;
            }
            read => read.map_err(refused)?,
        };
        match shape[..] {
            [] | [1] if name == RATE => rate_hz = values.first().copied(),
            [_] => columns.push((name, values)),
            [_, 3] => {
                let array = Array { shape, values };
                columns.extend((0..3).map(|k| (of_axis(&name, k), strided(&array, k, 3))));
            }
            _ => columns.push((name, Vec::new())),
        }
    }
    Ok((columns, rate_hz))
}

/// The name of one axis of a sensor's array: `accel_m_s2` has `accel_x_m_s2`.
#[cfg(feature = "npz")]
fn of_axis(name: &str, axis: usize) -> String {
    let units = ["_m_s2", "_rad_s", "_deg_s"];
    let unit = units.iter().find_map(|unit| name.find(unit));
    let (stem, unit) = name.split_at(unit.or(name.find('_')).unwrap_or(name.len()));
    format!("{stem}_{}{unit}", ["x", "y", "z"][axis])
}

/// Reads Apache Parquet: columns by their names; what is no number is NaN.
#[cfg(feature = "parquet")]
fn parquet(path: &Path) -> Result<Columns, Failure> {
    use parquet::basic::{ConvertedType, LogicalType, TimeUnit};
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    let damaged = |e: parquet::errors::ParquetError| {
        Failure::contents(path.display(), Place::Within, e.to_string())
    };
    let file = std::fs::File::open(path).map_err(|e| unreadable(path, e))?;
    let reader = SerializedFileReader::new(file).map_err(damaged)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    // the type of a time stamp has its unit, whatever its name says
    let named = schema.root_schema().get_fields().iter().map(|column| {
        let column = column.get_basic_info();
        let name = match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Timestamp(of)), _) => match of.unit {
                TimeUnit::MILLIS => "t_ms",
                TimeUnit::MICROS => "t_us",
                TimeUnit::NANOS => "t_ns",
            },
            (_, ConvertedType::TIMESTAMP_MILLIS) => "t_ms",
            (_, ConvertedType::TIMESTAMP_MICROS) => "t_us",
            _ => column.name(),
        };
        (name.to_owned(), Vec::new())
    });
    let mut columns: Columns = named.collect();
    for row in reader.get_row_iter(None).map_err(damaged)? {
        let row = row.map_err(damaged)?;
        for ((_, field), (_, values)) in row.get_column_iter().zip(&mut columns) {
            values.push(match field {
                Field::Double(value) => *value,
                Field::Float(value) => f64::from(*value),
                Field::Float16(value) => f64::from(*value),
                Field::Byte(value) => f64::from(*value),
                Field::Short(value) => f64::from(*value),
                Field::Int(value) => f64::from(*value),
                Field::UByte(value) => f64::from(*value),
                Field::UShort(value) => f64::from(*value),
                Field::UInt(value) => f64::from(*value),
                Field::ULong(value) => *value as f64,
                Field::Long(value)
                | Field::TimestampMillis(value)
                | Field::TimestampMicros(value) => *value as f64,
                // two's complement, the highest byte first
                Field::Decimal(value) => {
                    let bytes = value.data();
                    let negative = bytes.first().is_some_and(|b| *b >= 128);
                    let whole = bytes.iter().fold(-f64::from(u8::from(negative)), |x, b| {
                        x * 256.0 + f64::from(*b)
                    });
                    whole / 10_f64.powi(value.scale())
                }
                // of no such type is a measurement: NaN, which is refused where one is wanted
                _ => f64::NAN,
            });
        }
    }
    Ok(columns)
}

/// Names of the quantities of a sample of KITTI that are read, and their places in its line.
///
/// The numbers are those of `dataformat.txt` there ([Geiger et al. 2013](https://doi.org/10.1177/0278364913491297), sec.
/// III-A): accelerations and angular rates in the axes of the vehicle, front, left, up, are the 12th to 14th and 18th to 20th.
const OXTS: [(&str, usize); 6] = [
    ("accel_x_m_s2", 11),
    ("accel_y_m_s2", 12),
    ("accel_z_m_s2", 13),
    ("gyro_x_rad_s", 17),
    ("gyro_y_rad_s", 18),
    ("gyro_z_rad_s", 19),
];

/// True if a directory is a recording of KITTI: one line a sample in `data/`, and their times in `timestamps.txt`.
pub(crate) fn is_oxts(directory: &Path) -> bool {
    directory.join("timestamps.txt").is_file() && directory.join("data").is_dir()
}

/// Reads such a directory.
fn oxts(directory: &Path) -> Result<Columns, Failure> {
    let times = oxts_times(&directory.join("timestamps.txt"))?;
    let data = directory.join("data");
    let entries = std::fs::read_dir(&data).map_err(|e| unreadable(&data, e))?;
    let mut files: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "txt"));
    files.sort();
    if files.len() != times.len() {
        let (samples, times) = (files.len(), times.len());
        let message = format!("{samples} samples in data, {times} times in timestamps.txt");
        return Err(Failure::contents(
            directory.display(),
            Place::Within,
            message,
        ));
    }
    let mut columns = vec![("t_s".to_owned(), times)];
    columns.extend(OXTS.map(|(name, _)| (name.to_owned(), Vec::new())));
    for path in &files {
        let text = source::text(path).map_err(|e| unreadable(path, e))?;
        let cells: Vec<&str> = text.split_ascii_whitespace().collect();
        for ((_, values), (name, at)) in columns[1..].iter_mut().zip(OXTS) {
            let cell = cells.get(at).copied().unwrap_or_default();
            let finite = number(cell.as_bytes(), b' ').filter(|x| x.is_finite());
            values.push(finite.ok_or_else(|| {
                let (path, cell) = (path.display().to_string(), format!("\"{cell}\""));
                Failure::cell(&path, 1, name, cell, "is not a finite number")
            })?);
        }
    }
    Ok(columns)
}

/// Times of the samples (s since 1970).
fn oxts_times(path: &Path) -> Result<Vec<f64>, Failure> {
    let text = source::text(path).map_err(|e| unreadable(path, e))?;
    let time = |(i, line): (usize, &str)| {
        let parsed = NaiveDateTime::parse_from_str(line.trim(), "%Y-%m-%d %H:%M:%S%.f");
        let found = parsed.map_err(|_| {
            let message = format!("\"{}\" is not a time", shown(line, 40));
            Failure::contents(path.display(), i + 1, message)
                .or_hint("2011-09-26 13:02:25.964389445")
        })?;
        let since = found.and_utc();
        Ok(since.timestamp() as f64 + 1e-9 * f64::from(since.timestamp_subsec_nanos()))
    };
    let lines = text.lines().enumerate();
    lines
        .filter(|(_, line)| !line.trim().is_empty())
        .map(time)
        .collect()
}

/// Reads the samples of the IMU of a log.
fn log(
    path: &Path,
    options: Option<&logs::LogOptions>,
    of: &dyn Fn(Columns) -> Result<InputTable, Failure>,
) -> Result<InputTable, Failure> {
    let refused = |e| logs::refused(path, e);
    let log = logs::open(path)?;
    let channel = log.channel(
        Content::Imu,
        options.and_then(|options| options.topic.as_deref()),
    );
    let channel = channel.map_err(refused)?;
    let samples = log
        .imu(
            channel,
            options.map(|options| options.stamp).unwrap_or_default(),
        )
        .map_err(refused)?;
    let times = samples.iter().map(|sample| in_seconds(sample.stamp_ns));
    let mut columns = vec![("t_s".to_owned(), times.collect())];
    for (k, (name, _)) in OXTS.iter().enumerate() {
        let values = samples.iter().map(|sample| match k.checked_sub(3) {
            None => sample.accel_m_s2[k],
            Some(axis) => sample.gyro_rad_s[axis],
        });
        columns.push(((*name).to_owned(), values.collect()));
    }
    let mut table = of(columns)?;
    table.assumptions.push(format!("topic {}", channel.topic));
    table.warnings.extend(log.damage().map(logs::cut_off));
    let is_other = |c: &&LogChannel| c.topic != channel.topic && c.clock == Clock::Unix;
    let others = log.channels().iter().filter(is_other);
    table.ignored = others.map(|c| c.topic.clone()).collect();
    Ok(table)
}
