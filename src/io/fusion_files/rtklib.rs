//! Solutions of RTKLIB (`.pos`): a table whose header is a comment and whose time (GPST) takes two columns.

use super::fixes::WEEK_S;
use crate::io::Failure as Error;
use chrono::{DateTime, NaiveDateTime};

/// 1980-01-06, from which GPS weeks are counted (Unix s).
const GPS_EPOCH_S: i64 = 315_964_800;
/// Leap seconds between GPS time and UTC, and from when on (Unix s): IERS Bulletin C.
const LEAPS: [(f64, f64); 6] = [
    (1_483_228_800.0, 18.0),
    (1_435_708_800.0, 17.0),
    (1_341_100_800.0, 16.0),
    (1_230_768_000.0, 15.0),
    (1_136_073_600.0, 14.0),
    (915_148_800.0, 13.0),
];

/// True if a text is such a solution.
pub(in crate::io) fn is_rtklib(text: &str) -> bool {
    header(text).is_some()
}

/// The line that names the columns.
fn header(text: &str) -> Option<(usize, &str)> {
    let comments = text
        .lines()
        .enumerate()
        .take_while(|(_, l)| l.starts_with('%') || l.trim().is_empty());
    comments.filter(|(_, l)| l.contains("sdn(m)")).last()
}

/// Clock that an IMU may run in.
#[derive(Debug, PartialEq)]
pub(super) struct ClockOfImu {
    /// Subtracted from Unix times of the fixes (s).
    pub(super) origin_s: f64,
    pub(super) name: String,
}

/// Unix time at which GPS time is 0, by the leap seconds of a time (Unix s).
fn gps_origin_s(unix_s: f64) -> f64 {
    let leap = LEAPS.iter().find(|(from_s, _)| unix_s >= *from_s);
    GPS_EPOCH_S as f64 - leap.map_or(0.0, |(_, leap_s)| *leap_s)
}

/// Clocks that IMUs run in beside fixes that begin then (Unix s): Unix time, GPS time, seconds of the GPS week.
fn clocks(begin_s: f64) -> [ClockOfImu; 3] {
    let gps_s = gps_origin_s(begin_s);
    let week = ((begin_s - gps_s) / WEEK_S).floor();
    let week_name = format!("seconds of GPS week {week}");
    [
        (0.0, "Unix time"),
        (gps_s, "seconds of GPS time"),
        (gps_s + week * WEEK_S, &week_name),
    ]
    .map(|(origin_s, name)| ClockOfImu {
        origin_s,
        name: name.to_owned(),
    })
}

/// The clock in which an IMU ran beside fixes of such times (Unix s).
pub(super) fn clock(span_s: (f64, f64), imu_s: Option<(f64, f64)>) -> Option<ClockOfImu> {
    let (first_s, last_s) = imu_s?;
    clocks(span_s.0)
        .into_iter()
        .find(|clock| first_s <= span_s.1 - clock.origin_s && span_s.0 - clock.origin_s <= last_s)
}

/// The same as a table with one column of time, line by line, and the name of the clock of its times: that of the IMU, which
/// begins and ends at `imu_s`, else seconds of the GPS week.
pub(super) fn table(
    path: &str,
    text: &str,
    imu_s: Option<(f64, f64)>,
) -> Result<(String, String), Error> {
    let (at, names) = header(text).unwrap_or_default();
    let refuse = |line: usize, message: &str, advice: &'static str| {
        Error::contents(path, line + 1, message).or_hint(advice)
    };
    if !names.contains("GPST") {
        let advice = "write the solution in GPS time, as the IMU's clock is";
        return Err(refuse(at, "times that are not GPST", advice));
    }
    let is_blank = |c: char| matches!(c, ' ' | ',' | '\t' | '%');
    let cells = |line| -> Vec<&str> {
        str::split(line, is_blank)
            .filter(|c| !c.is_empty())
            .collect()
    };
    let names = cells(names);
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        if line.starts_with('%') || line.trim().is_empty() {
            continue;
        }
        let row = cells(line);
        let t_s = row
            .first()
            .zip(row.get(1))
            .and_then(|(a, b)| gps_time_s(a, b));
        let advice = "2021/03/01 00:00:01.000 (or 2147 86401.000), latitude, longitude, height, Q, ns, sdn, sde, sdu";
        let refused = || {
            refuse(
                i,
                "not a row of time, position, quality, satellites and standard deviations",
                advice,
            )
        };
        rows.push((i, t_s.ok_or_else(refused)?, row));
    }
    let span = rows.first().zip(rows.last());
    let (first_s, last_s) = span.map_or((0.0, 0.0), |(first, last)| (first.1, last.1));
    let gps_s = gps_origin_s(first_s + GPS_EPOCH_S as f64);
    let span_s = (first_s + gps_s, last_s + gps_s);
    let [.., of_week] = clocks(span_s.0);
    let clock = clock(span_s, imu_s).unwrap_or(of_week);
    let mut out = "\n".repeat(at) + "t_s " + &names[1..].join(" ") + "\n";
    let mut lines = at + 1;
    for (i, t_s, row) in rows {
        // line by line, so that a refusal names that of the file; the difference of two numbers of 1e9 keeps 0.2 µs
        let rest = row[2..].iter().take(names.len() - 1);
        let rest: Vec<&str> = rest.copied().collect();
        out += &"\n".repeat(i - lines);
        out += &format!("{:.6} {}\n", t_s + gps_s - clock.origin_s, rest.join(" "));
        lines = i + 1;
    }
    Ok((out, clock.name))
}

/// Seconds since GPS weeks are counted, of a date and a time of day or of a week and its second.
fn gps_time_s(first: &str, second: &str) -> Option<f64> {
    if !first.contains('/') {
        return Some(
            first.parse::<u32>().map(f64::from).ok()? * WEEK_S + second.parse::<f64>().ok()?,
        );
    }
    let time =
        NaiveDateTime::parse_from_str(&format!("{first} {second}"), "%Y/%m/%d %H:%M:%S%.f").ok()?;
    // GPST has no leap seconds, and neither has this count
    let since = time.and_utc() - DateTime::from_timestamp(GPS_EPOCH_S, 0)?;
    Some(since.num_seconds() as f64 + 1e-9 * f64::from(since.subsec_nanos()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "% program : RTKLIB\n%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n";

    const TABLE: &str = "\nt_s latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m)\n";

    /// 2021-03-01 was a Monday, the second day of GPS week 2147.
    #[test]
    fn dates_and_weeks_are_one_clock() {
        let dated = format!("{HEAD}2021/03/01 00:00:01.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0\n");
        let counted = format!("{HEAD}2147 86401.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0\n");
        assert!(is_rtklib(&dated) && !is_rtklib("t_s,lat_deg\n") && !is_rtklib(""));
        for text in [dated, counted] {
            let (table, clock) = table("a.pos", &text, None).unwrap();
            assert_eq!(
                table,
                format!("{TABLE}86401.250000 46.5 6.5 400.8 5 8 2.0 2.1 4.0\n")
            );
            assert_eq!(clock, "seconds of GPS week 2147");
        }
    }

    /// An IMU in Unix time, 18 leap seconds behind since 2017, or in GPS time has the fixes on its clock. 86401.25 s of
    /// week 2147 are 1298591.6 million of GPS time.
    #[test]
    fn the_clock_is_the_imu_s() {
        let row = "46.5 6.5 400.8 5 8 2.0 2.1 4.0\n";
        let text = format!("{HEAD}2021/03/01 00:00:01.250 {row}");
        let gps_s = 2147.0 * WEEK_S + 86_401.25;
        let unix_s = 1_614_556_801.25 - 18.0;
        for (start_s, words) in [(gps_s, "seconds of GPS time"), (unix_s, "Unix time")] {
            let imu_s = Some((start_s - 5.0, start_s + 5.0));
            let (table, said) = table("a.pos", &text, imu_s).unwrap();
            assert_eq!(table, format!("{TABLE}{start_s:.6} {row}"));
            assert_eq!(said, words);
        }
    }

    /// Fixes in Unix time beside IMUs in GPS time and in its weeks; an IMU of no known clock leaves them.
    #[test]
    fn dated_fixes_come_to_the_clock_of_the_imu() {
        let unix_s = (1_614_556_783.25, 1_614_556_883.25);
        let of = |start_s: f64| clock(unix_s, Some((start_s - 5.0, start_s + 5.0)));
        let gps_s = 2147.0 * WEEK_S + 86_401.25;
        for (start_s, name) in [
            (unix_s.0, "Unix time"),
            (gps_s, "seconds of GPS time"),
            (86_401.25, "seconds of GPS week 2147"),
        ] {
            let clock = of(start_s).unwrap();
            assert_eq!(
                (unix_s.0 - clock.origin_s, clock.name.as_str()),
                (start_s, name)
            );
        }
        assert_eq!([of(3_326.0), clock(unix_s, None)], [None, None]);
    }

    #[test]
    fn the_week_counts_on() {
        let text =
            format!("{HEAD}2147 604799 46.5 6.5 400 5 8 2 2 4\n2148 0.5 46.5 6.5 400 5 8 2 2 4\n");
        let (table, _) = table("a.pos", &text, None).unwrap();
        assert!(
            table.contains("604799.000000 ") && table.contains("604800.500000 "),
            "{table}"
        );
    }

    #[test]
    fn what_is_not_such_a_row_is_refused_with_its_line() {
        let error = |text: &str| table("a.pos", text, None).unwrap_err().to_string();
        let short = format!("{HEAD}2021/03/01 46.5 6.5\n");
        assert!(error(&short).starts_with("a.pos, line 3: not a row of time, position"));
        assert!(
            error(&HEAD.replace("GPST", "UTC"))
                .starts_with("a.pos, line 2: times that are not GPST")
        );
    }
}
