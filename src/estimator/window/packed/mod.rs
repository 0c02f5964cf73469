//! A window without what its inputs reproduce to the same bits.

mod packed_features;
mod packed_window;

pub(crate) use packed_window::PackedWindow;
