//! `epochs.csv` and `runs.csv` of a run directory, read back.

use super::{FileError, Kind};
use crate::metrics::EpochRow;
use crate::simulation::{OutageRecord, REPORTED, REPORTED_NAMES, RunRecord};
use std::collections::HashMap;

/// What to do about a damaged table.
pub(super) const REPEAT: &str = "repeat the run, or put back its files";

/// Reads `epochs.csv` back, as far as comparisons need it.
///
/// # Errors
/// A missing or doubled column, or a value that is not a finite number (unless no run is left at the epoch).
pub(super) fn parse_epochs(path: &str, text: &str) -> Result<Vec<EpochRow>, FileError> {
    let table = Table::read(path, text)?;
    let (asee, rmse) = (table.states("asee_")?, table.states("rmse_")?);
    let [t_s, nees, coverage] = table.columns(["t_s", "nees", "coverage"])?;
    let values: Vec<usize> = asee.iter().chain(&rmse).copied().chain([nees, coverage]).collect();
    let row = |row: usize| {
        table.finite_or_lost(row, &values)?;
        Ok(EpochRow {
            t_s: table.number(row, t_s)?,
            asee: table.numbers(row, asee)?,
            rmse: table.numbers(row, rmse)?,
            nees: table.number(row, nees)?,
            coverage: table.number(row, coverage)?,
        })
    };
    (0..table.rows.len()).map(row).collect()
}

/// Reads `runs.csv` back.
///
/// # Errors
/// A missing column or a value that is not a number.
pub(super) fn parse_runs(path: &str, text: &str) -> Result<Vec<RunRecord>, FileError> {
    let table = Table::read(path, text)?;
    let (see, see_end, error) =
        (table.states("see_mean_")?, table.states("see_end_")?, table.states("error_end_")?);
    let normalised = table.states("normalised_sq_")?;
    let [run, diverged, nis, fixes, nees, coverage, outage, nees_end, log_density, horizontal, recovery] =
        table.columns([
            "run",
            "diverged",
            "nis_mean",
            "fixes",
            "nees_mean",
            "coverage",
            "outage",
            "nees_end",
            "log_density_end",
            "horizontal_error_end_m",
            "reconvergence_s",
        ])?;
    let mut runs: Vec<RunRecord> = Vec::new();
    for row in 0..table.rows.len() {
        let number = table.number(row, run)? as u64;
        if runs.last().is_none_or(|r| r.run != number) {
            runs.push(RunRecord {
                run: number,
                diverged: table.number(row, diverged)? > 0.0,
                outages: Vec::new(),
                nis: (table.number(row, nis)?, table.number(row, fixes)? as u64),
                rejected: 0, // known to the summary only
                nees_mean: table.number(row, nees)?,
                covered: table.number(row, coverage)?,
                normalised_sq: table.numbers(row, normalised)?,
                horizontal_m: Vec::new(), // its quantiles are in fan.csv
            });
        }
        if table.rows[row][outage].is_empty() {
            continue;
        }
        let record = OutageRecord {
            see_mean: table.numbers(row, see)?,
            see_end: table.numbers(row, see_end)?,
            nees_end: table.number(row, nees_end)?,
            log_density_end: table.number(row, log_density)?,
            error_end: table.numbers(row, error)?,
            horizontal_error_end_m: table.number(row, horizontal)?,
            reconvergence_s: table.number(row, recovery)?,
        };
        if let Some(last) = runs.last_mut() {
            last.outages.push(record);
        }
    }
    Ok(runs)
}

/// A table in memory, its columns by name.
struct Table<'a> {
    path: &'a str,
    index: HashMap<String, usize>,
    names: Vec<String>,
    rows: Vec<csv::StringRecord>,
}

impl<'a> Table<'a> {
    fn read(path: &'a str, text: &str) -> Result<Self, FileError> {
        let syntax = |e: csv::Error| {
            let line = e.position().map_or(1, csv::Position::line);
            FileError::contents(path, line, e.to_string()).advice(REPEAT)
        };
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        let names: Vec<String> = reader.headers().map_err(syntax)?.iter().map(str::to_owned).collect();
        let mut index = HashMap::new();
        for (i, name) in names.iter().enumerate() {
            if index.insert(name.clone(), i).is_some() {
                return Err(columns_error(path, format!("two columns are named \"{name}\"")));
            }
        }
        let rows: Vec<csv::StringRecord> = reader.into_records().collect::<Result<_, _>>().map_err(syntax)?;
        match rows.iter().find(|row| row.len() != names.len()) {
            Some(row) => Err(FileError::row_length(path, line(row), row.len(), names.len())),
            None => Ok(Self { path, index, names, rows }),
        }
    }

    fn column(&self, name: &str) -> Result<usize, FileError> {
        let missing = || columns_error(self.path, format!("no column is named \"{name}\""));
        self.index.get(name).copied().ok_or_else(missing)
    }

    fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], FileError> {
        let mut found = [0; N];
        for (place, name) in found.iter_mut().zip(names) {
            *place = self.column(name)?;
        }
        Ok(found)
    }

    fn states(&self, prefix: &str) -> Result<[usize; REPORTED], FileError> {
        self.columns(REPORTED_NAMES.map(|n| format!("{prefix}{n}")).each_ref().map(String::as_str))
    }

    fn number(&self, row: usize, column: usize) -> Result<f64, FileError> {
        self.rows[row][column].parse().map_err(|_| self.no_number(row, column))
    }

    /// Refuses a row of an epoch in which some values are finite and others not. Where no run is left, all are NaN.
    fn finite_or_lost(&self, row: usize, columns: &[usize]) -> Result<(), FileError> {
        let mut odd = Vec::new();
        for &column in columns {
            let value = self.number(row, column)?;
            if !value.is_finite() {
                odd.push((column, value));
            }
        }
        let is_lost = odd.len() == columns.len() && odd.iter().all(|(_, value)| value.is_nan());
        match odd.first() {
            Some((column, _)) if !is_lost => Err(self.no_number(row, *column)),
            _ => Ok(()),
        }
    }

    fn no_number(&self, row: usize, column: usize) -> FileError {
        let value = format!("\"{}\"", &self.rows[row][column]);
        FileError::cell(self.path, line(&self.rows[row]), &self.names[column], value, "is not a number")
            .advice(REPEAT)
    }

    fn numbers(&self, row: usize, columns: [usize; REPORTED]) -> Result<[f64; REPORTED], FileError> {
        let mut values = [0.0; REPORTED];
        for (value, column) in values.iter_mut().zip(columns) {
            *value = self.number(row, column)?;
        }
        Ok(values)
    }
}

fn line(row: &csv::StringRecord) -> u64 {
    row.position().map_or(0, csv::Position::line)
}

fn columns_error(path: &str, message: String) -> FileError {
    FileError::new(path, 1_u64, Kind::Columns(message.into())).advice(REPEAT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::epochs;
    use crate::report::{
        sample,
        tables::{epochs_csv, runs_csv},
    };
    use crate::simulation::EpochSums;

    #[test]
    fn epochs_read_back_exactly() {
        let result = sample::result();
        let metrics = epochs(&result);
        let text = epochs_csv(&metrics);
        let rows = parse_epochs("e.csv", &text).unwrap();
        assert_eq!(rows.len(), result.epochs.len());
        for (row, metric) in rows.iter().zip(&metrics) {
            assert_eq!((row.t_s, row.nees, row.coverage), (metric.t_s, metric.nees.value, metric.coverage));
            assert_eq!(row.asee, metric.asee.0.map(|e| e.value));
            assert_eq!(row.rmse, metric.rmse.0.map(|e| e.value));
        }
        assert_eq!(text.lines().nth(1).unwrap().split(',').nth(1), Some("1"));
    }

    #[test]
    fn runs_read_back_exactly() {
        let mut result = sample::result();
        result.runs[1].outages[0].reconvergence_s = 2.5e-9;
        assert_eq!(parse_runs("r.csv", &runs_csv(&result).collect::<String>()).unwrap(), result.runs);
        for run in &mut result.runs {
            run.outages.clear();
        }
        assert_eq!(parse_runs("r.csv", &runs_csv(&result).collect::<String>()).unwrap(), result.runs);
    }

    #[test]
    fn unreadable_tables_are_refused_by_line_and_column() {
        let text = epochs_csv(&epochs(&sample::result()));
        let error = parse_epochs("e.csv", &text.replacen("rmse_yaw_deg", "rmse_yow_deg", 1)).unwrap_err();
        assert_eq!(error.to_string(), "e.csv, line 1: no column is named \"rmse_yaw_deg\"");
        let broken: String = text
            .lines()
            .enumerate()
            .map(|(i, l)| if i == 2 { format!("x{l}\n") } else { format!("{l}\n") })
            .collect();
        let error = parse_epochs("e.csv", &broken).unwrap_err();
        assert_eq!(error.to_string(), "e.csv, line 3: column \"t_s\": \"x1\" is not a number");
        let error = parse_epochs("e.csv", &text.replacen("rmse_yaw_deg", "rmse_roll_deg", 1)).unwrap_err();
        assert_eq!(error.to_string(), "e.csv, line 1: two columns are named \"rmse_roll_deg\"");
        let cut = &text[..text.rfind(',').unwrap()];
        let error = parse_epochs("e.csv", cut).unwrap_err().to_string();
        assert!(error.ends_with("38 values, but 39 columns"), "{error}");
    }

    /// One value that is none is damage; a row of them is an epoch that no run reached.
    #[test]
    fn only_an_epoch_without_runs_may_be_no_number() {
        let mut result = sample::result();
        let text = epochs_csv(&epochs(&result));
        let mut cells: Vec<&str> = text.lines().nth(2).unwrap().split(',').collect();
        cells[3] = "nan";
        let damaged = text.replacen(text.lines().nth(2).unwrap(), &cells.join(","), 1);
        let error = parse_epochs("e.csv", &damaged).unwrap_err();
        assert_eq!(error.to_string(), "e.csv, line 3: column \"asee_pos_e_m\": \"nan\" is not a number");
        result.epochs[1] = EpochSums { t_s: result.epochs[1].t_s, ..EpochSums::default() };
        let rows = parse_epochs("e.csv", &epochs_csv(&epochs(&result))).unwrap();
        assert!(rows[1].asee[1].is_nan() && rows[1].nees.is_nan());
    }
}
