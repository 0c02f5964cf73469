//! Tables of keys: the one definition of each key of a `key=value` text, from which its parser, its canonical text, help,
//! dialogs and documents come.

use std::ops::RangeInclusive;

use super::entry::{Entry, numbers};

/// A key of a `key=value` text that sets a field of `T`.
#[derive(Debug)]
pub struct Key<T: 'static> {
    /// Key as written before the `=`.
    pub name: &'static str,
    /// Form of the value for help and messages: `on|off`, `N`, `START,LENGTH`.
    pub form: &'static str,
    /// Effect of the value, as Markdown for the documents.
    pub meaning: &'static str,
    /// Field of `T` with the values that it accepts.
    pub field: Field<T>,
    /// Texts in the window; `None` for a key that no dialog offers.
    pub label: Option<Label>,
}

/// Field that a key sets, with its type and the values that it accepts.
#[derive(Debug)]
pub enum Field<T: 'static> {
    /// Switch with the values `on` and `off`.
    Switch(fn(&mut T) -> &mut bool),
    /// Whole number within a range.
    Count(fn(&mut T) -> &mut usize, RangeInclusive<usize>),
    Factor(fn(&mut T) -> &mut f64, RangeInclusive<f64>),
    /// Finite numbers between commas, with the range of each, which the user of the table checks.
    Numbers(fn(&mut T) -> &mut dyn Numbers, &'static [RangeInclusive<f64>]),
    /// Text with its own parser, whose error is the whole message, and its canonical texts: one for each time that the
    /// key is written.
    Other(fn(&mut T, &Entry<'_>) -> Result<(), String>, fn(&T) -> Vec<String>),
}

/// Texts of a key in a dialog.
#[derive(Clone, Copy, Debug)]
pub struct Label {
    /// Label left of a check box: the common subject of a group of check boxes.
    pub group: &'static str,
    /// Name of the value.
    pub text: &'static str,
    /// Hover text, or empty.
    pub hint: &'static str,
}

/// Numbers that one key sets together.
pub trait Numbers {
    /// Sets all; returns false, without a change, for another count.
    fn set(&mut self, numbers: &[f64]) -> bool;

    /// The numbers; empty while they are not set.
    fn get(&self) -> Vec<f64>;
}

impl Numbers for f64 {
    fn set(&mut self, numbers: &[f64]) -> bool {
        let [number] = numbers else { return false };
        *self = *number;
        true
    }

    fn get(&self) -> Vec<f64> {
        vec![*self]
    }
}

impl<const COUNT: usize> Numbers for [f64; COUNT] {
    fn set(&mut self, numbers: &[f64]) -> bool {
        numbers.try_into().map(|numbers| *self = numbers).is_ok()
    }

    fn get(&self) -> Vec<f64> {
        self.to_vec()
    }
}

impl<N: Numbers + Default> Numbers for Option<N> {
    fn set(&mut self, numbers: &[f64]) -> bool {
        let mut value = N::default();
        let fits = value.set(numbers);
        if fits {
            *self = Some(value);
        }
        fits
    }

    fn get(&self) -> Vec<f64> {
        self.as_ref().map(Numbers::get).unwrap_or_default()
    }
}

impl<T: Clone> Key<T> {
    /// Key that no dialog offers.
    pub const fn new(name: &'static str, form: &'static str, meaning: &'static str, field: Field<T>) -> Self {
        Self { name, form, meaning, field, label: None }
    }

    /// Key of an `on|off` value.
    pub const fn switch(name: &'static str, meaning: &'static str, field: fn(&mut T) -> &mut bool) -> Self {
        Self::new(name, "on|off", meaning, Field::Switch(field))
    }

    /// The same key, offered by a dialog.
    pub const fn labelled(self, group: &'static str, text: &'static str, hint: &'static str) -> Self {
        Self { label: Some(Label { group, text, hint }), ..self }
    }

    /// Sets the field from the text of a value.
    ///
    /// # Errors
    /// When the value is not accepted; the message says what was expected.
    fn read(&self, target: &mut T, entry: &Entry<'_>) -> Result<(), String> {
        let read = match &self.field {
            Field::Switch(field) => {
                let on = ["off", "on"].iter().position(|text| *text == entry.value);
                on.map(|on| *field(target) = on == 1).ok_or_else(|| "on or off".to_owned())
            }
            Field::Count(field, range) => {
                let expected = || format!("a number from {} to {}", range.start(), range.end());
                entry.number(range).map(|count| *field(target) = count).ok_or_else(expected)
            }
            Field::Factor(field, range) => {
                let expected = || format!("a factor from {} to {}", range.start(), range.end());
                entry.number(range).map(|factor| *field(target) = factor).ok_or_else(expected)
            }
            Field::Numbers(field, ranges) => {
                let count = ranges.len();
                let expected = || format!("{count} numbers after '{}=': {}", self.name, self.form);
                numbers(entry.value).filter(|numbers| field(target).set(numbers)).map(|_| ()).ok_or_else(expected)
            }
            Field::Other(read, _) => return read(target, entry),
        };
        read.map_err(|expected| entry.problem(&expected))
    }

    /// Canonical texts of the value, one for each time that the key is written.
    pub fn values(&self, of: &mut T) -> Vec<String> {
        match &self.field {
            Field::Switch(field) => vec![if *field(of) { "on" } else { "off" }.to_owned()],
            Field::Count(field, _) => vec![field(of).to_string()],
            Field::Factor(field, _) => vec![field(of).to_string()],
            Field::Numbers(field, _) => {
                let numbers = field(of).get();
                let texts: Vec<String> = numbers.iter().map(f64::to_string).collect();
                if texts.is_empty() { Vec::new() } else { vec![texts.join(",")] }
            }
            Field::Other(_, write) => write(of),
        }
    }

    /// Row of the table of keys in the documents: form, meaning, range and default, as Markdown.
    pub fn document_row(&self, standard: &T) -> String {
        let range = match &self.field {
            Field::Count(_, range) => format!("; {} to {}", range.start(), range.end()),
            Field::Factor(_, range) => format!("; {} to {}", range.start(), range.end()),
            _ => String::new(),
        };
        let default = match &self.field {
            Field::Switch(_) if self.form == "on|off" => {
                format!("; {} by default", self.values(&mut standard.clone()).concat())
            }
            Field::Count(..) => format!(", {} by default", self.values(&mut standard.clone()).concat()),
            _ => String::new(),
        };
        format!("| `{}={}` | {}{range}{default} |", self.name, self.form.replace('|', "\\|"), self.meaning)
    }
}

/// Keys with the forms of their values between commas, for help and messages: `encoder=on|off, window=N`.
pub fn key_list<T>(keys: &[Key<T>]) -> String {
    keys.iter().map(|key| format!("{}={}", key.name, key.form)).collect::<Vec<_>>().join(", ")
}

/// Sets the field that an item `key=value` names.
///
/// # Errors
/// For an item without a value, an unknown key and a value that is not accepted; the message says what was expected.
pub fn read_item<T: Clone>(keys: &[Key<T>], target: &mut T, item: &str) -> Result<(), String> {
    let no_value = || format!("'{item}' has no value, expected one of {}", key_list(keys));
    read_entry(keys, target, &Entry::parse(item).ok_or_else(no_value)?)
}

/// Sets the field that an entry names.
///
/// # Errors
/// For an unknown key and a value that is not accepted; the message says what was expected.
pub fn read_entry<T: Clone>(keys: &[Key<T>], target: &mut T, entry: &Entry<'_>) -> Result<(), String> {
    let key = keys.iter().find(|key| key.name == entry.key);
    let unknown = || format!("unknown key '{}', expected one of {}", entry.key, key_list(keys));
    key.ok_or_else(unknown)?.read(target, entry)
}

/// Items `key=value` of every value that differs from the standard one, in the order of the table.
pub fn written_items<T: Clone>(keys: &[Key<T>], of: &T, standard: &T) -> Vec<String> {
    let (mut of, mut standard) = (of.clone(), standard.clone());
    let mut items = Vec::new();
    for key in keys {
        let values = key.values(&mut of);
        if values != key.values(&mut standard) {
            items.extend(values.into_iter().map(|value| format!("{}={value}", key.name)));
        }
    }
    items
}
