//! Records of a `DataFlash` log: each begins with two fixed bytes and a type, whose fields `FMT` records describe.

use std::collections::BTreeMap;
use std::path::Path;

use super::super::super::ConvertError;
use super::super::damage::Damage;
use super::super::scalar::Scalar;
use crate::flight_log::container::file::{FileWindow, LogFile};

/// First bytes of every record.
pub(in super::super) const START: [u8; 2] = [0xA3, 0x95];
/// Number of bytes before the fields of a record: the two first bytes and the type.
const HEADER_BYTES: usize = 3;
/// Type of the `FMT` records.
const FORMAT_TYPE: u8 = 128;
/// Size of an `FMT` record: type, length, name (4), format (16) and columns (64).
const FORMAT_BYTES: usize = 89;

#[derive(Clone, Debug, PartialEq)]
struct Field {
    name: String,
    letter: u8,
    /// In bytes from the end of the header.
    offset: usize,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RecordType {
    pub(super) name: String,
    /// In bytes, including the header.
    length: usize,
    fields: Vec<Field>,
    /// Multiplier letters of the fields (`FMTU`).
    multipliers: Vec<u8>,
}

/// Size in bytes of a format letter.
fn size(letter: u8) -> Option<usize> {
    Some(match letter {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'f' | b'e' | b'E' | b'L' | b'n' => 4,
        b'd' | b'q' | b'Q' => 8,
        b'N' => 16,
        b'Z' | b'a' => 64,
        _ => return None,
    })
}

/// Number type of a format letter, and the factor implied by the letter; `None` for text, arrays and half floats.
fn scalar(letter: u8) -> Option<(Scalar, f64)> {
    Some(match letter {
        b'b' => (Scalar::I8, 1.0),
        b'B' | b'M' => (Scalar::U8, 1.0),
        b'h' => (Scalar::I16, 1.0),
        b'H' => (Scalar::U16, 1.0),
        b'c' => (Scalar::I16, 0.01),
        b'C' => (Scalar::U16, 0.01),
        b'i' => (Scalar::I32, 1.0),
        b'I' => (Scalar::U32, 1.0),
        b'e' => (Scalar::I32, 0.01),
        b'E' => (Scalar::U32, 0.01),
        b'L' => (Scalar::I32, 1e-7),
        b'f' => (Scalar::F32, 1.0),
        b'd' => (Scalar::F64, 1.0),
        b'q' => (Scalar::I64, 1.0),
        b'Q' => (Scalar::U64, 1.0),
        _ => return None,
    })
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

impl RecordType {
    /// Parses the content of an `FMT` record: returns the type's number and description, or a description of the
    /// problem.
    fn parse(content: &[u8]) -> Result<(u8, Self), String> {
        let (Some(number), Some(length), Some(name), Some(letters), Some(columns)) =
            (content.first(), content.get(1), content.get(2..6), content.get(6..22), content.get(22..86))
        else {
            return Err("a description of a record type that is too short".to_owned());
        };
        let (name, letters, columns) = (text(name), text(letters), text(columns));
        let mut fields = Vec::new();
        let mut offset = 0;
        for (letter, column) in letters.bytes().zip(columns.split(',').chain(std::iter::repeat(""))) {
            let bytes = size(letter)
                .ok_or_else(|| format!("record type {name} has a field of format {:?}", char::from(letter)))?;
            fields.push(Field { name: column.trim().to_owned(), letter, offset });
            offset += bytes;
        }
        let length = usize::from(*length);
        if length != HEADER_BYTES + offset {
            return Err(format!(
                "record type {name} has {length} bytes, but its fields take {}",
                HEADER_BYTES + offset
            ));
        }
        Ok((*number, Self { name, length, fields, multipliers: Vec::new() }))
    }
}

/// Record types and multipliers of a log.
#[derive(Clone, Debug, Default)]
struct Types {
    types: BTreeMap<u8, RecordType>,
    multipliers: BTreeMap<u8, f64>,
}

/// Record that describes other record types: field units (FMTU) or multipliers (MULT).
enum FormatRecord {
    /// Number of a record type and multiplier letters of its fields.
    Letters(u8, Vec<u8>),
    /// Letter and its multiplier.
    Multiplier(u8, f64),
}

impl FormatRecord {
    fn of(record: &Record<'_>) -> Option<Self> {
        match record.record_type.name.as_str() {
            "FMTU" => Some(Self::Letters(record.raw("FmtType")? as u8, record.bytes("MultIds")?.to_vec())),
            "MULT" => Some(Self::Multiplier(record.raw("Id")? as i64 as u8, record.raw("Mult")?)),
            _ => None,
        }
    }
}

impl Types {
    fn apply(&mut self, record: FormatRecord) {
        match record {
            FormatRecord::Letters(number, letters) => {
                if let Some(described) = self.types.get_mut(&number) {
                    described.multipliers = letters;
                }
            }
            FormatRecord::Multiplier(letter, factor) => {
                self.multipliers.insert(letter, factor);
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Record<'a> {
    pub(super) record_type: &'a RecordType,
    multipliers: &'a BTreeMap<u8, f64>,
    content: &'a [u8],
}

impl<'a> Record<'a> {
    fn field(&self, name: &str) -> Option<(usize, &'a Field)> {
        self.record_type.fields.iter().enumerate().find(|(_, field)| field.name == name)
    }

    /// Stored value of a field.
    pub(super) fn raw(&self, name: &str) -> Option<f64> {
        let (_, field) = self.field(name)?;
        scalar(field.letter)?.0.little_endian(self.content, field.offset)
    }

    /// Bytes of a text field.
    fn bytes(&self, name: &str) -> Option<&'a [u8]> {
        let (_, field) = self.field(name)?;
        let bytes = self.content.get(field.offset..field.offset + size(field.letter)?)?;
        Some(&bytes[..bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len())])
    }

    /// Value of a field in its unit: scaled by the log's multipliers (`FMTU`, `MULT`), else by the factor of its format
    /// letter.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        let (index, field) = self.field(name)?;
        let (scalar, implied) = scalar(field.letter)?;
        let raw = scalar.little_endian(self.content, field.offset)?;
        let described = self.record_type.multipliers.get(index).and_then(|letter| self.multipliers.get(letter));
        let factor = described.copied().filter(|factor| *factor != 0.0 && factor.is_finite()).unwrap_or(implied);
        // The quotient by 100 is the number nearest to the decimal one, the product with 0.01 is not.
        let divisor = (1.0 / factor).round();
        Some(if (divisor * factor - 1.0).abs() < 1e-12 { raw / divisor } else { raw * factor })
    }

    /// Values of several fields in their units.
    pub(super) fn numbers<const N: usize>(&self, names: [&str; N]) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for (number, name) in numbers.iter_mut().zip(names) {
            *number = self.number(name)?;
        }
        Some(numbers)
    }
}

/// Calls `visit` with every record and the position after it, until it returns an error; bytes that form no record are
/// skipped. Returns the skipped bytes, and the first problem with a type description.
pub(super) fn walk(
    file: &LogFile,
    path: &Path,
    mut visit: impl FnMut(&Record<'_>, usize) -> Result<(), ConvertError>,
) -> Result<(Damage, Option<String>), ConvertError> {
    let unreadable = |problem: String| ConvertError::unreadable(problem, path);
    let mut window = FileWindow::new(file);
    let mut types = Types::default();
    let description =
        RecordType { name: "FMT".to_owned(), length: FORMAT_BYTES, fields: Vec::new(), multipliers: Vec::new() };
    types.types.insert(FORMAT_TYPE, description);
    let (mut damage, mut problem) = (Damage::default(), None);
    let mut at = 0;
    let mut skipped_from = None;
    while at < file.len() {
        let end = at.saturating_add(HEADER_BYTES);
        let header = if end <= file.len() { window.read(at..end).map_err(unreadable)? } else { &[] };
        let known = match header {
            [first, second, number] if [*first, *second] == START => {
                types.types.get(number).map(|kind| (*number, kind.length))
            }
            _ => None,
        };
        let whole = known.filter(|(_, length)| at.saturating_add(*length) <= file.len());
        let Some((number, length)) = whole else {
            if known.is_some() && skipped_from.is_none() {
                damage.cut(file.len() - at);
                break;
            }
            skipped_from.get_or_insert(at);
            at += 1;
            continue;
        };
        if let Some(from) = skipped_from.take() {
            damage.skip(from, at - from);
        }
        let content = window.read(at + HEADER_BYTES..at + length).map_err(unreadable)?;
        if number == FORMAT_TYPE {
            match RecordType::parse(content) {
                Ok((FORMAT_TYPE, _)) => {}
                Ok((described, kind)) => {
                    types.types.insert(described, kind);
                }
                Err(found) => {
                    problem.get_or_insert(found);
                }
            }
        } else {
            let mut format_record = None;
            if let Some(record_type) = types.types.get(&number) {
                let record = Record { record_type, multipliers: &types.multipliers, content };
                visit(&record, at + length)?;
                format_record = FormatRecord::of(&record);
            }
            if let Some(format_record) = format_record {
                types.apply(format_record);
            }
        }
        at += length;
    }
    if let Some(from) = skipped_from {
        damage.skip(from, at - from);
    }
    Ok((damage, problem))
}
