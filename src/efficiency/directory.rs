//! The directory of an estimator study: what it is (`study.json`), and the estimates from each set as they
//! are finished (`sets.csv`), from which a study that was stopped goes on. Each row of that ends with a checksum of the rest of
//! it: an incomplete set at the end is made anew, a changed one is refused.

use crate::formats::atomic::Claim;
use crate::formats::difference::Difference;
use crate::formats::{FileError, Place, Setting, atomic, difference};
use nav_sim_calibration::efficiency::Estimate;
use serde_json::{Map, Value};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

type Result<T> = std::result::Result<T, FileError>;

/// What a study writes beside `study.json`.
const FILES: [&str; 6] = [
    "sets.csv",
    "results.csv",
    "results.json",
    "rmse.svg",
    "report.html",
    "sensitivity.csv",
];

/// What follows from other keys where it is not given: blamed last.
const FOLLOWING: [&str; 2] = ["levels", "trim"];

/// The names of what is estimated in each set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    /// (scenario, estimator) of each row of a set.
    pub rows: Vec<(String, String)>,
    /// Names of the parameters.
    pub parameters: Vec<String>,
}

impl Layout {
    fn header(&self) -> String {
        let names: Vec<String> = self
            .parameters
            .iter()
            .map(|n| n.replace(' ', "_"))
            .collect();
        format!(
            "set,scenario,estimator,{},objective,without_root,checksum\n",
            names.join(",")
        )
    }
}

/// An open study directory.
#[derive(Debug)]
pub(crate) struct StudyDirectory {
    path: PathBuf,
    layout: Layout,
    sets: File,
    _claim: Claim,
    /// The sets already estimated from, in order.
    pub done: Vec<Vec<Estimate>>,
    /// Sets that the results of the directory rest on; more than are done where `sets.csv` lost some.
    pub told: u64,
}

impl StudyDirectory {
    /// Opens or makes the directory of the study that `identity` (an object) describes. An incomplete set
    /// at the end, left by a run that was stopped, is removed.
    ///
    /// # Errors
    /// When the directory is of another study, holds somebody else's file of a name that the study writes, is damaged, or
    /// cannot be written to.
    pub(crate) fn open(path: &Path, identity: &Value, layout: Layout) -> Result<Self> {
        let (study, sets) = (path.join("study.json"), path.join("sets.csv"));
        let claim = atomic::claim_file(&study, [])?;
        match fs::read_to_string(&study) {
            Ok(text) => same(path, &text, identity)?,
            Err(_) => {
                if let Some(name) = FILES.into_iter().find(|name| path.join(name).exists()) {
                    return Err(foreign(path, name));
                }
                let text = serde_json::to_string_pretty(identity).unwrap_or_default();
                atomic::write(&study, text + "\n")?;
            }
        }
        let io = |source| FileError::io(&sets, source);
        let text = if sets.exists() {
            fs::read_to_string(&sets).map_err(io)?
        } else {
            String::new()
        };
        let (done, whole) = parse(&sets, &text, &layout)?;
        let mut file = File::options()
            .create(true)
            .write(true)
            .truncate(false)
            .open(&sets)
            .map_err(io)?;
        file.set_len(whole).map_err(io)?;
        std::io::Seek::seek(&mut file, std::io::SeekFrom::End(0)).map_err(io)?;
        let told = told(&path.join("results.json"));
        let mut directory = Self {
            path: sets.clone(),
            layout,
            sets: file,
            _claim: claim,
            done,
            told,
        };
        if whole == 0 {
            directory.write(directory.layout.header().as_bytes())?;
        }
        Ok(directory)
    }

    /// Appends sets, in order after those done, and flushes them to the disk.
    ///
    /// # Errors
    /// When the disk is full.
    pub(crate) fn append(&mut self, sets: Vec<Vec<Estimate>>) -> Result<()> {
        let mut rows = csv::Writer::from_writer(Vec::new());
        for set in sets {
            let number = (self.done.len() + 1).to_string();
            for ((scenario, estimator), e) in self.layout.rows.iter().zip(&set) {
                let mut row = vec![number.clone(), scenario.clone(), estimator.clone()];
                row.extend(e.theta.iter().map(|v| format!("{v:e}")));
                row.extend([format!("{:e}", e.objective), e.without_root.to_string()]);
                row.push(checksum(row.iter().map(String::as_str)));
                rows.write_record(&row)
                    .map_err(|e| FileError::io(&self.path, e.into()))?;
            }
            self.done.push(set);
        }
        let text = rows
            .into_inner()
            .map_err(|e| FileError::io(&self.path, e.into_error()))?;
        self.write(&text)
    }

    fn write(&mut self, text: &[u8]) -> Result<()> {
        let written = self
            .sets
            .write_all(text)
            .and_then(|()| self.sets.sync_data());
        written.map_err(|source| FileError::io(&self.path, source))
    }
}

/// A directory that cannot be worked in, or a file in it.
fn unusable(path: &Path, place: impl Into<Place>, message: impl Into<Box<str>>) -> FileError {
    FileError::contents(path.display().to_string(), place, message)
        .setting(Setting::OutputDirectory)
        .advice("remove this one")
}

/// A directory that holds no study but something else of these names.
fn foreign(path: &Path, file: &str) -> FileError {
    unusable(
        path,
        Place::Itself,
        format!("holds {file}, which is not of a study"),
    )
}

/// Refuses a directory whose study is another one.
fn same(path: &Path, text: &str, wanted: &Value) -> Result<()> {
    let Ok(Value::Object(found)) = serde_json::from_str(text) else {
        return Err(foreign(path, "study.json"));
    };
    let Some(wanted) = wanted.as_object() else {
        return Ok(());
    };
    let given = |all: &Map<String, Value>| {
        let mut given = all.clone();
        given.retain(|key, _| !FOLLOWING.contains(&key.as_str()));
        given
    };
    let difference = difference::first(&given(&found), &given(wanted));
    match difference.or_else(|| difference::first(&found, wanted)) {
        None => Ok(()),
        Some(Difference { key, found, wanted }) => {
            let message = format!("holds another study: its \"{key}\" is {found}, not {wanted}");
            Err(unusable(path, Place::Itself, message))
        }
    }
}

/// How many sets the results are of; none without results.
fn told(results: &Path) -> u64 {
    let text = fs::read_to_string(results).unwrap_or_default();
    serde_json::from_str::<Value>(&text)
        .ok()
        .and_then(|results| results["sets"].as_u64())
        .unwrap_or(0)
}

/// Of the fields of a row, in 16 hexadecimal digits.
fn checksum<'a>(fields: impl Iterator<Item = &'a str>) -> String {
    let mut hasher = blake3::Hasher::new();
    for field in fields {
        hasher.update(field.as_bytes());
        // what ends a field: "1", "23" are not "12", "3"
        hasher.update(b"\n");
    }
    hasher.finalize().to_hex()[..16].to_owned()
}

/// The complete sets, and how many bytes they take with the header.
fn parse(path: &Path, text: &str, layout: &Layout) -> Result<(Vec<Vec<Estimate>>, u64)> {
    let terminated = &text[..text.rfind('\n').map_or(0, |i| i + 1)];
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .from_reader(terminated.as_bytes());
    let damaged = |line: u64, reason: &str| unusable(path, line, reason);
    if terminated.is_empty() {
        return Ok((Vec::new(), 0));
    }
    reader.headers().map_err(|e| damaged(1, &e.to_string()))?;
    if !terminated.starts_with(&layout.header()) {
        return Err(damaged(
            1,
            "is not the header of this study's sets, whose rows end with a checksum",
        ));
    }
    let (mut sets, mut set, mut whole) = (Vec::new(), Vec::new(), reader.position().byte());
    let mut record = csv::StringRecord::new();
    while reader
        .read_record(&mut record)
        .map_err(|e| damaged(reader.position().line(), &e.to_string()))?
    {
        let line = record.position().map_or(0, csv::Position::line);
        let row = estimate(&record, sets.len() + 1, set.len(), layout);
        set.push(row.ok_or_else(|| damaged(line, "is not a row of this study"))?);
        let last = record.len() - 1;
        if record[last] != checksum(record.iter().take(last)) {
            return Err(damaged(
                line,
                "is not as it was written: its checksum is that of another row",
            ));
        }
        if set.len() == layout.rows.len() {
            sets.push(std::mem::take(&mut set));
            whole = reader.position().byte();
        }
    }
    Ok((sets, whole))
}

fn estimate(
    record: &csv::StringRecord,
    set: usize,
    row: usize,
    layout: &Layout,
) -> Option<Estimate> {
    let (scenario, estimator) = layout.rows.get(row)?;
    let p = layout.parameters.len();
    let as_expected = record.len() == p + 6
        && record[0].parse() == Ok(set)
        && record[1] == **scenario
        && record[2] == **estimator;
    let number = |i: usize| record.get(i)?.parse::<f64>().ok();
    if !as_expected {
        return None;
    }
    Some(Estimate {
        theta: (3..3 + p).map(number).collect::<Option<_>>()?,
        objective: number(3 + p)?,
        without_root: record[4 + p].parse().ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn layout() -> Layout {
        let rows = ["awv", "dr-awv"]
            .map(|e| ("a, b".to_owned(), e.to_owned()))
            .to_vec();
        Layout {
            rows,
            parameters: vec!["WN sigma2".into()],
        }
    }

    fn set(seed: f64) -> Vec<Estimate> {
        let estimate = |x: f64| Estimate {
            theta: vec![x / 3.0],
            objective: x,
            without_root: 2,
        };
        vec![estimate(seed), estimate(-seed)]
    }

    fn open(path: &Path) -> StudyDirectory {
        StudyDirectory::open(path, &json!({ "seed": 1 }), layout()).unwrap()
    }

    #[test]
    fn what_is_appended_comes_back_bit_by_bit_and_a_torn_tail_does_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("study");
        let mut first = open(&path);
        first.append(vec![set(1.0), set(1e-300)]).unwrap();
        first.append(vec![set(0.1)]).unwrap();
        let busy = StudyDirectory::open(&path, &json!({ "seed": 1 }), layout()).unwrap_err();
        assert!(
            busy.to_string()
                .ends_with("study.json is another output of the same command"),
            "{busy}"
        );
        drop(first);
        let sets = [set(1.0), set(1e-300), set(0.1)];
        assert_eq!(open(&path).done, sets);
        let file = path.join("sets.csv");
        let whole = fs::read(&file).unwrap();
        for cut in 1..whole.len() {
            fs::write(&file, &whole[..cut]).unwrap();
            let mut again = open(&path);
            let done = again.done.len();
            assert_eq!(again.done, sets[..done]);
            again.append(sets[done..].to_vec()).unwrap();
            assert_eq!(fs::read(&file).unwrap(), whole, "cut at {cut}");
        }
    }

    #[test]
    fn another_study_and_damage_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        open(dir.path()).append(vec![set(1.0)]).unwrap();
        let e = StudyDirectory::open(dir.path(), &json!({ "seed": 2 }), layout()).unwrap_err();
        assert!(
            e.to_string()
                .ends_with("holds another study: its \"seed\" is 1, not 2"),
            "{e}"
        );
        assert!(!e.is_system() && e.hint().is_some());
        let samples = tempfile::tempdir().unwrap();
        let study = |levels: u32, samples: u32| json!({ "levels": levels, "samples": samples });
        StudyDirectory::open(samples.path(), &study(12, 8192), layout()).unwrap();
        let e = StudyDirectory::open(samples.path(), &study(11, 4096), layout())
            .unwrap_err()
            .to_string();
        assert!(e.ends_with("its \"samples\" is 8192, not 4096"), "{e}");
        let e = StudyDirectory::open(samples.path(), &study(11, 8192), layout())
            .unwrap_err()
            .to_string();
        assert!(e.ends_with("its \"levels\" is 12, not 11"), "{e}");
        let file = dir.path().join("sets.csv");
        let text = fs::read_to_string(&file).unwrap().replace("dr-awv", "gmwm");
        let whole = fs::read_to_string(&file).unwrap();
        let refused = |text: &str| {
            fs::write(&file, text).unwrap();
            StudyDirectory::open(dir.path(), &json!({ "seed": 1 }), layout())
                .unwrap_err()
                .to_string()
        };
        let e = refused(&text);
        assert!(
            e.ends_with("sets.csv, line 3: is not a row of this study"),
            "{e}"
        );
        // one digit of an estimate, one of the objective: still numbers
        for (was, is) in [("3.333", "3.334"), (",-1e0,", ",-2e0,")] {
            assert!(whole.contains(was), "{whole}");
            let e = refused(&whole.replace(was, is));
            assert!(
                e.contains("sets.csv, line ")
                    && e.contains(": is not as it was written: its checksum"),
                "{e}"
            );
        }
        let e = refused(&whole.replace("checksum", "sum"));
        assert!(
            e.contains("sets.csv, line 1: is not the header of this study's sets"),
            "{e}"
        );
        fs::remove_file(dir.path().join("study.json")).unwrap();
        let e = StudyDirectory::open(dir.path(), &json!({ "seed": 1 }), layout()).unwrap_err();
        assert!(
            e.to_string()
                .ends_with("holds sets.csv, which is not of a study"),
            "{e}"
        );
    }
}
