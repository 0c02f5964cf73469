/// Profiles with additional fields in their sequence parameter sets (H.264, section 7.3.2.1.1).
const HIGH_PROFILES: [u32; 13] = [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135];

/// Tracks `frame_num` of an H.264 stream: it grows by one after every reference frame, so that a lost one is
/// detected.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameNumbers {
    sequence: Option<Sequence>,
    /// `frame_num` of the last reference frame.
    reference: Option<u32>,
}

/// Fields of a sequence parameter set that concern `frame_num`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sequence {
    bits: u32,
    gaps_allowed: bool,
    separate_planes: bool,
}

impl FrameNumbers {
    /// Reads the payload of a sequence parameter set.
    pub(super) fn take_sequence(&mut self, payload: &[u8]) {
        self.sequence = sequence(payload);
    }

    /// Reads the payload of a frame's first slice; the error means that a frame before it is missing.
    pub(super) fn take_slice(&mut self, payload: &[u8], is_idr: bool, is_reference: bool) -> Result<(), String> {
        let Some(sequence) = self.sequence else { return Ok(()) };
        let mut bits = BitReader::new(payload);
        let Some((0, number)) = first_macroblock_and_frame_number(&mut bits, sequence) else { return Ok(()) };
        let next = |number: u32| (number + 1) % (1 << sequence.bits);
        let follows = match self.reference {
            _ if is_idr || sequence.gaps_allowed => true,
            Some(reference) => number == reference || number == next(reference),
            None => true,
        };
        let expected = self.reference.map_or(0, next);
        if is_reference {
            self.reference = Some(number);
        }
        if follows {
            Ok(())
        } else {
            Err(format!("frames before it are missing: number {number}, expected {expected}"))
        }
    }
}

/// `first_mb_in_slice` and `frame_num` of a slice header (section 7.3.3).
fn first_macroblock_and_frame_number(bits: &mut BitReader<'_>, sequence: Sequence) -> Option<(u32, u32)> {
    let first_macroblock = bits.unsigned()?;
    let _slice_type = bits.unsigned()?;
    let _picture_parameter_set = bits.unsigned()?;
    if sequence.separate_planes {
        bits.number(2)?;
    }
    Some((first_macroblock, bits.number(sequence.bits)?))
}

/// Reads a sequence parameter set (section 7.3.2.1.1) as far as `frame_num` needs it.
fn sequence(payload: &[u8]) -> Option<Sequence> {
    let mut bits = BitReader::new(payload);
    let profile = bits.number(8)?;
    let _constraints_and_level = bits.number(16)?;
    let _id = bits.unsigned()?;
    let mut separate_planes = false;
    if HIGH_PROFILES.contains(&profile) {
        let chroma_format = bits.unsigned()?;
        if chroma_format == 3 {
            separate_planes = bits.bit()?;
        }
        let _luma_depth = bits.unsigned()?;
        let _chroma_depth = bits.unsigned()?;
        let _transform_bypass = bits.bit()?;
        if bits.bit()? {
            for list in 0..if chroma_format == 3 { 12 } else { 8 } {
                if bits.bit()? {
                    skip_scaling_list(&mut bits, if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    let frame_number_bits = bits.unsigned()?.checked_add(4).filter(|bits| *bits <= 16)?;
    match bits.unsigned()? {
        0 => {
            bits.unsigned()?;
        }
        1 => {
            bits.bit()?;
            bits.signed()?;
            bits.signed()?;
            for _ in 0..bits.unsigned()?.min(255) {
                bits.signed()?;
            }
        }
        _ => {}
    }
    let _reference_frames = bits.unsigned()?;
    Some(Sequence { bits: frame_number_bits, gaps_allowed: bits.bit()?, separate_planes })
}

/// Skips a scaling list (section 7.3.2.1.1.1).
fn skip_scaling_list(bits: &mut BitReader<'_>, size: u32) -> Option<()> {
    let (mut last, mut next) = (8_i64, 8_i64);
    for _ in 0..size {
        if next != 0 {
            next = (last + bits.signed()? + 256).rem_euclid(256);
        }
        last = if next == 0 { last } else { next };
    }
    Some(())
}

/// Reads the bits of a raw byte sequence payload (H.264, section 7.2), the most significant bit first.
#[derive(Clone, Debug)]
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    /// Number of bits read.
    position: usize,
}

impl<'a> BitReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0 }
    }

    /// Next bit, `None` at the end.
    pub(super) fn bit(&mut self) -> Option<bool> {
        let byte = self.bytes.get(self.position / 8)?;
        let bit = byte >> (7 - self.position % 8) & 1;
        self.position += 1;
        Some(bit == 1)
    }

    /// Unsigned number of at most 32 bits.
    pub(super) fn number(&mut self, bits: u32) -> Option<u32> {
        (0..bits).try_fold(0_u32, |number, _| Some(number << 1 | u32::from(self.bit()?)))
    }

    /// Unsigned Exp-Golomb code (`ue(v)`).
    pub(super) fn unsigned(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while !self.bit()? {
            zeros += 1;
            if zeros > 31 {
                return None;
            }
        }
        Some((1_u32 << zeros) - 1 + self.number(zeros)?)
    }

    /// Signed Exp-Golomb code (`se(v)`).
    pub(super) fn signed(&mut self) -> Option<i64> {
        let code = i64::from(self.unsigned()?);
        Some(if code % 2 == 0 { -(code / 2) } else { code / 2 + 1 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_golomb_codes_are_read() {
        // 1 | 010 | 011 | 00100 | 00101, then the end.
        let mut bits = BitReader::new(&[0b1010_0110, 0b0100_0010, 0b1000_0000]);
        assert_eq!([0; 5].map(|_: u32| bits.unsigned()), [Some(0), Some(1), Some(2), Some(3), Some(4)]);
        assert_eq!(bits.unsigned(), None);
        let mut bits = BitReader::new(&[0b1010_0110, 0b0100_0010, 0b1000_0000]);
        assert_eq!([0; 5].map(|_: u32| bits.signed()), [Some(0), Some(1), Some(-1), Some(2), Some(-2)]);
        assert_eq!(BitReader::new(&[0; 9]).unsigned(), None);
        assert_eq!(BitReader::new(&[0xAB]).number(6), Some(0b10_1010));
    }
}
