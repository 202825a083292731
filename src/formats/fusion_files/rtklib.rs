//! Solutions of RTKLIB (`.pos`): time (GPST), latitude, longitude, height, quality, satellites, standard deviations north,
//! east, up, and more that is not used.

use super::fixes::{POSITION, WEEK_S};
use crate::formats::FileError as Error;
use chrono::{DateTime, NaiveDateTime};

/// Columns of a row up to the standard deviation upwards; time takes two of them.
const COLUMNS: usize = 10;
/// Standard deviations north, east, up: their column.
const SIGMA: usize = 7;
/// 1980-01-06, from which GPS weeks are counted (Unix s).
const GPS_EPOCH_S: i64 = 315_964_800;

/// Whether a text is such a solution: its header names a latitude beside a time of two columns.
pub(super) fn is_rtklib(text: &str) -> bool {
    header(text).is_some()
}

/// The line that names the columns.
fn header(text: &str) -> Option<(usize, &str)> {
    let comments = text.lines().enumerate().take_while(|(_, l)| l.starts_with('%') || l.trim().is_empty());
    comments.filter(|(_, l)| l.contains("sdn(m)")).last()
}

/// The same as rows of time (s of the GPS week of the first fix), position and standard deviations, line by line, and what is to
/// be said of it.
pub(super) fn rows(path: &str, text: &str) -> Result<(String, String), Error> {
    let (at, names) = header(text).unwrap_or_default();
    let refuse = |line: usize, message: &str, advice: &'static str| {
        Err(Error::contents(path, line + 1, message).advice(advice))
    };
    if !names.contains("GPST") {
        return refuse(
            at,
            "times that are not GPST",
            "write the solution in GPS time, as the IMU's clock is",
        );
    }
    if !names.contains("latitude(deg)") {
        return refuse(
            at,
            "positions that are not latitude, longitude (deg) and height",
            "write the solution as lat/lon/height in degrees",
        );
    }
    let (mut table, mut first_week) = (String::new(), None);
    for (i, line) in text.lines().enumerate() {
        if !(line.starts_with('%') || line.trim().is_empty()) {
            let cells: Vec<&str> = line.split([' ', ',', '\t']).filter(|c| !c.is_empty()).collect();
            let time = if cells.len() < COLUMNS { None } else { gps_time_s(cells[0], cells[1]) };
            let Some(t_s) = time else {
                return refuse(
                    i,
                    "not a row of time, position, quality, satellites and standard deviations",
                    "2021/03/01 00:00:01.000 (or 2147 86401.000), latitude, longitude, height, Q, ns, sdn, sde, sdu",
                );
            };
            let week = *first_week.get_or_insert((t_s / WEEK_S).floor());
            // the difference of two numbers of 1e9 keeps 0.2 µs
            table += &format!(
                "{:.6} {} {}",
                t_s - week * WEEK_S,
                cells[2..5].join(" "),
                cells[SIGMA..COLUMNS].join(" ")
            );
        }
        table.push('\n');
    }
    debug_assert!(table.lines().all(|l| l.is_empty() || l.split(' ').count() == POSITION));
    let week = first_week.unwrap_or_default();
    Ok((
        table,
        format!("an RTKLIB solution: position and standard deviations, in seconds of GPS week {week}"),
    ))
}

/// Seconds since GPS weeks are counted, of a date and a time of day or of a week and its second.
fn gps_time_s(first: &str, second: &str) -> Option<f64> {
    if !first.contains('/') {
        return Some(first.parse::<u32>().map(f64::from).ok()? * WEEK_S + second.parse::<f64>().ok()?);
    }
    let time = NaiveDateTime::parse_from_str(&format!("{first} {second}"), "%Y/%m/%d %H:%M:%S%.f").ok()?;
    // GPST has no leap seconds, and neither has this count
    let since = time.and_utc() - DateTime::from_timestamp(GPS_EPOCH_S, 0)?;
    Some(since.num_seconds() as f64 + 1e-9 * f64::from(since.subsec_nanos()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "% program : RTKLIB\n%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)\n";

    /// 2021-03-01 was a Monday, the second day of GPS week 2147.
    #[test]
    fn dates_and_weeks_are_one_clock() {
        let dated = format!("{HEAD}2021/03/01 00:00:01.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0 0.1 0 0\n");
        let counted = format!("{HEAD}2147 86401.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0 0.1 0 0\n");
        assert!(is_rtklib(&dated) && !is_rtklib("t_s,lat_deg\n") && !is_rtklib(""));
        let expected = ("\n\n86401.250000 46.5 6.5 400.8 2.0 2.1 4.0\n", "seconds of GPS week 2147");
        for text in [dated, counted] {
            let (table, remark) = rows("a.pos", &text).unwrap();
            assert_eq!(table, expected.0);
            assert!(remark.ends_with(expected.1), "{remark}");
        }
    }

    #[test]
    fn the_week_counts_on() {
        let text = format!("{HEAD}2147 604799 46.5 6.5 400 5 8 2 2 4\n2148 0.5 46.5 6.5 400 5 8 2 2 4\n");
        let (table, _) = rows("a.pos", &text).unwrap();
        assert!(table.contains("604799.000000 ") && table.contains("604800.500000 "), "{table}");
    }

    #[test]
    fn what_is_not_such_a_row_is_refused_with_its_line() {
        let error = |text: &str| rows("a.pos", text).unwrap_err().to_string();
        let short = format!("{HEAD}2021/03/01 00:00:01 46.5 6.5\n");
        assert!(error(&short).starts_with("a.pos, line 3: not a row of time, position"));
        assert!(error(&HEAD.replace("GPST", "UTC")).starts_with("a.pos, line 2: times that are not GPST"));
        assert!(
            error(&HEAD.replace("latitude(deg)", "latitude(d'\")")).starts_with("a.pos, line 2: positions")
        );
    }
}
