//! Common Data Representation (OMG, XCDR1 plain) of ROS 2: aligned little- or big-endian fields after a
//! 4-byte encapsulation header.

use thiserror::Error;

use crate::flight_log::container::file::ZSTD_MAGIC;

/// Reason why a message could not be decoded.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{what} at byte {offset} of the message")]
pub(crate) struct CdrError {
    pub(crate) what: String,
    /// Byte offset from the start of the message.
    pub(crate) offset: usize,
}

/// Size of the encapsulation header; alignment counts from its end.
const ENCAPSULATION: usize = 4;

/// Reads fields in order, with bounds checks.
#[derive(Clone, Debug)]
pub(crate) struct CdrReader<'a> {
    message: &'a [u8],
    /// Next byte, from the start of the message.
    position: usize,
    big_endian: bool,
}

macro_rules! read_number {
    ($name:ident, $type:ty) => {
        #[doc = concat!("The next `", stringify!($type), "`.")]
        pub(crate) fn $name(&mut self) -> Result<$type, CdrError> {
            const SIZE: usize = size_of::<$type>();
            self.align(SIZE);
            let bytes = self.take(SIZE, stringify!($type))?;
            let mut array = [0; SIZE];
            array.copy_from_slice(bytes);
            Ok(if self.big_endian { <$type>::from_be_bytes(array) } else { <$type>::from_le_bytes(array) })
        }
    };
}

impl<'a> CdrReader<'a> {
    /// Reads the encapsulation header.
    pub(crate) fn new(message: &'a [u8]) -> Result<Self, CdrError> {
        let big_endian = match message {
            [0, 0, _, _, ..] => true,
            [0, 1, _, _, ..] => false,
            _ if message.starts_with(&ZSTD_MAGIC) => {
                let what = "a separately compressed message (zstd): convert the log with `dcvins convert`".into();
                return Err(CdrError { what, offset: 0 });
            }
            [first, second, _, _, ..] => {
                let what =
                    format!("encapsulation {first:#04x} {second:#04x} instead of plain CDR (0x00 0x00 or 0x00 0x01)");
                return Err(CdrError { what, offset: 0 });
            }
            _ => {
                let what = format!("{} bytes instead of an encapsulation header", message.len());
                return Err(CdrError { what, offset: 0 });
            }
        };
        Ok(Self { message, position: ENCAPSULATION, big_endian })
    }

    /// Bytes that are not read yet.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.message.get(self.position..).unwrap_or_default()
    }

    /// Goes to an offset from the end of the encapsulation header, from which on fields are read.
    pub(super) fn go_to(&mut self, offset: usize) {
        self.position = ENCAPSULATION + offset;
    }

    fn align(&mut self, size: usize) {
        let offset = self.position - ENCAPSULATION;
        self.position = ENCAPSULATION + offset.next_multiple_of(size);
    }

    fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], CdrError> {
        let end = self.position.checked_add(count);
        let bytes = end.and_then(|end| self.message.get(self.position..end)).ok_or_else(|| CdrError {
            what: format!("ends at byte {} inside a {what} of {count} bytes", self.message.len()),
            offset: self.position,
        })?;
        self.position += count;
        Ok(bytes)
    }

    read_number!(read_u8, u8);
    read_number!(read_u16, u16);
    read_number!(read_u32, u32);
    read_number!(read_i32, i32);
    read_number!(read_f32, f32);
    read_number!(read_f64, f64);
    read_number!(read_u64, u64);

    pub(crate) fn read_f64s<const N: usize>(&mut self) -> Result<[f64; N], CdrError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.read_f64()?;
        }
        Ok(values)
    }

    pub(crate) fn read_f32s<const N: usize>(&mut self) -> Result<[f32; N], CdrError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.read_f32()?;
        }
        Ok(values)
    }

    /// Reads the length of a sequence; an error if the rest of the message is shorter.
    fn read_length(&mut self, element_size: usize, what: &str) -> Result<usize, CdrError> {
        let offset = self.position;
        let count = self.read_u32()? as usize;
        if count.saturating_mul(element_size) > self.message.len() - self.position {
            let what = format!("{what} of {count} elements in a message of {} bytes", self.message.len());
            return Err(CdrError { what, offset });
        }
        Ok(count)
    }

    /// Reads a string without its terminating zero.
    pub(crate) fn read_string(&mut self) -> Result<&'a str, CdrError> {
        let count = self.read_length(1, "string")?;
        let offset = self.position;
        let bytes = self.take(count, "string")?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(text).map_err(|error| CdrError { what: format!("string is not UTF-8 ({error})"), offset })
    }

    /// Reads a sequence of bytes, borrowed.
    pub(crate) fn read_bytes(&mut self) -> Result<&'a [u8], CdrError> {
        let count = self.read_length(1, "byte sequence")?;
        self.take(count, "byte sequence")
    }

    pub(crate) fn read_strings(&mut self) -> Result<Vec<&'a str>, CdrError> {
        let count = self.read_length(4, "string sequence")?;
        (0..count).map(|_| self.read_string()).collect()
    }

    pub(crate) fn read_f64_sequence(&mut self) -> Result<Vec<f64>, CdrError> {
        let count = self.read_length(8, "number sequence")?;
        (0..count).map(|_| self.read_f64()).collect()
    }
}

/// Writes fields in order, little-endian.
#[derive(Clone, Debug)]
pub(crate) struct CdrWriter {
    message: Vec<u8>,
}

impl CdrWriter {
    /// Starts a message with the encapsulation header.
    pub(crate) fn new() -> Self {
        Self { message: vec![0, 1, 0, 0] }
    }

    fn align(&mut self, size: usize) {
        let offset = self.message.len() - ENCAPSULATION;
        self.message.resize(ENCAPSULATION + offset.next_multiple_of(size), 0);
    }

    pub(crate) fn u8(&mut self, value: u8) {
        self.message.push(value);
    }

    pub(crate) fn u16(&mut self, value: u16) {
        self.align(2);
        self.message.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.align(4);
        self.message.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn i32(&mut self, value: i32) {
        self.align(4);
        self.message.extend_from_slice(&value.to_le_bytes());
    }

    #[cfg(test)]
    pub(crate) fn u64(&mut self, value: u64) {
        self.align(8);
        self.message.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn f32(&mut self, value: f32) {
        self.align(4);
        self.message.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn f64s(&mut self, values: &[f64]) {
        for value in values {
            self.align(8);
            self.message.extend_from_slice(&value.to_le_bytes());
        }
    }

    pub(crate) fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.message.extend_from_slice(text.as_bytes());
        self.message.push(0);
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.u32(bytes.len() as u32);
        self.message.extend_from_slice(bytes);
    }

    pub(crate) fn strings(&mut self, texts: &[String]) {
        self.u32(texts.len() as u32);
        for text in texts {
            self.string(text);
        }
    }

    pub(crate) fn f64_sequence(&mut self, values: &[f64]) {
        self.u32(values.len() as u32);
        self.f64s(values);
    }

    pub(crate) fn finish(self) -> Vec<u8> {
        self.message
    }
}
