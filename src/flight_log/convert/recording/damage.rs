use crate::text::counted;

/// Skipped bytes of an autopilot's log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Damage {
    skipped_bytes: usize,
    /// Number of places at which bytes were skipped.
    places: usize,
    /// Position of the first place.
    first_at: usize,
    /// Number of bytes at the end that form no complete record.
    cut_bytes: usize,
}

impl Damage {
    /// Counts skipped bytes at a position.
    pub(super) fn skip(&mut self, at: usize, bytes: usize) {
        if self.places == 0 {
            self.first_at = at;
        }
        self.places += 1;
        self.skipped_bytes += bytes;
    }

    /// Counts truncated bytes at the end.
    pub(super) fn cut(&mut self, bytes: usize) {
        self.cut_bytes += bytes;
    }

    /// Notes for a report: `skipped` describes the skipped bytes, `cut` the loss of a number of bytes at the end.
    pub(super) fn notes(&self, skipped: &str, cut: impl FnOnce(usize) -> String) -> Vec<String> {
        let mut notes = Vec::new();
        if self.skipped_bytes > 0 {
            notes.push(format!(
                "{} bytes at {}, the first at byte {}, {skipped} and are skipped",
                self.skipped_bytes,
                counted(self.places, "place"),
                self.first_at
            ));
        }
        if self.cut_bytes > 0 {
            notes.push(cut(self.cut_bytes));
        }
        notes
    }
}
