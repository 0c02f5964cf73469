//! Texts that people write and read: `KEY=VALUE` entries, tables of keys, conditions, names of enums, command lines.

pub mod condition;
mod entry;
mod keys;
mod named;
mod printable;
mod utc;

pub use entry::{Entry, FINITE, items, numbers};
pub use keys::{Field, Key, Label, Numbers, key_list, read_entry, read_item, written_items};
pub use named::Named;
pub use printable::without_bom;
pub use printable::{
    command_line, counted, edit_distance, log_name, nearest_name, printable, printable_lines, shortened,
    without_signed_zeros,
};
pub use utc::utc;
