//! Tables as Apache Parquet, Snappy-compressed. The only module that knows the `parquet` crate.

use super::table_files::TableWriter;
use crate::report::{TableColumn, TableRow, Value, ValueKind};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::io;
use std::sync::Arc;

/// A table being written.
pub(super) struct ParquetWriter(SerializedFileWriter<File>);

impl ParquetWriter {
    /// Begins it.
    pub(super) fn new(file: File, columns: &[TableColumn]) -> io::Result<Self> {
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(concat!("nav-sim ", env!("CARGO_PKG_VERSION")).to_owned())
            .build();
        let schema = schema(columns).map_err(io::Error::other)?;
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties));
        Ok(Self(writer.map_err(io::Error::other)?))
    }
}

impl TableWriter for ParquetWriter {
    fn rows(&mut self, columns: &[TableColumn], rows: &[TableRow]) -> io::Result<()> {
        if rows.is_empty() {
            return Ok(());
        }
        row_group(&mut self.0, columns.len(), rows).map_err(io::Error::other)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.0.close().map(|_| ()).map_err(io::Error::other)
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
        let builder =
            Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED);
        builder.with_logical_type(logical).build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
    Type::group_type_builder("nav_sim")
        .with_fields(fields)
        .build()
}

fn row_group(
    to: &mut SerializedFileWriter<File>,
    columns: usize,
    rows: &[TableRow],
) -> Result<(), ParquetError> {
    let mut group = to.next_row_group()?;
    for i in 0..columns {
        let Some(mut column) = group.next_column()? else {
            break;
        };
        match column.untyped() {
            ColumnWriter::DoubleColumnWriter(writer) => {
                let float = |row: &TableRow| {
                    if let Value::Float(x) = row[i] {
                        x
                    } else {
                        f64::NAN
                    }
                };
                writer.write_batch(&rows.iter().map(float).collect::<Vec<_>>(), None, None)?;
            }
            ColumnWriter::Int64ColumnWriter(writer) => {
                let int = |row: &TableRow| {
                    if let Value::Int(n) = row[i] {
                        n as i64
                    } else {
                        0
                    }
                };
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
