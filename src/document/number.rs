//! Numbers as text.

/// The shortest decimal text that reads back to the same number; powers of ten where plain digits would be
/// long; `NaN` for what is unknown.
pub fn shortest(x: f64) -> String {
    let plain = x == 0.0 || (1e-5..1e15).contains(&x.abs()) || !x.is_finite();
    if plain {
        format!("{x}")
    } else {
        format!("{x:e}")
    }
}

/// A time of a schedule, to a hundredth of a second.
pub fn seconds(t_s: f64) -> String {
    format!("{}", (t_s * 100.0).round() / 100.0)
}

/// A value as the nearest of six significant digits: more of a rate or a time is no one's to read.
pub fn six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// A window of a schedule: `300–390 s`.
pub fn window(start_s: f64, end_s: f64) -> String {
    format!("{}–{} s", seconds(start_s), seconds(end_s))
}

/// `1 cell`, `2 cells`: a regular noun with its number.
#[must_use]
pub fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// A number for people: three significant digits, or four figures before the point.
#[must_use]
pub fn readable(x: f64) -> String {
    if !x.is_finite() {
        return "–".to_owned();
    }
    // of the number as it is shown: 9.996 is 10.0, not 10.00
    let magnitude = format!("{x:.2e}").parse::<f64>().unwrap_or(x).abs();
    match magnitude {
        0.0 => "0".to_owned(),
        m if !(1e-3..1e6).contains(&m) => format!("{x:.2e}"),
        m if m >= 100.0 => format!("{x:.0}"),
        m if m >= 10.0 => format!("{x:.1}"),
        m if m >= 1.0 => format!("{x:.2}"),
        m => format!("{x:.*}", (2.0 - m.log10().floor()) as usize),
    }
}

#[cfg(test)]
mod names_tests {
    use super::*;

    #[test]
    fn shortest_texts_read_back_to_the_same_number() {
        let numbers = [
            0.0,
            -0.0,
            0.1,
            300.0,
            1.0 / 3.0,
            2e-9,
            -6.02e23,
            5e-324,
            f64::MAX,
            1e-5,
            9.9e-6,
        ];
        for x in numbers {
            assert_eq!(
                shortest(x).parse::<f64>().unwrap().to_bits(),
                x.to_bits(),
                "{x:e}"
            );
        }
        assert_eq!(
            [300.0, 0.1, 2e-9, f64::NAN].map(shortest),
            ["300", "0.1", "2e-9", "NaN"]
        );
    }

    #[test]
    fn times_are_rounded() {
        assert_eq!(
            [300.0, 412.345_678_901_2, 0.1].map(seconds),
            ["300", "412.35", "0.1"]
        );
    }

    #[test]
    fn readable_numbers_have_three_significant_digits() {
        let shown = [
            0.0,
            1234.5,
            123.4,
            12.34,
            1.234,
            0.1234,
            0.01,
            0.000_123,
            f64::NAN,
        ]
        .map(readable);
        assert_eq!(
            shown,
            [
                "0", "1234", "123", "12.3", "1.23", "0.123", "0.0100", "1.23e-4", "–"
            ]
        );
        let carried = [0.000_999_6, 0.099_96, 0.9996, -9.996, 99.96, 999_600.0].map(readable);
        assert_eq!(
            carried,
            ["0.00100", "0.100", "1.00", "-10.0", "100", "1.00e6"]
        );
    }
}

// Names of files short enough for a legend.

/// Each path by the shortest of its ends that no other one of them has: `run1.csv`, or `a/run1.csv` beside `b/run1.csv`.
pub fn short_names(paths: &[&str]) -> Vec<String> {
    let parts: Vec<Vec<&str>> = paths.iter().map(|path| components(path)).collect();
    let tail =
        |parts: &[&str], length: usize| parts[parts.len().saturating_sub(length)..].join("/");
    let shortest = |components: &Vec<&str>| {
        let is_alone = |length: &usize| {
            let name = tail(components, *length);
            parts
                .iter()
                .all(|other| other == components || tail(other, *length) != name)
        };
        (1..components.len()).find(is_alone)
    };
    let named = parts
        .iter()
        .zip(paths)
        .map(|(components, path)| (components, path, shortest(components)));
    named
        .map(|(components, path, length)| {
            length.map_or_else(|| (*path).to_owned(), |length| tail(components, length))
        })
        .collect()
}

/// The names that a path is made of.
fn components(path: &str) -> Vec<&str> {
    path.split(['/', '\\'])
        .filter(|part| !part.is_empty() && *part != ".")
        .collect()
}

#[cfg(test)]
mod tests {
    use super::short_names;

    #[test]
    fn names_are_as_short_as_they_can_be_told_apart() {
        let cases: [(&[&str], &[&str]); 7] = [
            (&["/data/2026/imu/run1.csv"], &["run1.csv"]),
            (&["/d/run1.csv", "/d/run2.csv"], &["run1.csv", "run2.csv"]),
            // the same recording twice is one
            (
                &["/d/a.csv", "/d/a.csv", "/d/b.csv"],
                &["a.csv", "a.csv", "b.csv"],
            ),
            (
                &["x/II/awv", "x/III/awv", "x/III/sr-awv"],
                &["II/awv", "III/awv", "sr-awv"],
            ),
            (
                &["out/a/run", "out/b/run", "out/b"],
                &["a/run", "b/run", "b"],
            ),
            (&["run", "a/run", "./b"], &["run", "a/run", "./b"]),
            (&["", "C:\\data\\a.csv"], &["", "a.csv"]),
        ];
        for (paths, names) in cases {
            assert_eq!(short_names(paths), names, "{paths:?}");
        }
    }
}
