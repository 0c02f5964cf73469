//! A plan's TOML text as tables whose errors state the line, the key and the allowed values.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use thiserror::Error;

use crate::files::located::{Content, Located};
use crate::text::Named;

/// Range of seeds: integers that every program that reads the tables can represent.
pub(super) const SEEDS: RangeInclusive<u64> = 0..=i64::MAX as u64;

/// Reason why a plan cannot be used.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("line {line}: {problem}")]
pub struct PlanError {
    /// Line of the text, from 1.
    pub line: usize,
    /// The key with its value, and the allowed values.
    pub problem: String,
}

pub(super) fn parse(text: &str) -> Result<Located, PlanError> {
    Located::of_toml(text).map_err(|(line, problem)| PlanError { line, problem })
}

/// A table with its path, as in `flights[2]`.
pub(super) struct Section<'a> {
    /// Path of its keys, empty for the root table.
    path: String,
    line: usize,
    table: &'a BTreeMap<String, Located>,
}

/// One value with its key.
#[derive(Clone)]
struct Entry<'a> {
    key: String,
    value: &'a Located,
}

impl<'a> Section<'a> {
    pub(super) fn root(document: &'a Located) -> Self {
        static EMPTY: BTreeMap<String, Located> = BTreeMap::new();
        Self { path: String::new(), line: document.line, table: document.mapping().unwrap_or(&EMPTY) }
    }

    /// Returns an error if there are keys other than these.
    pub(super) fn allow(&self, keys: &[&str]) -> Result<(), PlanError> {
        let unknown = self.table.iter().find(|(key, _)| !keys.contains(&key.as_str()));
        unknown.map_or(Ok(()), |(key, value)| {
            let problem = format!("unknown key '{}', expected one of {}", self.key(key), keys.join(", "));
            Err(PlanError { line: value.key_line, problem })
        })
    }

    /// Full path of a key of this table.
    fn key(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_owned() } else { format!("{}.{name}", self.path) }
    }

    pub(super) fn error(&self, problem: &str) -> PlanError {
        let place = if self.path.is_empty() { "the plan".to_owned() } else { format!("'{}'", self.path) };
        PlanError { line: self.line, problem: format!("{place} {problem}") }
    }

    pub(super) fn error_at(&self, name: &str, problem: &str) -> PlanError {
        match self.entry(name) {
            Some(entry) => entry.refuse(problem),
            None => self.error(problem),
        }
    }

    fn entry(&self, name: &str) -> Option<Entry<'a>> {
        self.table.get(name).map(|value| Entry { key: self.key(name), value })
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = &'a str> {
        self.table.keys().map(String::as_str)
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.entry(name).is_some()
    }

    /// The text of a key, `None` if the key is missing.
    pub(super) fn text(&self, name: &str) -> Result<Option<String>, PlanError> {
        self.entry(name).map(|entry| entry.text()).transpose()
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
        self.entry(name).map(|entry| entry.number(&range)).transpose()
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
        let found = match &entry.value.content {
            Content::Text(text) => from_text(text),
            Content::Number(number) => number.value.and_then(from_number),
            _ => None,
        };
        found.map(Some).ok_or_else(|| entry.expected(expected))
    }

    pub(super) fn boolean(&self, name: &str) -> Result<Option<bool>, PlanError> {
        let Some(entry) = self.entry(name) else { return Ok(None) };
        entry.value.bool().map(Some).ok_or_else(|| entry.expected("true or false"))
    }

    pub(super) fn integer(&self, name: &str, range: RangeInclusive<u64>) -> Result<Option<u64>, PlanError> {
        self.entry(name).map(|entry| entry.integer(&range)).transpose()
    }

    /// The entries of a list, each with its number (from 1) in its path.
    fn list(&self, name: &str, expected: &str) -> Result<Vec<Entry<'a>>, PlanError> {
        let Some(entry) = self.entry(name) else { return Ok(Vec::new()) };
        let values = entry.value.list().ok_or_else(|| entry.expected(expected))?;
        let numbered = values.iter().zip(1..);
        Ok(numbered.map(|(value, number)| Entry { key: format!("{}[{number}]", entry.key), value }).collect())
    }

    /// A list of texts, each parsed by `read`, whose error describes the problem.
    pub(super) fn texts<T>(&self, name: &str, read: impl Fn(&str) -> Result<T, String>) -> Result<Vec<T>, PlanError> {
        let entries = self.list(name, "a list of texts, as in [\"a\", \"b\"]")?;
        let read_one = |entry: &Entry<'_>| {
            let text = entry.text()?;
            read(&text).map_err(|problem| entry.refuse(&format!("is '{text}': {problem}")))
        };
        entries.iter().map(read_one).collect()
    }

    /// A list of integers within a range.
    pub(super) fn integers(&self, name: &str, range: RangeInclusive<u64>) -> Result<Vec<u64>, PlanError> {
        let entries = self.list(name, "a list of integers, as in [1, 2, 3]")?;
        entries.iter().map(|entry| entry.integer(&range)).collect()
    }

    pub(super) fn sections(&self, name: &str) -> Result<Vec<Self>, PlanError> {
        let expected = format!("tables, each under [[{}]]", self.key(name));
        let entries = self.list(name, &expected)?;
        entries.into_iter().map(|entry| entry.section(&expected)).collect()
    }

    pub(super) fn section(&self, name: &str) -> Result<Option<Self>, PlanError> {
        let expected = format!("a table under [{}]", self.key(name));
        self.entry(name).map(|entry| entry.section(&expected)).transpose()
    }

    /// All keys of this table with their numbers, each within a range.
    pub(super) fn numbers(&self, range: &RangeInclusive<f64>) -> Result<Vec<(String, f64)>, PlanError> {
        let number = |(key, value): (&String, &'a Located)| {
            Ok((key.clone(), Entry { key: self.key(key), value }.number(range)?))
        };
        self.table.iter().map(number).collect()
    }
}

impl<'a> Entry<'a> {
    fn refuse(&self, problem: &str) -> PlanError {
        PlanError { line: self.value.line, problem: format!("'{}' {problem}", self.key) }
    }

    /// Error for a value of the wrong type or range.
    fn expected(&self, expected: &str) -> PlanError {
        let found = match &self.value.content {
            Content::Null => "nothing".to_owned(),
            Content::Text(text) => format!("the text '{text}'"),
            Content::Number(number) => number.text.clone(),
            Content::Bool(yes) => yes.to_string(),
            Content::Time(time) => time.clone(),
            Content::List(_) => "a list".to_owned(),
            Content::Mapping(_) => "a table".to_owned(),
        };
        self.refuse(&format!("is {found}, expected {expected}"))
    }

    fn text(&self) -> Result<String, PlanError> {
        self.value.text().map(str::to_owned).ok_or_else(|| self.expected("a text in quotes"))
    }

    fn number(&self, range: &RangeInclusive<f64>) -> Result<f64, PlanError> {
        let found = self.value.number().and_then(|number| number.value).filter(|number| range.contains(number));
        found.ok_or_else(|| self.expected(&format!("a number from {} to {}", range.start(), range.end())))
    }

    fn integer(&self, range: &RangeInclusive<u64>) -> Result<u64, PlanError> {
        let found = self.value.number().and_then(|number| number.integer).filter(|number| range.contains(number));
        found.ok_or_else(|| self.expected(&format!("an integer from {} to {}", range.start(), range.end())))
    }

    fn section(self, expected: &str) -> Result<Section<'a>, PlanError> {
        let table = self.value.mapping().ok_or_else(|| self.expected(expected))?;
        Ok(Section { path: self.key, line: self.value.line, table })
    }
}
