/// 8-bit gray image, rows top to bottom without padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrayImage {
    /// In pixels.
    pub width: usize,
    /// In pixels.
    pub height: usize,
    /// `width · height` gray values.
    pub pixels: Vec<u8>,
}
