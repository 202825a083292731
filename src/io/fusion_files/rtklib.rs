//! Solutions of RTKLIB (`.pos`): time (GPST), latitude, longitude, height, quality, satellites, standard deviations north,
//! east, up, and perhaps velocity; more is not used.

use super::fixes::WEEK_S;
use crate::io::Failure as Error;
use chrono::{DateTime, NaiveDateTime};

/// Columns of a row up to the standard deviation upwards; time takes two of them.
const COLUMNS: usize = 10;
/// Standard deviations north, east, up: their column.
const SIGMA: usize = 7;
/// 1980-01-06, from which GPS weeks are counted (Unix s).
pub(super) const GPS_EPOCH_S: i64 = 315_964_800;
/// Leap seconds between GPS time and UTC, and from when on (Unix s): IERS Bulletin C.
const LEAPS: [(f64, f64); 6] = [
    (1_483_228_800.0, 18.0),
    (1_435_708_800.0, 17.0),
    (1_341_100_800.0, 16.0),
    (1_230_768_000.0, 15.0),
    (1_136_073_600.0, 14.0),
    (915_148_800.0, 13.0),
];

/// Whether a text is such a solution: its header names a latitude beside a time of two columns.
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

/// Leap seconds between GPS time and UTC at a time (Unix s).
pub(super) fn leap_s(unix_s: f64) -> f64 {
    LEAPS
        .iter()
        .find(|(from_s, _)| unix_s >= *from_s)
        .map_or(0.0, |(_, leap)| *leap)
}

/// Clock that an IMU may run in.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ClockOfImu {
    /// What is taken from the times of the fixes (s).
    pub(super) origin_s: f64,
    /// Its name.
    pub(super) name: String,
}

/// The clocks that IMUs run in beside fixes in GPS time that begin then (s): seconds of the week, Unix time, GPS time.
fn clocks(begin_s: f64) -> [ClockOfImu; 3] {
    let (week, epoch_s) = ((begin_s / WEEK_S).floor(), GPS_EPOCH_S as f64);
    let leap_s = leap_s(begin_s + epoch_s);
    [
        ClockOfImu {
            origin_s: week * WEEK_S,
            name: format!("seconds of GPS week {week}"),
        },
        ClockOfImu {
            origin_s: leap_s - epoch_s,
            name: format!("Unix time, {leap_s} s behind GPS time"),
        },
        ClockOfImu {
            origin_s: 0.0,
            name: "seconds of GPS time".to_owned(),
        },
    ]
}

/// Whether an IMU runs in a clock beside fixes of such times.
fn runs(clock: &ClockOfImu, span_s: (f64, f64), imu_s: Option<(f64, f64)>) -> bool {
    imu_s
        .is_some_and(|imu| imu.0 <= span_s.1 - clock.origin_s && span_s.0 - clock.origin_s <= imu.1)
}

/// The clock of an IMU beside fixes in GPS time (s): the first that it ran in, else the second of the GPS week.
fn clock(span_s: (f64, f64), imu_s: Option<(f64, f64)>) -> ClockOfImu {
    let [of_week, unix, gps] = clocks(span_s.0);
    let others = [&of_week, &unix, &gps];
    others
        .into_iter()
        .find(|clock| runs(clock, span_s, imu_s))
        .unwrap_or(&of_week)
        .clone()
}

/// The same beside fixes in Unix time, where the IMU runs in another.
pub(super) fn of_unix(span_s: (f64, f64), imu_s: Option<(f64, f64)>) -> Option<ClockOfImu> {
    let unix = ClockOfImu {
        origin_s: 0.0,
        name: String::new(),
    };
    // to GPS time
    let gps_s = leap_s(span_s.0) - GPS_EPOCH_S as f64;
    let [of_week, _, gps] = clocks(span_s.0 + gps_s).map(|c| ClockOfImu {
        origin_s: c.origin_s - gps_s,
        ..c
    });
    let found = [unix, gps, of_week]
        .into_iter()
        .find(|clock| runs(clock, span_s, imu_s))?;
    (found.origin_s != 0.0).then_some(found)
}

/// Columns of velocity north, east, up (m/s) and of their standard deviations, where they are in the header.
fn velocity(names: &str) -> Option<[usize; 6]> {
    // the time is one name and two columns
    let at = |name: &str| {
        names
            .trim_start_matches('%')
            .split_whitespace()
            .position(|n| n == name)
            .map(|i| i + 1)
    };
    let found = ["vn(m/s)", "ve(m/s)", "vu(m/s)", "sdvn", "sdve", "sdvu"].map(at);
    found
        .iter()
        .all(Option::is_some)
        .then(|| found.map(Option::unwrap_or_default))
}

/// Velocity north, east, down and its standard deviations of a row; none where one is missing or none.
fn moving(cells: &[&str], columns: [usize; 6]) -> Option<([f64; 3], [f64; 3])> {
    let value = |i: usize| cells.get(columns[i])?.parse::<f64>().ok();
    let (v, sigma) = (
        [value(0)?, value(1)?, -value(2)?],
        [value(3)?, value(4)?, value(5)?],
    );
    sigma.iter().all(|s| *s > 0.0).then_some((v, sigma))
}

/// The same as rows of time, position and standard deviations, or with velocities where all rows have them, line by line, and
/// what is to be said of it. `imu_s` is when the IMU begins and ends.
pub(super) fn rows(
    path: &str,
    text: &str,
    imu_s: Option<(f64, f64)>,
) -> Result<(String, String), Error> {
    let (at, names) = header(text).unwrap_or_default();
    let refuse = |line: usize, message: &str, advice: &'static str| {
        Err(Error::contents(path, line + 1, message).or_hint(advice))
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
    let mut read = Vec::new();
    for (i, line) in text.lines().enumerate() {
        if line.starts_with('%') || line.trim().is_empty() {
            continue;
        }
        let cells: Vec<&str> = line
            .split([' ', ',', '\t'])
            .filter(|c| !c.is_empty())
            .collect();
        let time = if cells.len() < COLUMNS {
            None
        } else {
            gps_time_s(cells[0], cells[1])
        };
        let Some(t_s) = time else {
            return refuse(
                i,
                "not a row of time, position, quality, satellites and standard deviations",
                "2021/03/01 00:00:01.000 (or 2147 86401.000), latitude, longitude, height, Q, ns, sdn, sde, sdu",
            );
        };
        read.push((i, t_s, cells));
    }
    let columns = velocity(names).filter(|columns| {
        read.iter()
            .all(|(.., cells)| moving(cells, *columns).is_some())
    });
    let ends = read
        .first()
        .zip(read.last())
        .map_or((0.0, 0.0), |(first, last)| (first.1, last.1));
    let ClockOfImu {
        origin_s,
        name: clock,
    } = clock(ends, imu_s);
    let (mut table, mut lines) = (String::new(), 0);
    for (i, t_s, cells) in &read {
        let three = |v: [f64; 3]| v.map(|v| v.to_string()).join(" ");
        let (v, sigma) = columns.and_then(|columns| moving(cells, columns)).unzip();
        let parts = [
            // the difference of two numbers of 1e9 keeps 0.2 µs
            Some(format!("{:.6}", t_s - origin_s)),
            Some(cells[2..5].join(" ")),
            v.map(three),
            Some(cells[SIGMA..COLUMNS].join(" ")),
            sigma.map(three),
        ];
        // line by line, so that a refusal names that of the file
        table += &"\n".repeat(i - lines);
        lines = i + 1;
        table += &(parts.into_iter().flatten().collect::<Vec<_>>().join(" ") + "\n");
    }
    let velocity = if columns.is_some() { ", velocity" } else { "" };
    Ok((
        table,
        format!("an RTKLIB solution: position{velocity} and standard deviations, in {clock}"),
    ))
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

    const HEAD: &str = "% program : RTKLIB\n%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)\n";

    /// 2021-03-01 was a Monday, the second day of GPS week 2147.
    #[test]
    fn dates_and_weeks_are_one_clock() {
        let dated =
            format!("{HEAD}2021/03/01 00:00:01.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0 0.1 0 0\n");
        let counted = format!("{HEAD}2147 86401.250   46.5 6.5 400.8  5  8  2.0 2.1 4.0 0.1 0 0\n");
        assert!(is_rtklib(&dated) && !is_rtklib("t_s,lat_deg\n") && !is_rtklib(""));
        let expected = (
            "\n\n86401.250000 46.5 6.5 400.8 2.0 2.1 4.0\n",
            "seconds of GPS week 2147",
        );
        for text in [dated, counted] {
            let (table, remark) = rows("a.pos", &text, None).unwrap();
            assert_eq!(table, expected.0);
            assert!(remark.ends_with(expected.1), "{remark}");
        }
    }

    /// Up is down with the other sign; an IMU in Unix time, 18 leap seconds behind since 2017, or in GPS time has the fixes on
    /// its clock. 86401.25 s of week 2147 are 1298591.6 million of GPS time.
    #[test]
    fn velocities_are_read_and_the_clock_is_the_imu_s() {
        let head = HEAD.replace(
            "sdne(m)",
            "sdne(m) sdeu(m) sdun(m) age(s) ratio vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu",
        );
        let row = "2021/03/01 00:00:01.250 46.5 6.5 400.8 5 8 2.0 2.1 4.0 0 0 0 0 0 1 2 3 0.1 0.2 ";
        let text = format!("{head}{row}0.3\n");
        let read = |imu_s| rows("a.pos", &text, imu_s).unwrap();
        let rest = "46.5 6.5 400.8 1 2 -3 2.0 2.1 4.0 0.1 0.2 0.3\n";
        assert_eq!(read(None).0, format!("\n\n86401.250000 {rest}"));
        let gps_s = 2147.0 * WEEK_S + 86_401.25;
        let unix_s = 1_614_556_801.25 - 18.0;
        for (start_s, words) in [
            (gps_s, "seconds of GPS time"),
            (unix_s, "Unix time, 18 s behind GPS time"),
        ] {
            let (table, said) = read(Some((start_s - 5.0, start_s + 5.0)));
            assert_eq!(table, format!("\n\n{start_s:.6} {rest}"));
            assert!(said.ends_with(words), "{said}");
        }
        // what states no deviation of one velocity states none
        let (table, said) = rows("a.pos", &format!("{head}{row}0\n"), None).unwrap();
        assert!(
            table.ends_with("400.8 2.0 2.1 4.0\n") && !said.contains("velocity"),
            "{table} {said}"
        );
    }

    /// Fixes in Unix time beside IMUs in GPS time and in its weeks; an IMU of no known clock leaves them.
    #[test]
    fn dated_fixes_come_to_the_clock_of_the_imu() {
        let unix_s = (1_614_556_783.25, 1_614_556_883.25);
        let of = |start_s: f64| of_unix(unix_s, Some((start_s - 5.0, start_s + 5.0)));
        let gps_s = 2147.0 * WEEK_S + 86_401.25;
        for (start_s, name) in [
            (gps_s, "seconds of GPS time"),
            (86_401.25, "seconds of GPS week 2147"),
        ] {
            let clock = of(start_s).unwrap();
            assert_eq!(
                (unix_s.0 - clock.origin_s, clock.name.as_str()),
                (start_s, name)
            );
        }
        assert_eq!(
            [of(unix_s.0), of(3_326.0), of_unix(unix_s, None)],
            [None, None, None]
        );
    }

    #[test]
    fn the_week_counts_on() {
        let text =
            format!("{HEAD}2147 604799 46.5 6.5 400 5 8 2 2 4\n2148 0.5 46.5 6.5 400 5 8 2 2 4\n");
        let (table, _) = rows("a.pos", &text, None).unwrap();
        assert!(
            table.contains("604799.000000 ") && table.contains("604800.500000 "),
            "{table}"
        );
    }

    #[test]
    fn what_is_not_such_a_row_is_refused_with_its_line() {
        let error = |text: &str| rows("a.pos", text, None).unwrap_err().to_string();
        let short = format!("{HEAD}2021/03/01 00:00:01 46.5 6.5\n");
        assert!(error(&short).starts_with("a.pos, line 3: not a row of time, position"));
        assert!(
            error(&HEAD.replace("GPST", "UTC"))
                .starts_with("a.pos, line 2: times that are not GPST")
        );
        assert!(
            error(&HEAD.replace("latitude(deg)", "latitude(d'\")"))
                .starts_with("a.pos, line 2: positions")
        );
    }
}
