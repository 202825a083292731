//! Which files are meant: directories stand for the recordings in them.

use crate::io::table::{is_oxts, unreadable};
use crate::io::{Failure, Place};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// A file to read.
pub(super) struct File {
    pub(super) path: PathBuf,
    /// Found in a directory, not named: may turn out to be something else.
    pub(super) from_directory: bool,
}

const ENDINGS: [&str; 10] = [
    "csv", "tsv", "txt", "npy", "npz", "mcap", "bag", "ulg", "ubx", "parquet",
];

/// The files, in the order given, those of a directory in name order.
pub(super) fn expand(paths: &[PathBuf]) -> Result<Vec<File>, Failure> {
    let mut files = Vec::new();
    for path in paths {
        let io = |e: std::io::Error| {
            let is_missing = e.kind() == std::io::ErrorKind::NotFound;
            let advice = "check the path; a directory stands for all its recordings";
            unreadable(path, e).or_hint_if(is_missing.then(|| advice.to_owned()))
        };
        if std::fs::metadata(path).map_err(io)?.is_dir() && !is_oxts(path) {
            let inside = listing(path).map_err(io)?;
            if inside.is_empty() {
                return Err(no_files(path.display().to_string()));
            }
            files.extend(inside.into_iter().map(|path| File {
                path,
                from_directory: true,
            }));
        } else {
            files.push(File {
                path: path.clone(),
                from_directory: false,
            });
        }
    }
    let mut seen = HashSet::new();
    for file in &files {
        // A pipe has no path of its own.
        if !seen.insert(
            file.path
                .canonicalize()
                .unwrap_or_else(|_| file.path.clone()),
        ) {
            let message = "is given twice: it would count as two replicates";
            return Err(
                Failure::contents(file.path.display(), Place::Itself, message)
                    .or_hint("name each file once; a directory stands for all its recordings"),
            );
        }
    }
    Ok(files)
}

/// A directory without recordings.
pub(super) fn no_files(path: String) -> Failure {
    Failure::contents(path, Place::Within, "no recordings in it").or_hint(
        "recordings end in .csv, .tsv, .txt (also .gz), .npy, .npz, .mcap, .bag, .ulg or .ubx",
    )
}

fn listing(directory: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let name = name_of(&path);
        if !name.starts_with('.') && is_recording(&name) && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort_by_key(|p| natural(&name_of(p)));
    Ok(paths)
}

fn name_of(path: &Path) -> String {
    path.file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Whether a name ends like a recording's.
fn is_recording(name: &str) -> bool {
    let lower = name.to_lowercase();
    let plain = lower.strip_suffix(".gz").unwrap_or(&lower);
    plain
        .rsplit_once('.')
        .is_some_and(|(stem, ending)| !stem.is_empty() && ENDINGS.contains(&ending))
}

/// Sort key: digits compare by value, so that `replicate_9` is before `replicate_10`.
fn natural(name: &str) -> (String, String) {
    let is_digit = |text: &[u8]| text[0].is_ascii_digit();
    let parts = name
        .as_bytes()
        .chunk_by(|a, b| is_digit(&[*a]) == is_digit(&[*b]));
    let padded = parts.map(|part| match String::from_utf8_lossy(part) {
        number if is_digit(part) => format!("{number:0>20}"),
        word => word.into_owned(),
    });
    (padded.collect(), name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_order_counts() {
        let mut names = ["run10.csv", "run9.csv", "a.csv", "run1.csv", "run01.csv"];
        names.sort_by_key(|n| natural(n));
        assert_eq!(
            names,
            ["a.csv", "run01.csv", "run1.csv", "run9.csv", "run10.csv"]
        );
    }

    #[test]
    fn endings() {
        for name in ["a.csv", "a.CSV.gz", "b.tsv", "mt.txt", "x.npy"] {
            assert!(is_recording(name), "{name}");
        }
        for name in [
            "manifest.json",
            "model.toml",
            "csv",
            ".csv",
            "a.gz",
            "a.csv.partial",
        ] {
            assert!(!is_recording(name), "{name}");
        }
    }
}
