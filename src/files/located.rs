//! Documents in YAML and TOML as trees of values with the lines of their keys.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use toml::de::{DeTable, DeValue};

/// Value of a document.
#[derive(Clone, Debug)]
pub(crate) struct Located {
    /// Line of the value's key, of the item itself in a list; from 1, 0 if unknown.
    pub(crate) key_line: usize,
    /// Line of the value itself.
    pub(crate) line: usize,
    pub(crate) content: Content,
}

#[derive(Clone, Debug)]
pub(crate) enum Content {
    Null,
    Bool(bool),
    Number(Number),
    Text(String),
    /// A time of TOML.
    Time(String),
    List(Vec<Located>),
    Mapping(BTreeMap<String, Located>),
}

/// Number with its digits as messages show them.
#[derive(Clone, Debug)]
pub(crate) struct Number {
    pub(crate) text: String,
    /// `None` for an integer of TOML that is not decimal.
    pub(crate) value: Option<f64>,
    /// `None` for a float and for an integer outside of the range.
    pub(crate) integer: Option<u64>,
}

impl Located {
    /// Parses a document in YAML.
    pub(crate) fn of_yaml(text: &str) -> Result<Self, serde_saphyr::Error> {
        let content = serde_saphyr::from_str(text)?;
        Ok(Self { key_line: 0, line: 1, content })
    }

    /// Parses a document in TOML; an error is its line and the problem.
    pub(crate) fn of_toml(text: &str) -> Result<Self, (usize, String)> {
        let table = DeTable::parse(text).map_err(|error| {
            let line = error.span().map_or(1, |span| line_of(text, span.start));
            (line, format!("invalid TOML: {}", error.message().replace('\n', "; ")))
        })?;
        let line = line_of(text, table.span().start);
        Ok(Self { key_line: 0, line, content: Content::of_table(text, table.get_ref()) })
    }

    /// Mapping of texts that stand in no file.
    pub(crate) fn of_texts<'a>(entries: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let located = |content| Self { key_line: 0, line: 0, content };
        let entry = |(key, text): (&str, &str)| (key.to_owned(), located(Content::Text(text.to_owned())));
        located(Content::Mapping(entries.into_iter().map(entry).collect()))
    }

    /// Value of a key of this mapping, null or not.
    pub(crate) fn get(&self, key: &str) -> Option<&Self> {
        self.mapping()?.get(key)
    }

    pub(crate) fn mapping(&self) -> Option<&BTreeMap<String, Self>> {
        if let Content::Mapping(mapping) = &self.content { Some(mapping) } else { None }
    }

    pub(crate) fn list(&self) -> Option<&[Self]> {
        if let Content::List(items) = &self.content { Some(items) } else { None }
    }

    pub(crate) fn text(&self) -> Option<&str> {
        if let Content::Text(text) = &self.content { Some(text) } else { None }
    }

    pub(crate) fn bool(&self) -> Option<bool> {
        if let Content::Bool(value) = self.content { Some(value) } else { None }
    }

    pub(crate) fn number(&self) -> Option<&Number> {
        if let Content::Number(number) = &self.content { Some(number) } else { None }
    }

    pub(crate) fn is_null(&self) -> bool {
        matches!(self.content, Content::Null)
    }
}

/// Line of a byte of a text, from 1.
fn line_of(text: &str, byte: usize) -> usize {
    1 + text.as_bytes().iter().take(byte).filter(|byte| **byte == b'\n').count()
}

impl Content {
    fn of_table(text: &str, table: &DeTable<'_>) -> Self {
        let entry = |(key, value): (&toml::Spanned<_>, &toml::Spanned<DeValue<'_>>)| {
            let (key_line, line) = (line_of(text, key.span().start), line_of(text, value.span().start));
            (key.to_string(), Located { key_line, line, content: Self::of_toml(text, value.get_ref()) })
        };
        Self::Mapping(table.iter().map(|(key, value)| entry((key, value))).collect())
    }

    fn of_toml(text: &str, value: &DeValue<'_>) -> Self {
        match value {
            DeValue::String(text) => Self::Text(text.to_string()),
            DeValue::Integer(number) => Self::Number(Number {
                text: number.to_string(),
                value: (number.radix() == 10).then(|| number.as_str().parse().ok()).flatten(),
                integer: u64::from_str_radix(number.as_str(), number.radix()).ok(),
            }),
            DeValue::Float(number) => {
                Self::Number(Number { text: number.to_string(), value: number.as_str().parse().ok(), integer: None })
            }
            DeValue::Boolean(value) => Self::Bool(*value),
            DeValue::Datetime(time) => Self::Time(time.to_string()),
            DeValue::Array(items) => {
                let item = |item: &toml::Spanned<DeValue<'_>>| {
                    let line = line_of(text, item.span().start);
                    Located { key_line: line, line, content: Self::of_toml(text, item.get_ref()) }
                };
                Self::List(items.iter().map(item).collect())
            }
            DeValue::Table(table) => Self::of_table(text, table),
        }
    }

    fn of_number(text: &impl ToString, value: f64) -> Self {
        if !value.is_finite() {
            return Self::Null;
        }
        Self::Number(Number { text: text.to_string(), value: Some(value), integer: None })
    }
}

impl<'de> Deserialize<'de> for Content {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ContentVisitor)
    }
}

struct ContentVisitor;

impl<'de> Visitor<'de> for ContentVisitor {
    type Value = Content;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Content, E> {
        Ok(Content::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Content, E> {
        Ok(Content::of_number(&value, value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Content, E> {
        Ok(Content::of_number(&value, value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Content, E> {
        Ok(Content::of_number(&serde_json::Value::from(value), value))
    }

    fn visit_str<E>(self, text: &str) -> Result<Content, E> {
        Ok(Content::Text(text.to_owned()))
    }

    fn visit_unit<E>(self) -> Result<Content, E> {
        Ok(Content::Null)
    }

    fn visit_none<E>(self) -> Result<Content, E> {
        Ok(Content::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Content, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element::<serde_saphyr::Spanned<Content>>()? {
            let line = item.referenced.line() as usize;
            list.push(Located { key_line: line, line, content: item.value });
        }
        Ok(Content::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Content, A::Error> {
        type Spanned<T> = serde_saphyr::Spanned<T>;
        let mut mapping = BTreeMap::new();
        while let Some((key, value)) = entries.next_entry::<Spanned<String>, Spanned<Content>>()? {
            let (key_line, line) = (key.referenced.line() as usize, value.referenced.line() as usize);
            mapping.insert(key.value, Located { key_line, line, content: value.value });
        }
        Ok(Content::Mapping(mapping))
    }
}
