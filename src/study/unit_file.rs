//! Unit files of studies: what a unit found, as bytes with a checksum.
//!
//! `nav-sim unit 5\n`, the length of the head (u32), the head (JSON), the numbers (little-endian f64 and
//! u64: for each column its runs, then its epochs; of a covariance analysis what it expects), BLAKE3 of all before. A file that is cut off or changed
//! in one bit is no unit file.

use super::unit::{Finding, UnitResult};
use super::unit_words::{
    EPOCH, EXPECTED_EPOCH, EXPECTED_OUTAGE, OUTAGE, RUN, Words, epoch, expected_epoch, expected_outage,
    put_epoch, put_expected, put_run, run,
};
use crate::formats::{FileError, atomic};
use nav_sim_navigation::metrics::Expected;
use nav_sim_navigation::simulation::RunResult;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

const MAGIC: &[u8] = b"nav-sim unit 5\n";
pub(crate) const CHECKSUM: usize = 32;

/// A unit file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum UnitFileError {
    /// It is not there.
    #[error("{path} is missing")]
    Missing {
        /// File.
        path: String,
    },
    /// The system refused.
    #[error("{path}: {source}")]
    Io {
        /// File.
        path: String,
        /// What the system said.
        source: io::Error,
    },
    /// It is damaged.
    #[error("{path} is damaged: {what}")]
    Damaged {
        /// File.
        path: String,
        /// What is wrong.
        what: &'static str,
    },
}

#[derive(Serialize, Deserialize)]
struct Head {
    id: String,
    first: u64,
    runs: u64,
    columns: Vec<ColumnHead>,
}

#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Method {
    Sampled,
    Expected,
}

#[derive(Serialize, Deserialize)]
struct ColumnHead {
    method: Method,
    outages: Vec<(f64, f64)>,
    filter_states: usize,
    fix_components: usize,
    coverage_level: f64,
    run_epochs: u64,
    independent_windows: Option<f64>,
    seed: u64,
    epochs: usize,
}

impl From<&RunResult> for ColumnHead {
    fn from(r: &RunResult) -> Self {
        Self {
            method: Method::Sampled,
            outages: r.outages.clone(),
            filter_states: r.filter_states,
            fix_components: r.fix_components,
            coverage_level: r.coverage_level,
            run_epochs: r.run_epochs,
            independent_windows: r.independent_windows,
            seed: 0,
            epochs: r.epochs.len(),
        }
    }
}

impl From<&Expected> for ColumnHead {
    fn from(e: &Expected) -> Self {
        Self {
            method: Method::Expected,
            outages: e.outages.iter().map(|o| (o.start_s, o.end_s)).collect(),
            filter_states: e.filter_states,
            fix_components: e.fix_components,
            coverage_level: e.coverage_level,
            run_epochs: 0,
            independent_windows: None,
            seed: e.seed,
            epochs: e.epochs.len(),
        }
    }
}

impl From<&Finding> for ColumnHead {
    fn from(finding: &Finding) -> Self {
        match finding {
            Finding::Sampled(result) => result.into(),
            Finding::Expected(expected) => expected.into(),
        }
    }
}

impl ColumnHead {
    /// How many numbers follow for so many runs; `None` beyond what memory has.
    fn words(&self, runs: usize) -> Option<usize> {
        let outages = self.outages.len();
        let (outage, epoch) = match self.method {
            Method::Sampled => (0, EPOCH),
            Method::Expected => (outages * EXPECTED_OUTAGE, EXPECTED_EPOCH),
        };
        let of_runs = runs.checked_mul(RUN + outages * OUTAGE)?;
        of_runs.checked_add(outage)?.checked_add(self.epochs.checked_mul(epoch)?)
    }
}

/// Where a unit's file stands in a study directory: `units/ab/abcd….unit`.
pub(crate) fn path(directory: &Path, id: &str) -> PathBuf {
    directory.join("units").join(id.get(..2).unwrap_or("00")).join(format!("{id}.unit"))
}

/// Size (bytes, without the head) of the file of a unit like this one, with so many runs, and so many epochs in each
/// column.
pub(crate) fn size(like: &UnitResult, runs: u64, epochs: usize) -> f64 {
    let words = |finding: &Finding| ColumnHead { epochs, ..finding.into() }.words(runs as usize).unwrap_or(0);
    400.0 + like.columns.iter().map(|column| 100.0 + 8.0 * words(column) as f64).sum::<f64>()
}

/// Writes a unit; a directory in its place is set aside as `….unit.damaged`. Where another process has written the
/// same unit meanwhile (on a shared disk without locks it may have taken this one's temporary file for abandoned),
/// there is nothing left to do.
///
/// # Errors
/// When the disk is full or the directory cannot be written to; nothing is left then.
pub(crate) fn write(directory: &Path, unit: &UnitResult) -> Result<(), FileError> {
    let file = path(directory, &unit.id);
    if file.is_dir() {
        let aside = file.with_extension("unit.damaged");
        fs::rename(&file, &aside).map_err(|e| FileError::io(&file, e))?;
    }
    atomic::write(&file, encode(unit)).or_else(|e| match read(directory, &unit.id) {
        Ok(present) if encode(&present) == encode(unit) => Ok(()),
        _ => Err(e),
    })
}

/// Reads a unit and checks that it is the one of that name, whole.
///
/// # Errors
/// When it is missing or damaged.
pub fn read(directory: &Path, id: &str) -> Result<UnitResult, UnitFileError> {
    let file = path(directory, id);
    let shown = || file.display().to_string();
    let bytes = fs::read(&file).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => UnitFileError::Missing { path: shown() },
        io::ErrorKind::IsADirectory => UnitFileError::Damaged { path: shown(), what: "it is a directory" },
        _ => UnitFileError::Io { path: shown(), source },
    })?;
    let unit = decode(&bytes).map_err(|what| UnitFileError::Damaged { path: shown(), what })?;
    if unit.id != id {
        return Err(UnitFileError::Damaged { path: shown(), what: "it holds another unit" });
    }
    Ok(unit)
}

/// The bytes of a unit.
#[must_use]
pub fn encode(unit: &UnitResult) -> Vec<u8> {
    let columns = unit.columns.iter().map(ColumnHead::from).collect();
    let head = Head { id: unit.id.clone(), first: unit.first, runs: unit.runs, columns };
    let json = serde_json::to_vec(&head).expect("plain structs are always JSON");
    let mut bytes = MAGIC.to_vec();
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(json);
    for column in &unit.columns {
        match column {
            Finding::Sampled(result) => {
                result.runs.iter().for_each(|run| put_run(&mut bytes, run));
                result.epochs.iter().for_each(|epoch| put_epoch(&mut bytes, epoch));
            }
            Finding::Expected(expected) => put_expected(&mut bytes, expected),
        }
    }
    let checksum = blake3::hash(&bytes);
    bytes.extend(checksum.as_bytes());
    bytes
}

/// A unit from its bytes.
///
/// # Errors
/// What is wrong with them.
pub(crate) fn decode(bytes: &[u8]) -> Result<UnitResult, &'static str> {
    let content = bytes.len().checked_sub(CHECKSUM).ok_or("it is cut off")?;
    let (content, checksum) = bytes.split_at(content);
    if blake3::hash(content).as_bytes() != checksum {
        return Err("its checksum is wrong");
    }
    let rest = content.strip_prefix(MAGIC).ok_or("its version is not supported")?;
    let (length, rest) = rest.split_first_chunk::<4>().ok_or("its header is cut off")?;
    let (json, numbers) =
        rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or("its header is cut off")?;
    let head: Head = serde_json::from_slice(json).map_err(|_| "its header is not valid JSON")?;
    if announced(&head) != Some(numbers.len()) {
        return Err("its length is wrong");
    }
    let mut words = Words(numbers);
    let columns = head.columns.into_iter().map(|c| column(c, head.runs, &mut words)).collect();
    Ok(UnitResult { id: head.id, first: head.first, runs: head.runs, columns })
}

/// Bytes of the numbers that the head announces; `None` beyond what memory has.
fn announced(head: &Head) -> Option<usize> {
    let runs = usize::try_from(head.runs).ok()?;
    let mut columns = head.columns.iter().map(|column| column.words(runs));
    columns.try_fold(0_usize, |sum, words| sum.checked_add(words?))?.checked_mul(8)
}

fn column(head: ColumnHead, runs: u64, words: &mut Words<'_>) -> Finding {
    match head.method {
        Method::Sampled => Finding::Sampled(sampled(head, runs, words)),
        Method::Expected => Finding::Expected(expected(&head, words)),
    }
}

fn sampled(head: ColumnHead, runs: u64, words: &mut Words<'_>) -> RunResult {
    let runs = (0..runs).map(|_| run(head.outages.len(), words)).collect();
    let epochs = (0..head.epochs).map(|_| epoch(words)).collect();
    RunResult {
        epochs,
        fan_t_s: Vec::new(),
        outage_fix_t_s: Vec::new(),
        runs,
        outages: head.outages,
        filter_states: head.filter_states,
        fix_components: head.fix_components,
        coverage_level: head.coverage_level,
        run_epochs: head.run_epochs,
        independent_windows: head.independent_windows,
    }
}

fn expected(head: &ColumnHead, words: &mut Words<'_>) -> Expected {
    let record = run(head.outages.len(), words);
    let outages = head.outages.iter().map(|window| expected_outage(*window, words)).collect();
    Expected {
        epochs: (0..head.epochs).map(|_| expected_epoch(words)).collect(),
        record,
        outages,
        // The tables of studies are of outages: of the start a unit keeps no words.
        filter_states: head.filter_states,
        fix_components: head.fix_components,
        coverage_level: head.coverage_level,
        seed: head.seed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_navigation::simulation::{EpochSums, OutageRecord, RunRecord};

    fn unit() -> UnitResult {
        let value = |k: usize| (k as f64 + 0.1).sqrt();
        let outage = |k: usize| OutageRecord {
            see_mean: [value(k); 9],
            see_end: [value(k + 5); 9],
            nees_end: value(k + 6),
            log_density_end: -value(k + 4),
            error_end: std::array::from_fn(|i| -value(i + k)),
            horizontal_error_end_m: 1e-300,
            reconvergence_s: if k == 1 { f64::INFINITY } else { -0.0 },
        };
        let run = |k: usize| RunRecord {
            run: 16 + k as u64,
            diverged: k == 1,
            outages: vec![outage(k), outage(k + 1)],
            nis: (value(k), 700),
            rejected: 3 + k as u64,
            nees_mean: value(k + 7),
            covered: value(k + 8),
            normalised_sq: std::array::from_fn(|i| value(i + k + 9)),
            horizontal_m: Vec::new(),
        };
        let epoch = |k: usize| EpochSums {
            t_s: k as f64,
            gnss: k == 0,
            count: 2,
            see: [value(k); 9],
            error_4: [f64::MIN_POSITIVE; 9],
            nees: [value(3), value(4)],
            covered: 1,
            ..EpochSums::default()
        };
        let column = |states: usize| {
            Finding::Sampled(RunResult {
                epochs: (0..3).map(epoch).collect(),
                runs: (0..2).map(run).collect(),
                fan_t_s: Vec::new(),
                outage_fix_t_s: Vec::new(),
                outages: vec![(0.1, 0.3), (1.0 / 3.0, 5.0)],
                filter_states: states,
                fix_components: 6,
                coverage_level: 0.95,
                run_epochs: 180_000,
                independent_windows: Some(5.8),
            })
        };
        UnitResult { id: "ab12".into(), first: 16, runs: 2, columns: vec![column(15), column(27)] }
    }

    #[test]
    fn a_unit_comes_back_bit_by_bit() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &unit()).unwrap();
        assert!(dir.path().join("units/ab/ab12.unit").exists());
        assert_eq!(read(dir.path(), "ab12").unwrap(), unit());
        assert!(matches!(read(dir.path(), "ab13").unwrap_err(), UnitFileError::Missing { .. }));
    }

    #[test]
    fn the_size_is_foretold() {
        let bytes = encode(&unit()).len() as f64;
        assert!((size(&unit(), 2, 3) / bytes - 1.0).abs() < 0.1, "{bytes}");
    }

    #[test]
    fn every_cut_and_every_changed_byte_is_noticed() {
        let whole = encode(&unit());
        for cut in 0..whole.len() {
            assert!(decode(&whole[..cut]).is_err(), "cut at {cut}");
        }
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            assert_eq!(decode(&bytes).unwrap_err(), "its checksum is wrong", "byte {at}");
        }
    }

    /// A right checksum over a head that announces 2^61 runs: eight bytes a number of them are none.
    #[test]
    fn a_head_that_announces_more_than_there_is_is_refused() {
        let forged = |runs: u64, epochs: usize| {
            let mut column = ColumnHead {
                method: Method::Sampled,
                seed: 0,
                outages: Vec::new(),
                filter_states: 15,
                fix_components: 6,
                coverage_level: 0.95,
                independent_windows: None,
                run_epochs: 1,
                epochs,
            };
            column.outages = vec![(0.0, 1.0); 8];
            let head = Head { id: "ab12".into(), first: 0, runs, columns: vec![column] };
            let json = serde_json::to_vec(&head).unwrap();
            let mut bytes = [MAGIC, &(json.len() as u32).to_le_bytes(), &json].concat();
            bytes.extend(blake3::hash(&bytes).as_bytes());
            bytes
        };
        for (runs, epochs) in [(1 << 61, 0), (u64::MAX, 0), (0, 1 << 61), (1 << 60, 1 << 60)] {
            assert_eq!(decode(&forged(runs, epochs)).unwrap_err(), "its length is wrong", "{runs} {epochs}");
        }
        assert!(decode(&forged(0, 0)).is_ok());
    }

    #[test]
    fn a_unit_under_another_name_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &unit()).unwrap();
        fs::rename(path(dir.path(), "ab12"), dir.path().join("units/ab/abff.unit")).unwrap();
        let e = read(dir.path(), "abff").unwrap_err().to_string();
        assert!(e.ends_with("units/ab/abff.unit is damaged: it holds another unit"), "{e}");
    }
}
