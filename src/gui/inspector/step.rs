//! The step at the cursor: state, events, iterations, times.

use egui::{RichText, Sense, Ui, vec2};

use super::rows::{ROW_HEIGHT, Row, rows_ui};
use crate::estimator::{Stage, StageTimes, StepReport};
use crate::geometry::{principal_angle, so3};
use crate::gui::PanelContext;
use crate::gui::events::{look_of, name_of, paint_mark};
use crate::gui::help::terms::{Term, frame, iterations, joints, times};
use crate::gui::table::{grid_ui, named};
use crate::gui::theme::Theme;
use crate::gui::units::{fixed, seconds, significant};
use crate::session::{RunRecord, StepRecord};

pub(super) fn frame_ui(ui: &mut Ui, ctx: &PanelContext<'_>, run: &RunRecord, step: &StepRecord) {
    let report = &step.report;
    let delay_ms = (step.log_time_ns - report.stamp_ns) as f64 * 1e-6;
    let keyframe = if report.keyframe { ", keyframe" } else { "" };
    let mut rows = vec![
        (frame::STAMP, vec![format!("{}, log time {delay_ms:+.1} ms", seconds(report.stamp_ns))]),
        (frame::PHASE, vec![format!("{}{keyframe}", report.phase.name())]),
    ];
    if report.restarts > 0 {
        rows.push((frame::RESTARTS, vec![report.restarts.to_string()]));
    }
    let [tracked, detected] = step.tracked_and_detected();
    let tracks = format!("{tracked} continued, {detected} new");
    rows.push((frame::TRACKS, vec![tracks]));
    rows_ui(ui, ctx.theme, "step", rows);
    let Some(newest) = report.newest() else { return };

    let three = |term: Term, values: [f64; 3], decimals: usize| -> Row {
        (term, values.map(|value| fixed(value, decimals)).to_vec())
    };
    let (roll, pitch, yaw) = newest.world_from_imu.rotation.euler_angles();
    let [p, v] = [newest.world_from_imu.translation_m, newest.velocity_m_per_s];
    let [a, g] = [newest.accelerometer_bias_m_per_s2, newest.gyroscope_bias_rad_per_s];
    let mut rows = vec![
        (frame::AXES, ["x", "y", "z"].map(str::to_owned).to_vec()),
        three(frame::POSITION, [p.x, p.y, p.z], 3),
        three(frame::VELOCITY, [v.x, v.y, v.z], 3),
        three(frame::ATTITUDE, [roll, pitch, yaw].map(f64::to_degrees), 2),
        three(frame::ACCELEROMETER_BIAS, [a.x, a.y, a.z], 4),
        three(frame::GYROSCOPE_BIAS, [g.x, g.y, g.z].map(f64::to_degrees), 4),
    ];
    if let (Some(alignment), Some(ground_truth)) = (run.alignment, step.ground_truth) {
        let aligned = alignment * newest.world_from_imu;
        let error = aligned.translation_m - ground_truth.translation_m;
        rows.push(three(frame::POSITION_ERROR, [error.x, error.y, error.z], 3));
        let rotation_vector = so3::log(&(ground_truth.rotation.inverse() * aligned.rotation));
        rows.push(three(
            frame::ATTITUDE_ERROR,
            [rotation_vector.x, rotation_vector.y, rotation_vector.z].map(f64::to_degrees),
            2,
        ));
    }
    rows_ui(ui, ctx.theme, "state", rows);
    if !newest.joint_angles_rad.is_empty() {
        let encoders = newest.encoder_angles_rad.as_deref();
        let rig_joints = ctx.recording.rig.gimbal.as_ref().map_or(&[][..], |gimbal| &gimbal.joints);
        let lines = newest.joint_angles_rad.iter().enumerate().map(|(number, angle)| {
            let encoder = encoders.and_then(|angles| angles.get(number)).copied().unwrap_or(f64::NAN);
            let name =
                rig_joints.get(number).map_or_else(|| format!("joint {}", number + 1), |joint| joint.name.clone());
            let shown = |angle: f64| fixed(principal_angle(angle).to_degrees(), 2);
            vec![name, shown(*angle), shown(encoder), shown(angle - encoder)]
        });
        let columns = [joints::JOINT, joints::ESTIMATE, joints::ENCODER, joints::DIFFERENCE];
        grid_ui(ui, ctx.theme, ("joints", ROW_HEIGHT), &named(&columns), lines);
    }
}

/// Lists the events of the step with the values that caused them.
pub(super) fn events_ui(ui: &mut Ui, theme: &Theme, report: &StepReport) {
    if report.events.is_empty() && report.warnings.is_empty() {
        ui.label(RichText::new("No events in this step").color(theme.text_weak));
    }
    for event in &report.events {
        ui.horizontal_top(|ui| {
            let (mark, color) = look_of(event.kind, theme);
            let (rect, _) = ui.allocate_exact_size(vec2(11.0, 14.0), Sense::hover());
            paint_mark(ui.painter(), mark, rect.center(), 8.0, color);
            let event_values = match (event.value, event.threshold) {
                (Some(value), Some(threshold)) => format!("{} / {}", significant(value), significant(threshold)),
                (Some(value), None) => significant(value),
                (None, _) => String::new(),
            };
            if !event_values.is_empty() {
                let text = RichText::new(event_values).monospace().color(theme.text_strong);
                ui.label(text).on_hover_text("Measured value / threshold; the unit is that of the message");
            }
            let text = RichText::new(&event.message).color(theme.text);
            ui.add(egui::Label::new(text).wrap()).on_hover_text(name_of(event.kind));
        });
    }
    for warning in &report.warnings {
        ui.add(egui::Label::new(RichText::new(format!("⚠ {warning}")).color(theme.warn)).wrap());
    }
}

pub(super) fn iterations_ui(ui: &mut Ui, theme: &Theme, report: &StepReport) {
    if report.iterations.is_empty() {
        ui.label(RichText::new("No solve in this step").color(theme.text_weak));
        return;
    }
    let lines = report.iterations.iter().enumerate().map(|(number, iteration)| {
        vec![
            (number + 1).to_string(),
            significant(iteration.cost_before),
            significant(iteration.cost_after),
            significant(iteration.step_norm),
            significant(iteration.damping),
            if iteration.accepted { "accepted" } else { "rejected" }.to_owned(),
        ]
    });
    let columns = [
        iterations::NUMBER,
        iterations::COST_BEFORE,
        iterations::COST_AFTER,
        iterations::STEP_NORM,
        iterations::DAMPING,
        iterations::ACCEPTED,
    ];
    grid_ui(ui, theme, ("iterations", ROW_HEIGHT), &named(&columns), lines);
}

/// Table of the stage times in milliseconds.
pub(super) fn times_ui(ui: &mut Ui, theme: &Theme, report: &StepReport) {
    let row = |(term, stage): (&Term, &Stage)| -> Row {
        (*term, vec![format!("{} ms", fixed((stage.time_ms)(&report.times), 1))])
    };
    let terms = [
        times::FRONTEND,
        times::OPTIMIZE,
        times::LINEARIZE,
        times::REPORT,
        times::MARGINALIZE,
        times::OBSERVABILITY,
        times::TOTAL,
    ];
    let rows: Vec<Row> = terms.iter().zip(&StageTimes::STAGES).map(row).collect();
    rows_ui(ui, theme, "times", rows);
}
