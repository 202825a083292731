//! Tables: their cells keep where a number stands in the result.

use crate::draw::one_line;
use crate::number::{readable, seconds};
use serde::Serialize;
use serde_json::Value;

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    pub(crate) text: String,
    /// JSON pointer to its number in the answer.
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
    keys: usize,
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

    /// The table with further columns.
    pub fn and(mut self, head: impl IntoIterator<Item = String>) -> Self {
        self.head.extend(head);
        self
    }

    /// The table with this many columns that name a row.
    #[must_use]
    pub fn with_keys(self, keys: usize) -> Self {
        Self { keys, ..self }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Returns true if it has no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns true if all cells of a column are numbers.
    pub(crate) fn is_numeric(&self, column: usize) -> bool {
        !self.rows.is_empty()
            && self
                .rows
                .iter()
                .all(|row| row.get(column).is_some_and(|c| c.is_number))
    }

    /// The table without columns of which no row knows anything, for results that have no such figures.
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
    /// `rows` is the path of the entries, with `*` for each of a list: `/designs/*/horizontal_p95/*`; `N|B` are the entries
    /// of these names, `!N|B` all others. A column is a
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
    /// assert_eq!(table.columns(80), "  filter  RMSE 60 s  cost\n  tuned        4.20  none");
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
    /// assert_eq!(Table::of_keys(&result, &["", "mean"], &rows).columns(80), "                    mean\n  NIS (6 if right)  5.90");
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
            (names, Some(Value::Object(fields))) if names.contains('|') => {
                let others = names.strip_prefix('!');
                let listed = || others.unwrap_or(names).split('|');
                let keys: Vec<&str> = match others {
                    None => listed().filter(|name| fields.contains_key(*name)).collect(),
                    Some(_) => fields
                        .keys()
                        .map(String::as_str)
                        .filter(|key| listed().all(|name| name != *key))
                        .collect(),
                };
                keys.iter().map(|key| format!("{place}/{key}")).collect()
            }
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

// Tables as text: columns of a terminal, Markdown, CSV, LaTeX.

impl Table {
    /// Head and rows as texts, each line of its own.
    fn lines(&self) -> Vec<Vec<String>> {
        let rows = self
            .rows
            .iter()
            .map(|row| row.iter().map(|cell| one_line(&cell.text)).collect());
        std::iter::once(self.head.clone()).chain(rows).collect()
    }

    /// Columns for a terminal of so many characters; a table that is wider is cut, each part with the key columns.
    #[must_use]
    pub fn columns(&self, width: usize) -> String {
        const GAP: usize = 2;
        let lines = self.lines();
        let widths = widths(&lines);
        let room = |columns: &[usize]| columns.iter().map(|c| widths[*c] + GAP).sum::<usize>();
        let (keys, others): (Vec<usize>, Vec<usize>) =
            (0..widths.len()).partition(|c| *c < self.keys);
        let fits = |size: &usize| {
            others
                .chunks(*size)
                .all(|part| room(&keys) + room(part) <= width)
        };
        let most = (1..=others.len()).rev().find(fits).unwrap_or(1);
        // parts of about as many columns: those of one state stay together
        let size = others
            .len()
            .div_ceil(others.len().div_ceil(most).max(1))
            .max(1);
        let line = |line: &Vec<String>, columns: &[usize]| {
            let cell = |c: &usize| match (line.get(*c).map_or("", String::as_str), widths[*c]) {
                (text, width) if self.is_numeric(*c) => format!("  {text:>width$}"),
                (text, width) => format!("  {text:<width$}"),
            };
            columns
                .iter()
                .map(cell)
                .collect::<String>()
                .trim_end()
                .to_owned()
        };
        let part = |part: &[usize]| {
            let columns = [&keys, part].concat();
            lines
                .iter()
                .map(|l| line(l, &columns))
                .collect::<Vec<_>>()
                .join("\n")
        };
        if others.is_empty() {
            part(&[])
        } else {
            others
                .chunks(size)
                .map(part)
                .collect::<Vec<_>>()
                .join("\n\n")
        }
    }

    /// A table in Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let escaped = |text: &String| text.replace('|', "\\|").replace('<', "&lt;");
        let lines: Vec<Vec<String>> = self
            .lines()
            .iter()
            .map(|line| line.iter().map(escaped).collect())
            .collect();
        let widths = widths(&lines);
        let row = |line: &Vec<String>| {
            line.iter()
                .zip(&widths)
                .map(|(cell, w)| format!("| {cell:<w$} "))
                .collect::<String>()
                + "|"
        };
        let rule = widths
            .iter()
            .map(|w| format!("|{}", "-".repeat(w + 2)))
            .collect::<String>()
            + "|";
        let mut rows: Vec<String> = lines.iter().map(row).collect();
        rows.insert(1, rule);
        rows.join("\n")
    }

    /// A `tabular` of LaTeX (package booktabs), the first column to the left.
    #[must_use]
    pub fn latex(&self) -> String {
        let line = |line: &Vec<String>| {
            let cells = line.iter().map(|cell| latex(cell));
            cells.collect::<Vec<_>>().join(" & ") + " \\\\\n"
        };
        let layout = format!("l{}", "r".repeat(self.head.len().saturating_sub(1)));
        let body: String = self.lines()[1..].iter().map(line).collect();
        let head = line(&self.head);
        format!(
            "\\begin{{tabular}}{{{layout}}}\n\\toprule\n{head}\\midrule\n{body}\\bottomrule\n\\end{{tabular}}\n"
        )
    }
}

/// Characters of each column.
fn widths(lines: &[Vec<String>]) -> Vec<usize> {
    let width = |c: usize| {
        lines
            .iter()
            .filter_map(|l| l.get(c))
            .map(|cell| cell.chars().count())
            .max()
    };
    (0..lines[0].len()).map(|c| width(c).unwrap_or(0)).collect()
}

/// A text in LaTeX, where a hyphen is no minus.
fn latex(text: &str) -> String {
    let (sign, rest) = text
        .strip_prefix('-')
        .map_or(("", text), |rest| ("$-$", rest));
    let letter = |c: char| match c {
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        '\\' => "\\textbackslash{}".to_owned(),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '±' => "$\\pm$".to_owned(),
        '−' => "$-$".to_owned(),
        '–' => "--".to_owned(),
        '\n' | '\r' => " ".to_owned(),
        c => c.to_string(),
    };
    sign.to_owned() + &rest.chars().map(letter).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Cell;

    fn table<T: AsRef<str>>(rows: &[Vec<T>]) -> Table {
        let texts = |row: &Vec<T>| {
            row.iter()
                .map(|c| c.as_ref().to_owned())
                .collect::<Vec<_>>()
        };
        let mut table = Table::new([]).and(texts(&rows[0]));
        let cells = rows[1..]
            .iter()
            .map(|row| texts(row).into_iter().map(Cell::from));
        cells.for_each(|row| table.row(row));
        table.with_keys(1)
    }

    #[test]
    fn names_stay_in_their_cells() {
        let markdown = table(&[vec!["run"], vec!["a|b\n<script>"]]).markdown();
        assert_eq!(
            markdown,
            "| run               |\n|-------------------|\n| a\\|b\\n&lt;script> |"
        );
    }

    #[test]
    fn tables_of_other_programs_are_escaped() {
        let table = table(&[vec!["run", "a, b"], vec!["x_1 & 5 %", "1 ± 2"]]);
        let latex = table.latex();
        assert!(
            latex.starts_with("\\begin{tabular}{lr}\n\\toprule\nrun & a, b \\\\\n\\midrule\n"),
            "{latex}"
        );
        assert!(
            latex.contains("x\\_1 \\& 5 \\% & 1 $\\pm$ 2 \\\\\n\\bottomrule"),
            "{latex}"
        );
        let set = ["-1.67 ± 0.50", "a-4 -b"].map(super::latex);
        assert_eq!(set, ["$-$1.67 $\\pm$ 0.50", "a-4 -b"]);
    }

    /// Columns of 22 characters with their gap beside a key of 12: four take 100, five 122. Nine are three times three.
    #[test]
    fn wide_tables_are_cut_and_lose_nothing() {
        let row = |k: usize| {
            let cells = (0..9).map(|c| format!("{:>20}", format!("{k}.{c}")));
            std::iter::once(format!("{k:>10}"))
                .chain(cells)
                .collect::<Vec<String>>()
        };
        let wide = table(&(0..3).map(row).collect::<Vec<_>>());
        let parts: Vec<String> = wide.columns(100).split("\n\n").map(str::to_owned).collect();
        assert_eq!(parts.len(), 3);
        assert!(
            parts
                .iter()
                .flat_map(|part| part.lines())
                .all(|line| line.chars().count() <= 100)
        );
        let words: Vec<&str> = parts
            .iter()
            .flat_map(|part| part.lines().nth(2))
            .flat_map(str::split_whitespace)
            .collect();
        assert_eq!(
            words,
            [
                "2", "2.0", "2.1", "2.2", "2", "2.3", "2.4", "2.5", "2", "2.6", "2.7", "2.8"
            ]
        );
        // nothing can be done about a column that is wider than a terminal
        assert_eq!(
            table(&[vec!["a".repeat(100), "b".repeat(100)]])
                .columns(100)
                .lines()
                .count(),
            1
        );
    }

    #[test]
    fn numbers_stand_at_the_right() {
        let mut table = Table::new(["state", "RMSE (m)"]);
        table.row(["north".into(), Cell::number(12.0, "")]);
        table.row(["east".into(), Cell::number(1.0, "")]);
        assert_eq!(
            table.columns(100),
            "  state  RMSE (m)\n  north      12.0\n  east       1.00"
        );
    }
}
