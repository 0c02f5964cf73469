//! Number of bits in use of 16-bit grey levels.

/// Number of bits that a camera uses of a 16-bit gray value: its sensor has 8, 10, 12, 14 or 16.
///
/// A 12-bit sensor leaves the upper four bits at zero, so that the upper eight bits have 16 values only. Therefore the
/// eight bits below the highest used bit are taken. The brightest pixel of the topic's first image determines that bit:
/// the same for all images of a log, wherever reading starts. Brighter pixels of later images saturate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BitDepth(u32);

impl Default for BitDepth {
    fn default() -> Self {
        Self(16)
    }
}

impl BitDepth {
    /// Bit depth for the brightest pixel of an image; `None` if it is black.
    pub(super) fn of_brightest(brightest: u16) -> Option<Self> {
        let used = u16::BITS - brightest.leading_zeros();
        (used > 0).then(|| Self(used.next_multiple_of(2).max(8)))
    }

    /// Number of bits, 8 to 16.
    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    /// Converts a 16-bit gray value to 8 bits.
    pub(super) fn narrowed(self, value: u16) -> u8 {
        u8::try_from(value >> (self.0 - 8)).unwrap_or(u8::MAX)
    }
}
