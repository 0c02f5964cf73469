//! Images of a log as gray values: raw and compressed messages, frames of videos, and copies.

pub(crate) mod copies;
pub(crate) mod decoding;
pub(crate) mod grey_sampling;
mod raw_encoding;
pub(super) mod reader;
