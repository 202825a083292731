//! `epochs.csv` and `runs.csv` of a run directory, read back.

use super::Failure;
use super::table::{Asked, Column, Dictionary, Numbers, Quantity, Table, parse};
use nav_sim_navigation::metrics::EpochRow;
use nav_sim_navigation::simulation::{OutageRecord, REPORTED, REPORTED_NAMES, RunRecord};
use std::sync::LazyLock;

/// Columns that are one number each.
const SINGLE: [&str; 6] = ["t_s", "nees", "coverage", "run", "diverged", "outage"];
/// Columns that are one number for each state.
const OF_STATES: [&str; 3] = ["asee_", "see_mean_", "error_end_"];

static QUANTITIES: LazyLock<Vec<Quantity>> = LazyLock::new(|| {
    let of_states = OF_STATES
        .iter()
        .flat_map(|prefix| REPORTED_NAMES.map(|name| format!("{prefix}{name}")));
    let names = SINGLE.map(str::to_owned).into_iter().chain(of_states);
    let named = |name: String| {
        let stems: &[&str] = vec![&*name.leak()].leak();
        Quantity::number(stems[0], stems)
    };
    names.map(named).collect()
});

fn dictionary() -> Dictionary {
    Dictionary {
        quantities: &QUANTITIES,
        bare: &[],
        array: &[],
        numbers: Numbers::Missing,
        advice: REPEAT,
        empty: "no rows in it",
        bad_cell: |error, _| error,
    }
}

/// What to do about a damaged table.
pub(crate) const REPEAT: &str = "repeat the run, or put back its files";

/// Reads `epochs.csv` back, as far as comparisons need it.
///
/// # Errors
/// A missing or doubled column, or a value that is not a finite number (unless no run is left at the epoch).
pub(crate) fn parse_epochs(path: &str, text: &str) -> Result<Vec<EpochRow>, Failure> {
    let read = || -> Result<Vec<EpochRow>, Failure> {
        let table = parse(path, text, &dictionary(), &Asked::default())?;
        let asee = states(&table, "asee_")?;
        let [t_s, nees, coverage] = named(&table, ["t_s", "nees", "coverage"])?;
        let columns = [&asee[..], &[nees, coverage]].concat();
        let epoch = |row: usize| {
            finite_or_lost(&table, row, &columns)?;
            Ok(EpochRow {
                t_s: t_s.si(row),
                asee: asee.map(|column| column.si(row)),
                nees: nees.si(row),
                coverage: coverage.si(row),
            })
        };
        (0..table.rows()).map(epoch).collect()
    };
    read().map_err(damaged)
}

/// Reads `runs.csv` back, as far as comparisons need it: a row for each outage of a run, or one that ends where outages begin.
///
/// # Errors
/// A missing column or a value that is not a number.
pub(crate) fn parse_runs(path: &str, text: &str) -> Result<Vec<RunRecord>, Failure> {
    let table = parse(path, text, &dictionary(), &Asked::default());
    table.and_then(|table| runs(&table)).map_err(damaged)
}

fn runs(table: &Table) -> Result<Vec<RunRecord>, Failure> {
    let columns = named(table, ["run", "diverged", "outage"])?;
    let (see_mean, error_end) = (states(table, "see_mean_")?, states(table, "error_end_")?);
    let mut runs: Vec<RunRecord> = Vec::new();
    for row in 0..table.rows() {
        let [run, diverged, outage] = columns.map(|c| c.si(row));
        if runs.last().is_none_or(|r| r.run != run as u64) {
            runs.push(RunRecord {
                run: run as u64,
                diverged: diverged > 0.0,
                ..RunRecord::default()
            });
        }
        if let Some(last) = runs.last_mut().filter(|_| !outage.is_nan()) {
            last.outages.push(OutageRecord {
                see_mean: see_mean.map(|c| c.si(row)),
                error_end: error_end.map(|c| c.si(row)),
                ..OutageRecord::default()
            });
        }
    }
    Ok(runs)
}

fn named<'a, const N: usize>(
    table: &'a Table,
    names: [&str; N],
) -> Result<[&'a Column; N], Failure> {
    table.require(names, &dictionary())?;
    table.all(names).ok_or_else(|| table.refused(REPEAT))
}

fn states<'a>(table: &'a Table, prefix: &str) -> Result<[&'a Column; REPORTED], Failure> {
    let names = REPORTED_NAMES.map(|name| format!("{prefix}{name}"));
    named(table, names.each_ref().map(String::as_str))
}

/// Refuses a row of an epoch in which some values are finite and others not. Where no run is left, all are NaN.
fn finite_or_lost(table: &Table, row: usize, columns: &[&Column]) -> Result<(), Failure> {
    let is_lost = columns.iter().all(|column| column.si(row).is_nan());
    match columns.iter().find(|column| !column.si(row).is_finite()) {
        Some(column) if !is_lost => {
            let (line, value) = (table.lines.of(row), column.si(row).to_string());
            Err(Failure::cell(
                &table.path,
                line,
                &column.name,
                value,
                "is not finite",
            ))
        }
        _ => Ok(()),
    }
}

/// A table of a run is written by the program: what is wrong with it is damage.
fn damaged(error: Failure) -> Failure {
    error.hint(REPEAT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{
        sample,
        tables::{epochs_csv, runs_csv},
    };
    use nav_sim_navigation::metrics;
    use nav_sim_navigation::simulation::EpochSums;

    #[test]
    fn epochs_read_back_exactly() {
        let result = sample::result();
        let expected = metrics::epochs(&result);
        let text = epochs_csv(&expected);
        let rows = parse_epochs("e.csv", &text).unwrap();
        assert_eq!(rows.len(), result.epochs.len());
        for (row, metric) in rows.iter().zip(&expected) {
            assert_eq!(
                (row.t_s, row.nees, row.coverage),
                (metric.t_s, metric.nees.value, metric.coverage)
            );
            assert_eq!(row.asee, metric.asee.0.map(|e| e.value));
        }
        assert_eq!(text.lines().nth(1).unwrap().split(',').nth(1), Some("1"));
    }

    #[test]
    fn runs_read_back_exactly() {
        let mut result = sample::result();
        result.runs[1].outages[0].error_end[2] = 2.5e-9;
        for is_cleared in [false, true] {
            for run in result.runs.iter_mut().filter(|_| is_cleared) {
                run.outages.clear();
            }
            let read = parse_runs("r.csv", &runs_csv(&result).collect::<String>()).unwrap();
            let kept = |runs: &[RunRecord]| -> Vec<_> {
                let ends = |o: &OutageRecord| (o.see_mean, o.error_end);
                let kept =
                    |r: &RunRecord| (r.run, r.diverged, r.outages.iter().map(ends).collect());
                runs.iter().map(kept).collect::<Vec<(u64, bool, Vec<_>)>>()
            };
            assert_eq!(kept(&read), kept(&result.runs));
        }
    }

    #[test]
    fn unreadable_tables_are_refused_by_line_and_column() {
        let text = epochs_csv(&metrics::epochs(&sample::result()));
        let error =
            parse_epochs("e.csv", &text.replacen("asee_yaw_deg", "asee_yow_deg", 1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "e.csv, line 1: unknown column \"asee_yow_deg\""
        );
        let broken: String = text
            .lines()
            .enumerate()
            .map(|(i, l)| {
                if i == 2 {
                    format!("x{l}\n")
                } else {
                    format!("{l}\n")
                }
            })
            .collect();
        let error = parse_epochs("e.csv", &broken).unwrap_err();
        assert_eq!(
            error.to_string(),
            "e.csv, line 3: column \"t_s\": \"x1\" is not a number"
        );
        let error =
            parse_epochs("e.csv", &text.replacen("asee_yaw_deg", "asee_roll_deg", 1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "e.csv, line 1: columns \"asee_roll_deg\" and \"asee_roll_deg\" both give asee_roll_deg"
        );
        let cut = &text[..text.rfind(',').unwrap()];
        let error = parse_epochs("e.csv", cut).unwrap_err().to_string();
        assert!(error.ends_with("38 values, but 39 columns"), "{error}");
    }

    /// One value that is none is damage; a row of them is an epoch that no run reached.
    #[test]
    fn only_an_epoch_without_runs_may_be_no_number() {
        let mut result = sample::result();
        let text = epochs_csv(&metrics::epochs(&result));
        let mut cells: Vec<&str> = text.lines().nth(2).unwrap().split(',').collect();
        cells[3] = "nan";
        let damaged = text.replacen(text.lines().nth(2).unwrap(), &cells.join(","), 1);
        let error = parse_epochs("e.csv", &damaged).unwrap_err();
        assert_eq!(
            error.to_string(),
            "e.csv, line 3: column \"asee_pos_e_m\": NaN is not finite"
        );
        result.epochs[1] = EpochSums {
            t_s: result.epochs[1].t_s,
            ..EpochSums::default()
        };
        let rows = parse_epochs("e.csv", &epochs_csv(&metrics::epochs(&result))).unwrap();
        assert!(rows[1].asee[1].is_nan() && rows[1].nees.is_nan());
    }
}
