//! Draws every panel at stamps with missing data; no panel may panic. The screenshots can be kept for inspection.

use egui::Ui;

use super::rendering::headless::{HeadlessOptions, draw};
use super::samples::{rigid_recording, sample_images, sample_recording, sample_recording_of};
use super::tests::{keep_screenshot, with_context};
use super::theme::{Theme, ThemeName};
use super::{Panel as _, PanelContext, Selection};
use crate::gui::tests::parameter;
use crate::session::Recording;

const SECOND_NS: i64 = 1_000_000_000;

/// Draws a panel at a stamp and keeps the screenshot.
fn screenshot(
    name: &str,
    recording: &Recording,
    cursor_ns: i64,
    size_px: [u32; 2],
    theme: ThemeName,
    selection: &Selection,
    mut show: impl FnMut(&mut Ui, &mut PanelContext<'_>),
) {
    let mut selection = selection.clone();
    let colors = Theme::of(theme);
    let image = draw(HeadlessOptions { size_px, pixels_per_point: 1.0, theme }, |ui| {
        let frame = egui::Frame::new().fill(colors.surface).inner_margin(super::theme::PANEL_MARGIN);
        frame.show(ui, |ui| {
            with_context(recording, cursor_ns, &mut sample_images(), &mut selection, &colors, |ctx| show(ui, ctx));
        });
    });
    keep_screenshot(name, &image);
}

/// Recordings and stamps without data on which a panel may rely.
fn cases_with_missing_data() -> Vec<(&'static str, Recording, i64)> {
    let whole = sample_recording_of(70, &["auto", "classical"]);
    let mut no_runs = whole.clone();
    no_runs.runs.clear();
    let mut no_steps = whole.clone();
    for run in &mut no_steps.runs {
        run.steps.clear();
        run.alignment = None;
    }
    let mut no_ground_truth = whole.clone();
    no_ground_truth.ground_truth_rig = None;
    for run in &mut no_ground_truth.runs {
        run.alignment = None;
        for step in &mut run.steps {
            std::sync::Arc::make_mut(step).ground_truth = None;
        }
    }
    let mut rigid = rigid_recording();
    rigid.ground_truth_rig = None;
    let mut single_stamp = whole.clone();
    single_stamp.duration_ns = 0;
    let end_ns = whole.duration_ns;
    vec![
        ("no-runs", no_runs, end_ns),
        ("no-steps", no_steps, end_ns),
        ("no-truth", no_ground_truth, end_ns),
        ("rigid", rigid, end_ns),
        ("instant", single_stamp, 0),
        ("initializing", whole.clone(), SECOND_NS),
        ("before", whole.clone(), -5),
        ("after", whole, 9 * end_ns),
    ]
}

/// Draws a panel normally, then for every case in large and tiny sizes.
fn check<P: Default>(name: &str, size_px: [u32; 2], mut ui: impl FnMut(&mut P, &mut Ui, &mut PanelContext<'_>)) {
    let recording = sample_recording();
    let selection = Selection { parameter: Some(parameter("L2.alpha")), ..Selection::default() };
    let second = Selection { run: 1, ..Selection::default() };
    let mut shown = |file: &str, cursor_ns: i64, size_px: [u32; 2], theme: ThemeName, selection: &Selection| {
        let mut panel = P::default();
        screenshot(&format!("{name}-{file}"), &recording, cursor_ns, size_px, theme, selection, |panel_ui, ctx| {
            ui(&mut panel, panel_ui, ctx);
        });
    };
    shown("dark", 5 * SECOND_NS, size_px, ThemeName::Dark, &selection);
    shown("light", 5 * SECOND_NS, size_px, ThemeName::Light, &selection);
    shown("print", 5 * SECOND_NS, size_px, ThemeName::Print, &second);
    shown("second", 3 * SECOND_NS, size_px, ThemeName::Dark, &second);
    shown("tiny", 5 * SECOND_NS, [90, 40], ThemeName::Dark, &selection);
    for (case, recording, cursor_ns) in cases_with_missing_data() {
        let mut panel = P::default();
        let file = format!("{name}-{case}");
        screenshot(&file, &recording, cursor_ns, size_px, ThemeName::Dark, &Selection::default(), |panel_ui, ctx| {
            ui(&mut panel, panel_ui, ctx);
        });
    }
}

#[test]
fn convergence_is_drawn_in_every_case() {
    check("convergence", [1400, 420], super::convergence::ConvergencePanel::ui);
}

#[test]
fn the_calibration_table_is_drawn_in_every_case() {
    check("calibration", [1000, 420], super::calibration::CalibrationPanel::ui);
    check("calibration-narrow", [500, 420], super::calibration::CalibrationPanel::ui);
}

#[test]
fn rank_is_drawn_in_every_case() {
    check("rank", [480, 520], super::rank::RankPanel::ui);
}

#[test]
fn the_jacobian_is_drawn_in_every_case() {
    check("jacobian", [900, 520], super::jacobian::JacobianPanel::ui);
}

#[test]
fn parameters_of_sensors_are_drawn_in_groups() {
    let recording = super::samples::sensor_recording();
    let end_ns = recording.last_stamp_ns();
    let selection = Selection { parameter: Some(parameter("readout")), ..Selection::default() };
    let mut rank = super::rank::RankPanel::default();
    let mut jacobian = super::jacobian::JacobianPanel::default();
    let draw = |name: &str, show: &mut dyn FnMut(&mut Ui, &mut PanelContext<'_>)| {
        screenshot(name, &recording, end_ns, [1366, 768], ThemeName::Dark, &selection, show);
    };
    draw("rank-groups", &mut |ui, ctx| rank.ui(ui, ctx));
    draw("jacobian-groups", &mut |ui, ctx| jacobian.ui(ui, ctx));
}

#[test]
fn residuals_are_drawn_in_every_case() {
    check("residuals", [480, 420], super::residuals::ResidualsPanel::ui);
}

#[test]
fn the_window_is_drawn_in_every_case() {
    use super::window::{MainWindow, Preset, window_ui};
    check("window", [1920, 1080], |state: &mut MainWindow, ui, ctx| window_ui(ui, state, ctx));
    check("window-small", [1366, 768], |state: &mut MainWindow, ui, ctx| window_ui(ui, state, ctx));
    for preset in [Preset::Calibration, Preset::FrontEnd, Preset::Scene] {
        let mut state = MainWindow::default();
        state.tiles.arrange(preset);
        let (recording, selection) = (sample_recording(), Selection::default());
        let name = format!("window-{preset:?}");
        screenshot(&name, &recording, 5 * SECOND_NS, [1920, 1080], ThemeName::Dark, &selection, |ui, ctx| {
            window_ui(ui, &mut state, ctx);
        });
    }
}

#[test]
fn the_timeline_is_drawn_in_every_case() {
    check("timeline", [1900, 190], super::timeline::TimelinePanel::ui);
}

#[test]
fn the_inspector_is_drawn_in_every_case() {
    check("inspector", [480, 700], |panel: &mut super::inspector::InspectorPanel, ui, ctx| {
        let run = ctx.recording.runs.first();
        let step = run.and_then(|run| run.step_at(ctx.cursor_ns));
        ctx.selection.feature = step.and_then(|step| Some(step.report.features.first()?.id));
        panel.ui(ui, ctx);
    });
}
