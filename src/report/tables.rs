//! `epochs.csv` and `runs.csv` of a run directory, written and read back.

use super::number::shortest;
use crate::metrics::{EpochMetrics, EpochRow, PerState};
use crate::simulation::{BIAS_NAMES, OutageRecord, REPORTED, REPORTED_NAMES, RunRecord, RunResult};
use std::collections::HashMap;

/// A table that cannot be read back.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableError {
    /// A column is not there.
    #[error("line 1: no column is named \"{column}\"")]
    Column {
        /// The column.
        column: String,
    },
    /// Two columns have one name.
    #[error("line 1: two columns are named \"{column}\"")]
    Twice {
        /// The column.
        column: String,
    },
    /// A row is not as long as the header.
    #[error("line {line}: {found} values, but {expected} columns")]
    Length {
        /// Line, from 1.
        line: u64,
        /// Values of the row.
        found: usize,
        /// Columns of the table.
        expected: usize,
    },
    /// A value is not what its column holds.
    #[error("line {line}: column \"{column}\": \"{value}\" is not a number")]
    Value {
        /// Line, from 1.
        line: u64,
        /// Column.
        column: String,
        /// The text found.
        value: String,
    },
    /// Not a table.
    #[error("line {line}: {message}")]
    Syntax {
        /// Line, from 1.
        line: u64,
        /// What the reader said.
        message: String,
    },
}

const EPOCH_ENDS: [&str; 4] = ["mean_pos_err_m", "mean_att_err_deg", "nees", "coverage"];

fn named(prefix: &str) -> impl Iterator<Item = String> {
    REPORTED_NAMES.iter().map(move |name| format!("{prefix}{name}"))
}

/// Columns of `epochs.csv`.
fn epoch_columns() -> Vec<String> {
    let states = ["asee_", "rmse_", "bias_"].into_iter().flat_map(named);
    let ends = EPOCH_ENDS.map(str::to_owned);
    let biases = BIAS_NAMES.iter().map(|name| format!("asee_{name}"));
    ["t_s", "gnss"].map(str::to_owned).into_iter().chain(states).chain(ends).chain(biases).collect()
}

/// `epochs.csv`: one row a reporting epoch (1 Hz), means over runs.
#[must_use]
pub fn epochs_csv(epochs: &[EpochMetrics]) -> String {
    let values = |all: &PerState<crate::metrics::Estimate>| all.0.map(|e| shortest(e.value));
    let row = |e: &EpochMetrics| {
        let mut row = vec![shortest(e.t_s), u8::from(e.gnss).to_string()];
        row.extend([&e.asee, &e.rmse, &e.bias].into_iter().flat_map(values));
        let ends = [e.mean_pos_err_m.value, e.mean_att_err_deg.value, e.nees.value, e.coverage];
        row.extend(ends.into_iter().chain(e.bias_asee).map(shortest));
        row.join(",")
    };
    lines(epoch_columns().join(","), epochs.iter().map(row))
}

/// Columns of `runs.csv`.
fn run_columns() -> Vec<String> {
    let start = ["run", "diverged", "nis_mean", "fixes", "nees_mean", "coverage"].map(str::to_owned);
    let whole = start.into_iter().chain(named("normalised_sq_")).chain(["outage".to_owned()]);
    let ends =
        ["nees_end", "log_density_end", "horizontal_error_end_m", "reconvergence_s"].map(str::to_owned);
    let states = ["see_mean_", "see_end_", "error_end_"].into_iter().flat_map(named);
    whole.chain(states).chain(ends).collect()
}

/// `runs.csv`, line by line: one row a run and outage (one row a run, outage empty, when there is none).
pub fn runs_csv(result: &RunResult) -> impl Iterator<Item = String> {
    let columns = run_columns();
    let of_an_outage = columns.len() - 6 - REPORTED;
    let rows = result.runs.iter().flat_map(move |run| {
        let counts = format!("{},{},{},{}", run.run, u8::from(run.diverged), shortest(run.nis.0), run.nis.1);
        let whole = [run.nees_mean, run.covered].into_iter().chain(run.normalised_sq).map(shortest);
        let start = format!("{counts},{}", whole.collect::<Vec<_>>().join(","));
        let empty = run.outages.is_empty().then(|| format!("{start}{}\n", ",".repeat(of_an_outage)));
        let of_outage = move |(i, outage)| format!("{start},{i},{}\n", outage_cells(outage).join(","));
        empty.into_iter().chain(run.outages.iter().enumerate().map(of_outage))
    });
    std::iter::once(columns.join(",") + "\n").chain(rows)
}

fn outage_cells(outage: &OutageRecord) -> Vec<String> {
    let states = outage.see_mean.iter().chain(&outage.see_end).chain(&outage.error_end);
    let ends =
        [outage.nees_end, outage.log_density_end, outage.horizontal_error_end_m, outage.reconvergence_s];
    states.chain(&ends).copied().map(shortest).collect()
}

fn lines(header: String, rows: impl Iterator<Item = String>) -> String {
    let mut text = header + "\n";
    for row in rows {
        text += &row;
        text.push('\n');
    }
    text
}

/// Reads `epochs.csv` back, as far as comparisons need it.
///
/// # Errors
/// A missing or doubled column, or a value that is not a finite number (unless no run is left at the epoch).
pub fn parse_epochs(text: &str) -> Result<Vec<EpochRow>, TableError> {
    let table = Table::read(text)?;
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
pub fn parse_runs(text: &str) -> Result<Vec<RunRecord>, TableError> {
    let table = Table::read(text)?;
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
struct Table {
    index: HashMap<String, usize>,
    names: Vec<String>,
    rows: Vec<csv::StringRecord>,
}

impl Table {
    fn read(text: &str) -> Result<Self, TableError> {
        let syntax = |e: csv::Error| TableError::Syntax {
            line: e.position().map_or(1, csv::Position::line),
            message: e.to_string(),
        };
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        let names: Vec<String> = reader.headers().map_err(syntax)?.iter().map(str::to_owned).collect();
        let mut index = HashMap::new();
        for (i, name) in names.iter().enumerate() {
            if index.insert(name.clone(), i).is_some() {
                return Err(TableError::Twice { column: name.clone() });
            }
        }
        let rows: Vec<csv::StringRecord> = reader.into_records().collect::<Result<_, _>>().map_err(syntax)?;
        let expected = names.len();
        match rows.iter().find(|row| row.len() != expected) {
            Some(row) => Err(TableError::Length { line: line(row), found: row.len(), expected }),
            None => Ok(Self { index, names, rows }),
        }
    }

    fn column(&self, name: &str) -> Result<usize, TableError> {
        self.index.get(name).copied().ok_or_else(|| TableError::Column { column: name.to_owned() })
    }

    fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], TableError> {
        let mut found = [0; N];
        for (place, name) in found.iter_mut().zip(names) {
            *place = self.column(name)?;
        }
        Ok(found)
    }

    fn states(&self, prefix: &str) -> Result<[usize; REPORTED], TableError> {
        self.columns(REPORTED_NAMES.map(|n| format!("{prefix}{n}")).each_ref().map(String::as_str))
    }

    fn number(&self, row: usize, column: usize) -> Result<f64, TableError> {
        self.rows[row][column].parse().map_err(|_| self.no_number(row, column))
    }

    /// Refuses a row of an epoch in which some values are finite and others not. Where no run is left, all are NaN.
    fn finite_or_lost(&self, row: usize, columns: &[usize]) -> Result<(), TableError> {
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

    fn no_number(&self, row: usize, column: usize) -> TableError {
        let value = self.rows[row][column].to_owned();
        TableError::Value { line: line(&self.rows[row]), column: self.names[column].clone(), value }
    }

    fn numbers(&self, row: usize, columns: [usize; REPORTED]) -> Result<[f64; REPORTED], TableError> {
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

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;
    use crate::metrics::epochs;
    use crate::simulation::EpochSums;

    #[test]
    fn the_columns_are_those_of_the_interface() {
        let header = epoch_columns().join(", ");
        assert!(header.starts_with("t_s, gnss, asee_pos_n_m, asee_pos_e_m, asee_pos_d_m, asee_vel_n_m_s, "));
        assert!(
            header.contains("asee_yaw_deg, rmse_pos_n_m") && header.contains("rmse_yaw_deg, bias_pos_n_m")
        );
        assert!(
            header.contains("bias_yaw_deg, mean_pos_err_m, mean_att_err_deg, nees, coverage, asee_b_ax_m_s2")
        );
        assert!(header.ends_with("asee_b_az_m_s2, asee_b_gx_rad_s, asee_b_gy_rad_s, asee_b_gz_rad_s"));
    }

    #[test]
    fn epochs_read_back_exactly() {
        let result = sample::result();
        let metrics = epochs(&result);
        let text = epochs_csv(&metrics);
        let rows = parse_epochs(&text).unwrap();
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
        assert_eq!(parse_runs(&runs_csv(&result).collect::<String>()).unwrap(), result.runs);
        for run in &mut result.runs {
            run.outages.clear();
        }
        assert_eq!(parse_runs(&runs_csv(&result).collect::<String>()).unwrap(), result.runs);
    }

    #[test]
    fn unreadable_tables_are_refused_by_line_and_column() {
        let text = epochs_csv(&epochs(&sample::result()));
        let error = parse_epochs(&text.replacen("rmse_yaw_deg", "rmse_yow_deg", 1)).unwrap_err();
        assert_eq!(error.to_string(), "line 1: no column is named \"rmse_yaw_deg\"");
        let broken: String = text
            .lines()
            .enumerate()
            .map(|(i, l)| if i == 2 { format!("x{l}\n") } else { format!("{l}\n") })
            .collect();
        let error = parse_epochs(&broken).unwrap_err();
        assert_eq!(error.to_string(), "line 3: column \"t_s\": \"x1\" is not a number");
        let error = parse_epochs(&text.replacen("rmse_yaw_deg", "rmse_roll_deg", 1)).unwrap_err();
        assert_eq!(error.to_string(), "line 1: two columns are named \"rmse_roll_deg\"");
        let cut = &text[..text.rfind(',').unwrap()];
        let error = parse_epochs(cut).unwrap_err().to_string();
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
        let error = parse_epochs(&damaged).unwrap_err();
        assert_eq!(error.to_string(), "line 3: column \"asee_pos_e_m\": \"nan\" is not a number");
        result.epochs[1] = EpochSums { t_s: result.epochs[1].t_s, ..EpochSums::default() };
        let rows = parse_epochs(&epochs_csv(&epochs(&result))).unwrap();
        assert!(rows[1].asee[1].is_nan() && rows[1].nees.is_nan());
    }
}
