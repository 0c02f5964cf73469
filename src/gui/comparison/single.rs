//! The panel with one run: its errors over time, and suggested runs for a comparison.

use egui::{Button, Label, Rect, RichText, ScrollArea, Ui, UiBuilder, WidgetInfo, vec2};

use nalgebra::Vector3;

use super::numbers;
use super::row::{Bound, Line, MIN_HEIGHT, Row, row_ui};
use super::scores::Scores;
use crate::estimator::StepReport;
use crate::geometry::{RigidTransform, so3, wrap_angle};
use crate::gimbal::ClassicalChain;
use crate::gui::plot::Curve;
use crate::gui::units::{fixed, significant};
use crate::gui::{Dialog, PanelContext};
use crate::sensors::{CameraMount, Rig};
use crate::session::{Command, RunRecord, RunSpec, StepRecord};

/// Panel width in points from which the errors over time are shown to the right of the numbers.
const MIN_WIDTH_FOR_BOTH: f32 = 700.0;
/// Range of the row height in points.
const HEIGHTS: std::ops::RangeInclusive<f32> = MIN_HEIGHT..=120.0;

/// Values over time: name, shown unit, factor from the stored unit, definition.
const ROWS: [(&str, &str, f64, &str); 8] = [
    (
        "position error",
        "m",
        1.0,
        "Distance to the ground truth after alignment in yaw and position; dashed: 3σ relative to the first estimated frame",
    ),
    ("attitude error", "°", DEGREES, "Angle to the attitude of the ground truth after alignment in yaw"),
    (
        "tilt error",
        "°",
        DEGREES,
        "Angle between the verticals of estimate and ground truth (roll and pitch), which needs no alignment; dashed: 3σ",
    ),
    ("extrinsics error", "mm", 1e3, "Translation error of imu_from_camera at the joint angles of the frame"),
    ("extrinsics error", "°", DEGREES, "Rotation error of imu_from_camera at the joint angles of the frame"),
    ("joint angles − encoders", "°", DEGREES, "Largest difference of an estimated joint angle from its encoder"),
    ("reprojection RMS", "px", 1.0, "Reprojection RMS after the solve (reprojection_rms_after_px of frames.csv)"),
    ("informed rank", "", 1.0, "Informed rank of the calibration (rank.csv)"),
];
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Suggested runs for a comparison: specification as on the command line, and purpose.
const OFFERS: [(&str, &str); 5] = [
    ("classical", "redundant directions of the classical parameterization"),
    ("auto:encoder=off", "contribution of the encoder readings"),
    ("auto:calibrate=off", "gain of the online calibration over the rig's values"),
    ("static", "accuracy of the rig's rigid camera, without the gimbal"),
    ("auto:first-estimates=off", "spurious information that first-estimate Jacobians avoid"),
];

const PREVIEW: &str = "Two to four runs share log, tracks and cursor. Shown are the accuracy of each with the best of each row \
    marked, the first difference and the first notable divergence of 14 quantities, differences over time, images and \
    scenes side by side, and lost directions with common rows.";

/// Values of the run over time; recomputed when the run has new steps or another alignment.
#[derive(Debug, Default)]
pub(super) struct Single {
    of: Option<(u64, usize, Option<RigidTransform>)>,
    /// Changes when rows are removed.
    epoch: u64,
    stamps_ns: Vec<i64>,
    columns: [Vec<f64>; ROWS.len()],
    curves: [Curve; ROWS.len()],
    /// 3σ by frame, of the rows that have one.
    bounds: [Vec<f64>; ROWS.len()],
    bound_curves: [Curve; ROWS.len()],
}

impl Single {
    /// Draws suggestions, numbers and errors over time. Returns the requested dialog.
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, scores: &Scores) -> Option<Dialog> {
        const GAP: f32 = 12.0;
        let run = ctx.recording.runs.first()?;
        self.read(ctx, run);
        let all = ui.available_rect_before_wrap();
        ui.advance_cursor_after_rect(all);
        let wide = all.width() >= MIN_WIDTH_FOR_BOTH;
        let (left, right) = all.split_left_right_at_fraction(if wide { 0.46 } else { 1.0 });
        let mut asked = None;
        let mut at = |rect: Rect, draw: &mut dyn FnMut(&mut Ui)| {
            ui.scope_builder(UiBuilder::new().max_rect(rect), |ui| {
                ui.set_clip_rect(ui.clip_rect().intersect(rect));
                draw(ui);
            });
        };
        let own = if wide { left.with_max_x(left.right() - GAP) } else { left };
        at(own, &mut |ui| {
            ScrollArea::vertical().id_salt("offers").auto_shrink(false).show(ui, |ui| {
                if !ctx.presentation.is_figure() {
                    asked = offers_ui(ui, ctx, run);
                    ui.add_space(6.0);
                }
                numbers::accuracy_ui(ui, ctx, scores);
                if !wide {
                    ui.add_space(6.0);
                    self.over_time_ui(ui, ctx, run, *HEIGHTS.start());
                }
            });
        });
        if wide {
            at(right, &mut |ui| {
                let known = self.columns.iter().filter(|column| is_known(column)).count().max(1);
                let height = (ui.available_height() - 20.0) / known as f32 - 3.0;
                ScrollArea::vertical().id_salt("over time").auto_shrink(false).show(ui, |ui| {
                    self.over_time_ui(ui, ctx, run, height.clamp(*HEIGHTS.start(), *HEIGHTS.end()));
                });
            });
        }
        asked
    }

    fn over_time_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord, height: f32) {
        let with_ground_truth = is_known(&self.columns[0]) || is_known(&self.columns[3]);
        let title = if with_ground_truth {
            format!("Errors over time, against the {}", ctx.recording.truth_name())
        } else {
            "Values over time".to_owned()
        };
        ui.label(RichText::new(title).color(ctx.theme.text_strong));
        ui.spacing_mut().item_spacing.y = 3.0;
        let row_at = run.index_at(ctx.cursor_ns);
        for (index, (name, unit, factor, meaning)) in ROWS.into_iter().enumerate() {
            let column = &self.columns[index];
            if !is_known(column) {
                continue;
            }
            let value = row_at.and_then(|row| column.get(row)).copied().filter(|value| value.is_finite());
            let with_unit = |value: f64| {
                let decimals = unit.is_empty();
                let number = if decimals { fixed(value, 0) } else { significant(value * factor) };
                let space = if unit.starts_with('°') || unit.is_empty() { "" } else { " " };
                format!("{number}{space}{unit}")
            };
            let text = value.map(with_unit);
            let values = &self.bounds[index];
            let bound = is_known(values).then(|| Bound {
                values,
                curve: &mut self.bound_curves[index],
                text: row_at
                    .and_then(|row| values.get(row))
                    .filter(|value| value.is_finite())
                    .map(|value| format!("3σ {}", with_unit(*value))),
            });
            let row = Row {
                name,
                unit,
                factor,
                threshold: None,
                bound,
                min_high: 1e-9,
                steps: unit.is_empty(),
                id: index,
                label: &format!("{name} over time"),
                hover: meaning,
            };
            let line = Line {
                run: ctx.selection.run,
                epoch: self.epoch,
                stamps_ns: &self.stamps_ns,
                values: column,
                text,
                mark_ns: None,
            };
            row_ui(ui, ctx, row, &[line], std::slice::from_mut(&mut self.curves[index]), height);
        }
    }

    fn read(&mut self, ctx: &PanelContext<'_>, run: &RunRecord) {
        let of = Some((run.id, run.steps.len(), run.alignment));
        if self.of == of {
            return;
        }
        self.of = of;
        self.epoch += 1;
        self.stamps_ns.clear();
        self.columns.iter_mut().chain(&mut self.bounds).for_each(Vec::clear);
        let true_rig = ctx.recording.ground_truth_rig.as_ref();
        let true_chain = true_rig.and_then(|rig| rig.chain_of_camera(&run.camera_key));
        for step in &run.steps {
            self.stamps_ns.push(step.report.stamp_ns);
            let values = values_of(step, run.alignment.as_ref(), true_chain.as_ref());
            for (column, value) in self.columns.iter_mut().zip(values) {
                column.push(value.unwrap_or(f64::NAN));
            }
            for (bounds, bound) in self.bounds.iter_mut().zip(bounds_of(step)) {
                bounds.push(bound.unwrap_or(f64::NAN));
            }
        }
    }
}

/// 3σ of a step in the order of [`ROWS`]; `None` where a row has none.
fn bounds_of(step: &StepRecord) -> [Option<f64>; ROWS.len()] {
    let pose = step.report.newest().zip(step.report.newest_pose_covariance);
    let position_m = pose.map(|(_, covariance)| 3.0 * covariance.position_sigma_m());
    let tilt_rad = pose.map(|(newest, covariance)| 3.0 * covariance.tilt_sigma_rad(&newest.world_from_imu.rotation));
    [position_m, None, tilt_rad, None, None, None, None, None]
}

fn is_known(column: &[f64]) -> bool {
    column.iter().any(|value| value.is_finite())
}

/// Values of a step in the order of [`ROWS`]; `None` where the step has none.
fn values_of(
    step: &StepRecord,
    alignment: Option<&RigidTransform>,
    true_chain: Option<&ClassicalChain>,
) -> [Option<f64>; ROWS.len()] {
    let newest = step.report.newest();
    let pose = newest.zip(alignment).zip(step.ground_truth).map(|((newest, alignment), ground_truth)| {
        let aligned = *alignment * newest.world_from_imu;
        let rotation = ground_truth.rotation.inverse() * aligned.rotation;
        let vertical = |pose: &RigidTransform| pose.rotation.inverse() * Vector3::z();
        let tilt_rad = vertical(&aligned).cross(&vertical(&ground_truth)).norm().min(1.0).asin();
        [(aligned.translation_m - ground_truth.translation_m).norm(), so3::log(&rotation).norm(), tilt_rad]
    });
    let matching = newest.zip(true_chain).filter(|(newest, chain)| newest.joint_angles_rad.len() == chain.links.len());
    let chain = matching.map(|(newest, chain)| {
        let error = chain.imu_from_camera(&newest.joint_angles_rad).inverse() * newest.imu_from_camera;
        (error.translation_m.norm(), so3::log(&error.rotation).norm())
    });
    [
        pose.map(|[position_m, ..]| position_m),
        pose.map(|[_, attitude_rad, _]| attitude_rad),
        pose.map(|[.., tilt_rad]| tilt_rad),
        chain.map(|(translation_m, _)| translation_m),
        chain.map(|(_, rotation_rad)| rotation_rad),
        encoder_difference_rad(&step.report),
        newest.map(|_| step.report.reprojection_rms_after_px),
        step.rank.as_ref().filter(|rank| !rank.parameters.is_empty()).map(|rank| rank.rank_informed as f64),
    ]
}

/// Largest difference of an estimated joint angle from its encoder reading.
fn encoder_difference_rad(report: &StepReport) -> Option<f64> {
    let newest = report.newest()?;
    let encoders = newest.encoder_angles_rad.as_ref()?;
    let differences = newest.joint_angles_rad.iter().zip(encoders).map(|(angle, read)| wrap_angle(angle - read).abs());
    differences.reduce(f64::max)
}

/// Lists runs that a click adds, and the dialogs for others.
fn offers_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord) -> Option<Dialog> {
    let theme = *ctx.theme;
    let mut asked = None;
    ui.label(RichText::new("Nothing to compare yet: add a run or fork this one").color(theme.text_strong));
    for (text, question) in OFFERS {
        let Some(spec) = offered(text, &ctx.recording.rig, run) else { continue };
        ui.horizontal(|ui| {
            let button = ui.add(Button::new(format!("Add {text}")).min_size(vec2(182.0, 20.0)));
            button.widget_info(|| WidgetInfo::labeled(egui::Role::Button, true, format!("Add run {text}")));
            if button.on_hover_text(format!("--run {text}")).clicked() {
                ctx.commands.push(Command::AddRun(spec));
            }
            ui.add(Label::new(RichText::new(question).color(theme.text)).wrap());
        });
    }
    ui.horizontal(|ui| {
        for (text, dialog, hover) in [
            ("Add another run…", Dialog::AddRun, "Choose parameterization and options (A)"),
            ("Fork at the cursor…", Dialog::Fork, "Continue from this frame with changes, as a new run (F)"),
        ] {
            if ui.button(text).on_hover_text(hover).clicked() {
                asked = Some(dialog);
            }
        }
    });
    ui.add(Label::new(RichText::new(PREVIEW).color(theme.text_weak)).wrap());
    asked
}

/// Specification of a suggested run; `None` if the log lacks its inputs or if it equals `run`.
fn offered(text: &str, rig: &Rig, run: &RunRecord) -> Option<RunSpec> {
    let spec: RunSpec = text.parse().ok()?;
    let has_encoders = rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.encoder_sigma_rad.is_some());
    let has_static = rig.cameras.iter().any(|camera| matches!(camera.mount, CameraMount::Static { .. }));
    let possible = match text {
        "static" => has_static && rig.gimbal.is_some(),
        "auto:encoder=off" => has_encoders,
        "classical" => rig.gimbal.is_some(),
        _ => true,
    };
    (possible && spec.to_string() != run.spec.to_string()).then_some(spec)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn errors_are_those_of_the_run_and_offers_fit_the_rig() {
        let recording = sample_recording_of(120, &["auto"]);
        let run = &recording.runs[0];
        let true_chain = recording.ground_truth_rig.as_ref().unwrap().chain_of_camera(&run.camera_key);
        let step = run.steps.last().unwrap();
        let values = values_of(step, run.alignment.as_ref(), true_chain.as_ref());
        let newest = step.report.newest().unwrap();
        let aligned = run.alignment.unwrap() * newest.world_from_imu;
        let error_m = (aligned.translation_m - step.ground_truth.unwrap().translation_m).norm();
        assert_eq!(values[0], Some(error_m));
        assert!(values[3].unwrap() > 0.0 && values[6] == Some(step.report.reprojection_rms_after_px));
        // The tilt is part of the attitude error, and below the 3σ of the tilt.
        let bounds = bounds_of(step);
        assert!(values[2].unwrap() <= values[1].unwrap() && values[2] < bounds[2], "{values:?} {bounds:?}");
        assert!(bounds[0].unwrap() > 0.0 && bounds[1].is_none());
        let alone = values_of(step, None, None);
        assert!(alone[..5].iter().all(Option::is_none) && alone[6].is_some());

        for (text, _) in OFFERS {
            assert!(text.parse::<RunSpec>().is_ok(), "{text}");
        }
        assert!(offered("classical", &recording.rig, run).is_some());
        let mut rigid = (*recording.rig).clone();
        rigid.gimbal = None;
        assert!(offered("classical", &rigid, run).is_none() && offered("auto:encoder=off", &rigid, run).is_none());
        let classical = sample_recording_of(60, &["classical"]);
        assert!(offered("classical", &classical.rig, &classical.runs[0]).is_none());
    }
}
