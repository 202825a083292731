//! Tables: their cells keep where a number stands in the result.

use crate::number::{percent, readable};

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

    /// A share, shown in per cent; `pointer` as that of [`Self::number`].
    pub fn share(value: f64, pointer: &str) -> Self {
        Self {
            text: percent(value),
            ..Self::number(value, pointer)
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

    /// A table of texts, the first row its head.
    pub fn of_rows(rows: &[Vec<String>]) -> Self {
        let Some((head, rows)) = rows.split_first() else {
            return Self::new([]);
        };
        let cells = |row: &Vec<String>| row.iter().map(|text| Cell::from(text.clone())).collect();
        Self {
            head: head.clone(),
            rows: rows.iter().map(cells).collect(),
            keys: 1,
        }
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
