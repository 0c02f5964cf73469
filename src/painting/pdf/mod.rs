//! Export of egui's shapes as a PDF of one page: lines stay lines, texts stay texts in the embedded letters of the
//! window's fonts.
//!
//! The file has no date and no random identifier, so that the same drawing gives the same bytes.

mod content;
mod document;
mod file;
mod fonts;

pub use document::document;
