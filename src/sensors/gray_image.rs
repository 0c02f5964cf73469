/// 8-bit gray image, rows top to bottom without padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrayImage {
    /// Number of columns in pixels.
    pub width: usize,
    /// Number of rows in pixels.
    pub height: usize,
    /// `width · height` gray values.
    pub pixels: Vec<u8>,
}
