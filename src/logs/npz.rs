//! Arrays of NumPy in a zip archive (PKWARE APPNOTE 6.3.10, 4.3), as `numpy.savez` and `numpy.savez_compressed` write them.
//!
//! ```
//! # fn main() -> Result<(), nav_sim_logs::LogError> {
//! # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/arrays.npz");
//! let mut archive = nav_sim_logs::npz::Archive::open(path.as_ref())?;
//! assert!(archive.names().contains(&"gyro".to_owned()));
//! let gyro = archive.read("gyro")?;
//! assert_eq!(gyro.shape, [40, 3]);
//! let second_row = &gyro.values[3..6];
//! # assert_eq!(second_row.len(), 3);
//! # Ok(())
//! # }
//! ```

use crate::input::LogError;
use crate::npy;
use crate::npy::Array;
use std::fs::File;
use std::io;
use std::io::BufReader;
use std::path::Path;
use zip::ZipArchive;
use zip::result::ZipError;

/// Largest array that is read (bytes).
const LARGEST_ARRAY: u64 = 8 << 30;
/// Ending of the names of arrays.
const ENDING: &str = ".npy";

/// Archive whose arrays are known by name.
#[derive(Debug)]
pub struct Archive(ZipArchive<BufReader<File>>);

impl Archive {
    /// Opens a file.
    ///
    /// # Errors
    /// When it is no zip archive, or its directory is damaged.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let archive = ZipArchive::new(BufReader::new(File::open(path)?));
        Ok(Self(archive.map_err(|e| refused(0, &e))?))
    }

    /// Names of the arrays, in the order of the archive.
    pub fn names(&self) -> Vec<String> {
        let names = self.0.file_names();
        names
            .filter_map(|name| Some(name.strip_suffix(ENDING)?.to_owned()))
            .collect()
    }

    /// Reads an array of numbers.
    ///
    /// # Errors
    /// When there is none of that name, or it is damaged or not of numbers.
    pub fn read(&mut self, name: &str) -> Result<Array, LogError> {
        self.array(name).map_err(|error| error.of_topic(name))
    }

    fn array(&mut self, name: &str) -> Result<Array, LogError> {
        let Some(index) = self.0.index_for_name(&format!("{name}{ENDING}")) else {
            return Err(LogError::no_topic(
                &format!("the name {name}"),
                &self.names(),
            ));
        };
        let mut file = self.0.by_index(index).map_err(|e| refused(0, &e))?;
        let (offset, bytes, limit) = (file.header_start(), file.size(), LARGEST_ARRAY);
        if bytes > limit {
            return Err(LogError::too_large(offset, bytes, limit));
        }
        let array = npy::read_from(&mut file, bytes, offset)?;
        // the checksum is examined where the file ends
        let rest = io::copy(&mut file, &mut io::sink());
        rest.map_err(|e| LogError::malformed(offset, e.to_string()))?;
        Ok(array)
    }
}

fn refused(offset: u64, e: &ZipError) -> LogError {
    LogError::malformed(offset, e.to_string())
}
