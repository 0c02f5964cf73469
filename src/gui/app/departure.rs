//! Work in a session that leaving it would lose.

use serde_json::Value;

use super::open_request::OpenRequest;
use super::playing_log::PlayingLog;
use crate::gui::units::counted;

/// Keys of a saved session whose entries are stored nowhere else, each with the noun for one entry.
const WORK: [(&str, &str); 3] = [("forks", "fork"), ("breakpoints", "breakpoint"), ("markers", "marker")];

/// Destination when leaving the open session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Leaving {
    Quit,
    /// Close the log and go back to the welcome view.
    CloseLog,
    Open(OpenRequest),
}

/// Forks, breakpoints and markers of a session in saved form. Runs, layout and cursor are not included: they are easily
/// restored when the log is opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Work([Vec<Value>; 3]);

impl Work {
    /// Current work of a session.
    pub(super) fn of(log: &dyn PlayingLog) -> Self {
        log.saved(None).map(|text| Self::of_text(&text)).unwrap_or_default()
    }

    fn of_text(text: &str) -> Self {
        let value: Value = serde_json::from_str(text).unwrap_or_default();
        Self(WORK.map(|(key, _)| value.get(key).and_then(Value::as_array).cloned().unwrap_or_default()))
    }

    /// Work that a file with the work `saved` lacks, as text: "1 fork, 2 markers"; `None` if it lacks nothing.
    pub(super) fn missing_in(&self, saved: &Self) -> Option<String> {
        let counts = self.0.iter().zip(&saved.0).zip(WORK).filter_map(|((now, saved), (_, word))| {
            let count = now.iter().filter(|entry| !saved.contains(entry)).count();
            (count > 0).then(|| counted(count, word))
        });
        let text = counts.collect::<Vec<_>>().join(", ");
        (!text.is_empty()).then_some(text)
    }
}

#[derive(Debug, Default)]
pub(super) struct Departure {
    /// Work stored in the log or in the session's file.
    pub(super) saved: Work,
    /// Request that waits for the answer of the dialog.
    pub(super) asked: Option<Leaving>,
    /// True if the window may close without a question.
    pub(super) quits: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_new_entries_would_be_lost() {
        let work = |forks: &str, breakpoints: &str, markers: &str| {
            Work::of_text(&format!(
                "{{\"forks\": [{forks}], \"breakpoints\": [{breakpoints}], \"markers\": [{markers}], \"cursor_ns\": 7}}"
            ))
        };
        let saved = work("", "{\"condition\": \"frame == 3\"}", "5, 9");
        assert_eq!(saved.missing_in(&saved), None);
        assert_eq!(work("", "", "5").missing_in(&saved), None, "what was removed is still in the file");
        let more = work("{\"name\": \"a\"}", "{\"condition\": \"frame == 3\"}", "5, 6, 7, 9");
        assert_eq!(more.missing_in(&saved).as_deref(), Some("1 fork, 2 markers"));
        assert_eq!(more.missing_in(&Work::default()).as_deref(), Some("1 fork, 1 breakpoint, 4 markers"));
        assert_eq!(Work::of_text("no session").missing_in(&Work::default()), None);
    }
}
