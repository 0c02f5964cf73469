//! Work in a session that leaving it would lose.

use std::path::PathBuf;

use serde_json::Value;

use super::playing_log::PlayingLog;
use crate::gui::units::counted;

/// The keys of a saved session whose entries exist nowhere else, with the word for one of them.
const WORK: [(&str, &str); 3] = [("forks", "fork"), ("breakpoints", "breakpoint"), ("markers_ns", "marker")];

/// Where the user goes from the open session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Leaving {
    /// Quit the program.
    Quit,
    /// Close the log and go back to the welcome view.
    CloseLog,
    /// Open another log.
    Open(PathBuf),
}

/// The forks, breakpoints and markers of a session as they are saved. Runs, layout and cursor are not part of it: a
/// log has them again in a moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Work([Vec<Value>; 3]);

impl Work {
    /// The work in a session now.
    pub(super) fn of(log: &dyn PlayingLog) -> Self {
        log.saved(None).map(|text| Self::of_text(&text)).unwrap_or_default()
    }

    fn of_text(text: &str) -> Self {
        let value: Value = serde_json::from_str(text).unwrap_or_default();
        Self(WORK.map(|(key, _)| value.get(key).and_then(Value::as_array).cloned().unwrap_or_default()))
    }

    /// What a file with the work `saved` lacks, as text: "1 fork, 2 markers"; `None` if it lacks nothing.
    pub(super) fn missing_in(&self, saved: &Self) -> Option<String> {
        let counts = self.0.iter().zip(&saved.0).zip(WORK).filter_map(|((now, saved), (_, word))| {
            let count = now.iter().filter(|entry| !saved.contains(entry)).count();
            (count > 0).then(|| counted(count, word))
        });
        let text = counts.collect::<Vec<_>>().join(", ");
        (!text.is_empty()).then_some(text)
    }
}

/// The state of leaving.
#[derive(Debug, Default)]
pub(super) struct Departure {
    /// The work that is in the log or in the session's file.
    pub(super) saved: Work,
    /// Where the user goes after the answer of the dialog.
    pub(super) asked: Option<Leaving>,
    /// Whether the window may close without a question.
    pub(super) quits: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_new_entries_would_be_lost() {
        let work = |forks: &str, breakpoints: &str, markers: &str| {
            Work::of_text(&format!(
                "{{\"forks\": [{forks}], \"breakpoints\": [{breakpoints}], \"markers_ns\": [{markers}], \"cursor_ns\": 7}}"
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
