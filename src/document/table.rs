//! Tables: their cells keep where a number stands in the result.

use crate::number::{readable, seconds};
use serde::Serialize;
use serde_json::Value;

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    pub(crate) text: String,
    /// Where its number stands in the result as JSON, as a JSON pointer.
    pub(crate) pointer: String,
    pub(crate) is_number: bool,
}

impl Cell {
    /// A number, shown with three digits; `pointer` says where it stands in the result as JSON, such as
    /// `/outages/0/nees_end`: tests hold the page against it.
    pub fn number(value: f64, pointer: &str) -> Self {
        Self {
            text: readable(value),
            pointer: pointer.to_owned(),
            is_number: true,
        }
    }

    /// A number, or several, as they are to be shown.
    pub fn figures(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            pointer: String::new(),
            is_number: true,
        }
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self {
            text: text.into(),
            pointer: String::new(),
            is_number: false,
        }
    }
}

/// A table: its head, and rows of as many cells. The first column stays where it is when a phone scrolls the rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub(crate) head: Vec<String>,
    pub(crate) rows: Vec<Vec<Cell>>,
    /// Columns before the others that name a row: they stand in each part of a table that is cut.
    pub(crate) keys: usize,
}

impl Table {
    /// An empty table.
    pub fn new<const N: usize>(head: [&str; N]) -> Self {
        Self {
            head: head.map(str::to_owned).into(),
            rows: Vec::new(),
            keys: 1,
        }
    }

    /// The same with further columns.
    pub fn and(mut self, head: impl IntoIterator<Item = String>) -> Self {
        self.head.extend(head);
        self
    }

    /// The same with so many columns that name a row.
    #[must_use]
    pub fn with_keys(self, keys: usize) -> Self {
        Self { keys, ..self }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Whether it has no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Whether all cells of a column are numbers.
    pub(crate) fn is_numeric(&self, column: usize) -> bool {
        !self.rows.is_empty()
            && self
                .rows
                .iter()
                .all(|row| row.get(column).is_some_and(|c| c.is_number))
    }

    /// The same without columns of which no row knows anything, for results that have no such figures.
    pub fn without_unknown(self) -> Self {
        let is_known = |cell: &Cell| cell.text.contains(|letter| !"[–, ]".contains(letter));
        let kept: Vec<bool> = (0..self.head.len())
            .map(|k| self.rows.iter().any(|row| is_known(&row[k])))
            .collect();
        fn only<T>(row: Vec<T>, kept: &[bool]) -> Vec<T> {
            row.into_iter()
                .zip(kept)
                .filter_map(|(cell, kept)| kept.then_some(cell))
                .collect()
        }
        let rows = self.rows.into_iter().map(|row| only(row, &kept)).collect();
        Self {
            head: only(self.head, &kept),
            rows,
            ..self
        }
    }
}

impl Table {
    /// A table of the entries of a result, by its own JSON.
    ///
    /// `rows` is the path of the entries, with `*` for each of a list: `/designs/*/horizontal_p95/*`. A column is a
    /// title and a key of the entry: `p95_m`, or `../../hours` of what holds it. After `|` stands the text where the
    /// value is missing, else `–`; a list is an interval, `1 … 2`; a key of braces, `{start_s}–{end_s} s`, is a text with values in it. A key with `*`
    /// makes a column for each of the list, with a title from its entries: `("RMSE {after_s} s", "ends/*/rmse_m")`.
    /// `.` is the entry itself, `@` its name, such as in `../../asee_end/@`.
    ///
    /// ```
    /// use nav_sim_document::Table;
    ///
    /// let result = serde_json::json!({ "filters": [{ "name": "tuned", "ends": [{ "after_s": 60, "rmse_m": 4.2 }] }] });
    /// let columns = [("filter", "name"), ("RMSE {after_s} s", "ends/*/rmse_m"), ("cost", "cost|none")];
    /// let table = Table::of(&result, "/filters/*", &columns);
    /// assert_eq!(table.csv(), "filter,RMSE 60 s,cost\ntuned,4.20,none\n");
    /// ```
    pub fn of(result: &impl Serialize, rows: &str, columns: &[(&str, &str)]) -> Self {
        let json = serde_json::to_value(result).unwrap_or_default();
        let places = places(&json, rows);
        let mut expanded = Vec::new();
        for (title, key) in columns {
            match (key.split_once("/*"), places.first()) {
                (Some((list, rest)), Some(first)) => {
                    for place in self::places(&json, &format!("{first}/{list}/*")) {
                        let index = place.rsplit('/').next().unwrap_or_default();
                        let title = filled(title, &json, &place);
                        expanded.push((title, format!("{list}/{index}{rest}")));
                    }
                }
                (Some(_), None) => {}
                (None, _) => expanded.push(((*title).to_owned(), (*key).to_owned())),
            }
        }
        let row = |place: &String| {
            let cell = |(_, key): &(String, String)| cell(&json, place, key);
            expanded.iter().map(cell).collect()
        };
        Self {
            rows: places.iter().map(row).collect(),
            head: expanded.into_iter().map(|(title, _)| title).collect(),
            keys: 1,
        }
    }

    /// A table of single values of a result: a row is a title and the keys of its cells, as in [`Table::of`], with blanks
    /// between them. A row of which nothing is known is left out.
    ///
    /// ```
    /// use nav_sim_document::Table;
    ///
    /// let result = serde_json::json!({ "nis": { "mean": 5.9, "dof": 6 } });
    /// let rows = [("NIS ({nis/dof} if right)", "nis/mean"), ("NEES", "nees/mean")];
    /// assert_eq!(Table::of_keys(&result, &["", "mean"], &rows).csv(), ",mean\nNIS (6 if right),5.90\n");
    /// ```
    pub fn of_keys(result: &impl Serialize, head: &[&str], rows: &[(&str, &str)]) -> Self {
        let json = serde_json::to_value(result).unwrap_or_default();
        let row = |(title, keys): &(&str, &str)| {
            let cells: Vec<Cell> = keys.split(' ').map(|key| cell(&json, "", key)).collect();
            let is_known = cells.iter().any(|cell| cell.text != "–");
            is_known.then(|| [vec![filled(title, &json, "").into()], cells].concat())
        };
        Self {
            head: head.iter().map(|title| (*title).to_owned()).collect(),
            rows: rows.iter().filter_map(row).collect(),
            keys: 1,
        }
    }
}

/// The places that a path with `*` stands for.
fn places(json: &Value, path: &str) -> Vec<String> {
    let mut places = vec![String::new()];
    for part in path.split('/').skip(1) {
        let of = |place: &String| match (part, json.pointer(place)) {
            ("*", Some(Value::Array(list))) => {
                (0..list.len()).map(|k| format!("{place}/{k}")).collect()
            }
            ("*", Some(Value::Object(fields))) => {
                fields.keys().map(|key| format!("{place}/{key}")).collect()
            }
            ("*", _) => Vec::new(),
            (part, _) => vec![format!("{place}/{part}")],
        };
        places = places.iter().flat_map(of).collect();
    }
    places
}

/// The place of a key beside or above another.
fn resolved(place: &str, key: &str) -> String {
    let mut parts: Vec<&str> = place.split('/').collect();
    let name = parts.last().copied().unwrap_or_default();
    for part in key.split('/') {
        match part {
            "." => {}
            ".." => _ = parts.pop(),
            "@" => parts.push(name),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

fn cell(json: &Value, place: &str, key: &str) -> Cell {
    if key.contains('{') {
        return filled(key, json, place).into();
    }
    if key == "@" {
        return place.rsplit('/').next().unwrap_or_default().into();
    }
    let (key, missing) = key.split_once('|').unwrap_or((key, "–"));
    let pointer = resolved(place, key);
    match json.pointer(&pointer) {
        Some(Value::Number(number)) if number.is_f64() => {
            Cell::number(number.as_f64().unwrap_or(f64::NAN), &pointer)
        }
        Some(Value::Null) | None => Cell::figures(missing),
        Some(value @ (Value::Number(_) | Value::Array(_))) => Cell::figures(text(value)),
        Some(value) => text(value).into(),
    }
}

fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => readable(number.as_f64().unwrap_or(f64::NAN)),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        Value::Null => "–".to_owned(),
        Value::Array(list) => list.iter().map(text).collect::<Vec<_>>().join(" … "),
        other => other.to_string(),
    }
}

/// A text with the values of an entry in its braces; numbers to a hundredth.
fn filled(template: &str, json: &Value, place: &str) -> String {
    let mut parts = template.split('{');
    let mut filled = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (key, rest) = part.split_once('}').unwrap_or((part, ""));
        match json.pointer(&resolved(place, key)) {
            Some(Value::Number(number)) => filled += &seconds(number.as_f64().unwrap_or(f64::NAN)),
            value => filled += &value.map_or_else(|| "–".to_owned(), text),
        }
        filled += rest;
    }
    filled
}
