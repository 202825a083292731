//! Recorded speeds of a wheel.

use super::time_back;
use crate::formats::recordings::header::{Role, classify, normalise, split_unit};
use crate::formats::trajectory_file::table::{Numbers, Table, open};
use crate::formats::{FileError as Error, Kind};
use nav_sim_navigation::fusion::WheelSpeed;
use std::path::Path;

/// Endings of columns and their size in m/s.
const UNITS: &[(&[&str], f64)] = &[
    (&["m_s", "mps", "m_s_1", "m_sec"], 1.0),
    (&["km_h", "kmh", "kph", "kmph", "km_hr"], 1.0 / 3.6),
    (&["mph", "mi_h"], 0.447_04),
];
/// Words of a speed's name.
const SPEED: &[&str] = &[
    "speed", "velocity", "vel", "v", "wheel", "wheels", "odometer", "odo", "forward", "rear",
];
/// Words of what is no speed yet.
const COUNTS: &[&str] = &[
    "tick", "ticks", "count", "counts", "pulse", "pulses", "encoder", "rpm", "rad",
];
const COLUMNS: &str = "columns: t_s and wheel_m_s (or wheel_km_h, wheel_mph), negative in reverse; or rear_left_m_s and rear_right_m_s";

/// Reads speeds: a table with a time, and a speed or those of both rear wheels, whose mean is taken.
///
/// # Errors
/// Whatever is wrong with it, with its line.
pub(crate) fn read_wheel(path: &Path) -> Result<Vec<WheelSpeed>, Error> {
    let shown = path.display().to_string();
    let table =
        Table::read(&shown, open(path)?, None, Numbers::Finite).map_err(|e| match e.kind {
            Kind::Header(_) | Kind::Empty(_) => e.advice_instead(COLUMNS),
            _ => e,
        })?;
    let (time, unit_s) = time_column(&table)?;
    let speeds = speed_columns(&table)?;
    let speed = |row: &[f64]| {
        speeds
            .iter()
            .map(|(i, factor)| row[*i] * factor)
            .sum::<f64>()
            / speeds.len() as f64
    };
    let read = table.rows.iter().map(|(_, row)| WheelSpeed {
        t_s: row[time] * unit_s,
        m_s: speed(row),
    });
    let read: Vec<WheelSpeed> = read.collect();
    match read.windows(2).position(|w| w[1].t_s <= w[0].t_s) {
        Some(k) => Err(time_back(
            &shown,
            table.rows[k + 1].0,
            read[k].t_s,
            read[k + 1].t_s,
        )),
        None => Ok(read),
    }
}

fn refuse(table: &Table, message: impl Into<Box<str>>) -> Error {
    Error::contents(table.path.as_str(), table.header_line, message)
}

/// The time, and the length of its unit (s).
fn time_column(table: &Table) -> Result<(usize, f64), Error> {
    let mut times =
        table
            .columns
            .iter()
            .enumerate()
            .filter_map(|(i, name)| match classify(name, false) {
                Some(Ok(Role::Time { unit_s })) => Some((i, unit_s.unwrap_or(1.0))),
                _ => None,
            });
    times
        .next()
        .ok_or_else(|| refuse(table, "no time column").advice(COLUMNS))
}

/// A column that may be a speed.
struct Candidate<'a> {
    index: usize,
    name: &'a str,
    words: Vec<String>,
    factor: Option<f64>,
}

/// The speed, or those of both rear wheels, with their factors to m/s.
fn speed_columns(table: &Table) -> Result<Vec<(usize, f64)>, Error> {
    let named = table.columns.iter().enumerate().map(|(index, name)| {
        let plain = normalise(name);
        let unit = split_unit(&plain, UNITS);
        let words = unit
            .map_or(plain.as_str(), |(stem, _)| stem)
            .split('_')
            .map(str::to_owned)
            .collect();
        Candidate {
            index,
            name,
            words,
            factor: unit.map(|(_, factor)| factor),
        }
    });
    let has =
        |c: &Candidate<'_>, words: &[&str]| c.words.iter().any(|w| words.contains(&w.as_str()));
    let all: Vec<_> = named
        .filter(|c| has(c, SPEED) || has(c, COUNTS))
        .filter(|c| !has(c, &["front"]))
        .collect();
    let rear = |side: &str| all.iter().find(|c| has(c, &["rear"]) && has(c, &[side]));
    let chosen: Vec<&Candidate<'_>> = match (rear("left"), rear("right"), &all[..]) {
        (Some(left), Some(right), _) => vec![left, right],
        (_, _, []) => return Err(refuse(table, "no speed of a wheel").advice(COLUMNS)),
        (_, _, [one]) => vec![one],
        (_, _, many) => {
            let names: Vec<_> = many.iter().map(|c| format!("\"{}\"", c.name)).collect();
            return Err(
                refuse(table, format!("several speeds: {}", names.join(", ")))
                    .advice("keep one of them"),
            );
        }
    };
    let factor = |c: &&Candidate<'_>| {
        let (name, is_counted) = (c.name, has(c, COUNTS));
        c.factor.filter(|_| !is_counted).map(|factor| (c.index, factor)).ok_or_else(|| match is_counted {
            true => refuse(table, format!("column \"{name}\" counts turns: a speed is needed"))
                .advice("ticks over ticks a turn, over seconds, times the wheel's circumference: wheel_m_s"),
            false => refuse(table, format!("column \"{name}\" has no unit of speed in its name"))
                .advice("end its name in _m_s, _km_h or _mph"),
        })
    };
    chosen.iter().map(factor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<WheelSpeed>, Error> {
        let file = tempfile::NamedTempFile::with_suffix(".csv").unwrap();
        std::fs::write(file.path(), text).unwrap();
        read_wheel(file.path())
    }

    #[test]
    fn speeds_come_by_the_unit_of_their_column() {
        let read = |header: &str| read(&format!("{header}\n0.5,36\n1.5,-18\n")).unwrap();
        for (header, m_s) in [
            ("t_s,wheel_m_s", 36.0),
            ("time,speed (km/h)", 10.0),
            ("t_s,odo_km_h", 10.0),
            ("t_s,v_mph", 16.09344),
        ] {
            let speeds = read(header);
            assert!(
                (speeds[0].m_s - m_s).abs() < 1e-12 && (speeds[1].m_s + m_s / 2.0).abs() < 1e-12,
                "{header}"
            );
            assert_eq!([speeds[0].t_s, speeds[1].t_s], [0.5, 1.5]);
        }
    }

    #[test]
    fn of_four_wheels_it_is_the_mean_of_the_rear() {
        let header = "t_ms,front_left_m_s,front_right_m_s,rear_left_m_s,rear_right_m_s";
        let speeds = read(&format!("{header}\n1000,9,9,7,8\n1010,9,9,8,9\n")).unwrap();
        assert_eq!(
            speeds,
            [
                WheelSpeed { t_s: 1.0, m_s: 7.5 },
                WheelSpeed {
                    t_s: 1.01,
                    m_s: 8.5
                }
            ]
        );
    }

    #[test]
    fn what_is_no_speed_is_refused_with_its_line_and_column() {
        for (text, said, hint) in [
            (
                "# a\nt_s,wheel_ticks\n0,1\n",
                "line 2: column \"wheel_ticks\" counts turns",
                "circumference",
            ),
            (
                "t_s,wheel_rpm\n0,1\n",
                "line 1: column \"wheel_rpm\" counts turns",
                "circumference",
            ),
            (
                "t_s,wheel\n0,1\n",
                "line 1: column \"wheel\" has no unit",
                "_m_s, _km_h or _mph",
            ),
            (
                "t_s,speed_ft_s\n0,1\n",
                "line 1: column \"speed_ft_s\" has no unit",
                "_m_s, _km_h or _mph",
            ),
            (
                "t_s,wheel_m_s,speed_m_s\n0,1,1\n",
                "several speeds: \"wheel_m_s\", \"speed_m_s\"",
                "keep one",
            ),
            ("t_s,gear\n0,1\n", "no speed of a wheel", "wheel_m_s"),
            ("wheel_m_s\n1\n", "no time column", "t_s"),
            (
                "t_s,wheel_m_s\n1,2\n1,2\n",
                "line 3: time goes from 1 s to 1 s",
                "sort",
            ),
            (
                "t_s,wheel_m_s\n1,x\n",
                "line 2: column \"wheel_m_s\": \"x\" is not a number",
                "",
            ),
        ] {
            let e = read(text).unwrap_err();
            assert!(e.to_string().contains(said), "{e}");
            assert!(
                e.hint().unwrap_or_default().contains(hint),
                "{text}: {:?}",
                e.hint()
            );
        }
    }
}
