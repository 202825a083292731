//! Names of files short enough for a legend.

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
