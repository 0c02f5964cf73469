//! Images that equal the image before, and the certain copies among them.

/// Number of images over which copies that come regularly are found.
const REMEMBERED: u32 = 8;

/// Decides which of the images that equal the one before are copies: a camera without noise that does not move may see
/// the same twice.
///
/// An image is a copy if the vehicle rotates, or if images that differ and images that equal the one before alternate:
/// a scene that comes to a stop gives equal images from then on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CopyJudge {
    /// One bit for each of the last images, the newest lowest: 1 if it equalled the one before.
    equal: u32,
}

impl CopyJudge {
    /// Adds the next image; returns true for a copy.
    pub(crate) fn is_copy(&mut self, equals_previous: bool, rotates: bool) -> bool {
        let before = self.equal & ((1 << REMEMBERED) - 1);
        self.equal = self.equal << 1 | u32::from(equals_previous);
        let takes_turns = before != 0 && before & 1 == 0;
        equals_previous && (rotates || takes_turns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places of the copies in a text with `=` for an image that equals the one before.
    fn copies(images: &str, rotates: bool) -> Vec<usize> {
        let mut judge = CopyJudge::default();
        let judged = images.chars().map(|image| judge.is_copy(image == '=', rotates));
        judged.enumerate().filter(|(_, copy)| *copy).map(|(place, _)| place).collect()
    }

    #[test]
    fn equal_images_are_copies_if_something_moves() {
        assert_eq!(copies("..=..===.", true), [2, 5, 6, 7]);
        // Every second image, and every fourth.
        assert_eq!(copies(".=.=.=.=", false), [3, 5, 7]);
        assert_eq!(copies("...=...=...=", false), [7, 11]);
        // A vehicle that stands at first, and one that stops.
        assert_eq!(copies(".=====......", false), [0_usize; 0]);
        assert_eq!(copies("......======", false), [0_usize; 0]);
        assert_eq!(copies(".===.............====", false), [0_usize; 0]);
    }
}
