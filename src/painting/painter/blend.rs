//! Arithmetic on packed premultiplied pixels: red in the lowest byte, alpha in the highest.

/// Two of the four channels, with space for carries.
const LANES: u32 = 0x00ff_00ff;

pub const fn pack(rgba: [u8; 4]) -> u32 {
    u32::from_le_bytes(rgba)
}

/// Red, green, blue, alpha of a packed pixel.
pub const fn unpack(pixel: u32) -> [u8; 4] {
    pixel.to_le_bytes()
}

/// The four channels of a pixel, each with space for carries.
const CHANNELS: u64 = 0x00ff_00ff_00ff_00ff;

/// Spreads a pixel over four channels: red, blue, green, alpha from the lowest.
#[inline]
pub(super) fn spread(pixel: u32) -> u64 {
    let pixel = u64::from(pixel);
    (pixel | pixel << 24) & CHANNELS
}

/// Packs four spread channels.
#[inline]
pub(super) fn gathered(channels: u64) -> u32 {
    (channels | channels >> 24) as u32
}

/// `source + below · (1 − source alpha)`, each channel rounded and limited to 255.
#[inline]
pub(super) fn over(below: u32, source: u32) -> u32 {
    let keep = u64::from(255 - (source >> 24));
    gathered(saturated(spread(source) + scaled(spread(below), keep)))
}

/// Each channel times `factor / 255`, rounded.
#[inline]
pub(super) fn scale(pixel: u32, factor: u32) -> u32 {
    gathered(scaled(spread(pixel), u64::from(factor)))
}

/// Channel-wise `a · b / 255`, rounded.
#[inline]
pub(super) fn multiply(a: u32, b: u32) -> u32 {
    let (a, b) = (unpack(a), unpack(b));
    let mut product = [0; 4];
    for channel in 0..4 {
        let exact = u32::from(a[channel]) * u32::from(b[channel]) + 128;
        product[channel] = ((exact + (exact >> 8)) >> 8) as u8;
    }
    pack(product)
}

/// `a + (b − a) · weight / 256` for each spread channel, rounded; `weight` is 0 to 256.
#[inline]
pub(super) fn mixed(a: u64, b: u64, weight: u32) -> u64 {
    const HALF: u64 = 0x0080_0080_0080_0080;
    ((a * u64::from(256 - weight) + b * u64::from(weight) + HALF) >> 8) & CHANNELS
}

/// The mean of four pixels, rounded.
#[inline]
pub fn average(pixels: [u32; 4]) -> u32 {
    const TWO: u32 = 0x0002_0002;
    let sum = |shift: u32| pixels.iter().map(|pixel| (pixel >> shift) & LANES).sum::<u32>();
    (((sum(0) + TWO) >> 2) & LANES) | ((((sum(8) + TWO) >> 2) & LANES) << 8)
}

/// Spread channels times `factor / 255`, rounded exactly.
#[inline]
fn scaled(channels: u64, factor: u64) -> u64 {
    let exact = channels * factor + 0x0080_0080_0080_0080;
    ((exact + ((exact >> 8) & CHANNELS)) >> 8) & CHANNELS
}

/// Limits spread channels (at most 510) to 255.
#[inline]
fn saturated(channels: u64) -> u64 {
    let carry = channels & 0x0100_0100_0100_0100;
    (channels | (carry - (carry >> 8))) & CHANNELS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_rounded_exactly() {
        for a in 0..=255_u32 {
            for b in 0..=255_u32 {
                let exact = (f64::from(a * b) / 255.0).round() as u8;
                let (grey, factor) = (pack([a as u8; 4]), pack([b as u8; 4]));
                assert_eq!(unpack(scale(grey, b)), [exact; 4], "{a} scaled by {b}");
                assert_eq!(unpack(multiply(grey, factor)), [exact; 4], "{a} times {b}");
            }
        }
    }

    #[test]
    fn over_is_premultiplied_and_never_wraps() {
        let ground = pack([10, 200, 255, 255]);
        assert_eq!(over(ground, 0), ground);
        assert_eq!(over(ground, pack([1, 2, 3, 255])), pack([1, 2, 3, 255]));
        assert_eq!(unpack(over(ground, pack([64, 0, 0, 128]))), [69, 100, 127, 255]);
        // Additive light: colour without alpha.
        assert_eq!(unpack(over(ground, pack([100, 100, 100, 0]))), [110, 255, 255, 255]);
    }

    #[test]
    fn four_pixels_are_averaged_by_channel() {
        let mean =
            average([pack([0, 255, 7, 255]), pack([255, 255, 7, 255]), pack([255, 255, 8, 255]), pack([255, 0, 8, 0])]);
        assert_eq!(unpack(mean), [191, 191, 8, 191]);
        assert_eq!(average([u32::MAX; 4]), u32::MAX);
    }

    #[test]
    fn mix_hits_both_ends() {
        let (a, b) = (pack([0, 10, 250, 255]), pack([255, 20, 50, 0]));
        let mix = |weight: u32| gathered(mixed(spread(a), spread(b), weight));
        assert_eq!(mix(0), a);
        assert_eq!(mix(256), b);
        assert_eq!(unpack(mix(128)), [128, 15, 150, 128]);
    }
}
