//! Markers: instants of a log with names of the user.

use std::ops::Deref;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// Maximum number of characters of a name.
const MAX_NAME_LENGTH: usize = 80;

/// Instant of a log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "SavedMarker")]
pub struct Marker {
    /// In nanoseconds since the log began.
    pub stamp_ns: i64,
    /// One line of text without control characters; empty for a marker without a name.
    pub name: String,
}

impl Marker {
    /// A marker with the first line of `name` that fits.
    pub fn new(stamp_ns: i64, name: &str) -> Self {
        let line = name.trim().chars().map(|letter| if letter.is_control() { ' ' } else { letter });
        Self { stamp_ns, name: line.take(MAX_NAME_LENGTH).collect::<String>().trim_end().to_owned() }
    }
}

/// A marker in a file: sessions of version 1 have stamps only.
#[derive(Deserialize)]
#[serde(untagged)]
enum SavedMarker {
    Stamp(i64),
    Named {
        stamp_ns: i64,
        #[serde(default)]
        name: String,
    },
}

impl From<SavedMarker> for Marker {
    fn from(saved: SavedMarker) -> Self {
        match saved {
            SavedMarker::Stamp(stamp_ns) => Self::new(stamp_ns, ""),
            SavedMarker::Named { stamp_ns, name } => Self::new(stamp_ns, &name),
        }
    }
}

/// Markers in ascending order, one per stamp; cheap to clone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Markers(Arc<[Marker]>);

impl Markers {
    /// Markers from a list in any order; of several with one stamp the first one stays.
    pub fn new(mut markers: Vec<Marker>) -> Self {
        markers.sort_by_key(|marker| marker.stamp_ns);
        markers.dedup_by_key(|marker| marker.stamp_ns);
        Self(markers.into())
    }

    pub fn at(&self, stamp_ns: i64) -> Option<&Marker> {
        self.binary_search_by_key(&stamp_ns, |marker| marker.stamp_ns).ok().map(|index| &self[index])
    }

    /// The markers with another one, in place of one with its stamp.
    #[must_use]
    pub fn with(&self, marker: Marker) -> Self {
        Self::new(std::iter::once(marker).chain(self.iter().cloned()).collect())
    }

    #[must_use]
    pub fn without(&self, stamp_ns: i64) -> Self {
        Self::new(self.iter().filter(|marker| marker.stamp_ns != stamp_ns).cloned().collect())
    }

    /// The markers with a new one at a stamp, or without the one that is there.
    #[must_use]
    pub fn toggled(&self, stamp_ns: i64) -> Self {
        if self.at(stamp_ns).is_some() { self.without(stamp_ns) } else { self.with(Marker::new(stamp_ns, "")) }
    }

    /// Nearest marker after a stamp (`forward`), or before it.
    pub fn beside(&self, stamp_ns: i64, forward: bool) -> Option<&Marker> {
        if forward {
            self.iter().find(|marker| marker.stamp_ns > stamp_ns)
        } else {
            self.iter().rfind(|marker| marker.stamp_ns < stamp_ns)
        }
    }
}

impl Deref for Markers {
    type Target = [Marker];

    fn deref(&self) -> &[Marker] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamps(markers: &Markers) -> Vec<i64> {
        markers.iter().map(|marker| marker.stamp_ns).collect()
    }

    #[test]
    fn markers_stay_in_order_with_one_per_stamp() {
        let markers = Markers::new(vec![Marker::new(9, "turn"), Marker::new(3, ""), Marker::new(9, "other")]);
        assert_eq!((stamps(&markers), markers[1].name.as_str()), (vec![3, 9], "turn"));
        let renamed = markers.with(Marker::new(9, "roll")).toggled(5);
        assert_eq!((stamps(&renamed), renamed[2].name.as_str()), (vec![3, 5, 9], "roll"));
        assert_eq!(stamps(&renamed.toggled(3)), [5, 9]);
        assert_eq!(renamed.without(5), markers.with(Marker::new(9, "roll")));
        let beside = |forward| renamed.beside(5, forward).map(|marker| marker.stamp_ns);
        assert_eq!([beside(true), beside(false)], [Some(9), Some(3)]);
        assert_eq!((renamed.beside(9, true), renamed.beside(3, false)), (None, None));
    }

    #[test]
    fn names_are_one_short_line_and_files_of_version_1_have_none() {
        assert_eq!(Marker::new(1, " a\tb\n").name, "a b");
        assert_eq!(Marker::new(1, &"ä".repeat(500)).name.chars().count(), MAX_NAME_LENGTH);
        let read: Vec<Marker> =
            serde_json::from_str(r#"[7, {"stamp_ns": 8, "name": "x\u0007"}, {"stamp_ns": 9}]"#).unwrap();
        assert_eq!(read, [Marker::new(7, ""), Marker::new(8, "x"), Marker::new(9, "")]);
        let text = serde_json::to_string(&read[1]).unwrap();
        assert_eq!(text, r#"{"stamp_ns":8,"name":"x"}"#);
        assert!(serde_json::from_str::<Vec<Marker>>(r#"["x"]"#).is_err());
    }
}
