//! How the cursor of a session stops at breakpoints.

use std::sync::Arc;

use super::session::Session;
use crate::session::breakpoints::{Breakpoints, Condition, Hit};
use crate::session::record::Recording;

impl Session {
    /// Evaluates the breakpoints over the steps that are new.
    pub(in crate::session) fn evaluate_breakpoints(&mut self) {
        let recording = self.recording();
        if self.breakpoints.is_behind(&recording) {
            Arc::make_mut(&mut self.breakpoints).read(&recording);
        }
    }

    pub(in crate::session) fn change_breakpoints(&mut self, change: impl FnOnce(&mut Breakpoints)) {
        change(Arc::make_mut(&mut self.breakpoints));
        self.evaluate_breakpoints();
    }

    /// A breakpoint at the frame of the cursor, or none there any more.
    pub(in crate::session) fn toggle_breakpoint_here(&mut self) {
        let recording = self.recording();
        let here = recording.runs.iter().find_map(|run| run.step_at(self.cursor_ns));
        let text = here.map(|step| format!("frame == {}", step.report.frame_index));
        if let Some(Ok(condition)) = text.map(|text| text.parse::<Condition>()) {
            self.change_breakpoints(|all| all.toggle(condition));
        }
    }

    /// To the next or the previous hit.
    pub(in crate::session) fn run_to_breakpoint(&mut self, forward: bool) {
        self.playing = false;
        self.evaluate_breakpoints();
        let recording = self.recording();
        let all = &self.breakpoints;
        if !all.list().iter().any(|breakpoint| breakpoint.enabled) {
            self.notices.push("There is no breakpoint: set one in the breakpoints panel, or with B".to_owned());
            return;
        }
        let found = if forward {
            all.next_after(&recording, self.cursor_ns)
        } else {
            all.last_before(&recording, self.cursor_ns)
        };
        match found {
            Some(hit) => self.stop_at(&recording, hit),
            None if !forward => self.notices.push("No breakpoint was hit before this frame".to_owned()),
            None if recording.runs.iter().all(|run| run.finished) => {
                self.notices.push("No breakpoint is hit after this frame".to_owned());
            }
            None => self.running_on = true,
        }
    }

    /// Goes on to where the estimators are, until a breakpoint is hit or the log ends.
    pub(in crate::session) fn run_on(&mut self) {
        let recording = self.recording();
        if let Some(hit) = self.breakpoints.next_after(&recording, self.cursor_ns) {
            self.stop_at(&recording, hit);
            return;
        }
        self.cursor_ns = recording.computed_ns().max(self.cursor_ns);
        if recording.runs.iter().all(|run| run.finished) {
            self.running_on = false;
            self.notices.push("No breakpoint was hit up to the end of the log".to_owned());
        }
    }

    /// A cursor that played over a hit stops there.
    pub(in crate::session) fn stop_at_breakpoint(&mut self, before_ns: i64) {
        let recording = self.recording();
        let hit = self.breakpoints.next_after(&recording, before_ns);
        if let Some(hit) = hit.filter(|hit| hit.stamp_ns <= self.cursor_ns) {
            self.stop_at(&recording, hit);
        }
    }

    fn stop_at(&mut self, recording: &Recording, hit: Hit) {
        self.playing = false;
        self.running_on = false;
        self.cursor_ns = hit.stamp_ns;
        self.notices.push(format!("Breakpoint {}", self.breakpoints.describe(recording, hit)));
    }
}
