//! Conversion of video units with length prefixes (ISO/IEC 14496-15) to a byte stream with start codes (Annex B).

use super::boxes::u16_at;
use crate::flight_log::messages::VideoCodec;

const START_CODE: [u8; 4] = [0, 0, 0, 1];

/// Storage format of a track's units.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct UnitFormat {
    pub(super) codec: VideoCodec,
    /// Size of a unit's length prefix in bytes.
    length_bytes: usize,
    /// Parameter sets with start codes.
    parameter_sets: Vec<u8>,
}

fn put(unit: &[u8], out: &mut Vec<u8>) {
    out.extend_from_slice(&START_CODE);
    out.extend_from_slice(unit);
}

impl UnitFormat {
    /// Reads an `avcC` box.
    pub(super) fn avc(configuration: &[u8]) -> Option<Self> {
        let length_bytes = usize::from(configuration.get(4)? & 3) + 1;
        let mut parameter_sets = Vec::new();
        let mut at = 5;
        for mask in [0x1F, 0xFF] {
            let count = configuration.get(at)? & mask;
            at += 1;
            for _ in 0..count {
                let length = usize::from(u16_at(configuration, at)?);
                put(configuration.get(at + 2..at + 2 + length)?, &mut parameter_sets);
                at += 2 + length;
            }
        }
        Some(Self { codec: VideoCodec::H264, length_bytes, parameter_sets })
    }

    /// Reads an `hvcC` box.
    pub(super) fn hevc(configuration: &[u8]) -> Option<Self> {
        let length_bytes = usize::from(configuration.get(21)? & 3) + 1;
        let mut parameter_sets = Vec::new();
        let mut at = 23;
        for _ in 0..*configuration.get(22)? {
            let count = u16_at(configuration, at + 1)?;
            at += 3;
            for _ in 0..count {
                let length = usize::from(u16_at(configuration, at)?);
                put(configuration.get(at + 2..at + 2 + length)?, &mut parameter_sets);
                at += 2 + length;
            }
        }
        Some(Self { codec: VideoCodec::H265, length_bytes, parameter_sets })
    }

    /// Units of a sample without their length prefixes; the last one is an error if the sample ends within it.
    pub(super) fn units<'a>(&self, sample: &'a [u8]) -> impl Iterator<Item = Result<&'a [u8], String>> {
        let length_bytes = self.length_bytes;
        let mut rest = sample;
        std::iter::from_fn(move || {
            while !rest.is_empty() {
                let unit = rest.split_at_checked(length_bytes).and_then(|(length, behind)| {
                    let length = length.iter().fold(0_usize, |length, byte| length << 8 | usize::from(*byte));
                    behind.split_at_checked(length)
                });
                let Some((unit, behind)) = unit else {
                    rest = &[];
                    return Some(Err(damaged()));
                };
                rest = behind;
                if !unit.is_empty() {
                    return Some(Ok(unit));
                }
            }
            None
        })
    }

    /// Converts a sample to a byte stream; a keyframe without parameter sets gets them.
    pub(super) fn access_unit(&self, sample: &[u8]) -> Result<Vec<u8>, String> {
        let units = self.units(sample).collect::<Result<Vec<&[u8]>, String>>()?;
        let kinds: Vec<UnitKind> = units.iter().map(|unit| self.kind(unit[0])).collect();
        let needs_sets = kinds.contains(&UnitKind::RandomAccess) && !kinds.contains(&UnitKind::ParameterSet);
        let mut out = Vec::with_capacity(sample.len() + self.parameter_sets.len() + 4 * units.len());
        // An access unit delimiter must come first.
        let delimiters = kinds.iter().take_while(|kind| **kind == UnitKind::Delimiter).count();
        units[..delimiters].iter().for_each(|unit| put(unit, &mut out));
        if needs_sets {
            out.extend_from_slice(&self.parameter_sets);
        }
        units[delimiters..].iter().for_each(|unit| put(unit, &mut out));
        Ok(out)
    }

    fn kind(&self, header: u8) -> UnitKind {
        match (self.codec, header & 0x1F, header >> 1 & 0x3F) {
            (VideoCodec::H264, 5, _) | (VideoCodec::H265, _, 16..=21) => UnitKind::RandomAccess,
            (VideoCodec::H264, 7, _) | (VideoCodec::H265, _, 33) => UnitKind::ParameterSet,
            (VideoCodec::H264, 9, _) | (VideoCodec::H265, _, 35) => UnitKind::Delimiter,
            _ => UnitKind::Other,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum UnitKind {
    RandomAccess,
    ParameterSet,
    Delimiter,
    Other,
}

fn damaged() -> String {
    "damaged: the lengths of its units do not fit its size".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn avc() -> UnitFormat {
        UnitFormat::avc(&[1, 77, 64, 31, 0xFF, 0xE1, 0, 2, 0x67, 1, 1, 0, 3, 0x68, 2, 3]).unwrap()
    }

    #[test]
    fn parameter_sets_are_put_before_keyframes() {
        let format = avc();
        let sample = [0, 0, 0, 2, 9, 16, 0, 0, 0, 3, 0x65, 7, 8];
        let expected = [0, 0, 0, 1, 9, 16, 0, 0, 0, 1, 0x67, 1, 0, 0, 0, 1, 0x68, 2, 3, 0, 0, 0, 1, 0x65, 7, 8];
        assert_eq!(format.access_unit(&sample).unwrap(), expected);
        assert_eq!(format.access_unit(&[0, 0, 0, 2, 0x41, 5]).unwrap(), [0, 0, 0, 1, 0x41, 5]);
        let with_sets = [0, 0, 0, 1, 0x67, 0, 0, 0, 1, 0x65];
        assert_eq!(format.access_unit(&with_sets).unwrap(), [0, 0, 0, 1, 0x67, 0, 0, 0, 1, 0x65]);
    }

    #[test]
    fn lengths_are_checked() {
        let format = avc();
        for sample in [&[0, 0, 0, 9, 0x65][..], &[0, 0], &[0xFF, 0xFF, 0xFF, 0xFF, 1]] {
            assert!(format.access_unit(sample).unwrap_err().contains("damaged"));
        }
        assert_eq!(UnitFormat::avc(&[1, 77, 64, 31, 0xFF, 0xE1, 0, 20, 0x67]), None);
        assert_eq!(UnitFormat::hevc(&[1; 22]), None);
    }

    #[test]
    fn parameter_sets_of_h265_are_read() {
        let mut configuration = [0; 22].to_vec();
        configuration[21] = 3;
        configuration.extend([2, 32, 0, 1, 0, 2, 0x40, 1, 33, 0, 1, 0, 2, 0x42, 1]);
        let format = UnitFormat::hevc(&configuration).unwrap();
        let expected = [0, 0, 0, 1, 0x40, 1, 0, 0, 0, 1, 0x42, 1, 0, 0, 0, 1, 0x26, 1, 5];
        assert_eq!(format.access_unit(&[0, 0, 0, 3, 0x26, 1, 5]).unwrap(), expected);
    }
}
