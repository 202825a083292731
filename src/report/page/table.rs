//! Tables of a page.

use super::escape;
use crate::report::number::{percent, readable};
use std::fmt::Write as _;

/// Characters beyond which a text has more than one line.
const LONG: usize = 40;

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cell {
    text: String,
    /// Where its number stands in the results as JSON, as a JSON pointer.
    source: String,
    is_number: bool,
}

impl Cell {
    /// A number, shown with three digits; `source` says where it stands in the results as JSON, as a JSON pointer
    /// such as `/outages/0/nees_end`: tests hold the page against it.
    pub(crate) fn number(value: f64, source: &str) -> Self {
        Self { text: readable(value), source: source.to_owned(), is_number: true }
    }

    /// A share, shown in per cent; `source` as that of [`Self::number`].
    pub(crate) fn share(value: f64, source: &str) -> Self {
        Self { text: percent(value), ..Self::number(value, source) }
    }

    /// A number, or several, as they are to be shown.
    pub(crate) fn figures(text: impl Into<String>) -> Self {
        Self { text: text.into(), source: String::new(), is_number: true }
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self { text: text.into(), source: String::new(), is_number: false }
    }
}

/// A table: its head, and rows of as many cells. The first column stays where it is when a phone scrolls the rest.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Table {
    head: Vec<String>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// An empty table.
    pub(crate) fn new<const N: usize>(head: [&str; N]) -> Self {
        Self { head: head.map(str::to_owned).into(), rows: Vec::new() }
    }

    /// The same with further columns.
    pub(crate) fn and(mut self, head: impl IntoIterator<Item = String>) -> Self {
        self.head.extend(head);
        self
    }

    /// A table of texts, the first row its head.
    pub(crate) fn of_rows(rows: &[Vec<String>]) -> Self {
        let Some((head, rows)) = rows.split_first() else { return Self::default() };
        let cells = |row: &Vec<String>| row.iter().map(|text| Cell::from(text.clone())).collect();
        Self { head: head.clone(), rows: rows.iter().map(cells).collect() }
    }

    /// Adds a row.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The same without columns of which no row knows anything, for results that have no such figures.
    pub(crate) fn without_unknown(self) -> Self {
        let is_known = |cell: &Cell| cell.text.contains(|letter| !"[–, ]".contains(letter));
        let kept: Vec<bool> =
            (0..self.head.len()).map(|k| self.rows.iter().any(|row| is_known(&row[k]))).collect();
        fn only<T>(row: Vec<T>, kept: &[bool]) -> Vec<T> {
            row.into_iter().zip(kept).filter_map(|(cell, kept)| kept.then_some(cell)).collect()
        }
        let rows = self.rows.into_iter().map(|row| only(row, &kept)).collect();
        Self { head: only(self.head, &kept), rows }
    }

    pub(super) fn html(&self) -> String {
        let mut html = "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead><tr>".to_owned();
        let is_number = |column: usize| {
            self.rows.iter().all(|row| row.get(column).is_some_and(|c| c.is_number)) && !self.rows.is_empty()
        };
        for (column, name) in self.head.iter().enumerate() {
            let class = if is_number(column) { " class=\"number\"" } else { "" };
            let _ = write!(html, "<th{class}>{}</th>", escape(name));
        }
        html += "</tr></thead>\n<tbody>\n";
        for row in &self.rows {
            html += "<tr>";
            for cell in row {
                let class = match cell.is_number {
                    true => " class=\"number\"",
                    false if cell.text.chars().count() > LONG => " class=\"long\"",
                    false => "",
                };
                let source = match cell.source.as_str() {
                    "" => String::new(),
                    pointer => format!(" data-json=\"{}\"", escape(pointer)),
                };
                let _ = write!(html, "<td{class}{source}>{}</td>", escape(&cell.text));
            }
            html += "</tr>\n";
        }
        html + "</tbody></table></div>\n"
    }
}
