//! Tables as files, written row by row: CSV, where asked for JSON (a list of records), and Parquet in builds that have it.

use super::FileError;
use super::atomic::AtomicDir;
#[cfg(feature = "parquet")]
use super::parquet_file::ParquetWriter;
use crate::report::{TableColumn, TableRow, Value};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// A form of a table.
pub(super) trait TableWriter {
    /// Writes rows.
    fn rows(&mut self, columns: &[TableColumn], rows: &[TableRow]) -> io::Result<()>;
    /// Ends the file.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// A table being written, in all its forms.
pub(crate) struct TableFiles {
    name: String,
    columns: Vec<TableColumn>,
    writers: Vec<Box<dyn TableWriter>>,
    rows: Vec<TableRow>,
}

/// Rows that are written together.
pub(super) const GROUP: usize = 1 << 14;

impl TableFiles {
    /// Begins `name.csv` in a directory, and `name.parquet` where this build writes it.
    ///
    /// # Errors
    /// When a file cannot be made.
    pub(crate) fn create(
        directory: &mut AtomicDir,
        name: &str,
        columns: Vec<TableColumn>,
    ) -> Result<Self, FileError> {
        let mut table = Self {
            name: name.to_owned(),
            columns,
            writers: Vec::new(),
            rows: Vec::new(),
        };
        table.begin(directory, "csv", Csv::new)?;
        #[cfg(feature = "parquet")]
        table.begin(directory, "parquet", ParquetWriter::new)?;
        Ok(table)
    }

    /// Also `name.json`.
    ///
    /// # Errors
    /// When the file cannot be made.
    pub(crate) fn with_json(mut self, directory: &mut AtomicDir) -> Result<Self, FileError> {
        self.begin(directory, "json", Json::new)?;
        Ok(self)
    }

    fn begin<W: TableWriter + 'static>(
        &mut self,
        directory: &mut AtomicDir,
        ending: &str,
        writer: impl Fn(File, &[TableColumn]) -> io::Result<W>,
    ) -> Result<(), FileError> {
        let path = directory.path(&format!("{}.{ending}", self.name));
        let made = File::create(&path).and_then(|file| writer(file, &self.columns));
        self.writers
            .push(Box::new(made.map_err(|e| FileError::io(&path, e))?));
        Ok(())
    }

    /// Adds rows.
    ///
    /// # Errors
    /// When the disk is full.
    pub(crate) fn add(
        &mut self,
        rows: impl IntoIterator<Item = TableRow>,
    ) -> Result<(), FileError> {
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
            writer
                .rows(&self.columns, &rows)
                .map_err(|e| FileError::io(Path::new(&self.name), e))?;
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
        let finished = self
            .writers
            .into_iter()
            .try_for_each(|writer| writer.finish());
        finished.map_err(|e| FileError::io(Path::new(&name), e))
    }
}

/// Text with a header.
struct Csv(BufWriter<File>);

impl Csv {
    fn new(file: File, columns: &[TableColumn]) -> io::Result<Self> {
        let mut to = BufWriter::with_capacity(1 << 17, file);
        let names: Vec<String> = columns.iter().map(|(name, _)| quoted(name)).collect();
        writeln!(to, "{}", names.join(","))?;
        Ok(Self(to))
    }
}

impl TableWriter for Csv {
    fn rows(&mut self, _columns: &[TableColumn], rows: &[TableRow]) -> io::Result<()> {
        rows.iter().try_for_each(|row| csv_row(&mut self.0, row))
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.0.flush()
    }
}

/// A list of objects.
struct Json {
    to: BufWriter<File>,
    is_empty: bool,
}

impl Json {
    fn new(file: File, _columns: &[TableColumn]) -> io::Result<Self> {
        let mut to = BufWriter::with_capacity(1 << 17, file);
        to.write_all(b"[")?;
        Ok(Self { to, is_empty: true })
    }
}

impl TableWriter for Json {
    fn rows(&mut self, columns: &[TableColumn], rows: &[TableRow]) -> io::Result<()> {
        rows.iter().try_for_each(|row| {
            let separator: &[u8] = if std::mem::take(&mut self.is_empty) {
                b"\n"
            } else {
                b",\n"
            };
            self.to.write_all(separator)?;
            json_row(&mut self.to, columns, row)
        })
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.to.write_all(b"\n]\n")?;
        self.to.flush()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::ValueKind;

    const ROWS: usize = GROUP + 3;

    fn row(k: usize) -> TableRow {
        let x = if k == 1 {
            f64::NAN
        } else {
            (k as f64 + 0.1).sqrt() * 1e-7
        };
        vec![
            Value::Text(format!("a,\"{}\"", k % 3)),
            Value::Int(k as u64),
            Value::Float(x),
        ]
    }

    fn written() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        let mut out = AtomicDir::create(&dir.path().join("results")).unwrap();
        let columns = [
            ("name", ValueKind::Text),
            ("run", ValueKind::Int),
            ("error_m", ValueKind::Float),
        ];
        let columns = columns.map(|(n, k)| (n.to_owned(), k)).to_vec();
        let mut table = TableFiles::create(&mut out, "t", columns)
            .and_then(|table| table.with_json(&mut out))
            .unwrap();
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
        assert_eq!([csv.len(), json.len()], [ROWS; 2]);
        for k in 0..ROWS {
            let [Value::Text(name), Value::Int(run), Value::Float(x)] = &row(k)[..] else {
                panic!()
            };
            assert_eq!(
                (&csv[k][0], &csv[k][1]),
                (name.as_str(), run.to_string().as_str())
            );
            assert_eq!(csv[k][2].parse::<f64>().unwrap().to_bits(), x.to_bits());
            assert_eq!(
                (json[k]["name"].as_str(), json[k]["run"].as_u64()),
                (Some(name.as_str()), Some(*run))
            );
            assert_eq!(json[k]["error_m"].as_f64(), x.is_finite().then_some(*x));
        }
    }

    #[cfg(feature = "parquet")]
    #[test]
    fn parquet_holds_the_same_numbers() {
        use parquet::file::reader::{FileReader, SerializedFileReader};
        use parquet::record::Field;
        let dir = written();
        let file = File::open(dir.path().join("results/t.parquet")).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        assert_eq!(reader.num_row_groups(), 2);
        for (k, found) in reader.get_row_iter(None).unwrap().enumerate() {
            let found: Vec<Field> = found
                .unwrap()
                .get_column_iter()
                .map(|(_, field)| field.clone())
                .collect();
            let [Value::Text(name), Value::Int(run), Value::Float(x)] = &row(k)[..] else {
                panic!()
            };
            let [Field::Str(n), Field::Long(r), Field::Double(y)] = &found[..] else {
                panic!()
            };
            assert_eq!((n, *r as u64, y.to_bits()), (name, *run, x.to_bits()));
        }
    }

    #[test]
    fn the_same_rows_are_the_same_bytes() {
        let (a, b) = (written(), written());
        for entry in std::fs::read_dir(a.path().join("results")).unwrap() {
            let name = entry.unwrap().file_name();
            let bytes = |dir: &tempfile::TempDir| {
                std::fs::read(dir.path().join("results").join(&name)).unwrap()
            };
            assert_eq!(bytes(&a), bytes(&b), "{name:?}");
        }
    }
}
