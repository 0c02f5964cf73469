//! Tables of studies as Apache Parquet, readable by `DuckDB`, pandas and polars.
//!
//! All columns are optional `DOUBLE`, `INT64`, `BYTE_ARRAY (STRING)` or `BOOLEAN`, compressed by Zstandard. Units and
//! descriptions are in the file's metadata `dcvins.columns`, a JSON list of objects with `name`, `unit` and
//! `description`.

use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as PhysicalType, ZstdLevel};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use serde::{Deserialize, Serialize};

use super::error::StudyFileError;
use crate::files::output;
use crate::files::output::{OutputFile, StagedFile};
use crate::study::{Cell, ColumnType, ColumnValues, StudyColumn, StudyTable};

/// Key of the metadata with units and descriptions.
const COLUMNS_KEY: &str = "dcvins.columns";
/// Number of rows read at once.
const BATCH_ROWS: usize = 1 << 16;
/// Maximum number of rows of a table that is read, so that a damaged file does not exhaust the memory.
const MOST_ROWS: i64 = 100_000_000;

/// Unit and description of a column in the metadata of a file.
#[derive(Serialize, Deserialize)]
struct ColumnNote {
    name: String,
    unit: String,
    description: String,
}

/// Writes a table under a temporary name.
///
/// The same table gives the same bytes.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn stage_parquet(table: &StudyTable, path: &Path) -> Result<StagedFile, StudyFileError> {
    let file = OutputFile::create(path).map_err(StudyFileError::write(path))?;
    let file = write(table, file).map_err(|source| StudyFileError::Parquet { source, path: path.to_owned() })?;
    file.stage().map_err(StudyFileError::write(path))
}

/// Writes a table.
///
/// # Errors
/// If the file cannot be written.
pub fn write_parquet(table: &StudyTable, path: &Path) -> Result<(), StudyFileError> {
    stage_parquet(table, path)?.commit().map_err(StudyFileError::write(path))
}

fn schema(table: &StudyTable) -> ParquetResult<Arc<Type>> {
    let field = |column: &StudyColumn| {
        let (physical, logical, converted) = match column.values.column_type() {
            ColumnType::Number => (PhysicalType::DOUBLE, None, ConvertedType::NONE),
            ColumnType::Integer => (PhysicalType::INT64, None, ConvertedType::NONE),
            ColumnType::Bool => (PhysicalType::BOOLEAN, None, ConvertedType::NONE),
            ColumnType::Text => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String), ConvertedType::UTF8),
        };
        let builder = Type::primitive_type_builder(&column.name, physical);
        let builder = builder.with_repetition(Repetition::OPTIONAL).with_logical_type(logical);
        builder.with_converted_type(converted).build().map(Arc::new)
    };
    let fields = table.columns().iter().map(field).collect::<ParquetResult<Vec<_>>>()?;
    Type::group_type_builder("study").with_fields(fields).build().map(Arc::new)
}

fn write(table: &StudyTable, file: OutputFile) -> ParquetResult<OutputFile> {
    let notes: Vec<ColumnNote> = table
        .columns()
        .iter()
        .map(|StudyColumn { name, unit, description, .. }| ColumnNote {
            name: name.clone(),
            unit: unit.clone(),
            description: description.clone(),
        })
        .collect();
    let notes = serde_json::to_string(&notes).map_err(|error| ParquetError::General(error.to_string()))?;
    let properties = WriterProperties::builder()
        .set_created_by(format!("dcvins {}", env!("CARGO_PKG_VERSION")))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(vec![KeyValue::new(COLUMNS_KEY.to_owned(), notes)]))
        .build();
    let mut writer = SerializedFileWriter::new(file, schema(table)?, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for column in table.columns() {
        let Some(mut column_writer) = group.next_column()? else {
            return Err(ParquetError::General(format!("no place for the column '{}'", column.name)));
        };
        let cells = column.values.cells();
        let levels: Vec<i16> = cells.iter().map(|cell| i16::from(*cell != Cell::Empty)).collect();
        match column_writer.untyped() {
            ColumnWriter::DoubleColumnWriter(writer) => {
                let values: Vec<f64> = cells.iter().filter_map(Cell::number).collect();
                writer.write_batch(&values, Some(&levels), None)?;
            }
            ColumnWriter::Int64ColumnWriter(writer) => {
                let of = |cell: &Cell| if let Cell::Integer(integer) = cell { Some(*integer) } else { None };
                writer.write_batch(&cells.iter().filter_map(of).collect::<Vec<_>>(), Some(&levels), None)?;
            }
            ColumnWriter::BoolColumnWriter(writer) => {
                let of = |cell: &Cell| if let Cell::Bool(yes) = cell { Some(*yes) } else { None };
                writer.write_batch(&cells.iter().filter_map(of).collect::<Vec<_>>(), Some(&levels), None)?;
            }
            ColumnWriter::ByteArrayColumnWriter(writer) => {
                let of = |cell: &Cell| if let Cell::Text(text) = cell { Some(text.as_str().into()) } else { None };
                let values: Vec<ByteArray> = cells.iter().filter_map(of).collect();
                writer.write_batch(&values, Some(&levels), None)?;
            }
            _ => return Err(ParquetError::General(format!("another type of column '{}'", column.name))),
        }
        column_writer.close()?;
    }
    group.close()?;
    writer.into_inner()
}

/// Reads a table of this program, or of another one with flat columns of numbers, integers, texts and Booleans.
///
/// # Errors
/// If the file cannot be read or is not such a table.
pub fn read_parquet(path: &Path) -> Result<StudyTable, StudyFileError> {
    let file = std::fs::File::open(path).map_err(StudyFileError::read(path))?;
    read(file).map_err(|source| StudyFileError::Parquet { source, path: path.to_owned() })
}

fn read(file: std::fs::File) -> ParquetResult<StudyTable> {
    let reader = SerializedFileReader::new(file)?;
    let metadata = reader.metadata().file_metadata();
    if metadata.num_rows() > MOST_ROWS {
        return Err(ParquetError::General(format!("{} rows, at most {MOST_ROWS} are read", metadata.num_rows())));
    }
    let notes = metadata.key_value_metadata().into_iter().flatten().find(|entry| entry.key == COLUMNS_KEY);
    let notes: Vec<ColumnNote> = notes
        .and_then(|entry| entry.value.as_deref())
        .and_then(|text| serde_json::from_str(text).ok())
        .unwrap_or_default();
    let mut columns = Vec::new();
    for (place, descriptor) in metadata.schema_descr().columns().iter().enumerate() {
        let name = descriptor.path().string();
        let mut values = match descriptor.physical_type() {
            PhysicalType::DOUBLE | PhysicalType::FLOAT => ColumnValues::new(ColumnType::Number),
            PhysicalType::INT64 | PhysicalType::INT32 => ColumnValues::new(ColumnType::Integer),
            PhysicalType::BOOLEAN => ColumnValues::new(ColumnType::Bool),
            PhysicalType::BYTE_ARRAY => ColumnValues::new(ColumnType::Text),
            other => {
                return Err(ParquetError::General(format!(
                    "column '{name}' is {other}, expected DOUBLE, INT64, BYTE_ARRAY or BOOLEAN"
                )));
            }
        };
        if descriptor.max_rep_level() > 0 || descriptor.max_def_level() > 1 {
            return Err(ParquetError::General(format!("column '{name}' is nested, expected one value per row")));
        }
        for group in 0..reader.num_row_groups() {
            let group = reader.get_row_group(group)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            read_column(group.get_column_reader(place)?, rows, descriptor.max_def_level() > 0, &mut values)?;
        }
        let note = notes.iter().find(|note| note.name == name);
        let (unit, description) = note.map_or(("", ""), |note| (&note.unit, &note.description));
        columns.push(StudyColumn { values, ..StudyColumn::new(&name, ColumnType::Number, unit, description) });
    }
    StudyTable::new(columns).map_err(|error| ParquetError::General(error.to_string()))
}

/// Appends the cells of one row group.
fn read_column(reader: ColumnReader, rows: usize, optional: bool, values: &mut ColumnValues) -> ParquetResult<()> {
    match reader {
        ColumnReader::DoubleColumnReader(reader) => read_cells(reader, rows, optional, values, |it: f64| Ok(it.into())),
        ColumnReader::FloatColumnReader(reader) => {
            read_cells(reader, rows, optional, values, |it: f32| Ok(f64::from(it).into()))
        }
        ColumnReader::Int64ColumnReader(reader) => read_cells(reader, rows, optional, values, |it: i64| Ok(it.into())),
        ColumnReader::Int32ColumnReader(reader) => {
            read_cells(reader, rows, optional, values, |it: i32| Ok(i64::from(it).into()))
        }
        ColumnReader::BoolColumnReader(reader) => read_cells(reader, rows, optional, values, |it: bool| Ok(it.into())),
        ColumnReader::ByteArrayColumnReader(reader) => {
            read_cells(reader, rows, optional, values, |it: ByteArray| Ok(it.as_utf8()?.into()))
        }
        _ => Err(ParquetError::General("a column of another type than its description".to_owned())),
    }
}

fn read_cells<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: usize,
    optional: bool,
    cells: &mut ColumnValues,
    convert: impl Fn(T::T) -> ParquetResult<Cell>,
) -> ParquetResult<()> {
    let mut left = rows;
    while left > 0 {
        let (mut values, mut levels) = (Vec::new(), Vec::new());
        let wanted = left.min(BATCH_ROWS);
        let levels_buffer = optional.then_some(&mut levels);
        let (records, _, _) = reader.read_records(wanted, levels_buffer, None, &mut values)?;
        if records == 0 {
            return Err(ParquetError::General(format!("a column ends {left} rows early")));
        }
        let mut values = values.into_iter();
        for record in 0..records {
            let present = !optional || levels.get(record).is_some_and(|level| *level > 0);
            let value = if present { values.next() } else { None };
            cells.push(value.map_or(Ok(Cell::Empty), &convert)?);
        }
        left -= records;
    }
    Ok(())
}

/// Writes a text, in place of an older file.
///
/// # Errors
/// If the file cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), StudyFileError> {
    output::write_file(path, text.as_bytes()).map_err(StudyFileError::write(path))
}
