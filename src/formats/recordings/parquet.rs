//! Recordings in Apache Parquet: columns by their names, read one after the other.

use super::error::{sample, unreadable};
use super::header::{HeaderPlace, Layout};
use super::options::ReadOptions;
use super::table::{BETWEEN, BEYOND, Column, LARGEST, Lines, Notes, Raw, empty_columns, fits};
use crate::formats::{FileError, Place};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::fs::File;
use std::path::Path;

/// Reads a table.
pub(super) fn load(path: &Path, options: &ReadOptions) -> Result<Raw, FileError> {
    let name = path.display().to_string();
    let damaged =
        |e: ParquetError| FileError::contents(name.as_str(), Place::Within, e.to_string());
    let file = File::open(path).map_err(|source| unreadable(path, source))?;
    let reader = SerializedFileReader::new(file).map_err(damaged)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let names: Vec<String> = match &options.columns {
        Some(names) => names.clone(),
        None => schema
            .columns()
            .iter()
            .map(|column| column.name().to_owned())
            .collect(),
    };
    if names.len() != schema.num_columns() {
        return Err(FileError::row_length(
            &name,
            1,
            schema.num_columns(),
            names.len(),
        ));
    }
    let place = HeaderPlace {
        path: &name,
        line: 1,
    };
    let layout = Layout::new(place, &names, false, options.channels.as_deref())?;
    let (indices, mut columns) = empty_columns(&layout);
    let rows = reader.metadata().file_metadata().num_rows();
    fits(&name, &columns, rows.cast_unsigned())?;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).map_err(damaged)?;
        for (k, index) in indices.iter().enumerate() {
            let values = group.get_column_reader(*index).map_err(damaged)?;
            let mut block = Block {
                column: &mut columns[k],
                path: &name,
            };
            match values {
                ColumnReader::DoubleColumnReader(reader) => block.read(reader, |x| *x)?,
                ColumnReader::FloatColumnReader(reader) => block.read(reader, |x| f64::from(*x))?,
                ColumnReader::Int64ColumnReader(reader) => block.read(reader, |x| *x as f64)?,
                ColumnReader::Int32ColumnReader(reader) => block.read(reader, |x| f64::from(*x))?,
                _ => {
                    let message = format!("column \"{}\" has no numbers", columns[k].name);
                    return Err(FileError::contents(name, Place::Within, message));
                }
            }
        }
    }
    let (lines, notes) = (Lines::default(), Notes::default());
    Ok(Raw {
        path: name,
        columns,
        ignored: layout.ignored,
        head_rate: None,
        lines,
        notes,
    })
}

/// A column being read.
struct Block<'a> {
    column: &'a mut Column,
    path: &'a str,
}

impl Block<'_> {
    /// Reads the rest of a column of a row group; an empty cell is no measurement.
    fn read<T: DataType>(
        &mut self,
        mut reader: ColumnReaderImpl<T>,
        value: impl Fn(&T::T) -> f64,
    ) -> Result<(), FileError> {
        let damaged =
            |e: ParquetError| FileError::contents(self.path, Place::Within, e.to_string());
        let (mut cells, mut levels) = (Vec::new(), Vec::new());
        loop {
            cells.clear();
            levels.clear();
            let (rows, found, _) = reader
                .read_records(BETWEEN, Some(&mut levels), None, &mut cells)
                .map_err(damaged)?;
            if rows == 0 {
                return Ok(());
            }
            let next = self.column.values.len() as u64 + 1;
            if found < rows {
                let missing = levels.iter().position(|level| *level == 0).unwrap_or(0);
                return Err(sample(
                    self.path,
                    next + missing as u64,
                    &self.column.name,
                    "\"\"",
                    "is empty",
                ));
            }
            for (row, cell) in (next..).zip(&cells) {
                let number = value(cell);
                if !number.is_finite() || number.abs() > LARGEST {
                    let reason = if number.is_finite() {
                        BEYOND
                    } else {
                        "is not finite"
                    };
                    return Err(sample(
                        self.path,
                        row,
                        &self.column.name,
                        &number.to_string(),
                        reason,
                    ));
                }
                self.column.values.push(number);
            }
        }
    }
}
