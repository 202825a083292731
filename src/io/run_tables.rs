//! `epochs.csv` and `runs.csv` of a run directory, read back.

use super::Failure;
use nav_sim_navigation::metrics::EpochRow;
use nav_sim_navigation::simulation::{OutageRecord, REPORTED, REPORTED_NAMES, RunRecord};

/// Hint for a damaged table, which the program itself wrote.
pub(crate) const REPEAT: &str = "repeat the run, or restore its files";

/// Gives the cell of a column in a row; an empty one is NaN.
type Cell<'a> = &'a dyn Fn(&str) -> Result<f64, Failure>;

/// Rows of a table, each made from its line and its cells.
fn rows<T>(
    path: &str,
    text: &str,
    make: impl Fn(u64, Cell<'_>) -> Result<T, Failure>,
) -> Result<Vec<T>, Failure> {
    let refused = |e: csv::Error| {
        let line = e.position().map_or(1, csv::Position::line);
        match e.kind() {
            csv::ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => Failure::row_length(path, line, *len as usize, *expected_len as usize),
            _ => Failure::contents(path, line, e),
        }
        .hint(REPEAT)
    };
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().map_err(refused)?.clone();
    let read = |record: csv::Result<csv::StringRecord>| {
        let record = record.map_err(refused)?;
        let line = record.position().map_or(1, csv::Position::line);
        make(line, &|name| {
            let Some(column) = header.iter().position(|own| own == name) else {
                let message = format!("column \"{name}\" is missing");
                return Err(Failure::contents(path, 1_u64, message).hint(REPEAT));
            };
            match &record[column] {
                "" => Ok(f64::NAN),
                cell => cell.parse().map_err(|_| {
                    let value = format!("\"{cell}\"");
                    Failure::cell(path, line, name, value, "is not a number").hint(REPEAT)
                }),
            }
        })
    };
    reader.records().map(read).collect()
}

/// The cells of the states.
fn of_states(cell: Cell<'_>, prefix: &str) -> Result<[f64; REPORTED], Failure> {
    let mut values = [0.0; REPORTED];
    for (value, name) in values.iter_mut().zip(REPORTED_NAMES) {
        *value = cell(&format!("{prefix}{name}"))?;
    }
    Ok(values)
}

/// Reads `epochs.csv` back, as far as comparisons need it.
///
/// # Errors
/// A missing column, or a value that is not a finite number (unless no run is left at the epoch).
pub(crate) fn parse_epochs(path: &str, text: &str) -> Result<Vec<EpochRow>, Failure> {
    rows(path, text, |line, cell| {
        let row = EpochRow {
            t_s: cell("t_s")?,
            asee: of_states(cell, "asee_")?,
            nees: cell("nees")?,
            coverage: cell("coverage")?,
        };
        let names = REPORTED_NAMES.map(|name| format!("asee_{name}"));
        let names = names.iter().map(String::as_str).chain(["nees", "coverage"]);
        let values = row.asee.into_iter().chain([row.nees, row.coverage]);
        let mut cells = names.zip(values);
        let lost = cells.clone().find(|(_, value)| !value.is_finite());
        match lost.filter(|_| cells.any(|(_, value)| value.is_finite())) {
            Some((name, value)) => {
                Err(Failure::cell(path, line, name, value, "is not a finite number").hint(REPEAT))
            }
            None => Ok(row),
        }
    })
}

/// Reads `runs.csv` back, as far as comparisons need it: a row for each outage of a run, or one that ends where outages begin.
///
/// # Errors
/// A missing column or a value that is not a number.
pub(crate) fn parse_runs(path: &str, text: &str) -> Result<Vec<RunRecord>, Failure> {
    let mut runs: Vec<RunRecord> = Vec::new();
    let read = rows(path, text, |_, cell| {
        let run = RunRecord {
            run: cell("run")? as u64,
            diverged: cell("diverged")? > 0.0,
            ..RunRecord::default()
        };
        let outage = OutageRecord {
            see_mean: of_states(cell, "see_mean_")?,
            error_end: of_states(cell, "error_end_")?,
            ..OutageRecord::default()
        };
        Ok((run, (!cell("outage")?.is_nan()).then_some(outage)))
    })?;
    for (run, outage) in read {
        if runs.last().is_none_or(|last| last.run != run.run) {
            runs.push(run);
        }
        runs.last_mut()
            .into_iter()
            .for_each(|run| run.outages.extend(outage.clone()));
    }
    Ok(runs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::tests::{answers, told};
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

    /// One value that is none is damage; a row of them is an epoch that no run reached.
    #[test]
    fn unreadable_tables_are_refused_by_line_and_column() {
        let mut result = sample::result();
        let text = epochs_csv(&metrics::epochs(&result));
        let row = text.lines().nth(2).unwrap();
        let mut cells: Vec<&str> = row.split(',').collect();
        cells[3] = "nan";
        insta::assert_snapshot!(answers(
            [
                ("misspelt", text.replacen("asee_yaw_deg", "asee_yow_deg", 1)),
                ("twice", text.replacen("asee_yaw_deg", "asee_roll_deg", 1)),
                ("no number", text.replacen(row, &format!("x{row}"), 1)),
                ("cut", text[..text.rfind(',').unwrap()].to_owned()),
                ("nan", text.replacen(row, &cells.join(","), 1)),
            ]
            .map(|(name, text)| (name, parse_epochs("e.csv", &text).map_err(|e| told(&e))))
        ));
        result.epochs[1] = EpochSums {
            t_s: result.epochs[1].t_s,
            ..EpochSums::default()
        };
        let rows = parse_epochs("e.csv", &epochs_csv(&metrics::epochs(&result))).unwrap();
        assert!(rows[1].asee[1].is_nan() && rows[1].nees.is_nan());
    }
}
