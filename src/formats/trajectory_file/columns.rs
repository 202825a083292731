//! Columns of a table by the quantity that their names stand for, with its unit.

use super::table::Table;
use crate::formats::suggest::nearest;
use crate::formats::{FileError as Error, Kind};
use nav_sim_signal::units::DEG;

/// Kind of a quantity, by which its unit may be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::formats) enum Unit {
    Time,
    Angle,
    Length,
    Speed,
    Count,
}

impl Unit {
    /// Endings of names and the factors to SI.
    const fn endings(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Time => &[("_s", 1.0), ("_ms", 1e-3), ("_us", 1e-6), ("_ns", 1e-9)],
            Self::Angle => &[("_deg", DEG), ("_rad", 1.0)],
            Self::Length => &[("_m", 1.0)],
            Self::Speed => &[("_m_s", 1.0), ("_mps", 1.0)],
            Self::Count => &[],
        }
    }

    /// Factor of a name without a unit: seconds, degrees, metres, metres a second.
    const fn bare(self) -> f64 {
        if matches!(self, Self::Angle) {
            DEG
        } else {
            1.0
        }
    }
}

/// A quantity: its own name, the names that other programs have for it without the unit, whether these may stand without
/// it, and its sign.
#[derive(Debug)]
pub(in crate::formats) struct Known {
    pub(in crate::formats) name: &'static str,
    pub(in crate::formats) stems: &'static [&'static str],
    pub(in crate::formats) unit: Unit,
    pub(in crate::formats) may_be_bare: bool,
    pub(in crate::formats) sign: f64,
}

impl Known {
    pub(in crate::formats) const fn new(
        name: &'static str,
        stems: &'static [&'static str],
        unit: Unit,
        may_be_bare: bool,
    ) -> Self {
        Self {
            name,
            stems,
            unit,
            may_be_bare,
            sign: 1.0,
        }
    }

    /// The factor of a column of this name; none of another quantity.
    fn factor(&self, name: &str) -> Option<f64> {
        let of_ending = |(ending, factor): &(&str, f64)| {
            self.stems
                .contains(&name.strip_suffix(ending)?)
                .then_some(*factor)
        };
        let bare = || (self.may_be_bare && self.stems.contains(&name)).then(|| self.unit.bare());
        self.unit
            .endings()
            .iter()
            .find_map(of_ending)
            .or_else(bare)
            .map(|factor| self.sign * factor)
    }
}

/// Quantity of a name and the factor to SI.
pub(super) fn classify(known: &'static [Known], name: &str) -> Option<(&'static str, f64)> {
    let name = name.to_lowercase().replace([' ', '-'], "_");
    known
        .iter()
        .find_map(|quantity| Some((quantity.name, quantity.factor(&name)?)))
}

/// A column of a quantity.
#[derive(Debug, Clone, Copy)]
pub(in crate::formats) struct Column {
    pub(in crate::formats) index: usize,
    factor: f64,
}

impl Column {
    /// The value in a row, in SI.
    pub(in crate::formats) fn of(self, row: &[f64]) -> f64 {
        row[self.index] * self.factor
    }
}

/// Columns of the quantities in a table.
#[derive(Debug)]
pub(in crate::formats) struct Columns {
    found: Vec<(&'static str, Column)>,
    /// Columns that mean nothing here.
    pub(in crate::formats) ignored: Vec<String>,
}

impl Columns {
    /// Finds them.
    ///
    /// # Errors
    /// Two columns of one quantity.
    pub(in crate::formats) fn new(table: &Table, known: &'static [Known]) -> Result<Self, Error> {
        let mut columns = Self {
            found: Vec::new(),
            ignored: Vec::new(),
        };
        for (index, name) in table.columns.iter().enumerate() {
            let Some((quantity, factor)) = classify(known, name) else {
                columns.ignored.push(name.clone());
                continue;
            };
            if let Some(earlier) = columns.get(quantity) {
                let first = &table.columns[earlier.index];
                let message = format!("columns \"{first}\" and \"{name}\" both give {quantity}");
                return Err(
                    Error::contents(table.path.as_str(), table.header_line, message)
                        .advice("remove one of them"),
                );
            }
            columns.found.push((quantity, Column { index, factor }));
        }
        Ok(columns)
    }

    pub(in crate::formats) fn get(&self, quantity: &str) -> Option<Column> {
        self.found
            .iter()
            .find(|(name, _)| *name == quantity)
            .map(|(_, column)| *column)
    }

    pub(in crate::formats) fn has(&self, quantity: &str) -> bool {
        self.get(quantity).is_some()
    }

    /// Three quantities; none where one is missing.
    pub(in crate::formats) fn three(&self, quantities: [&str; 3]) -> Option<[Column; 3]> {
        let [a, b, c] = quantities.map(|quantity| self.get(quantity));
        Some([a?, b?, c?])
    }

    /// Refuses a table without one of the quantities that are needed; a column that nearly has the name of a missing one
    /// is a slip.
    ///
    /// # Errors
    /// What is missing, with `advice`.
    pub(in crate::formats) fn require(
        &self,
        table: &Table,
        needed: impl IntoIterator<Item = &'static str>,
        advice: &'static str,
    ) -> Result<(), Error> {
        let missing: Vec<_> = needed
            .into_iter()
            .filter(|quantity| !self.has(quantity))
            .collect();
        let refuse = |kind| Error::new(table.path.as_str(), table.header_line, kind);
        let slip = |name: &String| Some((name.clone(), nearest(name, missing.iter().copied())?));
        if let Some((name, meant)) = self.ignored.iter().find_map(slip) {
            let kind = Kind::Contents(format!("unknown column \"{name}\"").into());
            return Err(refuse(kind).advice(format!("did you mean \"{meant}\"?")));
        }
        let columns = match &missing[..] {
            [] => return Ok(()),
            [one] => format!("column {one} is missing"),
            many => format!("columns {} are missing", many.join(", ")),
        };
        Err(refuse(Kind::Columns(columns.into())).advice(advice))
    }
}
