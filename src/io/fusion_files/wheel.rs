//! Recorded speeds of a wheel.

use super::time_back;
use crate::io::Failure as Error;
use crate::io::recordings::{OF_CLOCK, OF_RECEIVER, STAMP};
use crate::io::table::{
    self, Asked, Bare, Column, Dictionary, NONE, Quantity, SPEED, Table, normalised,
};
use nav_sim_navigation::fusion::WheelSpeed;
use std::path::Path;

const fn of_words(name: &'static str, stems: &'static [&'static str]) -> Quantity {
    Quantity {
        of_words: true,
        ..Quantity::new(name, stems, SPEED, Bare::Unknown)
    }
}

/// Speeds by the words of their names, and what is no speed yet.
static QUANTITIES: [Quantity; 6] = [
    Quantity::time(OF_CLOCK),
    Quantity::time(STAMP),
    Quantity::time(OF_RECEIVER),
    Quantity::new("t_s", &["timeus"], NONE, Bare::Is(1e-6)),
    of_words(
        COUNTS,
        &[
            "tick", "ticks", "count", "counts", "pulse", "pulses", "encoder", "rpm", "rad",
        ],
    ),
    of_words(
        "speed",
        &[
            "speed", "velocity", "vel", "v", "wheel", "wheels", "odometer", "odo", "forward",
            "rear",
        ],
    ),
];
const COUNTS: &str = "counts";

const DICTIONARY: Dictionary = Dictionary::new(
    &QUANTITIES,
    "columns: t_s and wheel_m_s (or wheel_km_h, wheel_mph), negative in reverse; or rear_left_m_s and rear_right_m_s",
);

/// Reads speeds: a table with a time, and a speed or those of both rear wheels, whose mean is taken.
///
/// # Errors
/// Whatever is wrong with it, with its line.
pub(crate) fn read_wheel(path: &Path) -> Result<Vec<WheelSpeed>, Error> {
    let table = table::read(path, &DICTIONARY, &Asked::default())?;
    let [time] = table.columns(["t_s"], &DICTIONARY)?;
    let speeds = speed_columns(&table)?;
    let speed = |row| speeds.iter().map(|c| c.si(row)).sum::<f64>() / speeds.len() as f64;
    let rows = (0..table.rows()).map(|row| WheelSpeed {
        t_s: time.si(row),
        m_s: speed(row),
    });
    let read: Vec<WheelSpeed> = rows.collect();
    match read.windows(2).position(|w| w[1].t_s <= w[0].t_s) {
        Some(k) => {
            let line = table.line(k + 1);
            Err(time_back(&table.path, line, read[k].t_s, read[k + 1].t_s))
        }
        None => Ok(read),
    }
}

/// The speed, or those of both rear wheels.
fn speed_columns(table: &Table) -> Result<Vec<&Column>, Error> {
    let has = |c: &Column, word: &str| normalised(&c.name).split('_').any(|w| w == word);
    let is_candidate = |c: &&Column| c.quantity.of_words && !has(c, "front");
    let all: Vec<&Column> = table.columns.iter().filter(is_candidate).collect();
    let rear = |side: &str| all.iter().find(|c| has(c, "rear") && has(c, side));
    let chosen = match (rear("left"), rear("right"), &all[..]) {
        (Some(left), Some(right), _) => vec![*left, *right],
        (_, _, []) => {
            let refusal = table.refused("no speed of a wheel");
            return Err(refusal.or_hint(DICTIONARY.advice));
        }
        (_, _, [one]) => vec![*one],
        (_, _, many) => {
            let names: Vec<_> = many.iter().map(|c| format!("\"{}\"", c.name)).collect();
            let message = format!("several speeds: {}", names.join(", "));
            return Err(table.refused(message).or_hint("keep one of them"));
        }
    };
    for column in &chosen {
        let name = &column.name;
        if column.quantity.name == COUNTS {
            let message = format!("column \"{name}\" counts turns: a speed is needed");
            return Err(table.refused(message).or_hint(
                "ticks over ticks a turn, over seconds, times the wheel's circumference: wheel_m_s",
            ));
        }
        if column.factor.is_none() {
            let message = format!("column \"{name}\" has no unit of speed in its name");
            return Err(table
                .refused(message)
                .or_hint("end its name in _m_s, _km_h or _mph"));
        }
    }
    Ok(chosen)
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
            ("wheel_m_s\n1\n", "column t_s is missing", "t_s"),
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
                e.advice().unwrap_or_default().contains(hint),
                "{text}: {:?}",
                e.advice()
            );
        }
    }
}
