//! Unit files of studies: what a unit found, as bytes with a checksum.
//!
//! `nav-sim unit 6\n`, the unit in the wire format of postcard, BLAKE3 of all before. A file that is cut off or changed in one
//! bit is no unit file.

use super::unit::{Finding, UnitResult};
use crate::formats::{FileError, atomic};
use serde::Serialize;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

const MAGIC: &[u8] = b"nav-sim unit 6\n";
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

/// Where a unit's file stands in a study directory: `units/ab/abcd….unit`.
pub(crate) fn path(directory: &Path, id: &str) -> PathBuf {
    directory
        .join("units")
        .join(id.get(..2).unwrap_or("00"))
        .join(format!("{id}.unit"))
}

/// Size (bytes) of the file of a unit like this one, with so many runs, and so many epochs in each column.
pub(crate) fn size(like: &UnitResult, runs: u64, epochs: usize) -> f64 {
    let for_each = |number: usize, there: usize| number as f64 / there.max(1) as f64;
    let column = |finding: &Finding| match finding {
        Finding::Sampled(r) => {
            length(&r.runs) * for_each(runs as usize, r.runs.len())
                + length(&r.epochs) * for_each(epochs, r.epochs.len())
        }
        Finding::Expected(e) => {
            length(&(&e.record, &e.outages)) + length(&e.epochs) * for_each(epochs, e.epochs.len())
        }
    };
    100.0 + like.columns.iter().map(column).sum::<f64>()
}

/// Bytes of a value.
fn length(value: &impl Serialize) -> f64 {
    postcard::to_allocvec(value).map_or(0, |bytes| bytes.len()) as f64
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
        io::ErrorKind::IsADirectory => UnitFileError::Damaged {
            path: shown(),
            what: "it is a directory",
        },
        _ => UnitFileError::Io {
            path: shown(),
            source,
        },
    })?;
    let unit = decode(&bytes).map_err(|what| UnitFileError::Damaged {
        path: shown(),
        what,
    })?;
    if unit.id != id {
        return Err(UnitFileError::Damaged {
            path: shown(),
            what: "it holds another unit",
        });
    }
    Ok(unit)
}

/// The bytes of a unit.
#[must_use]
pub fn encode(unit: &UnitResult) -> Vec<u8> {
    let mut bytes = postcard::to_extend(unit, MAGIC.to_vec()).expect("vectors grow");
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
    let unit = content
        .strip_prefix(MAGIC)
        .ok_or("its version is not supported")?;
    match postcard::take_from_bytes(unit) {
        Ok((unit, [])) => Ok(unit),
        _ => Err("it is no unit"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nav_sim_navigation::simulation::{EpochSums, OutageRecord, RunRecord, RunResult};

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
        UnitResult {
            id: "ab12".into(),
            first: 16,
            runs: 2,
            columns: vec![column(15), column(27)],
        }
    }

    #[test]
    fn a_unit_comes_back_bit_by_bit() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &unit()).unwrap();
        assert!(dir.path().join("units/ab/ab12.unit").exists());
        assert_eq!(read(dir.path(), "ab12").unwrap(), unit());
        assert!(matches!(
            read(dir.path(), "ab13").unwrap_err(),
            UnitFileError::Missing { .. }
        ));
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
            assert_eq!(
                decode(&bytes).unwrap_err(),
                "its checksum is wrong",
                "byte {at}"
            );
        }
    }

    /// A right checksum over a list that announces more than 2^60 columns, of which there is none.
    #[test]
    fn a_list_that_announces_more_than_there_is_is_refused() {
        let empty = UnitResult {
            id: "ab12".into(),
            first: 0,
            runs: 0,
            columns: Vec::new(),
        };
        let whole = encode(&empty);
        let end = whole.len() - CHECKSUM - 1;
        let mut forged = [&whole[..end], &[0xff; 8], &[0x7f]].concat();
        forged.extend(blake3::hash(&forged).as_bytes());
        assert_eq!(decode(&whole), Ok(empty));
        assert_eq!(decode(&forged).unwrap_err(), "it is no unit");
    }

    #[test]
    fn a_unit_under_another_name_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &unit()).unwrap();
        fs::rename(
            path(dir.path(), "ab12"),
            dir.path().join("units/ab/abff.unit"),
        )
        .unwrap();
        let e = read(dir.path(), "abff").unwrap_err().to_string();
        assert!(
            e.ends_with("units/ab/abff.unit is damaged: it holds another unit"),
            "{e}"
        );
    }
}
