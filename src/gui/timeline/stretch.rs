//! Effect of a stretch of the flight on the calibration: σ before and after it, and the motion in it.

use egui::{Context, Grid, RichText, ScrollArea, Ui, pos2, vec2};

use crate::gimbal::ParameterId;
use crate::gui::PanelContext;
use crate::gui::derived::flight::DeterminationHistory;
use crate::gui::determination::look_of;
use crate::gui::units::{fixed, seconds};
use crate::observability::{Determination, information_rate};
use crate::session::{RunRecord, StepRecord};

/// Width and maximum height of the table in points.
const SIZE: [f32; 2] = [470.0, 260.0];

/// A stretch of one run, computed once.
#[derive(Debug)]
pub(super) struct TimelineStretch {
    run: u64,
    /// Number of steps of the run when the stretch was computed.
    steps: usize,
    range_ns: (i64, i64),
    rows: Vec<StretchRow>,
    motion: String,
}

/// Effect of a stretch on one parameter.
#[derive(Debug, PartialEq)]
struct StretchRow {
    parameter: ParameterId,
    /// Standard deviation before and after the stretch, and of the prior.
    before: f64,
    after: f64,
    prior: f64,
    verdict: Determination,
    /// Motion with the largest contribution to the information, and its part of the total.
    by: Option<(String, f64)>,
}

impl StretchRow {
    /// Gain in bits: one bit halves σ.
    fn bits(&self) -> f64 {
        (self.before / self.after).log2()
    }
}

impl TimelineStretch {
    /// True if the stretch belongs to this run and range, with all its steps so far.
    pub(super) fn is_of(&self, run: &RunRecord, range_ns: (i64, i64)) -> bool {
        (self.run, self.steps, self.range_ns) == (run.id, run.steps.len(), range_ns)
    }

    /// Reads a stretch of a run; `None` if it has no step or no estimated parameter.
    pub(super) fn read(
        run: &RunRecord,
        history: &DeterminationHistory,
        range_ns: (i64, i64),
        joints: &[String],
    ) -> Option<Self> {
        let first = run.index_at(range_ns.0).unwrap_or(0);
        let last = run.index_at(range_ns.1)?;
        let steps = run.steps.get(first..=last)?;
        let (begin, end) = (&steps.first()?.report.calibration, &steps.last()?.report.calibration);
        let gains = steps[1..].iter().filter_map(|step| step.gain());
        let rate = information_rate(gains);
        let sigma = |calibration: &crate::estimator::CalibrationEstimate, parameter: ParameterId| {
            let index = calibration.index_of(parameter)?;
            Some((*calibration.sigmas.get(index)?, *calibration.prior_sigmas.get(index)?))
        };
        let row = history.row_at(steps.last()?.report.stamp_ns);
        let mut rows: Vec<StretchRow> = end
            .parameters
            .iter()
            .filter_map(|parameter| {
                let parameter = *parameter;
                let verdict = history.verdict(parameter, row);
                let (after, prior) = sigma(end, parameter)?;
                // Before the first solve the prior is all that is known.
                let before = sigma(begin, parameter).map_or(prior, |(sigma, _)| sigma);
                let before = if before.is_finite() { before } else { prior };
                let by = rate.as_ref().and_then(|rate| {
                    let index = rate.parameters.iter().position(|known| known.parameter == parameter)?;
                    let (motion, part) = rate.leading(Some(index))?;
                    Some((motion.label(joints), part / rate.parameters[index].bits_per_s))
                });
                Some(StretchRow { parameter, before, after, prior, verdict, by })
            })
            .filter(|row| row.after.is_finite())
            .collect();
        rows.sort_by(|a, b| b.bits().total_cmp(&a.bits()));
        let motion = motion_text(steps.iter().map(AsRef::as_ref), joints);
        (!rows.is_empty()).then_some(Self { run: run.id, steps: run.steps.len(), range_ns, rows, motion })
    }

    /// Draws the table in a window above the lanes; returns false when it is closed.
    pub(super) fn window_ui(&self, context: &Context, ctx: &mut PanelContext<'_>, top: f32, center_x: f32) -> bool {
        let mut open = true;
        let (begin_ns, end_ns) = self.range_ns;
        let title = format!("From {} to {} s", seconds(begin_ns), seconds(end_ns));
        let place = pos2((center_x - 0.5 * SIZE[0]).max(8.0), (top - SIZE[1] - 90.0).max(40.0));
        egui::Window::new(title)
            .id(egui::Id::unique("stretch of the timeline"))
            .open(&mut open)
            .collapsible(false)
            .default_pos(place)
            .default_size(vec2(SIZE[0], SIZE[1]))
            .show(context, |ui| self.contents_ui(ui, ctx));
        open
    }

    fn contents_ui(&self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let (theme, names) = (*ctx.theme, ctx.names());
        ui.add(egui::Label::new(RichText::new(&self.motion).color(theme.text)).wrap());
        ScrollArea::vertical().max_height(SIZE[1]).show(ui, |ui| {
            Grid::new("stretch").striped(true).spacing(vec2(12.0, 1.0)).min_row_height(14.0).show(ui, |ui| {
                let heads = [
                    ("Parameter", "Click: select it in all panels"),
                    ("σ before → after", "Posterior standard deviation before and after this stretch"),
                    ("of prior", "σ over prior σ before and after, with the verdict at its end"),
                    ("bit", "One bit halves σ"),
                    ("Mostly from", "Motion with the largest part of the information gain, and its part"),
                ];
                for (head, meaning) in heads {
                    ui.label(RichText::new(head).small().color(theme.text_weak)).on_hover_text(meaning);
                }
                ui.end_row();
                for row in &self.rows {
                    let shown = row.parameter.shown();
                    let selected = ctx.selection.parameter == Some(row.parameter);
                    let name = RichText::new(names.name(row.parameter)).small();
                    if ui.selectable_label(selected, name).clicked() {
                        ctx.selection.parameter = if selected { None } else { Some(row.parameter) };
                    }
                    let number = |text: String| RichText::new(text).monospace().small().color(theme.text_strong);
                    ui.label(number(format!("{} → {}", shown.sigma(row.before), shown.sigma(row.after))));
                    let (mark, color) = look_of(row.verdict, &theme);
                    let [before, after] = [row.before, row.after].map(|sigma| fixed(sigma / row.prior, 2));
                    ui.label(number(format!("{before} → {after} {mark}")).color(color));
                    ui.label(number(fixed(row.bits(), 2)));
                    let by = row.by.as_ref().map_or_else(String::new, |(motion, part)| {
                        format!("{motion} ({} %)", fixed(100.0 * part.min(1.0), 0))
                    });
                    ui.label(RichText::new(by).small().color(theme.text));
                    ui.end_row();
                }
            });
        });
    }
}

/// Motion over some steps, by the estimate: path, speed, rotation of the vehicle and range of each joint.
fn motion_text<'a>(steps: impl Iterator<Item = &'a StepRecord>, joints: &[String]) -> String {
    let frames: Vec<_> = steps.filter_map(|step| step.report.newest()).collect();
    if frames.len() < 2 {
        return "No estimated motion".to_owned();
    }
    let pairs = || frames.windows(2).map(|pair| (pair[0].world_from_imu, pair[1].world_from_imu));
    let path_m: f64 = pairs().map(|(from, to)| (to.translation_m - from.translation_m).norm()).sum();
    let rotation_rad: f64 = pairs().map(|(from, to)| from.rotation.angle_to(&to.rotation)).sum();
    let speed = frames.iter().map(|frame| frame.velocity_m_per_s.norm()).fold(0.0, f64::max);
    let mut text = format!(
        "Vehicle: path {} m, speed up to {} m/s, rotation {}° in total",
        fixed(path_m, 2),
        fixed(speed, 2),
        fixed(rotation_rad.to_degrees(), 0)
    );
    let ranges: Vec<String> = joints
        .iter()
        .enumerate()
        .filter_map(|(joint, name)| {
            let angles = frames.iter().filter_map(|frame| frame.joint_angles_rad.get(joint).copied());
            let (low, high) =
                angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), angle| (low.min(angle), high.max(angle)));
            (low <= high).then(|| format!("{name} {}°", fixed((high - low).to_degrees(), 1)))
        })
        .collect();
    if !ranges.is_empty() {
        text.push_str(". Range of the joints: ");
        text.push_str(&ranges.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::{first_tracked_frame, sample_recording_of};

    #[test]
    fn a_stretch_has_the_sigmas_of_its_ends_and_the_motion_between() {
        let recording = sample_recording_of(first_tracked_frame() + 40, &["auto"]);
        let run = &recording.runs[0];
        let joints = recording.rig.joint_names();
        let tables = crate::gui::Selection::default().flight;
        let answer = crate::session::Answer::of_run(&recording, run);
        let history = tables.report(&Context::default(), &recording, run, &answer).history;
        let (first, last) = (first_tracked_frame() + 5, first_tracked_frame() + 30);
        let range_ns = (run.steps[first].report.stamp_ns, run.steps[last].report.stamp_ns);
        let stretch = TimelineStretch::read(run, &history, range_ns, &joints).expect("the run estimates parameters");
        assert!(stretch.is_of(run, range_ns) && !stretch.is_of(run, (0, range_ns.1)));
        let calibration = |step: usize| &run.steps[step].report.calibration;
        assert_eq!(stretch.rows.len(), calibration(last).parameters.len());
        assert!(stretch.rows.is_sorted_by(|a, b| a.bits() >= b.bits()) && stretch.rows[0].bits() > 0.1);
        for row in &stretch.rows {
            let index = calibration(last).parameters.iter().position(|it| *it == row.parameter).unwrap();
            assert_eq!(row.after, calibration(last).sigmas[index]);
            assert_eq!(row.before, calibration(first).sigmas[index]);
        }
        assert!(stretch.rows[0].by.is_some(), "{:?}", stretch.rows[0]);
        assert!(stretch.motion.contains("path ") && stretch.motion.contains(&joints[0]), "{}", stretch.motion);
        // Before the first solve the prior gives σ.
        let early = TimelineStretch::read(run, &history, (0, range_ns.1), &joints).unwrap();
        assert!(early.rows.iter().all(|row| row.before == row.prior));
        assert!(TimelineStretch::read(run, &history, (0, 1), &joints).is_none());
    }
}
