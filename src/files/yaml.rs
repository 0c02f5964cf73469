//! Numbers and names as YAML scalars, and the head of YAML files of `OpenCV`.

use std::borrow::Cow;

/// Shortest decimal that reads back as the same number, in the notation of YAML 1.1 (`PyYAML`), which requires a
/// point before an exponent, and a sign in it.
pub fn number(value: f64) -> String {
    let written = format!("{value:?}");
    let Some((mantissa, exponent)) = written.split_once('e') else { return written };
    let point = if mantissa.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{mantissa}{point}e{sign}{exponent}")
}

/// The text of a YAML file with the first line of `OpenCV`'s files, `%YAML:1.0`, which is no directive of YAML, as a comment,
/// so that lines keep their numbers.
pub(crate) fn without_opencv_head(text: &str) -> Cow<'_, str> {
    text.strip_prefix("%YAML:").map_or(Cow::Borrowed(text), |rest| Cow::Owned(format!("#{rest}")))
}

/// Numbers as a YAML list in brackets.
pub fn numbers(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", "))
}

/// Plain scalar if YAML reads it as a string, else a quoted one.
pub fn text(value: &str) -> String {
    let plain = value.starts_with(|first: char| first.is_ascii_alphabetic() || first == '/')
        && value.chars().all(|letter| letter.is_ascii_alphanumeric() || "/_-.".contains(letter))
        && !["true", "false", "null", "yes", "no", "on", "off", "y", "n"]
            .contains(&value.to_ascii_lowercase().as_str());
    if plain { value.to_owned() } else { serde_json::Value::from(value).to_string() }
}
