//! The entry `KEY=VALUE` of every text on the command line, in rigs and in plans.

use std::ops::{RangeBounds, RangeInclusive};
use std::str::FromStr;

/// Every number but infinities and NaN.
pub const FINITE: RangeInclusive<f64> = f64::MIN..=f64::MAX;

/// `KEY=VALUE`, split at its first equals sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'a> {
    /// Text before the first equals sign, as written.
    pub key: &'a str,
    /// Text behind the first equals sign, as written.
    pub value: &'a str,
}

impl<'a> Entry<'a> {
    /// Entry with key and value as written; `None` without an equals sign.
    pub fn parse(text: &'a str) -> Option<Self> {
        text.split_once('=').map(|(key, value)| Self { key, value })
    }

    /// Entry without spaces around key and value.
    pub fn trimmed(self) -> Self {
        Self { key: self.key.trim(), value: self.value.trim() }
    }

    /// Value as a number; `None` for another text and outside of the range.
    pub fn number<N: FromStr + PartialOrd>(&self, range: &impl RangeBounds<N>) -> Option<N> {
        self.value.parse().ok().filter(|number| range.contains(number))
    }

    /// Error message for a value that is not one of those expected.
    pub fn problem(&self, expected: &str) -> String {
        format!("{} is '{}', expected {expected}", self.key, self.value)
    }
}

/// Items between commas; empty ones are left out.
pub fn items(text: &str) -> impl Iterator<Item = &str> {
    text.split(',').filter(|item| !item.is_empty())
}

/// Finite numbers between commas; `None` if an item is no such number.
pub fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |text: &str| text.parse().ok().filter(|number| FINITE.contains(number));
    text.split(',').map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_is_split_at_its_first_equals_sign() {
        let parse = |text| Entry::parse(text).map(|entry| (entry.key, entry.value));
        assert_eq!(parse("a=b=c"), Some(("a", "b=c")));
        assert_eq!(parse(" a = "), Some((" a ", " ")));
        assert_eq!(parse("a:b"), None);
        assert_eq!(Entry { key: " a ", value: " b" }.trimmed(), Entry { key: "a", value: "b" });
    }

    #[test]
    fn numbers_are_finite_and_within_their_range() {
        let number = |value| Entry { key: "a", value }.number(&(-1.0..=f64::MAX));
        assert_eq!((number("1e3"), number("-1"), number("-1.5")), (Some(1000.0), Some(-1.0), None));
        for text in ["inf", "nan", "", " 1", "1m"] {
            assert_eq!(number(text), None, "{text}");
        }
        assert_eq!(numbers("1,-2.5"), Some(vec![1.0, -2.5]));
        for text in ["", "1,", "1,x", "1,inf"] {
            assert_eq!(numbers(text), None, "{text}");
        }
        assert_eq!(items("a=1,,b=2").collect::<Vec<_>>(), ["a=1", "b=2"]);
    }
}
