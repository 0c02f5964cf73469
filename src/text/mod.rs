//! Texts that people write and read: `KEY=VALUE` entries, tables of keys, conditions, names of enums, command lines.

mod command_line;
pub(crate) mod condition;
mod counted;
mod entry;
mod keys;
mod named;

pub use command_line::command_line;
pub use counted::counted;
pub use entry::{Entry, FINITE, items, numbers};
pub use keys::{Field, Key, Label, Numbers, key_list, read_entry, read_item, written_items};
pub use named::Named;
