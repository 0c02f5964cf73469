//! Texts that people write and read: `KEY=VALUE` entries, names of enums.

mod entry;
mod named;

pub use entry::{Entry, FINITE, items, numbers};
pub use named::Named;
