//! A plan's TOML text as tables whose errors state the line, the key and the allowed values.

use std::ops::{Range, RangeInclusive};

use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Range of seeds: integers that every program that reads the tables can represent.
pub(super) const SEEDS: std::ops::RangeInclusive<u64> = 0..=i64::MAX as u64;
use crate::text::Named;

/// Reason why a plan cannot be used.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("line {line}: {problem}")]
pub struct PlanError {
    /// Line of the text, from 1.
    pub line: usize,
    /// The key with its value, and the allowed values.
    pub problem: String,
}

/// Line number of a byte, from 1.
fn line_of(text: &str, byte: usize) -> usize {
    1 + text.as_bytes().iter().take(byte).filter(|byte| **byte == b'\n').count()
}

pub(super) fn parse(text: &str) -> Result<Spanned<DeTable<'_>>, PlanError> {
    DeTable::parse(text).map_err(|error| PlanError {
        line: error.span().map_or(1, |span| line_of(text, span.start)),
        problem: format!("invalid TOML: {}", error.message().replace('\n', "; ")),
    })
}

/// A table with its path, as in `flights[2]`.
pub(super) struct Section<'a> {
    text: &'a str,
    /// Path of its keys, empty for the root table.
    path: String,
    span: Range<usize>,
    table: &'a DeTable<'a>,
}

/// One value with its key.
#[derive(Clone)]
struct Entry<'a> {
    key: String,
    value: &'a Spanned<DeValue<'a>>,
}

impl<'a> Section<'a> {
    pub(super) fn root(text: &'a str, table: &'a Spanned<DeTable<'a>>) -> Self {
        Self { text, path: String::new(), span: table.span(), table: table.get_ref() }
    }

    /// Returns an error if there are keys other than these.
    pub(super) fn allow(&self, keys: &[&str]) -> Result<(), PlanError> {
        let unknown = self.table.keys().find(|key| !keys.contains(&key.get_ref().as_ref()));
        unknown.map_or(Ok(()), |key| {
            let line = line_of(self.text, key.span().start);
            let name = self.key(key.get_ref());
            Err(PlanError { line, problem: format!("unknown key '{name}', expected one of {}", keys.join(", ")) })
        })
    }

    /// Full path of a key of this table.
    fn key(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
    }

    pub(super) fn error(&self, problem: &str) -> PlanError {
        let place = if self.path.is_empty() { "the plan".to_owned() } else { format!("'{}'", self.path) };
        PlanError { line: line_of(self.text, self.span.start), problem: format!("{place} {problem}") }
    }

    pub(super) fn error_at(&self, name: &str, problem: &str) -> PlanError {
        match self.entry(name) {
            Some(entry) => self.refuse(&entry, problem),
            None => self.error(problem),
        }
    }

    fn refuse(&self, entry: &Entry<'_>, problem: &str) -> PlanError {
        let line = line_of(self.text, entry.value.span().start);
        PlanError { line, problem: format!("'{}' {problem}", entry.key) }
    }

    /// Error for a value of the wrong type or range.
    fn expected(&self, entry: &Entry<'_>, expected: &str) -> PlanError {
        let found = match entry.value.get_ref() {
            DeValue::String(text) => format!("the text '{text}'"),
            DeValue::Integer(number) => number.to_string(),
            DeValue::Float(number) => number.to_string(),
            DeValue::Boolean(yes) => yes.to_string(),
            DeValue::Datetime(time) => time.to_string(),
            DeValue::Array(_) => "a list".to_owned(),
            DeValue::Table(_) => "a table".to_owned(),
        };
        self.refuse(entry, &format!("is {found}, expected {expected}"))
    }

    fn entry(&self, name: &str) -> Option<Entry<'a>> {
        let (_, value) = self.table.iter().find(|(key, _)| key.get_ref() == name)?;
        Some(Entry { key: self.key(name), value })
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = &'a str> {
        self.table.keys().map(|key| key.get_ref().as_ref())
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.entry(name).is_some()
    }

    /// The text of a key, `None` if the key is missing.
    pub(super) fn text(&self, name: &str) -> Result<Option<String>, PlanError> {
        self.entry(name).map(|entry| self.text_of(&entry)).transpose()
    }

    fn text_of(&self, entry: &Entry<'_>) -> Result<String, PlanError> {
        match entry.value.get_ref() {
            DeValue::String(text) => Ok(text.to_string()),
            _ => Err(self.expected(entry, "a text in quotes")),
        }
    }

    /// The text of a mandatory key.
    pub(super) fn required_text(&self, name: &str) -> Result<String, PlanError> {
        self.text(name)?.ok_or_else(|| self.error(&format!("lacks the key '{name}'")))
    }

    /// Value of an enum by its name.
    pub(super) fn named<N: Named>(&self, name: &str) -> Result<Option<N>, PlanError> {
        let Some(text) = self.text(name)? else { return Ok(None) };
        let unknown = || self.error_at(name, &format!("is '{text}', expected {}", N::alternatives()));
        N::from_name(&text).map(Some).ok_or_else(unknown)
    }

    /// A number within a range; integers are accepted as well.
    pub(super) fn number(&self, name: &str, range: RangeInclusive<f64>) -> Result<Option<f64>, PlanError> {
        self.entry(name).map(|entry| self.number_of(&entry, &range)).transpose()
    }

    fn number_of(&self, entry: &Entry<'_>, range: &RangeInclusive<f64>) -> Result<f64, PlanError> {
        let found = match entry.value.get_ref() {
            DeValue::Float(number) => number.as_str().parse().ok(),
            DeValue::Integer(number) if number.radix() == 10 => number.as_str().parse().ok(),
            _ => None,
        };
        found
            .filter(|number| range.contains(number))
            .ok_or_else(|| self.expected(entry, &format!("a number from {} to {}", range.start(), range.end())))
    }

    /// A number, or a text that `read` parses.
    pub(super) fn number_or<T>(
        &self,
        name: &str,
        from_number: impl Fn(f64) -> Option<T>,
        from_text: impl Fn(&str) -> Option<T>,
        expected: &str,
    ) -> Result<Option<T>, PlanError> {
        let Some(entry) = self.entry(name) else { return Ok(None) };
        let found = match entry.value.get_ref() {
            DeValue::String(text) => from_text(text),
            DeValue::Float(number) => number.as_str().parse().ok().and_then(from_number),
            DeValue::Integer(number) => number.as_str().parse().ok().and_then(from_number),
            _ => None,
        };
        found.map(Some).ok_or_else(|| self.expected(&entry, expected))
    }

    pub(super) fn boolean(&self, name: &str) -> Result<Option<bool>, PlanError> {
        let Some(entry) = self.entry(name) else { return Ok(None) };
        match entry.value.get_ref() {
            DeValue::Boolean(yes) => Ok(Some(*yes)),
            _ => Err(self.expected(&entry, "true or false")),
        }
    }

    pub(super) fn integer(&self, name: &str, range: RangeInclusive<u64>) -> Result<Option<u64>, PlanError> {
        self.entry(name).map(|entry| self.integer_of(&entry, &range)).transpose()
    }

    fn integer_of(&self, entry: &Entry<'_>, range: &RangeInclusive<u64>) -> Result<u64, PlanError> {
        let found = match entry.value.get_ref() {
            DeValue::Integer(number) => u64::from_str_radix(number.as_str(), number.radix()).ok(),
            _ => None,
        };
        found
            .filter(|number| range.contains(number))
            .ok_or_else(|| self.expected(entry, &format!("an integer from {} to {}", range.start(), range.end())))
    }

    /// The entries of a list, each with its number (from 1) in its path.
    fn list(&self, name: &str, expected: &str) -> Result<Vec<Entry<'a>>, PlanError> {
        let Some(entry) = self.entry(name) else { return Ok(Vec::new()) };
        let DeValue::Array(values) = entry.value.get_ref() else { return Err(self.expected(&entry, expected)) };
        let numbered = values.iter().zip(1..);
        Ok(numbered.map(|(value, number)| Entry { key: format!("{}[{number}]", entry.key), value }).collect())
    }

    /// A list of texts, each parsed by `read`, whose error describes the problem.
    pub(super) fn texts<T>(&self, name: &str, read: impl Fn(&str) -> Result<T, String>) -> Result<Vec<T>, PlanError> {
        let entries = self.list(name, "a list of texts, as in [\"a\", \"b\"]")?;
        let read_one = |entry: &Entry<'_>| {
            let text = self.text_of(entry)?;
            read(&text).map_err(|problem| self.refuse(entry, &format!("is '{text}': {problem}")))
        };
        entries.iter().map(read_one).collect()
    }

    /// A list of integers within a range.
    pub(super) fn integers(&self, name: &str, range: RangeInclusive<u64>) -> Result<Vec<u64>, PlanError> {
        let entries = self.list(name, "a list of integers, as in [1, 2, 3]")?;
        entries.iter().map(|entry| self.integer_of(entry, &range)).collect()
    }

    pub(super) fn sections(&self, name: &str) -> Result<Vec<Self>, PlanError> {
        let expected = format!("tables, each under [[{}]]", self.key(name));
        let entries = self.list(name, &expected)?;
        entries.iter().map(|entry| self.section_of(entry, &expected)).collect()
    }

    pub(super) fn section(&self, name: &str) -> Result<Option<Self>, PlanError> {
        let expected = format!("a table under [{}]", self.key(name));
        self.entry(name).map(|entry| self.section_of(&entry, &expected)).transpose()
    }

    fn section_of(&self, entry: &Entry<'a>, expected: &str) -> Result<Self, PlanError> {
        let DeValue::Table(table) = entry.value.get_ref() else { return Err(self.expected(entry, expected)) };
        Ok(Self { text: self.text, path: entry.key.clone(), span: entry.value.span(), table })
    }

    /// All keys of this table with their numbers, each within a range.
    pub(super) fn numbers(&self, range: &RangeInclusive<f64>) -> Result<Vec<(String, f64)>, PlanError> {
        let entries = self.table.iter().map(|(key, value)| (key.get_ref(), value));
        entries
            .map(|(key, value)| {
                let entry = Entry { key: self.key(key), value };
                Ok((key.to_string(), self.number_of(&entry, range)?))
            })
            .collect()
    }
}
