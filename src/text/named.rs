//! Enums whose variants have fixed names.

/// Enum with one name per variant, on the command line, in rigs, in plans and in tables.
pub trait Named: Copy + PartialEq + 'static {
    /// All variants with their names, in the order of help and messages.
    const NAMES: &'static [(Self, &'static str)];

    /// Name of the variant.
    fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(value, _)| *value == self).expect("NAMES holds every variant").1
    }

    /// Variant of a name; `None` for another text.
    fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(_, known)| *known == name).map(|(value, _)| *value)
    }

    /// All variants, in the order of [`Self::NAMES`].
    fn all() -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator {
        Self::NAMES.iter().map(|(value, _)| *value)
    }

    /// Names between commas, for messages: `a, b, c`.
    fn names() -> String {
        Self::NAMES.iter().map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
    }

    /// Names as alternatives, for messages: `a, b or c`.
    fn alternatives() -> String {
        let names = Self::names();
        names.rsplit_once(", ").map(|(before, last)| format!("{before} or {last}")).unwrap_or(names)
    }
}
