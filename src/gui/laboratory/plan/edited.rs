//! A motion that is edited, with undo.

use crate::observability::laboratory::{MotionLimits, move_point};
use crate::simulation::MotionSplines;

/// Maximum number of changes that can be undone.
const MAX_CHANGES: usize = 100;

/// The motion with its earlier states.
#[derive(Clone, Debug)]
pub(super) struct EditedMotion {
    origin: MotionSplines,
    current: MotionSplines,
    /// States before each change, oldest first.
    before: Vec<MotionSplines>,
    undone: Vec<MotionSplines>,
    held: Option<HeldPoint>,
}

/// Control value that is being moved.
#[derive(Clone, Debug)]
struct HeldPoint {
    /// Channel and control value.
    place: (usize, usize),
    /// Motion before the move.
    base: MotionSplines,
}

impl EditedMotion {
    pub(super) fn new(motion: MotionSplines) -> Self {
        Self { origin: motion.clone(), current: motion, before: Vec::new(), undone: Vec::new(), held: None }
    }

    pub(super) fn current(&self) -> &MotionSplines {
        &self.current
    }

    /// Channel and control value that is being moved.
    pub(super) fn held(&self) -> Option<(usize, usize)> {
        self.held.as_ref().map(|held| held.place)
    }

    /// Begins to move a control value of a channel.
    pub(super) fn hold(&mut self, place: (usize, usize)) {
        self.held = Some(HeldPoint { place, base: self.current.clone() });
    }

    /// Moves the curve at the held control value by a change since [`Self::hold`].
    pub(super) fn drag(&mut self, limits: &MotionLimits, change: f64, width_s: f64) {
        if let Some(HeldPoint { place, base }) = &self.held {
            let mut moved = base.clone();
            move_point(&mut moved, limits, *place, change, width_s);
            self.current = moved;
        }
    }

    /// Ends a move, which is one change.
    pub(super) fn release(&mut self) {
        if let Some(held) = self.held.take() {
            self.record(held.base);
        }
    }

    /// Shows a motion of a search in progress, without recording it as a change.
    pub(super) fn preview(&mut self, motion: MotionSplines) {
        self.current = motion;
    }

    /// Replaces the motion; one change together with everything since `before`.
    pub(super) fn replace_since(&mut self, before: MotionSplines, motion: MotionSplines) {
        self.held = None;
        self.current = motion;
        self.record(before);
    }

    fn record(&mut self, before: MotionSplines) {
        if before == self.current {
            return;
        }
        self.before.push(before);
        self.undone.clear();
        if self.before.len() > MAX_CHANGES {
            self.before.remove(0);
        }
    }

    /// Replaces the motion by the one with which the editing began.
    pub(super) fn reset(&mut self) {
        self.replace_since(self.current.clone(), self.origin.clone());
    }

    pub(super) fn undo(&mut self) {
        if let Some(before) = self.before.pop() {
            self.undone.push(std::mem::replace(&mut self.current, before));
        }
    }

    pub(super) fn redo(&mut self) {
        if let Some(after) = self.undone.pop() {
            self.before.push(std::mem::replace(&mut self.current, after));
        }
    }

    pub(super) fn can_undo(&self) -> bool {
        !self.before.is_empty()
    }

    pub(super) fn can_redo(&self) -> bool {
        !self.undone.is_empty()
    }

    pub(super) fn is_changed(&self) -> bool {
        self.current != self.origin
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observability::laboratory::EnteredLimits;

    fn limits() -> MotionLimits {
        EnteredLimits::SLOW.of_joints(vec![(-1.0, 1.0)])
    }

    #[test]
    fn a_drag_is_one_change_that_can_be_undone() {
        let rest = MotionSplines::at_rest(&[0.1], 8.0, 16);
        let mut edited = EditedMotion::new(rest.clone());
        edited.hold((0, 8));
        for change in [0.1, 0.3, 0.2] {
            edited.drag(&limits(), change, 0.5);
        }
        edited.release();
        let moved = edited.current().clone();
        let at_s = rest.time_of_point(8);
        assert!((moved.value(0, at_s, 0) - 0.3).abs() < 1e-12);
        assert!(edited.can_undo() && edited.is_changed());
        edited.undo();
        assert!(edited.current() == &rest && !edited.can_undo() && edited.can_redo());
        edited.redo();
        assert_eq!(edited.current(), &moved);
        edited.reset();
        assert_eq!(edited.current(), &rest);
        edited.undo();
        assert_eq!(edited.current(), &moved);
        // A change drops what was undone, and a click without a move is no change.
        edited.undo();
        edited.hold((0, 9));
        edited.release();
        assert!(edited.can_redo());
        edited.hold((0, 9));
        edited.drag(&limits(), -0.2, 0.5);
        edited.release();
        assert!(!edited.can_redo());
    }

    #[test]
    fn a_search_is_one_change() {
        let rest = MotionSplines::at_rest(&[0.1], 8.0, 16);
        let mut edited = EditedMotion::new(rest.clone());
        let mut found = rest.clone();
        for index in 6..9 {
            found.set_point(0, index, 0.5);
            edited.preview(found.clone());
        }
        edited.replace_since(rest.clone(), found.clone());
        edited.undo();
        assert_eq!(edited.current(), &rest);
        assert!(!edited.can_undo());
        for _ in 0..2 * MAX_CHANGES {
            edited.hold((0, 8));
            edited.drag(&limits(), 0.001, 0.5);
            edited.release();
        }
        assert_eq!(edited.before.len(), MAX_CHANGES);
    }
}
