//! Text of a rig file as a tree of values, with the lines of its fields.

use std::fmt;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;
use serde_saphyr::{Error, Spanned};

use super::super::LogError;
use super::super::text::shortened;
use super::super::text::without_bom;
use super::fields::Field;
use super::indentation;

/// Largest rig file in bytes; the rig of 16 links and 16 cameras takes 16 kB.
const MAX_RIG_BYTES: u64 = 1 << 20;

/// Parsed rig file.
#[derive(Clone, Debug)]
pub(super) struct Document {
    pub(super) value: Value,
    pub(super) file: PathBuf,
    text: String,
}

impl Document {
    /// Reads and parses a file.
    pub(super) fn read(path: &Path) -> Result<Self, LogError> {
        let failed = |source| LogError::Io { action: "read the rig", source, path: path.to_owned() };
        let file = std::fs::File::open(path).map_err(failed)?;
        let mut bytes = Vec::new();
        file.take(MAX_RIG_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
        Self::from_bytes(bytes, path)
    }

    /// Parses the bytes of a file or an attachment.
    pub(super) fn from_bytes(bytes: Vec<u8>, file: &Path) -> Result<Self, LogError> {
        let syntax = |problem: String| LogError::RigSyntax { problem, path: file.to_owned() };
        if bytes.len() as u64 > MAX_RIG_BYTES {
            return Err(syntax(format!("more than {MAX_RIG_BYTES} bytes, expected a rig of some kilobytes")));
        }
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid = error.utf8_error().valid_up_to();
            let line = error.as_bytes()[..valid].split(|byte| *byte == b'\n').count();
            syntax(format!("line {line}: byte {valid} is not UTF-8, expected a text file"))
        })?;
        Self::parse(without_bom(&text).to_owned(), file)
    }

    pub(super) fn parse(text: String, file: &Path) -> Result<Self, LogError> {
        indentation::check(&text, file)?;
        match serde_saphyr::from_str(&text) {
            Ok(value) => Ok(Self { value, file: file.to_owned(), text }),
            Err(error) => Err(LogError::RigSyntax { problem: syntax_problem(&error, &text), path: file.to_owned() }),
        }
    }

    pub(super) fn root(&self) -> Field<'_> {
        Field::root(&self.value, &self.file)
    }

    /// Adds the line of its field to an error about a field of this document.
    pub(super) fn with_line(&self, error: LogError) -> LogError {
        match error {
            LogError::Rig { field, problem, path } if path == self.file => {
                let line = self.line_of(&field);
                let problem = line.map_or_else(|| problem.clone(), |line| format!("{problem}, line {line}"));
                LogError::Rig { field, problem, path }
            }
            error => error,
        }
    }

    /// Line of a field by its path, `gimbal.links[0].alpha`; for a missing field, that of its mapping.
    fn line_of(&self, field: &str) -> Option<u64> {
        let mut place: Spanned<Located> = serde_saphyr::from_str(&self.text).ok()?;
        let mut line = None;
        for step in field.split('.') {
            let (key, indices) = step.split_once('[').map_or((step, ""), |(key, indices)| (key, indices));
            let Some((at, next)) = place.value.take_field(key) else { break };
            line = Some(at);
            place = next;
            for index in indices.split('[') {
                let Some(index) = index.trim_end_matches(']').parse::<usize>().ok() else { break };
                let Some(next) = place.value.take_item(index) else { break };
                line = Some(next.referenced.line());
                place = next;
            }
        }
        line.filter(|line| *line > 0)
    }
}

/// Value of a document, reduced to its location.
enum Located {
    Scalar,
    List(Vec<Spanned<Self>>),
    Mapping(Vec<(Spanned<String>, Spanned<Self>)>),
}

impl Located {
    /// Line of a key, and its value.
    fn take_field(&mut self, key: &str) -> Option<(u64, Spanned<Self>)> {
        let Self::Mapping(fields) = self else { return None };
        let index = fields.iter().position(|(name, _)| name.value == key)?;
        let (name, value) = fields.swap_remove(index);
        Some((name.referenced.line(), value))
    }

    fn take_item(&mut self, index: usize) -> Option<Spanned<Self>> {
        let Self::List(items) = self else { return None };
        (index < items.len()).then(|| items.swap_remove(index))
    }
}

impl<'de> Deserialize<'de> for Located {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(LocatedVisitor)
    }
}

struct LocatedVisitor;

impl<'de> Visitor<'de> for LocatedVisitor {
    type Value = Located;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_bool<E>(self, _: bool) -> Result<Located, E> {
        Ok(Located::Scalar)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Located, E> {
        Ok(Located::Scalar)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Located, E> {
        Ok(Located::Scalar)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Located, E> {
        Ok(Located::Scalar)
    }

    fn visit_str<E>(self, _: &str) -> Result<Located, E> {
        Ok(Located::Scalar)
    }

    fn visit_unit<E>(self) -> Result<Located, E> {
        Ok(Located::Scalar)
    }

    fn visit_none<E>(self) -> Result<Located, E> {
        Ok(Located::Scalar)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Located, D::Error> {
        Located::deserialize(deserializer)
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, deserializer: D) -> Result<Located, D::Error> {
        IgnoredAny::deserialize(deserializer).map(|_| Located::Scalar)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Located, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Located::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Located, A::Error> {
        let mut mapping = Vec::new();
        while let Some(entry) = entries.next_entry()? {
            mapping.push(entry);
        }
        Ok(Located::Mapping(mapping))
    }
}

/// Describes a syntax error by line, field, found and expected text.
fn syntax_problem(error: &Error, text: &str) -> String {
    let location = error.location().filter(|location| location.line() > 0);
    let Some(location) = location else { return "expected a mapping with rig_version, imu0, cam0, …".to_owned() };
    // Errors at the end of the text are reported after the last line.
    let count = text.lines().count() as u64;
    let line = location.line().clamp(1, count.max(1));
    let unclosed = |open, close| line_of_unclosed(text, open, close);
    let (list, mapping) = (unclosed('[', ']'), unclosed('{', '}'));
    // The parser stops after the line that lacks a bracket.
    let line = list.or(mapping).map_or(line, |unclosed| unclosed.min(line));
    let found = text.lines().nth(line as usize - 1).unwrap_or_default();
    let field = field_at(text, line as usize - 1).map(|field| format!(", in {field}")).unwrap_or_default();
    let what = match error.without_snippet() {
        Error::DuplicateMappingKey { .. } => "the key is repeated, expected each key once",
        Error::MultipleDocuments { .. } => "a second document ('---'), expected one",
        Error::Eof { .. } => "the text ends here, expected a mapping with rig_version, imu0, cam0, …",
        Error::Budget { .. } => "too many values or aliases, expected a rig of some kilobytes",
        _ if found.trim_start_matches(' ').starts_with('\t') => "a tab, expected spaces before a key",
        _ if list.is_some() => "a list '[' without its ']', expected [value, value, …]",
        _ if mapping.is_some() => "a mapping '{' without its '}', expected {key: value, …}",
        _ if unclosed_quote(found) => "a quote that is not closed",
        _ if !found.contains(':') && !found.trim_start().starts_with('-') => "no 'key: value', expected one",
        _ => "expected 'key: value', with the keys of one mapping indented by the same number of spaces",
    };
    format!("line {line}{field}: '{}': {what}", shortened(found.trim(), 60))
}

/// Line of the last unclosed bracket, comments aside.
fn line_of_unclosed(text: &str, open: char, close: char) -> Option<u64> {
    let mut lines: Vec<u64> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        for letter in line.split(" #").next().unwrap_or_default().chars() {
            if letter == open {
                lines.push(number);
            } else if letter == close {
                lines.pop();
            }
        }
    }
    lines.pop()
}

fn unclosed_quote(line: &str) -> bool {
    ['"', '\''].into_iter().any(|quote| line.matches(quote).count() % 2 == 1)
}

/// Path of the field of a line, by the indentation of the keys above it.
fn field_at(text: &str, line: usize) -> Option<String> {
    let lines: Vec<&str> = text.lines().take(line + 1).collect();
    let mut keys: Vec<&str> = Vec::new();
    let mut depth = usize::MAX;
    for line in lines.iter().rev() {
        let content = line.trim_start_matches([' ', '-']);
        let indentation = line.len() - content.len();
        let Some((key, _)) = content.split_once(':') else { continue };
        let is_key = !key.is_empty() && key.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
        if is_key && indentation < depth {
            depth = indentation;
            keys.push(key);
        }
    }
    keys.reverse();
    (!keys.is_empty()).then(|| keys.join("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(text: &str) -> Document {
        Document::parse(text.to_owned(), Path::new("some.rig.yaml")).unwrap()
    }

    #[test]
    fn fields_have_lines() {
        let document = document(
            "rig_version: 1\nimu0: {rostopic: /imu,\n       update_rate: 200}\ngimbal:\n  links:\n  - joint: yaw\n    d: 1\n  \
             - joint: roll\n    alpha: 2\n",
        );
        let check = |field: &str, line: Option<u64>| assert_eq!(document.line_of(field), line, "{field}");
        check("rig_version", Some(1));
        check("imu0.update_rate", Some(3));
        check("gimbal.links[0].d", Some(7));
        check("gimbal.links[1].alpha", Some(9));
        // A missing field is reported at its mapping.
        check("gimbal.links[1].limits", Some(8));
        check("imu0.frame_id", Some(2));
        check("cam0", None);
    }

    #[test]
    fn syntax_errors_name_line_field_and_expectation() {
        let check = |text: &str, expected: &str| {
            let error = Document::parse(text.to_owned(), Path::new("some.rig.yaml")).unwrap_err().to_string();
            assert_eq!(error, format!("the rig is not valid YAML: {expected}: some.rig.yaml"), "{text}");
        };
        check(
            "rig_version: 1\ncam0:\n  intrinsics: [1, 2\n",
            "line 3, in cam0.intrinsics: 'intrinsics: [1, 2': a list '[' without its ']', expected [value, value, …]",
        );
        check(
            "cam0:\n  intrinsics: [1, 2\n  distortion_model: none\n  resolution: [3, 4]\n",
            "line 2, in cam0.intrinsics: 'intrinsics: [1, 2': a list '[' without its ']', expected [value, value, …]",
        );
        check(
            "imu0:\n  rostopic: /imu\n  rostopic: /imu\n",
            "line 3, in imu0.rostopic: 'rostopic: /imu': the key is repeated, expected each key once",
        );
    }
}
