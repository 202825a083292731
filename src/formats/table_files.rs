//! Tables as files, written row by row: CSV, JSON (a list of records) and Parquet. The only module that knows
//! the `parquet` crate.

use super::FileError;
use super::atomic::AtomicDir;
use crate::report::{TableColumn, TableRow, Value, ValueKind};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

/// Formats of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TableFormat {
    /// Text with a header.
    Csv,
    /// A list of objects.
    Json,
    /// Apache Parquet, Snappy-compressed.
    Parquet,
}

impl TableFormat {
    /// All of them.
    pub(crate) const ALL: [Self; 3] = [Self::Csv, Self::Json, Self::Parquet];

    const fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Json => "json",
            Self::Parquet => "parquet",
        }
    }
}

/// A table being written, in one or more formats.
pub(crate) struct TableFiles {
    name: String,
    columns: Vec<TableColumn>,
    writers: Vec<Writer>,
    rows: Vec<TableRow>,
}

/// Rows that are written together.
const GROUP: usize = 1 << 14;

impl TableFiles {
    /// Begins `name.csv`, `name.json`, … in a directory.
    ///
    /// # Errors
    /// When a file cannot be made.
    pub(crate) fn create(
        directory: &mut AtomicDir,
        name: &str,
        formats: &[TableFormat],
        columns: Vec<TableColumn>,
    ) -> Result<Self, FileError> {
        let mut writers = Vec::new();
        for format in formats {
            let path = directory.path(&format!("{name}.{}", format.ending()));
            let made = File::create(&path).and_then(|file| Writer::new(*format, file, &columns));
            writers.push(made.map_err(|e| FileError::io(&path, e))?);
        }
        Ok(Self { name: name.to_owned(), columns, writers, rows: Vec::new() })
    }

    /// Adds rows.
    ///
    /// # Errors
    /// When the disk is full.
    pub(crate) fn add(&mut self, rows: impl IntoIterator<Item = TableRow>) -> Result<(), FileError> {
        for row in rows {
            self.rows.push(row);
            if self.rows.len() == GROUP {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), FileError> {
        let rows = std::mem::take(&mut self.rows);
        for writer in &mut self.writers {
            writer.rows(&self.columns, &rows).map_err(|e| FileError::io(Path::new(&self.name), e))?;
        }
        Ok(())
    }

    /// Ends the files. They get their names when the directory is committed.
    ///
    /// # Errors
    /// When the disk is full.
    pub(crate) fn finish(mut self) -> Result<(), FileError> {
        self.flush()?;
        let name = self.name;
        let finished = self.writers.into_iter().try_for_each(Writer::finish);
        finished.map_err(|e| FileError::io(Path::new(&name), e))
    }
}

enum Writer {
    Csv(BufWriter<File>),
    Json(BufWriter<File>, bool),
    Parquet(SerializedFileWriter<File>),
}

impl Writer {
    fn new(format: TableFormat, file: File, columns: &[TableColumn]) -> io::Result<Self> {
        let buffered = |file| BufWriter::with_capacity(1 << 17, file);
        match format {
            TableFormat::Csv => {
                let mut to = buffered(file);
                let names: Vec<String> = columns.iter().map(|(name, _)| quoted(name)).collect();
                writeln!(to, "{}", names.join(","))?;
                Ok(Self::Csv(to))
            }
            TableFormat::Json => {
                let mut to = buffered(file);
                to.write_all(b"[")?;
                Ok(Self::Json(to, true))
            }
            TableFormat::Parquet => {
                let properties = WriterProperties::builder()
                    .set_compression(Compression::SNAPPY)
                    .set_created_by(concat!("nav-sim ", env!("CARGO_PKG_VERSION")).to_owned())
                    .build();
                let schema = schema(columns).map_err(io::Error::other)?;
                let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties));
                Ok(Self::Parquet(writer.map_err(io::Error::other)?))
            }
        }
    }

    fn rows(&mut self, columns: &[TableColumn], rows: &[TableRow]) -> io::Result<()> {
        match self {
            Self::Csv(to) => rows.iter().try_for_each(|row| csv_row(to, row)),
            Self::Json(to, first) => rows.iter().try_for_each(|row| {
                to.write_all(if std::mem::take(first) { b"\n" } else { b",\n" })?;
                json_row(to, columns, row)
            }),
            Self::Parquet(_) if rows.is_empty() => Ok(()),
            Self::Parquet(to) => row_group(to, columns.len(), rows).map_err(io::Error::other),
        }
    }

    fn finish(self) -> io::Result<()> {
        match self {
            Self::Csv(mut to) => to.flush(),
            Self::Json(mut to, _) => to.write_all(b"\n]\n").and_then(|()| to.flush()),
            Self::Parquet(to) => to.close().map(|_| ()).map_err(io::Error::other),
        }
    }
}

fn csv_row(to: &mut impl Write, row: &TableRow) -> io::Result<()> {
    for (i, value) in row.iter().enumerate() {
        if i > 0 {
            to.write_all(b",")?;
        }
        match value {
            Value::Text(text) => to.write_all(quoted(text).as_bytes())?,
            Value::Int(n) => write!(to, "{n}")?,
            Value::Float(x) => write_float(to, *x, "NaN")?,
        }
    }
    to.write_all(b"\n")
}

fn json_row(to: &mut impl Write, columns: &[TableColumn], row: &TableRow) -> io::Result<()> {
    for (i, ((name, _), value)) in columns.iter().zip(row).enumerate() {
        to.write_all(if i == 0 { b"{" } else { b"," })?;
        write!(to, "\"{name}\":")?;
        match value {
            Value::Text(text) => serde_json::to_writer(&mut *to, text)?,
            Value::Int(n) => write!(to, "{n}")?,
            Value::Float(x) => write_float(to, *x, "null")?,
        }
    }
    to.write_all(b"}")
}

/// The shortest text that reads back to the same number.
fn write_float(to: &mut impl Write, x: f64, none: &str) -> io::Result<()> {
    match x.abs() {
        _ if !x.is_finite() => to.write_all(none.as_bytes()),
        m if m == 0.0 || (1e-5..1e15).contains(&m) => write!(to, "{x}"),
        _ => write!(to, "{x:e}"),
    }
}

fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

fn schema(columns: &[TableColumn]) -> Result<Type, ParquetError> {
    let field = |(name, kind): &TableColumn| {
        let physical = match kind {
            ValueKind::Text => Physical::BYTE_ARRAY,
            ValueKind::Int => Physical::INT64,
            ValueKind::Float => Physical::DOUBLE,
        };
        let logical = (*kind == ValueKind::Text).then_some(LogicalType::String);
        let builder = Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED);
        builder.with_logical_type(logical).build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
    Type::group_type_builder("nav_sim").with_fields(fields).build()
}

fn row_group(
    to: &mut SerializedFileWriter<File>,
    columns: usize,
    rows: &[TableRow],
) -> Result<(), ParquetError> {
    let mut group = to.next_row_group()?;
    for i in 0..columns {
        let Some(mut column) = group.next_column()? else { break };
        match column.untyped() {
            ColumnWriter::DoubleColumnWriter(writer) => {
                let float = |row: &TableRow| if let Value::Float(x) = row[i] { x } else { f64::NAN };
                writer.write_batch(&rows.iter().map(float).collect::<Vec<_>>(), None, None)?;
            }
            ColumnWriter::Int64ColumnWriter(writer) => {
                let int = |row: &TableRow| if let Value::Int(n) = row[i] { n as i64 } else { 0 };
                writer.write_batch(&rows.iter().map(int).collect::<Vec<_>>(), None, None)?;
            }
            ColumnWriter::ByteArrayColumnWriter(writer) => {
                let text = |row: &TableRow| {
                    if let Value::Text(t) = &row[i] {
                        ByteArray::from(t.as_str())
                    } else {
                        ByteArray::from("")
                    }
                };
                writer.write_batch(&rows.iter().map(text).collect::<Vec<_>>(), None, None)?;
            }
            _ => {}
        }
        column.close()?;
    }
    group.close().map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    const ROWS: usize = GROUP + 3;

    fn row(k: usize) -> TableRow {
        let x = if k == 1 { f64::NAN } else { (k as f64 + 0.1).sqrt() * 1e-7 };
        vec![Value::Text(format!("a,\"{}\"", k % 3)), Value::Int(k as u64), Value::Float(x)]
    }

    fn written() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        let mut out = AtomicDir::create(&dir.path().join("results")).unwrap();
        let columns = [("name", ValueKind::Text), ("run", ValueKind::Int), ("error_m", ValueKind::Float)];
        let columns = columns.map(|(n, k)| (n.to_owned(), k)).to_vec();
        let mut table = TableFiles::create(&mut out, "t", &TableFormat::ALL, columns).unwrap();
        table.add((0..ROWS).map(row)).unwrap();
        table.finish().unwrap();
        out.commit().unwrap();
        dir
    }

    #[test]
    fn all_formats_hold_the_same_numbers() {
        let dir = written();
        let mut csv = csv::Reader::from_path(dir.path().join("results/t.csv")).unwrap();
        let csv: Vec<csv::StringRecord> = csv.records().map(Result::unwrap).collect();
        let json = std::fs::read_to_string(dir.path().join("results/t.json")).unwrap();
        let json: Vec<serde_json::Value> = serde_json::from_str(&json).unwrap();
        let file = File::open(dir.path().join("results/t.parquet")).unwrap();
        let parquet = SerializedFileReader::new(file).unwrap();
        assert_eq!(parquet.num_row_groups(), 2);
        let parquet: Vec<Vec<Field>> = parquet
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap().get_column_iter().map(|(_, f)| f.clone()).collect())
            .collect();
        assert_eq!([csv.len(), json.len(), parquet.len()], [ROWS; 3]);
        for k in 0..ROWS {
            let [Value::Text(name), Value::Int(run), Value::Float(x)] = &row(k)[..] else { panic!() };
            assert_eq!((&csv[k][0], &csv[k][1]), (name.as_str(), run.to_string().as_str()));
            assert_eq!(csv[k][2].parse::<f64>().unwrap().to_bits(), x.to_bits());
            assert_eq!(
                (json[k]["name"].as_str(), json[k]["run"].as_u64()),
                (Some(name.as_str()), Some(*run))
            );
            assert_eq!(json[k]["error_m"].as_f64(), x.is_finite().then_some(*x));
            let [Field::Str(n), Field::Long(r), Field::Double(y)] = &parquet[k][..] else { panic!() };
            assert_eq!((n, *r as u64, y.to_bits()), (name, *run, x.to_bits()));
        }
    }

    #[test]
    fn the_same_rows_are_the_same_bytes() {
        let (a, b) = (written(), written());
        for name in ["t.csv", "t.json", "t.parquet"] {
            let bytes =
                |dir: &tempfile::TempDir| std::fs::read(dir.path().join("results").join(name)).unwrap();
            assert_eq!(bytes(&a), bytes(&b), "{name}");
        }
    }
}
