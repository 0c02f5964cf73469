/// An 8-bit gray image, rows top to bottom without padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrayImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` gray values.
    pub pixels: Vec<u8>,
}
