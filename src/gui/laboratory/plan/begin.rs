//! The motion with which the editing begins: a start, or the rows of a file.

use std::sync::Arc;

use super::PlanView;
use super::edited::EditedMotion;
use crate::gui::units::fixed;
use crate::observability::laboratory::{MotionProblem, MotionStart, PLAN_DURATION_S, PLAN_KNOT_S};
use crate::simulation::{MotionSample, MotionSplines, PrescribedMotion};

/// Difference in radians or metres below which an opened motion counts as shown exactly: less than a shown digit.
const EXACT: f64 = 5e-5;

impl PlanView {
    /// Makes the initial motion, or the motion of an opened file.
    pub(super) fn make_motion(&mut self, problem: &Arc<MotionProblem>) {
        let situation = problem.situation();
        if let Some(opened) = self.opened.take() {
            match self.motion_of_file(&opened, problem) {
                Ok(motion) => {
                    self.settings.duration_s = motion.duration_s();
                    self.search = None;
                    self.before = None;
                    self.made = Some((self.settings.start, motion.duration_s()));
                    self.edited = Some(EditedMotion::new(motion));
                }
                Err(text) => self.message = Some((format!("The motion is not shown: {text}"), true)),
            }
            return;
        }
        let wanted = (self.settings.start, self.settings.duration_s);
        let fits = |edited: &EditedMotion| edited.current().joint_count() == situation.joints.len();
        let is_made = self.made.is_some_and(|(_, duration_s)| duration_s == wanted.1);
        if !is_made || !self.edited.as_ref().is_some_and(fits) {
            // The moves need a search of seconds, for which there is a button.
            let start = if wanted.0 == MotionStart::Moves { MotionStart::Waves } else { wanted.0 };
            let motion = problem.start(start, &self.settings.limits(situation), wanted.1);
            self.search = None;
            self.before = None;
            self.made = Some(wanted);
            self.edited = Some(EditedMotion::new(motion));
        }
    }

    /// Curves through the rows of a file, with points that can be dragged.
    fn motion_of_file(&mut self, file: &PrescribedMotion, problem: &MotionProblem) -> Result<MotionSplines, String> {
        file.check()?;
        let names = problem.situation().joint_names();
        let file = file.with_joints(&names)?;
        let [shortest_s, longest_s] = PLAN_DURATION_S;
        if !(shortest_s..=longest_s).contains(&file.duration_s()) {
            let given_s = fixed(file.duration_s(), 1);
            return Err(format!("it lasts {given_s} s, expected {shortest_s} to {longest_s} s"));
        }
        let motion = MotionSplines::with_knots(&file, PLAN_KNOT_S);
        let begin_s = file.samples.first().map_or(0.0, |sample| sample.time_s);
        let difference = |sample: &MotionSample| {
            let shown = motion.sample(sample.time_s - begin_s);
            let joints = shown.joints_rad.iter().zip(&sample.joints_rad).map(|(a, b)| (a - b).abs());
            let angle_rad = joints.fold((shown.heading_rad - sample.heading_rad).abs(), f64::max);
            (angle_rad, (shown.position_m - sample.position_m).amax())
        };
        let differences = file.samples.iter().map(difference);
        let (angle_rad, length_m) = differences.fold((0.0, 0.0), |a, b| (f64::max(a.0, b.0), f64::max(a.1, b.1)));
        let text = if angle_rad.max(length_m) < EXACT {
            "The curves are those of the file".to_owned()
        } else {
            format!(
                "Smoothed to a point every {PLAN_KNOT_S} s: up to {}° and {} m from the file",
                fixed(angle_rad.to_degrees(), 2),
                fixed(length_m, 3)
            )
        };
        self.message = Some((text, false));
        Ok(motion)
    }
}
