/// Number type of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Little-endian number at a byte of a record; `None` beyond its end. Whole numbers are exact up to 2⁵³.
    pub(super) fn little_endian(self, record: &[u8], offset: usize) -> Option<f64> {
        let mut bytes = [0; 8];
        bytes[..self.size()].copy_from_slice(record.get(offset..offset.checked_add(self.size())?)?);
        Some(self.value(bytes))
    }

    /// Big-endian number at a byte of a record; `None` beyond its end.
    pub(super) fn big_endian(self, record: &[u8], offset: usize) -> Option<f64> {
        let mut bytes = [0; 8];
        let size = self.size();
        bytes[..size].copy_from_slice(record.get(offset..offset.checked_add(size)?)?);
        bytes[..size].reverse();
        Some(self.value(bytes))
    }

    /// Number in the first of eight bytes, little-endian.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let whole = u64::from_le_bytes(bytes);
        match self {
            Self::I8 => f64::from(whole as u8 as i8),
            Self::U8 => f64::from(whole as u8),
            Self::I16 => f64::from(whole as u16 as i16),
            Self::U16 => f64::from(whole as u16),
            Self::I32 => f64::from(whole as u32 as i32),
            Self::U32 => f64::from(whole as u32),
            Self::I64 => whole as i64 as f64,
            Self::U64 => whole as f64,
            Self::F32 => f64::from(f32::from_bits(whole as u32)),
            Self::F64 => f64::from_bits(whole),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_in_both_orders() {
        let bytes = [0xFE, 0xFF, 0x00, 0x80, 0x00, 0x00, 0x20, 0xC1];
        assert_eq!(Scalar::I16.little_endian(&bytes, 0), Some(-2.0));
        assert_eq!(Scalar::U16.big_endian(&bytes, 0), Some(65279.0));
        assert_eq!(Scalar::I16.little_endian(&bytes, 2), Some(-32768.0));
        assert_eq!(Scalar::F32.little_endian(&bytes, 4), Some(-10.0));
        assert_eq!(Scalar::I8.big_endian(&bytes, 0), Some(-2.0));
        assert_eq!(Scalar::U64.big_endian(&[0, 0, 0, 0, 0, 1, 0, 0], 0), Some(65536.0));
        assert_eq!(Scalar::F64.little_endian(&1.25_f64.to_le_bytes(), 0), Some(1.25));
        assert_eq!(Scalar::F64.little_endian(&bytes, 1), None);
        assert_eq!(Scalar::U8.little_endian(&bytes, usize::MAX), None);
    }
}
