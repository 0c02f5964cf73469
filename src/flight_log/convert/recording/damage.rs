/// What was skipped of an autopilot's log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Damage {
    skipped_bytes: usize,
    /// Places at which bytes were skipped.
    places: u64,
    /// The first of them.
    first_at: usize,
    /// Bytes at the end that are nothing whole.
    cut_bytes: usize,
}

impl Damage {
    /// Counts bytes that are skipped from a position on.
    pub(super) fn skip(&mut self, at: usize, bytes: usize) {
        if self.places == 0 {
            self.first_at = at;
        }
        self.places += 1;
        self.skipped_bytes += bytes;
    }

    /// Counts bytes at the end that are cut off.
    pub(super) fn cut(&mut self, bytes: usize) {
        self.cut_bytes += bytes;
    }

    /// The notes of a report: `skipped` says what the skipped bytes are not, `cut` that a number of bytes at the end is lost.
    pub(super) fn notes(&self, skipped: &str, cut: impl FnOnce(usize) -> String) -> Vec<String> {
        let mut notes = Vec::new();
        if self.skipped_bytes > 0 {
            notes.push(format!(
                "{} bytes at {} places, the first at byte {}, {skipped} and are skipped",
                self.skipped_bytes, self.places, self.first_at
            ));
        }
        if self.cut_bytes > 0 {
            notes.push(cut(self.cut_bytes));
        }
        notes
    }
}
