//! Reader of protobuf messages (wire format of Protocol Buffers).

use super::cdr::CdrError;

/// Reads the fields of a message in order.
#[derive(Clone, Debug)]
pub(crate) struct ProtobufReader<'a> {
    message: &'a [u8],
    position: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ProtobufValue<'a> {
    /// Varint or number of fixed size.
    Number(u64),
    /// Bytes, text or another message.
    Bytes(&'a [u8]),
}

impl<'a> ProtobufReader<'a> {
    pub(crate) fn new(message: &'a [u8]) -> Self {
        Self { message, position: 0 }
    }

    /// Number and value of the next field, `None` at the end.
    pub(crate) fn next_field(&mut self) -> Result<Option<(u64, ProtobufValue<'a>)>, CdrError> {
        if self.position == self.message.len() {
            return Ok(None);
        }
        let start = self.position;
        let tag = self.varint()?;
        let value = match tag & 7 {
            0 => ProtobufValue::Number(self.varint()?),
            1 => ProtobufValue::Number(self.fixed::<8>()?),
            2 => {
                let length = usize::try_from(self.varint()?).unwrap_or(usize::MAX);
                ProtobufValue::Bytes(self.take(length)?)
            }
            5 => ProtobufValue::Number(self.fixed::<4>()?),
            other => return Err(CdrError { what: format!("protobuf field of wire type {other}"), offset: start }),
        };
        Ok(Some((tag >> 3, value)))
    }

    /// Converts bytes of this message to text.
    pub(crate) fn text(&self, bytes: &'a [u8]) -> Result<&'a str, CdrError> {
        std::str::from_utf8(bytes)
            .map_err(|error| CdrError { what: format!("string is not UTF-8 ({error})"), offset: self.position })
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], CdrError> {
        let end = self.position.checked_add(count);
        let bytes = end.and_then(|end| self.message.get(self.position..end)).ok_or_else(|| CdrError {
            what: format!("ends at byte {} inside a field of {count} bytes", self.message.len()),
            offset: self.position,
        })?;
        self.position += count;
        Ok(bytes)
    }

    fn fixed<const N: usize>(&mut self) -> Result<u64, CdrError> {
        let bytes = self.take(N)?;
        Ok(bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    fn varint(&mut self) -> Result<u64, CdrError> {
        let start = self.position;
        let mut number = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.take(1)?[0];
            number |= u64::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(CdrError { what: "protobuf number of more than 64 bits".into(), offset: start })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_every_wire_type_are_read() {
        let message = [0x08, 0xAC, 0x02, 0x12, 0x02, b'h', b'i', 0x1D, 1, 0, 0, 0, 0x21, 2, 0, 0, 0, 0, 0, 0, 0];
        let mut reader = ProtobufReader::new(&message);
        let fields: Vec<_> = std::iter::from_fn(|| reader.next_field().unwrap()).collect();
        let expected = [
            (1, ProtobufValue::Number(300)),
            (2, ProtobufValue::Bytes(b"hi")),
            (3, ProtobufValue::Number(1)),
            (4, ProtobufValue::Number(2)),
        ];
        assert_eq!(fields, expected);
    }

    #[test]
    fn lengths_beyond_the_message_are_refused() {
        for message in [&[0x12, 0x7F, 1][..], &[0x12, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1], &[0x0B]]
        {
            assert!(ProtobufReader::new(message).next_field().is_err(), "{message:?}");
        }
    }
}
