//! Errors of runs against the ground truth over time, with their 3σ.

use std::ops::RangeInclusive;

use egui::containers::scroll_area::ScrollAreaOutput;
use egui::{ScrollArea, Ui};
use nalgebra::Vector3;

use super::columns::label_of;
use super::row::{Line, LineCurves, MIN_HEIGHT, Row, row_ui};
use crate::estimator::StepReport;
use crate::geometry::{RigidTransform, so3, wrap_angle};
use crate::gimbal::ClassicalChain;
use crate::gui::PanelContext;
use crate::gui::units::{fixed, significant};
use crate::session::{RunRecord, StepRecord};

/// Range of the row height in points, in the window and in a figure.
const HEIGHTS: RangeInclusive<f32> = MIN_HEIGHT..=120.0;
const FIGURE_HEIGHTS: RangeInclusive<f32> = MIN_HEIGHT..=260.0;

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
/// Number of the first rows that are errors against the ground truth.
const ERRORS: usize = 5;
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Values of one run over time; recomputed when the run has new steps or another alignment.
#[derive(Debug, Default)]
struct RunErrors {
    of: Option<(u64, usize, Option<RigidTransform>)>,
    /// Changes when rows are removed.
    epoch: u64,
    stamps_ns: Vec<i64>,
    columns: [Vec<f64>; ROWS.len()],
    /// 3σ by frame, of the rows that have one.
    bounds: [Vec<f64>; ROWS.len()],
}

impl RunErrors {
    fn read(&mut self, run: &RunRecord, true_chain: Option<&ClassicalChain>) {
        let of = Some((run.id, run.steps.len(), run.alignment));
        if self.of == of {
            return;
        }
        self.of = of;
        self.epoch += 1;
        self.stamps_ns.clear();
        self.columns.iter_mut().chain(&mut self.bounds).for_each(Vec::clear);
        for step in &run.steps {
            self.stamps_ns.push(step.report.stamp_ns);
            let values = values_of(step, run.alignment.as_ref(), true_chain);
            for (column, value) in self.columns.iter_mut().zip(values) {
                column.push(value.unwrap_or(f64::NAN));
            }
            for (bounds, bound) in self.bounds.iter_mut().zip(bounds_of(step)) {
                bounds.push(bound.unwrap_or(f64::NAN));
            }
        }
    }
}

/// Values of all runs with their cached curves.
#[derive(Debug, Default)]
pub(super) struct Errors {
    runs: Vec<RunErrors>,
    curves: [Vec<LineCurves>; ROWS.len()],
}

impl Errors {
    /// Takes over the new steps of the runs.
    pub(super) fn read(&mut self, ctx: &PanelContext<'_>) {
        let true_rig = ctx.recording.ground_truth_rig.as_ref();
        self.runs.resize_with(ctx.recording.runs.len(), RunErrors::default);
        for (errors, run) in self.runs.iter_mut().zip(&ctx.recording.runs) {
            errors.read(run, true_rig.and_then(|rig| rig.chain_of_camera(&run.camera_key)).as_ref());
        }
    }

    /// Number of rows with values.
    pub(super) fn row_count(&self) -> usize {
        (0..ROWS.len()).filter(|index| self.has_row(*index)).count()
    }

    /// True if a run has an error against the ground truth.
    pub(super) fn has_ground_truth(&self) -> bool {
        self.has_row(0) || self.has_row(3)
    }

    fn has_row(&self, index: usize) -> bool {
        self.runs.iter().any(|run| is_known(&run.columns[index]))
    }

    /// Draws the errors at heights that fill the panel, in a list that scrolls if they are too many; `None` without
    /// ground truth.
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) -> Option<ScrollAreaOutput<()>> {
        let rows = (0..ERRORS).filter(|index| self.has_row(*index)).count();
        if rows == 0 {
            super::empty_ui(ui, "No ground truth");
            return None;
        }
        let heights = if ctx.presentation.is_figure() { FIGURE_HEIGHTS } else { HEIGHTS };
        let height = (ui.available_height() / rows as f32 - 3.0).clamp(*heights.start(), *heights.end());
        let list = ScrollArea::vertical().id_salt("errors over time").auto_shrink(false);
        Some(list.show(ui, |ui| self.rows_ui(ui, ctx, ERRORS, height)))
    }

    /// Draws all rows with values, each `height` points high.
    pub(super) fn all_rows_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, height: f32) {
        self.rows_ui(ui, ctx, ROWS.len(), height);
    }

    fn rows_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, count: usize, height: f32) {
        ui.spacing_mut().item_spacing.y = 3.0;
        for index in 0..count {
            if self.has_row(index) {
                self.row_ui(ui, ctx, index, height);
            }
        }
    }

    fn row_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, index: usize, height: f32) {
        let (name, unit, factor, meaning) = ROWS[index];
        let with_unit = |value: f64| {
            let number = if unit.is_empty() { fixed(value, 0) } else { significant(value * factor) };
            let space = if unit.starts_with('°') || unit.is_empty() { "" } else { " " };
            format!("{number}{space}{unit}")
        };
        let alone = self.runs.len() == 1;
        let lines = self.runs.iter().enumerate().map(|(run, errors)| {
            let row_at = ctx.recording.runs[run].index_at(ctx.cursor_ns);
            let at_cursor = |column: &[f64]| {
                row_at.and_then(|row| column.get(row)).copied().filter(|value| value.is_finite()).map(with_unit)
            };
            let (values, bound) = (errors.columns[index].as_slice(), errors.bounds[index].as_slice());
            let label = if alone { String::new() } else { format!("{} ", label_of(ctx.recording, run)) };
            // In a figure the texts are mainly the legend of the runs.
            let bound_text = at_cursor(bound).filter(|_| alone || !ctx.presentation.is_figure());
            let bound_text = bound_text.map_or_else(String::new, |text| format!(", 3σ {text}"));
            Line {
                run,
                epoch: errors.epoch,
                stamps_ns: &errors.stamps_ns,
                values,
                bound: if is_known(bound) { bound } else { &[] },
                text: at_cursor(values).map(|text| format!("{label}{text}{bound_text}")),
                mark_ns: None,
            }
        });
        let lines: Vec<Line<'_>> = lines.collect();
        let row = Row {
            name,
            unit,
            factor,
            threshold: None,
            min_high: 1e-9,
            steps: unit.is_empty(),
            id: index,
            label: &format!("{name} over time"),
            hover: meaning,
        };
        let curves = &mut self.curves[index];
        curves.resize_with(lines.len(), LineCurves::default);
        row_ui(ui, ctx, &row, &lines, curves, height);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn errors_are_those_of_the_run() {
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
    }
}
